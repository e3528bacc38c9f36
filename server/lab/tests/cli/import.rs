//! `chefshat import`: adds transcripts and records of other servers to a data folder, each once.
//! The contents of transcripts are tested in `chefshat-record`.

use std::path::{Path, PathBuf};

use tempfile::TempDir;

use super::run::{Ended, chefshat, fixture, json_lines};

/// A complete transcript of a game of two players.
pub(super) const TRANSCRIPT: &str = "\
shift,seat,what,value
,,rules,paper players=2 faces=4 jokers=0 target_shifts=1
,0,human,Ana
,1,robot,Pepper
1,0,plays,4 G
1,1,plays,2 2
1,0,passes,
1,1,plays,4 4
1,0,plays,3 3
1,1,passes,
1,0,plays,1
";

fn transcript(folder: &TempDir, text: &str) -> PathBuf {
    let path = folder.path().join("table.csv");
    std::fs::write(&path, text).unwrap();
    path
}

fn import(file: &Path, flags: &[&str]) -> Ended {
    let mut arguments = vec!["import", file.to_str().unwrap()];
    arguments.extend(flags);
    chefshat(&arguments)
}

#[test]
fn a_transcript_becomes_a_record_that_verifies() {
    let folder = tempfile::tempdir().unwrap();
    let file = transcript(&folder, TRANSCRIPT);
    let data_dir = folder.path().join("data");
    let flags = ["--data-dir", data_dir.to_str().unwrap()];

    let ended = import(&file, &[&flags[..], &["--json"]].concat()).clean();
    let printed = ended.json();
    let game_id = printed["game_id"].as_str().unwrap();
    let path = data_dir.join("records").join(format!("{game_id}.jsonl"));
    assert_eq!(printed["file"], path.to_str().unwrap());
    assert_eq!(
        (&printed["origin"], &printed["state"], &printed["decisions"]),
        (
            &"GAME_ORIGIN_IMPORTED".into(),
            &"finished".into(),
            &7.into()
        )
    );

    // As the records that a server writes.
    #[cfg(unix)]
    for (path, mode) in [(path.as_path(), 0o600), (path.parent().unwrap(), 0o700)] {
        use std::os::unix::fs::PermissionsExt as _;
        let permissions = std::fs::metadata(path).unwrap().permissions();
        assert_eq!(permissions.mode() & 0o777, mode, "{path:?}");
    }

    let ended = chefshat(&["verify", flags[0], flags[1]]).well();
    assert!(
        ended
            .stdout
            .contains("fits: finished, 7 decisions, 16 events, cards of a real table"),
        "{}",
        ended.stdout
    );

    // The same transcript is the same game.
    let before = std::fs::read(&path).unwrap();
    let ended = import(&file, &flags);
    ended.assert_failed("exists already");
    assert_eq!(std::fs::read(&path).unwrap(), before);
}

#[test]
fn an_impossible_row_is_reported_and_nothing_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let file = transcript(&folder, &TRANSCRIPT.replace("1,0,plays,3 3", "1,0,plays,3"));
    let out = folder.path().join("out");
    let ended = import(&file, &["--out", out.to_str().unwrap()]);
    ended.assert_failed("table.csv: line 9: ");
    ended.assert_failed("at least 2 cards");
    assert!(!out.exists());
}

#[test]
fn a_record_of_another_server_is_verified_and_added() {
    let folder = tempfile::tempdir().unwrap();
    let data_dir = folder.path().join("data");
    let flags = ["--data-dir", data_dir.to_str().unwrap()];
    let ended = import(&fixture("records/committed.jsonl"), &flags).clean();
    let placed = data_dir.join("records/22b73f3bba773c1120e1858de68cd801.jsonl");
    ended.assert_says(&[placed.to_str().unwrap()]);
    let values = |path: &Path| json_lines(&std::fs::read_to_string(path).unwrap());
    assert_eq!(values(&placed), values(&fixture("records/committed.jsonl")));

    let damaged = folder.path().join("damaged.jsonl");
    let text = std::fs::read_to_string(fixture("records/fixed.jsonl")).unwrap();
    std::fs::write(
        &damaged,
        text.replacen("\"sequence\":\"5\"", "\"sequence\":\"6\"", 1),
    )
    .unwrap();
    let ended = import(&damaged, &flags);
    ended.assert_failed("sequence is 6 and must be 5");
    assert_eq!(data_dir.join("records").read_dir().unwrap().count(), 1);
}
