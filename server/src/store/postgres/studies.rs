//! Studies: what their owners write, at their epochs, and what is read of them. Everything that
//! belongs to a study locks its row in `owned`, so it and a takeover come one after the other.

use futures::FutureExt as _;
use sqlx::Row as _;
use sqlx::postgres::{PgConnection, PgRow};

use super::reader::Reader;
use super::values::{FIRST_EPOCH, Owned};
use super::writer::confirming;
use crate::store::StoreError;
use crate::store::form::{self, FORM};
use crate::store::studies::{StoredStudy, StoredTraces};
use chefshat_room::ids::Id;

/// What is written for a study.
#[derive(Debug)]
pub(super) enum StudyWrite {
    /// Creates it, as this node's.
    Create { id: Id, node: i64, header: Vec<u8> },
    /// Adds a row to its journal.
    Append {
        owned: Owned,
        position: i64,
        changes: Vec<u8>,
    },
    /// Replaces its journal by one row, and deletes the interface traces of participants.
    Rewrite {
        owned: Owned,
        changes: Vec<u8>,
        forgotten: Vec<u32>,
    },
    /// Adds interface traces.
    Traces {
        owned: Owned,
        /// Identifies them, so that they are added once.
        id: Id,
        participant: u32,
        game: Id,
        traces: Vec<u8>,
    },
    /// Deletes it.
    Delete { owned: Owned },
}

impl StudyWrite {
    /// Writes it in a transaction; `again`: it may have been written before.
    pub(super) async fn run(
        &self,
        connection: &mut PgConnection,
        again: bool,
    ) -> sqlx::Result<Result<i64, StoreError>> {
        let written = match self {
            Self::Create { id, node, header } => {
                return create(connection, *id, *node, header, again).await;
            }
            Self::Append {
                owned,
                position,
                changes,
            } => append(connection, *owned, *position, changes).await?,
            Self::Rewrite {
                owned,
                changes,
                forgotten,
            } => rewrite(connection, *owned, changes, forgotten).await?,
            Self::Traces {
                owned,
                id,
                participant,
                game,
                traces,
            } => add_traces(connection, *owned, *id, (*participant, *game, traces)).await?,
            Self::Delete { owned } => delete(connection, *owned).await?,
        };
        Ok(match written {
            true => Ok(0),
            false => Err(self.fenced()),
        })
    }

    fn fenced(&self) -> StoreError {
        match self {
            Self::Create { id, .. } => StoreError::Fenced(*id),
            Self::Append { owned, .. }
            | Self::Rewrite { owned, .. }
            | Self::Traces { owned, .. }
            | Self::Delete { owned } => owned.fenced(),
        }
    }
}

/// Creates a study. It has no join code: what stands there cannot be typed as one.
async fn create(
    connection: &mut PgConnection,
    id: Id,
    node: i64,
    header: &[u8],
    again: bool,
) -> sqlx::Result<Result<i64, StoreError>> {
    let row = sqlx::query(
        "WITH owner AS (
             SELECT node FROM nodes WHERE node = $1
         ), place AS (
             INSERT INTO owned (id, unit, kind, node, epoch, join_code, durable, form)
             SELECT $2, $2, 2, node, $3, 'study ' || encode($2, 'hex'), true, $4 FROM owner
             ON CONFLICT DO NOTHING RETURNING id
         ), study AS (
             INSERT INTO studies (study_id, form, header) SELECT $2, $4, $5 FROM place
         )
         SELECT EXISTS (SELECT FROM place), EXISTS (SELECT FROM owner)",
    )
    .bind(node)
    .bind(id.0.as_slice())
    .bind(FIRST_EPOCH)
    .bind(FORM)
    .bind(header)
    .fetch_one(&mut *connection)
    .await?;
    let (placed, owner): (bool, bool) = (row.get(0), row.get(1));
    if placed {
        return Ok(Ok(0));
    }
    if again {
        let own = sqlx::query(confirming!(
            "study_id FROM studies WHERE study_id = $1 AND header = $2"
        ))
        .bind(id.0.as_slice())
        .bind(header)
        .fetch_optional(connection)
        .await?;
        if own.is_some() {
            return Ok(Ok(0));
        }
    }
    Ok(Err(match owner {
        true => StoreError::Taken(id),
        false => StoreError::Fenced(id),
    }))
}

/// Adds a row; `false` if another node has the study.
async fn append(
    connection: &mut PgConnection,
    owned: Owned,
    position: i64,
    changes: &[u8],
) -> sqlx::Result<bool> {
    let row = sqlx::query(
        "WITH owner AS (
             SELECT id FROM owned WHERE id = $1 AND epoch = $2 FOR UPDATE
         )
         INSERT INTO study_changes (study, position, epoch, changes)
         SELECT number, $3, $2, $4 FROM owner JOIN studies ON study_id = id
         ON CONFLICT DO NOTHING RETURNING study",
    )
    .bind(owned.id.0.as_slice())
    .bind(owned.epoch)
    .bind(position)
    .bind(changes)
    .fetch_optional(&mut *connection)
    .await?;
    if row.is_some() {
        return Ok(true);
    }
    let own = sqlx::query(confirming!(
        "study FROM studies JOIN study_changes ON study = number
         WHERE study_id = $1 AND position = $3 AND epoch = $2 AND changes = $4"
    ))
    .bind(owned.id.0.as_slice())
    .bind(owned.epoch)
    .bind(position)
    .bind(changes)
    .fetch_optional(connection)
    .await?;
    Ok(own.is_some())
}

/// Replaces the journal; doing it again changes nothing.
async fn rewrite(
    connection: &mut PgConnection,
    owned: Owned,
    changes: &[u8],
    forgotten: &[u32],
) -> sqlx::Result<bool> {
    let row = sqlx::query(
        "WITH owner AS (
             SELECT id FROM owned WHERE id = $1 AND epoch = $2 FOR UPDATE
         ), study AS (
             SELECT number FROM owner JOIN studies ON study_id = id
         ), later AS (
             DELETE FROM study_changes USING study WHERE study_changes.study = study.number AND position > 0
         ), traces AS (
             DELETE FROM study_traces USING study
             WHERE study_traces.study = study.number AND participant = ANY ($3)
         )
         INSERT INTO study_changes (study, position, epoch, changes)
         SELECT number, 0, $2, $4 FROM study
         ON CONFLICT (study, position) DO UPDATE SET epoch = excluded.epoch, changes = excluded.changes
         RETURNING study",
    )
    .bind(owned.id.0.as_slice())
    .bind(owned.epoch)
    .bind(forgotten.iter().map(|it| i64::from(*it)).collect::<Vec<_>>())
    .bind(changes)
    .fetch_optional(connection)
    .await?;
    Ok(row.is_some())
}

/// Adds interface traces; doing it again changes nothing.
async fn add_traces(
    connection: &mut PgConnection,
    owned: Owned,
    id: Id,
    (participant, game, traces): (u32, Id, &[u8]),
) -> sqlx::Result<bool> {
    let owner: bool = sqlx::query_scalar(
        "WITH owner AS (
             SELECT id FROM owned WHERE id = $1 AND epoch = $2 FOR UPDATE
         ), added AS (
             INSERT INTO study_traces (trace_id, study, participant, game_id, traces)
             SELECT $3, number, $4, $5, $6 FROM owner JOIN studies ON study_id = id
             ON CONFLICT DO NOTHING
         )
         SELECT EXISTS (SELECT FROM owner)",
    )
    .bind(owned.id.0.as_slice())
    .bind(owned.epoch)
    .bind(id.0.as_slice())
    .bind(i64::from(participant))
    .bind(game.0.as_slice())
    .bind(traces)
    .fetch_one(connection)
    .await?;
    Ok(owner)
}

/// Deletes a study; one that is gone counts as deleted.
async fn delete(connection: &mut PgConnection, owned: Owned) -> sqlx::Result<bool> {
    let row = sqlx::query(
        "WITH owner AS (
             SELECT id FROM owned WHERE id = $1 AND epoch = $2 FOR UPDATE
         ), study AS (
             DELETE FROM studies USING owner WHERE study_id = id RETURNING number
         ), changes AS (
             DELETE FROM study_changes USING study WHERE study_changes.study = study.number
         ), traces AS (
             DELETE FROM study_traces USING study WHERE study_traces.study = study.number
         )
         DELETE FROM owned USING owner WHERE owned.id = owner.id RETURNING owned.id",
    )
    .bind(owned.id.0.as_slice())
    .bind(owned.epoch)
    .fetch_optional(&mut *connection)
    .await?;
    if row.is_some() {
        return Ok(true);
    }
    let another = sqlx::query("SELECT id FROM owned WHERE id = $1")
        .bind(owned.id.0.as_slice())
        .fetch_optional(connection)
        .await?;
    Ok(another.is_none())
}

impl Reader {
    /// See `Store::study`.
    pub(super) async fn study(&self, id: Id) -> Result<Option<StoredStudy>, StoreError> {
        let row: Option<PgRow> = (self.read(|connection| {
            sqlx::query("SELECT number, form, header FROM studies WHERE study_id = $1")
                .bind(id.0.to_vec())
                .fetch_optional(connection)
                .boxed()
        }))
        .await?;
        let Some(row) = row else { return Ok(None) };
        let number: i64 = row.get(0);
        let rows: Vec<Vec<u8>> = (self.read(|connection| {
            sqlx::query_scalar(
                "SELECT changes FROM study_changes WHERE study = $1 ORDER BY position",
            )
            .bind(number)
            .fetch_all(connection)
            .boxed()
        }))
        .await?;
        let stored = form::stored_study(row.get(1), row.get(2), &rows);
        let stored = stored.map_err(|problem| {
            StoreError::Unreadable(format!("study {id} cannot be read: {problem}"))
        })?;
        Ok(Some(stored))
    }

    /// See `Store::studies`.
    pub(super) async fn studies(&self) -> Result<Vec<Id>, StoreError> {
        let ids: Vec<Vec<u8>> = (self.read(|connection| {
            sqlx::query_scalar("SELECT study_id FROM studies ORDER BY number")
                .fetch_all(connection)
                .boxed()
        }))
        .await?;
        let id = |bytes: Vec<u8>| bytes.try_into().ok().map(Id);
        Ok(ids.into_iter().filter_map(id).collect())
    }

    /// See `Store::traces`.
    pub(super) async fn traces(&self, study: Id) -> Result<Vec<StoredTraces>, StoreError> {
        let rows: Vec<(i64, Vec<u8>, Vec<u8>)> = (self.read(|connection| {
            sqlx::query_as(
                "SELECT participant, game_id, traces
                 FROM study_traces JOIN studies ON study = studies.number
                 WHERE study_id = $1 ORDER BY study_traces.number",
            )
            .bind(study.0.to_vec())
            .fetch_all(connection)
            .boxed()
        }))
        .await?;
        let traces = rows.iter().filter_map(|(participant, game, traces)| {
            let participant = u32::try_from(*participant).unwrap_or_default();
            form::stored_traces(participant, game, traces)
                .inspect_err(|problem| {
                    tracing::error!(%study, %problem, "traces of a game are left out");
                })
                .ok()
        });
        Ok(traces.collect())
    }
}
