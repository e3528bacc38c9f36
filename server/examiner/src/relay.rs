//! Forwards messages between the agent and the server, and shows each to the current case (`exam`).
//! Calls that join rooms and play games are examined; all others are forwarded unchanged.

use std::convert::Infallible;
use std::io;
use std::net::SocketAddr;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use chefshat_client::Connection;
use chefshat_proto::v1::{
    self,
    play_service_client::PlayServiceClient,
    play_service_server::{PlayService, PlayServiceServer},
    room_service_client::RoomServiceClient,
    room_service_server::{RoomService, RoomServiceServer},
};
use tokio::net::TcpListener;
use tokio::runtime::{self, Runtime};
use tokio::sync::{Notify, mpsc};
use tokio::time::{Instant, sleep, timeout};
use tokio_stream::wrappers::{ReceiverStream, TcpListenerStream};
use tonic::service::Routes;
use tonic::transport::Server;
use tonic::{Request, Response, Status, Streaming};
use tower::{Service as _, ServiceExt as _};

use super::exam::{Exam, Passed, StreamId};
use chefshat_server::access::MAX_MESSAGE_BYTES;

/// Messages queued for one side of a stream.
const QUEUE: usize = 16;
/// Largest message accepted from the server, bytes; its own limit is far below.
const MAX_RESPONSE_BYTES: usize = 64 << 20;

/// The current case, shared by all connections.
#[derive(Debug)]
pub(super) struct Desk {
    exam: Mutex<Exam>,
    began: Instant,
    /// How long the agent may leave a message unread.
    patience: Duration,
    changed: Notify,
}

impl Desk {
    pub(super) fn new(exam: Exam, patience: Duration) -> Arc<Self> {
        Arc::new(Self {
            exam: Mutex::new(exam),
            began: Instant::now(),
            patience,
            changed: Notify::new(),
        })
    }

    /// Passes an event to the case and wakes its waiters.
    pub(super) fn show<T>(&self, act: impl FnOnce(&mut Exam, Duration) -> T) -> T {
        let result = act(&mut self.lock(), self.began.elapsed());
        self.changed.notify_one();
        result
    }

    /// Locks the case without waking its waiters.
    pub(super) fn lock(&self) -> MutexGuard<'_, Exam> {
        self.exam.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// When the time limits of the case must be checked.
    pub(super) fn wake_at(&self) -> Instant {
        self.began + self.lock().wake_at()
    }

    /// Waits until an event has been passed to the case.
    pub(super) async fn changed(&self) {
        self.changed.notified().await;
    }

    /// Time since the start of the case.
    pub(super) fn elapsed(&self) -> Duration {
        self.began.elapsed()
    }
}

/// How long a port may take to become free.
const BIND_TIMEOUT: Duration = Duration::from_secs(5);
/// Time between two attempts to bind it.
const BIND_PAUSE: Duration = Duration::from_millis(20);

/// A port of the examiner, in front of a server. It has a runtime of its own, so that dropping it
/// closes the port together with all connections.
#[derive(Debug)]
pub(super) struct Port {
    pub(super) address: SocketAddr,
    runtime: Option<Runtime>,
}

impl Port {
    /// Serves on this address; waits until it is free.
    ///
    /// # Errors
    /// The address cannot be used.
    pub(super) async fn open(
        address: SocketAddr,
        server: Connection,
        desk: Arc<Desk>,
    ) -> io::Result<Self> {
        let give_up_at = Instant::now() + BIND_TIMEOUT;
        let listener = loop {
            match std::net::TcpListener::bind(address) {
                Err(error)
                    if error.kind() == io::ErrorKind::AddrInUse && Instant::now() < give_up_at =>
                {
                    sleep(BIND_PAUSE).await;
                }
                bound => break bound?,
            }
        };
        listener.set_nonblocking(true)?;
        let address = listener.local_addr()?;
        let runtime = runtime::Builder::new_multi_thread()
            .worker_threads(1)
            .enable_all()
            .build()?;
        runtime.spawn(async move { serve(TcpListener::from_std(listener)?, server, desk).await });
        Ok(Self {
            address,
            runtime: Some(runtime),
        })
    }
}

impl Drop for Port {
    fn drop(&mut self) {
        if let Some(runtime) = self.runtime.take() {
            runtime.shutdown_background();
        }
    }
}

async fn serve(listener: TcpListener, server: Connection, desk: Arc<Desk>) -> io::Result<()> {
    let play = PlayServiceServer::new(Play {
        server: server.clone(),
        desk: Arc::clone(&desk),
    });
    let rooms = RoomServiceServer::new(Rooms {
        server: RoomServiceClient::new(server.clone()),
        desk,
    });
    let all_else = tower::service_fn(move |request| through(server.clone(), request));
    let router = Routes::new(play.max_decoding_message_size(MAX_MESSAGE_BYTES))
        .add_service(rooms.max_decoding_message_size(MAX_MESSAGE_BYTES))
        .into_axum_router()
        .fallback_service(all_else);
    Server::builder()
        .tcp_nodelay(true)
        .add_routes(Routes::from(router))
        .serve_with_incoming(TcpListenerStream::new(listener))
        .await
        .map_err(io::Error::other)
}

/// Forwards a call unchanged.
async fn through(
    mut server: Connection,
    request: http::Request<axum::body::Body>,
) -> Result<http::Response<tonic::body::Body>, Infallible> {
    let request = request.map(tonic::body::Body::new);
    let answer = match server.ready().await {
        Ok(ready) => ready.call(request).await,
        Err(error) => Err(error),
    };
    Ok(answer.unwrap_or_else(|error| Status::unavailable(error.to_string()).into_http()))
}

struct Rooms {
    server: RoomServiceClient<Connection>,
    desk: Arc<Desk>,
}

impl RoomService for Rooms {
    async fn create_room(
        &self,
        request: Request<v1::CreateRoomRequest>,
    ) -> Result<Response<v1::CreateRoomResponse>, Status> {
        self.server.clone().create_room(request.into_inner()).await
    }

    async fn get_room(
        &self,
        request: Request<v1::GetRoomRequest>,
    ) -> Result<Response<v1::GetRoomResponse>, Status> {
        self.server.clone().get_room(request.into_inner()).await
    }

    async fn list_rooms(
        &self,
        request: Request<v1::ListRoomsRequest>,
    ) -> Result<Response<v1::ListRoomsResponse>, Status> {
        self.server.clone().list_rooms(request.into_inner()).await
    }

    async fn join_room(
        &self,
        request: Request<v1::JoinRoomRequest>,
    ) -> Result<Response<v1::JoinRoomResponse>, Status> {
        let request = request.into_inner();
        let code = request.join_code.clone();
        let answer = self.server.clone().join_room(request).await;
        let seen = answer.as_ref().map(Response::get_ref);
        self.desk.show(|exam, now| exam.joined(&code, seen, now));
        answer
    }

    async fn leave_room(
        &self,
        request: Request<v1::LeaveRoomRequest>,
    ) -> Result<Response<v1::LeaveRoomResponse>, Status> {
        self.server.clone().leave_room(request.into_inner()).await
    }

    async fn close_room(
        &self,
        request: Request<v1::CloseRoomRequest>,
    ) -> Result<Response<v1::CloseRoomResponse>, Status> {
        self.server.clone().close_room(request.into_inner()).await
    }

    async fn set_next_room(
        &self,
        request: Request<v1::SetNextRoomRequest>,
    ) -> Result<Response<v1::SetNextRoomResponse>, Status> {
        let mut server = self.server.clone();
        server.set_next_room(request.into_inner()).await
    }
}

struct Play {
    server: Connection,
    desk: Arc<Desk>,
}

impl Play {
    fn server(&self) -> PlayServiceClient<Connection> {
        PlayServiceClient::new(self.server.clone()).max_decoding_message_size(MAX_RESPONSE_BYTES)
    }
}

impl PlayService for Play {
    type PlayStream = ReceiverStream<Result<v1::PlayResponse, Status>>;
    type WatchStream = Streaming<v1::PlayServiceWatchResponse>;

    async fn play(
        &self,
        request: Request<Streaming<v1::PlayRequest>>,
    ) -> Result<Response<Self::PlayStream>, Status> {
        let (to_server, commands) = mpsc::channel(QUEUE);
        let (to_agent, updates) = mpsc::channel(QUEUE);
        let responses = self.server().play(ReceiverStream::new(commands)).await?;
        let stream = Stream {
            id: self.desk.show(|exam, _| exam.opened()),
            desk: Arc::clone(&self.desk),
            to_server: Some(to_server),
            to_agent,
        };
        tokio::spawn(stream.carry(request.into_inner(), responses.into_inner()));
        Ok(Response::new(ReceiverStream::new(updates)))
    }

    async fn watch(
        &self,
        request: Request<v1::PlayServiceWatchRequest>,
    ) -> Result<Response<Self::WatchStream>, Status> {
        self.desk.show(|exam, _| exam.unexamined("Watch"));
        self.server().watch(request.into_inner()).await
    }

    async fn act(
        &self,
        request: Request<v1::ActRequest>,
    ) -> Result<Response<v1::ActResponse>, Status> {
        self.desk.show(|exam, _| exam.unexamined("Act"));
        self.server().act(request.into_inner()).await
    }
}

/// One Play stream, between the agent and the server.
struct Stream {
    id: StreamId,
    desk: Arc<Desk>,
    /// `None` when the agent has half-closed.
    to_server: Option<mpsc::Sender<v1::PlayRequest>>,
    to_agent: mpsc::Sender<Result<v1::PlayResponse, Status>>,
}

impl Stream {
    /// Forwards messages both ways until either side, or the case, ends the stream.
    async fn carry(
        mut self,
        mut agent: Streaming<v1::PlayRequest>,
        mut server: Streaming<v1::PlayResponse>,
    ) {
        let id = self.id;
        let desk = Arc::clone(&self.desk);
        loop {
            let passed = tokio::select! {
                message = agent.message(), if self.to_server.is_some() => match message {
                    Ok(Some(request)) => desk.show(|exam, now| exam.from_agent(id, request, now)),
                    Ok(None) => {
                        self.to_server = None;
                        desk.show(|exam, now| exam.left(id, None, now));
                        continue;
                    }
                    Err(status) => {
                        desk.show(|exam, now| exam.left(id, Some(&status), now));
                        return;
                    }
                },
                received = server.message() => match received {
                    Ok(Some(response)) => desk.show(|exam, now| exam.from_server(id, response, now)),
                    Ok(None) => {
                        desk.show(|exam, _| exam.ended(id, None));
                        return;
                    }
                    Err(status) => {
                        desk.show(|exam, _| exam.ended(id, Some(&status)));
                        let _gone = self.to_agent.send(Err(status)).await;
                        return;
                    }
                },
                () = self.to_agent.closed() => {
                    desk.show(|exam, now| exam.left(id, None, now));
                    return;
                }
            };
            if !self.pass(passed).await {
                return;
            }
        }
    }

    /// Forwards messages; returns whether the stream continues.
    async fn pass(&self, passed: Passed) -> bool {
        if let (Some(server), false) = (&self.to_server, passed.to_server.is_empty()) {
            let commands = passed.to_server;
            // If the server accepts no more, the other direction of the stream has the reason.
            let _ended = server.send(v1::PlayRequest { commands }).await;
        }
        if !passed.to_agent.is_empty() {
            let updates = passed.to_agent;
            let received = self.to_agent.send(Ok(v1::PlayResponse { updates }));
            if timeout(self.desk.patience, received).await.is_err() {
                self.desk.show(|exam, _| exam.not_reading());
                return false;
            }
        }
        if passed.cut {
            let lost = Status::unavailable("the connection was lost: connect and attach again");
            let _gone = timeout(self.desk.patience, self.to_agent.send(Err(lost))).await;
        }
        !passed.cut
    }
}
