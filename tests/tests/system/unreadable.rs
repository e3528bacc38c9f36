//! What a database has and cannot be read ends no list, stream or export of the rest.

use std::collections::BTreeSet;
use std::path::Path;
use std::sync::Arc;

use chefshat_client::Connection;
use chefshat_proto::v1::record_service_client::RecordServiceClient;
use chefshat_proto::v1::room_service_client::RoomServiceClient;
use chefshat_proto::v1::study_service_client::StudyServiceClient;
use chefshat_proto::v1::tournament_service_client::TournamentServiceClient;
use chefshat_proto::v1::{self, record_line::Line};
use chefshat_record::pseudonym::Named;
use chefshat_server::participants::ParticipantData;
use chefshat_server::store::{SqliteStore, Store};
use chefshat_tests::{TestServer, one_shift, patiently};
use futures::TryStreamExt as _;
use prost::Message as _;
use prost_types::FileDescriptorSet;
use sqlx::sqlite::{SqliteConnectOptions, SqliteConnection};
use sqlx::{Connection as _, Executor as _};
use tonic::Code;

use crate::played::{built_in, ended};
use crate::records::reason;
use crate::studies::settings;

/// The calls that show many things of the store, and are tested here.
const CALLS: [&str; 8] = [
    "ExportParticipant",
    "ExportStudy",
    "GetLeaderboard",
    "ListRecords",
    "ListRooms",
    "ListStudies",
    "ListTournaments",
    "StreamRecords",
];
/// Those that show one tournament or study, or none of the store.
const OTHERS: [&str; 3] = ["ListClients", "ListStudyLinks", "ListTournamentGames"];

#[test]
fn every_call_that_shows_many_things_is_tested() {
    let set = FileDescriptorSet::decode(chefshat_proto::DESCRIPTORS).expect("descriptors");
    let services = set.file.iter().flat_map(|file| &file.service);
    let calls = services.flat_map(|service| &service.method);
    let words = ["List", "Stream", "Export", "GetLeaderboard"];
    let found: BTreeSet<&str> = (calls.map(|call| call.name()))
        .filter(|name| words.iter().any(|word| name.starts_with(word)))
        .collect();
    assert_eq!(found, CALLS.into_iter().chain(OTHERS).collect());
}

/// Changes the database while no server uses it.
async fn damage(folder: &Path, changes: &[String]) {
    let options = SqliteConnectOptions::new().filename(folder.join("games.sqlite3"));
    let mut connection = SqliteConnection::connect_with(&options)
        .await
        .expect("it opens");
    for change in changes {
        let changed = connection
            .execute(sqlx::AssertSqlSafe(change.clone()))
            .await;
        assert_ne!(changed.expect("executed").rows_affected(), 0, "{change}");
    }
    connection.close().await.expect("closed");
}

async fn started(folder: &Path) -> (TestServer, Arc<dyn Store>) {
    let store = SqliteStore::open(folder).await.expect("a store");
    let store: Arc<dyn Store> = Arc::new(store);
    (TestServer::with(|_| {}, Arc::clone(&store)).await, store)
}

async fn created_tournament(channel: &Connection, name: &str) -> String {
    let mut service = TournamentServiceClient::new(channel.clone());
    let request = v1::CreateTournamentRequest {
        settings: Some(v1::TournamentSettings {
            name: name.into(),
            format: v1::TournamentFormat::RoundRobin.into(),
            ..v1::TournamentSettings::default()
        }),
        ..v1::CreateTournamentRequest::default()
    };
    let created = service.create_tournament(request).await.expect("valid");
    let tournament = created.into_inner().tournament.expect("a tournament");
    tournament.tournament_id
}

async fn created_study(channel: &Connection) -> (String, String) {
    let mut service = StudyServiceClient::new(channel.clone());
    let request = v1::CreateStudyRequest {
        settings: Some(settings()),
        ..v1::CreateStudyRequest::default()
    };
    let created = service
        .create_study(request)
        .await
        .expect("valid")
        .into_inner();
    let study = created.study.expect("a study");
    (study.study_id, created.owner_token)
}

/// The games of a stream and what it could not read.
async fn streamed(
    service: &mut RecordServiceClient<Connection>,
    after: &str,
) -> Result<(Vec<String>, Vec<String>), tonic::Status> {
    let request = v1::StreamRecordsRequest {
        after: after.into(),
        ..v1::StreamRecordsRequest::default()
    };
    let parts = service.stream_records(request).await?.into_inner();
    let parts: Vec<_> = parts.try_collect().await?;
    let (mut games, mut unreadable) = (Vec::new(), Vec::new());
    for part in parts {
        unreadable.extend(part.unreadable.map(|record| record.game_id));
        games.extend(part.lines.into_iter().filter_map(|line| match line.line {
            Some(Line::Header(header)) => Some(header.game_id),
            _ => None,
        }));
    }
    Ok((games, unreadable))
}

#[tokio::test(flavor = "multi_thread")]
async fn what_cannot_be_read_ends_no_list_of_others() {
    let folder = tempfile::tempdir().expect("a folder");
    let (server, store) = started(folder.path()).await;
    let client = server.client().await;
    let channel = server.channel().await;
    let mut games = Vec::new();
    for _ in 0..5 {
        let request = v1::CreateRoomRequest {
            rules: Some(one_shift()),
            seats: ["greedy", "random", "random_unmasked", "trained"]
                .map(built_in)
                .into(),
            ..v1::CreateRoomRequest::default()
        };
        games.push(ended(&client, request).await.room.game_id);
    }
    // Rooms that wait.
    let mut waiting = Vec::new();
    for _ in 0..2 {
        let created = client.create_room(v1::CreateRoomRequest::default()).await;
        let room = created.expect("a room").room.expect("a room");
        waiting.push((room.room_id, room.game_id));
    }
    let mut tournaments = Vec::new();
    for name in ["bad", "good"] {
        tournaments.push(created_tournament(&channel, name).await);
    }
    let (bad_study, bad_token) = created_study(&channel).await;
    let (study, token) = created_study(&channel).await;
    patiently("the server to stop", server.stop()).await;
    drop(store);

    let of_game = |game: &str| format!("(SELECT number FROM games WHERE game_id = x'{game}')");
    damage(
        folder.path(),
        &[
            format!(
                "UPDATE journal SET entries = x'ff' WHERE game = {}",
                of_game(&games[1])
            ),
            format!(
                "UPDATE games SET summary = x'ff' WHERE game_id = x'{}'",
                games[2]
            ),
            format!(
                "UPDATE games SET header = x'ff' WHERE game_id = x'{}'",
                waiting[0].1
            ),
            format!(
                "UPDATE tournaments SET header = x'ff' WHERE tournament_id = x'{}'",
                tournaments[0]
            ),
            format!("UPDATE studies SET header = x'ff' WHERE study_id = x'{bad_study}'"),
        ],
    )
    .await;

    let (server, store) = started(folder.path()).await;
    let channel = server.channel().await;
    let mut records = RecordServiceClient::new(channel.clone());
    let listed = records
        .list_records(v1::ListRecordsRequest::default())
        .await;
    let listed = listed.expect("a list").into_inner().records;
    let listed: Vec<String> = listed.into_iter().map(|record| record.game_id).collect();
    let readable = [0, 1, 3, 4].map(|index| games[index].clone());
    assert_eq!(listed, readable);
    // The one whose summary is damaged is named to the operator alone: nothing says who may see it.
    let all = streamed(&mut records, "").await.expect("a stream");
    let whole = [0, 3, 4].map(|index| games[index].clone());
    assert_eq!(all, (whole.to_vec(), vec![games[1].clone()]));
    // It resumes after any of them.
    for (after, expected) in [
        (0, &whole[1..]),
        (1, &whole[1..]),
        (3, &whole[2..]),
        (4, &[]),
    ] {
        let (rest, _) = streamed(&mut records, &games[after])
            .await
            .expect("a stream");
        assert_eq!(rest, expected, "after {after}");
    }
    for after in ["00112233445566778899aabbccddeeff", "nonsense", &games[2]] {
        let refused = streamed(&mut records, after).await.expect_err(after);
        assert_eq!(
            (refused.code(), reason(&refused).as_str()),
            (Code::NotFound, "GAME_UNKNOWN")
        );
    }
    for (game, expected) in [
        (&games[1], (Code::DataLoss, "RECORD_UNREADABLE")),
        (&games[2], (Code::NotFound, "GAME_UNKNOWN")),
    ] {
        let request = v1::GetRecordRequest {
            game_id: game.clone(),
        };
        let refused = records.get_record(request).await.expect_err("damaged");
        assert_eq!((refused.code(), reason(&refused).as_str()), expected);
    }

    let mut service = RoomServiceClient::new(channel.clone());
    let rooms = service.list_rooms(v1::ListRoomsRequest::default()).await;
    let rooms = rooms.expect("a list").into_inner().rooms;
    let ids: BTreeSet<String> = rooms.into_iter().map(|room| room.room_id).collect();
    assert!(ids.contains(&waiting[1].0) && !ids.contains(&waiting[0].0));

    let mut service = TournamentServiceClient::new(channel.clone());
    let list = service
        .list_tournaments(v1::ListTournamentsRequest::default())
        .await;
    let list = list.expect("a list").into_inner().tournaments;
    let ids: Vec<&String> = list.iter().map(|it| &it.tournament_id).collect();
    assert_eq!(ids, [&tournaments[1]]);
    let board = service
        .get_leaderboard(v1::GetLeaderboardRequest::default())
        .await;
    assert_eq!(board.expect("a board").into_inner().games, 4);

    let mut service = StudyServiceClient::new(channel.clone());
    let request = v1::ListStudiesRequest {
        owner_tokens: vec![bad_token, token.clone()],
    };
    let list = service
        .list_studies(request)
        .await
        .expect("a list")
        .into_inner();
    let ids: Vec<&String> = list.studies.iter().map(|it| &it.study_id).collect();
    assert_eq!(ids, [&study]);
    let request = v1::ExportStudyRequest {
        study_id: study,
        owner_token: token,
        test: false,
    };
    let files = service
        .export_study(request)
        .await
        .expect("an export")
        .into_inner();
    let files: Vec<_> = files.try_collect().await.expect("whole");
    for file in ["traces.csv", "datapackage.json"] {
        let is_there = files.iter().any(|part| part.file == file);
        assert!(is_there, "it is complete: {file}");
    }

    let (sender, mut lines) = tokio::sync::mpsc::channel(1_000);
    let data = ParticipantData::new(Arc::clone(&store), None);
    let who = Named {
        name: "greedy".into(),
        fingerprint: None,
    };
    let skipped = data.export(&who, &sender).await.expect("an export");
    drop(sender);
    let mut exported = 0;
    while lines.recv().await.is_some() {
        exported += 1;
    }
    // Built-in agents are no participants, but what cannot be read may have the name.
    assert!(exported < 1_000);
    for game in [&games[1], &games[2], &bad_study] {
        assert!(
            skipped.named.iter().any(|it| it.contains(game.as_str())),
            "{skipped:?}"
        );
    }
    drop(store);
    patiently("the server to stop", server.stop()).await;
}
