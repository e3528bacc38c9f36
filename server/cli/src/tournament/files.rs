//! The results of a tournament as CSV: complete standings, and the columns of the reference
//! implementation.

use std::collections::BTreeMap;
use std::path::Path;

use chefshat_client::v1;
use chefshat_record::atomic_file::AtomicFile;
use chefshat_record::sheet;
use csv::{Terminator, WriterBuilder};

use super::super::CommandError;
use super::tables::Field;
use crate::kind::kind_name;

/// Header of FinalResultsComp.csv in the reference implementation (chefshatgym 2.4.0.4,
/// `ChefsHatRoomTournament`).
const FINAL_RESULTS: [&str; 4] = [
    "Position",
    "Player Name",
    "Final Game Performance Score",
    "Games Played",
];

/// Writes one line per participant, best first.
///
/// # Errors
/// The file cannot be written.
pub(super) fn write_standings(
    file: AtomicFile,
    results: &v1::GetTournamentResultsResponse,
) -> Result<(), CommandError> {
    let (header, rows) = standings(results);
    write(file, Terminator::Any(b'\n'), &header, rows)
}

/// Writes the columns of the reference implementation.
///
/// # Errors
/// The file cannot be written.
pub(super) fn write_final_results(
    path: &Path,
    results: &v1::GetTournamentResultsResponse,
    games: &[v1::TournamentGame],
) -> Result<(), CommandError> {
    let header = FINAL_RESULTS.map(str::to_owned);
    // Line ends of Python's csv module.
    write(
        AtomicFile::create(path)?,
        Terminator::CRLF,
        &header,
        final_results(results, games),
    )
}

/// Writes a header and rows; `terminator` ends each line.
///
/// # Errors
/// The file cannot be written; an existing file is unchanged.
fn write(
    mut file: AtomicFile,
    terminator: Terminator,
    header: &[String],
    rows: impl IntoIterator<Item = Vec<String>>,
) -> Result<(), CommandError> {
    let mut writer = WriterBuilder::new()
        .terminator(terminator)
        .from_writer(&mut file);
    writer.write_record(header)?;
    for row in rows {
        writer.write_record(row.iter().map(|text| sheet::cell(text).into_owned()))?;
    }
    writer.flush()?;
    drop(writer);
    Ok(file.finish()?)
}

fn standings(results: &v1::GetTournamentResultsResponse) -> (Vec<String>, Vec<Vec<String>>) {
    let tournament = results.tournament.clone().unwrap_or_default();
    let field = Field::new(&tournament);
    let seats = results
        .standings
        .iter()
        .map(|standing| standing.places.len());
    let seats = seats.max().unwrap_or(0);
    let before = [
        "place",
        "participant",
        "name",
        "kind",
        "built_in_agent",
        "filler",
        "last_round",
        "games",
        "byes",
        "score",
        "points",
    ];
    let after = [
        "forfeited",
        "substituted",
        "wrong_actions",
        "timeouts",
        "mean_decision_time_us",
        "performance_score",
        "rating_mean",
        "rating_deviation",
        "rated_games",
        "difference_to_next",
        "standard_error",
        "confidence",
        "more_games",
    ];
    let header = (before.into_iter().map(str::to_owned))
        .chain((1..=seats).map(|place| format!("place_{place}")))
        .chain(after.into_iter().map(str::to_owned));
    let rows = results.standings.iter().map(|standing| {
        let who = field.get(standing.participant).cloned().unwrap_or_default();
        let pair = (results.confidence.iter()).find(|pair| pair.upper == standing.participant);
        let rating = standing.rating.as_ref();
        let mut row = vec![
            standing.place.to_string(),
            standing.participant.to_string(),
            who.name.clone(),
            kind_name(who.kind()).to_owned(),
            who.built_in_agent,
            who.filler.to_string(),
            standing.last_round.to_string(),
            standing.games.to_string(),
            standing.byes.to_string(),
            standing.score.to_string(),
            standing.points.to_string(),
        ];
        row.extend((0..seats).map(|place| {
            let games = standing.places.get(place).copied().unwrap_or(0);
            games.to_string()
        }));
        row.extend([
            standing.forfeited.to_string(),
            standing.substituted.to_string(),
            standing.wrong_actions.to_string(),
            standing.timeouts.to_string(),
            standing.mean_decision_time_us.to_string(),
            standing.performance_score.to_string(),
            said(rating.map(|rating| rating.mean)),
            said(rating.map(|rating| rating.deviation)),
            rating.map_or(0, |rating| rating.games).to_string(),
            said(pair.map(|pair| pair.difference)),
            said(pair.map(|pair| pair.standard_error)),
            said(pair.map(|pair| pair.confidence)),
            said(pair.and_then(|pair| pair.more_games)),
        ]);
        row
    });
    (header.collect(), rows.collect())
}

/// A number, or an empty cell.
fn said(number: Option<impl ToString>) -> String {
    number.map_or_else(String::new, |number| number.to_string())
}

/// Position, name, performance score of the last game, and number of games.
fn final_results(
    results: &v1::GetTournamentResultsResponse,
    games: &[v1::TournamentGame],
) -> Vec<Vec<String>> {
    let tournament = results.tournament.clone().unwrap_or_default();
    let field = Field::new(&tournament);
    let mut last: BTreeMap<u32, (f64, u32)> = BTreeMap::new();
    let counted = games
        .iter()
        .filter(|game| game.state() == v1::TournamentGameState::Counted);
    for seat in counted.flat_map(|game| &game.seats) {
        if !seat.forfeited {
            let (score, played) = last.entry(seat.participant).or_default();
            *score = seat.performance_score;
            *played += 1;
        }
    }
    let row = |standing: &v1::TournamentStanding| {
        let who = field.get(standing.participant);
        let name = who.map_or_else(String::new, |who| who.name.clone());
        let (score, played) = last.get(&standing.participant).copied().unwrap_or_default();
        // Debug formats whole numbers like Python: 10.0.
        let score = format!("{score:?}");
        vec![standing.place.to_string(), name, score, played.to_string()]
    };
    results.standings.iter().map(row).collect()
}

#[cfg(test)]
mod tests {
    use crate::tournament::files::*;

    fn results() -> v1::GetTournamentResultsResponse {
        let participant = |participant, name: &str| v1::TournamentParticipant {
            participant,
            name: name.into(),
            kind: v1::ParticipantKind::Agent.into(),
            ..v1::TournamentParticipant::default()
        };
        let standing = |place, participant| v1::TournamentStanding {
            place,
            participant,
            games: 2,
            score: 5,
            places: vec![1, 0, 1],
            ..v1::TournamentStanding::default()
        };
        v1::GetTournamentResultsResponse {
            tournament: Some(v1::Tournament {
                participants: vec![participant(0, "Ada"), participant(1, "Bo, \"B\"")],
                ..v1::Tournament::default()
            }),
            standings: vec![standing(1, 1), standing(2, 0)],
            confidence: vec![v1::OrderConfidence {
                upper: 1,
                lower: 0,
                difference: 0.5,
                standard_error: 0.25,
                confidence: 0.9,
                more_games: Some(3),
            }],
        }
    }

    #[test]
    fn standings_have_a_line_each() {
        let (header, rows) = standings(&results());
        assert_eq!(rows.len(), 2);
        for row in &rows {
            assert_eq!(row.len(), header.len());
        }
        let cell = |row: usize, name: &str| {
            let column = header.iter().position(|column| column == name);
            rows[row][column.expect("a column")].as_str()
        };
        assert_eq!((cell(0, "name"), cell(1, "name")), ("Bo, \"B\"", "Ada"));
        assert_eq!((cell(0, "place_1"), cell(0, "place_2")), ("1", "0"));
        assert_eq!((cell(0, "confidence"), cell(1, "confidence")), ("0.9", ""));
        assert_eq!((cell(0, "more_games"), cell(0, "rating_mean")), ("3", ""));
    }

    #[test]
    fn final_results_are_in_the_form_of_the_reference_implementation() {
        let game =
            |state: v1::TournamentGameState, scores: [f64; 2], forfeited| v1::TournamentGame {
                state: state.into(),
                seats: (0..)
                    .zip(scores)
                    .map(|(participant, performance_score)| v1::TournamentGameSeat {
                        participant,
                        performance_score,
                        forfeited: forfeited && participant == 0,
                        ..v1::TournamentGameSeat::default()
                    })
                    .collect(),
                ..v1::TournamentGame::default()
            };
        let games = [
            game(v1::TournamentGameState::Counted, [1.5, 4.25], false),
            game(v1::TournamentGameState::Counted, [9.0, 3.0], true),
            game(v1::TournamentGameState::Void, [9.0, 9.0], false),
        ];
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("FinalResultsComp.csv");
        write_final_results(&file, &results(), &games).expect("written");
        assert_eq!(
            std::fs::read_to_string(&file).expect("read"),
            "Position,Player Name,Final Game Performance Score,Games Played\r\n\
             1,\"Bo, \"\"B\"\"\",3.0,2\r\n2,Ada,1.5,1\r\n"
        );
    }
}
