//! What the examiner has seen of each stream, seat and decision. The other files of this module
//! interpret it.

use std::collections::{BTreeMap, BTreeSet};

use chefshat_proto::v1;

/// Decisions of a seat that are remembered.
const REMEMBERED: usize = 64;

/// A seat of a room.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct SeatKey {
    pub(super) room_id: String,
    pub(super) seat: u32,
}

/// A requested attachment.
#[derive(Debug)]
pub(super) struct RequestedAttach {
    pub(super) ticket: String,
    pub(super) no_mask: bool,
}

/// One Play stream.
#[derive(Debug, Default)]
pub(super) struct StreamSeen {
    /// Requested attachments; each takes the next handle.
    pub(super) attachments: u32,
    /// Those without an answer yet, by handle.
    pub(super) requested: BTreeMap<u32, RequestedAttach>,
    /// The seat behind each handle, once attached.
    pub(super) bound: BTreeMap<u32, SeatKey>,
    /// Handles of seats that have been detached.
    pub(super) ended: BTreeSet<u32>,
    /// The examiner has cut it.
    pub(super) cut: bool,
    /// The agent has left it, or it has ended.
    pub(super) closed: bool,
}

impl StreamSeen {
    /// Whether a handle is valid. The handle of an attachment is known before its answer.
    pub(super) fn knows(&self, handle: u32) -> bool {
        handle < self.attachments
            || self.bound.contains_key(&handle)
            || self.ended.contains(&handle)
    }
}

/// The state of a decision, as the agent knows it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum DecisionState {
    /// Requested and not answered.
    Open,
    /// Answered, without a result yet.
    Answered,
    /// Answered illegally; another answer is due.
    Refused,
    /// The answer was accepted.
    Taken,
    /// Closed without the agent's answer.
    Closed,
}

/// A decision requested from the agent.
#[derive(Debug)]
pub(super) struct DecisionSeen {
    pub(super) kind: v1::DecisionKind,
    pub(super) mask: Vec<u8>,
    pub(super) state: DecisionState,
    /// The examiner interfered: losses caused by it are not the agent's fault.
    pub(super) tampered: bool,
    /// The examiner's action, sent in place of the agent's, and the agent's.
    pub(super) swapped: Option<(u32, u32)>,
    /// The agent's answer, held back.
    pub(super) held: Option<v1::Answer>,
    /// The agent has received the result CLOSED.
    pub(super) closed_received: bool,
    /// Answers after that.
    pub(super) after_closed: u32,
    /// It timed out, and that has been recorded.
    pub(super) lost_noted: bool,
}

impl DecisionSeen {
    pub(super) fn is_legal(&self, action: u32) -> bool {
        let byte = usize::try_from(action / 8).unwrap_or(usize::MAX);
        let bits = self.mask.get(byte).copied().unwrap_or_default();
        bits >> (action % 8) & 1 == 1
    }

    pub(super) fn legal_count(&self) -> u32 {
        self.mask.iter().map(|byte| byte.count_ones()).sum()
    }
}

/// A seat, over all streams.
#[derive(Debug, Default)]
pub(super) struct SeatSeen {
    /// Number of the last event forwarded.
    pub(super) last_event: u64,
    /// It belongs to the case.
    pub(super) own: bool,
    /// Events below this number happened before the seat was last attached.
    pub(super) live_from: u64,
    /// Number of actions; 0 until the game has started.
    pub(super) actions: u32,
    /// The last decisions requested, by number.
    pub(super) decisions: BTreeMap<u64, DecisionSeen>,
    /// Kinds of decisions requested.
    pub(super) kinds: BTreeSet<i32>,
    /// The agent wants no masks.
    pub(super) no_mask: bool,
    /// Newest decision when the agent learned that a held-back answer was too late.
    pub(super) read_after: u64,
    /// Decisions that were the agent's to take, and are over.
    pub(super) taken: u32,
    /// Decisions that it lost to the clock.
    pub(super) lost: u32,
    /// Answers that came after the time of their decision.
    pub(super) late: u32,
    /// It has received the end of the game.
    pub(super) over: bool,
}

impl SeatSeen {
    pub(super) fn learn(&mut self, started: &v1::GameStarted) {
        if let Some(space) = &started.action_space {
            self.actions = space.size;
        }
    }

    /// Records a decision request, the first or a repeated one.
    pub(super) fn decision_requested(&mut self, request: &v1::DecisionRequest) {
        self.kinds.insert(request.kind);
        let seen = self
            .decisions
            .entry(request.decision_id)
            .or_insert_with(|| DecisionSeen {
                kind: request.kind(),
                mask: request.action_mask.clone(),
                state: DecisionState::Open,
                tampered: false,
                swapped: None,
                held: None,
                closed_received: false,
                after_closed: 0,
                lost_noted: false,
            });
        seen.state = DecisionState::Open;
        while self.decisions.len() > REMEMBERED {
            self.decisions.pop_first();
        }
    }

    /// Number of the newest decision requested, or 0.
    pub(super) fn newest(&self) -> u64 {
        self.decisions.last_key_value().map_or(0, |(id, _)| *id)
    }
}
