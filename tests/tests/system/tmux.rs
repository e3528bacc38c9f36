//! A real terminal for tests: tmux, controlled by keys, with a readable screen.

use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

use chefshat_tests::{PATIENCE, set_up, skip};
use tempfile::TempDir;
use tokio::time::sleep;

/// Interval between two reads of the screen.
const PAUSE: Duration = Duration::from_millis(50);

/// A terminal; closed when dropped.
pub(crate) struct Terminal {
    /// tmux's socket, in its own folder.
    folder: TempDir,
}

impl Terminal {
    /// Starts the program in a terminal of 80 columns and 24 rows; without tmux reports that and
    /// returns `None`.
    pub(crate) fn start(test: &str, arguments: &[&str]) -> Option<Self> {
        let there = Command::new("tmux")
            .arg("-V")
            .stdout(Stdio::null())
            .status();
        if !there.is_ok_and(|status| status.success()) {
            skip(test, "tmux is not installed; run `apt-get install tmux`");
            return None;
        }
        let terminal = Self {
            folder: TempDir::new().expect("a temporary folder"),
        };
        let words = arguments.iter().map(|word| format!("'{word}'"));
        let words = words.collect::<Vec<_>>().join(" ");
        let binary = set_up("CHEFSHAT_BIN");
        let binary = binary.display();
        // The program's last output, its exit code and the restored terminal stay readable.
        let line = format!(
            "before=$(stty -g); '{binary}' {words}; echo \"ended with $?\"; \
             [ \"$before\" = \"$(stty -g)\" ] && echo 'terminal as before'; exec cat"
        );
        let started = terminal.tmux(&[
            "-f",
            "/dev/null",
            "new-session",
            "-d",
            "-x",
            "80",
            "-y",
            "24",
            &line,
        ]);
        assert!(started.status.success(), "{started:?}");
        Some(terminal)
    }

    pub(crate) fn tmux(&self, arguments: &[&str]) -> Output {
        let mut command = Command::new("tmux");
        for (name, _) in std::env::vars_os() {
            let name = name.to_string_lossy().into_owned();
            if name.starts_with("CHEFSHAT_") || name.starts_with("TMUX") {
                command.env_remove(name);
            }
        }
        command.env("LC_ALL", "C.UTF-8").arg("-S");
        command.arg(self.folder.path().join("socket"));
        command
            .args(arguments)
            .output()
            .expect("the program starts")
    }

    pub(crate) fn press(&self, key: &str) {
        let pressed = self.tmux(&["send-keys", key]);
        assert!(pressed.status.success(), "{pressed:?}");
    }

    /// Sends the program a signal; keys cannot, because the terminal passes them on unchanged.
    pub(crate) fn signal(&self, signal: &str) {
        let shell = self.tmux(&["display-message", "-p", "#{pane_pid}"]).stdout;
        let shell = String::from_utf8(shell).expect("a process id");
        let sent = Command::new("pkill")
            .args([signal, "-P", shell.trim()])
            .status();
        assert!(sent.is_ok_and(|status| status.success()), "{shell}");
    }

    /// The screen, with wrapped lines joined.
    fn screen(&self) -> String {
        let screen = self.tmux(&["capture-pane", "-p", "-J"]).stdout;
        String::from_utf8(screen).expect("text")
    }

    /// Waits until the program has exited with this code and the terminal is restored.
    pub(crate) async fn ended(&self, code: u8) -> String {
        let said = self.wait_for("terminal as before").await;
        assert!(said.contains(&format!("ended with {code}")), "{said}");
        said
    }

    /// Waits until the screen meets a condition.
    async fn wait(&self, what: &str, wanted: impl Fn(&str) -> bool) -> String {
        let begun = Instant::now();
        loop {
            let screen = self.screen();
            if wanted(&screen) {
                return screen;
            }
            assert!(
                begun.elapsed() < PATIENCE,
                "timed out waiting for {what}:\n{screen}"
            );
            sleep(PAUSE).await;
        }
    }

    pub(crate) async fn wait_for(&self, words: &str) -> String {
        self.wait(words, |screen| screen.contains(words)).await
    }

    /// Plays by what the screen says until it says `until`; returns the number of decisions.
    pub(crate) async fn play(&self, until: &str) -> usize {
        let begun = Instant::now();
        let mut decisions = 0;
        loop {
            let screen = self.screen();
            if screen.contains(until) {
                return decisions;
            }
            let key = if screen.contains("you cannot play") {
                Some("p")
            } else if screen.contains("Your turn: play") || screen.contains("Give a card") {
                Some("Enter")
            } else if screen.contains("Two jokers!") {
                Some("d")
            } else if screen.contains("Enter: the standings") || screen.contains("Enter goes to it")
            {
                Some("Enter")
            } else {
                None
            };
            if let Some(key) = key {
                decisions += 1;
                self.press(key);
                // The next iteration reads the result.
                self.wait("answer", |now| now != screen).await;
            }
            assert!(begun.elapsed() < PATIENCE, "no end:\n{screen}");
            sleep(PAUSE).await;
        }
    }
}

impl Drop for Terminal {
    fn drop(&mut self) {
        self.tmux(&["kill-server"]);
    }
}
