//! `cargo xtask lint`: all checks that do not run the project.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::command::{self, cargo, python_command};
use crate::failure::Failure;
use crate::places::{PYTHON_PACKAGES, Places};
use crate::setup::{self, at};
use crate::steps::Steps;
use crate::web;
use crate::{arrows, book, circles};

/// The protocol of the last release, which later ones only add to: `buf build proto
/// --exclude-source-info`. A file and not a tag, since archives and shallow clones have no tags.
const RELEASED_PROTOCOL: &str = "proto/frozen/v1.binpb";

/// What is off by default and still checked and tested, in one build with the rest.
pub(crate) const OPTIONAL_FEATURES: &str = "chefshat/otlp";

/// Everything that can be built. With `--all-targets`, libraries without tests would be built a
/// second time, to be benchmarks.
pub(crate) const ALL_TARGETS: [&str; 6] =
    ["--lib", "--bins", "--tests", "--examples", "--bench", "*"];

/// What Clippy is told: a warning is an error.
const CLIPPY_ARGUMENTS: [&str; 2] = ["-D", "warnings"];

/// Runs all checks, cheapest first.
pub(crate) fn run(places: &Places, steps: &mut Steps) -> Result<(), Failure> {
    sources(places, steps)?;
    steps.beside(vec![
        Box::new(|steps| {
            let features = ["--features", OPTIONAL_FEATURES, "--"];
            let mut clippy = in_root(places, cargo());
            clippy.args(["clippy", "--workspace"]).args(ALL_TARGETS);
            clippy.args(features).args(CLIPPY_ARGUMENTS);
            steps.program("cargo clippy", &mut clippy)
        }),
        Box::new(|steps| {
            documents(places, steps)?;
            licences(places, steps)?;
            steps.run("set up Python", || setup::python_packages(places))?;
            python(places, steps)?;
            steps.run("set up web", || setup::web_package(places))?;
            web::check(places, steps)
        }),
    ])
}

/// Makes Cargo build with Clippy in place of the compiler for the crates of the workspace: one build
/// is checked and tested. Clippy takes its arguments from the environment, as `cargo clippy` gives
/// them.
pub(crate) fn with_clippy(cargo: &mut Command) {
    let driver = Path::new(cargo.get_program()).with_file_name("clippy-driver");
    cargo.env("RUSTC_WORKSPACE_WRAPPER", driver);
    let arguments = CLIPPY_ARGUMENTS.map(|argument| format!("{argument}__CLIPPY_HACKERY__"));
    cargo.env("CLIPPY_ARGS", arguments.concat());
}

/// Systems for which the programs must compile besides this one: Windows and macOS.
const PLATFORMS: [&str; 2] = ["x86_64-pc-windows-gnu", "aarch64-apple-darwin"];

/// Compiles the programs and the SDK for other systems as far as that goes without their linkers.
/// What is C is not compiled: nothing is linked.
pub(crate) fn platforms(places: &Places, steps: &mut Steps) -> Result<(), Failure> {
    for target in PLATFORMS {
        steps.run(&format!("set up {target}"), || setup::target(target))?;
        let mut check = in_root(places, cargo());
        check.args(["check", "--target", target]);
        check.args([
            "-p",
            "chefshat",
            "-p",
            "chefshat-lab",
            "-p",
            "chefshat-client",
        ]);
        for tool in ["CC", "AR"] {
            check.env(format!("{tool}_{}", target.replace('-', "_")), "true");
        }
        steps.program(&format!("cargo check for {target}"), &mut check)?;
    }
    Ok(())
}

/// The checks that only read sources of Rust.
pub(crate) fn sources(places: &Places, steps: &mut Steps) -> Result<(), Failure> {
    let fmt = ["fmt", "--all", "--check"];
    steps.program("cargo fmt", in_root(places, cargo()).args(fmt))?;
    steps.run("arrows between crates", || arrows::check(places))?;
    steps.run("circles between files", || circles::check(places))?;
    steps.run("tests that are not built", || not_built(places))
}

/// Refuses tests in sources whose tests Cargo does not build (`test = false`, as of all examples).
fn not_built(places: &Places) -> Result<(), Failure> {
    let metadata = arrows::metadata(places)?;
    let packages = metadata["packages"].as_array();
    let targets = packages.into_iter().flatten();
    let targets = targets.filter_map(|package| package["targets"].as_array());
    let untested = targets.flatten().filter(|target| target["test"] == false);
    for target in untested {
        let Some(root) = target["src_path"].as_str().map(Path::new) else {
            continue;
        };
        let found = match (target["kind"][0].as_str(), root.parent()) {
            (Some("lib"), Some(folder)) => with_tests(folder)?,
            // The folder may be that of a library, too.
            (Some("bin" | "example"), _) if has_tests(root)? => Some(root.to_path_buf()),
            _ => None,
        };
        if let Some(file) = found {
            let file = file.display();
            let problem = format!("{file} has tests, but Cargo.toml says `test = false`");
            return Err(Failure::new(problem));
        }
    }
    Ok(())
}

/// A file in a folder, or in one of its folders, that has tests.
fn with_tests(folder: &Path) -> Result<Option<PathBuf>, Failure> {
    let listed = fs::read_dir(folder).map_err(|error| at(folder, &error))?;
    for entry in listed {
        let path = entry.map_err(|error| at(folder, &error))?.path();
        let found = match path.is_dir() {
            true => with_tests(&path)?,
            false => has_tests(&path)?.then_some(path),
        };
        if found.is_some() {
            return Ok(found);
        }
    }
    Ok(None)
}

fn has_tests(file: &Path) -> Result<bool, Failure> {
    let text = fs::read_to_string(file).map_err(|error| at(file, &error))?;
    Ok(["#[cfg(test)]", "#[test]"]
        .iter()
        .any(|it| text.contains(it)))
}

/// The checks of everything but programs: protocol, book, files of docker/. And the format of the agent
/// in C++, which the same environment checks.
pub(crate) fn documents(places: &Places, steps: &mut Steps) -> Result<(), Failure> {
    steps.run("set up checkers", || setup::tools(places))?;
    steps.program("buf lint", tool(places, "buf").args(["lint", "proto"]))?;
    let breaking = ["breaking", "proto", "--against", RELEASED_PROTOCOL];
    steps.program("buf breaking", tool(places, "buf").args(breaking))?;
    book::check_and_build(places, steps)?;
    schema(places, steps, "vendor.citation-file-format", "CITATION.cff")?;
    for name in ["compose", "compose.proxy", "compose.cluster"] {
        let file = format!("docker/{name}.yaml");
        schema(places, steps, "vendor.compose-spec", &file)?;
    }
    // Kinds of the Gateway API are not among the schemas.
    let manifests = [
        "--strict",
        "docker/kubernetes/chefshat.yaml",
        "docker/kubernetes/cluster.yaml",
        "docker/kubernetes/ingress.yaml",
        "docker/kubernetes/migrate.yaml",
    ];
    steps.program(
        "kubernetes-validate",
        tool(places, "kubernetes-validate").args(manifests),
    )?;
    // The tests of docker/ build the images.
    steps.program(
        "hadolint",
        tool(places, "hadolint").arg("docker/Dockerfile"),
    )?;
    let sources = ["clients/cpp/agent.cpp", "clients/cpp/player.h"];
    let mut format = tool(places, "clang-format");
    format.args(["--dry-run", "--Werror"]).args(sources);
    steps.program("clang-format", &mut format)
}

/// The licences and sources of what is built with, which change with Cargo.lock alone, and what is
/// known against it. The tool is compiled first, which takes minutes.
pub(crate) fn licences(places: &Places, steps: &mut Steps) -> Result<(), Failure> {
    let deny = |arguments: &[&str]| {
        command::run(in_root(places, setup::cargo_deny(places)?).args(arguments))
    };
    let mut check = vec!["--workspace", "check", "licenses", "bans", "sources"];
    match deny(&["fetch", "db"]) {
        Ok(()) => check.push("advisories"),
        Err(failure) => steps.skip("advisories", &failure.to_string()),
    }
    steps.run("cargo deny", || deny(&check))
}

/// The linter, formatter and type checker of the Python packages, which must be set up.
pub(crate) fn python(places: &Places, steps: &mut Steps) -> Result<(), Failure> {
    for package in PYTHON_PACKAGES {
        let checks = [
            ("ruff check", "ruff", &["check", "."][..]),
            ("ruff format", "ruff", &["format", "--check", "."]),
            ("mypy", "mypy", &[]),
        ];
        for (check, module, arguments) in checks {
            let mut command = python_command(places, package, module);
            steps.program(&format!("{check}, {package}"), command.args(arguments))?;
        }
    }
    Ok(())
}

/// Checks a file against one of the schemas that come with the checker.
fn schema(places: &Places, steps: &mut Steps, name: &str, file: &str) -> Result<(), Failure> {
    let arguments = ["--builtin-schema", name, file];
    let step = format!("schema of {file}");
    steps.program(&step, tool(places, "check-jsonschema").args(arguments))
}

fn tool(places: &Places, name: &str) -> Command {
    in_root(places, Command::new(places.tools().join("bin").join(name)))
}

fn in_root(places: &Places, mut command: Command) -> Command {
    command.current_dir(&places.root);
    command
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tests_are_found_in_every_folder() {
        let root = Places::find().unwrap().root;
        let xtask = root.join("tests/xtask");
        assert!(with_tests(&xtask.join("src")).unwrap().is_some());
        assert!(with_tests(&xtask.join("src/circles")).unwrap().is_some());
        assert_eq!(with_tests(&root.join("proto/src")).unwrap(), None);
        assert!(with_tests(&xtask.join("none")).is_err());
    }
}
