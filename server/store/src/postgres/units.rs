//! Tournaments and studies: what their owners write, at their epochs, and what is read of them.
//! Everything that belongs to one locks its row in `owned`, so it and a takeover come one after the
//! other.

use futures::FutureExt as _;
use sqlx::Row as _;
use sqlx::postgres::{PgConnection, PgRow};

use super::appends::refusal;
use super::reader::Reader;
use super::values::{FIRST_EPOCH, Owned, number_of, text};
use super::writer::confirming;
use crate::StoreError;
use crate::form::{self, FORM};
use crate::sql::integer;
use crate::units::{HEADER, ROWS, StoredTraces, StoredUnit, UnitKey, UnitKind, UnitRow};
use chefshat_room::ids::{StudyId, UnitId};

/// What is written for a unit.
#[derive(Debug)]
pub(super) enum Change {
    /// A node creates it.
    Create {
        unit: UnitKey,
        node: i64,
        join_code: Option<String>,
        header: Vec<u8>,
        first: Option<UnitRow>,
    },
    /// Its owner adds a row to its journal.
    Append(UnitKind, Owned, UnitRow),
    /// Its owner replaces its journal by one row, and deletes the interface traces of participants.
    Rewrite(UnitKind, Owned, Vec<u8>, Vec<u32>),
    /// Its owner adds interface traces; the id identifies them, so that they are added once.
    Traces(Owned, [u8; 16], StoredTraces),
    /// Its owner deletes it.
    Delete(UnitKind, Owned),
}

impl Change {
    /// Writes it in a transaction; `again`: it may have been written before.
    pub(super) async fn run(
        &self,
        connection: &mut PgConnection,
        again: bool,
    ) -> sqlx::Result<Result<i64, StoreError>> {
        let (owned, written) = match self {
            Self::Create {
                unit,
                node,
                join_code,
                header,
                first,
            } => {
                let names = (join_code.as_deref(), header.as_slice());
                let created = create(connection, *unit, *node, names, again).await?;
                if let (Ok(Created::Now), Some(row)) = (&created, first) {
                    let owned = Owned {
                        id: unit.id(),
                        unit: unit.id(),
                        epoch: FIRST_EPOCH,
                    };
                    let appended = append(connection, unit.kind(), owned, row).await?;
                    return Ok(appended.map(|()| 0));
                }
                return Ok(created.map(|_| 0));
            }
            Self::Append(kind, owned, row) => {
                let appended = append(connection, *kind, *owned, row).await?;
                return Ok(appended.map(|()| 0));
            }
            Self::Rewrite(kind, owned, entries, forgotten) => {
                let written = rewrite(connection, *kind, *owned, entries, forgotten);
                (owned, written.await?)
            }
            Self::Traces(owned, id, traces) => {
                (owned, add_traces(connection, *owned, *id, traces).await?)
            }
            Self::Delete(kind, owned) => (owned, delete(connection, *kind, *owned).await?),
        };
        Ok(match written {
            true => Ok(0),
            false => Err(owned.fenced()),
        })
    }
}

enum Created {
    /// By this attempt.
    Now,
    /// By an earlier one, with its first row.
    Before,
}

/// Creates a unit. What stands in place of a missing join code cannot be typed as one.
async fn create(
    connection: &mut PgConnection,
    unit: UnitKey,
    node: i64,
    (join_code, header): (Option<&str>, &[u8]),
    again: bool,
) -> sqlx::Result<Result<Created, StoreError>> {
    let row = sqlx::query(unit.kind().sql(
        "WITH owner AS (
             SELECT node FROM nodes WHERE node = $1
         ), place AS (
             INSERT INTO owned (id, unit, kind, node, epoch, join_code, durable, form)
             SELECT $2, $2, $7, node, $3, coalesce($6, 'study ' || encode($2, 'hex')), true, $4 FROM owner
             ON CONFLICT DO NOTHING RETURNING id
         ), unit AS (
             INSERT INTO {units} ({unit_id}, form, header) SELECT $2, $4, $5 FROM place
         )
         SELECT EXISTS (SELECT FROM place), EXISTS (SELECT FROM owner)",
    ))
    .bind(node)
    .bind(unit.id().bytes().as_slice())
    .bind(FIRST_EPOCH)
    .bind(FORM)
    .bind(header)
    .bind(join_code.map(text))
    .bind(number_of(unit.kind()))
    .fetch_one(&mut *connection)
    .await?;
    let (placed, owner): (bool, bool) = (row.get(0), row.get(1));
    if placed {
        return Ok(Ok(Created::Now));
    }
    if again {
        let own = sqlx::query(unit.kind().sql(confirming!(
            "{unit_id} FROM {units} WHERE {unit_id} = $1 AND header = $2"
        )))
        .bind(unit.id().bytes().as_slice())
        .bind(header)
        .fetch_optional(connection)
        .await?;
        if own.is_some() {
            return Ok(Ok(Created::Before));
        }
    }
    Ok(Err(match owner {
        true => StoreError::Taken(unit.id().to_string()),
        false => StoreError::Fenced(unit.id()),
    }))
}

/// Adds a row, unless another node has the unit, or the row before it is gone.
async fn append(
    connection: &mut PgConnection,
    kind: UnitKind,
    owned: Owned,
    row: &UnitRow,
) -> sqlx::Result<Result<(), StoreError>> {
    let position = integer(row.position);
    let added = sqlx::query(kind.sql(
        "WITH owner AS (
             SELECT id FROM owned WHERE id = $1 AND epoch = $2 FOR UPDATE
         )
         INSERT INTO {rows} ({unit}, position, epoch, {entries})
         SELECT number, $3, $2, $4 FROM owner JOIN {units} ON {unit_id} = id
         WHERE $3 = 0 OR (SELECT true FROM {rows} WHERE {unit} = number AND position = $3 - 1)
         ON CONFLICT DO NOTHING RETURNING {unit}",
    ))
    .bind(owned.id.bytes().as_slice())
    .bind(owned.epoch)
    .bind(position)
    .bind(row.entries.as_slice())
    .fetch_optional(&mut *connection)
    .await?;
    if added.is_some() {
        if row.over {
            end(connection, owned.id).await?;
        }
        return Ok(Ok(()));
    }
    let own = sqlx::query(kind.sql(confirming!(
        "{unit} FROM {units} JOIN {rows} ON {unit} = number
         WHERE {unit_id} = $1 AND position = $3 AND epoch = $2 AND {entries} = $4"
    )))
    .bind(owned.id.bytes().as_slice())
    .bind(owned.epoch)
    .bind(position)
    .bind(row.entries.as_slice())
    .fetch_optional(&mut *connection)
    .await?;
    Ok(match own {
        Some(_) => Ok(()),
        None => Err(refusal(connection, Some(kind), owned, position).await?),
    })
}

/// Marks a tournament, whose row is locked, as over.
async fn end(connection: &mut PgConnection, id: UnitId) -> sqlx::Result<()> {
    for text in [
        "UPDATE owned SET over = true, ended_ms = clock_ms() WHERE id = $1",
        "UPDATE tournaments SET over = true WHERE tournament_id = $1",
    ] {
        sqlx::query(text)
            .bind(id.bytes().as_slice())
            .execute(&mut *connection)
            .await?;
    }
    Ok(())
}

/// Replaces the journal; doing it again changes nothing.
async fn rewrite(
    connection: &mut PgConnection,
    kind: UnitKind,
    owned: Owned,
    entries: &[u8],
    forgotten: &[u32],
) -> sqlx::Result<bool> {
    let row = sqlx::query(kind.sql(
        "WITH owner AS (
             SELECT id FROM owned WHERE id = $1 AND epoch = $2 FOR UPDATE
         ), unit AS (
             SELECT number FROM owner JOIN {units} ON {unit_id} = id
         ), later AS (
             DELETE FROM {rows} USING unit WHERE {rows}.{unit} = unit.number AND position > 0
         ), traces AS (
             DELETE FROM study_traces USING owner JOIN studies ON study_id = id
             WHERE study_traces.study = studies.number AND participant = ANY ($3)
         )
         INSERT INTO {rows} ({unit}, position, epoch, {entries})
         SELECT number, 0, $2, $4 FROM unit
         ON CONFLICT ({unit}, position) DO UPDATE SET epoch = excluded.epoch, {entries} = excluded.{entries}
         RETURNING {unit}",
    ))
    .bind(owned.id.bytes().as_slice())
    .bind(owned.epoch)
    .bind(forgotten.iter().map(|it| i64::from(*it)).collect::<Vec<_>>())
    .bind(entries)
    .fetch_optional(connection)
    .await?;
    Ok(row.is_some())
}

/// Adds interface traces; doing it again changes nothing.
async fn add_traces(
    connection: &mut PgConnection,
    owned: Owned,
    id: [u8; 16],
    traces: &StoredTraces,
) -> sqlx::Result<bool> {
    sqlx::query_scalar(
        "WITH owner AS (
             SELECT id FROM owned WHERE id = $1 AND epoch = $2 FOR UPDATE
         ), added AS (
             INSERT INTO study_traces (trace_id, study, participant, game_id, traces)
             SELECT $3, number, $4, $5, $6 FROM owner JOIN studies ON study_id = id
             ON CONFLICT DO NOTHING
         )
         SELECT EXISTS (SELECT FROM owner)",
    )
    .bind(owned.id.bytes().as_slice())
    .bind(owned.epoch)
    .bind(id.as_slice())
    .bind(i64::from(traces.number))
    .bind(traces.game.bytes().as_slice())
    .bind(form::traces_to_bytes(traces))
    .fetch_one(connection)
    .await
}

/// Deletes a unit; one that is gone counts as deleted.
async fn delete(connection: &mut PgConnection, kind: UnitKind, owned: Owned) -> sqlx::Result<bool> {
    let row = sqlx::query(kind.sql(
        "WITH owner AS (
             SELECT id FROM owned WHERE id = $1 AND epoch = $2 FOR UPDATE
         ), unit AS (
             DELETE FROM {units} USING owner WHERE {unit_id} = id RETURNING number
         ), rows AS (
             DELETE FROM {rows} USING unit WHERE {rows}.{unit} = unit.number
         ), traces AS (
             DELETE FROM study_traces USING owner JOIN studies ON study_id = id
             WHERE study_traces.study = studies.number
         )
         DELETE FROM owned USING owner WHERE owned.id = owner.id RETURNING owned.id",
    ))
    .bind(owned.id.bytes().as_slice())
    .bind(owned.epoch)
    .fetch_optional(&mut *connection)
    .await?;
    if row.is_some() {
        return Ok(true);
    }
    let another = sqlx::query("SELECT id FROM owned WHERE id = $1")
        .bind(owned.id.bytes().as_slice())
        .fetch_optional(connection)
        .await?;
    Ok(another.is_none())
}

impl Reader {
    /// See `Store::unit`.
    pub(super) async fn unit(&self, unit: UnitKey) -> Result<Option<StoredUnit>, StoreError> {
        let row: Option<PgRow> = (self.read(|connection| {
            sqlx::query(unit.kind().sql(HEADER))
                .bind(unit.id().bytes().to_vec())
                .fetch_optional(connection)
                .boxed()
        }))
        .await?;
        let Some(row) = row else { return Ok(None) };
        let number: i64 = row.get(0);
        let rows = self.read(|connection| {
            sqlx::query_scalar(unit.kind().sql(ROWS))
                .bind(number)
                .fetch_all(connection)
                .boxed()
        });
        Ok(Some(StoredUnit {
            form: row.get(1),
            header: row.get(2),
            rows: rows.await?,
        }))
    }

    /// All studies, oldest first.
    pub(super) async fn studies(&self) -> Result<Vec<UnitKey>, StoreError> {
        let ids = self.read(|connection| {
            sqlx::query_scalar("SELECT study_id FROM studies ORDER BY number")
                .fetch_all(connection)
                .boxed()
        });
        Ok(read_units(UnitKind::Study, ids.await?))
    }

    /// The tournaments of a node that are not over, and of the newest ones of the cluster
    /// that are; oldest first.
    pub(super) async fn tournaments(
        &self,
        node: i64,
        newest_over: usize,
    ) -> Result<Vec<UnitKey>, StoreError> {
        let ids = self.read(|connection| {
            sqlx::query_scalar(
                "SELECT tournament_id FROM tournaments WHERE number IN (
                     SELECT number FROM tournaments JOIN owned ON id = tournament_id
                     WHERE node = $1 AND NOT owned.over
                     UNION ALL
                     SELECT * FROM (
                         SELECT number FROM tournaments WHERE over
                         ORDER BY number DESC LIMIT $2) newest)
                 ORDER BY number",
            )
            .bind(node)
            .bind(integer(newest_over as u64))
            .fetch_all(connection)
            .boxed()
        });
        Ok(read_units(UnitKind::Tournament, ids.await?))
    }

    /// See `Store::traces`.
    pub(super) async fn traces(&self, study: StudyId) -> Result<Vec<StoredTraces>, StoreError> {
        let rows: Vec<(i64, Vec<u8>, Vec<u8>)> = (self.read(|connection| {
            sqlx::query_as(
                "SELECT participant, game_id, traces
                 FROM study_traces JOIN studies ON study = studies.number
                 WHERE study_id = $1 ORDER BY study_traces.number",
            )
            .bind(study.bytes().to_vec())
            .fetch_all(connection)
            .boxed()
        }))
        .await?;
        let read = |(participant, game, traces): &(i64, Vec<u8>, Vec<u8>)| {
            let participant = u32::try_from(*participant).unwrap_or_default();
            StoredTraces::read(study, participant, game, traces)
        };
        Ok(rows.iter().filter_map(read).collect())
    }
}

fn read_units(kind: UnitKind, ids: Vec<Vec<u8>>) -> Vec<UnitKey> {
    let unit = |id: Vec<u8>| id.try_into().ok().map(|id| kind.unit(id));
    ids.into_iter().filter_map(unit).collect()
}
