//! Which games share a deal, and when deals may be published.

use std::collections::{BTreeMap, BTreeSet};

use chefshat_tournament::{Deals, Ended, Format, Tournament};

use super::support::{begun, end, follow, play_through, played, settings};

fn tournament(format: Format, deals: Deals, games_per_pairing: u32) -> Tournament {
    let mut settings = settings(format);
    settings.deals = deals;
    settings.games_per_pairing = games_per_pairing;
    settings.rounds = (format != Format::Knockout).then_some(3);
    begun(settings, 8)
}

/// The numbers of the games of each deal.
fn series(tournament: &Tournament) -> BTreeMap<u32, Vec<usize>> {
    let mut series: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
    for (index, game) in tournament.games().iter().enumerate() {
        series.entry(game.deal.unwrap()).or_default().push(index);
    }
    series
}

#[test]
fn independent_games_have_no_common_deal() {
    let tournament = tournament(Format::RoundRobin, Deals::Independent, 2);
    assert_eq!(tournament.games().len(), 12);
    assert!(tournament.games().iter().all(|game| game.deal.is_none()));
}

#[test]
fn tables_of_a_round_share_deals_and_nobody_plays_one_twice() {
    for format in Format::ALL {
        let mut tournament = tournament(format, Deals::SameAtAllTables, 2);
        play_through(&mut tournament);
        let series = series(&tournament);
        let games: usize = series.values().map(Vec::len).sum();
        assert_eq!(games, tournament.games().len());
        for games in series.values() {
            let games = games.iter().map(|&game| &tournament.games()[game]);
            let of: BTreeSet<(u32, u32)> = games
                .clone()
                .map(|game| (game.round, game.number))
                .collect();
            assert_eq!(of.len(), 1, "one number of one round");
            let round = of.first().unwrap().0;
            let tables = tournament
                .games()
                .iter()
                .filter(|game| game.round == round && game.number == 1);
            assert_eq!(games.clone().count(), tables.count(), "all tables");
            let mut who: Vec<usize> = games.flat_map(|game| game.seats.clone()).collect();
            let seats = who.len();
            who.sort_unstable();
            who.dedup();
            assert_eq!(who.len(), seats, "nobody plays it twice");
        }
    }
}

#[test]
fn rotated_deals_are_played_once_from_each_seat() {
    for format in Format::ALL {
        let mut tournament = tournament(format, Deals::Rotated, 2);
        assert_eq!(tournament.games().len() % 8, 0);
        play_through(&mut tournament);
        for games in series(&tournament).values() {
            let games = games.iter().map(|&game| &tournament.games()[game]);
            let tables: BTreeSet<(u32, u32)> =
                games.clone().map(|game| (game.round, game.table)).collect();
            assert_eq!((games.clone().count(), tables.len()), (4, 1));
            for seat in 0..4 {
                let who: BTreeSet<usize> = games.clone().map(|game| game.seats[seat]).collect();
                assert_eq!(who.len(), 4, "everybody has had the seat");
            }
        }
    }
}

#[test]
fn a_deal_opens_when_its_last_game_is_over() {
    let mut tournament = tournament(Format::Swiss, Deals::SameAtAllTables, 2);
    follow(&mut tournament, 0);
    let series = series(&tournament);
    assert_eq!(series[&0], [0, 2]);
    assert_eq!(series[&1], [1, 3]);
    let open = |tournament: &Tournament| [0, 1].map(|deal| tournament.is_deal_open(deal));
    end(&mut tournament, 0, played(&[1, 2, 3, 4]));
    assert_eq!(open(&tournament), [false, false]);
    end(&mut tournament, 2, played(&[1, 2, 3, 4]));
    assert_eq!(open(&tournament), [true, false]);
    assert!(!tournament.is_deal_open(99), "not yet drawn");
    follow(&mut tournament, 0);
    tournament.fold(&tournament.close().unwrap());
    assert_eq!(
        open(&tournament),
        [true, true],
        "no game is being played any more"
    );
}

#[test]
fn a_deal_that_was_seen_is_not_played_again() {
    let mut tournament = tournament(Format::Swiss, Deals::SameAtAllTables, 1);
    follow(&mut tournament, 0);
    let deal = tournament.games()[0].deal;
    let who = tournament.games()[0].seats[0];
    // The game never started, so its deal can be used again.
    end(
        &mut tournament,
        0,
        Ended::NeverStarted { missing: vec![who] },
    );
    assert_eq!(tournament.games()[0].deal, deal);
    follow(&mut tournament, 0);
    assert_eq!(tournament.games()[0].calls, 2);

    let mut settings = tournament.settings().clone();
    settings.max_calls = 3;
    let mut tournament = begun(settings.clone(), 8);
    follow(&mut tournament, 0);
    end(&mut tournament, 0, Ended::Aborted);
    assert_eq!(tournament.games()[0].deal, None, "dealt again");
    assert_eq!(tournament.games()[1].deal, deal);
    end(&mut tournament, 1, played(&[1, 2, 3, 4]));
    assert!(tournament.is_deal_open(0), "no game of it is left");

    settings.deals = Deals::Rotated;
    let mut tournament = begun(settings, 8);
    follow(&mut tournament, 0);
    end(&mut tournament, 0, Ended::Aborted);
    assert_eq!(
        tournament.games()[0].deal,
        Some(0),
        "stateless participants"
    );
}
