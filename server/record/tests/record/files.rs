//! Finding records, and files that appear whole or not at all.

use std::io::Write as _;
use std::path::{Path, PathBuf};

use chefshat_record::files::{FindError, find_records};
use chefshat_record::whole::WholeFile;

fn names(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).unwrap();
    let mut names: Vec<String> = entries
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}

#[test]
fn records_are_files_and_those_of_folders() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    // A folder is one whatever its name is, and its records are not those of the folder around it.
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
        let found = find_records(&paths).unwrap();
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
    let nothing = find_records(&[at("records"), at("empty")]);
    assert!(matches!(nothing, Err(FindError::NoRecords(path)) if path == at("empty")));
    let nowhere = find_records(&[at("nowhere")]);
    assert!(matches!(nowhere, Err(FindError::Unreadable { .. })));
}

#[test]
fn a_file_is_there_whole_or_not_at_all() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("file");
    std::fs::write(&path, "before").unwrap();
    let mut given_up = WholeFile::create(&path).unwrap();
    given_up.write_all(b"half").unwrap();
    assert_eq!(names(folder.path()), ["file", "file.part"]);
    drop(given_up);
    assert_eq!(names(folder.path()), ["file"]);
    assert_eq!(std::fs::read(&path).unwrap(), b"before");
    let mut file = WholeFile::create(&path).unwrap();
    write!(file, "af").unwrap();
    file.write_all(b"ter").unwrap();
    assert_eq!(std::fs::read(&path).unwrap(), b"before");
    file.finish().unwrap();
    assert_eq!(names(folder.path()), ["file"]);
    assert_eq!(std::fs::read(&path).unwrap(), b"after");
    let nowhere = folder.path().join("no/folder");
    let error = WholeFile::create(&nowhere).unwrap_err().to_string();
    assert!(error.starts_with(&nowhere.display().to_string()), "{error}");
}
