//! Questionnaires: valid answers, orders of items, templates.

use std::collections::{BTreeMap, BTreeSet};

use chefshat_study::testing::{settings, within};
use chefshat_study::{
    Answer, Change, Content, Item, ItemAnswer, ItemKind, Language, MAX_SAVES, Questionnaire,
    Refusal, Stage, Study, Task, Template,
};

use super::support::{Lab, answer, valid};

fn item(id: &str, kind: ItemKind) -> Item {
    Item {
        id: id.to_owned(),
        scale: String::new(),
        text: "How was it?".to_owned(),
        required: true,
        kind,
    }
}

/// One required item of each kind, and an optional choice.
fn questionnaire() -> Questionnaire {
    let labels = ["no", "yes"].map(str::to_owned).to_vec();
    let (left, right) = ("low".to_owned(), "high".to_owned());
    let options = ["a", "b", "c"].map(str::to_owned).to_vec();
    let (min, max, step) = (-10, 10, 5);
    let mut items = vec![
        item("likert", ItemKind::Likert { points: 7, labels }),
        item(
            "slider",
            ItemKind::Slider {
                min,
                max,
                step,
                left,
                right,
            },
        ),
        item(
            "one",
            ItemKind::Choice {
                options: options.clone(),
                multiple: false,
            },
        ),
        item("text", ItemKind::FreeText { max_characters: 12 }),
        item(
            "some",
            ItemKind::Choice {
                options,
                multiple: true,
            },
        ),
    ];
    items[4].required = false;
    Questionnaire {
        id: "after".to_owned(),
        title: String::new(),
        instructions: String::new(),
        items,
        shuffled: false,
    }
}

#[test]
fn answers_are_checked_item_by_item() {
    let mut settings = settings();
    settings.stages[0] = Stage::Once(Task::Questionnaire(questionnaire()));
    let mut lab = Lab::new(settings, 1);
    lab.open(1).unwrap();
    let items = questionnaire().items;
    let answers = |changed: Option<(usize, Answer)>| -> Vec<ItemAnswer> {
        let mut answers: BTreeMap<usize, Answer> = BTreeMap::new();
        for (index, item) in items.iter().enumerate() {
            answers.insert(index, valid(&item.kind));
        }
        answers.extend(changed);
        answers
            .into_iter()
            .map(|(item, value)| answer(item, value))
            .collect()
    };
    let check = |item: usize, value: Answer, problem: &str| {
        let given = answers(Some((item, value)));
        let refused = match lab.study.answer(lab.at(1), given, 0) {
            Err(Refusal::Answers(refused)) => refused.to_string(),
            other => panic!("{other:?}"),
        };
        assert_eq!(refused, format!("item {item}: {problem}"));
    };
    let text = |text: &str| Answer::Text(text.to_owned());
    check(0, Answer::Number(0), "0 is not a point within 1..=7");
    check(0, Answer::Number(8), "8 is not a point within 1..=7");
    check(0, text("7"), "it is answered by a number");
    check(
        1,
        Answer::Number(-11),
        "-11 is not within -10..=10 in steps of 5",
    );
    check(
        1,
        Answer::Number(i32::MIN),
        "-2147483648 is not within -10..=10 in steps of 5",
    );
    check(
        1,
        Answer::Number(-9),
        "-9 is not within -10..=10 in steps of 5",
    );
    check(2, Answer::Number(1), "it is answered by options");
    check(
        2,
        Answer::Options(vec![0, 1]),
        "2 options are not within 1..=1",
    );
    check(
        2,
        Answer::Options(vec![3]),
        "options must ascend within 0..=2",
    );
    check(3, text(""), "0 characters are not within 1..=12");
    check(
        3,
        text("thirteen char"),
        "13 characters are not within 1..=12",
    );
    check(3, text("a\u{0}b"), "control characters are not allowed");
    check(3, Answer::Options(vec![0]), "it is answered by a text");
    check(
        4,
        Answer::Options(vec![1, 0]),
        "options must ascend within 0..=2",
    );
    check(
        4,
        Answer::Options(vec![1, 1]),
        "options must ascend within 0..=2",
    );
    check(5, Answer::Number(1), "the questionnaire has no such item");

    let refused = |answers| match lab.study.answer(lab.at(1), answers, 0) {
        Err(Refusal::Answers(problem)) => problem.to_string(),
        other => panic!("{other:?}"),
    };
    let mut twice = answers(None);
    twice.push(twice[0].clone());
    assert_eq!(refused(twice), "item 0: it has two answers");
    let missing = answers(None).split_off(1);
    assert_eq!(refused(missing), "item 0: it must be answered");

    for last in [Answer::Options(Vec::new()), Answer::Options(vec![0, 1, 2])] {
        assert!(
            lab.study
                .answer(lab.at(1), answers(Some((4, last))), 0)
                .is_ok()
        );
    }
    let mut reversed = answers(None);
    reversed.pop();
    reversed.reverse();
    assert!(lab.study.answer(lab.at(1), reversed, 0).is_ok());
}

#[test]
fn what_is_entered_is_kept_until_it_is_answered_or_deleted() {
    let mut settings = settings();
    let stage = |id: &str| {
        let id = id.to_owned();
        Stage::Once(Task::Questionnaire(Questionnaire {
            id,
            ..questionnaire()
        }))
    };
    settings
        .stages
        .splice(0..1, [stage("first"), stage("second")]);
    let mut lab = Lab::new(settings, 1);
    lab.open(1).unwrap();
    let number = |item, value| answer(item, Answer::Number(value));
    let saved = |lab: &Lab| lab.study.participant(1).unwrap().saved_answers.to_vec();
    let save = |lab: &mut Lab, answers: &[ItemAnswer]| {
        let change = lab.study.save(lab.at(1), answers.to_vec())?;
        lab.fold(change);
        Ok(())
    };
    // Not all is answered, and what is entered changes.
    assert_eq!(save(&mut lab, &[number(0, 2)]), Ok(()));
    let unticked = answer(4, Answer::Options(Vec::new()));
    let second = [number(0, 3), unticked];
    assert_eq!(save(&mut lab, &second), Ok(()));
    assert_eq!(saved(&lab), second);
    let mut problem = |answers: &[ItemAnswer]| match save(&mut lab, answers) {
        Err(Refusal::Answers(problem)) => problem.to_string(),
        other => panic!("{other:?}"),
    };
    assert_eq!(
        problem(&[number(0, 9)]),
        "item 0: 9 is not a point within 1..=7"
    );
    assert_eq!(
        problem(&[number(0, 1), number(0, 1)]),
        "item 0: it has two answers"
    );
    let earlier = lab.at(1);
    lab.open(1).unwrap();
    let superseded = lab.study.save(earlier, Vec::new());
    assert_eq!(superseded, Err(Refusal::Superseded));
    assert_eq!(saved(&lab), second, "on another device");

    // The next questionnaire begins empty.
    let first_step = lab.at(1);
    lab.act(1);
    assert_eq!(saved(&lab), []);
    let late = lab.study.save(first_step, second.to_vec());
    assert_eq!(late, Err(Refusal::StepOver));
    while save(&mut lab, &second).is_ok() {}
    assert_eq!(lab.study.participant(1).unwrap().saves, MAX_SAVES);
    assert_eq!(save(&mut lab, &second), Err(Refusal::TooManySaves));
    let deleted = lab.study.withdraw(1, true, 0).unwrap().unwrap();
    lab.fold(deleted);
    assert_eq!(saved(&lab), []);
    let forgotten = lab.changes.iter_mut().filter_map(|change| {
        change.forget(1);
        match change {
            Change::Saved { answers, .. } => Some(answers.is_empty()),
            _ => None,
        }
    });
    assert_eq!(
        forgotten.collect::<Vec<_>>(),
        vec![true; MAX_SAVES as usize]
    );
}

#[test]
fn each_participant_has_an_order_of_its_own_that_stays() {
    let shown = |seed: u8| -> BTreeSet<Vec<usize>> {
        let mut settings = within(2);
        settings.assignment_seed = [seed; 32];
        let mut lab = Lab::new(settings, 6);
        let mut orders = BTreeSet::new();
        for number in 1..=6 {
            lab.open(number).unwrap();
            while lab.study.participant(number).unwrap().ended_at_ms.is_none() {
                if let Content::Questionnaire(shown) = lab.study.view(number).unwrap().content {
                    let order: Vec<usize> = shown.items.iter().map(|it| it.item).collect();
                    let step = lab.at(number).step;
                    assert_eq!(lab.study.item_order(number, step).as_ref(), Some(&order));
                    let mut sorted = order.clone();
                    sorted.sort_unstable();
                    assert_eq!(sorted, (0..24).collect::<Vec<_>>());
                    orders.insert(order);
                }
                lab.act(number);
            }
        }
        assert_eq!(lab.study.item_order(1, 0), None);
        orders
    };
    let orders = shown(1);
    // Six participants answer twice.
    assert_eq!(orders.len(), 12);
    assert_eq!(orders, shown(1));
    assert!(orders.is_disjoint(&shown(2)));
}

#[test]
fn templates_are_complete_in_both_languages() {
    for (template, count, scales) in [(Template::Godspeed, 24, 5), (Template::NasaTlx, 6, 1)] {
        assert_eq!(Template::from_name(template.name()), Some(template));
        let ids = [Language::English, Language::Italian].map(|language| {
            let questionnaire = template.questionnaire(language).unwrap();
            assert!(template.source(language).contains("doi:10."));
            let items = questionnaire.items.clone();
            assert_eq!(items.len(), count);
            let distinct: BTreeSet<_> = items.iter().map(|item| item.scale.clone()).collect();
            assert_eq!(distinct.len(), scales);
            // As a stage it passes the checks of every questionnaire.
            let mut settings = settings();
            settings.stages[2] = Stage::Once(Task::Questionnaire(questionnaire));
            Study::new(settings).unwrap();
            items.into_iter().map(|item| item.id).collect::<Vec<_>>()
        });
        assert_eq!(ids[0], ids[1]);
        assert_ne!(
            template.questionnaire(Language::English),
            template.questionnaire(Language::Italian)
        );
        for without in [Language::German, Language::Spanish] {
            assert_eq!(template.questionnaire(without), None);
        }
    }
}
