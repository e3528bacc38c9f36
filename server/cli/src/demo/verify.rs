//! Verifies the deals of a finished game: the revealed seed matches the commitment made before the
//! game (or the requested seed), it contains the agents' entropy, and each recorded hand follows
//! from it.

use chefshat_client::{Outcome, v1};
use chefshat_engine::{Deal, RuleSet, Seed};
use chefshat_engine::{MAX_ENTROPY, SeedPlan};
use chefshat_record::convert::{rules_from_proto, seat_cards};
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
pub(super) struct Unproven(&'static str);

/// Verifies a record against the commitment, the requested seed if any, and each agent's entropy.
pub(super) fn check(
    record: &[v1::RecordLine],
    commitment: &[u8],
    asked: Option<[u8; 32]>,
    outcomes: &[Outcome],
) -> Result<Checked, Unproven> {
    let mut rules = None;
    let mut game_id = String::new();
    let mut shifts = Vec::new();
    let mut reveal = None;
    for line in record.iter().filter_map(|line| line.line.as_ref()) {
        match line {
            Line::Header(header) => {
                rules = header
                    .rules
                    .as_ref()
                    .and_then(|rules| rules_from_proto(rules).ok());
                game_id.clone_from(&header.game_id);
            }
            Line::Event(event) => match &event.kind {
                Some(Kind::ShiftStarted(start)) => shifts.push(start),
                Some(Kind::GameEnded(end)) => reveal = end.reveal.as_ref(),
                _ => {}
            },
            _ => {}
        }
    }
    let rules = rules.ok_or(Unproven("the record has no rules"))?;
    let reveal = reveal.ok_or(Unproven("the record has no seed"))?;
    let seed: [u8; 32] = exactly(&reveal.game_seed).ok_or(Unproven("the seed is not 32 bytes"))?;
    match asked {
        Some(asked) if asked == seed => {}
        Some(_) => return Err(Unproven("the seed is not the requested one")),
        None => check_commitment(reveal, &game_id, commitment, seed, outcomes)?,
    }
    for start in &shifts {
        check_deal(&rules, Seed(seed), start)?;
    }
    if shifts.is_empty() {
        return Err(Unproven("nothing was dealt"));
    }
    Ok(Checked {
        deals: shifts.len(),
        committed: asked.is_none(),
    })
}

fn check_commitment(
    reveal: &v1::SeedReveal,
    game_id: &str,
    commitment: &[u8],
    seed: [u8; 32],
    outcomes: &[Outcome],
) -> Result<(), Unproven> {
    let short = Unproven("the revealed values have the wrong length");
    let (Some(server_seed), Some(nonce)) = (exactly(&reveal.server_seed), exactly(&reveal.nonce))
    else {
        return Err(short);
    };
    let mut id = [0; 16];
    hex::decode_to_slice(game_id, &mut id).map_err(|_| Unproven("the game's id cannot be read"))?;
    let plan = SeedPlan::Committed { server_seed, nonce };
    if plan.commitment(&id).as_ref().map(<[u8; 32]>::as_slice) != Some(commitment) {
        return Err(Unproven("the revealed seed is not the one committed to"));
    }
    let entropy = &reveal.seat_entropy;
    if entropy.iter().any(|bytes| bytes.len() > MAX_ENTROPY) {
        return Err(short);
    }
    let counted = |outcome: &Outcome| {
        let seat = usize::try_from(outcome.seat).unwrap_or(usize::MAX);
        entropy.get(seat) == Some(&outcome.entropy)
    };
    if !outcomes.iter().all(counted) {
        return Err(Unproven("an agent's own bytes are not in the seed"));
    }
    if plan.game_seed(entropy).0 != seed {
        return Err(Unproven("the game seed does not follow from its parts"));
    }
    Ok(())
}

/// Whether the hands of a Shift are those the seed deals.
fn check_deal(rules: &RuleSet, seed: Seed, start: &v1::ShiftStarted) -> Result<(), Unproven> {
    let deal = Deal::new(rules, seed, start.shift);
    let hands: Vec<v1::SeatCards> = deal
        .hands()
        .iter()
        .map(|(seat, cards)| seat_cards(seat, *cards, rules.faces()))
        .collect();
    if hands == start.hands {
        Ok(())
    } else {
        Err(Unproven("a hand does not follow from the seed"))
    }
}

fn exactly(bytes: &[u8]) -> Option<[u8; 32]> {
    bytes.try_into().ok()
}

#[cfg(test)]
mod tests {
    use chefshat_client::Ending;
    use chefshat_engine::RuleSetSpec;
    use chefshat_record::convert::rules_to_proto;

    use crate::demo::verify::*;

    /// A game with what was promised and what was recorded.
    #[derive(Clone)]
    struct Game {
        commitment: Vec<u8>,
        asked: Option<[u8; 32]>,
        outcomes: Vec<Outcome>,
        reveal: v1::SeedReveal,
        hands: Vec<v1::SeatCards>,
    }

    const ID: [u8; 16] = [0xab; 16];

    fn dealt(seed: Seed) -> Vec<v1::SeatCards> {
        let rules = RuleSetSpec::default().validate().expect("the standard");
        let hands = Deal::new(&rules, seed, 1).hands();
        let cards = |(seat, cards): (_, &_)| seat_cards(seat, *cards, rules.faces());
        hands.iter().map(cards).collect()
    }

    fn committed() -> Game {
        let entropy: Vec<Vec<u8>> = vec![vec![1; 32], vec![], vec![3], vec![4; 7]];
        let plan = SeedPlan::Committed {
            server_seed: [7; 32],
            nonce: [8; 32],
        };
        let seed = plan.game_seed(&entropy);
        let outcome = |(seat, entropy): (u32, &Vec<u8>)| Outcome {
            room_id: String::new(),
            game_id: String::new(),
            seat,
            ending: Ending::Finished(v1::GameEnded::default()),
            entropy: entropy.clone(),
            answers: 0,
        };
        Game {
            commitment: plan.commitment(&ID).expect("a commitment").to_vec(),
            asked: None,
            outcomes: (0..).zip(&entropy).map(outcome).collect(),
            reveal: v1::SeedReveal {
                server_seed: vec![7; 32],
                nonce: vec![8; 32],
                seat_entropy: entropy,
                game_seed: seed.0.to_vec(),
            },
            hands: dealt(seed),
        }
    }

    fn fixed() -> Game {
        Game {
            commitment: Vec::new(),
            asked: Some([9; 32]),
            reveal: v1::SeedReveal {
                game_seed: vec![9; 32],
                ..v1::SeedReveal::default()
            },
            hands: dealt(Seed([9; 32])),
            ..committed()
        }
    }

    fn checked(game: &Game) -> Result<Checked, Unproven> {
        let rules = RuleSetSpec::default().validate().expect("the standard");
        let event = |kind| {
            Line::Event(v1::GameEvent {
                kind: Some(kind),
                ..v1::GameEvent::default()
            })
        };
        let record = [
            Line::Header(Box::new(v1::RecordHeader {
                game_id: hex::encode(ID),
                rules: Some(rules_to_proto(&rules)),
                ..v1::RecordHeader::default()
            })),
            event(Kind::ShiftStarted(v1::ShiftStarted {
                shift: 1,
                hands: game.hands.clone(),
            })),
            event(Kind::GameEnded(Box::new(v1::GameEnded {
                standings: Vec::new(),
                reveal: Some(game.reveal.clone()),
            }))),
        ]
        .map(|line| v1::RecordLine { line: Some(line) });
        check(&record, &game.commitment, game.asked, &game.outcomes)
    }

    #[test]
    fn honest_games_are_verified() {
        for (game, committed) in [(committed(), true), (fixed(), false)] {
            assert_eq!(
                checked(&game),
                Ok(Checked {
                    deals: 1,
                    committed
                })
            );
        }
    }

    #[test]
    fn every_change_is_detected() {
        type Change = fn(&mut Game);
        let changes: [(&str, Change); 8] = [
            ("commitment", |game| game.commitment[0] ^= 1),
            ("server seed", |game| game.reveal.server_seed[0] ^= 1),
            ("nonce", |game| game.reveal.nonce[31] ^= 1),
            ("game seed", |game| game.reveal.game_seed[5] ^= 1),
            ("entropy", |game| game.reveal.seat_entropy[2] = vec![4]),
            ("long entropy", |game| {
                game.reveal.seat_entropy[2] = vec![4; 33]
            }),
            ("entropy reported", |game| game.outcomes[0].entropy[0] ^= 1),
            ("hands", |game| game.hands.swap(0, 1)),
        ];
        for (what, change) in changes {
            let mut game = committed();
            change(&mut game);
            assert!(checked(&game).is_err(), "{what}");
        }
        let mut other = fixed();
        other.asked = Some([1; 32]);
        assert!(checked(&other).is_err());
        let mut hands = fixed();
        hands.hands.pop();
        assert!(checked(&hands).is_err());
    }
}
