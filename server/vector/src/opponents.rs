//! The agents of the seats that the client does not play: built-in ones by name, and network files.

use std::sync::Arc;

use chefshat_agents::{AgentKind, NamedAgent, Network, shortened};
use chefshat_engine::{RuleSet, Seat};
use chefshat_proto::v1;
use chefshat_record::convert::{FieldProblem, seat_from_number};
use chefshat_simulation::vector::VectorSetup;

/// The agent of a seat that the client does not play, as a request names it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Named {
    BuiltIn(AgentKind),
    /// The network file with this number.
    Network(usize),
}

impl Named {
    /// The built-in agent, or one until a network takes its place.
    pub(crate) fn built_in(self) -> AgentKind {
        match self {
            Named::BuiltIn(kind) => kind,
            Named::Network(_) => AgentKind::default(),
        }
    }
}

/// The agent of each seat; `None`: the client.
pub(crate) fn agents(
    message: &v1::VectorSetup,
    rules: &RuleSet,
) -> Result<Vec<Option<Named>>, FieldProblem> {
    let players = rules.players();
    let mut owned = vec![message.client_seats.is_empty(); players];
    let mut before = None;
    for &number in &message.client_seats {
        let seat = seat_from_number(number, players).filter(|_| before < Some(number));
        let Some(seat) = seat else {
            let words = format!(
                "{:?}: list seats of 0..={}, ascending, each once",
                message.client_seats,
                players - 1
            );
            return Err(FieldProblem::new("client_seats", words));
        };
        owned[seat.index()] = true;
        before = Some(number);
    }
    let others = owned.iter().filter(|owned| !**owned).count();
    let names: Vec<Named> = (message.opponents.iter())
        .map(|name| opponent(name, message.networks.len()))
        .collect::<Result<_, _>>()?;
    if !(names.len() <= 1 || names.len() == others) {
        let words = format!(
            "{} agents for {others} other seats: give one for each of them, or one for all",
            names.len()
        );
        return Err(FieldProblem::new("opponents", words));
    }
    if message.networks.len() > others {
        let words = format!(
            "{} files for {others} other seats: give at most one for each of them",
            message.networks.len()
        );
        return Err(FieldProblem::new("networks", words));
    }
    let default = Named::BuiltIn(AgentKind::default());
    let for_all = names.first().copied().unwrap_or(default);
    let mut one_by_one = (names.len() > 1).then(|| names.into_iter());
    Ok(owned
        .into_iter()
        .map(|owned| {
            (!owned).then(|| match &mut one_by_one {
                None => for_all,
                Some(names) => names.next().unwrap_or(default),
            })
        })
        .collect())
}

/// The agent of this name, where a request has this number of network files.
fn opponent(name: &str, networks: usize) -> Result<Named, FieldProblem> {
    let Some(number) = name.strip_prefix("network:") else {
        let kind = agent_from_proto("opponents", name)?;
        return Ok(Named::BuiltIn(kind.unwrap_or_default()));
    };
    let number = number.parse().ok().filter(|number| *number < networks);
    number.map(Named::Network).ok_or_else(|| {
        let words = format!(
            "{:?} is not one of the {networks} network files: the first of `networks` is network:0",
            shortened(name)
        );
        FieldProblem::new("opponents", words)
    })
}

/// Has network files play their seats. A decision takes at most `most` multiplications.
pub(crate) fn with_networks(
    mut setup: VectorSetup,
    files: &[v1::NetworkFile],
    agents: &[Option<Named>],
    most: u64,
) -> Result<VectorSetup, FieldProblem> {
    for (number, file) in files.iter().enumerate() {
        let refused = |error: &dyn std::fmt::Display| {
            let name = match &*file.name {
                "" => format!("file {number}"),
                name => shortened(name),
            };
            FieldProblem::new("networks", format!("{name}: {error}"))
        };
        let network = Network::from_bytes(&file.content).map_err(|error| refused(&error))?;
        let network = Arc::new(network);
        let cost = network.multiplications();
        if cost > most {
            let words = format!(
                "a decision takes {cost} multiplications, where the units of each hidden layer count up to the next multiple of 32; a server takes at most {most}: use a smaller network, or play in process"
            );
            return Err(refused(&words));
        }
        if !agents.contains(&Some(Named::Network(number))) {
            let words = format!("no seat has it: name it in `opponents` as network:{number}");
            return Err(refused(&words));
        }
        for (seat, agent) in agents.iter().enumerate() {
            if *agent == Some(Named::Network(number)) {
                setup = setup
                    .with_network(Seat::new(seat), Arc::clone(&network))
                    .map_err(|error| refused(&error))?;
            }
        }
    }
    Ok(setup)
}

/// The built-in agent with this name; `None` for the empty name.
///
/// # Errors
/// There is no such agent.
pub(crate) fn agent_from_proto(
    field: &'static str,
    name: &str,
) -> Result<Option<AgentKind>, FieldProblem> {
    if name.is_empty() {
        return Ok(None);
    }
    if let Ok(NamedAgent::MonteCarlo(_)) = name.parse() {
        let words = "monte_carlo searches at every decision, which is too slow for batches of games; play it in rooms, by `chefshat simulate` or by `chefshat compare`";
        return Err(FieldProblem::new(field, words));
    }
    AgentKind::from_name(name).map(Some).ok_or_else(|| {
        let known = AgentKind::ALL.map(AgentKind::name).join(", ");
        FieldProblem::new(
            field,
            format!(
                "{:?} is not a built-in agent; use one of {known}",
                shortened(name)
            ),
        )
    })
}

#[cfg(test)]
mod tests {
    use chefshat_agents::Network;
    use chefshat_proto::v1;
    use chefshat_simulation::vector::Seeds;

    use crate::setup::{Limits, setup_from_proto, start_from_proto, started_to_proto};

    #[test]
    fn networks_that_cannot_play_are_refused_by_name() {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/fixtures/network/");
        let file = |name: &str| v1::NetworkFile {
            name: name.to_owned(),
            content: std::fs::read(format!("{folder}{name}.safetensors")).unwrap_or_default(),
        };
        let check = |opponents: &[&str], files: &[&str], expected: &str| {
            let message = v1::VectorSetup {
                games: 1,
                client_seats: vec![0],
                opponents: opponents.iter().map(ToString::to_string).collect(),
                networks: files.iter().map(|name| file(name)).collect(),
                ..v1::VectorSetup::default()
            };
            let (rules, start) = start_from_proto(&message).unwrap().unwrap();
            let setup =
                setup_from_proto(&message, rules, start, Seeds::Base(0), &Limits::OF_SERVER);
            match setup {
                Ok(setup) => {
                    assert_eq!(started_to_proto(&setup).built_in_agents.join(","), expected)
                }
                Err(error) => assert!(error.message.contains(expected), "{}", error.message),
            }
        };
        let good = "table-actions";
        let name = "network:abba48c4b1cdae5c";
        check(&["network:0"], &[good], &format!(",{name},{name},{name}"));
        let mixed = ["greedy", "network:1", "network:0"];
        check(&mixed, &[good, good], &format!(",greedy,{name},{name}"));
        check(
            &["network:1"],
            &[good],
            "opponents: \"network:1\" is not one of the 1 network files",
        );
        check(&["network:x"], &[], "is not one of the 0 network files");
        check(
            &["greedy"],
            &[good],
            "networks: table-actions: no seat has it",
        );
        check(
            &["network:0"],
            &["missing"],
            "networks: missing: not a safetensors file",
        );
        check(
            &["network:0"],
            &["small-table"],
            "networks: small-table: it is for 3 players",
        );
        check(
            &["network:0"],
            &[good; 4],
            "networks: 4 files for 3 other seats",
        );
        let long = "x".repeat(1 << 20);
        check(
            &["network:0"],
            &[&long],
            &format!("networks: {}: not a safetensors file", &long[..100]),
        );
        for name in [
            long.clone(),
            format!("network:{long}"),
            format!("monte_carlo{long}"),
        ] {
            check(&[&name], &[], &format!("{:?} is not ", &name[..100]));
        }
    }

    #[test]
    fn networks_that_decide_slowly_play_only_in_process() {
        let file = concat!(
            env!("CARGO_MANIFEST_DIR"),
            "/../../tests/fixtures/network/table-actions.safetensors"
        );
        let message = v1::VectorSetup {
            games: 1,
            client_seats: vec![0],
            opponents: vec!["network:0".to_owned()],
            networks: vec![v1::NetworkFile {
                name: "mine".to_owned(),
                content: std::fs::read(file).unwrap(),
            }],
            ..v1::VectorSetup::default()
        };
        let cost = Network::from_bytes(&message.networks[0].content)
            .unwrap()
            .multiplications();
        let with = |most| {
            let limits = Limits {
                network_multiplications: most,
                ..Limits::OF_SERVER
            };
            let (rules, start) = start_from_proto(&message).unwrap().unwrap();
            setup_from_proto(&message, rules, start, Seeds::Base(0), &limits)
        };
        assert!(with(cost).is_ok());
        let error = with(cost - 1).unwrap_err();
        assert_eq!(error.reason, "SETUP_REFUSED");
        let expected = format!("networks: mine: a decision takes {cost} multiplications");
        assert!(error.message.starts_with(&expected), "{}", error.message);
        // `trained` and what is several times as large are accepted.
        let trained = Network::trained().multiplications();
        assert!(4 * trained < Limits::OF_SERVER.network_multiplications);
    }
}
