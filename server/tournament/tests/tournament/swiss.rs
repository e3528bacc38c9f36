//! Rounds of a Swiss tournament: similar scores meet, few pairs meet twice, byes go to the lowest
//! without one.

use chefshat_tournament::{Format, Leaving, Tournament};

use super::support::{Round, begun, drawn, follow, meetings, order, play, range, settings};

/// Plays all rounds with lower numbers winning, and calls back with the standings before each.
fn play_all(
    mut tournament: Tournament,
    mut look: impl FnMut(&Tournament, &Round),
) -> (Tournament, Vec<Round>) {
    let participants = tournament.participants().len();
    let mut rounds = vec![first_round(&tournament)];
    loop {
        let before = tournament.clone();
        let changes = follow(&mut tournament, 0);
        if let Some(round) = drawn(&changes).pop() {
            look(&before, &round);
            rounds.push(round);
        }
        let playing: Vec<usize> = tournament.playing().collect();
        if playing.is_empty() {
            break;
        }
        for game in playing {
            play(&mut tournament, game);
        }
    }
    let players = tournament.settings().players;
    rounds
        .iter()
        .for_each(|round| round.check(participants, players));
    (tournament, rounds)
}

/// The first round is paired when the tournament begins.
fn first_round(tournament: &Tournament) -> Round {
    let tables: Vec<Vec<usize>> = tournament
        .games()
        .iter()
        .filter(|game| game.number == 1)
        .map(|game| game.seats.clone())
        .collect();
    let standings = tournament.standings();
    let sits_out = standings.iter().filter(|line| line.byes > 0);
    Round {
        tables,
        byes: sits_out.map(|line| line.participant).collect(),
    }
}

#[test]
fn few_meet_twice() {
    // Participants, rounds, most meetings of a pair, number of pairs that met more than once.
    for (participants, rounds, most, repeated) in [
        (40, None, 1, 0),
        (64, None, 1, 0),
        (22, None, 1, 0),
        (16, Some(3), 1, 0),
        // Twelve new opponents are impossible after the pairings that the scores forced.
        (16, Some(4), 2, 4),
        (17, Some(4), 2, 2),
        // With 8 participants at two tables, two rounds repeat at least four meetings.
        (8, Some(2), 2, 4),
        (4, Some(3), 3, 6),
    ] {
        let mut settings = settings(Format::Swiss);
        settings.rounds = rounds;
        let (_, drawn) = play_all(begun(settings, participants), |_, _| {});
        let met = meetings(drawn.iter().flat_map(|round| &round.tables), participants);
        let twice = met.iter().filter(|&&times| times > 1).count();
        assert_eq!(
            (range(met.iter().copied()).1, twice),
            (most, repeated),
            "{participants} participants, {} rounds",
            drawn.len()
        );
    }
}

#[test]
fn similar_standings_meet() {
    let mut apart = Vec::new();
    let (tournament, _) = play_all(begun(settings(Format::Swiss), 40), |before, round| {
        let mut rank = vec![0; 40];
        for line in before.standings() {
            rank[line.participant] = line.place as usize;
        }
        let pairs = round.tables.iter().flat_map(|table| {
            let ranks: Vec<usize> = table.iter().map(|&who| rank[who]).collect();
            let pairs = (0..4).flat_map(|a| (0..a).map(move |b| (a, b)));
            pairs.map(move |(a, b)| ranks[a].abs_diff(ranks[b]))
        });
        apart.push(pairs.sum::<usize>() as f64 / 60.0);
    });
    assert_eq!((apart.len(), tournament.rounds()), (5, 6));
    // Random ranks at a table would differ by 13.7, four neighbours by 1.7. In later rounds more
    // neighbours have already met.
    for (apart, most) in apart.iter().zip([1.7, 3.0, 6.0, 9.0, 12.0]) {
        assert!(*apart < most, "{apart}");
    }
    let best = &order(&tournament)[..3];
    assert!(best.iter().all(|&who| who < 12), "{best:?}");
}

#[test]
fn byes_go_to_the_lowest_who_had_fewest() {
    for (participants, rounds) in [(5, 4), (6, 5), (7, 6), (11, 5), (42, 6)] {
        let mut settings = settings(Format::Swiss);
        settings.rounds = Some(rounds);
        let (tournament, _) = play_all(begun(settings, participants), |before, round| {
            let standings = before.standings();
            let fewest =
                |line: &chefshat_tournament::Standing| (line.byes, std::cmp::Reverse(line.place));
            let mut expected: Vec<_> = standings.iter().map(|line| (fewest(line), line)).collect();
            expected.sort_by_key(|(key, _)| *key);
            let mut expected: Vec<usize> = expected[..participants % 4]
                .iter()
                .map(|(_, line)| line.participant)
                .collect();
            expected.sort_unstable();
            assert_eq!(round.byes, expected);
        });
        let standings = tournament.standings();
        let byes = range(standings.iter().map(|line| line.byes));
        assert!(byes.1 - byes.0 <= 1, "{byes:?}");
    }
}

#[test]
fn everybody_has_each_seat_about_equally_often() {
    let mut settings = settings(Format::Swiss);
    settings.rounds = Some(8);
    let (_, rounds) = play_all(begun(settings, 24), |_, _| {});
    let mut had = vec![[0; 4]; 24];
    for table in rounds.iter().flat_map(|round| &round.tables) {
        for (seat, &who) in table.iter().enumerate() {
            had[who][seat] += 1;
        }
    }
    let (least, most) = range(had.concat().into_iter());
    assert!(least >= 1 && most <= 3, "{had:?}");
}

#[test]
fn the_default_number_of_rounds_can_find_a_winner() {
    for (participants, rounds) in [(2, 2), (4, 2), (5, 3), (16, 4), (17, 5), (40, 6), (64, 6)] {
        assert_eq!(
            begun(settings(Format::Swiss), participants).rounds(),
            rounds
        );
    }
}

#[test]
fn those_who_have_left_make_room() {
    // Participants, those who leave after the first round, how many of them sit out in the second.
    for (participants, leaving, byes) in [
        (6, &[1, 4][..], 2),
        // Without two of them, some would sit out who have stayed.
        (9, &[0, 2, 8], 1),
        (8, &[3], 0),
        (8, &[0, 1, 2, 3], 4),
    ] {
        let mut settings = settings(Format::Swiss);
        settings.rounds = Some(2);
        let mut tournament = begun(settings, participants);
        follow(&mut tournament, 0);
        for game in tournament.playing().collect::<Vec<_>>() {
            play(&mut tournament, game);
        }
        for who in leaving {
            let left = tournament.withdraw(*who, Leaving::Itself);
            tournament.fold(&left.expect("it plays").expect("a change"));
        }
        let changes = follow(&mut tournament, 0);
        let round = drawn(&changes).pop().expect("a second round");
        assert_eq!(round.byes.len(), byes, "{participants}: {round:?}");
        let have_left = round.byes.iter().all(|who| leaving.contains(who));
        assert!(have_left, "{participants}: {round:?}");
        assert_eq!(tournament.games().len(), tournament.games_expected());
    }
}
