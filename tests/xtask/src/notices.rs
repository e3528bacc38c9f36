//! The licences of what releases contain: crates, packages of the page, fonts, libraries.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

use crate::command::{cargo, read};
use crate::failure::Failure;
use crate::places::Places;
use crate::setup::at;

/// Licences of what is not a package, each with what it covers: the fonts of pictures, and what every
/// static program contains.
const OTHERS: [(&str, &str); 3] = [
    (
        "server/assets/font/OFL.txt",
        "Atkinson Hyperlegible Next (OFL-1.1)",
    ),
    ("docker/archive/licences/musl.txt", "musl (MIT)"),
    (
        "docker/archive/licences/rust.txt",
        "Rust's standard library (MIT OR Apache-2.0)",
    ),
];
/// Those of what crates contain of others.
const WITHIN: [&str; 2] = ["jemalloc/COPYING", "third_party/fiat/LICENSE"];
/// How the names of files with licences begin, in capitals.
const LICENCES: [&str; 5] = ["LICENSE", "LICENCE", "COPYING", "COPYRIGHT", "NOTICE"];

/// What the programs of a release are built with, beside what is always in them.
pub(crate) const FEATURE: &str = "dist";

/// The file that releases have them in.
pub(crate) const FILE: &str = "NOTICES.txt";

/// What a release contains of others.
struct Part {
    /// Its name and version.
    name: String,
    licence: String,
    folder: PathBuf,
}

/// The notices of the programs and of the Python module, for a target. The packages of the page must
/// be set up.
pub(crate) fn notices(places: &Places, target: &str) -> Result<String, Failure> {
    let mut text =
        "What chefshat, chefshat-lab and chefshat_native contain of others, and its licences.\n"
            .to_owned();
    // Many texts differ in their line breaks alone.
    let mut by_words: BTreeMap<String, (String, BTreeSet<String>)> = BTreeMap::new();
    let mut add = |text: String, heading: &str| {
        let words = text.split_whitespace().collect::<Vec<_>>().join(" ");
        let (_, of) = by_words
            .entry(words)
            .or_insert_with(|| (text, BTreeSet::new()));
        of.insert(heading.to_owned());
    };
    for part in crates(places, target)?.into_iter().chain(page(places)?) {
        let heading = format!("{} ({})", part.name, part.licence);
        text += &format!("\n{heading}");
        for licence in licences(&part.folder)? {
            add(licence, &heading);
        }
    }
    for (file, heading) in OTHERS {
        let file = places.root.join(file);
        add(
            fs::read_to_string(&file).map_err(|error| at(&file, &error))?,
            heading,
        );
    }
    for (licence, of) in by_words.into_values() {
        let of = of.into_iter().collect::<Vec<_>>().join(", ");
        let line = "-".repeat(80);
        text += &format!("\n\n{line}\n{of}:\n\n{}", licence.trim_end());
    }
    Ok(text + "\n")
}

/// The crates in the Python module, and in the program that contains what the other one contains.
fn crates(places: &Places, target: &str) -> Result<Vec<Part>, Failure> {
    // For both: without it, what only a release contains is not among the packages.
    let features = ["--features", &format!("chefshat-lab/{FEATURE}")];
    let mut tree = cargo();
    tree.current_dir(&places.root);
    tree.args([
        "tree",
        "--locked",
        "--package",
        "chefshat-native",
        "--package",
        "chefshat-lab",
    ]);
    tree.args(features).args([
        "--edges", "normal", "--prefix", "none", "--format", "{p}", "--target", target,
    ]);
    let listed = read(&mut tree)?;
    let contained: BTreeSet<(&str, &str)> = listed
        .lines()
        .filter_map(|line| line.split_once(" v"))
        .map(|(name, rest)| (name, rest.split(' ').next().unwrap_or(rest)))
        .collect();

    let mut metadata = cargo();
    metadata.current_dir(&places.root);
    metadata.args([
        "metadata",
        "--locked",
        "--format-version",
        "1",
        "--filter-platform",
        target,
    ]);
    metadata.args(features);
    let metadata: Value = serde_json::from_str(&read(&mut metadata)?)
        .map_err(|error| Failure::new(format!("cargo metadata: {error}")))?;
    let packages = metadata["packages"].as_array().into_iter().flatten();
    let parts = packages.filter(|package| {
        let is_own = package["source"].is_null();
        !is_own && contained.contains(&(of(package, "name"), of(package, "version")))
    });
    Ok(parts
        .map(|package| part(package, Path::new(of(package, "manifest_path"))))
        .collect())
}

/// The packages in the page.
fn page(places: &Places) -> Result<Vec<Part>, Failure> {
    let mut npm = Command::new("npm");
    npm.current_dir(places.web());
    npm.args(["ls", "--omit", "dev", "--all", "--parseable"]);
    // The first line is the page itself.
    let listed = read(&mut npm)?;
    let folders = listed.lines().skip(1);
    folders
        .map(|folder| {
            let file = Path::new(folder).join("package.json");
            let text = fs::read_to_string(&file).map_err(|error| at(&file, &error))?;
            let package: Value =
                serde_json::from_str(&text).map_err(|error| at(&file, &error.into()))?;
            Ok(part(&package, &file))
        })
        .collect()
}

/// A package of Cargo or npm by its description.
fn part(package: &Value, manifest: &Path) -> Part {
    Part {
        name: format!("{} {}", of(package, "name"), of(package, "version")),
        licence: of(package, "license").to_owned(),
        folder: manifest.parent().unwrap_or(manifest).to_owned(),
    }
}

fn of<'a>(package: &'a Value, key: &str) -> &'a str {
    package[key].as_str().unwrap_or_default()
}

/// The texts of the licences in a folder. Where there is none, the name of the licence must do.
fn licences(folder: &Path) -> Result<Vec<String>, Failure> {
    let files = fs::read_dir(folder).map_err(|error| at(folder, &error))?;
    let own = files.filter_map(Result::ok).filter_map(|file| {
        let name = file.file_name().to_string_lossy().to_uppercase();
        let is_licence = LICENCES.iter().any(|begin| name.starts_with(begin));
        is_licence.then(|| file.path())
    });
    let within = WITHIN.iter().map(|path| folder.join(path));
    own.chain(within)
        .filter(|file| file.is_file())
        .map(|file| fs::read_to_string(&file).map_err(|error| at(&file, &error)))
        .collect()
}

#[test]
fn what_only_a_release_contains_is_listed() {
    let places = Places::find().unwrap();
    let target = format!("{}-unknown-linux-musl", std::env::consts::ARCH);
    let parts = crates(&places, &target).unwrap();
    for name in ["tokio 1", "tikv-jemalloc-sys 0", "rust-embed 8"] {
        let found = parts.iter().find(|part| part.name.starts_with(name));
        assert!(!licences(&found.unwrap().folder).unwrap().is_empty());
    }
}

#[test]
fn the_licences_of_a_package_are_found_by_the_names_of_their_files() {
    let root = Places::find().unwrap().root;
    let found = licences(&root).unwrap();
    assert_eq!(found, [fs::read_to_string(root.join("LICENSE")).unwrap()]);
    assert!(licences(&root.join("docs")).unwrap().is_empty());
}

#[test]
fn the_licence_of_a_library_inside_a_package_is_found() {
    let folder = std::env::temp_dir().join(format!("xtask-licences-{}", std::process::id()));
    fs::create_dir_all(folder.join("jemalloc")).unwrap();
    fs::write(folder.join("LICENSE-MIT"), "the binding").unwrap();
    fs::write(folder.join("jemalloc/COPYING"), "the library").unwrap();
    assert_eq!(licences(&folder).unwrap(), ["the binding", "the library"]);
    fs::remove_dir_all(folder).unwrap();
}

#[test]
fn the_licences_of_libraries_and_fonts_are_there() {
    let root = Places::find().unwrap().root;
    for (file, _) in OTHERS {
        assert!(root.join(file).is_file(), "{file}");
    }
}
