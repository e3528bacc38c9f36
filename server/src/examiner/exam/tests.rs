//! Courses of events as data: what agent and server say, and what is found. The cases against real agents are whole-system tests.

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

/// Something that happens.
#[derive(Clone)]
enum Step {
    /// The agent takes its seat.
    Join,
    /// It opens a stream and attaches, asking for events from a number on; the server attaches it.
    Attach(u64),
    /// It says something on its newest stream.
    Says(u32, Command),
    /// The server does.
    Told(Update),
    /// So many seconds pass.
    Wait(u64),
    /// The agent leaves its newest stream.
    Leave,
    /// Its process ends with a status.
    Exit(i32),
}
use Step::{Attach, Exit, Join, Leave, Says, Told, Wait};

fn answer(decision_id: u64, action: u32) -> Step {
    let answer = v1::Answer {
        decision_id,
        action,
        annotations: None,
    };
    Says(0, Command::Answer(answer))
}

fn put(decision_id: u64) -> Step {
    Told(Update::Decision(v1::DecisionRequest {
        decision_id,
        kind: v1::DecisionKind::Turn.into(),
        action_mask: MASK.to_vec(),
        ..v1::DecisionRequest::default()
    }))
}

fn result(decision_id: u64, action: u32, status: AnswerStatus) -> Step {
    Told(Update::Result(v1::AnswerResult {
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
    Told(Update::Events(v1::EventBatch {
        events: vec![event],
    }))
}

fn substituted(sequence: u64) -> Step {
    event(sequence, Kind::Substituted(v1::Substituted::default()))
}

fn detached(reason: v1::DetachReason) -> Step {
    Told(Update::Detached(v1::Detached {
        reason: reason.into(),
    }))
}

fn game_over() -> Step {
    detached(v1::DetachReason::GameOver)
}

fn resume() -> Step {
    Says(0, Command::Resume(v1::ResumeSeat {}))
}

/// Decisions from one number to another, each answered and taken.
fn played(from: u64, to: u64) -> Vec<Step> {
    (from..=to)
        .flat_map(|id| [put(id), answer(id, 1), accepted(id)])
        .collect()
}

/// A case as it went: everything that was passed on, and the case as it stands.
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
                self.says(stream, 0, Command::Attach(attach));
                let attached = v1::Attached {
                    room_id: "room".into(),
                    ..v1::Attached::default()
                };
                self.told(stream, Update::Attached(attached));
                let started = v1::GameStarted {
                    action_space: Some(v1::ActionSpace {
                        size: ACTIONS,
                        ..v1::ActionSpace::default()
                    }),
                    ..v1::GameStarted::default()
                };
                self.step(event(1, Kind::GameStarted(Box::new(started))));
            }
            Says(handle, command) => self.says(newest, handle, command),
            Told(update) => self.told(newest, update),
            Wait(seconds) => {
                self.now += Duration::from_secs(seconds);
                self.exam.tick(self.now);
            }
            Leave => self.exam.left(newest, None, self.now),
            Exit(status) => self.exam.exited(ExitStatus::from_raw(status << 8)),
        }
    }

    fn says(&mut self, stream: StreamId, handle: u32, command: Command) {
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

    fn told(&mut self, stream: StreamId, update: Update) {
        self.pass(stream, 0, update);
    }

    /// The server says something to a seat on the newest stream.
    fn told_to(&mut self, handle: u32, update: Update) {
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

    /// Answers the server got.
    fn answers(&self) -> Vec<(u64, u32)> {
        let answers = self.to_server.iter().filter_map(|command| match command {
            Command::Answer(answer) => Some((answer.decision_id, answer.action)),
            _ => None,
        });
        answers.collect()
    }
}

/// From joining to the first decision taken.
fn begun() -> Vec<Step> {
    let mut steps = vec![Join, Attach(0)];
    steps.extend(played(1, 1));
    steps
}

fn check(name: &str, case: &str, steps: impl IntoIterator<Item = Step>, expected: &[&str]) {
    let course = Course::of(case, begun().into_iter().chain(steps));
    assert_eq!(course.codes(), expected, "{name}");
    assert!(course.exam.is_done(), "{name} comes to an end");
}

/// The game is over, and the agent leaves and ends as it should.
fn good_end() -> Vec<Step> {
    vec![game_over(), Leave, Exit(0)]
}

fn and_good_end(steps: impl IntoIterator<Item = Step>) -> Vec<Step> {
    steps.into_iter().chain(good_end()).collect()
}

#[test]
fn before_the_game() {
    let unattached = v1::Refused {
        reason: "TICKET_UNKNOWN".into(),
        ..v1::Refused::default()
    };
    let attach = Says(0, Command::Attach(v1::Attach::default()));
    let table: [(&str, Vec<Step>, &str); 6] = [
        ("nothing", vec![Wait(30)], "NEVER_JOINED"),
        ("an early end", vec![Exit(0)], "NEVER_JOINED"),
        ("no attachment", vec![Join, Wait(5)], "NEVER_ATTACHED"),
        (
            "an end after joining",
            vec![Join, Exit(1)],
            "NEVER_ATTACHED",
        ),
        ("joining twice", vec![Join, Join], "JOINED_AGAIN"),
        (
            "another ticket",
            vec![Join, attach, Told(Update::Refused(unattached))],
            "ATTACH_REFUSED",
        ),
    ];
    for (name, steps, expected) in table {
        let mut course = Course::of("small", []);
        course.exam.opened();
        steps.into_iter().for_each(|step| course.step(step));
        assert_eq!(course.codes(), [expected], "{name}");
        assert!(course.exam.is_done(), "{name}");
    }
}

#[test]
fn answers_in_every_course() {
    let closed = |id| result(id, 1, AnswerStatus::Closed);
    let invalid = |id| result(id, ILLEGAL, AnswerStatus::Invalid);
    check("a good game", "small", and_good_end(played(2, 9)), &[]);
    let twice = [put(2), answer(2, 1), answer(2, 1), accepted(2)];
    check("twice", "small", and_good_end(twice), &["ANSWERED_TWICE"]);
    let again = [put(2), answer(2, 1), accepted(2), answer(2, 1)];
    check("again", "small", and_good_end(again), &["ANSWERED_TWICE"]);
    let illegal = [
        put(2),
        answer(2, ILLEGAL),
        invalid(2),
        answer(2, 1),
        accepted(2),
    ];
    check(
        "illegal",
        "small",
        and_good_end(illegal),
        &["ILLEGAL_ACTION"],
    );
    let beyond = [
        put(2),
        answer(2, ACTIONS),
        invalid(2),
        answer(2, 1),
        accepted(2),
    ];
    check(
        "beyond",
        "small",
        and_good_end(beyond),
        &["ACTION_OUT_OF_SPACE"],
    );
    let unasked = [put(2), answer(3, 1), answer(2, 1), accepted(2)];
    check(
        "unasked",
        "small",
        and_good_end(unasked),
        &["ANSWERED_UNASKED"],
    );
    let crossing = [put(2), put(3), answer(2, 1)];
    check("silence", "small", crossing, &["NOT_ANSWERED"]);
    let late = [
        put(2),
        answer(2, 1),
        put(3),
        closed(2),
        answer(3, 1),
        accepted(3),
    ];
    check(
        "too late",
        "small",
        and_good_end(late.clone()),
        &["TOO_SLOW"],
    );
    let once_more = [answer(2, 1), closed(2)];
    let repeated = late.iter().cloned().chain(once_more.clone());
    check(
        "crossing",
        "small",
        and_good_end(repeated.clone()),
        &["TOO_SLOW"],
    );
    let forever = and_good_end(repeated.chain(once_more));
    check(
        "forever",
        "small",
        forever,
        &["TOO_SLOW", "REPEATED_AFTER_CLOSED"],
    );
    let stray = [Says(1, Command::Resume(v1::ResumeSeat {}))];
    check(
        "a stray handle",
        "small",
        and_good_end(stray),
        &["HANDLE_UNKNOWN"],
    );
    let left = [Says(0, Command::Detach(v1::Detach {}))];
    check("detaching", "small", left, &["LEFT_EARLY"]);
    let flood = vec![resume(); 2_000];
    check("a flood", "small", flood, &["FLOODING"]);
    let many = and_good_end(played(2, 2_000));
    check("a long game is no flood", "small", many, &[]);
}

#[test]
fn the_end() {
    let over = |rest: &[Step]| [&[game_over()], rest].concat();
    check("staying", "small", over(&[Wait(5)]), &["NEVER_LEFT"]);
    check(
        "hanging",
        "small",
        over(&[Leave, Wait(5)]),
        &["NEVER_EXITED"],
    );
    check(
        "failing",
        "small",
        over(&[Leave, Exit(1)]),
        &["EXIT_STATUS"],
    );
    check("ending at once", "small", over(&[Exit(0)]), &[]);
    check("an early end", "small", [Exit(0)], &["EXITED_EARLY"]);
    check("a stream left", "small", [Leave, Wait(5)], &["LEFT_EARLY"]);
    check(
        "left and ended",
        "small",
        [Leave, Exit(0)],
        &["EXITED_EARLY"],
    );
    let back = and_good_end([Leave, Attach(2)]);
    check("left and back", "small", back, &[]);
    let aborted = event(2, Kind::GameAborted(Box::default()));
    check("aborted", "small", [aborted], &["GAME_ABORTED"]);
    let last = [put(2), game_over()];
    check("the last decision", "small", last, &["NOT_ANSWERED"]);
    check("too short", "stale", good_end(), &["NOT_EXAMINED"]);
    check("no exchange", "game", good_end(), &["NOT_EXAMINED"]);
    check("too long", "small", [put(2), Wait(630)], &["CASE_TOO_LONG"]);
}

#[test]
fn most_answers_in_time_are_enough_for_a_hurried_case() {
    let lost = |ids: std::ops::RangeInclusive<u64>| ids.map(put).collect::<Vec<_>>();
    let some = and_good_end([lost(2..=9), played(10, 20)].concat());
    check("some lost", "deadlines", some, &["TOO_SLOW"]);
    let few = and_good_end([lost(2..=5), played(6, 20)].concat());
    check("few lost", "deadlines", few, &[]);
    check("all lost", "deadlines", lost(2..=20), &["TOO_SLOW"]);
}

#[test]
fn a_refusal_looks_like_one_of_the_agents_own_answer() {
    let steps = [begun(), vec![put(2), answer(2, 5)]].concat();
    let mut course = Course::of("refusal", steps);
    assert_eq!(course.answers(), [(1, 1), (2, ILLEGAL)]);
    course.step(result(2, ILLEGAL, AnswerStatus::Invalid));
    let Some(Update::Result(told)) = course.to_agent.last() else {
        panic!("no result");
    };
    assert_eq!((told.action, told.status()), (5, AnswerStatus::Invalid));
    course.step(answer(2, 1));
    assert_eq!(course.answers(), [(1, 1), (2, ILLEGAL), (2, 1)]);
    course.step(accepted(2));
    assert!(course.codes().is_empty());

    let refused = [
        put(2),
        answer(2, 1),
        result(2, ILLEGAL, AnswerStatus::Invalid),
    ];
    let silent = [&refused[..], &[put(3)]].concat();
    check("silence", "refusal", silent, &["GAVE_UP_WHEN_REFUSED"]);
    let ended = [&refused[..], &[Exit(1)]].concat();
    check("an end", "refusal", ended, &["GAVE_UP_WHEN_REFUSED"]);
}

#[test]
fn a_connection_is_cut_before_an_answer_a_request_and_a_result() {
    let mut course = Course::of("disconnect", begun());
    course.step(put(2));
    course.step(answer(2, 1));
    assert_eq!((course.cuts, course.answers()), (1, vec![(1, 1)]));
    // What comes on the old stream is lost; on a new one the decision is put again.
    course.step(answer(2, 1));
    course.step(Attach(2));
    course.step(put(2));
    course.step(answer(2, 1));
    course.step(accepted(2));
    assert_eq!(course.answers(), [(1, 1), (2, 1)]);
    let told = course.to_agent.len();
    course.step(put(3));
    assert_eq!((course.cuts, course.to_agent.len()), (3, told));
    course.step(Attach(0));
    course.step(put(3));
    course.step(answer(3, 1));
    course.step(accepted(3));
    assert_eq!(course.cuts, 4, "the result is not told");
    course.step(Attach(2));
    course.step(put(4));
    assert!(course.codes().is_empty());

    let cut = [put(2), answer(2, 1)];
    let with = |rest: &[Step]| [&cut[..], rest].concat();
    check(
        "never",
        "disconnect",
        with(&[Wait(5)]),
        &["DID_NOT_RECONNECT"],
    );
    check(
        "an end",
        "disconnect",
        with(&[Exit(1)]),
        &["DID_NOT_RECONNECT"],
    );
    check("joining", "disconnect", with(&[Join]), &["JOINED_AGAIN"]);
    let skipping = with(&[Attach(3), Exit(1)]);
    let found = ["EVENTS_SKIPPED", "EXITED_EARLY"];
    check("skipping", "disconnect", skipping, &found);
}

#[test]
fn an_answer_is_held_until_its_decision_is_closed() {
    let closed = result(2, 1, AnswerStatus::Closed);
    let held = [begun(), vec![put(2), answer(2, 1)]].concat();
    let mut course = Course::of("stale", held);
    assert_eq!(course.answers(), [(1, 1)]);
    course.step(put(3));
    assert_eq!(course.answers(), [(1, 1), (2, 1)]);
    let late = [put(2), answer(2, 1), put(3), closed];
    let ended = [&late[..], &[Exit(1)]].concat();
    check("an end", "stale", ended, &["STOPPED_AFTER_CLOSED"]);
    let silent = [&late[..], &(4..=12).map(put).collect::<Vec<_>>()].concat();
    check("silence", "stale", silent, &["STOPPED_AFTER_CLOSED"]);
    let none = and_good_end(late.clone());
    check("nothing more", "stale", none, &["STOPPED_AFTER_CLOSED"]);
    let on = and_good_end([&late[..], &[answer(3, 1), accepted(3)]].concat());
    check("playing on", "stale", on, &[]);
}

#[test]
fn answers_are_dropped_until_a_substitute_plays() {
    let dropped = [put(2), answer(2, 1), put(3), answer(3, 1), substituted(2)];
    let course = Course::of("substitution", [begun(), dropped.to_vec()].concat());
    assert_eq!(course.answers(), [(1, 1)]);
    let with = |rest: &[Step]| [&dropped[..], rest].concat();
    let found = ["NEVER_RESUMED"];
    check("never", "substitution", with(&[Wait(5)]), &found);
    check("an end", "substitution", with(&[Exit(0)]), &found);
    check(
        "too late",
        "substitution",
        and_good_end(dropped.clone()),
        &found,
    );
    let resumed = and_good_end([with(&[resume()]), played(4, 6)].concat());
    check("resuming", "substitution", resumed, &[]);
    let anew = and_good_end([with(&[Leave, Attach(3)]), played(4, 6)].concat());
    check("attaching anew", "substitution", anew, &[]);
}

#[test]
fn an_agent_that_wants_no_masks_gets_none() {
    let mut course = Course::of("small", [Join]);
    let stream = course.exam.opened();
    let attach = v1::Attach {
        no_mask: true,
        ..v1::Attach::default()
    };
    course.says(stream, 0, Command::Attach(attach));
    let attached = v1::Attached {
        room_id: "room".into(),
        ..v1::Attached::default()
    };
    course.told(stream, Update::Attached(attached));
    course.step(put(1));
    let Some(Update::Decision(told)) = course.to_agent.last() else {
        panic!("no decision");
    };
    assert!(told.action_mask.is_empty());
    course.step(answer(1, ILLEGAL));
    assert_eq!(
        course.codes(),
        ["ILLEGAL_ACTION"],
        "it is judged all the same"
    );
}

/// A tournament in which so many games are played at a time, with what follows.
fn tournament(seats: u32, rest: &[Step]) -> Course {
    let venue = Venue::Tournament {
        tournament_id: "cup".into(),
    };
    let case = Case::named("many-seats").expect("a case");
    let mut course = Course {
        exam: Exam::new(case, PATIENCE, venue, true),
        ..Course::of("small", [])
    };
    let stream = course.exam.opened();
    course.says(stream, 0, Command::Attach(v1::Attach::default()));
    let entered = v1::Entered {
        tournament_id: "cup".into(),
        ..v1::Entered::default()
    };
    course.told(stream, Update::Entered(entered));
    for number in 0..seats {
        let handle = (1 << 31) + number;
        let attached = v1::Attached {
            room_id: format!("room {number}"),
            tournament_id: "cup".into(),
            ..v1::Attached::default()
        };
        course.told_to(handle, Update::Attached(attached));
        for step in [put(1), answer(1, 1), accepted(1)] {
            match step {
                Told(update) => course.told_to(handle, update),
                Says(_, command) => course.says(stream, handle, command),
                _ => {}
            }
        }
    }
    rest.iter().for_each(|step| course.step(step.clone()));
    course
}

#[test]
fn a_tournament_seats_the_agent_in_many_games() {
    let over = detached(v1::DetachReason::TournamentOver);
    let well = tournament(3, &[over.clone(), Leave, Exit(0)]);
    assert!(well.codes().is_empty() && well.exam.is_done());
    let one = tournament(1, &[over, Leave, Exit(0)]);
    assert_eq!(one.codes(), ["ONE_AT_A_TIME"]);
    let early = tournament(3, &[Exit(0)]);
    assert_eq!(early.codes(), ["EXITED_EARLY"]);
}
