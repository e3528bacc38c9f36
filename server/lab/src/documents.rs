//! Tests that every `chefshat` command line in the documents of the project is one that this
//! program accepts, so that no option is renamed without them.

use std::fs;
use std::path::{Path, PathBuf};

use clap::Parser as _;
use clap::error::{ContextKind, ContextValue, ErrorKind};

use chefshat_cli::program::CommandLine;

use crate::Command;

/// The Markdown files whose command lines are checked.
fn documents() -> Vec<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let mut documents: Vec<PathBuf> = [
        "README.md",
        "CONTRIBUTING.md",
        "ARCHITECTURE.md",
        "proto/README.md",
        "client-rs/README.md",
        "clients/python/README.md",
        "clients/python/server/README.md",
        "clients/node/README.md",
        "clients/cpp/README.md",
        "clients/paper/README.md",
        "clients/robot/README.md",
        "clients/web/README.md",
        "docker/archive/README.md",
    ]
    .map(|path| root.join(path))
    .into();
    let docs = fs::read_dir(root.join("docs")).unwrap();
    documents.extend(docs.map(|entry| entry.unwrap().path()));
    documents.retain(|path| path.extension().is_some_and(|ending| ending == "md"));
    documents.sort();
    documents
}

/// The texts in the blocks of shell commands of a document, and its code spans in prose.
fn code(text: &str) -> (Vec<String>, Vec<&str>) {
    let (mut blocks, mut spans) = (Vec::new(), Vec::new());
    for (index, part) in text.split("\n```").enumerate() {
        if index % 2 == 1 {
            if let Some(commands) = part.strip_prefix("sh\n") {
                blocks.push(commands.to_owned());
            }
            continue;
        }
        spans.extend(part.split('`').skip(1).step_by(2));
    }
    (blocks, spans)
}

/// The simple commands in a text for a shell, as words. Comments, redirections and what only
/// connects commands are left out; quotes are resolved, variables are not.
fn commands(text: &str) -> Vec<Vec<String>> {
    let (mut commands, mut words, mut word) = (Vec::new(), Vec::new(), None::<String>);
    let text = text.replace("\\\n", " ");
    let mut signs = text.chars().peekable();
    while let Some(sign) = signs.next() {
        match sign {
            '\'' | '"' => {
                let quoted = signs.by_ref().take_while(|next| *next != sign);
                word.get_or_insert_default().extend(quoted);
            }
            '#' if word.is_none() => while signs.next_if(|next| *next != '\n').is_some() {},
            ' ' => words.extend(word.take()),
            '\n' | '|' | '&' | ';' | '(' | ')' => {
                words.extend(word.take());
                commands.push(std::mem::take(&mut words));
            }
            sign => word.get_or_insert_default().push(sign),
        }
    }
    words.extend(word);
    commands.push(words);
    for words in &mut commands {
        while let Some(at) = words
            .iter()
            .position(|word| [">", "<", "2>"].contains(&word.as_str()))
        {
            words.drain(at..words.len().min(at + 2));
        }
    }
    commands.retain(|words| !words.is_empty());
    commands
}

/// The arguments of this program, if the words start it.
fn arguments(words: &[String]) -> Option<&[String]> {
    let starts = |prefix: &[&str]| {
        let begins = words.len() >= prefix.len() && words.iter().zip(prefix).all(|(a, b)| a == b);
        begins.then(|| &words[prefix.len()..])
    };
    let direct = [
        "chefshat",
        "./chefshat",
        "target/debug/chefshat",
        "target/release/chefshat",
    ];
    if let Some(rest) = direct.iter().find_map(|program| starts(&[program])) {
        return Some(rest);
    }
    if let Some(rest) =
        starts(&["cargo", "run", "--"]).or_else(|| starts(&["cargo", "run", "--release", "--"]))
    {
        return Some(rest);
    }
    if let Some(rest) = starts(&["sudo", "-u", "chefshat"]).or_else(|| starts(&["do"])) {
        return arguments(rest);
    }
    let (first, rest) = words.split_first()?;
    let is_variable = first.split_once('=').is_some_and(|(name, _)| {
        name.chars()
            .all(|sign| sign.is_ascii_uppercase() || sign == '_')
    });
    is_variable.then(|| arguments(rest)).flatten()
}

/// A value for a word that stands for one the program checks; any other word as it is.
fn value(word: &str) -> String {
    match word {
        "N" | "S" | "NUMBER" | "GAME" => "2".to_owned(),
        word => word.replace("ed25519:4b1f...", &format!("ed25519:{:064x}", 1)),
    }
}

/// Why the program would refuse these arguments.
fn refusal(arguments: &[String], is_complete: bool) -> Option<String> {
    let arguments = arguments.iter().map(|word| value(word));
    let line = ["chefshat".to_owned()].into_iter().chain(arguments);
    let error = CommandLine::<Command>::try_parse_from(line).err()?;
    let is_help = matches!(
        error.kind(),
        ErrorKind::DisplayHelp | ErrorKind::DisplayVersion
    );
    // Prose names commands without all that they need.
    let has_no_value = error.kind() == ErrorKind::InvalidValue
        && error.get(ContextKind::InvalidValue) == Some(&ContextValue::String(String::new()));
    let is_unfinished = has_no_value
        || matches!(
            error.kind(),
            ErrorKind::MissingRequiredArgument
                | ErrorKind::MissingSubcommand
                | ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand
        );
    (!is_help && (is_complete || !is_unfinished)).then(|| error.to_string())
}

#[test]
fn every_command_in_the_documents_is_accepted() {
    let (mut checked, mut refused) = (0, Vec::new());
    for document in documents() {
        let text = fs::read_to_string(&document).unwrap();
        let (blocks, spans) = code(&text);
        let complete = blocks.iter().map(|block| (block.as_str(), true));
        let named = spans.iter().map(|span| (*span, false));
        for (text, is_complete) in complete.chain(named) {
            for words in commands(text) {
                // The first word after the program is a command, or the text is not a command line.
                let Some(arguments) =
                    arguments(&words).filter(|it| it.first().is_none_or(|it| it != "GAME-ID"))
                else {
                    continue;
                };
                checked += 1;
                if let Some(reason) = refusal(arguments, is_complete) {
                    let page = document.file_name().unwrap_or_default().to_string_lossy();
                    refused.push(format!("{page}: {}\n{reason}", words.join(" ")));
                }
            }
        }
    }
    assert!(checked > 150, "only {checked} commands were found");
    assert!(refused.is_empty(), "{}", refused.join("\n"));
}

#[test]
fn commands_are_found_as_a_shell_finds_them() {
    for (text, expected) in [
        ("chefshat verify   # all of them", &["verify"][..]),
        (
            "export TOKEN=$(chefshat token create --role admin)",
            &["token", "create", "--role", "admin"],
        ),
        ("chefshat config > a.toml | tee b", &["config"]),
        (
            "CHEFSHAT_X=1 target/release/chefshat play \\\n  --local",
            &["play", "--local"],
        ),
        ("sudo -u chefshat chefshat key show", &["key", "show"]),
        (
            "cargo run --release -- table report 'Ada: 7 7'",
            &["table", "report", "Ada: 7 7"],
        ),
        ("chefshat-robot print", &[]),
    ] {
        let found = commands(text);
        let found: Vec<&[String]> = found.iter().filter_map(|words| arguments(words)).collect();
        assert_eq!(found.concat(), expected, "{text}");
    }
    assert!(refusal(&["serve".into(), "--no-such-option".into()], false).is_some());
    assert!(refusal(&["room".into()], true).is_some());
    assert!(refusal(&["room".into()], false).is_none());
}
