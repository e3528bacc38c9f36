//! Sequences of events as data: messages of agent and server, and the faults found. The system
//! tests run the cases against real agents.

mod interferences;
mod manners;

use std::os::unix::process::ExitStatusExt as _;
use std::process::ExitStatus;

use chefshat_proto::v1::{self, AnswerStatus};

use super::*;

const PATIENCE: Patience = Patience {
    start: Duration::from_secs(30),
    each: Duration::from_secs(5),
};
/// Actions 1, 2 and 5.
const MASK: [u8; 1] = [0b0010_0110];
const ACTIONS: u32 = 8;
const ILLEGAL: u32 = 0;

/// A step of a sequence.
#[derive(Clone)]
#[expect(clippy::large_enum_variant, reason = "a test holds a few")]
enum Step {
    /// The agent takes its seat.
    Join,
    /// It opens a stream and attaches, requesting events from a number on; the server attaches it.
    Attach(u64),
    /// It sends a command on its newest stream.
    Says(u32, Command),
    /// The server sends an update.
    Receives(Update),
    /// This number of seconds pass.
    Wait(u64),
    /// The agent leaves its newest stream.
    Leave,
    /// Its process exits with this status.
    Exit(i32),
}
use Step::{Attach, Exit, Join, Leave, Receives, Says, Wait};

fn answer(decision_id: u64, action: u32) -> Step {
    let answer = v1::Answer {
        decision_id,
        action,
        annotations: None,
    };
    Says(0, Command::Answer(answer))
}

fn request(decision_id: u64) -> Step {
    Receives(Update::Decision(v1::DecisionRequest {
        decision_id,
        kind: v1::DecisionKind::Turn.into(),
        action_mask: MASK.to_vec(),
        ..v1::DecisionRequest::default()
    }))
}

fn result(decision_id: u64, action: u32, status: AnswerStatus) -> Step {
    Receives(Update::Result(v1::AnswerResult {
        decision_id,
        action,
        status: status.into(),
        ..v1::AnswerResult::default()
    }))
}

fn accepted(decision_id: u64) -> Step {
    result(decision_id, 1, AnswerStatus::Accepted)
}

fn event(sequence: u64, kind: Kind) -> Step {
    let event = v1::GameEvent {
        sequence,
        kind: Some(kind),
        ..v1::GameEvent::default()
    };
    Receives(Update::Events(v1::EventBatch {
        events: vec![event],
    }))
}

fn substituted(sequence: u64) -> Step {
    event(sequence, Kind::Substituted(v1::Substituted::default()))
}

fn detached(reason: v1::DetachReason) -> Step {
    Receives(Update::Detached(v1::Detached {
        reason: reason.into(),
    }))
}

fn game_over() -> Step {
    detached(v1::DetachReason::GameOver)
}

fn resume() -> Step {
    Says(0, Command::Resume(v1::ResumeSeat {}))
}

/// Decisions from one number to another, each answered and accepted.
fn played(from: u64, to: u64) -> Vec<Step> {
    (from..=to)
        .flat_map(|id| [request(id), answer(id, 1), accepted(id)])
        .collect()
}

/// The course of a case: everything that was forwarded, and the case itself.
struct Course {
    exam: Exam,
    now: Duration,
    to_server: Vec<Command>,
    to_agent: Vec<Update>,
    cuts: usize,
}

impl Course {
    fn of(case: &str, steps: impl IntoIterator<Item = Step>) -> Course {
        let case = Case::named(case).expect("a case");
        let venue = Venue::Room {
            room_id: "room".into(),
            join_code: "CODE".into(),
        };
        let exam = Exam::new(case, PATIENCE, venue, true);
        let mut course = Course {
            exam,
            now: Duration::ZERO,
            to_server: Vec::new(),
            to_agent: Vec::new(),
            cuts: 0,
        };
        for step in steps {
            course.step(step);
        }
        course
    }

    fn step(&mut self, step: Step) {
        let newest = self.exam.streams.len().saturating_sub(1);
        match step {
            Join => self
                .exam
                .joined("code", Ok(&v1::JoinRoomResponse::default()), self.now),
            Attach(from_sequence) => {
                let stream = self.exam.opened();
                let attach = v1::Attach {
                    ticket: "ticket".into(),
                    from_sequence,
                    ..v1::Attach::default()
                };
                self.sends(stream, 0, Command::Attach(attach));
                let attached = v1::Attached {
                    room_id: "room".into(),
                    ..v1::Attached::default()
                };
                self.received(stream, Update::Attached(attached));
                let started = v1::GameStarted {
                    action_space: Some(v1::ActionSpace {
                        size: ACTIONS,
                        ..v1::ActionSpace::default()
                    }),
                    ..v1::GameStarted::default()
                };
                self.step(event(1, Kind::GameStarted(Box::new(started))));
            }
            Says(handle, command) => self.sends(newest, handle, command),
            Receives(update) => self.received(newest, update),
            Wait(seconds) => {
                self.now += Duration::from_secs(seconds);
                self.exam.tick(self.now);
            }
            Leave => self.exam.left(newest, None, self.now),
            Exit(status) => self.exam.exited(ExitStatus::from_raw(status << 8)),
        }
    }

    fn sends(&mut self, stream: StreamId, handle: u32, command: Command) {
        let command = v1::SeatCommand {
            handle,
            command: Some(command),
        };
        let request = v1::PlayRequest {
            commands: vec![command],
        };
        let passed = self.exam.from_agent(stream, request, self.now);
        self.take(passed);
    }

    fn received(&mut self, stream: StreamId, update: Update) {
        self.pass(stream, 0, update);
    }

    /// The server sends an update to a seat on the newest stream.
    fn receives_on(&mut self, handle: u32, update: Update) {
        self.pass(self.exam.streams.len() - 1, handle, update);
    }

    fn pass(&mut self, stream: StreamId, handle: u32, update: Update) {
        let update = v1::SeatUpdate {
            handle,
            update: Some(update),
        };
        let response = v1::PlayResponse {
            updates: vec![update],
        };
        let passed = self.exam.from_server(stream, response, self.now);
        self.take(passed);
    }

    fn take(&mut self, passed: Passed) {
        let commands = passed.to_server.into_iter().filter_map(|it| it.command);
        self.to_server.extend(commands);
        let updates = passed.to_agent.into_iter().filter_map(|it| it.update);
        self.to_agent.extend(updates);
        self.cuts += usize::from(passed.cut);
    }

    fn codes(&self) -> Vec<&'static str> {
        let findings = self.exam.findings().iter();
        findings.map(|finding| finding.fault.code()).collect()
    }

    /// Answers that the server received.
    fn answers(&self) -> Vec<(u64, u32)> {
        let answers = self.to_server.iter().filter_map(|command| match command {
            Command::Answer(answer) => Some((answer.decision_id, answer.action)),
            _ => None,
        });
        answers.collect()
    }
}

/// From joining to the first accepted decision.
fn started() -> Vec<Step> {
    let mut steps = vec![Join, Attach(0)];
    steps.extend(played(1, 1));
    steps
}

fn check(name: &str, case: &str, steps: impl IntoIterator<Item = Step>, expected: &[&str]) {
    let course = Course::of(case, started().into_iter().chain(steps));
    assert_eq!(course.codes(), expected, "{name}");
    assert!(course.exam.is_done(), "{name} ends");
}

/// The game is over, and the agent leaves and exits correctly.
fn good_end() -> Vec<Step> {
    vec![game_over(), Leave, Exit(0)]
}

fn and_good_end(steps: impl IntoIterator<Item = Step>) -> Vec<Step> {
    steps.into_iter().chain(good_end()).collect()
}
