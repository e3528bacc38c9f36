//! The part that a person takes: one game, or those of a tournament one after the other, with its lobby between them. Where a ticket has more games
//! at a time, one is on the screen, and one that asks comes to it as soon as that does not. Keys, messages and the time go in, what is to be
//! done comes out; what happens in a game is in `app`, how a tournament stands in `lobby`. No terminal and no connection.

use std::collections::VecDeque;

use chefshat_client::v1::{self, seat_update::Update};
use ratatui::crossterm::event::KeyCode;

use super::app::{App, Do, Input, Link};
use super::lobby::{Lobby, Report};
use crate::narration::view::GameView;
use crate::numbers::counted;
use crate::tui::screen::Key;

/// How long the result of a game stays before the lobby or the next game takes its place.
const RESULT_MS: u64 = 12_000;
/// And if the person is asked in the next game already, whose clock runs.
const SHORT_RESULT_MS: u64 = 3_000;

/// What happens to a part.
#[derive(Debug)]
pub(super) enum Heard {
    Key(Key),
    /// Time has passed.
    Tick,
    /// The place in a tournament is attached.
    Entered(v1::Entered),
    /// How the tournament stands.
    Report(Box<Report>),
    /// That will not be told any more, and why.
    Unfollowed(String),
    /// A seat is attached; of a game not heard of before, its room, where the server told it.
    Seated(v1::Attached, Option<Box<v1::Room>>),
    /// The server said something to the seat of a game.
    Told(String, Box<Update>),
    /// No more comes of a game that is not over, and why.
    Gone(String, String),
    /// The connection is lost, and why; it is being made again.
    Lost(String),
    /// Nothing more will come from the server; why, if that is not the end.
    Over(Option<String>),
}

/// What stands over everything.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Over {
    Help,
    Leave,
}

/// A part.
#[derive(Debug)]
pub(super) struct Part {
    /// Of a tournament.
    pub(super) lobby: Option<Lobby>,
    /// The game on the screen.
    pub(super) game: Option<App>,
    /// Those that wait for the screen, in the order in which they came to wait: while the result of another is shown, or another goes on.
    waiting: VecDeque<App>,
    /// When the game on the screen ended.
    ended_ms: Option<u64>,
    /// The lobby is shown although a game goes on.
    pub(super) peek: bool,
    pub(super) over: Option<Over>,
    pub(super) link: Link,
    pub(super) left: bool,
}

impl Part {
    /// A part before anything was heard; of a room the table may be known.
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

    /// Takes what happened at `now_ms` of any clock that goes on; what is to be done, and in which game.
    pub(super) fn take(&mut self, heard: Heard, now_ms: u64) -> Option<(String, Do)> {
        let act = match heard {
            Heard::Key(key) => self.key(key, now_ms),
            Heard::Told(game, update) => {
                let what = self.in_game(&game, Input::Update(update), now_ms);
                what.map(|what| (game, what))
            }
            heard => {
                self.hear(heard, now_ms);
                None
            }
        };
        self.go_on(now_ms);
        act
    }

    fn hear(&mut self, heard: Heard, now_ms: u64) {
        match heard {
            Heard::Key(_) | Heard::Told(..) | Heard::Tick => {}
            Heard::Entered(entered) => {
                self.link = Link::Live;
                let lobby = self.lobby.get_or_insert_with(|| {
                    Lobby::new(entered.tournament_id.clone(), entered.participant)
                });
                lobby.notice.clear();
            }
            Heard::Report(report) => {
                if let Some(lobby) = &mut self.lobby {
                    lobby.report = Some(*report);
                }
            }
            Heard::Unfollowed(why) => {
                if let Some(lobby) = &mut self.lobby {
                    lobby.notice = format!("standings are not told any more: {why}");
                }
            }
            Heard::Seated(attached, room) => self.seated(attached, room, now_ms),
            Heard::Gone(game, why) => {
                self.in_game(&game, Input::Over(Some(why)), now_ms);
            }
            Heard::Lost(why) => {
                for app in self.apps() {
                    app.take(Input::Lost(why.clone()), now_ms);
                }
                self.link = Link::Lost(why);
            }
            Heard::Over(why) => {
                for app in self.apps() {
                    app.take(Input::Over(why.clone()), now_ms);
                }
                // Where nothing was ever shown, a box over nothing would not help.
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

    /// Lets the next game, or the lobby, take the place of a game that is over, when its result was to be seen long enough; and one that asks
    /// that of one that does not.
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
                false => "Another game of yours has begun. Enter goes to it",
                true => "Enter: the standings",
            };
        }
        let ended = *self.ended_ms.get_or_insert(now_ms);
        let asked = self.first_to_ask().is_some();
        let long = if asked { SHORT_RESULT_MS } else { RESULT_MS };
        let reads = self.game.as_ref().is_some_and(|it| it.scroll.is_open());
        if now_ms.saturating_sub(ended) >= long && (asked || !reads) {
            self.dismiss();
        }
    }

    /// Which of the waiting games has asked for the longest time.
    fn first_to_ask(&self) -> Option<usize> {
        let asking = self.waiting.iter().enumerate();
        let asking = asking.filter_map(|(at, app)| Some((app.asks_since()?, at)));
        asking.min().map(|(_, at)| at)
    }

    /// The game that comes to the screen next: that which asks, else that which has waited longest.
    fn take_next(&mut self) -> Option<App> {
        let at = self.first_to_ask().unwrap_or(0);
        self.waiting.remove(at)
    }

    /// What the waiting games are to the person who looks at another.
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
        let over = self.is_over();
        match (&mut self.game, &mut self.lobby) {
            (Some(game), None) => {
                let what = game.take(Input::Key(key), now_ms)?;
                self.left |= what == Do::Leave;
                Some((game.table.game_id.clone(), what))
            }
            (Some(game), Some(_)) if is_over(game) => {
                match code {
                    code if game.scroll.key(code, &game.table) => {}
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
            (None, lobby) => {
                match (code, lobby) {
                    (KeyCode::Char('q') | KeyCode::Esc, _) => self.ask_to_leave(),
                    (KeyCode::Char('?'), _) => self.over = Some(Over::Help),
                    (KeyCode::Enter, _) if over => self.left = true,
                    (code, Some(lobby)) => lobby.key(code),
                    _ => {}
                }
                None
            }
        }
    }

    /// Leaves at once where that loses nothing.
    fn ask_to_leave(&mut self) {
        let playing = self.apps().any(|app| !is_over(app));
        let to_come = self.lobby.as_ref().is_none_or(Lobby::has_games_to_come);
        if self.is_over() || !(playing || to_come) {
            self.left = true;
        } else {
            self.over = Some(Over::Leave);
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
