//! The target folder of a dataset, and what an export replaces.

use std::path::Path;

use chefshat_dataset::{Export, Layout};

use super::{Stage, a_record};

#[test]
fn only_datasets_are_replaced() {
    let stage = Stage::new(&[("a.jsonl", a_record(1))]);
    let replacing = Export {
        replace: true,
        ..stage.export()
    };
    std::fs::create_dir(stage.out()).unwrap();
    let precious = stage.out().join("precious");
    std::fs::write(&precious, "kept").unwrap();
    let error = stage.run(&stage.export()).unwrap_err().to_string();
    assert!(error.contains("--force"), "{error}");
    let error = stage.run(&replacing).unwrap_err().to_string();
    assert!(error.contains("it is not only a dataset"), "{error}");
    assert_eq!(std::fs::read(&precious).unwrap(), b"kept");
    std::fs::remove_file(&precious).unwrap();
    // An empty folder is accepted.
    stage.run(&stage.export()).unwrap();
    assert!(stage.run(&stage.export()).is_err());
    stage.run(&replacing).unwrap();
    std::fs::remove_dir_all(stage.out()).unwrap();
    std::fs::write(stage.out(), "a file").unwrap();
    assert!(stage.run(&replacing).is_err());
    let nowhere = Export {
        out: Path::new("/").into(),
        ..stage.export()
    };
    assert!(stage.run(&nowhere).is_err());
}

/// A dataset of one game, and an export that may replace it.
fn a_dataset(layout: Layout) -> (Stage, Export) {
    let stage = Stage::new(&[("a.jsonl", a_record(1))]);
    let replacing = Export {
        replace: true,
        layout,
        ..stage.export()
    };
    stage.run(&replacing).unwrap();
    (stage, replacing)
}

/// The files of a folder and its subfolders: paths and contents.
fn contents(folder: &Path) -> Vec<(String, Vec<u8>)> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.extend(contents(&path));
        } else {
            let content = std::fs::read(&path).unwrap();
            found.push((path.display().to_string(), content));
        }
    }
    found.sort();
    found
}

#[test]
fn a_folder_with_a_foreign_file_is_left_unchanged() {
    let game = format!("{:032x}", 1);
    let in_game = format!("{game}/notes.txt");
    for (layout, foreign, named) in [
        (Layout::Tables, "thesis.tex", "thesis.tex"),
        (Layout::Tables, ".gitignore", ".gitignore"),
        (Layout::Tables, "figures/one.png", "figures"),
        (Layout::Tables, "decisions.jsonl.bak", "decisions.jsonl.bak"),
        (Layout::ChefsHatGym, in_game.as_str(), in_game.as_str()),
        (Layout::ChefsHatGym, "other/Dataset.pkl.csv", "other"),
    ] {
        let (stage, replacing) = a_dataset(layout);
        let path = stage.out().join(foreign);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(&path, "precious").unwrap();
        let before = contents(&stage.out());
        let error = stage.run(&replacing).unwrap_err().to_string();
        let words = format!("it contains {named}, which SHA256SUMS does not list");
        assert!(error.contains(&words), "{foreign}: {error}");
        assert_eq!(contents(&stage.out()), before, "{foreign}");
        assert_eq!(stage.leftovers(), ["out"], "{foreign}");
        std::fs::remove_file(&path).unwrap();
        if named != foreign {
            // A folder that no dataset has is foreign even if it is empty.
            assert!(stage.run(&replacing).is_err(), "{foreign}");
            std::fs::remove_dir(path.parent().unwrap()).unwrap();
        }
        stage.run(&replacing).unwrap();
    }
}

#[test]
fn checksums_alone_are_not_a_dataset() {
    for (file, content, words) in [
        (
            "README.md",
            "# My work\n",
            "was not written by this program",
        ),
        (
            "README.md",
            "---\npretty_name: Other games\n---\npretty_name: Games of Chef's Hat\n",
            "was not written by this program",
        ),
        ("SHA256SUMS", "", "it contains README.md"),
    ] {
        let (stage, replacing) = a_dataset(Layout::Tables);
        std::fs::write(stage.out().join(file), content).unwrap();
        let before = contents(&stage.out());
        let error = stage.run(&replacing).unwrap_err().to_string();
        assert!(error.contains(words), "{error}");
        assert_eq!(contents(&stage.out()), before);
    }
    for file in ["README.md", "SHA256SUMS"] {
        let (stage, replacing) = a_dataset(Layout::Tables);
        std::fs::remove_file(stage.out().join(file)).unwrap();
        assert!(stage.run(&replacing).is_err(), "{file}");
        assert!(stage.out().join("decisions.parquet").is_file());
    }
    // An incomplete dataset is replaced too.
    let (stage, replacing) = a_dataset(Layout::Tables);
    std::fs::remove_file(stage.out().join("decisions.csv")).unwrap();
    stage.run(&replacing).unwrap();
}

#[cfg(unix)]
#[test]
fn links_are_not_followed_out_of_the_folder() {
    let (stage, replacing) = a_dataset(Layout::Tables);
    let elsewhere = stage.folder.path().join("elsewhere");
    std::fs::create_dir(&elsewhere).unwrap();
    std::fs::write(elsewhere.join("kept"), "kept").unwrap();
    let link = stage.out().join("link");
    std::os::unix::fs::symlink(&elsewhere, &link).unwrap();
    let error = stage.run(&replacing).unwrap_err().to_string();
    assert!(error.contains("it contains link"), "{error}");
    std::fs::remove_file(&link).unwrap();
    // A link to the folder of the dataset is followed.
    let by_link = stage.folder.path().join("by-link");
    std::os::unix::fs::symlink(stage.out(), &by_link).unwrap();
    let through = Export {
        out: by_link.clone(),
        layout: Layout::ChefsHatGym,
        ..replacing
    };
    stage.run(&through).unwrap();
    assert!(by_link.is_symlink());
    assert!(stage.out().join(format!("{:032x}", 1)).is_dir());
    assert!(elsewhere.join("kept").is_file());
}
