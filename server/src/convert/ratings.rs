//! Ratings as everybody sees them. How they come about is in `chefshat-arena`, which games count in `chefshat-records`.

use chefshat_proto::v1;
use chefshat_record::outcome::Identity;
use chefshat_tournament::ratings::{Rated, Ratings};

/// A rating and how many games it came from.
pub fn rating_to_proto(rated: &Rated) -> v1::Rating {
    v1::Rating {
        mean: rated.rating.mean,
        deviation: rated.rating.deviation,
        games: rated.games,
    }
}

/// The leaderboard of those of a kind (UNSPECIFIED: all) who have played at least so many games, at most so many lines of it.
pub fn leaderboard(
    ratings: &Ratings<Identity>,
    kind: v1::ParticipantKind,
    min_games: u32,
    limit: usize,
) -> v1::GetLeaderboardResponse {
    let shown = |who: &Identity| kind == v1::ParticipantKind::Unspecified || who.kind == kind;
    let lines = ratings.leaderboard(shown, min_games);
    let rated = lines
        .into_iter()
        .zip(1..)
        .take(limit)
        .map(|((who, rated), place)| v1::Rated {
            name: who.name.clone(),
            kind: who.kind.into(),
            built_in: who.built_in,
            rating: Some(rating_to_proto(rated)),
            place,
            places: rated.places.clone(),
        })
        .collect();
    v1::GetLeaderboardResponse {
        rated,
        games: ratings.games(),
    }
}
