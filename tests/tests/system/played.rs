//! Games without clients, between recorded players and others, and their records. `branches` and
//! `beginnings` build on them.

use chefshat_client::Client;
use chefshat_engine::{DecisionKind, Game};
use chefshat_proto::v1::{
    self, create_room_request::Start, game_event::Kind, record_line::Line, seat_config::FilledBy,
};
use chefshat_record::replay::{replay, walk};
use chefshat_tests::patiently;

pub(crate) fn built_in(name: &str) -> v1::SeatConfig {
    v1::SeatConfig {
        filled_by: Some(FilledBy::BuiltInAgent(name.into())),
        ..v1::SeatConfig::default()
    }
}

pub(crate) fn recorded(game_id: &str, seat: u32) -> v1::SeatConfig {
    v1::SeatConfig {
        filled_by: Some(FilledBy::Replay(v1::RecordedPlayer {
            game_id: game_id.into(),
            seat,
        })),
        ..v1::SeatConfig::default()
    }
}

pub(crate) fn all_recorded(game_id: &str) -> Vec<v1::SeatConfig> {
    (0..4).map(|seat| recorded(game_id, seat)).collect()
}

pub(crate) fn point(game_id: &str, decisions: usize, same_deals: bool) -> Option<Start> {
    Some(Start::Branch(v1::BranchPoint {
        game_id: game_id.into(),
        decisions: decisions as u64,
        same_deals,
    }))
}

/// A game that has ended.
pub(crate) struct EndedGame {
    pub(crate) room: v1::Room,
    pub(crate) lines: Vec<v1::RecordLine>,
}

impl EndedGame {
    pub(crate) fn game_id(&self) -> &str {
        &self.room.game_id
    }

    pub(crate) fn header(&self) -> &v1::RecordHeader {
        match &self.lines[0].line {
            Some(Line::Header(header)) => header,
            other => panic!("no header: {other:?}"),
        }
    }

    pub(crate) fn decisions(&self) -> Vec<&v1::DecisionRecord> {
        let lines = self.lines.iter();
        lines
            .filter_map(|line| match &line.line {
                Some(Line::Decision(decision)) => Some(decision),
                _ => None,
            })
            .collect()
    }

    /// The seat and action of every decision.
    pub(crate) fn course(&self) -> Vec<(u32, u32)> {
        let decisions = self.decisions().into_iter();
        decisions
            .map(|decision| (decision.seat, decision.action))
            .collect()
    }

    /// The events after every decision, without source and time.
    pub(crate) fn deals_and_results(&self) -> Vec<Kind> {
        let events = self.lines.iter().filter_map(|line| match &line.line {
            Some(Line::Event(event)) => event.kind.clone(),
            _ => None,
        });
        events
            .filter_map(|kind| match kind {
                Kind::GameEnded(mut ended) => {
                    ended.reveal = None;
                    Some(Kind::GameEnded(ended))
                }
                Kind::ShiftStarted(_) | Kind::ShiftEnded(_) | Kind::RolesAssigned(_) => Some(kind),
                _ => None,
            })
            .collect()
    }

    pub(crate) fn events(&self, is: impl Fn(&Kind) -> bool) -> usize {
        let kinds = self.lines.iter().filter_map(|line| match &line.line {
            Some(Line::Event(event)) => event.kind.as_ref(),
            _ => None,
        });
        kinds.filter(|kind| is(kind)).count()
    }

    /// The game before each decision.
    pub(crate) fn positions(&self) -> Vec<Game> {
        let mut positions = Vec::new();
        walk(&self.lines, |moment| {
            if let (Line::Decision(_), Some(game)) = (moment.entry, moment.game) {
                positions.push(game.clone());
            }
        })
        .expect("a valid record");
        positions
    }
}

/// Creates a room that plays on its own, and waits for its end.
pub(crate) async fn ended(client: &Client, request: v1::CreateRoomRequest) -> EndedGame {
    let created = client.create_room(request).await.expect("a new room");
    let room = created.room.expect("a room");
    let ended = patiently("the game to end", until_over(client, room.room_id)).await;
    replay(&ended.lines).expect("a valid record");
    ended
}

pub(crate) async fn until_over(client: &Client, room_id: String) -> EndedGame {
    let mut watching = client.spectate(&room_id, 0);
    while watching.next().await.expect("a watched room").is_some() {}
    let room = client.get_room(&room_id).await.expect("still listed");
    assert_eq!(room.state(), v1::RoomState::Finished);
    let lines = client.record(&room.game_id).await.expect("a record");
    EndedGame { room, lines }
}

/// A game of four Shifts between built-in agents, the same every time.
pub(crate) async fn original(client: &Client) -> EndedGame {
    let request = v1::CreateRoomRequest {
        rules: Some(v1::RuleSet {
            stop: Some(v1::rule_set::Stop::TargetShifts(4)),
            ..v1::RuleSet::default()
        }),
        seats: ["greedy", "random", "random", "random_unmasked"]
            .map(built_in)
            .into(),
        game_seed: vec![21; 32],
        ..v1::CreateRoomRequest::default()
    };
    ended(client, request).await
}

/// Points worth branching at: the start, within an exchange, in the middle of a Shift, right after
/// a Shift, the last decision.
pub(crate) fn points(game: &EndedGame) -> [usize; 5] {
    let positions = game.positions();
    let find = |is: &dyn Fn(&Game) -> bool| {
        let found = positions.iter().position(is);
        found.expect("the game has such a point")
    };
    let kind = |game: &Game| game.decision().map(|decision| decision.kind);
    let exchange = find(&|game| kind(game) == Some(DecisionKind::Exchange)) + 1;
    assert_eq!(kind(&positions[exchange]), Some(DecisionKind::Exchange));
    let mid_shift = find(&|game| game.shift() == 3 && game.shift_turns() == 20);
    let after_shift = find(&|game| game.shift() == 2);
    assert_eq!(positions[after_shift - 1].shift(), 1);
    [0, exchange, mid_shift, after_shift, positions.len() - 1]
}
