//! A tournament with a physical table among virtual ones: two persons at the table, agents in this
//! process, built-in agents, a crash of the server in the middle of a physical game, and a game that
//! is closed and played again.

use std::collections::{BTreeMap, BTreeSet};

use chefshat_client::{Client, RandomAgent};
use chefshat_engine::{BySeat, Seat, Seed};
use chefshat_proto::v1::{self, TournamentGameState, record_line::Line};
use chefshat_record::convert::rules_from_proto;
use chefshat_tests::{Launch, patiently};
use serde_json::Value;

use crate::physical::{chefshat, restarted};
use crate::table_bridge::Bridge;

const AT_TABLE: [&str; 2] = ["Ada", "Bo"];
const AGENTS: [&str; 2] = ["Cem", "Dia"];
/// Two tables in each round.
const ROUNDS: u32 = 3;

/// The draw has games with both persons, with one of them and with none.
fn settings() -> v1::TournamentSettings {
    v1::TournamentSettings {
        name: "Coppa".into(),
        format: v1::TournamentFormat::RoundRobin.into(),
        rounds: ROUNDS,
        rules: Some(v1::RuleSet {
            stop: Some(v1::rule_set::Stop::TargetShifts(1)),
            // A decline is seen by nobody, so the truth could not follow it.
            special_actions: Some(false),
            ..v1::RuleSet::default()
        }),
        policy: Some(v1::RoomPolicy {
            pace_ms: Some(0),
            decision_time_ms: Some(600_000),
            ..v1::RoomPolicy::default()
        }),
        built_in_agents: ["greedy", "greedy", "random", "random"]
            .map(String::from)
            .into(),
        no_show_time_ms: 600_000,
        draw_seed: vec![7; 32],
        physical_tables: 1,
        ..v1::TournamentSettings::default()
    }
}

/// The organiser: a client with the owner token.
struct Organiser {
    client: Client,
    server: String,
    tournament_id: String,
    owner_token: String,
}

impl Organiser {
    async fn command(&self, action: &str, words: &[&str]) -> Value {
        let owned = [
            "--owner-token",
            &self.owner_token,
            "--server",
            &self.server,
            "--json",
        ];
        let arguments = [
            &["tournament", action, &self.tournament_id],
            words,
            &owned[..],
        ];
        let line = chefshat(&arguments.concat()).await;
        serde_json::from_str(&line).expect("a JSON line")
    }

    async fn games(&self) -> Vec<v1::TournamentGame> {
        let request = v1::ListTournamentGamesRequest {
            tournament_id: self.tournament_id.clone(),
            ..v1::ListTournamentGamesRequest::default()
        };
        let page = self.client.tournament_games(request).await;
        page.expect("a page").games
    }

    /// Why the table of a game is refused.
    async fn refusal(&self, owner_token: &str, game: u32) -> String {
        let table = (self.client).physical_table(&self.tournament_id, owner_token, game);
        let refused = table.await.expect_err("a refusal");
        refused.reason().expect("a reason").to_owned()
    }
}

/// The physical game in progress. There is one table, so there is at most one.
fn at_the_table(games: &[v1::TournamentGame]) -> Option<&v1::TournamentGame> {
    let mut playing = games
        .iter()
        .filter(|game| game.physical && game.state() == TournamentGameState::Playing);
    let game = playing.next();
    assert_eq!(playing.next(), None, "two games at one table");
    game
}

#[tokio::test(flavor = "multi_thread")]
async fn a_physical_table_takes_part_in_a_tournament() {
    let data = tempfile::tempdir().expect("a temporary folder");
    let mut launch = Launch::new(data.path());
    let mut server = launch.start().await.expect("the server starts");
    let client = Client::connect(launch.url()).await.expect("it listens");
    let created = client.create_tournament(settings()).await.expect("created");
    let organiser = Organiser {
        client: client.clone(),
        server: launch.url(),
        tournament_id: created.tournament.expect("a tournament").tournament_id,
        owner_token: created.owner_token,
    };
    let id = organiser.tournament_id.as_str();
    let mut at_table = BTreeSet::new();
    for name in AT_TABLE {
        let added = organiser.command("add", &["--name", name]).await;
        at_table.insert(added["participant"].as_u64().expect("a number"));
    }
    let mut agents = Vec::new();
    for (seed, name) in (0..).zip(AGENTS) {
        let request = v1::JoinTournamentRequest {
            join_code: created.join_code.clone(),
            name: name.into(),
            max_games: 2,
            ..v1::JoinTournamentRequest::default()
        };
        let joined = client.join_tournament(request).await.expect("joined");
        let client = client.clone();
        agents.push(tokio::spawn(async move {
            let agent = |_: &v1::Attached| RandomAgent::new(seed);
            client.play_tournament(joined.ticket, agent).await
        }));
    }
    let start = client.start_tournament(id, organiser.owner_token.as_str());
    let started = start.await.expect("started");
    for participant in &started.participants {
        let number = u64::from(participant.participant);
        assert_eq!(participant.at_table, at_table.contains(&number));
        assert!(participant.connected || !participant.at_table);
    }
    let rules = started.settings.and_then(|settings| settings.rules);
    let rules = rules_from_proto(&rules.expect("rules")).expect("valid rules");

    let mut follower = client.follow_tournament(id);
    let mut played: BTreeMap<u32, Bridge> = BTreeMap::new();
    let mut closed: Option<(u32, String)> = None;
    while let Some(report) = patiently("a report", follower.next())
        .await
        .expect("it follows")
    {
        let games = organiser.games().await;
        let is_over = |game: &v1::TournamentGame| {
            let closed = closed
                .as_ref()
                .is_some_and(|(_, room)| *room == game.room_id);
            closed || played.contains_key(&game.game)
        };
        let Some(game) = at_the_table(&games).filter(|game| !is_over(game)) else {
            continue;
        };
        let table = client.physical_table(id, organiser.owner_token.as_str(), game.game);
        let table = match table.await {
            Ok(table) => table,
            // Another report follows when its room is there.
            Err(refused) if refused.reason() == Some("GAME_NOT_STARTED") => continue,
            Err(refused) => panic!("{refused} after {report:?}"),
        };
        assert_eq!(table.room_id, game.room_id);
        let seats = BySeat::from_fn(4, |seat: Seat| {
            at_table.contains(&game.seats[seat.index()].participant.into())
        });
        let seed = Seed([u8::try_from(game.game).expect("few"); 32]);
        let ticket = table.table_ticket.clone();
        let mut bridge = Bridge::attach(&client, &game.room_id, ticket, rules, seed, seats).await;
        while bridge.state.stage() == v1::TableStage::Waiting {
            bridge.next_state().await;
        }
        // The second game cannot continue. It is called again, in another room.
        if played.len() == 1 && closed.is_none() {
            let close = client.close_room(&table.room_id, table.owner_token);
            close.await.expect("closed");
            closed = Some((game.game, table.room_id));
            continue;
        }
        if played.is_empty() {
            let number = game.game.to_string();
            let shown = organiser.command("table", &[&number]).await;
            let link = format!(
                "{}/rooms/{}/table#ticket={}",
                organiser.server, table.room_id, table.table_ticket
            );
            assert_eq!(shown["attendant_link"], link);
            let waiting = games
                .iter()
                .find(|game| game.physical && game.state() == TournamentGameState::Due);
            let waiting = waiting.expect("a game that waits for the table").game;
            let refused = organiser.refusal(&organiser.owner_token, waiting).await;
            assert_eq!(refused, "GAME_NOT_STARTED");

            bridge.until(|it| it.reports > 20).await;
            server = restarted(&mut launch, server).await;
            bridge.next_state().await;
            assert_eq!(organiser.command("table", &[&number]).await, shown);
        }
        bridge.until(|_| false).await;
        played.insert(game.game, bridge);
    }
    for agent in agents {
        let outcomes = patiently("the agents", agent).await.expect("no panic");
        outcomes.expect("it took part to the end");
    }

    let games = organiser.games().await;
    assert_eq!(games.len(), 2 * usize::try_from(ROUNDS).expect("few"));
    let closed = closed.expect("one game").0;
    let mut persons = BTreeSet::new();
    for game in &games {
        assert_eq!(game.state(), TournamentGameState::Counted);
        assert_eq!(game.calls, 1 + u32::from(game.game == closed));
        assert!(game.rated, "no substitute played");
        let seats = game.seats.iter();
        let present = seats.filter(|seat| at_table.contains(&seat.participant.into()));
        let present = present.count();
        persons.insert(present);
        assert_eq!(game.physical, present > 0);
        let record = client.record(&game.game_id).await.expect("a record");
        match played.get(&game.game) {
            Some(bridge) => bridge.assert_recorded(&record),
            None => assert!(!game.physical),
        }
        let Some(Line::Header(header)) = &record[0].line else {
            panic!("no header");
        };
        assert_eq!(header.tournament_id, id);
        assert_eq!(header.origin() == v1::GameOrigin::Physical, game.physical);
        let names = header.seats.iter().map(|seat| seat.name.as_str());
        assert_eq!(
            names.filter(|name| AT_TABLE.contains(name)).count(),
            present
        );
    }
    assert_eq!(persons, BTreeSet::from([0, 1, 2]), "games of every sort");
    let results = client.tournament_results(id).await.expect("results");
    let tournament = results.tournament.expect("a tournament");
    assert_eq!(tournament.state(), v1::TournamentState::Finished);
    assert_eq!(results.standings.len(), 8);
    assert!((results.standings.iter()).all(|standing| standing.games == ROUNDS));

    let virtual_game = games.iter().find(|game| !game.physical).expect("one").game;
    let over = *played.keys().next().expect("one");
    let owner = organiser.owner_token.as_str();
    for (owner, game, reason) in [
        (owner, over, "GAME_OVER"),
        (owner, virtual_game, "GAME_NOT_PHYSICAL"),
        (owner, 99, "GAME_UNKNOWN"),
        (created.join_code.as_str(), over, "OWNER_TOKEN_WRONG"),
    ] {
        assert_eq!(organiser.refusal(owner, game).await, reason);
    }
    let ended = server.stop().await;
    assert!(ended.status.success(), "{ended:?}");
}
