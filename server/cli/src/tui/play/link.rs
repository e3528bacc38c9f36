//! The connection of a ticket: opened, restored after failures, given up in the end. A ticket is
//! for a seat, or for a place in a tournament, whose games bring more seats. The agents of the SDK
//! decide on the task of the connection; a person thinks longer and sees events meanwhile, so that
//! messages and answers are independent here. `part` and `app` handle the messages.

use std::collections::BTreeMap;
use std::time::Duration;

use chefshat_client::v1::{
    self, play_service_client::PlayServiceClient, seat_command::Command, seat_update::Update,
};
use chefshat_client::{Client, FIRST_DELAY, GIVE_UP_AFTER, MAX_DELAY};
use tokio::sync::mpsc;
use tokio::time::{Instant, sleep, timeout};
use tokio_stream::wrappers::ReceiverStream;
use tonic::{Code, Status};

use super::part::PartInput;

/// Commands that may wait to be sent.
const COMMANDS: usize = 16;
/// Maximum size of a message: the history of a game.
const MAX_RESPONSE_BYTES: usize = 16 << 20;
/// Timeouts for opening a stream, describing a room, and closing a stream.
const OPEN_TIMEOUT: Duration = Duration::from_secs(10);
const ROOM_TIMEOUT: Duration = Duration::from_secs(2);
const LEAVE_TIMEOUT: Duration = Duration::from_secs(1);
/// Request id of the ticket's own attachment; those of tournament games follow.
const ATTACHMENT: u32 = 1;

/// A command for a game.
pub(super) type Order = (String, Command);

/// How a stream ended.
enum Stopped {
    /// The person has left.
    Left,
    /// The game or tournament is over, or the ticket is in use elsewhere; with the reason if it has
    /// not ended.
    Over(Option<String>),
    /// It failed; whether the ticket had been attached for a while.
    Broken { status: Status, held: bool },
}

/// A game with a seat of this ticket.
struct Game {
    /// The ticket of that seat.
    ticket: String,
    /// Sequence number of the next new event.
    next_event: u64,
    ended: bool,
}

/// One stream.
struct Stream {
    /// IDs of the games attached when the stream was opened, in order.
    asked: Vec<String>,
    /// Games by handle.
    games: BTreeMap<u32, String>,
    /// Handle of the place in a tournament.
    place: Option<u32>,
    /// When the ticket was attached.
    attached: Option<Instant>,
}

impl Stream {
    /// The game of an attachment request.
    fn asked_for(&self, request_id: u32) -> Option<String> {
        let nth = usize::try_from(request_id.checked_sub(ATTACHMENT + 1)?).ok()?;
        self.asked.get(nth).cloned()
    }

    fn broken(&self, status: Status) -> Stopped {
        let held = self.attached.is_some_and(|it| it.elapsed() >= MAX_DELAY);
        Stopped::Broken { status, held }
    }
}

/// A ticket's connection.
pub(super) struct Connection {
    client: Client,
    ticket: String,
    /// The person's contribution to the game seed.
    entropy: Vec<u8>,
    /// Games by ID, until their last message.
    games: BTreeMap<String, Game>,
    /// Whether anything new has arrived since the last outage.
    progress: bool,
}

impl Connection {
    pub(super) fn new(client: Client, ticket: String, entropy: Vec<u8>) -> Self {
        Self {
            client,
            ticket,
            entropy,
            games: BTreeMap::new(),
            progress: false,
        }
    }

    /// Runs the connection until it ends for good or `orders` is closed.
    pub(super) async fn serve(
        mut self,
        mut orders: mpsc::Receiver<Order>,
        heard: mpsc::Sender<PartInput>,
    ) {
        let mut outage: Option<Instant> = None;
        let mut delay = FIRST_DELAY;
        loop {
            self.progress = false;
            let why = match self.converse(&mut orders, &heard).await {
                Stopped::Left => return,
                Stopped::Over(why) => Some(why),
                Stopped::Broken { .. } if self.own_game_ended() => Some(None),
                Stopped::Broken { status, .. } if !may_retry(status.code()) => {
                    Some(Some(status.message().to_owned()))
                }
                Stopped::Broken { status, held } => {
                    // A long wait without events is not an outage.
                    if held || self.progress {
                        (outage, delay) = (None, FIRST_DELAY);
                    }
                    let since = *outage.get_or_insert_with(Instant::now);
                    let words = status.message().to_owned();
                    if since.elapsed() > GIVE_UP_AFTER {
                        Some(Some(format!("the server did not come back: {words}")))
                    } else if heard.send(PartInput::Lost(words)).await.is_err() {
                        return;
                    } else {
                        None
                    }
                }
            };
            if let Some(why) = why {
                // The receiver may be gone.
                let _ = heard.send(PartInput::Over(why)).await;
                return;
            }
            tokio::select! {
                () = sleep(delay) => {}
                () = closed(&mut orders) => return,
            }
            delay = (delay * 2).min(MAX_DELAY);
        }
    }

    /// Whether the ticket is a seat's and its game has ended.
    fn own_game_ended(&self) -> bool {
        let mut games = self.games.values();
        games.any(|game| game.ended && game.ticket == self.ticket)
    }

    /// The first commands of a stream. Tournament games come before the place, each with its own
    /// ticket, so that only new events are sent, and the end of a game that ended meanwhile.
    fn attachments(&self, stream: &mut Stream) -> Vec<Command> {
        let attach = |ticket: &str, request_id, from_sequence| {
            Command::Attach(v1::Attach {
                ticket: ticket.to_owned(),
                request_id,
                from_sequence,
                delivery: v1::EventDelivery::AtOnce.into(),
                entropy: self.entropy.clone(),
                ..v1::Attach::default()
            })
        };
        let own = |game: &&Game| game.ticket == self.ticket;
        let mut all = Vec::new();
        let games = self.games.iter().filter(|(_, game)| !own(game));
        for (request_id, (id, game)) in (ATTACHMENT + 1..).zip(games) {
            stream.asked.push(id.clone());
            all.push(attach(&game.ticket, request_id, game.next_event));
        }
        let from = self.games.values().find(own);
        let from = from.map_or(1, |game| game.next_event);
        all.push(attach(&self.ticket, ATTACHMENT, from));
        all
    }

    /// Runs one stream until it ends.
    async fn converse(
        &mut self,
        orders: &mut mpsc::Receiver<Order>,
        heard: &mpsc::Sender<PartInput>,
    ) -> Stopped {
        let mut stream = Stream {
            asked: Vec::new(),
            games: BTreeMap::new(),
            place: None,
            attached: None,
        };
        self.games
            .retain(|_, game| !game.ended || game.ticket == self.ticket);
        let (requests, queue) = mpsc::channel(COMMANDS);
        let commands = self.attachments(&mut stream).into_iter();
        let commands = commands.map(|command| seat_command(0, command)).collect();
        requests
            .try_send(v1::PlayRequest { commands })
            .expect("an empty queue has room");
        let mut service = PlayServiceClient::new(self.client.channel())
            .max_decoding_message_size(MAX_RESPONSE_BYTES);
        let opening = timeout(OPEN_TIMEOUT, service.play(ReceiverStream::new(queue)));
        let mut responses = match opening.await {
            Ok(Ok(opened)) => opened.into_inner(),
            Ok(Err(status)) => return stream.broken(status),
            Err(_) => return stream.broken(Status::unavailable("no answer in time")),
        };
        loop {
            tokio::select! {
                response = responses.message() => match response {
                    Ok(Some(response)) => {
                        for update in response.updates {
                            if let Some(over) = self.handle(&mut stream, update, heard).await {
                                return over;
                            }
                        }
                    }
                    Ok(None) => return stream.broken(Status::unavailable("the server ended the stream")),
                    Err(status) => return stream.broken(status),
                },
                order = orders.recv() => {
                    let Some((game, command)) = order else {
                        // Half-closing leaves the game; further messages do not matter.
                        drop(requests);
                        let end = async { while let Ok(Some(_)) = responses.message().await {} };
                        let _ = timeout(LEAVE_TIMEOUT, end).await;
                        return Stopped::Left;
                    };
                    let handle = stream.games.iter().find(|(_, id)| **id == game);
                    if let Some((&handle, _)) = handle {
                        let commands = vec![seat_command(handle, command)];
                        // A failed send shows as an error of the responses.
                        let _ = requests.send(v1::PlayRequest { commands }).await;
                    }
                }
            }
        }
    }

    /// Passes on one update; returns how the stream ended if it was the last.
    async fn handle(
        &mut self,
        stream: &mut Stream,
        update: v1::SeatUpdate,
        heard: &mpsc::Sender<PartInput>,
    ) -> Option<Stopped> {
        let (handle, mut update) = (update.handle, update.update?);
        let game = stream.games.get(&handle).cloned();
        let what = match &mut update {
            Update::Attached(attached) => {
                stream.attached.get_or_insert_with(Instant::now);
                self.seated(stream, handle, attached).await
            }
            Update::Entered(entered) => {
                stream.attached.get_or_insert_with(Instant::now);
                stream.place = Some(handle);
                PartInput::Entered(entered.clone())
            }
            // The end of the stream follows, after which everything is attached again.
            Update::Detached(detached) if detached.reason() == v1::DetachReason::ServerStopping => {
                return None;
            }
            Update::Detached(detached) if stream.place == Some(handle) => {
                return Some(Stopped::Over(match detached.reason() {
                    v1::DetachReason::TournamentOver => None,
                    v1::DetachReason::Superseded => {
                        Some("another connection has taken your place in the tournament".to_owned())
                    }
                    _ => Some("the server has ended your place's connection".to_owned()),
                }));
            }
            Update::Detached(detached) => {
                stream.games.remove(&handle);
                let id = game?;
                let why = why_detached(detached.reason());
                let game = self.games.remove(&id)?;
                if game.ticket == self.ticket {
                    return Some(Stopped::Over((!game.ended).then(|| why.to_owned())));
                }
                if game.ended {
                    return None;
                }
                PartInput::Gone(id, why.to_owned())
            }
            Update::Refused(refused) if refused.request_id == ATTACHMENT => {
                return Some(Stopped::Over(Some(refused.message.clone())));
            }
            Update::Refused(refused) if refused.request_id > ATTACHMENT => {
                // Its room was removed during the outage.
                let id = stream.asked_for(refused.request_id)?;
                self.games.remove(&id);
                PartInput::Gone(id, refused.message.clone())
            }
            Update::Events(batch) => {
                let id = game?;
                let game = self.games.get_mut(&id)?;
                self.progress |= game.events(batch);
                PartInput::Update(id, Box::new(update))
            }
            _ => PartInput::Update(game?, Box::new(update)),
        };
        match heard.send(what).await {
            Ok(()) => None,
            Err(_) => Some(Stopped::Left),
        }
    }

    /// A seat was attached. For a new game, requests its room, which lists the participants before
    /// the game starts.
    async fn seated(
        &mut self,
        stream: &mut Stream,
        handle: u32,
        attached: &v1::Attached,
    ) -> PartInput {
        let id = attached.game_id.clone();
        // A new handle replaces the old one.
        stream.games.retain(|_, other| *other != id);
        stream.games.insert(handle, id.clone());
        let mut room = None;
        if !self.games.contains_key(&id) {
            let asked = timeout(ROOM_TIMEOUT, self.client.get_room(&*attached.room_id)).await;
            room = asked.ok().and_then(Result::ok).map(Box::new);
            let ticket = match attached.ticket.as_str() {
                "" => self.ticket.clone(),
                ticket => ticket.to_owned(),
            };
            let game = Game {
                ticket,
                next_event: 1,
                ended: false,
            };
            self.games.insert(id, game);
        }
        PartInput::Seated(attached.clone(), room)
    }
}

impl Game {
    /// Removes events that were received before; whether any are left.
    fn events(&mut self, batch: &mut v1::EventBatch) -> bool {
        use v1::game_event::Kind::{GameAborted, GameEnded};
        let next = self.next_event;
        batch.events.retain(|event| event.sequence >= next);
        if let Some(last) = batch.events.last() {
            self.next_event = last.sequence.saturating_add(1);
        }
        let ends =
            |event: &v1::GameEvent| matches!(event.kind, Some(GameEnded(_) | GameAborted(_)));
        self.ended |= batch.events.iter().any(ends);
        !batch.events.is_empty()
    }
}

fn why_detached(reason: v1::DetachReason) -> &'static str {
    match reason {
        v1::DetachReason::Superseded => "another connection has taken this seat",
        _ => "the server has ended the seat's connection",
    }
}

/// Waits until no commands can come. Commands during an outage are dropped: the server sends the
/// decision again.
async fn closed(orders: &mut mpsc::Receiver<Order>) {
    while orders.recv().await.is_some() {}
}

fn seat_command(handle: u32, command: Command) -> v1::SeatCommand {
    v1::SeatCommand {
        handle,
        command: Some(command),
    }
}

/// Whether a retry may succeed.
fn may_retry(code: Code) -> bool {
    matches!(
        code,
        Code::Unavailable
            | Code::Unknown
            | Code::Internal
            | Code::Cancelled
            | Code::Aborted
            | Code::DeadlineExceeded
            | Code::ResourceExhausted
    )
}
