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

/// The oldest systems on which the module runs: glibc 2.17, those of numpy's wheels.
const PLATFORM: &str = "manylinux_2_17";
/// Those of the wheel with the programs, which are static: the oldest that numpy's wheels name.
const STATIC_PLATFORMS: [&str; 2] = [PLATFORM, "musllinux_1_2"];

/// The programs: the server, and what only some need beside it.
pub(crate) const PROGRAMS: [&str; 2] = ["chefshat", "chefshat-lab"];

/// The processors for which a release has wheels.
pub(crate) const PROCESSORS: [&str; 2] = ["x86_64", "aarch64"];

/// That of this machine, on which its wheels can be tried.
pub(crate) const HOST: [&str; 1] = [std::env::consts::ARCH];

/// The module, built by maturin from Rust.
const MODULE: &str = "clients/python/native";
/// The programs, built by it as well.
const SERVER: &str = "clients/python/server";
/// The packages in Python alone.
const PURE: [&str; 3] = ["clients/python", "clients/paper", "clients/robot"];

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
        let platforms = [
            (MODULE, target(processor), &[PLATFORM][..]),
            (SERVER, static_target(processor), &STATIC_PLATFORMS),
        ];
        for (package, target, compatible) in platforms {
            steps.run(&format!("set up {target}"), || setup::target(&target))?;
            let mut maturin = published(places, tool(places, "maturin", package));
            maturin.args(["build", "--profile", profile, "--target", &target]);
            maturin.arg("--out").arg(&wheels);
            // Zig links against the old glibc, and maturin refuses what needs a newer one.
            maturin.args(["--zig", "--compatibility"]).args(compatible);
            steps.program(&format!("wheel of {package}, {processor}"), &mut maturin)?;
        }
        steps.run("check that programs are static and name no folder", || {
            PROGRAMS
                .iter()
                .try_for_each(|name| check(places, &program(places, processor, profile, name)))
        })?;
    }
    for package in PURE {
        let mut hatchling = tool(places, "hatchling", package);
        hatchling.args(["build", "-t", "wheel", "-d"]).arg(&wheels);
        steps.program(&format!("wheel of {package}"), &mut hatchling)?;
    }
    steps.run("licences of what they contain", || {
        for processor in processors {
            let of_module = notices(places, &target(processor))?;
            let of_programs = notices(places, &static_target(processor))?;
            let ending = format!("_{processor}.whl");
            for wheel in built(&wheels)? {
                if wheel.to_string_lossy().ends_with(&ending) {
                    let is_static = has_programs(&wheel);
                    let notices = if is_static { &of_programs } else { &of_module };
                    add_notices(places, &wheel, notices)?;
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

/// A program of the server's wheel, which is also that of archives, packages and images.
pub(crate) fn program(places: &Places, processor: &str, profile: &str, name: &str) -> PathBuf {
    let built = places.target.join(static_target(processor));
    built.join(profile).join(name)
}

/// Checks that a program needs nothing of a system, and tells nothing of that which built it.
fn check(places: &Places, program: &Path) -> Result<(), Failure> {
    let mut readelf = Command::new("readelf");
    let headers = read(readelf.arg("--program-headers").arg(program))?;
    let shown = program.display();
    if headers.contains("INTERP") {
        return Err(Failure::new(format!("{shown} needs libraries")));
    }
    let bytes = fs::read(program).map_err(|error| at(program, &error))?;
    let root = format!("{}/server/", places.root.display());
    match bytes.windows(root.len()).any(|it| it == root.as_bytes()) {
        true => Err(Failure::new(format!("{shown} names the folder {root}"))),
        false => Ok(()),
    }
}

/// Checks that the module runs on every system that the name of its wheel promises.
fn audit(places: &Places, wheel: &Path) -> Result<(), Failure> {
    if is_pure(wheel) || has_programs(wheel) {
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

/// What the module is built for: Linux with glibc.
fn target(processor: &str) -> String {
    format!("{processor}-unknown-linux-gnu")
}

/// What programs are built for: every Linux, without libraries.
pub(crate) fn static_target(processor: &str) -> String {
    format!("{processor}-unknown-linux-musl")
}

fn has_programs(wheel: &Path) -> bool {
    wheel.to_string_lossy().contains(STATIC_PLATFORMS[1])
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
fn published(places: &Places, mut build: Command) -> Command {
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
fn tool(places: &Places, name: &str, folder: &str) -> Command {
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
