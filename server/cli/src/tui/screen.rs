//! The terminal itself: made ready and given back as it was, keys as they come. What they mean is decided elsewhere.

use std::io::{self, IsTerminal as _};
use std::process::ExitCode;
use std::thread;
use std::time::Duration;

use ratatui::DefaultTerminal;
use ratatui::Frame;
use ratatui::crossterm::event::{self, Event, KeyCode, KeyEvent, KeyEventKind, KeyModifiers};
use ratatui::crossterm::terminal::is_raw_mode_enabled;
use tokio::sync::mpsc;

use super::super::CommandError;

/// Keys that may wait to be understood.
const KEYS: usize = 64;
/// How often the reader of keys looks whether it is still wanted.
const LOOK: Duration = Duration::from_millis(100);
/// Exit code of a command that has no terminal to draw on.
const NO_TERMINAL: u8 = 2;

/// What comes from the person.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Key {
    /// A key.
    Code(KeyCode),
    /// Ctrl-C, and what ends the terminal.
    Interrupt,
    /// The window has another size.
    Resized,
}

/// The screen while it is ours; given back when dropped.
pub(crate) struct Screen {
    terminal: DefaultTerminal,
    /// Keys, in order.
    pub(crate) keys: mpsc::Receiver<Key>,
}

impl Screen {
    /// Takes the terminal.
    ///
    /// # Errors
    /// The terminal cannot be used.
    pub(crate) fn open() -> Result<Self, CommandError> {
        let terminal = ratatui::try_init()?;
        let (sender, keys) = mpsc::channel(KEYS);
        thread::spawn(move || read(&sender));
        Ok(Self { terminal, keys })
    }

    /// Draws a picture.
    ///
    /// # Errors
    /// The terminal is gone.
    pub(crate) fn draw(&mut self, picture: impl FnOnce(&mut Frame<'_>)) -> io::Result<()> {
        self.terminal.draw(picture).map(|_| ())
    }
}

impl Drop for Screen {
    fn drop(&mut self) {
        // A panic, on whatever task, has given it back before it said why; a second time would put what comes next over its words.
        if is_raw_mode_enabled().unwrap_or(true) {
            ratatui::restore();
        }
    }
}

/// Says that there is no terminal, where there is none, and with which code the command ends.
pub(crate) fn missing(instead: &str) -> Option<ExitCode> {
    if io::stdout().is_terminal() && io::stdin().is_terminal() {
        return None;
    }
    anstream::eprintln!("chefshat: this command draws on a terminal, and here is none; {instead}");
    Some(ExitCode::from(NO_TERMINAL))
}

/// Waits until somebody wants this process to end. The signals are caught from the call on: one that comes before the wait does not leave the
/// terminal as it is. Ctrl-C is a key here; an interrupt comes from outside.
///
/// # Errors
/// The operating system does not tell.
pub(crate) fn asked_to_end() -> io::Result<impl Future<Output = ()>> {
    use tokio::signal::unix::{SignalKind, signal};
    let mut interrupt = signal(SignalKind::interrupt())?;
    let mut terminate = signal(SignalKind::terminate())?;
    let mut hang_up = signal(SignalKind::hangup())?;
    Ok(async move {
        tokio::select! {
            _ = interrupt.recv() => {}
            _ = terminate.recv() => {}
            _ = hang_up.recv() => {}
        }
    })
}

/// Reads keys until nobody wants them any more.
fn read(keys: &mpsc::Sender<Key>) {
    while !keys.is_closed() {
        let key = match event::poll(LOOK) {
            Ok(false) => continue,
            Ok(true) => event::read(),
            Err(error) => Err(error),
        };
        let key = match key {
            Ok(Event::Key(key)) if key.kind != KeyEventKind::Release => key_of(key),
            Ok(Event::Resize(..)) => Some(Key::Resized),
            Ok(_) => None,
            // The terminal is gone; closing the channel says so.
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
