//! Records of finished games: listed, read, streamed, and copied from one server to another, with
//! both stores.

use std::sync::Arc;
use std::time::Duration;

use chefshat_client::Connection;
use chefshat_proto::v1::{
    self, record_line::Line, record_service_client::RecordServiceClient,
    tournament_service_client::TournamentServiceClient,
};
use chefshat_record::pseudonym::Named;
use chefshat_record::signature::SigningKey;
use chefshat_server::config::ServerConfig;
use chefshat_server::participants::ParticipantData;
use chefshat_server::store::{MemoryStore, SqliteStore, Store};
use chefshat_tests::{TestServer, one_shift, patiently, play_out, room_of_four, set_up};
use futures::TryStreamExt as _;
use tempfile::TempDir;
use tonic::{Code, Status};
use tonic_types::StatusExt as _;

use crate::played::{built_in, ended};

const GAMES: usize = 5;

/// The key that signs them.
fn key() -> SigningKey {
    SigningKey::from_seed(&[3; 32])
}

/// A server with some finished games of one Shift, and their ids in the order of creation.
async fn server_with_games(store: Arc<dyn Store>) -> (TestServer, Vec<String>) {
    let configure = |config: &mut ServerConfig| {
        config.allow_import = true;
        config.signing_key = Some(Arc::new(key()));
    };
    let server = TestServer::with(configure, store).await;
    let client = server.client().await;
    let mut games = Vec::new();
    for number in 0..GAMES {
        let durability = match number % 2 {
            0 => v1::Durability::Unspecified,
            _ => v1::Durability::Ephemeral,
        };
        let policy = v1::RoomPolicy {
            durability: durability.into(),
            ..v1::RoomPolicy::default()
        };
        let (created, tickets) = room_of_four(&client, one_shift(), policy).await;
        let room = created.room.expect("a room");
        play_out(&server, tickets).await;
        // The end of the game is sent after its commit.
        games.push(room.game_id);
    }
    (server, games)
}

async fn stores() -> Vec<(Arc<dyn Store>, Option<TempDir>)> {
    let folder = tempfile::tempdir().expect("a folder");
    let sqlite = SqliteStore::open(folder.path()).await.expect("a new one");
    vec![
        (Arc::new(MemoryStore::default()), None),
        (Arc::new(sqlite), Some(folder)),
    ]
}

async fn service(server: &TestServer) -> RecordServiceClient<Connection> {
    RecordServiceClient::new(server.channel().await)
}

async fn record(
    service: &mut RecordServiceClient<Connection>,
    game_id: &str,
) -> Result<Vec<v1::RecordLine>, Status> {
    let request = v1::GetRecordRequest {
        game_id: game_id.to_owned(),
    };
    let parts: Vec<_> = service
        .get_record(request)
        .await?
        .into_inner()
        .try_collect()
        .await?;
    Ok(parts.into_iter().flat_map(|part| part.lines).collect())
}

async fn import(
    service: &mut RecordServiceClient<Connection>,
    lines: &[v1::RecordLine],
) -> Result<v1::RecordSummary, Status> {
    let parts: Vec<_> = lines
        .chunks(100)
        .map(|lines| v1::ImportRecordRequest {
            lines: lines.to_vec(),
        })
        .collect();
    let imported = service
        .import_record(futures::stream::iter(parts))
        .await?
        .into_inner();
    Ok(imported.record.expect("a summary"))
}

pub(crate) fn reason(status: &Status) -> String {
    status
        .get_details_error_info()
        .map(|info| info.reason)
        .unwrap_or_default()
}

/// All records, page by page.
async fn listed(
    service: &mut RecordServiceClient<Connection>,
    newest_first: bool,
) -> Vec<v1::RecordSummary> {
    let mut listed = Vec::new();
    let mut page_token = String::new();
    loop {
        let request = v1::ListRecordsRequest {
            page_size: 2,
            page_token,
            newest_first,
            ..v1::ListRecordsRequest::default()
        };
        let page = service.list_records(request).await.expect("a page");
        let page = page.into_inner();
        assert!(page.records.len() <= 2);
        listed.extend(page.records);
        page_token = page.next_page_token;
        if page_token.is_empty() {
            return listed;
        }
    }
}

#[tokio::test]
async fn records_are_listed_in_pages_and_streamed_completely() {
    for (store, _folder) in stores().await {
        let (server, games) = server_with_games(store).await;
        let mut service = service(&server).await;
        let oldest_first = listed(&mut service, false).await;
        let mut newest_first = listed(&mut service, true).await;
        newest_first.reverse();
        assert_eq!(newest_first, oldest_first);
        let mut ids: Vec<String> = oldest_first.iter().map(|it| it.game_id.clone()).collect();
        let mut expected = games.clone();
        ids.sort();
        expected.sort();
        assert_eq!(ids, expected, "each once");

        let stream = service
            .stream_records(v1::StreamRecordsRequest::default())
            .await
            .expect("a stream")
            .into_inner();
        let parts: Vec<_> = patiently("the stream to end", stream.try_collect())
            .await
            .expect("no error");
        let streamed: Vec<v1::RecordLine> = parts
            .into_iter()
            .flat_map(|part: v1::StreamRecordsResponse| part.lines)
            .collect();
        let mut apart = Vec::new();
        for summary in &oldest_first {
            let lines = record(&mut service, &summary.game_id)
                .await
                .expect("a stored record");
            let replayed = chefshat_record::replay::replay(&lines).expect("a valid record");
            assert_eq!(replayed.standings, summary.standings);
            assert_eq!(replayed.signed_by, Some(key().public()));
            assert_eq!(replayed.decisions, summary.decisions);
            assert_eq!(summary.shifts, 1);
            assert_eq!(summary.state(), v1::RoomState::Finished);
            assert!(summary.ended_at_ms >= summary.created_at_ms);
            apart.extend(lines);
        }
        assert_eq!(streamed, apart, "the same as each one alone");

        for (filter, found) in [
            (
                v1::RecordFilter {
                    participant: "agent 2".into(),
                    ..v1::RecordFilter::default()
                },
                GAMES,
            ),
            (
                v1::RecordFilter {
                    participant: "nobody".into(),
                    ..v1::RecordFilter::default()
                },
                0,
            ),
            (
                v1::RecordFilter {
                    origin: v1::GameOrigin::Dealt.into(),
                    ..v1::RecordFilter::default()
                },
                GAMES,
            ),
            (
                v1::RecordFilter {
                    state: v1::RoomState::Aborted.into(),
                    ..v1::RecordFilter::default()
                },
                0,
            ),
        ] {
            let request = v1::ListRecordsRequest {
                filter: Some(filter.clone()),
                ..v1::ListRecordsRequest::default()
            };
            let page = service.list_records(request).await.expect("a page");
            assert_eq!(page.into_inner().records.len(), found, "{filter:?}");
        }
        server.stop().await;
    }
}

#[tokio::test]
async fn a_file_that_is_damaged_or_refused_ends_no_import_of_the_others() {
    let importing = |config: &mut ServerConfig| config.allow_import = true;
    let server = TestServer::with(importing, Arc::new(MemoryStore::default())).await;
    let folder = tempfile::tempdir().expect("a folder");
    let damaged = folder.path().join("damaged.jsonl");
    std::fs::write(&damaged, "{\n").expect("written");
    let fixtures = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures/records");
    let [fixed, committed] = ["fixed.jsonl", "committed.jsonl"].map(|it| fixtures.join(it));
    let refused = folder.path().join("refused.jsonl");
    let text = std::fs::read_to_string(&committed).expect("the record");
    let (header, rest) = text.split_once('\n').expect("a header");
    let without_an_event = rest.split_once('\n').expect("an event").1;
    std::fs::write(&refused, format!("{header}\n{without_an_event}")).expect("written");
    let import = async |files: &[&std::path::Path]| {
        let mut command = tokio::process::Command::new(set_up("CHEFSHAT_BIN"));
        command.args(["records", "import", "--server", &server.url()]);
        let output = patiently("the import", command.args(files).output()).await;
        output.expect("the program can be started")
    };
    let first = import(&[&fixed]).await;
    assert!(first.status.success(), "{first:?}");
    let output = import(&[&damaged, &refused, &fixed, &committed]).await;
    assert_eq!(output.status.code(), Some(1), "{output:?}");
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(said.matches("not imported: ").count(), 2, "{said}");
    assert_eq!(said.matches("already there: ").count(), 1, "{said}");
    assert_eq!(listed(&mut service(&server).await, false).await.len(), 2);
    server.stop().await;
}

#[tokio::test]
async fn a_record_is_copied_from_one_server_to_another() {
    let (first, games) = server_with_games(Arc::new(MemoryStore::default())).await;
    let lines = record(&mut service(&first).await, &games[0])
        .await
        .expect("a stored record");
    for (store, _folder) in stores().await {
        let second = TestServer::with(|config| config.allow_import = true, store).await;
        let mut service = service(&second).await;
        let summary = import(&mut service, &lines).await.expect("imported");
        assert_eq!(summary.game_id, games[0]);
        assert_eq!(summary.seats.len(), 4);
        assert_eq!(
            record(&mut service, &games[0])
                .await
                .expect("a stored record"),
            lines
        );
        let again = import(&mut service, &lines).await.expect_err("a taken id");
        assert_eq!(
            (again.code(), reason(&again).as_str()),
            (Code::AlreadyExists, "GAME_KNOWN")
        );

        let mut damaged = lines.clone();
        let line = damaged
            .iter()
            .position(|line| matches!(line.line, Some(Line::Decision(_))))
            .expect("a decision");
        if let Some(Line::Decision(decision)) = &mut damaged[line].line {
            decision.action_mask[0] ^= 1;
        }
        let refused = import(&mut service, &damaged).await.expect_err("damaged");
        assert_eq!(reason(&refused), "RECORD_REFUSED");
        assert!(
            refused.message().contains(&format!("line {}", line + 1)),
            "{refused}"
        );
        let mut forged = lines.clone();
        if let Some(Line::Header(header)) = &mut forged[0].line {
            header.created_at_ms += 1;
        }
        let refused = import(&mut service, &forged).await.expect_err("forged");
        assert_eq!(reason(&refused), "RECORD_REFUSED");
        assert!(refused.message().contains("signature"), "{refused}");
        let folder = second.stop().await;
        let file = chefshat_record::jsonl::path_of(folder.path(), &games[0]);
        assert_eq!(chefshat_record::jsonl::read(&file).expect("written"), lines);
    }
    first.stop().await;
}

#[tokio::test]
async fn unknown_and_unwanted_records_are_refused() {
    let server = TestServer::start().await;
    let client = server.client().await;
    let (created, _) = room_of_four(&client, one_shift(), v1::RoomPolicy::default()).await;
    let waiting = created.room.expect("a room").game_id;
    let mut service = service(&server).await;
    for (game, expected) in [
        (waiting.as_str(), (Code::FailedPrecondition, "GAME_RUNNING")),
        (
            "00112233445566778899aabbccddeeff",
            (Code::NotFound, "GAME_UNKNOWN"),
        ),
        ("nonsense", (Code::NotFound, "GAME_UNKNOWN")),
    ] {
        let refused = record(&mut service, game).await.expect_err(game);
        assert_eq!((refused.code(), reason(&refused).as_str()), expected);
    }
    let refused = import(&mut service, &[])
        .await
        .expect_err("imports are off");
    assert_eq!(
        (refused.code(), reason(&refused).as_str()),
        (Code::PermissionDenied, "IMPORT_OFF")
    );
    let promised = client
        .create_room(v1::CreateRoomRequest {
            policy: Some(v1::RoomPolicy {
                durability: v1::Durability::Durable.into(),
                ..v1::RoomPolicy::default()
            }),
            ..v1::CreateRoomRequest::default()
        })
        .await
        .expect_err("a memory store cannot promise this");
    assert_eq!(promised.reason(), Some("POLICY_REFUSED"));
    let request = v1::ListRecordsRequest {
        page_token: "nonsense".into(),
        ..v1::ListRecordsRequest::default()
    };
    let refused = service
        .list_records(request)
        .await
        .expect_err("not a token");
    assert_eq!(reason(&refused), "PAGE_TOKEN_REFUSED");
    let request = v1::StreamRecordsRequest {
        filter: Some(v1::RecordFilter {
            kind: 77,
            ..v1::RecordFilter::default()
        }),
        ..v1::StreamRecordsRequest::default()
    };
    let refused = service
        .stream_records(request)
        .await
        .expect_err("not a kind");
    assert_eq!(reason(&refused), "FILTER_REFUSED");
    server.stop().await;
}

#[tokio::test]
async fn a_record_without_a_participant_says_so_and_is_signed_again() {
    for (store, folder) in stores().await {
        let (server, games) = server_with_games(Arc::clone(&store)).await;
        let mut service = service(&server).await;
        let whole = record(&mut service, &games[0]).await.expect("a record");
        let replayed = chefshat_record::replay::replay(&whole).expect("it fits");
        assert_eq!(
            (replayed.signed_by, replayed.redacted),
            (Some(key().public()), false)
        );
        let name = match &whole[0].line {
            Some(Line::Header(header)) => header.seats[0].name.clone(),
            other => panic!("{other:?}"),
        };
        let data =
            ParticipantData::new(Arc::clone(&store), None).signing_with(Some(Arc::new(key())));
        let who = Named {
            name: name.clone(),
            fingerprint: None,
        };
        let deleted = data.delete(&who).await.expect("all games are over");
        assert_eq!(deleted.games, GAMES as u64, "{name}");
        for game in &games {
            let lines = record(&mut service, game).await.expect("a record");
            let replayed = chefshat_record::replay::replay(&lines).expect("it fits");
            assert_eq!(
                (replayed.signed_by, replayed.redacted),
                (Some(key().public()), true)
            );
            assert!(!serde_json::to_string(&lines).expect("JSON").contains(&name));
            let Some(Line::Footer(footer)) = lines.last().and_then(|it| it.line.as_ref()) else {
                panic!("a footer");
            };
            assert!(footer.participant_removed && !footer.parts_withheld);
        }
        server.stop().await;
        drop(folder);
    }
}

#[tokio::test]
async fn the_leaderboard_includes_games_that_end_after_a_request() {
    let server = TestServer::start().await;
    let client = server.client().await;
    let mut service = TournamentServiceClient::new(server.channel().await);
    for games in 0..=2 {
        // It is updated a moment later.
        let learnt = async {
            loop {
                let request = v1::GetLeaderboardRequest::default();
                let board = service.get_leaderboard(request).await.expect("a board");
                let board = board.into_inner();
                assert!(board.games <= games);
                if board.games == games {
                    return board;
                }
                tokio::time::sleep(Duration::from_millis(50)).await;
            }
        };
        let board = patiently("the game to be rated", learnt).await;
        let shown = if games == 0 { 0 } else { 4 };
        assert_eq!(board.rated.len(), shown);
        let request = v1::CreateRoomRequest {
            rules: Some(one_shift()),
            seats: ["greedy", "random", "random_unmasked", "trained"]
                .map(built_in)
                .into(),
            ..v1::CreateRoomRequest::default()
        };
        ended(&client, request).await;
    }
}
