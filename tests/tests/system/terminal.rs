//! `chefshat play` and `chefshat watch` in a real terminal: tmux, whose keys a test presses and whose screen it reads. What the screens say in
//! detail is tested beside their code.

use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

use chefshat_client::{Client, v1};
use chefshat_tests::{Launch, PATIENCE, one_shift, set_up, skip};
use tempfile::TempDir;
use tokio::time::sleep;

/// Time between two looks at the screen.
const PAUSE: Duration = Duration::from_millis(50);

/// A terminal; gone when dropped.
struct Terminal {
    /// tmux's socket, in a folder of its own.
    folder: TempDir,
}

impl Terminal {
    /// Starts the program in a terminal of 80 columns and 24 rows; `None`, said, where there is no tmux.
    fn start(test: &str, arguments: &[&str]) -> Option<Self> {
        let there = Command::new("tmux")
            .arg("-V")
            .stdout(Stdio::null())
            .status();
        if !there.is_ok_and(|status| status.success()) {
            skip(test, "there is no tmux; `apt-get install tmux` brings it");
            return None;
        }
        let terminal = Self {
            folder: TempDir::new().expect("a temporary folder"),
        };
        let words = arguments.iter().map(|word| format!("'{word}'"));
        let words = words.collect::<Vec<_>>().join(" ");
        let binary = set_up("CHEFSHAT_BIN");
        let binary = binary.display();
        // What the program says after its screen, and its end, stay to be read.
        let line = format!("'{binary}' {words}; echo \"ended with $?\"; exec cat");
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

    fn tmux(&self, arguments: &[&str]) -> Output {
        let mut command = Command::new("tmux");
        for (name, _) in std::env::vars_os() {
            let name = name.to_string_lossy().into_owned();
            if name.starts_with("CHEFSHAT_") || name.starts_with("TMUX") {
                command.env_remove(name);
            }
        }
        command.env("LC_ALL", "C.UTF-8").arg("-S");
        command.arg(self.folder.path().join("socket"));
        command.args(arguments).output().expect("the program runs")
    }

    fn press(&self, key: &str) {
        let pressed = self.tmux(&["send-keys", key]);
        assert!(pressed.status.success(), "{pressed:?}");
    }

    /// Interrupts the program from outside, as no key does: the terminal gives keys to it as they are.
    fn interrupt(&self) {
        let shell = self.tmux(&["display-message", "-p", "#{pane_pid}"]).stdout;
        let shell = String::from_utf8(shell).expect("a number is text");
        let told = Command::new("pkill")
            .args(["-INT", "-P", shell.trim()])
            .status();
        assert!(told.is_ok_and(|status| status.success()), "{shell}");
    }

    fn screen(&self) -> String {
        String::from_utf8(self.tmux(&["capture-pane", "-p"]).stdout).expect("a screen is text")
    }

    /// Waits until the screen is as wanted.
    async fn wait(&self, what: &str, wanted: impl Fn(&str) -> bool) -> String {
        let begun = Instant::now();
        loop {
            let screen = self.screen();
            if wanted(&screen) {
                return screen;
            }
            assert!(begun.elapsed() < PATIENCE, "no {what}:\n{screen}");
            sleep(PAUSE).await;
        }
    }

    async fn wait_for(&self, words: &str) -> String {
        self.wait(words, |screen| screen.contains(words)).await
    }

    /// Plays as a person would, by what the screen says, until it says `until`; gives the number of decisions.
    async fn play(&self, until: &str) -> usize {
        let begun = Instant::now();
        let mut decisions = 0;
        loop {
            let screen = self.screen();
            if screen.contains(until) {
                return decisions;
            }
            let key = if screen.contains("nothing can be played") {
                Some("p")
            } else if screen.contains("Your turn: play") || screen.contains("Give a card") {
                Some("Enter")
            } else if screen.contains("Two jokers!") {
                Some("d")
            } else {
                None
            };
            if let Some(key) = key {
                decisions += 1;
                self.press(key);
                // The next look is for what came of it.
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

#[tokio::test]
async fn a_person_plays_two_shifts_with_one_command() {
    let data = TempDir::new().expect("a temporary folder");
    let folder = data.path().to_str().expect("a path of text");
    let Some(terminal) = Terminal::start(
        "a_person_plays_two_shifts_with_one_command",
        &[
            "play",
            "--local",
            "--name",
            "Ada",
            "--target-shifts",
            "2",
            "--pace-ms",
            "0",
            "--times",
            "--data-dir",
            folder,
        ],
    ) else {
        return;
    };
    terminal.wait_for("your hand").await;
    terminal.press("?");
    terminal.wait_for("to another card").await;
    terminal.press("?");
    // Two sizes it must bear with, and the first again.
    terminal.tmux(&["resize-window", "-x", "60", "-y", "20"]);
    terminal.wait_for("The table needs").await;
    terminal.tmux(&["resize-window", "-x", "120", "-y", "40"]);
    terminal.wait_for("your hand").await;
    terminal.tmux(&["resize-window", "-x", "80", "-y", "24"]);
    let decisions = terminal.play("the game is over").await;
    assert!(decisions > 5, "{decisions} decisions only");
    terminal.press("Enter");
    let said = terminal.wait_for("ended with").await;
    assert!(said.contains("ended with 0"), "{said}");
    assert!(said.contains("you have place"), "{said}");

    let record = only_record(data.path());
    let record = record.to_str().expect("a path of text");
    let mut verify = Command::new(set_up("CHEFSHAT_BIN"));
    let verified = verify
        .args(["verify", record])
        .output()
        .expect("the program runs");
    assert!(verified.status.success(), "{verified:?}");
    let text = std::fs::read_to_string(record).expect("the record is there");
    // What the person's side measured stands with the decisions.
    assert!(text.contains("person_decision_time_ms"), "{text}");

    let watched =
        Terminal::start("and watches the record", &["watch", record]).expect("tmux is there");
    watched.wait_for("hands").await;
    watched.press("End");
    watched.wait_for("wins the game").await;
    watched.press("Home");
    watched.wait_for(" 0/").await;
    watched.interrupt();
    let left = watched.wait_for("ended with 0").await;
    assert!(!left.contains("the pizza"), "{left}");
}

#[tokio::test]
async fn a_game_goes_on_when_the_server_comes_back_and_is_watched() {
    let data = TempDir::new().expect("a temporary folder");
    let mut launch = Launch::new(data.path());
    let server = launch.start().await.expect("the server listens");
    let url = launch.url();
    let client = Client::connect(&url).await.expect("the server listens");
    let (code, room_id) = room(&client).await;
    let test = "a_game_goes_on_when_the_server_comes_back_and_is_watched";
    let join = ["play", "--server", &url, "--code", &code, "--name", "Ada"];
    let Some(terminal) = Terminal::start(test, &join) else {
        return;
    };
    let spectator =
        Terminal::start(test, &["watch", &room_id, "--server", &url]).expect("tmux is there");
    terminal.wait_for("Your turn").await;
    spectator.wait_for("● live").await;
    let spectated = spectator.wait_for("Ada").await;
    assert!(spectated.contains("person"), "{spectated}");

    server.kill().await;
    terminal.wait_for("connection lost").await;
    let server = launch.start().await.expect("the server listens");
    terminal.wait_for("● connected").await;
    terminal.play("the game is over").await;
    terminal.press("Enter");
    terminal.wait_for("ended with 0").await;
    spectator.wait_for("wins the game").await;
    server.stop().await;
}

/// A room for one person and three built-in agents, without hurry: its join code and its id.
async fn room(client: &Client) -> (String, String) {
    use v1::seat_config::FilledBy::{BuiltInAgent, ReservedFor};
    let person = ReservedFor(v1::ParticipantKind::Human.into());
    let agents = ["greedy", "random", "greedy"].map(|kind| BuiltInAgent(kind.into()));
    let seats = std::iter::once(person).chain(agents);
    let made = client
        .create_room(v1::CreateRoomRequest {
            rules: Some(one_shift()),
            policy: Some(v1::RoomPolicy {
                decision_time_ms: Some(3_600_000),
                ..v1::RoomPolicy::default()
            }),
            seats: seats
                .map(|filled_by| v1::SeatConfig {
                    filled_by: Some(filled_by),
                })
                .collect(),
            ..v1::CreateRoomRequest::default()
        })
        .await
        .expect("the room is made");
    (
        made.join_code,
        made.room.expect("the server says which").room_id,
    )
}

#[tokio::test]
async fn leaving_gives_the_terminal_back() {
    let data = TempDir::new().expect("a temporary folder");
    let folder = data.path().to_str().expect("a path of text");
    let play = ["play", "--local", "--data-dir", folder];
    let Some(terminal) = Terminal::start("leaving_gives_the_terminal_back", &play) else {
        return;
    };
    terminal.wait_for("your hand").await;
    terminal.press("q");
    terminal.wait_for("Leave the table?").await;
    terminal.press("y");
    let said = terminal.wait_for("ended with").await;
    assert!(said.contains("ended with 1"), "{said}");
    assert!(said.contains("you left"), "{said}");
}

/// The one record in a data folder.
fn only_record(data_dir: &Path) -> PathBuf {
    let records = std::fs::read_dir(data_dir.join("records")).expect("records were written");
    let mut records = records.map(|entry| entry.expect("an entry").path());
    let record = records.next().expect("a record was written");
    assert_eq!(records.next(), None);
    record
}
