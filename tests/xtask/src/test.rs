//! `cargo xtask test`: the tests of every language, with the paths of the others. The system tests,
//! in Rust, start agents in Python and JavaScript; the tests of those start the server.

use std::process::Command;

use clap::ValueEnum;

use crate::command::{cargo, python_command, with_environment};
use crate::failure::Failure;
use crate::lint;
use crate::places::{NO_NODE_PACKAGE, NO_PYTHON_PACKAGE, NO_WEB_PACKAGE, Places};
use crate::setup;
use crate::steps::Steps;
use crate::web;

/// A language whose tests can be run separately.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Language {
    /// Engine, server, Rust SDK and system tests.
    Rust,
    /// The packages in clients/python and clients/robot.
    Python,
    /// The agent in clients/node.
    Node,
    /// The page for people in clients/web, including browser tests.
    Web,
}

/// Sets up and runs the tests of one language, or of all.
pub(crate) fn run(
    places: &Places,
    steps: &mut Steps,
    only: Option<Language>,
) -> Result<(), Failure> {
    let wants = |language| only.is_none_or(|only| only == language);
    let has_python = !places.python_packages().is_empty();
    let (has_node, has_web) = (places.has_node_package(), places.has_web_package());

    if has_python && (wants(Language::Rust) || wants(Language::Python)) {
        steps.run("set up Python", || setup::python_packages(places))?;
    }
    if has_node && (wants(Language::Rust) || wants(Language::Node)) {
        steps.run("set up Node", || setup::node_package(places))?;
    }
    if has_web && (wants(Language::Rust) || wants(Language::Web)) {
        web::run(places, steps)?;
    }
    // Libraries, programs and tests together: otherwise hundreds of crates would be built twice,
    // with the features of the server and with those of its tests.
    let build = [
        "build",
        "--workspace",
        "--lib",
        "--bins",
        "--tests",
        "--examples",
    ];
    steps.program("build", cargo_command(places).args(build))?;

    if wants(Language::Rust) {
        // Tests that need something missing on this machine report that they are skipped.
        if let Err(failure) = setup::strace() {
            steps.skip("a disk that does not sync", &failure.to_string());
        }
        if let Err(failure) = setup::tmux() {
            steps.skip("commands at a terminal", &failure.to_string());
        }
        let test = ["test", "--workspace", "--no-fail-fast"];
        steps.program("cargo test", cargo_command(places).args(test))?;
    }
    if wants(Language::Python) {
        if has_python {
            for package in places.python_packages() {
                let cache = places.own.join("pytest").join(package);
                let cache = format!("cache_dir={}", cache.display());
                let mut pytest = python_command(places, package, "pytest");
                steps.program(&format!("pytest, {package}"), pytest.args(["-o", &cache]))?;
            }
            lint::python(places, steps)?;
        } else {
            steps.skip("pytest, ruff, mypy", NO_PYTHON_PACKAGE);
        }
    }
    if wants(Language::Node) {
        if has_node {
            let mut node = with_environment(places, Command::new("node"));
            steps.program("node --test", node.arg("--test").current_dir(places.node()))?;
        } else {
            steps.skip("node --test", NO_NODE_PACKAGE);
        }
    }
    if wants(Language::Web) {
        if has_web {
            web::test(places, steps)?;
            web::check(places, steps)?;
        } else {
            steps.skip("vitest, browser tests, tsc, biome", NO_WEB_PACKAGE);
        }
    }
    Ok(())
}

fn cargo_command(places: &Places) -> Command {
    let mut command = with_environment(places, cargo());
    command.current_dir(&places.root);
    command
}
