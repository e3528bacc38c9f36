//! Which finished games retention leaves alone: those of studies, those of tournaments that are not
//! over or cannot be read, and those that do not say of which they are. The header of a game says
//! what it is part of; it is asked about in the same transaction as the game.

use std::collections::HashMap;

use sqlx::Row as _;
use sqlx::sqlite::SqliteConnection;

use crate::form;
use crate::tournaments::StoredTournament;
use crate::units::{ROWS, StoredUnit, UnitKey, UnitKind};
use chefshat_room::ids::{StudyId, TournamentId};

/// Which tournaments and studies need their games, as far as they were asked about.
#[derive(Default)]
pub(super) struct Units(HashMap<UnitKey, bool>);

impl Units {
    /// Whether a game with this encoding and header is needed.
    pub(super) async fn need(
        &mut self,
        connection: &mut SqliteConnection,
        form: i64,
        header: Option<&[u8]>,
    ) -> sqlx::Result<bool> {
        let unit = match form::stored_unit(form, header) {
            Ok(Some(unit)) => unit,
            Ok(None) => return Ok(false),
            Err(_) => return Ok(true),
        };
        if let Some(needs) = self.0.get(&unit) {
            return Ok(*needs);
        }
        let needs = match unit {
            UnitKey::Study(study) => is_study(connection, study).await?,
            UnitKey::Tournament(tournament) => is_open(connection, tournament).await?,
        };
        self.0.insert(unit, needs);
        Ok(needs)
    }
}

async fn is_study(connection: &mut SqliteConnection, study: StudyId) -> sqlx::Result<bool> {
    sqlx::query_scalar("SELECT EXISTS (SELECT 1 FROM studies WHERE study_id = $1)")
        .bind(study.bytes().as_slice())
        .fetch_one(connection)
        .await
}

/// Whether a tournament is there, and is not over or cannot be read.
async fn is_open(
    connection: &mut SqliteConnection,
    tournament: TournamentId,
) -> sqlx::Result<bool> {
    let kind = UnitKind::Tournament;
    let row =
        sqlx::query("SELECT number, form, header, over FROM tournaments WHERE tournament_id = $1")
            .bind(tournament.bytes().as_slice())
            .fetch_optional(&mut *connection)
            .await?;
    let Some(row) = row else { return Ok(false) };
    if !row.get::<bool, _>(3) {
        return Ok(true);
    }
    let rows = sqlx::query_scalar(kind.sql(ROWS))
        .bind(row.get::<i64, _>(0))
        .fetch_all(connection)
        .await?;
    let stored = StoredUnit {
        form: row.get(1),
        header: row.get(2),
        rows,
    };
    Ok(StoredTournament::decode(tournament, &stored).is_err())
}
