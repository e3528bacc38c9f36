//! The pages of the book as Zensical reads them: links between documents become links between
//! pages, and links to other files of the source tree lead to the repository.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use super::files::files;
use super::links::{Link, is_external, links, resolve};
use super::sequence;
use crate::failure::Failure;
use crate::setup::at;

/// The documents outside `docs/` that are pages of the book, with their names there.
pub(super) const ELSEWHERE: [(&str, &str); 4] = [
    ("ARCHITECTURE.md", "architecture.md"),
    ("CONTRIBUTING.md", "contributing.md"),
    ("proto/README.md", "protocol.md"),
    ("tests/load/README.md", "load.md"),
];

/// Zensical's settings, with the order of the pages.
pub(super) const SETTINGS: &str = "docs/zensical.toml";

/// Where links to files that are not in the book lead.
const REPOSITORY: &str = env!("CARGO_PKG_REPOSITORY");

/// Copies `docs/` and the documents from elsewhere, with their links changed.
pub(super) fn gather(root: &Path, book: &Path) -> Result<(), Failure> {
    let elsewhere = ELSEWHERE.map(|(file, _)| file.to_owned());
    for file in files(root, "docs", "")?.into_iter().chain(elsewhere) {
        let Some(name) = page_of(&file) else {
            continue;
        };
        let to = book.join(&name);
        let folder = to.parent().expect("a page is in a folder");
        fs::create_dir_all(folder).map_err(|error| at(folder, &error))?;
        let from = root.join(&file);
        if file.ends_with(".md") {
            let text = fs::read_to_string(&from).map_err(|error| at(&from, &error))?;
            let text = sequence::draw(&relinked(root, &file, &text)?)
                .map_err(|reason| Failure::new(format!("{file}: {reason}")))?;
            fs::write(&to, text).map_err(|error| at(&to, &error))?;
        } else {
            fs::copy(&from, &to).map_err(|error| at(&from, &error))?;
        }
    }
    Ok(())
}

/// The name in the book of a file of the source tree, if it is there.
fn page_of(file: &str) -> Option<String> {
    let elsewhere = ELSEWHERE.iter().find(|(path, _)| *path == file);
    if let Some((_, name)) = elsewhere {
        return Some((*name).to_owned());
    }
    let name = file.strip_prefix("docs/")?;
    (!name.ends_with(".toml") || name.contains('/')).then(|| name.to_owned())
}

/// A document with links as they are in the book.
fn relinked(root: &Path, file: &str, text: &str) -> Result<String, Failure> {
    let mut result = String::with_capacity(text.len());
    let mut written = 0;
    for Link { range, target } in links(text) {
        let changed = in_book(root, file, target)
            .map_err(|reason| Failure::new(format!("{file}: the link to {target} {reason}")))?;
        result.push_str(&text[written..range.start]);
        result.push_str(&changed);
        written = range.end;
    }
    result.push_str(&text[written..]);
    Ok(result)
}

/// Where a link of a document leads in the book.
fn in_book(root: &Path, file: &str, target: &str) -> Result<String, String> {
    if is_external(target) || target.starts_with('#') {
        return Ok(target.to_owned());
    }
    let (path, anchor) = target
        .split_once('#')
        .map_or((target, None), |(path, anchor)| (path, Some(anchor)));
    let path = resolve(file, path).ok_or("leaves the repository")?;
    let anchor = anchor.map_or(String::new(), |anchor| format!("#{anchor}"));
    let depth = page_of(file).map_or(0, |page| page.matches('/').count());
    let up = "../".repeat(depth);
    if let Some(proto) = path.strip_prefix("proto/chefshat/v1") {
        let name = proto.trim_start_matches('/').strip_suffix(".proto");
        return Ok(format!(
            "{up}reference/{}.md{anchor}",
            name.unwrap_or("index")
        ));
    }
    let is_folder = root.join(&path).is_dir();
    if let Some(page) = page_of(&path).filter(|_| !is_folder) {
        return Ok(format!("{up}{page}{anchor}"));
    }
    let kind = match is_folder {
        true => "tree",
        false if root.join(&path).exists() => "blob",
        false => return Err("leads nowhere".into()),
    };
    Ok(format!("{REPOSITORY}/{kind}/main/{path}{anchor}"))
}

/// Checks that the order of the pages names exactly the pages that there are.
pub(super) fn check_order(settings: &str, found: &BTreeSet<String>) -> Result<(), Failure> {
    let quoted = settings.lines().filter(|line| !line.starts_with('#'));
    let quoted = quoted.flat_map(|line| line.split('"').skip(1).step_by(2));
    let named = quoted.filter(|text| text.ends_with(".md"));
    let named: BTreeSet<String> = named.map(str::to_owned).collect();
    let wrong: Vec<&String> = named.symmetric_difference(found).collect();
    if wrong.is_empty() {
        return Ok(());
    }
    Err(Failure::new(format!(
        "the pages and `nav` in {} differ by {wrong:?}: list each page there",
        SETTINGS
    )))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::places::Places;

    #[test]
    fn links_lead_to_pages_or_to_the_repository() {
        let root = Places::find().unwrap().root;
        for (file, target, expected) in [
            (
                "docs/a.md",
                "rules.md#71-rules",
                Ok("rules.md#71-rules".to_owned()),
            ),
            ("docs/a.md", "#here", Ok("#here".to_owned())),
            (
                "docs/a.md",
                "../proto/README.md#errors",
                Ok("protocol.md#errors".to_owned()),
            ),
            (
                "proto/README.md",
                "../docs/rules.md",
                Ok("rules.md".to_owned()),
            ),
            (
                "proto/README.md",
                "chefshat/v1/room.proto",
                Ok("reference/room.md".to_owned()),
            ),
            (
                "proto/README.md",
                "chefshat/v1",
                Ok("reference/index.md".to_owned()),
            ),
            (
                "docs/a.md",
                "../LICENSE",
                Ok(format!("{REPOSITORY}/blob/main/LICENSE")),
            ),
            (
                "docs/a.md",
                "../docker",
                Ok(format!("{REPOSITORY}/tree/main/docker")),
            ),
            (
                "docs/a.md",
                "images",
                Ok(format!("{REPOSITORY}/tree/main/docs/images")),
            ),
            (
                "docs/a.md",
                "../missing.rs",
                Err("leads nowhere".to_owned()),
            ),
            (
                "docs/a.md",
                "../../other",
                Err("leaves the repository".to_owned()),
            ),
        ] {
            assert_eq!(in_book(&root, file, target), expected, "{file}: {target}");
        }
    }

    #[test]
    fn every_page_has_a_place_in_the_order_and_no_other_is_named() {
        let found: BTreeSet<String> = ["a.md".to_owned(), "b/c.md".to_owned()].into();
        let settings = "nav = [\n  { \"A\" = \"a.md\" },\n  { \"C\" = \"b/c.md\" },\n]\n";
        check_order(settings, &found).unwrap();
        let missing = check_order("nav = [{ \"A\" = \"a.md\" }]", &found).unwrap_err();
        assert!(missing.to_string().contains("b/c.md"), "{missing}");
        let unknown = format!("{settings}\n{{ \"D\" = \"d.md\" }}");
        let unknown = check_order(&unknown, &found).unwrap_err();
        assert!(unknown.to_string().contains("[\"d.md\"]"), "{unknown}");
    }
}
