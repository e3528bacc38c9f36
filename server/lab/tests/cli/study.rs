//! `chefshat study` against a server: a study is created from the example, managed, exported and
//! deleted.

use std::collections::{BTreeMap, BTreeSet};
use std::io::{self, BufRead as _, BufReader, Read as _};
use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::thread;

use chefshat_client::Client;
use chefshat_postgres::own_address;
use chefshat_proto::v1;
use chefshat_proto::v1::participation_service_client::ParticipationServiceClient;
use serde_json::Value;
use tempfile::TempDir;

use super::run::{
    Ended, Running, chefshat, in_runtime, run, serve, serve_at, typed, typed_on_a_full_disk,
};

/// The example of the documentation.
const EXAMPLE: &str = concat!(
    env!("CARGO_MANIFEST_DIR"),
    "/../../docs/studies/example.toml"
);

/// Creates the study of the example, with the owner token in a file. Returns its id.
fn create(url: &str, owner: &Path) -> String {
    let create = ["study", "create", EXAMPLE, "--json", "--server", url];
    let owner_file = ["--owner-file", owner.to_str().unwrap()];
    let created = chefshat(&[&create[..], &owner_file].concat()).well().json();
    created["study"]["studyId"].as_str().unwrap().to_owned()
}

#[test]
fn a_study_is_created_and_deleted() {
    let folder = TempDir::new().unwrap();
    let (_server, url) = serve(&folder.path().join("data"));
    let owner = folder.path().join("owner");
    let id = create(&url, &owner);
    let owned = |command: &str| {
        let owner = owner.to_str().unwrap();
        run(&url, &format!("study {command} {id} --owner-file {owner}"))
    };
    owned("links --add 3").well().assert_says(&["/study/"]);
    owned("delete").assert_refused("confirm with --yes");
    let deleted = owned("delete --yes --json").well().json();
    assert_eq!(deleted["study"]["participants"], 3, "{deleted}");
    owned("show").assert_failed("no study with this id and owner token");
    owned("delete --yes").assert_failed("no study with this id and owner token");
    chefshat(&["study", "--help"]).assert_helps("chefshat study links");
}

#[test]
fn a_study_is_followed_across_the_death_of_its_server() {
    let folder = TempDir::new().unwrap();
    let (data, owner) = (folder.path().join("data"), folder.path().join("owner"));
    // Only this server listens there.
    let (server, url) = serve_at(&format!("{}:0", own_address()), &data, &[]);
    let id = create(&url, &owner);
    let owned = format!("{id} --json --owner-file {}", owner.display());
    let mut following = Running::start(&url, &format!("study follow {owned}"));
    let lines = BufReader::new(following.0.stdout.take().unwrap()).lines();
    let mut lines = lines.map(|line| serde_json::from_str::<Value>(&line.unwrap()).unwrap());
    let first = lines.next().unwrap();
    assert_eq!(first["study"]["studyId"], id);
    drop(server);
    // It has tried to connect while there was none.
    let mut said = String::new();
    let mut stderr = BufReader::new(following.0.stderr.take().unwrap());
    stderr.read_line(&mut said).unwrap();
    assert!(said.contains("retrying for up to 30 seconds"), "{said}");
    let address = url.trim_start_matches("http://");
    let (_server, _) = serve_at(address, &data, &[]);
    run(&url, &format!("study close {owned}")).well();
    // What was shown is not shown again.
    let rest: Vec<Value> = lines.collect();
    assert!(!rest.is_empty() && !rest.contains(&first), "{rest:?}");
    assert_eq!(following.0.wait().unwrap().code(), Some(0));
}

/// Type of the frame of HTTP/2 that begins a request.
const HEADERS: u8 = 1;

/// The URL of a relay to a server that loses its first connection once a request was sent.
fn losing_a_request(url: &str) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let relay = listener.local_addr().unwrap();
    let server = url.trim_start_matches("http://").to_owned();
    thread::spawn(move || {
        let (mut lost, _) = listener.accept().unwrap();
        // The preface, then frames: length, type, flags, stream, content.
        lost.read_exact(&mut [0; 24]).unwrap();
        let mut frame = [0; 9];
        while frame[3] != HEADERS {
            lost.read_exact(&mut frame).unwrap();
            let length = u32::from_be_bytes([0, frame[0], frame[1], frame[2]]);
            io::copy(&mut (&lost).take(length.into()), &mut io::sink()).unwrap();
        }
        drop(lost);
        for client in listener.incoming() {
            let (client, server) = (client.unwrap(), TcpStream::connect(&server).unwrap());
            for (from, to) in [(&client, &server), (&server, &client)] {
                let (mut from, mut to) = (from.try_clone().unwrap(), to.try_clone().unwrap());
                thread::spawn(move || io::copy(&mut from, &mut to));
            }
        }
    });
    format!("http://{relay}")
}

#[test]
fn requests_for_a_study_are_repeated_if_their_connection_is_lost() {
    let folder = TempDir::new().unwrap();
    let (_server, url) = serve(&folder.path().join("data"));
    let (owner, out) = (folder.path().join("owner"), folder.path().join("out"));
    let id = create(&losing_a_request(&url), &owner);
    for command in [
        "list".to_owned(),
        format!("show {id}"),
        format!("links {id}"),
        format!("export {id} --out {}", out.display()),
    ] {
        let line = format!("study {command} --owner-file {}", owner.display());
        run(&losing_a_request(&url), &line).well();
    }
}

#[test]
fn an_owner_token_whose_file_cannot_be_written_is_printed() {
    let folder = TempDir::new().unwrap();
    let (_server, url) = serve(&folder.path().join("data"));
    let owner = folder.path().join("owner");
    let create = format!("study create {EXAMPLE} --server {url}");
    let create = format!("{create} --owner-file {}", owner.display());
    let created = typed_on_a_full_disk(&create);
    assert_eq!(created.code, Some(1), "{created:?}");
    assert!(created.stderr.contains("an owner token cannot be written"));
    assert!(!owner.exists());
    let value = |name: &str| {
        let line = created.stdout.lines().find(|line| line.starts_with(name));
        line.unwrap().split_whitespace().last().unwrap().to_owned()
    };
    let (id, token) = (value("study "), value("owner token "));
    run(&url, &format!("study show {id} --owner-token {token}")).well();
}

#[test]
fn studies_are_listed_with_the_owner_token_of_a_file_that_exists() {
    let folder = TempDir::new().unwrap();
    let (_server, url) = serve(&folder.path().join("data"));
    assert_eq!(run(&url, "study list").clean().stdout, "no studies\n");
    assert_eq!(run(&url, "study list --json").clean().stdout, "");
    let missing = folder.path().join("ownerr");
    let list = format!("study list --owner-file {}", missing.display());
    run(&url, &list).assert_failed("--owner-file: ");
}

#[test]
fn an_export_that_fails_leaves_no_folder() {
    let folder = TempDir::new().unwrap();
    let (_server, url) = serve(&folder.path().join("data"));
    let owner = folder.path().join("owner");
    let id = create(&url, &owner);
    let exports = folder.path().join("exports");
    let export = format!(
        "study export {id} --out {}",
        exports.join("monday").display()
    );
    let export = format!("{export} --owner-file {} --server {url}", owner.display());
    typed_on_a_full_disk(&export).assert_failed(exports.to_str().unwrap());
    assert_eq!(exports.read_dir().unwrap().count(), 0);
    typed(&export).well();
    assert!(exports.join("monday/datapackage.json").exists());
}

/// The example of the documentation with pairs.
const PAIRS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/studies/pairs.toml");

/// A study within participants, with a scale of two items, one whose items have different ranges, one that
/// only some answer, and one item after all conditions.
const WITHIN: &str = r#"
name = "within"
title = "A game of cards"
participants = 8
order = "within"
factors = [{ name = "pace", levels = ["fast", "slow"] }]
[[conditions]]
id = "fast"
levels = { pace = "fast" }
seats = [{}, { built_in_agent = "random" }, { built_in_agent = "random" }]
[[conditions]]
id = "slow"
levels = { pace = "slow" }
seats = [{ built_in_agent = "random" }, { built_in_agent = "random" }, { built_in_agent = "random" }]
[[stages]]
[[stages.per_condition.stages]]
games = { count = 1 }
[[stages.per_condition.stages]]
[stages.per_condition.stages.questionnaire]
id = "after"
items = [
    { id = "calm-1", scale = "calm", text = "It was calm.", likert = { points = 5, labels = ["no", "yes"] } },
    { id = "calm-2", scale = "calm", text = "It was quiet.", likert = { points = 5, labels = ["no", "yes"] } },
    { id = "mixed-1", scale = "mixed", text = "It was fun.", likert = { points = 5, labels = ["no", "yes"] } },
    { id = "mixed-2", scale = "mixed", text = "It was joy.", likert = { points = 7, labels = ["no", "yes"] } },
    { id = "some", text = "Why?", likert = { points = 5, labels = ["no", "yes"] }, shown_if = [{ item = "calm-1", answers = { min = 4 } }] },
]
[[stages]]
[stages.questionnaire]
id = "end"
items = [{ id = "all", text = "All in all?", likert = { points = 5, labels = ["no", "yes"] } }]
"#;

#[test]
fn a_study_is_simulated_with_a_known_effect() {
    let simulate = |file: &str, options: &str| {
        let options = options.split_whitespace();
        let given: Vec<&str> = ["study", "simulate", file]
            .into_iter()
            .chain(options)
            .collect();
        chefshat(&given)
    };
    let of_answers = "--measure nasa_tlx/effort --effect strength=strong:1sd --studies 400";
    let printed = simulate(EXAMPLE, &format!("{of_answers} --json"))
        .well()
        .json();
    let rows = printed["results"].as_array().unwrap();
    let participants: Vec<&Value> = rows.iter().map(|row| &row["participants"]).collect();
    assert_eq!(participants, [16, 32, 64]);
    let power: Vec<f64> = rows
        .iter()
        .map(|row| row["power"].as_f64().unwrap())
        .collect();
    assert!(
        power.is_sorted() && power[0] < 0.8 && power[2] > 0.9,
        "{printed:#}"
    );
    for row in rows {
        let found = row["found_without_effect"].as_f64().unwrap();
        assert!(found < 0.12, "{printed:#}");
        assert_eq!(row["with_level"], row["without_level"]);
    }
    let again = simulate(EXAMPLE, &format!("{of_answers} --json --threads 1"))
        .well()
        .json();
    assert_eq!(again, printed);
    let enough = "64 are the fewest of these with a power of 80 % (400 simulated studies";
    simulate(EXAMPLE, of_answers).well().assert_says(&[enough]);
    let small = format!("{of_answers} --participants 16");
    let too_few = "None of these reaches a power of 80 %";
    simulate(EXAMPLE, &small).well().assert_says(&[too_few]);

    // A pair counts once: of 16 participants 8 pairs, 4 with each level.
    let pairs =
        "--measure afterwards/together --effect agents=strong:2 --participants 16 --studies 100";
    let printed = simulate(PAIRS, &format!("{pairs} --json")).well().json();
    let row = &printed["results"][0];
    assert_eq!(
        [&row["with_level"], &row["without_level"]],
        [4, 4],
        "{printed:#}"
    );

    // Greedy agents score more against weak agents than against strong ones.
    let games = "--measure points --effect strength=strong --participants 8 --studies 100 --json";
    let printed = simulate(EXAMPLE, games).well().json();
    let means = &printed["measured"]["means"];
    let mean = |condition: &str| means[condition].as_f64().unwrap();
    assert!(
        mean("weak-opponents") > mean("strong-opponents") + 1.0,
        "{printed:#}"
    );
    let difference = printed["results"][0]["difference"].as_f64().unwrap();
    assert!(difference < -1.0, "{printed:#}");

    let folder = TempDir::new().unwrap();
    let within = folder.path().join("within.toml");
    std::fs::write(&within, WITHIN).unwrap();
    let within = within.to_str().unwrap();
    let of = |measure: &str, options: &str| {
        let options = format!("--measure {measure} --effect pace=fast:1 --studies 100 {options}");
        simulate(within, &options)
    };
    // Each participant meets both conditions, with two items of the scale in each.
    let printed = of("after/calm", "--json").well().json();
    assert_eq!(printed["measured"]["answers"], 2, "{printed:#}");
    let row = &printed["results"][0];
    assert_eq!(
        [&row["with_level"], &row["without_level"]],
        [8, 8],
        "{printed:#}"
    );
    // Items that measure the same differ less between conditions than those that measure different things.
    let power = |options: &str| {
        let printed = of("after/calm", &format!("{options} --json")).well().json();
        printed["results"][0]["power"].as_f64().unwrap()
    };
    assert!(power("--item-correlation 1") + 0.1 < power("--item-correlation 0.5"));
    of("after/calm", "")
        .well()
        .assert_says(&["d_z", "of its items 0.7"]);
    for (measure, options, problem) in [
        ("after/mixed", "", "different ranges"),
        ("after/some", "", "shown_if"),
        ("end/all", "", "per_condition"),
        ("after/calm", "--mean 9", "from 1 to 5"),
        (
            "after/calm",
            "--item-correlation 0.4",
            "at least --correlation",
        ),
    ] {
        of(measure, options).assert_failed(problem);
    }
    let games = "--measure place --effect pace=fast";
    simulate(within, games).assert_failed("\"fast\" has seats without a built-in agent");

    let with_size = "--effect strength=strong:1";
    for (options, problem) in [
        (
            "--measure nasa_tlx/effort --effect kind=strong:1",
            "strength",
        ),
        (
            "--measure nasa_tlx/effort --effect strength=average:1",
            "weak, strong",
        ),
        (
            "--measure nasa_tlx/effort --effect strength=strong",
            "its size",
        ),
        (&format!("--measure effort {with_size}"), "nasa_tlx/effort"),
        (
            &format!("--measure before/experience {with_size}"),
            "before the first game",
        ),
        (
            &format!("--measure points {with_size}"),
            "leave out the size",
        ),
        (
            &format!("--measure nasa_tlx/effort {with_size} --participants 3"),
            "at least 2",
        ),
    ] {
        simulate(EXAMPLE, options).assert_failed(problem);
    }
    simulate(
        PAIRS,
        "--measure points --effect agents=strong --participants 7",
    )
    .assert_failed("multiple of 2");
}

/// Opens the study with a participant's link, on a phone: from then on it is active.
fn open(url: &str, link: &str) {
    let request = v1::OpenStudyRequest {
        link: link.into(),
        device: Some(v1::StudyDevice {
            width: 390,
            height: 844,
            pixels: 300,
            pointer: v1::StudyPointer::Coarse.into(),
            time_zone: "Europe/Rome".to_owned(),
        }),
    };
    in_runtime(async {
        let client = Client::connect(url).await.unwrap();
        let mut service = ParticipationServiceClient::new(client.channel());
        service.open_study(request).await.unwrap();
    });
}

/// The files of an export without the records, one after the other.
fn exported(folder: &Path) -> String {
    let files = std::fs::read_dir(folder).unwrap().map(Result::unwrap);
    let files = files.filter(|file| file.file_type().unwrap().is_file());
    let texts = files.map(|file| std::fs::read_to_string(file.path()).unwrap());
    texts.collect()
}

#[test]
fn a_study_is_listed_shown_exported_and_closed_and_participants_leave_it() {
    let folder = TempDir::new().unwrap();
    let (_server, url) = serve(&folder.path().join("data"));
    let owner = folder.path().join("owner");
    let owner_file = format!("--owner-file {}", owner.to_str().unwrap());
    let id = create(&url, &owner);
    let owned = |command: &str, more: &str| -> Ended {
        run(&url, &format!("study {command} {id} {more} {owner_file}"))
    };
    let participants =
        || -> Value { owned("show", "--json").well().json()["participants"].clone() };
    let state = |name: &str| format!("STUDY_PARTICIPANT_STATE_{name}");
    let links = owned("links", "--pseudonym Anabel --pseudonym Bonifaz --json").well();
    let links = links.json_lines();
    open(&url, links[0]["link"].as_str().unwrap());

    let summary = |state: &str, counts: &str| {
        format!("study {id} (strength-pilot) is {state}: 0 completed, {counts}\n")
    };
    let listed = run(&url, &format!("study list {owner_file}")).well();
    let counts = "1 active, 1 invited, 0 left";
    assert_eq!(listed.stdout, summary("open", counts));
    let listed = run(&url, &format!("study list {owner_file} --json")).well();
    assert_eq!(listed.json()["studyId"], id.as_str());
    let shown = owned("show", "").well().stdout;
    let shown: Vec<&str> = shown.lines().collect();
    assert_eq!(shown[0], summary("open", counts).trim_end());
    assert!(shown[1].starts_with("1\tAnabel\tactive"), "{shown:?}");
    assert_eq!(shown[2], "2\tBonifaz\tinvited\tstep 0\t");
    assert_eq!(shown.len(), 3);

    let removed = owned("remove", "2 --replace").well().stdout;
    let removed: Vec<&str> = removed.lines().collect();
    assert!(removed[0].starts_with("2\tBonifaz\tremoved"), "{removed:?}");
    assert!(removed[1].starts_with("3\t"), "{removed:?}");
    assert!(removed[1].contains(&format!("{url}/study/")), "{removed:?}");
    let now = participants();
    assert_eq!(now[1]["state"], state("REMOVED").as_str(), "{now}");
    assert_eq!(now[2]["state"], state("INVITED").as_str(), "{now}");

    let (before, after) = (folder.path().join("before"), folder.path().join("after"));
    let out = format!("--out {}", before.display());
    let printed = owned("export", &out).well();
    printed.assert_says(&["study.json (", "participants.csv (", "records/ (0 games)"]);
    let data = exported(&before);
    assert!(
        data.contains("Anabel") && data.contains("Bonifaz"),
        "{data}"
    );
    owned("export", &out).assert_failed("exists already; name a new folder");

    let deleted = owned("delete-participant", "1").well();
    let words = "the data of participant 1 are deleted, with 0 games\n";
    assert_eq!(deleted.stdout, words);
    let ana = participants()[0].clone();
    assert_eq!(ana["dataDeleted"], true, "{ana}");
    assert_eq!(ana["state"], state("WITHDRAWN").as_str(), "{ana}");
    let out = format!("--out {} --json", after.display());
    let printed = owned("export", &out).well().json();
    assert_eq!(printed["event"], "exported");
    let data = exported(&after);
    assert!(
        !data.contains("Anabel") && data.contains("Bonifaz"),
        "{data}"
    );

    let closed = owned("close", "").well().stdout;
    let counts = "0 active, 1 invited, 2 left";
    assert_eq!(closed, summary("closed", counts));
    owned("links", "--add 1").assert_failed("STUDY_CLOSED");
}

/// A study without consent and games, with an item of each kind, and items and stages for some.
const QUESTIONS: &str = r#"
name = "questions"
title = "Questions"
participants = 2
device = { pointer = "coarse" }

[[conditions]]
id = "one"
rules = { preset = "paper", faces = 8, target_shifts = 1 }
policy = { pace_ms = 0 }
seats = [{ built_in_agent = "random" }, { built_in_agent = "random" }, { built_in_agent = "random" }]
[[conditions]]
id = "two"
rules = { preset = "paper", faces = 8, target_shifts = 1 }
policy = { pace_ms = 0 }
seats = [{ built_in_agent = "random" }, { built_in_agent = "random" }, { built_in_agent = "random" }]

[[stages]]
[stages.questionnaire]
id = "before"
items = [
    { id = "age", text = "Age", number = { min = 18, max = 99 } },
    { id = "plays", text = "What?", optional = true, choice = { options = ["a", "b", "c"], multiple = true } },
    { id = "one", text = "Which?", choice = { options = ["a", "b"] } },
    { id = "liked", text = "Liked", likert = { points = 2, labels = ["no", "yes"] } },
    { id = "why", text = "Why not?", free_text = { max_characters = 9 }, shown_if = [{ item = "liked", answers = { max = 1 } }] },
    { id = "real", semantic_differential = { points = 5, left = "fake", right = "real" } },
    { id = "check", text = "Low?", slider = { min = 0, max = 10, step = 5 }, attention_check = { max = 0 } },
]
[[stages]]
shown_if = [{ questionnaire = "before", item = "one", answers = { options = [0] }, not = true }]
[stages.questionnaire]
id = "some"
items = [
    { id = "a", text = "A", number = { min = 1, max = 3 } },
    { id = "b", text = "B", number = { min = 1, max = 3 }, shown_if = [{ questionnaire = "before", item = "plays", answers = { options = [2] }, not = true }] },
]
[[stages]]
games = { count = 1 }
"#;

#[test]
fn those_whose_answers_screen_them_out_are_counted_apart() {
    let folder = TempDir::new().unwrap();
    let (_server, url) = serve(&folder.path().join("data"));
    let (owner, file) = (
        folder.path().join("owner"),
        folder.path().join("screening.toml"),
    );
    let screening = "[[stages]]
shown_if = [{ questionnaire = \"before\", item = \"liked\", answers = { max = 1 } }]
screen_out = { text = \"This study is for those who like it.\" }
[[stages]]
games";
    std::fs::write(&file, QUESTIONS.replacen("[[stages]]\ngames", screening, 1)).unwrap();
    let (owner, out) = (owner.to_str().unwrap(), folder.path().join("out"));
    let create = format!(
        "study create {} --owner-file {owner} --json",
        file.display()
    );
    let created = run(&url, &create).well().json();
    let id = created["study"]["studyId"].as_str().unwrap();
    let tested = run(
        &url,
        &format!("study test {id} --participants 16 --seed 7 --owner-file {owner} --json"),
    );
    let tested = tested.well().json();
    run(
        &url,
        &format!(
            "study export {id} --test --out {} --owner-file {owner}",
            out.display()
        ),
    )
    .well();
    let rows = |file: &str| -> Vec<BTreeMap<String, String>> {
        let rows = csv::Reader::from_path(out.join(file)).unwrap();
        rows.into_deserialize().map(Result::unwrap).collect()
    };
    let (participants, answers) = (rows("participants.csv"), rows("answers.csv"));
    let count = |state: &str| {
        participants
            .iter()
            .filter(|it| it["state"] == state)
            .count()
    };
    let (completed, screened_out) = (count("completed"), count("screened_out"));
    assert_eq!(completed + screened_out, 16);
    assert!(completed > 2 && screened_out > 2, "{completed}");
    assert_eq!(tested["completed"], completed);
    assert_eq!(tested["screened_out"], screened_out);
    assert_eq!(rows("games.csv").len(), completed);
    for participant in &participants {
        let mut answers = answers
            .iter()
            .filter(|it| it["number"] == participant["number"]);
        let liked = answers.find(|it| it["item"] == "liked").unwrap();
        let is_out = participant["state"] == "screened_out";
        assert_eq!(is_out, liked["answer"] == "1", "{participant:?}");
    }
}

#[test]
fn test_participants_go_through_a_study_by_what_they_are_shown() {
    let folder = TempDir::new().unwrap();
    let (_server, url) = serve(&folder.path().join("data"));
    let owner = folder.path().join("owner");
    let file = folder.path().join("questions.toml");
    std::fs::write(&file, QUESTIONS).unwrap();
    let create = ["study", "create", file.to_str().unwrap(), "--json"];
    let owner_file = ["--server", &url, "--owner-file", owner.to_str().unwrap()];
    let created = chefshat(&[&create[..], &owner_file].concat()).well().json();
    let id = created["study"]["studyId"].as_str().unwrap().to_owned();
    let owned = |command: &str, more: &str| -> Ended {
        let owner = owner.to_str().unwrap();
        run(
            &url,
            &format!("study {command} {id} {more} --owner-file {owner}"),
        )
    };
    let tested = owned("test", "--participants 24 --seed 7").well().stdout;
    let lines: Vec<&str> = tested.lines().collect();
    assert!(lines[0].starts_with("1\tT01 (test)\tcompleted"), "{tested}");
    assert_eq!(lines[24], "24 of 24 test participants completed the study");
    let shown = owned("show", "").well().stdout;
    assert!(
        shown.contains("0 completed, 0 active, 0 invited, 0 left"),
        "{shown}"
    );
    // A participant still gets the first place.
    // Links are listed of those who have not completed it.
    owned("links", "--test --add 1 --pseudonym Looks").well();
    assert_eq!(owned("links", "--test").well().stdout.lines().count(), 2);
    let links = owned("links", "--add 1 --json").well().json();
    assert_eq!(owned("links", "").well().stdout.lines().count(), 1);
    open(&url, links["link"].as_str().unwrap());
    let first = owned("show", "--json").well().json()["participants"][26].clone();
    assert_eq!(first["slot"], 0, "{first}");

    let table = |more: &str, file: &str| -> Vec<BTreeMap<String, String>> {
        let out = folder.path().join(format!("exported{more}"));
        if !out.exists() {
            owned("export", &format!("{more} --out {}", out.display())).well();
        }
        let rows = csv::Reader::from_path(out.join(file)).unwrap();
        rows.into_deserialize().map(Result::unwrap).collect()
    };
    assert_eq!(table("", "participants.csv").len(), 1);
    assert_eq!(table("", "games.csv").len(), 0);
    let participants = table("--test", "participants.csv");
    let participants: Vec<_> = participants
        .into_iter()
        .filter(|it| it["state"] == "completed")
        .collect();
    assert_eq!(participants.len(), 24);
    assert!(participants.iter().all(|it| it["test"] == "true"));
    for condition in ["one", "two"] {
        let of = participants
            .iter()
            .filter(|it| it["conditions"] == condition);
        assert_eq!(of.count(), 12, "{condition}");
    }
    assert_eq!(table("--test", "games.csv").len(), 24);

    // What each was shown follows from its answers, which were by chance: all of it occurs.
    let answers = table("--test", "answers.csv");
    let mut seen = BTreeSet::new();
    for participant in &participants {
        let of = |item: &str| {
            let mut rows = answers.iter();
            let row = rows.find(|it| it["number"] == participant["number"] && it["item"] == item);
            row.unwrap().clone()
        };
        let is_shown = |item: &str| of(item)["status"] != "not_shown";
        assert_eq!(is_shown("why"), of("liked")["answer"] == "1");
        assert_eq!(is_shown("a"), of("one")["answer"] != "0");
        let plays_c = of("plays")["answer"].contains('2');
        assert_eq!(is_shown("b"), is_shown("a") && !plays_c);
        assert_eq!(
            of("a")["questionnaire_shown_at_ms"].is_empty(),
            !is_shown("a")
        );
        assert_eq!(
            of("check")["passed"] == "true",
            of("check")["answer"] == "0"
        );
        let passed = if of("check")["answer"] == "0" {
            "1"
        } else {
            "0"
        };
        assert_eq!(participant["attention_checks_passed"], passed);
        seen.insert((is_shown("why"), is_shown("a"), plays_c, passed));
    }
    assert!(seen.len() > 6, "{seen:?}");
}
