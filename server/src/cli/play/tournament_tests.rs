//! A person's part of a tournament, told by data and played by keys: the lobby, games one after the other, results between them, leaving.

use chefshat_client::v1::{self, game_event::Kind, seat_update::Update};
use chefshat_engine::{Action, Seat, Viewer};
use ratatui::crossterm::event::KeyCode;

use super::super::terminal::look::Look;
use super::super::terminal::screen::Key;
use super::super::terminal::testing::{Dealt, as_kept, text};
use super::app::{Do, Link};
use super::lobby::Report;
use super::part::{Heard, Over, Part};
use super::tests::shifts;
use super::view;

const ME: u32 = 2;

/// A tournament of eight, in which the person is number 2.
struct Friday {
    part: Part,
    dealt: Option<Dealt>,
    game: String,
    now_ms: u64,
}

impl Friday {
    fn new() -> Self {
        let mut friday = Self {
            part: Part::new(None),
            dealt: None,
            game: String::new(),
            now_ms: 0,
        };
        friday.hear(Heard::Entered(v1::Entered {
            tournament_id: "7ea82e54d878816e4e9bde8b21aa7dce".into(),
            participant: ME,
            ..v1::Entered::default()
        }));
        friday
    }

    fn hear(&mut self, heard: Heard) -> Option<(String, Do)> {
        self.part.take(heard, self.now_ms)
    }

    fn press(&mut self, code: KeyCode) -> Option<(String, Do)> {
        self.hear(Heard::Key(Key::Code(code)))
    }

    fn report(&mut self, report: Report) {
        self.hear(Heard::Report(Box::new(report)));
    }

    fn tell(&mut self, update: Update) -> Option<(String, Do)> {
        let game = self.game.clone();
        self.hear(Heard::Told(game, Box::new(update)))
    }

    /// The server seats the person in a new game.
    fn seated(&mut self, game: &str) {
        let (dealt, mut events) = Dealt::new(&shifts(1), 3, Viewer::Seat(Seat::new(0)));
        self.dealt = Some(dealt);
        game.clone_into(&mut self.game);
        for event in &mut events {
            if let Some(Kind::GameStarted(start)) = &mut event.kind {
                game.clone_into(&mut start.game_id);
            }
        }
        let attached = v1::Attached {
            game_id: game.to_owned(),
            tournament_id: "7ea82e54d878816e4e9bde8b21aa7dce".into(),
            ..v1::Attached::default()
        };
        self.hear(Heard::Seated(attached, None));
        self.tell(Update::Events(v1::EventBatch { events }));
    }

    fn apply(&mut self, action: Action) {
        let events = self.dealt.as_mut().unwrap().apply(action);
        self.tell(Update::Events(v1::EventBatch { events }));
    }

    /// Has the others decide until the person is asked.
    fn until_asked(&mut self) -> bool {
        loop {
            let dealt = self.dealt.as_mut().unwrap();
            let Some(decision) = dealt.game.decision() else {
                return false;
            };
            if decision.seat.index() == 0 {
                let request = dealt.request();
                self.tell(Update::Decision(request));
                return true;
            }
            let first = dealt.game.legal_actions().nth(0).unwrap();
            self.apply(first);
        }
    }

    /// Plays the game to its end by keys; gives the number of answers.
    fn play(&mut self) -> usize {
        let mut answers = 0;
        while self.until_asked() {
            let picked = self.press(KeyCode::Enter);
            let what = picked.or_else(|| self.press(KeyCode::Char('p')));
            let (game, what) = what.expect("one of the two is legal");
            assert_eq!(game, self.game);
            let Do::Answer { action, .. } = what else {
                panic!("{what:?} is no answer");
            };
            answers += 1;
            self.apply(Action::new(u16::try_from(action).unwrap()));
        }
        answers
    }

    fn screen(&self) -> String {
        text(80, 24, |frame| {
            view::draw(frame, Look::new(false), &self.part, self.now_ms);
        })
    }
}

fn participant(number: u32, name: &str) -> v1::TournamentParticipant {
    v1::TournamentParticipant {
        participant: number,
        name: name.into(),
        kind: if number == ME {
            v1::ParticipantKind::Human
        } else {
            v1::ParticipantKind::Agent
        }
        .into(),
        connected: number != 5,
        // The first can play two games at a time.
        max_games: if number == 0 { 2 } else { 1 },
        ..v1::TournamentParticipant::default()
    }
}

fn game(number: u32, state: v1::TournamentGameState, seats: [u32; 4]) -> v1::TournamentGame {
    let seats = seats.map(|participant| v1::TournamentGameSeat {
        participant,
        ..v1::TournamentGameSeat::default()
    });
    v1::TournamentGame {
        game: number,
        round: 2,
        table: number % 2 + 1,
        state: state.into(),
        seats: seats.into(),
        ..v1::TournamentGame::default()
    }
}

fn report(
    format: v1::TournamentFormat,
    state: v1::TournamentState,
    games: Vec<v1::TournamentGame>,
) -> Report {
    let names = [
        "greedy", "Ben", "Ada", "Cleo", "Dan", "Eve", "Fay", "trained",
    ];
    let standings = (1..).zip([1, 0, ME, 4, 3, 7, 6, 5]);
    let standings = standings.map(|(place, participant)| v1::TournamentStanding {
        place,
        participant,
        games: 1,
        score: u64::from(8 - place) / 2,
        places: vec![u32::from(place < 3)],
        last_round: if participant == ME { 1 } else { 2 },
        ..v1::TournamentStanding::default()
    });
    Report {
        tournament: v1::Tournament {
            settings: Some(v1::TournamentSettings {
                name: "friday".into(),
                format: format.into(),
                no_show_time_ms: 60_000,
                max_calls: 2,
                start_when_joined: 12,
                ..v1::TournamentSettings::default()
            }),
            state: state.into(),
            participants: (0..)
                .zip(names)
                .map(|(at, name)| participant(at, name))
                .collect(),
            round: 2,
            rounds: 3,
            games: 6,
            games_over: 3,
            ..v1::Tournament::default()
        },
        standings: standings.collect(),
        games,
        next: None,
    }
}

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
    assert!(result.contains("Your next game has begun"), "{result}");
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
    // With a ticket that opens nothing there is nothing to show.
    let mut part = Part::new(None);
    part.take(Heard::Over(Some("unknown".into())), 0);
    assert!(part.left);
}
