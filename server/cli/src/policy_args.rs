//! Flags for the policy of rooms: times, limits, rewards. The server validates them.

use chefshat_client::v1;
use chefshat_engine::RewardScheme;
use chefshat_record::convert::reward_scheme_to_proto;
use clap::builder::PossibleValuesParser;
use clap::{Args, ValueEnum as _};

use crate::choice::choice;
use crate::kind::KindArg;

/// Names of the reward schemes, in the order of their numbers in the protocol, from 1.
const REWARDS: [&str; 5] = ["validity", "paper", "paper_intended", "winning", "points"];

const DURABILITIES: [(&str, v1::Durability, &str); 2] = [
    (
        "durable",
        v1::Durability::Durable,
        "The game survives the death of the server and resumes",
    ),
    (
        "ephemeral",
        v1::Durability::Ephemeral,
        "The game is lost with the server. Faster; its record is stored when it ends",
    ),
];
const VISIBILITIES: [(&str, v1::Visibility, &str); 3] = [
    ("public", v1::Visibility::Public, "Everybody"),
    (
        "unlisted",
        v1::Visibility::Unlisted,
        "It is in no list, but anyone who knows its id sees it",
    ),
    (
        "private",
        v1::Visibility::Private,
        "Only those who have a ticket or the owner token",
    ),
];

/// Times and limits of a room.
#[derive(Debug, Clone, Default, Args)]
#[command(next_help_heading = "Times and limits")]
pub(super) struct PolicyArgs {
    /// Milliseconds for each decision. Default: 10000, for people and language models 60000.
    #[arg(long, value_name = "MS")]
    decision_time_ms: Option<u32>,
    /// Time bank of each seat for the whole game, in milliseconds. Default: 60000, for people and
    /// language models 300000.
    #[arg(long, value_name = "MS")]
    bank_ms: Option<u32>,
    /// Absence time: milliseconds that the game waits, at each decision, for a seat that is not
    /// connected; then a substitute plays until it returns. Default: 20000 for people, the decision
    /// time for others.
    #[arg(long, value_name = "MS")]
    absence_time_ms: Option<u32>,
    /// Times for one kind of participant: milliseconds per decision and, after further colons, the
    /// time bank and the absence time, for example human:60000 or robot:30000:120000:5000.
    /// Repeatable. People and language models have their default times unless --decision-time-ms or
    /// --bank-ms is given.
    #[arg(long = "clock", value_name = "KIND:MS[:MS[:MS]]", value_parser = clock)]
    clocks: Vec<v1::KindClock>,
    /// Invalid attempts at one decision before the default action is taken, 0 for no limit.
    /// Default: 10.
    #[arg(long, value_name = "N")]
    max_invalid_attempts: Option<u32>,
    /// Consecutive timeouts before a seat is substituted. Default: 3.
    #[arg(long, value_name = "N")]
    max_timeouts: Option<u32>,
    /// Milliseconds that built-in agents wait before a decision. Default: 1000 if a person plays,
    /// else 0.
    #[arg(long, value_name = "MS")]
    pace_ms: Option<u32>,
    /// Reward scheme for the seats.
    #[arg(long, value_name = "SCHEME", value_parser = PossibleValuesParser::new(REWARDS))]
    reward: Option<String>,
    /// Number of decisions by which spectators are delayed. Default: 0.
    #[arg(long, value_name = "N")]
    spectator_delay: Option<u32>,
    /// What the game survives. Default: durable.
    #[arg(long, value_parser = choice(&DURABILITIES))]
    durability: Option<v1::Durability>,
    /// Who sees it, with the records of its games. Default: public.
    #[arg(long, value_name = "WHO", value_parser = choice(&VISIBILITIES))]
    visibility: Option<v1::Visibility>,
}

/// What a line about something that is not public ends with.
pub(super) fn visibility_mark(visibility: v1::Visibility) -> &'static str {
    match visibility {
        v1::Visibility::Unspecified | v1::Visibility::Public => "",
        v1::Visibility::Unlisted => "  (unlisted)",
        v1::Visibility::Private => "  (private)",
    }
}

impl PolicyArgs {
    /// The policy for the server; flags that are not given are left to its defaults.
    pub(super) fn message(&self) -> v1::RoomPolicy {
        let scheme = self.reward.as_deref().and_then(RewardScheme::from_name);
        v1::RoomPolicy {
            decision_time_ms: self.decision_time_ms,
            bank_ms: self.bank_ms,
            absence_time_ms: self.absence_time_ms,
            max_invalid_attempts: self.max_invalid_attempts,
            max_timeouts: self.max_timeouts,
            pace_ms: self.pace_ms,
            reward_scheme: reward_scheme_to_proto(scheme).into(),
            spectator_delay_decisions: self.spectator_delay,
            durability: self.durability.unwrap_or_default().into(),
            clocks: self.clocks.clone(),
            visibility: self.visibility.unwrap_or_default().into(),
            ..v1::RoomPolicy::default()
        }
    }
}

fn clock(words: &str) -> Result<v1::KindClock, String> {
    let mut parts = words.split(':');
    let kind = parts
        .next()
        .and_then(|kind| KindArg::from_str(kind, false).ok());
    let times: Option<Vec<u32>> = parts.map(|part| part.parse().ok()).collect();
    match (kind, times.as_deref()) {
        (Some(kind), Some([decision_time_ms, rest @ ..])) if rest.len() <= 2 => Ok(v1::KindClock {
            kind: v1::ParticipantKind::from(kind).into(),
            decision_time_ms: Some(*decision_time_ms),
            bank_ms: rest.first().copied(),
            absence_time_ms: rest.get(1).copied(),
        }),
        _ => Err(
            "use agent, human, robot or model, a colon, and milliseconds per decision".to_owned(),
        ),
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
    fn durability_is_a_choice() {
        for (flags, expected) in [
            ("", v1::Durability::Unspecified),
            ("--durability durable", v1::Durability::Durable),
            ("--durability ephemeral", v1::Durability::Ephemeral),
        ] {
            assert_eq!(policy(flags).durability(), expected);
        }
    }

    #[test]
    fn visibility_is_a_choice() {
        for (flags, expected) in [
            ("", v1::Visibility::Unspecified),
            ("--visibility public", v1::Visibility::Public),
            ("--visibility unlisted", v1::Visibility::Unlisted),
            ("--visibility private", v1::Visibility::Private),
        ] {
            assert_eq!(policy(flags).visibility(), expected);
        }
    }

    #[test]
    fn kinds_have_their_own_clocks() {
        let clock_of =
            |kind: v1::ParticipantKind, decision_time_ms, bank_ms, absence_time_ms| v1::KindClock {
                kind: kind.into(),
                decision_time_ms: Some(decision_time_ms),
                bank_ms,
                absence_time_ms,
            };
        let flags = "--clock human:60000 --clock robot:30000:0 --clock agent:9:8:7";
        assert_eq!(
            policy(flags).clocks,
            [
                clock_of(v1::ParticipantKind::Human, 60_000, None, None),
                clock_of(v1::ParticipantKind::Robot, 30_000, Some(0), None),
                clock_of(v1::ParticipantKind::Agent, 9, Some(8), Some(7)),
            ]
        );
        assert_eq!(policy("--absence-time-ms 5000").absence_time_ms, Some(5000));
        for nonsense in [
            "",
            "human",
            "human:",
            "ghost:5",
            "human:5:",
            "human:5:x",
            "human:5:6:7:8",
        ] {
            assert!(clock(nonsense).is_err(), "{nonsense}");
        }
    }
}
