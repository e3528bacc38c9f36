//! `chefshat verify`: accepts valid records, and reports file, line and problem of a damaged one.
//! The kinds of damage are tested in `chefshat-record`.

use serde_json::json;

use super::run::{chefshat, fixture, typed_into_a_closed_pipe};

/// A data folder with two records, the second damaged on line 9.
fn data_dir() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let records = folder.path().join("records");
    std::fs::create_dir(&records).unwrap();
    std::fs::copy(fixture("records/committed.jsonl"), records.join("a.jsonl")).unwrap();
    let text = std::fs::read_to_string(fixture("records/committed.jsonl")).unwrap();
    let damaged: Vec<String> = (1..)
        .zip(text.lines())
        .map(|(number, line)| match number {
            9 => line.replace("\"quantity\":3", "\"quantity\":2"),
            _ => line.to_owned(),
        })
        .collect();
    std::fs::write(records.join("b.jsonl"), damaged.join("\n") + "\n").unwrap();
    std::fs::write(records.join("c.jsonl.part"), "half a li").unwrap();
    std::fs::create_dir(records.join("d.jsonl")).unwrap();
    folder
}

#[test]
fn valid_records_verify() {
    let (committed, fixed) = (
        fixture("records/committed.jsonl"),
        fixture("records/fixed.jsonl"),
    );
    let ended = chefshat(&[
        "verify",
        committed.to_str().unwrap(),
        fixed.to_str().unwrap(),
    ])
    .clean();
    let lines: Vec<&str> = ended.stdout.lines().collect();
    let [first, second, last] = lines[..] else {
        panic!("{}", ended.stdout)
    };
    assert!(
        first.ends_with(
            "committed.jsonl: fits: finished, 207 decisions, 284 events, committed seed, unsigned"
        ),
        "{first}"
    );
    assert!(
        second.ends_with(
            "fixed.jsonl: fits: finished, 96 decisions, 130 events, fixed seed, unsigned"
        ),
        "{second}"
    );
    assert_eq!(last, "2 records fit, 303 decisions");
}

#[test]
fn a_damaged_record_is_reported() {
    let folder = data_dir();
    let data_dir = folder.path().to_str().unwrap();
    let ended = chefshat(&["verify", "--data-dir", data_dir]).ended_with(1);
    let lines: Vec<&str> = ended.stdout.lines().collect();
    let [first, second, last] = lines[..] else {
        panic!("{}", ended.stdout)
    };
    assert!(first.contains("a.jsonl: fits: finished"), "{first}");
    assert!(
        second.ends_with("b.jsonl: line 9: play.quantity is 2 and must be 3"),
        "{second}"
    );
    assert_eq!(last, "1 of 2 records do not fit");

    let records = folder.path().join("records");
    let ended = chefshat(&["verify", "--json", records.to_str().unwrap()]).ended_with(1);
    let printed = ended.json_lines();
    assert_eq!(printed.len(), 2);
    assert_eq!(
        printed[0],
        json!({
            "file": records.join("a.jsonl"),
            "fits": true,
            "game_id": "22b73f3bba773c1120e1858de68cd801",
            "state": "finished",
            "decisions": 207,
            "events": 284,
            "origin": "GAME_ORIGIN_DEALT",
            "seed_committed": true,
            "signed_by": null,
            "signature": "none",
            "redacted": false,
            "line": null,
            "problem": null,
        })
    );
    assert_eq!(
        (&printed[1]["fits"], &printed[1]["line"]),
        (&json!(false), &json!(9))
    );
}

#[test]
fn a_missing_record_does_not_hide_the_others() {
    let folder = tempfile::tempdir().unwrap();
    let nowhere = folder.path().join("nowhere.jsonl");
    let (nowhere, fixed) = (nowhere.to_str().unwrap(), fixture("records/fixed.jsonl"));
    let ended = chefshat(&["verify", nowhere, fixed.to_str().unwrap()]).ended_with(1);
    ended.assert_says(&[
        "fixed.jsonl: fits: finished",
        "nowhere.jsonl: No such file",
        "1 of 2 records do not fit",
    ]);
    let ended = chefshat(&["verify", "--json", nowhere, fixed.to_str().unwrap()]).ended_with(1);
    let fits: Vec<_> = ended
        .json_lines()
        .iter()
        .map(|it| it["fits"].clone())
        .collect();
    assert_eq!(fits, [true, false]);
}

#[test]
fn a_record_writes_no_control_characters_to_a_terminal() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("game.jsonl");
    std::fs::write(&path, "{\"\\u001b[2K\\rgame.jsonl: fits\": 1}\n").unwrap();
    for json in [false, true] {
        let mut arguments = vec!["verify", path.to_str().unwrap()];
        arguments.extend(json.then_some("--json"));
        let ended = chefshat(&arguments).ended_with(1);
        assert!(!ended.stdout.contains(['\x1b', '\r']), "{ended:?}");
        ended.assert_says(&["unknown field"]);
    }
}

#[test]
fn missing_records_are_reported() {
    let folder = tempfile::tempdir().unwrap();
    let nowhere = folder.path().join("nowhere");
    for (path, words) in [
        (folder.path(), "contains no records (*.jsonl)"),
        (nowhere.as_path(), "No such file"),
    ] {
        let ended = chefshat(&["verify", path.to_str().unwrap()]);
        ended.assert_failed(words);
    }
    // A record given twice counts once.
    let fixed = fixture("records/fixed.jsonl");
    let fixed = fixed.to_str().unwrap();
    let ended = chefshat(&["verify", fixed, fixed]);
    assert!(
        ended.stdout.ends_with("1 record fits, 96 decisions\n"),
        "{}",
        ended.stdout
    );
    let empty = folder.path().join("empty.jsonl");
    std::fs::write(&empty, "").unwrap();
    let ended = chefshat(&["verify", empty.to_str().unwrap()]).ended_with(1);
    assert!(
        ended
            .stdout
            .contains("empty.jsonl: line 1: the line is missing: the file is empty"),
        "{}",
        ended.stdout
    );
}

#[test]
fn a_damaged_record_is_found_if_nobody_reads_the_first_ones() {
    let folder = data_dir();
    let verify = format!("verify --data-dir {}", folder.path().display());
    typed_into_a_closed_pipe(&verify).ended_with(1);
    let whole = fixture("records/committed.jsonl");
    typed_into_a_closed_pipe(&format!("verify {}", whole.display())).clean();
}

#[test]
fn a_pinned_key_accepts_only_what_it_signed() {
    let key = "ed25519:ea4a6c63e29c520abef5507b132ec5f9954776aebebe7b92421eea691446d22c";
    // The base point.
    let other = format!("ed25519:58{}", "66".repeat(31));
    let signed = fixture("signed.jsonl");
    let signed = signed.to_str().unwrap();
    let ended = chefshat(&["verify", signed]);
    assert!(
        ended.stdout.contains(&format!("signed by {key}")),
        "{}",
        ended.stdout
    );
    chefshat(&["verify", signed, "--key", &other, "--key", key]).ended_with(0);
    let ended = chefshat(&["verify", signed, "--key", &other]).ended_with(1);
    assert!(ended.stdout.contains("not the key asked for"));
    let unsigned = fixture("records/fixed.jsonl");
    let ended = chefshat(&["verify", unsigned.to_str().unwrap(), "--key", key]).ended_with(1);
    assert!(ended.stdout.contains("unsigned, but a signature"));
    chefshat(&["verify", signed, "--key", "ed25519:12"]).assert_refused("64 hexadecimal digits");
    let weak = format!("ed25519:{}", "00".repeat(32));
    chefshat(&["verify", signed, "--key", &weak]).assert_refused("anybody can sign");
}

#[test]
fn a_data_directory_without_a_key_says_where_keys_come_from() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path().to_str().unwrap();
    let key = |command: &str| chefshat(&["key", command, "--data-dir", folder]);
    key("show").assert_failed("a server creates it");
    let created = key("create").clean().stdout;
    assert!(created.starts_with("ed25519:"), "{created}");
    assert_eq!(key("show").clean().stdout, created);
    assert_eq!(key("create").clean().stdout, created, "it is created once");
}

#[test]
fn a_signature_that_cannot_be_checked_is_no_forgery_and_no_proof() {
    let records = fixture("unordered/records");
    let records = records.to_str().unwrap();
    let known: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(fixture("unordered/known.json")).unwrap())
            .unwrap();
    let ended = chefshat(&["verify", records]).ended_with(3);
    let last: Vec<&str> = ended.stdout.lines().rev().take(2).collect();
    assert!(last[1].starts_with("3 records fit"), "{}", ended.stdout);
    assert_eq!(last[0], "1 signature cannot be checked");
    let large = known["large"].as_str().unwrap();
    let of_large = ended.stdout.lines().find(|line| line.contains(large));
    assert!(
        of_large.unwrap().contains("signature unproven"),
        "{of_large:?}"
    );
    for printed in chefshat(&["verify", "--json", records])
        .ended_with(3)
        .json_lines()
    {
        let is_large = printed["game_id"] == known["large"];
        assert_eq!(printed["fits"], true);
        let (signature, key) = match is_large {
            true => ("uncheckable", &serde_json::Value::Null),
            false => ("valid", &known["key"]),
        };
        assert_eq!(printed["signature"], signature);
        assert_eq!(&printed["signed_by"], key);
    }
    // It does not pass for a signature of the key.
    let key = known["key"].as_str().unwrap();
    let ended = chefshat(&["verify", "--key", key, "--json", records]).ended_with(1);
    let wrong: Vec<_> = (ended.json_lines().into_iter())
        .filter(|printed| printed["fits"] == false)
        .collect();
    assert_eq!(wrong.len(), 1, "{wrong:?}");
    assert_eq!(wrong[0]["signature"], "uncheckable");
    // The folder is exported whole, and says of no row that the key signed it.
    let out = tempfile::tempdir().unwrap();
    let out = out.path().join("dataset");
    let export = [
        "export",
        records,
        "--out",
        out.to_str().unwrap(),
        "--format",
        "jsonl",
    ];
    let ended = chefshat(&export).ended_with(0);
    assert!(ended.stdout.contains(": 3 games, "), "{}", ended.stdout);
    let rows = std::fs::read_to_string(out.join("decisions.jsonl")).unwrap();
    for row in rows.lines() {
        let row: serde_json::Value = serde_json::from_str(row).unwrap();
        assert_eq!(
            row["signed_by"].is_null(),
            row["game_id"] == known["large"],
            "{row}"
        );
    }
}

#[test]
fn a_key_for_which_anybody_can_sign_is_refused() {
    let text = std::fs::read_to_string(fixture("signed.jsonl")).unwrap();
    let at = text.find(",\"signature\":").unwrap();
    let zeros = |bytes: usize| {
        let full = "A".repeat(bytes.div_ceil(3) * 4);
        let padding = (3 - bytes % 3) % 3;
        format!("{}{}", &full[..full.len() - padding], "=".repeat(padding))
    };
    let forged = format!(
        "{},\"signature\":{{\"publicKey\":\"{}\",\"signature\":\"{}\"}}}}}}\n",
        &text[..at],
        zeros(32),
        zeros(64)
    );
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("forged.jsonl");
    std::fs::write(&path, forged).unwrap();
    let ended = chefshat(&["verify", path.to_str().unwrap()]).ended_with(1);
    assert!(
        ended.stdout.contains("anybody can sign"),
        "{}",
        ended.stdout
    );
}
