//! Evenness of a round robin: meetings, byes and seats, for fields of all sizes.

use chefshat_tournament::Format;

use super::support::{Round, begun, drawn, joined, meetings, order, play_through, range, settings};

/// The rounds of a round robin with this number of participants.
fn rounds(participants: usize, players: usize, rounds: Option<u32>) -> Vec<Round> {
    let mut settings = settings(Format::RoundRobin);
    settings.players = players;
    settings.points = vec![1; players];
    settings.rounds = rounds;
    drawn(&joined(settings, participants).begin().unwrap())
}

/// Fewest and most meetings of a pair.
fn met(rounds: &[Round], participants: usize) -> (u32, u32) {
    let tables = rounds.iter().flat_map(|round| &round.tables);
    range(meetings(tables, participants).into_iter())
}

/// Fewest and most byes of a participant.
fn byes(rounds: &[Round], participants: usize) -> (u32, u32) {
    let mut byes = vec![0; participants];
    for &who in rounds.iter().flat_map(|round| &round.byes) {
        byes[who] += 1;
    }
    range(byes.into_iter())
}

/// The largest difference between two seats of one participant.
fn seats(rounds: &[Round], participants: usize, players: usize) -> u32 {
    let mut had = vec![vec![0; players]; participants];
    for table in rounds.iter().flat_map(|round| &round.tables) {
        for (seat, &who) in table.iter().enumerate() {
            had[who][seat] += 1;
        }
    }
    let apart = had.into_iter().map(|seats| range(seats.into_iter()));
    apart.map(|(least, most)| most - least).max().unwrap()
}

#[test]
fn all_meet_about_equally_often() {
    // Participants, players, rounds; fewest and most meetings; fewest and most byes.
    for (participants, players, asked, expected, sat_out) in [
        // Full tables: every pair meets three times.
        (4, 4, None, (3, 3), (0, 0)),
        (8, 4, None, (3, 3), (0, 0)),
        (12, 4, None, (3, 3), (0, 0)),
        (16, 4, None, (3, 3), (0, 0)),
        (20, 4, None, (3, 3), (0, 0)),
        (24, 4, None, (3, 3), (0, 0)),
        (28, 4, None, (3, 3), (0, 0)),
        (32, 4, None, (3, 3), (0, 0)),
        // One participant more: even with one round more.
        (5, 4, None, (2, 3), (0, 1)),
        (9, 4, None, (2, 3), (0, 1)),
        (13, 4, None, (2, 3), (0, 1)),
        (5, 4, Some(5), (3, 3), (1, 1)),
        (9, 4, Some(9), (3, 3), (1, 1)),
        // Of six, three pairs meet once and three meet three times.
        (6, 4, None, (1, 3), (1, 2)),
        (7, 4, None, (1, 2), (2, 3)),
        (10, 4, None, (2, 3), (1, 2)),
        (14, 4, None, (2, 3), (1, 2)),
        (15, 4, None, (2, 3), (2, 3)),
        // Other numbers of rounds.
        (16, 4, Some(5), (1, 1), (0, 0)),
        (8, 4, Some(14), (6, 6), (0, 0)),
        (12, 4, Some(22), (6, 6), (0, 0)),
        (8, 4, Some(1), (0, 1), (0, 0)),
        (12, 4, Some(5), (0, 3), (0, 0)),
        (7, 4, Some(21), (6, 6), (9, 9)),
        // Other table sizes. With only two tables it can hardly be even.
        (2, 2, None, (1, 1), (0, 0)),
        (20, 2, None, (1, 1), (0, 0)),
        (21, 2, None, (0, 1), (0, 1)),
        (6, 3, None, (1, 3), (0, 0)),
        (9, 3, None, (2, 2), (0, 0)),
        (9, 3, Some(4), (1, 1), (0, 0)),
        (15, 3, None, (2, 2), (0, 0)),
        (15, 3, Some(7), (1, 1), (0, 0)),
        (10, 5, None, (3, 5), (0, 0)),
        (15, 5, None, (3, 5), (0, 0)),
        (20, 5, None, (4, 4), (0, 0)),
        (12, 6, None, (5, 5), (0, 0)),
    ] {
        let rounds = rounds(participants, players, asked);
        let field = format!("{participants} participants, {players} players, {asked:?}");
        assert_eq!(
            rounds.len() as u32,
            asked.unwrap_or(participants as u32 - 1)
        );
        assert_eq!(met(&rounds, participants), expected, "{field}");
        assert_eq!(byes(&rounds, participants), sat_out, "{field}");
        assert!(seats(&rounds, participants, players) <= 1, "{field}");
        for round in &rounds {
            round.check(participants, players);
        }
    }
}

#[test]
fn a_large_field_meets_nearly_equally_often() {
    for participants in [40, 64] {
        let rounds = rounds(participants, 4, None);
        let (least, most) = met(&rounds, participants);
        assert!(least >= 1 && most <= 5, "{least}..={most}");
        assert_eq!(byes(&rounds, participants), (0, 0));
        assert!(seats(&rounds, participants, 4) <= 1);
    }
}

#[test]
fn fewer_than_a_table_are_filled_up() {
    let tournament = begun(settings(Format::RoundRobin), 3);
    let participants = tournament.participants().iter();
    let names: Vec<&str> = participants.map(|entrant| &*entrant.name).collect();
    assert_eq!(names, ["agent 0", "agent 1", "agent 2", "Filler 1"]);
    assert!(tournament.participants()[3].filler);
    assert_eq!((tournament.rounds(), tournament.games().len()), (3, 3));
}

#[test]
fn rounds_do_not_wait_for_each_other() {
    let mut tournament = begun(settings(Format::RoundRobin), 8);
    assert_eq!(tournament.games().len(), 14, "all are drawn at once");
    assert_eq!(tournament.games_expected(), 14);
    assert_eq!(tournament.round(), 1);
    play_through(&mut tournament);
    assert_eq!(tournament.round(), 7);
    assert_eq!(
        order(&tournament),
        [0, 1, 2, 3, 4, 5, 6, 7],
        "the lower number wins"
    );
    let standings = tournament.standings();
    assert!(standings.iter().all(|line| line.games == 7));
}
