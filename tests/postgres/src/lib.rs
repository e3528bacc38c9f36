//! A PostgreSQL server for tests: Debian's, in a temporary folder, on an address of its own. All
//! tests of a process share one server and have a database each; a test that stops its server has
//! one of its own, which may have a standby. The server ends with the process that started it, however
//! that ends.

use std::fs;
use std::io::{self, Write as _};
use std::net::{Ipv4Addr, SocketAddr};
use std::os::unix::fs::{MetadataExt as _, PermissionsExt as _, chown};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU8, AtomicU64, Ordering};
use std::thread::sleep;
use std::time::{Duration, Instant};

use tempfile::TempDir;

/// Where Debian's packages have the programs, in a folder for each version.
const PROGRAMS: &str = "/usr/lib/postgresql";
/// The port of every server: not PostgreSQL's own, on which one may listen at all addresses, and none
/// that the system gives to clients.
const PORT: u16 = 25_432;
/// The user that owns all databases.
const USER: &str = "chefshat";
/// The system's user `nobody`: PostgreSQL refuses to run as root.
const NOBODY: u32 = 65_534;
/// How long a server may take to start or stop.
const LIMIT: Duration = Duration::from_secs(60);
/// The settings of a server of which nothing is to survive a crash of the machine.
const FAST: &[&str] = &["fsync=off", "full_page_writes=off"];
/// The settings of every server.
const SETTINGS: [&str; 3] = [
    "max_connections=500",
    "shared_buffers=32MB",
    "unix_socket_directories=",
];
/// Runs a server until a line with a signal or the end of the input arrives. It ends when the
/// test's process ends, in whatever way; then the folder is removed too. A server that is killed would
/// leave its shared memory behind.
const KEEPER: &str = r#"
"$1" -D "$2/data" &
server=$!
read -r signal
[ "$signal" != KILL ] || ipcrm --shmem-id "$(sed -n '7s/.* //p' "$2/data/postmaster.pid")"
kill -"${signal:-QUIT}" $server
wait $server
[ -n "$signal" ] || rm -rf "$2"
"#;

/// A server.
#[derive(Debug)]
pub struct Server {
    folder: TempDir,
    programs: PathBuf,
    ip: Ipv4Addr,
    settings: Vec<String>,
    keeper: Option<Child>,
}

/// A database of its own.
#[derive(Debug, Clone)]
pub struct Database {
    url: String,
    programs: PathBuf,
}

/// Creates an empty database on the server that all tests of this process share.
///
/// # Panics
/// If PostgreSQL is missing or does not start.
pub fn database() -> Database {
    static SHARED: OnceLock<Server> = OnceLock::new();
    SHARED.get_or_init(Server::start).database()
}

impl Server {
    /// Starts a new server with no databases.
    ///
    /// # Panics
    /// If PostgreSQL is missing or does not start.
    pub fn start() -> Self {
        Self::primary(FAST)
    }

    /// Starts a new server that syncs what it commits, for measurements.
    ///
    /// # Panics
    /// If PostgreSQL is missing or does not start.
    pub fn syncing() -> Self {
        Self::primary(&[])
    }

    fn primary(settings: &[&str]) -> Self {
        let arguments = [
            "--auth=trust",
            "--encoding=UTF8",
            "--locale=C.UTF-8",
            "--no-sync",
        ];
        let settings = SETTINGS.iter().chain(settings);
        let settings = settings.map(|&it| it.to_owned()).collect();
        Self::with(settings, "initdb", &arguments)
    }

    /// Starts a standby, which follows this server at an address that leads to it. From now on, the
    /// standby has what is committed before that is acknowledged.
    ///
    /// # Panics
    /// If it does not start.
    pub fn standby(&self, address: SocketAddr) -> Self {
        let (ip, port) = (address.ip(), address.port());
        let from = format!("host={ip} port={port} user={USER}");
        let mut settings = self.settings.clone();
        settings.push(format!("primary_conninfo={from} application_name=standby"));
        let copied_from = format!("--dbname={from}");
        let arguments = [
            copied_from.as_str(),
            "--checkpoint=fast",
            "--write-recovery-conf",
            "--no-sync",
        ];
        let standby = Self::with(settings, "pg_basebackup", &arguments);
        let own = self.with_url("postgres");
        own.run("ALTER SYSTEM SET synchronous_standby_names = 'standby'");
        own.run("SELECT pg_reload_conf()");
        let deadline = Instant::now() + LIMIT;
        while own.run("SELECT sync_state FROM pg_stat_replication") != "sync" {
            assert!(Instant::now() < deadline, "the standby does not follow");
            sleep(Duration::from_millis(20));
        }
        standby
    }

    /// Makes a standby the primary.
    ///
    /// # Panics
    /// If it is none.
    pub fn promote(&self) {
        assert_eq!(self.with_url("postgres").run("SELECT pg_promote()"), "t");
    }

    fn with(settings: Vec<String>, program: &str, arguments: &[&str]) -> Self {
        let programs = programs().expect(
            "the tests need PostgreSQL: install it, for example with `apt-get install postgresql`",
        );
        let folder = tempfile::Builder::new()
            .prefix("chefshat-postgres-")
            .tempdir();
        let folder = folder.expect("a temporary folder");
        if is_root() {
            chown(folder.path(), Some(NOBODY), Some(NOBODY)).expect("root may change owners");
        }
        let mut server = Self {
            ip: own_address(),
            programs,
            folder,
            settings,
            keeper: None,
        };
        let filled = as_nobody(&server.programs.join(program))
            .args(arguments)
            .args(["--username", USER, "--pgdata"])
            .arg(server.data())
            .output();
        succeeded(program, filled);
        server.resume();
        server
    }

    /// Creates an empty database.
    ///
    /// # Panics
    /// If the server does not run.
    pub fn database(&self) -> Database {
        static NUMBER: AtomicU64 = AtomicU64::new(1);
        let name = format!("test{}", NUMBER.fetch_add(1, Ordering::Relaxed));
        self.with_url("postgres")
            .run(&format!("CREATE DATABASE {name}"));
        self.with_url(&name)
    }

    /// The copy that a standby has of a database, or the primary that was one.
    pub fn copy_of(&self, database: &Database) -> Database {
        let (_, name) = database.url.rsplit_once('/').expect("a URL");
        self.with_url(name)
    }

    fn with_url(&self, name: &str) -> Database {
        Database {
            url: format!("postgres://{USER}@{}/{name}", self.address()),
            programs: self.programs.clone(),
        }
    }

    /// Where it listens, also when it runs again after a stop.
    pub fn address(&self) -> SocketAddr {
        (self.ip, PORT).into()
    }

    /// Ends the server at once, as a crash does.
    pub fn stop(&mut self) {
        self.end("QUIT");
    }

    /// Kills the server.
    pub fn kill(&mut self) {
        self.end("KILL");
    }

    /// Ends the server as an administrator does: it ends all connections first.
    pub fn shut_down(&mut self) {
        self.end("INT");
    }

    fn end(&mut self, signal: &str) {
        if let Some(mut keeper) = self.keeper.take() {
            if let Some(mut input) = keeper.stdin.take() {
                // If it has ended already, so has the server.
                let _ = writeln!(input, "{signal}");
            }
            let _ = keeper.wait();
        }
    }

    /// Starts the server again, with its databases.
    ///
    /// # Panics
    /// If it does not start.
    pub fn resume(&mut self) {
        let deadline = Instant::now() + LIMIT;
        let settings: String = (self.settings.iter())
            .map(|setting| {
                format!("{setting}\n")
                    .replacen('=', " = '", 1)
                    .replace('\n', "'\n")
            })
            .collect();
        let ip = self.ip;
        let settings = format!("{settings}listen_addresses = '{ip}'\nport = {PORT}\n");
        let file = self.data().join("postgresql.auto.conf");
        fs::write(file, settings).expect("the folder of the database is writable");
        let log = fs::File::create(self.log()).expect("the folder is writable");
        let mut keeper = as_nobody(Path::new("/bin/sh"))
            .args(["-c", KEEPER, "keeper"])
            .arg(self.programs.join("postgres"))
            .arg(self.folder.path())
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .stderr(log)
            .spawn()
            .expect("a shell runs");
        while !self.is_ready() {
            let ended = keeper.try_wait().expect("a child can be asked");
            assert!(
                ended.is_none() && Instant::now() < deadline,
                "PostgreSQL does not start: {}",
                fs::read_to_string(self.log()).unwrap_or_default()
            );
            sleep(Duration::from_millis(20));
        }
        self.keeper = Some(keeper);
    }

    /// Makes the server, while it is stopped, accept encrypted connections alone.
    ///
    /// # Panics
    /// If the files cannot be written.
    pub fn encrypt(&self, certificate_pem: &str, key_pem: &str) {
        for (name, text) in [
            ("server.crt", certificate_pem),
            ("server.key", key_pem),
            ("pg_hba.conf", "hostssl all all 127.0.0.1/32 trust\n"),
            ("postgresql.conf", "ssl = on\n"),
        ] {
            let file = self.data().join(name);
            fs::write(&file, text).expect("the folder of the database is writable");
            let private = fs::set_permissions(&file, fs::Permissions::from_mode(0o600));
            private.expect("it is ours");
            if is_root() {
                chown(&file, Some(NOBODY), Some(NOBODY)).expect("root may change owners");
            }
        }
    }

    fn is_ready(&self) -> bool {
        Command::new(self.programs.join("pg_isready"))
            .arg("--quiet")
            .arg(format!("--host={}", self.ip))
            .arg(format!("--port={PORT}"))
            .status()
            .is_ok_and(|status| status.success())
    }

    fn data(&self) -> PathBuf {
        self.folder.path().join("data")
    }

    fn log(&self) -> PathBuf {
        self.folder.path().join("log")
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.stop();
    }
}

impl Database {
    /// Its address.
    pub fn url(&self) -> &str {
        &self.url
    }

    /// Runs SQL with psql and returns what it prints, rows without decoration.
    ///
    /// # Panics
    /// If the SQL fails.
    pub fn run(&self, sql: &str) -> String {
        let psql = Command::new(self.programs.join("psql"))
            .args(["--no-psqlrc", "--quiet", "--tuples-only", "--no-align"])
            .args(["--set=ON_ERROR_STOP=1", "--command", sql, &self.url])
            .output();
        succeeded("psql", psql).trim().to_owned()
    }
}

/// The folder with the programs of the newest installed version.
fn programs() -> Option<PathBuf> {
    let versions = fs::read_dir(PROGRAMS).ok()?.flatten();
    let newest = versions
        .filter(|folder| folder.path().join("bin/postgres").exists())
        .max_by_key(|folder| {
            let name = folder.file_name().into_string().unwrap_or_default();
            name.parse::<u32>().unwrap_or_default()
        })?;
    Some(newest.path().join("bin"))
}

fn is_root() -> bool {
    fs::metadata("/proc/self").is_ok_and(|process| process.uid() == 0)
}

/// A command that runs as `nobody`, if this process runs as root.
fn as_nobody(program: &Path) -> Command {
    if !is_root() {
        return Command::new(program);
    }
    let mut command = Command::new("setpriv");
    let nobody = NOBODY.to_string();
    command
        .args(["--reuid", &nobody, "--regid", &nobody, "--clear-groups"])
        .arg(program)
        // Not necessarily a folder that it may enter.
        .current_dir("/");
    command
}

/// A loopback address that no other test of this machine listens on: a free port may be another's
/// by the time that its server listens, or listens again. Connections come from 127.0.0.1, so a
/// client that tries to connect while the server is down never gets the server's port.
pub fn own_address() -> Ipv4Addr {
    static NEXT: AtomicU8 = AtomicU8::new(1);
    let [_, _, high, low] = std::process::id().to_be_bytes();
    let number = NEXT.fetch_add(1, Ordering::Relaxed);
    Ipv4Addr::new(127, 100 + number % 100, high, low)
}

/// What a program printed.
fn succeeded(name: &str, output: io::Result<Output>) -> String {
    let output = output.unwrap_or_else(|error| panic!("{name} does not run: {error}"));
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{name} failed: {errors}");
    String::from_utf8_lossy(&output.stdout).into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_database_is_empty_and_survives_the_end_of_its_server() {
        let mut server = Server::start();
        let (first, second) = (server.database(), server.database());
        first.run("CREATE TABLE dishes (name text)");
        first.run("INSERT INTO dishes VALUES ('pizza')");
        assert_eq!(second.run("SELECT to_regclass('dishes') IS NULL"), "t");
        server.stop();
        assert!(!server.is_ready());
        server.resume();
        assert_eq!(first.run("SELECT name FROM dishes"), "pizza");
        first.run("INSERT INTO dishes VALUES ('gelato')");
        server.shut_down();
        assert!(!server.is_ready());
        server.resume();
        assert_eq!(first.run("SELECT count(*) FROM dishes"), "2");
    }

    #[test]
    fn a_standby_has_what_was_acknowledged() {
        let mut server = Server::start();
        let database = server.database();
        database.run("CREATE TABLE dishes (name text)");
        let standby = server.standby(server.address());
        database.run("INSERT INTO dishes VALUES ('pizza')");
        server.kill();
        let copy = standby.copy_of(&database);
        assert_eq!(copy.run("SELECT pg_is_in_recovery()"), "t");
        standby.promote();
        assert_eq!(copy.run("SELECT name FROM dishes"), "pizza");
        copy.run("INSERT INTO dishes VALUES ('gelato')");
        assert_eq!(copy.run("SELECT count(*) FROM dishes"), "2");
    }

    #[test]
    fn tests_share_one_server() {
        let port = |database: &Database| database.url().split('/').nth(2).map(str::to_owned);
        let (first, second) = (database(), database());
        assert_eq!(port(&first), port(&second));
        assert_ne!(first.url(), second.url());
    }
}
