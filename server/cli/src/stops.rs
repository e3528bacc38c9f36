//! How a person or the operating system asks a program to end.

use std::io;
use std::process::ExitCode;

#[cfg(windows)]
use tokio::signal::windows as system;

/// The signals of this system, by the names that Windows has for its own.
#[cfg(unix)]
mod system {
    use std::io;

    pub(super) use tokio::signal::unix::{
        Signal as CtrlC, Signal as CtrlBreak, Signal as CtrlClose,
    };
    use tokio::signal::unix::{SignalKind, signal};

    pub(super) fn ctrl_c() -> io::Result<CtrlC> {
        signal(SignalKind::interrupt())
    }

    pub(super) fn ctrl_break() -> io::Result<CtrlBreak> {
        signal(SignalKind::terminate())
    }

    pub(super) fn ctrl_close() -> io::Result<CtrlClose> {
        signal(SignalKind::hangup())
    }
}

/// Exit code after Ctrl-C, as shells use it.
const INTERRUPTED: u8 = 130;

/// What asked the program to end.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stop {
    /// Ctrl-C.
    Interrupt,
    /// `SIGTERM`, or Ctrl-Break on Windows.
    Terminate,
    /// The end of the terminal.
    HangUp,
}

impl Stop {
    /// The exit code of a program that ends for it before its work is done.
    #[must_use]
    pub fn exit_code(self) -> ExitCode {
        match self {
            Self::Interrupt => ExitCode::from(INTERRUPTED),
            Self::Terminate | Self::HangUp => ExitCode::FAILURE,
        }
    }
}

/// What asks a program to end, from its first call on.
#[derive(Debug)]
pub struct Stops {
    interrupt: system::CtrlC,
    terminate: system::CtrlBreak,
    hang_up: Option<system::CtrlClose>,
}

impl Stops {
    /// Catches interrupts and terminations.
    ///
    /// # Errors
    /// The system has no place for them.
    pub fn catch() -> io::Result<Self> {
        Ok(Self {
            interrupt: system::ctrl_c()?,
            terminate: system::ctrl_break()?,
            hang_up: None,
        })
    }

    /// Catches also the end of the terminal, which else ends the program at once.
    ///
    /// # Errors
    /// The system has no place for it.
    pub fn with_hang_up(self) -> io::Result<Self> {
        Ok(Self {
            hang_up: Some(system::ctrl_close()?),
            ..self
        })
    }

    /// Waits for the next one. Cancel safe.
    pub async fn next(&mut self) -> Stop {
        let Self {
            interrupt,
            terminate,
            hang_up,
        } = self;
        let hung_up = async {
            match hang_up {
                Some(hang_up) => hang_up.recv().await,
                None => std::future::pending().await,
            }
        };
        tokio::select! {
            _ = interrupt.recv() => Stop::Interrupt,
            _ = terminate.recv() => Stop::Terminate,
            _ = hung_up => Stop::HangUp,
        }
    }
}
