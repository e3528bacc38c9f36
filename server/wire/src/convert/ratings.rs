//! Ratings as messages. `chefshat-tournament` computes them; `chefshat-record` says which games
//! count.

use chefshat_proto::v1;
use chefshat_record::outcome::Identity;
use chefshat_tournament::ratings::{Rated, Ratings};

/// A rating and its number of games.
pub fn rating_to_proto(rated: &Rated) -> v1::Rating {
    v1::Rating {
        mean: rated.rating.mean,
        deviation: rated.rating.deviation,
        games: rated.games,
    }
}

/// The leaderboard of one kind of participant (UNSPECIFIED: all) with at least `min_games` games,
/// at most `limit` rows.
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
            name_fingerprint: who.name_fingerprint.clone(),
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
