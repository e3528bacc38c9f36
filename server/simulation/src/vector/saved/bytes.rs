//! The bytes of a state: portable and versioned. All numbers are little-endian. A state is
//!
//! - 8 bytes `chefsave`, u16 version;
//! - the terms: rule set, agents, reward scheme, decisions, invalid actions, what is kept;
//! - u64 index, and whether a game is running; if so:
//! - the game: its seed, the engine's state, positions of generators, statistics, pending rewards,
//!   the open decision, kept decisions, the history;
//! - u32 CRC-32 of all bytes before, which finds damage.
//!
//! Bytes are not trusted, with a right checksum or without: reading checks every value, and the
//! engine refuses states that no game can have. A state has less than 2 KB, plus 5 bytes for each
//! entry of a history and at least 7 for each kept decision.

use std::num::NonZeroU32;

use chefshat_engine::{
    ActionId, Game, MetricsRecorder, Opening, PassScope, PlayedDecision, RecorderState,
    RewardScheme, RuleSet, RuleSetSpec, SeatCounts, Seed, Stop,
};

use super::SavedGame;
use super::game::{game, put_game};
use super::history::{history, put_history};
use super::reader::Reader;
use crate::vector::error::{STATE_VERSION, StateError};
use crate::vector::history::MAX_HISTORY;
use crate::vector::opponent::Opponent;
use crate::vector::running::{Open, RunningGame};
use crate::vector::terms::{Decisions, InvalidActions, Terms};

const MAGIC: &[u8; 8] = b"chefsave";
/// Bytes of the checksum.
const CHECKSUM: usize = 4;
/// Fewest bytes of a kept decision.
const DECISION: usize = 7;
/// Words after which a generator repeats itself.
const PERIOD: u128 = 1 << 68;

impl SavedGame {
    /// The state as bytes.
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut out = Vec::with_capacity(1024);
        out.extend(MAGIC);
        out.extend(STATE_VERSION.to_le_bytes());
        put_terms(&mut out, &self.terms);
        out.extend(self.index.to_le_bytes());
        out.push(self.running.is_some().into());
        if let Some(running) = &self.running {
            put_running(&mut out, running);
        }
        let checksum = crc32fast::hash(&out);
        out.extend(checksum.to_le_bytes());
        out
    }

    /// Reads what [`SavedGame::to_bytes`] writes.
    ///
    /// # Errors
    /// If the bytes are damaged, of another version, or a state that no game can have.
    pub fn from_bytes(bytes: &[u8]) -> Result<SavedGame, StateError> {
        let mut reader = Reader(bytes);
        if reader.take(MAGIC.len()) != Ok(MAGIC) {
            return Err(StateError::Malformed("they do not begin as one"));
        }
        let version = reader.u16()?;
        if version != STATE_VERSION {
            return Err(StateError::Version(version));
        }
        let length = reader.0.len().checked_sub(CHECKSUM);
        let length = length.ok_or(StateError::Malformed("they are incomplete"))?;
        let (content, checksum) = reader.0.split_at(length);
        let hash = crc32fast::hash(&bytes[..bytes.len() - CHECKSUM]);
        if hash.to_le_bytes() != *checksum {
            return Err(StateError::Malformed("they are damaged"));
        }
        let mut reader = Reader(content);
        let terms = terms(&mut reader)?;
        let index = reader.u64()?;
        let running = reader.optional(|reader| running(reader, &terms))?;
        if !reader.0.is_empty() {
            return Err(StateError::Malformed("more bytes follow"));
        }
        Ok(SavedGame {
            terms,
            index,
            running,
        })
    }
}

fn put_text(out: &mut Vec<u8>, text: &str) {
    out.push(u8::try_from(text.len()).expect("names are short"));
    out.extend(text.as_bytes());
}

fn put_agent(out: &mut Vec<u8>, agent: Option<Opponent>) {
    put_text(out, &agent.map_or(String::new(), |agent| agent.to_string()));
}

fn put_terms(out: &mut Vec<u8>, terms: &Terms) {
    let rules = terms.rules.spec();
    out.extend([rules.players, rules.faces, rules.jokers]);
    let (kind, target) = match rules.stop {
        Stop::Points(target) => (0, target),
        Stop::Shifts(target) => (1, target),
    };
    out.push(kind);
    out.extend(target.to_le_bytes());
    rules
        .points
        .iter()
        .for_each(|points| out.extend(points.to_le_bytes()));
    out.extend([
        rules.exchange.into(),
        rules.special_actions.into(),
        u8::from(rules.opening == Opening::AnyTopFace),
        rules.opening_pass.into(),
        u8::from(rules.pass_scope == PassScope::Turn),
    ]);
    out.extend(rules.max_idle_pizzas.to_le_bytes());
    out.extend(rules.max_turns.to_le_bytes());
    terms
        .agents
        .values()
        .for_each(|agent| put_agent(out, *agent));
    put_text(out, terms.scheme.map_or("", RewardScheme::name));
    let (turns, others) = match terms.decisions {
        Decisions::All => (false, None),
        Decisions::Turns { others } => (true, others),
    };
    out.push(turns.into());
    put_agent(out, others.map(Opponent::BuiltIn));
    let (asks, limit) = match terms.invalid {
        InvalidActions::Error => (false, None),
        InvalidActions::AskAgain { limit } => (true, limit),
    };
    out.push(asks.into());
    out.extend(limit.map_or(0, NonZeroU32::get).to_le_bytes());
    out.extend([terms.statistics, terms.records].map(u8::from));
    out.extend(terms.history.to_le_bytes());
}

fn terms(reader: &mut Reader<'_>) -> Result<Terms, StateError> {
    let rules = rules(reader)?;
    let agents = reader.by_seat(rules.players(), Reader::agent)?;
    let scheme = match reader.text()? {
        "" => None,
        name => {
            let unknown = StateError::Malformed("there is no reward scheme of this name");
            Some(RewardScheme::from_name(name).ok_or(unknown)?)
        }
    };
    let (turns, others) = (reader.flag()?, reader.agent()?);
    let others = match others {
        None => None,
        Some(Opponent::BuiltIn(kind)) => Some(kind),
        Some(Opponent::Network(_)) => return Err(StateError::Malformed("no network takes these")),
    };
    let (asks, limit) = (reader.flag()?, NonZeroU32::new(reader.u32()?));
    Ok(Terms {
        rules,
        agents,
        scheme,
        decisions: match (turns, others) {
            (false, None) => Decisions::All,
            (false, Some(_)) => return Err(StateError::Malformed("an agent has no decisions")),
            (true, others) => Decisions::Turns { others },
        },
        invalid: match (asks, limit) {
            (false, None) => InvalidActions::Error,
            (false, Some(_)) => return Err(StateError::Malformed("attempts have no limit here")),
            (true, limit) => InvalidActions::AskAgain { limit },
        },
        statistics: reader.flag()?,
        records: reader.flag()?,
        history: history_width(reader)?,
    })
}

fn history_width(reader: &mut Reader<'_>) -> Result<u16, StateError> {
    let width = reader.u16()?;
    if width > MAX_HISTORY {
        return Err(StateError::Malformed("its history is too wide"));
    }
    Ok(width)
}

fn rules(reader: &mut Reader<'_>) -> Result<RuleSet, StateError> {
    let [players, faces, jokers] = reader.array()?;
    let by_shifts = reader.flag()?;
    let target = reader.u32()?;
    let points = (0..players).map(|_| reader.u32());
    let points = points.collect::<Result<Vec<u32>, _>>()?;
    let spec = RuleSetSpec {
        players,
        faces,
        jokers,
        stop: match by_shifts {
            true => Stop::Shifts(target),
            false => Stop::Points(target),
        },
        points,
        exchange: reader.flag()?,
        special_actions: reader.flag()?,
        opening: match reader.flag()? {
            true => Opening::AnyTopFace,
            false => Opening::Golden,
        },
        opening_pass: reader.flag()?,
        pass_scope: match reader.flag()? {
            true => PassScope::Turn,
            false => PassScope::Pizza,
        },
        max_idle_pizzas: reader.u32()?,
        max_turns: reader.u32()?,
    };
    let invalid = |_| StateError::Malformed("the rule set is not valid");
    spec.validate().map_err(invalid)
}

fn put_running(out: &mut Vec<u8>, running: &RunningGame) {
    out.extend(running.seed.0);
    put_game(out, &running.game.state());
    let agents = running.agents.iter().flatten();
    for position in agents.filter_map(|agent| agent.position()) {
        out.extend(position.to_le_bytes());
    }
    if let Some(recorder) = &running.recorder {
        let state = recorder.state();
        out.extend(state.shifts.to_le_bytes());
        for seat in state.seats.values() {
            for count in [seat.plays, seat.passes, seat.wrong] {
                out.extend(count.to_le_bytes());
            }
            out.extend(seat.reward_sum.to_le_bytes());
            out.extend(seat.performance_sum.to_le_bytes());
        }
    }
    for reward in running.rewards.values() {
        out.extend(reward.to_le_bytes());
    }
    out.push(running.open.is_some().into());
    if let Some(open) = &running.open {
        out.extend(open.attempts.to_le_bytes());
        out.extend(open.reward.to_le_bytes());
    }
    put_actions(out, &running.attempts);
    out.extend((running.decisions.len() as u32).to_le_bytes());
    for taken in &running.decisions {
        out.extend(taken.action.index().to_le_bytes());
        out.push(taken.by_default.into());
        put_actions(out, &taken.attempts);
    }
    if let Some(history) = &running.history {
        put_history(out, history);
    }
}

fn put_actions(out: &mut Vec<u8>, actions: &[ActionId]) {
    out.extend((actions.len() as u32).to_le_bytes());
    for action in actions {
        out.extend(action.index().to_le_bytes());
    }
}

fn actions(reader: &mut Reader<'_>) -> Result<Vec<ActionId>, StateError> {
    let count = reader.count(2)?;
    (0..count)
        .map(|_| reader.u16().map(ActionId::new))
        .collect()
}

fn running(reader: &mut Reader<'_>, terms: &Terms) -> Result<RunningGame, StateError> {
    let players = terms.rules.players();
    let seed = Seed(reader.array()?);
    let game = Game::from_state(&game(reader, terms.rules)?)?;
    let mut agents = RunningGame::agents(terms, seed);
    for agent in agents.iter_mut().flatten() {
        if agent.position().is_some() {
            let position = reader.u128()?;
            if position >= PERIOD {
                return Err(StateError::Malformed("no generator has this position"));
            }
            agent.set_position(position);
        }
    }
    let recorder = match terms.statistics {
        false => None,
        true => {
            let state = RecorderState {
                shifts: reader.u32()?,
                seats: reader.by_seat(players, |reader| {
                    Ok(SeatCounts {
                        plays: reader.u32()?,
                        passes: reader.u32()?,
                        wrong: reader.u32()?,
                        reward_sum: reader.f64()?,
                        performance_sum: reader.f64()?,
                    })
                })?,
            };
            Some(MetricsRecorder::resuming(&game, terms.scheme, &state)?)
        }
    };
    let rewards = reader.by_seat(players, Reader::f32)?;
    let open = reader.optional(|reader| Ok((reader.u32()?, reader.f32()?)))?;
    let attempts = actions(reader)?;
    let count = reader.count(DECISION)?;
    let decisions = (0..count).map(|_| {
        Ok(PlayedDecision {
            action: ActionId::new(reader.u16()?),
            by_default: reader.flag()?,
            attempts: actions(reader)?,
        })
    });
    let decisions = decisions.collect::<Result<Vec<_>, StateError>>()?;
    let open = open.map(|(attempts, reward)| Open::resuming(&game, terms, attempts, reward));
    let open = open.transpose()?;
    let asked = open.as_ref().map_or(0, |open| open.attempts) as usize;
    let listed = if terms.records { asked } else { 0 };
    if attempts.len() != listed || (!terms.records && !decisions.is_empty()) {
        return Err(StateError::Malformed("kept decisions do not fit"));
    }
    let history = match terms.history {
        0 => None,
        _ => Some(history(reader, terms)?),
    };
    let kept = decisions
        .iter()
        .map(|taken| 1 + taken.attempts.len() as u64);
    Ok(RunningGame {
        seed,
        game,
        agents,
        recorder,
        rewards,
        open,
        events: Vec::new(),
        attempts,
        kept: kept.sum(),
        decisions,
        history,
    })
}
