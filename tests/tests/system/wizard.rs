//! Wizard of Oz: a person plays a robot's seat. For everybody in the room and for spectators it is a
//! robot's, until the record of the game says what it was.

use chefshat_proto::v1::{
    self, ExpressionSource, ParticipantKind, game_event::Kind, record_line::Line,
    seat_config::FilledBy,
};
use chefshat_record::{jsonl, outcome, replay};
use chefshat_tests::{TestServer, one_shift, patiently, random_agents};

use crate::physical::chefshat;

fn seat(filled_by: FilledBy) -> v1::SeatConfig {
    v1::SeatConfig {
        filled_by: Some(filled_by),
        ..v1::SeatConfig::default()
    }
}

fn expression(source: ExpressionSource, record_only: bool) -> v1::Expression {
    v1::Expression {
        label: "joy".into(),
        source: source.into(),
        record_only,
        ..v1::Expression::default()
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_person_who_plays_as_a_robot_is_one_until_the_record() {
    let server = TestServer::start().await;
    let client = server.client().await;
    let human = || seat(FilledBy::ReservedFor(ParticipantKind::Human.into()));
    let request = |wizard: ParticipantKind| v1::CreateRoomRequest {
        rules: Some(one_shift()),
        seats: vec![
            seat(FilledBy::Wizard(wizard.into())),
            human(),
            human(),
            human(),
        ],
        ..v1::CreateRoomRequest::default()
    };
    for not_shown in [ParticipantKind::Human, ParticipantKind::Unspecified] {
        let refused = client.create_room(request(not_shown)).await;
        assert_eq!(
            refused.expect_err("shown as nothing else").reason(),
            Some("SEATS_REFUSED")
        );
    }
    let created = client.create_room(request(ParticipantKind::Robot)).await;
    let created = created.expect("a new room");
    let room = created.room.expect("a room");
    let mut tickets = Vec::new();
    for (name, kind) in [
        ("Ada", ParticipantKind::Human),
        ("Bo", ParticipantKind::Human),
        ("Cem", ParticipantKind::Human),
        // People cannot take this seat.
        ("Dia", ParticipantKind::Human),
        ("Robbie", ParticipantKind::Robot),
    ] {
        let joined = client.join(v1::JoinRoomRequest {
            join_code: created.join_code.clone(),
            name: name.into(),
            kind: kind.into(),
            ..v1::JoinRoomRequest::default()
        });
        match joined.await {
            Ok(joined) => tickets.push(joined.ticket),
            Err(_) => assert_eq!(name, "Dia"),
        }
    }
    let [.., robot] = &tickets[..] else {
        panic!("nobody has joined");
    };
    // What the robot seems to feel; a source that would betray the seat is refused.
    let betrays = client.express(robot, expression(ExpressionSource::Wizard, false));
    assert_eq!(
        betrays.await.expect_err("refused").reason(),
        Some("EXPRESSION_REFUSED")
    );
    for record_only in [false, true] {
        let shown = client.express(robot, expression(ExpressionSource::Model, record_only));
        shown.await.expect("expressed");
    }
    // A robot speaks; people write only where the policy lets them.
    let line = || v1::Expression {
        label: "say".into(),
        media: "data:,Ciao".into(),
        ..v1::Expression::default()
    };
    client.express(robot, line()).await.expect("a robot speaks");
    let refused = client.express(&tickets[0], line()).await;
    assert_eq!(
        refused.expect_err("people do not write here").reason(),
        Some("CHAT_OFF")
    );
    let mut watching = client.spectate(&room.room_id, 0);
    let watched = async {
        let mut seen = String::new();
        while let Some(event) = watching.next().await.expect("a watched room") {
            seen += &format!("{event:?}\n");
        }
        seen
    };
    let playing = client.play_many(random_agents(tickets));
    let both = futures::future::join(watched, playing);
    let (seen, _) = patiently("the game to end", both).await;
    assert!(
        seen.contains("Robbie") && !seen.contains("Wizard"),
        "{seen}"
    );

    // The room stays as it was.
    let shown = client.get_room(&room.room_id).await.expect("still listed");
    let robot = &shown.seats[0];
    assert_eq!(
        (robot.kind(), robot.shown_kind()),
        (ParticipantKind::Robot, ParticipantKind::Unspecified)
    );
    let record = client.record(&room.game_id).await.expect("a record");
    replay::replay(&record).expect("a valid record");
    let Some(Line::Header(header)) = &record[0].line else {
        panic!("no header");
    };
    let kinds = header.seats.iter().map(|it| (it.kind(), it.shown_kind()));
    let person = (ParticipantKind::Human, ParticipantKind::Unspecified);
    let wizard = (ParticipantKind::Human, ParticipantKind::Robot);
    assert_eq!(kinds.collect::<Vec<_>>(), [wizard, person, person, person]);
    let sources = record.iter().filter_map(|line| match &line.line {
        Some(Line::PrivateExpression(private)) => private.expression.clone(),
        Some(Line::Event(event)) => match &event.kind {
            Some(Kind::ExpressionShown(shown)) => shown.expression.clone(),
            _ => None,
        },
        _ => None,
    });
    let sources: Vec<_> = sources.map(|expression| expression.source()).collect();
    assert_eq!(sources, [ExpressionSource::Wizard; 3]);
    let outcome = outcome::outcome(&record).expect("a finished game");
    assert_eq!(outcome.unrated, Some(outcome::Unrated::Wizard));
    let rated = client.leaderboard(v1::GetLeaderboardRequest::default());
    assert_eq!(rated.await.expect("a leaderboard").games, 0);

    // Its file verifies, and is exported.
    let data = server.stop().await;
    let file = jsonl::path_of(data.path(), &room.game_id);
    assert!(jsonl::read(&file).expect("a record file") == record);
    let file = file.to_str().expect("text");
    let out = data.path().join("out");
    chefshat(&["verify", file]).await;
    let folder = out.to_str().expect("text");
    chefshat(&["export", file, "--format", "csv", "--out", folder]).await;
    let mut rows = 0;
    for table in ["decisions.csv", "expressions.csv"] {
        let text = std::fs::read_to_string(out.join(table)).expect("text");
        let names = text.lines().next().expect("names of columns");
        assert!(names.ends_with(",shown_kind"), "{names}");
        let of_wizard = |row: &&str| row.contains("Robbie,human,") && row.ends_with(",robot");
        rows += text.lines().filter(of_wizard).count();
    }
    assert!(rows > 2, "its decisions and two expressions");
}
