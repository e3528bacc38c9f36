//! `cargo xtask test`: the tests of every language, with the paths of the others. The system tests,
//! in Rust, start agents in Python, JavaScript and C++; the tests of those start the server.

use std::collections::BTreeSet;
use std::path::Path;
use std::process::Command;

use clap::ValueEnum;
use serde_json::Value;

use crate::command::{cargo, git, python_command, read, with_environment};
use crate::failure::Failure;
use crate::lint::{self, OPTIONAL_FEATURES};
use crate::places::{CLIENTS, DEPLOYMENT, PYTHON_PACKAGES, Places};
use crate::setup;
use crate::steps::{Lane, Steps};
use crate::web;
use crate::wheels;

/// The tests of a language, or of docker/, which can be run separately.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, ValueEnum)]
pub(crate) enum Part {
    /// Engine, server, Rust SDK and system tests, with the agent in C++.
    Rust,
    /// The packages in clients/python, clients/paper and clients/robot.
    Python,
    /// The agent in clients/node.
    Node,
    /// The page for people in clients/web, including browser tests.
    Web,
    /// Backups, the tournament of friends in docs/access.md, the proxies of docker/, and with --slow
    /// its images, with agents in all languages and a browser.
    Deployment,
    /// Those that the changes since origin/main can break, committed or not.
    Changed,
}

/// All parts, in the order in which they are named.
const ALL: [Part; 5] = [
    Part::Rust,
    Part::Python,
    Part::Node,
    Part::Web,
    Part::Deployment,
];

/// The parts that a change of a file can break. The server and the protocol are in all of them.
fn broken_by(file: &str) -> &'static [Part] {
    use Part::{Deployment, Node, Python, Rust, Web};
    let folders: [(&str, &'static [Part]); 9] = [
        ("clients/web/", &[Web, Deployment]),
        // The system tests start agents of each language.
        ("clients/node/", &[Rust, Node, Deployment]),
        ("clients/cpp/", &[Rust]),
        ("clients/python/", &[Rust, Python, Deployment]),
        ("clients/paper/", &[Python]),
        ("clients/robot/", &[Python, Deployment]),
        ("docs/", &[Rust, Python, Deployment]),
        ("docker/", &[Rust, Deployment]),
        ("tests/deployment/", &[Deployment]),
    ];
    match folders.iter().find(|(folder, _)| file.starts_with(folder)) {
        Some((_, parts)) => parts,
        None if file.ends_with(".md") => &[Rust, Python, Deployment],
        None => &ALL,
    }
}

/// The parts that the changes since the last common commit with origin/main can break.
fn changed(places: &Places) -> Result<Vec<Part>, Failure> {
    let git = |arguments: &[&str]| read(git(places).args(arguments));
    let base = git(&["merge-base", "HEAD", "origin/main"]).unwrap_or_else(|_| "HEAD".to_owned());
    let tracked = git(&["diff", "--name-only", &base])?;
    let new = git(&["ls-files", "--others", "--exclude-standard"])?;
    let files = tracked.lines().chain(new.lines());
    let parts: BTreeSet<Part> = files.flat_map(broken_by).copied().collect();
    println!("    changed since {base}: {parts:?}");
    Ok(parts.into_iter().collect())
}

/// What is run.
#[derive(Debug, Clone, Copy, clap::Args)]
pub(crate) struct Options {
    /// Run only the tests of one part.
    #[arg(long, value_enum)]
    only: Option<Part>,
    /// Also run what takes many minutes: long tests, the images, the wheels, idle
    /// streams, checks for Windows and macOS, licences.
    #[arg(long)]
    slow: bool,
    /// Also run the checks of `cargo xtask lint` but that of licences, in the same build.
    #[arg(long, conflicts_with = "only")]
    lint: bool,
}

/// Sets up and runs the tests of one part, or of all.
pub(crate) fn run(places: &Places, steps: &mut Steps, options: &Options) -> Result<(), Failure> {
    let Options { only, slow, lint } = *options;
    if lint {
        lint::sources(places, steps)?;
    }
    let parts = match only {
        None => ALL.to_vec(),
        Some(Part::Changed) => changed(places)?,
        Some(part) => vec![part],
    };
    if parts.is_empty() {
        steps.skip("tests", "nothing has changed");
        return Ok(());
    }
    let wants = |part| parts.contains(&part);
    let deployment = wants(Part::Deployment);
    let needs_python = wants(Part::Rust) || wants(Part::Python) || deployment;
    // The long tests of the page analyse the data of a study.
    let analyses = slow && wants(Part::Web);
    let needs_node = wants(Part::Rust) || wants(Part::Node) || deployment;
    let needs_page = wants(Part::Rust) || wants(Part::Web) || deployment;

    // Downloads wait while Cargo computes.
    steps.beside(vec![
        // Libraries, programs and tests together: otherwise hundreds of crates would be built twice,
        // with the features of the server and with those of its tests.
        Box::new(|steps| {
            let mut build = cargo_command(places, lint);
            build.args(["build", "--workspace", "--features", OPTIONAL_FEATURES]);
            steps.program("build", build.args(lint::ALL_TARGETS))
        }),
        Box::new(|steps| {
            if needs_python || analyses {
                steps.run("set up Python", || setup::python_packages(places))?;
            }
            if lint {
                lint::python(places, steps)?;
            }
            if wants(Part::Python) {
                for which in VERSIONS {
                    let set_up = || setup::versions(places, which);
                    steps.run(&format!("set up the {which} versions"), set_up)?;
                }
            }
            Ok(())
        }),
        Box::new(|steps| {
            if needs_node {
                steps.run("set up Node", || setup::node_package(places))?;
            }
            if needs_page {
                web::run(places, steps)?;
            }
            if lint {
                web::check(places, steps)?;
            }
            Ok(())
        }),
        Box::new(|steps| {
            let mut wanted = Vec::new();
            if wants(Part::Rust) {
                wanted.extend(setup::FOR_RUST);
            }
            if deployment {
                wanted.extend(setup::FOR_DEPLOYMENT);
            }
            if wants(Part::Web) {
                wanted.push(setup::CHROMIUM);
            }
            if deployment && slow {
                wanted.extend(setup::FOR_IMAGES);
            }
            // What is still missing afterwards is reported where it is needed.
            if let Err(failure) = setup::debian_programs(&wanted) {
                println!("{failure}");
            }
            if wants(Part::Rust) {
                steps.run("build the agent in C++", || setup::cpp_agent(places))?;
            }
            if lint {
                lint::documents(places, steps)?;
            }
            if slow {
                lint::licences(places, steps)?;
            }
            Ok(())
        }),
    ])?;

    let mut in_rust = TestsInRust::default();
    if wants(Part::Rust) {
        steps.run("find the tests in Rust", || {
            in_rust = TestsInRust::find(places, *options)?;
            Ok(())
        })?;
        steps.run("PostgreSQL", setup::postgresql)?;
        steps.run("HAProxy", || setup::debian_programs(&[setup::HAPROXY]))?;
        // Tests that need something missing on this machine report that they are skipped.
        for (program, tests) in [
            (setup::STRACE, "a disk that does not sync"),
            (setup::PROMETHEUS, "the dashboard in Prometheus"),
            (setup::TMUX, "commands at a terminal"),
            (setup::R, "the analysis in R"),
        ] {
            if let Err(failure) = setup::debian_programs(&[program]) {
                steps.skip(tests, &failure.to_string());
            }
        }
    }
    if needs_python {
        steps.run("install the native module", || setup::native_module(places))?;
    }

    // First what takes longest, of which much is waiting: the short ones fill what is left.
    let mut lanes: Vec<Lane<'_>> = Vec::new();
    let package = |package: &'static str, options: &'static [&'static str]| -> Lane<'_> {
        Box::new(move |steps| {
            let mut runs = vec![pytest(places, package, options)];
            if slow {
                runs.push(pytest(places, package, &["-m", "slow"]));
            }
            of_all(steps, runs)
        })
    };
    if wants(Part::Python) {
        lanes.push(package(CLIENTS, &["--numprocesses=2", "--dist=loadfile"]));
    }
    if deployment {
        lanes.push(Box::new(|steps| test_deployment(places, steps, slow)));
    }
    for run in in_rust.whole {
        lanes.push(Box::new(|steps| of_all(steps, [run])));
    }
    if wants(Part::Web) {
        lanes.push(Box::new(|steps| web::test_in_browser(places, steps, slow)));
    }
    if wants(Part::Python) {
        let others = PYTHON_PACKAGES.into_iter();
        let others = others.filter(|other| ![CLIENTS, DEPLOYMENT].contains(other));
        lanes.extend(others.map(|other| package(other, &[])));
    }
    if wants(Part::Rust) {
        let mut runs = in_rust.crates;
        runs.push(cargo_test(places, *options, &["--doc"]));
        lanes.push(Box::new(move |steps| {
            if slow {
                lint::platforms(places, steps)?;
            }
            of_all(steps, runs)
        }));
    }
    if wants(Part::Web) {
        lanes.push(Box::new(|steps| web::test(places, steps)));
    }
    if wants(Part::Python) {
        lanes.push(Box::new(|steps| {
            of_all(steps, VERSIONS.map(|which| pytest_with(places, which)))
        }));
    }
    if wants(Part::Node) {
        lanes.push(Box::new(|steps| {
            let mut node = with_environment(places, Command::new("node"));
            steps.program("node --test", node.arg("--test").current_dir(places.node()))
        }));
    }
    // A failure stops only what depends on it, so that one run shows all of them.
    let mut outcomes = vec![steps.beside(lanes)];
    if slow && wants(Part::Python) {
        // Builds the page again, in the folder of its tests.
        outcomes.push(wheels::run(places, steps, &wheels::HOST, "release", true));
    }
    Failure::of_any(outcomes)
}

/// Runs programs as steps, one after another; each that fails is named.
fn of_all(steps: &mut Steps, runs: impl IntoIterator<Item = Run>) -> Result<(), Failure> {
    let run = |(name, mut program): Run| steps.program(&name, &mut program);
    Failure::of_any(runs.into_iter().map(run))
}

/// A step that runs a program.
type Run = (String, Command);

/// The folder of the tests that start servers and clusters.
const WHOLE: &str = "tests";

/// The modules of tests that are ignored because they measure something; the others take long.
const MEASURING: [&str; 3] = ["measure::", "growth::", "alerts::"];

/// The programs of the tests in Rust.
#[derive(Default)]
struct TestsInRust {
    /// Of whole servers and clusters, which mostly wait.
    whole: Vec<Run>,
    /// Of single crates.
    crates: Vec<Run>,
}

impl TestsInRust {
    /// Finds the programs that the build has made. They are started here, since `cargo test --lib`
    /// also builds libraries without tests once more.
    fn find(places: &Places, options: Options) -> Result<Self, Failure> {
        let mut build = cargo_tests(places, options);
        build.args(["--tests", "--no-run", "--message-format", "json"]);
        let mut found = Self::default();
        for message in read(&mut build)?.lines() {
            let built: Value = serde_json::from_str(message).unwrap_or_default();
            if built["profile"]["test"] != true {
                continue;
            }
            let path = |field: &str| built[field].as_str().map(Path::new);
            let (Some(program), Some(manifest)) = (path("executable"), path("manifest_path"))
            else {
                continue;
            };
            let folder = manifest.parent().unwrap_or(&places.root);
            let package = folder.strip_prefix(&places.root).unwrap_or(folder);
            let target = built["target"]["name"].as_str().unwrap_or_default();
            let mut tests = with_environment(places, Command::new(program));
            with_extent(tests.current_dir(folder), options);
            let is_integration = built["target"]["kind"][0] == "test";
            if options.slow && is_integration {
                tests.arg("--include-ignored");
                tests.args(MEASURING.iter().flat_map(|module| ["--skip", module]));
            }
            let run = (format!("{}, tests of {target}", package.display()), tests);
            if is_integration && package.starts_with(WHOLE) {
                found.whole.push(run);
            } else {
                found.crates.push(run);
            }
        }
        if found.whole.is_empty() || found.crates.is_empty() {
            return Err(Failure::new("Cargo names no programs of tests"));
        }
        Ok(found)
    }
}

/// Tests in Rust of these kinds.
fn cargo_test(places: &Places, options: Options, kinds: &[&str]) -> Run {
    let mut tests = cargo_tests(places, options);
    with_extent(tests.arg("--no-fail-fast").args(kinds), options);
    (format!("cargo test {}", kinds.join(" ")), tests)
}

/// Cargo for tests of all packages, so that nothing is built again.
fn cargo_tests(places: &Places, options: Options) -> Command {
    let mut tests = cargo_command(places, options.lint);
    tests.args(["test", "--workspace", "--features", OPTIONAL_FEATURES]);
    tests
}

/// Says how long the longest tests in Rust are, and how many of a program run at a time.
fn with_extent(tests: &mut Command, options: Options) {
    // Most wait for servers and clocks.
    tests.env("RUST_TEST_THREADS", "4");
    if options.slow {
        tests.env("CHEFSHAT_FAULTS", "200");
        tests.env("CHEFSHAT_KILLS", "100");
        tests.env("CHEFSHAT_SIMULATIONS", "300");
        tests.env("CHEFSHAT_MODEL", "all");
        tests.env("CHEFSHAT_PAIRS", "100000");
        tests.env("CHEFSHAT_SLOW", "1");
    }
}

/// The tests of docker/ and of what the documents tell to type.
fn test_deployment(places: &Places, steps: &mut Steps, slow: bool) -> Result<(), Failure> {
    steps.run("set up proxies and a browser", || {
        setup::debian_programs(&setup::FOR_DEPLOYMENT)
    })?;
    let (name, mut command) = pytest(places, DEPLOYMENT, &[]);
    steps.program(&name, &mut command)?;
    if slow {
        if let Err(failure) = setup::debian_programs(&setup::FOR_IMAGES) {
            steps.skip("images", &failure.to_string());
        }
        let (name, mut command) = pytest(places, DEPLOYMENT, &["-m", "slow"]);
        steps.program(&name, &mut command)?;
    }
    Ok(())
}

/// The ends of the ranges of versions that the Python SDK works with.
const VERSIONS: [&str; 2] = ["oldest", "newest"];

/// Tests of the Python SDK that use each of its dependencies, with other versions of those.
fn pytest_with(places: &Places, versions: &str) -> Run {
    let mut pytest = Command::new(places.versions(versions).join("bin/python"));
    pytest.current_dir(places.root.join("clients/python"));
    pytest.env("PYTHONPATH", "src");
    pytest.env("PYTHONPYCACHEPREFIX", places.own.join("pycache"));
    // A warning of protobuf about versions is an error.
    pytest.args(["-W", "error::UserWarning", "-m", "pytest"]);
    pytest.args(["-p", "no:cacheprovider", "-m", "not server"]);
    for module in ["imports", "vector", "decision", "errors", "play"] {
        pytest.arg(format!("tests/test_{module}.py"));
    }
    (format!("pytest, the {versions} versions"), pytest)
}

/// The tests of a Python package, with the name of the step.
fn pytest(places: &Places, package: &str, options: &[&str]) -> Run {
    let cache = places.own.join("pytest").join(package);
    let cache = format!("cache_dir={}", cache.display());
    let mut pytest = python_command(places, package, "pytest");
    // The tests that take long are named, so that growth is seen.
    pytest.args(["-o", &cache, "--durations=15", "--durations-min=5"]);
    pytest.args(options);
    let step = format!("pytest, {package} {}", options.join(" "));
    (step.trim_end().to_owned(), pytest)
}

/// Cargo; if `lint`, its build is also checked.
fn cargo_command(places: &Places, lint: bool) -> Command {
    let mut command = with_environment(places, cargo());
    command.current_dir(&places.root);
    if lint {
        lint::with_clippy(&mut command);
    }
    command
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_change_selects_what_it_can_break() {
        for (file, parts) in [
            (
                "clients/web/src/main.tsx",
                &[Part::Web, Part::Deployment][..],
            ),
            ("clients/robot/README.md", &[Part::Python, Part::Deployment]),
            ("docker/Dockerfile", &[Part::Rust, Part::Deployment]),
            ("README.md", &[Part::Rust, Part::Python, Part::Deployment]),
            ("server/src/lib.rs", &ALL),
            ("proto/chefshat/v1/room.proto", &ALL),
            ("Cargo.lock", &ALL),
        ] {
            assert_eq!(broken_by(file), parts, "{file}");
        }
        // Every folder of clients is known.
        let clients = Places::find().unwrap().root.join("clients");
        for client in std::fs::read_dir(clients).unwrap() {
            let name = client.unwrap().file_name().into_string().unwrap();
            assert_ne!(broken_by(&format!("clients/{name}/file")), ALL, "{name}");
        }
    }
}
