//! Participants: beginning, sessions, steps, dropping out, withdrawing, being removed.

use std::sync::Arc;

use chefshat_study::testing::{settings, text, within};
use chefshat_study::{
    At, CLOCK_CHECK_MS, CONFIRMATION_TIME_MS, Change, Content, Device, End, NewParticipants,
    Pointer, Refusal, RequiredDevice, Settings, Stage, Status, Study, Task,
};

use super::support::{Lab, device, tests};

fn status(lab: &Lab, number: u32) -> Status {
    lab.participant(number).status
}

fn slot(lab: &Lab, number: u32) -> Option<u32> {
    lab.participant(number).slot
}

fn named(names: &[String]) -> NewParticipants {
    NewParticipants {
        pseudonyms: names.to_vec(),
        ..NewParticipants::default()
    }
}

/// The end of a participation without an address to go on to.
fn over(reason: End) -> Content {
    Content::End {
        reason,
        url: None,
        text: String::new(),
    }
}

#[test]
fn a_participant_completes_all_steps() {
    let mut lab = Lab::new(within(2), 1);
    assert_eq!((status(&lab, 1), slot(&lab, 1)), (Status::Invited, None));
    let games = lab.complete(1);
    assert_eq!(games.len(), 5);
    let participant = lab.participant(1);
    assert_eq!(participant.status, Status::Completed);
    assert_eq!(participant.reached_at_ms.len(), lab.study.step_count() + 1);
    assert_eq!(participant.answers.len(), 2);
    let consent = participant.consent.as_ref().unwrap();
    assert_eq!(
        (consent.version.as_str(), consent.language.as_str()),
        ("1", "en")
    );
    // printf 'I take part.' | sha256sum
    assert_eq!(consent.text_sha256[..4], [0x80, 0xf3, 0x13, 0x13]);
    assert_eq!(lab.content(1), over(End::Completed));
    assert!(lab.folded_again() == lab.study);
}

#[test]
fn the_newest_session_wins_and_repeated_commands_change_nothing() {
    let mut lab = Lab::new(settings(), 1);
    lab.open(1).unwrap();
    let first = lab.at(1);
    lab.open(1).unwrap();
    assert_eq!(lab.study.consent(first, 0), Err(Refusal::Superseded));
    let second = lab.at(1);
    lab.act(1);
    assert_eq!(slot(&lab, 1), Some(0));
    assert_eq!(lab.study.consent(second, 0), Err(Refusal::StepOver));
    assert_eq!(lab.study.consent(lab.at(1), 0), Err(Refusal::StepMismatch));
    assert_eq!(
        lab.study.answer(lab.at(1), Vec::new(), 0),
        Err(Refusal::StepMismatch)
    );
    assert_eq!(lab.study.proceed(lab.at(1), 0), Err(Refusal::GameNotOver));
    let unknown = At {
        number: 2,
        ..second
    };
    assert_eq!(lab.study.consent(unknown, 0), Err(Refusal::Unknown));
    lab.complete(1);
    assert_eq!(lab.study.proceed(lab.at(1), 0), Err(Refusal::Over));
    // The link still shows the end, without a new session.
    let sessions = lab.participant(1).session;
    lab.open(1).unwrap();
    assert_eq!(lab.participant(1).session, sessions);
}

#[test]
fn on_another_device_nothing_begins_and_nothing_is_taken() {
    let required = RequiredDevice {
        pointer: Some(Pointer::Coarse),
        min_width: 0,
    };
    let mut lab = Lab::new(
        Settings {
            device: Some(required),
            stages: vec![Stage::once(Task::Games { count: 1 }), Stage::once(text())],
            ..settings()
        },
        1,
    );
    lab.invite(&tests(2));
    let with = |pointer| Device {
        pointer: pointer as u32,
        ..device()
    };
    let opened = |lab: &Lab, number, device| lab.study.open(number, device, lab.now_ms);
    let refused = Err(Refusal::WrongDevice(required));
    for device in [None, Some(with(Pointer::Fine))] {
        assert_eq!(opened(&lab, 1, device), refused);
    }
    // The study gives slots when it is opened.
    let change = opened(&lab, 1, Some(with(Pointer::Coarse))).unwrap();
    assert!(matches!(&change, Some(Change::Opened(opened)) if opened.slot == Some(0)));
    lab.fold_all(change);
    // On another device it does not continue either, and the first session stays the newest.
    assert_eq!(opened(&lab, 1, Some(with(Pointer::Fine))), refused);
    assert_eq!(lab.participant(1).session, 1);
    lab.complete(1);
    assert_eq!(opened(&lab, 1, None), Ok(None));

    // A test participant is a program, or somebody who sees what others see.
    assert!(opened(&lab, 2, None).unwrap().is_some());
    assert_eq!(opened(&lab, 3, Some(with(Pointer::Fine))), refused);
}

#[test]
fn sessions_are_bounded() {
    let mut lab = Lab::new(settings(), 1);
    for _ in 0..chefshat_study::MAX_SESSIONS {
        lab.open(1).unwrap();
    }
    assert_eq!(lab.open(1), Err(Refusal::TooManySessions));
}

#[test]
fn who_is_away_too_long_drops_out_and_may_return_until_the_slot_is_given_again() {
    let mut lab = Lab::new(settings(), 3);
    lab.open(1).unwrap();
    lab.act(1);
    lab.wait(200_000);
    assert_eq!(status(&lab, 1), Status::Active);

    lab.study.set_connected(1, false, lab.now_ms);
    lab.wait(59_999);
    assert_eq!(lab.wake_in(), Some(1));
    assert_eq!(status(&lab, 1), Status::Active);
    lab.wait(1);
    assert_eq!(status(&lab, 1), Status::DroppedOut);
    assert_eq!(lab.wake_in(), None);
    assert!(lab.study.due(1).is_none());

    // Its slot is free: it continues where it was.
    lab.open(1).unwrap();
    assert_eq!(
        (status(&lab, 1), slot(&lab, 1), lab.at(1).step),
        (Status::Active, Some(0), 1)
    );
    assert_eq!(lab.participant(1).ended_at_ms, None);

    // A restart: nobody is connected, and the time counts from then.
    lab.study = lab.folded_again();
    lab.wait(0);
    lab.wait(60_000);
    assert_eq!(status(&lab, 1), Status::DroppedOut);
    lab.begin(2);
    assert_eq!(slot(&lab, 2), Some(0));
    lab.open(1).unwrap();
    assert_eq!(status(&lab, 1), Status::DroppedOut);
    assert_eq!(lab.content(1), over(End::DroppedOut));
    assert_eq!(lab.study.consent(lab.at(1), 0), Err(Refusal::Over));
}

#[test]
fn withdrawing_is_always_possible_and_does_what_it_says() {
    let mut settings = within(2);
    settings.participants = 2;
    let mut lab = Lab::new(settings, 4);
    lab.complete(1);
    lab.open(2).unwrap();
    lab.wait(500);
    lab.fold(lab.study.close().unwrap());
    for number in 1..=3 {
        lab.withdraw(number, false);
        assert_eq!(status(&lab, number), Status::Withdrawn);
        assert_eq!(lab.study.withdraw(number, false, lab.now_ms), Ok(None));
        assert_eq!(lab.content(number), over(End::Withdrawn));
    }
    let kept = lab.participant(1);
    assert_eq!((kept.answers.len(), kept.pseudonym.as_str()), (2, "P01"));

    lab.withdraw(1, true);
    assert_eq!(lab.study.withdraw(1, true, lab.now_ms), Ok(None));
    let participant = lab.participant(1);
    assert!(participant.answers.is_empty() && participant.pseudonym.is_empty());
    assert!(participant.consent.is_some() && participant.games.len() == 5);
    assert_eq!(lab.content(1), over(End::DataDeleted));

    // The stored changes lose the data too, and fold to the same study.
    assert_eq!(lab.forget(1), 4);
    let text = format!("{:?}", lab.changes);
    assert!(!text.contains("P01") && text.contains("P02") && !text.contains("Number("));
    assert!(lab.folded_again() == lab.study);
}

#[test]
fn a_slot_is_given_again_first() {
    let mut lab = Lab::new(settings(), 6);
    (1..=3).for_each(|number| lab.begin(number));
    lab.withdraw(2, false);
    lab.remove(1);
    assert_eq!(lab.study.remove(1, 0), Ok(None));
    assert_eq!(lab.study.remove(2, 0), Err(Refusal::Over));
    assert_eq!(lab.open(1), Ok(()));
    assert_eq!(lab.content(1), over(End::Removed));
    assert!(lab.study.withdraw(1, true, 0).unwrap().is_some());
    (4..=6).for_each(|number| lab.begin(number));
    let slots: Vec<_> = (3..=6).map(|number| slot(&lab, number)).collect();
    assert_eq!(slots, [Some(2), Some(0), Some(1), Some(3)]);
}

#[test]
fn who_does_not_consent_takes_no_slot() {
    let one = Settings {
        participants: 1,
        ..settings()
    };
    let mut lab = Lab::new(one.clone(), 2);
    (1..=2).for_each(|number| lab.open(number).unwrap());
    assert_eq!((slot(&lab, 1), slot(&lab, 2)), (None, None));
    lab.act(2);
    assert_eq!(slot(&lab, 2), Some(0));
    let full = lab.study.consent(lab.at(1), lab.now_ms);
    assert_eq!(full, Err(Refusal::Full));
    lab.withdraw(2, false);
    lab.act(1);
    assert_eq!(slot(&lab, 1), Some(0));
    assert!(lab.folded_again() == lab.study);

    // Who returns before consenting has still no slot.
    let mut lab = Lab::new(one, 2);
    lab.open(1).unwrap();
    lab.study.set_connected(1, false, lab.now_ms);
    lab.wait(60_000);
    lab.open(2).unwrap();
    lab.open(1).unwrap();
    assert_eq!((status(&lab, 1), slot(&lab, 1)), (Status::Active, None));

    // Without a question before the game, the link takes it.
    let mut unasked = settings();
    unasked.stages.remove(0);
    let mut lab = Lab::new(unasked, 1);
    lab.open(1).unwrap();
    assert_eq!(slot(&lab, 1), Some(0));
}

#[test]
fn who_completed_the_study_has_done_so_without_data_too_but_its_slot_is_free() {
    let mut settings = settings();
    settings.participants = 1;
    let mut lab = Lab::new(settings, 2);
    lab.open(1).unwrap();
    lab.complete(1);
    assert_eq!(lab.open(2), Err(Refusal::Full));
    lab.withdraw(1, true);
    assert_eq!(lab.study.withdraw(1, true, lab.now_ms), Ok(None));
    assert_eq!(status(&lab, 1), Status::Completed);
    assert!(lab.participant(1).answers.is_empty());
    let view = lab.study.view(1).unwrap();
    assert_eq!(view.content, over(End::DataDeleted));
    lab.open(2).unwrap();
    lab.complete(2);
    assert_eq!(status(&lab, 2), Status::Completed);
}

#[test]
fn a_full_or_closed_study_accepts_nobody() {
    let mut settings = settings();
    settings.participants = 1;
    settings.closes_at_ms = Some(2_000_000);
    let mut lab = Lab::new(settings, 3);
    lab.begin(1);
    assert_eq!(lab.open(2), Err(Refusal::Full));
    assert!(lab.study.view(2).is_none());
    lab.wait(0);
    assert_eq!(lab.wake_in(), Some(CLOCK_CHECK_MS));
    lab.wait(2_000_000 - lab.now_ms - 7);
    assert_eq!(lab.wake_in(), Some(7));
    lab.wait(7);
    assert_eq!(lab.open(2), Err(Refusal::Closed));
    assert_eq!(lab.wake_in(), Some(CONFIRMATION_TIME_MS));
    lab.wait(CONFIRMATION_TIME_MS - 1);
    assert!(!lab.study.is_closed());
    lab.wait(1);
    assert!(lab.study.is_closed() && lab.study.close().is_none());
    assert_eq!(lab.wake_in(), None);
    assert_eq!(lab.open(2), Err(Refusal::Closed));
    assert_eq!(
        lab.study.add(&NewParticipants::numbered(1)),
        Err(Refusal::Closed)
    );
    // Who has begun continues, also in a new session.
    lab.complete(1);
    assert_eq!(status(&lab, 1), Status::Completed);
}

#[test]
fn a_clock_that_was_ahead_closes_no_study() {
    let mut settings = settings();
    settings.closes_at_ms = Some(2_000_000);
    let mut lab = Lab::new(settings, 1);
    let (now_ms, ahead_ms) = (lab.now_ms, 3_000_000);
    lab.now_ms = ahead_ms;
    assert_eq!(lab.open(1), Err(Refusal::Closed));
    // Right again when it is asked next, however late that is.
    let elapsed_ms = [0, 1, 2 * CONFIRMATION_TIME_MS, 3 * CONFIRMATION_TIME_MS];
    for (at_ms, elapsed_ms) in [ahead_ms, now_ms, ahead_ms, now_ms]
        .into_iter()
        .zip(elapsed_ms)
    {
        assert_eq!(lab.study.next(at_ms, elapsed_ms), []);
    }
    lab.now_ms = now_ms;
    lab.begin(1);
}

#[test]
fn a_study_closes_when_its_data_are_deleted_and_not_after_that() {
    let mut settings = settings();
    settings.deletes_at_ms = Some(2_000_000);
    let mut lab = Lab::new(settings.clone(), 1);
    lab.begin(1);
    assert_eq!(lab.study.view(1).unwrap().deletes_at_ms, Some(2_000_000));
    assert_eq!(lab.wake_in(), Some(CLOCK_CHECK_MS));
    lab.wait(1_000_000);
    lab.wait(CONFIRMATION_TIME_MS);
    assert!(lab.study.is_closed());
    // Before it closes, or given in microseconds.
    for (closes_at_ms, deletes_at_ms) in [(2_000_001, 2_000_000), (0, 1_900_000_000_000_000)] {
        settings.closes_at_ms = Some(closes_at_ms);
        settings.deletes_at_ms = Some(deletes_at_ms);
        let refused = Study::new(Arc::new(settings.clone())).unwrap_err();
        assert_eq!(refused.field, "deletes_at_ms");
    }
}

#[test]
fn pseudonyms_are_unique_and_follow_from_numbers() {
    let mut lab = Lab::new(settings(), 1);
    let names = ["p04", "", "", "Ada"].map(str::to_owned);
    lab.invite(&named(&names));
    let participants = lab.study.participants().values();
    let pseudonyms: Vec<_> = participants.map(|it| it.pseudonym.as_str()).collect();
    assert_eq!(pseudonyms, ["P01", "p04", "P03", "P05", "Ada"]);
    for taken in [&["ada".to_owned()][..], &["Bo".to_owned(), "BO".to_owned()]] {
        assert!(matches!(
            lab.study.add(&named(taken)),
            Err(Refusal::NameTaken(_))
        ));
    }
    let most = chefshat_study::MAX_PARTICIPANTS as usize;
    let too_many = lab.study.add(&NewParticipants::numbered(most));
    assert_eq!(too_many, Err(Refusal::TooManyParticipants));
}

#[test]
fn test_participants_take_no_slot_from_others_and_may_go_on_without_answers() {
    let mut settings = within(2);
    settings.participants = 2;
    let mut lab = Lab::new(settings, 1);
    lab.invite(&tests(3));
    lab.add(2);
    let of = |lab: &Lab, number| {
        let participant = lab.participant(number);
        (
            participant.pseudonym.clone(),
            participant.slot,
            participant.test,
        )
    };
    // More of them than the study has slots, before anybody else.
    for (number, slot) in [(2, 0), (3, 1), (4, 2)] {
        lab.complete(number);
        let name = format!("T{number:02}");
        assert_eq!(of(&lab, number), (name, Some(slot), true));
        assert!(lab.study.view(number).unwrap().test);
    }
    for (number, slot) in [(1, 0), (5, 1)] {
        lab.begin(number);
        assert_eq!(
            of(&lab, number),
            (format!("P{number:02}"), Some(slot), false)
        );
        assert!(!lab.study.view(number).unwrap().test);
    }
    assert_eq!(lab.open(6), Err(Refusal::Full));
    // The conditions of a slot are the same in a test.
    let conditions = |number| {
        let participant = lab.participant(number);
        lab.study.sequence_of(participant)
    };
    assert_eq!(conditions(2), conditions(1));
    assert_eq!(lab.folded_again(), lab.study);

    // A questionnaire is passed over in a test alone.
    lab.invite(&tests(1));
    let mut skipped = Vec::new();
    for number in [1, 7] {
        if number == 7 {
            lab.begin(number);
        }
        while !matches!(lab.content(number), Content::Questionnaire(_)) {
            lab.act(number);
        }
        skipped.push(lab.study.proceed(lab.at(number), 0).is_ok());
    }
    assert_eq!(skipped, [false, true]);
}
