//! What a chat shows of a link to a replay: a title, the result, and a picture of the end of the game.
//! The document of the page gets them as Open Graph tags (ogp.me). The record comes from
//! `RecordService.GetRecord` of this server, called without a token: so only what everybody with the
//! link may read is shown, within the limits of the caller's address.
//!
//! Records are large and pictures take long, so few are read at a time, for callers in turns, and
//! what was made of a game is kept for those that ask next.

use std::path::Path;
use std::process::Stdio;
use std::sync::Arc;
use std::time::Duration;

use bytes::Bytes;
use chefshat_proto::v1::{self, record_line::Line, record_service_client::RecordServiceClient};
use chefshat_record::jsonl;
use chefshat_record::outcome::outcome;
use chefshat_room::ids::{GameId, Id};
use http::uri::{Authority, Scheme};
use http::{Extensions, Request, header};
use prost::Message as _;
use rayon::ThreadPoolBuildError;
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tokio::process::{Child, Command};
use tokio::runtime::Handle;
use tokio::time::timeout;
use tracing::warn;

use super::answer::File;
use super::cache::Cache;
use super::calls::{Services, own_call, own_origin};
use crate::connections::peer_address;
use chefshat_admission::limits::{FairSemaphore, Key};
use chefshat_base::threads::{Priority, Threads};
use chefshat_hosting::config::PaintingSettings;
use chefshat_hosting::rooms::Rooms;

/// Most records that are in memory at a time, those being painted included.
pub const MAX_PREVIEWS: usize = 2;
/// Most requests that wait for that; further ones are refused.
pub const MAX_PREVIEWS_WAITING: usize = 1_024;
/// Longest time until the document is sent, if necessary without tags: people wait for it.
const DOCUMENT_PATIENCE: Duration = Duration::from_secs(1);
/// Pictures that are kept, each some hundred kilobytes.
const PICTURES_KEPT: usize = 16;
/// Titles that are kept.
const TITLES_KEPT: usize = 256;
/// Most lines of a record that is shown: a game of some hundred Shifts.
const MAX_LINES: usize = 50_000;
/// Most bytes of a record that is shown, as encoded.
const MAX_BYTES: usize = 16 * 1024 * 1024;
/// Width of a picture, in pixels.
const WIDTH: u32 = 1200;
/// Most bytes of a picture.
const MAX_PICTURE_BYTES: u64 = 4 * 1024 * 1024;
/// How a proxy that ends TLS says so.
const FORWARDED_PROTO: &str = "x-forwarded-proto";
/// What a path shows of a game.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Link {
    /// The page of its replay.
    Replay(GameId),
    /// The picture of its end.
    Picture(GameId),
}

impl Link {
    /// What a path names, if it is the replay of a game.
    pub(super) fn of(path: &str) -> Option<Self> {
        let name = path.strip_prefix("/replay/")?;
        match name.strip_suffix(".png") {
            Some(game) => Id::parse(game).map(Self::Picture),
            None => Id::parse(name).map(Self::Replay),
        }
    }
}

/// Why a game is not shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Unshown {
    /// The game does not exist, not everybody may see it, it is not over, or it is too long.
    Unknown,
    /// Too many others are being shown.
    Busy,
}

/// What the tags of a game say.
#[derive(Debug, Clone)]
pub(super) struct Title {
    room: String,
    result: String,
}

/// Shows games.
#[derive(Debug)]
pub(super) struct Previews {
    rooms: Arc<Rooms>,
    places: Arc<FairSemaphore>,
    waiting: Arc<FairSemaphore>,
    threads: Threads,
    painter: Option<PaintingSettings>,
    pictures: Cache<File>,
    titles: Cache<Title>,
}

impl Previews {
    /// Starts the thread that reads records.
    ///
    /// # Errors
    /// The operating system cannot start the thread.
    pub(super) fn new(
        rooms: Arc<Rooms>,
        painter: Option<PaintingSettings>,
    ) -> Result<Self, ThreadPoolBuildError> {
        let shares = rooms.shares();
        Ok(Self {
            rooms,
            places: FairSemaphore::new(MAX_PREVIEWS, shares),
            waiting: FairSemaphore::new(MAX_PREVIEWS_WAITING, shares),
            threads: Threads::new("previews", 1, Priority::Batches)?,
            painter,
            pictures: Cache::new(PICTURES_KEPT),
            titles: Cache::new(TITLES_KEPT),
        })
    }

    /// The picture of the end of a game, as PNG.
    ///
    /// # Errors
    /// It is not shown.
    pub(super) async fn picture(
        &self,
        game: GameId,
        services: impl Services,
        extensions: &Extensions,
    ) -> Result<File, Unshown> {
        let painter = self.painter.clone().ok_or(Unshown::Unknown)?;
        let (kept, patience) = (&self.pictures, painter.patience);
        let runtime = Handle::current();
        let start = move |lines: &[v1::RecordLine]| {
            let _runtime = runtime.enter();
            Some((started(&painter.program)?, jsonl::text(lines).ok()?))
        };
        let paint =
            async |(child, record)| Some(File::new("image/png", painted(child, record).await?));
        (self.shown(kept, patience, game, services, extensions, start, paint)).await
    }

    /// Whether there are pictures.
    pub(super) fn paints(&self) -> bool {
        self.painter.is_some()
    }

    /// What the tags of a game say.
    ///
    /// # Errors
    /// It is not shown.
    pub(super) async fn title(
        &self,
        game: GameId,
        services: impl Services,
        extensions: &Extensions,
    ) -> Result<Title, Unshown> {
        let (kept, patience) = (&self.titles, DOCUMENT_PATIENCE);
        let ready = async |title| Some(title);
        (self.shown(kept, patience, game, services, extensions, title, ready)).await
    }

    /// What is kept of a game, or what `finish` makes of what `make` makes of its record. A thread
    /// that gives way to games runs `make`.
    #[expect(
        clippy::too_many_arguments,
        reason = "the two callers differ in all of them"
    )]
    async fn shown<M, T>(
        &self,
        kept: &Cache<T>,
        patience: Duration,
        game: GameId,
        services: impl Services,
        extensions: &Extensions,
        make: impl FnOnce(&[v1::RecordLine]) -> Option<M> + Send + 'static,
        finish: impl AsyncFnOnce(M) -> Option<T>,
    ) -> Result<T, Unshown>
    where
        M: Send + 'static,
        T: Clone + Send + 'static,
    {
        // A value that was made before names were deleted may show them.
        let now = (game, self.rooms.forgotten());
        if let Some(value) = kept.find(now) {
            return Ok(value);
        }
        let key = Key::of_address(peer_address(extensions));
        let _waiting = self.waiting.try_take(key).ok_or(Unshown::Busy)?;
        let showing = async {
            // First: the game of another caller does not wait behind those of this one.
            let place = self.places.take(key).await;
            let making = async {
                let lines = record(services, game, extensions).await;
                let lines = lines.ok_or(Unshown::Unknown)?;
                // The work keeps its place when its request is cancelled.
                let work = move || (make(&lines), place);
                let made = self.threads.run(work).await.ok_or(Unshown::Unknown)?;
                let (Some(made), _place) = made else {
                    return Err(Unshown::Unknown);
                };
                finish(made).await.ok_or(Unshown::Unknown)
            };
            kept.get(now, making).await
        };
        timeout(patience, showing)
            .await
            .unwrap_or(Err(Unshown::Busy))
    }
}

/// The record of a game, if everybody may read it and it is not too long.
async fn record(
    services: impl Services,
    game: GameId,
    extensions: &Extensions,
) -> Option<Vec<v1::RecordLine>> {
    let mut service = RecordServiceClient::with_origin(services, own_origin());
    let message = v1::GetRecordRequest {
        game_id: game.to_string(),
    };
    let request = own_call(extensions, message);
    let mut responses = service.get_record(request).await.ok()?.into_inner();
    let (mut lines, mut bytes) = (Vec::new(), 0);
    while let Some(response) = responses.message().await.ok()? {
        bytes += response.encoded_len();
        lines.extend(response.lines);
        if lines.len() > MAX_LINES || bytes > MAX_BYTES {
            return None;
        }
    }
    Some(lines)
}

/// What the tags of a game say.
fn title(lines: &[v1::RecordLine]) -> Option<Title> {
    let Some(Line::Header(header)) = lines.first().and_then(|line| line.line.as_ref()) else {
        return None;
    };
    Some(Title {
        room: header.room_name.clone(),
        result: result(lines),
    })
}

/// The document with the tags of a game. `origin`: where this server is reached. `has_picture`:
/// whether there is a picture of it.
pub(super) fn document(
    document: &[u8],
    game: GameId,
    title: &Title,
    origin: &str,
    has_picture: bool,
) -> Option<File> {
    let document = std::str::from_utf8(document).ok()?;
    let (head, rest) = document.split_once("</head>")?;
    let room = match title.room.as_str() {
        "" => "A game of Chef’s Hat",
        room => room,
    };
    let (room, result, origin) = (escaped(room), escaped(&title.result), escaped(origin));
    let mut tags = format!(
        r#"
    <meta property="og:site_name" content="Chef’s Hat" />
    <meta property="og:type" content="website" />
    <meta property="og:title" content="{room}" />
    <meta property="og:description" content="{result}" />
    <meta property="og:url" content="{origin}/replay/{game}" />
"#
    );
    if has_picture {
        tags += &format!(
            r#"    <meta property="og:image" content="{origin}/replay/{game}.png" />
    <meta name="twitter:card" content="summary_large_image" />
"#
        );
    }
    let tagged = format!("{head}{tags}</head>{rest}");
    Some(File::new("text/html", tagged.into()))
}

/// A text as the value of an attribute of HTML.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
        .replace('\'', "&#x27;")
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

/// Starts the program that paints. It gives way to games as the calling thread does, and ends with
/// the value.
fn started(painter: &Path) -> Option<Child> {
    let mut command = Command::new(painter);
    command
        .args(["render", "-", "--out", "-", "--width"])
        .arg(WIDTH.to_string());
    command
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::null());
    let child = command.kill_on_drop(true).spawn();
    child
        .inspect_err(
            |error| warn!(%error, painter = %painter.display(), "cannot draw previews of replays"),
        )
        .ok()
}

/// The picture of the end of a game, as PNG. Takes its record as JSON Lines.
async fn painted(mut child: Child, record: Vec<u8>) -> Option<Bytes> {
    let (mut to, from) = (child.stdin.take()?, child.stdout.take()?);
    let write = async move {
        // Fails if the program refuses the record; it writes no picture then.
        let _ = to.write_all(&record).await;
    };
    let mut picture = Vec::new();
    let mut from = from.take(MAX_PICTURE_BYTES);
    let (_, read) = tokio::join!(write, from.read_to_end(&mut picture));
    read.ok()?;
    child.wait().await.ok()?.success().then(|| picture.into())
}

/// Where a client reaches this server; `None` if it does not say.
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

    fn game() -> GameId {
        Id::parse(GAME).expect("an id")
    }

    /// The page with the tags of a game.
    fn tagged(page: &[u8], lines: &[v1::RecordLine], origin: &str) -> String {
        let title = title(lines).expect("a header");
        let made = document(page, game(), &title, origin, true).expect("a document");
        String::from_utf8(made.bytes.into()).expect("text")
    }

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
            Line::Header(Box::new(header)),
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
        assert_eq!(Link::of(&path), Some(Link::Replay(game())));
        let picture = format!("{path}.png");
        assert_eq!(Link::of(&picture), Some(Link::Picture(game())));
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
        let made = tagged(page, &lines, "https://chef.example.org");
        assert!(made.starts_with("<html><head><title>t</title>\n"), "{made}");
        assert!(made.ends_with("</head><body></body></html>"), "{made}");
        let picture = format!("content=\"https://chef.example.org/replay/{GAME}.png\"");
        let odd = tagged(page, &lines, "https://a&lt.example");
        assert!(
            odd.contains("content=\"https://a&amp;lt.example/replay/"),
            "{odd}"
        );
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
        let made = tagged(b"<head></head>", &lines, "http://127.0.0.1:1");
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
