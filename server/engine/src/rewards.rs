//! Rewards by named schemes (`docs/rules.md` §8.6), computed from events. Agents can compute their
//! own from the same events.

use crate::{Event, RuleSet, Seat, ShiftEnd};

/// How turns and invalid attempts at turns are rewarded. No scheme rewards gifts and special
/// actions.
#[derive(Copy, Clone, Eq, PartialEq, Hash, Debug)]
pub enum RewardScheme {
    /// +1 for a valid action, -1 for an invalid one (the paper's Experiment 2).
    Validity,
    /// The paper's Experiment 3, exactly as printed.
    Paper,
    /// What the printed formula seems to mean: with the share of cards already played.
    PaperIntended,
    /// 1 for finishing first, else -0.001.
    Winning,
    /// The Shift's points when it ends, else 0.
    Points,
}

impl RewardScheme {
    /// All schemes.
    pub const ALL: [RewardScheme; 5] = [
        RewardScheme::Validity,
        RewardScheme::Paper,
        RewardScheme::PaperIntended,
        RewardScheme::Winning,
        RewardScheme::Points,
    ];

    /// The scheme's name.
    pub const fn name(self) -> &'static str {
        match self {
            RewardScheme::Validity => "validity",
            RewardScheme::Paper => "paper",
            RewardScheme::PaperIntended => "paper_intended",
            RewardScheme::Winning => "winning",
            RewardScheme::Points => "points",
        }
    }

    /// The scheme of this name, or `None` if there is none.
    pub fn from_name(name: &str) -> Option<RewardScheme> {
        RewardScheme::ALL
            .into_iter()
            .find(|scheme| scheme.name() == name)
    }

    /// Reward of an invalid attempt at a turn.
    pub fn invalid(self) -> f32 {
        match self {
            RewardScheme::Validity | RewardScheme::Paper | RewardScheme::PaperIntended => -1.0,
            RewardScheme::Winning => -0.001,
            RewardScheme::Points => 0.0,
        }
    }

    /// Reward of a valid turn after which the seat has `cards_left` cards. `place`, from 1, is set
    /// if the seat finished with this turn.
    pub fn turn(self, rules: &RuleSet, cards_left: u8, place: Option<u8>) -> f32 {
        let (left, dealt) = (f64::from(cards_left), f64::from(rules.hand_size()));
        let finishing = place.map_or(0.0, |place| self.finishing(place));
        let reward = match self {
            RewardScheme::Validity => 1.0,
            RewardScheme::Paper => (1.0 - left) * 100.0 / dealt * 0.01 * 0.7 + finishing,
            RewardScheme::PaperIntended => (1.0 - left / dealt) * 0.7 + finishing,
            RewardScheme::Winning if place == Some(1) => finishing,
            RewardScheme::Winning => -0.001,
            RewardScheme::Points => 0.0,
        };
        reward as f32
    }

    /// Reward of a seat at the end of a Shift, in addition to its turns: `place` from 1, `points`
    /// of the Shift, `finished` whether it has no cards left. A seat that finished received its
    /// finishing part with its last turn. `None` if there is no reward.
    pub fn shift_end(self, place: u8, points: u32, finished: bool) -> Option<f32> {
        match self {
            RewardScheme::Points => Some(points as f32),
            RewardScheme::Paper | RewardScheme::PaperIntended if !finished => {
                Some(self.finishing(place) as f32)
            }
            // A seat with cards is first only in an adjudicated Shift.
            RewardScheme::Winning if !finished && place == 1 => Some(self.finishing(place) as f32),
            _ => None,
        }
    }

    /// Computes the rewards of the events of ONE call of [`crate::Game::apply`]. Calls `give` with
    /// the seat, its reward and the index of the event that causes it: a play, a pass or the end of
    /// a Shift.
    pub fn of_events(
        self,
        rules: &RuleSet,
        events: &[Event],
        mut give: impl FnMut(Seat, f32, usize),
    ) {
        for (index, event) in events.iter().enumerate() {
            match *event {
                Event::Played {
                    seat, cards_left, ..
                } => {
                    let place = events[index..].iter().find_map(|event| match *event {
                        Event::SeatFinished {
                            seat: finished,
                            place,
                        } if finished == seat => Some(place),
                        _ => None,
                    });
                    give(seat, self.turn(rules, cards_left, place), index);
                }
                Event::Passed { seat, cards_left } => {
                    give(seat, self.turn(rules, cards_left, None), index)
                }
                Event::ShiftEnded(ref end) => {
                    let ShiftEnd {
                        order,
                        points,
                        finished,
                        ..
                    } = **end;
                    for (&seat, place) in order.as_slice().iter().zip(1u8..) {
                        if let Some(reward) = self.shift_end(place, points[seat], place <= finished)
                        {
                            give(seat, reward, index);
                        }
                    }
                }
                _ => {}
            }
        }
    }

    /// The part of the reward for finishing with a place, from 1.
    fn finishing(self, place: u8) -> f64 {
        match self {
            RewardScheme::Paper | RewardScheme::PaperIntended => {
                (1.0 - 0.3 * (f64::from(place) - 1.0)) * 0.3
            }
            RewardScheme::Winning => f64::from(u8::from(place == 1)),
            RewardScheme::Validity | RewardScheme::Points => 0.0,
        }
    }
}
