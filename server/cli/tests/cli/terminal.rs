//! `chefshat play` and `chefshat watch` without a terminal. With one they are tested with the whole
//! system.

use std::process::Stdio;

use super::server::program;

#[test]
fn a_missing_terminal_is_reported() {
    for arguments in [&["play", "--local"][..], &["watch", "room"]] {
        let ended = program()
            .args(arguments)
            .stdin(Stdio::null())
            .output()
            .unwrap();
        assert_eq!(ended.status.code(), Some(2), "{ended:?}");
        let said = String::from_utf8(ended.stderr).unwrap();
        assert!(said.contains("needs an interactive terminal"), "{said}");
        assert!(ended.stdout.is_empty());
    }
}
