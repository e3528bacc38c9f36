//! The tasks, as data: `tasks.json`. Everything in them is part of the benchmark's version.

use std::fmt;
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

/// The key of hidden deals: 32 random bytes, known to their organiser alone until the games have been
/// played.
#[derive(Clone, PartialEq, Eq)]
pub struct DealsKey(pub [u8; 32]);

impl DealsKey {
    /// What the organiser publishes before the games.
    pub fn commitment(&self) -> Commitment {
        Commitment(hex::encode(Sha256::digest(hex::encode(self.0))))
    }
}

impl fmt::Debug for DealsKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "DealsKey({})", self.commitment())
    }
}

/// The commitment to a [`DealsKey`]: SHA-256 of its 64 hexadecimal digits, in hexadecimal digits.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Commitment(String);

impl TryFrom<String> for Commitment {
    type Error = &'static str;

    fn try_from(text: String) -> Result<Self, Self::Error> {
        let is_hex = text.len() == 64 && text.bytes().all(|byte| byte.is_ascii_hexdigit());
        is_hex
            .then_some(Self(text))
            .ok_or("a commitment has 64 hexadecimal digits")
    }
}

impl From<Commitment> for String {
    fn from(commitment: Commitment) -> Self {
        commitment.0
    }
}

impl fmt::Display for Commitment {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

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
    /// The key of hidden deals; `None` for the published ones.
    #[serde(skip)]
    pub deals_key: Option<DealsKey>,
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

    /// The same task with the deals of a key, or with the published ones.
    pub fn with_deals(&self, key: Option<&DealsKey>) -> Self {
        Self {
            deals_key: key.cloned(),
            ..self.clone()
        }
    }

    /// The commitment to the key of its hidden deals; `None` for the published ones.
    pub fn deals_commitment(&self) -> Option<Commitment> {
        self.deals_key.as_ref().map(DealsKey::commitment)
    }

    /// The rule set.
    pub fn rule_set(&self) -> RuleSet {
        self.rules.rule_set().expect("the tasks are tested")
    }

    fn players(&self) -> usize {
        self.rules.players.into()
    }

    /// The game seed of a deal, by its index from 0: SHA-256 of the text "ChefsHat-v1 TASK INDEX",
    /// for example "ChefsHat-v1 shift 0". If the deals are hidden, a space and the 64 hexadecimal digits of
    /// the key follow.
    pub fn seed(&self, deal: usize) -> Seed {
        let mut text = format!("{BENCHMARK} {} {deal}", self.name);
        if let Some(DealsKey(bytes)) = &self.deals_key {
            text.push(' ');
            text.push_str(&hex::encode(bytes));
        }
        Seed(Sha256::digest(text).into())
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
                // Who sees a game of hidden deals knows the hands of the next one who plays them.
                visibility: match self.deals_key {
                    Some(_) => v1::Visibility::Private.into(),
                    None => v1::Visibility::Unspecified.into(),
                },
                ..self.policy()
            }),
            game_seed: self.seed(deal).0.to_vec(),
            ..v1::CreateRoomRequest::default()
        }
    }
}
