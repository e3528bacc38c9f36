//! Settings: every check names its field.

use std::collections::BTreeMap;

use chefshat_study::testing::{condition, consent, settings, text, within};
use chefshat_study::{
    AnswerSet, ExternalQuestionnaire, Factor, Item, ItemKind, Language, Part, Questionnaire,
    Settings, ShownIf, Stage, Study, Task, Template,
};

fn check(field: &str, start: Settings, change: impl FnOnce(&mut Settings)) {
    let mut changed = start;
    change(&mut changed);
    let problem = Study::new(changed).expect_err(field);
    assert_eq!(problem.field, field, "{problem}");
}

fn questionnaire(id: &str, items: Vec<Item>, shuffled: bool) -> Task {
    Task::Questionnaire(Questionnaire {
        id: id.to_owned(),
        title: String::new(),
        instructions: String::new(),
        items,
        shuffled,
    })
}

fn item(kind: ItemKind) -> Stage {
    let item = Item {
        required: false,
        ..Item::new("i", "?", kind)
    };
    Stage::once(questionnaire("q", vec![item], false))
}

fn slider(min: i32, max: i32, step: u32) -> Stage {
    let (left, right) = (String::new(), String::new());
    item(ItemKind::Slider {
        min,
        max,
        step,
        left,
        right,
    })
}

fn external(url: &str) -> Stage {
    let (text, url) = (String::new(), url.to_owned());
    Stage::once(Task::External(ExternalQuestionnaire { text, url }))
}

#[test]
fn the_settings_of_the_tests_are_valid() {
    Study::new(settings()).unwrap();
    (1..=12).for_each(|conditions| drop(Study::new(within(conditions)).unwrap()));
}

#[test]
fn a_problem_of_the_design_names_its_field() {
    let factor = |name: &str| Factor {
        name: name.to_owned(),
        levels: vec!["x".to_owned()],
    };
    check("title", settings(), |it| it.title.clear());
    check("title", settings(), |it| it.title = "a\u{7}".to_owned());
    check("participants", settings(), |it| it.participants = 0);
    check("participants", settings(), |it| it.participants = 10_001);
    check("factors", settings(), |it| {
        it.factors = vec![factor("x"); 9]
    });
    check("factors[0].name", settings(), |it| {
        it.factors[0].name = "a b".to_owned()
    });
    check("factors[0].levels", settings(), |it| {
        it.factors[0].levels.clear()
    });
    check("factors[0].levels", settings(), |it| {
        it.factors[0].levels[1] = "é".to_owned()
    });
    check("factors[1].name", within(2), |it| {
        it.factors = vec![factor("x"), factor("x")]
    });
    check("conditions", settings(), |it| it.conditions.clear());
    check("conditions", within(13), |_| {});
    check("conditions[1].id", settings(), |it| {
        it.conditions[1].id = "condition-0".to_owned()
    });
    check("conditions[0].id", settings(), |it| {
        it.conditions[0].id.clear()
    });
    check("conditions[0].levels", settings(), |it| {
        it.conditions[0].levels.clear()
    });
    check("conditions[2].levels", settings(), |it| {
        it.conditions.push(condition(2))
    });
    check("conditions[0].levels", within(2), |it| {
        it.conditions[0].levels = BTreeMap::from([("y".to_owned(), "x".to_owned())]);
    });
    check("conditions[0].rules.players", settings(), |it| {
        it.conditions[0].players = 7
    });
    check("conditions[0].participant_seat", settings(), |it| {
        it.conditions[0].participant_seat = Some(4);
    });
    check("conditions[1].seeds", settings(), |it| {
        it.conditions[1].seeds = vec![[0; 32]; 1001]
    });
    check("seeds", settings(), |it| it.seeds.clear());
    check("block_size", settings(), |it| it.block_size = Some(3));
    check("block_size", settings(), |it| it.block_size = Some(0));
    check("block_size", settings(), |it| it.block_size = Some(34));
    check("block_size", within(3), |it| it.block_size = Some(3));
    check("drop_out_after_ms", settings(), |it| {
        it.drop_out_after_ms = 1000
    });
    check("recruiting.id_parameter", settings(), |it| {
        it.recruiting.open_link = true;
        it.recruiting.id_parameter = "a b".to_owned();
    });
    check("recruiting.id_parameter", settings(), |it| {
        it.recruiting.id_parameter = "id".to_owned()
    });
    check("recruiting.completed_url", settings(), |it| {
        it.recruiting.completed_url = "javascript:alert(1)".to_owned()
    });
    check("recruiting.left_url", settings(), |it| {
        it.recruiting.left_url = "https://{id}.example".to_owned()
    });
    check("recruiting.left_url", settings(), |it| {
        it.recruiting.open_link = true;
        it.recruiting.id_parameter = "id".to_owned();
        it.recruiting.left_url = "https://panel.example/{id}".to_owned();
    });
    check("recruiting.completed_url", settings(), |it| {
        it.recruiting.open_link = true;
        it.recruiting.id_parameter = "id".to_owned();
        it.recruiting.completed_url = "https://panel.example/{id}/{id}".to_owned();
    });
    check("recruiting.full_url", settings(), |it| {
        it.recruiting.full_url = "https://panel.example/{id}".to_owned()
    });
}

#[test]
fn a_problem_of_a_stage_names_its_field() {
    let games = |count| Stage::once(Task::Games { count });
    check("stages", settings(), |it| it.stages.clear());
    check("stages", settings(), |it| it.stages = vec![games(100); 11]);
    check("stages", within(12), |it| {
        it.stages = vec![Stage::per_condition(vec![text(); 17])]
    });
    check("stages[1]", settings(), |it| {
        it.stages[1] = Stage::once(consent())
    });
    check("stages[0].per_condition.stages[0]", settings(), |it| {
        it.stages[0] = Stage::per_condition(vec![consent()]);
    });
    check("stages[0].per_condition.stages", settings(), |it| {
        it.stages[0] = Stage::per_condition(Vec::new());
    });
    check("stages[3]", within(2), |it| it.stages[3] = games(1));
    check("stages[1].games.count", settings(), |it| {
        it.stages[1] = games(0)
    });
    check("stages[2].questionnaire.id", settings(), |it| {
        let twice =
            Task::Questionnaire(Template::NasaTlx.questionnaire(Language::English).unwrap());
        it.stages[1] = Stage::once(twice.clone());
        it.stages[2] = Stage::once(twice);
    });
    for url in [
        "http://example.org",
        "https://",
        "https:///x",
        "https://{participant}.example.org",
        "https://example.org/?c={condition}",
        "https://example.org/a b",
        "javascript:alert(1)",
    ] {
        let field = "stages[1].external_questionnaire.url";
        check(field, settings(), |it| it.stages[1] = external(url));
    }
    let mut valid = settings();
    valid.stages[1] = external("https://example.org/?p={participant}&q={participant}");
    Study::new(valid).unwrap();
}

#[test]
fn a_problem_of_an_item_names_its_field() {
    let labels = |count| vec!["x".to_owned(); count];
    let likert = |points, count| {
        item(ItemKind::Likert {
            points,
            labels: labels(count),
        })
    };
    let choice = |options: &[&str]| {
        let options = options.iter().map(|&it| it.to_owned()).collect();
        item(ItemKind::Choice {
            options,
            multiple: true,
        })
    };
    let number = |min, max| {
        let unit = "years".to_owned();
        item(ItemKind::Number { min, max, unit })
    };
    for (field, stage) in [
        ("points", likert(1, 2)),
        ("points", likert(12, 2)),
        ("labels", likert(5, 3)),
        ("min", slider(-1_000_001, 0, 1)),
        ("max", slider(0, 0, 1)),
        ("step", slider(0, 10, 0)),
        ("step", slider(0, 10, 3)),
        ("options", choice(&["a"])),
        ("options[1]", choice(&["a", "a"])),
        (
            "max_characters",
            item(ItemKind::FreeText { max_characters: 0 }),
        ),
        ("min", number(-1_000_001, 0)),
        ("max", number(1, 0)),
    ] {
        let field = format!("stages[1].questionnaire.items[0].{field}");
        check(&field, settings(), |it| it.stages[1] = stage);
    }
    for stage in [
        likert(5, 2),
        likert(5, 5),
        slider(-10, 10, 5),
        choice(&["a", "b"]),
        number(7, 7),
    ] {
        let mut valid = settings();
        valid.stages[1] = stage;
        Study::new(valid).unwrap();
    }
}

#[test]
fn a_problem_of_a_condition_names_its_field() {
    let number = |min, max| ItemKind::Number {
        min,
        max,
        unit: String::new(),
    };
    let options = ["a", "b"].map(str::to_owned).to_vec();
    let multiple = false;
    let earlier = questionnaire(
        "earlier",
        vec![
            Item::new("number", "?", number(0, 9)),
            Item::new("choice", "?", ItemKind::Choice { options, multiple }),
            Item::new("text", "?", ItemKind::FreeText { max_characters: 9 }),
        ],
        false,
    );
    let from = |min| AnswerSet {
        min: Some(min),
        ..AnswerSet::default()
    };
    let chosen = |options: &[usize]| AnswerSet {
        options: options.to_vec(),
        ..AnswerSet::default()
    };
    let shown_if = |questionnaire: Option<&str>, item: &str, answers: AnswerSet| ShownIf {
        questionnaire: questionnaire.map(str::to_owned),
        item: item.to_owned(),
        answers,
        not: false,
    };
    let part = |task, shown_if| Stage::Once(Part { task, shown_if });
    let check_part = |field: &str, stage: Stage| {
        check(&format!("stages[2].{field}"), settings(), |it| {
            it.stages[1] = Stage::once(earlier.clone());
            it.stages.insert(2, stage);
        });
    };
    let in_earlier = |item: &str, answers| vec![shown_if(Some("earlier"), item, answers)];
    for (field, conditions) in [
        (
            "shown_if",
            vec![shown_if(Some("earlier"), "number", from(1)); 5],
        ),
        (
            "shown_if[0].questionnaire",
            vec![shown_if(None, "number", from(1))],
        ),
        (
            "shown_if[0].questionnaire",
            vec![shown_if(Some("later"), "number", from(1))],
        ),
        ("shown_if[0].item", in_earlier("nothing", from(1))),
        (
            "shown_if[0].answers",
            in_earlier("number", AnswerSet::default()),
        ),
        ("shown_if[0].answers", in_earlier("number", chosen(&[1]))),
        ("shown_if[0].answers", in_earlier("number", from(10))),
        ("shown_if[0].answers", in_earlier("text", from(1))),
        ("shown_if[0].answers", in_earlier("choice", from(1))),
        (
            "shown_if[0].answers.options",
            in_earlier("choice", chosen(&[])),
        ),
        (
            "shown_if[0].answers.options",
            in_earlier("choice", chosen(&[2])),
        ),
        (
            "shown_if[0].answers.options",
            in_earlier("choice", chosen(&[1, 0])),
        ),
    ] {
        check_part(field, part(text(), conditions));
    }
    let games = Task::Games { count: 1 };
    check_part("shown_if", part(games, in_earlier("number", from(1))));
    // Items of their own questionnaire: not themselves, not later ones, and not where it is shuffled.
    let own = |of_first: &str, of_second: &str, shuffled| {
        let item = |id: &str, other: &str| Item {
            shown_if: vec![shown_if(None, other, from(1))],
            ..Item::new(id, "?", number(0, 9))
        };
        let first = match of_first {
            "" => Item::new("one", "?", number(0, 9)),
            other => item("one", other),
        };
        Stage::once(questionnaire(
            "own",
            vec![first, item("two", of_second)],
            shuffled,
        ))
    };
    let items = "questionnaire.items";
    check_part(
        &format!("{items}[0].shown_if[0].item"),
        own("two", "one", false),
    );
    check_part(
        &format!("{items}[1].shown_if[0].item"),
        own("", "two", false),
    );
    check_part(
        &format!("{items}[1].shown_if[0].questionnaire"),
        own("", "one", true),
    );
    for stage in [
        own("", "one", false),
        part(text(), in_earlier("number", from(1))),
        part(text(), in_earlier("choice", chosen(&[0, 1]))),
    ] {
        let mut valid = settings();
        valid.stages[1] = Stage::once(earlier.clone());
        valid.stages.insert(2, stage);
        Study::new(valid).unwrap();
    }
    for (field, kind, passing) in [
        ("attention_check.options", "choice", chosen(&[2])),
        ("attention_check.options", "choice", chosen(&[0, 1])),
        ("attention_check", "number", AnswerSet::default()),
    ] {
        let mut items = match &earlier {
            Task::Questionnaire(it) => it.items.clone(),
            _ => Vec::new(),
        };
        let index = items.iter().position(|item| item.id == kind).unwrap();
        items[index].attention_check = Some(passing);
        let field = format!("stages[1].questionnaire.items[{index}].{field}");
        check(&field, settings(), |it| {
            it.stages[1] = Stage::once(questionnaire("earlier", items, false));
        });
    }
}
