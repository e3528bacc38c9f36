//! Creation of rooms.

use chefshat_engine::RuleSetSpec;

use super::*;
use crate::store::FailingStore;
use chefshat_room::ids::SecretHash;
use chefshat_room::journal::ParticipantKind;

#[tokio::test]
async fn participants_of_a_tournament_are_committed_with_their_room() {
    // It stores new games, but no further entries.
    let store = Arc::new(FailingStore::after(0));
    let rooms = Rooms::new(&ServerConfig::default(), store, TaskTracker::new()).expect("threads");
    let fill = Fill::Open {
        reserved_for: Some(ParticipantKind::Agent),
    };
    let seated = |name: &str| SeatedParticipant {
        name: name.into(),
        kind: ParticipantKind::Agent,
        ticket: SecretHash::of(name.as_bytes()),
    };
    let made = rooms.create(NewRoom {
        name: "a game of a tournament".into(),
        rules: RuleSetSpec::default().validate().expect("the standard"),
        policy: Policy::default(),
        fills: vec![fill; 4],
        display_names: BTreeMap::new(),
        recorded: BTreeMap::new(),
        start: GameStart::default(),
        game_seed: None,
        physical: false,
        request: None,
        charged: Key::Local,
        seating: Some(Seating {
            game: TournamentGame {
                tournament: Id([1; 16]),
                series: None,
            },
            owner: Token::random(Id([2; 16])),
            game_id: Id([3; 16]),
            participants: BTreeMap::from([(0, seated("Ada")), (2, seated("Bo"))]),
            server_seed: None,
        }),
    });
    let made = made.await.expect("the first commit succeeds");
    let room = made.handle.describe().await.expect("the room exists");
    let names: Vec<&str> = room.seats.iter().map(|seat| seat.name.as_str()).collect();
    assert_eq!(names, ["Ada", "", "Bo", ""]);
}
