//! Sequences of events as data: responses go in, commands are compared.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex};

#[path = "participant_tests.rs"]
mod participant;

use prost::Message as _;

use super::*;
use crate::tickets::{FIRST_SEAT, MAX_COMMANDS, MAX_REQUEST_BYTES};
use crate::v1::game_event::Kind;
use crate::v1::seat_command::Command;
use crate::v1::seat_update::Update;
use crate::{ActionId, Ending, Entropy};

/// In place of an action: none is chosen.
const NONE: u32 = u32::MAX;

/// Answers with given actions, in order, and logs all calls.
struct Scripted {
    log: Arc<Mutex<Vec<String>>>,
    actions: VecDeque<u32>,
}

impl Scripted {
    fn log_line(&self, line: String) {
        self.log.lock().unwrap().push(line);
    }
}

impl Agent for Scripted {
    fn decide(&mut self, request: &v1::DecisionRequest) -> ActionId {
        let left = request.invalid_attempts_left;
        self.log_line(format!("decide {} {left:?}", request.decision_id));
        ActionId(
            self.actions
                .pop_front()
                .expect("asked more often than scripted"),
        )
    }
    fn try_decide(&mut self, request: &v1::DecisionRequest) -> Option<ActionId> {
        Some(self.decide(request)).filter(|action| action.0 != NONE)
    }
    fn on_attached(&mut self, attached: &v1::Attached) {
        self.log_line(format!("attached {}", attached.seat));
    }
    fn on_event(&mut self, event: &v1::GameEvent) {
        self.log_line(format!("event {}", event.sequence));
    }
    fn on_snapshot(&mut self, snapshot: &v1::Snapshot) {
        self.log_line(format!("snapshot before {}", snapshot.next_sequence));
    }
    fn on_awaited(&mut self, awaited: &v1::Awaited) {
        self.log_line(format!("awaited {:?}", awaited.seat));
    }
    fn on_result(&mut self, result: &v1::AnswerResult) {
        self.log_line(format!("result {}", result.status().as_str_name()));
    }
    fn on_game_over(&mut self, outcome: &Outcome) {
        self.log_line(format!(
            "over, place {:?}",
            outcome.standing().map(|line| line.place)
        ));
    }
}

/// A session with one seat per list of actions, and their logs.
struct Harness {
    session: Session<'static, Scripted>,
    logs: Vec<Arc<Mutex<Vec<String>>>>,
}

impl Harness {
    fn new(actions: &[&[u32]]) -> Self {
        let logs: Vec<_> = actions.iter().map(|_| Arc::default()).collect();
        let seats = actions
            .iter()
            .zip(&logs)
            .enumerate()
            .map(|(i, (actions, log))| {
                let agent = Scripted {
                    log: Arc::clone(log),
                    actions: actions.iter().copied().collect(),
                };
                (format!("ticket {i}"), agent)
            });
        let options = PlayOptions {
            entropy: Entropy::Fixed(vec![7]),
            ..PlayOptions::default()
        };
        let session = Session::new(seats, &options);
        Self { session, logs }
    }

    /// A session of one seat, attached with handle 0 to a game whose next event is number 1.
    fn seated(actions: &[u32]) -> Self {
        let mut harness = Self::new(&[actions]);
        harness.connect(&[(0, 1, 1)]);
        harness
    }

    /// Connects and attaches (handle, request id, next event). Returns the requested attachments as
    /// (request id, first event).
    fn connect(&mut self, attached: &[(u32, u32, u64)]) -> Vec<(u32, u64)> {
        let asked = self.attach(attached);
        self.clear();
        asked
    }

    /// The same, and keeps the logs.
    fn attach(&mut self, attached: &[(u32, u32, u64)]) -> Vec<(u32, u64)> {
        let mut asked = Vec::new();
        for request in self.session.attach() {
            for command in request.commands {
                let Some(Command::Attach(attach)) = command.command else {
                    panic!("not an attachment: {command:?}");
                };
                assert_eq!(attach.ticket, format!("ticket {}", attach.request_id - 1));
                assert_eq!(attach.entropy, [7]);
                asked.push((attach.request_id, attach.from_sequence));
            }
        }
        let updates = attached.iter().map(|&(handle, request_id, next_sequence)| {
            let attached = v1::Attached {
                request_id,
                seat: request_id - 1,
                next_sequence,
                room_id: "room".to_owned(),
                game_id: "game".to_owned(),
                ..Default::default()
            };
            (handle, Update::Attached(attached))
        });
        assert_eq!(self.receive(updates.collect()), Vec::<String>::new());
        asked
    }

    /// The requests of the session after a response, in short.
    fn receive(&mut self, updates: Vec<(u32, Update)>) -> Vec<String> {
        let requests = self.session.receive(response(updates));
        requests.iter().map(in_short).collect()
    }

    fn log(&self, seat: usize) -> Vec<String> {
        self.logs[seat].lock().unwrap().clone()
    }

    fn clear(&mut self) {
        for log in &self.logs {
            log.lock().unwrap().clear();
        }
    }
}

fn response(updates: Vec<(u32, Update)>) -> v1::PlayResponse {
    let updates = updates.into_iter().map(|(handle, update)| v1::SeatUpdate {
        handle,
        update: Some(update),
    });
    v1::PlayResponse {
        updates: updates.collect(),
    }
}

/// A request in short: `handle:decision=action` or `handle:resume`.
fn in_short(request: &v1::PlayRequest) -> String {
    let words = request
        .commands
        .iter()
        .map(|command| match &command.command {
            Some(Command::Answer(answer)) => {
                format!(
                    "{}:{}={}",
                    command.handle, answer.decision_id, answer.action
                )
            }
            Some(Command::Resume(_)) => format!("{}:resume", command.handle),
            Some(Command::Detach(_)) => format!("{}:detach", command.handle),
            other => panic!("not to be expected: {other:?}"),
        });
    words.collect::<Vec<_>>().join(" ")
}

fn decision(decision_id: u64) -> Update {
    Update::Decision(v1::DecisionRequest {
        decision_id,
        action_mask: vec![0xff],
        ..Default::default()
    })
}

fn result(decision_id: u64, action: u32, status: v1::AnswerStatus, left: Option<u32>) -> Update {
    Update::Result(v1::AnswerResult {
        decision_id,
        action,
        status: status.into(),
        invalid_attempts_left: left,
        ..Default::default()
    })
}

fn events(kinds: &[(u64, Option<Kind>)]) -> Update {
    let events = kinds.iter().map(|(sequence, kind)| v1::GameEvent {
        sequence: *sequence,
        kind: kind.clone(),
        ..Default::default()
    });
    Update::Events(v1::EventBatch {
        events: events.collect(),
    })
}

fn detached(reason: v1::DetachReason) -> Update {
    Update::Detached(v1::Detached {
        reason: reason.into(),
    })
}

fn ended() -> Option<Kind> {
    let line = |seat, place| v1::Standing {
        seat,
        place,
        points: 15,
    };
    Some(Kind::GameEnded(Box::new(v1::GameEnded {
        standings: vec![line(1, 1), line(0, 2)],
        reveal: None,
    })))
}

fn substituted(seat: u32) -> Option<Kind> {
    let agent = "random".to_owned();
    Some(Kind::Substituted(v1::Substituted {
        seat,
        built_in_agent: agent,
        for_good: false,
    }))
}

#[test]
fn answers_of_one_response_go_out_as_one_request_after_all_its_updates() {
    let mut harness = Harness::new(&[&[10], &[20], &[]]);
    let asked = harness.connect(&[(0, 1, 1), (1, 2, 1), (2, 3, 1)]);
    assert_eq!(asked, [(1, 1), (2, 1), (3, 1)]);
    let sent = harness.receive(vec![
        (1, decision(4)),
        (2, events(&[(1, None)])),
        (0, events(&[(1, None), (2, None)])),
        (0, decision(9)),
        (1, events(&[(1, None)])),
    ]);
    assert_eq!(sent, ["1:4=20 0:9=10"]);
    assert_eq!(harness.log(0), ["event 1", "event 2", "decide 9 None"]);
    assert_eq!(harness.log(1), ["event 1", "decide 4 None"]);
    assert_eq!(harness.log(2), ["event 1"]);
}

#[test]
fn a_snapshot_reaches_the_agent_in_place_of_events() {
    let mut harness = Harness::seated(&[5]);
    let snapshot = v1::Snapshot {
        next_sequence: 900,
        ..v1::Snapshot::default()
    };
    let sent = harness.receive(vec![
        (0, Update::Snapshot(Box::new(snapshot))),
        (0, decision(1)),
    ]);
    assert_eq!(sent, ["0:1=5"]);
    assert_eq!(harness.log(0), ["snapshot before 900", "decide 1 None"]);
}

#[test]
fn a_decision_without_an_action_stays_open() {
    let mut harness = Harness::seated(&[5, NONE, NONE, 6]);
    assert_eq!(harness.receive(vec![(0, decision(1))]), ["0:1=5"]);
    let accepted = result(1, 5, v1::AnswerStatus::Accepted, None);
    let sent = harness.receive(vec![(0, accepted), (0, decision(2))]);
    assert_eq!(sent, Vec::<String>::new());
    // Nothing is sent again with a new connection, which asks once more.
    harness.connect(&[(0, 1, 1)]);
    assert_eq!(
        harness.receive(vec![(0, decision(2))]),
        Vec::<String>::new()
    );
    assert_eq!(harness.log(0), ["decide 2 None"]);
    // The server has decided.
    assert_eq!(harness.receive(vec![(0, decision(3))]), ["0:3=6"]);
}

#[test]
fn only_an_invalid_answer_is_followed_by_another() {
    use v1::AnswerStatus::{Accepted, Closed, Invalid, UnknownDecision, Unspecified};
    let harness = [
        (Accepted, None, false),
        (Closed, None, false),
        (UnknownDecision, None, false),
        (Unspecified, None, false),
        (Invalid, None, true),
        (Invalid, Some(3), true),
        (Invalid, Some(0), false),
    ];
    for (status, left, again) in harness {
        let mut harness = Harness::seated(&[5, 6, 7]);
        assert_eq!(harness.receive(vec![(0, decision(1))]), ["0:1=5"]);
        let sent = harness.receive(vec![(0, result(1, 5, status, left))]);
        let expected: &[&str] = if again { &["0:1=6"] } else { &[] };
        assert_eq!(sent, expected, "{status:?} {left:?}");
        if again {
            assert_eq!(harness.log(0).last(), Some(&format!("decide 1 {left:?}")));
        }
        assert_eq!(harness.receive(vec![(0, decision(2))]).len(), 1);
    }
}

#[test]
fn a_repeated_acknowledgement_does_not_ask_twice() {
    let mut harness = Harness::seated(&[5, 6]);
    harness.receive(vec![(0, decision(1))]);
    let invalid = || (0, result(1, 5, v1::AnswerStatus::Invalid, Some(9)));
    assert_eq!(harness.receive(vec![invalid()]), ["0:1=6"]);
    assert!(harness.receive(vec![invalid()]).is_empty());
}

#[test]
fn a_decision_closed_in_the_response_with_the_next_is_not_answered() {
    let mut harness = Harness::seated(&[5, 6, 7]);
    harness.receive(vec![(0, decision(1))]);
    let closed = result(1, 5, v1::AnswerStatus::Closed, None);
    assert_eq!(
        harness.receive(vec![(0, closed), (0, decision(2))]),
        ["0:2=6"]
    );
    let sent = harness.receive(vec![(0, decision(3)), (0, decision(4))]);
    assert_eq!(sent, ["0:4=7"]);
}

#[test]
fn after_a_lost_connection_the_same_decision_gets_the_same_answer() {
    let mut harness = Harness::seated(&[5, 6]);
    harness.receive(vec![(0, events(&[(1, None), (2, None)])), (0, decision(1))]);
    harness.session.disconnected();
    assert_eq!(harness.connect(&[(0, 1, 4)]), [(1, 3)]);
    let sent = harness.receive(vec![(0, events(&[(2, None), (3, None)])), (0, decision(1))]);
    assert_eq!(sent, ["0:1=5"]);
    assert_eq!(
        harness.log(0),
        ["event 3"],
        "asked for nothing, no event received twice"
    );
    // The answer was invalid: the agent is asked again.
    let invalid = result(1, 5, v1::AnswerStatus::Invalid, Some(1));
    assert_eq!(harness.receive(vec![(0, invalid)]), ["0:1=6"]);
}

#[test]
fn after_a_lost_connection_the_agent_takes_new_decisions() {
    let mut harness = Harness::seated(&[5, 6]);
    harness.receive(vec![(0, decision(1))]);
    harness.session.disconnected();
    harness.connect(&[(0, 1, 1)]);
    assert_eq!(harness.receive(vec![(0, decision(2))]), ["0:2=6"]);
}

#[test]
fn an_acknowledged_answer_is_not_stored() {
    let mut harness = Harness::seated(&[5, 6]);
    harness.receive(vec![(0, decision(1))]);
    harness.receive(vec![(0, result(1, 5, v1::AnswerStatus::Invalid, Some(0)))]);
    harness.session.disconnected();
    harness.connect(&[(0, 1, 1)]);
    assert_eq!(harness.receive(vec![(0, decision(1))]), ["0:1=6"]);
}

#[test]
fn after_a_lost_connection_nobody_is_awaited_until_the_server_says_so() {
    let mut harness = Harness::seated(&[]);
    let awaited = |seat| {
        Update::Awaited(v1::Awaited {
            seat,
            ..v1::Awaited::default()
        })
    };
    harness.receive(vec![(0, awaited(Some(2)))]);
    harness.clear();
    for _ in 0..2 {
        harness.session.disconnected();
        harness.attach(&[(0, 1, 1)]);
    }
    let attached = harness.log(0);
    assert_eq!(attached.len(), 3, "{attached:?}");
    assert!(attached[0].starts_with("attached"), "{attached:?}");
    assert_eq!(attached[1], "awaited None", "once");
    harness.clear();
    harness.receive(vec![(0, awaited(Some(2)))]);
    assert_eq!(harness.log(0), ["awaited Some(2)"]);
}

#[test]
fn handles_belong_to_the_current_stream() {
    let mut harness = Harness::new(&[&[], &[20, 21]]);
    harness.connect(&[(0, 1, 1), (1, 2, 1)]);
    assert_eq!(harness.receive(vec![(1, decision(1))]), ["1:1=20"]);
    assert!(
        harness
            .receive(vec![
                (0, events(&[(1, ended())])),
                (0, detached(v1::DetachReason::GameOver))
            ])
            .is_empty()
    );
    harness.session.disconnected();
    assert_eq!(harness.connect(&[(0, 2, 1)]), [(2, 1)]);
    assert_eq!(harness.receive(vec![(0, decision(2))]), ["0:2=21"]);
}

#[test]
fn a_seat_resumes_after_the_server_has_stopped() {
    let mut harness = Harness::new(&[&[20, 21]]);
    harness.connect(&[(0, 1, 1)]);
    assert_eq!(harness.receive(vec![(0, decision(1))]), ["0:1=20"]);
    let stopping = detached(v1::DetachReason::ServerStopping);
    assert!(harness.receive(vec![(0, stopping)]).is_empty());
    assert!(!harness.session.is_over());
    harness.session.disconnected();
    harness.connect(&[(0, 1, 1)]);
    assert_eq!(harness.receive(vec![(0, decision(2))]), ["0:2=21"]);
}

#[test]
fn each_seat_has_its_own_reason_to_leave() {
    use v1::DetachReason::{GameOver, Requested, Superseded};
    let aborted = Kind::GameAborted(Box::new(v1::GameAborted {
        reason: v1::AbortReason::Closed.into(),
        reveal: None,
    }));
    let mut harness = Harness::new(&[&[], &[], &[], &[], &[], &[]]);
    harness.connect(&[(0, 1, 1), (1, 2, 1), (2, 3, 1), (3, 4, 1), (4, 5, 1)]);
    harness.receive(vec![(0, events(&[(1, ended())])), (0, detached(GameOver))]);
    harness.receive(vec![
        (1, detached(Superseded)),
        (2, detached(Requested)),
        (3, detached(GameOver)),
    ]);
    harness.receive(vec![
        (4, events(&[(1, Some(aborted))])),
        (4, detached(GameOver)),
    ]);
    assert!(!harness.session.is_over());
    let refused = v1::Refused {
        code: 16,
        request_id: 6,
        reason: "TICKET_UNKNOWN".to_owned(),
        message: "no such ticket".to_owned(),
        metadata: [("field".to_owned(), "ticket".to_owned())].into(),
    };
    harness.receive(vec![(0, Update::Refused(refused))]);
    assert!(harness.session.is_over());
    assert_eq!(harness.log(0), ["event 1", "over, place Some(2)"]);
    assert_eq!(harness.log(4), ["event 1", "over, place None"]);

    let outcomes = harness.session.into_outcomes();
    let finished = outcomes[0].as_ref().unwrap();
    assert_eq!(
        (
            finished.seat,
            finished.room_id.as_str(),
            finished.game_id.as_str()
        ),
        (0, "room", "game")
    );
    assert_eq!(
        (finished.entropy.as_slice(), finished.answers),
        (&[7][..], 0)
    );
    assert!(matches!(finished.ending, Ending::Finished(_)));
    let reasons = outcomes
        .iter()
        .map(|outcome| outcome.as_ref().err().and_then(PlayError::reason));
    let expected = [
        None,
        Some("SUPERSEDED"),
        Some("DETACHED"),
        Some("ENDING_UNKNOWN"),
        None,
        Some("TICKET_UNKNOWN"),
    ];
    assert_eq!(reasons.collect::<Vec<_>>(), expected);
    assert_eq!(
        outcomes[4].as_ref().unwrap().aborted(),
        Some(v1::AbortReason::Closed)
    );
}

#[test]
fn a_known_result_needs_no_new_connection() {
    let mut harness = Harness::seated(&[]);
    harness.receive(vec![(0, events(&[(1, ended())]))]);
    assert!(!harness.session.is_over(), "there may be more to come");
    harness.session.disconnected();
    assert!(harness.session.is_over());
    assert!(harness.session.into_outcomes()[0].is_ok());
}

#[test]
fn giving_up_does_not_change_outcomes() {
    let mut harness = Harness::new(&[&[], &[]]);
    harness.connect(&[(0, 1, 1), (1, 2, 1)]);
    harness.receive(vec![
        (0, events(&[(1, ended())])),
        (0, detached(v1::DetachReason::GameOver)),
    ]);
    harness.session.give_up(&PlayError::Superseded);
    assert!(harness.session.is_over());
    let outcomes = harness.session.into_outcomes();
    assert!(outcomes[0].is_ok() && outcomes[1].is_err());
}

#[test]
fn a_substituted_seat_resumes_once() {
    let mut harness = Harness::seated(&[5]);
    let sent = harness.receive(vec![(
        0,
        events(&[(1, substituted(3)), (2, substituted(0))]),
    )]);
    assert_eq!(sent, ["0:resume"]);
    assert!(harness.receive(vec![(0, events(&[(3, None)]))]).is_empty());
    let returned = Some(Kind::Returned(v1::Returned { seat: 0 }));
    let sent = harness.receive(vec![
        (0, events(&[(4, substituted(0)), (5, returned)])),
        (0, decision(1)),
    ]);
    assert_eq!(sent, ["0:1=5"]);
}

#[test]
fn a_substitution_that_others_do_not_see_is_ended_as_well() {
    let mut harness = Harness::seated(&[5]);
    let update = |active| Update::Substitution(v1::Substitution { active });
    assert_eq!(harness.receive(vec![(0, update(true))]), ["0:resume"]);
    assert!(harness.receive(vec![(0, update(false))]).is_empty());
    let over = vec![(0, update(true)), (0, update(false))];
    assert!(harness.receive(over).is_empty());
}

#[test]
fn a_substitution_before_the_attachment_is_over() {
    let mut harness = Harness::new(&[&[]]);
    harness.connect(&[(0, 1, 10)]);
    assert!(
        harness
            .receive(vec![(0, events(&[(1, substituted(0))]))])
            .is_empty()
    );
}

#[test]
fn unknown_handles_and_numbers_are_ignored() {
    let mut harness = Harness::seated(&[5]);
    let stray = |request_id| {
        Update::Attached(v1::Attached {
            request_id,
            ..Default::default()
        })
    };
    let refused = |request_id| {
        Update::Refused(v1::Refused {
            request_id,
            ..Default::default()
        })
    };
    let sent = harness.receive(vec![
        (u32::MAX, decision(1)),
        (7, detached(v1::DetachReason::Superseded)),
        (u32::MAX, stray(2)),
        (0, stray(0)),
        (0, stray(u32::MAX)),
        (0, refused(0)),
        (0, refused(u32::MAX)),
        (0, result(99, 1, v1::AnswerStatus::Invalid, None)),
        (0, events(&[(u64::MAX, None)])),
        (0, decision(1)),
    ]);
    assert_eq!(sent, ["0:1=5"]);
    assert!(!harness.session.is_over());
}

#[test]
fn requests_stay_within_the_limits_of_a_message() {
    let answer = |annotations| v1::SeatCommand {
        handle: u32::MAX,
        command: Some(Command::Answer(v1::Answer {
            decision_id: u64::MAX,
            action: 213,
            annotations,
        })),
    };
    let large = v1::Annotations {
        action_scores: vec![0.5; 1000],
        ..Default::default()
    };
    let harness = [
        (vec![], 0),
        (vec![answer(None); 1000], 1),
        (vec![answer(None); 1025], 2),
        (vec![answer(Some(large.clone())); 20], 3),
        (vec![answer(None), answer(Some(large))], 1),
    ];
    for (commands, expected) in harness {
        let requests = pack(commands.clone());
        assert_eq!(requests.len(), expected);
        for request in &requests {
            assert!(request.encoded_len() <= MAX_REQUEST_BYTES);
            assert!(request.commands.len() <= MAX_COMMANDS);
        }
        let packed: Vec<_> = requests
            .into_iter()
            .flat_map(|request| request.commands)
            .collect();
        assert_eq!(packed, commands);
    }
}
