//! `cargo xtask book`: builds the book of `docs/` into `target/book`, and fails for every broken
//! link.
//!
//! The pages are those of `docs/`, a few documents of other folders ([`pages::ELSEWHERE`]) and the
//! reference of the protocol ([`reference`]). They are gathered in a folder of their own
//! ([`pages`]), from which Zensical builds the book. [`links`] checks the documents of the source
//! tree and, independently of Zensical, what was built.

mod files;
mod links;
mod pages;
mod reference;
mod sequence;

use std::fs;
use std::path::Path;
use std::process::Command;

use crate::command::run as run_program;
use crate::failure::Failure;
use crate::places::Places;
use crate::setup::{self, at};
use crate::steps::Steps;

/// The Markdown files of the source tree.
#[cfg(test)]
pub(crate) fn documents(root: &Path) -> Result<Vec<String>, Failure> {
    files::files(root, "", ".md")
}

/// Builds and checks the book.
pub(crate) fn run(places: &Places, steps: &mut Steps) -> Result<(), Failure> {
    steps.run("set up checkers", || setup::tools(places))?;
    check_and_build(places, steps)
}

/// Builds and checks the book with checkers that are set up.
pub(crate) fn check_and_build(places: &Places, steps: &mut Steps) -> Result<(), Failure> {
    steps.run("links of documents", || links::of_documents(&places.root))?;
    let folder = places.own.join("book");
    steps.run("gather the book", || gather(places, &folder))?;
    let mut zensical = Command::new(places.tools().join("bin/zensical"));
    zensical.args(["build", "--clean", "--strict"]);
    steps.program("build the book", zensical.current_dir(&folder))?;
    steps.run("links of the book", || links::of_site(&folder.join("site")))?;
    steps.run("put the book in place", || {
        let book = places.book();
        let _ = fs::remove_dir_all(&book);
        fs::rename(folder.join("site"), &book).map_err(|error| at(&book, &error))?;
        println!("    {}/index.html", book.display());
        Ok(())
    })
}

/// Makes the folder that Zensical reads: settings, pages and pictures.
fn gather(places: &Places, folder: &Path) -> Result<(), Failure> {
    let docs = folder.join("docs");
    let _ = fs::remove_dir_all(folder);
    fs::create_dir_all(&docs).map_err(|error| at(&docs, &error))?;
    let settings = places.root.join(pages::SETTINGS);
    fs::copy(&settings, folder.join("zensical.toml")).map_err(|error| at(&settings, &error))?;
    pages::gather(&places.root, &docs)?;

    let image = folder.join("protocol.json");
    let mut buf = Command::new(places.tools().join("bin/buf"));
    buf.args(["build", "proto", "--output"]).arg(&image);
    run_program(buf.current_dir(&places.root))?;
    let image = fs::read_to_string(&image).map_err(|error| at(&image, &error))?;
    reference::write(&image, &docs.join("reference"))?;

    let settings = fs::read_to_string(&settings).map_err(|error| at(&settings, &error))?;
    let found = files::files(&docs, "", ".md")?.into_iter().collect();
    pages::check_order(&settings, &found)
}
