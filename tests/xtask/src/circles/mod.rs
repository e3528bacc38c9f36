//! Circles between the files of a crate, and between its folders.
//!
//! A file depends on another if its code, except tests, names an item that the other defines:
//! - Every path that starts with `crate`, `self`, `super`, a child module or an imported name
//!   counts, in `use` and elsewhere, macro arguments included.
//! - Re-exports are followed: `crate::Item` is a dependency on the file that defines `Item`, not on
//!   the `lib.rs` that re-exports it. Likewise a module in a path is not a dependency: `use
//!   super::child` counts where `child::Item` is used.
//! - So a `mod.rs` or `lib.rs` that declares and re-exports its children does not depend on them,
//!   unless its own code uses one of the names.
//! - Code under `#[cfg(test)]` and attributes, including doc comments, do not count; nor do methods
//!   and trait implementations, whose file cannot be found without types.

mod files;
mod names;

use std::path::PathBuf;

use serde_json::Value;

use crate::arrows;
use crate::failure::Failure;
use crate::places::Places;
use files::Files;

/// Refuses circles between the files of a crate, and between the folders of its root, for every crate
/// of the workspace.
pub(crate) fn check(places: &Places) -> Result<(), Failure> {
    let mut circles = Vec::new();
    for root in crate_roots(&arrows::metadata(places)?) {
        let files = Files::of_crate(&root, &|path| std::fs::read_to_string(path).ok())?;
        circles.extend(files.circles(&places.root));
        circles.extend(files.circles_of_folders(&places.root));
    }
    if circles.is_empty() {
        return Ok(());
    }
    Err(Failure::new(format!("\n{}", circles.join("\n"))))
}

/// The root files of all libraries and programs of the workspace.
fn crate_roots(metadata: &Value) -> Vec<PathBuf> {
    let packages = metadata["packages"].as_array().into_iter().flatten();
    let targets = packages.filter_map(|package| package["targets"].as_array());
    let roots = targets.flatten().filter_map(|target| {
        let kinds = target["kind"].as_array()?;
        let counts = kinds.iter().any(|kind| kind == "lib" || kind == "bin");
        counts.then(|| target["src_path"].as_str().map(PathBuf::from))?
    });
    roots.collect()
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;
    use std::path::Path;

    use super::*;

    /// The circles in a crate of these files.
    fn ways(files: &[(&str, &str)]) -> Vec<String> {
        let files: BTreeMap<&Path, &str> = files
            .iter()
            .map(|(path, text)| (Path::new(*path), *text))
            .collect();
        let read = |path: &Path| files.get(path).map(|text| (*text).to_owned());
        let files = Files::of_crate(Path::new("lib.rs"), &read).unwrap();
        files.circles(Path::new(""))
    }

    /// The circles between the folders of a crate of these files.
    fn ways_of_folders(files: &[(&str, &str)]) -> Vec<String> {
        let files: BTreeMap<&Path, &str> = files
            .iter()
            .map(|(path, text)| (Path::new(*path), *text))
            .collect();
        let read = |path: &Path| files.get(path).map(|text| (*text).to_owned());
        let files = Files::of_crate(Path::new("lib.rs"), &read).unwrap();
        files.circles_of_folders(Path::new(""))
    }

    #[test]
    fn folders_need_each_other_although_no_files_do() {
        let files = [
            ("lib.rs", "mod a; mod b;"),
            ("a/mod.rs", "pub mod x; pub mod w;"),
            ("a/x.rs", "use crate::b::y::Y; struct X(Y);"),
            ("a/w.rs", "pub struct W;"),
            ("b.rs", "pub mod y; pub mod z;"),
            ("b/y.rs", "pub struct Y;"),
            ("b/z.rs", "use crate::a::w::W; struct Z(W);"),
        ];
        assert_eq!(ways(&files), [""; 0]);
        assert_eq!(ways_of_folders(&files), ["a → b → a"]);
        // A file and its children are one, and what all pass through is none.
        let files = [
            ("lib.rs", "mod a; mod b; pub struct Top(a::A);"),
            ("a.rs", "mod x; pub struct A(x::X);"),
            ("a/x.rs", "use crate::b::B; pub struct X(B);"),
            ("b.rs", "pub struct B;"),
        ];
        assert_eq!(ways_of_folders(&files), [""; 0]);
    }

    const TWO: &str = "mod a; mod b;";

    #[test]
    fn the_workspace_has_no_circles() {
        check(&Places::find().unwrap()).unwrap();
    }

    #[test]
    fn a_circle_is_reported_however_it_is_written() {
        let uses = [
            "use crate::b::B; struct A(B);",
            "struct A(super::b::B);",
            "use super::b; struct A(b::B);",
            "use super::{b::{self, B}}; struct A(B);",
            "use super::b::*; struct A(B);",
            "struct A; fn f() { println!(\"{}\", crate::b::B); }",
            "struct A; fn f() { use crate::b::B as Other; }",
        ];
        for a in uses {
            let found = ways(&[
                ("lib.rs", TWO),
                ("a.rs", a),
                ("b.rs", "struct B(crate::a::A);"),
            ]);
            assert_eq!(found, ["a.rs → b.rs → a.rs"], "{a}");
        }
    }

    #[test]
    fn dependencies_in_one_direction_are_not_a_circle() {
        let none: [String; 0] = [];
        let a = "use crate::b::B; struct A(B);";
        assert_eq!(
            ways(&[("lib.rs", TWO), ("a.rs", a), ("b.rs", "struct B;")]),
            none
        );
        let b = "struct B; #[cfg(test)] mod tests { use crate::a::A; }";
        assert_eq!(ways(&[("lib.rs", TWO), ("a.rs", a), ("b.rs", b)]), none);
        let b = "/// See [`crate::a::A`].\nstruct B { a: u8 } fn f(a: u8) { let b = a; }";
        assert_eq!(ways(&[("lib.rs", TWO), ("a.rs", a), ("b.rs", b)]), none);
    }

    #[test]
    fn re_exports_are_followed_and_are_not_dependencies() {
        let none: [String; 0] = [];
        let root = "mod a; mod b; pub use a::A; pub use b::B;";
        let a = "use crate::B; pub struct A(B);";
        let found = ways(&[("lib.rs", root), ("a.rs", a), ("b.rs", "pub struct B;")]);
        assert_eq!(found, none);
        let found = ways(&[
            ("lib.rs", root),
            ("a.rs", a),
            ("b.rs", "pub struct B(super::A);"),
        ]);
        assert_eq!(found, ["a.rs → b.rs → a.rs"]);
    }

    #[test]
    fn a_parent_that_uses_its_child_depends_on_it() {
        let none: [String; 0] = [];
        let child = "use super::Shared; pub struct Child(Shared);";
        let declares = "mod child; pub use child::Child; pub struct Shared;";
        assert_eq!(
            ways(&[
                ("lib.rs", "mod a;"),
                ("a/mod.rs", declares),
                ("a/child.rs", child)
            ]),
            none
        );
        for uses in ["fn f(child: Child) {}", "fn f(child: child::Child) {}"] {
            let parent = format!("{declares} {uses}");
            let found = ways(&[
                ("lib.rs", "mod a;"),
                ("a/mod.rs", &parent),
                ("a/child.rs", child),
            ]);
            assert_eq!(found, ["a/child.rs → a/mod.rs → a/child.rs"], "{uses}");
        }
    }

    #[test]
    fn longer_circles_and_modules_with_paths_are_found() {
        let root = "mod a; #[path = \"else/where.rs\"] mod b; mod c { pub mod d; }";
        let found = ways(&[
            ("lib.rs", root),
            ("a.rs", "pub fn a() { crate::b::b() }"),
            ("else/where.rs", "pub fn b() { super::c::d::d() }"),
            ("c/d.rs", "pub fn d() { super::super::a::a() }"),
        ]);
        assert_eq!(found, ["a.rs → else/where.rs → c/d.rs → a.rs"]);
    }
}
