//! The terminal: opened and restored, with its keys, ticks and the signals that end the process.
//! What a key means is decided in `play` and `watch`.

use std::io::{self, IsTerminal as _};
use std::process::ExitCode;
use std::thread;
use std::time::Duration;

use ratatui::DefaultTerminal;
use ratatui::Frame;
use ratatui::crossterm::event::{self, Event, KeyCode, KeyEvent, KeyEventKind, KeyModifiers};
use ratatui::crossterm::terminal::is_raw_mode_enabled;
use tokio::sync::mpsc;
use tokio::time::{Instant, Interval, MissedTickBehavior, interval};

use crate::error::{CommandError, tell};
use crate::stops::Stops;

/// Keys that may wait to be handled.
const KEYS: usize = 64;
/// How often the key reader checks whether the screen is still open.
const POLL: Duration = Duration::from_millis(100);
/// Exit code of a command without a terminal.
const NO_TERMINAL: u8 = 2;

/// Input from the person.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Key {
    Code(KeyCode),
    /// Ctrl-C, a signal, or the end of the terminal.
    Interrupt,
    Resized,
}

/// Why `Screen::next` returned.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Wake {
    Key(Key),
    Tick,
}

/// The open screen. Dropping it restores the terminal.
pub(crate) struct Screen {
    terminal: DefaultTerminal,
    keys: mpsc::Receiver<Key>,
    ticks: Interval,
    opened: Instant,
    stops: Stops,
}

impl Screen {
    /// Opens the screen; `tick` is the time between two ticks. Signals are caught from here on, so
    /// that none leaves the terminal in raw mode.
    ///
    /// # Errors
    /// The terminal or the signals are unavailable.
    pub(crate) fn open(tick: Duration) -> Result<Self, CommandError> {
        let stops = Stops::catch()?.with_hang_up()?;
        let mut ticks = interval(tick);
        ticks.set_missed_tick_behavior(MissedTickBehavior::Skip);
        let terminal = ratatui::try_init()?;
        let (sender, keys) = mpsc::channel(KEYS);
        thread::spawn(move || read(&sender));
        Ok(Self {
            terminal,
            keys,
            ticks,
            opened: Instant::now(),
            stops,
        })
    }

    /// Milliseconds since the screen was opened.
    pub(crate) fn now_ms(&self) -> u64 {
        u64::try_from(self.opened.elapsed().as_millis()).unwrap_or(u64::MAX)
    }

    /// Waits for a key, a signal or the next tick. Cancel safe.
    pub(crate) async fn next(&mut self) -> Wake {
        tokio::select! {
            key = self.keys.recv() => Wake::Key(key.unwrap_or(Key::Interrupt)),
            _ = self.ticks.tick() => Wake::Tick,
            _ = self.stops.next() => Wake::Key(Key::Interrupt),
        }
    }

    /// Draws a frame.
    ///
    /// # Errors
    /// The terminal is gone.
    pub(crate) fn draw(&mut self, picture: impl FnOnce(&mut Frame<'_>)) -> io::Result<()> {
        self.terminal.draw(picture).map(|_| ())
    }
}

impl Drop for Screen {
    fn drop(&mut self) {
        // The panic hook has restored it already; a second restore would overwrite the panic
        // message.
        if is_raw_mode_enabled().unwrap_or(true) {
            ratatui::restore();
        }
    }
}

/// Prints an error and returns the exit code if there is no interactive terminal; `instead` names
/// commands that work without one.
pub(crate) fn missing(instead: &str) -> Option<ExitCode> {
    if io::stdout().is_terminal() && io::stdin().is_terminal() {
        return None;
    }
    tell(format_args!(
        "chefshat: this command needs an interactive terminal; {instead}"
    ));
    Some(ExitCode::from(NO_TERMINAL))
}

/// Reads keys until the screen is closed.
fn read(keys: &mpsc::Sender<Key>) {
    while !keys.is_closed() {
        let key = match event::poll(POLL) {
            Ok(false) => continue,
            Ok(true) => event::read(),
            Err(error) => Err(error),
        };
        let key = match key {
            Ok(Event::Key(key)) if key.kind != KeyEventKind::Release => key_of(key),
            Ok(Event::Resize(..)) => Some(Key::Resized),
            Ok(_) => None,
            // The terminal is gone: the closed channel is the signal.
            Err(_) => return,
        };
        if let Some(key) = key
            && keys.blocking_send(key).is_err()
        {
            return;
        }
    }
}

fn key_of(key: KeyEvent) -> Option<Key> {
    if key.modifiers.contains(KeyModifiers::CONTROL) {
        return matches!(key.code, KeyCode::Char('c' | 'd')).then_some(Key::Interrupt);
    }
    Some(Key::Code(key.code))
}
