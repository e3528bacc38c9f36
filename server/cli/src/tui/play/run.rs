//! A part is played: keys, messages and pictures are carried to and fro until the person has seen the end or leaves. What they mean is in `part`,
//! how it looks in `view`, the connection in `link`.

use std::collections::BTreeMap;
use std::time::Duration;

use chefshat_client::v1::{self, seat_command::Command};
use chefshat_client::{Client, ENTROPY_BYTES};
use tokio::sync::mpsc;
use tokio::time::{Instant, MissedTickBehavior, interval};

use super::app::{App, Do, EXPRESSIONS};
use super::follow::follow;
use super::link::{Connection, Order};
use super::part::{Heard, Part};
use super::view;
use crate::CommandError;
use crate::tui::look::Look;
use crate::tui::screen::{Key, Screen, asked_to_end};

/// Messages that may wait to be taken.
const HEARD: usize = 64;
/// Orders that may wait for the connection.
const ORDERS: usize = 16;
/// How often the clock is drawn.
const TICK: Duration = Duration::from_millis(250);
/// Key under which the time before the person's eyes is recorded with a decision, as the page for browsers does it.
const PERSON_TIME_KEY: &str = "person_decision_time_ms";

/// A ticket, and the table as it was when it was got, where it is a seat's.
pub(super) struct Taken {
    pub(super) client: Client,
    pub(super) ticket: String,
    pub(super) game: Option<App>,
}

/// Plays until the person has seen the end or leaves; with `times`, the person's own times are recorded.
///
/// # Errors
/// The terminal cannot be used.
pub(super) async fn play(taken: Taken, times: bool) -> Result<Part, CommandError> {
    let Taken {
        client,
        ticket,
        game,
    } = taken;
    let (sender, mut heard) = mpsc::channel(HEARD);
    let (orders, for_server) = mpsc::channel(ORDERS);
    let entropy = random_entropy();
    let connection = Connection::new(client.clone(), ticket, entropy);
    let mut serving = tokio::spawn(connection.serve(for_server, sender.clone()));

    let look = Look::of_environment();
    let mut part = Part::new(game);
    let begun = Instant::now();
    let now = || u64::try_from(begun.elapsed().as_millis()).unwrap_or(u64::MAX);
    let mut ticks = interval(TICK);
    ticks.set_missed_tick_behavior(MissedTickBehavior::Skip);
    let ended = asked_to_end()?;
    tokio::pin!(ended);
    let mut following = None;
    let mut served = false;
    let mut screen = Screen::open()?;
    while !part.left {
        screen.draw(|frame| view::draw(frame, look, &part, now()))?;
        let what = tokio::select! {
            key = screen.keys.recv() => Heard::Key(key.unwrap_or(Key::Interrupt)),
            Some(what) = heard.recv() => what,
            end = &mut serving, if !served => {
                served = true;
                // It has said why it ended, unless it failed: then the terminal has been given back, and nothing can be drawn.
                end.map_err(|error| format!("the connection failed: {error}; go on with --ticket"))?;
                continue;
            }
            _ = ticks.tick() => Heard::Tick,
            _ = &mut ended => Heard::Key(Key::Interrupt),
        };
        if let (Heard::Entered(entered), None) = (&what, &following) {
            let followed = follow(client.clone(), entered.clone(), sender.clone());
            following = Some(tokio::spawn(followed));
        }
        let Some((game, what)) = part.take(what, now()) else {
            continue;
        };
        // One that finds no connection is not needed: the decision is put anew.
        if let Some(command) = command(what, times) {
            let order: Order = (game, command);
            let _ = orders.try_send(order);
        }
    }
    drop(screen);
    drop(orders);
    drop(heard);
    if let Some(following) = following {
        following.abort();
    }
    if !served {
        serving.await?;
    }
    Ok(part)
}

fn random_entropy() -> Vec<u8> {
    chefshat_room::ids::random_bytes::<ENTROPY_BYTES>().to_vec()
}

/// What the server is told. How long a person took is told only where that was asked for.
pub(super) fn command(what: Do, times: bool) -> Option<Command> {
    match what {
        Do::Answer {
            decision_id,
            action,
            took_ms,
        } => Some(Command::Answer(v1::Answer {
            decision_id,
            action,
            annotations: (times && took_ms > 0).then(|| v1::Annotations {
                extra: BTreeMap::from([(PERSON_TIME_KEY.to_owned(), took_ms.to_string())])
                    .into_iter()
                    .collect(),
                ..v1::Annotations::default()
            }),
        })),
        Do::Resume => Some(Command::Resume(v1::ResumeSeat {})),
        Do::Express(index) => {
            let (label, valence, arousal) = EXPRESSIONS.get(index).copied()?;
            // Everybody sees it in the story, the person too; why one is refused is said.
            Some(Command::Express(v1::Expression {
                label: label.to_owned(),
                valence: Some(valence),
                arousal: Some(arousal),
                source: v1::ExpressionSource::SelfReport.into(),
                ..v1::Expression::default()
            }))
        }
        Do::Leave => None,
    }
}
