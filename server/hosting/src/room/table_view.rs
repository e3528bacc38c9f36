//! The state of a physical table for those who attend to it: what is sent, to whom, and the
//! pictures of open questions.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use chefshat_proto::v1::{self, table_report::Kind};
use chefshat_room::Core;
use tokio::sync::watch;

use chefshat_base::clock::millis;
use chefshat_wire::convert;

/// Most streams that follow one table.
const MAX_WATCHERS: usize = 64;

/// The state of a table as it was last sent.
pub type SentState = Arc<v1::TableState>;

/// The physical table of a room.
#[derive(Debug)]
pub(super) struct TableView {
    states: watch::Sender<SentState>,
    /// Pictures of open questions, by their ids. They are not stored.
    pictures: BTreeMap<String, Vec<u8>>,
}

impl TableView {
    /// Creates the view of a table that nobody watches yet.
    pub(super) fn new() -> Self {
        Self {
            states: watch::Sender::default(),
            pictures: BTreeMap::new(),
        }
    }

    /// Keeps the picture of a question while it is open.
    pub(super) fn keep_picture(&mut self, core: &Core, report: v1::TableReport) {
        let open = core.table().map(|table| table.referee().questions());
        let open = open.unwrap_or_default();
        if let Some(Kind::Question(question)) = report.kind
            && !question.picture.is_empty()
        {
            self.pictures.insert(question.question_id, question.picture);
        }
        self.pictures
            .retain(|id, _| open.iter().any(|question| question.id == *id));
    }

    /// The current state.
    pub(super) fn state(&self, core: &Core, now: Duration) -> SentState {
        let mut state = convert::table_state(core, &self.pictures);
        self.states.send_if_modified(|last| {
            state.version = last.version;
            if state == **last {
                return false;
            }
            // Later states have higher versions, also across a restart of the server.
            let elapsed_ms = millis(now);
            state.version = elapsed_ms.max(last.version + 1);
            *last = Arc::new(state);
            true
        });
        Arc::clone(&self.states.borrow())
    }

    /// Sends the state to those who watch, if it has changed.
    pub(super) fn follow(&self, core: &Core, now: Duration) {
        if self.states.receiver_count() > 0 {
            self.state(core, now);
        }
    }

    /// Watches the table from its current state on; `None` if too many do.
    pub(super) fn watch(&self, core: &Core, now: Duration) -> Option<watch::Receiver<SentState>> {
        if self.states.receiver_count() >= MAX_WATCHERS {
            return None;
        }
        self.state(core, now);
        let mut watching = self.states.subscribe();
        watching.mark_changed();
        Some(watching)
    }
}
