//! The server of one attack and what is around it: its disk, certificate, tokens, a receiver of its
//! webhooks, the program `chefshat mcp`, and other nodes of its cluster.

use std::net::{Ipv4Addr, SocketAddr};
use std::path::{Path, PathBuf};
use std::process::Stdio;
use std::time::Duration;

use chefshat_postgres::Server as Postgres;
use chefshat_tests::{Launch, Process, SmallDisk, own_address};
use serde_json::Value;
use tempfile::TempDir;
use tokio::io::{AsyncBufReadExt as _, BufReader};
use tokio::process::{Child, Command};

use crate::error::HostileError;
use crate::gauge;
use crate::honest::Access;
use crate::webhooks::Receiver;

/// Port on which nodes receive each other; each has an address of its own.
const PEER_PORT: u16 = 50_052;
/// Where Debian's packages have PostgreSQL.
const POSTGRES: &str = "/usr/lib/postgresql";
/// How long a server runs that has started again: what it resumes may end it.
const STAYS: Duration = Duration::from_secs(1);
/// How long a server may take to start.
const START_LIMIT: Duration = Duration::from_secs(60);

/// What a server is started with.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Setup {
    /// Options of `chefshat serve` without a value.
    pub(crate) flags: &'static [&'static str],
    /// Most file descriptors, if fewer than usual.
    pub(crate) descriptors: Option<u32>,
    /// Size of a disk of its own, MiB.
    pub(crate) disk_mib: Option<u32>,
    /// Whether connections are encrypted.
    pub(crate) tls: bool,
    /// The attacker's tokens. With any, callers need a token, and the honest room has another.
    pub(crate) tokens: usize,
    /// Whether webhooks are sent.
    pub(crate) webhooks: bool,
    /// Whether `chefshat mcp` runs, whose memory is measured then.
    pub(crate) mcp: bool,
    /// Number of nodes of its cluster; 0: it is none.
    pub(crate) nodes: usize,
    /// Whether the honest room plays one game all the time, because new ones are refused.
    pub(crate) one_game: bool,
}

/// A server as most attacks have it.
pub(crate) const PLAIN: Setup = Setup {
    flags: &[],
    descriptors: None,
    disk_mib: None,
    tls: false,
    tokens: 0,
    webhooks: false,
    mcp: false,
    nodes: 0,
    one_game: false,
};

/// A server that runs.
pub(crate) struct AttackedServer {
    launch: Launch,
    process: Process,
    /// How honest clients reach it.
    pub(crate) access: Access,
    /// The attacker's tokens.
    pub(crate) tokens: Vec<String>,
    /// Where it receives other nodes.
    pub(crate) peers: Option<SocketAddr>,
    other_node: Option<(Process, String)>,
    /// What receives its webhooks.
    pub(crate) webhooks: Option<Receiver>,
    mcp: Option<(Child, SocketAddr)>,
    disk: Option<SmallDisk>,
    folder: TempDir,
    _postgres: Option<Postgres>,
}

impl AttackedServer {
    /// Starts it.
    ///
    /// # Errors
    /// It does not start, or this machine lacks what it needs.
    pub(crate) async fn start(binary: &Path, setup: &Setup) -> Result<Self, HostileError> {
        let folder = tempfile::tempdir().map_err(HostileError::io("making a temporary folder"))?;
        let disk = match setup.disk_mib {
            Some(mib) => Some(
                SmallDisk::new(mib * 1024)
                    .await
                    .map_err(HostileError::Lacks)?,
            ),
            None => None,
        };
        let data = match &disk {
            Some(disk) => disk.mounted_at().join("data"),
            None => folder.path().join("data"),
        };
        let mut launch = Launch::new(&data).binary(binary).flags(setup.flags);
        let mut through: Vec<_> = disk.as_ref().map(SmallDisk::enter).unwrap_or_default();
        if let Some(descriptors) = setup.descriptors {
            let limited = format!("ulimit -n {descriptors}; exec \"$@\"");
            through.extend(["sh", "-c", &limited, "sh"].map(Into::into));
        }
        let mut access = Access::default();
        if setup.tls {
            let authority = certify(folder.path(), &launch).await?;
            launch = (launch.with("--tls-cert", authority.display()))
                .with("--tls-key", folder.path().join("key.pem").display());
            access.ca = Some(authority);
        }
        let mut tokens = Vec::new();
        if setup.tokens > 0 {
            access.token = Some(token(binary, &data).await?);
            for _ in 0..setup.tokens {
                tokens.push(token(binary, &data).await?);
            }
        }
        let mut webhooks = None;
        if setup.webhooks {
            let receiver = Receiver::start().await?;
            let secret = folder.path().join("secret");
            std::fs::write(&secret, "0123456789abcdef")
                .map_err(HostileError::io("writing the secret of webhooks"))?;
            launch = (launch.with("--webhook", receiver.url()))
                .with("--webhook-secret-file", secret.display());
            webhooks = Some(receiver);
        }
        let (mut postgres, mut peers, mut other) = (None, None, None);
        if setup.nodes > 0 {
            let server = start_postgres()?;
            let url = server.database().url().to_owned();
            let listens = || SocketAddr::from((own_address(), PEER_PORT));
            let node = |launch: Launch, at: SocketAddr| {
                (launch.with("--database", &url)).with("--peer-listen", at)
            };
            let at = listens();
            launch = node(launch, at);
            peers = Some(at);
            if setup.nodes > 1 {
                let launch = Launch::new(&folder.path().join("other")).binary(binary);
                other = Some(started(&mut node(launch, listens())).await?);
            }
            postgres = Some(server);
        }
        launch = launch.through(through);
        let (process, url) = started(&mut launch).await?;
        access.url = match setup.tls {
            true => url.replacen("http", "https", 1),
            false => url,
        };
        let mcp = match setup.mcp {
            true => Some(start_mcp(binary, &access.url).await?),
            false => None,
        };
        Ok(Self {
            launch,
            process,
            access,
            tokens,
            peers,
            other_node: other,
            webhooks,
            mcp,
            disk,
            folder,
            _postgres: postgres,
        })
    }

    /// The process whose memory is measured: the one that is attacked.
    pub(crate) fn pid(&self) -> u32 {
        match &self.mcp {
            Some((child, _)) => child.id().expect("it has not been waited for"),
            None => self.process.id(),
        }
    }

    /// Its address.
    pub(crate) fn address(&self) -> SocketAddr {
        let url = self.launch.url();
        (url["http://".len()..].parse()).expect("the server printed it")
    }

    /// Where `chefshat mcp` listens.
    pub(crate) fn mcp(&self) -> Option<SocketAddr> {
        self.mcp.as_ref().map(|(_, address)| *address)
    }

    /// How clients reach another node.
    pub(crate) fn other_node(&self) -> Option<Access> {
        let (_, url) = self.other_node.as_ref()?;
        Some(Access::open(url.clone()))
    }

    /// The folder with its data, for this process.
    pub(crate) fn data(&self) -> PathBuf {
        match &self.disk {
            Some(disk) => disk.path(),
            None => self.folder.path().to_path_buf(),
        }
    }

    /// Kills it and starts it again on the same data. Returns the number of lines that it had printed
    /// or logged, and whether it started again and stays.
    pub(crate) async fn restart(mut self) -> (usize, bool) {
        let ended = self.process.kill().await;
        let started = tokio::time::timeout(START_LIMIT, self.launch.start()).await;
        let stays = match started {
            Ok(Ok(process)) => {
                tokio::time::sleep(STAYS).await;
                gauge::memory(process.id()).is_ok()
            }
            _ => false,
        };
        (ended.said.lines().count(), stays)
    }
}

/// Starts a server. Returns its process and its URL.
async fn started(launch: &mut Launch) -> Result<(Process, String), HostileError> {
    let process = launch.start().await;
    let process = process.map_err(|ended| HostileError::Start(ended.said))?;
    Ok((process, launch.url()))
}

/// Writes a certificate for the server's address, and its key, as the book makes them. Returns the
/// certificate, which is its own authority.
async fn certify(folder: &Path, launch: &Launch) -> Result<PathBuf, HostileError> {
    let url = launch.url();
    let (host, _) = (url["http://".len()..].split_once(':')).expect("an address and a port");
    let authority = folder.join("cert.pem");
    let output = Command::new("openssl")
        .args([
            "req", "-x509", "-newkey", "rsa:3072", "-nodes", "-days", "2",
        ])
        .args([
            "-subj",
            "/CN=hostile",
            "-addext",
            &format!("subjectAltName=IP:{host}"),
        ])
        .args(["-addext", "basicConstraints=critical,CA:FALSE", "-keyout"])
        .arg(folder.join("key.pem"))
        .arg("-out")
        .arg(&authority)
        .output()
        .await
        .map_err(|error| HostileError::Lacks(format!("openssl: {error}")))?;
    match output.status.success() {
        true => Ok(authority),
        false => {
            let said = String::from_utf8_lossy(&output.stderr);
            Err(HostileError::Lacks(format!("openssl: {said}")))
        }
    }
}

/// Creates a token of a host in a data directory.
async fn token(binary: &Path, data: &Path) -> Result<String, HostileError> {
    let output = Command::new(binary)
        .args(["token", "create", "--role", "host", "--json", "--data-dir"])
        .arg(data)
        .output()
        .await
        .map_err(HostileError::io("creating a token"))?;
    let created: Option<Value> = serde_json::from_slice(&output.stdout).ok();
    let token = created.and_then(|created| created["token"].as_str().map(str::to_owned));
    token.ok_or_else(|| HostileError::Start(String::from_utf8_lossy(&output.stderr).into_owned()))
}

fn start_postgres() -> Result<Postgres, HostileError> {
    if !Path::new(POSTGRES).is_dir() {
        let missing = format!("PostgreSQL is not installed: there is no {POSTGRES}");
        return Err(HostileError::Lacks(missing));
    }
    Ok(tokio::task::block_in_place(Postgres::start))
}

/// Starts `chefshat mcp` for a server. Returns its process and its address.
async fn start_mcp(binary: &Path, url: &str) -> Result<(Child, SocketAddr), HostileError> {
    let listen = SocketAddr::from((Ipv4Addr::LOCALHOST, 0)).to_string();
    let mut child = Command::new(binary)
        .args(["mcp", "--server", url, "--listen", &listen])
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .kill_on_drop(true)
        .spawn()
        .map_err(HostileError::io("starting chefshat mcp"))?;
    let mut lines = BufReader::new(child.stdout.take().expect("a pipe")).lines();
    let line = tokio::time::timeout(START_LIMIT, lines.next_line()).await;
    let line = line.ok().and_then(Result::ok).flatten().unwrap_or_default();
    let address = (line.strip_prefix("listening on http://"))
        .and_then(|rest| rest.split('/').next()?.parse().ok());
    let address = address.ok_or_else(|| HostileError::Start(format!("chefshat mcp: {line}")))?;
    Ok((child, address))
}
