//! Duplicate deals: every deal in every seating, no bias, no difference between identical agents,
//! and smaller errors than independent deals.

use std::num::NonZeroU32;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use chefshat_agents::{AgentKind, Listener, Network, game_seed};
use chefshat_engine::{BySeat, Cards, Event, RuleSet, RuleSetSpec, Seat, Stop};
use chefshat_simulation::{Comparison, Contender, Duplicate, DuplicateError, SeatPlan};
use rayon::ThreadPoolBuilder;
use safetensors::Dtype;
use safetensors::tensor::{TensorView, serialize};

use AgentKind::{Greedy, Random, RandomUnmasked};
use SeatPlan::{Half, One};

fn rules_for(players: u8) -> RuleSet {
    let spec = RuleSetSpec {
        players,
        ..RuleSetSpec::default()
    };
    spec.validate().unwrap()
}

fn duplicate(plan: SeatPlan, players: u8, deals: u64) -> Duplicate {
    let shifts = NonZeroU32::new(3).unwrap();
    Duplicate::new(rules_for(players), shifts, plan, deals, 9).unwrap()
}

fn compared(a: AgentKind, b: AgentKind, plan: SeatPlan, players: u8, deals: u64) -> Comparison {
    let contenders = [Contender::Kind(a), Contender::Kind(b)];
    duplicate(plan, players, deals)
        .run(&contenders, &|_| {})
        .unwrap()
}

/// A network that plays turns by a fixed order of preference: the highest action first, which sheds
/// high faces and jokers.
fn careless() -> Contender {
    let metadata = [
        ("format", "chefshat-network-1"),
        ("input", "classic"),
        ("output", "turns"),
        ("output_activation", "none"),
        ("masked", "true"),
        ("players", "4"),
        ("faces", "11"),
        ("jokers", "2"),
    ];
    let bytes =
        |numbers: Vec<f32>| -> Vec<u8> { numbers.into_iter().flat_map(f32::to_le_bytes).collect() };
    let weights = bytes(vec![0.0; 200 * 228]);
    let bias = bytes((0..200u8).map(|index| f32::from(index % 199)).collect());
    let tensor =
        |shape: &[usize], bytes| TensorView::new(Dtype::F32, shape.to_vec(), bytes).unwrap();
    let tensors = [
        ("layer0.weight", tensor(&[200, 228], &weights)),
        ("layer0.bias", tensor(&[200], &bias)),
    ];
    let metadata = metadata.map(|(key, text)| (key.to_owned(), text.to_owned()));
    let file = serialize(tensors, Some(metadata.into())).unwrap();
    Contender::Network(Arc::new(Network::from_bytes(&file).unwrap()))
}

#[test]
fn all_seatings_are_played_and_seats_are_shared_fairly() {
    for (players, half, one) in [(2, 2, 2), (3, 6, 3), (4, 6, 4), (5, 20, 5), (6, 20, 6)] {
        for (plan, count, a_share) in [(Half, half, 0.5), (One, one, 1.0 / players as f64)] {
            let seatings = plan.seatings(players);
            assert_eq!(seatings.len(), count, "{players} players, {plan:?}");
            for seat in (0..players).map(Seat::new) {
                let times = seatings.iter().filter(|seating| seating.is_a(seat)).count();
                assert_eq!(
                    times as f64,
                    a_share * count as f64,
                    "seat {seat} of {players}"
                );
            }
            for (index, seating) in seatings.iter().enumerate() {
                let seats = (0..players).map(Seat::new);
                assert_eq!(
                    seats.filter(|&seat| seating.is_a(seat)).count(),
                    seating.a_seats()
                );
                assert!(!seatings[..index].contains(seating));
            }
        }
    }
}

#[test]
fn identical_agents_are_exactly_even() {
    for players in 2..=5 {
        for plan in [Half, One] {
            let comparison = compared(Greedy, Greedy, plan, players, 12);
            for figure in [&comparison.points, &comparison.places, &comparison.wins] {
                assert_eq!(figure.difference(), 0.0, "{players} players, {plan:?}");
                assert_eq!(figure.standard_error(), 0.0);
                assert!(figure.independent_standard_error() > 0.0);
                assert_eq!(figure.gain(), None);
                assert_eq!(figure.a(), figure.b());
            }
        }
    }
}

#[test]
fn random_agents_differ_from_themselves_only_by_chance() {
    for plan in [Half, One] {
        let comparison = compared(Random, Random, plan, 4, 150);
        for figure in [&comparison.points, &comparison.places, &comparison.wins] {
            assert!(figure.interval95().contains(0.0), "{figure:?}");
            assert!(figure.standard_error() > 0.0 && figure.difference() != 0.0);
        }
    }
}

#[test]
fn the_better_agent_is_found() {
    for (plan, players) in [(Half, 4), (One, 4), (Half, 3), (One, 2)] {
        let comparison = compared(Greedy, Random, plan, players, 40);
        let [points, places, wins] = [&comparison.points, &comparison.places, &comparison.wins];
        assert!(points.interval95().low > 1.0, "{points:?}");
        assert!(places.interval95().high < 0.0, "{places:?}");
        assert!(wins.interval95().low > 0.2, "{wins:?}");
        let other = compared(Random, Greedy, plan, players, 40);
        assert!(other.points.interval95().high < 0.0);
    }
    let wild = compared(Random, RandomUnmasked, Half, 4, 20);
    assert!(
        wild.points.interval95().contains(0.0),
        "both play the same valid actions"
    );
}

#[test]
fn means_add_up_to_the_totals_of_a_shift() {
    for (plan, b_seats) in [(Half, 1.0), (One, 3.0)] {
        let comparison = compared(Greedy, Random, plan, 4, 30);
        let seatings = plan.seatings(4).len() as u64;
        assert_eq!(comparison.deals, 30);
        assert_eq!(comparison.games, 30 * seatings);
        assert_eq!(comparison.shifts, 90 * seatings);
        for (figure, mean) in [
            (&comparison.points, 9.0 / 4.0),
            (&comparison.places, 2.5),
            (&comparison.wins, 0.25),
        ] {
            let sum = (figure.a() + b_seats * figure.b()) / (1.0 + b_seats);
            assert!((sum - mean).abs() < 1e-12, "{sum} {mean}");
            let difference = figure.a() - figure.b();
            assert!((difference - figure.difference()).abs() < 1e-12);
        }
    }
}

#[test]
fn duplicate_deals_reduce_the_error() {
    let contenders = [Contender::Kind(Greedy), careless()];
    let comparison = duplicate(Half, 4, 200).run(&contenders, &|_| {}).unwrap();
    let points = &comparison.points;
    assert!(points.standard_error() > 0.0);
    assert!(
        points.standard_error() < 0.9 * points.independent_standard_error(),
        "{} {}",
        points.standard_error(),
        points.independent_standard_error()
    );
    assert!(points.gain().unwrap() > 1.3);
}

/// The deals of a game's Shifts.
#[derive(Default, PartialEq, Debug)]
struct Deals {
    hands: Vec<BySeat<Option<Cards>>>,
    order: Vec<Seat>,
}

impl Listener for Deals {
    fn on_event(&mut self, event: &Event) {
        match event {
            Event::ShiftStarted { hands, .. } => self.hands.push(**hands),
            Event::ShiftEnded(end) => self.order.extend(end.order.as_slice()),
            _ => {}
        }
    }
}

#[test]
fn deals_are_the_same_in_all_seatings_and_random_choices_are_not() {
    let contenders = [Contender::Kind(Random), Contender::Kind(Random)];
    let duplicate = duplicate(Half, 4, 2);
    let game = |deal, seating| {
        let mut deals = Deals::default();
        duplicate.play_game(&contenders, deal, seating, &mut deals);
        deals
    };
    let first = game(0, 0);
    assert_eq!(first.hands.len(), 3);
    let rules = RuleSetSpec {
        stop: Stop::Shifts(3),
        ..rules_for(4).spec()
    };
    assert_eq!(*duplicate.rules(), rules.validate().unwrap());
    let mut orders = vec![first.order.clone()];
    for seating in 1..duplicate.seatings().len() {
        let other = game(0, seating);
        assert_eq!(other.hands, first.hands);
        assert!(
            !orders.contains(&other.order),
            "agents that draw do so independently"
        );
        orders.push(other.order);
    }
    assert_eq!(game(0, 0), first);
    assert_ne!(game(1, 0).hands, first.hands);
    // Game d of a batch with this seed.
    let mut batch = Deals::default();
    let mut engine = chefshat_engine::Game::new(*duplicate.rules(), game_seed(9, 0), |event| {
        batch.on_event(&event);
    });
    assert!(engine.decision().is_some());
    engine.reseed(game_seed(9, 1));
    assert_eq!(batch.hands[0], first.hands[0]);
}

#[test]
fn any_number_of_threads_gives_the_same_figures_and_progress_counts_every_deal() {
    let contenders = [Contender::Kind(Greedy), careless()];
    let duplicate = duplicate(One, 4, 33);
    let runs = [1, 2, 3].map(|threads| {
        let finished = AtomicU64::new(0);
        let pool = ThreadPoolBuilder::new().num_threads(threads).build();
        let comparison = pool.unwrap().install(|| {
            duplicate.run(&contenders, &|deals| {
                finished.fetch_add(deals, Ordering::Relaxed);
            })
        });
        let comparison = comparison.unwrap();
        assert_eq!(finished.into_inner(), 33);
        comparison
    });
    assert_eq!(runs[0], runs[1]);
    assert_eq!(runs[0], runs[2]);
    let bits = |comparison: &Comparison| comparison.points.standard_error().to_bits();
    assert_eq!(bits(&runs[0]), bits(&runs[1]));
}

#[test]
fn a_small_comparison_has_these_numbers() {
    let comparison = compared(Greedy, Random, Half, 4, 10);
    let figures = [&comparison.points, &comparison.places, &comparison.wins].map(|figure| {
        [figure.a(), figure.b(), figure.standard_error()].map(|number| format!("{number:.6}"))
    });
    assert_eq!(
        figures,
        [
            ["3.950000", "0.550000", "0.048148"],
            ["1.525000", "3.475000", "0.024074"],
            ["0.491667", "0.008333", "0.011858"],
        ]
    );
}

#[test]
fn invalid_comparisons_are_refused() {
    let shifts = NonZeroU32::MIN;
    for deals in [0, 1] {
        let refused = Duplicate::new(rules_for(4), shifts, Half, deals, 9).unwrap_err();
        assert_eq!(refused, DuplicateError::Deals(deals));
    }
    let greedy = || Contender::Kind(Greedy);
    for contenders in [[careless(), greedy()], [greedy(), careless()]] {
        let refused = duplicate(Half, 5, 10)
            .run(&contenders, &|_| {})
            .unwrap_err();
        let expected = "it was trained for 4 players, 11 faces and hands of 17 cards";
        assert!(refused.to_string().starts_with(expected), "{refused}");
    }
}

#[test]
fn the_trained_agent_is_stronger_than_greedy() {
    let contenders = [AgentKind::Trained, Greedy].map(Contender::Kind);
    let rules = RuleSetSpec::default().validate().unwrap();
    let shifts = NonZeroU32::new(4).unwrap();
    let duplicate = Duplicate::new(rules, shifts, Half, 40, 0).unwrap();
    let points = duplicate.run(&contenders, &|_| {}).unwrap().points;
    assert!(points.interval95().low > 0.5, "{points:?}");
}
