//! Checks the record of a game: that it is complete and correct, has the deal, the rules, the limits
//! and the opponents of the task, and that each decision of an opponent is the one that it takes. No
//! record proves who took the decisions of the agent.

use std::collections::VecDeque;
use std::num::NonZeroU32;

use chefshat_agents::{BuiltInAgent, Following, Listener, NamedAgent, play_agents};
use chefshat_engine::{ActionId, Decision, Event, Mask, MetricsRecorder, Observation, Seat};
use chefshat_proto::v1::{self, game_event::Kind, record_line::Line};
use chefshat_record::convert::rules_to_proto;
use chefshat_record::jsonl::Record;
use chefshat_record::language_model::ModelUsage;
use chefshat_record::outcome::{Identity, has_choice, is_by_fallback};
use chefshat_record::replay::{ReplayError, walk_file};
use chefshat_record::signature::{PublicKey, TextHash};
use chefshat_search::named_agent;
use thiserror::Error;

use crate::task::Task;

/// Why a record does not count for the game of a deal.
#[derive(Debug, Error)]
pub enum Problem {
    /// It is wrong or incomplete.
    #[error("line {}: {}", .0.line, .0.problem)]
    Wrong(#[from] ReplayError),
    /// Its game was aborted.
    #[error("the game was aborted")]
    Aborted,
    /// Parts of it are missing.
    #[error("parts were removed from the record; download the whole one")]
    Redacted,
    /// It is of another deal.
    #[error("the game has a different seed than this deal of the task")]
    OtherDeal,
    /// It has other rules.
    #[error("the game has different rules than the task")]
    OtherRules,
    /// It has other limits.
    #[error("the room has a different policy than the task: {0}")]
    OtherPolicy(&'static str),
    /// Other opponents.
    #[error("seat {seat} was not the built-in agent {wanted}")]
    OtherOpponent {
        /// The seat, from 0.
        seat: usize,
        /// The opponent of the task.
        wanted: String,
    },
    /// A built-in agent took a decision that it does not take.
    #[error("decision {decision} of the game, by seat {seat}, is not the one that {name} takes")]
    Deviates {
        /// The seat, from 0.
        seat: usize,
        /// The opponent.
        name: String,
        /// Number of the decision in the game, from 1.
        decision: usize,
    },
}

/// What the agent reached in the game of a deal.
#[derive(Debug, Clone, PartialEq)]
pub struct GameScore {
    /// Points of the agent in the whole game.
    pub points: u64,
    /// Shifts of the game.
    pub shifts: u32,
    /// Place of the agent in the game, from 1.
    pub place: u8,
    /// Who played: the participant at the agent's seat.
    pub player: Identity,
    /// Decisions of the agent's seat.
    pub decisions: u64,
    /// Those of them with more than one legal action.
    pub choices: u64,
    /// Choices that the agent did not take itself: defaults after timeouts or invalid attempts,
    /// decisions of the room's substitute, and those of its own fallback.
    pub fallback_decisions: u64,
    /// Its invalid attempts.
    pub invalid_attempts: u64,
    /// Tokens and cost of a language model, by its own account; `None` for other agents.
    pub language_model: Option<ModelUsage>,
    /// Decision times that were measured, in microseconds.
    pub decision_times_us: Vec<u64>,
    /// Whose key signed the record.
    pub signed_by: Option<PublicKey>,
    /// The hash of the text of the record.
    pub record: TextHash,
}

/// Checks the record of the game of a deal, by its index from 0.
///
/// # Errors
/// What prevents it from counting.
pub fn check(task: &Task, deal: usize, record: &Record) -> Result<GameScore, Problem> {
    let replayed = walk_file(record, |_| {})?;
    if replayed.state != v1::RoomState::Finished {
        return Err(Problem::Aborted);
    }
    if replayed.redacted {
        return Err(Problem::Redacted);
    }
    let lines = || record.lines.iter().filter_map(|line| line.line.as_ref());
    let seed = lines().find_map(|line| match line {
        Line::Event(v1::GameEvent {
            kind: Some(Kind::GameEnded(ended)),
            ..
        }) => Some(ended.reveal.as_ref()?.game_seed.as_slice()),
        _ => None,
    });
    if seed != Some(task.seed(deal).0.as_slice()) {
        return Err(Problem::OtherDeal);
    }
    let header = lines().find_map(|line| match line {
        Line::Header(header) => Some(header),
        _ => None,
    });
    let header = header.expect("a record that was replayed has a header");
    check_header(task, deal, header)?;
    let decisions = lines().filter_map(|line| match line {
        Line::Decision(decision) => Some(decision),
        _ => None,
    });
    let decisions: Vec<&v1::DecisionRecord> = decisions.collect();
    let seat = task.seat(deal).index();
    let player = header.seats.get(seat).map(Identity::of);
    let player = player.expect("a record that was replayed has all seats");
    let played = play_again(task, deal, &player, &decisions)?;
    let mut score = GameScore {
        points: played.points,
        shifts: played.shifts,
        place: played.place,
        player,
        decisions: 0,
        choices: 0,
        fallback_decisions: 0,
        invalid_attempts: 0,
        language_model: None,
        decision_times_us: Vec::new(),
        signed_by: replayed.signed_by,
        record: record.text,
    };
    let own = (decisions.into_iter()).filter(|decision| decision.seat as usize == seat);
    let choices = own.clone().filter(|decision| has_choice(decision));
    let said = choices.map(|decision| decision.annotations.as_ref());
    score.language_model = ModelUsage::of_game(said);
    for decision in own {
        score.decisions += 1;
        score.invalid_attempts += decision.invalid_attempts.len() as u64;
        let is_own = decision.source() == v1::DecisionSource::Agent
            && !decision.annotations.as_ref().is_some_and(is_by_fallback);
        if has_choice(decision) {
            score.choices += 1;
            score.fallback_decisions += u64::from(!is_own);
        }
        if is_own && decision.decision_time_us > 0 {
            score.decision_times_us.push(decision.decision_time_us);
        }
    }
    Ok(score)
}

fn check_header(task: &Task, deal: usize, header: &v1::RecordHeader) -> Result<(), Problem> {
    if header.origin() != v1::GameOrigin::FixedSeed {
        return Err(Problem::OtherDeal);
    }
    if header.rules.as_ref() != Some(&rules_to_proto(&task.rule_set())) {
        return Err(Problem::OtherRules);
    }
    if let Some(what) = difference(&header.policy.clone().unwrap_or_default(), &task.policy()) {
        return Err(Problem::OtherPolicy(what));
    }
    for (seat, wanted) in task.opponents(deal).into_iter().enumerate() {
        let Some(wanted) = wanted.map(|agent| agent.name()) else {
            continue;
        };
        let given = header.seats.get(seat).map(|it| &it.built_in_agent);
        if given != Some(&wanted) {
            return Err(Problem::OtherOpponent { seat, wanted });
        }
    }
    Ok(())
}

/// The first limit in which a policy differs from that of the task, if it could help the agent.
fn difference(given: &v1::RoomPolicy, wanted: &v1::RoomPolicy) -> Option<&'static str> {
    let longest = wanted.decision_time_ms.unwrap_or(0);
    let is_longer = |time: Option<u32>| time.is_some_and(|time| time > longest);
    let has_bank = |bank: Option<u32>| bank.is_some_and(|bank| bank > 0);
    let clocks = || given.clocks.iter();
    let differences = [
        (
            given.decision_time_ms.is_none()
                || is_longer(given.decision_time_ms)
                || clocks().any(|clock| is_longer(clock.decision_time_ms)),
            "a longer time for decisions",
        ),
        (
            given.bank_ms.is_none()
                || has_bank(given.bank_ms)
                || clocks().any(|clock| has_bank(clock.bank_ms)),
            "a time bank",
        ),
        (
            given.max_invalid_attempts != wanted.max_invalid_attempts,
            "the number of invalid attempts",
        ),
        (
            given.max_timeouts != wanted.max_timeouts,
            "the number of timeouts",
        ),
        (given.substitute != wanted.substitute, "the substitute"),
        (given.abort != wanted.abort, "when a game is aborted"),
        (
            given.pace_ms != wanted.pace_ms,
            "the pace of built-in agents",
        ),
        (
            given.spectators_see_hands == Some(true),
            "spectators see hands",
        ),
        (given.hints, "hints"),
    ];
    let found = differences.iter().find(|(differs, _)| *differs);
    found.map(|(_, what)| *what)
}

/// The result of the agent in a game.
struct Played {
    points: u64,
    shifts: u32,
    place: u8,
}

/// The built-in agent that can be played again, if a participant is one.
pub(crate) fn repeatable(player: &Identity) -> Option<NamedAgent> {
    let named: Option<NamedAgent> = player.name.parse().ok().filter(|_| player.built_in);
    named.filter(|agent| agent.search().is_none())
}

/// Plays the game again with the recorded decisions of the agent, unless that is a built-in one, and
/// compares all decisions.
fn play_again(
    task: &Task,
    deal: usize,
    player: &Identity,
    decisions: &[&v1::DecisionRecord],
) -> Result<Played, Problem> {
    let (rules, own) = (task.rule_set(), task.seat(deal));
    let mut known = task.opponents(deal);
    known[own.index()] = repeatable(player);
    let given = (decisions.iter())
        .filter(|decision| decision.seat as usize == own.index())
        .map(|decision| action(decision));
    let given = Given(given.collect());
    let mut agents: Vec<BuiltInAgent> = (known.iter().enumerate())
        .map(|(seat, agent)| match agent {
            None => BuiltInAgent::following(Box::new(given.clone())),
            Some(agent) => named_agent(*agent, &rules, task.agent_seed(deal, Seat::new(seat))),
        })
        .collect();
    let mut witness = Witness {
        recorder: MetricsRecorder::new(rules, None),
        own,
        decisions: Vec::with_capacity(decisions.len()),
        points: 0,
        shifts: 0,
    };
    // Once an opponent has deviated, a recorded action may be illegal.
    let attempts = Some(NonZeroU32::MIN);
    let standings = play_agents(rules, task.seed(deal), attempts, &mut agents, &mut witness);
    let differs = |(number, (seat, played)): (usize, &(Seat, ActionId))| {
        let recorded = decisions.get(number);
        let is_same =
            recorded.is_some_and(|it| it.seat as usize == seat.index() && action(it) == *played);
        (!is_same).then_some((number, *seat))
    };
    if let Some((number, seat)) = witness.decisions.iter().enumerate().find_map(differs) {
        let name = known[seat.index()].map_or_else(String::new, |agent| agent.name());
        return Err(Problem::Deviates {
            seat: seat.index(),
            name,
            decision: number + 1,
        });
    }
    let place = standings.iter().find(|(_, seat, _)| *seat == own);
    Ok(Played {
        points: witness.points,
        shifts: witness.shifts,
        place: place.map_or(0, |(place, ..)| place),
    })
}

fn action(decision: &v1::DecisionRecord) -> ActionId {
    // No action has the last number, so another decision is found there.
    ActionId::new(u16::try_from(decision.action).unwrap_or(u16::MAX))
}

/// An agent that takes given decisions.
#[derive(Debug, Clone)]
struct Given(VecDeque<ActionId>);

impl Following for Given {
    fn name(&self) -> &'static str {
        "given"
    }

    fn on_event(&mut self, _: Seat, _: &Event) {}

    fn decide(&mut self, _: &Observation, legal: &Mask) -> ActionId {
        let first = legal.iter().next().expect("a decision has a legal action");
        self.0.pop_front().unwrap_or(first)
    }

    fn boxed_clone(&self) -> Box<dyn Following> {
        Box::new(self.clone())
    }
}

/// Notes what the agent gets in a game.
struct Witness {
    recorder: MetricsRecorder,
    own: Seat,
    decisions: Vec<(Seat, ActionId)>,
    points: u64,
    shifts: u32,
}

impl Listener for Witness {
    fn on_event(&mut self, event: &Event) {
        if let Some(shift) = self.recorder.on_event(event) {
            self.points += u64::from(shift.seats[self.own].points);
            self.shifts += 1;
        }
    }

    fn on_decision(&mut self, decision: Decision, action: ActionId) {
        self.decisions.push((decision.seat, action));
    }
}
