//! A place with several games at a time, for example after another program used its ticket: one
//! game is on screen, the others wait.

use chefshat_client::v1::{TournamentFormat::Swiss, TournamentState::Playing};
use ratatui::crossterm::event::KeyCode;

use super::part::PartInput;
use super::tournament_session::{TournamentSession, report};

/// A person with three games; the first is on screen.
fn three() -> TournamentSession {
    let mut session = TournamentSession::new();
    session.report(report(Swiss, Playing, Vec::new()));
    for game in ["one", "two", "three"] {
        session.seated(game);
    }
    assert_eq!(shown(&session), "one");
    session
}

/// The game on screen.
fn shown(session: &TournamentSession) -> &str {
    let game = session.part.game.as_ref();
    game.map_or("", |game| &game.table.game_id)
}

/// Sends the following updates to this game.
fn select_game(session: &mut TournamentSession, game: &str) {
    game.clone_into(&mut session.game);
}

/// Requests a decision in this game.
fn ask(session: &mut TournamentSession, game: &str) {
    select_game(session, game);
    session.now_ms += 1_000;
    assert!(session.until_asked());
}

#[test]
fn the_game_that_asks_first_is_shown() {
    let mut session = three();
    assert!(
        session
            .screen()
            .contains("2 other games wait · ● connected")
    );
    ask(&mut session, "three");
    assert_eq!(shown(&session), "three");
    assert!(
        session
            .screen()
            .contains("2 other games wait · ● connected")
    );
    // Games that ask meanwhile wait until this one is answered, and follow in the order in which
    // they asked.
    ask(&mut session, "two");
    ask(&mut session, "one");
    assert_eq!(shown(&session), "three");
    assert!(session.screen().contains("2 other games ask · ● connected"));
    let answered = ["three", "two", "one"].map(|game| {
        assert_eq!(shown(&session), game);
        select_game(&mut session, game);
        session.answer();
        shown(&session).to_owned()
    });
    assert_eq!(answered, ["two", "one", "one"]);
    assert!(
        session
            .screen()
            .contains("2 other games wait · ● connected")
    );
}

/// While the person reads or answers a dialog, no other game replaces the screen.
#[test]
fn a_dialog_keeps_its_game_on_screen() {
    for (opens, closes) in [
        (KeyCode::PageUp, KeyCode::End),
        (KeyCode::Char('e'), KeyCode::Esc),
    ] {
        let mut session = three();
        session.press(opens);
        ask(&mut session, "two");
        assert_eq!(shown(&session), "one", "{opens:?}");
        assert!(session.screen().contains("1 other game asks"), "{opens:?}");
        session.press(closes);
        assert_eq!(shown(&session), "two", "{opens:?}");
    }
}

/// No game is lost: when one is over the next is shown.
#[test]
fn all_games_are_played_to_their_end() {
    let mut session = three();
    for (game, others) in [
        ("one", "2 other games wait"),
        ("two", "1 other game waits"),
        ("three", "● connected"),
    ] {
        select_game(&mut session, game);
        assert_eq!(shown(&session), game);
        assert!(session.play() > 3);
        let result = session.screen();
        assert!(result.contains("the game is over"), "{result}");
        assert!(result.contains(others), "{result}");
        assert_eq!(
            result.contains("Another of your games"),
            game != "three",
            "{result}"
        );
        session.press(KeyCode::Enter);
    }
    assert!(session.part.game.is_none());
    session.handle(PartInput::Tick);
    assert!(session.screen().contains("Your last game: "));
}
