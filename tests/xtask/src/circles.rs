//! Circles between the files of a crate.
//!
//! A file depends on another if its code, except tests, names an item that the other defines:
//! - Every path that starts with `crate`, `self`, `super`, a child module or an imported name counts, in
//!   `use` and elsewhere, macro arguments included.
//! - Re-exports are followed: `crate::Item` is a dependency on the file that defines `Item`, not on the
//! `lib.rs` that re-exports it. Likewise a module in a path is not a dependency: `use super::child`
//! counts where `child::Item` is used.
//! - So a `mod.rs` or `lib.rs` that declares and re-exports its children does not depend on them, unless
//!   its own code uses one of the names.
//! - Code under `#[cfg(test)]` and attributes, including doc comments, do not count; nor do methods and
//!   trait implementations, whose file cannot be found without types.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::path::{Path, PathBuf};

use proc_macro2::{TokenStream, TokenTree};
use serde_json::Value;
use syn::visit::{self, Visit};

use crate::arrows;
use crate::failure::Failure;
use crate::places::Places;

/// Most re-exports followed from one name. Far more than any path has.
const MAX_HOPS: usize = 32;

/// Refuses circles between the files of a crate, for every crate of the workspace.
pub(crate) fn check(places: &Places) -> Result<(), Failure> {
    let mut circles = Vec::new();
    for root in crate_roots(&arrows::metadata(places)?) {
        let files = Files::of_crate(&root, &|path| std::fs::read_to_string(path).ok())?;
        circles.extend(files.circles(&places.root));
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

/// The modules of one crate and their files.
#[derive(Default)]
struct Files {
    paths: Vec<PathBuf>,
    modules: Vec<Module>,
}

#[derive(Default)]
struct Module {
    file: usize,
    parent: Option<usize>,
    children: BTreeMap<String, usize>,
    /// Names of the items it defines.
    items: BTreeSet<String>,
    imports: Vec<Import>,
    /// Paths in its code, except imports.
    paths: BTreeSet<Vec<String>>,
}

/// One name of a `use`.
struct Import {
    path: Vec<String>,
    /// The name it introduces; `None` for a glob.
    name: Option<String>,
    is_re_export: bool,
}

/// The target of a path.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Target {
    Module(usize),
    /// An item of the module's own file.
    Item(usize),
}

impl Files {
    /// Reads a crate from its root file.
    fn of_crate(root: &Path, read: &dyn Fn(&Path) -> Option<String>) -> Result<Files, Failure> {
        let mut files = Files::default();
        let folder = root.parent().unwrap_or(Path::new("")).to_owned();
        files.add_file(root.to_owned(), folder, None, read)?;
        Ok(files)
    }

    /// Adds a module that is a file, with its children from `folder`.
    fn add_file(
        &mut self,
        path: PathBuf,
        folder: PathBuf,
        parent: Option<usize>,
        read: &dyn Fn(&Path) -> Option<String>,
    ) -> Result<usize, Failure> {
        let failed =
            |error: &dyn std::fmt::Display| Failure::new(format!("{}: {error}", path.display()));
        let text = read(&path).ok_or_else(|| failed(&"cannot be read"))?;
        let syntax = syn::parse_file(&text).map_err(|error| failed(&error))?;
        self.paths.push(path.clone());
        let file = self.paths.len() - 1;
        self.add_module(file, folder, parent, &syntax.items, read)
    }

    fn add_module(
        &mut self,
        file: usize,
        folder: PathBuf,
        parent: Option<usize>,
        items: &[syn::Item],
        read: &dyn Fn(&Path) -> Option<String>,
    ) -> Result<usize, Failure> {
        let module = self.modules.len();
        self.modules.push(Module {
            file,
            parent,
            ..Module::default()
        });
        let mut reader = Reader::default();
        for item in items {
            reader.visit_item(item);
        }
        for child in reader.children {
            let name = child.ident.to_string();
            let nested = folder.join(&name);
            let index = if let Some((_, items)) = &child.content {
                self.add_module(file, nested, Some(module), items, read)?
            } else if let Some(path) = path_attribute(&child) {
                let own = self.paths[file].parent().unwrap_or(Path::new(""));
                self.add_file(own.join(path), nested, Some(module), read)?
            } else {
                let flat = folder.join(format!("{name}.rs"));
                let path = if read(&flat).is_some() {
                    flat
                } else {
                    nested.join("mod.rs")
                };
                self.add_file(path, nested, Some(module), read)?
            };
            self.modules[module].children.insert(name, index);
        }
        let own = &mut self.modules[module];
        (own.items, own.imports, own.paths) = (reader.items, reader.imports, reader.paths);
        Ok(module)
    }

    /// The dependencies of each file.
    fn dependencies(&self) -> Vec<BTreeSet<usize>> {
        let mut all = vec![BTreeSet::new(); self.paths.len()];
        for (index, module) in self.modules.iter().enumerate() {
            let imports = module.imports.iter();
            let imports = imports.filter(|import| !import.is_re_export && import.name.is_some());
            // An import introduces a name; if it is a module, the paths through it count.
            let named = imports.filter_map(|import| self.resolve(index, &import.path, 0));
            let used = (module.paths.iter()).filter_map(|path| self.resolve(index, path, 0));
            for target in named.chain(used) {
                if let Target::Item(other) = target {
                    all[module.file].insert(self.modules[other].file);
                }
            }
        }
        for (file, others) in all.iter_mut().enumerate() {
            others.remove(&file);
        }
        all
    }

    /// The target of a path in `module`; `None` if it is outside the crate.
    fn resolve(&self, module: usize, path: &[String], hops: usize) -> Option<Target> {
        let (first, rest) = path.split_first()?;
        match first.as_str() {
            "crate" => self.walk(0, rest, hops),
            "self" => self.walk(module, rest, hops),
            "super" => {
                let parent = self.modules[module].parent?;
                match rest.first() {
                    Some(next) if next == "super" => self.resolve(parent, rest, hops),
                    _ => self.walk(parent, rest, hops),
                }
            }
            _ => self.find(module, path, hops),
        }
    }

    /// Like [`Files::find`]; an unknown name counts as an item of the module, because macros define
    /// items too.
    fn walk(&self, module: usize, path: &[String], hops: usize) -> Option<Target> {
        if path.is_empty() {
            return Some(Target::Module(module));
        }
        self.find(module, path, hops).or(Some(Target::Item(module)))
    }

    /// Finds the first name of the path among the module's definitions and imports, and follows it.
    fn find(&self, module: usize, path: &[String], hops: usize) -> Option<Target> {
        if hops > MAX_HOPS {
            return None;
        }
        let (first, rest) = path.split_first()?;
        let own = &self.modules[module];
        if let Some(&child) = own.children.get(first) {
            return self.walk(child, rest, hops + 1);
        }
        if own.items.contains(first) {
            return Some(Target::Item(module));
        }
        for import in &own.imports {
            if import.name.as_deref() == Some(first) && import.path != path {
                let path: Vec<String> = import.path.iter().chain(rest).cloned().collect();
                return self.resolve(module, &path, hops + 1);
            }
        }
        let globs = own.imports.iter().filter(|import| import.name.is_none());
        globs
            .filter_map(|import| self.resolve(module, &import.path, hops + 1))
            .find_map(|target| match target {
                Target::Module(other) if other != module => self.find(other, path, hops + 1),
                _ => None,
            })
    }

    /// The shortest circle through each dependency, shortest first. Paths are relative to `root`.
    fn circles(&self, root: &Path) -> Vec<String> {
        let dependencies = self.dependencies();
        let name = |file: usize| {
            let path = &self.paths[file];
            let path = path.strip_prefix(root).unwrap_or(path);
            path.to_string_lossy().replace('\\', "/")
        };
        let mut circles = BTreeSet::new();
        for to in 0..dependencies.len() {
            let before = search(&dependencies, to);
            for from in (0..dependencies.len()).filter(|from| dependencies[*from].contains(&to)) {
                // From `to` back to `from`, read backwards.
                let mut way = vec![from];
                while let Some(&file) = way.last()
                    && file != to
                    && let Some(file) = before[file]
                {
                    way.push(file);
                }
                if way.last() != Some(&to) {
                    continue;
                }
                way.reverse();
                let smallest = (0..way.len()).min_by_key(|&at| name(way[at]));
                way.rotate_left(smallest.unwrap_or_default());
                way.push(way[0]);
                let names: Vec<String> = way.into_iter().map(name).collect();
                circles.insert((names.len(), names.join(" → ")));
            }
        }
        circles.into_iter().map(|(_, circle)| circle).collect()
    }
}

/// For every file that can be reached from one, the previous file on a shortest path.
fn search(dependencies: &[BTreeSet<usize>], from: usize) -> Vec<Option<usize>> {
    let mut before = vec![None; dependencies.len()];
    let mut queue = VecDeque::from([from]);
    while let Some(file) = queue.pop_front() {
        for &next in &dependencies[file] {
            if before[next].is_none() {
                before[next] = Some(file);
                queue.push_back(next);
            }
        }
    }
    before
}

/// Collects what a module defines, imports and names.
#[derive(Default)]
struct Reader {
    children: Vec<syn::ItemMod>,
    items: BTreeSet<String>,
    imports: Vec<Import>,
    paths: BTreeSet<Vec<String>>,
}

impl Reader {
    fn import(&mut self, tree: &syn::UseTree, mut path: Vec<String>, is_re_export: bool) {
        let (last, name) = match tree {
            syn::UseTree::Path(tree) => {
                path.push(tree.ident.to_string());
                return self.import(&tree.tree, path, is_re_export);
            }
            syn::UseTree::Group(group) => {
                for tree in &group.items {
                    self.import(tree, path.clone(), is_re_export);
                }
                return;
            }
            syn::UseTree::Glob(_) => (None, None),
            syn::UseTree::Name(tree) => {
                let last = tree.ident.to_string();
                (Some(last.clone()), Some(last))
            }
            syn::UseTree::Rename(tree) => {
                (Some(tree.ident.to_string()), Some(tree.rename.to_string()))
            }
        };
        // `use path::{self}` names the module itself.
        let (last, name) = match last {
            Some(last) if last == "self" && !path.is_empty() => {
                let module = path.last().cloned();
                (None, name.filter(|name| name != "self").or(module))
            }
            last => (last, name),
        };
        path.extend(last);
        self.imports.push(Import {
            path,
            name,
            is_re_export,
        });
    }

    /// Paths in the arguments of a macro, which have no syntax of their own.
    fn tokens(&mut self, tokens: TokenStream) {
        let mut path: Vec<String> = Vec::new();
        let mut colons = 0;
        for token in tokens {
            match token {
                TokenTree::Ident(ident) => {
                    if colons != 2 {
                        self.path(std::mem::take(&mut path));
                    }
                    path.push(ident.to_string());
                    colons = 0;
                }
                TokenTree::Punct(punct) if punct.as_char() == ':' => colons += 1,
                TokenTree::Group(group) => {
                    self.path(std::mem::take(&mut path));
                    colons = 0;
                    self.tokens(group.stream());
                }
                TokenTree::Punct(_) | TokenTree::Literal(_) => {
                    self.path(std::mem::take(&mut path));
                    colons = 0;
                }
            }
        }
        self.path(path);
    }

    fn path(&mut self, path: Vec<String>) {
        if !path.is_empty() {
            self.paths.insert(path);
        }
    }
}

impl<'ast> Visit<'ast> for Reader {
    fn visit_item(&mut self, item: &'ast syn::Item) {
        let (attributes, name) = match item {
            syn::Item::Const(item) => (&item.attrs, Some(&item.ident)),
            syn::Item::Enum(item) => (&item.attrs, Some(&item.ident)),
            syn::Item::Fn(item) => (&item.attrs, Some(&item.sig.ident)),
            syn::Item::Impl(item) => (&item.attrs, None),
            syn::Item::Macro(item) => (&item.attrs, item.ident.as_ref()),
            syn::Item::Mod(item) => (&item.attrs, None),
            syn::Item::Static(item) => (&item.attrs, Some(&item.ident)),
            syn::Item::Struct(item) => (&item.attrs, Some(&item.ident)),
            syn::Item::Trait(item) => (&item.attrs, Some(&item.ident)),
            syn::Item::Type(item) => (&item.attrs, Some(&item.ident)),
            syn::Item::Union(item) => (&item.attrs, Some(&item.ident)),
            syn::Item::Use(item) => (&item.attrs, None),
            _ => return visit::visit_item(self, item),
        };
        if is_for_tests(attributes) {
            return;
        }
        self.items.extend(name.map(ToString::to_string));
        visit::visit_item(self, item);
    }

    fn visit_item_mod(&mut self, module: &'ast syn::ItemMod) {
        self.children.push(module.clone());
    }

    fn visit_item_use(&mut self, item: &'ast syn::ItemUse) {
        let is_re_export = !matches!(item.vis, syn::Visibility::Inherited);
        self.import(&item.tree, Vec::new(), is_re_export);
    }

    fn visit_impl_item_fn(&mut self, function: &'ast syn::ImplItemFn) {
        if !is_for_tests(&function.attrs) {
            visit::visit_impl_item_fn(self, function);
        }
    }

    fn visit_attribute(&mut self, _: &'ast syn::Attribute) {}

    /// `pub(in path)` and `pub(super)` do not use what they name.
    fn visit_visibility(&mut self, _: &'ast syn::Visibility) {}

    fn visit_path(&mut self, path: &'ast syn::Path) {
        if path.leading_colon.is_none() {
            let names = path.segments.iter();
            self.path(names.map(|segment| segment.ident.to_string()).collect());
        }
        visit::visit_path(self, path);
    }

    fn visit_macro(&mut self, call: &'ast syn::Macro) {
        self.visit_path(&call.path);
        self.tokens(call.tokens.clone());
    }
}

/// Whether an item is compiled only for tests.
fn is_for_tests(attributes: &[syn::Attribute]) -> bool {
    attributes.iter().any(|attribute| {
        let syn::Meta::List(list) = &attribute.meta else {
            return false;
        };
        let mut is_negated = false;
        list.path.is_ident("cfg")
            && list.tokens.clone().into_iter().any(|token| match token {
                TokenTree::Ident(ident) => {
                    is_negated = ident == "not";
                    ident == "test"
                }
                TokenTree::Group(group) => {
                    let mut inner = group.stream().into_iter();
                    !is_negated
                        && inner.any(
                            |token| matches!(token, TokenTree::Ident(ident) if ident == "test"),
                        )
                }
                _ => false,
            })
    })
}

/// The file named by `#[path = "…"]`.
fn path_attribute(module: &syn::ItemMod) -> Option<String> {
    module.attrs.iter().find_map(|attribute| {
        let syn::Meta::NameValue(pair) = &attribute.meta else {
            return None;
        };
        let syn::Expr::Lit(literal) = &pair.value else {
            return None;
        };
        match &literal.lit {
            syn::Lit::Str(text) if pair.path.is_ident("path") => Some(text.value()),
            _ => None,
        }
    })
}

#[cfg(test)]
mod tests {
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

    const TWO: &str = "mod a; mod b;";

    #[test]
    fn the_workspace_has_only_the_remaining_circles() {
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
