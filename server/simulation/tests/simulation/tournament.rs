//! Offline tournaments: independent of the number of threads; better agents rank higher.

use std::sync::atomic::{AtomicU64, Ordering};

use chefshat_agents::AgentKind;
use chefshat_engine::{RuleSet, RuleSetSpec};
use chefshat_simulation::tournament::{OfflineProblem, play_offline};
use chefshat_tournament::testing::{begun, settings};
use chefshat_tournament::{Deals, Format, Settings, State, Tournament};
use rayon::ThreadPoolBuilder;

fn rules() -> RuleSet {
    RuleSetSpec::default().validate().unwrap()
}

/// A tournament of greedy agents (even numbers) and random ones that has begun.
fn field(format: Format, deals: Deals, participants: usize) -> Tournament {
    let settings = Settings {
        deals,
        games_per_pairing: 2,
        ..settings(format)
    };
    let agents = [Some(AgentKind::Greedy), Some(AgentKind::Random)];
    begun(settings, agents.into_iter().cycle().take(participants))
}

fn play(tournament: &mut Tournament, seed: u64, threads: usize) -> u64 {
    let games = AtomicU64::new(0);
    let pool = ThreadPoolBuilder::new().num_threads(threads).build();
    let progress = |more| {
        games.fetch_add(more, Ordering::Relaxed);
    };
    pool.unwrap()
        .install(|| play_offline(tournament, rules(), seed, &progress))
        .unwrap();
    games.into_inner()
}

#[test]
fn better_agents_stand_higher_in_every_format() {
    for format in Format::ALL {
        for deals in Deals::ALL {
            let mut tournament = field(format, deals, 8);
            let games = play(&mut tournament, 5, 2);
            assert_eq!(tournament.state(), State::Finished);
            assert_eq!(usize::try_from(games), Ok(tournament.games_expected()));
            let standings = tournament.standings();
            assert_eq!(standings[0].participant % 2, 0, "{format:?}, {deals:?}");
            let greedy = |upper: &[chefshat_tournament::Standing]| {
                upper
                    .iter()
                    .filter(|line| line.participant % 2 == 0)
                    .count()
            };
            assert!(greedy(&standings[..4]) >= 3, "{format:?}, {deals:?}");
            assert!(standings.iter().all(|line| line.performance_score >= 0.0));
        }
    }
}

#[test]
fn the_seed_matters_and_the_number_of_threads_does_not() {
    let start = field(Format::Swiss, Deals::SameAtAllTables, 12);
    let [one, three, other] = [(5, 1), (5, 3), (6, 1)].map(|(seed, threads)| {
        let mut tournament = start.clone();
        play(&mut tournament, seed, threads);
        tournament
    });
    assert!(one == three);
    assert!(one != other);
}

#[test]
fn duplicate_deals_are_the_same_cards() {
    // The same deterministic agents on all seats: rotating them through a deal changes nothing but
    // names.
    let settings = Settings {
        deals: Deals::Rotated,
        rounds: Some(2),
        ..settings(Format::RoundRobin)
    };
    let mut tournament = begun(settings, [Some(AgentKind::Greedy); 4]);
    play(&mut tournament, 3, 2);
    let places = |game: usize| {
        let result = tournament.games()[game].result().unwrap();
        let seats = result.seats.iter();
        seats
            .map(|seat| (seat.statistics.place, seat.statistics.points))
            .collect::<Vec<_>>()
    };
    for game in 1..4 {
        assert_eq!(places(game), places(0), "one deal");
        assert_eq!(places(4 + game), places(4), "another one");
    }
    assert_ne!(places(4), places(0));
    let standings = tournament.standings();
    assert!(
        standings
            .iter()
            .all(|line| line.score == standings[0].score),
        "everyone has played every hand"
    );
}

#[test]
fn people_and_other_player_counts_are_refused() {
    let mut with_people = begun(settings(Format::Swiss), [None; 4]);
    let refused = play_offline(&mut with_people, rules(), 0, &|_| {});
    assert_eq!(refused, Err(OfflineProblem::NotBuiltIn(0)));
    let spec = RuleSetSpec {
        players: 3,
        ..RuleSetSpec::default()
    };
    let rules = spec.validate().unwrap();
    let refused = play_offline(&mut with_people, rules, 0, &|_| {});
    assert_eq!(refused, Err(OfflineProblem::Players { rules: 3, seats: 4 }));
}
