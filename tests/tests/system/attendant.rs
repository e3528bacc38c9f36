//! `chefshat table`: an attendant who types what happens at a physical table. The words are tested
//! beside their code.

use std::process::{Output, Stdio};

use chefshat_tests::{Launch, patiently, set_up};
use serde_json::Value;
use tokio::io::{AsyncBufReadExt as _, AsyncWriteExt as _, BufReader, Lines};
use tokio::process::{Child, ChildStdin, ChildStdout, Command};

fn chefshat(arguments: &[&str]) -> Command {
    let mut command = Command::new(set_up("CHEFSHAT_BIN"));
    command.args(arguments).kill_on_drop(true);
    command
}

async fn output(arguments: &[&str]) -> Output {
    let output = chefshat(arguments).output();
    patiently("the command", output)
        .await
        .expect("the binary starts")
}

/// The running command and its pipes.
struct Attendant {
    process: Child,
    input: ChildStdin,
    output: Lines<BufReader<ChildStdout>>,
    /// The last printed state.
    state: Value,
}

impl Attendant {
    fn start(arguments: &[&str]) -> Self {
        let mut process = chefshat(arguments)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .expect("the binary starts");
        Self {
            input: process.stdin.take().expect("a pipe"),
            output: BufReader::new(process.stdout.take().expect("a pipe")).lines(),
            process,
            state: Value::Null,
        }
    }

    /// Types lines.
    async fn types(&mut self, lines: &str) {
        let lines = format!("{lines}\n");
        let written = self.input.write_all(lines.as_bytes()).await;
        written.expect("the command reads");
    }

    /// The next printed line that is not a state.
    async fn answer(&mut self) -> Value {
        loop {
            let line = patiently("a line", self.output.next_line()).await;
            let line = line.expect("text").expect("the command runs");
            let mut value: Value = serde_json::from_str(&line).expect("JSON");
            match value["event"].as_str() {
                Some("state") => self.state = value["state"].take(),
                _ => return value,
            }
        }
    }

    /// Types lines of which the last is a report, and checks its verdict; returns the report's
    /// number.
    async fn reports(&mut self, lines: &str, verdict: &str) -> String {
        self.types(lines).await;
        let answer = self.answer().await;
        let response = &answer["response"];
        assert_eq!(response["verdict"], verdict, "{lines}: {answer}");
        response["report"].as_str().expect("a number").to_owned()
    }
}

#[tokio::test]
async fn the_first_turns_of_a_physical_game_are_typed() {
    const ACCEPTED: &str = "REPORT_VERDICT_ACCEPTED";
    const VIOLATION: &str = "REPORT_VERDICT_VIOLATION";
    let data = tempfile::tempdir().expect("a temporary folder");
    let mut launch = Launch::new(data.path());
    let server = launch.start().await.expect("the server starts");
    let url = launch.url();
    let seats = ["table=Ada", "table=Bo", "table=Cy", "greedy=Greta"];
    let seats = seats.iter().flat_map(|seat| ["--seat", seat]);
    let create = ["room", "create", "--physical", "--json", "--server", &url];
    let create: Vec<&str> = create.into_iter().chain(seats).collect();
    let created = output(&create).await;
    let created: Value = serde_json::from_slice(&created.stdout).expect("the room");
    let ticket = created["table_ticket"].as_str().expect("a ticket");
    let link = created["attendant_link"].as_str().expect("a link");
    assert!(link.ends_with(&format!("/table#ticket={ticket}")), "{link}");

    let table = ["--server", &url, "--ticket", ticket, "--json"];
    let attend: Vec<&str> = ["table"].into_iter().chain(table).collect();
    let mut attendant = Attendant::start(&attend);
    attendant.types("lay the cards").await;
    assert_eq!(attendant.answer().await["event"], "problem");
    let hand = "hand 1 2 2 3 3 3 4 4 5 5 6 6 7 8 9 10 11 no golden";
    attendant.reports(hand, ACCEPTED).await;
    attendant.reports("Ada: golden", ACCEPTED).await;
    attendant.reports("Bo: 11", VIOLATION).await;
    let misread = attendant.reports("10", ACCEPTED).await;
    let correction = format!("correct {misread}: 9");
    attendant.reports(&correction, ACCEPTED).await;
    attendant.reports("Cy: pass", ACCEPTED).await;
    // What a built-in agent decides is laid for it.
    attendant.reports("wait\ndone", ACCEPTED).await;
    attendant.types("state").await;
    drop(attendant.input);
    while let Some(line) = patiently("the end", attendant.output.next_line())
        .await
        .expect("text")
    {
        let mut value: Value = serde_json::from_str(&line).expect("JSON");
        attendant.state = value["state"].take();
    }
    let ended = patiently("the end", attendant.process.wait()).await;
    assert!(ended.expect("it ends").success());
    let state = attendant.state;
    assert_eq!(state["waitingFor"], "It is Ada's turn.", "{state}");
    let texts: Vec<&str> = (state["reports"].as_array().expect("reports").iter())
        .filter_map(|report| report["text"].as_str())
        .collect();
    let expected = [
        "The hand of Greta was seen",
        "Ada laid an 11",
        "Bo laid a 9",
        "Cy passed",
    ];
    assert_eq!(texts[..4], expected, "{state}");

    // One report, with its verdict as the exit code.
    let report = |line| {
        let words = ["table", "report"].into_iter().chain(table);
        words.chain([line]).collect::<Vec<_>>()
    };
    assert_eq!(output(&report("Bo: 1")).await.status.code(), Some(1));
    assert_eq!(output(&report("Ada: pass")).await.status.code(), Some(0));
    assert_eq!(output(&report("Ada plays")).await.status.code(), Some(1));
    // A stop would wait for the end of the game.
    server.kill().await;
}
