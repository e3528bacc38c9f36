//! `chefshat serve --database` and `chefshat cluster`: nodes join, are shown, and hand over.

use chefshat_client::{Client, v1};

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
    // It may be mounted read-only.
    assert!(!folders[0].path().join("records").exists());
    let created = run(&address, "room create --name Coppa --json").clean();
    let room = created.json()["room"]["roomId"].clone();
    assert_eq!((rooms_of("first"), rooms_of("second")), (Some(1), Some(0)));
    // Their heartbeats say that they are reached.
    until("both nodes to serve", || {
        let shown = cluster("status").clean().stdout;
        assert!(
            shown.contains("first") && shown.contains("second"),
            "{shown}"
        );
        shown.matches(" serving ").count() == 2
    });

    cluster("drain nobody").assert_failed("`chefshat cluster status`");
    cluster("drain first")
        .clean()
        .assert_says(&["hands over 1 room, 0 tournaments and 0 studies"]);
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
fn what_is_over_is_shown_when_its_node_has_left() {
    let database = chefshat_postgres::database();
    let folders = [(); 3].map(|()| tempfile::tempdir().unwrap());
    let node = |number: usize, name: &str| {
        let flags = ["--database", database.url(), "--node-name", name];
        serve_with(folders[number].path(), &flags)
    };
    let (mut first, address) = node(0, "first");
    let (_second, other) = node(1, "second");
    let seats = " --seat greedy".repeat(4);
    let create = format!("room create --name Coppa --target-shifts 1 --json{seats}");
    let created = run(&address, &create).clean().json();
    let room = created["room"]["roomId"].as_str().unwrap().to_owned();
    let settings = "--format round_robin --rounds 1 --built-in greedy*4 --start-when 4";
    let create = format!("tournament create --name Coppa {settings} --target-shifts 1 --json");
    let created = run(&address, &create).json();
    let cup = created["tournament"]["tournamentId"].as_str().unwrap();
    let finished = |server: &str, line: &str, name: &str| {
        run(server, &format!("{line} --json")).stdout.contains(name)
    };
    let show = format!("room show {room}");
    until("the end of the game", || {
        finished(&address, &show, "ROOM_STATE_FINISHED")
    });
    until("the end of the tournament", || {
        finished(&address, "tournament list --state finished", cup)
    });
    let shown = run(&address, &show).clean();
    let results = run(&address, &format!("tournament results {cup}")).clean();

    let drain = format!("cluster drain first --database {}", database.url());
    typed(&drain).clean();
    assert_eq!(first.0.wait().unwrap().code(), Some(0));
    assert_eq!(run(&other, &show), shown);
    assert_eq!(run(&other, &format!("tournament results {cup}")), results);
    // Several nodes have it now, and each lists it once.
    let (_third, newest) = node(2, "third");
    for server in [&other, &newest] {
        let listed = run(server, "tournament list --json").clean();
        assert_eq!(listed.stdout.matches(cup).count(), 1, "{listed:?}");
    }
}

#[tokio::test]
async fn a_seat_is_told_where_its_node_is_reached() {
    let database = chefshat_postgres::database();
    let folders = [(); 2].map(|()| tempfile::tempdir().unwrap());
    let endpoint = "https://node1.example.org";
    let flags = ["--database", database.url(), "--client-endpoint", endpoint];
    let (_first, address) = serve_with(folders[0].path(), &flags);
    let (_second, other) = serve_with(folders[1].path(), &flags[..2]);
    let client = Client::connect(&address).await.unwrap();
    let created = client.create_room(v1::CreateRoomRequest::default()).await;
    let join = v1::JoinRoomRequest {
        join_code: created.unwrap().join_code,
        name: "Ada".into(),
        ..v1::JoinRoomRequest::default()
    };
    let joined = Client::connect(&other).await.unwrap().join(join).await;
    assert_eq!(joined.unwrap().preferred_endpoint, endpoint);
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
