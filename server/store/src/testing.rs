//! What tests share: a store that fails on request, and tournaments and studies by their types.

mod cluster;
mod failing;

use std::sync::Arc;

use async_trait::async_trait;
use chefshat_engine::RuleSetSpec;
use chefshat_proto::v1;
use chefshat_room::ids::{GameId, SecretHash, StudyId, TournamentId};
use chefshat_room::journal::{Entry, GameHeader};
use chefshat_room::policy::{Durability, Policy};
use chefshat_room::testing::{self, OPEN, id};
use chefshat_study::Change;
use chefshat_tournament::Tournament;
use chefshat_wire::convert::tournament_plan;

pub use cluster::{Database, FakeStore};
pub use failing::{FailingStore, Read};

use crate::studies::{StoredStudy, StudyHeader, changes_to_bytes};
use crate::tournaments::{StoredTournament, TournamentEntry, TournamentHeader};
use crate::units::{StoredTraces, UnitKey, UnitRow, UnitWrite};
use crate::{Journal, Store, StoreError, StoredGame, units_of};

type Written = Result<(), StoreError>;

/// Tournaments and studies by their types, as tests write and read them.
#[async_trait]
pub trait TypedUnits: Store {
    /// Creates a tournament with these entries as its first row.
    async fn create_tournament(
        &self,
        header: Arc<TournamentHeader>,
        entries: Vec<TournamentEntry>,
    ) -> Written {
        let create = UnitWrite::Create {
            join_code: Some(header.join_code.clone()),
            header: header.to_bytes(),
            first: Some(tournament_row(0, &entries)),
        };
        self.write_unit(UnitKey::Tournament(header.id), create)
            .await
    }

    /// Adds a row to a tournament.
    async fn append_tournament(
        &self,
        tournament: TournamentId,
        row: u64,
        entries: Vec<TournamentEntry>,
    ) -> Written {
        let append = UnitWrite::Append(tournament_row(row, &entries));
        self.write_unit(UnitKey::Tournament(tournament), append)
            .await
    }

    /// The tournaments that are not over, and the newest ones that are.
    async fn tournaments(&self, newest_over: usize) -> Result<Vec<StoredTournament>, StoreError> {
        let mut found = Vec::new();
        for id in units_of(self, newest_over).await? {
            let stored = self.unit(UnitKey::Tournament(id)).await?;
            found.push(StoredTournament::decode(id, &stored.expect("it is there"))?);
        }
        Ok(found)
    }

    /// Creates a study.
    async fn create_study(&self, header: Arc<StudyHeader>) -> Written {
        let create = UnitWrite::Create {
            join_code: None,
            header: header.to_bytes(),
            first: None,
        };
        self.write_unit(UnitKey::Study(header.id), create).await
    }

    /// Adds a row to a study.
    async fn append_study(&self, study: StudyId, row: u64, changes: Vec<Change>) -> Written {
        let append = UnitWrite::Append(UnitRow {
            position: row,
            entries: changes_to_bytes(&changes),
            over: false,
        });
        self.write_unit(UnitKey::Study(study), append).await
    }

    /// Replaces the rows of a study, and deletes traces of participants.
    async fn rewrite_study(
        &self,
        study: StudyId,
        changes: Vec<Change>,
        forgotten: Vec<u32>,
    ) -> Written {
        let rewrite = UnitWrite::Rewrite {
            entries: changes_to_bytes(&changes),
            forgotten,
        };
        self.write_unit(UnitKey::Study(study), rewrite).await
    }

    /// Deletes a study.
    async fn delete_study(&self, study: StudyId) -> Written {
        self.write_unit(UnitKey::Study(study), UnitWrite::Delete)
            .await
    }

    /// Adds interface traces to a study.
    async fn append_traces(&self, study: StudyId, traces: StoredTraces) -> Written {
        self.write_unit(UnitKey::Study(study), UnitWrite::Traces(traces))
            .await
    }

    /// A study.
    async fn study(&self, study: StudyId) -> Result<Option<StoredStudy>, StoreError> {
        let unit = self.unit(UnitKey::Study(study)).await?;
        unit.map(|unit| StoredStudy::decode(study, &unit))
            .transpose()
    }

    /// The ids of all studies.
    async fn studies(&self) -> Result<Vec<StudyId>, StoreError> {
        units_of(self, usize::MAX).await
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

/// Creates a game.
pub async fn begin(
    store: &(impl Store + ?Sized),
    header: &Arc<GameHeader>,
    entries: Vec<Entry>,
) -> Box<dyn Journal> {
    let created = store.create(Arc::clone(header), entries).await;
    created.expect("a new game")
}

/// Ends a game.
pub async fn end(journal: &mut Box<dyn Journal>, summary: Box<v1::RecordSummary>) {
    let ended = journal.finish(Some(summary), None).await;
    ended.expect("committed");
}

/// The entries of a hosted game that has ended.
pub async fn ended(store: &(impl Store + ?Sized), game: GameId) -> Vec<Entry> {
    let stored = store.finished(game).await.expect("readable");
    let Some(StoredGame::Hosted(_, entries, _)) = stored else {
        panic!("not stored: {stored:?}");
    };
    entries.to_vec()
}

/// The header of a game with this number.
pub fn header(game: u8, durability: Durability) -> Arc<GameHeader> {
    let policy = Policy {
        durability,
        ..Policy::default()
    };
    Arc::new(GameHeader {
        room_id: id(game.wrapping_add(200)),
        game_id: id(game),
        name: format!("game {game}"),
        created_at_ms: 1_000,
        join_code: format!("ABCDE{game:03}"),
        ..testing::header(policy, vec![OPEN; 4], RuleSetSpec::default())
    })
}

/// Its summary, once it is over.
pub fn summary(header: &GameHeader) -> Box<v1::RecordSummary> {
    Box::new(v1::RecordSummary {
        game_id: header.game_id.to_string(),
        room_name: header.name.clone(),
        state: v1::RoomState::Finished.into(),
        created_at_ms: header.created_at_ms,
        ended_at_ms: 2_000,
        ..v1::RecordSummary::default()
    })
}

/// The header of a tournament with this number.
pub fn cup(number: u8) -> TournamentHeader {
    TournamentHeader {
        id: id(number),
        settings: v1::TournamentSettings {
            name: "Coppa dello chef".into(),
            format: v1::TournamentFormat::Swiss.into(),
            max_calls: 2,
            ..v1::TournamentSettings::default()
        },
        created_at_ms: 1_700_000_000_000,
        join_code: "ABCDEFGH".into(),
        owner: SecretHash::of(b"owner"),
        deal_secret: [6; 32],
    }
}

/// A tournament as its journal has it.
///
/// # Errors
/// Why this version cannot resume it.
pub fn folded(stored: &StoredTournament) -> Result<Tournament, String> {
    let plan = tournament_plan(&stored.header.settings, [0; 32]);
    let plan = plan.map_err(|problem| problem.to_string())?;
    let mut core = Tournament::new(plan.core).map_err(|problem| problem.to_string())?;
    for entry in &stored.entries {
        if let TournamentEntry::Change(change) = entry {
            core.fold(change);
        }
    }
    Ok(core)
}
