//! Reads the database over its own connections, which cannot write and never wait for the writer.

use std::collections::HashMap;
use std::sync::Arc;

use chefshat_proto::v1;
use futures::TryStreamExt as _;
use sqlx::Row as _;
use sqlx::sqlite::SqlitePool;
use tracing::error;

use super::errors::failure;
use super::journals::{DurableJournal, WriteQueue};
use super::retained::Units;
use super::rows::{self, Read};
use crate::Keep;
use crate::decode_pool::DecodePool;
use crate::form::{self, FORM, OWNER_WITHIN, Unreadable, check_form, stored_header};
use crate::sql::{MAX_PRUNABLE_READ, OLD_GAMES, integer, list_query};
use crate::units::{HEADER, ROWS, StoredTraces, StoredUnit, UnitKey, UnitKind};
use crate::{Listed, Part, ResumableGame, StoreError, StoredGame, listed, stored_summary};
use chefshat_room::ids::{GameId, Id, StudyId};

/// Most ended games whose rooms are restored: the newest ones, because clients know the end of
/// older ones.
const MAX_ENDED: i64 = 256;

/// Reads stored games.
pub(super) struct Reader {
    pub(super) pool: SqlitePool,
    pub(super) decoding: DecodePool,
}

impl Reader {
    /// See `Store::resumable_games`.
    pub(super) async fn resumable_games(
        &self,
        ended_since_ms: u64,
        commands: &WriteQueue,
    ) -> Result<Vec<ResumableGame>, StoreError> {
        let games = sqlx::query(
            "SELECT number, form, header, state, last_row FROM games WHERE number IN (
                 SELECT number FROM games WHERE state = 0
                 UNION ALL
                 SELECT * FROM (
                     SELECT number FROM games WHERE ended_at_ms >= $1 AND header IS NOT NULL
                     ORDER BY ended_at_ms DESC LIMIT $2))
             ORDER BY number",
        )
        .bind(integer(ended_since_ms))
        .bind(MAX_ENDED)
        .fetch_all(&self.pool)
        .await
        .map_err(failure)?;
        let mut running_journals = self.running_journals().await?;
        let mut left = Vec::with_capacity(games.len());
        for row in games {
            let (number, form): (i64, i64) = (row.get(0), row.get(1));
            let concluded = row.get::<i64, _>(3) != 0;
            let header = check_form(form).and_then(|()| stored_header(row.get(2)));
            let read = match concluded {
                true => self.journal(number, row.get(4)).await?,
                false => running_journals
                    .remove(&number)
                    .unwrap_or(Ok(Read::default())),
            };
            match header.and_then(|header| Ok((header, read?))) {
                Ok((header, read)) => left.push(ResumableGame {
                    journal: Box::new(DurableJournal {
                        number,
                        position: read.rows,
                        last_row: read.last_row,
                        is_of_older_form: form < FORM,
                        running: (!concluded).then(|| commands.space.game()),
                        queue: commands.clone(),
                        readers: self.pool.clone(),
                        decoding: self.decoding.clone(),
                    }),
                    entries: read.entries,
                    concluded,
                    header,
                }),
                Err(problem) => {
                    error!(number, %problem, "a game cannot be read; it is left unchanged");
                }
            }
        }
        Ok(left)
    }

    /// See `Store::summary`.
    pub(super) async fn summary(
        &self,
        game: GameId,
    ) -> Result<Option<v1::RecordSummary>, StoreError> {
        let summary: Option<Vec<u8>> = sqlx::query_scalar(
            "SELECT summary FROM games WHERE game_id = $1 AND summary IS NOT NULL",
        )
        .bind(game.bytes().as_slice())
        .fetch_optional(&self.pool)
        .await
        .map_err(failure)?;
        let decoded = summary.map(|bytes| stored_summary(game, &bytes));
        Ok(decoded.transpose()?)
    }

    /// See `Store::finished`.
    pub(super) async fn finished(&self, game: GameId) -> Result<Option<StoredGame>, StoreError> {
        let row = sqlx::query(
            "SELECT number, form, header, record, last_row, signature
             FROM games LEFT JOIN added_records ON game = number
             WHERE game_id = $1 AND summary IS NOT NULL",
        )
        .bind(game.bytes().as_slice())
        .fetch_optional(&self.pool)
        .await
        .map_err(failure)?;
        let Some(row) = row else { return Ok(None) };
        let unreadable = |problem: Unreadable| {
            StoreError::Unreadable(format!("game {game} cannot be read: {problem}"))
        };
        check_form(row.get(1)).map_err(unreadable)?;
        let record: Option<Vec<u8>> = row.get(3);
        if let Some(record) = record {
            let decoding = self
                .decoding
                .run(record.len() / 64, move || form::lines_from_bytes(&record));
            let lines = decoding.await?.map_err(unreadable)?;
            return Ok(Some(StoredGame::Imported(lines.into())));
        }
        let header = stored_header(row.get(2)).map_err(unreadable)?;
        let journal = self.journal(row.get(0), row.get(4)).await?;
        let journal = journal.map_err(unreadable)?;
        let signature: Option<&[u8]> = row.get(5);
        let signature = signature.map(form::signature_from_bytes).transpose();
        Ok(Some(StoredGame::Hosted(
            Arc::new(header),
            journal.entries.into(),
            signature.map_err(unreadable)?.map(Arc::new),
        )))
    }

    /// Whether a game with this id is stored, over or not.
    pub(super) async fn has_game(&self, game: GameId) -> Result<bool, StoreError> {
        sqlx::query_scalar("SELECT EXISTS (SELECT 1 FROM games WHERE game_id = $1)")
            .bind(game.bytes().as_slice())
            .fetch_one(&self.pool)
            .await
            .map_err(failure)
    }

    /// See `Store::unit`.
    pub(super) async fn unit(&self, unit: UnitKey) -> Result<Option<StoredUnit>, StoreError> {
        let row = sqlx::query(unit.kind().sql(HEADER))
            .bind(unit.id().bytes().as_slice())
            .fetch_optional(&self.pool)
            .await
            .map_err(failure)?;
        let Some(row) = row else { return Ok(None) };
        let rows = sqlx::query_scalar(unit.kind().sql(ROWS))
            .bind(row.get::<i64, _>(0))
            .fetch_all(&self.pool)
            .await
            .map_err(failure)?;
        Ok(Some(StoredUnit {
            form: row.get(1),
            header: row.get(2),
            rows,
        }))
    }

    /// See `Store::units`.
    pub(super) async fn units(
        &self,
        kind: UnitKind,
        newest_over: usize,
    ) -> Result<Vec<UnitKey>, StoreError> {
        let query = match kind {
            UnitKind::Tournament => sqlx::query_scalar(
                "SELECT tournament_id FROM tournaments WHERE number IN (
                     SELECT number FROM tournaments WHERE over = 0
                     UNION ALL
                     SELECT * FROM (
                         SELECT number FROM tournaments WHERE over = 1
                         ORDER BY number DESC LIMIT $1))
                 ORDER BY number",
            )
            .bind(integer(newest_over as u64)),
            UnitKind::Study => sqlx::query_scalar("SELECT study_id FROM studies ORDER BY number"),
        };
        let ids: Vec<Vec<u8>> = query.fetch_all(&self.pool).await.map_err(failure)?;
        let unit = |id: Vec<u8>| id.try_into().ok().map(|id| kind.unit(id));
        Ok(ids.into_iter().filter_map(unit).collect())
    }

    /// See `Store::traces`.
    pub(super) async fn traces(&self, study: StudyId) -> Result<Vec<StoredTraces>, StoreError> {
        let rows = sqlx::query(
            "SELECT participant, game_id, traces FROM study_traces
             WHERE study = (SELECT number FROM studies WHERE study_id = $1) ORDER BY number",
        )
        .bind(study.bytes().as_slice())
        .fetch_all(&self.pool)
        .await
        .map_err(failure)?;
        let read = |row: &sqlx::sqlite::SqliteRow| {
            StoredTraces::read(study, row.get(0), row.get(1), row.get(2))
        };
        Ok(rows.iter().filter_map(read).collect())
    }

    /// The journals of all running games, by game number; the inner result says why one cannot be
    /// read. Reads everything stored since the oldest of them was created.
    async fn running_journals(&self) -> Result<HashMap<i64, Result<Read, Unreadable>>, StoreError> {
        let mut rows = sqlx::query(
            "SELECT row, position, entries, game FROM journal
             WHERE row >= (SELECT min(first_row) FROM games WHERE state = 0)
               AND game IN (SELECT number FROM games WHERE state = 0)
             ORDER BY row",
        )
        .fetch(&self.pool);
        let mut journals = HashMap::new();
        while let Some(row) = rows.try_next().await.map_err(failure)? {
            let journal = journals.entry(row.get(3)).or_insert(Ok(Read::default()));
            if let Ok(read) = journal
                && let Err(problem) = read.add(&row)
            {
                *journal = Err(problem);
            }
        }
        Ok(journals)
    }

    async fn journal(
        &self,
        number: i64,
        last_row: Option<i64>,
    ) -> Result<Result<Read, Unreadable>, StoreError> {
        rows::journal(&self.pool, &self.decoding, number, last_row).await
    }

    /// See `Store::list`.
    pub(super) async fn list(
        &self,
        filter: &v1::RecordFilter,
        part: Part,
        count: usize,
    ) -> Result<Vec<Listed>, StoreError> {
        let (query, number) = list_query(part);
        let rows = sqlx::query(query)
            .bind(number)
            .bind(filter.state)
            .bind(filter.origin)
            .bind(filter.room_name.as_str())
            .bind(integer(filter.created_from_ms))
            .bind(integer(filter.created_before_ms))
            .bind(filter.kind)
            .bind(filter.participant.as_str())
            .bind(filter.hosted_here)
            .bind(integer(count as u64))
            .bind(OWNER_WITHIN)
            .fetch_all(&self.pool)
            .await
            .map_err(failure)?;
        Ok(rows
            .iter()
            .map(|row| listed(row.get(0), row.get(2), row.get(1), row.get(3)))
            .collect())
    }

    /// See `Store::finished_games`.
    pub(super) async fn finished_games(&self) -> Result<u64, StoreError> {
        let count: i64 = sqlx::query_scalar("SELECT count(*) FROM games WHERE state <> 0")
            .fetch_one(&self.pool)
            .await
            .map_err(failure)?;
        Ok(u64::try_from(count).unwrap_or_default())
    }

    /// See `Store::prunable`. Games without a record are none of the newest ones. `unwritten`: also
    /// those whose record is still to be written to a file.
    pub(super) async fn prunable(
        &self,
        keep: Keep,
        mut after: u64,
        count: usize,
        unwritten: bool,
    ) -> Result<Vec<(u64, GameId)>, StoreError> {
        let mut connection = self.pool.acquire().await.map_err(failure)?;
        let (mut found, mut units) = (Vec::new(), Units::default());
        let mut page = count;
        loop {
            /// Number, game, encoding version, header.
            type Row = (i64, Vec<u8>, i64, Option<Vec<u8>>);
            let rows: Vec<Row> = sqlx::query_as(OLD_GAMES)
                .bind(integer(after))
                .bind(integer(keep.newest.unwrap_or_default().max(1)))
                .bind(integer(keep.ended_since_ms.unwrap_or(u64::MAX)))
                .bind(integer(page as u64))
                .bind(unwritten)
                .fetch_all(&mut *connection)
                .await
                .map_err(failure)?;
            let Some((last, ..)) = rows.last() else {
                return Ok(found);
            };
            after = last.unsigned_abs();
            for (number, id, form, header) in rows {
                let Ok(id) = id.try_into() else { continue };
                let needed = units.need(&mut connection, form, header.as_deref());
                if !needed.await.map_err(failure)? {
                    found.push((number.unsigned_abs(), Id::from_bytes(id)));
                }
                if found.len() >= count {
                    return Ok(found);
                }
            }
            page = MAX_PRUNABLE_READ.min(page * 2);
        }
    }

    /// See `Store::without_record_file`.
    pub(super) async fn without_record_file(&self) -> Result<Vec<GameId>, StoreError> {
        let ids: Vec<Vec<u8>> = sqlx::query_scalar(
            "SELECT game_id FROM games WHERE filed = 0 AND summary IS NOT NULL ORDER BY number",
        )
        .fetch_all(&self.pool)
        .await
        .map_err(failure)?;
        let id = |bytes: Vec<u8>| bytes.try_into().ok().map(Id::from_bytes);
        Ok(ids.into_iter().filter_map(id).collect())
    }
}
