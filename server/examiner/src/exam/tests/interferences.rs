//! Cases with interferences: the messages forwarded, and the faults found.

use super::*;

#[test]
fn a_refusal_looks_like_one_of_the_agents_own_answer() {
    let steps = [started(), vec![request(2), answer(2, 5)]].concat();
    let mut course = Course::of("refusal", steps);
    assert_eq!(course.answers(), [(1, 1), (2, ILLEGAL)]);
    course.step(result(2, ILLEGAL, AnswerStatus::Invalid));
    let Some(Update::Result(received)) = course.to_agent.last() else {
        panic!("no result");
    };
    assert_eq!(
        (received.action, received.status()),
        (5, AnswerStatus::Invalid)
    );
    course.step(answer(2, 1));
    assert_eq!(course.answers(), [(1, 1), (2, ILLEGAL), (2, 1)]);
    course.step(accepted(2));
    assert!(course.codes().is_empty());

    let refused = [
        request(2),
        answer(2, 1),
        result(2, ILLEGAL, AnswerStatus::Invalid),
    ];
    let silent = [&refused[..], &[request(3)]].concat();
    check("silence", "refusal", silent, &["GAVE_UP_WHEN_REFUSED"]);
    let ended = [&refused[..], &[Exit(1)]].concat();
    check("an end", "refusal", ended, &["GAVE_UP_WHEN_REFUSED"]);
}

#[test]
fn a_connection_is_cut_before_an_answer_a_request_and_a_result() {
    let mut course = Course::of("disconnect", started());
    course.step(request(2));
    course.step(answer(2, 1));
    assert_eq!((course.cuts, course.answers()), (1, vec![(1, 1)]));
    // Messages on the old stream are lost; on a new one the decision is requested again.
    course.step(answer(2, 1));
    course.step(Attach(2));
    course.step(request(2));
    course.step(answer(2, 1));
    course.step(accepted(2));
    assert_eq!(course.answers(), [(1, 1), (2, 1)]);
    let received = course.to_agent.len();
    course.step(request(3));
    assert_eq!((course.cuts, course.to_agent.len()), (3, received));
    course.step(Attach(0));
    course.step(request(3));
    course.step(answer(3, 1));
    course.step(accepted(3));
    assert_eq!(course.cuts, 4, "the result is not sent");
    course.step(Attach(2));
    course.step(request(4));
    assert!(course.codes().is_empty());

    let cut = [request(2), answer(2, 1)];
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
    let held = [started(), vec![request(2), answer(2, 1)]].concat();
    let mut course = Course::of("stale", held);
    assert_eq!(course.answers(), [(1, 1)]);
    course.step(request(3));
    assert_eq!(course.answers(), [(1, 1), (2, 1)]);
    let late = [request(2), answer(2, 1), request(3), closed];
    let ended = [&late[..], &[Exit(1)]].concat();
    check("an end", "stale", ended, &["STOPPED_AFTER_CLOSED"]);
    let silent = [&late[..], &(4..=12).map(request).collect::<Vec<_>>()].concat();
    check("silence", "stale", silent, &["STOPPED_AFTER_CLOSED"]);
    let unheard = [&late[..], &[answer(3, 1), Exit(1)]].concat();
    check(
        "an answer on its way",
        "stale",
        unheard,
        &["STOPPED_AFTER_CLOSED"],
    );
    let none = and_good_end([&late[..], &[request(4)]].concat());
    check("nothing more", "stale", none, &["STOPPED_AFTER_CLOSED"]);
    let on = and_good_end([&late[..], &[answer(3, 1), accepted(3)]].concat());
    check("playing on", "stale", on, &[]);
}

#[test]
fn answers_are_dropped_until_a_substitute_plays() {
    let dropped = [
        request(2),
        answer(2, 1),
        request(3),
        answer(3, 1),
        substituted(2),
    ];
    let course = Course::of("substitution", [started(), dropped.to_vec()].concat());
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
    let again = and_good_end([with(&[Leave, Attach(3)]), played(4, 6)].concat());
    check("attaching again", "substitution", again, &[]);
}

#[test]
fn an_agent_waits_for_a_server_that_restarts() {
    let mut course = Course::of("restart", started());
    course.step(request(2));
    assert!(!course.exam.takes_restart());
    course.step(answer(2, 1));
    assert_eq!(course.answers(), [(1, 1)], "the answer is lost");
    assert!(course.exam.takes_restart() && !course.exam.takes_restart());
    // However long the restart takes.
    course.step(Wait(60));
    assert!(!course.exam.is_done());
    course.exam.restarted(course.now);
    for step in [Attach(2), request(2), answer(2, 1), accepted(2)] {
        course.step(step);
    }
    good_end().into_iter().for_each(|step| course.step(step));
    assert!(course.codes().is_empty() && course.exam.is_done());

    let mut gone = Course::of("restart", started());
    gone.step(request(2));
    gone.step(answer(2, 1));
    gone.exam.restarted(gone.now);
    gone.step(Wait(5));
    assert_eq!(gone.codes(), ["DID_NOT_RECONNECT"]);
}
