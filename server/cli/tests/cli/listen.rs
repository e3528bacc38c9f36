//! The sockets of `chefshat serve` other than an address and port: a unix socket, one that systemd
//! opens; and the unit for systemd.

use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::os::unix::net::{UnixDatagram, UnixStream};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use serde_json::Value;
use tempfile::TempDir;

use super::run::{Ended, Running, program, run, typed};

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
        let mut client = UnixStream::connect(&path).unwrap();
        let request = "GET / HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n";
        client.write_all(request.as_bytes()).unwrap();
        let mut answer = String::new();
        client.read_to_string(&mut answer).unwrap();
        assert!(answer.starts_with("HTTP/1.1 "), "{answer}");

        let other = Ended::of(serve_at(&path).output().unwrap());
        other.assert_failed("choose another path with --listen");
    }
    typed("serve --listen unix:").assert_refused("add a path");
}

#[test]
fn a_server_takes_the_socket_that_systemd_opens_and_says_when_it_is_ready() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("notify");
    let notified = UnixDatagram::bind(&path).unwrap();
    let mut command = Command::new("python3");
    command.args(["-c", ACTIVATE, env!("CARGO_BIN_EXE_chefshat")]);
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
    let binary = env!("CARGO_BIN_EXE_chefshat");
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
