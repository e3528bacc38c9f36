//! The tournaments of a server: creates, finds and resumes them. `chefshat_tournament` decides
//! pairings and results; `task` runs one tournament.

mod by_hand;
mod ended;
mod games;
mod handle;
mod leaderboard;
mod message;
mod shared;
mod state;
mod task;
#[cfg(any(test, feature = "testing"))]
mod testing;
#[cfg(test)]
mod tests;
mod views;

use std::sync::Arc;
use std::time::Duration;

use chefshat_record::pseudonym::{Named, Pseudonym};
use chefshat_tournament::{Change, Entrant, ParticipantKind, SettingsProblem, State, Tournament};
use tokio_util::task::TaskTracker;

pub use handle::{TableProblem, TournamentHandle};
pub use leaderboard::{Leaderboard, finish};
pub use message::{
    BeginRefusal, ByHand, ByHandRefusal, Call, Connection, Entry, JoinRefusal, Newcomer, Who,
};
pub use shared::ComputeError;

pub use crate::journaled::Stopped;

use crate::journaled::{Folded, New, Registry, owner_of};
use crate::rooms::{self, CODES_TRIED, Rooms};
use chefshat_admission::limits::Key;
use chefshat_base::clock::{TimeOfDay, millis, since_epoch_ms};
use chefshat_room::ids::{GameId, RequestKey, TournamentToken, join_code, random_bytes};
use chefshat_store::StoreError;
use chefshat_store::tournaments::{TournamentEntry, TournamentHeader};
use chefshat_wire::convert::{self, TournamentPlan};
use state::{Common, TournamentShared, TournamentState};
use task::TournamentTask;

/// How far ahead the start of a tournament may be set.
const MAX_START_AHEAD: Duration = Duration::from_secs(366 * 24 * 3_600);

/// Why a tournament was not created.
pub type CreateError = rooms::CreateError<SettingsProblem>;

/// The tournaments of a server.
pub type Tournaments = Registry<TournamentTask>;

impl Tournaments {
    /// Creates an empty set. A shutdown waits for the tasks in `tracker`.
    pub fn new(rooms: Arc<Rooms>, tracker: TaskTracker) -> Arc<Self> {
        Self::at(since_epoch_ms, rooms, tracker)
    }

    /// As [`Tournaments::new`], with this clock.
    pub fn at(now: TimeOfDay, rooms: Arc<Rooms>, tracker: TaskTracker) -> Arc<Self> {
        let reading = Default::default();
        Self::empty(rooms, tracker, Common { now, reading })
    }

    /// Creates a tournament. Returns it with its owner token.
    ///
    /// # Errors
    /// See [`CreateError`].
    pub async fn create(
        self: &Arc<Self>,
        name: &str,
        plan: TournamentPlan,
        request: Option<RequestKey>,
        charged: Key,
    ) -> Result<(Arc<TournamentHandle>, TournamentToken), CreateError> {
        let core = Tournament::new(plan.core.clone()).map_err(CreateError::Settings)?;
        let owner = owner_of(request);
        let (tournaments, name) = (Arc::clone(self), name.to_owned());
        let making = async move { tournaments.make(&name, plan, core, owner).await };
        Ok((self.create_once(owner, charged, making).await?, owner))
    }

    async fn make(
        &self,
        name: &str,
        plan: TournamentPlan,
        core: Tournament,
        owner: TournamentToken,
    ) -> Result<New<TournamentTask>, CreateError> {
        let now_ms = (self.common.now)();
        check_start(plan.start_at_ms, now_ms).map_err(CreateError::Settings)?;
        let mut header = TournamentHeader {
            id: owner.subject,
            settings: convert::settings_to_proto(name, &plan),
            created_at_ms: now_ms,
            join_code: join_code(),
            owner: owner.hash(),
            deal_secret: random_bytes(),
        };
        let built_in = built_in(&plan).into_iter().map(Change::Joined);
        let entries: Vec<_> = built_in.map(TournamentEntry::Change).collect();
        let mut codes_left = CODES_TRIED;
        loop {
            match self.store_new(&header, Some(&entries)).await {
                Err(StoreError::Taken(_)) if codes_left > 1 => {
                    codes_left -= 1;
                    header.join_code = join_code();
                }
                stored => break stored?,
            }
        }
        let mut state = TournamentState::new(core);
        entries.iter().for_each(|entry| state.apply(entry));
        let folded = Folded {
            header,
            plan,
            state,
            rows: 1,
        };
        let shared = TournamentShared::default();
        Ok(New { folded, shared })
    }

    /// Whether a tournament has announced a game with this id.
    pub fn has_announced(&self, game: GameId) -> bool {
        let announces = |(_, handle): &(u64, Arc<TournamentHandle>)| {
            handle.committed().announced.contains(&game)
        };
        self.earlier(None).iter().any(announces)
    }

    /// The newest `count` tournaments in this state, or in any; only those created before number
    /// `before`, if set. With their numbers, newest first.
    pub fn newest(
        &self,
        before: Option<u64>,
        state: Option<State>,
        count: usize,
    ) -> Vec<(u64, Arc<TournamentHandle>)> {
        let is_wanted = |handle: &TournamentHandle| {
            state.is_none_or(|state| handle.read(Tournament::state) == state)
        };
        let earlier = self.earlier(before).into_iter();
        let wanted = earlier.filter(|(_, handle)| is_wanted(handle));
        wanted.take(count).collect()
    }

    /// Whether a participant, other than a built-in agent, is in a tournament that is not over.
    pub fn is_playing(&self, who: &Named) -> bool {
        let is_meant =
            |it: &Entrant| it.built_in.is_none() && who.is(&it.name, &it.name_fingerprint);
        let all = self.newest(None, None, usize::MAX);
        all.iter().any(|(_, handle)| {
            !handle.is_over() && handle.read(|core| core.participants().iter().any(is_meant))
        })
    }

    /// Renames a participant in the tournaments in memory that are over. Returns in how many.
    pub async fn forget(&self, who: &Pseudonym) -> u64 {
        let mut count = 0;
        for (_, handle) in self.newest(None, None, usize::MAX) {
            if handle.is_over() && handle.forget(who) {
                handle.shared.follower_update.clear().await;
                handle.shared.results.clear().await;
                count += 1;
            }
        }
        count
    }
}

/// Checks when a new tournament starts by itself.
fn check_start(at_ms: Option<u64>, now_ms: u64) -> Result<(), SettingsProblem> {
    let Some(at_ms) = at_ms else { return Ok(()) };
    let latest = now_ms.saturating_add(millis(MAX_START_AHEAD));
    let problem = match at_ms {
        at_ms if at_ms <= now_ms => "this time has passed; choose a later one, or none",
        at_ms if at_ms > latest => "more than 366 days ahead; choose an earlier time",
        _ => return Ok(()),
    };
    Err(SettingsProblem {
        field: "start_at_ms",
        problem: problem.to_owned(),
    })
}

/// The built-in participants of a tournament, named after their agents, numbered if there are
/// several of one.
fn built_in(plan: &TournamentPlan) -> Vec<Entrant> {
    let mut entrants: Vec<Entrant> = Vec::new();
    for kind in &plan.built_in {
        let same = |other: &&Entrant| other.built_in == Some(*kind);
        let before = entrants.iter().filter(same).count();
        let several = plan.built_in.iter().filter(|other| *other == kind).count() > 1;
        entrants.push(Entrant {
            name: match several {
                true => format!("{kind} {}", before + 1),
                false => kind.name(),
            },
            name_fingerprint: String::new(),
            kind: ParticipantKind::Agent,
            built_in: Some(*kind),
            filler: false,
            stateless: true,
            max_games: chefshat_tournament::MAX_GAMES_AT_A_TIME,
            at_table: false,
        });
    }
    entrants
}
