//! The setup of vector streams, and their batches, as messages. The columns of a batch already have
//! the protocol's layout; they are moved, not copied.

use std::num::{NonZeroU32, NonZeroU64};

use chefshat_agents::AgentKind;
use chefshat_engine::{RuleSet, RuleSetSpec, Seed, Stop};
use chefshat_proto::v1::{self, vector_reset, vector_setup};
use chefshat_record::convert::{
    FieldProblem, action_space, reward_scheme_from_proto, rules_to_proto, seat_from_number,
    seat_number,
};
use chefshat_simulation::vector::{
    Batch, Decisions, Episode, InvalidActions, ObservationColumns, Seeds, SetupError, Start,
    VectorSetup,
};

use super::kind::unknown;
use super::policy::agent;
use crate::config::{MAX_HOSTED_SHIFTS, MAX_VECTOR_RECORDED_GAMES, MAX_VECTOR_SEEDS};
use chefshat_record::convert::MAX_RECORDED_ATTEMPTS;

/// The games of a setup message, whose rules, start and seeds are already checked.
///
/// # Errors
/// The first invalid field.
pub fn setup_from_proto(
    message: &v1::VectorSetup,
    rules: RuleSet,
    start: Start,
    seeds: Seeds,
) -> Result<VectorSetup, FieldProblem> {
    let agents = agents(message, &rules)?;
    let invalid = invalid_actions(message)?;
    let dealt = matches!(start, Start::Deal);
    let setup = VectorSetup::new(rules, message.games, &agents, seeds)
        .map_err(problem)?
        .with_rewards(
            v1::RewardScheme::try_from(message.reward_scheme)
                .map(reward_scheme_from_proto)
                .map_err(|_| unknown("reward_scheme", message.reward_scheme))?,
        )
        .with_episode(match v1::EpisodeScope::try_from(message.episode) {
            Ok(v1::EpisodeScope::Unspecified | v1::EpisodeScope::Shift) => Episode::Shift,
            Ok(v1::EpisodeScope::Game) => Episode::Game,
            Err(_) => return Err(unknown("episode", message.episode)),
        })
        .with_decisions(decisions(message)?)
        .with_skip_forced(message.skip_forced)
        .with_invalid_actions(invalid)
        .with_total_games(NonZeroU64::new(message.total_games))
        .map_err(problem)?
        .with_start(start)
        .map_err(problem)?
        .with_statistics(message.shift_statistics)
        .with_records(message.records);
    if message.records {
        check_records(&setup, dealt)?;
    }
    Ok(setup)
}

/// Reads a list of seeds.
///
/// # Errors
/// The list is empty or too long, or a seed is not 32 bytes long.
fn seeds_from_proto(message: &v1::GameSeeds) -> Result<Seeds, FieldProblem> {
    if !(1..=MAX_VECTOR_SEEDS).contains(&message.seeds.len()) {
        let given = message.seeds.len();
        let words = format!("{given} seeds; give 1 to {MAX_VECTOR_SEEDS}");
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

/// The games to reset.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Reset {
    /// Some games, which continue with their next seeds.
    Some(Vec<u32>),
    /// All games: with the first of these seeds, or with their next ones.
    All(Option<Seeds>),
}

/// Reads a reset request.
///
/// # Errors
/// The column of games has a partial entry, or a field for all games comes with a list of games.
pub fn reset_from_proto(message: &v1::VectorReset) -> Result<Reset, FieldProblem> {
    let (games, rest) = message.games.as_chunks::<4>();
    if !rest.is_empty() {
        let words = "the column is incomplete: 4 bytes for each game";
        return Err(FieldProblem::new("games", words));
    }
    let seeds = match &message.seeds {
        None => None,
        Some(_) if !message.all => {
            let words = "seeds can only be given for a reset of all games; set `all`";
            return Err(FieldProblem::new("seeds", words));
        }
        Some(vector_reset::Seeds::BaseSeed(base)) => Some(Seeds::Base(*base)),
        Some(vector_reset::Seeds::GameSeeds(seeds)) => Some(seeds_from_proto(seeds)?),
    };
    if message.all && !games.is_empty() {
        let words = "list games or set `all`, not both";
        return Err(FieldProblem::new("games", words));
    }
    if message.all {
        return Ok(Reset::All(seeds));
    }
    let games = games.iter().map(|bytes| u32::from_le_bytes(*bytes));
    Ok(Reset::Some(games.collect()))
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
            .map(|agent| agent.map_or("", AgentKind::name).to_owned())
            .collect(),
        base_seed: match setup.seeds() {
            Seeds::Base(base) => Some(*base),
            Seeds::List(_) => None,
        },
    }
}

/// Converts a batch, except for the records of its games.
pub fn batch_to_proto(batch: Batch, statistics: bool) -> v1::VectorBatch {
    let (endings, beginnings, shifts) = (batch.endings, batch.beginnings, batch.shifts);
    v1::VectorBatch {
        step: batch.step,
        rows: batch.rows,
        done: batch.done,
        games: batch.games.into(),
        seats: batch.seats.into(),
        kinds: batch.kinds.into(),
        attempts: batch.attempts.into(),
        rewards: batch.rewards.into(),
        observations: Some(observations(batch.observations)),
        action_masks: batch.masks.into(),
        endings: (endings.rows > 0).then(|| v1::EpisodeEndings {
            rows: endings.rows,
            games: endings.games.into(),
            indices: endings.indices.into(),
            seats: endings.seats.into(),
            rewards: endings.rewards.into(),
            ends: endings.ends.into(),
            game_over: endings.game_over.into(),
            places_taken: endings.places_taken.into(),
            observations: Some(observations(endings.observations)),
        }),
        beginnings: (beginnings.rows > 0).then(|| v1::GameBeginnings {
            rows: beginnings.rows,
            games: beginnings.games.into(),
            indices: beginnings.indices.into(),
            seeds: beginnings.seeds.into(),
        }),
        shifts: statistics.then(|| v1::ShiftStatistics {
            rows: shifts.rows,
            games: shifts.games.into(),
            indices: shifts.indices.into(),
            shifts: shifts.shifts.into(),
            starters: shifts.starters.into(),
            pizzas: shifts.pizzas.into(),
            laps: shifts.laps.into(),
            turns: shifts.turns.into(),
            special_actions: shifts.special_actions.into(),
            adjudicated: shifts.adjudicated.into(),
            game_winners: shifts.game_winners.into(),
            places: shifts.places.into(),
            points: shifts.points.into(),
            valid: shifts.valid.into(),
            wrong: shifts.wrong.into(),
            passes: shifts.passes.into(),
            reward_sums: shifts.reward_sums.into(),
            performance: shifts.performance.into(),
        }),
        totals: Some(v1::VectorTotals {
            client_decisions: batch.totals.client_decisions,
            decisions: batch.totals.decisions,
            invalid_attempts: batch.totals.invalid_attempts,
            shifts: batch.totals.shifts,
            games: batch.totals.games,
        }),
    }
}

fn observations(columns: ObservationColumns) -> v1::ObservationColumns {
    v1::ObservationColumns {
        shifts: columns.shifts.into(),
        pizzas: columns.pizzas.into(),
        hands: columns.hands.into(),
        golden: columns.golden.into(),
        boards: columns.boards.into(),
        cards_left: columns.cards_left.into(),
        passed: columns.passed.into(),
        places: columns.places.into(),
        roles: columns.roles.into(),
        points: columns.points.into(),
        played: columns.played.into(),
        gave: columns.gave.into(),
        received: columns.received.into(),
    }
}

/// The agent of each seat; `None`: the client.
fn agents(
    message: &v1::VectorSetup,
    rules: &RuleSet,
) -> Result<Vec<Option<AgentKind>>, FieldProblem> {
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
    let names: Vec<Option<AgentKind>> = (message.opponents.iter())
        .map(|name| agent("opponents", name))
        .collect::<Result<_, _>>()?;
    if !(names.len() <= 1 || names.len() == others) {
        let words = format!(
            "{} agents for {others} other seats: give one for each of them, or one for all",
            names.len()
        );
        return Err(FieldProblem::new("opponents", words));
    }
    let for_all = names.first().copied().flatten().unwrap_or_default();
    let mut one_by_one = (names.len() > 1).then(|| names.into_iter());
    Ok(owned
        .into_iter()
        .map(|owned| {
            (!owned).then(|| match &mut one_by_one {
                None => for_all,
                Some(names) => names.next().flatten().unwrap_or_default(),
            })
        })
        .collect())
}

fn decisions(message: &v1::VectorSetup) -> Result<Decisions, FieldProblem> {
    let others = agent("other_decisions", &message.other_decisions)?;
    match v1::DecisionScope::try_from(message.decisions) {
        Ok(v1::DecisionScope::Turns) => Ok(Decisions::Turns { others }),
        Ok(v1::DecisionScope::Unspecified | v1::DecisionScope::All) if others.is_some() => {
            let words =
                "the client takes all decisions; leave it empty, or set `decisions` to turns";
            Err(FieldProblem::new("other_decisions", words))
        }
        Ok(v1::DecisionScope::Unspecified | v1::DecisionScope::All) => Ok(Decisions::All),
        Err(_) => Err(unknown("decisions", message.decisions)),
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
        Err(_) => Err(unknown("invalid_actions", message.invalid_actions)),
    }
}

/// Checks that the games can be recorded and that records stay of bounded size.
fn check_records(setup: &VectorSetup, dealt: bool) -> Result<(), FieldProblem> {
    let refused = |words: String| Err(FieldProblem::new("records", words));
    if !dealt {
        return refused("only dealt games can be recorded; leave `start` unset".to_owned());
    }
    if setup.games() > MAX_VECTOR_RECORDED_GAMES {
        return refused(format!(
            "at most {MAX_VECTOR_RECORDED_GAMES} parallel games can be recorded"
        ));
    }
    let max_turns = RuleSetSpec::default().max_turns;
    if setup.rules().max_turns() > max_turns {
        return refused(format!("with records, max_turns is at most {max_turns}"));
    }
    let (Stop::Points(length) | Stop::Shifts(length)) = setup.rules().stop();
    if length > MAX_HOSTED_SHIFTS {
        return refused(format!(
            "a recorded game ends after at most {MAX_HOSTED_SHIFTS} points or Shifts, not {length}"
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
        SetupError::Games { .. } => "games",
        SetupError::Total { .. } => "total_games",
        SetupError::NoSeeds => "game_seeds",
        SetupError::Script(_) => "scripted",
    };
    FieldProblem::new(field, error.to_string())
}

/// The seeds of a setup; `drawn` supplies a base seed if it has none.
///
/// # Errors
/// The list is empty or too long, or a seed is not 32 bytes long.
pub fn setup_seeds(
    message: &v1::VectorSetup,
    drawn: impl FnOnce() -> u64,
) -> Result<Seeds, FieldProblem> {
    match &message.seeds {
        None => Ok(Seeds::Base(drawn())),
        Some(vector_setup::Seeds::BaseSeed(base)) => Ok(Seeds::Base(*base)),
        Some(vector_setup::Seeds::GameSeeds(seeds)) => seeds_from_proto(seeds),
    }
}

#[cfg(test)]
mod tests {
    use chefshat_agents::game_seed;
    use chefshat_engine::{ActionId, DecisionKind, Role};
    use chefshat_simulation::vector::{MAX_SEATS_PLAYED, VectorGames};
    use prost::Message as _;

    use crate::config::MAX_VECTOR_BATCH_BYTES;
    use crate::convert::vector::*;
    use chefshat_record::convert::decision_kind;

    fn actions(batch: &Batch) -> Vec<ActionId> {
        let width = batch.masks.len() / batch.rows as usize;
        let first = |mask: &[u8]| {
            let mask = chefshat_engine::Mask::from_bytes(mask).unwrap();
            mask.nth(0).unwrap()
        };
        batch.masks.chunks(width).map(first).collect()
    }

    #[test]
    fn columns_use_the_numbers_of_the_protocol() {
        let rules = RuleSetSpec::default().validate().unwrap();
        let setup = VectorSetup::new(rules, 64, &[None; 4], Seeds::Base(3))
            .unwrap()
            .with_statistics(true);
        let (mut games, mut batch) = VectorGames::new(setup);
        let (mut kinds, mut roles, mut ends, mut specials) = ([0; 4], [0; 6], [0; 3], [0; 3]);
        while batch.totals.shifts < 2000 {
            batch
                .kinds
                .iter()
                .for_each(|kind| kinds[usize::from(*kind)] += 1);
            let seen = &batch.observations;
            seen.roles
                .iter()
                .for_each(|role| roles[usize::from(*role)] += 1);
            let ended = &batch.endings;
            ended
                .ends
                .iter()
                .for_each(|end| ends[usize::from(*end)] += 1);
            let special = batch.shifts.special_actions.iter();
            special.for_each(|special| specials[usize::from(*special)] += 1);
            // Declare whenever possible; exchanges are recognised by their actions.
            let masks = batch
                .masks
                .chunks(27)
                .map(|mask| chefshat_engine::Mask::from_bytes(mask).unwrap());
            for (kind, mask) in batch.kinds.iter().zip(masks) {
                let expected = match mask.nth(0).unwrap().index() {
                    0..=199 => DecisionKind::Turn,
                    200..=211 => DecisionKind::Exchange,
                    _ => DecisionKind::SpecialAction,
                };
                assert_eq!(i32::from(*kind), i32::from(decision_kind(expected)));
            }
            let mut actions = actions(&batch);
            for (action, kind) in actions.iter_mut().zip(&batch.kinds) {
                if i32::from(*kind) == i32::from(v1::DecisionKind::SpecialAction) {
                    *action = ActionId::new(213);
                }
            }
            batch = games.step(&actions).unwrap();
        }
        let chef = v1::Role::Chef as usize;
        assert_eq!(chef, Role::Chef as usize);
        assert_eq!(v1::Role::Dishwasher as usize, Role::Dishwasher as usize);
        assert_eq!(v1::Role::SousChef as usize, Role::SousChef as usize);
        assert_eq!(v1::Role::Cook as usize, Role::Cook as usize);
        assert_eq!(v1::Role::Waiter as usize, Role::Waiter as usize);
        assert!(kinds[1..].iter().all(|count| *count > 0), "{kinds:?}");
        assert!(
            roles[chef] > 0 && roles[v1::Role::Cook as usize] == 0,
            "{roles:?}"
        );
        assert_eq!(ends[v1::EpisodeEnd::CutShort as usize], 0);
        assert!(ends[v1::EpisodeEnd::Finished as usize] > 0);
        // One role in four can declare a Food Fight.
        let fights = specials[v1::SpecialAction::FoodFight as usize];
        let dinners = specials[v1::SpecialAction::DinnerIsServed as usize];
        assert!(fights > 0 && dinners > fights, "{specials:?}");
    }

    #[test]
    fn the_largest_batch_fits_its_limit() {
        // All columns at their widest, and two Shifts of one turn each ended in every game.
        let spec = RuleSetSpec {
            players: 6,
            faces: 15,
            max_turns: 1,
            stop: Stop::Shifts(u32::MAX),
            ..RuleSetSpec::default()
        };
        let random = Some(AgentKind::Random);
        let agents = [None, random, random, random, random, random];
        let setup = VectorSetup::new(
            spec.validate().unwrap(),
            MAX_SEATS_PLAYED,
            &agents,
            Seeds::List(vec![game_seed(1, 1)].into()),
        )
        .unwrap()
        .with_statistics(true);
        let (mut games, mut batch) = VectorGames::new(setup);
        let mut most = 0;
        for _ in 0..3 {
            batch = if batch.rows == 0 {
                games.step(&[]).unwrap()
            } else {
                games.step(&actions(&batch)).unwrap()
            };
            let shifts = batch.shifts.rows;
            let rows = batch.rows;
            let message = batch_to_proto(std::mem::take(&mut batch), true);
            most = most.max(message.encoded_len());
            assert!(message.encoded_len() <= MAX_VECTOR_BATCH_BYTES);
            assert!(shifts <= 3 * MAX_SEATS_PLAYED);
            batch.rows = rows;
            batch.masks = message.action_masks.to_vec();
        }
        assert!(most > MAX_VECTOR_BATCH_BYTES / 4, "{most}");
    }
}
