//! Tournaments and studies by their types, as tests write and read them.

use std::sync::Arc;

use chefshat_study::Change;
use futures::FutureExt as _;
use futures::future::BoxFuture;

use crate::store::studies::{StoredStudy, StudyHeader, changes_to_bytes};
use crate::store::tournaments::{StoredTournament, TournamentEntry, TournamentHeader};
use crate::store::units::{StoredTraces, UnitKind, UnitRow, UnitWrite};
use crate::store::{Store, StoreError};
use chefshat_room::ids::Id;

type Written<'s> = BoxFuture<'s, Result<(), StoreError>>;

pub(crate) trait TypedUnits: Store {
    fn create_tournament(
        &self,
        header: Arc<TournamentHeader>,
        entries: Vec<TournamentEntry>,
    ) -> Written<'_> {
        let create = UnitWrite::Create {
            join_code: Some(header.join_code.clone()),
            header: header.to_bytes(),
            first: Some(tournament_row(0, &entries)),
        };
        self.write_unit(UnitKind::Tournament.id(header.id), create)
    }

    fn append_tournament(
        &self,
        tournament: Id,
        row: u64,
        entries: Vec<TournamentEntry>,
    ) -> Written<'_> {
        let append = UnitWrite::Append(tournament_row(row, &entries));
        self.write_unit(UnitKind::Tournament.id(tournament), append)
    }

    fn tournaments(
        &self,
        newest_over: usize,
    ) -> BoxFuture<'_, Result<Vec<StoredTournament>, StoreError>> {
        async move {
            let mut found = Vec::new();
            for id in self.units(UnitKind::Tournament, newest_over).await? {
                let unit = self.unit(UnitKind::Tournament.id(id)).await?;
                found.push(StoredTournament::decode(id, &unit.expect("it is there"))?);
            }
            Ok(found)
        }
        .boxed()
    }

    fn create_study(&self, header: Arc<StudyHeader>) -> Written<'_> {
        let create = UnitWrite::Create {
            join_code: None,
            header: header.to_bytes(),
            first: None,
        };
        self.write_unit(UnitKind::Study.id(header.id), create)
    }

    fn append_study(&self, study: Id, row: u64, changes: Vec<Change>) -> Written<'_> {
        let append = UnitWrite::Append(UnitRow {
            position: row,
            entries: changes_to_bytes(&changes),
            over: false,
        });
        self.write_unit(UnitKind::Study.id(study), append)
    }

    fn rewrite_study(&self, study: Id, changes: Vec<Change>, forgotten: Vec<u32>) -> Written<'_> {
        let rewrite = UnitWrite::Rewrite {
            entries: changes_to_bytes(&changes),
            forgotten,
        };
        self.write_unit(UnitKind::Study.id(study), rewrite)
    }

    fn delete_study(&self, study: Id) -> Written<'_> {
        self.write_unit(UnitKind::Study.id(study), UnitWrite::Delete)
    }

    fn append_traces(&self, study: Id, traces: StoredTraces) -> Written<'_> {
        self.write_unit(UnitKind::Study.id(study), UnitWrite::Traces(traces))
    }

    fn study(&self, study: Id) -> BoxFuture<'_, Result<Option<StoredStudy>, StoreError>> {
        async move {
            let unit = self.unit(UnitKind::Study.id(study)).await?;
            unit.map(|unit| StoredStudy::decode(study, &unit))
                .transpose()
        }
        .boxed()
    }

    fn studies(&self) -> BoxFuture<'_, Result<Vec<Id>, StoreError>> {
        self.units(UnitKind::Study, usize::MAX)
    }
}

impl<S: Store + ?Sized> TypedUnits for S {}

fn tournament_row(position: u64, entries: &[TournamentEntry]) -> UnitRow {
    UnitRow {
        position,
        entries: TournamentEntry::to_bytes(entries),
        over: entries.iter().any(TournamentEntry::is_end),
    }
}
