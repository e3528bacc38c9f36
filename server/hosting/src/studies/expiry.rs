//! Deletes studies at the dates of their settings.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use futures::{StreamExt as _, future, stream};
use tokio::task::JoinHandle;
use tokio::time::{MissedTickBehavior, interval, timeout};
use tracing::{info, warn};

use super::{Studies, StudyHandle};
use crate::confirmed_time::{CONFIRMATION_TIME, ConfirmedTime};
use chefshat_base::tasks::short;
use chefshat_room::ids::StudyId;

/// Time between two checks of the dates.
const CHECK_INTERVAL: Duration = Duration::from_secs(600);
/// Studies that are deleted at a time.
const DELETED_AT_ONCE: usize = 4;
/// How long each is waited for.
const DELETION_TIMEOUT: Duration = Duration::from_secs(60);
const _: () = assert!(
    CONFIRMATION_TIME.as_secs() + 2 * CHECK_INTERVAL.as_secs() < 2 * 3_600,
    "the page and the protocol say that it takes two hours at most"
);

impl Studies {
    /// Deletes each study with all its data when the date of its settings has passed for an hour or
    /// little more, until the future is dropped.
    pub async fn delete_when_due(self: Arc<Self>) {
        let mut checks = interval(CHECK_INTERVAL);
        checks.set_missed_tick_behavior(MissedTickBehavior::Delay);
        let mut time = ConfirmedTime::default();
        // Deletions that wait for the ends of games.
        let mut waiting: BTreeMap<StudyId, JoinHandle<()>> = BTreeMap::new();
        loop {
            checks.tick().await;
            // A study that is still there was not deleted, or was resumed since: it is tried again.
            waiting.retain(|_, deleting| !deleting.is_finished());
            let Some(now_ms) = time.look((self.common.now)()) else {
                continue;
            };
            let mut due = self.past_their_dates(now_ms);
            due.retain(|study| !waiting.contains_key(&study.id()));
            let deleting = due.into_iter().map(|study| async {
                let id = study.id();
                let mut deleting = tokio::spawn(short(
                    "one tournament or study",
                    Arc::clone(&self).delete_at_date(study),
                ));
                if timeout(DELETION_TIMEOUT, &mut deleting).await.is_ok() {
                    return None;
                }
                warn!(study = %id, "a study is deleted as soon as its games have ended");
                Some((id, deleting))
            });
            let deleting = stream::iter(deleting).buffer_unordered(DELETED_AT_ONCE);
            let unfinished: Vec<_> = deleting.filter_map(future::ready).collect().await;
            waiting.extend(unfinished);
        }
    }

    async fn delete_at_date(self: Arc<Self>, study: Arc<StudyHandle>) {
        let id = study.id();
        info!(study = %id, "the date of a study has passed for an hour; it is deleted");
        if self.delete(study, true).await.is_err() {
            warn!(study = %id, "a study could not be deleted at its date; it is tried again");
        }
    }

    /// The studies whose dates had passed at this time.
    fn past_their_dates(&self, now_ms: u64) -> Vec<Arc<StudyHandle>> {
        let studies = self.earlier(None).into_iter().map(|(_, study)| study);
        let is_past = |study: &Arc<StudyHandle>| {
            let at_ms = study.read(|core| core.settings().deletes_at_ms);
            at_ms.is_some_and(|at_ms| at_ms <= now_ms)
        };
        studies.filter(is_past).collect()
    }
}
