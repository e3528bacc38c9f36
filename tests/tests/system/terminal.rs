//! `chefshat play` and `chefshat watch` in a real terminal (see `tmux`). The tests beside their
//! code check the screens in detail.

use std::path::{Path, PathBuf};
use std::process::Command;

use chefshat_client::{Client, v1};
use chefshat_tests::{Launch, one_shift, set_up};
use tempfile::TempDir;

use crate::tmux::Terminal;

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
    // Two sizes it must cope with, and the first again.
    terminal.tmux(&["resize-window", "-x", "60", "-y", "20"]);
    terminal.wait_for("The table needs").await;
    terminal.tmux(&["resize-window", "-x", "120", "-y", "40"]);
    terminal.wait_for("your hand").await;
    terminal.tmux(&["resize-window", "-x", "80", "-y", "24"]);
    let decisions = terminal.play("the game is over").await;
    assert!(decisions > 5, "{decisions} decisions only");
    terminal.press("Enter");
    let said = terminal.ended(0).await;
    assert!(said.contains("you have place"), "{said}");

    let record = only_record(data.path());
    let record = record.to_str().expect("a path of text");
    let mut verify = Command::new(set_up("CHEFSHAT_BIN"));
    let verified = verify
        .args(["verify", record])
        .output()
        .expect("the program starts");
    assert!(verified.status.success(), "{verified:?}");
    let text = std::fs::read_to_string(record).expect("a record file");
    // The record has what the person's terminal measured.
    assert!(text.contains("person_decision_time_ms"), "{text}");

    let watched =
        Terminal::start("and watches the record", &["watch", record]).expect("tmux is installed");
    watched.wait_for("hands").await;
    watched.press("End");
    watched.wait_for("wins the game").await;
    watched.press("Home");
    watched.wait_for(" 0/").await;
    watched.signal("-INT");
    let left = watched.ended(0).await;
    assert!(!left.contains("the pizza"), "{left}");
}

#[tokio::test]
async fn a_game_continues_when_the_server_returns_and_is_watched() {
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
        Terminal::start(test, &["watch", &room_id, "--server", &url]).expect("tmux is installed");
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

/// A room for one person and three built-in agents, without time pressure: its join code and its
/// id.
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
                pace_ms: Some(0),
                ..v1::RoomPolicy::default()
            }),
            seats: seats
                .map(|filled_by| v1::SeatConfig {
                    filled_by: Some(filled_by),
                    ..v1::SeatConfig::default()
                })
                .collect(),
            ..v1::CreateRoomRequest::default()
        })
        .await
        .expect("a new room");
    (made.join_code, made.room.expect("a room").room_id)
}

#[tokio::test]
async fn leaving_restores_the_terminal() {
    let data = TempDir::new().expect("a temporary folder");
    let folder = data.path().to_str().expect("a path of text");
    let play = ["play", "--local", "--data-dir", folder];
    let Some(terminal) = Terminal::start("leaving_restores_the_terminal", &play) else {
        return;
    };
    terminal.wait_for("your hand").await;
    terminal.press("q");
    terminal.wait_for("Leave the table?").await;
    terminal.press("y");
    let said = terminal.ended(1).await;
    assert!(said.contains("you left"), "{said}");

    let terminated = Terminal::start("and so does a signal", &play).expect("tmux is installed");
    terminated.wait_for("your hand").await;
    terminated.signal("-TERM");
    terminated.ended(1).await;
}

/// Joins a tournament of built-in agents by its code, leaves in the middle, and resumes with the
/// ticket, through a restart of the server, to the end.
#[tokio::test]
async fn a_person_plays_a_tournament_of_built_in_agents_to_its_end() {
    let data = TempDir::new().expect("a temporary folder");
    let mut launch = Launch::new(data.path());
    let server = launch.start().await.expect("the server listens");
    let url = launch.url();
    let client = Client::connect(&url).await.expect("the server listens");
    let (code, tournament_id) = tournament(&client).await;
    let test = "a_person_plays_a_tournament_of_built_in_agents_to_its_end";
    let join = ["play", "--server", &url, "--code", &code, "--name", "Ada"];
    let Some(terminal) = Terminal::start(test, &join) else {
        return;
    };
    // A game that waits for nobody else starts on its own, and its result is shown.
    terminal.wait_for("your hand").await;
    terminal.play("the game is over").await;
    terminal.press("q");
    terminal.wait_for("Leave the tournament?").await;
    terminal.press("y");
    let said = terminal.ended(1).await;
    let (_, ticket) = said.rsplit_once("CHEFSHAT_TICKET=").expect("how to resume");
    let ticket = ticket.split_whitespace().next().expect("a ticket");

    let back = ["play", "--server", &url, "--ticket", ticket];
    let terminal = Terminal::start(test, &back).expect("tmux is installed");
    terminal.wait_for("your hand").await;
    server.kill().await;
    terminal.wait_for("Connection lost, reconnecting").await;
    let server = launch.start().await.expect("the server listens");
    terminal.wait_for("● connected").await;
    let decisions = terminal.play("final standings").await;
    assert!(decisions > 3, "{decisions} decisions only");
    let end = terminal.wait_for("q ends").await;
    assert!(end.contains("Ada (you)"), "{end}");
    terminal.press("q");
    let said = terminal.ended(0).await;
    assert!(said.contains("the tournament is over: you are"), "{said}");

    let client = Client::connect(&url).await.expect("the server listens");
    let results = client.tournament_results(tournament_id).await;
    let results = results.expect("results");
    let games: Vec<u32> = results.standings.iter().map(|line| line.games).collect();
    let forfeited: u32 = results.standings.iter().map(|line| line.forfeited).sum();
    assert_eq!((games, forfeited), (vec![3; 4], 0));
    server.stop().await;
}

/// A tournament of three rounds for one person and three built-in agents, without time pressure:
/// its join code and its id.
async fn tournament(client: &Client) -> (String, String) {
    let made = client
        .create_tournament(v1::TournamentSettings {
            name: "friday".into(),
            format: v1::TournamentFormat::Swiss.into(),
            rounds: 3,
            rules: Some(one_shift()),
            policy: Some(v1::RoomPolicy {
                decision_time_ms: Some(3_600_000),
                pace_ms: Some(0),
                ..v1::RoomPolicy::default()
            }),
            built_in_agents: ["greedy", "random", "greedy"].map(Into::into).into(),
            start_when_joined: 4,
            no_show_time_ms: 3_600_000,
            ..v1::TournamentSettings::default()
        })
        .await
        .expect("created");
    let tournament = made.tournament.expect("a tournament");
    (made.join_code, tournament.tournament_id)
}

/// Refusals end with a sentence that gives advice.
#[tokio::test]
async fn refusals_give_advice() {
    let data = TempDir::new().expect("a temporary folder");
    let mut launch = Launch::new(data.path());
    let server = launch.start().await.expect("the server listens");
    let url = launch.url();
    let client = Client::connect(&url).await.expect("the server listens");
    let (code, _) = room(&client).await;
    let taken = client.join(v1::JoinRoomRequest {
        join_code: code.clone(),
        name: "Ben".into(),
        kind: v1::ParticipantKind::Human.into(),
        ..v1::JoinRoomRequest::default()
    });
    taken.await.expect("a free seat");
    let long = "x".repeat(65);
    let table: [(&[&str], &str); 5] = [
        (&["--code", "ZZZZZZZZ"], "check the code"),
        (&["--code", &code], "chefshat watch"),
        (&["--code", &code, "--name", &long], "another --name"),
        (&["--ticket", "00"], "join again"),
        (
            &["--code", &code, "--server", "http://127.0.0.1:9"],
            "chefshat serve",
        ),
    ];
    for (arguments, todo) in table {
        let play = [&["play"], arguments].concat();
        let play = match arguments.contains(&"--server") {
            true => play,
            false => [play.as_slice(), &["--server", &url]].concat(),
        };
        let Some(terminal) = Terminal::start("refusals_give_advice", &play) else {
            return;
        };
        let said = terminal.ended(1).await;
        assert!(said.contains(todo), "{arguments:?}: {said}");
    }
    server.stop().await;
}

/// The only record in a data folder.
fn only_record(data_dir: &Path) -> PathBuf {
    let records = std::fs::read_dir(data_dir.join("records")).expect("a folder of records");
    let mut records = records.map(|entry| entry.expect("an entry").path());
    let record = records.next().expect("a record");
    assert_eq!(records.next(), None);
    record
}
