//! What the writer writes for tournaments and studies.

use sqlx::sqlite::SqliteConnection;

use crate::form::{self, FORM};
use crate::sql::integer;
use crate::units::{UnitKey, UnitKind, UnitRow, UnitWrite};

const CREATE: &str = "INSERT INTO {units} ({unit_id}, form, header) VALUES ($1, $2, $3)
     ON CONFLICT ({unit_id}) DO NOTHING";
const APPEND: &str = "INSERT INTO {rows} ({unit}, position, {entries})
     SELECT number, $2, $3 FROM {units} WHERE {unit_id} = $1";
/// What is added, versions of an older encoding may not know: they leave the unit alone.
const RAISE_FORM: &str = "UPDATE {units} SET form = $2 WHERE {unit_id} = $1 AND form < $2";
const END: &str = "UPDATE tournaments SET over = 1 WHERE tournament_id = $1";
const DELETE_ROWS: &str =
    "DELETE FROM {rows} WHERE {unit} = (SELECT number FROM {units} WHERE {unit_id} = $1)";
const DELETE_TRACES: &str =
    "DELETE FROM study_traces WHERE study = (SELECT number FROM studies WHERE study_id = $1)";
const DELETE: &str = "DELETE FROM {units} WHERE {unit_id} = $1";

/// Writes something for a unit; `false` if its id is taken.
pub(super) async fn write(
    connection: &mut SqliteConnection,
    unit: UnitKey,
    change: &UnitWrite,
) -> sqlx::Result<bool> {
    match change {
        UnitWrite::Create { header, first, .. } => {
            let created = sqlx::query(unit.kind().sql(CREATE))
                .bind(unit.id().bytes().as_slice())
                .bind(FORM)
                .bind(header.as_slice())
                .execute(&mut *connection)
                .await?;
            if created.rows_affected() == 0 {
                return Ok(false);
            }
            if let Some(row) = first {
                append(connection, unit, row).await?;
            }
        }
        UnitWrite::Append(row) => append(connection, unit, row).await?,
        UnitWrite::Rewrite { entries, forgotten } => {
            run(connection, unit, DELETE_ROWS).await?;
            for participant in forgotten {
                sqlx::query(
                    "DELETE FROM study_traces
                     WHERE study = (SELECT number FROM studies WHERE study_id = $1)
                       AND participant = $2",
                )
                .bind(unit.id().bytes().as_slice())
                .bind(participant)
                .execute(&mut *connection)
                .await?;
            }
            let row = UnitRow {
                position: 0,
                entries: entries.clone(),
                over: false,
            };
            append(connection, unit, &row).await?;
        }
        UnitWrite::Traces(traces) => {
            sqlx::query(
                "INSERT INTO study_traces (study, participant, game_id, traces)
                 SELECT number, $2, $3, $4 FROM studies WHERE study_id = $1",
            )
            .bind(unit.id().bytes().as_slice())
            .bind(traces.number)
            .bind(traces.game.bytes().as_slice())
            .bind(form::traces_to_bytes(traces))
            .execute(&mut *connection)
            .await?;
            raise_form(connection, unit).await?;
        }
        UnitWrite::Delete => {
            for text in [DELETE_TRACES, DELETE_ROWS, DELETE] {
                run(connection, unit, text).await?;
            }
        }
    }
    Ok(true)
}

async fn append(
    connection: &mut SqliteConnection,
    unit: UnitKey,
    row: &UnitRow,
) -> sqlx::Result<()> {
    let added = sqlx::query(unit.kind().sql(APPEND))
        .bind(unit.id().bytes().as_slice())
        .bind(integer(row.position))
        .bind(row.entries.as_slice())
        .execute(&mut *connection)
        .await?;
    if added.rows_affected() == 0 && unit.kind() == UnitKind::Tournament {
        // Nothing deletes a tournament: what is to be committed would be lost.
        return Err(sqlx::Error::RowNotFound);
    }
    raise_form(connection, unit).await?;
    match row.over {
        true => run(connection, unit, END).await,
        false => Ok(()),
    }
}

async fn raise_form(connection: &mut SqliteConnection, unit: UnitKey) -> sqlx::Result<()> {
    sqlx::query(unit.kind().sql(RAISE_FORM))
        .bind(unit.id().bytes().as_slice())
        .bind(FORM)
        .execute(connection)
        .await
        .map(drop)
}

/// Runs a statement about one unit.
async fn run(
    connection: &mut SqliteConnection,
    unit: UnitKey,
    text: &'static str,
) -> sqlx::Result<()> {
    sqlx::query(unit.kind().sql(text))
        .bind(unit.id().bytes().as_slice())
        .execute(connection)
        .await
        .map(drop)
}
