//! The configuration of a server: flags, environment variables, a TOML file and defaults, in this
//! order of precedence; and `chefshat config`, which prints the result.
//!
//! A setting is declared once, as a field of `serve::Settings` with a long flag and an environment
//! variable: its key in the file is the name of the flag. Values of the file replace the defaults
//! of the command line before it is parsed, so relations between settings (`requires`,
//! `conflicts_with`) are checked where the settings are used, not by clap.

use std::ffi::OsStr;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::builder::Resettable;
use clap::parser::ValueSource;
use clap::{Arg, ArgAction, ArgMatches, Args, Command, Parser};
use serde_json::{Value, json};
use toml::de::DeValue;

use crate::error::{CommandError, say};
use crate::help::grouped;
use crate::{serve, toml_file};

/// The setting that names the file, which cannot be in the file.
const CONFIG: &str = "config";
/// The commands that have the settings.
const COMMANDS: [&str; 2] = ["serve", "config"];
/// Most bytes of a configuration file.
const MAX_FILE_BYTES: u64 = 1024 * 1024;
/// How similar two keys are if one may be a misspelling of the other, 0 to 1.
const SIMILAR: f64 = 0.7;

/// Print the configuration of `chefshat serve` with the same flags, environment and file: as TOML
/// that `--config` reads, with the source of each value.
#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  chefshat config --max-rooms 100 > chefshat.toml\n  chefshat serve --config chefshat.toml"
)]
pub(super) struct ConfigCommand {
    #[command(flatten)]
    settings: serve::Settings,
    /// Print the configuration as JSON.
    #[arg(long)]
    json: bool,
}

/// How this process was started.
#[derive(Debug)]
pub struct Invocation {
    /// The whole command line.
    command: Command,
    /// The matches of the command that runs.
    matches: ArgMatches,
    file: Option<SettingsFile>,
}

impl Invocation {
    /// Parses the arguments of this process, and the configuration file they name. Ends the process
    /// if the arguments are wrong or ask for help.
    ///
    /// # Errors
    /// The file is unreadable, or has a wrong key or value.
    pub(crate) fn of_process<C: Parser>() -> Result<(C, Self), CommandError> {
        let command = || without_empty_variables(C::command());
        let mut matches = grouped(command()).get_matches();
        let path = match matches.subcommand() {
            Some((name, sub)) if COMMANDS.contains(&name) => sub.get_one::<PathBuf>(CONFIG),
            _ => None,
        };
        let file = match path {
            Some(path) => Some(SettingsFile::read(path, &settings(C::command()))?),
            None => None,
        };
        if let Some(file) = &file {
            matches = grouped(file.as_defaults(command())).get_matches();
        }
        let cli = C::from_arg_matches(&matches)
            .unwrap_or_else(|error| error.format(&mut C::command()).exit());
        let (_, matches) = matches.remove_subcommand().expect("there is a command");
        let command = C::command();
        Ok((
            cli,
            Self {
                command,
                matches,
                file,
            },
        ))
    }

    /// The definition of the whole command line.
    #[must_use]
    pub fn command(&self) -> Command {
        self.command.clone()
    }
}

/// A command line for which a variable of the environment that is empty is not set: files of services
/// and containers cannot leave one out.
fn without_empty_variables(command: Command) -> Command {
    let is_empty = |name: &OsStr| std::env::var_os(name).is_some_and(|value| value.is_empty());
    let command = command.mut_args(|argument| match argument.get_env().is_some_and(is_empty) {
        true => argument.env(Resettable::Reset),
        false => argument,
    });
    command.mut_subcommands(without_empty_variables)
}

impl ConfigCommand {
    /// Prints the settings of this process.
    pub(super) fn run(&self, invocation: &Invocation) -> Result<ExitCode, CommandError> {
        let effective: Vec<Effective> = settings(invocation.command())
            .into_iter()
            .map(|argument| Effective::of(argument, &invocation.matches, invocation.file.as_ref()))
            .collect();
        if self.json {
            say(as_json(&effective))?;
        } else {
            say(as_toml(&effective).trim_end())?;
        }
        Ok(ExitCode::SUCCESS)
    }
}

/// The settings of `chefshat serve`, in the order of its help: its arguments that have an
/// environment variable.
fn settings(mut command: Command) -> Vec<Arg> {
    command.build();
    let serve = (command.find_subcommand(COMMANDS[0])).expect("the command that has the settings");
    (serve.get_arguments())
        .filter(|argument| argument.get_env().is_some() && argument.get_id() != CONFIG)
        .cloned()
        .collect()
}

/// The key of a setting in the file.
fn key(argument: &Arg) -> &str {
    argument.get_long().expect("a setting has a long flag")
}

fn is_switch(argument: &Arg) -> bool {
    matches!(argument.get_action(), ArgAction::SetTrue)
}

fn is_list(argument: &Arg) -> bool {
    argument.get_value_delimiter().is_some() || matches!(argument.get_action(), ArgAction::Append)
}

/// A setting of a file, with the values as they would be given to its flag.
type Entry = (Arg, Vec<String>);

/// The values of a configuration file, checked.
#[derive(Debug)]
struct SettingsFile {
    path: PathBuf,
    values: Vec<Entry>,
}

impl SettingsFile {
    fn read(path: &Path, settings: &[Arg]) -> Result<Self, CommandError> {
        let unreadable = |reason: String| format!("cannot read {}: {reason}", path.display());
        let size = std::fs::metadata(path).map_err(|error| unreadable(error.to_string()))?;
        if size.len() > MAX_FILE_BYTES {
            return Err(unreadable("it is too large for a configuration file".to_owned()).into());
        }
        let text = std::fs::read_to_string(path).map_err(|error| unreadable(error.to_string()))?;
        let values = parse_file(&text, settings)
            .map_err(|(line, reason)| format!("{}:{line}: {reason}", path.display()))?;
        Ok(Self {
            path: path.to_owned(),
            values,
        })
    }

    /// Makes the values of the file the defaults of the command line.
    fn as_defaults(&self, mut command: Command) -> Command {
        for (argument, values) in &self.values {
            let id = argument.get_id();
            let set = |argument: Arg| argument.default_values(values);
            let is_global = command.get_arguments().any(|other| other.get_id() == id);
            command = match is_global {
                true => command.mut_arg(id, set),
                false => COMMANDS.into_iter().fold(command, |command, name| {
                    command.mut_subcommand(name, |sub| sub.mut_arg(id, set))
                }),
            };
        }
        command
    }

    fn sets(&self, argument: &Arg) -> bool {
        (self.values.iter()).any(|(set, _)| set.get_id() == argument.get_id())
    }
}

/// The values of a file. An error has its line, from 1.
fn parse_file(text: &str, settings: &[Arg]) -> Result<Vec<Entry>, (usize, String)> {
    let table = toml_file::parse(text)?;
    let mut entries: Vec<_> = table.into_inner().into_iter().collect();
    entries.sort_by_key(|(key, _)| key.span().start);
    let read = |(name, value): (
        toml::Spanned<toml::de::DeString<'_>>,
        toml::Spanned<DeValue<'_>>,
    )| {
        let at = toml_file::line(text, name.span().start);
        let name = name.into_inner();
        let argument = (settings.iter().find(|setting| key(setting) == name))
            .ok_or_else(|| (at, unknown_key(&name, settings)))?;
        let values = flag_values(argument, value.get_ref())
            .map_err(|reason| (at, format!("{name}: {reason}")))?;
        Ok((argument.clone(), values))
    };
    entries.into_iter().map(read).collect()
}

fn unknown_key(name: &str, settings: &[Arg]) -> String {
    let nearest = (settings.iter().map(key))
        .map(|key| (strsim::jaro_winkler(name, key), key))
        .filter(|(similarity, _)| *similarity > SIMILAR)
        .max_by(|a, b| a.0.total_cmp(&b.0));
    let hint = match nearest {
        Some((_, key)) => format!("did you mean {key}?"),
        None => "`chefshat config` prints all settings".to_owned(),
    };
    format!("unknown setting {name:?}; {hint}")
}

/// A value of the file as the values of its flag, checked by the parser of the flag.
fn flag_values(argument: &Arg, value: &DeValue<'_>) -> Result<Vec<String>, String> {
    if is_switch(argument) {
        let set = value.as_bool().ok_or("use true or false")?;
        return Ok(vec![set.to_string()]);
    }
    let values = match value.as_array() {
        Some(items) if is_list(argument) => (items.iter())
            .map(|item| scalar(item.get_ref()))
            .collect::<Option<Vec<_>>>(),
        _ => scalar(value).map(|value| vec![value]),
    };
    let values = values.ok_or(match is_list(argument) {
        true => "use a list of strings",
        false => "use one string or number",
    })?;
    let flag = Arg::new("value")
        .long(key(argument).to_owned())
        .action(argument.get_action().clone())
        .value_parser(argument.get_value_parser().clone());
    let check = Command::new("chefshat").no_binary_name(true).arg(flag);
    for value in &values {
        let given = [format!("--{}={value}", key(argument))];
        if let Err(error) = check.clone().try_get_matches_from(given) {
            return Err(reason(&error));
        }
    }
    Ok(values)
}

/// A single value as its flag would be given it.
fn scalar(value: &DeValue<'_>) -> Option<String> {
    match value {
        DeValue::String(text) => Some(text.to_string()),
        DeValue::Integer(number) => {
            let number = i128::from_str_radix(number.as_str(), number.radix()).ok()?;
            Some(number.to_string())
        }
        DeValue::Float(number) => Some(number.as_str().to_owned()),
        DeValue::Boolean(_) | DeValue::Datetime(_) | DeValue::Array(_) | DeValue::Table(_) => None,
    }
}

/// The reason of clap's error, without its frame.
fn reason(error: &clap::Error) -> String {
    let text = error.to_string();
    let first = text.lines().next().unwrap_or_default();
    match std::error::Error::source(error) {
        Some(source) => source.to_string(),
        None => first.trim_start_matches("error: ").to_owned(),
    }
}

/// A setting and its effective value.
struct Effective {
    argument: Arg,
    value: Option<Value>,
    /// Where the value comes from, in a word; "unset" if there is none.
    source: &'static str,
    /// The flag, variable or file of the source.
    origin: Option<String>,
}

impl Effective {
    fn of(argument: Arg, matches: &ArgMatches, file: Option<&SettingsFile>) -> Self {
        let id = argument.get_id().as_str();
        let mut values =
            (matches.get_raw(id).into_iter().flatten()).map(|raw| value_of(&raw.to_string_lossy()));
        let value = match (is_switch(&argument), is_list(&argument)) {
            (true, _) => Some(json!(matches.get_flag(id))),
            (_, true) => Some(Value::Array(values.collect())),
            _ => values.next(),
        };
        let (source, origin) = match matches.value_source(id) {
            Some(ValueSource::CommandLine) => ("flag", Some(format!("--{}", key(&argument)))),
            Some(ValueSource::EnvVariable) => {
                let name = argument.get_env().map(|name| name.to_string_lossy());
                ("environment", name.map(|name| name.into_owned()))
            }
            _ => match file.filter(|file| file.sets(&argument)) {
                Some(file) => ("file", Some(file.path.display().to_string())),
                None if value.is_some() => ("default", None),
                None => ("unset", None),
            },
        };
        Self {
            argument,
            value,
            source,
            origin,
        }
    }
}

/// A raw value of a flag as a value of TOML or JSON, which write these values alike.
fn value_of(raw: &str) -> Value {
    let integer = (raw.parse().ok()).filter(|number: &i64| number.to_string() == raw);
    let float = (raw.parse().ok()).filter(|number: &f64| number.to_string() == raw);
    match (integer, float) {
        (Some(number), _) => json!(number),
        (None, Some(number)) if number.is_finite() => json!(number),
        _ => json!(raw),
    }
}

fn as_toml(effective: &[Effective]) -> String {
    let mut text = String::new();
    for setting in effective {
        let key = key(&setting.argument);
        let source = setting.origin.as_deref().unwrap_or(setting.source);
        let line = match &setting.value {
            Some(value) => writeln!(text, "{key} = {value}  # {source}"),
            None => writeln!(text, "# {key} is not set"),
        };
        line.expect("a String takes everything");
    }
    text
}

fn as_json(effective: &[Effective]) -> Value {
    let settings = effective.iter().map(|setting| {
        json!({
            "name": key(&setting.argument),
            "value": setting.value,
            "source": setting.source,
            "origin": setting.origin,
        })
    });
    json!({ "settings": settings.collect::<Vec<_>>() })
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory as _;

    use super::*;

    /// The part of the command line that this file depends on.
    #[derive(Debug, Parser)]
    enum Line {
        Serve(serve::Serve),
    }

    fn parsed(text: &str) -> Result<Vec<(String, Vec<String>)>, String> {
        parse_file(text, &settings(Line::command()))
            .map(|values| {
                let pairs = values.into_iter();
                pairs
                    .map(|(argument, values)| (key(&argument).to_owned(), values))
                    .collect()
            })
            .map_err(|(line, reason)| format!("{line}: {reason}"))
    }

    #[test]
    fn a_file_has_strings_numbers_switches_and_lists() {
        let text = "listen = \"127.0.0.1:0\"\nmax-rooms = 1_000\nno-records = true\n\
                    allow-origin = [\"http://a\", \"http://b\"]\ngrace = 0x10";
        let expected = [
            ("listen", vec!["127.0.0.1:0"]),
            ("max-rooms", vec!["1000"]),
            ("no-records", vec!["true"]),
            ("allow-origin", vec!["http://a", "http://b"]),
            ("grace", vec!["16"]),
        ];
        let expected = expected.map(|(key, values)| {
            (
                key.to_owned(),
                values.into_iter().map(str::to_owned).collect(),
            )
        });
        assert_eq!(parsed(text), Ok(expected.to_vec()));
    }

    #[test]
    fn mistakes_are_explained_with_their_line() {
        for (text, expected) in [
            (
                "max_rooms = 1",
                "1: unknown setting \"max_rooms\"; did you mean max-rooms?",
            ),
            (
                "\nlisten-on = \"a:1\"",
                "2: unknown setting \"listen-on\"; did you mean listen?",
            ),
            (
                "zzz = 1",
                "1: unknown setting \"zzz\"; `chefshat config` prints all settings",
            ),
            (
                "config = \"other.toml\"",
                "1: unknown setting \"config\"; `chefshat config` prints all settings",
            ),
            (
                "[serve]\nmax-rooms = 1",
                "1: unknown setting \"serve\"; `chefshat config` prints all settings",
            ),
            (
                "grace = 1\nmax-rooms = 0",
                "2: max-rooms: 0 is not in 1..18446744073709551615",
            ),
            (
                "listen = \"50051\"",
                "1: listen: use IP:PORT or HOST:PORT, for example 127.0.0.1:50051",
            ),
            ("no-records = \"yes\"", "1: no-records: use true or false"),
            ("max-rooms = [1]", "1: max-rooms: use one string or number"),
            (
                "allow-origin = [true]",
                "1: allow-origin: use a list of strings",
            ),
        ] {
            assert_eq!(parsed(text), Err(expected.to_owned()), "{text}");
        }
        let error = parsed("a = 1\nmax-rooms = ").expect_err("TOML");
        assert!(error.starts_with("2: "), "{error}");
        let error = parsed("grace = 1\ngrace = 2").expect_err("TOML");
        assert!(error.starts_with("2: duplicate key"), "{error}");
    }

    /// A flag of `chefshat serve` without a variable is not a setting. These describe one run, or are
    /// for tests.
    #[test]
    fn every_flag_of_serve_is_a_setting_except_those_of_one_run() {
        let mut command = Line::command();
        command.build();
        let serve = command.find_subcommand("serve").expect("the command");
        let known: Vec<_> = settings(Line::command())
            .iter()
            .map(|it| it.get_id().clone())
            .collect();
        let others: Vec<&str> = (serve.get_arguments())
            .map(|argument| argument.get_id())
            .filter(|id| !known.contains(id))
            .map(|id| id.as_str())
            .collect();
        assert_eq!(
            others,
            [
                "config",
                "lease",
                "until_stdin_closes",
                "new",
                "json",
                "help"
            ]
        );
        for argument in settings(Line::command()) {
            let variable = argument.get_env().expect("settings have one");
            let expected = format!(
                "CHEFSHAT_{}",
                key(&argument).to_uppercase().replace('-', "_")
            );
            assert_eq!(variable, &*expected);
            let conflicts = serve.get_arg_conflicts_with(&argument);
            assert!(conflicts.is_empty(), "{expected}: see the top of this file");
        }
    }
}
