//! `chefshat config`, `completions` and `man`, and a server that reads a configuration file.

use std::fs;
use std::process::Command;

use serde_json::{Value, json};
use tempfile::TempDir;

use super::run::{Ended, chefshat, program, serve_with, typed};

/// A setting of `chefshat config --json`.
fn setting(printed: &Value, name: &str) -> Value {
    let settings = printed["settings"].as_array().unwrap();
    let found = settings.iter().find(|setting| setting["name"] == name);
    found.unwrap_or_else(|| panic!("{name}: {printed}")).clone()
}

fn ended(command: &mut Command) -> Ended {
    Ended::of(command.output().unwrap())
}

#[test]
fn flags_override_variables_which_override_the_file_which_overrides_defaults() {
    let folder = TempDir::new().unwrap();
    let file = folder.path().join("chefshat.toml");
    let text = "max-rooms = 1\nvector-threads = 1\ngrace = 1\nno-records = true\nlog = \"info\"\nallow-origin = [\"http://a\", \"http://b\"]\n";
    fs::write(&file, text).unwrap();
    let mut command = program();
    command.args(["config", "--json", "--max-rooms", "3"]);
    command.env("CHEFSHAT_CONFIG", &file);
    command.env("CHEFSHAT_MAX_ROOMS", "2");
    command.env("CHEFSHAT_VECTOR_THREADS", "2");
    let printed = ended(&mut command).clean().json();
    let file = file.to_str().unwrap();
    for (name, value, source, origin) in [
        ("max-rooms", json!(3), "flag", json!("--max-rooms")),
        (
            "vector-threads",
            json!(2),
            "environment",
            json!("CHEFSHAT_VECTOR_THREADS"),
        ),
        ("grace", json!(1), "file", json!(file)),
        ("no-records", json!(true), "file", json!(file)),
        ("log", json!("info"), "file", json!(file)),
        (
            "allow-origin",
            json!(["http://a", "http://b"]),
            "file",
            json!(file),
        ),
        ("listen", json!("127.0.0.1:50051"), "default", Value::Null),
        ("allow-import", json!(false), "default", Value::Null),
        ("data-dir", Value::Null, "unset", Value::Null),
    ] {
        let expected = json!({ "name": name, "value": value, "source": source, "origin": origin });
        assert_eq!(setting(&printed, name), expected);
    }
}

#[test]
fn an_empty_variable_is_not_set() {
    let folder = TempDir::new().unwrap();
    let file = folder.path().join("chefshat.toml");
    fs::write(&file, "no-records = true\nallow-host = [\"a\"]\n").unwrap();
    let mut config = program();
    config.args(["config", "--json", "--config", file.to_str().unwrap()]);
    let printed = ended(&mut config).clean().json();
    for setting in printed["settings"].as_array().unwrap() {
        let name = setting["name"].as_str().unwrap();
        config.env(
            format!("CHEFSHAT_{}", name.to_uppercase().replace('-', "_")),
            "",
        );
    }
    assert_eq!(ended(&mut config).clean().json(), printed);
    let mut list = program();
    list.args(["room", "list", "--server", "x://y"]);
    list.env("CHEFSHAT_TOKEN", "").env("CHEFSHAT_CA", "");
    ended(&mut list).assert_failed("is not the address of a server");
}

#[test]
fn the_printed_configuration_can_be_read_again() {
    let folder = TempDir::new().unwrap();
    let file = folder.path().join("chefshat.toml");
    let line = "config --max-rooms 7 --data-dir 12 --allow-origin http://a,http://b --log info --no-records";
    let printed = typed(line).clean();
    printed.assert_says(&[
        "max-rooms = 7  # --max-rooms\n",
        "no-records = true  # --no-records\n",
        "listen = \"127.0.0.1:50051\"  # default\n",
    ]);
    fs::write(&file, &printed.stdout).unwrap();
    let read = format!("config --json --config {}", file.display());
    let again = typed(&read).clean().json();
    let first = typed(&format!("{line} --json")).clean().json();
    let values = |printed: &Value| -> Vec<(Value, Value)> {
        let settings = printed["settings"].as_array().unwrap().iter();
        settings
            .map(|setting| (setting["name"].clone(), setting["value"].clone()))
            .collect()
    };
    assert_eq!(values(&again), values(&first));
    assert_eq!(setting(&again, "data-dir")["source"], "file");
}

#[test]
fn a_server_uses_the_file_and_refuses_a_wrong_one() {
    let folder = TempDir::new().unwrap();
    let file = folder.path().join("chefshat.toml");
    fs::write(&file, "max-rooms = 1\n").unwrap();
    let path = file.to_str().unwrap();
    let (_server, url) = serve_with(folder.path(), &["--config", path]);
    typed(&format!("room create --server {url}")).well();
    typed(&format!("room create --server {url}")).assert_failed("TOO_MANY_ROOMS");

    fs::write(&file, "# rooms\nmax_rooms = 1\n").unwrap();
    let expected = format!("{path}:2: unknown setting \"max_rooms\"; did you mean max-rooms?");
    chefshat(&["serve", "--config", path]).assert_failed(&expected);
    let missing = folder.path().join("missing.toml");
    chefshat(&["config", "--config", missing.to_str().unwrap()]).assert_failed("cannot read");
}

#[test]
fn completions_know_the_commands_and_manual_pages_are_written() {
    let script = typed("completions bash").clean();
    script.assert_says(&["check-agent", "--max-rooms"]);
    // A shell accepts the script.
    let folder = TempDir::new().unwrap();
    let file = folder.path().join("chefshat.bash");
    fs::write(&file, &script.stdout).unwrap();
    ended(Command::new("bash").arg("-n").arg(file)).clean();
    typed("completions tcl").assert_refused("fish");

    let pages = folder.path().join("man1");
    chefshat(&["man", "--out-dir", pages.to_str().unwrap()]).clean();
    let page = fs::read_to_string(pages.join("chefshat-serve.1")).unwrap();
    assert!(page.contains("CHEFSHAT_MAX_ROOMS"), "{page}");
    assert!(pages.join("chefshat.1").is_file());
}
