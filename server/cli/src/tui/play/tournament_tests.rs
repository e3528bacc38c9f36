//! A person's part of a tournament, told by data and played by keys: the lobby, games one after the other, results between them, leaving. Several
//! games at a time are in `several_tests`.

use chefshat_client::v1;
use ratatui::crossterm::event::KeyCode;

use super::app::Link;
use super::friday::{Friday, ME, game, report};
use super::lobby::Report;
use super::part::{Heard, Over, Part};
use crate::tui::testing::as_kept;

use v1::TournamentFormat::{Knockout, RoundRobin, Swiss};
use v1::TournamentGameState::{Counted, Due, Playing as Called};
use v1::TournamentState::{Closed, Finished, Open, Playing};

#[test]
fn games_follow_each_other_with_result_and_standings_between() {
    let mut friday = Friday::new();
    assert!(friday.screen().contains("Waiting for the server"));
    friday.report(report(Swiss, Playing, vec![game(3, Due, [0, 1, ME, 5])]));
    let lobby = friday.screen();
    friday.seated("game one");
    assert!(friday.screen().contains("your hand"));
    assert!(friday.play() > 3);

    // The result stays for a while, with how the person stands.
    let result = friday.screen();
    assert!(result.contains("3rd of 8, score 2.00"), "{result}");
    friday.now_ms += 11_000;
    friday.hear(Heard::Tick);
    assert!(friday.screen().contains("the game is over"));
    friday.now_ms += 1_000;
    friday.hear(Heard::Tick);
    assert!(
        friday.screen().contains("Your last game: "),
        "{}",
        friday.screen()
    );

    // The next game begins by itself; one that begins while a result is shown waits a little, and less once it asks.
    friday.seated("game two");
    assert!(friday.play() > 3);
    friday.seated("game three");
    let result = friday.screen();
    assert!(
        result.contains("Another game of yours has begun"),
        "{result}"
    );
    assert!(friday.until_asked());
    friday.hear(Heard::Tick);
    assert!(friday.screen().contains("the game is over"));
    friday.now_ms += 3_000;
    friday.hear(Heard::Tick);
    assert!(friday.screen().contains("Your turn"), "{}", friday.screen());
    assert!(friday.play() > 3);
    friday.press(KeyCode::Enter);
    assert!(friday.part.game.is_none());

    friday.report(report(Swiss, Finished, Vec::new()));
    friday.hear(Heard::Over(None));
    let end = friday.screen();
    assert!(
        end.contains("final standings") && end.contains("Enter ends"),
        "{end}"
    );
    as_kept(&[("lobby.txt", lobby, include_str!("screens/lobby.txt"))]);
    friday.press(KeyCode::Enter);
    assert!(friday.part.left);
}

#[test]
fn the_lobby_says_what_comes() {
    let mine = [0, 1, ME, 5];
    let others = [3, 4, 6, 7];
    let table = [
        (report(Swiss, Open, vec![]), "It begins when 12 have joined"),
        (
            report(Swiss, Playing, vec![game(2, Due, mine)]),
            "Your next game: round 2, table 1, with greedy, Ben and Eve.",
        ),
        (
            report(Swiss, Playing, vec![game(2, Called, mine)]),
            "It waits for Eve (not here).",
        ),
        (
            report(
                Swiss,
                Playing,
                vec![game(2, Counted, mine), game(3, Called, others)],
            ),
            "At table 2: Cleo, Dan, Fay and trained.",
        ),
        (
            report(Swiss, Playing, vec![game(3, Called, others)]),
            "You have a bye in round 2 of 3.",
        ),
        (
            report(
                Swiss,
                Playing,
                vec![game(2, Due, mine), game(3, Called, [0, 1, 4, 6])],
            ),
            "It waits for Ben (plays at table 2) and Eve (not here).",
        ),
        (
            report(Knockout, Playing, vec![game(3, Called, others)]),
            "You are out",
        ),
        (
            report(RoundRobin, Playing, vec![]),
            "All your games are over",
        ),
        (
            Report {
                next: Some(game(5, Due, mine)),
                ..report(RoundRobin, Playing, vec![])
            },
            "Your next game: round 2, table 2",
        ),
        (report(Swiss, Closed, vec![]), "closed before its end"),
        (report(Swiss, Finished, vec![]), "The tournament is over"),
    ];
    for (told, words) in table {
        let mut friday = Friday::new();
        friday.report(told);
        let screen = friday.screen();
        assert!(screen.contains(words), "{words}: {screen}");
    }
}

/// Leaving asks where that can lose something, and only there.
#[test]
fn leaving_asks_while_games_are_to_come() {
    let mine = [0, 1, ME, 5];
    let table = [
        (report(Swiss, Open, vec![]), true),
        (report(Swiss, Playing, vec![game(2, Counted, mine)]), true),
        (report(RoundRobin, Playing, vec![game(2, Due, mine)]), true),
        (report(RoundRobin, Playing, vec![]), false),
        (report(Knockout, Playing, vec![]), false),
        (report(Swiss, Finished, vec![]), false),
    ];
    for (told, asks) in table {
        let words = format!("{:?} {:?}", told.format(), told.tournament.state());
        let mut friday = Friday::new();
        friday.report(told);
        friday.press(KeyCode::Char('q'));
        assert_eq!(friday.part.over.is_some(), asks, "{words}");
        assert_eq!(friday.part.left, !asks, "{words}");
    }
    let mut friday = Friday::new();
    friday.seated("game one");
    friday.press(KeyCode::Char('q'));
    assert_eq!(friday.part.over, Some(Over::Leave));
    assert!(friday.screen().contains("Leave the tournament?"));
    friday.press(KeyCode::Char('n'));
    assert!(friday.part.over.is_none() && !friday.part.left);
    friday.press(KeyCode::Esc);
    friday.press(KeyCode::Char('y'));
    assert!(friday.part.left);
}

#[test]
fn standings_are_looked_at_while_a_game_goes_on() {
    let mut friday = Friday::new();
    friday.report(report(Swiss, Playing, vec![]));
    friday.seated("game one");
    friday.press(KeyCode::Char('s'));
    assert!(
        friday.screen().contains("Any key goes back"),
        "{}",
        friday.screen()
    );
    friday.press(KeyCode::Enter);
    assert!(friday.screen().contains("your hand"));
    friday.press(KeyCode::Char('s'));
    // Being asked ends it.
    assert!(friday.until_asked());
    assert!(friday.screen().contains("Your turn"));
}

#[test]
fn a_connection_or_a_game_that_is_lost_is_shown() {
    let mut friday = Friday::new();
    friday.report(report(Swiss, Playing, vec![]));
    friday.hear(Heard::Lost("gone".into()));
    assert!(friday.screen().contains("being made again: gone"));
    friday.seated("game one");
    assert_eq!(friday.part.link, Link::Live);
    friday.hear(Heard::Gone("game one".into(), "the room is gone".into()));
    assert!(friday.screen().contains("the room is gone"));
    friday.press(KeyCode::Enter);
    assert!(
        friday.screen().contains("out of reach"),
        "{}",
        friday.screen()
    );
    friday.hear(Heard::Over(Some("another has it".into())));
    assert!(
        friday
            .screen()
            .contains("Your place is lost: another has it")
    );
    friday.press(KeyCode::Enter);
    assert!(friday.part.left);
    // The end may be told before the last report is.
    let mut friday = Friday::new();
    friday.report(report(Swiss, Playing, vec![game(3, Due, [0, 1, ME, 5])]));
    friday.hear(Heard::Unfollowed("unknown".into()));
    friday.hear(Heard::Over(None));
    let screen = friday.screen();
    assert!(
        screen.contains("The tournament is over.") && screen.contains("Enter ends."),
        "{screen}"
    );
    assert!(!screen.contains("next game"), "{screen}");
    // With a ticket that opens nothing there is nothing to show.
    let mut part = Part::new(None);
    part.take(Heard::Over(Some("unknown".into())), 0);
    assert!(part.left);
}
