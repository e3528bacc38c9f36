//! The vectors of `tests/fixtures/vectors` agree, and every kind of damage is located.

use std::fs::File;
use std::io::{self, BufReader, Cursor, Read};
use std::path::PathBuf;

use chefshat_simulation::conformance::{Agreed, Failure, Report, check};
use serde_json::{Value, json};

fn path(file: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
        .join("../../tests/fixtures/vectors")
        .join(file)
}

fn lines(file: &str) -> Vec<String> {
    let path = path(file);
    let text = std::fs::read_to_string(&path)
        .unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    text.lines().map(str::to_owned).collect()
}

fn check_text(text: &str) -> Report {
    check(Cursor::new(text), |_| {})
}

#[test]
fn all_vectors_agree() {
    for (name, expected) in [
        (
            "games.jsonl",
            Agreed {
                deals: 0,
                games: 57,
                steps: 29_553,
            },
        ),
        (
            "deals.jsonl",
            Agreed {
                deals: 87,
                games: 0,
                steps: 0,
            },
        ),
    ] {
        let file = File::open(path(name)).unwrap();
        let (length, mut read) = (file.metadata().unwrap().len(), 0);
        let report = check(BufReader::new(file), |bytes| read += bytes);
        assert!(report.failure.is_none(), "{name}: {:?}", report.failure);
        assert_eq!(report.agreed, expected, "{name}");
        assert_eq!(read, length, "{name}: progress");
    }
}

type Damage = fn(&mut Value);

/// Damages the second line of a file. Returns place, step, expected and got of the report.
fn damaged(file: &str, damage: impl FnOnce(&mut Value)) -> (String, Option<usize>, String, String) {
    let lines = lines(file);
    let mut vector: Value = serde_json::from_str(&lines[1]).unwrap();
    damage(&mut vector);
    let report = check_text(&format!("{}\n{vector}\n{}\n", lines[0], lines[2]));
    assert_eq!(
        report.agreed.vectors(),
        1,
        "the first line agrees, the third is not reached"
    );
    match report.failure {
        Some(Failure::Disagrees {
            line: 2,
            disagreement: found,
        }) => (found.place, found.step, found.expected, found.got),
        other => panic!("the damage was not found: {other:?}"),
    }
}

fn raise(number: &mut Value) {
    *number = json!(number.as_u64().unwrap() + 1);
}

#[test]
fn damage_to_a_game_is_located() {
    let table: [(&str, Option<usize>, Damage); 12] = [
        ("steps[7], seat", Some(7), |game| {
            game["steps"][7][0] = json!((game["steps"][7][0].as_u64().unwrap() + 1) % 4)
        }),
        ("steps[7], legal actions", Some(7), |game| {
            raise(&mut game["steps"][7][2][0])
        }),
        ("steps[7], legal actions", Some(7), |game| {
            drop(game["steps"][7][2].as_array_mut().unwrap().pop())
        }),
        ("steps[7], action", Some(7), |game| {
            game["steps"][7][1] = json!(198)
        }),
        ("steps[7], action", Some(7), |game| {
            game["steps"][7][1] = json!(65_535)
        }),
        ("shifts[0].starter", None, |game| {
            raise(&mut game["shifts"][0]["starter"])
        }),
        ("shifts[0].order", None, |game| {
            game["shifts"][0]["order"].as_array_mut().unwrap().reverse()
        }),
        ("shifts[1].special", None, |game| {
            game["shifts"][1]["special"] = json!("food_fight")
        }),
        ("shifts[1].laps", None, |game| {
            raise(&mut game["shifts"][1]["laps"])
        }),
        ("number of shifts", None, |game| {
            let again = game["shifts"][0].clone();
            game["shifts"].as_array_mut().unwrap().push(again);
        }),
        ("scores", None, |game| raise(&mut game["scores"][2])),
        ("winner", None, |game| raise(&mut game["winner"])),
    ];
    for (expected_place, expected_step, damage) in table {
        let (place, step, expected, got) = damaged("games.jsonl", damage);
        assert_eq!(place, expected_place);
        assert!(
            step.is_some() && (expected_step.is_none() || step == expected_step),
            "{place}: {step:?}"
        );
        assert_ne!(expected, got, "{place}");
    }
}

#[test]
fn wrong_legal_actions_are_listed() {
    let table: [(&str, Damage); 4] = [
        (", without [0]", |game| {
            game["steps"][1][2]
                .as_array_mut()
                .unwrap()
                .insert(0, json!(0))
        }),
        (", with [199] in addition", |game| {
            drop(game["steps"][1][2].as_array_mut().unwrap().pop())
        }),
        (", without [0], with [199] in addition", |game| {
            let legal = game["steps"][1][2].as_array_mut().unwrap();
            legal.insert(0, json!(0));
            legal.pop();
        }),
        (", each once, ascending", |game| {
            game["steps"][1][2].as_array_mut().unwrap().push(json!(199));
        }),
    ];
    for (expected, damage) in table {
        let (place, _, _, got) = damaged("games.jsonl", damage);
        assert_eq!(place, "steps[1], legal actions");
        assert!(got.ends_with(expected), "{got}");
    }
}

#[test]
fn a_shortened_or_extended_game_is_reported() {
    let (place, _, expected, got) = damaged("games.jsonl", |game| {
        drop(game["steps"].as_array_mut().unwrap().pop())
    });
    assert_eq!(
        (place.as_str(), got.as_str()),
        ("steps", "a game that continues"),
        "{expected}"
    );
    let (place, _, _, got) = damaged("games.jsonl", |game| {
        let steps = game["steps"].as_array_mut().unwrap();
        steps.push(steps[0].clone());
    });
    assert!(
        place == "steps" && got.starts_with("the game has ended"),
        "{place}: {got}"
    );
}

#[test]
fn another_legal_action_shows_where_it_makes_a_difference() {
    let (place, step, ..) = damaged("games.jsonl", |game| {
        let step = &mut game["steps"][0];
        let other = step[2]
            .as_array()
            .unwrap()
            .iter()
            .find(|&action| *action != step[1])
            .unwrap()
            .clone();
        step[1] = other;
    });
    assert!(place.starts_with("steps["), "{place}");
    assert!(step > Some(0), "{place}");
}

#[test]
fn damage_to_a_deal_is_located() {
    let table: [(&str, Damage); 5] = [
        ("leader", |deal| raise(&mut deal["leader"])),
        ("hands[2]", |deal| {
            deal["hands"][2].as_array_mut().unwrap().swap(0, 1)
        }),
        ("hands[1]", |deal| {
            drop(deal["hands"][1].as_array_mut().unwrap().pop())
        }),
        ("number of hands", |deal| {
            drop(deal["hands"].as_array_mut().unwrap().pop())
        }),
        ("hands[0]", |deal| deal["seed"] = json!("00".repeat(32))),
    ];
    for (expected_place, damage) in table {
        let (place, step, expected, got) = damaged("deals.jsonl", damage);
        assert_eq!((place.as_str(), step), (expected_place, None));
        assert_ne!(expected, got, "{place}");
    }
}

#[test]
fn lines_that_are_not_vectors_are_explained() {
    let changed = |change: Damage| {
        let mut vector: Value = serde_json::from_str(&lines("deals.jsonl")[0]).unwrap();
        change(&mut vector);
        vector.to_string()
    };
    let table = [
        ("hello".to_owned(), "it is not JSON"),
        ("{\"rules\": ".to_owned(), "it is not JSON"),
        ("[1, 2]".to_owned(), "it is neither a game"),
        (
            "{\"name\": \"chefshat\"}".to_owned(),
            "it is neither a game",
        ),
        (
            changed(|deal| deal["comment"] = json!("x")),
            "unknown field `comment`",
        ),
        (
            changed(|deal| drop(deal.as_object_mut().unwrap().remove("leader"))),
            "missing field `leader`",
        ),
        (
            changed(|deal| deal["seed"] = json!("abc")),
            "Odd number of digits",
        ),
        (
            changed(|deal| deal["rules"]["faces"] = json!(3)),
            "faces: 3 faces: choose 4 to 15",
        ),
        (
            changed(|deal| deal["rules"]["players"] = json!(300)),
            "invalid value: integer `300`",
        ),
        (
            changed(|deal| deal["rules"]["opening"] = json!("silver")),
            "unknown variant `silver`",
        ),
        (
            changed(|deal| deal["rules"]["target_shifts"] = json!(3)),
            "exactly one of target_points and target_shifts",
        ),
    ];
    for (text, expected) in table {
        match check_text(&format!("\n{text}\n")).failure {
            Some(Failure::Unreadable { line: 2, reason }) => {
                assert!(reason.contains(expected), "{reason}: {text}")
            }
            other => panic!("{text}: {other:?}"),
        }
    }
}

#[test]
fn files_without_vectors_are_refused() {
    for text in ["", "\n\n  \n"] {
        assert!(
            matches!(check_text(text).failure, Some(Failure::Empty)),
            "{text:?}"
        );
    }
}

/// Fails after its first bytes.
struct Broken;

impl Read for Broken {
    fn read(&mut self, _: &mut [u8]) -> io::Result<usize> {
        Err(io::Error::other("the disk is gone"))
    }
}

#[test]
fn a_read_error_is_reported() {
    let line = format!("{}\n", lines("deals.jsonl")[0]);
    let report = check(BufReader::new(Cursor::new(line).chain(Broken)), |_| {});
    assert_eq!(report.agreed.deals, 1);
    match report.failure {
        Some(Failure::Read { line: 2, source }) => {
            assert_eq!(source.to_string(), "the disk is gone")
        }
        other => panic!("{other:?}"),
    }
}
