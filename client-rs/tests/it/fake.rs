//! A server that follows scripts, one per stream. It has no rules and no rooms.

use std::collections::VecDeque;
use std::future::Future;
use std::net::SocketAddr;
use std::pin::Pin;
use std::sync::{Arc, Mutex};

use chefshat_client::Client;
use chefshat_client::v1::{
    self, play_service_server, seat_command::Command, seat_update::Update,
    spectator_service_server, table_service_server,
};
use tokio::sync::mpsc;
use tokio_stream::wrappers::{ReceiverStream, TcpListenerStream};
use tonic::{Request, Response, Status, Streaming};

/// A Play stream in a script.
pub(crate) struct Line {
    requests: Streaming<v1::PlayRequest>,
    responses: mpsc::Sender<Result<v1::PlayResponse, Status>>,
}

impl Line {
    /// The commands of the next request; `None` after the client has half-closed.
    pub(crate) async fn heard(&mut self) -> Vec<v1::SeatCommand> {
        let request = self.requests.message().await.expect("the client is there");
        request.map(|it| it.commands).unwrap_or_default()
    }

    /// Reads a request with one attachment, and attaches it as handle and seat number request id -
    /// 1.
    pub(crate) async fn attaches(&mut self) -> v1::Attach {
        let commands = self.heard().await;
        let [
            v1::SeatCommand {
                command: Some(Command::Attach(attach)),
                ..
            },
        ] = &commands[..]
        else {
            panic!("not one attachment: {commands:?}");
        };
        let attached = v1::Attached {
            request_id: attach.request_id,
            seat: attach.request_id - 1,
            room_id: "room".to_owned(),
            game_id: "game".to_owned(),
            next_sequence: attach.from_sequence,
            ..Default::default()
        };
        self.says(vec![(attach.request_id - 1, Update::Attached(attached))])
            .await;
        attach.clone()
    }

    /// The answers of the next request, as (handle, decision, action).
    pub(crate) async fn answers(&mut self) -> Vec<(u32, u64, u32)> {
        let commands = self.heard().await;
        let answers = commands.into_iter().map(|command| match command.command {
            Some(Command::Answer(it)) => (command.handle, it.decision_id, it.action),
            other => panic!("not an answer: {other:?}"),
        });
        answers.collect()
    }

    pub(crate) async fn says(&self, updates: Vec<(u32, Update)>) {
        let updates = updates.into_iter().map(|(handle, update)| v1::SeatUpdate {
            handle,
            update: Some(update),
        });
        let response = v1::PlayResponse {
            updates: updates.collect(),
        };
        self.responses
            .send(Ok(response))
            .await
            .expect("the client is there");
    }

    pub(crate) async fn fails(self, status: Status) {
        self.responses
            .send(Err(status))
            .await
            .expect("the client is there");
    }
}

type Scripted = Pin<Box<dyn Future<Output = ()> + Send>>;
type PlayScript = Box<dyn FnOnce(Line) -> Scripted + Send>;
/// The updates of a seat that is followed, message by message; the stream breaks with the last.
pub(crate) type SeatScript = Vec<Result<Vec<Update>, Status>>;
/// The same of all seats of a ticket, with their handles.
pub(crate) type TicketScript = Vec<Result<Vec<(u32, Update)>, Status>>;
/// The responses of a spectator's stream, in order; it ends after the last.
pub(crate) type WatchScript = Vec<Result<v1::SpectatorServiceWatchResponse, Status>>;

/// The remaining scripts. A panic in one fails the test through the client, which then finds no
/// server.
#[derive(Clone, Default)]
pub(crate) struct Fake {
    plays: Arc<Mutex<VecDeque<PlayScript>>>,
    watches: Arc<Mutex<VecDeque<WatchScript>>>,
    watched_from: Arc<Mutex<Vec<u64>>>,
    attached: Arc<Mutex<Vec<v1::Attach>>>,
}

impl Fake {
    /// Follows this script on the next Play stream.
    pub(crate) fn play<F: Future<Output = ()> + Send + 'static>(
        &self,
        script: impl FnOnce(Line) -> F + Send + 'static,
    ) {
        let script: PlayScript = Box::new(|line| Box::pin(script(line)));
        self.plays.lock().unwrap().push_back(script);
    }

    /// Follows this script on the next spectator's stream.
    pub(crate) fn watch(&self, script: WatchScript) {
        self.watches.lock().unwrap().push_back(script);
    }

    /// Follows this script on the next stream of a seat that is followed: handle 0.
    pub(crate) fn follow(&self, script: SeatScript) {
        let script = script.into_iter().map(|message| {
            let updates = message?.into_iter().map(|update| (0, update));
            Ok(updates.collect())
        });
        self.follow_all(script.collect());
    }

    /// Follows this script on the next stream of a ticket that is followed.
    pub(crate) fn follow_all(&self, script: TicketScript) {
        let attached = Arc::clone(&self.attached);
        self.play(async move |mut line: Line| {
            for command in line.heard().await {
                match command.command {
                    Some(Command::Attach(attach)) => attached.lock().unwrap().push(attach),
                    other => panic!("not an attachment: {other:?}"),
                }
            }
            for message in script {
                match message {
                    Ok(updates) => line.says(updates).await,
                    Err(status) => return line.fails(status).await,
                }
            }
        });
    }

    /// The attachments of tickets that are followed, in order.
    pub(crate) fn attached(&self) -> Vec<v1::Attach> {
        self.attached.lock().unwrap().clone()
    }

    /// The first event requested on each spectator's stream.
    pub(crate) fn watched_from(&self) -> Vec<u64> {
        self.watched_from.lock().unwrap().clone()
    }

    /// Whether all scripts have been followed.
    pub(crate) fn is_done(&self) -> bool {
        self.plays.lock().unwrap().is_empty() && self.watches.lock().unwrap().is_empty()
    }

    /// Serves on a free port and connects to it.
    pub(crate) async fn start(&self) -> Client {
        let listener = listen();
        let address = listener.local_addr().unwrap();
        tokio::spawn(self.clone().serve(listener));
        connect(address).await
    }

    /// Serves on a listener until dropped.
    pub(crate) async fn serve(self, listener: std::net::TcpListener) {
        let listener = tokio::net::TcpListener::from_std(listener).unwrap();
        let play = play_service_server::PlayServiceServer::new(self.clone());
        let spectators = spectator_service_server::SpectatorServiceServer::new(self.clone());
        let tables = table_service_server::TableServiceServer::new(self);
        let server = tonic::transport::Server::builder()
            .add_service(play)
            .add_service(spectators)
            .add_service(tables);
        let served = server.serve_with_incoming(TcpListenerStream::new(listener));
        served.await.unwrap();
    }
}

/// A socket on a free port, for tokio.
pub(crate) fn listen() -> std::net::TcpListener {
    let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    listener.set_nonblocking(true).unwrap();
    listener
}

pub(crate) async fn connect(address: SocketAddr) -> Client {
    Client::connect(address.to_string()).await.unwrap()
}

impl play_service_server::PlayService for Fake {
    type PlayStream = ReceiverStream<Result<v1::PlayResponse, Status>>;
    type WatchStream = tokio_stream::Empty<Result<v1::PlayServiceWatchResponse, Status>>;

    async fn play(
        &self,
        request: Request<Streaming<v1::PlayRequest>>,
    ) -> Result<Response<Self::PlayStream>, Status> {
        let script = self.plays.lock().unwrap().pop_front();
        let script = script.ok_or_else(|| Status::failed_precondition("no script is left"))?;
        let (responses, queue) = mpsc::channel(16);
        let requests = request.into_inner();
        tokio::spawn(script(Line {
            requests,
            responses,
        }));
        Ok(Response::new(ReceiverStream::new(queue)))
    }

    async fn watch(
        &self,
        _request: Request<v1::PlayServiceWatchRequest>,
    ) -> Result<Response<Self::WatchStream>, Status> {
        Err(Status::unimplemented("not in this play"))
    }

    async fn act(
        &self,
        _request: Request<v1::ActRequest>,
    ) -> Result<Response<v1::ActResponse>, Status> {
        Err(Status::unimplemented("not in this play"))
    }
}

impl spectator_service_server::SpectatorService for Fake {
    type WatchStream =
        tokio_stream::Iter<std::vec::IntoIter<Result<v1::SpectatorServiceWatchResponse, Status>>>;

    async fn watch(
        &self,
        request: Request<v1::SpectatorServiceWatchRequest>,
    ) -> Result<Response<Self::WatchStream>, Status> {
        let from = request.get_ref().from_sequence;
        self.watched_from.lock().unwrap().push(from);
        let script = self.watches.lock().unwrap().pop_front();
        let script = script.ok_or_else(|| Status::failed_precondition("no script is left"))?;
        Ok(Response::new(tokio_stream::iter(script)))
    }
}

/// A table whose state is sent on every stream, which then ends.
impl table_service_server::TableService for Fake {
    type WatchStream = tokio_stream::Once<Result<v1::TableServiceWatchResponse, Status>>;

    async fn report(
        &self,
        _request: Request<v1::ReportRequest>,
    ) -> Result<Response<v1::ReportResponse>, Status> {
        Err(Status::unimplemented("not in this play"))
    }

    async fn watch(
        &self,
        _request: Request<v1::TableServiceWatchRequest>,
    ) -> Result<Response<Self::WatchStream>, Status> {
        let state = Some(v1::TableState::default());
        let response = v1::TableServiceWatchResponse { state };
        Ok(Response::new(tokio_stream::once(Ok(response))))
    }
}

/// An event with only a number.
pub(crate) fn event(sequence: u64) -> v1::GameEvent {
    v1::GameEvent {
        sequence,
        ..Default::default()
    }
}
