//! The setup of games as a message, and its answer.

use std::num::{NonZeroU32, NonZeroU64};

use chefshat_agents::AgentKind;
use chefshat_engine::{ActionId, RuleSet, RuleSetSpec, Seed, Stop};
use chefshat_proto::v1::{self, vector_setup};
use chefshat_record::convert::{
    FieldProblem, MAX_RECORDED_ATTEMPTS, action_space, reward_scheme_from_proto, rules_from_proto,
    rules_to_proto, script_from_proto, seat_number,
};
use chefshat_simulation::vector::{
    Decisions, Episode, InvalidActions, Opponent, Seeds, SetupError, Start, StartPoint, VectorSetup,
};

use crate::error::RequestError;
use crate::opponents::{Named, agent_from_proto, agents, with_networks};
use crate::states::states_from_proto;

/// What a setup may ask for.
#[derive(Debug, Clone, Copy)]
pub struct Limits {
    /// Most games times the client's seats in each.
    pub seats_played: u64,
    /// Most entries of the history columns of one decision of each of these seats.
    pub history_entries: u64,
    /// Most bytes of the games and their batches ([`VectorSetup::memory`]).
    pub memory: u64,
    /// Most seeds in a list.
    pub seeds: usize,
    /// Most parallel games with records.
    pub recorded_games: u32,
    /// Most points or Shifts of a game with a record.
    pub recorded_shifts: u32,
    /// Most multiplications for a decision of a network file.
    pub network_multiplications: u64,
}

impl Limits {
    /// Those of games in process, beside this number of bytes of memory.
    pub const fn in_process(memory: u64) -> Limits {
        Limits {
            seats_played: u64::MAX,
            history_entries: u64::MAX,
            memory,
            seeds: usize::MAX,
            recorded_games: u32::MAX,
            recorded_shifts: u32::MAX,
            network_multiplications: u64::MAX,
        }
    }

    /// Those of a server, whose clients share its memory and its processors.
    pub const OF_SERVER: Limits = Limits {
        seats_played: 16_384,
        history_entries: 1 << 19,
        memory: u64::MAX,
        seeds: 16_384,
        recorded_games: 256,
        recorded_shifts: chefshat_record::MAX_RECORDED_SHIFTS,
        network_multiplications: 1 << 20,
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
        .map(|agent| agent.map(Named::built_in))
        .collect();
    let setup = VectorSetup::new(rules, message.games, &built_in, seeds).map_err(problem)?;
    let setup = with_networks(
        setup,
        &message.networks,
        &agents,
        limits.network_multiplications,
    )?
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
    .with_all_hands(message.all_hands);
    // Before anything is laid out for each game.
    check_size(&setup, limits)?;
    let setup = setup.with_start(start).map_err(problem)?;
    if message.records {
        check_records(&setup, dealt, limits)?;
    }
    Ok(setup)
}

/// Checks how much the games take.
fn check_size(setup: &VectorSetup, limits: &Limits) -> Result<(), FieldProblem> {
    let (games, seats) = (setup.games(), setup.seats_played());
    if seats > limits.seats_played {
        let words = format!(
            "{games} games with {} of the client's seats: play at most {} games times seats",
            setup.client_seats().count(),
            limits.seats_played
        );
        return Err(FieldProblem::new("games", words));
    }
    let history = setup.history();
    if seats * u64::from(history) > limits.history_entries {
        let words = format!(
            "a history of {history} actions: choose at most {} actions over the client's seats of all games",
            limits.history_entries
        );
        return Err(FieldProblem::new("history", words));
    }
    if setup.memory() > limits.memory {
        let words = format!(
            "{games} games with their batches take about {} MiB, and {} MiB of memory are free: play fewer at a time, or with a shorter history",
            setup.memory() >> 20,
            limits.memory >> 20
        );
        return Err(FieldProblem::new("games", words));
    }
    Ok(())
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
            .map(|agent| agent.map(Opponent::name).unwrap_or_default().into_owned())
            .collect(),
        base_seed: match setup.seeds() {
            Seeds::Base(base) => Some(*base),
            Seeds::List(_) => None,
        },
        history: setup.history().into(),
        all_hands: setup.all_hands(),
    }
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
        SetupError::NoGames => "games",
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
    fn games_take_a_limited_part_of_a_server_and_the_memory_of_a_process() {
        let check = |games, client_seats: &[u32], history, limits: &Limits| {
            let message = v1::VectorSetup {
                games,
                client_seats: client_seats.to_vec(),
                history,
                ..v1::VectorSetup::default()
            };
            let (rules, start) = start_from_proto(&message).unwrap().unwrap();
            setup_from_proto(&message, rules, start, Seeds::Base(1), limits)
                .map(|setup| setup.memory() >> 20)
                .map_err(|error| error.message)
        };
        let server = Limits::OF_SERVER;
        assert!(check(4_096, &[], 32, &server).is_ok());
        assert!(check(16_384, &[2], 32, &server).is_ok());
        let words = "games: 4097 games with 4 of the client's seats: play at most 16384";
        assert!(
            check(4_097, &[], 0, &server)
                .unwrap_err()
                .starts_with(words)
        );
        let words = "history: a history of 33 actions: choose at most 524288 actions";
        assert!(
            check(4_096, &[], 33, &server)
                .unwrap_err()
                .starts_with(words)
        );
        // More than a server takes, and as much as there is room for.
        let free = Limits::in_process(1 << 30);
        let taken = check(50_000, &[0], 64, &free).unwrap();
        assert!((50..1_000).contains(&taken), "{taken} MiB");
        let words = "and 1024 MiB of memory are free: play fewer at a time";
        assert!(check(u32::MAX, &[], 0, &free).unwrap_err().contains(words));
    }

    #[test]
    fn lists_of_seeds_are_limited() {
        let setup = |seeds| v1::VectorSetup {
            seeds: Some(vector_setup::Seeds::GameSeeds(v1::GameSeeds {
                seeds: vec![vec![7; 32]; seeds],
            })),
            ..v1::VectorSetup::default()
        };
        let read = |seeds| seeds_from_setup(&setup(seeds), &Limits::OF_SERVER, || 0);
        assert!(read(16_384).is_ok());
        let error = read(16_385).unwrap_err();
        assert_eq!(error.reason, "SEED_REFUSED");
        assert_eq!(error.message, "game_seeds: 16385 seeds; give 1 to 16384");
    }
}
