//! Standings of a tournament as messages, with ratings and the confidence in their order.
//! `chefshat-tournament` computes them.

use chefshat_proto::v1;
use chefshat_tournament::Tournament;
use chefshat_tournament::ratings::Ratings;

use super::{number, rating_to_proto};

/// The standings, best first, with the ratings by participant number.
pub fn standings_to_proto(
    tournament: &Tournament,
    ratings: &Ratings<usize>,
) -> Vec<v1::TournamentStanding> {
    let standings = tournament.standings().into_iter();
    standings
        .map(|standing| v1::TournamentStanding {
            place: standing.place,
            participant: number(standing.participant),
            last_round: standing.last_round,
            games: standing.games,
            byes: standing.byes,
            score: standing.score,
            points: standing.points,
            rating: ratings.get(&standing.participant).map(rating_to_proto),
            places: standing.places,
            forfeited: standing.forfeited,
            substituted: standing.substituted,
            wrong_actions: standing.wrong_actions,
            timeouts: standing.timeouts,
            mean_decision_time_us: standing.mean_decision_time_us,
            performance_score: standing.performance_score,
        })
        .collect()
}

/// For each two neighbours, from the top: the probability that the upper one is better.
pub fn confidence_to_proto(tournament: &Tournament) -> Vec<v1::OrderConfidence> {
    let neighbours = tournament.order_confidence().into_iter();
    neighbours
        .map(|pair| v1::OrderConfidence {
            upper: number(pair.upper),
            lower: number(pair.lower),
            difference: pair.order.difference,
            standard_error: pair.order.standard_error,
            confidence: pair.order.confidence,
            more_games: pair.order.more_games,
        })
        .collect()
}
