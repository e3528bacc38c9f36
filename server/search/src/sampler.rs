//! Draws deals that are consistent with what a seat knows, each equally likely.

use chefshat_engine::{BySeat, Cards, Face, Game, Mask, Seat, Seed};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng as _, SeedableRng as _};

use crate::holders::{Counts, Holders, MAX_KINDS};
use crate::table::{Steps, Table};
use crate::{Knowledge, KnowledgeError, World};

/// The random numbers of a search, in an order that a seed determines.
#[derive(Clone, Debug)]
pub struct Chance(ChaCha8Rng);

impl Chance {
    /// The numbers of a seed.
    pub fn new(seed: [u8; 32]) -> Chance {
        Chance(ChaCha8Rng::from_seed(seed))
    }

    /// The numbers of one of many streams of a seed.
    pub fn stream(seed: [u8; 32], stream: u64) -> Chance {
        let mut chance = ChaCha8Rng::from_seed(seed);
        chance.set_stream(stream);
        Chance(chance)
    }

    /// 32 random bytes.
    pub fn seed(&mut self) -> [u8; 32] {
        let mut bytes = [0; 32];
        self.0.fill_bytes(&mut bytes);
        bytes
    }

    /// A number from 0 to below 1, a multiple of 2^-53.
    fn unit(&mut self) -> f64 {
        (self.0.next_u64() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// A place in these weights, drawn by weight.
    pub(crate) fn weighted(&mut self, weights: &[f64]) -> usize {
        let mut rest = self.unit() * weights.iter().sum::<f64>();
        let reached = weights.iter().position(|weight| {
            rest -= weight;
            rest < 0.0
        });
        reached.unwrap_or(weights.len() - 1)
    }

    /// A number below `n`.
    fn below(&mut self, n: usize) -> usize {
        ((u128::from(self.0.next_u64()) * n as u128) >> 64) as usize
    }
}

/// The possible deals if a seat was drawn for the opening.
#[derive(Clone, Debug)]
struct Case {
    drawn: Option<Seat>,
    table: Table,
}

/// All deals that are consistent with what a seat knows.
#[derive(Clone, Debug)]
pub struct Sampler {
    knowledge: Knowledge,
    legal: Mask,
    cases: Vec<Case>,
    ways: f64,
}

impl Sampler {
    /// Counts the deals that are consistent with what a seat knows. A step takes 8 bytes at most.
    ///
    /// # Errors
    /// If there is none, or counting takes more than `max_steps` steps.
    pub fn new(knowledge: Knowledge, max_steps: u64) -> Result<Sampler, KnowledgeError> {
        let mut steps = Steps::new(max_steps);
        let mut cases = Vec::new();
        for drawn in drawn_seats(&knowledge) {
            if let Some(holders) = Holders::new(&knowledge, drawn)? {
                let table = Table::new(holders, &mut steps)?;
                cases.push(Case { drawn, table });
            }
        }
        let ways = cases.iter().map(|case| case.table.ways()).sum();
        let mut sampler = Sampler {
            knowledge,
            legal: Mask::EMPTY,
            cases,
            ways,
        };
        if sampler.ways <= 0.0 {
            return Err(KnowledgeError::Inconsistent);
        }
        // What the rules say about the rest of the history shows in one deal as in all.
        let mut chance = Chance::new([0; 32]);
        let world = sampler.world(&mut chance);
        let game = sampler.knowledge.game(&world, Seed([0; 32]))?;
        sampler.legal = game.legal_actions();
        Ok(sampler)
    }

    /// The legal actions of the seat's decision.
    pub fn legal_actions(&self) -> Mask {
        self.legal
    }

    /// What the seat knows.
    pub fn knowledge(&self) -> &Knowledge {
        &self.knowledge
    }

    /// The number of ways to deal the physical cards and to choose the gifts that the seat did not
    /// see, with the seats that may have been drawn for the opening.
    pub fn ways(&self) -> f64 {
        self.ways
    }

    /// The numbers that it keeps, 8 bytes each.
    pub fn states(&self) -> usize {
        self.cases.iter().map(|case| case.table.states()).sum()
    }

    /// Draws a deal.
    pub fn world(&self, chance: &mut Chance) -> World {
        let case = self.draw_case(chance);
        let table = &case.table;
        let holders = table.holders();
        let players = self.knowledge.rules.players();
        let faces = self.knowledge.rules.faces();
        let variables = holders.pairs.len() * 2 + holders.singles.len();
        let mut dealt = [(Counts::default(), false); MAX_KINDS];
        let mut given = [Counts::default(); 2];
        table.draw(
            || chance.unit(),
            |kind, before, split| {
                for variable in 0..variables {
                    dealt[variable].0[kind] = split.next[variable] - before[variable];
                    dealt[variable].1 |= split.golden == Some(variable as u8);
                }
                for (pair, given) in given.iter_mut().enumerate().take(holders.pairs.len()) {
                    let variable = table.gifts_variable(pair);
                    given[kind] = split.next[variable] - before[variable];
                }
            },
        );
        let mut world = World {
            dealt: BySeat::filled(players, Cards::EMPTY),
            gifts: BySeat::filled(players, Cards::EMPTY),
            drawn: case.drawn,
        };
        world.dealt[self.knowledge.seat] = self.knowledge.dealt;
        let hand = |variable: usize| {
            let (counts, golden) = &dealt[variable];
            cards(counts, faces, *golden)
        };
        for (index, pair) in holders.pairs.iter().enumerate() {
            world.dealt[pair.chooser] = hand(2 * index);
            world.dealt[pair.forced] = hand(2 * index + 1);
            world.gifts[pair.chooser] = cards(&given[index], faces, false);
        }
        for (index, single) in holders.singles.iter().enumerate() {
            if let Some(seat) = single.seat {
                world.dealt[seat] = hand(2 * holders.pairs.len() + index);
            }
        }
        if let Some((giver, count)) = self.knowledge.pending_gift() {
            world.gifts[giver] = draw_cards(world.dealt[giver], count, faces, chance);
        }
        world
    }

    /// Draws a deal and plays it up to the seat's decision.
    ///
    /// # Panics
    /// If the deal does not lead there, which would be a bug of the sampler.
    pub fn game(&self, chance: &mut Chance) -> Game {
        let world = self.world(chance);
        self.knowledge
            .game(&world, Seed(chance.seed()))
            .expect("a sampled deal leads to what the seat sees")
    }

    fn draw_case(&self, chance: &mut Chance) -> &Case {
        let mut rest = chance.unit() * self.ways;
        let mut possible = (self.cases.iter()).filter(|case| case.table.ways() > 0.0);
        let mut chosen = possible.next().expect("there is a deal");
        rest -= chosen.table.ways();
        for case in possible {
            if rest < 0.0 {
                break;
            }
            rest -= case.table.ways();
            chosen = case;
        }
        chosen
    }
}

/// The seats that may have been drawn for the opening.
fn drawn_seats(knowledge: &Knowledge) -> Vec<Option<Seat>> {
    if knowledge.draws_starter() {
        let players = knowledge.rules.players();
        (0..players).map(|seat| Some(Seat::new(seat))).collect()
    } else {
        vec![None]
    }
}

fn cards(counts: &Counts, faces: u8, golden: bool) -> Cards {
    Cards::from_counts(faces, &counts[..=usize::from(faces)], golden)
        .expect("the cards are those of a deck")
}

/// Draws cards of a hand, each equally likely. Of equal cards the Golden one goes last.
fn draw_cards(hand: Cards, count: u8, faces: u8, chance: &mut Chance) -> Cards {
    let mut left: Vec<u8> = hand.ascending(faces).collect();
    let mut rest = hand;
    for _ in 0..count.min(hand.len()) {
        let kind = left.swap_remove(chance.below(left.len()));
        rest = match Face::new(kind).filter(|face| face.get() <= faces) {
            Some(face) => rest.without_face(face, 1),
            None => rest.without_jokers(1),
        }
        .expect("the card is there");
    }
    let counts: Vec<u8> = (hand.counts(faces).zip(rest.counts(faces)))
        .map(|(before, after)| before - after)
        .collect();
    let golden = hand.has_golden() && !rest.has_golden();
    Cards::from_counts(faces, &counts, golden).expect("the cards are those of a hand")
}
