//! What a game that branches from a record takes over from it. The game itself, and whose seats it has, are made elsewhere.

use std::collections::BTreeSet;

use chefshat_engine::{ActionId, Game, RuleSet, Script, Seed, TakenOver};
use chefshat_proto::v1::{self, game_event::Kind, record_line::Line};

use crate::convert::{FieldProblem, rules_from_proto, script_from_proto, seat_cards};
use crate::replay::{Moment, ReplayError, reveal, walk};

/// The beginning of a recorded game, up to a point: from these values alone the game can be played up to there again, as
/// [`Branch::played`] does.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Branch {
    /// The rule set.
    pub rules: RuleSet,
    /// The first Shift, where its hands were given.
    pub script: Option<Script>,
    /// The decisions taken over, in order, by the seed of the Shifts dealt among them. At least one part, which may have no decisions: its
    /// seed deals the first Shift.
    pub taken_over: Vec<TakenOver>,
    /// The seed of all Shifts that the recorded game dealt after the point. `None` if there was not one such seed: then later Shifts
    /// cannot be dealt as they were there.
    pub later_deals: Option<Seed>,
}

/// Why no game can branch from a record at a point.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum BranchError {
    /// The record does not fit.
    #[error("the record cannot be replayed: {0}")]
    Record(#[from] ReplayError),
    /// Its rules or first hands do not fit.
    #[error("the record makes no sense: {0}")]
    Field(#[from] FieldProblem),
    /// The game was aborted before it began.
    #[error("the recorded game never began")]
    NeverBegan,
    /// The record ends before.
    #[error("the recorded game has {has} decisions, not {asked}")]
    TooFar {
        /// Decisions there are.
        has: u64,
        /// Decisions asked for.
        asked: u64,
    },
    /// Nothing is left to decide.
    #[error("after {0} decisions the recorded game was over; take over fewer")]
    Over(u64),
    /// A game from a real table without everybody's cards.
    #[error("the hands of the recorded game are not all known")]
    HandsUnknown,
    /// A game from a real table has no seed.
    #[error(
        "the cards of the recorded game were real: another can go on with it in its first Shift alone"
    )]
    RealCards,
    /// A game from a real table with gaps.
    #[error("not all decisions of the recorded game before this point are known")]
    DecisionsUnknown,
}

impl Branch {
    /// The recorded game at the point, with this seed for later Shifts. `None` if the decisions do not fit; those of a branch that
    /// [`branch_of`] gives do.
    pub fn played(&self, later: Seed) -> Option<Game> {
        let first = self.taken_over.first().map_or(later, |part| part.seed);
        let mut game = match &self.script {
            None => Game::new(self.rules, first, |_| {}),
            Some(script) => Game::scripted(self.rules, first, script, |_| {}).ok()?,
        };
        for part in &self.taken_over {
            game.reseed(part.seed);
            for action in &part.actions {
                game.apply(*action, |_| {}).ok()?;
            }
        }
        game.reseed(later);
        Some(game)
    }
}

/// What a game takes over that branches from a record after so many decisions.
///
/// # Errors
/// The record does not fit, or the game cannot be gone on with from there.
pub fn branch_of(lines: &[v1::RecordLine], decisions: u64) -> Result<Branch, BranchError> {
    let mut beginning = Beginning::default();
    let replayed = walk(lines, |moment| beginning.visit(&moment, decisions))?;
    let first_deal = beginning.first_deal.ok_or(BranchError::NeverBegan)?;
    if decisions > replayed.decisions {
        return Err(BranchError::TooFar {
            has: replayed.decisions,
            asked: decisions,
        });
    }
    if decisions == replayed.decisions && replayed.state == v1::RoomState::Finished {
        return Err(BranchError::Over(decisions));
    }
    let header = &beginning.header;
    let rules = rules_from_proto(&header.rules.clone().unwrap_or_default())?;
    let scripted = header
        .start
        .as_ref()
        .and_then(|start| start.scripted.clone());
    let shifts = beginning.shifts.iter().copied();
    let seeds = Seeds::of(header, lines);
    let (script, later_deals) = if header.origin() == v1::GameOrigin::Imported {
        if !first_deal.known {
            return Err(BranchError::HandsUnknown);
        }
        if shifts.filter(|begun_by| *begun_by <= decisions).count() > 1 {
            return Err(BranchError::RealCards);
        }
        let dealt = v1::ScriptedShift {
            hands: first_deal.hands,
            ..scripted.unwrap_or_default()
        };
        (Some(dealt), None)
    } else {
        let later = shifts.filter(|begun_by| *begun_by > decisions);
        (scripted, seeds.one_of(later))
    };
    let script = script
        .map(|script| script_from_proto(&script, &rules))
        .transpose()?;
    let branch = Branch {
        rules,
        script,
        taken_over: seeds.parts(&beginning.actions),
        later_deals,
    };
    // Decisions of a real game may have gaps, and then lead elsewhere.
    let any = Seed([0; 32]);
    let same = beginning.at_point.is_some_and(|mut game| {
        game.reseed(any);
        branch.played(any) == Some(game)
    });
    if same {
        Ok(branch)
    } else {
        Err(BranchError::DecisionsUnknown)
    }
}

/// What is seen of a record on the way to the point and behind it.
#[derive(Default)]
struct Beginning {
    header: v1::RecordHeader,
    /// Decisions taken so far.
    decisions: u64,
    /// The actions of those up to the point.
    actions: Vec<ActionId>,
    first_deal: Option<FirstDeal>,
    /// For each Shift, the number of the decision that it began with; 0: none.
    shifts: Vec<u64>,
    /// The game at the point.
    at_point: Option<Game>,
}

struct FirstDeal {
    hands: Vec<v1::SeatCards>,
    /// Whether they are what was dealt, all of them.
    known: bool,
}

impl Beginning {
    fn visit(&mut self, moment: &Moment<'_>, point: u64) {
        match moment.entry {
            Line::Header(header) => self.header = header.clone(),
            Line::Decision(decision) => {
                if self.decisions == point {
                    self.at_point = moment.game.cloned();
                } else if self.decisions < point {
                    let action = u16::try_from(decision.action).unwrap_or(u16::MAX);
                    self.actions.push(ActionId::new(action));
                }
                self.decisions += 1;
            }
            Line::Event(event) => {
                if let Some(Kind::ShiftStarted(_)) = &event.kind {
                    self.shifts.push(self.decisions);
                    self.first_deal = self.first_deal.take().or_else(|| first_deal(moment));
                }
            }
            // A game that was given up has no decision after the point.
            Line::Footer(_) if self.decisions == point => self.at_point = moment.game.cloned(),
            Line::PrivateExpression(_) | Line::Footer(_) => {}
        }
    }
}

fn first_deal(moment: &Moment<'_>) -> Option<FirstDeal> {
    let game = moment.game?;
    let faces = game.rules().faces();
    Some(FirstDeal {
        hands: game
            .hands()
            .iter()
            .map(|(seat, hand)| seat_cards(seat, *hand, faces))
            .collect(),
        known: moment.hands_known.values().all(|known| *known),
    })
}

/// The seeds of a recorded game, with the number of decisions up to which each deals; the last deals without end.
struct Seeds(Vec<(u64, Seed)>);

impl Seeds {
    /// The seeds that the game took over, and its own. The record has been replayed: its seeds are whole.
    fn of(header: &v1::RecordHeader, lines: &[v1::RecordLine]) -> Self {
        let seed = |bytes: &[u8]| Seed(bytes.try_into().unwrap_or_default());
        let mut end = 0;
        let mut seeds = Vec::new();
        for part in header.start.iter().flat_map(|start| &start.taken_over) {
            end += part.decisions;
            seeds.push((end, seed(&part.game_seed)));
        }
        let own = lines.iter().rev().find_map(reveal);
        seeds.push((u64::MAX, seed(own.map_or(&[], |reveal| &reveal.game_seed))));
        Self(seeds)
    }

    /// The seed of a Shift that begins with this decision, counted from 1; for 0 the seed of the first Shift.
    fn of_shift(&self, begun_by: u64) -> Seed {
        let part = self.0.iter().find(|(end, _)| begun_by <= *end);
        part.expect("the last seed has no end").1
    }

    /// The seed of all these Shifts, if it is one; the last if there are none.
    fn one_of(&self, begun_by: impl Iterator<Item = u64>) -> Option<Seed> {
        let seeds: BTreeSet<[u8; 32]> =
            begun_by.map(|begun_by| self.of_shift(begun_by).0).collect();
        match seeds.len() {
            0 => Some(self.of_shift(u64::MAX)),
            1 => seeds.first().copied().map(Seed),
            _ => None,
        }
    }

    /// The decisions from the first on, each with its seed.
    fn parts(&self, actions: &[ActionId]) -> Vec<TakenOver> {
        let mut parts = vec![TakenOver {
            seed: self.of_shift(0),
            actions: Vec::new(),
        }];
        for (begun_by, action) in (1..).zip(actions) {
            let seed = self.of_shift(begun_by);
            match parts.last_mut() {
                Some(part) if part.seed == seed => part.actions.push(*action),
                _ => parts.push(TakenOver {
                    seed,
                    actions: vec![*action],
                }),
            }
        }
        parts
    }
}
