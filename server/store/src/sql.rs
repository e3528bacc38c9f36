//! What SQLite and PostgreSQL share about games: texts of queries, and numbers as both have them.
//! `units` has those about tournaments and studies.

use super::Part;

/// Most games of which retention reads at a time whether they are needed.
pub(super) const MAX_PRUNABLE_READ: usize = 1_024;

/// The games after number `$1`, at most `$4`, that ended before `$3` and are not the `$2` newest
/// ones. `$5`: also those whose record is not written to a file.
pub(super) const OLD_GAMES: &str = "SELECT number, game_id, form, header FROM games
     WHERE state <> 0 AND number > $1 AND coalesce(ended_at_ms, created_at_ms, 0) < $3
       AND (summary IS NULL
            OR (filed OR $5)
               AND listed <= (SELECT listed FROM games WHERE listed IS NOT NULL
                              ORDER BY listed DESC LIMIT 1 OFFSET $2))
     ORDER BY number LIMIT $4";

/// The query for the list of finished games, with the condition on their numbers and the order.
macro_rules! list_query {
    ($part:literal, $order:literal) => {
        concat!(
            "SELECT listed, summary, game_id, substr(header, 1, $11) FROM games
             WHERE summary IS NOT NULL AND ",
            $part,
            " AND ($2 = 0 OR state = $2) AND ($3 = 0 OR origin = $3) AND ($4 = '' OR room_name = $4)
               AND created_at_ms >= $5 AND ($6 = 0 OR created_at_ms < $6)
               AND ($7 = 0 OR EXISTS (SELECT 1 FROM participants WHERE game = number AND kind = $7))
               AND ($8 = '' OR number IN (SELECT game FROM participants WHERE (name = $8 AND agent = '') OR agent = $8))
               AND NOT ($9 AND added)
             ORDER BY ",
            $order,
            " LIMIT $10"
        )
    };
}

/// The query for a part of the list of finished games, and the number for its `$1`.
pub(super) fn list_query(part: Part) -> (&'static str, i64) {
    match part {
        Part::After(number) => (list_query!("listed > $1", "listed"), integer(number)),
        Part::Before(number) => (list_query!("listed < $1", "listed DESC"), integer(number)),
    }
}

/// A number as both databases have it; the largest if it is too large.
pub(super) fn integer(number: u64) -> i64 {
    i64::try_from(number).unwrap_or(i64::MAX)
}
