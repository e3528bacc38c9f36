//! Rows of decisions agree with the engine's metrics and with the record.

use std::collections::{BTreeMap, BTreeSet};

use chefshat_dataset::decision_columns;
use chefshat_engine::RewardScheme;
use chefshat_proto::v1::{self, game_event::Kind, record_line::Line};
use chefshat_record::signature::SigningKey;
use serde_json::{Value, json};

use super::{Stage, a_record, counted, number, players};

/// The record with invalid attempts before some of its decisions.
fn with_attempts(mut lines: Vec<v1::RecordLine>) -> Vec<v1::RecordLine> {
    let decisions = lines.iter_mut().filter_map(|line| match &mut line.line {
        Some(Line::Decision(decision)) => Some(decision),
        _ => None,
    });
    for (index, decision) in decisions.enumerate() {
        if index % 5 == 2 {
            // No action has these numbers, so they are never legal.
            decision.invalid_attempts = vec![4_000_000_000, 213_000];
        }
    }
    lines
}

#[test]
fn rows_agree_with_the_engines_metrics() {
    let lines = with_attempts(a_record(3));
    let stage = Stage::new(&[("a.jsonl", lines.clone())]);
    let exported = stage.run(&stage.export()).unwrap();
    let rows = stage.rows("decisions");
    assert_eq!(exported.decisions, rows.len() as u64);
    for scheme in RewardScheme::ALL {
        for shift in counted(&lines, scheme) {
            for (seat, metrics) in shift.seats.iter() {
                let of_seat: Vec<&Value> = rows
                    .iter()
                    .filter(|row| {
                        row["shift"] == shift.shift
                            && row["seat"].as_u64() == Some(seat.index() as u64)
                    })
                    .collect();
                let turns: Vec<&&Value> = of_seat
                    .iter()
                    .filter(|row| row["phase"] == "turn")
                    .collect();
                let passes = turns.iter().filter(|row| row["text"] == "pass").count();
                let attempts: f64 = turns.iter().map(|row| number(row, "invalid_count")).sum();
                assert_eq!(turns.len(), metrics.valid as usize);
                assert_eq!(passes, metrics.passes as usize);
                assert_eq!(attempts, f64::from(metrics.wrong));
                let name = scheme.name();
                let rewards: f64 = of_seat
                    .iter()
                    .map(|row| {
                        number(row, &format!("reward_{name}"))
                            + number(row, &format!("invalid_reward_{name}"))
                    })
                    .sum();
                assert!(
                    (rewards - metrics.reward_sum).abs() < 1e-4,
                    "{name}, seat {seat}: {rewards}, {}",
                    metrics.reward_sum
                );
                for row in of_seat {
                    assert_eq!(number(row, "shift_points"), f64::from(metrics.points));
                    assert_eq!(number(row, "shift_place"), f64::from(metrics.place));
                }
            }
        }
    }
}

#[test]
fn rows_of_a_study_have_its_columns_and_the_time_of_the_device() {
    let mut lines = a_record(3);
    let mut timed = 0;
    for line in &mut lines {
        match &mut line.line {
            Some(Line::Header(header)) => {
                header.study = Some(v1::StudyRecord {
                    study_id: "5".repeat(32),
                    name: "warmth".into(),
                    condition: "cold".into(),
                    number: 7,
                    participant: "P07".into(),
                    ..v1::StudyRecord::default()
                });
            }
            Some(Line::Decision(decision)) if decision.seat == 0 => {
                timed += 1;
                let time = |text: &str| ("person_decision_time_ms".to_owned(), text.to_owned());
                decision.annotations = Some(v1::Annotations {
                    // Whatever a client sends: one of them is not a time.
                    extra: [time(if timed == 1 { "soon" } else { "1234" })].into(),
                    ..v1::Annotations::default()
                });
            }
            _ => {}
        }
    }
    let stage = Stage::new(&[("a.jsonl", lines)]);
    stage.run(&stage.export()).unwrap();
    let rows = stage.rows("decisions");
    for row in &rows {
        let study = [&row["study"], &row["condition"], &row["participant"]];
        assert_eq!(study, ["warmth", "cold", "P07"]);
    }
    let times = |of: fn(&Value) -> bool| {
        let rows = rows.iter().filter(move |row| of(&row["seat"]));
        rows.map(|row| row["person_decision_time_ms"].clone())
    };
    let own: Vec<Value> = times(|seat| seat == 0).collect();
    assert!(own.len() > 1 && own.len() == timed);
    assert!(own[0].is_null() && own[1..].iter().all(|time| *time == 1234));
    assert!(times(|seat| seat != 0).all(|time| time.is_null()));
}

#[test]
fn players_of_one_name_are_told_apart_by_their_keys() {
    let mut lines = a_record(3);
    let fingerprint = "0123456789abcdef";
    let seat = players(&lines)
        .iter()
        .position(|it| it.built_in_agent.is_empty());
    let seat = seat.expect("a participant");
    for line in &mut lines {
        match &mut line.line {
            Some(Line::Header(header)) => header.seats[seat].name_fingerprint = fingerprint.into(),
            Some(Line::Event(event)) => {
                if let Some(Kind::GameStarted(started)) = &mut event.kind {
                    started.seats[seat].name_fingerprint = fingerprint.into();
                }
            }
            _ => {}
        }
    }
    let stage = Stage::new(&[("a.jsonl", lines)]);
    stage.run(&stage.export()).unwrap();
    for row in stage.rows("decisions") {
        let expected = match row["seat"].as_u64() == Some(seat as u64) {
            true => Value::from(fingerprint),
            false => Value::Null,
        };
        assert_eq!(row["name_fingerprint"], expected);
    }
}

#[test]
fn the_owner_of_a_board_is_the_seat_that_played_last() {
    let stage = Stage::new(&[("a.jsonl", a_record(3))]);
    stage.run(&stage.export()).unwrap();
    let (mut pizza, mut owner, mut owned) = (Value::Null, Value::Null, 0);
    for row in stage.rows("decisions") {
        let now = json!([row["shift"], row["pizza"]]);
        if now != pizza {
            (pizza, owner) = (now, Value::Null);
        }
        assert_eq!(row["board_owner"], owner);
        owned += u32::from(!owner.is_null());
        if row["phase"] == "turn" && row["text"] != "pass" {
            owner = row["seat"].clone();
        }
    }
    assert!(owned > 100, "{owned}");
}

#[test]
fn rewards_of_a_shifts_end_are_in_each_seats_last_turn() {
    let stage = Stage::new(&[("a.jsonl", a_record(3))]);
    stage.run(&stage.export()).unwrap();
    let rows = stage.rows("decisions");
    for shift in [1, 2] {
        let turns: Vec<&Value> = rows
            .iter()
            .filter(|row| row["shift"] == shift && row["phase"] == "turn")
            .collect();
        let mut enders = 0;
        for seat in 0..4 {
            let mine: Vec<&&Value> = turns.iter().filter(|row| row["seat"] == seat).collect();
            let (last, before) = mine.split_last().unwrap();
            let points = |row: &Value| number(row, "reward_points");
            assert_eq!(points(last), number(last, "shift_points"));
            assert!(before.iter().all(|row| points(row) == 0.0));
            let won = last["shift_place"] == 1;
            assert_eq!(number(last, "reward_winning") == 1.0, won);
            enders += usize::from(last["number"] == turns[turns.len() - 1]["number"]);
        }
        assert_eq!(enders, 1, "one seat's last turn ended the Shift");
    }
}

#[test]
fn a_row_has_the_observation_and_action_of_its_seat() {
    let lines = a_record(3);
    let players = players(&lines);
    let stage = Stage::new(&[("a.jsonl", lines)]);
    stage.run(&stage.export()).unwrap();
    let rows = stage.rows("decisions");
    let columns: Vec<&str> = decision_columns()
        .iter()
        .map(|column| column.name)
        .collect();
    let turns_of_shift = |shift: u64| {
        let turns = rows.iter().filter(move |row| row["shift"] == shift);
        turns.filter_map(|row| row["turn"].as_u64())
    };
    for shift in [1, 2] {
        let turns: Vec<u64> = turns_of_shift(shift).collect();
        assert!(turns.len() > 20);
        assert_eq!(turns, (1..=turns.len() as u64).collect::<Vec<_>>());
    }
    assert!(rows.iter().any(|row| row["phase"] == "exchange"));
    for (row, index) in rows.iter().zip(1..) {
        assert!(columns.iter().all(|column| row.get(column).is_some()));
        assert_eq!(row.as_object().unwrap().len(), columns.len());
        assert_eq!(row["number"], index);
        assert_eq!(row["game_id"], format!("{:032x}", 3));
        assert_eq!(row["created_at"], "2023-11-14T22:13:20.123+00:00");
        assert_eq!(row["origin"], "fixed_seed");
        assert_eq!(row["finished"], true);
        let player = &players[row["seat"].as_u64().unwrap() as usize];
        assert_eq!(row["agent"], player.name);
        let built_in = Some(&player.built_in_agent).filter(|name| !name.is_empty());
        assert_eq!(
            row["built_in_agent"],
            built_in.map_or(Value::Null, |name| name.as_str().into())
        );
        assert_eq!(row["agent_kind"], built_in.map_or("agent", |_| "built_in"));
        assert_eq!(row["decision_time_us"].is_null(), built_in.is_some());
        assert_eq!(row["valid"], true);
        assert_eq!(row["invalid_reward_validity"].to_string(), "0.0");
        let seat = row["seat"].as_u64().unwrap() as usize;
        let hand: u64 = sum(&row["hand"]);
        assert_eq!(Some(hand), row["cards_left"][seat].as_u64());
        let legal = row["legal_actions"].as_array().unwrap();
        assert!(legal.contains(&row["action"]));
        let mask = hex::decode(row["mask"].as_str().unwrap()).unwrap();
        let bits = (0..214u16).filter(|bit| mask[usize::from(bit / 8)] >> (bit % 8) & 1 == 1);
        assert_eq!(*legal, bits.map(Value::from).collect::<Vec<_>>());
        let is_turn = row["phase"] == "turn";
        assert_eq!(row["pizza"].is_null(), !is_turn);
        assert_eq!(row["turn"].is_null(), !is_turn);
        if !is_turn {
            assert_eq!(number(row, "reward_validity"), 0.0);
        }
        assert_eq!(
            *row["expressions"].as_array().unwrap(),
            vec![Value::Null; 4]
        );
    }
    let places: BTreeMap<u64, u64> = rows
        .iter()
        .map(|row| {
            (
                row["seat"].as_u64().unwrap(),
                row["game_place"].as_u64().unwrap(),
            )
        })
        .collect();
    let mut in_order: Vec<u64> = places.into_values().collect();
    in_order.sort_unstable();
    assert_eq!(in_order, [1, 2, 3, 4]);
}

fn sum(list: &Value) -> u64 {
    let values = list.as_array().unwrap().iter();
    values.map(|value| value.as_u64().unwrap()).sum()
}

#[test]
fn rows_name_the_key_that_signed_their_record() {
    let key = SigningKey::from_seed(&[7; 32]);
    let mut signed = a_record(1);
    let signature = key.sign(&signed);
    if let Some(Line::Footer(footer)) = signed.last_mut().and_then(|line| line.line.as_mut()) {
        footer.signature = Some(signature);
    }
    let stage = Stage::new(&[("signed.jsonl", signed), ("unsigned.jsonl", a_record(3))]);
    stage.run(&stage.export()).unwrap();
    let rows = stage.rows("decisions");
    let keys: BTreeSet<Option<&str>> = rows.iter().map(|row| row["signed_by"].as_str()).collect();
    let key = key.public().to_string();
    assert_eq!(keys, [None, Some(key.as_str())].into());
}
