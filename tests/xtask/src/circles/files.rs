//! The files of a crate and their dependencies: follows every name in a module to the file that
//! defines it.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::path::{Path, PathBuf};

use super::names::Names;
use crate::failure::Failure;

/// Most re-exports followed from one name. Far more than any path has.
const MAX_HOPS: usize = 32;

/// The modules of one crate and their files.
#[derive(Default)]
pub(super) struct Files {
    paths: Vec<PathBuf>,
    modules: Vec<Module>,
}

struct Module {
    file: usize,
    parent: Option<usize>,
    children: BTreeMap<String, usize>,
    names: Names,
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
    pub(super) fn of_crate(
        root: &Path,
        read: &dyn Fn(&Path) -> Option<String>,
    ) -> Result<Files, Failure> {
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
        let mut names = Names::of(items);
        let children = std::mem::take(&mut names.children);
        self.modules.push(Module {
            file,
            parent,
            children: BTreeMap::new(),
            names,
        });
        for child in children {
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
        Ok(module)
    }

    /// The dependencies of each file.
    fn dependencies(&self) -> Vec<BTreeSet<usize>> {
        let mut all = vec![BTreeSet::new(); self.paths.len()];
        for (index, module) in self.modules.iter().enumerate() {
            let imports = module.names.imports.iter();
            let imports = imports.filter(|import| !import.is_re_export && import.name.is_some());
            // An import introduces a name; if it is a module, the paths through it count.
            let named = imports.filter_map(|import| self.resolve(index, &import.path, 0));
            let used = (module.names.paths.iter()).filter_map(|path| self.resolve(index, path, 0));
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
        if own.names.items.contains(first) {
            return Some(Target::Item(module));
        }
        for import in &own.names.imports {
            if import.name.as_deref() == Some(first) && import.path != path {
                let path: Vec<String> = import.path.iter().chain(rest).cloned().collect();
                return self.resolve(module, &path, hops + 1);
            }
        }
        let globs = own
            .names
            .imports
            .iter()
            .filter(|import| import.name.is_none());
        globs
            .filter_map(|import| self.resolve(module, &import.path, hops + 1))
            .find_map(|target| match target {
                Target::Module(other) if other != module => self.find(other, path, hops + 1),
                _ => None,
            })
    }

    /// The shortest circle of files through each dependency, shortest first. Paths are relative to
    /// `root`.
    pub(super) fn circles(&self, root: &Path) -> Vec<String> {
        let name = |file: usize| relative(&self.paths[file], root);
        circles(&self.dependencies(), &name)
    }

    /// The same of the folders directly below the root file: a file there and the folder with its
    /// children count as one. The root file itself only passes names on.
    pub(super) fn circles_of_folders(&self, root: &Path) -> Vec<String> {
        let top = self.paths[0].parent().unwrap_or(Path::new(""));
        let folder_of = |path: &PathBuf| {
            let below = path.strip_prefix(top).unwrap_or(path);
            let first = below.iter().next().map(Path::new).unwrap_or(path);
            top.join(first.file_stem().unwrap_or(first.as_os_str()))
        };
        let folders: BTreeSet<PathBuf> = self.paths[1..].iter().map(folder_of).collect();
        let folders: Vec<PathBuf> = folders.into_iter().collect();
        let number_of = |file: usize| {
            let folder = folder_of(&self.paths[file]);
            folders.binary_search(&folder).ok().filter(|_| file > 0)
        };
        let mut arrows = vec![BTreeSet::new(); folders.len()];
        for (file, others) in self.dependencies().into_iter().enumerate() {
            let Some(from) = number_of(file) else {
                continue;
            };
            let others = others.into_iter().filter_map(number_of);
            arrows[from].extend(others.filter(|to| *to != from));
        }
        circles(&arrows, &|folder| relative(&folders[folder], root))
    }
}

fn relative(path: &Path, root: &Path) -> String {
    let path = path.strip_prefix(root).unwrap_or(path);
    path.to_string_lossy().replace('\\', "/")
}

/// The shortest circle through each dependency, shortest first, by the names of its parts.
fn circles(dependencies: &[BTreeSet<usize>], name: &dyn Fn(usize) -> String) -> Vec<String> {
    let mut circles = BTreeSet::new();
    for to in 0..dependencies.len() {
        let before = search(dependencies, to);
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
