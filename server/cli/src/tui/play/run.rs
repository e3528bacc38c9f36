//! The loop of `chefshat play`: passes keys, ticks and server messages to `part`, draws its state,
//! and sends its commands. `link` holds the connection.

use std::collections::BTreeMap;
use std::time::Duration;

use chefshat_client::Client;
use chefshat_client::v1::{self, seat_command::Command};
use chefshat_record::convert::PERSON_TIME_KEY;
use tokio::sync::mpsc;

use super::app::{App, Do, EXPRESSIONS};
use super::follow::follow;
use super::link::{Order, link};
use super::part::{Part, PartInput};
use super::view;
use crate::CommandError;
use crate::narration::words;
use crate::tui::screen::{Screen, Wake};
use crate::tui::theme::Theme;

/// Messages that may wait to be handled.
const HEARD: usize = 64;
/// Commands that may wait for the connection.
const ORDERS: usize = 16;
/// Time between two drawings of the clock.
const TICK: Duration = Duration::from_millis(250);

/// A ticket and, if it is for a seat, the table as of joining.
pub(super) struct Taken {
    pub(super) client: Client,
    pub(super) ticket: String,
    pub(super) game: Option<App>,
}

/// Plays until the person has seen the end or leaves. `times`: record how long each decision was on
/// screen.
///
/// # Errors
/// The terminal cannot be used.
pub(super) async fn play(taken: Taken, times: bool) -> Result<Part, CommandError> {
    let Taken {
        client,
        ticket,
        game,
    } = taken;
    // The room or tournament may be private.
    let client = client.with_secrets([&ticket])?;
    let (sender, mut heard) = mpsc::channel(HEARD);
    let (orders, for_server) = mpsc::channel(ORDERS);
    let linking = link(client.clone(), ticket.clone(), for_server, sender.clone());
    let mut linking = tokio::spawn(linking);

    let theme = Theme::of_environment();
    let mut part = Part::new(game);
    let mut following = None;
    let mut ended = false;
    let mut screen = Screen::open(TICK)?;
    while !part.left {
        let now_ms = screen.now_ms();
        screen.draw(|frame| view::draw(frame, theme, &part, now_ms))?;
        let what = tokio::select! {
            wake = screen.next() => match wake {
                Wake::Key(key) => PartInput::Key(key),
                Wake::Tick => PartInput::Tick,
            },
            Some(what) = heard.recv() => what,
            end = &mut linking, if !ended => {
                ended = true;
                // It reports why it ended unless it panicked; then the terminal has been restored.
                end.map_err(|error| format!("the connection failed: {error}; resume with --ticket"))?;
                continue;
            }
        };
        if let (PartInput::Entered(entered), None) = (&what, &following) {
            let followed = follow(client.clone(), entered.clone(), sender.clone());
            following = Some(tokio::spawn(followed));
        }
        let Some((game, what)) = part.take(what, screen.now_ms()) else {
            continue;
        };
        if let Do::AskHint {
            ticket: of_game,
            decision_id,
        } = what
        {
            let ticket = of_game.unwrap_or_else(|| ticket.clone());
            tokio::spawn(ask_hint(
                client.clone(),
                ticket,
                game,
                decision_id,
                sender.clone(),
            ));
            continue;
        }
        // A command without a connection is dropped: the server sends the decision again.
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
    if !ended {
        linking.await?;
    }
    Ok(part)
}

/// Asks the server for a hint and passes it on.
async fn ask_hint(
    client: Client,
    ticket: String,
    game: String,
    decision_id: u64,
    heard: mpsc::Sender<PartInput>,
) {
    let hint = client.hint(ticket, decision_id).await;
    let hint = hint.map_err(|error| error.message().to_owned());
    // The receiver may be gone.
    let _ = heard.send(PartInput::Hint(game, decision_id, hint)).await;
}

/// The command for the stream of the seat. The time a decision was on screen is sent only with `times`.
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
        Do::Say(words) => Some(Command::Express(words::said(&words))),
        Do::Express(index) => {
            let (label, valence, arousal) = EXPRESSIONS.get(index).copied()?;
            Some(Command::Express(v1::Expression {
                label: label.to_owned(),
                valence: Some(valence),
                arousal: Some(arousal),
                source: v1::ExpressionSource::SelfReport.into(),
                ..v1::Expression::default()
            }))
        }
        Do::AskHint { .. } | Do::Leave => None,
    }
}
