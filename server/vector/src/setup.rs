//! The setup of games as a message, and its answer.

use std::num::{NonZeroU32, NonZeroU64};
use std::sync::Arc;

use chefshat_agents::{AgentKind, NamedAgent, Network};
use chefshat_engine::{ActionId, RuleSet, RuleSetSpec, Seat, Seed, Stop};
use chefshat_proto::v1::{self, vector_setup};
use chefshat_record::convert::{
    FieldProblem, MAX_RECORDED_ATTEMPTS, action_space, reward_scheme_from_proto, rules_from_proto,
    rules_to_proto, script_from_proto, seat_from_number, seat_number,
};
use chefshat_simulation::vector::{
    Decisions, Episode, InvalidActions, Opponent, Seeds, SetupError, Start, StartPoint, VectorSetup,
};

use crate::error::RequestError;
use crate::states::states_from_proto;

/// What a setup may ask for.
#[derive(Debug, Clone, Copy)]
pub struct Limits {
    /// Most seeds in a list.
    pub seeds: usize,
    /// Most parallel games with records.
    pub recorded_games: u32,
    /// Most points or Shifts of a game with a record.
    pub recorded_shifts: u32,
}

impl Limits {
    /// Those of a server and of games in process: a setup that one accepts, the other does.
    pub const DEFAULT: Limits = Limits {
        seeds: 16_384,
        recorded_games: 256,
        recorded_shifts: 1_000,
    };
}

/// The seeds of a setup; `drawn` supplies a base seed if it has none.
///
/// # Errors
/// The list is empty or too long, or a seed is not 32 bytes long.
pub fn seeds_from_setup(
    message: &v1::VectorSetup,
    limits: &Limits,
    drawn: impl FnOnce() -> u64,
) -> Result<Seeds, RequestError> {
    match &message.seeds {
        None => Ok(Seeds::Base(drawn())),
        Some(vector_setup::Seeds::BaseSeed(base)) => Ok(Seeds::Base(*base)),
        Some(vector_setup::Seeds::GameSeeds(seeds)) => seeds_from_proto(seeds, limits)
            .map_err(|problem| RequestError::field("SEED_REFUSED", &problem)),
    }
}

/// The rules and the start of games that do not continue a recorded game; `None` if they do.
///
/// # Errors
/// The rule set, the hands or the saved games are invalid.
pub fn start_from_proto(
    message: &v1::VectorSetup,
) -> Result<Option<(RuleSet, Start)>, RequestError> {
    let rules = || {
        rules_from_proto(&message.rules.clone().unwrap_or_default())
            .map_err(|problem| RequestError::field("RULE_SET_REFUSED", &problem))
    };
    match &message.start {
        None => Ok(Some((rules()?, Start::Deal))),
        Some(vector_setup::Start::Scripted(script)) => {
            let rules = rules()?;
            let script = script_from_proto(script, &rules)
                .map_err(|problem| RequestError::field("SCRIPT_REFUSED", &problem))?;
            Ok(Some((rules, Start::Script(Box::new(script)))))
        }
        Some(vector_setup::Start::Listed(listed)) => {
            let rules = rules()?;
            let points = listed.starts.iter().enumerate().map(|(entry, start)| {
                point_from_proto(start, &rules).map_err(|problem| {
                    let words = format!("start {entry}: {problem}");
                    RequestError::field("SCRIPT_REFUSED", &FieldProblem::new("listed", words))
                })
            });
            let points = points.collect::<Result<Vec<_>, _>>()?;
            Ok(Some((rules, Start::Listed(points.into()))))
        }
        Some(vector_setup::Start::Saved(saved)) => {
            let refused = |problem| RequestError::field("STATES_REFUSED", &problem);
            check_count(saved, message.games).map_err(refused)?;
            let states = states_from_proto(&saved.states).map_err(refused)?;
            let start = Start::Saved {
                games: states.into(),
                same_deals: saved.same_deals,
            };
            Ok(Some((rules()?, start)))
        }
        Some(vector_setup::Start::Branch(_)) => Ok(None),
    }
}

/// Refuses more saved games than are played, before any is read: memory is reserved for those.
fn check_count(saved: &v1::SavedStart, games: u32) -> Result<(), FieldProblem> {
    let states = saved.states.len();
    if u32::try_from(states).is_ok_and(|states| states <= games) {
        return Ok(());
    }
    let words = format!("{states} saved games for {games} parallel games: give at most as many");
    Err(FieldProblem::new("saved", words))
}

fn point_from_proto(
    message: &v1::ListedStart,
    rules: &RuleSet,
) -> Result<StartPoint, FieldProblem> {
    let script = message.hands.clone().unwrap_or_default();
    let (actions, rest) = message.actions.as_chunks::<2>();
    if !rest.is_empty() {
        let words = "the column is incomplete: 2 bytes for each action";
        return Err(FieldProblem::new("actions", words));
    }
    let actions = actions.iter();
    Ok(StartPoint {
        script: script_from_proto(&script, rules)?,
        actions: actions
            .map(|bytes| ActionId::new(u16::from_le_bytes(*bytes)))
            .collect(),
    })
}

/// The games of a setup message, whose rules, start and seeds are already checked.
///
/// # Errors
/// The first invalid field.
pub fn setup_from_proto(
    message: &v1::VectorSetup,
    rules: RuleSet,
    start: Start,
    seeds: Seeds,
    limits: &Limits,
) -> Result<VectorSetup, RequestError> {
    read(message, rules, start, seeds, limits)
        .map_err(|problem| RequestError::field("SETUP_REFUSED", &problem))
}

fn read(
    message: &v1::VectorSetup,
    rules: RuleSet,
    start: Start,
    seeds: Seeds,
    limits: &Limits,
) -> Result<VectorSetup, FieldProblem> {
    let agents = agents(message, &rules)?;
    let invalid = invalid_actions(message)?;
    let dealt = matches!(start, Start::Deal);
    let built_in: Vec<Option<AgentKind>> = (agents.iter())
        .map(|agent| {
            agent.map(|agent| match agent {
                Named::BuiltIn(kind) => kind,
                Named::Network(_) => AgentKind::default(),
            })
        })
        .collect();
    let setup = VectorSetup::new(rules, message.games, &built_in, seeds).map_err(problem)?;
    let setup = with_networks(setup, &message.networks, &agents)?
        .with_rewards(
            v1::RewardScheme::try_from(message.reward_scheme)
                .map(reward_scheme_from_proto)
                .map_err(|_| FieldProblem::unknown("reward_scheme", message.reward_scheme))?,
        )
        .with_episode(match v1::EpisodeScope::try_from(message.episode) {
            Ok(v1::EpisodeScope::Unspecified | v1::EpisodeScope::Shift) => Episode::Shift,
            Ok(v1::EpisodeScope::Game) => Episode::Game,
            Err(_) => return Err(FieldProblem::unknown("episode", message.episode)),
        })
        .with_decisions(decisions(message)?)
        .with_skip_forced(message.skip_forced)
        .with_invalid_actions(invalid)
        .with_total_games(NonZeroU64::new(message.total_games))
        .map_err(problem)?
        .with_statistics(message.shift_statistics)
        .with_records(message.records)
        .with_history(u16::try_from(message.history).unwrap_or(u16::MAX))
        .map_err(problem)?
        .with_start(start)
        .map_err(problem)?;
    if message.records {
        check_records(&setup, dealt, limits)?;
    }
    Ok(setup)
}

/// The answer to a setup.
pub fn started_to_proto(setup: &VectorSetup) -> v1::VectorStarted {
    let rules = setup.rules();
    v1::VectorStarted {
        rules: Some(rules_to_proto(rules)),
        action_space: Some(action_space(&rules.actions())),
        hand_size: rules.hand_size().into(),
        client_seats: setup.client_seats().map(seat_number).collect(),
        built_in_agents: (setup.agents().values())
            .map(|agent| agent.map_or("", Opponent::name).to_owned())
            .collect(),
        base_seed: match setup.seeds() {
            Seeds::Base(base) => Some(*base),
            Seeds::List(_) => None,
        },
        history: setup.history().into(),
    }
}

/// The agent of a seat that the client does not play, as a request names it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Named {
    BuiltIn(AgentKind),
    /// The network file with this number.
    Network(usize),
}

/// The agent of each seat; `None`: the client.
fn agents(message: &v1::VectorSetup, rules: &RuleSet) -> Result<Vec<Option<Named>>, FieldProblem> {
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
            "{name:?} is not one of the {networks} network files: the first of `networks` is network:0"
        );
        FieldProblem::new("opponents", words)
    })
}

/// Has network files play their seats.
fn with_networks(
    mut setup: VectorSetup,
    files: &[v1::NetworkFile],
    agents: &[Option<Named>],
) -> Result<VectorSetup, FieldProblem> {
    for (number, file) in files.iter().enumerate() {
        let refused = |error: &dyn std::fmt::Display| {
            let name = match &*file.name {
                "" => format!("file {number}"),
                name => name.to_owned(),
            };
            FieldProblem::new("networks", format!("{name}: {error}"))
        };
        let network = Network::from_bytes(&file.content).map_err(|error| refused(&error))?;
        let network = Arc::new(network);
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
pub fn agent_from_proto(
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
            format!("{name:?} is not a built-in agent; use one of {known}"),
        )
    })
}

fn decisions(message: &v1::VectorSetup) -> Result<Decisions, FieldProblem> {
    let others = agent_from_proto("other_decisions", &message.other_decisions)?;
    match v1::DecisionScope::try_from(message.decisions) {
        Ok(v1::DecisionScope::Turns) => Ok(Decisions::Turns { others }),
        Ok(v1::DecisionScope::Unspecified | v1::DecisionScope::All) if others.is_some() => {
            let words =
                "the client takes all decisions; leave it empty, or set `decisions` to turns";
            Err(FieldProblem::new("other_decisions", words))
        }
        Ok(v1::DecisionScope::Unspecified | v1::DecisionScope::All) => Ok(Decisions::All),
        Err(_) => Err(FieldProblem::unknown("decisions", message.decisions)),
    }
}

fn invalid_actions(message: &v1::VectorSetup) -> Result<InvalidActions, FieldProblem> {
    let limit = NonZeroU32::new(message.max_invalid_attempts);
    match v1::InvalidActionRule::try_from(message.invalid_actions) {
        Ok(v1::InvalidActionRule::AskAgain) => Ok(InvalidActions::AskAgain { limit }),
        Ok(_) if limit.is_some() => {
            let words = "an invalid action is an error here; leave it 0, or set ASK_AGAIN";
            Err(FieldProblem::new("max_invalid_attempts", words))
        }
        Ok(_) => Ok(InvalidActions::Error),
        Err(_) => Err(FieldProblem::unknown(
            "invalid_actions",
            message.invalid_actions,
        )),
    }
}

/// Checks that the games can be recorded and that records stay of bounded size.
fn check_records(setup: &VectorSetup, dealt: bool, limits: &Limits) -> Result<(), FieldProblem> {
    let refused = |words: String| Err(FieldProblem::new("records", words));
    if !dealt {
        return refused("only dealt games can be recorded; leave `start` unset".to_owned());
    }
    if setup.games() > limits.recorded_games {
        return refused(format!(
            "at most {} parallel games can be recorded",
            limits.recorded_games
        ));
    }
    let max_turns = RuleSetSpec::default().max_turns;
    if setup.rules().max_turns() > max_turns {
        return refused(format!("with records, max_turns is at most {max_turns}"));
    }
    let (Stop::Points(length) | Stop::Shifts(length)) = setup.rules().stop();
    if length > limits.recorded_shifts {
        return refused(format!(
            "a recorded game ends after at most {} points or Shifts, not {length}",
            limits.recorded_shifts
        ));
    }
    match setup.invalid_actions() {
        InvalidActions::AskAgain { limit }
            if limit.is_none_or(|limit| limit.get() > MAX_RECORDED_ATTEMPTS) =>
        {
            refused(format!(
                "with records, set max_invalid_attempts to 1..={MAX_RECORDED_ATTEMPTS}"
            ))
        }
        InvalidActions::AskAgain { .. } | InvalidActions::Error => Ok(()),
    }
}

fn problem(error: SetupError) -> FieldProblem {
    let field = match &error {
        SetupError::Seats { .. } | SetupError::NoClient => "client_seats",
        SetupError::ClientsSeat(_) | SetupError::UnfitNetwork { .. } => "networks",
        SetupError::Games { .. } => "games",
        SetupError::Total { .. } => "total_games",
        SetupError::NoSeeds => "game_seeds",
        SetupError::Script(_) => "scripted",
        SetupError::History(_) => "history",
        SetupError::NoStarts
        | SetupError::ListedScript { .. }
        | SetupError::ListedAction { .. }
        | SetupError::ListedEnd { .. } => "listed",
        SetupError::NoSaved | SetupError::Saved { .. } | SetupError::Copied(_) => "saved",
        SetupError::SavedRecords => "records",
    };
    FieldProblem::new(field, error.to_string())
}

/// Reads a list of seeds.
///
/// # Errors
/// The list is empty or too long, or a seed is not 32 bytes long.
pub(crate) fn seeds_from_proto(
    message: &v1::GameSeeds,
    limits: &Limits,
) -> Result<Seeds, FieldProblem> {
    if !(1..=limits.seeds).contains(&message.seeds.len()) {
        let given = message.seeds.len();
        let words = format!("{given} seeds; give 1 to {}", limits.seeds);
        return Err(FieldProblem::new("game_seeds", words));
    }
    let seeds = message.seeds.iter().map(|bytes| {
        bytes.as_slice().try_into().map(Seed).map_err(|_| {
            let words = format!("a seed of {} bytes; give 32", bytes.len());
            FieldProblem::new("game_seeds", words)
        })
    });
    Ok(Seeds::List(seeds.collect::<Result<_, _>>()?))
}

#[cfg(test)]
mod tests {
    use crate::setup::*;

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
            let setup = setup_from_proto(&message, rules, start, Seeds::Base(0), &Limits::DEFAULT);
            match setup {
                Ok(setup) => {
                    assert_eq!(started_to_proto(&setup).built_in_agents.join(","), expected)
                }
                Err(error) => assert!(error.message.contains(expected), "{}", error.message),
            }
        };
        let good = "table-actions";
        check(&["network:0"], &[good], ",network,network,network");
        let mixed = ["greedy", "network:1", "network:0"];
        check(&mixed, &[good, good], ",greedy,network,network");
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
    }

    #[test]
    fn lists_of_seeds_are_limited() {
        let setup = |seeds| v1::VectorSetup {
            seeds: Some(vector_setup::Seeds::GameSeeds(v1::GameSeeds {
                seeds: vec![vec![7; 32]; seeds],
            })),
            ..v1::VectorSetup::default()
        };
        let read = |seeds| seeds_from_setup(&setup(seeds), &Limits::DEFAULT, || 0);
        assert!(read(16_384).is_ok());
        let error = read(16_385).unwrap_err();
        assert_eq!(error.reason, "SEED_REFUSED");
        assert_eq!(error.message, "game_seeds: 16385 seeds; give 1 to 16384");
    }
}
