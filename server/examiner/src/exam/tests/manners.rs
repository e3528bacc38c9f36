//! Cases without interferences: joining, answering, leaving, in a room and in a tournament.

use super::*;

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
            vec![Join, attach, Receives(Update::Refused(unattached))],
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
fn answers_and_their_faults() {
    let closed = |id| result(id, 1, AnswerStatus::Closed);
    let invalid = |id| result(id, ILLEGAL, AnswerStatus::Invalid);
    check("a good game", "small", and_good_end(played(2, 9)), &[]);
    let twice = [request(2), answer(2, 1), answer(2, 1), accepted(2)];
    check("twice", "small", and_good_end(twice), &["ANSWERED_TWICE"]);
    let again = [request(2), answer(2, 1), accepted(2), answer(2, 1)];
    check("again", "small", and_good_end(again), &["ANSWERED_TWICE"]);
    let illegal = [
        request(2),
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
        request(2),
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
    let unrequested_answer = [request(2), answer(3, 1), answer(2, 1), accepted(2)];
    check(
        "unasked",
        "small",
        and_good_end(unrequested_answer),
        &["ANSWERED_UNASKED"],
    );
    let crossing = [request(2), request(3), answer(2, 1)];
    check("silence", "small", crossing, &["NOT_ANSWERED"]);
    let late = [
        request(2),
        answer(2, 1),
        request(3),
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
    let last = [request(2), game_over()];
    check("the last decision", "small", last, &["NOT_ANSWERED"]);
    check("too short", "stale", good_end(), &["NOT_EXAMINED"]);
    check("no exchange", "game", good_end(), &["NOT_EXAMINED"]);
    check(
        "too long",
        "small",
        [request(2), Wait(630)],
        &["CASE_TOO_LONG"],
    );
}

#[test]
fn short_deadlines_need_most_answers_in_time() {
    let lost = |ids: std::ops::RangeInclusive<u64>| ids.map(request).collect::<Vec<_>>();
    let some = and_good_end([lost(2..=9), played(10, 20)].concat());
    check("some lost", "deadlines", some, &["NOT_ANSWERED"]);
    let few = and_good_end([lost(2..=5), played(6, 20)].concat());
    check("few lost", "deadlines", few, &[]);
    check("all lost", "deadlines", lost(2..=20), &["NOT_ANSWERED"]);
    let late = (3..=20).flat_map(|id| [request(id), answer(id - 1, 1)]);
    let late: Vec<Step> = [request(2)].into_iter().chain(late).collect();
    check("all late", "deadlines", late, &["TOO_SLOW"]);
}

#[test]
fn an_agent_without_masks_receives_none_but_is_judged() {
    let mut course = Course::of("small", [Join]);
    let stream = course.exam.opened();
    let attach = v1::Attach {
        no_mask: true,
        ..v1::Attach::default()
    };
    course.sends(stream, 0, Command::Attach(attach));
    let attached = v1::Attached {
        room_id: "room".into(),
        ..v1::Attached::default()
    };
    course.received(stream, Update::Attached(attached));
    course.step(request(1));
    let Some(Update::Decision(received)) = course.to_agent.last() else {
        panic!("no decision");
    };
    assert!(received.action_mask.is_empty());
    course.step(answer(1, ILLEGAL));
    assert_eq!(
        course.codes(),
        ["ILLEGAL_ACTION"],
        "its actions are still judged"
    );
}

/// A tournament with this number of games at a time, followed by these steps.
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
    course.sends(stream, 0, Command::Attach(v1::Attach::default()));
    let entered = v1::Entered {
        tournament_id: "cup".into(),
        ..v1::Entered::default()
    };
    course.received(stream, Update::Entered(entered));
    for number in 0..seats {
        let handle = (1 << 31) + number;
        let attached = v1::Attached {
            room_id: format!("room {number}"),
            tournament_id: "cup".into(),
            ..v1::Attached::default()
        };
        course.receives_on(handle, Update::Attached(attached));
        for step in [request(1), answer(1, 1), accepted(1)] {
            match step {
                Receives(update) => course.receives_on(handle, update),
                Says(_, command) => course.sends(stream, handle, command),
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
