//! The tasks, as data: `tasks.json`. Everything in them is part of the benchmark's version.

use std::sync::LazyLock;

use chefshat_agents::NamedAgent;
use chefshat_engine::{RuleSet, Seat, Seed, SeedPlan};
use chefshat_proto::v1;
use chefshat_record::convert::{plain_policy, rules_to_proto};
use chefshat_simulation::RulesForm;
use serde::{Deserialize, Serialize};
use sha2::{Digest as _, Sha256};

/// The name and version of the benchmark. Another version has other seeds.
pub const BENCHMARK: &str = "ChefsHat-v1";

/// Invalid attempts at a decision after which the default decision is taken.
const INVALID_ATTEMPTS: u32 = 10;
/// Timeouts after which a substitute plays.
const TIMEOUTS: u32 = 3;
/// How long a room waits for the agent, in milliseconds: agents may play one game after the other.
const WAITING_MS: u32 = 3_600_000;

/// A task: an agent plays one game on each of a number of deals, always against the same opponents.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Task {
    /// Its name in commands and results.
    pub name: String,
    /// What is played, in a sentence.
    pub about: String,
    /// The rules.
    pub rules: RulesForm,
    /// The built-in agents on the other seats, in their order from the left of the agent.
    pub opponents: Vec<String>,
    /// Number of deals that a complete result has.
    pub deals: usize,
    /// Time for a decision of the agent, in milliseconds.
    pub decision_time_ms: u32,
}

/// All tasks.
pub fn tasks() -> &'static [Task] {
    static TASKS: LazyLock<Vec<Task>> = LazyLock::new(|| {
        serde_json::from_str(include_str!("tasks.json")).expect("the tasks are tested")
    });
    &TASKS
}

impl Task {
    /// The task of this name.
    pub fn named(name: &str) -> Option<&'static Task> {
        tasks().iter().find(|task| task.name == name)
    }

    /// The rule set.
    pub fn rule_set(&self) -> RuleSet {
        self.rules.rule_set().expect("the tasks are tested")
    }

    fn players(&self) -> usize {
        self.rules.players.into()
    }

    /// The game seed of a deal, by its index from 0: SHA-256 of the text "ChefsHat-v1 TASK INDEX",
    /// for example "ChefsHat-v1 shift 0".
    pub fn seed(&self, deal: usize) -> Seed {
        Seed(Sha256::digest(format!("{BENCHMARK} {} {deal}", self.name)).into())
    }

    /// The seat of the agent in the game of a deal: it rotates by one with each deal.
    pub fn seat(&self, deal: usize) -> Seat {
        Seat::new(deal % self.players())
    }

    /// The opponents in the game of a deal, by seat; `None` at the seat of the agent.
    pub fn opponents(&self, deal: usize) -> Vec<Option<NamedAgent>> {
        let players = self.players();
        let own = self.seat(deal).index();
        let of_seat = |seat: usize| {
            let to_the_left = (seat + players - own) % players;
            let name = self.opponents.get(to_the_left.checked_sub(1)?)?;
            Some(name.parse().expect("the tasks are tested"))
        };
        (0..players).map(of_seat).collect()
    }

    /// The seed of the built-in agent on a seat, as a room gives it.
    pub fn agent_seed(&self, deal: usize, seat: Seat) -> [u8; 32] {
        let game_seed = self.seed(deal).0;
        SeedPlan::Fixed { game_seed }.agent_seed(seat.index())
    }

    /// The policy of the rooms.
    pub fn policy(&self) -> v1::RoomPolicy {
        v1::RoomPolicy {
            decision_time_ms: Some(self.decision_time_ms),
            bank_ms: Some(0),
            max_invalid_attempts: Some(INVALID_ATTEMPTS),
            max_timeouts: Some(TIMEOUTS),
            substitute: "random".to_owned(),
            abort: v1::AbortPolicy::Never.into(),
            waiting_time_ms: Some(WAITING_MS),
            ..plain_policy()
        }
    }

    /// The request of the room of a deal, with the agent's seat open to every kind of participant.
    pub fn room(&self, deal: usize) -> v1::CreateRoomRequest {
        let seat = |agent: Option<NamedAgent>| v1::SeatConfig {
            filled_by: Some(match agent {
                None => {
                    v1::seat_config::FilledBy::ReservedFor(v1::ParticipantKind::Unspecified.into())
                }
                Some(agent) => v1::seat_config::FilledBy::BuiltInAgent(agent.name()),
            }),
            name: String::new(),
        };
        v1::CreateRoomRequest {
            name: format!("{BENCHMARK} {} {deal}", self.name),
            rules: Some(rules_to_proto(&self.rule_set())),
            seats: self.opponents(deal).into_iter().map(seat).collect(),
            policy: Some(v1::RoomPolicy {
                // A server without a store keeps them in memory.
                durability: v1::Durability::Unspecified.into(),
                ..self.policy()
            }),
            game_seed: self.seed(deal).0.to_vec(),
            ..v1::CreateRoomRequest::default()
        }
    }
}
