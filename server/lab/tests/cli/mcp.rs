//! `chefshat mcp` as a process. What it offers is tested with the whole system.

use std::io::{BufRead as _, BufReader, Write as _};
use std::process::Stdio;

use super::run::{Running, program, until};

#[test]
fn it_stops_when_it_is_asked_to_while_its_input_stays_open() {
    let mut command = program();
    command.arg("mcp").stdin(Stdio::piped());
    let mut mcp = Running(command.spawn().unwrap());
    let mut stdin = mcp.0.stdin.take().unwrap();
    let mut answers = BufReader::new(mcp.0.stdout.take().unwrap()).lines();
    // When it answers the second one, it waits for the next.
    for line in [
        r#"{"jsonrpc":"2.0","id":1,"method":"initialize","params":{"protocolVersion":"2025-06-18","capabilities":{},"clientInfo":{"name":"test","version":"1"}}}"#,
        r#"{"jsonrpc":"2.0","method":"notifications/initialized"}"#,
        r#"{"jsonrpc":"2.0","id":2,"method":"ping"}"#,
    ] {
        writeln!(stdin, "{line}").unwrap();
        if line.contains("\"id\"") {
            let answer = answers.next().unwrap().unwrap();
            assert!(answer.contains("\"result\""), "{answer}");
        }
    }
    mcp.terminate();
    until("its end", || mcp.0.try_wait().unwrap().is_some());
    assert_eq!(mcp.0.wait().unwrap().code(), Some(0));
    drop(stdin);
}
