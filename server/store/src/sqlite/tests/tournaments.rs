//! The encoding of stored tournaments stays readable.

use chefshat_tournament::{
    Change, Entrant, GameResult, ParticipantKind, SeatResult, SeatStatistics,
};

use super::*;
use crate::tournaments::TournamentEntry;
use chefshat_room::journal::TournamentGame;

pub(crate) fn every_entry() -> Vec<TournamentEntry> {
    let entrant = Entrant {
        name: "Bruna".into(),
        name_fingerprint: String::new(),
        kind: ParticipantKind::Robot,
        built_in: None,
        filler: false,
        stateless: true,
        max_games: 3,
        at_table: false,
    };
    let with_key = Entrant {
        name_fingerprint: "0123456789abcdef".into(),
        ..entrant.clone()
    };
    let filler = Entrant {
        name: "random 1".into(),
        name_fingerprint: String::new(),
        kind: ParticipantKind::Agent,
        built_in: Some(AgentKind::Random.into()),
        filler: true,
        stateless: false,
        max_games: 64,
        at_table: false,
    };
    let at_table = Entrant {
        name: "Ada".into(),
        name_fingerprint: String::new(),
        kind: ParticipantKind::Human,
        built_in: None,
        filler: false,
        stateless: false,
        max_games: 1,
        at_table: true,
    };
    let seat = SeatResult {
        participant: 4,
        forfeited: false,
        score: 3,
        statistics: SeatStatistics {
            place: 2,
            points: u64::MAX,
            substituted: true,
            decisions: 71,
            wrong_actions: 5,
            timeouts: 6,
            decision_time_us: 7_000_000,
            timed_decisions: 8,
            performance_score: 1.25,
            hinted: false,
        },
    };
    let forfeited = SeatResult {
        participant: 0,
        forfeited: true,
        score: 3,
        statistics: SeatStatistics {
            substituted: false,
            ..seat.statistics
        },
    };
    let hinted = SeatResult {
        statistics: SeatStatistics {
            hinted: true,
            ..forfeited.statistics
        },
        ..forfeited
    };
    let change = TournamentEntry::Change;
    vec![
        change(Change::Joined(entrant)),
        TournamentEntry::Ticket {
            participant: 0,
            ticket: SecretHash::of(b"ticket"),
        },
        change(Change::Joined(filler)),
        change(Change::Begun { rounds: 3 }),
        change(Change::Drawn {
            round: 2,
            tables: vec![vec![3, 1, 0, 2], vec![4, 5, 6, 7]],
            byes: vec![8, 9],
        }),
        change(Change::Called {
            game: 1,
            forfeited: vec![0],
        }),
        TournamentEntry::Placed {
            game: 1,
            room_id: id(3),
            game_id: id(4),
        },
        change(Change::Rescheduled {
            game: 1,
            missing: vec![1, 2],
            never_started: false,
        }),
        change(Change::Counted {
            game: 1,
            result: GameResult {
                shifts: 5,
                seats: vec![seat, forfeited],
            },
        }),
        change(Change::Voided { game: 2 }),
        change(Change::Finished),
        change(Change::Closed),
        // Fields that are newer than the entries above.
        change(Change::Joined(at_table.clone())),
        change(Change::Counted {
            game: 2,
            result: GameResult {
                shifts: 1,
                seats: vec![hinted],
            },
        }),
        change(Change::Withdrawn {
            participant: 2,
            removed: true,
        }),
        change(Change::Replaced {
            participant: 3,
            by: at_table,
        }),
        change(Change::Paused),
        change(Change::Resumed),
        change(Change::Postponed { game: 4, by: None }),
        change(Change::Postponed {
            game: 5,
            by: Some(0),
        }),
        change(Change::Recalled { game: 6 }),
        change(Change::Rescheduled {
            game: 7,
            missing: vec![],
            never_started: true,
        }),
        change(Change::Joined(with_key)),
    ]
}

fn shown(value: &(impl std::fmt::Debug + ?Sized)) -> String {
    format!("{value:?}")
}

#[test]
fn the_encoding_of_tournaments_stays_readable() {
    let written = format!(
        "{}\n{}\n",
        hex::encode(cup(3).to_bytes()),
        hex::encode(TournamentEntry::to_bytes(&every_entry()))
    );
    assert_eq!(written, include_str!("../fixtures/tournament2.hex"));
    let former = include_str!("../fixtures/tournament1.hex");
    let (first, second) = former.split_once('\n').expect("two lines");
    let bytes = hex::decode(first).expect("hexadecimal digits");
    form::tournament_from_bytes(&bytes).expect("readable");
    let bytes = hex::decode(second.trim()).expect("hexadecimal digits");
    let read = form::tournament_entries_from_bytes(&bytes).expect("readable");
    assert_eq!(shown(&read), shown(&every_entry()[..read.len()]));
    let (first, second) = written.split_once('\n').expect("two lines");
    let bytes = hex::decode(first).expect("hexadecimal digits");
    let read = form::tournament_from_bytes(&bytes).expect("readable");
    assert_eq!(shown(&read), shown(&cup(3)));
    let bytes = hex::decode(second.trim()).expect("hexadecimal digits");
    let read = form::tournament_entries_from_bytes(&bytes).expect("readable");
    assert_eq!(shown(&read), shown(&every_entry()));
    for end in 1..bytes.len() {
        // Half an entry is an error; a cut between two entries reads as fewer entries.
        if let Ok(read) = form::tournament_entries_from_bytes(&bytes[..end]) {
            assert!(read.len() < every_entry().len());
        }
    }
}

#[test]
fn a_game_keeps_the_id_of_its_tournament() {
    for series in [None, Some(id(5))] {
        let game = TournamentGame {
            tournament: id(6),
            series,
        };
        let header = GameHeader {
            tournament: Some(game),
            ..header(1, Durability::Durable)
        };
        let read = form::header_from_bytes(&form::header_to_bytes(&header)).expect("readable");
        assert_eq!(read.tournament, Some(game));
    }
}
