//! The messages that the reader of a stream executes: those of clients, and those of other nodes for
//! the clients that are connected there.

use std::time::Duration;

use chefshat_proto::v1::{self, seat_command::Command};
use tokio::time::Instant;
use tonic::{Code, Status};

use super::reader::{Reader, Requests};
use crate::grpc::status::status;
use chefshat_hosting::room::{Loss, SeatAction};
use chefshat_room::Answer;
use chefshat_wire::convert;
use chefshat_wire::encoded::peer::{HandedOver, PlayInput, PlayRequest, play_input::Input};

/// Most commands in one message.
const MAX_COMMANDS_PER_MESSAGE: usize = 1_024;

impl Requests for v1::PlayRequest {
    async fn execute(self, reader: &mut Reader, arrived: Instant) -> Result<(), Status> {
        // A flood of messages without commands, too, must not hold the thread.
        tokio::task::consume_budget().await;
        if self.commands.len() > MAX_COMMANDS_PER_MESSAGE {
            return Err(status(
                Code::InvalidArgument,
                "TOO_MANY_COMMANDS",
                format!("a message contains at most {MAX_COMMANDS_PER_MESSAGE} commands"),
                [("field", "commands")],
            ));
        }
        // The rooms of a message for several seats work in parallel instead.
        let in_place = self.commands.len() == 1;
        for command in self.commands {
            reader.execute(command, arrived, in_place).await;
        }
        Ok(())
    }
}

impl Requests for PlayRequest {
    async fn execute(self, reader: &mut Reader, arrived: Instant) -> Result<(), Status> {
        if self.first_assigned_handle > 0 {
            reader.first_called = self.first_assigned_handle;
            reader.next_called = self.first_assigned_handle;
        }
        reader.asks_gateway |= self.answers_contested;
        if self.announces_left {
            reader.loss = Loss::WithNode;
        }
        let in_place = self.inputs.len() == 1;
        for PlayInput {
            mut input,
            elapsed_us,
        } in self.inputs
        {
            tokio::task::consume_budget().await;
            if let Some(Input::Command(command)) = &mut input
                && reader.hold_back(command, arrived)
            {
                continue;
            }
            match input {
                Some(Input::StillOpen(handle)) => Box::pin(reader.still_open(handle)).await,
                Some(Input::Command(mut command)) => match command.command.take() {
                    Some(Command::Attach(attach)) => {
                        Box::pin(reader.attach_as(command.handle, attach)).await;
                    }
                    Some(Command::Answer(answer)) => {
                        let measured = elapsed_us.map(Duration::from_micros);
                        let answer = Answer {
                            measured,
                            ..convert::answer_from_proto(answer)
                        };
                        let left = match reader.seats.get(&command.handle) {
                            Some(bound) => bound.answer_now(answer, arrived, in_place).err(),
                            None => Some(answer),
                        };
                        if let Some(answer) = left {
                            let action = SeatAction::Answer(answer);
                            Box::pin(reader.perform(command.handle, action, arrived)).await;
                        }
                    }
                    other => {
                        Box::pin(reader.execute_command(command.handle, other, arrived)).await;
                    }
                },
                Some(Input::HandedOver(HandedOver {
                    handle,
                    decision_id,
                })) => {
                    if let Some(bound) = reader.seats.get(&handle) {
                        bound.stamp.report(decision_id, arrived);
                    }
                }
                None => {}
            }
        }
        if self.left {
            reader.loss = Loss::Gone;
        }
        Ok(())
    }
}
