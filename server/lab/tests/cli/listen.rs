//! The sockets of `chefshat serve` other than an address and port: a unix socket, one that systemd
//! opens; and the unit for systemd.

use std::collections::{BTreeMap, BTreeSet};
use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::os::unix::net::{UnixDatagram, UnixStream};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use serde_json::Value;
use tempfile::TempDir;

use super::run::{Ended, Running, closed_pipe, program, run, typed};

/// Opens a socket and becomes the server, as systemd does.
const ACTIVATE: &str = "
import os, socket, sys
opened = socket.create_server(('127.0.0.1', 0))
os.dup2(opened.fileno(), 3)
os.set_inheritable(3, True)
os.environ.update(LISTEN_FDS='1', LISTEN_PID=str(os.getpid()))
os.execv(sys.argv[1], sys.argv[1:])
";

/// Starts a server and reads the line in which it says where it listens.
fn start(command: &mut Command) -> (Running, Value) {
    let mut server = Running(command.spawn().unwrap());
    let mut line = String::new();
    let stdout = server.0.stdout.take().unwrap();
    BufReader::new(stdout).read_line(&mut line).unwrap();
    (server, serde_json::from_str(&line).unwrap())
}

fn serve_at(path: &Path) -> Command {
    let mut command = program();
    command.args(["serve", "--json", "--no-records", "--listen"]);
    command.arg(format!("unix:{}", path.display()));
    command.args(["--access", "open"]);
    command
}

#[test]
fn a_server_listens_on_a_unix_socket_again_and_again() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("chefshat.sock");
    for _ in 0..2 {
        // The second finds the socket of the first, which was killed.
        let (_server, listening) = start(&mut serve_at(&path));
        let expected = format!("unix:{}", path.display());
        assert_eq!(listening["address"], expected.as_str());
        let answer = answer(&path, "localhost");
        assert!(answer.starts_with("HTTP/1.1 "), "{answer}");

        let other = Ended::of(serve_at(&path).output().unwrap());
        other.assert_failed("choose another path with --listen");
    }
    typed("serve --listen unix:").assert_refused("add a path");
    let unsaid = format!("serve --no-records --listen unix:{}", path.display());
    std::fs::remove_file(&path).unwrap();
    typed(&unsaid).assert_failed("say --access open");
}

#[test]
fn a_server_whose_messages_nobody_can_read_starts_and_stops() {
    let folder = TempDir::new().unwrap();
    let mut command = serve_at(&folder.path().join("chefshat.sock"));
    let (mut server, _) = start(command.stderr(closed_pipe()));
    server.terminate();
    assert_eq!(server.0.wait().unwrap().code(), Some(0));
}

/// The answer of a server to a request for the page of a host.
fn answer(path: &Path, host: &str) -> String {
    let mut client = UnixStream::connect(path).unwrap();
    let request = format!("GET / HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n\r\n");
    client.write_all(request.as_bytes()).unwrap();
    let mut answer = String::new();
    client.read_to_string(&mut answer).unwrap();
    answer
}

#[test]
fn beyond_loopback_hosts_are_checked_if_some_are_named() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("chefshat.sock");
    for (named, is_checked) in [("", false), ("chef.example.org", true)] {
        let mut command = serve_at(&path);
        let (_server, _) = start(command.env("CHEFSHAT_ALLOW_HOST", named));
        let is_refused = |host: &str| answer(&path, host).contains("--allow-host");
        assert_eq!(is_refused("other.example.org"), is_checked, "{named}");
        assert!(!is_refused("chef.example.org"), "{named}");
        assert!(!is_refused("127.0.0.1"), "{named}");
    }
}

#[test]
fn a_server_takes_the_socket_that_systemd_opens_and_says_when_it_is_ready() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("notify");
    let notified = UnixDatagram::bind(&path).unwrap();
    let mut command = Command::new("python3");
    command.args(["-c", ACTIVATE, env!("CARGO_BIN_EXE_chefshat-lab")]);
    // The address is in use by nobody, but not used either.
    command.args(["serve", "--json", "--no-records", "--listen", "192.0.2.1:1"]);
    command.env("NOTIFY_SOCKET", &path).stdout(Stdio::piped());
    let (_server, listening) = start(&mut command);
    let mut message = [0; 64];
    let length = notified.recv(&mut message).unwrap();
    assert_eq!(&message[..length], b"READY=1\n");
    let address = listening["address"].as_str().unwrap();
    assert!(address.starts_with("127.0.0.1:"), "{address}");
    run(&format!("http://{address}"), "room list").well();
}

#[test]
fn the_unit_for_systemd_is_valid() {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docker/systemd");
    let folder = TempDir::new().unwrap();
    let binary = env!("CARGO_BIN_EXE_chefshat-lab");
    let units: Vec<PathBuf> = (["chefshat.service", "chefshat.socket"].into_iter())
        .map(|name| {
            let text = std::fs::read_to_string(source.join(name)).unwrap();
            let copy = folder.path().join(name);
            std::fs::write(&copy, text.replace("/usr/bin/chefshat", binary)).unwrap();
            copy
        })
        .collect();
    let mut verify = Command::new("systemd-analyze");
    let Ok(output) = verify.arg("verify").args(&units).output() else {
        eprintln!("SKIPPED the_unit_for_systemd_is_valid: systemd-analyze is not installed");
        return;
    };
    Ended::of(output).clean();
}

#[test]
fn the_unit_for_systemd_allows_every_system_call_of_a_server() {
    let name = "the_unit_for_systemd_allows_every_system_call_of_a_server";
    let Some(groups) = groups_of_system_calls() else {
        eprintln!("SKIPPED {name}: systemd-analyze is not installed");
        return;
    };
    let tried = Command::new("strace")
        .args(["-o", "/dev/null", "true"])
        .output();
    if !tried.is_ok_and(|output| output.status.success()) {
        eprintln!("SKIPPED {name}: strace is not installed or not allowed");
        return;
    }
    let unit = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docker/systemd/chefshat.service");
    let unit = std::fs::read_to_string(unit).unwrap();
    let mut allowed = BTreeSet::new();
    for line in unit.lines() {
        let Some(filter) = line.strip_prefix("SystemCallFilter=") else {
            continue;
        };
        match filter.strip_prefix('~') {
            Some(denied) => members(&groups, denied).iter().for_each(|call| {
                allowed.remove(call);
            }),
            None => allowed.extend(members(&groups, filter)),
        }
    }
    // SQLite hands files to the owner of the database only where it runs as root.
    if rustix::process::geteuid().is_root() {
        allowed.insert("fchown");
    }

    let folder = TempDir::new().unwrap();
    let log = folder.path().join("strace.log");
    let mut command = Command::new("strace");
    command
        .args(["-f", "-qq", "-o"])
        .arg(&log)
        .arg(env!("CARGO_BIN_EXE_chefshat-lab"));
    command.args([
        "serve",
        "--json",
        "--listen",
        "127.0.0.1:0",
        "--until-stdin-closes",
    ]);
    command.arg("--data-dir").arg(folder.path().join("data"));
    command
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::null());
    let (mut server, listening) = start(&mut command);
    let url = format!("http://{}", listening["address"].as_str().unwrap());
    let game = "room create --seat greedy --seat greedy --seat greedy --seat greedy";
    run(&url, game).well();
    drop(server.0.stdin.take());
    assert!(server.0.wait().unwrap().success());

    let log = std::fs::read_to_string(log).unwrap();
    // "1234 openat(AT_FDCWD, …"; what is resumed or a signal has another form.
    let used: BTreeSet<&str> = (log.lines())
        .filter_map(|line| line.split_once(' ')?.1.trim_start().split_once('('))
        .map(|(call, _)| call)
        .filter(|call| {
            call.chars()
                .all(|letter| letter.is_ascii_alphanumeric() || letter == '_')
        })
        .collect();
    // The server lowers the priority of its background threads, so the log is complete.
    assert!(used.contains("setpriority"), "{used:?}");
    let denied: Vec<_> = used.difference(&allowed).collect();
    assert!(denied.is_empty(), "the unit denies {denied:?}");
}

/// The groups of system calls of systemd, by their names; `None`: it is not installed.
fn groups_of_system_calls() -> Option<BTreeMap<String, BTreeSet<String>>> {
    let output = Command::new("systemd-analyze")
        .args(["--no-pager", "syscall-filter"])
        .output()
        .ok()?;
    let text = Ended::of(output).well().stdout;
    let mut groups = BTreeMap::<String, BTreeSet<String>>::new();
    let mut group = String::new();
    for line in text.lines() {
        match line.strip_prefix(' ').map(str::trim) {
            None => group = line.trim().to_owned(),
            Some(comment) if comment.starts_with('#') => {}
            Some(member) => {
                groups
                    .entry(group.clone())
                    .or_default()
                    .insert(member.to_owned());
            }
        }
    }
    Some(groups)
}

/// The system calls of a filter, which names groups and calls.
fn members<'a>(
    groups: &'a BTreeMap<String, BTreeSet<String>>,
    filter: &'a str,
) -> BTreeSet<&'a str> {
    let mut found = BTreeSet::new();
    let mut open: Vec<&str> = filter.split_whitespace().collect();
    while let Some(name) = open.pop() {
        match groups.get(name) {
            Some(members) => open.extend(members.iter().map(String::as_str)),
            None => {
                assert!(!name.starts_with('@'), "systemd has no {name}");
                found.insert(name);
            }
        }
    }
    found
}
