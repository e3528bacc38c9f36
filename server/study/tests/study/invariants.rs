//! Invariants under arbitrary behaviour of participants and researchers: slots have one holder, the
//! assignment is balanced, the same changes give the same study, and nothing that participants get
//! names a condition.

use std::collections::BTreeSet;

use chefshat_study::testing::within;
use chefshat_study::{Answer, Order, Outcome, Settings, Status};
use proptest::prelude::*;

use super::support::{Lab, answer};

/// Words that stand for conditions, and other identifiers that participants must not get.
const HIDDEN: [&str; 6] = [
    "condition",
    "anthropomorphism",
    "moving_elegantly",
    "perceived_safety",
    "godspeed",
    "AsTheyAre",
];

fn plans() -> impl Strategy<Value = Settings> {
    let design = (
        prop::sample::select(Order::ALL.to_vec()),
        1..=4usize,
        1..=2usize,
    );
    (design, 1..=20u32, any::<[u8; 32]>()).prop_map(|(design, participants, seed)| {
        let (order, conditions, repeats) = design;
        let mut settings = within(conditions);
        settings.order = order;
        settings.participants = participants;
        settings.assignment_seed = seed;
        settings.block_size = Some(settings.sequences().len() * repeats);
        settings
    })
}

/// Something happens: its kind, and a number that says to whom.
type Event = (u8, u32);

fn happen(lab: &mut Lab, (kind, who): Event) {
    let number = who % (lab.study.participants().len() as u32 + 1) + 1;
    let is_active = (lab.study.participant(number)).is_some_and(|it| it.status == Status::Active);
    match kind {
        0 if !lab.study.is_closed() => lab.add(1),
        1..=3 => drop(lab.open(number)),
        4..=9 if is_active => {
            lab.act(number);
        }
        10 if is_active && lab.study.due(number).is_some() => {
            let placed = lab.place(number);
            lab.fold_all(placed);
            let aborted = lab.ended(number, Outcome::Aborted);
            lab.fold(aborted);
        }
        11 => lab.study.set_connected(number, false, lab.now_ms),
        12 => lab.wait(u64::from(who) * 100),
        13 => {
            if let Ok(Some(withdrew)) = lab.study.withdraw(number, who % 2 == 0, lab.now_ms) {
                lab.fold(withdrew);
            }
        }
        14 => {
            if let Ok(Some(removed)) = lab.study.remove(number, lab.now_ms) {
                lab.fold(removed);
            }
        }
        // The server restarts: nobody is connected.
        15 => lab.study = lab.folded_again(),
        16 if who < 20 => lab
            .study
            .close()
            .into_iter()
            .for_each(|closed| lab.fold(closed)),
        17 if is_active => {
            let entered = vec![answer(0, Answer::Number(1))];
            if let Ok(saved) = lab.study.save(lab.at(number), entered) {
                lab.fold(saved);
            }
        }
        _ => {}
    }
}

fn check(lab: &Lab) {
    let settings = lab.study.settings();
    let participants = lab.study.participants();
    let holders = participants.values().filter(|it| it.holds_slot());
    let slots: Vec<u32> = holders.map(|it| it.slot.unwrap()).collect();
    let distinct: BTreeSet<u32> = slots.iter().copied().collect();
    assert_eq!(distinct.len(), slots.len(), "a slot has two holders");
    assert!(slots.iter().all(|slot| *slot < settings.participants));

    // Balanced within one block, but for slots that wait to be given again.
    let repeats = settings.block_size.unwrap() / settings.sequences().len();
    let waiting = distinct.last().map_or(0, |last| *last as usize + 1) - distinct.len();
    let times = |kind: &Vec<usize>| {
        let slots = distinct.iter();
        slots
            .filter(|slot| lab.study.sequence(**slot) == kind)
            .count()
    };
    let times: Vec<usize> = settings.sequences().iter().map(times).collect();
    let difference = times.iter().max().unwrap() - times.iter().min().unwrap();
    assert!(
        difference <= repeats + waiting,
        "{times:?} with {waiting} waiting"
    );

    for (number, participant) in participants {
        assert_eq!(participant.slot.is_some(), participant.consent.is_some());
        let Some(view) = lab.study.view(*number) else {
            continue;
        };
        let text = format!("{view:?}");
        let found = HIDDEN.iter().find(|word| text.contains(**word));
        assert!(found.is_none(), "{found:?} in {text}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 96, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn it_stays_balanced_and_folds_to_the_same(
        plan in plans(),
        events in prop::collection::vec((0..=17u8, 0..1000u32), 0..250),
    ) {
        let mut lab = Lab::new(plan, 6);
        for event in events {
            happen(&mut lab, event);
            check(&lab);
        }
        prop_assert!(lab.folded_again() == lab.study);

        // What was deleted can be removed from the stored changes as well.
        let deleted: Vec<u32> = (lab.study.participants().iter())
            .filter(|(_, it)| it.data_deleted)
            .map(|(number, _)| *number)
            .collect();
        for number in deleted {
            lab.forget(number);
            prop_assert_eq!(lab.forget(number), 0);
        }
        prop_assert!(lab.folded_again() == lab.study);

        // Once everybody needed has begun, only the last block may be incomplete.
        if !lab.study.is_closed() {
            lab.add(40);
            for number in 1..=lab.study.participants().len() as u32 {
                if lab.open(number).is_ok() && lab.at(number).step == 0 {
                    lab.act(number);
                }
            }
            let holders = lab.study.participants().values().filter(|it| it.holds_slot());
            prop_assert_eq!(holders.count() as u32, lab.study.settings().participants);
            check(&lab);
        }
    }
}
