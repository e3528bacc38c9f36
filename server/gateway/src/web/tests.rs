use std::net::IpAddr;
use std::path::Path;
use std::pin::Pin;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

use chefshat_proto::v1;
use futures::FutureExt as _;
use futures::future::join_all;
use http::{HeaderMap, StatusCode};
use http_body_util::{BodyExt as _, Full};
use prost::Message as _;
use tokio::sync::Semaphore;
use tokio::time::Instant;
use tokio_util::task::TaskTracker;
use tower::{Layer as _, service_fn};

use super::*;
use crate::connections::ForwardedClient;
use chefshat_admission::limits::{Shares, calls::MAX_ANSWERS};
use chefshat_hosting::config::{PICTURE_PATIENCE, ServerConfig};
use chefshat_store::MemoryStore;

/// Services that have one record for all games, and count how often it was asked for.
#[derive(Clone)]
struct Services {
    record: Bytes,
    /// How many may have it.
    admitted: Arc<Semaphore>,
    asked: Arc<AtomicUsize>,
}

impl Services {
    /// Admits this number of requests for the record.
    fn new(admitted: usize) -> Self {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR"));
        let record = folder.join("../../tests/fixtures/signed.jsonl");
        let lines = chefshat_record::jsonl::read(&record).expect("a record");
        let message = v1::GetRecordResponse { lines }.encode_to_vec();
        let length = u32::try_from(message.len()).expect("a small record");
        let record = [&[0], &length.to_be_bytes()[..], &message[..]].concat();
        Self {
            record: record.into(),
            admitted: Arc::new(Semaphore::new(admitted)),
            asked: Arc::default(),
        }
    }

    fn asked(&self) -> usize {
        self.asked.load(Relaxed)
    }

    async fn get_record(self) -> Response<Body> {
        self.asked.fetch_add(1, Relaxed);
        (self.admitted.acquire().await.expect("never closed")).forget();
        let trailers = HeaderMap::from_iter([("grpc-status", "0")].map(|(name, value)| {
            let (name, value) = (name.parse(), value.parse());
            (
                name.unwrap_or(header::TRAILER),
                value.expect("visible ASCII"),
            )
        }));
        let body = Full::new(self.record).with_trailers(async { Some(Ok(trailers)) });
        let mut response = Response::new(Body::new(body.map_err(|never| match never {})));
        let media_type = http::HeaderValue::from_static("application/grpc");
        response
            .headers_mut()
            .insert(header::CONTENT_TYPE, media_type);
        response
    }
}

type Answer<'a> = Pin<Box<dyn Future<Output = Response<Body>> + 'a>>;

fn get<'a>(page: &InFront<PageLayer>, services: &Services, path: &str, caller: u8) -> Answer<'a> {
    let mut request = Request::get(path).body(Body::empty()).expect("a request");
    let address: IpAddr = [192, 0, 2, caller].into();
    request.extensions_mut().insert(ForwardedClient(address));
    send(page, services, request)
}

fn send<'a>(page: &InFront<PageLayer>, services: &Services, request: Request<Body>) -> Answer<'a> {
    let services = services.clone();
    let mut page = page.layer(service_fn(move |_: Request<Body>| {
        services.clone().get_record().map(Ok::<_, BoxError>)
    }));
    async move { page.call(request).await.expect("an answer") }.boxed_local()
}

fn page() -> InFront<PageLayer> {
    page_of(&rooms())
}

fn page_of(rooms: &Arc<Rooms>) -> InFront<PageLayer> {
    // Its picture is the record.
    let painter = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/web/painter.sh");
    PageLayer::new(
        false,
        Arc::new(CallLimits::new(Shares::default())),
        Arc::clone(rooms),
        Some(PaintingSettings::new(painter)),
    )
    .expect("a thread")
}

fn rooms() -> Arc<Rooms> {
    let store = Arc::new(MemoryStore::default());
    Rooms::new(&ServerConfig::default(), store, TaskTracker::new()).expect("threads")
}

fn picture(game: usize) -> String {
    format!("/replay/{game:032x}.png")
}

#[tokio::test(start_paused = true)]
async fn a_caller_that_reads_nothing_of_the_page_holds_up_no_other() {
    let (page, services) = (page(), Services::new(1));
    let ask = async |caller| get(&page, &services, "/assets/none.js", caller).await;
    let mut unread = Vec::new();
    loop {
        let answer = ask(1).await;
        if answer.status() == StatusCode::SERVICE_UNAVAILABLE {
            break;
        }
        unread.push(answer);
    }
    assert_eq!(
        unread.len(),
        MAX_ANSWERS / 10,
        "the share of a caller elsewhere"
    );
    assert_eq!(ask(2).await.status(), StatusCode::NOT_FOUND);
    unread.pop();
    assert_eq!(ask(1).await.status(), StatusCode::NOT_FOUND);
}

#[tokio::test]
async fn a_picture_is_painted_once_for_all_that_ask() {
    let (page, services) = (page(), Services::new(1));
    let path = picture(1);
    let mut tag = None;
    for _ in 0..10 {
        let answers = (0..100).map(|caller| get(&page, &services, &path, caller));
        for answer in join_all(answers).await {
            assert_eq!(answer.status(), StatusCode::OK);
            tag = answer.headers().get(header::ETAG).cloned();
        }
    }
    assert_eq!(services.asked(), 1);
    let known = Request::get(&path)
        .header(header::IF_NONE_MATCH, tag.expect("a tag"))
        .body(Body::empty())
        .expect("a request");
    let answer = send(&page, &services, known).await;
    assert_eq!(answer.status(), StatusCode::NOT_MODIFIED);
    let body = answer.into_body().collect().await.expect("a body");
    assert!(body.to_bytes().is_empty());
}

#[tokio::test]
async fn what_was_painted_before_a_name_was_deleted_is_painted_again() {
    let (rooms, services) = (rooms(), Services::new(9));
    let page = page_of(&rooms);
    for (asked, forgets) in [(1, false), (1, true), (2, false)] {
        let answer = get(&page, &services, &picture(1), 1).await;
        assert_eq!(answer.status(), StatusCode::OK);
        assert_eq!(services.asked(), asked);
        if forgets {
            rooms.count_forgotten();
        }
    }
}

#[tokio::test]
async fn few_records_are_in_memory_and_those_of_one_caller_hold_back_no_other() {
    let (page, services) = (page(), Services::new(0));
    let mut flood: Vec<_> = (0..1_000)
        .map(|game| get(&page, &services, &picture(game), 1))
        .collect();
    let mut refused = 0;
    flood.retain_mut(|answer| {
        let Some(answer) = answer.now_or_never() else {
            return true;
        };
        assert_eq!(answer.status(), StatusCode::SERVICE_UNAVAILABLE);
        assert!(answer.headers().contains_key(header::RETRY_AFTER));
        refused += 1;
        false
    });
    // A tenth of the places, and of those to wait in, are the share of a caller elsewhere.
    assert_eq!(refused, 1_000 - MAX_PREVIEWS_WAITING / 10);
    assert_eq!(services.asked(), 1);
    let mut others: Vec<_> = (2..50)
        .map(|caller| get(&page, &services, &picture(1_000), caller))
        .collect();
    for other in &mut others {
        assert!(other.now_or_never().is_none(), "nobody has a record yet");
    }
    assert_eq!(services.asked(), MAX_PREVIEWS);
    // The others get a picture while the flood still waits.
    services.admitted.add_permits(2);
    let flooding = join_all(flood);
    tokio::select! {
        _ = flooding => panic!("there are only two records"),
        answers = join_all(others) => {
            assert!(answers.iter().all(|answer| answer.status() == StatusCode::OK));
        }
    }
}

#[tokio::test(start_paused = true)]
async fn who_waits_too_long_is_refused_and_gets_the_page_without_tags() {
    let (page, services) = (page(), Services::new(0));
    let begun = Instant::now();
    let answer = get(&page, &services, &picture(1), 1).await;
    assert_eq!(answer.status(), StatusCode::SERVICE_UNAVAILABLE);
    assert_eq!(begun.elapsed().as_secs(), PICTURE_PATIENCE.as_secs());
    let replay = picture(1);
    let replay = replay.trim_end_matches(".png");
    let document = get(&page, &services, replay, 1).await;
    let plain = get(&page, &services, "/", 1).await;
    assert_eq!(document.status(), plain.status());
    assert_eq!(
        document.headers().get(header::ETAG),
        plain.headers().get(header::ETAG)
    );
    // The second one had the place of the first.
    assert_eq!(services.asked(), 2);
}

#[tokio::test]
async fn monitors_without_grpc_are_told_whether_the_server_serves() {
    let (reporter, service) = tonic_health::server::health_reporter();
    let mut page = page().layer(tonic::service::Routes::new(service));
    for (said, status, text) in [
        (tonic_health::ServingStatus::Serving, 200, "serving\n"),
        (
            tonic_health::ServingStatus::NotServing,
            503,
            "not serving\n",
        ),
    ] {
        reporter.set_service_status("", said).await;
        for (method, text) in [(Method::GET, text), (Method::HEAD, "")] {
            let request = Request::builder().method(method).uri(HEALTH);
            let request = request.body(Body::empty()).expect("a request");
            let answer = page.call(request).await.expect("an answer");
            assert_eq!(answer.status().as_u16(), status);
            assert_eq!(answer.headers()[header::CACHE_CONTROL], "no-store");
            let body = answer.into_body().collect().await.expect("a body");
            assert_eq!(body.to_bytes(), text);
        }
    }
}
