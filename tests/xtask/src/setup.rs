//! Prepares what the steps need: virtual environments, node modules, checkers, Debian packages.
//! Everything is created inside the build folder and recreated only when its sources have changed;
//! a Debian package is installed only if it is missing.

use std::collections::BTreeSet;
use std::fs;
use std::os::unix::fs::symlink;
use std::path::Path;
use std::process::Command;
use std::sync::{Mutex, OnceLock};

use crate::command::{cargo, read, run, succeeds};
use crate::failure::Failure;
use crate::places::{PYTHON_PACKAGES, Places};

/// The version of cargo-deny for which deny.toml is written.
const CARGO_DENY: &str = "0.20.2";

/// What lists the contents of a release.
const CARGO_CYCLONEDX: &str = "0.5.9";

/// What installs Python packages in a fraction of pip's time.
const UV: &str = "uv==0.13.9";

/// Oldest major version of Node that the packages support.
const OLDEST_NODE: u32 = 20;

/// The Debian packages that the agent in C++ is built with.
const CPP_PACKAGES: [&str; 7] = [
    "cmake",
    "g++",
    "libgrpc++-dev",
    "libprotobuf-dev",
    "make",
    "protobuf-compiler",
    "protobuf-compiler-grpc",
];

/// A program, by its name or path, and the Debian package that has it.
pub(crate) type Program = (&'static str, &'static str);

/// Spreads clients over the nodes of a cluster.
pub(crate) const HAPROXY: Program = ("/usr/sbin/haproxy", "haproxy");

/// Makes a disk fail.
pub(crate) const STRACE: Program = ("strace", "strace");

/// Loads the shipped dashboard and alerts.
pub(crate) const PROMETHEUS: Program = ("promtool", "prometheus");

/// Has the terminals of the tests of commands.
pub(crate) const TMUX: Program = ("tmux", "tmux");

/// Runs the sample that analyses a study.
pub(crate) const R: Program = ("Rscript", "r-base-core");

/// What the tests in Rust use, and the agent in C++ is built with.
pub(crate) const FOR_RUST: [Program; 7] = [
    ("psql", "postgresql"),
    HAPROXY,
    STRACE,
    PROMETHEUS,
    TMUX,
    R,
    ("grpc_cpp_plugin", "protobuf-compiler-grpc"),
];

/// The proxies of docker/, what makes the certificates of docs/access.md, and a browser.
pub(crate) const FOR_DEPLOYMENT: [Program; 4] = [
    ("openssl", "openssl"),
    ("/usr/sbin/nginx", "nginx"),
    HAPROXY,
    CHROMIUM,
];

/// Builds images, and the systems they are based on.
pub(crate) const FOR_IMAGES: [Program; 2] = [
    ("buildah", "buildah"),
    ("/usr/sbin/debootstrap", "debootstrap"),
];

/// What runs programs for aarch64.
pub(crate) const EMULATOR: Program = ("qemu-aarch64-static", "qemu-user-static");

/// The browser without windows.
pub(crate) const CHROMIUM: Program = (
    "/usr/bin/chromium-headless-shell",
    "chromium-headless-shell",
);

/// A file in each created folder that lists its sources.
const MADE_FROM: &str = ".made-from";

/// The Python packages, editable, with their development extras, in one environment.
pub(crate) fn python_packages(places: &Places) -> Result<(), Failure> {
    let mut made_from = String::new();
    let mut install = Vec::new();
    for package in PYTHON_PACKAGES {
        let package = places.root.join(package);
        let project = package.join("pyproject.toml");
        let text = fs::read_to_string(&project).map_err(|error| at(&project, &error))?;
        let editable = format!("{}[dev]", package.display());
        // The path counts too: clones may share a build folder, and a package runs from its source
        // folder.
        made_from += &format!("{editable}\n{text}\n");
        install.extend(["--editable".to_owned(), editable]);
    }
    let install: Vec<&str> = install.iter().map(String::as_str).collect();
    venv(places, &places.venv(), &made_from, &install)
}

/// The module `chefshat_native` that the `build` step built, in the environment of the packages.
pub(crate) fn native_module(places: &Places) -> Result<(), Failure> {
    let program = "import sysconfig; print(sysconfig.get_path('platlib'))";
    let folder = read(Command::new(places.python()).args(["-c", program]))?;
    let module = Path::new(folder.trim()).join("chefshat_native.abi3.so");
    // A process that has loaded the old one keeps it.
    let _ = fs::remove_file(&module);
    match fs::copy(places.native_module(), &module) {
        Ok(_) => Ok(()),
        Err(error) => Err(at(&module, &error)),
    }
}

/// The checkers of tools.txt, in their own environment.
pub(crate) fn tools(places: &Places) -> Result<(), Failure> {
    listed(places, "tests/xtask/tools.txt", &places.tools())
}

/// Rust's standard library for another target.
pub(crate) fn target(name: &str) -> Result<(), Failure> {
    let mut rustc = Command::new("rustc");
    let folder = read(rustc.args(["--print", "target-libdir", "--target", name]))?;
    match Path::new(folder.trim()).exists() {
        true => Ok(()),
        false => run(Command::new("rustup").args(["target", "add", name])),
    }
}

/// The builders of wheels.txt, in their own environment.
pub(crate) fn wheel_tools(places: &Places) -> Result<(), Failure> {
    listed(places, "tests/xtask/wheels.txt", &places.wheel_tools())
}

/// The oldest or newest versions that the Python SDK works with, in their own environment.
pub(crate) fn versions(places: &Places, which: &str) -> Result<(), Failure> {
    let list = format!("clients/python/tests/{which}.txt");
    listed(places, &list, &places.versions(which))
}

/// An environment with the packages of a list.
fn listed(places: &Places, list: &str, folder: &Path) -> Result<(), Failure> {
    let list = places.root.join(list);
    let made_from = fs::read_to_string(&list).map_err(|error| at(&list, &error))?;
    let install = ["--requirement", &list.to_string_lossy()];
    venv(places, folder, &made_from, &install)
}

/// The JavaScript agent, with its modules.
pub(crate) fn node_package(places: &Places) -> Result<(), Failure> {
    npm_package(&places.node_package(), &places.node())
}

/// The agent in C++, built with the system's gRPC.
pub(crate) fn cpp_agent(places: &Places) -> Result<(), Failure> {
    let (source, build) = (places.cpp_source(), places.cpp_build());
    // CMake refuses a folder in which another source tree was built.
    let made_from = source.display().to_string();
    if !is_made_from(&build, &made_from) {
        let _ = fs::remove_dir_all(&build);
        fs::create_dir_all(&build).map_err(|error| at(&build, &error))?;
        note_made_from(&build, &made_from)?;
    }
    let configure = || {
        let mut cmake = Command::new("cmake");
        cmake.arg("-S").arg(&source).arg("-B").arg(&build);
        // Unoptimised, and without what a debugger needs.
        cmake.args(["-DCMAKE_BUILD_TYPE=Debug", "-DCMAKE_CXX_FLAGS_DEBUG="]);
        cmake
    };
    if read(&mut configure()).is_err() {
        debian_packages(&CPP_PACKAGES)?;
        run(&mut configure())?;
    }
    run(Command::new("cmake")
        .arg("--build")
        .arg(&build)
        .args(["--parallel", "2"]))
}

/// The page for people, with its modules, in a folder in which the rest of the source tree is where
/// the page expects it.
pub(crate) fn web_package(places: &Places) -> Result<(), Failure> {
    let tree = places.web_tree();
    fs::create_dir_all(&tree).map_err(|error| at(&tree, &error))?;
    for name in ["docs", "proto", "server", "tests"] {
        let link = tree.join(name);
        let source = places.root.join(name);
        if fs::read_link(&link).is_ok_and(|pointed| pointed == source) {
            continue;
        }
        // Another source tree uses the same build folder.
        let _ = fs::remove_file(&link);
        symlink(&source, &link).map_err(|error| at(&link, &error))?;
    }
    npm_package(&places.web_package(), &places.web())
}

/// Copies a package for Node next to its modules: npm writes only beside a package.json.
fn npm_package(source: &Path, copy: &Path) -> Result<(), Failure> {
    if !succeeds("node", &["--version"]) {
        debian_package("nodejs")?;
    }
    if !succeeds("npm", &["--version"]) {
        debian_package("npm")?;
    }
    let version = read(Command::new("node").arg("--version"))?;
    if !is_new_enough(&version) {
        return Err(Failure::new(format!(
            "Node {OLDEST_NODE} or newer is needed, but `node` is {version}; see https://nodejs.org"
        )));
    }
    copy_package(source, copy).map_err(|error| at(copy, &error))?;
    let lock = source.join("package-lock.json");
    let made_from = fs::read_to_string(&lock).map_err(|error| at(&lock, &error))?;
    let modules = copy.join("node_modules");
    if is_made_from(&modules, &made_from) {
        return Ok(());
    }
    run(Command::new("npm")
        .args(["ci", "--no-audit", "--no-fund"])
        .current_dir(copy))?;
    note_made_from(&modules, &made_from)
}

/// Whether a version as Node prints it ("v20.19.4") is supported.
fn is_new_enough(version: &str) -> bool {
    let main = version.trim_start_matches('v').split('.').next();
    main.and_then(|main| main.parse().ok())
        .is_some_and(|main: u32| main >= OLDEST_NODE)
}

/// PostgreSQL, of which tests start servers of their own.
pub(crate) fn postgresql() -> Result<(), Failure> {
    let versions = fs::read_dir("/usr/lib/postgresql").into_iter().flatten();
    match versions
        .flatten()
        .any(|it| it.path().join("bin/postgres").exists())
    {
        true => Ok(()),
        false => debian_package("postgresql"),
    }
}

/// cargo-deny, which checks licences and sources. Returns its command.
pub(crate) fn cargo_deny(places: &Places) -> Result<Command, Failure> {
    cargo_tool(places, "cargo-deny", CARGO_DENY)
}

/// cargo-cyclonedx, which lists what a binary contains. Returns its command.
pub(crate) fn cargo_cyclonedx(places: &Places) -> Result<Command, Failure> {
    cargo_tool(places, "cargo-cyclonedx", CARGO_CYCLONEDX)
}

/// A program for Cargo: from the path if it has this version, else built here.
fn cargo_tool(places: &Places, name: &str, version: &str) -> Result<Command, Failure> {
    let own = places.cargo_tools().join("bin").join(name);
    for program in [own.as_path(), Path::new(name)] {
        let said = read(Command::new(program).arg("--version"));
        if said.is_ok_and(|said| said.ends_with(&format!(" {version}"))) {
            return Ok(Command::new(program));
        }
    }
    // An unoptimised build takes a fraction of the time and still checks our few hundred crates in
    // seconds.
    let build = places.cargo_tools().join("build");
    let mut install = cargo();
    install.args(["install", name, "--locked", "--debug", "--quiet"]);
    install.args(["--version", version]);
    run(install
        .arg("--root")
        .arg(places.cargo_tools())
        .arg("--target-dir")
        .arg(&build))?;
    fs::remove_dir_all(&build).map_err(|error| at(&build, &error))?;
    Ok(Command::new(own))
}

/// A virtual environment with these packages, unless it exists already.
fn venv(places: &Places, folder: &Path, made_from: &str, install: &[&str]) -> Result<(), Failure> {
    if !succeeds("python3", &["--version"]) {
        debian_package("python3")?;
    }
    let python = folder.join("bin/python");
    if is_made_from(folder, made_from) && succeeds(&python, &["-c", "import pip"]) {
        return Ok(());
    }
    if !succeeds("python3", &["-c", "import ensurepip, venv"]) {
        debian_package("python3-venv")?;
    }
    let by_uv = match is_pip_configured() {
        true => Err(Failure::new("pip is configured")),
        false => venv_by_uv(places, folder, install),
    };
    if let Err(failure) = by_uv {
        println!("{failure}; pip installs the packages instead of uv");
        venv_by_pip(folder, install)?;
    }
    note_made_from(folder, made_from)
}

/// Whether pip has an index or constraints of its own, which uv would not read.
fn is_pip_configured() -> bool {
    let settings = read(Command::new("python3").args(["-m", "pip", "config", "list"]));
    settings.is_ok_and(|settings| {
        ["index", "constraint"]
            .iter()
            .any(|name| settings.contains(name))
    })
}

fn venv_by_uv(places: &Places, folder: &Path, install: &[&str]) -> Result<(), Failure> {
    // Steps that run side by side need it.
    static BEING_SET_UP: Mutex<()> = Mutex::new(());
    let (environment, program) = (places.uv(), places.uv().join("bin/uv"));
    {
        let _one_at_a_time = BEING_SET_UP.lock().expect("no code that holds it panics");
        let runs = || succeeds(&program, &["--version"]);
        if !is_made_from(&environment, UV) || !runs() {
            venv_by_pip(&environment, &[UV])?;
            note_made_from(&environment, UV)?;
        }
    }
    let uv = || {
        let mut uv = Command::new(&program);
        uv.args(["--quiet", "--system-certs"]);
        uv
    };
    // uv itself would prefer a Python that it has installed.
    let python = read(Command::new("python3").args(["-c", "import sys; print(sys.executable)"]))?;
    run(uv()
        .args(["venv", "--clear", "--seed", "--python", python.trim()])
        .arg(folder))?;
    run(uv()
        .args(["pip", "install", "--python"])
        .arg(folder.join("bin/python"))
        .args(install))
}

fn venv_by_pip(folder: &Path, install: &[&str]) -> Result<(), Failure> {
    run(Command::new("python3")
        .args(["-m", "venv", "--clear"])
        .arg(folder))?;
    run(Command::new(folder.join("bin/python"))
        // Python compiles what it imports.
        .args(["-m", "pip", "install", "--quiet", "--no-compile"])
        .args(install))
}

/// Installs the packages of missing programs at once, which takes a fraction of one at a time.
pub(crate) fn debian_programs(wanted: &[Program]) -> Result<(), Failure> {
    let missing = wanted.iter().filter(|(program, _)| !is_on_path(program));
    let mut packages: BTreeSet<&str> = missing.map(|(_, package)| *package).collect();
    if packages.contains("protobuf-compiler-grpc") {
        packages.extend(CPP_PACKAGES);
    }
    match packages.is_empty() {
        true => Ok(()),
        false => debian_packages(&Vec::from_iter(packages)),
    }
}

/// Whether there is a program, by its name or path.
fn is_on_path(program: &str) -> bool {
    let path = std::env::var_os("PATH").unwrap_or_default();
    std::env::split_paths(&path).any(|folder| folder.join(program).exists())
}

/// Installs a Debian package if it is missing, or names it if it cannot.
fn debian_package(name: &str) -> Result<(), Failure> {
    debian_packages(&[name])
}

/// Installs those of the Debian packages that are missing, or names them if it cannot.
fn debian_packages(names: &[&str]) -> Result<(), Failure> {
    let root = read(Command::new("id").arg("-u")).is_ok_and(|id| id == "0");
    if !root || !succeeds("apt-get", &["--version"]) {
        return Err(Failure::new(format!(
            "Debian packages are missing; install them: apt-get install {}",
            names.join(" ")
        )));
    }
    // Once: without a network, it waits for minutes.
    static UPDATED: OnceLock<bool> = OnceLock::new();
    let update = || run(Command::new("apt-get").args(["update", "--quiet"])).is_ok();
    if !UPDATED.get_or_init(update) {
        return Err(Failure::new(format!(
            "`apt-get update` failed, so there is no {}",
            names.join(", ")
        )));
    }
    let mut install = Command::new("apt-get");
    install.args(["install", "--yes", "--quiet", "--no-install-recommends"]);
    install.args(names);
    // Services are not started: tests start servers of their own.
    run(install.env("RUNLEVEL", "1"))
}

/// Makes `copy` equal to `source`, except for the modules: those of `copy` stay, those of `source`
/// are skipped.
fn copy_package(source: &Path, copy: &Path) -> std::io::Result<()> {
    fs::create_dir_all(copy)?;
    for entry in fs::read_dir(copy)? {
        let entry = entry?;
        if entry.file_name() == "node_modules" {
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
        if entry.file_name() == "node_modules" {
            continue;
        }
        if entry.file_type()?.is_dir() {
            copy_package(&entry.path(), &to)?;
        } else {
            fs::copy(entry.path(), to)?;
        }
    }
    Ok(())
}

fn is_made_from(folder: &Path, made_from: &str) -> bool {
    fs::read_to_string(folder.join(MADE_FROM)).is_ok_and(|text| text == made_from)
}

fn note_made_from(folder: &Path, made_from: &str) -> Result<(), Failure> {
    fs::write(folder.join(MADE_FROM), made_from).map_err(|error| at(folder, &error))
}

pub(crate) fn at(path: &Path, error: &std::io::Error) -> Failure {
    Failure::new(format!("{}: {error}", path.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_copied_package_follows_its_source_and_keeps_its_own_modules() {
        let folder = std::env::temp_dir().join(format!("xtask-copy-{}", std::process::id()));
        let (source, copy) = (folder.join("source"), folder.join("copy"));
        for made in [
            source.join("tests"),
            source.join("node_modules"),
            copy.join("node_modules"),
            copy.join("old"),
        ] {
            fs::create_dir_all(made).unwrap();
        }
        for (file, text) in [
            ("source/agent.js", "new"),
            ("copy/agent.js", "old"),
            ("copy/gone.js", "old"),
        ] {
            fs::write(folder.join(file), text).unwrap();
        }
        fs::write(source.join("tests/one.test.js"), "test").unwrap();
        fs::write(source.join("node_modules/theirs"), "").unwrap();
        fs::write(copy.join("node_modules/ours"), "").unwrap();

        copy_package(&source, &copy).unwrap();

        assert_eq!(fs::read_to_string(copy.join("agent.js")).unwrap(), "new");
        assert_eq!(
            fs::read_to_string(copy.join("tests/one.test.js")).unwrap(),
            "test"
        );
        assert!(!copy.join("gone.js").exists() && !copy.join("old").exists());
        assert!(
            copy.join("node_modules/ours").exists() && !copy.join("node_modules/theirs").exists()
        );
        fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn old_versions_of_node_are_recognised() {
        for (version, new_enough) in [
            ("v20.19.4", true),
            ("v24.0.0", true),
            ("v18.20.4", false),
            ("", false),
        ] {
            assert_eq!(is_new_enough(version), new_enough, "{version}");
        }
    }

    #[test]
    fn a_folder_matches_only_its_recorded_sources() {
        let folder = std::env::temp_dir().join(format!("xtask-made-{}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        assert!(!is_made_from(&folder, "one"));
        note_made_from(&folder, "one").unwrap();
        assert!(is_made_from(&folder, "one") && !is_made_from(&folder, "two"));
        fs::remove_dir_all(folder).unwrap();
    }
}
