//! `cargo xtask test`: the tests of every language, each told where to find the others. The whole-system tests, written in
//! Rust, start agents in Python and JavaScript; the tests of those start the server.

use std::process::Command;

use crate::Language;
use crate::command::cargo;
use crate::lint;
use crate::places::{NO_NODE_PACKAGE, NO_PYTHON_PACKAGE, NO_WEB_PACKAGE, Places};
use crate::setup;
use crate::steps::{Failure, Steps};
use crate::web;

/// Sets up and runs the tests of one language, or of all.
pub(crate) fn run(
    places: &Places,
    steps: &mut Steps,
    only: Option<Language>,
) -> Result<(), Failure> {
    let wants = |language| only.is_none_or(|only| only == language);
    let (has_python, has_node) = (places.has_python_package(), places.has_node_package());
    let has_web = places.has_web_package();

    if has_python && (wants(Language::Rust) || wants(Language::Python)) {
        steps.run("set up Python", || setup::python_package(places))?;
    }
    if has_node && (wants(Language::Rust) || wants(Language::Node)) {
        steps.run("set up Node", || setup::node_package(places))?;
    }
    if has_web && (wants(Language::Rust) || wants(Language::Web)) {
        web::run(places, steps)?;
    }
    // Libraries, programs and tests in one go: the server alone would be built with other features than
    // beside its tests, and hundreds of crates twice.
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
        // Tests that need what a machine does not have say themselves that they are skipped.
        if let Err(failure) = setup::strace() {
            steps.skip("a disk that does not sync", &failure.to_string());
        }
        if let Err(failure) = setup::tmux() {
            steps.skip("commands at a terminal", &failure.to_string());
        }
        let test = ["test", "--workspace"];
        steps.program("cargo test", cargo_command(places).args(test))?;
    }
    if wants(Language::Python) {
        if has_python {
            let cache = format!("cache_dir={}", places.own.join("pytest").display());
            let mut pytest = python_command(places, "pytest");
            steps.program("pytest", pytest.args(["-o", &cache]))?;
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

/// A module run by the Python package's interpreter, in the package's folder, with every cache in the build folder.
pub(crate) fn python_command(places: &Places, module: &str) -> Command {
    let mut command = with_environment(places, Command::new(places.python()));
    command
        .args(["-m", module])
        .current_dir(places.python_package());
    command.env("RUFF_CACHE_DIR", places.own.join("ruff"));
    command.env("MYPY_CACHE_DIR", places.own.join("mypy"));
    // Most of the time of the learning tests goes into compiling; what was compiled once is kept.
    command.env("JAX_COMPILATION_CACHE_DIR", places.own.join("jax"));
    command.env("JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS", "0");
    command.env("JAX_PERSISTENT_CACHE_MIN_ENTRY_SIZE_BYTES", "-1");
    command
}

/// Tells tests where the server, the other languages and the protocol are.
pub(crate) fn with_environment(places: &Places, mut command: Command) -> Command {
    command.env("CHEFSHAT_BIN", places.chefshat());
    command.env("CHEFSHAT_PYTHON", places.python());
    command.env("CHEFSHAT_NODE_DIR", places.node());
    command.env("CHEFSHAT_PROTO", places.root.join("proto"));
    // Python would otherwise write its caches among the sources, also where a Rust test starts it.
    command.env("PYTHONPYCACHEPREFIX", places.own.join("pycache"));
    command
}
