//! Playing one game: whom it asks, and the effect of illegal actions.

use std::num::NonZeroU32;

use chefshat_agents::{Listener, play};
use chefshat_engine::{ActionId, Decision, DecisionKind, Event, RuleSetSpec, Seed, Stop};

#[derive(Default)]
struct Counts {
    decisions: u64,
    invalid: u64,
    turns: u64,
    ended: bool,
}

impl Listener for Counts {
    fn on_event(&mut self, event: &Event) {
        match event {
            Event::ShiftEnded(end) => self.turns += u64::from(end.turns),
            Event::GameEnded { .. } => self.ended = true,
            _ => {}
        }
    }

    fn on_decision(&mut self, _: Decision, _: ActionId) {
        self.decisions += 1;
    }

    fn on_invalid(&mut self, _: Decision, _: ActionId) {
        self.invalid += 1;
    }
}

#[test]
fn only_illegal_answers_lead_to_default_decisions() {
    let spec = RuleSetSpec {
        stop: Stop::Shifts(2),
        ..RuleSetSpec::default()
    };
    let mut counts = Counts::default();
    let limit = NonZeroU32::new(4);
    play(
        spec.validate().unwrap(),
        Seed([9; 32]),
        limit,
        |_, _, _| ActionId::new(u16::MAX),
        &mut counts,
    );
    assert!(counts.ended);
    assert!(counts.turns > 0 && counts.decisions > counts.turns);
    assert_eq!(counts.invalid, 4 * counts.decisions);
}

#[test]
fn the_deciding_seat_is_asked() {
    let rules = RuleSetSpec::default().validate().unwrap();
    let mut counts = Counts::default();
    let mut kinds = Vec::new();
    let standings = play(
        rules,
        Seed([10; 32]),
        None,
        |seat, observation, legal| {
            assert_eq!(observation.seat, Some(seat));
            kinds.push(
                observation
                    .kind
                    .expect("a seat that is asked has a decision open"),
            );
            legal.nth(0).expect("there is a legal action")
        },
        &mut counts,
    );
    assert_eq!(kinds.len() as u64, counts.decisions);
    assert_eq!(
        kinds
            .iter()
            .filter(|&&kind| kind == DecisionKind::Turn)
            .count() as u64,
        counts.turns
    );
    assert!(kinds.contains(&DecisionKind::Exchange));
    assert_eq!(counts.invalid, 0);
    assert!(standings.points[standings.winner()] >= 15);
}
