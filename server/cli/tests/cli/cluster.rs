//! `chefshat serve --database` and `chefshat cluster`: nodes join, are shown, and hand over.

use super::run::{run, serve_with, typed, until};

#[test]
fn a_drained_node_hands_its_room_to_another_and_stops() {
    let database = chefshat_postgres::database();
    let cluster = |line: &str| typed(&format!("cluster {line} --database {}", database.url()));
    let rooms_of = |name: &str| {
        let status = cluster("status --json").clean().json();
        let nodes = status["nodes"].as_array().unwrap().clone();
        let node = nodes.into_iter().find(|node| node["name"] == name);
        node.map(|node| node["rooms"].as_u64().unwrap())
    };
    let folders = [(); 2].map(|()| tempfile::tempdir().unwrap());
    let node = |number: usize, name: &str| {
        let flags = ["--database", database.url(), "--node-name", name];
        serve_with(folders[number].path(), &flags)
    };
    let (mut first, address) = node(0, "first");
    let (_second, other) = node(1, "second");
    let created = run(&address, "room create --name Coppa --json").clean();
    let room = created.json()["room"]["roomId"].clone();
    assert_eq!((rooms_of("first"), rooms_of("second")), (Some(1), Some(0)));
    cluster("status")
        .clean()
        .assert_says(&["first", "second", "serving"]);

    cluster("drain nobody").assert_failed("`chefshat cluster status`");
    cluster("drain first")
        .clean()
        .assert_says(&["hands over 1 room and 0 tournaments"]);
    assert_eq!(first.0.wait().unwrap().code(), Some(0));
    assert_eq!(rooms_of("first"), None, "it has left");
    until("the other node to have the room", || {
        rooms_of("second") == Some(1)
    });
    until("the other node to show the room", || {
        run(&other, "room list --json")
            .clean()
            .stdout
            .contains(room.as_str().unwrap())
    });
}

#[test]
fn settings_of_nodes_that_cannot_work_are_explained() {
    let serve = |line: &str| typed(&format!("serve --no-records --listen 127.0.0.1:0 {line}"));
    let database = "--database postgres://ada:secret@127.0.0.1:1/games";
    let gone = serve(database);
    gone.assert_failed("cannot be reached");
    assert!(!gone.stderr.contains("secret"));
    serve(&format!("{database} --peer-listen 0.0.0.0:0")).assert_failed("--peer-endpoint");
    serve(&format!(
        "{database} --peer-listen 0.0.0.0:0 --peer-endpoint a:1"
    ))
    .assert_failed("loopback");
    serve(&format!("{database} --peer-cert a.pem")).assert_failed("must be given together");
}
