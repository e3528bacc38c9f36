//! Shared by the tests of a person's part of a tournament: a tournament of eight, driven by data
//! and keys.

use std::collections::BTreeMap;

use chefshat_client::v1::{self, game_event::Kind, seat_update::Update};
use chefshat_engine::{ActionId, Seat, Viewer};
use ratatui::crossterm::event::KeyCode;

use super::app::Do;
use super::lobby::Report;
use super::part::{Part, PartInput};
use super::tests::shifts;
use super::view;
use crate::tui::screen::Key;
use crate::tui::testing::{Dealt, text};
use crate::tui::theme::Theme;

pub(super) const ME: u32 = 2;

/// A tournament of eight; the person is participant 2.
pub(super) struct TournamentSession {
    pub(super) part: Part,
    dealt: BTreeMap<String, Dealt>,
    /// The game that receives updates.
    pub(super) game: String,
    pub(super) now_ms: u64,
}

impl TournamentSession {
    pub(super) fn new() -> Self {
        let mut session = Self {
            part: Part::new(None),
            dealt: BTreeMap::new(),
            game: String::new(),
            now_ms: 0,
        };
        session.handle(PartInput::Entered(v1::Entered {
            tournament_id: "7ea82e54d878816e4e9bde8b21aa7dce".into(),
            participant: ME,
            ..v1::Entered::default()
        }));
        session
    }

    pub(super) fn handle(&mut self, heard: PartInput) -> Option<(String, Do)> {
        self.part.take(heard, self.now_ms)
    }

    pub(super) fn press(&mut self, code: KeyCode) -> Option<(String, Do)> {
        self.handle(PartInput::Key(Key::Code(code)))
    }

    pub(super) fn report(&mut self, report: Report) {
        self.handle(PartInput::Report(Box::new(report)));
    }

    fn receive(&mut self, update: Update) -> Option<(String, Do)> {
        let game = self.game.clone();
        self.handle(PartInput::Update(game, Box::new(update)))
    }

    /// The server seats the person in a new game.
    pub(super) fn seated(&mut self, game: &str) {
        let (dealt, mut events) = Dealt::new(&shifts(1), 3, Viewer::Seat(Seat::new(0)));
        self.dealt.insert(game.to_owned(), dealt);
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
        self.handle(PartInput::Seated(attached, None));
        self.receive(Update::Events(v1::EventBatch { events }));
    }

    fn apply(&mut self, action: ActionId) {
        let events = self.dealt.get_mut(&self.game).unwrap().apply(action);
        self.receive(Update::Events(v1::EventBatch { events }));
    }

    /// Lets the other seats decide until the person has a decision.
    pub(super) fn until_asked(&mut self) -> bool {
        loop {
            let dealt = self.dealt.get_mut(&self.game).unwrap();
            let Some(decision) = dealt.game.decision() else {
                return false;
            };
            if decision.seat.index() == 0 {
                let request = dealt.request();
                self.receive(Update::Decision(request));
                return true;
            }
            let first = dealt.game.legal_actions().nth(0).unwrap();
            self.apply(first);
        }
    }

    /// Plays the game to its end by keys. Returns the number of answers.
    pub(super) fn play(&mut self) -> usize {
        let mut answers = 0;
        while self.until_asked() {
            self.answer();
            answers += 1;
        }
        answers
    }

    /// Answers the open decision of the current game by keys.
    pub(super) fn answer(&mut self) {
        let picked = self.press(KeyCode::Enter);
        let what = picked.or_else(|| self.press(KeyCode::Char('p')));
        let (game, what) = what.expect("one of the two is legal");
        assert_eq!(game, self.game);
        let Do::Answer { action, .. } = what else {
            panic!("{what:?} is no answer");
        };
        self.apply(ActionId::new(u16::try_from(action).unwrap()));
    }

    pub(super) fn screen(&self) -> String {
        text(80, 24, |frame| {
            view::draw(frame, Theme::new(false), &self.part, self.now_ms);
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
        // The first participant can play two games at a time.
        max_games: if number == 0 { 2 } else { 1 },
        ..v1::TournamentParticipant::default()
    }
}

pub(super) fn game(
    number: u32,
    state: v1::TournamentGameState,
    seats: [u32; 4],
) -> v1::TournamentGame {
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

pub(super) fn report(
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
        is_searching: false,
    }
}
