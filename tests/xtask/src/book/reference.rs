//! The reference of the protocol: a page for each `.proto` file, from its definitions and comments
//! as `buf build` writes them in JSON.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use serde_json::Value;

use crate::failure::Failure;
use crate::setup::at;

/// The files that are described.
const FOLDER: &str = "chefshat/v1/";

/// What full names of its types begin with.
const PACKAGE: &str = ".chefshat.v1.";

/// The numbers of fields in the descriptors of protobuf, of which paths of comments are made.
mod number {
    pub(super) const PACKAGE: u64 = 2;
    pub(super) const MESSAGES: u64 = 4;
    pub(super) const ENUMS: u64 = 5;
    pub(super) const SERVICES: u64 = 6;
    pub(super) const FIELDS: u64 = 2;
    pub(super) const NESTED_MESSAGES: u64 = 3;
    pub(super) const NESTED_ENUMS: u64 = 4;
    pub(super) const ONEOFS: u64 = 8;
    pub(super) const VALUES: u64 = 2;
    pub(super) const METHODS: u64 = 2;
}

/// Writes the pages into a folder.
pub(super) fn write(image: &str, folder: &Path) -> Result<(), Failure> {
    fs::create_dir_all(folder).map_err(|error| at(folder, &error))?;
    for (name, text) in pages(image)? {
        let path = folder.join(format!("{name}.md"));
        fs::write(&path, text).map_err(|error| at(&path, &error))?;
    }
    Ok(())
}

/// The pages by their names without endings.
fn pages(image: &str) -> Result<BTreeMap<String, String>, Failure> {
    let image: Value = serde_json::from_str(image)
        .map_err(|error| Failure::new(format!("the protocol as JSON: {error}")))?;
    let files = list(&image, "file").iter();
    let mut files: Vec<File<'_>> = files.filter_map(File::new).collect();
    if files.is_empty() {
        return Err(Failure::new(format!("no files in {FOLDER}")));
    }
    files.sort_by_key(|file| file.name);
    let mut homes = BTreeMap::new();
    for file in &files {
        for (message, _) in file.messages() {
            homes.insert(message, file.name);
        }
        for (name, _, _) in file.enums() {
            homes.insert(name, file.name);
        }
    }
    let mut pages = BTreeMap::new();
    pages.insert("index".to_owned(), index(&files));
    for file in &files {
        let text = Page {
            file,
            homes: &homes,
        }
        .text();
        pages.insert(file.name.to_owned(), text);
    }
    Ok(pages)
}

/// The first page: what each file and each call is for.
fn index(files: &[File<'_>]) -> String {
    let mut text = "# Reference of the protocol\n\nEvery service, message and value of `chefshat.v1`, generated from the \
        `.proto` files. [The protocol](../protocol.md) explains how they work together.\n\n| file | content |\n|---|---|\n"
        .to_owned();
    let mut calls = "\n## Calls\n\n| call | what it does |\n|---|---|\n".to_owned();
    for file in files {
        let about = cell(first_sentence(&file.comment(&[number::PACKAGE])));
        writeln!(text, "| [{0}]({0}.md) | {about} |", file.name).expect("a String grows");
        for (place, service) in (0..).zip(list(file.json, "service")) {
            for (index, method) in (0..).zip(list(service, "method")) {
                let (service, method) = (name(service), name(method));
                let path = [number::SERVICES, place, number::METHODS, index];
                let about = cell(first_sentence(&file.comment(&path)));
                writeln!(
                    calls,
                    "| [{service}.{method}]({}.md#{service}.{method}) | {about} |",
                    file.name
                )
                .expect("a String grows");
            }
        }
    }
    text + &calls
}

/// A `.proto` file.
struct File<'a> {
    /// Without folder and ending.
    name: &'a str,
    json: &'a Value,
    comments: BTreeMap<Vec<u64>, &'a str>,
}

impl<'a> File<'a> {
    /// `None` if the file is not described.
    fn new(json: &'a Value) -> Option<Self> {
        let name = name(json).strip_prefix(FOLDER)?.strip_suffix(".proto")?;
        let comments = list(&json["sourceCodeInfo"], "location").iter();
        let comments = comments.filter_map(|location| {
            let path = list(location, "path").iter().filter_map(Value::as_u64);
            Some((path.collect(), location["leadingComments"].as_str()?))
        });
        let comments = comments.collect();
        Some(Self {
            name,
            json,
            comments,
        })
    }

    fn comment(&self, path: &[u64]) -> String {
        let comment = self.comments.get(path).copied().unwrap_or_default();
        let lines = comment
            .lines()
            .map(|line| line.strip_prefix(' ').unwrap_or(line));
        lines
            .collect::<Vec<&str>>()
            .join("\n")
            .trim_end()
            .to_owned()
    }

    /// All messages in order, nested ones after their own, with their paths. Entries of maps are
    /// not among them.
    fn messages(&self) -> Vec<(String, Definition<'a>)> {
        fn add<'a>(
            json: &'a Value,
            before: &str,
            path: Vec<u64>,
            messages: &mut Vec<(String, Definition<'a>)>,
        ) {
            if json["options"]["mapEntry"] == true {
                return;
            }
            let full = format!("{before}{}", name(json));
            messages.push((
                full.clone(),
                Definition {
                    json,
                    path: path.clone(),
                },
            ));
            for (index, nested) in (0..).zip(list(json, "nestedType")) {
                let path = [&path[..], &[number::NESTED_MESSAGES, index]].concat();
                add(nested, &format!("{full}."), path, messages);
            }
        }
        let mut messages = Vec::new();
        for (index, json) in (0..).zip(list(self.json, "messageType")) {
            add(json, "", vec![number::MESSAGES, index], &mut messages);
        }
        messages
    }

    /// All enums, with their paths.
    fn enums(&self) -> Vec<(String, &'a Value, Vec<u64>)> {
        let own = (0..).zip(list(self.json, "enumType"));
        let mut enums: Vec<_> = own
            .map(|(index, json)| (name(json).to_owned(), json, vec![number::ENUMS, index]))
            .collect();
        for (message, Definition { json, path }) in self.messages() {
            for (index, nested) in (0..).zip(list(json, "enumType")) {
                let path = [&path[..], &[number::NESTED_ENUMS, index]].concat();
                enums.push((format!("{message}.{}", name(nested)), nested, path));
            }
        }
        enums
    }
}

/// A message and where it is in its file.
struct Definition<'a> {
    json: &'a Value,
    path: Vec<u64>,
}

/// The page of a file.
struct Page<'a> {
    file: &'a File<'a>,
    /// The files of all messages and enums.
    homes: &'a BTreeMap<String, &'a str>,
}

impl Page<'_> {
    fn text(&self) -> String {
        let File {
            name: page, json, ..
        } = self.file;
        let mut parts = vec![format!("# {page}.proto")];
        parts.push(self.prose(&[number::PACKAGE]));
        for (index, service) in (0..).zip(list(json, "service")) {
            self.service(service, &[number::SERVICES, index], &mut parts);
        }
        for (message, definition) in self.file.messages() {
            self.message(&message, &definition, &mut parts);
        }
        for (name, json, path) in self.file.enums() {
            parts.push(format!("## {name} {{#{name}}}"));
            parts.push(self.prose(&path));
            let mut table = "| value | number | meaning |\n|---|---|---|\n".to_owned();
            for (index, value) in (0..).zip(list(json, "value")) {
                let path = [&path[..], &[number::VALUES, index]].concat();
                let about = cell(&self.prose(&path));
                let number = value["number"].as_i64().unwrap_or(0);
                let value = self::name(value);
                writeln!(table, "| `{value}` | {number} | {about} |").expect("a String grows");
            }
            parts.push(table);
        }
        parts.retain(|part| !part.is_empty());
        parts.join("\n\n") + "\n"
    }

    fn service(&self, service: &Value, path: &[u64], parts: &mut Vec<String>) {
        let service_name = name(service);
        parts.push(format!("## {service_name} {{#{service_name}}}"));
        parts.push(self.prose(path));
        for (index, method) in (0..).zip(list(service, "method")) {
            let stream = |streams: &str, of: &str| {
                let kind = method[of].as_str().unwrap_or_default();
                let stream = if method[streams] == true {
                    "stream of "
                } else {
                    ""
                };
                format!("{stream}{}", self.link(kind))
            };
            let method_name = name(method);
            parts.push(format!(
                "### {method_name} {{#{service_name}.{method_name}}}"
            ));
            parts.push(format!(
                "{} → {}",
                stream("clientStreaming", "inputType"),
                stream("serverStreaming", "outputType")
            ));
            parts.push(self.prose(&[path, &[number::METHODS, index]].concat()));
        }
    }

    fn message(
        &self,
        name: &str,
        Definition { json, path }: &Definition<'_>,
        parts: &mut Vec<String>,
    ) {
        parts.push(format!("## {name} {{#{name}}}"));
        parts.push(self.prose(path));
        let fields = list(json, "field");
        if fields.is_empty() {
            return;
        }
        let mut table = "| field | number | type | meaning |\n|---|---|---|---|\n".to_owned();
        for (index, field) in (0..).zip(fields) {
            let choice = match field["proto3Optional"] == true {
                true => None,
                false => field["oneofIndex"].as_u64(),
            };
            let mut about =
                cell(&self.prose(&[path.as_slice(), &[number::FIELDS, index]].concat()));
            if let Some(choice) = choice {
                let choice = self::name(&list(json, "oneofDecl")[choice as usize]);
                write!(about, " *One of `{choice}`.*").expect("a String grows");
            }
            let number = &field["number"];
            let kind = self.kind(json, field);
            writeln!(
                table,
                "| `{}` | {number} | {kind} | {about} |",
                self::name(field)
            )
            .expect("a String grows");
        }
        parts.push(table);
        for (index, choice) in (0..).zip(list(json, "oneofDecl")) {
            let about = self.prose(&[path.as_slice(), &[number::ONEOFS, index]].concat());
            if !about.is_empty() {
                parts.push(format!("`{}`: {about}", self::name(choice)));
            }
        }
    }

    /// The type of a field.
    fn kind(&self, message: &Value, field: &Value) -> String {
        let full = field["typeName"].as_str();
        let entry = list(message, "nestedType").iter().find(|nested| {
            let is_type = full.is_some_and(|full| full.ends_with(&format!(".{}", name(nested))));
            nested["options"]["mapEntry"] == true && is_type
        });
        if let Some(entry) = entry {
            let of = |index: usize| self.kind(entry, &list(entry, "field")[index]);
            return format!("map of {} to {}", of(0), of(1));
        }
        let scalar = || {
            let kind = field["type"].as_str().unwrap_or_default();
            kind.trim_start_matches("TYPE_").to_lowercase()
        };
        let kind = full.map_or_else(scalar, |full| self.link(full));
        match field["label"].as_str() {
            Some("LABEL_REPEATED") => format!("repeated {kind}"),
            _ if field["proto3Optional"] == true => format!("optional {kind}"),
            _ => kind,
        }
    }

    /// A type by its full name, with a link if it is described.
    fn link(&self, full: &str) -> String {
        let name = full
            .strip_prefix(PACKAGE)
            .unwrap_or(full.trim_start_matches('.'));
        match self.homes.get(name) {
            Some(home) => format!("[{name}]({home}.md#{name})"),
            None => name.to_owned(),
        }
    }

    /// A comment as Markdown: signs that Markdown would read are escaped, and names of types in
    /// code spans lead to them.
    fn prose(&self, path: &[u64]) -> String {
        let comment = self.file.comment(path);
        let mut text = String::new();
        for (index, part) in comment.split('`').enumerate() {
            if index % 2 == 0 {
                // Stars around a word emphasise it, as in Markdown; those between numbers do not.
                text.push_str(
                    &part
                        .replace('<', "&lt;")
                        .replace(" * ", " \\* ")
                        .replace('[', "\\["),
                );
            } else {
                match self.homes.get(part) {
                    Some(home) => {
                        write!(text, "[`{part}`]({home}.md#{part})").expect("a String grows")
                    }
                    None => write!(text, "`{part}`").expect("a String grows"),
                }
            }
        }
        text
    }
}

/// A text as the cell of a table.
fn cell(text: &str) -> String {
    text.replace('\n', " ").replace('|', "\\|")
}

fn first_sentence(text: &str) -> &str {
    let end = [". ", ".\n"].iter().filter_map(|end| text.find(end)).min();
    end.map_or(text, |end| &text[..end + 1])
}

fn name(json: &Value) -> &str {
    json["name"].as_str().unwrap_or_default()
}

/// The elements of a list, of which an empty one may be missing.
fn list<'a>(json: &'a Value, name: &str) -> &'a [Value] {
    json[name].as_array().map_or(&[], Vec::as_slice)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_has_calls_fields_values_and_their_comments() {
        let image = r#"{"file": [{
            "name": "chefshat/v1/menu.proto",
            "service": [{"name": "MenuService", "method": [
                {"name": "Order", "inputType": ".chefshat.v1.Dish", "outputType": ".chefshat.v1.Dish", "serverStreaming": true}]}],
            "messageType": [{"name": "Dish", "field": [
                {"name": "price", "number": 1, "label": "LABEL_OPTIONAL", "type": "TYPE_UINT32", "oneofIndex": 1, "proto3Optional": true},
                {"name": "kind", "number": 2, "label": "LABEL_REPEATED", "type": "TYPE_ENUM", "typeName": ".chefshat.v1.Kind"},
                {"name": "extra", "number": 4, "label": "LABEL_REPEATED", "type": "TYPE_MESSAGE", "typeName": ".chefshat.v1.Dish.ExtraEntry"},
                {"name": "note", "number": 5, "label": "LABEL_OPTIONAL", "type": "TYPE_STRING", "oneofIndex": 0}],
              "nestedType": [{"name": "ExtraEntry", "options": {"mapEntry": true}, "field": [
                {"name": "key", "type": "TYPE_STRING"}, {"name": "value", "type": "TYPE_UINT64"}]}],
              "oneofDecl": [{"name": "said"}, {"name": "_price"}]}],
            "enumType": [{"name": "Kind", "value": [{"name": "KIND_UNSPECIFIED"}, {"name": "KIND_PIZZA", "number": 1}]}],
            "sourceCodeInfo": {"location": [
                {"path": [2], "leadingComments": " What is served. See below.\n"},
                {"path": [6, 0, 2, 0], "leadingComments": " Brings a\n `Dish`.\n"},
                {"path": [4, 0, 2, 0], "leadingComments": " Cents, 1 < a | b.\n"},
                {"path": [5, 0, 2, 1], "leadingComments": " Round.\n"}]}
        }, {"name": "google/protobuf/timestamp.proto"}]}"#;
        let pages = pages(image).unwrap();
        assert_eq!(pages.len(), 2);
        let page = &pages["menu"];
        for expected in [
            "# menu.proto\n\nWhat is served. See below.\n\n## MenuService {#MenuService}\n\n### Order {#MenuService.Order}\n\n\
             [Dish](menu.md#Dish) → stream of [Dish](menu.md#Dish)\n\nBrings a\n[`Dish`](menu.md#Dish).\n",
            "| `price` | 1 | optional uint32 | Cents, 1 &lt; a \\| b. |\n",
            "| `kind` | 2 | repeated [Kind](menu.md#Kind) |  |\n",
            "| `extra` | 4 | map of string to uint64 |  |\n",
            "| `note` | 5 | string |  *One of `said`.* |\n",
            "## Kind {#Kind}\n\n| value | number | meaning |\n|---|---|---|\n| `KIND_UNSPECIFIED` | 0 |  |\n| `KIND_PIZZA` | 1 | Round. |\n",
        ] {
            assert!(page.contains(expected), "{expected}\nis not in\n{page}");
        }
        assert!(!page.contains("ExtraEntry"));
        assert!(pages["index"].contains("| [menu](menu.md) | What is served. |\n"));
        assert!(
            pages["index"].contains(
                "| [MenuService.Order](menu.md#MenuService.Order) | Brings a `Dish`. |\n"
            )
        );
    }
}
