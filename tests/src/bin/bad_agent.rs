//! An agent that plays well except for one fault, given by name: the examiner must find it.
//! `bad_agent none ADDRESS CODE` plays without a fault; a further argument makes it play in a
//! tournament. It uses the protocol directly, because an SDK would prevent most of these faults.

use std::collections::BTreeMap;
use std::process::ExitCode;
use std::time::Duration;

use chefshat_proto::v1::{
    self, game_event::Kind, play_service_client::PlayServiceClient,
    room_service_client::RoomServiceClient, seat_command::Command, seat_update::Update,
    tournament_service_client::TournamentServiceClient,
};
use chefshat_tests::{first_legal, is_legal};
use tokio::sync::mpsc;
use tokio_stream::wrappers::ReceiverStream;
use tonic::transport::Channel;

/// Longer than any examination.
const FOREVER: Duration = Duration::from_secs(600);

type Failure = Box<dyn std::error::Error>;

/// State kept across connections.
struct Agent {
    fault: String,
    tournament: bool,
    ticket: String,
    seat: u32,
    last_event: u64,
}

/// How a stream ended.
enum End {
    GameOver,
    Lost,
}

#[tokio::main]
async fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().collect();
    let (fault, address, code, tournament) = match arguments.as_slice() {
        [_, fault, address, code] => (fault, address, code, false),
        [_, fault, address, code, _] => (fault, address, code, true),
        _ => {
            eprintln!("bad_agent FAULT ADDRESS CODE [tournament]");
            return ExitCode::from(2);
        }
    };
    match run(fault, address, code, tournament).await {
        Ok(code) => code,
        Err(error) => {
            eprintln!("bad_agent: {error}");
            ExitCode::FAILURE
        }
    }
}

async fn run(
    fault: &str,
    address: &str,
    code: &str,
    tournament: bool,
) -> Result<ExitCode, Failure> {
    if fault == "never-joins" {
        tokio::time::sleep(FOREVER).await;
    }
    let channel = Channel::from_shared(format!("http://{address}"))?
        .connect()
        .await?;
    let code = if fault == "wrong-code" { "NONE" } else { code };
    let (ticket, seat) = if tournament {
        (enter(&channel, code, fault).await?, 0)
    } else {
        let joined = join(&channel, code).await?;
        (joined.ticket, joined.seat)
    };
    let mut agent = Agent {
        fault: fault.to_owned(),
        tournament,
        ticket,
        seat,
        last_event: 0,
    };
    match fault {
        "never-attaches" => tokio::time::sleep(FOREVER).await,
        "wrong-ticket" => agent.ticket.push('x'),
        "uses-act" => return agent.act(channel).await,
        _ => {}
    }
    loop {
        match agent.play(channel.clone()).await {
            Ok(End::GameOver) => break,
            Ok(End::Lost) => {}
            // The server's port is closed while it restarts.
            Err(error) if is_unavailable(&*error) => {}
            Err(error) => return Err(error),
        }
        match fault {
            "no-reconnect" => return Ok(ExitCode::FAILURE),
            "joins-again" => agent.ticket = join(&channel, code).await?.ticket,
            _ => tokio::time::sleep(Duration::from_millis(50)).await,
        }
    }
    match fault {
        "never-exits" => tokio::time::sleep(FOREVER).await,
        "exit-status" => return Ok(ExitCode::from(3)),
        _ => {}
    }
    Ok(ExitCode::SUCCESS)
}

/// Whether no server answered.
fn is_unavailable(error: &(dyn std::error::Error + 'static)) -> bool {
    let status = error.downcast_ref::<tonic::Status>();
    status.is_some_and(|status| status.code() == tonic::Code::Unavailable)
}

async fn join(channel: &Channel, code: &str) -> Result<v1::JoinRoomResponse, Failure> {
    let request = v1::JoinRoomRequest {
        join_code: code.to_owned(),
        name: "bad".into(),
        ..v1::JoinRoomRequest::default()
    };
    let joined = RoomServiceClient::new(channel.clone())
        .join_room(request)
        .await?;
    Ok(joined.into_inner())
}

async fn enter(channel: &Channel, code: &str, fault: &str) -> Result<String, Failure> {
    let request = v1::JoinTournamentRequest {
        join_code: code.to_owned(),
        name: "bad".into(),
        max_games: if fault == "one-at-a-time" { 1 } else { 8 },
        ..v1::JoinTournamentRequest::default()
    };
    let joined = TournamentServiceClient::new(channel.clone())
        .join_tournament(request)
        .await?;
    Ok(joined.into_inner().ticket)
}

/// The sending side of a stream.
struct Voice(mpsc::Sender<v1::PlayRequest>);

impl Voice {
    async fn say(&self, handle: u32, command: Command) {
        let command = v1::SeatCommand {
            handle,
            command: Some(command),
        };
        // If the stream is lost, the receiving side reports it.
        let _lost = self
            .0
            .send(v1::PlayRequest {
                commands: vec![command],
            })
            .await;
    }

    async fn answer(&self, handle: u32, decision_id: u64, action: u32) {
        self.say(handle, Command::Answer(answer(decision_id, action)))
            .await;
    }
}

fn answer(decision_id: u64, action: u32) -> v1::Answer {
    v1::Answer {
        decision_id,
        action,
        annotations: None,
    }
}

impl Agent {
    /// Plays on one stream until it is lost or the game is over.
    async fn play(&mut self, channel: Channel) -> Result<End, Failure> {
        let (requests, queue) = mpsc::channel(16);
        let mut responses = PlayServiceClient::new(channel)
            .play(ReceiverStream::new(queue))
            .await?
            .into_inner();
        let voice = Voice(requests);
        let skipped = if self.fault == "skips-events" { 10 } else { 0 };
        let attach = v1::Attach {
            ticket: self.ticket.clone(),
            from_sequence: if self.last_event == 0 {
                0
            } else {
                self.last_event + 1 + skipped
            },
            ..v1::Attach::default()
        };
        voice.say(0, Command::Attach(attach)).await;
        if self.fault == "unasked" {
            // The second decision is requested when the first one has been answered.
            voice.answer(0, 2, 0).await;
        }
        let mut open: BTreeMap<u32, v1::DecisionRequest> = BTreeMap::new();
        loop {
            let updates = match responses.message().await {
                Ok(Some(response)) => response.updates,
                Ok(None) | Err(_) => return Ok(End::Lost),
            };
            for v1::SeatUpdate { handle, update } in updates {
                match update {
                    Some(Update::Events(batch)) => {
                        for event in batch.events {
                            self.event(handle, &voice, event).await;
                        }
                    }
                    Some(Update::Decision(decision)) => {
                        self.decide(handle, &voice, &decision).await;
                        open.insert(handle, decision);
                    }
                    Some(Update::Result(result)) => {
                        self.result(handle, &voice, &result, open.get(&handle))
                            .await;
                    }
                    Some(Update::Detached(detached))
                        if self.tournament && detached.reason() == v1::DetachReason::GameOver => {}
                    Some(Update::Detached(_)) => {
                        if self.fault == "never-leaves" {
                            tokio::time::sleep(FOREVER).await;
                        }
                        return Ok(End::GameOver);
                    }
                    Some(Update::Refused(refused)) if refused.request_id == 0 => {
                        eprintln!("refused: {}", refused.message);
                    }
                    _ => {}
                }
            }
        }
    }

    async fn event(&mut self, handle: u32, voice: &Voice, event: v1::GameEvent) {
        self.last_event = event.sequence;
        match event.kind {
            Some(Kind::Substituted(it))
                if it.seat == self.seat && self.fault != "never-resumes" =>
            {
                voice.say(handle, Command::Resume(v1::ResumeSeat {})).await;
            }
            Some(Kind::ShiftEnded(_)) if self.fault == "one-shift" => std::process::exit(0),
            _ => {}
        }
    }

    async fn decide(&self, handle: u32, voice: &Voice, decision: &v1::DecisionRequest) {
        let id = decision.decision_id;
        let legal = first_legal(decision);
        let illegal = (0..).find(|action| !is_legal(decision, *action));
        let illegal = illegal.expect("some action is illegal");
        match self.fault.as_str() {
            "silent" => {}
            // As if the seats attached by the server belonged to another client.
            "own-handles" if handle > 0 => {}
            "always-illegal" => voice.answer(handle, id, illegal).await,
            // As if all masks were the same.
            "ignores-mask" => {
                voice
                    .answer(handle, id, u32::try_from(id % 7).expect("small"))
                    .await
            }
            "answers-twice" => {
                voice.answer(handle, id, legal).await;
                voice.answer(handle, id, legal).await;
            }
            "wrong-decision" => voice.answer(handle, id + 7, legal).await,
            "two-hundred" => {
                let known = (0..200).find(|action| is_legal(decision, *action));
                voice.answer(handle, id, known.unwrap_or(199)).await;
            }
            "always-passes" => voice.answer(handle, id, 199).await,
            "wrong-handle" => {
                voice.answer(handle + 5, id, legal).await;
                voice.answer(handle, id, legal).await;
            }
            "floods" => {
                for _ in 0..2_000 {
                    voice.say(handle, Command::Resume(v1::ResumeSeat {})).await;
                }
                voice.answer(handle, id, legal).await;
            }
            "too-slow" => {
                tokio::time::sleep(Duration::from_secs(1)).await;
                voice.answer(handle, id, legal).await;
            }
            "large-annotations" | "large-message" => {
                let size = if self.fault == "large-message" {
                    70_000
                } else {
                    5_000
                };
                let annotations = v1::Annotations {
                    extra: [("reason".to_owned(), "x".repeat(size))].into(),
                    ..v1::Annotations::default()
                };
                let answer = v1::Answer {
                    annotations: Some(annotations),
                    ..answer(id, legal)
                };
                voice.say(handle, Command::Answer(answer)).await;
            }
            "bad-expression" => {
                // Without a label it is invalid.
                let expression = v1::Expression::default();
                voice.say(handle, Command::Express(expression)).await;
                voice.answer(handle, id, legal).await;
            }
            "detaches" => voice.say(handle, Command::Detach(v1::Detach {})).await,
            _ => voice.answer(handle, id, legal).await,
        }
    }

    async fn result(
        &self,
        handle: u32,
        voice: &Voice,
        result: &v1::AnswerResult,
        open: Option<&v1::DecisionRequest>,
    ) {
        let id = result.decision_id;
        let faulty = self.fault == "always-illegal" || self.fault == "ignores-mask";
        match (result.status(), self.fault.as_str()) {
            (v1::AnswerStatus::Invalid, "exits-when-refused") => std::process::exit(1),
            (v1::AnswerStatus::Invalid, "ignores-refusal") => {}
            (v1::AnswerStatus::Invalid, _) if result.invalid_attempts_left != Some(0) => {
                if let Some(open) = open.filter(|open| open.decision_id == id) {
                    let legal = if faulty {
                        result.action
                    } else {
                        first_legal(open)
                    };
                    voice.answer(handle, id, legal).await;
                }
            }
            (v1::AnswerStatus::Closed, "stale-forever") => {
                voice.answer(handle, id, result.action).await;
            }
            (v1::AnswerStatus::Closed, "stops-when-late") => std::process::exit(1),
            _ => {}
        }
    }

    /// Plays by single calls, as a browser may.
    async fn act(self, channel: Channel) -> Result<ExitCode, Failure> {
        let request = v1::ActRequest {
            ticket: self.ticket,
            command: Some(v1::act_request::Command::Answer(answer(1, 0))),
        };
        PlayServiceClient::new(channel).act(request).await?;
        tokio::time::sleep(FOREVER).await;
        Ok(ExitCode::SUCCESS)
    }
}
