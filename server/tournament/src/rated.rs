//! What a tournament's games say of its participants' skill. How ratings come about is in [`crate::ratings`].

use super::{Game, Tournament};
use crate::ratings::Ratings;

impl Game {
    /// Whether it counts for ratings: it has a result, and all its participants played it themselves.
    pub fn is_rated(&self) -> bool {
        self.result().is_some_and(|result| {
            let mut seats = result.seats.iter();
            seats.all(|seat| !seat.forfeited && !seat.did.substituted)
        })
    }
}

impl Tournament {
    /// Ratings of the participants, by number, from the rated games of this tournament alone, in the order of their numbers.
    pub fn ratings(&self) -> Ratings<usize> {
        let mut ratings = Ratings::default();
        for game in self.games().iter().filter(|game| game.is_rated()) {
            let Some(result) = game.result() else {
                continue;
            };
            let places: Vec<(usize, u32)> = result
                .seats
                .iter()
                .map(|seat| {
                    (
                        seat.participant,
                        u32::try_from(seat.did.place).unwrap_or(u32::MAX),
                    )
                })
                .collect();
            // A game whose seats do not fit together tells nothing of anybody.
            let _ = ratings.fold(&places);
        }
        ratings
    }
}
