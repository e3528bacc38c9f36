//! The settings of a server, and bounds that several parts share or that docs/hosting.md lists.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use chefshat_record::signature::SigningKey;
use chefshat_vector::Limits;

use crate::webhooks::WebhookSettings;
use chefshat_admission::access::AccessSettings;
use chefshat_admission::limits::Shares;
use chefshat_base::proxies::TrustedProxies;
use chefshat_base::tls_files::TlsFiles;

/// Largest message between nodes, bytes: a batch of inputs of one client, or of updates for it.
pub const MAX_PEER_MESSAGE_BYTES: usize = 16 * 1024 * 1024;
/// Most streams of one connection.
pub const MAX_STREAMS_PER_CONNECTION: u32 = 1_024;
/// Most seats attached to one stream at a time.
pub const MAX_SEATS_PER_STREAM: usize = 4_096;
/// Most seats named in one Watch.
pub const MAX_SEATS_PER_WATCH: usize = 64;
/// Games that are deleted in one commit: rooms wait for it.
pub const GAMES_DELETED_AT_ONCE: usize = 16;
/// Pause between two such commits, in which rooms commit.
pub const DELETION_PAUSE: Duration = Duration::from_millis(20);
/// How long a Play stream may stay silent before its first message.
pub const FIRST_MESSAGE_TIMEOUT: Duration = Duration::from_secs(10);
/// Longest time until a picture of a game is sent.
pub const PICTURE_PATIENCE: Duration = Duration::from_secs(30);
/// Messages that wait for one room.
pub const ROOM_MAILBOX: usize = 256;
/// Most vector streams at a time.
pub const MAX_VECTOR_STREAMS: usize = 128;
/// Most seats played on all vector streams together, games times seats: about 5 KB each. The
/// default share of one caller is as many as one stream may have.
pub const MAX_VECTOR_SEATS_IN_ALL: usize = 163_840;
/// Most multiplications for a decision of a network file of a vector stream.
pub const MAX_VECTOR_NETWORK_MULTIPLICATIONS: u64 = Limits::OF_SERVER.network_multiplications;
/// How long a client may take to send the setup of a vector stream.
pub const VECTOR_SETUP_TIMEOUT: Duration = Duration::from_secs(10);
/// Most analyses at a time, those waiting for a thread included.
pub const MAX_ANALYSES: usize = 64;
/// Most rollouts of an analysis.
pub const MAX_ANALYSIS_ROLLOUTS: u64 = 1_000_000;
/// Longest time of an analysis.
pub const MAX_ANALYSIS_TIME: Duration = Duration::from_secs(10);
/// Bytes of records that are received for import in a second, of all imports together.
pub const IMPORT_RATE: usize = 16 * 1024 * 1024;
/// Most bytes of memory that the lines of all records take that are being imported.
pub const MAX_IMPORT_MEMORY: usize = 192 * 1024 * 1024;
/// How long a client may take to send the next part of a record.
pub const IMPORT_IDLE_TIMEOUT: Duration = Duration::from_secs(10);
/// Most uploads of records at a time.
pub const MAX_IMPORTS: usize = 2;
/// Most records that are sent at a time.
pub const MAX_RECORDS_SENT: usize = 8;
/// How long a client may take to receive one message of a record.
pub const RECORD_SEND_TIMEOUT: Duration = Duration::from_secs(30);
/// Most tournaments, including ended ones that are still listed.
pub const MAX_TOURNAMENTS: usize = 256;
/// Most studies.
pub const MAX_STUDIES: usize = 256;
/// Most bytes of memory that the settings of all studies take. Decoding them is costed, which is
/// about as much as a study keeps.
pub const MAX_STUDY_MEMORY: usize = 48 * 1024 * 1024;
/// Most bytes of memory that the participants of all studies and their answers take.
pub const MAX_STUDY_DATA: usize = 64 * 1024 * 1024;
/// Most streams that follow studies, and of participants.
pub const MAX_STUDY_STREAMS: usize = 4_096;
/// Most streams that follow tournaments.
pub const MAX_FOLLOWERS: usize = 1_024;
/// Shortest time between two updates of a followed tournament.
pub const FOLLOW_INTERVAL: Duration = Duration::from_millis(250);
/// How long a follower may take to receive an update.
pub const FOLLOW_SEND_TIMEOUT: Duration = Duration::from_secs(30);
/// How long open streams and connections may delay a shutdown, and then what is still written.
pub const DRAIN_LIMIT: Duration = Duration::from_secs(5);
/// Longest time for which a node of a cluster that ends hands over what it owns, unless the grace for
/// games that no other node can resume is longer.
pub const HAND_OVER_LIMIT: Duration = Duration::from_secs(20);
/// How long games may take to end after the grace, at most.
pub const END_LIMIT: Duration = Duration::from_secs(5);
/// How long closing the database may delay a shutdown at last.
pub const CLOSE_LIMIT: Duration = Duration::from_secs(5);

/// The longest time of a shutdown. What stops the server must wait for longer.
pub fn longest_shutdown(grace: Duration) -> Duration {
    grace.max(HAND_OVER_LIMIT) + END_LIMIT + 2 * DRAIN_LIMIT + CLOSE_LIMIT
}

/// How many games a server keeps by itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum KeepGames {
    /// The newest ones.
    Newest(u64),
    /// Those that ended within this time.
    For(Duration),
}

/// The settings of a server.
#[derive(Debug, Clone)]
pub struct ServerConfig {
    /// Folder for the records of finished games; `None` disables them.
    pub data_dir: Option<PathBuf>,
    /// The key that signs records; `None`: they are not signed.
    pub signing_key: Option<Arc<SigningKey>>,
    /// Most rooms at a time, including ended ones that are still listed.
    pub max_rooms: usize,
    /// Most connections at a time.
    pub max_connections: usize,
    /// Threads that step the games of vector streams; 0: one for each core.
    pub vector_threads: usize,
    /// How long an ended room stays listed.
    pub retention: Duration,
    /// How long running games may continue after a shutdown is requested.
    pub grace: Duration,
    /// How many finished games are kept; `None`: all.
    pub keep_games: Option<KeepGames>,
    /// How much of each limit one caller may use.
    pub shares: Shares,
    /// Decisions of games that only built-in agents play, in a second; faster for a minute.
    pub built_in_decisions_per_second: u64,
    /// How long a new connection may take until its protocol is known.
    pub first_bytes_timeout: Duration,
    /// Whether clients may import records of games played elsewhere.
    pub allow_import: bool,
    /// Who may call.
    pub access: AccessSettings,
    /// The files for TLS; `None`: connections are not encrypted.
    pub tls: Option<TlsFiles>,
    /// How long a client may use one connection before it is asked to open another; its streams may
    /// finish on the old one. `None`: for ever.
    pub max_connection_age: Option<Duration>,
    /// Names of hosts under which the server may be reached, besides those of this machine; `None`:
    /// any.
    pub allowed_hosts: Option<Vec<String>>,
    /// Proxies that are trusted to name their clients in `x-forwarded-for`.
    pub trusted_proxies: TrustedProxies,
    /// The URL at which clients reach this server directly, if it is one of several behind a load
    /// balancer.
    pub client_endpoint: Option<String>,
    /// Web origins that may call the server from a browser; `*` allows all.
    pub allowed_origins: Vec<String>,
    /// Where webhooks go; `None`: there are none.
    pub webhooks: Option<WebhookSettings>,
    /// What draws the pictures that chats show of a link to a replay; `None`: there are no pictures.
    pub painter: Option<PaintingSettings>,
}

/// What draws pictures of games.
#[derive(Debug, Clone)]
pub struct PaintingSettings {
    /// The program `chefshat-lab`. It gives way to games.
    pub program: PathBuf,
    /// Longest time until a picture is sent.
    pub patience: Duration,
}

impl PaintingSettings {
    /// Those of a program, with the default patience.
    pub fn new(program: PathBuf) -> Self {
        Self {
            program,
            patience: PICTURE_PATIENCE,
        }
    }
}

impl Default for ServerConfig {
    fn default() -> Self {
        Self {
            data_dir: None,
            signing_key: None,
            max_rooms: 10_000,
            max_connections: 10_000,
            vector_threads: 0,
            retention: Duration::from_secs(600),
            grace: Duration::from_secs(30),
            keep_games: None,
            shares: Shares::default(),
            built_in_decisions_per_second: 10_000,
            first_bytes_timeout: Duration::from_secs(10),
            allow_import: false,
            access: AccessSettings::default(),
            tls: None,
            max_connection_age: None,
            allowed_hosts: None,
            trusted_proxies: TrustedProxies::default(),
            client_endpoint: None,
            allowed_origins: Vec::new(),
            webhooks: None,
            painter: None,
        }
    }
}
