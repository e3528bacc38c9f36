//! Verifies a finished game against what was said before it: its record replays, which includes every
//! deal and the revealed seed; that seed is the one committed to, or the requested one; and it contains
//! the agents' entropy.

use chefshat_client::{Outcome, v1};
use chefshat_record::replay::replay;
use v1::game_event::Kind;
use v1::record_line::Line;

/// A successful verification.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Checked {
    /// Number of deals that follow from the seed.
    pub(super) deals: usize,
    /// Whether the server had committed to its part of the seed.
    pub(super) committed: bool,
}

impl Checked {
    /// The result in words.
    pub(super) fn in_words(&self) -> String {
        let deals = match self.deals {
            1 => "the deal follows".to_owned(),
            deals => format!("all {deals} deals follow"),
        };
        let seed = if self.committed {
            "the seed committed to"
        } else {
            "the requested seed"
        };
        format!("check out: {deals} from {seed}")
    }
}

/// Why the verification failed.
#[derive(Debug, PartialEq, Eq, thiserror::Error)]
#[error("the deals cannot be verified: {0}")]
pub(super) struct Unproven(String);

/// Verifies a record against the commitment, the requested seed if any, and each agent's entropy.
pub(super) fn check(
    record: &[v1::RecordLine],
    commitment: &[u8],
    asked: Option<[u8; 32]>,
    outcomes: &[Outcome],
) -> Result<Checked, Unproven> {
    let unproven = |why: &str| Unproven(why.to_owned());
    replay(record).map_err(|error| Unproven(error.to_string()))?;
    let (mut committed_to, mut deals, mut reveal) = (&[][..], 0, None);
    for line in record.iter().filter_map(|line| line.line.as_ref()) {
        match line {
            Line::Header(header) => committed_to = &header.seed_commitment,
            Line::Event(event) => match &event.kind {
                Some(Kind::ShiftStarted(_)) => deals += 1,
                Some(Kind::GameEnded(end)) => reveal = end.reveal.as_ref(),
                _ => {}
            },
            _ => {}
        }
    }
    let reveal = reveal.ok_or_else(|| unproven("the record has no seed"))?;
    let is_in_seed = |outcome: &Outcome| {
        let seat = usize::try_from(outcome.seat).unwrap_or(usize::MAX);
        reveal.seat_entropy.get(seat) == Some(&outcome.entropy)
    };
    match asked {
        Some(asked) if reveal.game_seed != asked => {
            Err(unproven("the seed is not the requested one"))
        }
        None if commitment.is_empty() || committed_to != commitment => {
            Err(unproven("the revealed seed is not the one committed to"))
        }
        None if !outcomes.iter().all(is_in_seed) => {
            Err(unproven("an agent's own bytes are not in the seed"))
        }
        _ => Ok(Checked {
            deals,
            committed: asked.is_none(),
        }),
    }
}

#[cfg(test)]
mod tests {
    use chefshat_client::Ending;

    use crate::demo::verify::*;
    use crate::tui::testing::lines;

    /// A recorded game with what was said before it.
    #[derive(Clone)]
    struct Game {
        record: Vec<v1::RecordLine>,
        commitment: Vec<u8>,
        asked: Option<[u8; 32]>,
        outcomes: Vec<Outcome>,
    }

    impl Game {
        fn checked(&self) -> Result<Checked, Unproven> {
            check(&self.record, &self.commitment, self.asked, &self.outcomes)
        }

        /// The hands of the first deal.
        fn hands(&mut self) -> &mut Vec<v1::SeatCards> {
            let deal = self
                .record
                .iter_mut()
                .find_map(|line| match &mut line.line {
                    Some(Line::Event(v1::GameEvent {
                        kind: Some(Kind::ShiftStarted(start)),
                        ..
                    })) => Some(&mut start.hands),
                    _ => None,
                });
            deal.expect("a deal")
        }
    }

    fn committed() -> Game {
        let record = lines("committed.jsonl");
        let Some(Line::Header(header)) = &record[0].line else {
            panic!("a record begins with its header");
        };
        let commitment = header.seed_commitment.clone();
        let entropy = record.iter().find_map(|line| match &line.line {
            Some(Line::Event(v1::GameEvent {
                kind: Some(Kind::GameEnded(end)),
                ..
            })) => end.reveal.as_ref().map(|reveal| &reveal.seat_entropy),
            _ => None,
        });
        let outcome = |(seat, entropy): (u32, &Vec<u8>)| Outcome {
            room_id: String::new(),
            game_id: String::new(),
            seat,
            ending: Ending::Finished(v1::GameEnded::default()),
            entropy: entropy.clone(),
            answers: 0,
        };
        let outcomes = (0..).zip(entropy.expect("a reveal")).map(outcome).collect();
        Game {
            commitment,
            asked: None,
            outcomes,
            record,
        }
    }

    fn fixed() -> Game {
        Game {
            record: lines("fixed.jsonl"),
            commitment: Vec::new(),
            asked: Some([7; 32]),
            ..committed()
        }
    }

    #[test]
    fn honest_games_are_verified() {
        for (game, deals, committed) in [(committed(), 3, true), (fixed(), 2, false)] {
            assert_eq!(game.checked(), Ok(Checked { deals, committed }));
        }
    }

    #[test]
    fn every_change_is_detected() {
        type Change = fn(&mut Game);
        let changes: [(&str, Change); 4] = [
            ("another commitment", |game| game.commitment[0] ^= 1),
            ("no commitment", |game| {
                *game = Game {
                    asked: None,
                    ..fixed()
                }
            }),
            ("entropy", |game| game.outcomes[2].entropy[0] ^= 1),
            ("hands", |game| game.hands().swap(0, 1)),
        ];
        for (what, change) in changes {
            let mut game = committed();
            change(&mut game);
            assert!(game.checked().is_err(), "{what}");
        }
        let mut other = fixed();
        other.asked = Some([1; 32]);
        assert!(other.checked().is_err());
    }
}
