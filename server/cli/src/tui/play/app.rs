//! The state of one game in `chefshat play`: takes keys and server messages, returns actions for
//! the server. It has no terminal, connection or clock, so that tests play whole games with data.

use chefshat_client::v1::{self, game_event::Kind, seat_update::Update};
use ratatui::crossterm::event::KeyCode;

use super::keys::{key_of, names_cards, not_held};
use super::pick::Decision;
use crate::narration::awaited::{AwaitedSeat, left_ms};
use crate::narration::story;
use crate::narration::view::GameView;
use crate::narration::words;
use crate::tui::log::Log;
use crate::tui::screen::Key;

/// Most characters of a line to the table.
pub(super) const MAX_LINE: usize = 60;

/// Expressions by key: label, valence and arousal, the same as in the page.
pub(super) const EXPRESSIONS: [(&str, f32, f32); 6] = [
    ("joy", 0.8, 0.5),
    ("amusement", 0.6, 0.7),
    ("surprise", 0.1, 0.8),
    ("concentration", 0.0, 0.2),
    ("annoyance", -0.6, 0.6),
    ("sadness", -0.7, -0.4),
];

/// Notice about words and expressions without a connection.
const NOT_SENT: &str = "not sent: the connection is lost; send it again when it is back";
/// Notice after the server decided for the person.
const TOO_LATE: &str = "too late: this decision was taken without you";

/// Input of a game.
#[derive(Debug)]
pub(super) enum Input {
    Key(Key),
    /// An update from the server.
    Update(Box<Update>),
    /// The hint for a decision, or why there is none.
    Hint(u64, Result<v1::Hint, String>),
    /// The connection was lost, with the reason; it is being restored.
    Lost(String),
    /// The connection ended for good; with the reason if the game has not ended.
    Over(Option<String>),
}

/// Output of a game.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Do {
    /// Answer a decision that was on screen for `took_ms`.
    Answer {
        decision_id: u64,
        action: u32,
        took_ms: u64,
    },
    Express(usize),
    /// Write to everybody at the table.
    Say(String),
    /// Ask for a hint for a decision. `ticket` is that of a game of a tournament; `None`: the person's
    /// own.
    AskHint {
        ticket: Option<String>,
        decision_id: u64,
    },
    /// Take the seat back from a substitute.
    Resume,
    /// Leave the table and quit.
    Leave,
}

/// A dialog over the table.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Dialog {
    Help,
    Leave,
    Express,
    Write,
}

/// State of the connection.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Link {
    Connecting,
    Live,
    Lost(String),
    /// Ended; with the reason if the game has not ended.
    Over(Option<String>),
}

/// An open decision and when it arrived.
#[derive(Debug, Clone)]
pub(super) struct Open {
    pub(super) decision: Decision,
    pub(super) since_ms: u64,
    /// The answer has been sent.
    pub(super) sent: bool,
    pub(super) hint: Hint,
}

/// The hint for an open decision.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Hint {
    NotAsked,
    /// The server computes it.
    Asked,
    /// In words.
    Given(String),
}

/// A game in the terminal.
#[derive(Debug)]
pub(super) struct App {
    pub(super) table: GameView,
    pub(super) me: Option<u32>,
    /// The ticket of the seat in a game of a tournament.
    ticket: Option<String>,
    pub(super) open: Option<Open>,
    /// Whom of the others the game waits for.
    pub(super) awaited: Option<AwaitedSeat>,
    pub(super) dialog: Option<Dialog>,
    /// What the person is writing to the table.
    pub(super) line: String,
    pub(super) link: Link,
    /// A notice for the person: why a key was refused, or a message of the server.
    pub(super) notice: String,
    pub(super) log: Log,
    /// What Enter does after the end of the game.
    pub(super) then: &'static str,
    /// The person's standing in the tournament, shown with the result.
    pub(super) standing: Option<String>,
    /// Notice about other games in progress.
    pub(super) others: Option<String>,
    /// The answer that is not acknowledged yet.
    unacknowledged: Option<Do>,
    pub(super) left: bool,
}

impl Link {
    /// Symbol and words for the state.
    pub(super) fn words(&self) -> &'static str {
        match self {
            Self::Connecting => "○ connecting",
            Self::Live => "● connected",
            Self::Lost(_) => "✕ connection lost",
            Self::Over(_) => "○ over",
        }
    }
}

impl App {
    /// A game before its first input.
    pub(super) fn new(table: GameView, me: Option<u32>) -> Self {
        Self {
            table,
            me,
            ticket: None,
            open: None,
            awaited: None,
            dialog: None,
            line: String::new(),
            link: Link::Connecting,
            notice: String::new(),
            log: Log::default(),
            then: "Enter ends",
            standing: None,
            others: None,
            unacknowledged: None,
            left: false,
        }
    }

    /// Handles an input at `now_ms` of a monotonic clock.
    pub(super) fn take(&mut self, input: Input, now_ms: u64) -> Option<Do> {
        match input {
            Input::Key(key) => self.key(key, now_ms),
            Input::Update(update) => self.update(*update, now_ms),
            Input::Hint(decision_id, hint) => {
                self.hinted(decision_id, hint);
                None
            }
            Input::Lost(why) => {
                self.link = Link::Lost(why);
                self.open = None;
                None
            }
            Input::Over(why) => {
                self.link = Link::Over(why);
                self.open = None;
                None
            }
        }
    }

    /// Milliseconds left for the open decision, and then in the time bank.
    pub(super) fn clock(&self, now_ms: u64) -> Option<(u64, u64)> {
        let open = self.open.as_ref().filter(|_| !self.table.paused)?;
        let gone_ms = now_ms.saturating_sub(open.since_ms);
        Some(left_ms(&open.decision.request, gone_ms))
    }

    /// Whether keys act on the table, not on a dialog or the log.
    pub(super) fn takes_keys(&self) -> bool {
        self.dialog.is_none() && !self.log.is_open()
    }

    /// When the open decision arrived; `None` if there is none or its answer has been sent.
    pub(super) fn asks_since(&self) -> Option<u64> {
        let open = self.open.as_ref().filter(|open| !open.sent)?;
        Some(open.since_ms)
    }

    /// Whether a substitute plays for this seat.
    pub(super) fn substituted(&self) -> bool {
        let me = self.me.and_then(|me| self.table.seat(me));
        me.is_some_and(|place| place.substituted)
    }

    fn update(&mut self, update: Update, now_ms: u64) -> Option<Do> {
        match update {
            Update::Attached(attached) => {
                self.me = Some(attached.seat);
                self.ticket = Some(attached.ticket).filter(|ticket| !ticket.is_empty());
                self.link = Link::Live;
                self.notice.clear();
                self.open = None;
                self.awaited = None;
                self.table.substitute(attached.seat, None);
            }
            Update::Substitution(substitution) => {
                if let Some(me) = self.me {
                    self.table.substitute(me, substitution.active.then_some(""));
                    let line = story::substitution(me, substitution.active);
                    self.log.add(vec![line]);
                }
            }
            Update::Awaited(awaited) => self.awaited = AwaitedSeat::new(&awaited, now_ms),
            Update::Events(batch) => {
                for event in &batch.events {
                    self.log.follow(&mut self.table, event);
                    self.close_by(event);
                    self.restart_clock_by(event, now_ms);
                }
            }
            Update::Decision(request) => return self.asked(request, now_ms),
            Update::Result(result) => self.result(&result),
            Update::Refused(refused) => {
                self.notice = crate::narration::clean(&refused.message, 76);
            }
            Update::Snapshot(snapshot) => {
                self.table.restore(&snapshot, self.me);
                self.log.add(vec![story::unknown_before()]);
            }
            Update::Detached(_) | Update::Entered(_) => {}
        }
        None
    }

    /// After a pause at a physical table, a decision has its full time again.
    fn restart_clock_by(&mut self, event: &v1::GameEvent, now_ms: u64) {
        if let (Some(Kind::TablePaused(table)), Some(open)) = (&event.kind, &mut self.open)
            && !table.paused
        {
            open.since_ms = now_ms;
        }
    }

    /// Closes the open decision after an event that shows it was decided, by a timeout or a
    /// substitute, or that makes it void.
    fn close_by(&mut self, event: &v1::GameEvent) {
        if let Some(Kind::Correction(correction)) = &event.kind
            && correction.first_void > 0
        {
            // A decision that is still open is asked again.
            self.open = None;
            self.unacknowledged = None;
        }
        let moved = matches!(
            event.kind,
            Some(
                Kind::Play(_)
                    | Kind::Pass(_)
                    | Kind::CardsExchanged(_)
                    | Kind::SpecialActionDeclared(_)
                    | Kind::GameEnded(_)
                    | Kind::GameAborted(_)
            )
        );
        if moved
            && let Some(open) = self.open.take()
            && !open.sent
        {
            TOO_LATE.clone_into(&mut self.notice);
        }
    }

    fn asked(&mut self, request: v1::DecisionRequest, now_ms: u64) -> Option<Do> {
        // The answer may have been lost with the connection: send it again.
        if let Some(again @ Do::Answer { decision_id, .. }) = &self.unacknowledged
            && *decision_id == request.decision_id
        {
            return Some(again.clone());
        }
        self.unacknowledged = None;
        self.notice.clear();
        let decision = self
            .table
            .rules
            .and_then(|rules| Decision::open(request, rules.actions()));
        if decision.is_none() {
            "the server's question cannot be read; its default decision will be taken"
                .clone_into(&mut self.notice);
        }
        self.open = decision.map(|decision| Open {
            decision,
            since_ms: now_ms,
            sent: false,
            hint: Hint::NotAsked,
        });
        self.table.turn = self.me;
        None
    }

    /// Selects what a hint suggests for the open decision.
    fn hinted(&mut self, decision_id: u64, hint: Result<v1::Hint, String>) {
        let asked = |open: &&mut Open| open.decision.request.decision_id == decision_id;
        let Some(open) = self.open.as_mut().filter(asked) else {
            return;
        };
        match hint {
            Ok(hint) => {
                open.decision.pick_action(hint.action);
                open.hint = Hint::Given(open.decision.hint_words(&hint));
            }
            Err(why) => {
                open.hint = Hint::NotAsked;
                self.notice = crate::narration::clean(&why, 76);
            }
        }
    }

    fn result(&mut self, result: &v1::AnswerResult) {
        self.unacknowledged.take_if(|answer| {
            matches!(answer, Do::Answer { decision_id, action, .. }
                if (*decision_id, *action) == (result.decision_id, result.action))
        });
        let ours =
            |open: &mut Open| open.decision.request.decision_id == result.decision_id && open.sent;
        match result.status() {
            v1::AnswerStatus::Invalid if result.invalid_attempts_left != Some(0) => {
                if let Some(open) = self
                    .open
                    .as_mut()
                    .filter(|open| open.decision.request.decision_id == result.decision_id)
                {
                    open.sent = false;
                }
                self.notice = crate::narration::clean(&result.detail, 76);
            }
            v1::AnswerStatus::Closed => {
                self.open.take_if(ours);
                TOO_LATE.clone_into(&mut self.notice);
            }
            _ => {
                self.open.take_if(ours);
            }
        }
    }

    fn key(&mut self, key: Key, now_ms: u64) -> Option<Do> {
        let code = match key {
            Key::Resized => return None,
            Key::Interrupt => return self.leave(),
            Key::Code(code) => code,
        };
        if self.dialog.is_none() && self.log.key(code) {
            return None;
        }
        if self.table.end.is_some() || matches!(self.link, Link::Over(_)) {
            if self.ends_line(code) {
                return None;
            }
            let done = matches!(code, KeyCode::Enter | KeyCode::Esc | KeyCode::Char('q'));
            return done.then(|| self.leave()).flatten();
        }
        if let Some(dialog) = self.dialog {
            return self.dialog_key(dialog, code);
        }
        match code {
            KeyCode::Char('?') => self.dialog = Some(Dialog::Help),
            KeyCode::Char('q') | KeyCode::Esc => self.dialog = Some(Dialog::Leave),
            KeyCode::Char('e') => self.dialog = Some(Dialog::Express),
            KeyCode::Char('t') => self.dialog = Some(Dialog::Write),
            KeyCode::Char('r') if self.substituted() => return Some(Do::Resume),
            code => return self.decide(code, now_ms),
        }
        None
    }

    fn dialog_key(&mut self, dialog: Dialog, code: KeyCode) -> Option<Do> {
        if dialog == Dialog::Write {
            return self.write(code);
        }
        self.dialog = None;
        match (dialog, code) {
            (Dialog::Leave, KeyCode::Char('y' | 'Y')) => self.leave(),
            (Dialog::Express, KeyCode::Char(digit @ '1'..='6')) => {
                let index = usize::try_from(u32::from(digit) - u32::from('1')).ok()?;
                self.is_heard().then_some(Do::Express(index))
            }
            _ => None,
        }
    }

    /// Whether a key still belongs to a line to the table, which the end of the game interrupted.
    pub(super) fn ends_line(&mut self, code: KeyCode) -> bool {
        let writes = self.dialog == Some(Dialog::Write);
        if writes && matches!(code, KeyCode::Enter | KeyCode::Esc) {
            self.dialog = None;
        }
        writes
    }

    /// Handles a key for the line to the table.
    fn write(&mut self, code: KeyCode) -> Option<Do> {
        match code {
            KeyCode::Char(sign) => {
                let longer = format!("{}{sign}", self.line);
                if longer.chars().count() <= MAX_LINE && words::fits(&longer) {
                    self.line = longer;
                }
            }
            KeyCode::Backspace => drop(self.line.pop()),
            KeyCode::Enter => {
                self.dialog = None;
                if !self.is_heard() {
                    return None;
                }
                let words = std::mem::take(&mut self.line);
                let words = words.trim();
                return (!words.is_empty()).then(|| Do::Say(words.to_owned()));
            }
            // What was written stays for the next time.
            KeyCode::Esc => self.dialog = None,
            _ => {}
        }
        None
    }

    /// Whether there is a connection. Unlike a decision, words and expressions are not asked for again.
    fn is_heard(&mut self) -> bool {
        let is_heard = self.link == Link::Live;
        if !is_heard {
            NOT_SENT.clone_into(&mut self.notice);
        }
        is_heard
    }

    fn leave(&mut self) -> Option<Do> {
        self.left = true;
        Some(Do::Leave)
    }

    /// Handles a key for the open decision.
    fn decide(&mut self, code: KeyCode, now_ms: u64) -> Option<Do> {
        let open = self.open.as_mut().filter(|open| !open.sent)?;
        let decision = &mut open.decision;
        let special = decision.kind() == v1::DecisionKind::SpecialAction;
        self.notice.clear();
        let action = match code {
            KeyCode::Left => return done(|| decision.step(false)),
            KeyCode::Right => return done(|| decision.step(true)),
            KeyCode::Tab => return done(|| decision.step_active(true)),
            KeyCode::BackTab => return done(|| decision.step_active(false)),
            KeyCode::Up | KeyCode::Char('+') => return done(|| decision.more(true)),
            KeyCode::Down | KeyCode::Char('-') => return done(|| decision.more(false)),
            KeyCode::Char('j') => {
                if !decision.next_joker() {
                    "no joker can go with it".clone_into(&mut self.notice);
                }
                return None;
            }
            KeyCode::Char(key) if !special && names_cards(key) => {
                let mut stacks = decision.stacks.iter();
                match stacks.position(|stack| key_of(*stack) == Some(key)) {
                    Some(at) => decision.press(at),
                    None => self.notice = not_held(key),
                }
                return None;
            }
            KeyCode::Char('h') => {
                if open.hint == Hint::Asked {
                    return None;
                }
                open.hint = Hint::Asked;
                return Some(Do::AskHint {
                    ticket: self.ticket.clone(),
                    decision_id: decision.request.decision_id,
                });
            }
            KeyCode::Char('p') => match decision.pass_objection() {
                None => decision.pass(),
                Some(why) => {
                    why.clone_into(&mut self.notice);
                    return None;
                }
            },
            KeyCode::Char('d') if special => decision.declare()[0],
            KeyCode::Char('n') if special => decision.declare()[1],
            KeyCode::Enter | KeyCode::Char(' ') => match decision.objection() {
                None => decision.picked()?,
                Some(why) => {
                    self.notice = why;
                    return None;
                }
            },
            _ => return None,
        };
        open.sent = true;
        let decision_id = decision.request.decision_id;
        let action = u32::from(action.index());
        self.unacknowledged = Some(Do::Answer {
            decision_id,
            action,
            took_ms: now_ms.saturating_sub(open.since_ms),
        });
        self.unacknowledged.clone()
    }
}

/// Runs a key's effect that sends nothing.
fn done(act: impl FnOnce()) -> Option<Do> {
    act();
    None
}
