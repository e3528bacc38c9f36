//! A leaderboard as a table, as JSON and as CSV, for boards from a server and boards recomputed
//! from records.

use chefshat_engine::MAX_SEATS;
use chefshat_proto::v1;
use chefshat_record::sheet;
use serde_json::{Value, json};

use super::CommandError;
use super::output::{line, table};
use crate::kind::kind_name;
use crate::narration::clean;

/// Maximum columns of a name.
const NAME_COLUMNS: usize = 24;
/// Digits shown of a fingerprint.
const SHOWN_DIGITS: usize = 4;
/// Half the width of a 95 % interval of the normal distribution, in deviations.
const Z95: f64 = 1.96;
/// Names of the places.
const PLACES: [&str; MAX_SEATS] = ["1st", "2nd", "3rd", "4th", "5th", "6th"];

/// The mean of a rating and the half width of its 95 % interval.
pub fn rating_in_words(rating: &v1::Rating) -> [String; 2] {
    let half = Z95 * rating.deviation;
    [format!("{:.2}", rating.mean), format!("± {half:.2}")]
}

/// Adds the table of a leaderboard.
pub fn add_table(text: &mut String, board: &v1::GetLeaderboardResponse) {
    if board.rated.is_empty() {
        line(text, "no participants");
        return;
    }
    let deepest = board.rated.iter().map(|line| line.places.len()).max();
    let places = &PLACES[..deepest.unwrap_or(0).min(MAX_SEATS)];
    let header = ["", "Name", "Kind", "Rating", "95 %", "Games"];
    let header: Vec<&str> = header.iter().chain(places).copied().collect();
    let rows = board.rated.iter().map(|line| {
        let rating = line.rating.unwrap_or_default();
        let [mean, uncertainty] = rating_in_words(&rating);
        let mut row = vec![
            line.place.to_string(),
            marked_name(line),
            rated_kind(line).to_owned(),
            mean,
            uncertainty,
            rating.games.to_string(),
        ];
        row.extend(times(line, places.len()));
        row
    });
    table(text, &header, &[1, 2], rows);
}

/// The participants as a JSON array.
pub fn as_json(board: &v1::GetLeaderboardResponse) -> Vec<Value> {
    let lines = board.rated.iter().map(|line| {
        let rating = line.rating.unwrap_or_default();
        json!({
            "place": line.place,
            "name": line.name,
            "name_fingerprint": line.name_fingerprint,
            "kind": rated_kind(line),
            "mean": rating.mean,
            "deviation": rating.deviation,
            "games": rating.games,
            "places": line.places,
        })
    });
    lines.collect()
}

/// The participants as CSV with a header.
pub fn as_csv(board: &v1::GetLeaderboardResponse) -> Result<Vec<u8>, CommandError> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    let mut header: Vec<String> = ["place", "name", "kind", "mean", "deviation", "games"]
        .map(str::to_owned)
        .into();
    header.extend((1..=MAX_SEATS).map(|place| format!("place_{place}")));
    header.push("name_fingerprint".to_owned());
    writer.write_record(&header)?;
    for line in &board.rated {
        let rating = line.rating.unwrap_or_default();
        let mut row = vec![
            line.place.to_string(),
            sheet::cell(&line.name).into_owned(),
            rated_kind(line).to_owned(),
            rating.mean.to_string(),
            rating.deviation.to_string(),
            rating.games.to_string(),
        ];
        row.extend(times(line, MAX_SEATS));
        row.push(line.name_fingerprint.clone());
        writer.write_record(&row)?;
    }
    Ok(writer.into_inner()?)
}

/// The name, with the beginning of its fingerprint if it has a key.
fn marked_name(line: &v1::Rated) -> String {
    let name = clean(&line.name, NAME_COLUMNS);
    match line.name_fingerprint.get(..SHOWN_DIGITS) {
        Some(digits) => format!("{name} #{}", clean(digits, SHOWN_DIGITS)),
        None => name,
    }
}

/// How often the participant took each of the first places.
fn times(line: &v1::Rated, places: usize) -> impl Iterator<Item = String> {
    (0..places).map(|index| line.places.get(index).copied().unwrap_or(0).to_string())
}

fn rated_kind(line: &v1::Rated) -> &'static str {
    match line.built_in {
        true => "built-in",
        false => kind_name(line.kind()),
    }
}

#[cfg(test)]
mod tests {
    use crate::board::*;

    #[test]
    fn a_leaderboard_has_the_same_lines_in_every_form() {
        let rated = |place, name: &str, built_in| v1::Rated {
            name: name.into(),
            kind: v1::ParticipantKind::Human.into(),
            built_in,
            rating: Some(v1::Rating {
                mean: 25.5,
                deviation: 2.0,
                games: 7,
            }),
            place,
            places: vec![4, 3],
            name_fingerprint: String::new(),
        };
        let mut board = v1::GetLeaderboardResponse {
            rated: vec![
                rated(1, "greedy", true),
                v1::Rated {
                    name_fingerprint: "0123456789abcdef".into(),
                    ..rated(2, "A\u{1b}da", false)
                },
            ],
            games: 7,
        };
        let mut text = String::new();
        add_table(&mut text, &board);
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines.len(), 4, "{text}");
        let words: Vec<&str> = lines[3].split_whitespace().collect();
        assert_eq!(
            words,
            [
                "2", "Ada", "#0123", "human", "25.50", "±", "3.92", "7", "4", "3"
            ]
        );
        let csv = String::from_utf8(as_csv(&board).expect("written")).expect("text");
        let csv: Vec<&str> = csv.lines().collect();
        assert_eq!(csv[1], "1,greedy,built-in,25.5,2,7,4,3,0,0,0,0,");
        assert_eq!(as_json(&board)[1]["kind"], "human");
        board.rated.clear();
        text.clear();
        add_table(&mut text, &board);
        assert_eq!(text, "  no participants\n");
    }
}
