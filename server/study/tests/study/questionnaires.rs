//! Questionnaires: valid answers, orders of items, templates.

use std::collections::{BTreeMap, BTreeSet};

use chefshat_study::testing::{settings, within};
use chefshat_study::{
    Answer, AnswerSet, Change, Content, End, Item, ItemAnswer, ItemKind, Language, MAX_SAVES, Part,
    Questionnaire, Refusal, ScreenOut, Settings, ShownIf, Stage, Status, Study, Task, Template,
    Text,
};

use super::support::{Lab, answer, valid};

fn item(id: &str, kind: ItemKind) -> Item {
    Item::new(id, "How was it?", kind)
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
    settings.stages[0] = Stage::once(Task::Questionnaire(questionnaire()));
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
        Answer::options(vec![0, 1]),
        "2 options are not within 1..=1",
    );
    check(
        2,
        Answer::options(vec![3]),
        "options must ascend within 0..=2",
    );
    check(3, text(""), "0 characters are not within 1..=12");
    check(
        3,
        text("thirteen char"),
        "13 characters are not within 1..=12",
    );
    check(3, text("a\u{0}b"), "control characters are not allowed");
    check(3, Answer::options(vec![0]), "it is answered by a text");
    check(
        4,
        Answer::options(vec![1, 0]),
        "options must ascend within 0..=2",
    );
    check(
        4,
        Answer::options(vec![1, 1]),
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

    for last in [Answer::options(Vec::new()), Answer::options(vec![0, 1, 2])] {
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

/// A first questionnaire with a number and a choice, a second with items for some, and a text and
/// practice for some.
fn branching() -> Settings {
    let options = ["cards", "chess", "none"].map(str::to_owned).to_vec();
    let number = |id: &str| {
        let (min, max, unit) = (18, 99, "years".to_owned());
        item(id, ItemKind::Number { min, max, unit })
    };
    let choice = |id: &str, multiple| {
        let options = options.clone();
        item(id, ItemKind::Choice { options, multiple })
    };
    let likert = |id: &str, shown_if: Vec<ShownIf>| {
        let labels = ["no", "yes"].map(str::to_owned).to_vec();
        Item {
            shown_if,
            ..item(id, ItemKind::Likert { points: 5, labels })
        }
    };
    let numbers = |min, max| AnswerSet {
        min,
        max,
        options: Vec::new(),
    };
    let options_of = |options: &[usize]| AnswerSet {
        options: options.to_vec(),
        ..AnswerSet::default()
    };
    let before = |item: &str, answers, not| ShownIf {
        questionnaire: Some("before".to_owned()),
        item: item.to_owned(),
        answers,
        not,
    };
    let here = |item: &str, answers| ShownIf {
        questionnaire: None,
        item: item.to_owned(),
        answers,
        not: false,
    };
    let first = Questionnaire {
        id: "before".to_owned(),
        items: vec![
            number("age"),
            Item {
                required: false,
                ..choice("plays", true)
            },
            // "cards" and no other option.
            Item {
                attention_check: Some(options_of(&[0])),
                ..choice("check", true)
            },
        ],
        ..questionnaire()
    };
    let over_30 = before("age", numbers(Some(31), None), false);
    let second = Questionnaire {
        id: "after".to_owned(),
        items: vec![
            likert("all", Vec::new()),
            likert("players", vec![before("plays", options_of(&[0, 1]), false)]),
            likert("agreed", vec![here("all", numbers(Some(4), None))]),
            likert("asked_on", vec![here("agreed", numbers(None, Some(2)))]),
        ],
        ..questionnaire()
    };
    let text = Task::Text(Text {
        title: String::new(),
        text: "You play cards.".to_owned(),
    });
    let part = |task, shown_if| Stage::Once(Part { task, shown_if });
    let mut settings = settings();
    settings.stages = vec![
        Stage::once(Task::Questionnaire(first)),
        part(
            Task::Practice { in_data: false },
            vec![before("plays", options_of(&[0]), true)],
        ),
        part(
            text,
            vec![before("plays", options_of(&[0]), false), over_30.clone()],
        ),
        Stage::once(Task::Questionnaire(second)),
        Stage::once(Task::Games { count: 1 }),
        part(Task::Practice { in_data: false }, vec![over_30]),
    ];
    settings
}

#[test]
fn earlier_answers_decide_what_is_shown() {
    // Age, what is played, the steps that are reached, and the items of the second questionnaire.
    for (age, plays, steps, items) in [
        (18, vec![2], vec![0, 1, 3, 4, 6], vec![0, 2, 3]),
        (30, vec![0], vec![0, 3, 4, 6], vec![0, 1, 2, 3]),
        (31, vec![1, 2], vec![0, 1, 3, 4, 5, 6], vec![0, 1, 2, 3]),
        (99, vec![0, 1], vec![0, 2, 3, 4, 5, 6], vec![0, 1, 2, 3]),
        (40, vec![], vec![0, 1, 3, 4, 5, 6], vec![0, 2, 3]),
    ] {
        let mut lab = Lab::new(branching(), 1);
        lab.open(1).unwrap();
        let given = vec![
            answer(0, Answer::Number(age)),
            answer(1, Answer::options(plays.clone())),
            answer(2, Answer::options(vec![0])),
        ];
        let mut given = Some(given);
        let mut reached = vec![0];
        while lab.participant(1).ended_at_ms.is_none() {
            match lab.content(1) {
                Content::Questionnaire(shown) if lab.at(1).step == 3 => {
                    let shown: Vec<usize> = shown.items.iter().map(|it| it.item).collect();
                    assert_eq!(shown, items);
                    // `all` has 5, so `agreed` is shown and has 5, so `asked_on` is not.
                    let mut answers: Vec<ItemAnswer> = (shown.iter())
                        .map(|item| answer(*item, Answer::Number(5)))
                        .collect();
                    let hidden = lab.study.answer(lab.at(1), answers.clone(), 0).unwrap_err();
                    let text = "item 3: it is not shown after these answers";
                    assert_eq!(hidden.to_string(), text);
                    answers.pop();
                    lab.answer(1, answers);
                    let mut met = items.clone();
                    met.pop();
                    assert_eq!(lab.study.shown_items(1, 3), Some(met));
                }
                Content::Questionnaire(_) => {
                    let given = given.take().unwrap();
                    lab.answer(1, given);
                }
                _ => drop(lab.act(1)),
            }
            let step = lab.at(1).step;
            if reached.last() != Some(&step) {
                reached.push(step);
            }
        }
        assert_eq!(reached, steps, "{age} {plays:?}");
        let participant = lab.participant(1);
        assert_eq!(participant.status, Status::Completed);
        assert_eq!(participant.reached_at_ms.len(), 7);
        assert_eq!(lab.folded_again(), lab.study);
        // The journal without the answers leads to the same steps.
        lab.withdraw(1, true);
        lab.forget(1);
        assert_eq!(lab.folded_again(), lab.study);
    }
}

#[test]
fn screening_out_ends_a_participation_and_frees_its_slot() {
    let (min, max, unit) = (0, 99, String::new());
    let young = ShownIf {
        questionnaire: Some("first".to_owned()),
        item: "age".to_owned(),
        answers: AnswerSet {
            max: Some(17),
            ..AnswerSet::default()
        },
        not: false,
    };
    let text = "For adults.".to_owned();
    let screen_out = Part {
        task: Task::ScreenOut(ScreenOut { text: text.clone() }),
        shown_if: vec![young],
    };
    let first = Task::Questionnaire(Questionnaire {
        id: "first".to_owned(),
        items: vec![item("age", ItemKind::Number { min, max, unit })],
        ..questionnaire()
    });
    let mut settings = settings();
    settings.participants = 1;
    settings.recruiting.left_url = "https://panel.example/left".to_owned();
    let stages = [Stage::once(first), Stage::Once(screen_out.clone())];
    settings.stages.splice(1..1, stages);
    let mut lab = Lab::new(settings.clone(), 2);
    let answered = |lab: &mut Lab, number, age| {
        lab.begin(number);
        let age = vec![answer(0, Answer::Number(age))];
        lab.answer(number, age);
    };
    answered(&mut lab, 1, 17);
    let participant = lab.participant(1);
    assert_eq!(participant.status, Status::ScreenedOut);
    assert_eq!(participant.ended_at_ms, Some(lab.now_ms));
    assert!(
        !participant.answers.is_empty(),
        "what it has answered is kept"
    );
    let end = |url: &str, text: &str| Content::End {
        reason: End::ScreenedOut,
        url: Some(url.to_owned()),
        text: text.to_owned(),
    };
    let content = |lab: &Lab| lab.content(1);
    assert_eq!(content(&lab), end("https://panel.example/left", &text));
    assert_eq!(lab.study.proceed(lab.at(1), 0), Err(Refusal::Over));

    // The slot is for the next one, who goes on.
    answered(&mut lab, 2, 18);
    assert_eq!(lab.participant(2).slot, Some(0));
    lab.complete(2);
    let participant = lab.participant(2);
    assert_eq!(participant.status, Status::Completed);
    assert_eq!(participant.passed_over, [2].into());
    assert_eq!(lab.folded_again(), lab.study);

    // Its data are deleted at its wish; the journal without them leads to the same state.
    lab.withdraw(1, true);
    let participant = lab.participant(1);
    assert_eq!(participant.status, Status::ScreenedOut);
    lab.forget(1);
    assert_eq!(lab.folded_again(), lab.study);

    // It has an address of its own, and needs answers.
    settings.recruiting.screened_out_url = "https://panel.example/out".to_owned();
    let mut lab = Lab::new(settings.clone(), 1);
    answered(&mut lab, 1, 0);
    assert_eq!(content(&lab), end("https://panel.example/out", &text));
    settings.stages[2] = Stage::once(screen_out.task);
    let refused = Study::new(settings).unwrap_err();
    assert_eq!(refused.field, "stages[2].shown_if");
}

#[test]
fn in_a_block_the_answers_of_other_conditions_do_not_count() {
    let number = |id: &str, shown_if: Vec<ShownIf>| {
        let (min, max, unit) = (0, 9, String::new());
        let kind = ItemKind::Number { min, max, unit };
        Item {
            required: false,
            shown_if,
            ..item(id, kind)
        }
    };
    let above_5 = || {
        vec![ShownIf {
            questionnaire: Some("asked".to_owned()),
            item: "n".to_owned(),
            answers: AnswerSet {
                min: Some(6),
                ..AnswerSet::default()
            },
            not: false,
        }]
    };
    let stage = |id: &str, items| {
        Task::Questionnaire(Questionnaire {
            id: id.to_owned(),
            items,
            ..questionnaire()
        })
    };
    let mut settings = within(2);
    settings.stages = vec![
        Stage::per_condition([
            stage("asked", vec![number("n", Vec::new())]),
            // Nobody is shown a questionnaire without items.
            stage("more", vec![number("m", above_5())]),
            Task::Games { count: 1 },
        ]),
        Stage::Once(Part {
            task: stage("last", vec![number("l", Vec::new())]),
            shown_if: above_5(),
        }),
    ];
    // The answers in both conditions, and the steps that are passed over.
    for (answers, passed_over) in [
        ([Some(6), Some(6)], vec![]),
        ([Some(6), Some(5)], vec![4, 6]),
        ([Some(6), None], vec![4, 6]),
        ([None, Some(9)], vec![1]),
    ] {
        let mut lab = Lab::new(settings.clone(), 1);
        lab.open(1).unwrap();
        while lab.participant(1).ended_at_ms.is_none() {
            let at = lab.at(1);
            let given = match at.step {
                0 => answers[0],
                3 => answers[1],
                1 | 4 | 6 => Some(1),
                _ => {
                    lab.act(1);
                    continue;
                }
            };
            let given = given.map(|number| answer(0, Answer::Number(number)));
            let given = Vec::from_iter(given);
            lab.answer(1, given);
        }
        let participant = lab.participant(1);
        assert_eq!(
            participant.passed_over,
            passed_over.iter().copied().collect()
        );
        for step in [1, 4, 6] {
            let shown = if passed_over.contains(&step) {
                vec![]
            } else {
                vec![0]
            };
            assert_eq!(lab.study.shown_items(1, step), Some(shown));
        }
    }
}

#[test]
fn an_attention_check_is_passed_by_its_answers_and_no_others() {
    for (chosen, passed) in [(vec![0], 1), (vec![1], 0), (vec![0, 1], 0), (vec![], 0)] {
        let mut settings = branching();
        let Stage::Once(first) = &mut settings.stages[0] else {
            panic!("a questionnaire");
        };
        let Task::Questionnaire(it) = &mut first.task else {
            panic!("a questionnaire");
        };
        it.items[2].required = false;
        it.items[0].attention_check = Some(AnswerSet {
            min: Some(20),
            max: Some(20),
            options: Vec::new(),
        });
        let mut lab = Lab::new(settings, 1);
        lab.open(1).unwrap();
        let given = vec![
            answer(0, Answer::Number(20 + passed)),
            answer(1, Answer::options(vec![2])),
            answer(2, Answer::options(chosen)),
        ];
        lab.answer(1, given);
        // One of both checks is passed where none or all options are right.
        let participant = lab.participant(1);
        assert_eq!(lab.study.attention_checks(participant), (2, 1));
    }
}

#[test]
fn what_is_entered_is_kept_until_it_is_answered_or_deleted() {
    let mut settings = settings();
    let stage = |id: &str| {
        let id = id.to_owned();
        Stage::once(Task::Questionnaire(Questionnaire {
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
    let saved = |lab: &Lab| lab.participant(1).saved_answers.to_vec();
    let save = |lab: &mut Lab, answers: &[ItemAnswer]| {
        let change = lab.study.save(lab.at(1), answers.to_vec())?;
        lab.fold(change);
        Ok(())
    };
    // Not all is answered, and what is entered changes.
    assert_eq!(save(&mut lab, &[number(0, 2)]), Ok(()));
    let unticked = answer(4, Answer::options(Vec::new()));
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
    assert_eq!(lab.participant(1).saves, MAX_SAVES);
    assert_eq!(save(&mut lab, &second), Err(Refusal::TooManySaves));
    lab.withdraw(1, true);
    assert_eq!(saved(&lab), []);
    let forgotten = lab.changes.iter_mut().filter_map(|change| {
        change.forget(1);
        match change {
            Change::Saved(saved) => Some(saved.answers.is_empty()),
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
            while lab.participant(number).ended_at_ms.is_none() {
                if let Content::Questionnaire(shown) = lab.content(number) {
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
    for (template, other, count, scales) in [
        (Template::Godspeed, Language::Italian, 24, 5),
        (Template::NasaTlx, Language::Italian, 6, 1),
        (Template::UeqS, Language::German, 8, 2),
    ] {
        assert_eq!(Template::from_name(template.name()), Some(template));
        let ids = [Language::English, other].map(|language| {
            let questionnaire = template.questionnaire(language).unwrap();
            assert!(template.source(language).contains("doi:10."));
            let items = questionnaire.items.clone();
            assert_eq!(items.len(), count);
            let distinct: BTreeSet<_> = items.iter().map(|item| item.scale.clone()).collect();
            assert_eq!(distinct.len(), scales);
            // As a stage it passes the checks of every questionnaire.
            let mut settings = settings();
            settings.stages[2] = Stage::once(Task::Questionnaire(questionnaire));
            Study::new(settings).unwrap();
            items.into_iter().map(|item| item.id).collect::<Vec<_>>()
        });
        assert_eq!(ids[0], ids[1]);
        assert_ne!(
            template.questionnaire(Language::English),
            template.questionnaire(other)
        );
        for language in Language::ALL {
            let has_texts = [Language::English, other].contains(&language);
            assert_eq!(template.questionnaire(language).is_some(), has_texts);
        }
    }
}
