//! Batches as messages. Their columns already have the protocol's layout: they are moved, not
//! copied.

use chefshat_proto::v1;
use chefshat_simulation::vector::{Batch, ObservationColumns};

/// Size of the largest batch, bytes: the most games of the largest rule set, each with two Shifts
/// ended at once.
pub const MAX_BATCH_BYTES: usize = 16 * 1024 * 1024;

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
        all_hands: batch.all_hands.into(),
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
        history: columns.history.into(),
        history_counts: columns.history_counts.into(),
        board_owners: columns.board_owners.into(),
    }
}

#[cfg(test)]
mod tests {
    use chefshat_agents::{AgentKind, game_seed};
    use chefshat_engine::{ActionId, DecisionKind, Role, RuleSetSpec, Stop};
    use chefshat_record::convert::decision_kind;
    use chefshat_simulation::vector::{Seeds, VectorGames, VectorSetup};
    use prost::Message as _;

    use crate::batch::*;
    use crate::setup::Limits;

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
        let (seats, entries) = (
            Limits::OF_SERVER.seats_played,
            Limits::OF_SERVER.history_entries,
        );
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
            seats as u32,
            &agents,
            Seeds::List(vec![game_seed(1, 1)].into()),
        )
        .unwrap()
        .with_statistics(true)
        .with_all_hands(true)
        .with_history((entries / seats) as u16)
        .unwrap();
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
            assert!(message.encoded_len() <= MAX_BATCH_BYTES);
            assert!(u64::from(shifts) <= 3 * seats);
            batch.rows = rows;
            batch.masks = message.action_masks.to_vec();
        }
        assert!(most > MAX_BATCH_BYTES / 4, "{most}");
    }
}
