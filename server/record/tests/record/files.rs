//! Finding records; atomic files.

use std::io::Write as _;
use std::path::{Path, PathBuf};

use chefshat_record::atomic_file::AtomicFile;
use chefshat_record::files::{FindProblem, find_records};
use chefshat_record::jsonl;

fn names(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).unwrap();
    let mut names: Vec<String> = entries
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}

#[test]
fn records_are_found_in_files_and_folders() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    // The search of a folder does not include its subfolders, whatever their names.
    std::fs::create_dir_all(at("records/old.jsonl")).unwrap();
    for name in [
        "named.txt",
        "records/b.jsonl",
        "records/a.jsonl",
        "records/c.jsonl.part",
        "records/old.jsonl/z.jsonl",
    ] {
        std::fs::write(at(name), "12345").unwrap();
    }
    let found = |paths: &[&str]| {
        let paths: Vec<PathBuf> = paths.iter().map(|path| at(path)).collect();
        let found = find_records(&paths);
        assert!(found.missing.is_empty(), "{:?}", found.missing);
        let found = found.files;
        assert!(found.iter().all(|file| file.bytes == 5));
        let name = |path: &Path| path.strip_prefix(folder.path()).unwrap().to_owned();
        let found = found.into_iter().map(|file| name(&file.path));
        found.collect::<Vec<PathBuf>>()
    };
    let expected = |names: &[&str]| names.iter().map(PathBuf::from).collect::<Vec<_>>();
    assert_eq!(
        found(&["records", "named.txt"]),
        expected(&["records/a.jsonl", "records/b.jsonl", "named.txt"])
    );
    assert_eq!(
        found(&["records/b.jsonl", "records", "records/b.jsonl"]),
        expected(&["records/b.jsonl", "records/a.jsonl"])
    );
    assert_eq!(
        found(&["records/old.jsonl"]),
        expected(&["records/old.jsonl/z.jsonl"])
    );
    std::fs::create_dir(at("empty")).unwrap();
    // What is missing hides nothing of the others.
    let found = find_records(&[at("empty"), at("records"), at("nowhere"), at("named.txt")]);
    assert_eq!(found.files.len(), 3);
    let [empty, nowhere] = found.missing.as_slice() else {
        panic!("{:?}", found.missing)
    };
    assert_eq!((&empty.path, &nowhere.path), (&at("empty"), &at("nowhere")));
    assert!(matches!(empty.problem, FindProblem::NoRecords));
    assert!(matches!(nowhere.problem, FindProblem::Unreadable(_)));
}

#[test]
fn an_unfinished_file_leaves_the_target_unchanged() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("file");
    std::fs::write(&path, "before").unwrap();
    let mut abandoned = AtomicFile::create(&path).unwrap();
    abandoned.write_all(b"half").unwrap();
    let part = abandoned.part().file_name().unwrap().to_str().unwrap();
    assert!(part.starts_with("file.") && part.ends_with(".part"));
    assert_eq!(names(folder.path()), ["file", part]);
    drop(abandoned);
    assert_eq!(names(folder.path()), ["file"]);
    assert_eq!(std::fs::read(&path).unwrap(), b"before");
    let mut file = AtomicFile::create(&path).unwrap();
    write!(file, "af").unwrap();
    file.write_all(b"ter").unwrap();
    assert_eq!(std::fs::read(&path).unwrap(), b"before");
    file.finish().unwrap();
    assert_eq!(names(folder.path()), ["file"]);
    assert_eq!(std::fs::read(&path).unwrap(), b"after");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt as _;
        let plain = folder.path().join("plain");
        std::fs::write(&plain, "").unwrap();
        let mode = |path: &Path| std::fs::metadata(path).unwrap().permissions().mode();
        assert_eq!(mode(&path), mode(&plain));
    }
    let nowhere = folder.path().join("no/folder");
    let error = AtomicFile::create(&nowhere).unwrap_err().to_string();
    assert!(error.starts_with(&nowhere.display().to_string()), "{error}");
}

#[cfg(unix)]
#[test]
fn links_and_pipes_stay_what_they_are() {
    let folder = tempfile::tempdir().unwrap();
    let (file, link) = (folder.path().join("file"), folder.path().join("link"));
    std::fs::write(&file, "before").unwrap();
    std::os::unix::fs::symlink("file", &link).unwrap();
    let mut written = AtomicFile::create(&link).unwrap();
    written.write_all(b"after").unwrap();
    written.finish().unwrap();
    assert!(link.is_symlink());
    assert_eq!(std::fs::read(&file).unwrap(), b"after");

    let (missing, new) = (folder.path().join("missing"), folder.path().join("new"));
    std::os::unix::fs::symlink("missing", &new).unwrap();
    AtomicFile::create(&new).unwrap().finish().unwrap();
    assert!(new.is_symlink() && missing.is_file());

    let pipe = folder.path().join("pipe");
    let made = std::process::Command::new("mkfifo").arg(&pipe).status();
    assert!(made.unwrap().success());
    let reading = std::thread::spawn({
        let pipe = pipe.clone();
        move || std::fs::read(pipe).unwrap()
    });
    let mut written = AtomicFile::create(&pipe).unwrap();
    written.write_all(b"through").unwrap();
    written.finish().unwrap();
    assert_eq!(reading.join().unwrap(), b"through");
    assert_eq!(
        names(folder.path()),
        ["file", "link", "missing", "new", "pipe"]
    );
}

#[test]
fn writers_of_one_file_do_not_disturb_each_other() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("file");
    let mut first = AtomicFile::create(&path).unwrap();
    first.write_all(b"first").unwrap();
    let mut second = AtomicFile::create(&path).unwrap();
    second.write_all(b"second").unwrap();
    drop(AtomicFile::create(&path).unwrap());
    first.finish().unwrap();
    assert_eq!(std::fs::read(&path).unwrap(), b"first");
    second.finish().unwrap();
    assert_eq!(std::fs::read(&path).unwrap(), b"second");
    assert_eq!(names(folder.path()), ["file"]);
}

#[test]
fn part_files_of_killed_writers_are_removed() {
    let folder = tempfile::tempdir().unwrap();
    jsonl::remove_unfinished(folder.path()).unwrap();
    let records = folder.path().join("records");
    std::fs::create_dir(&records).unwrap();
    for name in ["1.jsonl", "2.jsonl.part", "3.jsonl.a1b2c3.part"] {
        std::fs::write(records.join(name), "Ada").unwrap();
    }
    jsonl::remove_unfinished(folder.path()).unwrap();
    assert_eq!(names(&records), ["1.jsonl"]);
}
