//! The state of `chefshat play`: one game, or the games of a tournament with the lobby between
//! them. If a ticket has several games at a time, one is on screen; another with an open decision
//! replaces it once it has none. Takes keys, messages and the time, returns actions; `app` has one
//! game, `lobby` the tournament. No terminal and no connection.

use std::collections::VecDeque;

use chefshat_client::v1::{self, seat_update::Update};
use ratatui::crossterm::event::KeyCode;

use super::app::{App, Do, Input, Link};
use super::lobby::{Lobby, Report};
use crate::narration::view::GameView;
use crate::numbers::counted;
use crate::tui::screen::Key;

/// How long a result is shown before the lobby or the next game.
const RESULT_MS: u64 = 12_000;
/// The same if the next game already waits for a decision.
const SHORT_RESULT_MS: u64 = 3_000;

/// Input of a part.
#[derive(Debug)]
pub(super) enum PartInput {
    Key(Key),
    /// Time has passed.
    Tick,
    /// The place in a tournament was attached.
    Entered(v1::Entered),
    /// A report of the tournament.
    Report(Box<Report>),
    /// No more reports follow, with the reason.
    Unfollowed(String),
    /// A seat was attached; for a new game with its room, if known.
    Seated(v1::Attached, Option<Box<v1::Room>>),
    /// An update for the seat of a game.
    Update(String, Box<Update>),
    /// The hint for a decision of a game, or why there is none.
    Hint(String, u64, Result<v1::Hint, String>),
    /// A game is lost before its end, with the reason.
    Gone(String, String),
    /// The connection was lost, with the reason; it is being restored.
    Lost(String),
    /// The connection ended for good; with the reason if the game has not ended.
    Over(Option<String>),
}

/// A dialog over everything.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Over {
    Help,
    Leave,
}

/// What a person plays.
#[derive(Debug)]
pub(super) struct Part {
    /// The tournament, if it is one.
    pub(super) lobby: Option<Lobby>,
    /// The game on screen.
    pub(super) game: Option<App>,
    /// The games that wait for the screen, in order of arrival.
    waiting: VecDeque<App>,
    /// When the game on the screen ended.
    ended_ms: Option<u64>,
    /// The lobby is shown during a game.
    pub(super) peek: bool,
    pub(super) over: Option<Over>,
    pub(super) link: Link,
    pub(super) left: bool,
}

impl Part {
    /// Before the first input; `game` is the room, if known.
    pub(super) fn new(game: Option<App>) -> Self {
        Self {
            lobby: None,
            game,
            waiting: VecDeque::new(),
            ended_ms: None,
            peek: false,
            over: None,
            link: Link::Connecting,
            left: false,
        }
    }

    /// Handles an input at `now_ms` of a monotonic clock; returns an action and its game.
    pub(super) fn take(&mut self, heard: PartInput, now_ms: u64) -> Option<(String, Do)> {
        let act = match heard {
            PartInput::Key(key) => self.key(key, now_ms),
            PartInput::Update(game, update) => {
                let what = self.in_game(&game, Input::Update(update), now_ms);
                what.map(|what| (game, what))
            }
            heard => {
                self.handle(heard, now_ms);
                None
            }
        };
        self.go_on(now_ms);
        act
    }

    fn handle(&mut self, heard: PartInput, now_ms: u64) {
        match heard {
            PartInput::Key(_) | PartInput::Update(..) | PartInput::Tick => {}
            PartInput::Entered(entered) => {
                self.link = Link::Live;
                let lobby = self.lobby.get_or_insert_with(|| {
                    Lobby::new(entered.tournament_id.clone(), entered.participant)
                });
                lobby.notice.clear();
            }
            PartInput::Report(report) => {
                if let Some(lobby) = &mut self.lobby {
                    lobby.report = Some(*report);
                }
            }
            PartInput::Unfollowed(why) => {
                if let Some(lobby) = &mut self.lobby {
                    lobby.notice = format!("no more updates of the standings: {why}");
                }
            }
            PartInput::Seated(attached, room) => self.seated(attached, room, now_ms),
            PartInput::Hint(game, decision_id, hint) => {
                self.in_game(&game, Input::Hint(decision_id, hint), now_ms);
            }
            PartInput::Gone(game, why) => {
                self.in_game(&game, Input::Over(Some(why)), now_ms);
            }
            PartInput::Lost(why) => {
                for app in self.apps() {
                    app.take(Input::Lost(why.clone()), now_ms);
                }
                self.link = Link::Lost(why);
            }
            PartInput::Over(why) => {
                for app in self.apps() {
                    app.take(Input::Over(why.clone()), now_ms);
                }
                // Without a game or lobby a popup would hang over an empty screen.
                self.left |= self.game.is_none() && self.lobby.is_none();
                self.link = Link::Over(why);
            }
        }
    }

    fn apps(&mut self) -> impl Iterator<Item = &mut App> {
        self.game.iter_mut().chain(&mut self.waiting)
    }

    fn in_game(&mut self, game: &str, input: Input, now_ms: u64) -> Option<Do> {
        let mut apps = self.apps();
        let app = apps.find(|app| app.table.game_id == game)?;
        app.take(input, now_ms)
    }

    fn seated(&mut self, attached: v1::Attached, room: Option<Box<v1::Room>>, now_ms: u64) {
        self.link = Link::Live;
        let id = attached.game_id.clone();
        let seat = attached.seat;
        let attached = || Input::Update(Box::new(Update::Attached(attached)));
        let known = self.apps().any(|app| app.table.game_id == id);
        if known {
            self.in_game(&id, attached(), now_ms);
            return;
        }
        let table = room.map_or_else(GameView::default, |room| GameView::of_room(&room));
        let table = GameView {
            game_id: id,
            ..table
        };
        let mut app = App::new(table, Some(seat));
        app.take(attached(), now_ms);
        self.waiting.push_back(app);
    }

    fn go_on(&mut self, now_ms: u64) {
        self.show(now_ms);
        let others = self.others();
        if let Some(game) = &mut self.game {
            game.others = others;
        }
    }

    /// Replaces a finished game by the next game or the lobby after its result was shown, and a
    /// game without a decision by one that has one.
    fn show(&mut self, now_ms: u64) {
        let Some(game) = &self.game else {
            self.game = self.take_next();
            self.peek &= self.game.is_none();
            return;
        };
        if game.open.is_some() || is_over(game) {
            self.peek = false;
        }
        if !is_over(game) {
            if game.open.is_none()
                && game.takes_keys()
                && let Some(at) = self.first_to_ask()
            {
                let shown = std::mem::replace(&mut self.game, self.waiting.remove(at));
                self.waiting.extend(shown);
                self.peek = false;
            }
            return;
        }
        if self.lobby.is_none() {
            return;
        }
        let standing = self.lobby.as_ref().and_then(Lobby::in_short);
        if let Some(game) = &mut self.game {
            game.standing = standing;
            game.then = match self.waiting.is_empty() {
                false => "Another of your games has started. Enter goes to it",
                true => "Enter: the standings",
            };
        }
        let ended = *self.ended_ms.get_or_insert(now_ms);
        let asked = self.first_to_ask().is_some();
        let long = if asked { SHORT_RESULT_MS } else { RESULT_MS };
        let reads = self.game.as_ref().is_some_and(|it| it.log.is_open());
        if now_ms.saturating_sub(ended) >= long && (asked || !reads) {
            self.dismiss();
        }
    }

    /// The waiting game whose decision is open longest.
    fn first_to_ask(&self) -> Option<usize> {
        let asking = self.waiting.iter().enumerate();
        let asking = asking.filter_map(|(at, app)| Some((app.asks_since()?, at)));
        asking.min().map(|(_, at)| at)
    }

    /// Takes the next game: one with an open decision, or else the one that has waited longest.
    fn take_next(&mut self) -> Option<App> {
        let at = self.first_to_ask().unwrap_or(0);
        self.waiting.remove(at)
    }

    /// Notice about the waiting games.
    fn others(&self) -> Option<String> {
        let going = || self.waiting.iter().filter(|app| !is_over(app));
        let asking = going().filter(|app| app.asks_since().is_some()).count();
        let (number, what) = match (asking, going().count()) {
            (_, 0) => return None,
            (0, waiting) => (waiting, "wait"),
            (asking, _) => (asking, "ask"),
        };
        let end = if number == 1 { "s" } else { "" };
        Some(format!(
            "{} {what}{end}",
            counted(number as u64, "other game")
        ))
    }

    fn dismiss(&mut self) {
        if let (Some(game), Some(lobby)) = (&self.game, &mut self.lobby) {
            lobby.played(game);
        }
        self.ended_ms = None;
        self.peek = false;
        self.game = self.take_next();
    }

    fn key(&mut self, key: Key, now_ms: u64) -> Option<(String, Do)> {
        let code = match key {
            Key::Resized => return None,
            Key::Interrupt => {
                self.left = true;
                return None;
            }
            Key::Code(code) => code,
        };
        if let Some(over) = self.over.take() {
            self.left |= over == Over::Leave && matches!(code, KeyCode::Char('y' | 'Y'));
            return None;
        }
        if std::mem::take(&mut self.peek) {
            return None;
        }
        match (&mut self.game, &mut self.lobby) {
            (Some(game), None) => {
                let what = game.take(Input::Key(key), now_ms)?;
                self.left |= what == Do::Leave;
                Some((game.table.game_id.clone(), what))
            }
            (Some(game), Some(_)) if is_over(game) => {
                match code {
                    code if game.ends_line(code) || game.log.key(code) => {}
                    KeyCode::Enter | KeyCode::Char(' ') | KeyCode::Esc => self.dismiss(),
                    KeyCode::Char('q') => self.ask_to_leave(),
                    _ => {}
                }
                None
            }
            (Some(game), Some(_)) => match code {
                KeyCode::Char('q') | KeyCode::Esc if game.takes_keys() => {
                    self.ask_to_leave();
                    None
                }
                KeyCode::Char('s') if game.takes_keys() => {
                    self.peek = true;
                    None
                }
                _ => {
                    let what = game.take(Input::Key(key), now_ms)?;
                    Some((game.table.game_id.clone(), what))
                }
            },
            // Not Enter: it may be meant for a result that has just left the screen.
            (None, lobby) => {
                match (code, lobby) {
                    (KeyCode::Char('q') | KeyCode::Esc, _) => self.ask_to_leave(),
                    (KeyCode::Char('?'), _) => self.over = Some(Over::Help),
                    (code, Some(lobby)) => lobby.key(code),
                    _ => {}
                }
                None
            }
        }
    }

    /// Leaves without a question if no game is lost by it.
    fn ask_to_leave(&mut self) {
        let playing = self.apps().any(|app| !is_over(app));
        let to_come = self.lobby.as_ref().is_none_or(Lobby::has_games_to_come);
        if self.is_over() || !(playing || to_come) {
            self.left = true;
        } else {
            self.over = Some(Over::Leave);
        }
    }

    /// Whether the game or tournament has ended, so that its ticket is used up.
    pub(super) fn has_result(&self) -> bool {
        match (&self.lobby, &self.game) {
            (Some(lobby), _) => lobby.is_over() || self.link == Link::Over(None),
            (None, Some(game)) => game.table.end.is_some(),
            (None, None) => false,
        }
    }

    /// Whether nothing more happens.
    pub(super) fn is_over(&self) -> bool {
        let ended = self.lobby.as_ref().is_some_and(Lobby::is_over);
        ended || matches!(self.link, Link::Over(_))
    }
}

fn is_over(app: &App) -> bool {
    app.table.end.is_some() || matches!(app.link, Link::Over(_))
}
