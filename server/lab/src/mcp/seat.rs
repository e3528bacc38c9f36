//! A seat that a client of this program has taken: follows it while the client is silent, waits for
//! its turn, answers. The ticket stays here and in the file of tickets, if there is one; no text shows
//! it.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use chefshat_client::{Client, Error, legal_count, nth_legal, v1};
use tokio::sync::watch;
use tokio::task::JoinHandle;
use tokio::time::{Instant, timeout};

use chefshat_cli::language::live::Live;
use chefshat_cli::language::{self, cards, text};
use chefshat_cli::narration::view::GameView;

/// Longest wait of a call. Clients give up on calls after about a minute.
pub(super) const LONGEST_WAIT: Duration = Duration::from_secs(25);
/// How long a seat that has just been taken waits for the answer of the server.
pub(super) const ATTACH_TIMEOUT: Duration = Duration::from_secs(10);

/// A seat, followed until it is dropped.
pub(super) struct Seat {
    client: Client,
    ticket: String,
    live: watch::Sender<Live>,
    /// Number of the last event that the client has been sent.
    shown: AtomicU64,
    began: Instant,
    following: JoinHandle<()>,
}

impl Drop for Seat {
    fn drop(&mut self) {
        self.following.abort();
    }
}

impl Seat {
    /// Follows a seat with its ticket. `view`: the room; `None` if it is not known yet.
    pub(super) fn follow(
        client: &Client,
        ticket: String,
        view: GameView,
        me: Option<u32>,
    ) -> Arc<Self> {
        let began = Instant::now();
        let live = watch::Sender::new(Live::new(view, me));
        let mut follower = client.follow_seat(&*ticket);
        let updates = live.clone();
        let following = tokio::spawn(async move {
            loop {
                let (lost, reason) = match follower.next().await {
                    Ok(Some(update)) => {
                        let now_ms = elapsed_ms(began);
                        updates.send_modify(|live| live.take(update, now_ms));
                        continue;
                    }
                    Ok(None) => (None, None),
                    Err(error) => (Some(error.message()), error.reason().map(str::to_owned)),
                };
                updates.send_modify(|live| {
                    live.open = None;
                    live.lost = lost;
                    live.is_gone =
                        matches!(reason.as_deref(), Some("TICKET_UNKNOWN" | "GAME_OVER"));
                });
                return;
            }
        });
        Arc::new(Self {
            client: client.clone(),
            ticket,
            live,
            shown: AtomicU64::new(0),
            began,
            following,
        })
    }

    /// Reads the state.
    pub(super) fn read<T>(&self, read: impl FnOnce(&Live) -> T) -> T {
        read(&self.live.borrow())
    }

    /// Its ticket.
    pub(super) fn ticket(&self) -> &str {
        &self.ticket
    }

    /// The client that shows the ticket as a secret, which a private room asks for.
    ///
    /// # Errors
    /// The ticket is malformed.
    pub(super) fn client(&self) -> Result<Client, Error> {
        self.client.with_secrets([&self.ticket])
    }

    /// Waits until the server has attached the seat.
    ///
    /// # Errors
    /// Why it has not.
    pub(super) async fn attached(&self) -> Result<(), String> {
        let mut changes = self.live.subscribe();
        let attached = changes.wait_for(|live| live.me.is_some() || live.lost.is_some());
        match timeout(ATTACH_TIMEOUT, attached).await {
            Ok(Ok(live)) => live.lost.clone().map_or(Ok(()), Err),
            Ok(Err(_)) | Err(_) => Err("the server did not answer in time".to_owned()),
        }
    }

    /// What has happened since an event (by default the last one that was shown), once it is the
    /// seat's turn, the game is over or the time has passed. Takes the seat back from a substitute;
    /// if `skip_forced`, takes also decisions with only one legal action.
    pub(super) async fn wait(
        &self,
        after: Option<u64>,
        longest: Duration,
        skip_forced: bool,
    ) -> String {
        let turn = async {
            loop {
                self.turn().await;
                let forced = self.read(forced).filter(|_| skip_forced);
                let Some((decision, action)) = forced else {
                    return;
                };
                // What was refused is shown, and left to the model.
                if self.play(decision, action, None).await.is_err() {
                    return;
                }
            }
        };
        // When the time has passed, the state is shown as it is.
        let _ = timeout(longest, turn).await;
        self.since(after)
    }

    /// Waits until it is the seat's turn or the game is over.
    async fn turn(&self) {
        let mut changes = self.live.subscribe();
        let concerns = |live: &Live| live.concerns_me() || live.is_substituted();
        let _ = changes.wait_for(concerns).await;
        if self.read(Live::is_substituted) {
            if let Err(error) = self.client.resume_seat(&*self.ticket).await {
                tracing::warn!("the seat was not taken back from its substitute: {error}");
            }
            let _ = changes.wait_for(Live::concerns_me).await;
        }
    }

    /// What has happened since an event, by default the last one that was shown.
    fn since(&self, after: Option<u64>) -> String {
        self.read(|live| {
            let shown = self.shown.fetch_max(live.sequence(), Ordering::Relaxed);
            text::since(live, after.unwrap_or(shown), elapsed_ms(self.began))
        })
    }

    /// The rules of this game.
    pub(super) fn rules(&self) -> String {
        self.read(|live| language::this_game(live.view.rules.as_ref()))
    }

    /// The whole table.
    pub(super) fn table(&self) -> String {
        self.read(|live| text::table(live, elapsed_ms(self.began)))
    }

    /// Answers a decision. The server judges the answer, and counts and records an illegal one.
    ///
    /// # Errors
    /// The refusal, with the legal actions.
    pub(super) async fn play(
        &self,
        decision_id: u64,
        action: u32,
        reason: Option<&str>,
    ) -> Result<String, String> {
        if let Some(over) = self.read(text::over) {
            return Err(over);
        }
        let annotations = reason
            .and_then(language::reason)
            .map(|reason| v1::Annotations {
                extra: [(language::REASON.to_owned(), reason)].into(),
                ..v1::Annotations::default()
            });
        let answer = v1::Answer {
            decision_id,
            action,
            annotations,
        };
        let words = self.read(|live| {
            let special = live.open.as_ref().map(|open| open.request.special_action());
            cards::action(live.space(), action, special.unwrap_or_default())
        });
        let result = (self.client.answer(&*self.ticket, answer).await)
            .map_err(|error| error.message().to_owned())?;
        match result.status() {
            v1::AnswerStatus::Accepted => {
                self.live.send_modify(|live| live.close(decision_id));
                let dropped = match result.annotations_dropped {
                    true => " The reason was not recorded: this game has too many.",
                    false => "",
                };
                Ok(format!("ok {words}.{dropped}"))
            }
            v1::AnswerStatus::Invalid => Err(self.illegal(&result, &words)),
            _ => {
                self.live.send_modify(|live| live.close_before(decision_id));
                Err(self.closed(decision_id))
            }
        }
    }

    /// Why an action was not accepted, and which would be.
    fn illegal(&self, result: &v1::AnswerResult, words: &str) -> String {
        if result.invalid_attempts_left == Some(0) {
            self.live.send_modify(|live| live.close(result.decision_id));
            return format!(
                "Illegal: {} ({words}): {}. No attempts are left, so the server has decided for you. Call wait_for_turn.",
                cards::id(result.action),
                result.detail
            );
        }
        let left = match result.invalid_attempts_left {
            Some(left) => format!(" Attempts left: {left}."),
            None => String::new(),
        };
        self.read(|live| {
            let request = live.open.as_ref().map(|open| &open.request);
            let legal = request.map_or_else(String::new, |it| cards::options(live.space(), it));
            let (action, detail) = (cards::id(result.action), &result.detail);
            format!("Illegal: {action} ({words}): {detail}.{left}\noptions\n{legal}")
        })
    }

    /// What is open in place of a decision that is not.
    fn closed(&self, decision_id: u64) -> String {
        let open = self.read(|live| live.open.as_ref().map(|open| open.request.decision_id));
        let todo = match open {
            Some(open) => format!("Decision {open} is open: call get_table."),
            None => "Call wait_for_turn.".to_owned(),
        };
        format!(
            "Decision {decision_id} is not open: the time has run out, or it was answered before. {todo}"
        )
    }

    /// Shows an expression to everybody at the table.
    ///
    /// # Errors
    /// The server's refusal.
    pub(super) async fn express(&self, expression: v1::Expression) -> Result<(), Error> {
        self.client.express(&*self.ticket, expression).await
    }

    /// Gives the seat back if the game has not begun. Afterwards, dropping the seat leaves it.
    ///
    /// # Errors
    /// The server's refusal.
    pub(super) async fn leave(&self) -> Result<(), Error> {
        if self.read(|live| live.view.started || live.is_over()) {
            return Ok(());
        }
        match self.client.leave_room(&*self.ticket).await {
            // It has begun just now.
            Err(error) if error.reason() == Some("GAME_STARTED") => Ok(()),
            left => left.map(drop),
        }
    }
}

/// The open decision and its action, if only one is legal.
fn forced(live: &Live) -> Option<(u64, u32)> {
    let request = &live.open.as_ref()?.request;
    let only = nth_legal(request, 0).filter(|_| legal_count(request) == 1)?;
    Some((request.decision_id, only.0))
}

fn elapsed_ms(began: Instant) -> u64 {
    u64::try_from(began.elapsed().as_millis()).unwrap_or(u64::MAX)
}
