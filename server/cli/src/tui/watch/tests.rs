//! Moving through a recorded game by keys.

use std::collections::BTreeMap;

use chefshat_client::v1::{self, game_event::Kind, record_line};
use ratatui::crossterm::event::KeyCode;

use super::reel::Reel;
use super::{of_record, view};
use crate::narration::view::GameView;
use crate::tui::screen::Key;
use crate::tui::testing::{assert_screens, lines, recorded, text};
use crate::tui::theme::Theme;

fn reel() -> Reel {
    let hints = BTreeMap::default();
    Reel::recorded(GameView::default(), recorded("fixed.jsonl"), hints)
}

fn press(reel: &mut Reel, code: KeyCode) {
    reel.key(Key::Code(code), 0);
}

fn screen(reel: &Reel) -> String {
    text(80, 24, |frame| view::draw(frame, Theme::new(false), reel))
}

#[test]
fn every_moment_is_the_same_forwards_and_back() {
    let mut forth = reel();
    press(&mut forth, KeyCode::Home);
    let mut moments = vec![format!("{:?}", forth.table)];
    while forth.at < forth.len() {
        press(&mut forth, KeyCode::Right);
        moments.push(format!("{:?}", forth.table));
    }
    assert!(moments.len() > 100, "{} moments only", moments.len());
    for moment in moments.iter().rev().skip(1) {
        press(&mut forth, KeyCode::Left);
        assert_eq!(&format!("{:?}", forth.table), moment);
    }
    assert_eq!(forth.at, 0);
}

#[test]
fn a_record_with_hints_says_so() {
    let mut lines = lines("committed.jsonl");
    let mut hints = Some(2);
    for line in lines.iter_mut().filter_map(|line| line.line.as_mut()) {
        match line {
            record_line::Line::Header(header) => header.policy.get_or_insert_default().hints = true,
            record_line::Line::Event(event) => {
                if let Some(Kind::GameStarted(started)) = &mut event.kind {
                    started.policy.get_or_insert_default().hints = true;
                }
            }
            // The first one of a seat that is not built in.
            record_line::Line::Decision(decision) if decision.seat > 1 => {
                decision.hints = hints.take().unwrap_or(0);
            }
            _ => {}
        }
    }
    let mut reel = of_record(lines).expect("a record");
    press(&mut reel, KeyCode::Home);
    let shown = |reel: &Reel| screen(reel).contains(" gets 2 hints");
    while !shown(&reel) {
        assert!(reel.at < reel.len(), "never shown");
        press(&mut reel, KeyCode::Right);
    }
    press(&mut reel, KeyCode::Left);
    assert!(!shown(&reel));
}

#[test]
fn a_live_game_shows_whom_it_waits_for() {
    let mut reel = Reel::live(GameView::default());
    let awaited = v1::Awaited {
        seat: Some(1),
        away: true,
        waited_ms: 0,
        left_ms: Some(12_000),
    };
    reel.wait_for(&awaited, 500);
    assert!(screen(&reel).contains("Waiting for seat 2 (away): 12 s"));
    assert!(!reel.tick(501), "the same second");
    assert!(reel.tick(1_500));
    assert!(screen(&reel).contains("Waiting for seat 2 (away): 11 s"));
    reel.wait_for(&v1::Awaited::default(), 1_600);
    assert!(!screen(&reel).contains("Waiting for seat"));
}

#[test]
fn the_reel_runs_stops_and_jumps() {
    let mut reel = reel();
    let deal = reel.at;
    assert_eq!(reel.table.shift, 1);
    assert!(!reel.tick(999) && reel.tick(1000) && !reel.tick(1999));
    press(&mut reel, KeyCode::Char(' '));
    assert!(!reel.tick(9_999_999));
    press(&mut reel, KeyCode::Char('s'));
    assert_eq!(reel.table.shift, 2);
    press(&mut reel, KeyCode::Char('S'));
    assert_eq!(reel.at, deal);
    press(&mut reel, KeyCode::Char(' '));
    press(&mut reel, KeyCode::Up);
    assert!((reel.per_second() - 2.0).abs() < f64::EPSILON);
    assert!(!reel.tick(499) && reel.tick(500));
    for (code, times, expected) in [(KeyCode::Up, 20, 40.0), (KeyCode::Down, 20, 0.25)] {
        for _ in 0..times {
            press(&mut reel, code);
        }
        assert!((reel.per_second() - expected).abs() < f64::EPSILON);
    }
    press(&mut reel, KeyCode::End);
    assert_eq!(reel.at, reel.len());
    assert!(reel.table.end.is_some());
    press(&mut reel, KeyCode::Char('q'));
    assert!(reel.left);
}

#[test]
fn unknown_hands_say_why_they_are_unknown() {
    let mut events = recorded("fixed.jsonl");
    for event in &mut events {
        if let Some(Kind::ShiftStarted(start)) = &mut event.kind {
            start.hands.clear();
        }
    }
    let hints = BTreeMap::default();
    let mut imported = Reel::recorded(GameView::default(), events.clone(), hints);
    assert_eq!(screen(&imported).matches("not recorded").count(), 3);
    press(&mut imported, KeyCode::End);
    assert_eq!(screen(&imported).matches("not recorded").count(), 3);

    let mut live = Reel::live(GameView::default());
    press(&mut live, KeyCode::Char('h'));
    let last = events.pop().expect("the end");
    events.into_iter().for_each(|event| live.push(event));
    let shown = screen(&live);
    assert_eq!(
        shown.matches("not shown while the game is played").count(),
        3
    );
    live.push(last);
    let shown = screen(&live);
    assert_eq!(shown.matches("not shown to spectators").count(), 3);
}

#[test]
fn a_record_that_does_not_replay_is_refused_and_drawing_is_bounded() {
    let lines = lines("fixed.jsonl");
    assert!(of_record(lines.clone()).is_ok());
    let plays = |line: &v1::RecordLine| match &line.line {
        Some(record_line::Line::Event(event)) => matches!(event.kind, Some(Kind::Play(_))),
        _ => false,
    };
    let at = lines.iter().position(plays).expect("somebody plays");
    let spoils: [fn(&mut v1::Play); 3] = [
        |play| (play.quantity, play.jokers) = (u32::MAX, u32::MAX),
        |play| play.seat = u32::MAX,
        |play| play.face = u32::MAX,
    ];
    for spoil in spoils {
        let mut bad = lines.clone();
        let Some(record_line::Line::Event(event)) = &mut bad[at].line else {
            panic!("an event");
        };
        let Some(Kind::Play(play)) = &mut event.kind else {
            panic!("a play");
        };
        spoil(play);
        // A live game is drawn as received, whatever the server sends.
        let mut reel = Reel::live(GameView::default());
        for line in &bad[..=at] {
            if let Some(record_line::Line::Event(event)) = &line.line {
                reel.push(event.clone());
            }
        }
        assert!(reel.table.board.is_some());
        assert!(screen(&reel).contains("the pizza"));
        let refused = of_record(bad).unwrap_err().to_string();
        assert!(refused.contains("line"), "{refused}");
    }
}

#[test]
fn a_live_game_is_followed_until_it_is_paused() {
    let mut reel = Reel::live(GameView::default());
    let mut events = recorded("fixed.jsonl").into_iter();
    for event in events.by_ref().take(20) {
        reel.push(event);
    }
    assert_eq!(reel.at, 20);
    press(&mut reel, KeyCode::Left);
    for event in events.by_ref().take(5) {
        reel.push(event);
    }
    assert_eq!((reel.at, reel.len()), (19, 25));
    assert!(screen(&reel).contains("behind"));
    press(&mut reel, KeyCode::End);
    for event in events {
        reel.push(event);
    }
    assert_eq!(reel.at, reel.len());
    reel.close(Some("gone".into()));
    assert!(screen(&reel).contains("gone"));
}

#[test]
fn the_screens_match_the_committed_ones() {
    let mut reel = reel();
    for _ in 0..30 {
        press(&mut reel, KeyCode::Right);
    }
    let hands = screen(&reel);
    press(&mut reel, KeyCode::End);
    assert_screens(&[
        ("hands.txt", hands, include_str!("screens/hands.txt")),
        ("end.txt", screen(&reel), include_str!("screens/end.txt")),
    ]);
    press(&mut reel, KeyCode::Char('h'));
    assert!(!screen(&reel).contains(" hands ─"));
    press(&mut reel, KeyCode::Char('?'));
    assert!(screen(&reel).contains("one event back"));
}
