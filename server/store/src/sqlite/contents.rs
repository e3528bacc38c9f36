//! Everything in the database of a data directory, for moving it to another store. No server has it
//! open meanwhile.

use std::path::Path;

use futures::stream::BoxStream;
use futures::{StreamExt as _, TryStreamExt as _};
use sqlx::sqlite::SqliteRow;
use sqlx::{Row as _, SqlSafeStr};

use super::errors::failure;
use super::open::{self, IfGone, OpenError, Opened};
use super::rows::with_own_rows;
use crate::StoreError;
use crate::units::UnitKind;

/// A game as stored.
pub(crate) struct GameRow {
    pub(crate) number: i64,
    pub(crate) game_id: Vec<u8>,
    pub(crate) form: i64,
    pub(crate) state: i32,
    pub(crate) ended_at_ms: Option<i64>,
    pub(crate) filed: bool,
    pub(crate) origin: Option<i32>,
    pub(crate) room_name: Option<String>,
    pub(crate) created_at_ms: Option<i64>,
    pub(crate) added: bool,
    pub(crate) summary: Option<Vec<u8>>,
    pub(crate) header: Option<Vec<u8>>,
    pub(crate) listed: Option<i64>,
    pub(crate) signature: Option<Vec<u8>>,
    /// The record of a game that was played elsewhere.
    pub(crate) record: Option<Vec<u8>>,
    last_row: Option<i64>,
}

/// A row of the journal of a game, tournament or study.
pub(crate) struct JournalRow {
    /// The number of the game, tournament or study.
    pub(crate) of: i64,
    pub(crate) position: i64,
    pub(crate) entries: Vec<u8>,
}

/// A participant of a finished game.
pub(crate) struct ParticipantRow {
    pub(crate) game: i64,
    pub(crate) seat: i64,
    pub(crate) name: String,
    pub(crate) agent: String,
    pub(crate) kind: i32,
}

/// A tournament or study as stored, without its journal.
pub(crate) struct UnitHeader {
    pub(crate) number: i64,
    pub(crate) id: Vec<u8>,
    pub(crate) form: i64,
    pub(crate) header: Vec<u8>,
    /// A study is never over.
    pub(crate) over: bool,
}

/// Interface traces as stored.
pub(crate) struct TracesRow {
    /// The number of the study.
    pub(crate) study: i64,
    pub(crate) participant: i64,
    pub(crate) game_id: Vec<u8>,
    pub(crate) traces: Vec<u8>,
}

/// The database of a data directory.
pub(crate) struct Contents(Opened);

type Rows<'a, T> = BoxStream<'a, Result<T, StoreError>>;

impl Contents {
    /// Opens the database, and upgrades it to this version's.
    pub(crate) async fn open(data_dir: &Path) -> Result<Self, OpenError> {
        let opened = open::open(data_dir, IfGone::CreateFirst).await;
        opened.map(Self)
    }

    /// Number of games.
    pub(crate) async fn count(&self) -> Result<u64, StoreError> {
        let count: i64 = sqlx::query_scalar("SELECT count(*) FROM games")
            .fetch_one(&self.0.readers)
            .await
            .map_err(failure)?;
        Ok(count.cast_unsigned())
    }

    /// The largest number of a game, 0 if there is none.
    pub(crate) async fn newest_game(&self) -> Result<i64, StoreError> {
        sqlx::query_scalar("SELECT coalesce(max(number), 0) FROM games")
            .fetch_one(&self.0.readers)
            .await
            .map_err(failure)
    }

    /// The tournaments or studies, in the order of their numbers.
    pub(crate) fn units(&self, kind: UnitKind) -> Rows<'_, UnitHeader> {
        let text = match kind {
            UnitKind::Tournament => {
                "SELECT number, tournament_id, form, header, over FROM tournaments ORDER BY number"
            }
            UnitKind::Study => {
                "SELECT number, study_id, form, header, false FROM studies ORDER BY number"
            }
        };
        self.rows(text, |row| UnitHeader {
            number: row.get(0),
            id: row.get(1),
            form: row.get(2),
            header: row.get(3),
            over: row.get(4),
        })
    }

    /// The journals of all tournaments or studies.
    pub(crate) fn unit_journals(&self, kind: UnitKind) -> Rows<'_, JournalRow> {
        let text = "SELECT {unit}, position, {entries} FROM {rows} ORDER BY {unit}, position";
        self.rows(kind.sql(text), journal_row)
    }

    /// The interface traces of all studies, in the order in which they were added.
    pub(crate) fn traces(&self) -> Rows<'_, TracesRow> {
        self.rows(
            "SELECT study, participant, game_id, traces FROM study_traces ORDER BY number",
            |row| TracesRow {
                study: row.get(0),
                participant: row.get(1),
                game_id: row.get(2),
                traces: row.get(3),
            },
        )
    }

    /// The games, in the order of their numbers.
    pub(crate) fn games(&self) -> Rows<'_, GameRow> {
        self.rows(
            "SELECT number, game_id, form, state, ended_at_ms, filed, origin, room_name, created_at_ms, added, summary,
                    header, listed, signature, record, last_row
             FROM games LEFT JOIN added_records ON game = number ORDER BY number",
            |row| GameRow {
                number: row.get(0),
                game_id: row.get(1),
                form: row.get(2),
                state: row.get(3),
                ended_at_ms: row.get(4),
                filed: row.get(5),
                origin: row.get(6),
                room_name: row.get(7),
                created_at_ms: row.get(8),
                added: row.get(9),
                summary: row.get(10),
                header: row.get(11),
                listed: row.get(12),
                signature: row.get(13),
                record: row.get(14),
                last_row: row.get(15),
            },
        )
    }

    /// The journal of a game that is over.
    pub(crate) async fn journal(&self, game: &GameRow) -> Result<Vec<JournalRow>, StoreError> {
        let rows = sqlx::query(with_own_rows!(
            "row = $1 AND game = $2",
            "SELECT game, position, entries FROM journal WHERE row IN (SELECT row FROM own) ORDER BY row"
        ))
        .bind(game.last_row)
        .bind(game.number)
        .fetch_all(&self.0.readers)
        .await
        .map_err(failure)?;
        Ok(rows.into_iter().map(journal_row).collect())
    }

    /// The journals of all games that are not over, in the order in which they were written.
    pub(crate) fn running_journals(&self) -> Rows<'_, JournalRow> {
        self.rows(
            "SELECT game, position, entries FROM journal
             WHERE row >= (SELECT min(first_row) FROM games WHERE state = 0)
               AND game IN (SELECT number FROM games WHERE state = 0)
             ORDER BY row",
            journal_row,
        )
    }

    /// The participants of finished games.
    pub(crate) fn participants(&self) -> Rows<'_, ParticipantRow> {
        self.rows(
            "SELECT game, seat, name, agent, kind FROM participants",
            |row| ParticipantRow {
                game: row.get(0),
                seat: row.get(1),
                name: row.get(2),
                agent: row.get(3),
                kind: row.get(4),
            },
        )
    }

    fn rows<T: 'static>(&self, query: impl SqlSafeStr, row: fn(SqliteRow) -> T) -> Rows<'_, T> {
        (sqlx::query(query).fetch(&self.0.readers))
            .map_ok(row)
            .map_err(failure)
            .boxed()
    }
}

fn journal_row(row: SqliteRow) -> JournalRow {
    JournalRow {
        of: row.get(0),
        position: row.get(1),
        entries: row.get(2),
    }
}
