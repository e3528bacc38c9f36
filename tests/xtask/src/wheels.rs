//! `cargo xtask wheels`: builds the wheels of the Python packages, and tries them in a virtual
//! environment that contains nothing else.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::command::{git, read, run as run_command};
use crate::failure::Failure;
use crate::notices::{self, notices};
use crate::places::Places;
use crate::setup::{self, at};
use crate::steps::Steps;
use crate::web;

/// The oldest systems on which the wheels with programs run: glibc 2.17, those of numpy's wheels.
const PLATFORM: &str = "manylinux_2_17";

/// The processors for which a release has wheels.
pub(crate) const PROCESSORS: [&str; 2] = ["x86_64", "aarch64"];

/// That of this machine, on which its wheels can be tried.
pub(crate) const HOST: [&str; 1] = [std::env::consts::ARCH];

/// The packages built by maturin, from Rust.
const BUILT_FROM_RUST: [&str; 2] = ["clients/python/native", "clients/python/server"];
/// The packages in Python alone.
const PURE: [&str; 2] = ["clients/python", "clients/robot"];

/// Builds the page and all wheels for these processors with one of Cargo's profiles; then optionally
/// tries them.
pub(crate) fn run(
    places: &Places,
    steps: &mut Steps,
    processors: &[&str],
    profile: &str,
    try_them: bool,
) -> Result<(), Failure> {
    web::run(places, steps)?;
    steps.run("set up builders", || setup::wheel_tools(places))?;
    let wheels = places.wheels();
    steps.run("remove older wheels", || {
        for wheel in built(&wheels)? {
            fs::remove_file(&wheel).map_err(|error| at(&wheel, &error))?;
        }
        Ok(())
    })?;
    for processor in processors {
        let target = target(processor);
        steps.run(&format!("set up {target}"), || setup::target(&target))?;
        for package in BUILT_FROM_RUST {
            let mut maturin = published(places, tool(places, "maturin", package));
            maturin.args(["build", "--profile", profile, "--target", &target]);
            maturin.arg("--out").arg(&wheels);
            // Zig links against the old glibc, and maturin refuses what needs a newer one.
            maturin.args(["--zig", "--compatibility", PLATFORM]);
            steps.program(&format!("wheel of {package}, {processor}"), &mut maturin)?;
        }
    }
    for package in PURE {
        let mut hatchling = tool(places, "hatchling", package);
        hatchling.args(["build", "-t", "wheel", "-d"]).arg(&wheels);
        steps.program(&format!("wheel of {package}"), &mut hatchling)?;
    }
    steps.run("licences of what they contain", || {
        for processor in processors {
            let notices = notices(places, &target(processor))?;
            let ending = format!("_{processor}.whl");
            for wheel in built(&wheels)? {
                if wheel.to_string_lossy().ends_with(&ending) {
                    add_notices(places, &wheel, &notices)?;
                }
            }
        }
        Ok(())
    })?;
    steps.run("auditwheel", || {
        built(&wheels)?
            .iter()
            .try_for_each(|wheel| audit(places, wheel))
    })?;
    if try_them {
        try_wheels(places, steps)?;
    }
    Ok(())
}

/// Installs the wheels into an empty environment and uses them, without Rust and the source tree.
fn try_wheels(places: &Places, steps: &mut Steps) -> Result<(), Failure> {
    let folder = places.own.join("wheels-try");
    let python = folder.join("bin/python");
    steps.run("install the wheels", || {
        let wheels = built(&places.wheels())?;
        run_command(
            Command::new("python3")
                .args(["-m", "venv", "--clear"])
                .arg(&folder),
        )?;
        let mut install = Command::new(&python);
        install.args(["-m", "pip", "install", "--quiet"]);
        for wheel in wheels {
            let extras = if is_pure(&wheel) {
                "[envs,native,server]"
            } else {
                ""
            };
            install.arg(format!("{}{extras}", wheel.display()));
        }
        run_command(&mut install)
    })?;
    let script = places.root.join("clients/python/tools/try_wheels.py");
    let copy = folder.join("try_wheels.py");
    let mut attempt = Command::new(&python);
    // Isolated from the folder of the script, from the user's packages and from this environment.
    attempt
        .arg("-I")
        .arg(&copy)
        .current_dir(&folder)
        .env_clear();
    attempt.env("PATH", folder.join("bin")).env("HOME", &folder);
    steps.run("try the wheels", || {
        fs::copy(&script, &copy).map_err(|error| at(&script, &error))?;
        run_command(&mut attempt)
    })
}

/// Puts the notices beside the licence of a wheel.
fn add_notices(places: &Places, wheel: &Path, notices: &str) -> Result<(), Failure> {
    let unpacked = places.own.join("wheel");
    if unpacked.exists() {
        fs::remove_dir_all(&unpacked).map_err(|error| at(&unpacked, &error))?;
    }
    let mut unpack = tool(places, "wheel", "");
    run_command(unpack.arg("unpack").arg(wheel).arg("--dest").arg(&unpacked))?;
    let name = wheel.file_name().unwrap_or_default().to_string_lossy();
    let name = name.split('-').take(2).collect::<Vec<_>>().join("-");
    let folder = unpacked.join(&name);
    let licences = folder.join(format!("{name}.dist-info/licenses"));
    fs::create_dir_all(&licences).map_err(|error| at(&licences, &error))?;
    let file = licences.join(notices::FILE);
    fs::write(&file, notices).map_err(|error| at(&file, &error))?;
    let mut pack = tool(places, "wheel", "");
    pack.arg("pack").arg(&folder);
    run_command(pack.arg("--dest-dir").arg(places.wheels()))
}

/// Checks that a wheel runs on every system that its name promises.
fn audit(places: &Places, wheel: &Path) -> Result<(), Failure> {
    if is_pure(wheel) {
        return Ok(());
    }
    let found = read(tool(places, "auditwheel", "").arg("show").arg(wheel))?;
    let found: String = found.split_whitespace().collect();
    if !found.contains(&format!("platformtag:\"{PLATFORM}_")) {
        let wheel = wheel.display();
        return Err(Failure::new(format!(
            "{wheel} is not {PLATFORM}: see auditwheel show {wheel}"
        )));
    }
    println!("    {}: {PLATFORM}", wheel.display());
    Ok(())
}

/// What programs in wheels are built for: Linux with glibc.
fn target(processor: &str) -> String {
    format!("{processor}-unknown-linux-gnu")
}

fn is_pure(wheel: &Path) -> bool {
    wheel.to_string_lossy().ends_with("-none-any.whl")
}

/// The wheels in a folder, sorted.
pub(crate) fn built(folder: &Path) -> Result<Vec<PathBuf>, Failure> {
    fs::create_dir_all(folder).map_err(|error| at(folder, &error))?;
    let entries = fs::read_dir(folder).map_err(|error| at(folder, &error))?;
    let mut wheels: Vec<PathBuf> = entries
        .filter_map(|entry| entry.ok().map(|entry| entry.path()))
        .filter(|path| path.extension().is_some_and(|extension| extension == "whl"))
        .collect();
    wheels.sort();
    Ok(wheels)
}

/// The environment of a build whose program others run: it names its commit, and no folder of this
/// machine.
pub(crate) fn published(places: &Places, mut build: Command) -> Command {
    if let Ok(commit) = read(git(places).args(["log", "-1", "--format=%h %cs"])) {
        build.env("CHEFSHAT_COMMIT", commit);
    }
    let home = std::env::var_os("HOME")
        .map(PathBuf::from)
        .unwrap_or_default();
    let of_cargo = std::env::var_os("CARGO_HOME").map_or(home.join(".cargo"), PathBuf::from);
    let folders = [(&places.root, "."), (&of_cargo, "cargo")];
    let remap =
        |(from, to): (&PathBuf, &str)| format!("--remap-path-prefix={}={to}", from.display());
    build.env("CARGO_ENCODED_RUSTFLAGS", folders.map(remap).join("\x1f"));
    let remap = |(from, to): (&PathBuf, &str)| format!("-ffile-prefix-map={}={to}", from.display());
    build.env("CFLAGS", folders.map(remap).join(" "));
    build
}

/// A program of the builders' environment, in a folder of the source tree.
pub(crate) fn tool(places: &Places, name: &str, folder: &str) -> Command {
    let programs = places.wheel_tools().join("bin");
    let mut command = Command::new(programs.join(name));
    let path = std::env::var_os("PATH").unwrap_or_default();
    let paths = std::iter::once(programs).chain(std::env::split_paths(&path));
    let path = std::env::join_paths(paths).expect("they come from a PATH");
    command
        .current_dir(places.root.join(folder))
        .env("PATH", path);
    command.env("CARGO_TARGET_DIR", &places.target);
    command
}
