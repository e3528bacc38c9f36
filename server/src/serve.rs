//! Serves all services and the page on one port, for gRPC and gRPC-web, and shuts down without
//! leaving a client waiting.

#[cfg(test)]
mod budget;
mod ending;
#[cfg(test)]
mod fuzz;
mod health;
#[cfg(test)]
mod idle_tests;
mod joining;
mod probing;

use std::future::Future;
use std::io;
use std::sync::Arc;
use std::time::Duration;

use chefshat_proto::v1;
use futures::future::{BoxFuture, Either, try_join};
use futures::{FutureExt as _, Stream, StreamExt as _, TryStreamExt as _};
use http::HeaderName;
use tokio::io::{AsyncRead, AsyncWrite};
use tokio::task::JoinHandle;
use tokio_util::sync::CancellationToken;
use tokio_util::task::{AbortOnDropHandle, TaskTracker};
use tonic::body::Body;
use tonic::server::NamedService;
use tonic::service::{LayerExt as _, Routes};
use tonic::transport;
use tonic::transport::server::Connected;
use tower::util::{MapRequestLayer, MapResponseLayer, option_layer};
use tower_http::cors::{AllowHeaders, AllowOrigin, Any, CorsLayer};
use tracing::{info, warn};

use crate::access::{Access, Call, TokenFileError};
use crate::cluster::{Directory, NodeLease, SingleServer, StoreDirectory};
use crate::config::{DRAIN_LIMIT, MAX_STREAMS_PER_CONNECTION, ServerConfig};
use crate::connections::{self, Client, Connection, Connections, Limits, Listener};
use crate::forwarded::note_clients;
use crate::front::InFront;
use crate::grpc;
use crate::handshakes::Handshakes;
use crate::limits::frames::MAX_HEADER_BYTES;
use crate::limits::{CallLimits, Metered};
use crate::metrics::Metrics;
use crate::node::{ClusterNode, Hosted};
use crate::participants::Participants;
use crate::peers::{
    CONNECTION_WINDOW, MAX_RESET_STREAMS, PING_INTERVAL, PING_TIMEOUT, PeerPort, Peers,
    STREAM_WINDOW,
};
use crate::proxies::{TrustedProxies, TrustedProxy};
use crate::retention::Retention;
use crate::rooms::Rooms;
use crate::scrape;
use crate::store::cluster::{ClusterStore, NodeInfo};
use crate::store::{Store, StoreError};
use crate::studies::Studies;
use crate::tasks::{LongTask, named};
use crate::tls::{MaybeTls, Tls, TlsError};
use crate::tournaments::Tournaments;
use crate::web::{OriginLayer, Origins, PageLayer};
use crate::wire::peer::peer_service_server::PeerServiceServer;
use ending::Ending;

/// Most bytes of a client that wait on one stream to be read.
const CLIENT_STREAM_WINDOW: u32 = 256 * 1024;
/// Most bytes that wait on all streams of a connection: one that is not read leaves most of them to
/// others.
const CLIENT_CONNECTION_WINDOW: u32 = 1024 * 1024;

/// How long a browser need not ask again whether a page of another origin may call: the longest that
/// one remembers.
const PREFLIGHT_AGE: Duration = Duration::from_secs(2 * 3_600);

/// Why serving failed.
#[derive(Debug, thiserror::Error)]
pub enum ServeError {
    /// The transport failed.
    #[error("the server's transport failed: {0}")]
    Transport(#[from] tonic::transport::Error),
    /// The store failed. Acknowledged decisions are stored; the fate of others shows when the store
    /// is opened again.
    #[error(
        "{0}; every acknowledged decision is stored, and durable games resume when the server is started again"
    )]
    Store(#[from] StoreError),
    /// The threads for work that takes long could not be started.
    #[error("starting the threads for work that takes long failed: {0}")]
    Threads(#[from] rayon::ThreadPoolBuildError),
    /// The tokens file is unreadable.
    #[error(transparent)]
    Tokens(#[from] TokenFileError),
    /// The files for TLS cannot be used.
    #[error(transparent)]
    Tls(#[from] TlsError),
    /// A setting is not a web origin.
    #[error("{0:?} is not a web origin; an example is https://example.org")]
    Origin(String),
}

/// A service behind its server, which accepts no longer message than the longest of its calls. The layer
/// of `grpc/decoding.rs` refuses those of each call before they are read.
macro_rules! served {
    ($server:ident, $service:expr) => {{
        let server = $server::new($service);
        let longest = Call::longest_message_of(name_of(&server));
        server.max_decoding_message_size(longest)
    }};
}

fn name_of<S: NamedService>(_: &S) -> &'static str {
    S::NAME
}

/// Resumes the games of a store and serves on a socket until `shutdown` completes and everything
/// has ended.
///
/// # Errors
/// The transport or store failed, or an allowed origin is not a web origin.
pub async fn serve(
    listener: impl Into<Listener>,
    config: ServerConfig,
    store: Arc<dyn Store>,
    shutdown: impl Future<Output = ()> + Send,
) -> Result<(), ServeError> {
    let server = Server::restored(config, store).await?;
    server.serve(listener, shutdown).await
}

/// A server whose games are resumed, before it has a socket.
#[derive(Debug)]
pub struct Server {
    config: ServerConfig,
    store: Arc<dyn Store>,
    rooms: Arc<Rooms>,
    tournaments: Arc<Tournaments>,
    studies: Arc<Studies>,
    access: Arc<Access>,
    tls: Option<Arc<Tls>>,
    peers: Option<PeerPort>,
    node: Option<ClusterNode>,
    calls: Arc<CallLimits>,
    connections: Arc<Connections>,
    tracker: TaskTracker,
    games: usize,
}

impl Server {
    /// Creates a server without peers and resumes the unfinished games of its store.
    ///
    /// # Errors
    /// The store failed.
    pub async fn restored(config: ServerConfig, store: Arc<dyn Store>) -> Result<Self, ServeError> {
        Self::of_node(config, store, Arc::new(SingleServer)).await
    }

    /// Creates a node of a cluster, whose `directory` knows what the other nodes have, and resumes
    /// the unfinished games of its store.
    ///
    /// # Errors
    /// The store failed.
    pub async fn of_node(
        config: ServerConfig,
        store: Arc<dyn Store>,
        directory: Arc<dyn Directory>,
    ) -> Result<Self, ServeError> {
        let mut server = Self::new(config, store, directory, None)?;
        server.restore().await?;
        Ok(server)
    }

    /// Resumes what the store has. Boxed for the reason of `serve_on`.
    fn restore(&mut self) -> BoxFuture<'_, Result<(), ServeError>> {
        async move {
            self.games = self.rooms.restore().await?;
            self.tournaments.restore().await?;
            self.studies.restore().await?;
            Ok(())
        }
        .boxed()
    }

    /// Creates a node of a cluster, and joins. From here on it runs what nobody else owns. It shows
    /// the tournaments that are over.
    ///
    /// # Errors
    /// The database cannot be reached.
    pub async fn joined(
        config: ServerConfig,
        store: Arc<dyn ClusterStore>,
        info: NodeInfo,
    ) -> Result<Self, ServeError> {
        let endpoint = Some(info.client_endpoint.clone());
        let config = ServerConfig {
            client_endpoint: endpoint.filter(|endpoint| !endpoint.is_empty()),
            ..config
        };
        let lease = Arc::new(NodeLease::new());
        let shared = Arc::clone(&store);
        let directory = StoreDirectory::new(shared, Arc::clone(&lease), config.shares);
        let directory = Arc::new(directory);
        let stored: Arc<dyn Store> = Arc::clone(&store) as Arc<dyn Store>;
        let mut server = Self::new(config, stored, directory, Some(lease))?;
        let grace = server.config.grace;
        let id = store.join(info.clone()).await?;
        info!(node = id.0, name = info.name, "joined the cluster");
        // It owns nothing yet: these are over.
        server.tournaments.restore().await?;
        server.node = Some(ClusterNode::start(
            id,
            info,
            grace,
            store,
            Hosted {
                rooms: Arc::clone(&server.rooms),
                tournaments: Arc::clone(&server.tournaments),
                studies: Arc::clone(&server.studies),
            },
        ));
        Ok(server)
    }

    fn new(
        config: ServerConfig,
        store: Arc<dyn Store>,
        directory: Arc<dyn Directory>,
        lease: Option<Arc<NodeLease>>,
    ) -> Result<Self, ServeError> {
        let access = Access::open(&config.access, config.data_dir.as_ref())?;
        let tls = config.tls.clone().map(Tls::open).transpose()?;
        let tracker = TaskTracker::new();
        let rooms = Rooms::of_node(
            &config,
            Arc::clone(&store),
            directory,
            lease,
            tracker.clone(),
        )?;
        let tournaments = Tournaments::new(Arc::clone(&rooms), tracker.clone());
        let studies = Studies::new(Arc::clone(&rooms), tracker.clone());
        scrape::add_state(&rooms, &tournaments);
        let limits = Limits {
            max_connections: config.max_connections,
            shares: config.shares,
            trusted_proxies: config.trusted_proxies.clone(),
        };
        Ok(Self {
            calls: Arc::new(CallLimits::new(config.shares)),
            connections: Connections::new(limits, Arc::clone(rooms.metrics())),
            config,
            store,
            rooms,
            tournaments,
            studies,
            access: Arc::new(access),
            tls,
            peers: None,
            node: None,
            tracker,
            games: 0,
        })
    }

    /// Serves other nodes on a socket of their own, and sends them what is about their rooms and
    /// tournaments.
    #[must_use]
    pub fn with_peers(self, port: PeerPort) -> Self {
        Self {
            peers: Some(port),
            ..self
        }
    }

    /// Number of resumed games.
    pub fn games(&self) -> usize {
        self.games
    }

    /// Who may call.
    pub fn access(&self) -> &Access {
        &self.access
    }

    /// What the server counts.
    pub fn metrics(&self) -> &Arc<Metrics> {
        self.rooms.metrics()
    }

    /// Serves on a socket until `shutdown` completes and everything has ended.
    ///
    /// # Errors
    /// The transport or store failed, or an allowed origin is not a web origin.
    pub async fn serve(
        self,
        listener: impl Into<Listener>,
        shutdown: impl Future<Output = ()> + Send,
    ) -> Result<(), ServeError> {
        self.serve_on(listener.into(), shutdown.boxed()).await
    }

    /// Serves on a socket. Boxed, so that only this crate compiles it: a plain async function is compiled
    /// again in each crate that awaits it.
    fn serve_on<'a>(
        self,
        listener: Listener,
        shutdown: BoxFuture<'a, ()>,
    ) -> BoxFuture<'a, Result<(), ServeError>> {
        async move {
            let clock = Arc::clone(self.rooms.process_clock());
            let _watching =
                AbortOnDropHandle::new(tokio::spawn(named(LongTask::ProcessClock, clock.watch())));
            let connections = Arc::clone(&self.connections);
            let incoming = connections::accept(listener, connections);
            let incoming = match self.tls.clone() {
                None => incoming.map_ok(MaybeTls::Plain).left_stream(),
                Some(tls) => {
                    let limits = Handshakes::new(self.config.shares, Arc::clone(self.metrics()))?;
                    let secured = tls.secure(incoming, limits, Connection::key);
                    secured.right_stream()
                }
            };
            self.serve_incoming(incoming, shutdown).await
        }
        .boxed()
    }

    /// Serves on connections of any kind until `shutdown` completes and everything has ended.
    ///
    /// # Errors
    /// The transport or store failed, or an allowed origin is not a web origin.
    pub async fn serve_incoming<I, C>(
        mut self,
        incoming: I,
        shutdown: impl Future<Output = ()> + Send,
    ) -> Result<(), ServeError>
    where
        I: Stream<Item = io::Result<C>> + Send,
        C: AsyncRead + AsyncWrite + Connected + Unpin + Send + 'static,
    {
        let ending = Ending::new(
            &self.store,
            &self.rooms,
            &self.tournaments,
            &self.studies,
            self.config.grace,
        );
        let mut node = self.node.take();
        let is_node = node.is_some();
        let (health, health_service) = tonic_health::server::health_reporter();
        let retention = Retention::new(Arc::clone(&self.rooms));
        let closed = ending.closing.clone();
        let until_closing = MapResponseLayer::new(move |it| grpc::until_closing(it, &closed));
        let routes = self
            .routes(&ending.closing, retention.clone())?
            .add_service(until_closing.named_layer(health_service))
            .add_service(until_closing.named_layer(reflection()));
        let to_others = self.peers.as_ref();
        let to_others = to_others.map(|port| port.peers(self.rooms.metrics()));
        self.spawn_tasks(&ending.closing, retention, to_others.as_ref());
        let following = health::report(
            health.clone(),
            node.as_ref().map(ClusterNode::serves),
            self.store.metrics().cloned(),
        );
        let following = self.begin(&ending.closing, LongTask::Health, following);
        let peers = self.peers.take().zip(to_others.clone());
        let peer_serving = match peers {
            None => Either::Left(std::future::ready(Ok(()))),
            Some((port, to_others)) => {
                let serving = self.serve_peers(port, to_others, routes.clone(), &ending.closing)?;
                Either::Right(serving)
            }
        };
        let serving = self.serve_clients(incoming, to_others, routes, &ending.closing)?;

        let tracker = self.tracker.clone();
        let ended_or_drained = async {
            ending
                .begin(shutdown, node.as_mut(), &health, following)
                .await;
            tokio::time::sleep(DRAIN_LIMIT).await;
        };
        tokio::select! {
            served = try_join(serving, peer_serving) => drop(served?),
            () = ended_or_drained => warn!("dropping connections that do not close"),
            // Nothing more can be acknowledged: waiting clients learn it at once when the process
            // ends.
            failure = ending.store.failed() => return Err(ServeError::Store(failure)),
        }
        drop(self);
        ending.finish(&tracker, is_node).await;
        Ok(())
    }

    /// Begins a task that ends when the server closes its connections.
    fn begin(
        &self,
        closing: &CancellationToken,
        task: LongTask,
        work: impl Future<Output = ()> + Send + 'static,
    ) -> JoinHandle<Option<()>> {
        // Boxed, so that the loop around it is compiled once.
        let until_closing = closing.clone().run_until_cancelled_owned(work.boxed());
        self.tracker.spawn(named(task, until_closing))
    }

    /// Spawns what a server does besides answering calls.
    fn spawn_tasks(
        &self,
        closing: &CancellationToken,
        retention: Retention,
        to_others: Option<&Arc<Peers>>,
    ) {
        let (rooms, directory) = (&self.rooms, self.rooms.directory());
        let stalled = Arc::clone(&self.connections).close_stalled();
        self.begin(closing, LongTask::StalledConnections, stalled);
        if let Some(keep) = self.config.keep_games {
            self.begin(closing, LongTask::Retention, retention.follow(keep));
        }
        let deletion = Arc::clone(&self.studies).delete_when_due();
        self.begin(closing, LongTask::StudyDeletion, deletion);
        let tokens = Arc::clone(&self.access).follow();
        self.begin(closing, LongTask::TokenFile, tokens);
        let delivering = rooms.webhooks().clone().deliver(closing.clone());
        self.tracker.spawn(named(LongTask::Webhooks, delivering));
        let of_nodes = self.peers.as_ref().and_then(PeerPort::tls);
        let shown = [("clients", self.tls.clone()), ("nodes", of_nodes)];
        let shown = shown
            .into_iter()
            .filter_map(|(whom, tls)| Some((whom, tls?)));
        let shown: Vec<_> = shown.collect();
        for (_, tls) in &shown {
            self.begin(closing, LongTask::Certificates, Arc::clone(tls).follow());
        }
        scrape::add_certificates(rooms.metrics(), shown);
        if let Some(lease) = rooms.lease() {
            let (lease, directory) = (Arc::clone(lease), Arc::clone(directory));
            let joining = joining::be_reached(lease, directory, to_others.cloned());
            self.begin(closing, LongTask::Joining, joining);
        }
        if let Some(peers) = to_others.cloned() {
            let signing_key = rooms.signing_key();
            let signing_key = signing_key.map_or_else(String::new, |key| key.to_string());
            let metrics = Arc::clone(rooms.metrics());
            let probing = probing::probe(Arc::clone(directory), peers, signing_key, metrics);
            self.begin(closing, LongTask::Probing, probing);
        }
    }

    /// Answers the calls of other nodes until the server closes its connections.
    fn serve_peers(
        &self,
        port: PeerPort,
        to_others: Arc<Peers>,
        routes: Routes,
        closing: &CancellationToken,
    ) -> Result<impl Future<Output = Result<(), transport::Error>>, ServeError> {
        let rooms = &self.rooms;
        let play = grpc::Play::new(
            Arc::clone(rooms),
            Arc::clone(&self.tournaments),
            closing.clone(),
        );
        let of_nodes = grpc::OfNodes::new(play, Arc::clone(rooms.directory()), to_others);
        let of_nodes = served!(PeerServiceServer, of_nodes);
        let first_bytes = self.config.first_bytes_timeout;
        let incoming = port
            .incoming(rooms.metrics())?
            .map_ok(move |it| Metered::of_trusted(it, first_bytes));
        Ok(transport::Server::builder()
            .http2_max_header_list_size(MAX_HEADER_BYTES)
            .max_concurrent_streams(None)
            .initial_stream_window_size(STREAM_WINDOW)
            .initial_connection_window_size(CONNECTION_WINDOW)
            .http2_keepalive_interval(Some(PING_INTERVAL))
            .http2_keepalive_timeout(Some(PING_TIMEOUT))
            .http2_max_pending_accept_reset_streams(Some(MAX_RESET_STREAMS))
            .http2_max_local_error_reset_streams(None)
            .layer(MapRequestLayer::new(from_peer))
            .layer(note_clients(TrustedProxies::new([
                TrustedProxy::UnixSocket,
            ])))
            .layer(grpc::count_refusals(rooms.metrics()))
            .layer(grpc::AccessLayer::new(
                Arc::clone(&self.access),
                Arc::clone(&self.calls),
            ))
            .layer(grpc::LimitsLayer::new(Arc::clone(&self.calls)))
            .layer(grpc::DecodingLayer::new(Arc::clone(&self.calls)))
            .add_routes(routes.add_service(of_nodes))
            .serve_with_incoming_shutdown(incoming, closing.clone().cancelled_owned()))
    }

    /// Answers the calls of clients, and serves the page, until the server closes its connections.
    fn serve_clients<I, C>(
        &self,
        incoming: I,
        to_others: Option<Arc<Peers>>,
        routes: Routes,
        closing: &CancellationToken,
    ) -> Result<impl Future<Output = Result<(), transport::Error>>, ServeError>
    where
        I: Stream<Item = io::Result<C>> + Send,
        C: AsyncRead + AsyncWrite + Connected + Unpin + Send + 'static,
    {
        let (config, rooms, calls) = (&self.config, &self.rooms, &self.calls);
        // Above any encryption, because it reads frames.
        let first_bytes = config.first_bytes_timeout;
        let incoming = incoming.map_ok(move |connection| Metered::new(connection, first_bytes));
        let forwarding = to_others.map(|to_others| {
            grpc::ForwardLayer::new(Arc::clone(rooms.directory()), to_others, Arc::clone(calls))
        });
        let origins = Origins::new(&config.allowed_origins, config.allowed_hosts.clone());
        let cors = cors(origins.listed())?;
        let mut builder = transport::Server::builder();
        if let Some(age) = config.max_connection_age {
            builder = builder.max_connection_age(age);
        }
        Ok(builder
            .accept_http1(true)
            .tcp_nodelay(true)
            .http2_max_header_list_size(MAX_HEADER_BYTES)
            .initial_stream_window_size(CLIENT_STREAM_WINDOW)
            .initial_connection_window_size(CLIENT_CONNECTION_WINDOW)
            .max_concurrent_streams(Some(MAX_STREAMS_PER_CONNECTION))
            .layer(note_clients(config.trusted_proxies.clone()))
            .layer(OriginLayer::new(origins, Arc::clone(calls)))
            .layer(cors)
            .layer(PageLayer::new(
                self.tls.is_some(),
                Arc::clone(calls),
                Arc::clone(rooms),
                config.painter.clone(),
            )?)
            .layer(tonic_web::GrpcWebLayer::new())
            .layer(InFront(grpc::HeartbeatLayer))
            .layer(grpc::count_refusals(rooms.metrics()))
            .layer(option_layer(forwarding))
            .layer(grpc::AccessLayer::new(
                Arc::clone(&self.access),
                Arc::clone(calls),
            ))
            .layer(grpc::LimitsLayer::new(Arc::clone(calls)))
            .layer(grpc::DecodingLayer::new(Arc::clone(calls)))
            .add_routes(routes)
            .serve_with_incoming_shutdown(incoming, closing.clone().cancelled_owned()))
    }

    /// The services for clients.
    fn routes(
        &self,
        closing: &CancellationToken,
        retention: Retention,
    ) -> Result<Routes, ServeError> {
        use crate::wire::service::play_service_server::PlayServiceServer;
        use crate::wire::service::spectator_service_server::SpectatorServiceServer;
        use v1::admin_service_server::AdminServiceServer;
        use v1::analysis_service_server::AnalysisServiceServer;
        use v1::instrument_service_server::InstrumentServiceServer;
        use v1::participation_service_server::ParticipationServiceServer;
        use v1::record_service_server::RecordServiceServer;
        use v1::room_service_server::RoomServiceServer;
        use v1::server_service_server::ServerServiceServer;
        use v1::study_service_server::StudyServiceServer;
        use v1::table_service_server::TableServiceServer;
        use v1::tournament_service_server::TournamentServiceServer;
        use v1::vector_service_server::VectorServiceServer;
        let Self {
            config,
            rooms,
            tournaments,
            studies,
            calls,
            connections,
            ..
        } = self;
        let lookup = grpc::Lookup::new(Arc::clone(rooms), Arc::clone(tournaments));
        let recorded = grpc::Recorded::new(lookup.clone(), config.access.records)?;
        let study_calls = grpc::StudyCalls::new(
            Arc::clone(studies),
            lookup.clone(),
            Arc::clone(calls),
            closing.clone(),
        );
        let participants = Participants::new(
            Arc::clone(rooms),
            Arc::clone(tournaments),
            Arc::clone(studies),
        );
        let admin = grpc::AdminCalls::new(
            lookup.clone(),
            Arc::clone(connections),
            retention,
            Arc::new(participants),
            closing.clone(),
        );
        let vectors = grpc::Vectors::new(recorded.clone(), config.vector_threads, closing.clone())?;
        let analyses =
            grpc::Analyses::new(recorded.clone(), config.vector_threads, closing.clone())?;
        let play = grpc::Play::new(Arc::clone(rooms), Arc::clone(tournaments), closing.clone());
        let tournament_calls = grpc::TournamentCalls::new(
            Arc::clone(tournaments),
            recorded.clone(),
            Arc::clone(calls),
            closing.clone(),
        );
        let room_calls = grpc::RoomCalls::new(
            Arc::clone(rooms),
            recorded.clone(),
            Arc::clone(calls),
            config.client_endpoint.as_deref(),
        );
        let spectate = grpc::Spectate::new(lookup.clone(), closing.clone());
        let tables = grpc::TableCalls::new(lookup.clone());
        let instruments = grpc::Instruments::new(lookup.clone());
        let records =
            grpc::Records::new(recorded, Arc::clone(tournaments), config, closing.clone());
        let info = grpc::Info::new(lookup, calls, config);
        Ok(Routes::new(served!(PlayServiceServer, play))
            .add_service(served!(TournamentServiceServer, tournament_calls))
            .add_service(served!(StudyServiceServer, study_calls.clone()))
            .add_service(served!(ParticipationServiceServer, study_calls))
            .add_service(served!(RoomServiceServer, room_calls))
            .add_service(served!(SpectatorServiceServer, spectate))
            .add_service(served!(TableServiceServer, tables))
            .add_service(served!(InstrumentServiceServer, instruments))
            .add_service(served!(RecordServiceServer, records))
            .add_service(served!(VectorServiceServer, vectors))
            .add_service(served!(AnalysisServiceServer, analyses))
            .add_service(served!(AdminServiceServer, admin))
            .add_service(served!(ServerServiceServer, info)))
    }
}

/// Marks a request of another node, and removes that node's address: it names the client's, if it
/// has one.
fn from_peer(mut request: http::Request<Body>) -> http::Request<Body> {
    request.extensions_mut().remove::<Arc<Client>>();
    request.extensions_mut().insert(grpc::FromPeer);
    request
}

fn reflection() -> tonic_reflection::server::v1::ServerReflectionServer<
    impl tonic_reflection::server::v1::ServerReflection,
> {
    tonic_reflection::server::Builder::configure()
        .register_encoded_file_descriptor_set(chefshat_proto::DESCRIPTORS)
        .register_encoded_file_descriptor_set(tonic_health::pb::FILE_DESCRIPTOR_SET)
        .build_v1()
        .expect("the descriptors come from the generated code")
}

/// Lets browsers of other origins call and read the headers that gRPC uses.
fn cors(origins: &[String]) -> Result<CorsLayer, ServeError> {
    let layer = CorsLayer::new()
        .allow_methods([http::Method::POST])
        .allow_headers(AllowHeaders::mirror_request())
        .max_age(PREFLIGHT_AGE)
        .expose_headers(
            ["grpc-status", "grpc-message", "grpc-status-details-bin"].map(HeaderName::from_static),
        );
    if origins.iter().any(|origin| origin == "*") {
        return Ok(layer.allow_origin(Any));
    }
    let origins = origins
        .iter()
        .map(|origin| {
            origin
                .parse()
                .map_err(|_| ServeError::Origin(origin.clone()))
        })
        .collect::<Result<Vec<http::HeaderValue>, _>>()?;
    Ok(layer.allow_origin(AllowOrigin::list(origins)))
}
