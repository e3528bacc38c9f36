//! Commands that wait for a seat to be attached, or to be sent to another node. They have been decoded,
//! and what they wait for may be slow, so they keep a share of the memory for that.

use std::sync::Arc;

use chefshat_proto::v1::seat_command::Command;
use tokio::time::Instant;

use chefshat_admission::limits::{FairSemaphore, Key, Permit, Shares};

/// Memory of the commands that wait.
pub const MAX_WAITING_MEMORY: usize = 64 << 20;
/// A command takes at most as many times the bytes of its message: a map of short texts does.
const DECODED: usize = 16;
/// What the shortest command takes.
const LEAST: usize = 256;

/// The memory of commands that wait, of which one caller has a share.
#[derive(Debug, Clone)]
pub(super) struct WaitingMemory {
    memory: Arc<FairSemaphore>,
    key: Key,
}

/// A command that waits.
#[derive(Debug)]
pub(super) struct WaitingCommand {
    pub(super) command: Option<Command>,
    pub(super) arrived: Instant,
    _memory: Permit,
}

impl WaitingMemory {
    /// The memory for all callers.
    pub(super) fn for_all(shares: Shares) -> Arc<FairSemaphore> {
        FairSemaphore::new(MAX_WAITING_MEMORY, shares)
    }

    /// That of a caller on this machine.
    #[cfg(test)]
    pub(super) fn for_tests() -> Self {
        Self::of(&Self::for_all(Shares::default()), Key::Local)
    }

    /// The share of a caller.
    pub(super) fn of(memory: &Arc<FairSemaphore>, key: Key) -> Self {
        Self {
            memory: Arc::clone(memory),
            key,
        }
    }

    /// Takes a command to let it wait, unless its caller's share is used up.
    pub(super) fn hold(
        &self,
        command: &mut Option<Command>,
        arrived: Instant,
    ) -> Option<WaitingCommand> {
        let bytes = memory_of(command.as_ref().map_or(0, Command::encoded_len));
        let memory = self.memory.try_take_many(self.key, bytes)?;
        Some(WaitingCommand {
            command: command.take(),
            arrived,
            _memory: memory,
        })
    }

    /// Takes memory for a command of this length, as soon as the caller's share has it.
    pub(super) async fn take(&self, encoded_len: usize) -> Permit {
        self.memory
            .take_many(self.key, memory_of(encoded_len))
            .await
    }
}

fn memory_of(encoded_len: usize) -> usize {
    (DECODED * encoded_len).max(LEAST)
}

#[cfg(test)]
mod tests {
    use chefshat_proto::v1::{Annotations, Answer};

    use super::*;

    #[test]
    fn the_commands_of_a_caller_take_no_more_memory_than_its_share() {
        let memory = WaitingMemory::for_all(Shares::default());
        let one = WaitingMemory::of(&memory, Key::Local);
        let command = || {
            let extra = (0..1_000).map(|number| (number.to_string(), String::new()));
            let annotations = Annotations {
                extra: extra.collect(),
                ..Annotations::default()
            };
            Some(Command::Answer(Answer {
                annotations: Some(annotations),
                ..Answer::default()
            }))
        };
        let hold = |waiting: &WaitingMemory| waiting.hold(&mut command(), Instant::now());
        let mut held: Vec<WaitingCommand> = std::iter::from_fn(|| hold(&one)).collect();
        let bytes = DECODED * command().as_ref().map_or(0, Command::encoded_len);
        assert_eq!(held.len(), MAX_WAITING_MEMORY / 2 / bytes);
        // It is not lost.
        let mut left = command();
        assert!(one.hold(&mut left, Instant::now()).is_none() && left.is_some());
        let other = WaitingMemory::of(&memory, Key::Address([192, 0, 2, 1].into()));
        assert!(hold(&other).is_some());
        held.pop();
        assert!(hold(&one).is_some());
    }
}
