//! The tickets of one connection: what is attached on each stream, from which event each seat
//! resumes, whose handle is whose, and how a ticket ends. No stream, no clock and no decisions:
//! `session` plays the seats with agents, `ticket_follower` passes their updates on.

use std::collections::{BTreeMap, BTreeSet};

use prost::Message as _;

use crate::v1::game_event::Kind;
use crate::v1::seat_command::Command;
use crate::v1::{self, seat_update::Update};
use crate::{Error, PlayError};

/// Maximum number of commands in a message.
pub(crate) const MAX_COMMANDS: usize = 1024;
/// Requests are split at this size; servers accept 64 KiB per message.
pub(crate) const MAX_REQUEST_BYTES: usize = 32 * 1024;
/// Upper bound of a command's overhead in its message: a tag and a length.
const COMMAND_OVERHEAD_BYTES: usize = 6;
/// Number of the first seat.
pub(crate) const FIRST_SEAT: u32 = 1;
/// Number of a ticket that may be a tournament participant's, after those of its seats.
pub(crate) const PARTICIPANT: u32 = u32::MAX;

/// A seat or a participant, from its ticket to its end, across any number of connections.
#[derive(Debug)]
struct Ticket {
    ticket: String,
    /// The contribution to the seed; one for all games of a participant, as in the protocol.
    entropy: Vec<u8>,
    /// The game it was last attached to; empty before the first attachment.
    game_id: String,
    /// Number of the next event.
    next_event: u64,
    /// The result of the game is known.
    ended: bool,
    /// It has entered a tournament.
    entered: bool,
    /// Its handle on the current stream.
    handle: Option<u32>,
}

/// What an update says about a ticket.
#[derive(Debug)]
#[allow(
    clippy::large_enum_variant,
    reason = "each is handled at once and not kept"
)]
pub(crate) enum TicketEvent {
    /// The participant is in its tournament.
    Entered(v1::Entered),
    /// The seat is attached: of a ticket that was added, or of a participant's game.
    Attached(v1::Attached),
    /// An update for the seat: events that are new, never an attachment or its end.
    Update(Update),
    /// The ticket is settled and removed: the game with this id has a result, or the tournament is
    /// over, unless there is an error.
    Over(String, Result<(), PlayError>),
}

/// The tickets of a connection that are in play, by number: the request id of their attachments.
#[derive(Debug)]
pub(crate) struct Tickets {
    tickets: BTreeMap<u32, Ticket>,
    next_number: u32,
    delivery: v1::EventDelivery,
    no_mask: bool,
    /// The ticket of each handle of the current stream.
    by_handle: BTreeMap<u32, u32>,
    /// Games whose results are known.
    played: BTreeSet<String>,
    /// Handles of seats whose games have already been played, and of participants in place of seats,
    /// and whether they still have to be detached. Their updates are ignored.
    ignored: BTreeMap<u32, bool>,
    progress: bool,
}

impl Tickets {
    pub(crate) fn new(delivery: v1::EventDelivery, no_mask: bool) -> Self {
        Self {
            tickets: BTreeMap::new(),
            next_number: FIRST_SEAT,
            delivery,
            no_mask,
            by_handle: BTreeMap::new(),
            played: BTreeSet::new(),
            ignored: BTreeMap::new(),
            progress: false,
        }
    }

    /// Adds the ticket of a seat and returns its number.
    pub(crate) fn add(&mut self, ticket: String, entropy: Vec<u8>) -> u32 {
        let number = self.next_number;
        self.next_number += 1;
        self.insert(number, ticket, entropy);
        number
    }

    /// Adds the one ticket that may be a participant's, as number [`PARTICIPANT`].
    pub(crate) fn add_participant(&mut self, ticket: String, entropy: Vec<u8>) {
        self.insert(PARTICIPANT, ticket, entropy);
    }

    fn insert(&mut self, number: u32, ticket: String, entropy: Vec<u8>) {
        let ticket = Ticket {
            ticket,
            entropy,
            game_id: String::new(),
            next_event: 1,
            ended: false,
            entered: false,
            handle: None,
        };
        self.tickets.insert(number, ticket);
    }

    /// Whether all tickets are settled.
    pub(crate) fn is_empty(&self) -> bool {
        self.tickets.is_empty()
    }

    /// Gives up all tickets.
    pub(crate) fn clear(&mut self) {
        self.tickets.clear();
    }

    /// The handle of a ticket on the current stream.
    pub(crate) fn handle(&self, number: u32) -> Option<u32> {
        self.tickets.get(&number)?.handle
    }

    /// The handle of the seat in a game on the current stream.
    pub(crate) fn handle_in(&self, game_id: &str) -> Option<u32> {
        let mut tickets = self.tickets.values();
        tickets.find(|ticket| ticket.game_id == game_id)?.handle
    }

    /// The game of a ticket; empty if it is not known yet.
    pub(crate) fn game_id(&self, number: u32) -> &str {
        let ticket = self.tickets.get(&number);
        ticket.map_or("", |ticket| &ticket.game_id)
    }

    /// The contribution of a ticket to the seed.
    pub(crate) fn entropy(&self, number: u32) -> Vec<u8> {
        let ticket = self.tickets.get(&number);
        ticket.map_or_else(Vec::new, |ticket| ticket.entropy.clone())
    }

    /// Whether there were new events since the last call.
    pub(crate) fn take_progress(&mut self) -> bool {
        std::mem::take(&mut self.progress)
    }

    /// The first requests of a new stream: attach every ticket in play. The seats of a participant
    /// come before the participant, each with its own ticket, to resume after the last event seen
    /// and to receive results of games that ended meanwhile. The server keeps these attachments.
    pub(crate) fn attach(&mut self) -> Vec<v1::PlayRequest> {
        self.by_handle.clear();
        self.ignored.clear();
        let commands = self.tickets.iter_mut().map(|(&request_id, ticket)| {
            ticket.handle = None;
            let attach = v1::Attach {
                ticket: ticket.ticket.clone(),
                request_id,
                from_sequence: ticket.next_event,
                snapshot: false,
                delivery: self.delivery.into(),
                no_mask: self.no_mask,
                entropy: ticket.entropy.clone(),
            };
            command(0, Command::Attach(attach))
        });
        pack(commands.collect())
    }

    /// The commands that detach what is ignored.
    pub(crate) fn detach(&mut self) -> Vec<v1::SeatCommand> {
        let attached = self.ignored.iter_mut().filter(|(_, attached)| **attached);
        let detach = attached.map(|(&handle, attached)| {
            *attached = false;
            command(handle, Command::Detach(v1::Detach {}))
        });
        detach.collect()
    }

    /// Handles the loss of a stream. Returns the numbers of the tickets whose results are known,
    /// which are settled.
    pub(crate) fn disconnected(&mut self) -> Vec<u32> {
        let ended = self.tickets.extract_if(.., |_, ticket| ticket.ended);
        let settled = ended.map(|(number, ticket)| {
            self.played.insert(ticket.game_id);
            number
        });
        settled.collect()
    }

    /// Handles an update: the number of its ticket and what is new. `None` for what is known
    /// already, and for handles and numbers of no ticket.
    pub(crate) fn take(&mut self, update: v1::SeatUpdate) -> Option<(u32, TicketEvent)> {
        let handle = update.handle;
        match update.update? {
            Update::Attached(attached) => {
                let number = self.attached(handle, &attached)?;
                Some((number, TicketEvent::Attached(attached)))
            }
            Update::Entered(entered) => {
                let Some(participant) = self.tickets.get_mut(&PARTICIPANT) else {
                    // Nobody plays the games of a participant whose ticket was given as a seat's.
                    self.ignored.insert(handle, true);
                    let error = PlayError::Refused(Error::ticket_of_participant());
                    return self.settle(entered.request_id, Err(error));
                };
                participant.entered = true;
                self.assign(handle, PARTICIPANT);
                Some((PARTICIPANT, TicketEvent::Entered(entered)))
            }
            Update::Refused(refused) if refused.request_id != 0 => {
                let number = refused.request_id;
                let ticket = self.tickets.get(&number)?;
                // The server may have attached the seat meanwhile, with its participant.
                if ticket.handle.is_some() && number != PARTICIPANT {
                    return None;
                }
                let error = PlayError::Refused(Error::refused(refused));
                self.settle(number, Err(error))
            }
            update => self.seat_update(handle, update),
        }
    }

    /// Finds the ticket of an attachment: one that was requested, or one of a tournament's game,
    /// which may be new.
    fn attached(&mut self, handle: u32, attached: &v1::Attached) -> Option<u32> {
        let requested = attached.request_id;
        let number = if self.tickets.contains_key(&requested) {
            requested
        } else if self.played.contains(&attached.game_id) {
            // It ended on a connection that was lost before the server could count it.
            self.ignored.insert(handle, true);
            return None;
        } else if requested != 0 {
            return None;
        } else {
            self.of_participant(attached)?
        };
        let ticket = self.tickets.get_mut(&number)?;
        ticket.game_id.clone_from(&attached.game_id);
        self.assign(handle, number);
        Some(number)
    }

    /// The seat of a participant's game.
    fn of_participant(&mut self, attached: &v1::Attached) -> Option<u32> {
        let mut tickets = self.tickets.iter();
        let known = tickets.find(|(_, ticket)| ticket.game_id == attached.game_id);
        if let Some((&number, _)) = known {
            return Some(number);
        }
        let participant = self.tickets.get(&PARTICIPANT).filter(|it| it.entered)?;
        let entropy = participant.entropy.clone();
        Some(self.add(attached.ticket.clone(), entropy))
    }

    /// The newest handle of a ticket replaces older ones, whose updates are ignored.
    fn assign(&mut self, handle: u32, number: u32) {
        let ticket = self.tickets.get_mut(&number);
        let older = ticket.and_then(|ticket| ticket.handle.replace(handle));
        if let Some(older) = older {
            self.by_handle.remove(&older);
        }
        self.by_handle.insert(handle, number);
    }

    fn seat_update(&mut self, handle: u32, mut update: Update) -> Option<(u32, TicketEvent)> {
        if self.ignored.contains_key(&handle) {
            return None;
        }
        let number = self.by_handle.get(&handle).copied();
        let Some((number, ticket)) =
            number.and_then(|number| Some((number, self.tickets.get_mut(&number)?)))
        else {
            tracing::warn!(handle, "update for a seat that is not attached");
            return None;
        };
        match &mut update {
            Update::Detached(detached) => {
                use v1::DetachReason::{GameOver, ServerStopping, Superseded, TournamentOver};
                let end = match detached.reason() {
                    // The end of the stream follows; tickets are attached again on the next one.
                    ServerStopping => return None,
                    _ if ticket.ended => Ok(()),
                    TournamentOver if ticket.entered => Ok(()),
                    GameOver => Err(PlayError::EndingUnknown),
                    Superseded => Err(PlayError::Superseded),
                    _ => Err(PlayError::Detached),
                };
                return self.settle(number, end);
            }
            _ if ticket.entered => return None,
            Update::Events(batch) => {
                ticket.take_new(batch);
                if batch.events.is_empty() {
                    return None;
                }
                self.progress = true;
            }
            Update::Snapshot(snapshot) => {
                ticket.next_event = ticket.next_event.max(snapshot.next_sequence);
                self.progress = true;
            }
            _ => {}
        }
        Some((number, TicketEvent::Update(update)))
    }

    fn settle(&mut self, number: u32, end: Result<(), PlayError>) -> Option<(u32, TicketEvent)> {
        let ticket = self.tickets.remove(&number)?;
        if let Some(handle) = ticket.handle {
            self.by_handle.remove(&handle);
        }
        if ticket.ended {
            self.played.insert(ticket.game_id.clone());
        }
        Some((number, TicketEvent::Over(ticket.game_id, end)))
    }
}

impl Ticket {
    /// Removes events that were received before.
    fn take_new(&mut self, batch: &mut v1::EventBatch) {
        batch.events.retain(|event| {
            if event.sequence < self.next_event {
                return false;
            }
            if event.sequence > self.next_event {
                let (expected, got) = (self.next_event, event.sequence);
                tracing::warn!(game = self.game_id, expected, got, "events are missing");
            }
            self.next_event = event.sequence.saturating_add(1);
            self.ended |= matches!(event.kind, Some(Kind::GameEnded(_) | Kind::GameAborted(_)));
            true
        });
    }
}

/// A command for the seat with this handle.
pub(crate) fn command(handle: u32, command: Command) -> v1::SeatCommand {
    v1::SeatCommand {
        handle,
        command: Some(command),
    }
}

/// Packs commands into as few messages as the limits allow; nearly always one.
pub(crate) fn pack(commands: Vec<v1::SeatCommand>) -> Vec<v1::PlayRequest> {
    let mut requests: Vec<v1::PlayRequest> = Vec::new();
    let mut bytes = 0;
    for command in commands {
        let length = command.encoded_len() + COMMAND_OVERHEAD_BYTES;
        bytes += length;
        match requests.last_mut() {
            Some(last) if bytes <= MAX_REQUEST_BYTES && last.commands.len() < MAX_COMMANDS => {
                last.commands.push(command);
            }
            _ => {
                bytes = length;
                requests.push(v1::PlayRequest {
                    commands: vec![command],
                });
            }
        }
    }
    requests
}
