//! Links: found in Markdown and in HTML, and checked. Only files are read, never the network.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::ops::Range;
use std::path::{Path, PathBuf};

use super::files::files;
use crate::failure::Failure;
use crate::setup::at;

/// A link or picture in a Markdown text.
pub(super) struct Link<'a> {
    /// The bytes of its target.
    pub(super) range: Range<usize>,
    /// Where it leads.
    pub(super) target: &'a str,
}

/// Whether a target is not a file: a web address and the like.
pub(super) fn is_external(target: &str) -> bool {
    ["http://", "https://", "mailto:", "data:", "javascript:"]
        .iter()
        .any(|scheme| target.starts_with(scheme))
}

/// The inline links and pictures of a Markdown text, outside code.
pub(super) fn links(text: &str) -> Vec<Link<'_>> {
    let mut links = Vec::new();
    let mut start = 0;
    for (line, is_code) in lines(text) {
        let begins = start;
        start += line.len();
        if is_code {
            continue;
        }
        let line = without_code_spans(line);
        let mut from = 0;
        while let Some(found) = line[from..].find("](") {
            let target = from + found + 2;
            let Some(length) = line[target..].find([')', ' ', '\n']) else {
                break;
            };
            let range = begins + target..begins + target + length;
            links.push(Link {
                target: &text[range.clone()],
                range,
            });
            from = target + length;
        }
    }
    links
}

/// The anchors of a Markdown text, as GitHub and the book make them from headings.
fn anchors(text: &str) -> BTreeSet<String> {
    let mut seen: BTreeMap<String, usize> = BTreeMap::new();
    let mut anchors = BTreeSet::new();
    for (line, is_code) in lines(text) {
        if is_code || !line.starts_with('#') {
            continue;
        }
        let slug = slug(line.trim_start_matches('#').trim());
        let count = seen.entry(slug.clone()).or_default();
        anchors.insert(match *count {
            0 => slug,
            count => format!("{slug}-{count}"),
        });
        *count += 1;
    }
    anchors
}

/// The anchor of a heading.
fn slug(heading: &str) -> String {
    // Of a link, only its text is in the heading.
    let mut shown = String::new();
    let mut rest = heading;
    while let Some(at) = rest.find("](") {
        let end = rest[at..].find(')').map_or(rest.len(), |end| at + end + 1);
        shown.push_str(&rest[..at]);
        rest = &rest[end..];
    }
    shown.push_str(rest);
    let kept = shown.to_lowercase();
    let kept = kept
        .chars()
        .filter(|it| it.is_alphanumeric() || [' ', '-', '_'].contains(it));
    kept.map(|it| if it == ' ' { '-' } else { it }).collect()
}

/// The lines of a Markdown text, each with whether it is in or around a block of code.
fn lines(text: &str) -> impl Iterator<Item = (&str, bool)> {
    let mut fence: Option<&str> = None;
    text.split_inclusive('\n').map(move |line| {
        let bare = line.trim_start();
        let opening = ["```", "~~~"]
            .into_iter()
            .find(|mark| bare.starts_with(mark));
        match (fence, opening) {
            (None, Some(mark)) => {
                fence = Some(mark);
                (line, true)
            }
            (Some(mark), Some(closing)) if mark == closing => {
                fence = None;
                (line, true)
            }
            (inside, _) => (line, inside.is_some()),
        }
    })
}

/// A line of the same length with blanks in place of its code spans.
fn without_code_spans(line: &str) -> String {
    let mut inside = false;
    let masked = line.bytes().map(|byte| {
        inside ^= byte == b'`';
        if inside && byte != b'\n' { b' ' } else { byte }
    });
    String::from_utf8_lossy(&masked.collect::<Vec<u8>>()).into_owned()
}

/// The path in the source tree to which a relative link in a file leads; `None` if it leaves it.
pub(super) fn resolve(file: &str, target: &str) -> Option<String> {
    let mut parts: Vec<&str> = file.split('/').collect();
    parts.pop();
    for part in target.split('/') {
        match part {
            "" | "." => {}
            ".." => {
                parts.pop()?;
            }
            part => parts.push(part),
        }
    }
    Some(parts.join("/"))
}

/// Checks the relative links of all Markdown files of the source tree, with their anchors.
pub(super) fn of_documents(root: &Path) -> Result<(), Failure> {
    let texts = texts(root, ".md", |_| true)?;
    let anchors: BTreeMap<&str, BTreeSet<String>> = texts
        .iter()
        .map(|(file, text)| (file.as_str(), anchors(text)))
        .collect();
    let mut broken = Vec::new();
    let mut count = 0;
    for (file, text) in &texts {
        for Link { target, .. } in links(text) {
            if is_external(target) {
                continue;
            }
            count += 1;
            let (path, anchor) = target.split_once('#').unwrap_or((target, ""));
            let path = match path {
                "" => Some(file.clone()),
                path => resolve(file, path),
            };
            let is_there = path.is_some_and(|path| {
                let has_anchor = |found: &BTreeSet<String>| found.contains(anchor);
                root.join(&path).exists()
                    && (anchor.is_empty() || anchors.get(path.as_str()).is_some_and(has_anchor))
            });
            if !is_there {
                broken.push(format!("{file}: {target}"));
            }
        }
    }
    report(broken, count)
}

/// Checks every link and address of a built site: the files and the anchors exist.
pub(super) fn of_site(site: &Path) -> Result<(), Failure> {
    // The page for unknown addresses is shown at any depth.
    let pages = texts(site, ".html", |page| page != "404.html")?;
    let ids: BTreeMap<&str, BTreeSet<&str>> = pages
        .iter()
        .map(|(page, html)| (page.as_str(), attributes(html, "id").into_iter().collect()))
        .collect();
    let mut broken = Vec::new();
    let mut count = 0;
    for (page, html) in &pages {
        let targets = ["href", "src"].map(|name| attributes(html, name));
        for target in targets.concat() {
            if is_external(target) || target.starts_with("//") {
                continue;
            }
            count += 1;
            let (path, anchor) = target.split_once('#').unwrap_or((target, ""));
            let path = path.split('?').next().unwrap_or_default();
            let path = match path {
                "" => Some(page.clone()),
                path if path.starts_with('/') => resolve("", path),
                path => resolve(page, path),
            };
            let is_there = path.is_some_and(|mut path| {
                if site.join(&path).is_dir() {
                    path = PathBuf::from(path).join("index.html").display().to_string();
                }
                let has_anchor = |found: &BTreeSet<&str>| found.contains(anchor);
                site.join(&path).is_file()
                    && (anchor.is_empty() || ids.get(path.as_str()).is_some_and(has_anchor))
            });
            if !is_there {
                broken.push(format!("{page}: {target}"));
            }
        }
    }
    report(broken, count)
}

/// The texts of the wanted files of a folder and of those in it whose names end like this.
fn texts(
    folder: &Path,
    ending: &str,
    is_wanted: impl Fn(&str) -> bool,
) -> Result<BTreeMap<String, String>, Failure> {
    let mut texts = BTreeMap::new();
    for file in files(folder, "", ending)? {
        if is_wanted(&file) {
            let path = folder.join(&file);
            let text = fs::read_to_string(&path).map_err(|error| at(&path, &error))?;
            texts.insert(file, text);
        }
    }
    Ok(texts)
}

/// The values of an attribute of all elements of an HTML text.
fn attributes<'a>(html: &'a str, name: &str) -> Vec<&'a str> {
    let mut values = Vec::new();
    let mut rest = html;
    while let Some(at) = rest.find('<') {
        rest = &rest[at + 1..];
        let (element, after) = rest.split_once('>').unwrap_or((rest, ""));
        let mut parts = element.split_inclusive(char::is_whitespace);
        let tag = parts.next().unwrap_or_default();
        for quote in ['"', '\''] {
            let begin = format!(" {name}={quote}");
            if let Some((_, value)) = element[tag.len().saturating_sub(1)..].split_once(&begin) {
                values.extend(value.split(quote).next());
            }
        }
        // Minified HTML leaves out the quotes.
        let bare = format!("{name}=");
        values.extend(parts.filter_map(|part| {
            let value = part.trim().strip_prefix(&bare)?;
            (!value.starts_with(['"', '\''])).then_some(value)
        }));
        // What follows until its end is no HTML.
        let end = ["script", "style"].iter().find(|it| tag.trim() == **it);
        rest = match end.and_then(|tag| after.split_once(&format!("</{tag}>"))) {
            Some((_, after)) => after,
            None => after,
        };
    }
    values
}

fn report(broken: Vec<String>, count: usize) -> Result<(), Failure> {
    if !broken.is_empty() {
        let list = broken.join("\n    ");
        return Err(Failure::new(format!("broken links:\n    {list}\n")));
    }
    if count == 0 {
        return Err(Failure::new("no links were found"));
    }
    println!("    {count} links");
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn links_are_found_outside_code() {
        let text = "[a](b.md) `[c](d.md)` ![e](f.png \"g\")\n```sh\n[h](i.md)\n```\né [j](k.md#l), [m](#n)\n";
        let found: Vec<&str> = links(text).iter().map(|link| link.target).collect();
        assert_eq!(found, ["b.md", "f.png", "k.md#l", "#n"]);
    }

    #[test]
    fn anchors_are_those_of_github() {
        let text = "# A\n## What `it` does: 1/2\n### 3.4 The *exchange*\n## [A](b.md) & c\n# A\n```sh\n# no\n```\n";
        let expected = ["a", "a-1", "a--c", "what-it-does-12", "34-the-exchange"];
        let expected: BTreeSet<String> = expected.map(str::to_owned).into();
        // The brackets of a link are dropped with its target.
        assert_eq!(anchors(text), expected);
    }

    #[test]
    fn links_to_missing_files_and_anchors_are_broken() {
        let folder = std::env::temp_dir().join(format!("xtask-links-{}", std::process::id()));
        fs::create_dir_all(folder.join("in")).unwrap();
        let page = |name: &str, html: &str| fs::write(folder.join(name), html).unwrap();
        page(
            "a.html",
            "<h1 id=top>A</h1><a class=\"x\" href=\"in/b.html#here\">b</a><a href=#top>up</a>",
        );
        page(
            "in/b.html",
            "<p id='here'><a href=\"../a.html\">a</a><script>'<a href=\"no.html\">'</script>",
        );
        of_site(&folder).unwrap();
        for wrong in [
            "<a href=c.html>c</a>",
            "<a href='in/b.html#there'>b</a>",
            "<img src=\"d.png\">",
        ] {
            page("wrong.html", wrong);
            let failure = of_site(&folder).unwrap_err().to_string();
            assert!(failure.contains("wrong.html: "), "{failure}");
        }
        fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn paths_of_links_are_resolved() {
        assert_eq!(resolve("docs/a.md", "../b/c.rs").as_deref(), Some("b/c.rs"));
        assert_eq!(resolve("docs/a.md", "./x/").as_deref(), Some("docs/x"));
        assert_eq!(resolve("a.md", "../b.md"), None);
    }
}
