//! Fuzz target: the largest legal messages of every call, edited, for a server in this process. Each
//! is answered, within the memory that its call may take, and never with an error that says the
//! server is at fault; no task panics, and an honest call is answered next. A binary of its own,
//! because it counts the memory of the whole process.

use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::{Arc, LazyLock, Mutex, Once, PoisonError};
use std::time::Duration;

use bolero::check;
use chefshat_client::{Client, Connection};
use chefshat_proto::cost::{Cost, Filling, Method, shapes};
use chefshat_proto::v1::{self, server_service_client::ServerServiceClient};
use chefshat_record::testing::Edits;
use chefshat_server::access::Call;
use chefshat_server::store::MemoryStore;
use chefshat_tests::{TestServer, one_shift, patiently, room_of_four};
use http::Request;
use http_body_util::{BodyExt as _, Full};
use peak_alloc::PeakAlloc;
use prost::Message as _;
use tokio::runtime::Runtime;
use tonic::body::Body;
use tonic::{Code, Status};
use tower::ServiceExt as _;

#[global_allocator]
static MEMORY: PeakAlloc = PeakAlloc;

/// Runs in `cargo test`.
const RUNS: usize = 150;
/// Calls after which a new server is started, because they leave rooms and studies behind.
const CALLS_PER_SERVER: u32 = 100;
/// How long an answer is read.
const READ: Duration = Duration::from_millis(500);
/// Memory that executing a call may take besides its decoded message, bytes: the games of a vector
/// stream are the most.
const EXECUTION: usize = 64 * 1024 * 1024;
/// How often the bytes of a request are in memory, at the client and at the server.
const COPIES: usize = 6;
/// What is left for the valid fields of a message.
const VALID: Cost = Cost {
    elements: 16,
    memory: 8 * 1024,
};

/// A server with a room that waits.
struct Running {
    server: TestServer,
    honest: Client,
    hostile: Connection,
    room: v1::CreateRoomResponse,
    tickets: Vec<String>,
    calls: u32,
}

impl Running {
    async fn start() -> Self {
        let store = Arc::new(MemoryStore::default());
        let server = TestServer::with(|config| config.allow_import = true, store).await;
        let honest = server.client().await;
        let (room, tickets) = room_of_four(&honest, one_shift(), v1::RoomPolicy::default()).await;
        Self {
            hostile: server.channel().await,
            server,
            honest,
            room,
            tickets,
            calls: 0,
        }
    }

    /// What makes a message of a call reach more than the first check.
    fn valid(&self, path: &str) -> Vec<u8> {
        let room_id = || self.room.room.clone().unwrap_or_default().room_id;
        let owner_token = || self.room.owner_token.clone();
        let attach = || v1::Attach {
            ticket: self.tickets[0].clone(),
            ..v1::Attach::default()
        };
        match path.trim_start_matches("/chefshat.v1.") {
            "PlayService/Act" => v1::ActRequest {
                ticket: self.tickets[0].clone(),
                ..v1::ActRequest::default()
            }
            .encode_to_vec(),
            "PlayService/Watch" => v1::PlayServiceWatchRequest {
                seats: vec![attach()],
            }
            .encode_to_vec(),
            "PlayService/Play" => v1::PlayRequest {
                commands: vec![v1::SeatCommand {
                    handle: 0,
                    command: Some(v1::seat_command::Command::Attach(attach())),
                }],
            }
            .encode_to_vec(),
            "InstrumentService/AddSamples" => v1::AddSamplesRequest {
                ticket: self.tickets[0].clone(),
                ..v1::AddSamplesRequest::default()
            }
            .encode_to_vec(),
            "InstrumentService/AddMarker" => v1::AddMarkerRequest {
                room_id: room_id(),
                owner_token: owner_token(),
                ..v1::AddMarkerRequest::default()
            }
            .encode_to_vec(),
            "RoomService/GetRoom" | "SpectatorService/Watch" => v1::GetRoomRequest {
                room_id: room_id(),
                ..v1::GetRoomRequest::default()
            }
            .encode_to_vec(),
            "RoomService/JoinRoom" => v1::JoinRoomRequest {
                join_code: self.room.join_code.clone(),
                name: "Ada".into(),
                ..v1::JoinRoomRequest::default()
            }
            .encode_to_vec(),
            _ => Vec::new(),
        }
    }

    /// Sends one edited message and checks what comes of it.
    async fn serve(&mut self, which: u32, frames: bool, edits: &Edits) {
        let (method, filling) = chosen(which);
        let Some(call) = Call::find(method.path) else {
            panic!("{} is not served", method.path);
        };
        let limits = call.message;
        let mut message = self.valid(method.path);
        let most = Cost {
            elements: limits.elements.saturating_sub(VALID.elements),
            memory: limits.memory.saturating_sub(VALID.memory),
        };
        message.extend(filling.largest(method.request, limits.bytes - message.len(), most));
        let body = match frames {
            true => edits.apply(&framed(&message)),
            false => framed(&edits.apply(&message)),
        };
        let what = format!(
            "{} with {} bytes of {}",
            method.path,
            body.len(),
            filling.name
        );
        let allowed = limits.memory + COPIES * body.len() + EXECUTION;
        MEMORY.reset_peak_usage();
        let before = MEMORY.current_usage();
        let status = answer(self.hostile.clone(), method.path, body).await;
        let taken = MEMORY.peak_usage().saturating_sub(before);
        assert!(
            taken <= allowed,
            "{what} took {taken} bytes of memory, not {allowed}"
        );
        // How tonic refuses what is not a message.
        let refused_by_tonic = ["decod", "protocol error", "Missing request"]
            .iter()
            .any(|words| status.message().contains(words));
        let is_fault = match status.code() {
            Code::Unknown | Code::DataLoss => true,
            Code::Internal => !refused_by_tonic,
            _ => false,
        };
        assert!(!is_fault, "{what}: {status:?}");
        let mut service = ServerServiceClient::new(self.honest.channel());
        let info = service.get_server_info(v1::GetServerInfoRequest {});
        let info = patiently("an honest call to be answered", info).await;
        assert!(!info.expect("it is served").into_inner().shutting_down);
        assert!(!PANICKED.load(Relaxed), "{what}: a task panicked");
        self.calls += 1;
    }
}

/// The call and the way of filling its message that a number selects: each call as often as others.
fn chosen(which: u32) -> (&'static Method, &'static Filling) {
    static ALL: LazyLock<Vec<(&Method, Vec<Filling>)>> = LazyLock::new(|| {
        let methods = shapes::METHODS.iter();
        let with_fields = methods.map(|method| (method, Filling::all(method.request)));
        with_fields.collect()
    });
    let which = which as usize;
    let (method, fillings) = &ALL[which % ALL.len()];
    (method, &fillings[which / ALL.len() % fillings.len()])
}

/// A message as gRPC frames it.
fn framed(message: &[u8]) -> Vec<u8> {
    let mut body = vec![0];
    body.extend(u32::try_from(message.len()).expect("short").to_be_bytes());
    body.extend(message);
    body
}

/// Calls the server. Returns its status, OK for an answer that does not end in time.
async fn answer(connection: Connection, path: &str, body: Vec<u8>) -> Status {
    let request = Request::post(path)
        .header("content-type", "application/grpc")
        .header("te", "trailers")
        .body(Body::new(Full::new(bytes::Bytes::from(body))))
        .expect("a valid request");
    let calling = async {
        let response = match connection.oneshot(request).await {
            Ok(response) => response,
            Err(error) => return Status::cancelled(error.to_string()),
        };
        let early = Status::from_header_map(response.headers());
        let Ok(collected) = response.into_body().collect().await else {
            return Status::cancelled("the stream was cut");
        };
        let late = (collected.trailers()).and_then(Status::from_header_map);
        early.or(late).unwrap_or(Status::ok(""))
    };
    (tokio::time::timeout(READ, calling).await).unwrap_or(Status::ok(""))
}

/// Whether a task has panicked during this run.
static PANICKED: AtomicBool = AtomicBool::new(false);

/// Notices panics of tasks, which the runtime catches.
fn notice_panics() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        let before = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |panic| {
            PANICKED.store(true, Relaxed);
            before(panic);
        }));
    });
}

#[test]
fn edited_largest_messages_are_answered_within_their_memory() {
    static RUNTIME: LazyLock<Runtime> = LazyLock::new(|| Runtime::new().expect("threads"));
    static RUNNING: Mutex<Option<Running>> = Mutex::new(None);
    notice_panics();
    let inputs = check!()
        .with_type::<(u32, bool, Edits)>()
        .with_iterations(RUNS);
    inputs.for_each(|(which, frames, edits)| {
        // An earlier run may have failed: bolero then looks for a smaller input.
        let mut running = RUNNING.lock().unwrap_or_else(PoisonError::into_inner);
        PANICKED.store(false, Relaxed);
        RUNTIME.block_on(async {
            if let Some(used) = running.take_if(|used| used.calls >= CALLS_PER_SERVER) {
                let Running { server, .. } = used;
                server.stop().await;
            }
            if running.is_none() {
                *running = Some(Running::start().await);
            }
            let running = running.as_mut().expect("it was just started");
            running.serve(*which, *frames, edits).await;
        });
    });
}
