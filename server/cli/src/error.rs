//! What every command shares: its error, and a line of output.

use std::fmt::Display;
use std::io::{self, Write as _};
use std::process::ExitCode;

/// Why a command failed, as a message for the user.
pub type CommandError = Box<dyn std::error::Error + Send + Sync>;

/// Writes a line to standard output.
pub fn say(line: impl Display) -> Result<(), CommandError> {
    Ok(writeln!(io::stdout().lock(), "{line}")?)
}

/// Writes a line to standard error, for a program that runs on if nobody can read it.
pub fn tell(line: impl Display) {
    let _ = writeln!(io::stderr().lock(), "{}", plain(line));
}

/// A text with words of a server or a file, which may contain anything, without what steers a
/// terminal, such as escape codes.
pub(crate) fn plain(text: impl Display) -> String {
    let steers = |sign: char| sign.is_control() && !['\n', '\t'].contains(&sign);
    text.to_string().replace(steers, "")
}

/// The exit code of a command that has printed all it has to say, also if the reader of the output
/// has closed it before.
///
/// # Errors
/// The output cannot be written for another reason.
pub fn after_printing(printed: io::Result<()>, code: ExitCode) -> Result<ExitCode, CommandError> {
    match printed {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => Err(error.into()),
        _ => Ok(code),
    }
}

/// Whether the reader of the output has closed it, as `head` does. A command returns this error
/// unchanged, and ends well.
pub fn is_broken_pipe(error: &CommandError) -> bool {
    error
        .downcast_ref::<io::Error>()
        .is_some_and(|error| error.kind() == io::ErrorKind::BrokenPipe)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_of_others_do_not_steer_the_terminal() {
        let said = plain("a\u{1b}[2J\tb\r\n\u{9b}31mc\u{7}");
        assert_eq!(said, "a[2J\tb\n31mc");
    }
}
