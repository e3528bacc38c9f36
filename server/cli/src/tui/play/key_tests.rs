//! Keys that select cards, scroll the log, leave, send expressions, or take the seat back.

use chefshat_client::v1::{self, game_event::Kind, seat_update::Update};
use chefshat_engine::{ActionId, RuleSetSpec};
use ratatui::crossterm::event::KeyCode;

use super::app::{Dialog, Do, Input, MAX_LINE};
use super::keys::key_of;
use super::tests::{GameSession, shifts};
use crate::narration::words;
use crate::tui::screen::Key;

/// With decks of any size every stack has its own key, which the screen shows.
#[test]
fn every_stack_has_a_key() {
    let (mut pressed, mut added) = (0, 0);
    for (faces, seed) in [(11, 3), (15, 1), (15, 4), (4, 2)] {
        let rules = RuleSetSpec { faces, ..shifts(2) };
        let mut session = GameSession::new(&rules, seed);
        while session.until_asked() {
            let decision = &session.app.open.as_ref().unwrap().decision;
            if decision.kind() != v1::DecisionKind::SpecialAction {
                let stacks = decision.stacks.clone();
                for (at, stack) in stacks.iter().enumerate() {
                    let key = key_of(*stack).unwrap();
                    assert_eq!(session.press(KeyCode::Char(key)), None);
                    let decision = &session.app.open.as_ref().unwrap().decision;
                    assert_eq!(decision.at, at, "{key}");
                    pressed += 1;
                    if !stack.joker && stack.face >= 10 {
                        assert!(session.screen().contains(&format!("{key}━┓")), "{key}");
                    }
                    // The same key selects one more, if there are more.
                    let before = session.app.open.as_ref().unwrap().decision.quantity;
                    session.press(KeyCode::Char(key));
                    let after = session.app.open.as_ref().unwrap().decision.quantity;
                    let turn = session.app.open.as_ref().unwrap().decision.kind()
                        == v1::DecisionKind::Turn;
                    if turn && !stack.joker && before < stack.count {
                        assert_eq!(after, before + 1);
                        added += 1;
                    }
                }
                let request = session.dealt.request();
                session.receive(Update::Decision(request));
            }
            let what = session.act();
            session.answered(what);
        }
    }
    assert!(pressed > 100 && added > 20, "{pressed} {added}");
}

#[test]
fn a_key_without_cards_is_explained() {
    let mut session = GameSession::new(&shifts(1), 3);
    assert!(session.until_asked());
    let held = |session: &GameSession, key| {
        let decision = &session.app.open.as_ref().unwrap().decision;
        let mut stacks = decision.stacks.iter();
        stacks.any(|stack| key_of(*stack) == Some(key))
    };
    let mut missing = 0;
    for (key, words) in [
        ('1', "no 1"),
        ('2', "no 2"),
        ('3', "no 3"),
        ('f', "no 14"),
        ('J', "no joker"),
    ] {
        if !held(&session, key) {
            missing += 1;
            session.press(KeyCode::Char(key));
            assert!(session.app.notice.contains(words), "{key}");
        }
    }
    assert!(missing > 0);
}

#[test]
fn the_log_scrolls_back() {
    let mut session = GameSession::new(&shifts(2), 3);
    let mut turns = 0;
    while turns < 12 && session.until_asked() {
        let what = session.act();
        session.answered(what);
        turns += 1;
    }
    let first = "the game begins";
    assert!(!session.screen().contains(first));
    let picked = |session: &GameSession| session.app.open.as_ref().map(|open| open.decision.at);
    let before = picked(&session);
    for _ in 0..20 {
        session.press(KeyCode::PageUp);
    }
    let back = session.screen();
    assert!(
        back.contains(first) && back.contains("more after these"),
        "{back}"
    );
    // The hand stays visible; other keys close the log before they do anything else.
    assert!(back.contains("your hand"), "{back}");
    session.press(KeyCode::Right);
    assert_eq!(picked(&session), before);
    assert!(session.screen().contains("the pizza"));
    session.press(KeyCode::PageUp);
    session.press(KeyCode::PageDown);
    assert!(session.screen().contains("the pizza"));

    // The same after the end of the game.
    while session.until_asked() {
        let what = session.act();
        session.answered(what);
    }
    assert!(session.screen().contains("wins the game"));
    session.press(KeyCode::PageUp);
    let back = session.screen();
    assert!(
        !back.contains("wins the game") && back.contains("more after these"),
        "{back}"
    );
    session.press(KeyCode::Enter);
    assert!(session.screen().contains("wins the game") && !session.app.left);
}

/// In the narrowest window a line of the log is wrapped between words, not cut.
#[test]
fn long_lines_are_wrapped() {
    let mut session = GameSession::new(&shifts(1), 3);
    let restarted = v1::GameEvent {
        kind: Some(Kind::ServerRestarted(v1::ServerRestarted::default())),
        ..v1::GameEvent::default()
    };
    session.receive(Update::Events(v1::EventBatch {
        events: vec![restarted],
    }));
    let screen = session.screen();
    assert!(screen.contains("─ the server was"), "{screen}");
    assert!(screen.contains("  restarted"), "{screen}");
}

#[test]
fn leaving_asks_for_confirmation() {
    let mut session = GameSession::new(&shifts(1), 3);
    assert_eq!(session.press(KeyCode::Char('q')), None);
    assert_eq!(session.app.dialog, Some(Dialog::Leave));
    assert_eq!(session.press(KeyCode::Char('n')), None);
    assert!(session.app.dialog.is_none() && !session.app.left);
    session.press(KeyCode::Esc);
    assert_eq!(session.press(KeyCode::Char('y')), Some(Do::Leave));
    assert!(session.app.left);
    let mut session = GameSession::new(&shifts(1), 3);
    let interrupted = session.app.take(Input::Key(Key::Interrupt), 0);
    assert_eq!(interrupted, Some(Do::Leave));
}

#[test]
fn a_hint_selects_the_suggested_action() {
    let mut session = GameSession::new(&shifts(1), 3);
    assert_eq!(session.press(KeyCode::Char('h')), None);
    assert!(session.until_asked());
    let decision = session.app.open.as_ref().unwrap().decision.clone();
    let (id, legal) = (
        decision.request.decision_id,
        session.dealt.game.legal_actions(),
    );
    let asked = Do::AskHint {
        ticket: None,
        decision_id: id,
    };
    assert_eq!(session.press(KeyCode::Char('h')), Some(asked));
    assert!(session.screen().contains("The hint is being computed."));
    assert_eq!(session.press(KeyCode::Char('h')), None, "one at a time");
    let plays: Vec<ActionId> = (legal.iter()).filter(|it| *it != decision.pass()).collect();
    assert!(plays.len() > 1, "{plays:?}");
    for action in plays {
        let hint = v1::Hint {
            action: action.index().into(),
            actions: [(action, 2.5), (decision.pass(), 3.0)]
                .map(|(action, points)| v1::ActionEstimate {
                    action: action.index().into(),
                    points,
                    ..v1::ActionEstimate::default()
                })
                .into(),
        };
        session.app.take(Input::Hint(id, Ok(hint)), 0);
        let open = session.app.open.as_ref().unwrap();
        assert_eq!(open.decision.picked(), Some(action));
        let words = format!(
            "Hint, with expected points: {} 2.5 · pass 3.0",
            open.decision.words()
        );
        assert!(session.screen().contains(&words), "{}", session.screen());
    }

    // Another decision's, one without estimates, and none.
    let unestimated = || v1::Hint {
        action: decision.pass().index().into(),
        actions: Vec::new(),
    };
    session.app.take(Input::Hint(id + 1, Ok(unestimated())), 0);
    assert!(session.screen().contains("Hint, with"));
    session.app.take(Input::Hint(id, Ok(unestimated())), 0);
    assert!(session.screen().contains("Hint: pass."));
    session.press(KeyCode::Char('h'));
    let refused = Err("this room gives no hints".to_owned());
    session.app.take(Input::Hint(id, refused), 0);
    assert!(session.screen().contains("! this room gives no hints"));
}

#[test]
fn a_line_to_the_table_is_written_sent_and_shown() {
    let mut session = GameSession::new(&shifts(1), 3);
    for key in "tq d".chars() {
        assert_eq!(session.press(KeyCode::Char(key)), None);
    }
    assert!(session.screen().contains("q d▏"), "{}", session.screen());
    session.press(KeyCode::Backspace);
    // The line is kept.
    session.press(KeyCode::Esc);
    for key in "tup!".chars() {
        session.press(KeyCode::Char(key));
    }
    let said = session.press(KeyCode::Enter);
    assert_eq!(said, Some(Do::Say("q up!".to_owned())));
    for key in [KeyCode::Char('t'), KeyCode::Enter] {
        assert_eq!(session.press(key), None);
    }
    assert!(session.app.dialog.is_none());
    session.press(KeyCode::Char('t'));
    // What does not fit is refused at once.
    for (sign, most) in [('x', MAX_LINE), ('è', 41)] {
        for _ in 0..=MAX_LINE {
            session.press(KeyCode::Char(sign));
        }
        let line = &session.app.line;
        assert_eq!((line.chars().count(), words::fits(line)), (most, true));
        session.app.line.clear();
    }
    // The end of the game takes the line away, not the person's next keys.
    assert!(!session.app.ends_line(KeyCode::Esc) || session.app.dialog.is_none());
    let shown = v1::GameEvent {
        kind: Some(Kind::ExpressionShown(Box::new(v1::ExpressionShown {
            seat: 1,
            expression: Some(words::said("q up!")),
        }))),
        ..v1::GameEvent::default()
    };
    let events = vec![shown];
    session.receive(Update::Events(v1::EventBatch { events }));
    assert!(
        session.screen().contains("says “q up!”"),
        "{}",
        session.screen()
    );
}

#[test]
fn expressions_and_resuming_have_keys() {
    let mut session = GameSession::new(&shifts(1), 3);
    session.press(KeyCode::Char('e'));
    assert!(session.screen().contains("surprise"));
    assert_eq!(session.press(KeyCode::Char('3')), Some(Do::Express(2)));
    assert_eq!(session.press(KeyCode::Char('r')), None);
    let substituted = v1::GameEvent {
        kind: Some(Kind::Substituted(v1::Substituted {
            seat: 0,
            built_in_agent: "random".into(),
            for_good: false,
        })),
        ..v1::GameEvent::default()
    };
    let events = vec![substituted];
    session.receive(Update::Events(v1::EventBatch { events }));
    assert!(session.screen().contains("Press r"));
    assert_eq!(session.press(KeyCode::Char('r')), Some(Do::Resume));
    // Where no event says so.
    let substitution = |active| Update::Substitution(v1::Substitution { active });
    session.receive(substitution(false));
    assert!(!session.screen().contains("Press r"));
    session.receive(substitution(true));
    let screen = session.screen();
    assert!(screen.contains("Press r"), "{screen}");
    assert!(screen.contains("Ada is replaced by a "), "{screen}");
}
