//! Records of finished games, in parts of bounded size.

use chefshat_agents::AgentKind;
use chefshat_engine::{BySeat, RewardScheme};
use chefshat_proto::v1;
use chefshat_record::convert::{Played, plain_policy, reward_scheme_to_proto};
use chefshat_simulation::vector::{InvalidActions, Opponent, PlayedGame, VectorSetup};
use prost::Message as _;

/// Size from which a part of a record is sent, bytes.
const RECORD_PART_BYTES: usize = 512 * 1024;

/// The policy in the record of a game without a room: that of a room, without clocks and pauses.
/// Only its limits and rewards have a meaning.
pub fn simulation_policy(
    max_invalid_attempts: Option<u32>,
    reward_scheme: Option<RewardScheme>,
) -> v1::RoomPolicy {
    v1::RoomPolicy {
        decision_time_ms: Some(10_000),
        bank_ms: Some(60_000),
        max_invalid_attempts: Some(max_invalid_attempts.unwrap_or(0)),
        max_timeouts: Some(3),
        substitute: AgentKind::Random.name().into(),
        abort: v1::AbortPolicy::AllLost.into(),
        reward_scheme: reward_scheme_to_proto(reward_scheme).into(),
        waiting_time_ms: Some(3_600_000),
        ..plain_policy()
    }
}

/// The lines of the record of a game.
pub fn record_lines(setup: &VectorSetup, played: &PlayedGame) -> Vec<v1::RecordLine> {
    let limit = match setup.invalid_actions() {
        InvalidActions::AskAgain { limit } => limit.map(|limit| limit.get()),
        InvalidActions::Error => None,
    };
    let names: Vec<_> = (setup.agents().values())
        .map(|agent| agent.map(Opponent::name))
        .collect();
    let record = Played {
        by: "vector",
        rules: setup.rules(),
        agents: &BySeat::from_fn(names.len(), |seat| names[seat.index()].as_deref()),
        seed: played.seed,
        scheme: setup.scheme(),
        policy: &simulation_policy(limit, setup.scheme()),
        decisions: &played.decisions,
    };
    record.record()
}

/// Splits the record of a game into parts.
pub fn record_parts(setup: &VectorSetup, played: &PlayedGame) -> Vec<v1::VectorRecord> {
    let mut parts = vec![v1::VectorRecord::default()];
    let mut size = 0;
    for line in record_lines(setup, played) {
        if size > RECORD_PART_BYTES {
            parts.push(v1::VectorRecord::default());
            size = 0;
        }
        size += line.encoded_len();
        let part = parts.last_mut().expect("there is a first part");
        part.lines.push(line);
    }
    for part in &mut parts {
        part.game = played.game;
        part.index = played.index;
    }
    let last = parts.last_mut().expect("there is a first part");
    last.last = true;
    parts
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use chefshat_agents::Network;
    use chefshat_engine::{RuleSetSpec, Seat, Stop};
    use chefshat_proto::v1::record_line::Line;
    use chefshat_record::outcome::Identity;
    use chefshat_record::replay::replay;
    use chefshat_simulation::vector::{Seeds, VectorGames};

    use crate::record::*;

    #[test]
    fn records_say_which_network_played() {
        let rules = RuleSetSpec {
            stop: Stop::Shifts(2),
            ..RuleSetSpec::default()
        };
        let greedy = Some(AgentKind::Greedy);
        let agents = [None, greedy, greedy, greedy];
        let mut setup =
            VectorSetup::new(rules.validate().unwrap(), 1, &agents, Seeds::Base(1)).unwrap();
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/fixtures/network/");
        let file = std::fs::read(format!("{folder}table-actions.safetensors")).unwrap();
        let other = Arc::new(Network::from_bytes(&file).unwrap());
        for (seat, network) in [(1, &other), (2, Network::trained())] {
            let network = Arc::clone(network);
            setup = setup.with_network(Seat::new(seat), network).unwrap();
        }
        let (mut games, mut batch) = VectorGames::new(setup.with_records(true));
        while batch.played.is_empty() {
            let mut actions = Vec::new();
            games.sample(1, 0, |action| actions.push(action));
            batch = games.step(&actions).unwrap();
        }
        let lines = record_lines(games.setup(), &batch.played[0]);
        assert!(replay(&lines).is_ok());
        let Some(Line::Header(header)) = &lines[0].line else {
            panic!("a record begins with its header");
        };
        let players: Vec<_> = header.seats.iter().map(Identity::of).collect();
        // The beginning of the SHA-256 of the file.
        assert_eq!(players[1].name, "network:abba48c4b1cdae5c");
        assert!(players[2].name.starts_with("network:") && players[2] != players[1]);
        assert_eq!(header.seats[1].name, players[1].name);
        assert_eq!(players[3].name, "greedy");
    }
}
