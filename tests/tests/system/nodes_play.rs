//! Play through a node that does not have the room: agents of the SDK with seats of several nodes on
//! one stream, their clocks, lost connections between nodes, spectators, and participants of a
//! tournament.

use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::Duration;

use chefshat_client::{Client, RandomAgent};
use chefshat_proto::v1::{self, play_service_client::PlayServiceClient, seat_update::Update};
use chefshat_record::replay::replay;
use chefshat_tests::{
    Held, Ledger, StreamSeat, TestNodes, first_legal, first_update, one_shift, patiently, play_on,
    random_agents, until_watched_by, watched,
};
use futures::future::join_all;

use crate::tournament_deals::streamed;

/// A room of one Shift at a node, and the tickets of its seats, joined through another node.
async fn room(nodes: &TestNodes, node: usize, through: &Client) -> (String, Vec<String>) {
    let created = nodes.create_room(
        node,
        v1::CreateRoomRequest {
            rules: Some(one_shift()),
            ..v1::CreateRoomRequest::default()
        },
    );
    let created = created.await;
    let mut tickets = Vec::new();
    for seat in 0..4 {
        let request = v1::JoinRoomRequest {
            join_code: created.join_code.clone(),
            name: format!("agent {seat}"),
            seat: Some(seat),
            ..v1::JoinRoomRequest::default()
        };
        let joined = through.join(request).await.expect("a free seat");
        tickets.push(joined.ticket);
    }
    (created.room.expect("a room").room_id, tickets)
}

/// Checks the record of a game at its node: it verifies, and nobody but agents decided.
async fn check_record(nodes: &TestNodes, node: usize, game: &str) -> Vec<v1::RecordLine> {
    let owner = nodes.nodes[node].client().await;
    let record = owner.record(game).await.expect("a record");
    replay(&record).expect("a valid record");
    for line in &record {
        if let Some(v1::record_line::Line::Decision(decision)) = &line.line {
            assert_eq!(decision.source(), v1::DecisionSource::Agent, "{decision:?}");
        }
    }
    record
}

/// The next update of a stream, a refusal.
async fn refused(seat: &mut StreamSeat) -> v1::Refused {
    match seat.next().await {
        Update::Refused(refused) => refused,
        other => panic!("not refused, but {other:?}"),
    }
}

/// Why a seat is detached.
async fn detached(seat: &mut StreamSeat) -> v1::DetachReason {
    loop {
        match seat.next().await {
            Update::Detached(detached) => return detached.reason(),
            Update::Decision(_) => {}
            other => panic!("{other:?}"),
        }
    }
}

#[tokio::test]
async fn one_stream_plays_rooms_of_three_nodes_to_the_end() {
    let nodes = TestNodes::start(3).await;
    let client = nodes.nodes[0].client().await;
    let mut tickets = Vec::new();
    for node in [0, 1, 2, 1] {
        tickets.extend(room(&nodes, node, &client).await.1);
    }
    let playing = client.play_many(random_agents(tickets));
    let mut outcomes = Vec::new();
    for outcome in patiently("the games to end", playing).await {
        outcomes.push(outcome.expect("played"));
    }
    for (number, node) in [0, 1, 2, 1].into_iter().enumerate() {
        let game = &outcomes[4 * number].game_id;
        assert!(
            outcomes[4 * number..][..4]
                .iter()
                .all(|it| it.game_id == *game)
        );
        check_record(&nodes, node, game).await;
    }
}

#[tokio::test]
async fn seats_are_played_step_by_step_and_detached_through_another_node() {
    let nodes = TestNodes::start(2).await;
    let client = nodes.nodes[0].client().await;
    let (room_id, tickets) = room(&nodes, 1, &client).await;
    let mut seats = vec![StreamSeat::attached(client.channel(), &tickets[0]).await];
    // Before the game starts, refusals are all that comes.
    let resume = v1::seat_command::Command::Resume(v1::ResumeSeat {});
    seats[0].send_to(9, resume).await;
    assert_eq!(refused(&mut seats[0]).await.reason, "HANDLE_UNKNOWN");
    // A ticket that nobody has, and one that the room does not know.
    for (request_id, ticket) in [
        (5, "ab".repeat(48)),
        (6, format!("{room_id}{}", "ab".repeat(32))),
    ] {
        let attach = v1::Attach {
            ticket,
            request_id,
            ..v1::Attach::default()
        };
        seats[0].attach(attach).await;
        let refusal = refused(&mut seats[0]).await;
        assert_eq!(refusal.reason, "TICKET_UNKNOWN");
        assert_eq!(refusal.request_id, request_id);
    }
    // The second stream with a seat detaches the first.
    for ticket in &tickets[1..] {
        seats.push(StreamSeat::attached(client.channel(), ticket).await);
    }
    let newer = StreamSeat::attached(client.channel(), &tickets[3]).await;
    let mut older = std::mem::replace(&mut seats[3], newer);
    assert_eq!(detached(&mut older).await, v1::DetachReason::Superseded);
    let playing = join_all(seats.iter_mut().map(play_on));
    let ends = patiently("the game to end", playing).await;
    assert!(
        ends.iter().all(|end| *end == v1::DetachReason::GameOver),
        "{ends:?}"
    );
    for seat in &mut seats {
        seat.half_close();
        assert!(seat.next_or_end().await.expect("no error").is_none());
    }
}

#[tokio::test]
async fn the_network_between_nodes_costs_no_seat_its_time() {
    let nodes = TestNodes::start(2).await;
    let client = nodes.nodes[0].client().await;
    let (_, tickets) = room(&nodes, 1, &client).await;
    let mut seats = Vec::new();
    for ticket in &tickets {
        seats.push(StreamSeat::attached(client.channel(), ticket).await);
    }
    // There and back. If it counted, each decision would take longer than this.
    let delay = Duration::from_millis(700);
    nodes.link(0, 1).delay(delay);
    let mut least = Duration::MAX;
    let game = async {
        while least >= delay {
            let (update, number) = first_update(&mut seats).await;
            match update {
                Update::Decision(decision) => {
                    let action = first_legal(&decision);
                    seats[number].answer(decision.decision_id, action).await;
                }
                Update::Result(result) => {
                    assert_eq!(result.status(), v1::AnswerStatus::Accepted);
                    least = least.min(Duration::from_micros(result.decision_time_us));
                }
                other => panic!("{other:?}"),
            }
        }
    };
    patiently("a decision that took less than the network", game).await;
}

#[tokio::test]
async fn games_are_finished_although_the_connection_between_nodes_is_cut() {
    let nodes = TestNodes::start(2).await;
    let client = nodes.nodes[0].client().await;
    let (_, mut tickets) = room(&nodes, 1, &client).await;
    // The seats of another room, at the gateway itself, are attached again too.
    tickets.extend(room(&nodes, 0, &client).await.1);
    let ledger = Arc::new(Ledger::default());
    let agents =
        (random_agents(tickets).into_iter()).map(|(ticket, agent)| (ticket, ledger.wrap(agent)));
    let playing = client.play_many(agents);
    let cutting = async {
        for decisions in [10, 20] {
            ledger.reaches(decisions).await;
            nodes.link(0, 1).cut();
        }
    };
    let (outcomes, ()) =
        patiently("the games to end", futures::future::join(playing, cutting)).await;
    ledger.assert_nothing_unexpected();
    let game = outcomes[0].as_ref().expect("played").game_id.clone();
    let record = check_record(&nodes, 1, &game).await;
    ledger.assert_committed(&game, &record);
}

#[tokio::test]
async fn a_spectator_at_another_node_sees_what_one_at_the_owner_sees() {
    let nodes = TestNodes::start(2).await;
    let client = nodes.nodes[0].client().await;
    let (room_id, tickets) = room(&nodes, 1, &client).await;
    let at_owner = nodes.nodes[1].client().await;
    let watch = async |client: &Client| {
        let mut spectator = client.spectate(&room_id, 0);
        let mut events = Vec::new();
        while let Some(event) = spectator.next().await.expect("no error") {
            events.push(event);
        }
        events
    };
    let playing = client.play_many(random_agents(tickets));
    let watching = join_all([&client, &client, &at_owner].map(watch));
    let all = futures::future::join(watching, playing);
    let (seen, _) = patiently("the game to end", all).await;
    assert!(seen[0].len() > 20);
    assert!(seen.iter().all(|events| *events == seen[2]));
}

#[tokio::test]
async fn spectators_who_share_a_stream_are_all_counted() {
    let nodes = TestNodes::start(2).await;
    let gateway = nodes.nodes[0].client().await;
    let (room_id, _) = room(&nodes, 1, &gateway).await;
    let owner = nodes.nodes[1].client().await;
    let all = [&gateway, &owner, &gateway, &gateway];
    let mut watching = Vec::from(all.map(|client| watched(client, &room_id)));
    until_watched_by(&gateway, &room_id, watching.len()).await;
    while let Some(spectator) = watching.pop() {
        spectator.abort();
        for client in [&gateway, &owner] {
            until_watched_by(client, &room_id, watching.len()).await;
        }
    }
}

#[tokio::test]
async fn a_seat_is_watched_and_played_with_single_calls_through_another_node() {
    let nodes = TestNodes::start(2).await;
    let client = nodes.nodes[0].client().await;
    let (_, mut tickets) = room(&nodes, 1, &client).await;
    let own = tickets.pop().expect("four tickets");
    let mut service = PlayServiceClient::new(client.channel());
    let watching = service.watch(v1::PlayServiceWatchRequest {
        seats: vec![v1::Attach {
            ticket: own.clone(),
            ..v1::Attach::default()
        }],
    });
    let mut updates = watching.await.expect("a stream").into_inner();
    let act = |command| v1::ActRequest {
        ticket: own.clone(),
        command: Some(command),
    };
    let expression = v1::Expression {
        label: "joy".into(),
        ..v1::Expression::default()
    };
    let express = v1::act_request::Command::Express(expression);
    service.act(act(express)).await.expect("expressed");
    let one_seat = async {
        let mut service = PlayServiceClient::new(client.channel());
        let mut accepted = 0;
        while let Some(response) = updates.message().await.expect("no error") {
            for update in response.updates {
                match update.update {
                    Some(Update::Decision(decision)) => {
                        let answer = v1::act_request::Command::Answer(v1::Answer {
                            decision_id: decision.decision_id,
                            action: first_legal(&decision),
                            annotations: None,
                        });
                        let acted = service.act(act(answer)).await.expect("answered");
                        let result = acted.into_inner().result.expect("a result");
                        assert_eq!(result.status(), v1::AnswerStatus::Accepted);
                        accepted += 1;
                    }
                    Some(Update::Detached(detached)) => {
                        assert_eq!(detached.reason(), v1::DetachReason::GameOver);
                        return accepted;
                    }
                    _ => {}
                }
            }
        }
        accepted
    };
    let others = client.play_many(random_agents(tickets));
    let both = futures::future::join(one_seat, others);
    let (accepted, _) = patiently("the game to end", both).await;
    assert!(accepted > 0);
}

#[tokio::test]
async fn participants_play_a_tournament_of_another_node() {
    let nodes = TestNodes::start(2).await;
    let owner = nodes.nodes[1].client().await;
    let settings = v1::TournamentSettings {
        name: "Coppa".into(),
        format: v1::TournamentFormat::RoundRobin.into(),
        rounds: 2,
        rules: Some(one_shift()),
        start_when_joined: 4,
        ..v1::TournamentSettings::default()
    };
    let created = owner.create_tournament(settings).await.expect("created");
    let id = created.tournament.expect("a tournament").tournament_id;
    nodes.place(1, &id, &created.join_code);
    let client = nodes.nodes[0].client().await;
    let mut tickets = Vec::new();
    for number in 0..4 {
        let joined = client.join_tournament(v1::JoinTournamentRequest {
            join_code: created.join_code.clone(),
            name: format!("agent {number}"),
            ..v1::JoinTournamentRequest::default()
        });
        tickets.push(joined.await.expect("a free place").ticket);
    }
    let playing = (0..).zip(tickets).map(|(number, ticket)| {
        let client = client.clone();
        async move {
            client
                .play_tournament(ticket, |_| RandomAgent::new(number))
                .await
        }
    });
    let played = patiently("the tournament to end", join_all(playing)).await;
    let mut games = BTreeSet::new();
    for outcomes in played {
        let outcomes = outcomes.expect("played");
        assert_eq!(outcomes.len(), 2);
        for outcome in outcomes {
            check_record(&nodes, 0, &outcome.game_id).await;
            games.insert(outcome.game_id);
        }
    }
    assert_eq!(streamed(&client).await, games);
}

#[tokio::test]
async fn the_newest_stream_has_a_seat_through_whichever_node_it_comes() {
    let nodes = TestNodes::start(3).await;
    let mut clients = Vec::new();
    for node in [0, 1, 2, 0] {
        clients.push(nodes.nodes[node].client().await);
    }
    let (_, tickets) = room(&nodes, 2, &clients[0]).await;
    let mut others = Vec::new();
    for ticket in &tickets[1..] {
        others.push(StreamSeat::attached(clients[1].channel(), ticket).await);
    }
    let mut newest = StreamSeat::attached(clients[0].channel(), &tickets[0]).await;
    for client in &clients[1..] {
        let newer = StreamSeat::attached(client.channel(), &tickets[0]).await;
        let mut older = std::mem::replace(&mut newest, newer);
        assert_eq!(detached(&mut older).await, v1::DetachReason::Superseded);
    }
    others.push(newest);
    let playing = join_all(others.iter_mut().map(play_on));
    let ends = patiently("the game to end", playing).await;
    let over = |end: &v1::DetachReason| *end == v1::DetachReason::GameOver;
    assert!(ends.iter().all(over), "{ends:?}");
}

#[tokio::test]
async fn a_stream_that_its_client_has_left_takes_no_seat_although_another_node_sends_it_late() {
    let nodes = TestNodes::start(3).await;
    let (gateway, other) = (nodes.nodes[0].client().await, nodes.nodes[1].client().await);
    let (_, tickets) = room(&nodes, 2, &other).await;
    let late = nodes.link(0, 2);
    late.way().hold(Held::Everything);
    let left = StreamSeat::open(gateway.channel()).await;
    let attach = v1::Attach {
        ticket: tickets[0].clone(),
        ..v1::Attach::default()
    };
    left.attach(attach).await;
    let mut seats = Vec::new();
    for ticket in &tickets {
        seats.push(StreamSeat::attached(other.channel(), ticket).await);
    }
    drop(left);
    late.way().hold(Held::Nothing);
    let playing = join_all(seats.iter_mut().map(play_on));
    let ends = patiently("the game to end", playing).await;
    let over = |end: &v1::DetachReason| *end == v1::DetachReason::GameOver;
    assert!(ends.iter().all(over), "{ends:?}");
}
