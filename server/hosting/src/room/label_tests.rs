//! What everybody but the study's owner learns about the seats of its rooms: lists, snapshots for
//! seats and spectators, and events.

use std::sync::Arc;

use chefshat_agents::AgentKind;
use chefshat_engine::{Seat, Viewer};
use chefshat_proto::v1;
use chefshat_room::Core;
use chefshat_room::ids::SecretHash;
use chefshat_room::journal::{Fill, GameHeader, ParticipantKind, SeatLabels, SeatedParticipant};
use chefshat_room::policy::Policy;
use chefshat_room::testing::{OPEN, Table, ms, study_game};
use prost::Message as _;

use chefshat_wire::convert;

/// A game that has started, of the participant Ana, the robot Carla and two agents, one of them
/// built in and called Dora.
fn playing(labels: SeatLabels) -> Table {
    let policy = Policy {
        pace: Some(ms(0)),
        ..Policy::default()
    };
    let fills = vec![OPEN, OPEN, Fill::BuiltIn(AgentKind::Greedy.into()), OPEN];
    let mut table = Table::empty(policy, fills);
    let header = GameHeader {
        display_names: [(2, "Dora".to_owned())].into(),
        study: Some(Arc::new(study_game(labels))),
        ..GameHeader::clone(table.core.header())
    };
    table.core = Core::new(Arc::new(header));
    for (seat, name, kind) in [
        (0, "Ana", ParticipantKind::Human),
        (1, "Carla", ParticipantKind::Robot),
        (3, "Emil", ParticipantKind::Agent),
    ] {
        let participant = SeatedParticipant {
            name: name.into(),
            name_fingerprint: format!("key of {name}"),
            kind,
            ticket: SecretHash::of(name.as_bytes()),
        };
        table.core.seat(Seat::new(seat), participant);
        table.attach(Seat::new(seat));
    }
    assert!(table.core.game().is_some(), "it has started");
    table
}

fn names(seats: &[v1::Participant]) -> Vec<&str> {
    seats.iter().map(|seat| seat.name.as_str()).collect()
}

fn contains(bytes: &[u8], word: &str) -> bool {
    bytes
        .windows(word.len())
        .any(|part| part == word.as_bytes())
}

#[test]
fn labels_hold_in_rooms_snapshots_and_events_for_every_viewer() {
    use v1::ParticipantKind::{Agent, Human, Robot, Unspecified};
    let hidden = ["Carla", "Dora", "Emil", "greedy", "condition", "level"];
    for (labels, expected, kinds) in [
        (
            SeatLabels::Kinds,
            ["Ana", "Robot 2", "Agent 3", "Agent 4"],
            [Human, Robot, Agent, Agent],
        ),
        (
            SeatLabels::Players,
            ["Ana", "Player 2", "Player 3", "Player 4"],
            [Human, Unspecified, Unspecified, Unspecified],
        ),
    ] {
        let table = playing(labels);
        let room = convert::describe(&table.core);
        assert_eq!(names(&room.seats), expected);
        let shown: Vec<_> = room.seats.iter().map(v1::Participant::kind).collect();
        assert_eq!(shown, kinds);
        let mut sent = vec![room.encode_to_vec()];
        let seats = (0..4).map(|seat| Viewer::Seat(Seat::new(seat)));
        for viewer in seats.chain([Viewer::Spectator, Viewer::Everything]) {
            let snapshot = convert::snapshot(&table.core, viewer);
            let started = snapshot.game_started.as_ref().expect("it has started");
            assert_eq!(names(&started.seats), expected, "{viewer:?}");
            sent.push(snapshot.encode_to_vec());
            for position in 0..table.core.log().len() {
                let event = convert::event_to_proto(&table.core, position, viewer);
                sent.extend(event.map(|event| event.encode_to_vec()));
            }
        }
        for word in hidden {
            let told = sent.iter().find(|bytes| contains(bytes, word));
            assert_eq!(told, None, "{word} with {labels:?}");
        }
    }
    let room = convert::describe(&playing(SeatLabels::AsTheyAre).core);
    assert_eq!(names(&room.seats), ["Ana", "Carla", "Dora", "Emil"]);
}
