//! Deletes studies at the dates of their settings.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use futures::{StreamExt as _, future, stream};
use tokio::time::{Instant, MissedTickBehavior, interval, timeout};
use tracing::{info, warn};

use super::{Studies, StudyHandle};
use chefshat_room::ids::StudyId;

/// Time between two checks of the dates.
const CHECK_INTERVAL: Duration = Duration::from_secs(600);
/// For how long a date must have passed at every check: a clock may jump ahead and back, and what is
/// deleted stays deleted.
const CONFIRMATION_TIME: Duration = Duration::from_secs(3_600);
/// Studies that are deleted at a time.
const DELETED_AT_ONCE: usize = 4;
/// How long each is waited for.
const DELETION_TIMEOUT: Duration = Duration::from_secs(60);
const _: () = assert!(
    CONFIRMATION_TIME.as_secs() + 2 * CHECK_INTERVAL.as_secs() < 2 * 3_600,
    "the page and the protocol say that it takes two hours at most"
);

/// A study whose date has passed.
#[derive(Debug)]
struct Passed {
    since: Instant,
    /// The study whose deletion was requested; it completes when its games have ended. One that was
    /// resumed since is another, which knows of no request.
    requested: Option<Arc<StudyHandle>>,
}

impl Studies {
    /// Deletes each study with all its data when the date of its settings has passed for an hour or
    /// little more, until the future is dropped.
    pub async fn delete_when_due(self: Arc<Self>) {
        let mut checks = interval(CHECK_INTERVAL);
        checks.set_missed_tick_behavior(MissedTickBehavior::Delay);
        let mut passed: BTreeMap<StudyId, Passed> = BTreeMap::new();
        loop {
            checks.tick().await;
            let studies = self.past_their_dates();
            passed.retain(|id, _| studies.iter().any(|study| study.id() == *id));
            let mut due = Vec::new();
            for study in studies {
                let it = passed.entry(study.id()).or_insert_with(|| {
                    info!(study = %study.id(), "the date at which a study is deleted has come");
                    let since = Instant::now();
                    Passed {
                        since,
                        requested: None,
                    }
                });
                let is_requested = it
                    .requested
                    .as_ref()
                    .is_some_and(|it| Arc::ptr_eq(it, &study));
                if it.since.elapsed() >= CONFIRMATION_TIME && !is_requested {
                    it.requested = Some(Arc::clone(&study));
                    due.push(study);
                }
            }
            let deleting = due.into_iter().map(|study| async {
                let id = study.id();
                match timeout(DELETION_TIMEOUT, self.delete(study, true)).await {
                    Ok(Ok(_)) => None,
                    Ok(Err(_)) => {
                        warn!(study = %id, "a study could not be deleted at its date; it is tried again");
                        Some(id)
                    }
                    Err(_) => {
                        warn!(study = %id, "a study is deleted as soon as its games have ended");
                        None
                    }
                }
            });
            let deleting = stream::iter(deleting).buffer_unordered(DELETED_AT_ONCE);
            let failed: Vec<StudyId> = deleting.filter_map(future::ready).collect().await;
            for id in failed {
                passed.entry(id).and_modify(|it| it.requested = None);
            }
        }
    }

    /// The studies whose dates have passed.
    fn past_their_dates(&self) -> Vec<Arc<StudyHandle>> {
        let now_ms = (self.common.now)();
        let studies = self.earlier(None).into_iter().map(|(_, study)| study);
        let is_past = |study: &Arc<StudyHandle>| {
            let at_ms = study.read(|core| core.settings().deletes_at_ms);
            at_ms.is_some_and(|at_ms| at_ms <= now_ms)
        };
        studies.filter(is_past).collect()
    }
}
