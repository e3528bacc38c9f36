//! A place whose ticket has several games at a time, as one that another program had before may: one is on the screen, the others wait for it.

use chefshat_client::v1::{TournamentFormat::Swiss, TournamentState::Playing};
use ratatui::crossterm::event::KeyCode;

use super::friday::{Friday, report};
use super::part::Heard;

/// A person with three games, of which the first is on the screen.
fn three() -> Friday {
    let mut friday = Friday::new();
    friday.report(report(Swiss, Playing, Vec::new()));
    for game in ["one", "two", "three"] {
        friday.seated(game);
    }
    assert_eq!(shown(&friday), "one");
    friday
}

/// The game on the screen.
fn shown(friday: &Friday) -> &str {
    let game = friday.part.game.as_ref();
    game.map_or("", |game| &game.table.game_id)
}

/// What is told from now on is of this game.
fn turn_to(friday: &mut Friday, game: &str) {
    game.clone_into(&mut friday.game);
}

/// The server asks in this game.
fn ask(friday: &mut Friday, game: &str) {
    turn_to(friday, game);
    friday.now_ms += 1_000;
    assert!(friday.until_asked());
}

#[test]
fn the_game_that_asks_first_is_shown() {
    let mut friday = three();
    assert!(friday.screen().contains("2 other games wait · ● connected"));
    ask(&mut friday, "three");
    assert_eq!(shown(&friday), "three");
    assert!(friday.screen().contains("2 other games wait · ● connected"));
    // Those that ask meanwhile wait until this one has its answer, and come in the order in which they asked.
    ask(&mut friday, "two");
    ask(&mut friday, "one");
    assert_eq!(shown(&friday), "three");
    assert!(friday.screen().contains("2 other games ask · ● connected"));
    let answered = ["three", "two", "one"].map(|game| {
        assert_eq!(shown(&friday), game);
        turn_to(&mut friday, game);
        friday.answer();
        shown(&friday).to_owned()
    });
    assert_eq!(answered, ["two", "one", "one"]);
    assert!(friday.screen().contains("2 other games wait · ● connected"));
}

/// While the person reads or is asked something else, no other game takes the screen.
#[test]
fn what_the_person_looks_at_stays() {
    for (opens, closes) in [
        (KeyCode::PageUp, KeyCode::End),
        (KeyCode::Char('e'), KeyCode::Esc),
    ] {
        let mut friday = three();
        friday.press(opens);
        ask(&mut friday, "two");
        assert_eq!(shown(&friday), "one", "{opens:?}");
        assert!(friday.screen().contains("1 other game asks"), "{opens:?}");
        friday.press(closes);
        assert_eq!(shown(&friday), "two", "{opens:?}");
    }
}

/// None is lost: when one is over the next is shown, to the last.
#[test]
fn all_games_are_played_to_their_end() {
    let mut friday = three();
    for (game, others) in [
        ("one", "2 other games wait"),
        ("two", "1 other game waits"),
        ("three", "● connected"),
    ] {
        turn_to(&mut friday, game);
        assert_eq!(shown(&friday), game);
        assert!(friday.play() > 3);
        let result = friday.screen();
        assert!(result.contains("the game is over"), "{result}");
        assert!(result.contains(others), "{result}");
        assert_eq!(result.contains("Another game"), game != "three", "{result}");
        friday.press(KeyCode::Enter);
    }
    assert!(friday.part.game.is_none());
    friday.hear(Heard::Tick);
    assert!(friday.screen().contains("Your last game: "));
}
