//! Which finished games retention leaves alone: those of studies, those of tournaments that are not
//! over or cannot be read, and those that do not say of which they are. The header of a game says
//! what it is part of; it is asked about in the same transaction as the game.

use std::collections::BTreeSet;

use sqlx::Row as _;
use sqlx::postgres::{PgConnection, PgRow};

use crate::Keep;
use crate::form;
use crate::sql::{OLD_GAMES, integer};
use crate::tournaments::StoredTournament;
use crate::units::{ROWS, StoredUnit, UnitKey, UnitKind};
use chefshat_room::ids::{GameId, Id, TournamentId, UnitId};

/// A finished game, with its encoding and header.
pub(super) struct Candidate {
    pub(super) number: i64,
    pub(super) game: GameId,
    /// What it is part of; the outer one is `None` if this version cannot read that.
    unit: Option<Option<UnitKey>>,
}

impl Candidate {
    /// From a number, id, encoding and header.
    pub(super) fn of(row: &PgRow) -> Option<Self> {
        Some(Self {
            number: row.get(0),
            game: Id::from_bytes(row.get::<&[u8], _>(1).try_into().ok()?),
            unit: form::stored_unit(row.get(2), row.get(3)).ok(),
        })
    }
}

/// The rows of the next games, after a number, that are old enough to be deleted.
pub(super) async fn old(
    connection: &mut PgConnection,
    keep: Keep,
    (after, count): (i64, usize),
    unwritten: bool,
) -> sqlx::Result<Vec<PgRow>> {
    sqlx::query(OLD_GAMES)
        .bind(after)
        .bind(integer(keep.newest.unwrap_or_default().max(1)))
        .bind(integer(keep.ended_since_ms.unwrap_or(u64::MAX)))
        .bind(integer(count as u64))
        .bind(unwritten)
        .fetch_all(connection)
        .await
}

/// Those of these games that are over, locked.
pub(super) async fn locked(
    connection: &mut PgConnection,
    games: &[GameId],
) -> sqlx::Result<Vec<Candidate>> {
    let ids: Vec<&[u8]> = games.iter().map(|id| id.bytes().as_slice()).collect();
    let rows = sqlx::query(
        "SELECT number, game_id, form, header FROM games
         WHERE game_id = ANY ($1) AND state <> 0 ORDER BY number FOR UPDATE",
    )
    .bind(ids)
    .fetch_all(connection)
    .await?;
    Ok(rows.iter().filter_map(Candidate::of).collect())
}

/// Those of these games that nothing needs, and the others.
pub(super) async fn divided(
    connection: &mut PgConnection,
    games: Vec<Candidate>,
) -> sqlx::Result<(Vec<Candidate>, Vec<Candidate>)> {
    let units: BTreeSet<UnitKey> = games.iter().filter_map(|game| game.unit?).collect();
    let needing = needing(connection, &units).await?;
    let is_free = |game: &Candidate| match game.unit {
        Some(Some(unit)) => !needing.contains(&unit),
        Some(None) => true,
        None => false,
    };
    Ok(games.into_iter().partition(is_free))
}

/// Those of these tournaments and studies that need their games.
async fn needing(
    connection: &mut PgConnection,
    units: &BTreeSet<UnitKey>,
) -> sqlx::Result<BTreeSet<UnitKey>> {
    if units.is_empty() {
        return Ok(BTreeSet::new());
    }
    let ids: Vec<UnitId> = units.iter().map(|unit| unit.id()).collect();
    let ids: Vec<&[u8]> = ids.iter().map(|id| id.bytes().as_slice()).collect();
    let studies: Vec<Vec<u8>> =
        sqlx::query_scalar("SELECT study_id FROM studies WHERE study_id = ANY ($1)")
            .bind(ids.clone())
            .fetch_all(&mut *connection)
            .await?;
    let mut needing: BTreeSet<UnitKey> = (studies.into_iter())
        .filter_map(|id| Some(UnitKind::Study.unit(id.try_into().ok()?)))
        .collect();
    let tournaments = sqlx::query(
        "SELECT number, tournament_id, form, header, over FROM tournaments
         WHERE tournament_id = ANY ($1)",
    )
    .bind(ids)
    .fetch_all(&mut *connection)
    .await?;
    for row in tournaments {
        let Ok(id) = row.get::<&[u8], _>(1).try_into() else {
            continue;
        };
        let id = TournamentId::from_bytes(id);
        let is_readable = async {
            let rows = sqlx::query_scalar(UnitKind::Tournament.sql(ROWS))
                .bind(row.get::<i64, _>(0))
                .fetch_all(&mut *connection)
                .await?;
            let stored = StoredUnit {
                form: row.get(2),
                header: row.get(3),
                rows,
            };
            Ok::<_, sqlx::Error>(StoredTournament::decode(id, &stored).is_ok())
        };
        let is_over: bool = row.get(4);
        if !is_over || !is_readable.await? {
            needing.insert(UnitKey::Tournament(id));
        }
    }
    Ok(needing)
}
