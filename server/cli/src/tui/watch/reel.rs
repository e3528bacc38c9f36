//! Steps through the events of a game, forwards and back: position, speed, visible hands. Takes
//! events, keys and the time; `view` draws it.

use std::collections::BTreeMap;

use chefshat_client::v1::{self, game_event::Kind};
use ratatui::crossterm::event::KeyCode;

use crate::narration::awaited::AwaitedSeat;
use crate::narration::story;
use crate::narration::view::GameView;
use crate::tui::log::Log;
use crate::tui::screen::Key;

/// Milliseconds per event at each speed, slowest first.
const PACES_MS: [u64; 7] = [4000, 2000, 1000, 500, 250, 100, 25];
/// The default speed.
const STANDARD_PACE: usize = 2;

/// A game to step through.
#[derive(Debug)]
pub(super) struct Reel {
    /// The state before the first event.
    start: GameView,
    events: Vec<v1::GameEvent>,
    /// What the log says about hints, by the number of events before it.
    hints: BTreeMap<usize, Vec<story::Line>>,
    /// Number of events applied.
    pub(super) at: usize,
    pub(super) table: GameView,
    pub(super) running: bool,
    pace: usize,
    /// When it last advanced on its own.
    moved_ms: u64,
    /// More events may come.
    pub(super) live: bool,
    /// The events are those of a record.
    pub(super) recorded: bool,
    /// Whom a live game waits for.
    awaited: Option<AwaitedSeat>,
    /// The same in words, as of the last tick.
    pub(super) waiting: Option<String>,
    /// Why no more events come although the game has not ended.
    pub(super) lost: Option<String>,
    pub(super) hands: bool,
    pub(super) help: bool,
    pub(super) log: Log,
    pub(super) left: bool,
}

impl Reel {
    /// A finished game, running from its first deal.
    pub(super) fn recorded(
        start: GameView,
        events: Vec<v1::GameEvent>,
        hints: BTreeMap<usize, Vec<story::Line>>,
    ) -> Self {
        let first = events.iter().position(is_deal).map_or(0, |at| at + 1);
        let mut reel = Self::new(start, events, false);
        reel.hints = hints;
        reel.wind_to(first);
        reel
    }

    /// A live game, at its newest event.
    pub(super) fn live(start: GameView) -> Self {
        Self::new(start, Vec::new(), true)
    }

    fn new(start: GameView, events: Vec<v1::GameEvent>, live: bool) -> Self {
        Self {
            table: start.clone(),
            start,
            events,
            hints: BTreeMap::new(),
            at: 0,
            running: true,
            pace: STANDARD_PACE,
            moved_ms: 0,
            live,
            recorded: !live,
            awaited: None,
            waiting: None,
            lost: None,
            hands: !live,
            help: false,
            log: Log::default(),
            left: false,
        }
    }

    /// Number of events.
    pub(super) fn len(&self) -> usize {
        self.events.len()
    }

    /// Events per second.
    pub(super) fn per_second(&self) -> f64 {
        // At most 4000: exact.
        1000.0 / f64::from(u32::try_from(PACES_MS[self.pace]).unwrap_or(u32::MAX))
    }

    /// Adds a live event; shown at once if the newest was shown.
    pub(super) fn push(&mut self, event: v1::GameEvent) {
        let follows = self.running && self.at == self.events.len();
        self.events.push(event);
        if follows {
            self.wind_to(self.events.len());
        }
    }

    /// Starts over from a snapshot in place of events that are gone.
    pub(super) fn restore(&mut self, snapshot: &v1::Snapshot) {
        self.start.clone_from(&self.table);
        self.start.restore(snapshot, None);
        self.table.clone_from(&self.start);
        self.log = Log::default();
        self.log.add(vec![story::unknown_before()]);
        self.events.clear();
        self.at = 0;
    }

    /// Takes whom a live game waits for.
    pub(super) fn wait_for(&mut self, awaited: &v1::Awaited, now_ms: u64) {
        self.awaited = AwaitedSeat::new(awaited, now_ms);
        self.count_waiting(now_ms);
    }

    /// Brings the words about waiting up to date; whether they changed.
    fn count_waiting(&mut self, now_ms: u64) -> bool {
        let newest = self.live && self.at == self.events.len();
        let awaited = self.awaited.as_ref().filter(|_| newest);
        let words = awaited.and_then(|awaited| awaited.words(&self.table, now_ms));
        std::mem::replace(&mut self.waiting, words) != self.waiting
    }

    /// Ends a live game; with the reason if it has not ended.
    pub(super) fn close(&mut self, why: Option<String>) {
        self.live = false;
        self.waiting = None;
        self.lost = why;
    }

    /// Advances if it is time; whether anything changed.
    pub(super) fn tick(&mut self, now_ms: u64) -> bool {
        let advanced = self.advance(now_ms);
        self.count_waiting(now_ms) || advanced
    }

    fn advance(&mut self, now_ms: u64) -> bool {
        let due = now_ms.saturating_sub(self.moved_ms) >= PACES_MS[self.pace];
        if !self.running || !due || self.at == self.events.len() {
            return false;
        }
        self.moved_ms = now_ms;
        self.wind_to(self.at + 1);
        true
    }

    /// Takes a key.
    pub(super) fn key(&mut self, key: Key, now_ms: u64) {
        let code = match key {
            Key::Resized => return,
            Key::Interrupt => {
                self.left = true;
                return;
            }
            Key::Code(code) => code,
        };
        if std::mem::take(&mut self.help) {
            return;
        }
        if self.log.key(code) {
            // Stop while the person reads the log.
            self.running &= !self.log.is_open();
            return;
        }
        self.moved_ms = now_ms;
        match code {
            KeyCode::Char('q') | KeyCode::Esc => self.left = true,
            KeyCode::Char('?') => self.help = true,
            KeyCode::Char('h') => self.hands = !self.hands,
            KeyCode::Char(' ') => self.running = !self.running,
            KeyCode::Up | KeyCode::Char('+') => {
                self.pace = (self.pace + 1).min(PACES_MS.len() - 1);
            }
            KeyCode::Down | KeyCode::Char('-') => self.pace = self.pace.saturating_sub(1),
            KeyCode::Left => self.stop_at(self.at.saturating_sub(1)),
            KeyCode::Right => self.stop_at(self.at + 1),
            KeyCode::Char('S') => self.stop_at(self.shift_before()),
            KeyCode::Char('s') => self.stop_at(self.shift_after()),
            KeyCode::Home => self.stop_at(0),
            KeyCode::End => {
                self.wind_to(self.events.len());
                // Follow a live game from here on.
                self.running = self.live;
            }
            _ => {}
        }
    }

    fn stop_at(&mut self, at: usize) {
        self.running = false;
        self.wind_to(at);
    }

    /// The last deal before the current event.
    fn shift_before(&self) -> usize {
        let before = &self.events[..self.at.saturating_sub(1)];
        before.iter().rposition(is_deal).map_or(0, |at| at + 1)
    }

    /// The next deal.
    fn shift_after(&self) -> usize {
        let after = self.events[self.at..].iter().position(is_deal);
        after.map_or(self.events.len(), |at| self.at + at + 1)
    }

    /// Moves to the state after `at` events.
    fn wind_to(&mut self, at: usize) {
        let at = at.min(self.events.len());
        if at < self.at {
            self.table = self.start.clone();
            self.log = Log::default();
            self.at = 0;
        }
        for (before, event) in (self.at..).zip(&self.events[self.at..at]) {
            self.log
                .add(self.hints.get(&before).cloned().unwrap_or_default());
            self.log.follow(&mut self.table, event);
        }
        self.at = at;
    }
}

fn is_deal(event: &v1::GameEvent) -> bool {
    matches!(event.kind, Some(Kind::ShiftStarted(_)))
}
