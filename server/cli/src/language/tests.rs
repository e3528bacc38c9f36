//! A game of the engine as its seat 0 reads it. The transcript is committed, to be read as a
//! difference.

use chefshat_client::v1::{self, game_event::Kind, seat_update::Update};
use chefshat_engine::{Action, ActionId, RuleSetSpec, Seat, Stop, Viewer};

use super::live::Live;
use super::text;
use crate::narration::view::GameView;
use crate::tui::testing::{Dealt, assert_screens};

/// Plays a game: every seat takes its last legal action that is no pass, if there is one. Seat 0
/// reads what `wait_for_turn` and, once a Shift, `get_table` return.
fn transcript(rules: &RuleSetSpec, seed: u8) -> String {
    let me = Seat::new(0);
    let (mut dealt, events) = Dealt::new(rules, seed, Viewer::Seat(me));
    let mut live = Live::new(GameView::default(), Some(0));
    let mut shown = 0;
    let mut text = String::new();
    let take = |live: &mut Live, events| {
        live.take(Update::Events(v1::EventBatch { events }), 0);
    };
    take(&mut live, events);
    let mut shift = 0;
    while let Some(decision) = dealt.game.decision() {
        let space = dealt.game.rules().actions();
        if decision.seat == me {
            let request = dealt.request();
            if request.kind() == v1::DecisionKind::Turn {
                // What the events say about the hand is what the game knows.
                let hand = live.view.seats[0].hand.as_ref().unwrap();
                let known = request.observation.as_ref().unwrap();
                assert_eq!((&hand.counts, hand.golden), (&known.hand, known.golden));
                assert_eq!(
                    live.played.counts.is_empty(),
                    known.played.iter().all(|it| *it == 0)
                );
                if !live.played.counts.is_empty() {
                    assert_eq!(live.played.counts, known.played);
                }
            }
            live.take(Update::Decision(request), 0);
            if live.view.shift > shift {
                shift = live.view.shift;
                text += &format!("> get_table\n{}\n\n", text::table(&live, 0));
            }
            text += &format!("> wait_for_turn\n{}\n\n", text::since(&live, shown, 1_500));
            shown = live.sequence();
        }
        let legal: Vec<ActionId> = dealt.game.legal_actions().iter().collect();
        let plays = legal
            .iter()
            .rev()
            .find(|id| space.decode(**id) != Some(Action::Pass));
        let action = *plays.unwrap_or(&legal[0]);
        if decision.seat == me {
            let id = u32::from(action.index());
            text += &format!("> play a{id}\n\n");
            live.close(live.open.as_ref().unwrap().request.decision_id);
        }
        take(&mut live, dealt.apply(action));
    }
    text + &format!("> wait_for_turn\n{}\n", text::since(&live, shown, 0))
}

#[test]
fn a_game_reads_as_committed() {
    let rules = RuleSetSpec {
        faces: 5,
        stop: Stop::Shifts(4),
        ..RuleSetSpec::default()
    };
    // The first game in which the reader makes decisions of all kinds.
    let mut games = (0..=u8::MAX).map(|seed| transcript(&rules, seed));
    let game = games.find(|text| text.contains(": give card") && text.contains(": declare or"));
    let committed = include_str!("transcript.txt");
    assert_screens(&[("transcript.txt", game.unwrap(), committed)]);
}

/// No event is left out, and what happened since an event begins after it.
#[test]
fn what_happened_begins_after_the_event_that_was_asked_for() {
    let (_, events) = Dealt::new(&RuleSetSpec::default(), 1, Viewer::Spectator);
    let mut live = Live::new(GameView::default(), None);
    let batch = v1::EventBatch {
        events: events.clone(),
    };
    live.take(Update::Events(batch), 0);
    let last = events.last().unwrap().sequence;
    assert_eq!(live.sequence(), last);
    let numbers: Vec<u64> = live.events.iter().map(|event| event.sequence).collect();
    assert_eq!(numbers, (1..=last).collect::<Vec<_>>());
    let all = text::since(&live, 0, 0);
    assert!(
        all.contains("The game begins: Ada, Ben, Cleo, Dan"),
        "{all}"
    );
    let none = text::since(&live, last, 0);
    assert_eq!(
        none,
        format!("seq {last}\nNot your turn. Call wait_for_turn again.")
    );
}

#[test]
fn a_play_of_more_cards_than_any_deck_takes_no_memory() {
    let mut live = Live::new(GameView::default(), Some(0));
    let play = Kind::Play(v1::Play {
        face: 3,
        quantity: u32::MAX,
        jokers: u32::MAX,
        ..v1::Play::default()
    });
    let events = vec![v1::GameEvent {
        kind: Some(play),
        ..v1::GameEvent::default()
    }];
    live.take(Update::Events(v1::EventBatch { events }), 0);
    assert_eq!(live.played.counts[2], u8::MAX);
}

#[test]
fn after_a_pause_a_decision_has_its_full_time_again() {
    let mut live = Live::new(GameView::default(), Some(0));
    let request = v1::DecisionRequest {
        time_left_ms: 30_000,
        bank_left_ms: 9_000,
        ..v1::DecisionRequest::default()
    };
    live.take(Update::Decision(request), 1_000);
    let left = |live: &Live, now_ms| live.left_ms(now_ms).unwrap();
    let full = (30_000, 9_000);
    assert_eq!(left(&live, 33_000), (0, 7_000));
    for (paused, now_ms) in [(true, 34_000), (false, 90_000)] {
        let paused = Kind::TablePaused(v1::TablePaused { paused });
        let events = vec![v1::GameEvent {
            kind: Some(paused),
            ..v1::GameEvent::default()
        }];
        live.take(Update::Events(v1::EventBatch { events }), now_ms);
        assert_eq!(left(&live, now_ms), full);
    }
    assert_eq!(left(&live, 91_000), (29_000, 9_000));
}
