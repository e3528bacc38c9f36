//! Participants who play together.

use std::collections::{BTreeMap, BTreeSet};

use chefshat_study::testing::in_groups;
use chefshat_study::{
    Content, End, Labels, LeftOverPolicy, NewParticipants, Outcome, Refusal, Settings, Stage,
    Status, Task, testing,
};
use proptest::prelude::*;

use super::support::{Lab, tests};

/// A group's next game is placed, if it waits for nobody.
fn place(lab: &mut Lab, number: u32) {
    let placed = lab.place(number);
    lab.fold_all(placed);
}

fn end(lab: &mut Lab, number: u32, outcome: Outcome) {
    let ended = lab.ended(number, outcome);
    lab.fold(ended);
}

/// A game ends for these, with a result.
fn finish(lab: &mut Lab, numbers: impl IntoIterator<Item = u32>) {
    let numbers = numbers.into_iter();
    numbers.for_each(|number| end(lab, number, Outcome::Finished));
}

/// These begin, then groups are formed.
fn meet(lab: &mut Lab, numbers: impl IntoIterator<Item = u32>) {
    numbers.into_iter().for_each(|number| lab.begin(number));
    lab.wait(0);
}

/// New participants who are planned to play together.
fn together(count: usize) -> NewParticipants {
    NewParticipants {
        together: true,
        ..NewParticipants::numbered(count)
    }
}

/// Groups: their members by number, with the slot of each.
fn groups(lab: &Lab) -> BTreeMap<u32, Vec<(u32, u32)>> {
    let mut groups: BTreeMap<u32, Vec<(u32, u32)>> = BTreeMap::new();
    for (number, it) in lab.study.participants() {
        if let Some(group) = it.group {
            groups
                .entry(group)
                .or_default()
                .push((*number, it.slot.unwrap()));
        }
    }
    groups
}

fn here(lab: &Lab, number: u32) -> u32 {
    match lab.content(number) {
        Content::Arrival(shown) => shown.here,
        other => panic!("{other:?}"),
    }
}

fn reason(lab: &Lab, number: u32) -> End {
    match lab.content(number) {
        Content::End { reason, .. } => reason,
        other => panic!("{other:?}"),
    }
}

#[test]
fn those_who_arrive_together_play_the_same_games_in_one_condition() {
    let mut lab = Lab::new(in_groups(2), 5);
    for number in [3, 1, 5] {
        lab.begin(number);
        lab.now_ms += 1;
    }
    assert_eq!(here(&lab, 3), 2);
    lab.wait(0);
    // Who came first: 3 with 1.
    assert_eq!(groups(&lab), BTreeMap::from([(1, vec![(1, 1), (3, 0)])]));
    assert_eq!(here(&lab, 5), 1);
    let sequences = [0, 1].map(|slot| lab.study.sequence(slot).to_vec());
    assert_eq!(sequences[0], sequences[1]);

    for round in 0..2 {
        let due = [3, 1].map(|number| lab.study.due(number).unwrap());
        assert_eq!(due.each_ref().map(|it| it.seat), [round, round + 2]);
        assert_eq!(due[0].seed, due[1].seed);
        place(&mut lab, 1);
        let placed = [1, 3].map(|number| lab.participant(number).games[round].clone());
        assert_eq!(placed[0].placed.game, placed[1].placed.game);
        let participant = lab.participant(1);
        let seats = lab.study.seats_of_group(participant, &placed[0].placed);
        assert_eq!(seats, [round, round + 2]);
        assert_eq!(lab.study.players_of(3), [1, 3]);
        assert!(
            [1, 3]
                .iter()
                .all(|number| lab.study.plays_with_others(*number))
        );
        finish(&mut lab, [1, 3]);
        // The next game waits for both.
        lab.act(1);
        if round == 0 {
            assert!(lab.place(1).is_empty());
            let Content::Game(shown) = lab.content(1) else {
                panic!("no game");
            };
            assert_eq!(shown.waits_for, 1);
        }
        lab.act(3);
    }
    for number in [1, 3] {
        lab.act(number);
        assert_eq!(lab.participant(number).status, Status::Completed);
    }
}

#[test]
fn a_plan_says_who_plays_with_whom() {
    let mut lab = Lab::new(in_groups(2), 0);
    let planned = together(4);
    lab.invite(&planned);
    lab.add(2);
    for number in [1, 3, 5, 6, 4] {
        lab.begin(number);
        lab.wait(1);
    }
    let members = |lab: &Lab| -> Vec<Vec<u32>> {
        let groups = groups(lab).into_values();
        groups
            .map(|it| it.into_iter().map(|(number, _)| number).collect())
            .collect()
    };
    assert_eq!(members(&lab), [vec![5, 6], vec![3, 4]]);
    // Somebody else comes in place of the one who was planned.
    lab.remove(2);
    lab.fold_all(lab.study.replacement(2).unwrap());
    lab.begin(7);
    lab.wait(1);
    assert_eq!(members(&lab)[2], [1, 7]);

    assert_eq!(lab.study.add(&together(3)), Err(Refusal::NoWholeGroups(2)));
    let alone = Lab::new(testing::settings(), 0);
    assert_eq!(alone.study.add(&planned), Err(Refusal::NoWholeGroups(1)));
}

#[test]
fn those_left_over_are_thanked_or_play_with_agents() {
    for left_over in [LeftOverPolicy::Dismiss, LeftOverPolicy::Agents] {
        let mut settings = in_groups(3);
        settings.groups.as_mut().unwrap().left_over = left_over;
        settings.recruiting.completed_url = "https://panel.example/done".to_owned();
        let mut lab = Lab::new(settings, 3);
        meet(&mut lab, [1, 2]);
        // Only time with an open page counts.
        lab.wait(59_000);
        lab.study.set_connected(2, false, lab.now_ms);
        lab.wait(0);
        lab.open(2).unwrap();
        lab.wait(2_000);
        match left_over {
            LeftOverPolicy::Dismiss => {
                assert_eq!(reason(&lab, 1), End::LeftOver);
                let Content::End { url, .. } = lab.content(1) else {
                    panic!("no end");
                };
                assert_eq!(url.as_deref(), Some("https://panel.example/done"));
                assert_eq!(here(&lab, 2), 1);
                // Its place is free: two more may begin with the second.
                assert_eq!(lab.open(3), Ok(()));
                assert!(lab.participant(1).slot.is_none());
            }
            LeftOverPolicy::Agents => {
                assert_eq!(groups(&lab)[&1], [(1, 0), (2, 1)]);
                place(&mut lab, 2);
                let participant = lab.participant(2);
                let game = participant.games[0].placed.clone();
                assert_eq!(lab.study.seats_of_group(participant, &game), [0, 1, 2]);
                assert_eq!(game.seat, 1);
                // The third slot of the group is nobody's.
                meet(&mut lab, [3]);
                lab.wait(60_000);
                assert_eq!(groups(&lab)[&2], [(3, 3)]);
            }
        }
    }
}

#[test]
fn a_member_who_leaves_keeps_nobody_waiting() {
    let mut lab = Lab::new(in_groups(2), 4);
    meet(&mut lab, [1, 2]);
    place(&mut lab, 1);
    lab.withdraw(2, true);
    assert!(lab.study.plays_with_others(2) && !lab.study.plays_with_others(1));
    finish(&mut lab, [1, 2]);
    lab.act(1);
    // The next game has one of them.
    place(&mut lab, 1);
    assert!(lab.study.due(1).is_none());
    assert_eq!(lab.study.players_of(1), [1]);

    // The slots of a group are given again only after all of it have left.
    meet(&mut lab, [3, 4]);
    assert_eq!(groups(&lab)[&2], [(3, 2), (4, 3)]);
    lab.remove(1);
    lab.add(2);
    meet(&mut lab, [5, 6]);
    assert_eq!(groups(&lab)[&3], [(5, 0), (6, 1)]);
}

#[test]
fn of_a_group_of_three_only_the_late_one_drops_out() {
    let mut lab = Lab::new(in_groups(3), 3);
    meet(&mut lab, 1..=3);
    place(&mut lab, 1);
    finish(&mut lab, 1..=3);
    lab.act(1);
    lab.act(3);
    lab.wait(0);
    lab.wait(30_000);
    // One who waits loses its connection for a moment: that prolongs nothing, and costs it nothing.
    lab.study.set_connected(1, false, lab.now_ms);
    lab.wait(0);
    lab.study.set_connected(1, true, lab.now_ms);
    lab.wait(29_000);
    lab.study.set_connected(3, false, lab.now_ms);
    lab.wait(1_000);
    assert_eq!(reason(&lab, 2), End::DroppedOut);
    lab.study.set_connected(3, true, lab.now_ms);
    lab.wait(0);
    assert_eq!(lab.place(1).len(), 2);
}

#[test]
fn nothing_is_due_while_nobody_is_here_who_waits() {
    let mut settings = in_groups(3);
    settings.drop_out_after_ms = 600_000;
    settings.stages.insert(3, Stage::once(testing::text()));
    settings
        .stages
        .insert(4, Stage::once(Task::Games { count: 1 }));
    let mut lab = Lab::new(settings, 3);
    meet(&mut lab, 1..=3);
    for _ in 0..2 {
        place(&mut lab, 1);
        finish(&mut lab, 1..=3);
        for number in 1..=3 {
            lab.act(number);
        }
    }
    // The first reads; the others wait for it, and have no page open.
    for number in 2..=3 {
        lab.act(number);
        lab.study.set_connected(number, false, lab.now_ms);
    }
    lab.wait(0);
    lab.wait(60_000);
    assert_eq!(lab.wake_in(), Some(540_000));
    // When one is back, the two who are late have dropped out.
    lab.study.set_connected(2, true, lab.now_ms);
    lab.wait(0);
    assert_eq!(
        [1, 3].map(|number| reason(&lab, number)),
        [End::DroppedOut; 2]
    );
    assert_eq!(lab.place(2).len(), 1);
}

#[test]
fn who_is_alone_in_its_group_may_return() {
    let mut settings = in_groups(2);
    settings.groups.as_mut().unwrap().left_over = LeftOverPolicy::Agents;
    let mut lab = Lab::new(settings, 1);
    meet(&mut lab, [1]);
    lab.wait(60_000);
    assert_eq!(groups(&lab)[&1], [(1, 0)]);
    lab.study.set_connected(1, false, lab.now_ms);
    lab.wait(60_000);
    assert_eq!(reason(&lab, 1), End::DroppedOut);
    assert_eq!(lab.open(1), Ok(()));
    assert_eq!(lab.participant(1).status, Status::Active);
}

#[test]
fn plans_do_not_take_each_others_places() {
    let mut settings = in_groups(2);
    settings.participants = 4;
    let mut lab = Lab::new(settings, 0);
    lab.invite(&together(6));
    lab.begin(1);
    lab.begin(3);
    // Two pairs are expected: there is a place for their others, and for nobody else.
    assert_eq!(lab.open(5), Err(Refusal::Full));
    meet(&mut lab, [2, 4]);
    assert_eq!(groups(&lab).len(), 2);
    // In place of one whose group is formed comes somebody who may play with anybody.
    lab.fold_all(lab.study.replacement(2).unwrap());
    assert_eq!(lab.participant(7).planned, None);
}

#[test]
fn nobody_waits_where_no_slots_are_left() {
    let mut settings = in_groups(2);
    settings.participants = 4;
    settings.groups.as_mut().unwrap().left_over = LeftOverPolicy::Agents;
    let mut lab = Lab::new(settings, 4);
    let away = |lab: &mut Lab, number| {
        lab.begin(number);
        lab.study.set_connected(number, false, lab.now_ms);
    };
    away(&mut lab, 3);
    // Two come alone, one after the other, and play with agents.
    meet(&mut lab, [1]);
    lab.wait(60_000);
    meet(&mut lab, [2]);
    lab.wait(59_000);
    away(&mut lab, 4);
    lab.wait(1_000);
    assert_eq!(groups(&lab).len(), 2);
    lab.study.set_connected(4, true, lab.now_ms);
    lab.wait(0);
    assert_eq!(reason(&lab, 4), End::LeftOver);
    // Nor may one return who had no group.
    assert_eq!(reason(&lab, 3), End::DroppedOut);
    assert_eq!(lab.open(3), Err(Refusal::Full));
}

#[test]
fn a_member_for_whom_the_others_wait_too_long_has_dropped_out() {
    let mut lab = Lab::new(in_groups(2), 2);
    meet(&mut lab, [1, 2]);
    place(&mut lab, 1);
    finish(&mut lab, [1, 2]);
    lab.act(1);
    lab.wait(0);
    assert_eq!(lab.wake_in(), Some(60_000));
    lab.wait(59_999);
    assert!(lab.place(1).is_empty());
    lab.wait(1);
    assert_eq!(reason(&lab, 2), End::DroppedOut);
    assert_eq!(lab.place(1).len(), 1);
    // Its seat is taken: it does not come back.
    assert_eq!(lab.study.open(2, None, lab.now_ms), Ok(None));
}

#[test]
fn nobody_begins_for_whom_there_is_no_place() {
    let mut settings = in_groups(2);
    settings.participants = 2;
    let mut lab = Lab::new(settings, 4);
    lab.begin(1);
    lab.open(2).unwrap();
    lab.open(3).unwrap();
    lab.act(2);
    assert_eq!(lab.study.consent(lab.at(3), lab.now_ms), Err(Refusal::Full));
    assert_eq!(lab.open(4), Err(Refusal::Full));
    lab.wait(0);
    assert_eq!(groups(&lab)[&1], [(1, 0), (2, 1)]);
    assert_eq!(lab.study.consent(lab.at(3), lab.now_ms), Err(Refusal::Full));
    for number in [1, 2] {
        lab.remove(number);
    }
    lab.act(3);
    assert_eq!(here(&lab, 3), 1);
}

#[test]
fn a_test_participant_goes_on_alone() {
    let mut lab = Lab::new(in_groups(2), 1);
    lab.invite(&tests(3));
    meet(&mut lab, [1, 2]);
    assert_eq!([1, 2].map(|number| here(&lab, number)), [1, 1]);
    let at = lab.at(1);
    assert_eq!(
        lab.study.proceed(at, lab.now_ms),
        Err(Refusal::StepMismatch)
    );
    let grouped = lab.study.proceed(lab.at(2), lab.now_ms);
    lab.fold(grouped.unwrap());
    assert_eq!(groups(&lab)[&1], [(2, 0)]);
    meet(&mut lab, [3, 4]);
    assert_eq!(groups(&lab)[&2], [(3, 2), (4, 3)]);
    // Nor does its game wait for another test participant any longer, if it continues.
    lab.study.set_connected(4, false, lab.now_ms);
    assert!(lab.place(3).is_empty());
    let late = lab.study.without_late(3, lab.now_ms);
    lab.fold_all(late);
    assert_eq!(reason(&lab, 4), End::DroppedOut);
    assert_eq!(lab.place(3).len(), 1);
}

#[test]
fn practice_is_played_alone() {
    let mut settings = in_groups(2);
    settings
        .stages
        .insert(2, Stage::once(Task::Practice { in_data: false }));
    let mut lab = Lab::new(settings, 2);
    meet(&mut lab, [1, 2]);
    place(&mut lab, 1);
    assert!(lab.study.due(1).is_none() && lab.study.due(2).is_some());
    let participant = lab.participant(1);
    let practice = participant.games[0].placed.clone();
    assert_eq!(
        lab.study.seats_of_group(participant, &practice),
        [practice.seat]
    );
}

#[test]
fn settings_of_groups_that_cannot_be_played_are_refused() {
    type Change = fn(&mut Settings);
    let changes: [(Change, &str); 9] = [
        (|it| it.groups.as_mut().unwrap().size = 1, "groups.size"),
        (|it| it.groups.as_mut().unwrap().size = 7, "groups.size"),
        (
            |it| it.groups.as_mut().unwrap().wait_ms = 0,
            "groups.wait_ms",
        ),
        (|it| it.participants = 7, "participants"),
        (
            |it| it.conditions[1].players = 2,
            "conditions[1].rules.players",
        ),
        (|it| drop(it.stages.remove(1)), "stages"),
        (|it| it.stages.swap(1, 2), "stages[2]"),
        (|it| it.stages.insert(1, it.stages[1].clone()), "stages[2]"),
        (|it| it.groups = None, "stages[1]"),
    ];
    for (change, field) in changes {
        let mut settings = in_groups(3);
        change(&mut settings);
        let problem = chefshat_study::Study::new(settings).unwrap_err();
        assert_eq!(problem.field, field, "{problem}");
    }
}

/// Something happens: its kind, and a number that says to whom.
fn happen(lab: &mut Lab, (kind, who): (u8, u32)) {
    let number = who % (lab.study.participants().len() as u32 + 1) + 1;
    let is_active = (lab.study.participant(number)).is_some_and(|it| it.status == Status::Active);
    match kind {
        0 => lab.add(1),
        1..=4 => drop(lab.open(number)),
        5..=11 if is_active => {
            let running = lab.participant(number).games.last();
            let running = running
                .filter(|it| it.ended.is_none())
                .map(|it| it.placed.game);
            match running {
                // A game ends for all who play it, at once.
                Some(game) => {
                    let all = lab.study.participants().iter();
                    let all = all.filter(|(_, it)| {
                        it.games
                            .last()
                            .is_some_and(|it| it.placed.game == game && it.ended.is_none())
                    });
                    let all: Vec<u32> = all.map(|(number, _)| *number).collect();
                    let outcome = match who % 4 {
                        0 => Outcome::Aborted,
                        _ => Outcome::Finished,
                    };
                    all.into_iter().for_each(|it| end(lab, it, outcome));
                }
                None => {
                    lab.act(number);
                }
            }
        }
        12 => lab.study.set_connected(number, false, lab.now_ms),
        13 => lab.wait(u64::from(who) * 100),
        14 => {
            if let Ok(Some(withdrew)) = lab.study.withdraw(number, who % 2 == 0, lab.now_ms) {
                lab.fold(withdrew);
            }
        }
        15 => lab.study = lab.folded_again(),
        _ => lab.wait(1),
    }
}

/// What holds of groups, whatever happens.
fn check(lab: &Lab) {
    let size = lab.study.settings().group_size();
    let mut holders = BTreeSet::new();
    for (group, members) in groups(lab) {
        let slots: BTreeSet<u32> = members.iter().map(|(_, slot)| *slot).collect();
        assert_eq!(slots.len(), members.len(), "two members have one slot");
        let units: BTreeSet<u32> = slots.iter().map(|slot| slot / size).collect();
        assert_eq!(units.len(), 1, "the slots of group {group} are apart");
        let holds = |number: &u32| lab.participant(*number).holds_slot();
        if members.iter().any(|(number, _)| holds(number)) {
            assert!(holders.insert(units), "two groups hold the same slots");
        }
        // Those who are in the middle of it play the same game, or wait for each other.
        let active = members.iter().map(|(number, _)| lab.participant(*number));
        let active: Vec<_> = active.filter(|it| it.status == Status::Active).collect();
        let games: BTreeSet<_> = active
            .iter()
            .map(|it| it.games.last().map(|it| it.placed.game))
            .collect();
        assert!(games.len() <= 1, "group {group} is in several games");
        let seats: BTreeSet<_> = active
            .iter()
            .map(|it| it.games.last().map(|it| it.placed.seat))
            .collect();
        assert!(
            games.contains(&None) || seats.len() == active.len(),
            "two share a seat"
        );
    }
    for (number, participant) in lab.study.participants() {
        if participant.status == Status::Active {
            assert!(lab.study.view(*number).is_some());
        }
    }
}

fn plans() -> impl Strategy<Value = Settings> {
    let left_over = prop::sample::select(vec![LeftOverPolicy::Dismiss, LeftOverPolicy::Agents]);
    (2..=4u32, left_over, any::<[u8; 32]>()).prop_map(|(size, left_over, seed)| {
        let mut settings = in_groups(size);
        settings.assignment_seed = seed;
        settings.participants = 2 * size;
        settings.groups.as_mut().unwrap().left_over = left_over;
        settings.conditions[0].labels = Labels::Players;
        settings
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 96, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn groups_stay_together(
        plan in plans(),
        events in prop::collection::vec((0..=17u8, 0..1000u32), 0..250),
    ) {
        let mut lab = Lab::new(plan, 6);
        for event in events {
            happen(&mut lab, event);
            check(&lab);
        }
        prop_assert!(lab.folded_again() == lab.study);
    }
}
