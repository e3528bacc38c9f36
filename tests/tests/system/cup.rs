//! A realistic tournament of sixteen: agents in three languages and their own processes, one that
//! crashes, one that is silent, one that floods, one that never joins its games; and a server that
//! is killed twice in the middle.

use std::collections::BTreeSet;
use std::process::Stdio;
use std::time::Duration;

use chefshat_client::{Backoff, Client, Outcome, PlayError, PlayOptions, RandomAgent};
use chefshat_proto::v1::{
    self, Answer, play_service_client::PlayServiceClient, record_line::Line,
    seat_command::Command as SeatDoes,
};
use chefshat_tests::{Launch, PATIENCE, one_shift, patiently, scores, set_up};
use tokio::process::{Child, Command};
use tokio::sync::mpsc;
use tokio::task::JoinHandle;
use tokio_stream::wrappers::ReceiverStream;

const PARTICIPANTS: u32 = 16;
const ROUNDS: u32 = 2;
/// Tables per round.
const TABLES: u32 = 4;
/// SDK agents in this process.
const REGULARS: u32 = 6;
/// Lifetime of the crashing agent at first, and how much longer it lives each time, so that it is
/// present at some point even on a slow machine.
const LIFE: Duration = Duration::from_millis(150);
const LIVES_LONGER: Duration = Duration::from_millis(10);
/// Messages per burst of the flooding agent, and the pause between bursts. The tournament is long:
/// more would only take the processors from the others.
const FLOOD: u32 = 500;
const BETWEEN_FLOODS: Duration = Duration::from_millis(500);
/// Until a lost server is tried again.
const TRY_AGAIN: Duration = Duration::from_millis(100);
/// Until the tournament is looked at again.
const LOOK_AGAIN: Duration = Duration::from_millis(50);

fn options() -> PlayOptions {
    PlayOptions {
        backoff: Backoff {
            first: Duration::from_millis(5),
            max: Duration::from_millis(40),
            give_up_after: PATIENCE,
            ..Backoff::default()
        },
        ..PlayOptions::default()
    }
}

fn settings() -> v1::TournamentSettings {
    v1::TournamentSettings {
        name: "Coppa dello chef".into(),
        format: v1::TournamentFormat::Swiss.into(),
        rules: Some(one_shift()),
        rounds: ROUNDS,
        built_in_agents: vec!["greedy".into()],
        start_when_joined: PARTICIPANTS,
        // Each round takes as long, for one who never joins; the others, and a restarted server, take less
        // on any machine.
        no_show_time_ms: 20_000,
        policy: Some(v1::RoomPolicy {
            decision_time_ms: Some(1_000),
            bank_ms: Some(0),
            ..v1::RoomPolicy::default()
        }),
        ..v1::TournamentSettings::default()
    }
}

/// A participant's ticket.
async fn ticket(client: &Client, code: &str, name: &str, max_games: u32) -> String {
    let request = v1::JoinTournamentRequest {
        join_code: code.to_owned(),
        name: name.to_owned(),
        max_games,
        ..v1::JoinTournamentRequest::default()
    };
    let joined = client.join_tournament(request).await;
    joined.expect("joined").ticket
}

/// Plays to the end with the SDK.
fn regular(url: &str, ticket: String, seed: u64) -> JoinHandle<Result<Vec<Outcome>, PlayError>> {
    let url = url.to_owned();
    tokio::spawn(async move {
        // The server may be down at this moment.
        let client = loop {
            match Client::connect(&url).await {
                Ok(client) => break client,
                Err(_) => tokio::time::sleep(TRY_AGAIN).await,
            }
        };
        let make = |_: &v1::Attached| RandomAgent::new(seed);
        client.play_tournament_with(ticket, make, &options()).await
    })
}

/// An agent that crashes repeatedly and returns with nothing but its ticket.
fn crashing(url: &str, ticket: String) -> JoinHandle<()> {
    let url = url.to_owned();
    tokio::spawn(async move {
        let mut length = LIFE;
        loop {
            let life = regular(&url, ticket.clone(), 0);
            tokio::time::sleep(length).await;
            length += LIVES_LONGER;
            life.abort();
            if let Ok(Ok(_)) = life.await {
                return;
            }
        }
    })
}

/// An agent that attaches and never sends an answer; it reconnects when the connection is lost.
fn silent(url: &str, ticket: String) -> JoinHandle<()> {
    noisy(url, ticket, 0)
}

/// An agent that sends garbage faster than it can be processed, and never a valid answer.
fn flooding(url: &str, ticket: String) -> JoinHandle<()> {
    noisy(url, ticket, FLOOD)
}

fn noisy(url: &str, ticket: String, at_a_time: u32) -> JoinHandle<()> {
    let url = url.to_owned();
    tokio::spawn(async move {
        loop {
            if let Ok(client) = Client::connect(&url).await {
                // However it ends, it starts again.
                let _ = make_noise(client, &ticket, at_a_time).await;
            }
            tokio::time::sleep(TRY_AGAIN).await;
        }
    })
}

async fn make_noise(client: Client, ticket: &str, at_a_time: u32) -> Result<(), tonic::Status> {
    let (requests, queue) = mpsc::channel(4);
    let command = |handle, command| v1::SeatCommand {
        handle,
        command: Some(command),
    };
    let attach = v1::Attach {
        ticket: ticket.to_owned(),
        ..v1::Attach::default()
    };
    let commands = vec![command(0, SeatDoes::Attach(attach))];
    let _ = requests.send(v1::PlayRequest { commands }).await;
    let mut service = PlayServiceClient::new(client.channel());
    let mut responses = service.play(ReceiverStream::new(queue)).await?.into_inner();
    let mut sent = 0;
    loop {
        tokio::select! {
            response = responses.message() => if response?.is_none() { return Ok(()) },
            () = tokio::time::sleep(BETWEEN_FLOODS), if at_a_time > 0 => {
                let rubbish = (0..at_a_time).map(|number| {
                    sent += 1;
                    let answer = Answer {
                        decision_id: sent,
                        action: number,
                        annotations: None,
                    };
                    let handles = [0, 1 << 31, number, u32::MAX];
                    command(handles[number as usize % 4], SeatDoes::Answer(answer))
                });
                let commands = rubbish.collect();
                if requests.send(v1::PlayRequest { commands }).await.is_err() {
                    return Ok(());
                }
            }
        }
    }
}

/// Agents in their own processes, in the languages of the SDKs.
fn processes(url: &str, code: &str) -> Vec<(String, Child)> {
    let address = url.trim_start_matches("http://");
    let way_in = ["--address", address, "--tournament", code];
    let mut commands = Vec::new();
    let mut rust = Command::new(set_up("CHEFSHAT_BIN"));
    rust.args(["tournament", "join", "--agent", "greedy", "--server", url]);
    rust.args(["--code", code, "--name", "process"]);
    commands.push(("process".to_owned(), rust));
    for number in 1..=2 {
        let name = format!("python {number}");
        let mut python = Command::new(set_up("CHEFSHAT_PYTHON"));
        python.args(["-m", "chefshat.agent"]).args(way_in);
        python.args(["--name", &name]);
        commands.push((name, python));
        let name = format!("node {number}");
        let mut node = Command::new("node");
        node.arg("agent.js").args(way_in).args(["--name", &name]);
        node.current_dir(set_up("CHEFSHAT_NODE_DIR"));
        commands.push((name, node));
    }
    let started = commands.into_iter().map(|(name, mut command)| {
        command.stdin(Stdio::null()).stdout(Stdio::piped());
        let child = command.kill_on_drop(true).spawn();
        let child = child.unwrap_or_else(|error| panic!("{name} does not start: {error}"));
        (name, child)
    });
    started.collect()
}

/// All games of the tournament.
async fn games(client: &Client, tournament_id: &str) -> Vec<v1::TournamentGame> {
    let request = v1::ListTournamentGamesRequest {
        tournament_id: tournament_id.to_owned(),
        ..v1::ListTournamentGamesRequest::default()
    };
    let page = client.tournament_games(request).await.expect("a page");
    assert_eq!(page.next_page_token, "");
    page.games
}

/// Waits until this number of games are over and others are running.
async fn in_the_middle(client: &Client, tournament_id: &str, games_over: u32) {
    let reached = async {
        loop {
            let now = client.tournament(tournament_id).await.expect("it exists");
            let is_over = now.state() == v1::TournamentState::Finished;
            assert!(!is_over, "it ended before the server could be killed");
            if now.games_over >= games_over && now.games_playing > 0 {
                return;
            }
            tokio::time::sleep(LOOK_AGAIN).await;
        }
    };
    patiently("the middle", reached).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_tournament_of_sixteen_resumes_after_sigkill_and_counts_every_game_once() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let mut launch = Launch::new(folder.path());
    let mut server = launch.start().await.expect("the server starts");
    let url = launch.url();
    let client = Client::connect(&url).await.expect("the server listens");
    let made = client.create_tournament(settings()).await;
    let made = made.expect("created");
    let id = made.tournament.expect("a tournament").tournament_id;
    let code = made.join_code;
    let mut regulars = Vec::new();
    for number in 0..REGULARS {
        let name = format!("regular {number}");
        let ticket = ticket(&client, &code, &name, 1 + number % 2).await;
        regulars.push(regular(&url, ticket, number.into()));
    }
    let strange = [
        crashing(&url, ticket(&client, &code, "crashing", 1).await),
        silent(&url, ticket(&client, &code, "silent", 1).await),
        flooding(&url, ticket(&client, &code, "flooding", 1).await),
    ];
    ticket(&client, &code, "absent", 1).await;
    let processes = processes(&url, &code);

    // Once in each round.
    for games_over in [2, TABLES + 2] {
        in_the_middle(&client, &id, games_over).await;
        server.kill().await;
        server = launch.start().await.expect("the server restarts");
    }
    let mut follow = client.follow_tournament(&id);
    let mut last = None;
    while let Some(now) = patiently("the end", follow.next())
        .await
        .expect("an update")
    {
        last = now.tournament.or(last);
    }
    assert_eq!(
        last.expect("an update").state(),
        v1::TournamentState::Finished
    );
    for playing in regulars {
        let played = patiently("a regular", playing).await.expect("no panic");
        for outcome in played.expect("it played to the end") {
            assert!(outcome.standing().is_some(), "no game was aborted");
        }
    }
    for (name, child) in processes {
        let ended = patiently(&name, child.wait_with_output()).await;
        let ended = ended.expect("it has started");
        assert!(ended.status.success(), "{name}: {}", ended.status);
    }
    for task in strange {
        task.abort();
    }

    let games = games(&client, &id).await;
    let different: BTreeSet<&String> = games.iter().map(|game| &game.game_id).collect();
    assert_eq!(games.len(), (ROUNDS * TABLES) as usize);
    assert_eq!(different.len(), games.len());
    for game in &games {
        assert_eq!(game.state(), v1::TournamentGameState::Counted, "{game:?}");
    }
    // There are no other records of the tournament. A record may still be being written.
    let records = folder.path().join("records");
    let kept = || {
        let entries = std::fs::read_dir(&records).expect("a folder of records");
        let paths = entries.map(|entry| entry.expect("an entry").path());
        let mut kept = BTreeSet::new();
        for path in paths.filter(|path| path.extension().is_some_and(|it| it == "jsonl")) {
            let lines = chefshat_record::jsonl::read(&path).expect("a record");
            if let Some(Line::Header(header)) = &lines[0].line
                && header.tournament_id == id
            {
                kept.insert(header.game_id.clone());
            }
        }
        kept
    };
    let written = async {
        while kept().len() < different.len() {
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
    };
    patiently("all records", written).await;
    let kept = kept();
    assert_eq!(kept.iter().collect::<BTreeSet<_>>(), different);

    let results = client.tournament_results(&id).await.expect("results");
    let participants = &results.tournament.as_ref().expect("it").participants;
    let with_records: Vec<_> = (games.iter())
        .map(|game| {
            let path = chefshat_record::jsonl::path_of(folder.path(), &game.game_id);
            let lines = chefshat_record::jsonl::read(&path).expect("a record file");
            (game.clone(), lines)
        })
        .collect();
    let scores = scores(&with_records);
    assert_eq!(results.standings.len(), PARTICIPANTS as usize);
    for standing in &results.standings {
        assert_eq!(standing.score, scores[&standing.participant]);
        assert_eq!(standing.games, ROUNDS);
        let name = participants[standing.participant as usize].name.as_str();
        match name {
            "absent" => assert_eq!((standing.score, standing.forfeited), (0, ROUNDS)),
            "silent" => {
                assert!(standing.timeouts >= 3, "{standing:?}");
                assert_eq!(standing.substituted, ROUNDS, "{standing:?}");
            }
            _ => {}
        }
    }
    let by_score: Vec<u64> = results.standings.iter().map(|it| it.score).collect();
    assert!(by_score.is_sorted_by(|upper, lower| upper >= lower));
    assert!(server.stop().await.status.success());
}
