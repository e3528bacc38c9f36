//! What the examiner has seen of each stream, seat and decision. What it makes of it is decided in the files beside this.

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

/// An attachment that was asked for.
#[derive(Debug)]
pub(super) struct Asked {
    pub(super) ticket: String,
    pub(super) no_mask: bool,
}

/// One Play stream.
#[derive(Debug, Default)]
pub(super) struct StreamSeen {
    /// Attachments asked for: each has the next handle.
    pub(super) attachments: u32,
    /// Those not yet answered, by handle.
    pub(super) asked: BTreeMap<u32, Asked>,
    /// The seat behind each handle, once attached.
    pub(super) bound: BTreeMap<u32, SeatKey>,
    /// Handles of seats that have been detached.
    pub(super) ended: BTreeSet<u32>,
    /// The examiner broke it off.
    pub(super) cut: bool,
    /// The agent has left it, or it has ended.
    pub(super) closed: bool,
}

impl StreamSeen {
    /// Whether a handle means anything here. That of an attachment is known before it is answered.
    pub(super) fn knows(&self, handle: u32) -> bool {
        handle < self.attachments
            || self.bound.contains_key(&handle)
            || self.ended.contains(&handle)
    }
}

/// How a decision stands, as far as the agent has been told and has said.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Stand {
    /// Put, and not answered.
    Open,
    /// Answered, without a result yet.
    Answered,
    /// Answered illegally: to be answered again.
    Refused,
    /// The answer was taken.
    Taken,
    /// Closed without the agent's answer.
    Closed,
}

/// A decision that was put to the agent.
#[derive(Debug)]
pub(super) struct DecisionSeen {
    pub(super) kind: v1::DecisionKind,
    pub(super) mask: Vec<u8>,
    pub(super) stand: Stand,
    /// The examiner interfered: what is lost with it is not the agent's fault.
    pub(super) tampered: bool,
    /// The examiner's own action, sent in place of the agent's, and that.
    pub(super) swapped: Option<(u32, u32)>,
    /// The agent's answer that is held back.
    pub(super) held: Option<v1::Answer>,
    /// The agent has been told that it is closed.
    pub(super) closed_told: bool,
    /// Answers that came after that.
    pub(super) after_closed: u32,
    /// It was lost, and that has been noted.
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

/// One seat, over all streams.
#[derive(Debug, Default)]
pub(super) struct SeatSeen {
    /// Number of the last event passed on.
    pub(super) last_event: u64,
    /// It belongs to the case.
    pub(super) own: bool,
    /// Events below this number happened before the seat was last attached.
    pub(super) live_from: u64,
    /// Number of actions; 0 until the game has begun.
    pub(super) actions: u32,
    /// The last so many decisions put, by number.
    pub(super) decisions: BTreeMap<u64, DecisionSeen>,
    /// Kinds of decisions put.
    pub(super) kinds: BTreeSet<i32>,
    /// The agent wants no masks.
    pub(super) no_mask: bool,
    /// Newest decision when the agent was told that an answer held back was too late.
    pub(super) read_after: u64,
    /// Decisions that were the agent's to take, and came to an end.
    pub(super) taken: u32,
    /// Decisions that it lost to the clock.
    pub(super) lost: u32,
    /// It has been told that the game is over.
    pub(super) over: bool,
}

impl SeatSeen {
    pub(super) fn learn(&mut self, started: &v1::GameStarted) {
        if let Some(space) = &started.action_space {
            self.actions = space.size;
        }
    }

    /// Notes a decision that is put, for the first time or again.
    pub(super) fn put(&mut self, request: &v1::DecisionRequest) {
        self.kinds.insert(request.kind);
        let seen = self
            .decisions
            .entry(request.decision_id)
            .or_insert_with(|| DecisionSeen {
                kind: request.kind(),
                mask: request.action_mask.clone(),
                stand: Stand::Open,
                tampered: false,
                swapped: None,
                held: None,
                closed_told: false,
                after_closed: 0,
                lost_noted: false,
            });
        seen.stand = Stand::Open;
        while self.decisions.len() > REMEMBERED {
            self.decisions.pop_first();
        }
    }

    /// Number of the newest decision put, or 0.
    pub(super) fn newest(&self) -> u64 {
        self.decisions.last_key_value().map_or(0, |(id, _)| *id)
    }
}
