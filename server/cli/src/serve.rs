//! `chefshat serve`: runs a server until it is stopped.

use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::time::Duration;

use clap::Args;
use clap::builder::{FalseyValueParser, NonEmptyStringValueParser, RangedU64ValueParser};
use futures::future::OptionFuture;
use tokio::net::TcpListener;
use tokio::sync::oneshot;

use super::cluster::{NewNode, NodeSettings};
use super::error::tell;
use super::listen::{self, Address};
use super::numbers::duration;
use super::stops::Stops;
use super::{CommandError, data_dir, lab, lan, say};
use chefshat_server::access::{Access, AccessSettings, Mode, Role, TokenFile};
use chefshat_server::cluster::LeaseTimes;
use chefshat_server::config::{KeepGames, PaintingSettings, ServerConfig};
use chefshat_server::limits::Shares;
use chefshat_server::proxies::{TrustedProxies, TrustedProxy};
use chefshat_server::scrape;
use chefshat_server::serve::Server;
use chefshat_server::signing::key_or_new;
use chefshat_server::store::{MemoryStore, PostgresOptions, SqliteStore, Store};
use chefshat_server::tls::TlsFiles;
use chefshat_server::web::{self, Origins};
use chefshat_server::webhooks::WebhookSettings;

/// The settings of a server. Each has a flag, an environment variable, a key in the file of
/// `--config` and a default; see `config.rs`.
#[derive(Debug, Args)]
pub(super) struct Settings {
    /// Read settings from a TOML file: its keys are the names of these flags, such as max-rooms = 100.
    /// Flags and environment variables override it.
    #[arg(long, env = "CHEFSHAT_CONFIG", value_name = "FILE")]
    pub(super) config: Option<PathBuf>,
    /// Address and port to listen on, such as 0.0.0.0:50051 or localhost:50051, or a unix socket, such
    /// as unix:/run/chefshat/chefshat.sock. Port 0 selects a free port. A socket from systemd is used
    /// instead.
    #[arg(long, env = "CHEFSHAT_LISTEN", value_name = "HOST:PORT|unix:PATH", default_value = "127.0.0.1:50051", value_parser = listen::address)]
    listen: String,
    /// Address and port that serve metrics for Prometheus at /metrics, such as 127.0.0.1:9464. They
    /// contain no names or cards, but anyone who reaches the port can read them. Default: none.
    #[arg(long, env = "CHEFSHAT_METRICS_LISTEN", value_name = "HOST:PORT", value_parser = listen::host_and_port)]
    metrics_listen: Option<String>,
    /// Data directory: the database (games.sqlite3) and the records of finished games
    /// (records/GAME-ID.jsonl). Default: chefshat in the user's data directory.
    #[arg(long, env = "CHEFSHAT_DATA_DIR")]
    data_dir: Option<PathBuf>,
    /// Keep games only in memory: no database, no records.
    #[arg(long, env = "CHEFSHAT_NO_RECORDS", value_parser = FalseyValueParser::new())]
    no_records: bool,
    /// Let hosts import records of games played elsewhere.
    #[arg(long, env = "CHEFSHAT_ALLOW_IMPORT", value_parser = FalseyValueParser::new())]
    allow_import: bool,
    /// Maximum number of open rooms.
    #[arg(long, env = "CHEFSHAT_MAX_ROOMS", default_value_t = 10_000, value_parser = RangedU64ValueParser::<usize>::new().range(1..))]
    max_rooms: usize,
    /// Delete older finished games with their records: keep this many (1000), or those of a time (90d).
    #[arg(long, env = "CHEFSHAT_KEEP_GAMES", value_name = "GAMES|TIME", value_parser = keep_games)]
    keep_games: Option<KeepGames>,
    /// Share of each limit that one client elsewhere may use, percent: of connections, streams, rooms,
    /// tournaments and more. Clients on this machine may use half.
    #[arg(long, env = "CHEFSHAT_CALLER_SHARE", default_value_t = 10, value_name = "PERCENT", value_parser = clap::value_parser!(u8).range(1..=100))]
    caller_share: u8,
    /// Maximum number of connections.
    #[arg(long, env = "CHEFSHAT_MAX_CONNECTIONS", default_value_t = 10_000, value_parser = RangedU64ValueParser::<usize>::new().range(1..))]
    max_connections: usize,
    /// Decisions per second, over more than a minute, of games that only built-in agents play.
    #[arg(long, env = "CHEFSHAT_BUILT_IN_RATE", default_value_t = 10_000, value_name = "DECISIONS", value_parser = clap::value_parser!(u64).range(1..))]
    built_in_rate: u64,
    /// Threads for the games of learning agents; 0 means one per core. Rooms have separate threads.
    #[arg(long, env = "CHEFSHAT_VECTOR_THREADS", default_value_t = 0, value_parser = RangedU64ValueParser::<usize>::new().range(..=256))]
    vector_threads: usize,
    /// Seconds that games in progress may continue after the server is asked to stop.
    #[arg(long, env = "CHEFSHAT_GRACE", default_value_t = 30)]
    grace: u64,
    /// Web origin whose pages may call the server, such as https://example.org; * allows all.
    /// Repeatable.
    #[arg(
        long = "allow-origin",
        env = "CHEFSHAT_ALLOW_ORIGIN",
        value_name = "ORIGIN",
        value_delimiter = ',',
        value_parser = origin
    )]
    allowed_origins: Vec<String>,
    /// Answer only requests for localhost, an address or this name of a host, so that no web page
    /// reaches the server under a name of its own. Repeatable. Default: an open server on a loopback
    /// address answers only for localhost and addresses, others for any name.
    #[arg(
        long = "allow-host",
        env = "CHEFSHAT_ALLOW_HOST",
        value_name = "HOST",
        value_delimiter = ',',
        value_parser = NonEmptyStringValueParser::new()
    )]
    allowed_hosts: Vec<String>,
    /// Collector of OpenTelemetry that receives a span for each room and decision, over gRPC, such as
    /// http://127.0.0.1:4317.
    #[cfg(feature = "otlp")]
    #[arg(long, env = "CHEFSHAT_OTLP_ENDPOINT", value_name = "URL")]
    pub(super) otlp_endpoint: Option<String>,
    /// Proxy in front of the server that names its clients in x-forwarded-for: an address, a network
    /// such as 10.0.0.0/8, or unix for the server's unix socket. Limits and logs then see the
    /// clients. Repeatable.
    #[arg(
        long = "trusted-proxy",
        env = "CHEFSHAT_TRUSTED_PROXY",
        value_name = "CIDR|unix",
        value_delimiter = ','
    )]
    trusted_proxies: Vec<TrustedProxy>,
    /// Whether calls need a token (see `chefshat token`): open or tokens. Default: tokens if the data
    /// directory has any. An open server is refused on addresses that others reach, unless this
    /// says open.
    #[arg(long, env = "CHEFSHAT_ACCESS", value_name = "open|tokens", value_parser = mode)]
    access: Option<Mode>,
    /// What callers without a token may do where tokens are needed: none, spectator or player.
    #[arg(long, env = "CHEFSHAT_ANONYMOUS", value_name = "none|spectator|player", default_value = "none", value_parser = anonymous)]
    anonymous: Role,
    /// The role needed to list and read records of games: spectator, player, host or admin.
    #[arg(
        long,
        env = "CHEFSHAT_RECORDS",
        value_name = "ROLE",
        default_value = "spectator"
    )]
    records: Role,
    /// Encrypt connections (https): file with the certificate of the server and those that lead to
    /// its authority, PEM. Read again when it changes.
    #[arg(long, env = "CHEFSHAT_TLS_CERT", value_name = "FILE")]
    tls_cert: Option<PathBuf>,
    /// File with the private key of the certificate, PEM.
    #[arg(long, env = "CHEFSHAT_TLS_KEY", value_name = "FILE")]
    tls_key: Option<PathBuf>,
    /// Require a certificate of every client: file with the authorities that sign them, PEM.
    #[arg(long, env = "CHEFSHAT_TLS_CLIENT_CA", value_name = "FILE")]
    tls_client_ca: Option<PathBuf>,
    /// Seconds after which a client on an encrypted connection is asked to open another, so that it
    /// meets the present certificate; what it does on the old one continues. 0 means never.
    #[arg(long, env = "CHEFSHAT_CONNECTION_AGE", default_value_t = 43_200)]
    connection_age: u64,
    /// Address, http or https, that receives a signed POST request when a room is created, a game ends,
    /// or a tournament starts or ends (see docs/instruments.md).
    #[arg(long, env = "CHEFSHAT_WEBHOOK", value_name = "URL")]
    webhook: Option<String>,
    /// File with the secret that signs webhooks, 16 bytes or more; spaces around it do not count.
    #[arg(long, env = "CHEFSHAT_WEBHOOK_SECRET_FILE", value_name = "FILE")]
    webhook_secret_file: Option<PathBuf>,
    /// File with the authorities that certify the receiver of webhooks, PEM. Default: the system's.
    #[arg(long, env = "CHEFSHAT_WEBHOOK_CA", value_name = "FILE")]
    webhook_ca: Option<PathBuf>,
    #[command(flatten)]
    node: NodeSettings,
}

/// The fewest bytes of a secret for webhooks.
const MIN_WEBHOOK_SECRET: usize = 16;

impl Settings {
    /// Where webhooks go, if anywhere.
    ///
    /// # Errors
    /// A flag is missing, or a file cannot be used.
    fn webhooks(&self) -> Result<Option<WebhookSettings>, CommandError> {
        let (url, file) = match (&self.webhook, &self.webhook_secret_file) {
            (Some(url), Some(file)) => (url, file),
            (None, None) if self.webhook_ca.is_none() => return Ok(None),
            _ => return Err("--webhook and --webhook-secret-file must be given together".into()),
        };
        let secret = std::fs::read(file)
            .map_err(|error| format!("cannot read {}: {error}", file.display()))?;
        let secret = secret.trim_ascii();
        if secret.len() < MIN_WEBHOOK_SECRET {
            return Err(format!(
                "the secret in {} is too short: `openssl rand -hex 32` makes one",
                file.display()
            )
            .into());
        }
        let settings = WebhookSettings::new(url, secret, self.webhook_ca.as_deref())
            .map_err(|error| format!("--webhook: {error}"))?;
        Ok(Some(settings))
    }

    /// The files for TLS, if connections are encrypted. Warns if others may read along.
    ///
    /// # Errors
    /// One is missing.
    fn tls(&self, address: &Address) -> Result<Option<TlsFiles>, CommandError> {
        match (&self.tls_cert, &self.tls_key, &self.tls_client_ca) {
            (Some(certificate), Some(key), authority) => Ok(Some(TlsFiles {
                certificate: certificate.clone(),
                key: key.clone(),
                client_authority: authority.clone(),
            })),
            (None, None, None) => {
                if !address.is_local() {
                    tell(format_args!(
                        "WARNING: connections to {address} are not encrypted: others can read tokens and tickets on the way; use \
                         --tls-cert and --tls-key, or a proxy with TLS"
                    ));
                }
                Ok(None)
            }
            (None, None, Some(_)) => Err("--tls-client-ca needs --tls-cert and --tls-key".into()),
            _ => Err("--tls-cert and --tls-key must be given together".into()),
        }
    }

    /// Who may call, and the mode that follows, for a server with this data directory and address.
    ///
    /// # Errors
    /// Strangers would reach a server that is not meant for them.
    fn access(
        &self,
        data_dir: Option<&PathBuf>,
        address: &Address,
    ) -> Result<(AccessSettings, Mode), CommandError> {
        let settings = AccessSettings {
            mode: self.access,
            anonymous: self.anonymous,
            records: self.records,
        };
        if settings.mode == Some(Mode::Tokens) && data_dir.is_none() {
            return Err("--access tokens needs a data directory, which has the tokens; leave --no-records out".into());
        }
        let mode = Access::open(&settings, data_dir)?.mode();
        if mode == Mode::Open && !address.is_loopback() {
            if settings.mode.is_none() {
                return Err(format!(
                    "refusing to listen on {address} without tokens: anyone who reaches it could create rooms; create a token with \
                     `chefshat token create --role admin`, or say --access open"
                )
                .into());
            }
            tell(format_args!(
                "WARNING: {address} is open: anyone who reaches it can create rooms, play, and read records; create tokens with \
                 `chefshat token create`"
            ));
        }
        Ok((settings, mode))
    }
}

/// Run a server that hosts rooms. One port serves gRPC, gRPC-web, health checks, reflection and the
/// web page.
#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  chefshat serve --listen 127.0.0.1:50051 --data-dir ./chefshat-data"
)]
pub(super) struct Serve {
    #[command(flatten)]
    pub(super) settings: Settings,
    /// Stop when standard input ends: for a program that starts its own server and may die at any
    /// time.
    #[arg(long)]
    until_stdin_closes: bool,
    /// Begin with an empty database if that of the data directory is empty or missing although a
    /// server used the directory before. Without this, such a start is refused.
    #[arg(long)]
    new: bool,
    /// Print the server's address as a JSON line on standard output.
    #[arg(long)]
    json: bool,
}

impl Serve {
    pub(super) async fn run(self) -> Result<ExitCode, CommandError> {
        let settings = self.settings;
        let data_dir = match (settings.no_records, settings.data_dir.clone()) {
            (true, ignored) => {
                // Images and units set the variable of the data directory.
                if let Some(folder) = ignored
                    && settings.access.is_none()
                    && TokenFile::of(&folder).read()?.is_some()
                {
                    return Err(format!(
                        "{} has tokens, which --no-records leaves out; leave --no-records out, or say --access open",
                        folder.display()
                    )
                    .into());
                }
                None
            }
            (false, data_dir) if settings.node.database.is_some() => {
                Some(data_dir::prepare_without_records(data_dir)?)
            }
            (false, data_dir) => Some(data_dir::prepare(data_dir)?),
        };
        let (listener, address) = listen::listen(&settings.listen).await?;
        let metrics_listener = match &settings.metrics_listen {
            Some(address) => Some(listen::tcp(address, "--metrics-listen").await?),
            None => None,
        };
        let tls = settings.tls(&address)?;
        let webhooks = settings.webhooks()?;
        let scheme = if tls.is_some() { "https" } else { "http" };
        let (access, mode) = settings.access(data_dir.as_ref(), &address)?;
        // Pages of other names must not reach a server that trusts everybody on this machine.
        let is_local = mode == Mode::Open && address.is_loopback();
        let options = PostgresOptions {
            retention: ServerConfig::default().retention,
            record_files: false,
            lease: settings.node.lease.unwrap_or(LeaseTimes::DEFAULT),
            scratch: data_dir.clone().unwrap_or_else(std::env::temp_dir),
            ..PostgresOptions::default()
        };
        let storage = match settings.node.open(settings.max_rooms, options).await? {
            Some(node) => Storage::Shared(Box::new(node)),
            None => Storage::Own(match &data_dir {
                Some(folder) if self.new => Arc::new(SqliteStore::open_or_new(folder).await?),
                Some(folder) => Arc::new(SqliteStore::open(folder).await?),
                None => Arc::new(MemoryStore::default()),
            }),
        };
        let metrics_address = (metrics_listener.as_ref())
            .map(TcpListener::local_addr)
            .transpose()?;
        // Before the address is printed, so that an immediate signal is handled.
        let mut stops = Stops::catch()?;
        let kept_in = data_dir.clone();
        let grace = settings.grace;
        let is_node = settings.node.database.is_some();
        let allowed_hosts = settings.allowed_hosts;
        // The metrics need no token: pages of other names must not reach them on this machine.
        let has_local_metrics = metrics_address.is_some_and(|address| address.ip().is_loopback());
        let metrics_hosts = has_local_metrics || !allowed_hosts.is_empty();
        let metrics_hosts = metrics_hosts.then(|| allowed_hosts.clone());
        let metrics_names = Origins::new(&[], metrics_hosts);
        let signing_key = data_dir.as_deref().map(key_or_new).transpose()?;
        let config = ServerConfig {
            data_dir,
            signing_key: signing_key.map(Arc::new),
            max_rooms: settings.max_rooms,
            max_connections: settings.max_connections,
            keep_games: settings.keep_games,
            shares: Shares {
                remote: settings.caller_share,
                ..Shares::default()
            },
            built_in_decisions_per_second: settings.built_in_rate,
            vector_threads: settings.vector_threads,
            allow_import: settings.allow_import,
            allowed_hosts: (is_local || !allowed_hosts.is_empty()).then_some(allowed_hosts),
            trusted_proxies: TrustedProxies::new(settings.trusted_proxies),
            access,
            max_connection_age: (tls.is_some() && settings.connection_age > 0)
                .then(|| Duration::from_secs(settings.connection_age)),
            tls,
            grace: Duration::from_secs(settings.grace),
            allowed_origins: settings.allowed_origins,
            webhooks,
            painter: lab::program().map(PaintingSettings::new),
            ..ServerConfig::default()
        };
        let server = match storage {
            Storage::Shared(node) => {
                let (name, endpoint) = (node.info.name.clone(), node.info.peer_endpoint.clone());
                let server = Server::joined(config, node.store, node.info).await?;
                tell(format_args!(
                    "node {name} of a cluster; other nodes reach it at {endpoint}"
                ));
                server.with_peers(node.port)
            }
            Storage::Own(store) => {
                let server = Server::restored(config, store).await?;
                if let Some(folder) = kept_in {
                    tell(format_args!("games are stored in {}", folder.display()));
                }
                server
            }
        };
        if server.games() > 0 {
            tell(format_args!("resumed games: {}", server.games()));
        }
        if server.access().mode() == Mode::Tokens {
            let tokens = server.access().tokens();
            tell(format_args!(
                "calls need a token; tokens: {tokens} (see `chefshat token`)"
            ));
        }
        if self.json {
            say(serde_json::json!({
                "event": "listening",
                "address": address.to_string(),
                "metrics_address": metrics_address.map(|address| address.to_string()),
                "games": server.games(),
            }))?;
        }
        tell(format_args!("listening on {}", address.url(scheme)));
        if let Address::Ip(address) = &address {
            lan::print_addresses(*address, scheme);
        }
        if let (Some(listener), Some(address)) = (metrics_listener, metrics_address) {
            tell(format_args!("metrics at http://{address}/metrics"));
            let metrics = Arc::clone(server.metrics());
            tokio::spawn(scrape::serve(listener, metrics, metrics_names));
        }
        if !web::is_built() {
            tell("the web page is not built yet; `cargo xtask web` builds it");
        }
        #[cfg(target_os = "linux")]
        tell_systemd(sd_notify::NotifyState::Ready);
        let input_ends = self.until_stdin_closes.then(end_of_input);
        let stop = async move {
            tokio::select! {
                _ = stops.next() => {}
                Some(_) = OptionFuture::from(input_ends) => {}
            }
            #[cfg(target_os = "linux")]
            tell_systemd(sd_notify::NotifyState::Stopping);
            let (then, at_once) = match is_node {
                true => (
                    format!("other nodes take durable games over, others may end within {grace} s"),
                    "other nodes take durable games over when the lease expires",
                ),
                false => (
                    format!(
                        "running games may end within {grace} s, then durable ones are suspended and resume at the next start"
                    ),
                    "durable games resume when the server is started again",
                ),
            };
            tell(format_args!(
                "stopping: no new rooms; {then}; stop again to end at once"
            ));
            tokio::spawn(async move {
                stops.next().await;
                tell(format_args!(
                    "stopped at once: {at_once}, all others are lost"
                ));
                std::process::exit(1);
            });
        };
        server.serve(listener, stop).await?;
        tell("stopped");
        Ok(ExitCode::SUCCESS)
    }
}

/// Tells systemd how far the server is, if it has started it. A failure only delays systemd, which says
/// so itself.
#[cfg(target_os = "linux")]
fn tell_systemd(state: sd_notify::NotifyState<'_>) {
    let _ = sd_notify::notify(&[state]);
}

/// Where the games of a server are stored.
enum Storage {
    /// In a store of its own.
    Own(Arc<dyn Store>),
    /// In the database of a cluster.
    Shared(Box<NewNode>),
}

/// Resolves when standard input ends. Uses a detached thread: tokio would wait for one of its own
/// at shutdown.
fn end_of_input() -> oneshot::Receiver<()> {
    let (sender, closed) = oneshot::channel();
    std::thread::spawn(move || {
        // A read error ends the input, too.
        let _ = std::io::copy(&mut std::io::stdin().lock(), &mut std::io::sink());
        let _ = sender.send(());
    });
    closed
}

fn mode(text: &str) -> Result<Mode, String> {
    match text {
        "open" => Ok(Mode::Open),
        "tokens" => Ok(Mode::Tokens),
        _ => Err("use open or tokens".to_owned()),
    }
}

fn anonymous(text: &str) -> Result<Role, String> {
    match text {
        "none" => Ok(Role::Anyone),
        "spectator" => Ok(Role::Spectator),
        "player" => Ok(Role::Player),
        _ => Err("use none, spectator or player".to_owned()),
    }
}

/// A number of games, or a time such as 90d.
fn keep_games(text: &str) -> Result<KeepGames, String> {
    match text.parse() {
        Ok(0) => Err("keep at least one game".to_owned()),
        Ok(count) => Ok(KeepGames::Newest(count)),
        Err(_) => duration(text).map(KeepGames::For).map_err(|_| {
            "use a number of games above 0, or a time such as 90d, 12h or 30m".to_owned()
        }),
    }
}

/// Checks a web origin as browsers send it: scheme and host without a path.
fn origin(text: &str) -> Result<String, String> {
    if text == "*" {
        return Ok(text.to_owned());
    }
    let host = (text.strip_prefix("https://")).or(text.strip_prefix("http://"));
    let plain =
        |letter: char| letter.is_ascii_graphic() && !matches!(letter, '/' | '?' | '#' | '@');
    match host.is_some_and(|host| !host.is_empty() && host.chars().all(plain)) {
        true => Ok(text.to_owned()),
        false => Err(
            "use http://HOST or https://HOST with an optional port and no path, for example https://example.org, or *"
                .to_owned(),
        ),
    }
}

#[cfg(test)]
mod tests {
    use crate::serve::{keep_games, origin};

    #[test]
    fn at_least_one_game_is_kept() {
        for good in ["1", "1000", "90d"] {
            assert!(keep_games(good).is_ok(), "{good}");
        }
        for bad in ["", "0", "0d", "0s", "-1", "all"] {
            assert!(keep_games(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn origins_are_as_browsers_send_them() {
        for good in ["*", "http://localhost:8080", "https://example.org"] {
            assert_eq!(origin(good).as_deref(), Ok(good));
        }
        for bad in [
            "",
            "example.org",
            "https://",
            "https://example.org/",
            "https://a b",
            " *",
            "ftp://a",
        ] {
            assert!(origin(bad).is_err(), "{bad}");
        }
    }
}
