//! Games played by keys, and the contents of the screen.

use chefshat_client::v1::{self, game_event::Kind, seat_command::Command, seat_update::Update};
use chefshat_engine::{ActionId, DecisionKind, RuleSetSpec, Seat, Stop, Viewer};
use ratatui::crossterm::event::KeyCode;

use super::app::{App, Do, Input, Link};
use super::run::command;
use super::view;
use crate::narration::view::GameView;
use crate::tui::screen::Key;
use crate::tui::testing::{Dealt, assert_screens, text};
use crate::tui::theme::Theme;

const ME: Viewer = Viewer::Seat(Seat::new(0));

/// A game whose seat 0 is played by keys.
pub(super) struct GameSession {
    pub(super) dealt: Dealt,
    pub(super) app: App,
    pub(super) now_ms: u64,
}

impl GameSession {
    pub(super) fn new(rules: &RuleSetSpec, seed: u8) -> Self {
        let (dealt, events) = Dealt::new(rules, seed, ME);
        let mut session = Self {
            dealt,
            app: App::new(GameView::default(), Some(0)),
            now_ms: 0,
        };
        session.receive(Update::Attached(v1::Attached::default()));
        session.receive(Update::Events(v1::EventBatch { events }));
        session
    }

    pub(super) fn receive(&mut self, update: Update) -> Option<Do> {
        let input = Input::Update(Box::new(update));
        self.app.take(input, self.now_ms)
    }

    pub(super) fn press(&mut self, code: KeyCode) -> Option<Do> {
        self.app.take(Input::Key(Key::Code(code)), self.now_ms)
    }

    pub(super) fn apply(&mut self, action: ActionId) {
        let events = self.dealt.apply(action);
        self.receive(Update::Events(v1::EventBatch { events }));
    }

    /// Lets the other seats decide, by default or the first legal action, until seat 0 has a
    /// decision.
    pub(super) fn until_asked(&mut self) -> bool {
        while let Some(decision) = self.dealt.game.decision() {
            if decision.seat.index() == 0 {
                let request = self.dealt.request();
                self.receive(Update::Decision(request));
                return true;
            }
            let first = self.dealt.game.legal_actions().nth(0).unwrap();
            self.apply(first);
        }
        false
    }

    /// Takes the selected action, or passes if it is illegal.
    pub(super) fn act(&mut self) -> Do {
        let picked = self.press(KeyCode::Enter);
        let what = picked.or_else(|| self.press(KeyCode::Char('p')));
        what.expect("one of the two is legal")
    }

    /// The server processes an answer.
    pub(super) fn answered(&mut self, what: Do) {
        let Do::Answer {
            decision_id,
            action,
            ..
        } = what
        else {
            panic!("{what:?} is no answer");
        };
        self.receive(Update::Result(v1::AnswerResult {
            decision_id,
            action,
            status: v1::AnswerStatus::Accepted.into(),
            ..v1::AnswerResult::default()
        }));
        self.apply(ActionId::new(u16::try_from(action).unwrap()));
    }

    pub(super) fn screen(&self) -> String {
        text(80, 24, |frame| {
            view::draw_game(frame, Theme::new(false), &self.app, self.now_ms);
        })
    }
}

pub(super) fn shifts(shifts: u32) -> RuleSetSpec {
    RuleSetSpec {
        stop: Stop::Shifts(shifts),
        ..RuleSetSpec::default()
    }
}

#[test]
fn a_pause_or_correction_at_a_physical_table_renews_the_decision() {
    let mut session = GameSession::new(&shifts(1), 1);
    session.app.table.history = Some(Box::default());
    assert!(session.until_asked());
    let happens = |session: &mut GameSession, kind| {
        let event = v1::GameEvent {
            kind: Some(kind),
            ..v1::GameEvent::default()
        };
        let events = vec![event];
        session.receive(Update::Events(v1::EventBatch { events }));
    };
    let full = session.app.clock(0);
    session.now_ms = 1;
    assert_ne!(session.app.clock(1), full);
    happens(
        &mut session,
        Kind::TablePaused(v1::TablePaused { paused: true }),
    );
    assert_eq!(session.app.clock(1), None);
    assert!(session.screen().contains("· paused"));
    session.now_ms = 5000;
    happens(
        &mut session,
        Kind::TablePaused(v1::TablePaused { paused: false }),
    );
    assert_eq!(session.app.clock(5000), full);
    happens(
        &mut session,
        Kind::Correction(Box::new(v1::Correction {
            first_void: u64::MAX,
            ..v1::Correction::default()
        })),
    );
    assert!(session.app.open.is_none() && session.app.notice.is_empty());
}

#[test]
fn cards_at_a_physical_table_are_awaited() {
    let mut session = GameSession::new(&shifts(1), 1);
    assert!(!session.screen().contains("Your cards are on their way"));
    session.app.table.history = Some(Box::default());
    session.app.table.seats[0].hand = None;
    let screen = session.screen();
    assert!(screen.contains("Your cards are on their way"), "{screen}");
    assert!(screen.contains("has shown them."), "{screen}");
}

/// Every legal action can be selected by keys, and a selection has an objection exactly if it is
/// illegal.
#[test]
fn complete_games_are_played_by_keys() {
    let (mut kinds, mut objections) = ([0; 3], 0);
    for seed in 0..6 {
        let mut session = GameSession::new(&shifts(4), seed);
        while session.until_asked() {
            let decision = session.dealt.game.decision().unwrap();
            kinds[decision.kind as usize] += 1;
            let legal = session.dealt.game.legal_actions();
            let (reached, refused) = all_selections(&mut session);
            objections += refused;
            let mut missing = legal.iter().filter(|action| !reached.contains(action));
            let pass = session.app.open.as_ref().unwrap().decision.pass();
            assert_eq!(missing.find(|action| *action != pass), None);

            let passes = session.press(KeyCode::Char('p'));
            assert_eq!(passes.is_some(), legal.contains(pass));
            session.app.open.as_mut().unwrap().sent = false;
            // The initial selection is legal, unless nothing can be played.
            let request = session.dealt.request();
            session.receive(Update::Decision(request));
            let what = session.act();
            session.answered(what);
            assert!(session.app.open.is_none());
        }
        assert!(session.app.table.end.is_some());
        let end = session.screen();
        assert!(end.contains("wins the game"), "{end}");
        assert!(end.contains(&session.app.table.game_id), "{end}");
        assert_eq!(session.press(KeyCode::Enter), Some(Do::Leave));
    }
    let [turns, exchanges, _specials] = kinds;
    assert!(
        turns > 100 && exchanges > 3 && objections > 100,
        "{kinds:?} {objections}"
    );
}

/// All possible selections: the legal actions, and the number of others, each with its reason.
fn all_selections(session: &mut GameSession) -> (Vec<ActionId>, usize) {
    let legal = session.dealt.game.legal_actions();
    let (mut reached, mut refused) = (Vec::new(), 0);
    let stacks = session.app.open.as_ref().unwrap().decision.stacks.len();
    for _ in 0..stacks.max(2) {
        session.press(KeyCode::Right);
        for _ in 0..20 {
            session.press(KeyCode::Down);
        }
        for _ in 0..12 {
            for _ in 0..3 {
                let decision = &session.app.open.as_ref().unwrap().decision;
                let picked = decision.picked().unwrap();
                let objection = decision.objection();
                assert_eq!(objection.is_none(), legal.contains(picked), "{objection:?}");
                match objection {
                    None => reached.push(picked),
                    Some(why) => {
                        refused += 1;
                        // A refused key only explains why.
                        assert_eq!(session.press(KeyCode::Enter), None);
                        assert_eq!(session.app.notice, why);
                    }
                }
                // In an exchange this is the key of the jokers, which would restart the selection.
                if session.app.open.as_ref().unwrap().decision.kind() == v1::DecisionKind::Turn {
                    session.press(KeyCode::Char('j'));
                }
            }
            session.press(KeyCode::Up);
        }
    }
    (reached, refused)
}

#[test]
fn a_special_action_is_declared_or_declined_by_a_key() {
    let mut offered = 0;
    for seed in 0..60 {
        let mut session = GameSession::new(&shifts(3), seed);
        while session.until_asked() {
            let decision = session.dealt.game.decision().unwrap();
            let what = match decision.kind {
                DecisionKind::SpecialAction => {
                    offered += 1;
                    assert!(
                        session.screen().contains("Two jokers!"),
                        "{}",
                        session.screen()
                    );
                    let key = ['d', 'n'][offered % 2];
                    session.press(KeyCode::Char(key)).unwrap()
                }
                _ => session.act(),
            };
            session.answered(what);
        }
    }
    assert!(offered > 1, "{offered} were offered");
}

#[test]
fn the_screen_shows_the_request() {
    let mut session = GameSession::new(&shifts(2), 3);
    assert!(session.until_asked());
    session.now_ms += 12_500;
    let first = session.screen();
    for _ in 0..5 {
        let what = session.act();
        session.answered(what);
        assert!(session.until_asked());
    }
    session.press(KeyCode::Left);
    let later = session.screen();
    session.press(KeyCode::Char('?'));
    assert_screens(&[
        ("first.txt", first, include_str!("screens/first.txt")),
        ("later.txt", later, include_str!("screens/later.txt")),
        (
            "help.txt",
            session.screen(),
            include_str!("screens/help.txt"),
        ),
    ]);
}

#[test]
fn windows_of_any_size_are_drawn() {
    let spec = RuleSetSpec {
        players: 6,
        faces: 15,
        ..shifts(1)
    };
    let mut session = GameSession::new(&spec, 1);
    assert!(session.until_asked());
    for (columns, rows) in [
        (1, 1),
        (20, 5),
        (79, 24),
        (80, 23),
        (80, 24),
        (100, 30),
        (250, 90),
    ] {
        let screen = text(columns, rows, |frame| {
            view::draw_game(frame, Theme::new(true), &session.app, 0);
        });
        let drawn = screen.contains("your hand");
        assert_eq!(drawn, columns >= 80 && rows >= 24, "{screen}");
    }
}

#[test]
fn a_lost_answer_is_sent_again() {
    let mut session = GameSession::new(&shifts(1), 3);
    assert!(session.until_asked());
    session.now_ms = 4_000;
    let first = session.press(KeyCode::Enter).unwrap();
    let Do::Answer {
        decision_id,
        action,
        took_ms,
    } = first
    else {
        panic!("{first:?}");
    };
    assert_eq!(took_ms, 4_000);
    // Repeated keys send nothing twice.
    assert_eq!(session.press(KeyCode::Enter), None);
    session.app.take(Input::Lost("gone".into()), 5_000);
    assert!(session.screen().contains("Connection lost, reconnecting"));
    assert_eq!(session.press(KeyCode::Enter), None);
    session.now_ms = 9_000;
    session.receive(Update::Attached(v1::Attached::default()));
    assert_eq!(session.app.link, Link::Live);
    let again = session.dealt.request();
    let again = v1::DecisionRequest {
        decision_id,
        ..again
    };
    let answer = session.receive(Update::Decision(again));
    let the_same = Do::Answer {
        decision_id,
        action,
        took_ms,
    };
    assert_eq!(answer, Some(the_same));
}

#[test]
fn what_is_said_without_a_connection_is_kept_until_there_is_one() {
    let mut session = GameSession::new(&shifts(1), 3);
    session.app.take(Input::Lost("gone".into()), 0);
    let write = [KeyCode::Char('t'), KeyCode::Char('x'), KeyCode::Enter];
    for key in write {
        assert_eq!(session.press(key), None);
    }
    assert_eq!(session.app.line, "x");
    assert!(session.app.notice.starts_with("not sent"));
    session.press(KeyCode::Char('e'));
    assert_eq!(session.press(KeyCode::Char('1')), None);
    session.receive(Update::Attached(v1::Attached::default()));
    session.press(KeyCode::Char('t'));
    assert_eq!(session.press(KeyCode::Enter), Some(Do::Say("x".into())));
}

/// Times are recorded only on request.
#[test]
fn times_are_sent_only_on_request() {
    let annotations = |took_ms, times| {
        let what = Do::Answer {
            decision_id: 1,
            action: 2,
            took_ms,
        };
        match command(what, times) {
            Some(Command::Answer(answer)) => answer.annotations,
            other => panic!("{other:?}"),
        }
    };
    assert_eq!(annotations(4_000, false), None);
    assert_eq!(annotations(0, true), None);
    let noted = annotations(4_000, true).unwrap().extra;
    assert_eq!(noted["person_decision_time_ms"], "4000");
}

#[test]
fn the_result_of_an_answer_is_shown() {
    let table = [
        (v1::AnswerStatus::Invalid, "not so", true),
        (v1::AnswerStatus::Closed, "too late", false),
        (v1::AnswerStatus::Accepted, "", false),
    ];
    for (status, words, stays) in table {
        let mut session = GameSession::new(&shifts(1), 3);
        assert!(session.until_asked());
        let Some(Do::Answer {
            decision_id,
            action,
            ..
        }) = session.press(KeyCode::Enter)
        else {
            panic!("an answer");
        };
        session.receive(Update::Result(v1::AnswerResult {
            decision_id,
            action,
            status: status.into(),
            detail: words.into(),
            ..v1::AnswerResult::default()
        }));
        assert!(session.app.notice.contains(words), "{status:?}");
        let open = session.app.open.as_ref().filter(|open| !open.sent);
        assert_eq!(open.is_some(), stays, "{status:?}");
    }
}

#[test]
fn a_decision_taken_by_the_server_is_closed() {
    let mut session = GameSession::new(&shifts(1), 3);
    assert!(session.until_asked());
    let default = session.dealt.game.default_action().unwrap();
    session.apply(default);
    assert!(session.app.open.is_none());
    assert!(session.screen().contains("too late"));
    assert_eq!(session.press(KeyCode::Enter), None);
    // The next decision removes the notice.
    assert!(session.until_asked());
    assert!(!session.screen().contains("too late"));
}

#[test]
fn the_clock_continues_with_the_bank() {
    let mut session = GameSession::new(&shifts(1), 3);
    assert!(session.until_asked());
    let table = [
        (0, 30_000, 60_000),
        (29_999, 1, 60_000),
        (31_000, 0, 59_000),
        (600_000, 0, 0),
    ];
    for (now, time, bank) in table {
        assert_eq!(session.app.clock(now), Some((time, bank)));
    }
}
