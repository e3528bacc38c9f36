//! `chefshat play` and `chefshat watch` where there is no terminal. In one they are tested with the whole system.

use std::process::Stdio;

use super::server::program;

#[test]
fn without_a_terminal_it_says_so() {
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
