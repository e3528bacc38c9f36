//! The flags that describe the policy of rooms, shared by the commands that make them: times, limits, rewards. What makes sense is decided by
//! the server.

use chefshat_client::v1;
use chefshat_engine::RewardScheme;
use chefshat_record::convert::reward_scheme_to_proto;
use clap::builder::PossibleValuesParser;
use clap::{Args, ValueEnum};

use crate::kind::KindArg;

/// Names of the reward schemes, in the order of the protocol's numbers from 1.
const REWARDS: [&str; 5] = ["validity", "paper", "paper_intended", "winning", "points"];

/// Times and limits of a room.
#[derive(Debug, Clone, Default, Args)]
#[command(next_help_heading = "Times and limits")]
pub(super) struct PolicyArgs {
    /// Milliseconds for a decision; standard 10000, for people 60000.
    #[arg(long, value_name = "MS")]
    decision_time_ms: Option<u32>,
    /// Milliseconds each seat may use beyond that over the whole game; standard 60000, for people 300000.
    #[arg(long, value_name = "MS")]
    bank_ms: Option<u32>,
    /// Other times for participants of a kind: milliseconds for a decision and, after another colon, beyond that, for instance human:60000
    /// or robot:30000:120000. Repeatable. People have their standard times unless --decision-time-ms or --bank-ms is given.
    #[arg(long = "clock", value_name = "KIND:MS[:MS]", value_parser = clock)]
    clocks: Vec<v1::KindClock>,
    /// Invalid attempts at one decision before the default is taken, 0 for no limit; standard 10.
    #[arg(long, value_name = "N")]
    max_invalid_attempts: Option<u32>,
    /// Decisions in a row lost to the clock before a seat is substituted; standard 3.
    #[arg(long, value_name = "N")]
    max_timeouts: Option<u32>,
    /// Milliseconds that the server's own agents wait before they decide; standard 1000 where a person plays, else 0.
    #[arg(long, value_name = "MS")]
    pace_ms: Option<u32>,
    /// Rewards told to the seats.
    #[arg(long, value_name = "SCHEME", value_parser = PossibleValuesParser::new(REWARDS))]
    reward: Option<String>,
    /// Decisions by which spectators are behind; standard 0.
    #[arg(long, value_name = "N")]
    spectator_delay: Option<u32>,
    /// What the game outlives; standard durable.
    #[arg(long)]
    durability: Option<DurabilityArg>,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum DurabilityArg {
    /// The death of the server: it goes on where it stood.
    Durable,
    /// Nothing; takes less time, and its record is kept when it ends.
    Ephemeral,
}

impl PolicyArgs {
    /// The policy as a server is asked for it: what was not said is left to the server's standard.
    pub(super) fn message(&self) -> v1::RoomPolicy {
        let scheme = self.reward.as_deref().and_then(RewardScheme::from_name);
        v1::RoomPolicy {
            decision_time_ms: self.decision_time_ms,
            bank_ms: self.bank_ms,
            max_invalid_attempts: self.max_invalid_attempts,
            max_timeouts: self.max_timeouts,
            pace_ms: self.pace_ms,
            reward_scheme: reward_scheme_to_proto(scheme).into(),
            spectator_delay_decisions: self.spectator_delay,
            durability: match self.durability {
                None => v1::Durability::Unspecified,
                Some(DurabilityArg::Durable) => v1::Durability::Durable,
                Some(DurabilityArg::Ephemeral) => v1::Durability::Ephemeral,
            }
            .into(),
            clocks: self.clocks.clone(),
            ..v1::RoomPolicy::default()
        }
    }
}

fn clock(words: &str) -> Result<v1::KindClock, String> {
    let mut parts = words.split(':');
    let kind = parts
        .next()
        .and_then(|kind| KindArg::from_str(kind, false).ok());
    let mut times = parts.map(|part| part.parse::<u32>().ok());
    match (kind, times.next(), times.next(), times.next()) {
        (Some(kind), Some(Some(decision_time_ms)), bank_ms, None) if bank_ms != Some(None) => {
            Ok(v1::KindClock {
                kind: v1::ParticipantKind::from(kind).into(),
                decision_time_ms: Some(decision_time_ms),
                bank_ms: bank_ms.flatten(),
            })
        }
        _ => Err("give agent, human or robot, :, and milliseconds for a decision".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use crate::policy_args::*;

    #[derive(Parser)]
    struct Only {
        #[command(flatten)]
        policy: PolicyArgs,
    }

    fn policy(flags: &str) -> v1::RoomPolicy {
        let words = std::iter::once("test").chain(flags.split_whitespace());
        let only = Only::try_parse_from(words).expect("the flags are known");
        only.policy.message()
    }

    #[test]
    fn every_reward_has_its_scheme() {
        for name in REWARDS {
            let policy = policy(&format!("--reward {name}"));
            let wire = policy.reward_scheme().as_str_name();
            assert_eq!(wire, format!("REWARD_SCHEME_{}", name.to_uppercase()));
        }
    }

    #[test]
    fn a_game_outlives_the_server_or_not() {
        for (flags, expected) in [
            ("", v1::Durability::Unspecified),
            ("--durability durable", v1::Durability::Durable),
            ("--durability ephemeral", v1::Durability::Ephemeral),
        ] {
            assert_eq!(policy(flags).durability(), expected);
        }
    }

    #[test]
    fn kinds_have_clocks_of_their_own() {
        let clock_of = |kind: v1::ParticipantKind, decision_time_ms, bank_ms| v1::KindClock {
            kind: kind.into(),
            decision_time_ms: Some(decision_time_ms),
            bank_ms,
        };
        assert_eq!(
            policy("--clock human:60000 --clock robot:30000:0").clocks,
            [
                clock_of(v1::ParticipantKind::Human, 60_000, None),
                clock_of(v1::ParticipantKind::Robot, 30_000, Some(0)),
            ]
        );
        for nonsense in [
            "",
            "human",
            "human:",
            "ghost:5",
            "human:5:",
            "human:5:x",
            "human:5:6:7",
        ] {
            assert!(clock(nonsense).is_err(), "{nonsense}");
        }
    }
}
