//! Where a room rests while its task waits, and how the reader of a stream handles an answer there.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Mutex, MutexGuard};

use chefshat_engine::Seat;
use chefshat_room::{Answer, ConnectionId};
use tokio::sync::mpsc;
use tokio::time::Instant;
use tracing::error;

use super::message::Message;
use super::task::Room;

/// Holds the state of a room while its task waits. Meanwhile the reader of a stream may handle an
/// answer in place, which saves a message and waking the task: a large part of the cost of a
/// decision.
#[derive(Default)]
pub(super) struct Resting(Mutex<Option<Box<Room>>>);

impl Resting {
    pub(super) fn lock(&self) -> MutexGuard<'_, Option<Box<Room>>> {
        self.0
            .lock()
            .expect("nothing that holds this lock can panic")
    }

    /// Handles an answer in place and returns whether the task must be woken. Returns the answer if
    /// the task is running, if the room does not handle answers in place, or if messages wait in
    /// `mailbox`, which come first.
    pub(super) fn answer(
        &self,
        mailbox: &mpsc::Sender<Message>,
        (seat, connection): (Seat, ConnectionId),
        answer: Answer,
        arrived: Instant,
    ) -> Result<bool, Answer> {
        let Ok(mut resting) = self.0.try_lock() else {
            return Err(answer);
        };
        let is_first = mailbox.capacity() == mailbox.max_capacity();
        let Some(mut room) = resting.take_if(|room| is_first && room.answers_in_place) else {
            return Err(answer);
        };
        // A panic ends the room, but not the stream of a reader that may have seats in other rooms.
        let answered = catch_unwind(AssertUnwindSafe(move || {
            let needs_task = room.answer_in_place(seat, connection, answer, arrived);
            (room, needs_task)
        }));
        match answered {
            Ok((room, needs_task)) => {
                *resting = Some(room);
                Ok(needs_task)
            }
            Err(_) => {
                error!("a room panicked and is gone");
                Ok(true)
            }
        }
    }
}
