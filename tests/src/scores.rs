//! What a tournament must have counted, from nothing but the records of its games.

use std::collections::BTreeMap;

use chefshat_proto::v1::{self, game_event::Kind, record_line::Line};

/// Points for the places of a game.
const SCORES: [u64; 4] = [5, 3, 1, 0];

/// The score of every participant of these games, each with its record.
///
/// # Panics
/// A record is not valid, or does not contain exactly one end.
pub fn scores(games: &[(v1::TournamentGame, Vec<v1::RecordLine>)]) -> BTreeMap<u32, u64> {
    let mut scores = BTreeMap::new();
    for (game, lines) in games {
        chefshat_record::replay::replay(lines).expect("a valid record");
        let mut placed: Vec<(bool, u32, u32)> = (places(lines).into_iter())
            .map(|(seat, place)| {
                let line = &game.seats[seat as usize];
                (line.forfeited, place, line.participant)
            })
            .collect();
        // Participants who were present are placed before absent ones, in the order of the game.
        placed.sort_unstable();
        for ((forfeited, _, participant), score) in placed.into_iter().zip(SCORES) {
            *scores.entry(participant).or_default() += if forfeited { 0 } else { score };
        }
    }
    scores
}

/// Places by seat of a finished game.
fn places(lines: &[v1::RecordLine]) -> BTreeMap<u32, u32> {
    let events = lines.iter().filter_map(|line| match &line.line {
        Some(Line::Event(event)) => event.kind.as_ref(),
        _ => None,
    });
    let mut ends = events.filter_map(|kind| match kind {
        Kind::GameEnded(ended) => Some(&ended.standings),
        _ => None,
    });
    let standings = ends.next().expect("the game ended");
    assert!(ends.next().is_none(), "only once");
    let placed = standings
        .iter()
        .map(|standing| (standing.seat, standing.place));
    placed.collect()
}
