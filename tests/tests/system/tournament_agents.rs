//! Agents of the Rust SDK in tournaments: several games at a time, an outcome for each game, and
//! lost connections in mid-game.

use std::collections::BTreeSet;
use std::net::SocketAddr;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};

use chefshat_client::{ActionId, Agent, Client, Outcome, PlayError, RandomAgent};
use chefshat_proto::v1;
use chefshat_tests::{TestServer, one_shift, patiently};
use futures::future::join_all;
use tokio::net::{TcpListener, TcpStream};
use tokio_util::sync::CancellationToken;

const AGENTS: u32 = 4;

/// A tournament of three rounds in which four agents meet, and the tickets of all four.
async fn round_robin(client: &Client) -> (String, Vec<String>) {
    let settings = v1::TournamentSettings {
        name: "Coppa".into(),
        format: v1::TournamentFormat::RoundRobin.into(),
        rounds: 3,
        games_per_pairing: 2,
        rules: Some(one_shift()),
        start_when_joined: AGENTS,
        ..v1::TournamentSettings::default()
    };
    let made = client.create_tournament(settings).await.expect("created");
    let tournament = made.tournament.expect("a tournament");
    let mut tickets = Vec::new();
    for number in 0..AGENTS {
        let request = v1::JoinTournamentRequest {
            join_code: made.join_code.clone(),
            name: format!("agent {number}"),
            max_games: 2,
            ..v1::JoinTournamentRequest::default()
        };
        let joined = client.join_tournament(request).await.expect("a free place");
        assert_eq!(joined.participant, number);
        tickets.push(joined.ticket);
    }
    (tournament.tournament_id, tickets)
}

/// Checks that the participants' outcomes equal what the server has counted.
async fn compare(client: &Client, tournament_id: &str, played: &[Vec<Outcome>]) {
    let request = v1::ListTournamentGamesRequest {
        tournament_id: tournament_id.to_owned(),
        ..v1::ListTournamentGamesRequest::default()
    };
    let games = client
        .tournament_games(request)
        .await
        .expect("a page")
        .games;
    assert_eq!(games.len(), 6);
    for game in &games {
        assert_eq!(game.state(), v1::TournamentGameState::Counted);
        assert!(game.rated, "no forfeit and no substitute");
        for (seat, line) in (0..).zip(&game.seats) {
            let outcomes = &played[line.participant as usize];
            let outcome = outcomes
                .iter()
                .find(|outcome| outcome.game_id == game.game_id);
            let outcome = outcome.expect("every participant has an outcome for each game");
            assert_eq!((outcome.seat, &outcome.room_id), (seat, &game.room_id));
            let standing = outcome.standing().expect("a result");
            assert_eq!((standing.place, standing.points), (line.place, line.points),);
        }
    }
    for outcomes in played {
        assert_eq!(outcomes.len(), games.len());
    }
    let results = client
        .tournament_results(tournament_id)
        .await
        .expect("results");
    let state = results.tournament.expect("a tournament").state();
    assert_eq!(state, v1::TournamentState::Finished);
    assert_eq!(results.standings.len(), played.len());
}

#[tokio::test]
async fn four_agents_play_a_tournament_to_its_end() {
    let server = TestServer::start().await;
    let client = server.client().await;
    let (tournament_id, tickets) = round_robin(&client).await;
    let mut follower = client.follow_tournament(tournament_id.as_str());
    let following = async {
        let mut last = None;
        while let Some(report) = follower.next().await.expect("an update") {
            last = report.tournament;
        }
        last.expect("at least one report")
    };
    let playing = join_all(tickets.into_iter().zip(0..).map(|(ticket, seed)| {
        let make = move |_: &v1::Attached| RandomAgent::new(seed);
        client.play_tournament(ticket, make)
    }));
    let both = async { tokio::join!(playing, following) };
    let (played, last) = patiently("the tournament to end", both).await;
    assert_eq!(last.state(), v1::TournamentState::Finished);
    assert_eq!(last.games_over, 6);
    let played: Vec<_> = (played.into_iter())
        .map(|outcomes| outcomes.expect("it took part to the end"))
        .collect();
    compare(&client, &tournament_id, &played).await;
    let leaderboard = (client
        .leaderboard(v1::GetLeaderboardRequest::default())
        .await)
        .expect("an outcome");
    assert_eq!((leaderboard.games, leaderboard.rated.len()), (6, 4));
}

/// Forwards connections to a server until they are cut.
#[derive(Clone)]
struct Proxy {
    address: SocketAddr,
    cut: Arc<Mutex<CancellationToken>>,
}

impl Proxy {
    async fn start(server: SocketAddr) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").await.expect("a free port");
        let address = listener
            .local_addr()
            .expect("a bound socket has an address");
        let cut = Arc::new(Mutex::new(CancellationToken::new()));
        let now = Arc::clone(&cut);
        tokio::spawn(async move {
            while let Ok((mut near, _)) = listener.accept().await {
                let cut = now.lock().expect("no panic").clone();
                tokio::spawn(async move {
                    let mut far = TcpStream::connect(server)
                        .await
                        .expect("the server listens");
                    let forward = tokio::io::copy_bidirectional(&mut near, &mut far);
                    let _ = cut.run_until_cancelled(forward).await;
                });
            }
        });
        Self { address, cut }
    }

    /// Cuts the current connections; new ones are forwarded.
    fn cut(&self) {
        let mut cut = self.cut.lock().expect("no panic");
        std::mem::take(&mut *cut).cancel();
    }
}

/// An agent whose connection is cut before every fifth decision of a game; it checks what it
/// receives.
struct Cutting {
    proxy: Proxy,
    cuts: Arc<AtomicUsize>,
    random: RandomAgent,
    decisions: u32,
    next_event: u64,
    asked: BTreeSet<u64>,
}

impl Agent for Cutting {
    fn decide(&mut self, request: &v1::DecisionRequest) -> ActionId {
        assert!(
            self.asked.insert(request.decision_id),
            "one request for each"
        );
        self.decisions += 1;
        if self.decisions.is_multiple_of(5) {
            self.cuts.fetch_add(1, Ordering::Relaxed);
            self.proxy.cut();
        }
        self.random.decide(request)
    }
    fn on_event(&mut self, event: &v1::GameEvent) {
        assert_eq!(event.sequence, self.next_event, "each once and in order");
        self.next_event += 1;
    }
}

#[tokio::test]
async fn a_participant_whose_connection_is_cut_continues_in_all_its_games() {
    let server = TestServer::start().await;
    let client = server.client().await;
    let (tournament_id, mut tickets) = round_robin(&client).await;
    let last = tickets.pop().expect("four tickets");
    let playing = join_all(tickets.into_iter().zip(0..).map(|(ticket, seed)| {
        client.play_tournament(ticket, move |_: &v1::Attached| RandomAgent::new(seed))
    }));
    let proxy = Proxy::start(server.address).await;
    let through =
        (Client::connect(proxy.address.to_string()).await).expect("a forwarded connection");
    let made = Arc::new(AtomicUsize::new(0));
    let cuts = Arc::new(AtomicUsize::new(0));
    let cutting = through.play_tournament(last, |_: &v1::Attached| {
        made.fetch_add(1, Ordering::Relaxed);
        Cutting {
            proxy: proxy.clone(),
            cuts: Arc::clone(&cuts),
            random: RandomAgent::new(7),
            decisions: 0,
            next_event: 1,
            asked: BTreeSet::new(),
        }
    });
    let both = async { tokio::join!(playing, cutting) };
    let (mut played, cut) = patiently("the tournament to end", both).await;
    played.push(cut);
    let played: Result<Vec<_>, PlayError> = played.into_iter().collect();
    let played = played.expect("all took part to the end");
    assert!(cuts.load(Ordering::Relaxed) > 0);
    assert_eq!(made.load(Ordering::Relaxed), 6, "one agent for each game");
    compare(&client, &tournament_id, &played).await;
}
