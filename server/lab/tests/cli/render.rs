//! `chefshat render`: complete files of the requested size; errors give advice and leave no file.
//! The contents of pictures are tested in `chefshat-render`.

use std::path::Path;

use serde_json::json;
use tempfile::TempDir;

use super::run::{Ended, fixture, typed};

const DOCS: &str = include_str!("../../../../docs/pictures.md");

/// Draws the record of three players, small.
fn render(out: &Path, flags: &str) -> Ended {
    let (record, out) = (fixture("records/fixed.jsonl"), out.display());
    let record = record.display();
    typed(&format!("render {record} --out {out} --width 320 {flags}"))
}

fn files_in(folder: &TempDir) -> Vec<String> {
    let mut names: Vec<String> = std::fs::read_dir(folder.path())
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}

/// Width and height in the head of a PNG.
fn png_size(bytes: &[u8]) -> (u32, u32) {
    assert!(bytes.starts_with(b"\x89PNG\r\n\x1a\n"));
    let number = |at: usize| u32::from_be_bytes(bytes[at..at + 4].try_into().unwrap());
    (number(16), number(20))
}

#[test]
fn pictures_have_the_requested_size() {
    let folder = TempDir::new().unwrap();
    for (name, flags, height) in [
        ("end.png", "", 200),
        ("seat.png", "--at 57 --seat 2", 200),
        ("shift.png", "--shift 1 --spectator", 200),
        ("figure.PNG", "--at 57 --figure actions", 226),
    ] {
        let out = folder.path().join(name);
        let ended = render(&out, flags).clean();
        let bytes = std::fs::read(&out).unwrap();
        assert_eq!(png_size(&bytes), (320, height), "{name}");
        let printed = format!("{}: 320 × {height}, {} bytes\n", out.display(), bytes.len());
        assert_eq!(ended.stdout, printed);
    }

    // Another perspective gives another picture; the same one gives the same.
    let (one, other) = (folder.path().join("seat.png"), folder.path().join("b.png"));
    render(&other, "--at 57 --seat 2");
    assert_eq!(std::fs::read(&one).unwrap(), std::fs::read(&other).unwrap());
    render(&other, "--at 57 --seat 1");
    assert_ne!(std::fs::read(&one).unwrap(), std::fs::read(&other).unwrap());

    let out = folder.path().join("end.svg");
    let ended = render(&out, "--json");
    let svg = std::fs::read_to_string(&out).unwrap();
    assert!(svg.starts_with("<svg ") && svg.trim_end().ends_with("</svg>"));
    assert_eq!(
        ended.json(),
        json!({
            "file": out.to_str().unwrap(),
            "kind": "svg",
            "width": 320,
            "height": 200,
            "frames": 1,
            "seconds": 0.0,
            "bytes": svg.len(),
        })
    );
    assert!(
        files_in(&folder)
            .iter()
            .all(|name| !name.ends_with(".part"))
    );
}

#[test]
fn missing_letters_cause_no_warning() {
    let folder = TempDir::new().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let (transcript, record) = (path("table.csv"), path("table.jsonl"));
    let written = "shift,seat,what,value,label
,,table,厨房 Kitchen,
,,rules,paper players=2 faces=4 jokers=1 target_shifts=1,
,0,human,料理長,
,1,robot,Ορέστης 👩‍🍳,
1,0,hand,1 3 3 4 G,
1,0,plays,4 G,
1,0,expresses,,驚き
1,1,plays,2 2,
1,0,passes,,
1,1,plays,4 J,
1,0,plays,3 3,
1,1,passes,,
1,0,plays,1,
";
    std::fs::write(&transcript, written).unwrap();
    typed(&format!("import {transcript} --out {record}")).clean();
    for (name, flags) in [
        ("film.gif", ""),
        ("seat.gif", "--seat 1"),
        ("end.svg", ""),
        ("figure.png", "--at 1 --figure actions"),
    ] {
        let out = path(name);
        typed(&format!("render {record} --width 160 {flags} --out {out}")).clean();
    }
}

#[test]
fn secrets_of_other_seats_are_not_drawn() {
    let folder = TempDir::new().unwrap();
    let draw = |name: &str, flags: &str| {
        let out = folder.path().join(name);
        render(&out, flags).clean();
        std::fs::read(&out).unwrap()
    };
    // Only seat 1 knows about decision 59, a special action. Others see the end of the previous
    // Shift.
    for eyes in ["--seat 2", "--spectator"] {
        let with = |flags: &str| format!("{eyes} {flags}");
        let shift = draw("a.png", &with("--shift 1"));
        assert_eq!(shift, draw("a.png", &with("--at 59")));
        let film = draw("a.gif", &with("--from 59 --to 59"));
        assert!(film.starts_with(b"GIF89a"));
    }
    let own = "--seat 1";
    let shift = draw("a.png", &format!("{own} --shift 1"));
    assert_ne!(shift, draw("a.png", &format!("{own} --at 59")));
}

#[test]
fn the_length_of_a_film_is_that_of_its_decisions() {
    let folder = TempDir::new().unwrap();
    let out = folder.path().join("film.gif");
    // Decisions 94 to 96, the end of the Shift, the end of the game. Built-in agents take no time.
    for (flags, seconds) in [
        ("--seconds-per-decision 0.5", 3.0 * 0.5 + 2.0 * 1.5),
        ("--real-time", 3.0 * 0.2 + 2.0 * 3.0),
        ("--real-time 4", 3.0 * 0.2 + 2.0 * 3.0),
    ] {
        let ended = render(&out, &format!("--from 94 --json {flags}")).clean();
        let printed = ended.json();
        assert_eq!(printed["frames"], 5);
        assert!(
            (printed["seconds"].as_f64().unwrap() - seconds).abs() < 1e-6,
            "{printed}"
        );
        let bytes = std::fs::read(&out).unwrap();
        assert!(bytes.starts_with(b"GIF89a") && bytes.ends_with(b";"));
        assert_eq!(printed["bytes"], bytes.len());
    }
    assert_eq!(files_in(&folder), ["film.gif"]);
}

/// A replacement for ffmpeg that logs its arguments and the size of its input.
#[cfg(unix)]
fn fake_ffmpeg(folder: &Path, script: &str) -> String {
    use std::os::unix::fs::PermissionsExt as _;
    let program = folder.join("stand-in");
    std::fs::write(&program, format!("#!/bin/sh\n{script}\n")).unwrap();
    std::fs::set_permissions(&program, std::fs::Permissions::from_mode(0o755)).unwrap();
    program.to_str().unwrap().to_owned()
}

#[cfg(unix)]
#[test]
fn ffmpeg_receives_every_frame() {
    let (folder, tools) = (TempDir::new().unwrap(), TempDir::new().unwrap());
    let out = folder.path().join("film.mp4");
    let program = fake_ffmpeg(
        tools.path(),
        "for last; do :; done; { echo \"$@\"; wc -c; } > \"$last\"",
    );
    let flags = "--from 3 --to 5 --seconds-per-decision 0.2";
    render(&out, &format!("{flags} --ffmpeg {program}")).clean();
    let written = std::fs::read_to_string(&out).unwrap();
    assert!(
        written.contains("-video_size 320x200 -framerate 10"),
        "{written}"
    );
    // Three decisions, two frames each, four bytes per pixel.
    let given = written.lines().last().unwrap().trim();
    assert_eq!(given, (3 * 2 * 320 * 200 * 4).to_string());
    assert_eq!(files_in(&folder), ["film.mp4"]);

    // A failure is reported with its message and leaves the file unchanged.
    for (script, words) in [
        ("echo no such codec >&2; exit 3", "no such codec"),
        ("exec true", "stand-in: Broken pipe"),
    ] {
        let program = fake_ffmpeg(tools.path(), script);
        let ended = render(&out, &format!("{flags} --ffmpeg {program}"));
        assert_eq!(ended.code, Some(1));
        assert!(ended.stderr.contains(words), "{}", ended.stderr);
        assert_eq!(std::fs::read_to_string(&out).unwrap(), written);
        assert_eq!(files_in(&folder), ["film.mp4"]);
    }
}

#[cfg(unix)]
#[test]
fn the_samples_of_the_page_work() {
    let (folder, tools) = (TempDir::new().unwrap(), TempDir::new().unwrap());
    let program = fake_ffmpeg(tools.path(), "for last; do :; done; cat > \"$last\"");
    let record = fixture("records/committed.jsonl");
    let samples: Vec<&str> = DOCS
        .lines()
        .filter_map(|line| line.strip_prefix("chefshat render game.jsonl "))
        .collect();
    assert_eq!(samples.len(), 5);
    for sample in &samples {
        let (flags, out) = sample.split_once("--out ").unwrap();
        let out = folder.path().join(out);
        let (record, target) = (record.display(), out.display());
        let options = format!("--ffmpeg {program} --width 160");
        typed(&format!("render {record} {flags} --out {target} {options}")).clean();
        assert!(std::fs::metadata(&out).unwrap().len() > 0);
    }
    assert_eq!(files_in(&folder).len(), samples.len());
}

#[test]
fn impossible_pictures_are_explained() {
    let folder = TempDir::new().unwrap();
    for (name, flags, code, words) in [
        (
            "a.jpg",
            "",
            1,
            "choose a name that ends in .png, .svg, .gif or .mp4",
        ),
        (
            "a",
            "",
            1,
            "choose a name that ends in .png, .svg, .gif or .mp4",
        ),
        (
            "a.png",
            "--at 97",
            1,
            "there is no decision 97: the game has decisions 1 to 96",
        ),
        ("a.png", "--at 0", 1, "there is no decision 0"),
        (
            "a.png",
            "--at soon",
            2,
            "use the number of a decision, from 1, or end",
        ),
        (
            "a.png",
            "--shift 3",
            1,
            "there is no shift 3: the game has shifts 1 to 2",
        ),
        (
            "a.png",
            "--seat 3",
            1,
            "there is no seat 3: the game has seats 0 to 2",
        ),
        ("a.png", "--seat 1 --spectator", 2, "cannot be used with"),
        ("a.png", "--from 3", 1, "use --at"),
        ("a.gif", "--at 3", 1, "use --from and --to, or --shift"),
        ("a.gif", "--from 9 --to 3", 1, "--from 9 is after --to 3"),
        ("a.gif", "--from 90 --to 97", 1, "there is no decision 97"),
        (
            "a.gif",
            "--seconds-per-decision 0",
            2,
            "use seconds above 0, at most 600",
        ),
        (
            "a.gif",
            "--real-time nan",
            2,
            "use a number above 0, at most 1000",
        ),
        (
            "a.gif",
            "--figure actions",
            1,
            "choose a name that ends in .png or .svg",
        ),
        ("a.png", "--figure actions", 1, "select it with --at"),
        (
            "a.png",
            "--figure actions --at 3 --spectator",
            1,
            "this viewer does not see its hand",
        ),
        (
            "a.mp4",
            "--ffmpeg no-such-program",
            1,
            "install ffmpeg, or choose a name that ends in .gif",
        ),
        ("no/such/folder/a.png", "", 1, "no such file or directory"),
    ] {
        let ended = render(&folder.path().join(name), flags);
        assert_eq!(ended.code, Some(code), "{name} {flags:?}: {}", ended.stderr);
        assert!(
            ended.stderr.to_lowercase().contains(words),
            "{name} {flags:?}: {}",
            ended.stderr
        );
        assert_eq!(files_in(&folder), [""; 0], "{name} {flags:?}");
    }

    let out = folder.path().join("a.png");
    let no_record = Path::new(env!("CARGO_MANIFEST_DIR")).join("Cargo.toml");
    for (record, words) in [
        (no_record.as_path(), "line 1 is not a line of a record"),
        (Path::new("no-such-record.jsonl"), "no-such-record.jsonl"),
    ] {
        let (record, out) = (record.display(), out.display());
        typed(&format!("render {record} --out {out}")).assert_failed(words);
        assert_eq!(files_in(&folder), [""; 0]);
    }
}
