//! What a chat shows of a link to a replay: a title, the result, and a picture of the end of the game.
//! The document of the page gets them as Open Graph tags (ogp.me). The record comes from
//! `RecordService.GetRecord` of this server, called without a token: so only what everybody with the
//! link may read is shown, within the limits of the caller's address.

use std::sync::LazyLock;

use bytes::Bytes;
use chefshat_proto::v1::{self, record_line::Line, record_service_client::RecordServiceClient};
use chefshat_record::outcome::outcome;
use chefshat_render::{Painter, Perspective, last_scene};
use chefshat_room::ids::Id;
use http::uri::{Authority, Scheme};
use http::{Extensions, Request, Uri, header};
use minijinja::{AutoEscape, Environment, Value, context};
use tokio::sync::Semaphore;
use tonic::body::Body;
use tonic::client::GrpcService;
use tonic::metadata::MetadataMap;

/// Most lines of a record that is shown: a game of some hundred Shifts.
const MAX_LINES: usize = 50_000;
/// Width of a picture, in pixels.
const WIDTH: u32 = 1200;
/// How a proxy that ends TLS says so.
const FORWARDED_PROTO: &str = "x-forwarded-proto";
/// The tags of a replay.
const TAGS: &str = include_str!("preview.html");

/// Draws all pictures, one at a time: they are large, and nobody waits for them at a table.
static PAINTER: LazyLock<Painter> = LazyLock::new(Painter::new);
static PAINTING: Semaphore = Semaphore::const_new(1);

/// What a path shows of a game.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Link<'a> {
    /// The page of its replay.
    Replay(&'a str),
    /// The picture of its end.
    Picture(&'a str),
}

impl<'a> Link<'a> {
    /// What a path names, if it is the replay of a game.
    pub(super) fn of(path: &'a str) -> Option<Self> {
        let name = path.strip_prefix("/replay/")?;
        let (game, link) = match name.strip_suffix(".png") {
            Some(game) => (game, Self::Picture(game)),
            None => (name, Self::Replay(name)),
        };
        Id::parse(game).map(|_| link)
    }

    /// The game.
    pub(super) fn game(self) -> &'a str {
        match self {
            Self::Replay(game) | Self::Picture(game) => game,
        }
    }
}

/// The record of a game, if everybody may read it and it is not too long.
pub(super) async fn record<S>(
    services: S,
    game: &str,
    extensions: Extensions,
) -> Option<Vec<v1::RecordLine>>
where
    S: GrpcService<Body>,
    S::ResponseBody: http_body::Body<Data = Bytes> + Send + 'static,
    <S::ResponseBody as http_body::Body>::Error:
        Into<Box<dyn std::error::Error + Send + Sync>> + Send,
{
    let mut service = RecordServiceClient::with_origin(services, Uri::from_static("http://page"));
    let message = v1::GetRecordRequest {
        game_id: game.to_owned(),
    };
    let request = tonic::Request::from_parts(MetadataMap::new(), extensions, message);
    let mut responses = service.get_record(request).await.ok()?.into_inner();
    let mut lines = Vec::new();
    while let Some(response) = responses.message().await.ok()? {
        lines.extend(response.lines);
        if lines.len() > MAX_LINES {
            return None;
        }
    }
    Some(lines)
}

/// The document with the tags of a game. `origin`: where this server is reached.
pub(super) fn document(document: &[u8], lines: &[v1::RecordLine], origin: &str) -> Option<Bytes> {
    let document = std::str::from_utf8(document).ok()?;
    let (head, rest) = document.split_once("</head>")?;
    let Some(Line::Header(header)) = lines.first().and_then(|line| line.line.as_ref()) else {
        return None;
    };
    let mut environment = Environment::new();
    environment.set_auto_escape_callback(|_| AutoEscape::Html);
    let tags = context! {
        room => header.room_name.as_str(),
        result => result(lines),
        origin => Value::from_safe_string(origin.to_owned()),
        game => header.game_id.as_str(),
    };
    let tags = environment.render_str(TAGS, tags).ok()?;
    Some(format!("{head}{tags}</head>{rest}").into())
}

/// The result of a game in words.
fn result(lines: &[v1::RecordLine]) -> String {
    let Ok(outcome) = outcome(lines) else {
        return "The game ended without a result.".into();
    };
    let mut seats = outcome.seats;
    seats.sort_by_key(|seat| seat.statistics.place);
    let places: Vec<_> = (seats.iter().map(|seat| (&seat.name, &seat.statistics)))
        .map(|(name, it)| format!("{}. {name} ({} points)", it.place, it.points))
        .collect();
    places.join(" · ")
}

/// The picture of the end of a game, as PNG.
pub(super) async fn picture(lines: Vec<v1::RecordLine>) -> Option<Bytes> {
    let place = PAINTING.acquire().await.ok()?;
    let painting = move || {
        let _place = place;
        let scene = last_scene(&lines, Perspective::All).ok()?;
        let pixels = PAINTER.pixels(&PAINTER.table(&scene), WIDTH).ok()?;
        PAINTER.png(&pixels).ok()
    };
    let painted = tokio::task::spawn_blocking(painting).await;
    painted.ok().flatten().map(Bytes::from)
}

/// Where a client reaches this server; `None` if it does not say. Has no characters that HTML escapes.
pub(super) fn origin<B>(request: &Request<B>, tls: bool) -> Option<String> {
    let named = || {
        let host = request.headers().get(header::HOST)?;
        Authority::try_from(host.as_bytes()).ok()
    };
    let authority = request.uri().authority().cloned().or_else(named)?;
    let forwarded = request.headers().get(FORWARDED_PROTO);
    let scheme = match tls || forwarded.is_some_and(|it| it == Scheme::HTTPS.as_str()) {
        true => Scheme::HTTPS,
        false => Scheme::HTTP,
    };
    Some(format!("{scheme}://{authority}"))
}

#[cfg(test)]
mod tests {
    use chefshat_proto::v1::game_event::Kind;

    use super::*;

    const GAME: &str = "0123456789abcdef0123456789abcdef";

    fn record(name: &str, kind: Kind) -> Vec<v1::RecordLine> {
        let seat = |name: &str| v1::Participant {
            name: name.into(),
            ..v1::Participant::default()
        };
        let header = v1::RecordHeader {
            game_id: GAME.into(),
            room_name: "Friday <evening>".into(),
            seats: vec![seat("Gustav"), seat(name)],
            ..v1::RecordHeader::default()
        };
        let event = v1::GameEvent {
            kind: Some(kind),
            ..v1::GameEvent::default()
        };
        let mut footer = v1::RecordFooter::default();
        footer.set_state(match &event.kind {
            Some(Kind::GameEnded(_)) => v1::RoomState::Finished,
            _ => v1::RoomState::Aborted,
        });
        [
            Line::Header(header),
            Line::Event(event),
            Line::Footer(footer),
        ]
        .map(|line| v1::RecordLine { line: Some(line) })
        .into()
    }

    fn standing(seat: u32, points: u64, place: u32) -> v1::Standing {
        v1::Standing {
            seat,
            points,
            place,
        }
    }

    #[test]
    fn only_the_replay_of_a_game_is_previewed() {
        let path = format!("/replay/{GAME}");
        assert_eq!(Link::of(&path), Some(Link::Replay(GAME)));
        let picture = format!("{path}.png");
        assert_eq!(Link::of(&picture), Some(Link::Picture(GAME)));
        for other in [
            "/",
            "/replay",
            "/replay/0123",
            "/rooms/0123",
            "/replay/a.png",
        ] {
            assert_eq!(Link::of(other), None, "{other}");
        }
    }

    #[test]
    fn the_document_names_the_room_and_the_result_and_escapes_them() {
        let ended = v1::GameEnded {
            standings: vec![standing(1, 12, 1), standing(0, 3, 2)],
            ..v1::GameEnded::default()
        };
        let lines = record("\"><script>", Kind::GameEnded(ended.into()));
        let page = b"<html><head><title>t</title></head><body></body></html>";
        let made = document(page, &lines, "https://chef.example.org").expect("a document");
        let made = String::from_utf8(made.into()).expect("text");
        assert!(made.starts_with("<html><head><title>t</title>\n"), "{made}");
        assert!(made.ends_with("</head><body></body></html>"), "{made}");
        let picture = format!("content=\"https://chef.example.org/replay/{GAME}.png\"");
        for part in [
            "Friday &lt;evening&gt;",
            "1. &quot;&gt;&lt;script&gt; (12 points) · 2. Gustav (3 points)",
            &picture,
        ] {
            assert!(made.contains(part), "{part} in {made}");
        }
        assert!(!made.contains("<script"), "{made}");
    }

    #[test]
    fn a_game_without_a_result_says_so() {
        let lines = record("Rosa", Kind::GameAborted(Box::default()));
        let made = document(b"<head></head>", &lines, "http://127.0.0.1:1").expect("a document");
        let made = String::from_utf8(made.into()).expect("text");
        assert!(made.contains("The game ended without a result."), "{made}");
    }

    #[test]
    fn the_origin_is_what_the_client_has_asked() {
        let request = |headers: &[(&str, &str)]| {
            let mut request = Request::get("/replay/x");
            for (name, value) in headers {
                request = request.header(*name, *value);
            }
            request.body(()).expect("a request")
        };
        let host = ("host", "chef.example.org:8443");
        for (headers, tls, expected) in [
            (&[host][..], false, Some("http://chef.example.org:8443")),
            (&[host], true, Some("https://chef.example.org:8443")),
            (
                &[host, (FORWARDED_PROTO, "https")],
                false,
                Some("https://chef.example.org:8443"),
            ),
            (&[], true, None),
            (&[("host", "\"><script>")], true, None),
        ] {
            assert_eq!(origin(&request(headers), tls).as_deref(), expected);
        }
    }
}
