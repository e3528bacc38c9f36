//! The keys that name cards, those that go back in what happened, and those that leave, show a feeling or take a seat back.

use chefshat_client::v1::{self, game_event::Kind, seat_update::Update};
use chefshat_engine::RuleSetSpec;
use ratatui::crossterm::event::KeyCode;

use super::app::{Dialog, Do, Input};
use super::keys::key_of;
use super::tests::{Evening, shifts};
use crate::tui::screen::Key;

/// In decks of any size every stack has a key of its own, which picks it, and the screen says which.
#[test]
fn every_stack_has_its_key() {
    let (mut pressed, mut added) = (0, 0);
    for (faces, seed) in [(11, 3), (15, 1), (15, 4), (4, 2)] {
        let rules = RuleSetSpec { faces, ..shifts(2) };
        let mut evening = Evening::new(&rules, seed);
        while evening.until_asked() {
            let decision = &evening.app.open.as_ref().unwrap().decision;
            if decision.kind() != v1::DecisionKind::SpecialAction {
                let stacks = decision.stacks.clone();
                for (at, stack) in stacks.iter().enumerate() {
                    let key = key_of(*stack).unwrap();
                    assert_eq!(evening.press(KeyCode::Char(key)), None);
                    let decision = &evening.app.open.as_ref().unwrap().decision;
                    assert_eq!(decision.at, at, "{key}");
                    pressed += 1;
                    if !stack.joker && stack.face >= 10 {
                        assert!(evening.screen().contains(&format!("{key}━┓")), "{key}");
                    }
                    // Again: one more of them, where there are more.
                    let before = evening.app.open.as_ref().unwrap().decision.quantity;
                    evening.press(KeyCode::Char(key));
                    let after = evening.app.open.as_ref().unwrap().decision.quantity;
                    let turn = evening.app.open.as_ref().unwrap().decision.kind()
                        == v1::DecisionKind::Turn;
                    if turn && !stack.joker && before < stack.count {
                        assert_eq!(after, before + 1);
                        added += 1;
                    }
                }
                let request = evening.dealt.request();
                evening.tell(Update::Decision(request));
            }
            let what = evening.act();
            evening.answered(what);
        }
    }
    assert!(pressed > 100 && added > 20, "{pressed} {added}");
}

#[test]
fn a_key_without_cards_says_so() {
    let mut evening = Evening::new(&shifts(1), 3);
    assert!(evening.until_asked());
    let held = |evening: &Evening, key| {
        let decision = &evening.app.open.as_ref().unwrap().decision;
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
        if !held(&evening, key) {
            missing += 1;
            evening.press(KeyCode::Char(key));
            assert!(evening.app.notice.contains(words), "{key}");
        }
    }
    assert!(missing > 0);
}

#[test]
fn what_happened_is_scrolled_back() {
    let mut evening = Evening::new(&shifts(2), 3);
    let mut turns = 0;
    while turns < 12 && evening.until_asked() {
        let what = evening.act();
        evening.answered(what);
        turns += 1;
    }
    let first = "the game begins";
    assert!(!evening.screen().contains(first));
    let picked = |evening: &Evening| evening.app.open.as_ref().map(|open| open.decision.at);
    let before = picked(&evening);
    for _ in 0..20 {
        evening.press(KeyCode::PageUp);
    }
    let back = evening.screen();
    assert!(
        back.contains(first) && back.contains("more after these"),
        "{back}"
    );
    // The hand stays to be seen, and other keys give the table back before they mean anything else.
    assert!(back.contains("your hand"), "{back}");
    evening.press(KeyCode::Right);
    assert_eq!(picked(&evening), before);
    assert!(evening.screen().contains("the pizza"));
    evening.press(KeyCode::PageUp);
    evening.press(KeyCode::PageDown);
    assert!(evening.screen().contains("the pizza"));

    // So it is when the game is over.
    while evening.until_asked() {
        let what = evening.act();
        evening.answered(what);
    }
    assert!(evening.screen().contains("wins the game"));
    evening.press(KeyCode::PageUp);
    let back = evening.screen();
    assert!(
        !back.contains("wins the game") && back.contains("more after these"),
        "{back}"
    );
    evening.press(KeyCode::Enter);
    assert!(evening.screen().contains("wins the game") && !evening.app.left);
}

/// In the narrowest window a line of the story is broken between words, not cut.
#[test]
fn long_lines_are_wrapped() {
    let mut evening = Evening::new(&shifts(1), 3);
    let restarted = v1::GameEvent {
        kind: Some(Kind::ServerRestarted(v1::ServerRestarted::default())),
        ..v1::GameEvent::default()
    };
    evening.tell(Update::Events(v1::EventBatch {
        events: vec![restarted],
    }));
    let screen = evening.screen();
    assert!(screen.contains("─ the server was"), "{screen}");
    assert!(screen.contains("  restarted"), "{screen}");
}

#[test]
fn leaving_asks_first() {
    let mut evening = Evening::new(&shifts(1), 3);
    assert_eq!(evening.press(KeyCode::Char('q')), None);
    assert_eq!(evening.app.dialog, Some(Dialog::Leave));
    assert_eq!(evening.press(KeyCode::Char('n')), None);
    assert!(evening.app.dialog.is_none() && !evening.app.left);
    evening.press(KeyCode::Esc);
    assert_eq!(evening.press(KeyCode::Char('y')), Some(Do::Leave));
    assert!(evening.app.left);
    let mut evening = Evening::new(&shifts(1), 3);
    let interrupted = evening.app.take(Input::Key(Key::Interrupt), 0);
    assert_eq!(interrupted, Some(Do::Leave));
}

#[test]
fn feelings_and_substitutes_have_their_keys() {
    let mut evening = Evening::new(&shifts(1), 3);
    evening.press(KeyCode::Char('e'));
    assert!(evening.screen().contains("surprise"));
    assert_eq!(evening.press(KeyCode::Char('3')), Some(Do::Express(2)));
    assert_eq!(evening.press(KeyCode::Char('r')), None);
    let substituted = v1::GameEvent {
        kind: Some(Kind::Substituted(v1::Substituted {
            seat: 0,
            built_in_agent: "random".into(),
        })),
        ..v1::GameEvent::default()
    };
    let events = vec![substituted];
    evening.tell(Update::Events(v1::EventBatch { events }));
    assert!(evening.screen().contains("Press r"));
    assert_eq!(evening.press(KeyCode::Char('r')), Some(Do::Resume));
}
