//! `chefshat play` and `chefshat watch` without a terminal. With one they are tested with the whole
//! system.

use super::run::typed;

#[test]
fn a_missing_terminal_is_reported() {
    for line in ["play --local", "watch room"] {
        let ended = typed(line);
        assert_eq!(ended.code, Some(2), "{ended:?}");
        ended.assert_refused("needs an interactive terminal");
    }
}
