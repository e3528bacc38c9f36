//! Structure of a knockout: tables of four, two of each advance, halves meet in the final, fillers
//! are spread evenly.

use chefshat_tournament::{Change, Format, State};

use super::support::{begun, drawn, end, follow, order, play_through, played, settings, won_by};

#[test]
fn sixteen_become_eight_become_four() {
    let mut tournament = begun(settings(Format::Knockout), 16);
    let games = tournament.games().iter();
    let first: Vec<Vec<usize>> = games.map(|game| game.seats.clone()).collect();
    assert_eq!((first.len(), tournament.rounds()), (4, 3));
    let mut everybody = first.concat();
    everybody.sort_unstable();
    assert_eq!(everybody, (0..16).collect::<Vec<_>>());

    let changes = play_through(&mut tournament);
    let rounds = drawn(&changes);
    let sizes: Vec<usize> = rounds.iter().map(|round| round.tables.len()).collect();
    assert_eq!(sizes, [2, 1], "the first was drawn before");
    // The two lower numbers of each table advance, two neighbouring tables to one: halves stay
    // apart until the final.
    let best = |tables: &[Vec<usize>]| {
        let mut on: Vec<usize> = tables.iter().flat_map(|table| lowest(table, 2)).collect();
        on.sort_unstable();
        on
    };
    for (half, table) in rounds[0].tables.iter().enumerate() {
        assert_eq!(sorted(table), best(&first[2 * half..2 * half + 2]));
    }
    assert_eq!(sorted(&rounds[1].tables[0]), best(&rounds[0].tables));

    assert_eq!(tournament.state(), State::Finished);
    assert_eq!(tournament.games().len(), 7);
    assert_eq!(tournament.games_expected(), 7);
    let standings = tournament.standings();
    let last_rounds: Vec<u32> = standings.iter().map(|line| line.last_round).collect();
    assert_eq!(
        last_rounds,
        [3, 3, 3, 3, 2, 2, 2, 2, 1, 1, 1, 1, 1, 1, 1, 1]
    );
    assert_eq!(order(&tournament)[..4], sorted(&rounds[1].tables[0]));
    let places: Vec<u32> = standings.iter().map(|line| line.place).collect();
    assert_eq!(places, (1..=16).collect::<Vec<_>>());
}

#[test]
fn the_winner_of_the_final_is_first_whatever_its_score() {
    let mut tournament = begun(settings(Format::Knockout), 8);
    follow(&mut tournament, 0);
    for game in [0, 1] {
        end(&mut tournament, game, played(&[1, 2, 3, 4]));
    }
    let others: Vec<usize> = (0..2)
        .flat_map(|game| tournament.games()[game].seats[2..].to_vec())
        .collect();
    follow(&mut tournament, 0);
    let seats = tournament.games()[2].seats.clone();
    // The second of the first table wins.
    let winner = tournament.games()[0].seats[1];
    end(&mut tournament, 2, won_by(winner, &seats));
    follow(&mut tournament, 0);
    assert_eq!(tournament.state(), State::Finished);
    let ranked = order(&tournament);
    assert_eq!(ranked[0], winner);
    assert_eq!(sorted(&ranked[..4]), sorted(&seats));
    assert_eq!(sorted(&ranked[4..]), sorted(&others));
}

#[test]
fn fillers_are_marked_and_spread() {
    for joined in 2..=64 {
        let tournament = begun(settings(Format::Knockout), joined);
        let field = joined.next_power_of_two().max(4);
        let participants = tournament.participants();
        assert_eq!(participants.len(), field);
        assert!(participants[..joined].iter().all(|entrant| !entrant.filler));
        assert!(participants[joined..].iter().all(|entrant| entrant.filler));
        assert_eq!(
            tournament.rounds(),
            field.trailing_zeros() - 1,
            "{joined} joined"
        );
        let fillers = |games: &[chefshat_tournament::Game]| -> usize {
            let seats = games.iter().flat_map(|game| &game.seats);
            seats.filter(|&&who| participants[who].filler).count()
        };
        // Likewise for tables, halves and quarters.
        let tables = field / 4;
        for parts in (0..).map(|doublings| 1 << doublings) {
            if parts > tables {
                break;
            }
            let counts = tournament.games().chunks(tables / parts).map(fillers);
            let (least, most) = (counts.clone().min().unwrap(), counts.max().unwrap());
            assert!(most - least <= 1, "{joined} joined: {least} and {most}");
        }
    }
}

#[test]
fn games_of_a_pairing_add_up() {
    let mut settings = settings(Format::Knockout);
    settings.games_per_pairing = 2;
    let mut tournament = begun(settings, 8);
    follow(&mut tournament, 0);
    let seats = tournament.games()[0].seats.clone();
    let turned = tournament.games()[1].seats.clone();
    assert_eq!(turned, [&seats[1..], &seats[..1]].concat());
    let table = [0, 1].map(|game| tournament.games()[game].table);
    assert_eq!(table, [1, 1]);
    // 5 + 0, 3 + 5, 1 + 3, 0 + 1: the first seat's 5 is less than the 8 of the second and more than
    // the 4 of the third.
    end(&mut tournament, 0, played(&[1, 2, 3, 4]));
    follow(&mut tournament, 0);
    end(&mut tournament, 1, played(&[1, 2, 3, 4]));
    for game in [2, 3] {
        end(&mut tournament, game, played(&[1, 2, 3, 4]));
        follow(&mut tournament, 0);
    }
    let last = &tournament.games()[4];
    assert_eq!(last.round, 2);
    for (seat, goes_on) in [true, true, false, false].into_iter().enumerate() {
        assert_eq!(last.seats.contains(&seats[seat]), goes_on);
    }
}

#[test]
fn tie_breaks_decide_a_table_without_games() {
    let mut settings = settings(Format::Knockout);
    settings.max_calls = 1;
    let mut tournament = begun(settings, 8);
    for who in 0..8 {
        tournament.set_present(who, false);
    }
    assert_eq!(follow(&mut tournament, 0), []);
    let changes = follow(&mut tournament, 1000);
    assert_eq!(
        changes[..2],
        [Change::Voided { game: 0 }, Change::Voided { game: 1 }]
    );
    assert!(matches!(changes[2], Change::Drawn { round: 2, .. }));
    follow(&mut tournament, 2000);
    assert_eq!(tournament.state(), State::Finished);
    assert!(tournament.standings().iter().all(|line| line.games == 0));
}

#[test]
fn tables_of_an_unfinished_round_decide_nothing() {
    let mut tournament = begun(settings(Format::Knockout), 8);
    follow(&mut tournament, 0);
    let seats = tournament.games()[0].seats.clone();
    end(&mut tournament, 0, played(&[1, 2, 3, 4]));
    let ranked = order(&tournament);
    assert_eq!(ranked[..2], seats[..2], "5 and 3, all others 1 or 0");
    tournament.fold(&tournament.close().unwrap());
    assert_eq!(order(&tournament), ranked);
}

fn lowest(table: &[usize], count: usize) -> Vec<usize> {
    sorted(table)[..count].to_vec()
}

fn sorted(numbers: &[usize]) -> Vec<usize> {
    let mut numbers = numbers.to_vec();
    numbers.sort_unstable();
    numbers
}
