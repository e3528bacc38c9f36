//! `cargo xtask web`: builds the page and copies it to where the server expects it. Also checks and
//! tests the page.

use std::fs;
use std::path::Path;
use std::process::Command;

use crate::command::with_environment;
use crate::failure::Failure;
use crate::places::Places;
use crate::setup::{self, at};
use crate::steps::Steps;

/// Sets up the page's package and builds the page.
pub(crate) fn run(places: &Places, steps: &mut Steps) -> Result<(), Failure> {
    steps.run("set up web", || setup::web_package(places))?;
    steps.program("build the page", npm(places).args(["run", "build"]))?;
    steps.run("put the page in place", || {
        let dist = places.web_dist();
        follow(&places.web().join("dist"), &dist).map_err(|error| at(&dist, &error))
    })
}

/// Checks types, lints and format of the page, whose package must be set up.
pub(crate) fn check(places: &Places, steps: &mut Steps) -> Result<(), Failure> {
    steps.program("tsc, biome", npm(places).args(["run", "check"]))
}

/// The page's tests without a browser. The protocol's code is not generated again: the browser tests
/// beside them use it.
pub(crate) fn test(places: &Places, steps: &mut Steps) -> Result<(), Failure> {
    steps.program("vitest", npm(places).args(["exec", "--", "vitest", "run"]))
}

/// The browser tests, which start the server; the long ones only if `slow`.
pub(crate) fn test_in_browser(
    places: &Places,
    steps: &mut Steps,
    slow: bool,
) -> Result<(), Failure> {
    match setup::debian_programs(&[setup::CHROMIUM]) {
        Ok(()) => {
            let mut tests = npm(places);
            tests.args(["run", "test:browser"]);
            if slow {
                tests.env("CHEFSHAT_SLOW", "1");
            } else {
                tests.args(["--", "--exclude", "**/*.slow.test.ts"]);
            }
            steps.program("browser tests", &mut tests)
        }
        Err(failure) => {
            steps.skip("browser tests", &failure.to_string());
            Ok(())
        }
    }
}

fn npm(places: &Places) -> Command {
    let mut command = with_environment(places, Command::new("npm"));
    command.current_dir(places.web());
    command
}

/// Makes `copy` contain the files of `source`. Unchanged files are not touched, so that Cargo
/// rebuilds nothing for them; hidden files belong to the source tree.
fn follow(source: &Path, copy: &Path) -> std::io::Result<()> {
    fs::create_dir_all(copy)?;
    for entry in fs::read_dir(copy)? {
        let entry = entry?;
        let hidden = entry.file_name().as_encoded_bytes().starts_with(b".");
        if hidden || source.join(entry.file_name()).exists() {
            continue;
        }
        if entry.file_type()?.is_dir() {
            fs::remove_dir_all(entry.path())?;
        } else {
            fs::remove_file(entry.path())?;
        }
    }
    for entry in fs::read_dir(source)? {
        let entry = entry?;
        let to = copy.join(entry.file_name());
        if entry.file_type()?.is_dir() {
            follow(&entry.path(), &to)?;
        } else {
            let bytes = fs::read(entry.path())?;
            if fs::read(&to).ok().as_deref() != Some(&bytes) {
                fs::write(to, bytes)?;
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_copied_folder_equals_its_source_except_hidden_files_and_unchanged_files_are_not_touched() {
        let folder = std::env::temp_dir().join(format!("xtask-follow-{}", std::process::id()));
        let (source, copy) = (folder.join("source"), folder.join("copy"));
        fs::create_dir_all(source.join("assets")).unwrap();
        fs::create_dir_all(copy.join("old")).unwrap();
        for (file, text) in [
            ("source/index.html", "same"),
            ("source/assets/new.js", "new"),
            ("copy/index.html", "same"),
            ("copy/gone.js", "gone"),
            ("copy/.gitignore", "*"),
        ] {
            fs::write(folder.join(file), text).unwrap();
        }
        let written = |file| fs::metadata(copy.join(file)).unwrap().modified().unwrap();
        let before = written("index.html");

        follow(&source, &copy).unwrap();

        assert_eq!(written("index.html"), before);
        assert_eq!(
            fs::read_to_string(copy.join("assets/new.js")).unwrap(),
            "new"
        );
        assert!(copy.join(".gitignore").exists());
        assert!(!copy.join("gone.js").exists() && !copy.join("old").exists());
        fs::remove_dir_all(folder).unwrap();
    }
}
