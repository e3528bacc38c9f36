//! A person's part of a tournament, driven by data and keys: the lobby, consecutive games, results
//! between them, leaving. Several games at a time are in `several_tests`.

use chefshat_client::v1;
use ratatui::crossterm::event::KeyCode;

use super::app::Link;
use super::lobby::Report;
use super::part::{Over, Part, PartInput};
use super::tournament_session::{ME, TournamentSession, game, report};
use crate::tui::testing::assert_screens;

use v1::TournamentFormat::{Knockout, RoundRobin, Swiss};
use v1::TournamentGameState::{Counted, Due, Playing as Called};
use v1::TournamentState::{Closed, Finished, Open, Playing};

#[test]
fn games_follow_each_other_with_results_between() {
    let mut session = TournamentSession::new();
    assert!(session.screen().contains("Waiting for the state"));
    session.report(report(Swiss, Playing, vec![game(3, Due, [0, 1, ME, 5])]));
    let lobby = session.screen();
    session.seated("game one");
    assert!(session.screen().contains("your hand"));
    assert!(session.play() > 3);

    // The result stays for a while, with the person's standing.
    let result = session.screen();
    assert!(result.contains("3rd of 8, score 2.00"), "{result}");
    session.now_ms += 11_000;
    session.handle(PartInput::Tick);
    assert!(session.screen().contains("the game is over"));
    session.now_ms += 1_000;
    session.handle(PartInput::Tick);
    assert!(
        session.screen().contains("Your last game: "),
        "{}",
        session.screen()
    );

    // The next game starts by itself. A game that starts while a result is shown waits a little,
    // and less once it has a decision.
    session.seated("game two");
    assert!(session.play() > 3);
    session.seated("game three");
    let result = session.screen();
    assert!(
        result.contains("Another of your games has started"),
        "{result}"
    );
    assert!(session.until_asked());
    session.handle(PartInput::Tick);
    assert!(session.screen().contains("the game is over"));
    session.now_ms += 3_000;
    session.handle(PartInput::Tick);
    assert!(
        session.screen().contains("Your turn"),
        "{}",
        session.screen()
    );
    assert!(session.play() > 3);
    session.press(KeyCode::Enter);
    assert!(session.part.game.is_none());

    session.report(report(Swiss, Finished, Vec::new()));
    session.handle(PartInput::Over(None));
    let end = session.screen();
    assert!(
        end.contains("final standings") && end.contains("q ends"),
        "{end}"
    );
    assert_screens(&[("lobby.txt", lobby, include_str!("screens/lobby.txt"))]);
    // A second Enter for the result does not hide the final standings.
    session.press(KeyCode::Enter);
    assert!(!session.part.left);
    session.press(KeyCode::Char('q'));
    assert!(session.part.left);
}

#[test]
fn the_lobby_shows_what_comes_next() {
    let mine = [0, 1, ME, 5];
    let others = [3, 4, 6, 7];
    let table = [
        (report(Swiss, Open, vec![]), "It starts when 12 have joined"),
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
            "You are eliminated",
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
    for (report, words) in table {
        let mut session = TournamentSession::new();
        session.report(report);
        let screen = session.screen();
        assert!(screen.contains(words), "{words}: {screen}");
    }
}

/// Leaving asks for confirmation only if it may lose something.
#[test]
fn leaving_asks_while_games_remain() {
    let mine = [0, 1, ME, 5];
    let table = [
        (report(Swiss, Open, vec![]), true),
        (report(Swiss, Playing, vec![game(2, Counted, mine)]), true),
        (report(RoundRobin, Playing, vec![game(2, Due, mine)]), true),
        (report(RoundRobin, Playing, vec![]), false),
        (report(Knockout, Playing, vec![]), false),
        (report(Swiss, Finished, vec![]), false),
    ];
    for (report, asks) in table {
        let words = format!("{:?} {:?}", report.format(), report.tournament.state());
        let mut session = TournamentSession::new();
        session.report(report);
        session.press(KeyCode::Char('q'));
        assert_eq!(session.part.over.is_some(), asks, "{words}");
        assert_eq!(session.part.left, !asks, "{words}");
    }
    let mut session = TournamentSession::new();
    session.seated("game one");
    session.press(KeyCode::Char('q'));
    assert_eq!(session.part.over, Some(Over::Leave));
    assert!(session.screen().contains("Leave the tournament?"));
    session.press(KeyCode::Char('n'));
    assert!(session.part.over.is_none() && !session.part.left);
    session.press(KeyCode::Esc);
    session.press(KeyCode::Char('y'));
    assert!(session.part.left);
}

#[test]
fn standings_are_shown_during_a_game() {
    let mut session = TournamentSession::new();
    session.report(report(Swiss, Playing, vec![]));
    session.seated("game one");
    session.press(KeyCode::Char('s'));
    assert!(
        session.screen().contains("Any key returns"),
        "{}",
        session.screen()
    );
    session.press(KeyCode::Enter);
    assert!(session.screen().contains("your hand"));
    session.press(KeyCode::Char('s'));
    // A new decision closes them.
    assert!(session.until_asked());
    assert!(session.screen().contains("Your turn"));
}

#[test]
fn lost_connections_and_games_are_shown() {
    let mut session = TournamentSession::new();
    session.report(report(Swiss, Playing, vec![]));
    session.handle(PartInput::Lost("gone".into()));
    assert!(session.screen().contains("reconnecting: gone"));
    session.seated("game one");
    assert_eq!(session.part.link, Link::Live);
    session.handle(PartInput::Gone(
        "game one".into(),
        "the room is gone".into(),
    ));
    assert!(session.screen().contains("the room is gone"));
    session.press(KeyCode::Enter);
    assert!(
        session.screen().contains("unavailable"),
        "{}",
        session.screen()
    );
    session.handle(PartInput::Over(Some("another has it".into())));
    assert!(
        session
            .screen()
            .contains("Your place is lost: another has it")
    );
    session.press(KeyCode::Char('q'));
    assert!(session.part.left);
    // The end may arrive before the last report.
    let mut session = TournamentSession::new();
    session.report(report(Swiss, Playing, vec![game(3, Due, [0, 1, ME, 5])]));
    session.handle(PartInput::Unfollowed("unknown".into()));
    session.handle(PartInput::Over(None));
    let screen = session.screen();
    assert!(
        screen.contains("The tournament is over.") && screen.contains("q ends."),
        "{screen}"
    );
    assert!(!screen.contains("next game"), "{screen}");
    // With an invalid ticket there is nothing to show.
    let mut part = Part::new(None);
    part.take(PartInput::Over(Some("unknown".into())), 0);
    assert!(part.left);
}
