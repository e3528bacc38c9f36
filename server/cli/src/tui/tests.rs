//! The state built from events agrees with the engine's observations at every decision of complete
//! games.

use chefshat_agents::{AgentKind, BuiltInAgent};
use chefshat_engine::{DecisionKind, PassScope, RuleSetSpec, Seat, Viewer};

use super::testing::Dealt;
use crate::narration::view::{End, GameView};

/// Games of many kinds, as seen by seat 0 and by a viewer of all hands.
#[test]
fn the_state_agrees_with_the_engine() {
    let mut decisions = 0;
    let mut finished = 0;
    for preset in RuleSetSpec::PRESETS {
        for seed in 0..4 {
            let rules = RuleSetSpec::preset(preset).unwrap();
            for viewer in [Viewer::Seat(Seat::new(0)), Viewer::Everything] {
                let (mut dealt, events) = Dealt::new(&rules, seed, viewer);
                let mut table = GameView::default();
                let mut agent = BuiltInAgent::new(AgentKind::Random, [seed; 32]);
                events.iter().for_each(|event| table.apply(event));
                while let Some(decision) = dealt.game.decision() {
                    agree(&table, &dealt, viewer);
                    decisions += 1;
                    let seen = dealt.game.observe(Viewer::Seat(decision.seat));
                    let action = agent.decide(&seen, &dealt.game.legal_actions());
                    for event in dealt.apply(action) {
                        table.apply(&event);
                    }
                }
                assert!(matches!(&table.end, Some(End::Finished(all)) if all.len() == 4));
                finished += 1;
            }
        }
    }
    assert_eq!(finished, 24);
    assert!(decisions > 24 * 100, "{decisions} decisions only");
}

fn agree(table: &GameView, dealt: &Dealt, viewer: Viewer) {
    let seen = dealt.game.observe(viewer);
    let decision = dealt.game.decision().unwrap();
    assert_eq!(table.shift, seen.shift);
    // Before the first turn of a Shift the engine has no pizza, but the events have announced the
    // first.
    assert_eq!(table.pizza, seen.pizza.max(1));
    let board = table
        .board
        .map(|it| (it.face, it.quantity + it.jokers, it.jokers));
    let empty = (0, 0, 0);
    let on_board = (seen.board.face, seen.board.size, seen.board.jokers);
    let on_board = (on_board.0.into(), on_board.1.into(), on_board.2.into());
    assert_eq!(board.unwrap_or(empty), on_board);
    // Gifts are reported when the exchange is complete.
    let complete = decision.kind == DecisionKind::Turn;
    for (index, place) in table.seats.iter().enumerate() {
        let seat = Seat::new(index);
        if complete {
            assert_eq!(place.cards, u32::from(seen.cards_left[seat]));
        }
        if dealt.game.rules().pass_scope() == PassScope::Pizza {
            assert_eq!(place.passed, seen.passed[seat]);
        }
        assert_eq!(place.finished.unwrap_or(0), u32::from(seen.places[seat]));
        assert_eq!(place.points, seen.points[seat]);
        let role = seen.roles[seat].map_or(0, |role| role as i32);
        assert_eq!(i32::from(place.role), role);
        let known = match viewer {
            Viewer::Seat(own) => own == seat,
            _ => true,
        };
        assert_eq!(place.hand.is_some(), known);
        if let Some(hand) = place.hand.as_ref().filter(|_| complete) {
            let held = dealt.game.hands()[seat];
            let counts: Vec<u8> = held.counts(seen.faces).collect();
            assert_eq!((&hand.counts, hand.golden), (&counts, held.has_golden()));
        }
    }
    // From the first turn of a Shift on, the events determine whose turn it is.
    if table.turns > 0 && complete {
        assert_eq!(table.turn, u32::try_from(decision.seat.index()).ok());
    }
}
