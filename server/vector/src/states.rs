//! States of games as messages.

use chefshat_proto::v1;
use chefshat_record::convert::FieldProblem;
use chefshat_simulation::vector::{SavedGame, StateError, VectorGames};

use crate::batch::MAX_BATCH_BYTES;
use crate::error::RequestError;

/// Bytes of a message beside those of each state, at most.
const STATE_OVERHEAD: usize = 8;

/// The states that a message asks for.
///
/// # Errors
/// A game does not exist, or the states are too large for a message.
pub fn saved_to_proto(
    message: &v1::VectorSave,
    games: &VectorGames,
) -> Result<v1::VectorStates, RequestError> {
    let chosen = numbers("games", &message.games);
    let chosen = chosen.map_err(|problem| RequestError::field("STATES_REFUSED", &problem))?;
    let mut size = 0;
    let mut states = Vec::with_capacity(chosen.len());
    for game in chosen {
        let saved = games.save(&[game]).map_err(StateError::Games)?;
        let bytes: Vec<u8> = saved.iter().flat_map(SavedGame::to_bytes).collect();
        size += bytes.len() + STATE_OVERHEAD;
        if size > MAX_BATCH_BYTES {
            return Err(RequestError {
                reason: "STATES_TOO_LARGE",
                message: format!(
                    "the states of these games have more than {MAX_BATCH_BYTES} bytes: save fewer at a time"
                ),
                metadata: vec![("limit", MAX_BATCH_BYTES.to_string())],
            });
        }
        states.push(bytes);
    }
    Ok(v1::VectorStates { states })
}

/// Reads states.
///
/// # Errors
/// The first that is not a state of a game.
pub(crate) fn states_from_proto<B: AsRef<[u8]>>(
    states: &[B],
) -> Result<Vec<SavedGame>, FieldProblem> {
    let states = states.iter().enumerate().map(|(entry, bytes)| {
        SavedGame::from_bytes(bytes.as_ref())
            .map_err(|error| FieldProblem::new("states", format!("state {entry}: {error}")))
    });
    states.collect()
}

/// Reads a column of u32.
pub(crate) fn numbers(field: &'static str, column: &[u8]) -> Result<Vec<u32>, FieldProblem> {
    let (numbers, rest) = column.as_chunks::<4>();
    if !rest.is_empty() {
        let words = "the column is incomplete: 4 bytes for each game";
        return Err(FieldProblem::new(field, words));
    }
    Ok(numbers
        .iter()
        .map(|bytes| u32::from_le_bytes(*bytes))
        .collect())
}

#[cfg(test)]
mod tests {
    use chefshat_engine::RuleSetSpec;
    use chefshat_simulation::vector::{Seeds, VectorSetup};

    use crate::setup::start_from_proto;
    use crate::states::*;

    #[test]
    fn too_many_states_are_refused_before_any_is_read() {
        let states = vec![b"not a state".to_vec(); 3];
        let saved = v1::SavedStart {
            states: states.clone(),
            same_deals: true,
        };
        let setup = v1::VectorSetup {
            games: 2,
            start: Some(v1::vector_setup::Start::Saved(saved)),
            ..v1::VectorSetup::default()
        };
        let error = start_from_proto(&setup).unwrap_err();
        assert_eq!(error.reason, "STATES_REFUSED");
        let words = "saved: 3 saved games for 2 parallel games: give at most as many";
        assert_eq!(error.message, words);

        let rules = RuleSetSpec::default().validate().unwrap();
        let setup = VectorSetup::new(rules, 2, &[None; 4], Seeds::Base(1)).unwrap();
        let (mut games, _) = VectorGames::new(setup);
        let restore = v1::VectorRestore {
            games: [0u32, 1].map(u32::to_le_bytes).concat(),
            states,
        };
        let error = crate::Request::Restore(restore).execute(&mut games);
        let words = "games: 3 states for 2 games: give one for each";
        assert_eq!(error.unwrap_err().message, words);
    }
}
