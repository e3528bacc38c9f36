//! Deletes studies at the dates of their settings.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use tokio::time::{Instant, MissedTickBehavior, interval, timeout};
use tracing::{info, warn};

use super::{Studies, StudyHandle};
use chefshat_room::ids::Id;

/// Time between two looks at the clock.
const INTERVAL: Duration = Duration::from_secs(600);
/// For how long a date must have passed at every look: a clock may jump ahead and back, and what is
/// deleted stays deleted.
const CERTAIN: Duration = Duration::from_secs(3_600);
/// How long a deletion is waited for. It completes by itself, and another look asks again.
const PATIENCE: Duration = Duration::from_secs(60);

impl Studies {
    /// Deletes each study with all its data, an hour or little more after the date of its settings,
    /// until the future is dropped.
    pub async fn delete_when_due(self: Arc<Self>) {
        let mut looks = interval(INTERVAL);
        looks.set_missed_tick_behavior(MissedTickBehavior::Delay);
        let mut passed_since: BTreeMap<Id, Instant> = BTreeMap::new();
        loop {
            looks.tick().await;
            let passed = self.passed();
            passed_since.retain(|id, _| passed.iter().any(|study| study.id() == *id));
            for study in passed {
                let since = passed_since.entry(study.id()).or_insert_with(|| {
                    info!(study = %study.id(), "the date on which a study is deleted has come");
                    Instant::now()
                });
                if since.elapsed() < CERTAIN {
                    continue;
                }
                let id = study.id();
                match timeout(PATIENCE, self.delete(study, true)).await {
                    Ok(Ok(_)) => {}
                    Ok(Err(_)) => {
                        warn!(study = %id, "a study could not be deleted at its date; it is tried again")
                    }
                    Err(_) => warn!(study = %id, "a study is deleted when its games have ended"),
                }
            }
        }
    }

    /// The studies whose dates have passed.
    fn passed(&self) -> Vec<Arc<StudyHandle>> {
        let now_ms = (self.common.now)();
        let studies = self.earlier(None).into_iter().map(|(_, study)| study);
        let is_due = |study: &Arc<StudyHandle>| {
            study.read(|core| {
                core.settings()
                    .deletes_at_ms
                    .is_some_and(|at_ms| at_ms <= now_ms)
            })
        };
        studies.filter(is_due).collect()
    }
}
