//! Tables of a tournament for people: standings, confidence, statistics of play. Each is at most
//! 100 columns wide.

use chefshat_client::v1;

use super::super::board::rating_in_words;
use super::super::numbers::{counted, ordinal, signed};
use super::super::output::{heading, percent, table};
use crate::kind::kind_name;
use crate::narration::clean;

/// What is said of the standings before a game has counted.
pub(crate) const NO_GAME_COUNTED: &str = "no game was counted";

/// Maximum columns of a name.
const MAX_NAME: usize = 20;
/// Confidence above which an order is significant.
const SURE: f64 = 0.95;

/// The participants, and the columns that depend on the format.
pub(crate) struct Field<'t> {
    participants: &'t [v1::TournamentParticipant],
    knockout: bool,
}

impl<'t> Field<'t> {
    pub(crate) fn new(tournament: &'t v1::Tournament) -> Self {
        let settings = tournament.settings.as_ref();
        Self {
            participants: &tournament.participants,
            knockout: settings
                .is_some_and(|settings| settings.format() == v1::TournamentFormat::Knockout),
        }
    }

    /// The participant with a number.
    pub(crate) fn get(&self, participant: u32) -> Option<&v1::TournamentParticipant> {
        usize::try_from(participant)
            .ok()
            .and_then(|index| self.participants.get(index))
    }

    /// The name of a participant, safe to print.
    pub(crate) fn name(&self, participant: u32) -> String {
        match self.get(participant) {
            Some(who) => clean(&who.name, MAX_NAME),
            None => format!("participant {participant}"),
        }
    }

    /// Kind of a participant, or its built-in agent.
    fn what(&self, participant: u32) -> String {
        match self.get(participant) {
            Some(who) if who.withdrawn => "withdrawn".to_owned(),
            Some(who) if who.filler => "filler".to_owned(),
            Some(who) if !who.built_in_agent.is_empty() => clean(&who.built_in_agent, 15),
            Some(who) => kind_name(who.kind()).to_owned(),
            None => String::new(),
        }
    }
}

/// Mean score per game; 0 without games.
pub(crate) fn mean_score(standing: &v1::TournamentStanding) -> f64 {
    a_game(standing.score, standing)
}

/// The place of a participant in words; `None` before a game has counted, when there are no places.
pub(crate) fn place_in_words(
    standing: &v1::TournamentStanding,
    participants: usize,
) -> Option<String> {
    let place = (standing.place > 0).then(|| ordinal(standing.place))?;
    Some(format!(
        "{place} of {participants}, score {:.2} a game in {}",
        mean_score(standing),
        counted(standing.games.into(), "game"),
    ))
}

fn a_game(sum: u64, standing: &v1::TournamentStanding) -> f64 {
    sum as f64 / f64::from(standing.games.max(1))
}

/// Mean place per game.
fn mean_place(standing: &v1::TournamentStanding) -> String {
    let games: u64 = standing.places.iter().copied().map(u64::from).sum();
    if games == 0 {
        return "–".to_owned();
    }
    let places = (1_u64..).zip(standing.places.iter().copied().map(u64::from));
    let sum: u64 = places.map(|(place, games)| place * games).sum();
    format!("{:.2}", sum as f64 / games as f64)
}

/// Whether a game has counted; before, there are no places.
pub(super) fn has_counted(standings: &[v1::TournamentStanding]) -> bool {
    standings.iter().any(|standing| standing.place > 0)
}

/// Adds the standings; before a game has counted, the participants.
pub(super) fn standings(
    text: &mut String,
    field: &Field<'_>,
    standings: &[v1::TournamentStanding],
) {
    if !has_counted(standings) {
        heading(text, "Participants");
        let rows = (standings.iter()).map(|standing| {
            vec![
                field.name(standing.participant),
                field.what(standing.participant),
            ]
        });
        return table(text, &["Participant", "What"], &[0, 1], rows);
    }
    heading(text, "Standings");
    let mut header = vec![
        "Place",
        "Participant",
        "What",
        "Games",
        "Score\na game",
        "Points\na game",
        "Won",
        "Mean\nplace",
        "For-\nfeited",
        "Byes",
    ];
    if field.knockout {
        header[9] = "Last\nround";
    }
    let rows = standings.iter().map(|standing| {
        vec![
            standing.place.to_string(),
            field.name(standing.participant),
            field.what(standing.participant),
            standing.games.to_string(),
            format!("{:.2}", mean_score(standing)),
            format!("{:.2}", a_game(standing.points, standing)),
            standing.places.first().copied().unwrap_or(0).to_string(),
            mean_place(standing),
            standing.forfeited.to_string(),
            match field.knockout {
                true => standing.last_round.to_string(),
                false => standing.byes.to_string(),
            },
        ]
    });
    table(text, &header, &[1, 2], rows);
}

/// Adds the confidence that of two neighbours the first is better.
pub(super) fn order(text: &mut String, field: &Field<'_>, pairs: &[v1::OrderConfidence]) {
    heading(text, "How sure is the order?");
    let header = [
        "Participant",
        "before",
        "Difference\na game",
        "Standard\nerror",
        "Confidence",
        "More games each\nuntil sure (95 %)",
    ];
    let rows = pairs.iter().map(|pair| {
        vec![
            field.name(pair.upper),
            field.name(pair.lower),
            signed(pair.difference),
            match pair.standard_error {
                0.0 => "–".to_owned(),
                error => format!("{error:.3}"),
            },
            percent(pair.confidence),
            match pair.more_games {
                Some(games) => games.to_string(),
                None if pair.confidence >= SURE => "sure".to_owned(),
                None => "–".to_owned(),
            },
        ]
    });
    table(text, &header, &[0, 1], rows);
}

/// Adds statistics of play and ratings.
pub(super) fn play(text: &mut String, field: &Field<'_>, standings: &[v1::TournamentStanding]) {
    heading(text, "How they played");
    let header = [
        "Participant",
        "Performance\nscore",
        "Wrong\nactions",
        "Timeouts",
        "Games with\nsubstitute",
        "Decision\nms",
        "Rating\n(95 %)",
        "Rated\ngames",
    ];
    let rows = standings.iter().map(|standing| {
        let (rated, games) = rating(standing.rating.as_ref());
        vec![
            field.name(standing.participant),
            format!("{:.3}", standing.performance_score),
            standing.wrong_actions.to_string(),
            standing.timeouts.to_string(),
            standing.substituted.to_string(),
            match standing.mean_decision_time_us {
                0.0 => "–".to_owned(),
                time => format!("{:.1}", time / 1000.0),
            },
            rated,
            games,
        ]
    });
    table(text, &header, &[0], rows);
}

/// A rating with its uncertainty and number of games.
fn rating(rating: Option<&v1::Rating>) -> (String, String) {
    match rating {
        Some(rating) => (rating_in_words(rating).join(" "), rating.games.to_string()),
        None => ("–".to_owned(), "0".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use crate::tournament::tables::*;

    #[test]
    fn participants_are_listed_before_a_game_has_counted() {
        let tournament = v1::Tournament {
            participants: vec![v1::TournamentParticipant {
                name: "Ada".into(),
                kind: v1::ParticipantKind::Human.into(),
                ..v1::TournamentParticipant::default()
            }],
            ..v1::Tournament::default()
        };
        let lines = [v1::TournamentStanding::default()];
        assert!(!has_counted(&lines));
        let mut text = String::new();
        standings(&mut text, &Field::new(&tournament), &lines);
        let text = anstream::adapter::strip_str(&text).to_string();
        for words in ["Participants", "Ada", "human"] {
            assert!(text.contains(words), "{words} is not in {text}");
        }
        assert!(!text.contains("Place"), "{text}");
    }

    #[test]
    fn no_places_before_a_game_has_counted() {
        let standing = |place, games| v1::TournamentStanding {
            place,
            games,
            score: 5,
            ..v1::TournamentStanding::default()
        };
        let table = [
            (standing(0, 0), None),
            (
                standing(1, 1),
                Some("1st of 8, score 5.00 a game in 1 game"),
            ),
            (
                standing(3, 2),
                Some("3rd of 8, score 2.50 a game in 2 games"),
            ),
        ];
        for (standing, words) in table {
            assert_eq!(place_in_words(&standing, 8).as_deref(), words);
        }
    }

    #[test]
    fn tables_fit_on_a_page() {
        let participants = ["Ada", "a name that is far too long for a table", "Cem"];
        let participants =
            (0..)
                .zip(participants)
                .map(|(participant, name)| v1::TournamentParticipant {
                    participant,
                    name: name.into(),
                    kind: v1::ParticipantKind::Robot.into(),
                    built_in_agent: if participant == 1 {
                        "random_unmasked"
                    } else {
                        ""
                    }
                    .into(),
                    ..v1::TournamentParticipant::default()
                });
        let tournament = v1::Tournament {
            participants: participants.collect(),
            ..v1::Tournament::default()
        };
        let field = Field::new(&tournament);
        let standing = |place, participant| v1::TournamentStanding {
            place,
            participant,
            games: 1000,
            score: 2350,
            points: 123_456,
            places: vec![400, 100, 100, 100, 100, 200],
            wrong_actions: 1_000_000,
            timeouts: 100_000,
            mean_decision_time_us: 12_345_678.9,
            performance_score: 1.234_567,
            rating: Some(v1::Rating {
                mean: 25.0,
                deviation: 2.0,
                games: 1000,
            }),
            ..v1::TournamentStanding::default()
        };
        let lines = [standing(1, 1), standing(2, 0), standing(3, 9)];
        let pair = |upper, lower, confidence, more_games| v1::OrderConfidence {
            upper,
            lower,
            difference: -0.25,
            standard_error: 0.125,
            confidence,
            more_games,
        };
        let pairs = [pair(1, 0, 0.61, Some(123)), pair(0, 9, 0.99, None)];
        let mut text = String::new();
        standings(&mut text, &field, &lines);
        order(&mut text, &field, &pairs);
        play(&mut text, &field, &lines);
        for line in anstream::adapter::strip_str(&text).to_string().lines() {
            assert!(line.chars().count() <= 100, "{line}");
        }
        for words in [
            "a name that is far …",
            "random_unmasked",
            "robot",
            "participant 9",
            "2.35",
            "3.00",
            "123.46",
            "−0.250",
            "61.0 %",
            "sure",
            "12345.7",
            "25.00 ± 3.92",
        ] {
            assert!(text.contains(words), "{words} is not in {text}");
        }
    }
}
