//! Reliability of tournament results: equal participants are seldom called different, and only
//! games without forfeit or substitute are rated.

use chefshat_agents::AgentKind;
use chefshat_engine::{RuleSet, RuleSetSpec, Stop};
use chefshat_simulation::tournament::play_offline;
use chefshat_tournament::testing::{begun, settings};
use chefshat_tournament::{
    Change, Deals, Format, GameResult, SURE, Scored, SeatResult, SeatStatistics, Settings,
    Tournament, order_confidence,
};

const POINTS: [f64; 4] = [5.0, 3.0, 1.0, 0.0];

/// Reproducible numbers from 0 to 1.
struct Chance(u64);

impl Chance {
    fn draw(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    fn score(&mut self) -> f64 {
        POINTS[(self.draw() * 4.0) as usize]
    }

    /// The scores of two at one table.
    fn at_one_table(&mut self) -> [f64; 2] {
        let first = (self.draw() * 4.0) as usize;
        let second = (first + 1 + (self.draw() * 3.0) as usize) % 4;
        [POINTS[first], POINTS[second]]
    }

    /// The scores of two participants with the same cards, which mostly decide.
    fn same_cards(&mut self) -> [f64; 2] {
        let luck = self.score();
        [luck, luck].map(|luck| {
            if self.draw() < 0.3 {
                self.score()
            } else {
                luck
            }
        })
    }
}

/// How often one of two equal participants is called better. Their scores in game n are `of(n)`,
/// each with its occasion.
fn called_sure(games: u64, of: impl Fn(&mut Chance, u64) -> [Scored; 2]) -> f64 {
    let repetitions = 3000;
    let mut chance = Chance(17);
    let sure = (0..repetitions)
        .filter(|_| {
            let both: Vec<[Scored; 2]> = (0..games).map(|game| of(&mut chance, game)).collect();
            let scores = |who: usize| both.iter().map(|both| both[who]).collect::<Vec<_>>();
            let (first, second) = (scores(0), scores(1));
            // The standings have the one with the higher mean above.
            [(&first, &second), (&second, &first)]
                .iter()
                .any(|(upper, lower)| order_confidence(upper, lower).confidence > SURE)
        })
        .count();
    sure as f64 / f64::from(repetitions)
}

#[test]
fn equal_participants_are_called_different_as_rarely_as_stated() {
    let on = |occasions: [u64; 2], scores: [f64; 2]| {
        [0, 1].map(|who| Scored {
            occasion: occasions[who],
            score: scores[who],
        })
    };
    let shares = [
        (
            "at one table",
            called_sure(40, |chance, game| on([game; 2], chance.at_one_table())),
        ),
        (
            "with the same cards",
            called_sure(40, |chance, game| on([game; 2], chance.same_cards())),
        ),
        (
            "with nothing in common",
            called_sure(40, |chance, game| {
                on([game, 1000 + game], [chance.score(), chance.score()])
            }),
        ),
        (
            "sometimes at one table",
            called_sure(40, |chance, game| match game % 4 {
                0 => on([game; 2], chance.at_one_table()),
                _ => on([game, 1000 + game], [chance.score(), chance.score()]),
            }),
        ),
    ];
    for (how, share) in shares {
        assert!((0.03..0.06).contains(&share), "{how}: {share}");
    }
}

fn rules() -> RuleSet {
    let spec = RuleSetSpec {
        stop: Stop::Shifts(1),
        ..RuleSetSpec::default()
    };
    spec.validate().unwrap()
}

/// A Swiss tournament of these agents that has begun.
fn swiss(agents: &[AgentKind], deals: Deals, draw: u8) -> Tournament {
    let settings = Settings {
        rounds: Some(12),
        games_per_pairing: 10,
        deals,
        max_participants: 24,
        draw_seed: [draw; 32],
        ..settings(Format::Swiss)
    };
    begun(settings, agents.iter().copied().map(Some))
}

#[test]
fn easier_opponents_do_not_make_a_participant_look_better() {
    use AgentKind::{Greedy, Random, Trained};
    let agents: Vec<AgentKind> = [Trained, Greedy, Random].repeat(8);
    let (mut pairs, mut sure) = (0, 0);
    for deals in [Deals::Independent, Deals::SameAtAllTables] {
        for draw in 0..4 {
            let mut tournament = swiss(&agents, deals, draw);
            play_offline(&mut tournament, rules(), 4, &|_| {}).unwrap();
            for pair in tournament.order_confidence() {
                // Agents of one kind play alike, whatever their opponents.
                if agents[pair.upper] == agents[pair.lower] {
                    pairs += 1;
                    sure += usize::from(pair.order.confidence > SURE);
                }
            }
        }
    }
    assert!(pairs > 100, "{pairs}");
    assert!(sure * 10 <= pairs, "{sure} of {pairs}");
}

#[test]
fn different_neighbours_are_told_apart_and_equal_ones_are_not() {
    use AgentKind::{Greedy, Random, Trained};
    let agents = [
        Trained, Trained, Greedy, Greedy, Greedy, Random, Random, Random,
    ];
    let mut tournament = swiss(&agents, Deals::SameAtAllTables, 3);
    play_offline(&mut tournament, rules(), 4, &|_| {}).unwrap();
    let standings = tournament.standings();
    let neighbours = tournament.order_confidence();
    assert_eq!(neighbours.len(), 7);
    let sure = |pair: usize| neighbours[pair].order.confidence;
    for (pair, two) in neighbours.iter().zip(standings.windows(2)) {
        assert_eq!(
            (pair.upper, pair.lower),
            (two[0].participant, two[1].participant)
        );
        let difference = two[0].mean_score() - two[1].mean_score();
        assert!((pair.order.difference - difference).abs() < 1e-9);
        assert!(pair.order.confidence >= 0.5);
        let settled = pair.order.confidence >= SURE;
        assert_eq!(pair.order.more_games.is_none(), settled, "{pair:?}");
    }
    // Between trained and greedy, and between greedy and random, the larger step.
    assert!(sure(1) > 0.8 && sure(4) > 0.99, "{neighbours:?}");

    let ratings = tournament.ratings();
    assert_eq!(ratings.games(), tournament.games().len() as u64);
    let order = ratings.leaderboard(|_| true, 0);
    let kinds: Vec<AgentKind> = order.iter().map(|(who, _)| agents[**who]).collect();
    assert_eq!(kinds, agents);
    for (who, rated) in order {
        let played = standings
            .iter()
            .find(|standing| standing.participant == *who);
        assert_eq!(rated.games, played.unwrap().games);
    }
}

#[test]
fn games_with_forfeits_or_substitutes_are_not_rated() {
    let mut tournament = swiss(&[AgentKind::Greedy; 4], Deals::SameAtAllTables, 3);
    let seats = |forfeited: bool, substituted: bool| {
        let seat = |participant: usize| SeatResult {
            participant,
            forfeited: forfeited && participant == 3,
            score: [5, 3, 1, 0][participant],
            statistics: SeatStatistics {
                place: participant + 1,
                substituted: substituted && participant == 2,
                ..SeatStatistics::default()
            },
        };
        (0..4).map(seat).collect()
    };
    let mut called = Vec::new();
    while let Some(change) = tournament.next(0) {
        tournament.fold(&change);
        if let Change::Called { game, .. } = change {
            called.push(game);
        }
        if called.len() == 3 {
            break;
        }
    }
    let games = [(true, false), (false, true), (false, false)];
    for (game, (forfeited, substituted)) in called.into_iter().zip(games) {
        let result = GameResult {
            shifts: 1,
            seats: seats(forfeited, substituted),
        };
        tournament.fold(&Change::Counted { game, result });
        let rated = tournament.games()[game].is_rated();
        assert_eq!(rated, !forfeited && !substituted);
    }
    let ratings = tournament.ratings();
    assert_eq!(ratings.games(), 1);
    assert!(ratings.rating(&0).mean > ratings.rating(&3).mean);
    assert_eq!(ratings.get(&0).unwrap().places, [1]);
}
