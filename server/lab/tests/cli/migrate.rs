//! `chefshat migrate`: tables are created once, and a data directory moves as a whole or not.

use std::fs::{self, File};

use super::run::{chefshat, fixture};

#[test]
fn tables_are_created_and_a_data_directory_moves_into_them() {
    let database = chefshat_postgres::database();
    let migrate = |more: &[&str]| {
        let arguments = [&["migrate", "--database", database.url()], more].concat();
        chefshat(&arguments)
    };
    migrate(&[]).clean().assert_says(&["tables created"]);
    migrate(&[]).clean().assert_says(&["already"]);
    let version = migrate(&["--json"]).clean().json();
    assert_eq!(version["version"], version["version_before"]);

    let folder = tempfile::tempdir().unwrap();
    let from = ["--from", folder.path().to_str().unwrap()];
    migrate(&from).assert_failed("has no games.sqlite3");
    let copied = folder.path().join("games.sqlite3");
    fs::copy(fixture("database/games.sqlite3"), copied).unwrap();
    let lock = File::create(folder.path().join("games.lock")).unwrap();
    lock.lock().unwrap();
    migrate(&from).assert_failed("another chefshat server uses");
    drop(lock);
    assert_eq!(database.run("SELECT count(*) FROM games"), "0");

    let moved = migrate(&[from[0], from[1], "--json"]).clean().json();
    assert_eq!(
        (&moved["tournaments"], &moved["unreadable"]),
        (&2.into(), &0.into())
    );
    for (key, state) in [("finished_games", "<> 0"), ("unfinished_games", "= 0")] {
        let games = database.run(&format!("SELECT count(*) FROM games WHERE state {state}"));
        assert_ne!(games, "0");
        assert_eq!(moved[key].to_string(), games);
    }
    migrate(&from).assert_failed("already has games");
    let other = chefshat_postgres::database();
    let again = ["migrate", "--from", from[1], "--database", other.url()];
    chefshat(&again).assert_failed("the games of this folder have moved to postgres://");
    // As if they had not arrived there.
    fs::remove_file(folder.path().join("games.moved")).unwrap();
    chefshat(&again)
        .clean()
        .assert_says(&["moved: ", "2 tournaments"]);
}

#[test]
fn a_database_that_cannot_be_used_is_explained() {
    let refused = |url: &str| chefshat(&["migrate", "--database", url]);
    refused("games.sqlite3").assert_failed("an example is postgres://");
    let gone = refused("postgres://ada:secret@127.0.0.1:1/games");
    gone.assert_failed("cannot be reached");
    assert!(!gone.stderr.contains("secret"));
    let database = chefshat_postgres::database();
    database.run("CREATE TABLE recipes (name text)");
    refused(database.url()).assert_failed("another program");
}
