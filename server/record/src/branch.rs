//! Branches: the part of a recorded game that a new game takes over.

use std::collections::BTreeSet;

use chefshat_engine::{ActionId, Event, Game, RuleSet, Script, Seed, TakenOver};
use chefshat_proto::v1::{self, game_event::Kind, record_line::Line};

use crate::convert::{
    FieldProblem, has_real_cards, rules_from_proto, script_from_proto, seat_cards,
};
use crate::replay::{Moment, ReplayError, reveal, walk};

/// The beginning of a recorded game up to a branch point, sufficient to replay it
/// ([`Branch::played`]).
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Branch {
    /// The rule set.
    pub rules: RuleSet,
    /// The first Shift, if its hands were given.
    pub script: Option<Script>,
    /// The decisions taken over, grouped by the seed of the Shifts dealt in them. Never empty: the
    /// first part deals the first Shift, even without decisions.
    pub taken_over: Vec<TakenOver>,
    /// The seed of all later Shifts of the recorded game; `None` if they have several, so that
    /// they cannot be dealt again.
    pub later_deals: Option<Seed>,
}

/// Why a game cannot branch from a record.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum BranchError {
    /// The record does not verify.
    #[error("the record cannot be replayed: {0}")]
    Record(#[from] ReplayError),
    /// Its rules or first hands are invalid.
    #[error("the record is invalid: {0}")]
    Field(#[from] FieldProblem),
    /// The game was aborted before its start.
    #[error("the recorded game never started")]
    NeverBegan,
    /// The record has fewer decisions.
    #[error("the recorded game has {has} decisions, not {asked}")]
    TooFar {
        /// Decisions recorded.
        has: u64,
        /// Decisions requested.
        asked: u64,
    },
    /// The game was over at the point.
    #[error("after {0} decisions the recorded game was over; take over fewer")]
    Over(u64),
    /// A game with real cards and unknown hands.
    #[error("some hands of the recorded game are unknown")]
    HandsUnknown,
    /// A game with real cards has no seed for later Shifts.
    #[error(
        "the recorded game was played with real cards: it can only be branched in its first Shift"
    )]
    RealCards,
    /// A game with real cards and unknown decisions.
    #[error("some decisions of the recorded game before this point are unknown")]
    DecisionsUnknown,
}

impl Branch {
    /// The game at the branch point, with this seed for later Shifts. `None` if a decision is
    /// illegal, which never happens for a result of [`branch_of`].
    pub fn played(&self, later: Seed) -> Option<Game> {
        self.replayed(later, |_| {})
    }

    /// Like [`Branch::played`], reporting every event, private fields included.
    pub fn replayed(&self, later: Seed, mut on_event: impl FnMut(Event)) -> Option<Game> {
        let first = self.taken_over.first().map_or(later, |part| part.seed);
        let mut game = match &self.script {
            None => Game::new(self.rules, first, &mut on_event),
            Some(script) => Game::scripted(self.rules, first, script, &mut on_event).ok()?,
        };
        for part in &self.taken_over {
            game.reseed(part.seed);
            for action in &part.actions {
                game.apply(*action, &mut on_event).ok()?;
            }
        }
        game.reseed(later);
        Some(game)
    }
}

/// The branch of a record after `decisions`.
///
/// # Errors
/// The record does not verify, or the game cannot branch at this point.
pub fn branch_of(lines: &[v1::RecordLine], decisions: u64) -> Result<Branch, BranchError> {
    let mut collector = Collector::default();
    let replayed = walk(lines, |moment| collector.visit(&moment, decisions))?;
    let first_deal = collector.first_deal.ok_or(BranchError::NeverBegan)?;
    if decisions > replayed.decisions {
        return Err(BranchError::TooFar {
            has: replayed.decisions,
            asked: decisions,
        });
    }
    if decisions == replayed.decisions && replayed.state == v1::RoomState::Finished {
        return Err(BranchError::Over(decisions));
    }
    let header = &collector.header;
    let rules = rules_from_proto(&header.rules.clone().unwrap_or_default())?;
    let scripted = header
        .start
        .as_ref()
        .and_then(|start| start.scripted.clone());
    let shifts = collector.shifts.iter().copied();
    let seeds = Seeds::of(header, lines);
    let (script, later_deals) = if has_real_cards(header.origin()) {
        if !first_deal.known {
            return Err(BranchError::HandsUnknown);
        }
        if shifts.filter(|started_by| *started_by <= decisions).count() > 1 {
            return Err(BranchError::RealCards);
        }
        let dealt = v1::ScriptedShift {
            hands: first_deal.hands,
            ..scripted.unwrap_or_default()
        };
        (Some(dealt), None)
    } else {
        let later = shifts.filter(|started_by| *started_by > decisions);
        (scripted, seeds.one_of(later))
    };
    let script = script
        .map(|script| script_from_proto(&script, &rules))
        .transpose()?;
    let branch = Branch {
        rules,
        script,
        taken_over: seeds.parts(&collector.actions),
        later_deals,
    };
    // Without its missing decisions, a game with real cards continues differently.
    let any = Seed([0; 32]);
    let same = collector.at_point.is_some_and(|mut game| {
        game.reseed(any);
        branch.played(any) == Some(game)
    });
    if same {
        Ok(branch)
    } else {
        Err(BranchError::DecisionsUnknown)
    }
}

/// The state collected while walking a record.
#[derive(Default)]
struct Collector {
    header: v1::RecordHeader,
    /// Decisions taken so far.
    decisions: u64,
    /// The actions up to the point.
    actions: Vec<ActionId>,
    first_deal: Option<FirstDeal>,
    /// For each Shift, the number of the decision that started it; 0: none.
    shifts: Vec<u64>,
    /// The game at the point.
    at_point: Option<Game>,
}

struct FirstDeal {
    hands: Vec<v1::SeatCards>,
    /// Whether all hands are known.
    known: bool,
}

impl Collector {
    fn visit(&mut self, moment: &Moment<'_>, point: u64) {
        match moment.entry {
            Line::Header(header) => self.header = (**header).clone(),
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
            // An aborted game may have no decision after the point.
            Line::Footer(_) if self.decisions == point => self.at_point = moment.game.cloned(),
            Line::PrivateExpression(_) | Line::Marker(_) | Line::Footer(_) => {}
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

/// The seeds of a recorded game, each with the number of decisions up to which it deals.
struct Seeds(Vec<(u64, Seed)>);

impl Seeds {
    /// The seeds taken over, then the game's own. The record must be verified.
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

    /// The seed of a Shift that starts with this decision, from 1; for 0, of the first Shift.
    fn of_shift(&self, started_by: u64) -> Seed {
        let part = self.0.iter().find(|(end, _)| started_by <= *end);
        part.expect("the last seed has no limit").1
    }

    /// The common seed of these Shifts; the last seed if there are none.
    fn one_of(&self, started_by: impl Iterator<Item = u64>) -> Option<Seed> {
        let seeds: BTreeSet<[u8; 32]> = started_by
            .map(|started_by| self.of_shift(started_by).0)
            .collect();
        match seeds.len() {
            0 => Some(self.of_shift(u64::MAX)),
            1 => seeds.first().copied().map(Seed),
            _ => None,
        }
    }

    /// The decisions grouped by seed.
    fn parts(&self, actions: &[ActionId]) -> Vec<TakenOver> {
        let mut parts = vec![TakenOver {
            seed: self.of_shift(0),
            actions: Vec::new(),
        }];
        for (started_by, action) in (1..).zip(actions) {
            let seed = self.of_shift(started_by);
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
