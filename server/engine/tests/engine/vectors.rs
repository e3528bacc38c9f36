//! The vectors of `tests/fixtures/vectors`: deals and games of another engine, which must match
//! card for card.

use std::path::PathBuf;

use chefshat_engine::{ActionId, Card, Deal, Event, Game, Seat, ShiftEnd, SpecialAction};
use serde::Deserialize;
use serde::de::DeserializeOwned;
use serde_json::{Value, json};

use crate::support::{VectorRules, seed_from_hex};

/// The lines of the files, so that a lost file or line is noticed.
const DEALS: usize = 87;
const GAMES: usize = 57;

fn lines<T: DeserializeOwned>(file: &str) -> Vec<T> {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR"))
        .join("../../tests/fixtures/vectors")
        .join(file);
    let text = std::fs::read_to_string(&path)
        .unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    text.lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect()
}

#[derive(Deserialize)]
struct DealVector {
    rules: VectorRules,
    seed: String,
    shift: u32,
    hands: Vec<Vec<Value>>,
    leader: usize,
}

#[test]
fn deals() {
    let vectors: Vec<DealVector> = lines("deals.jsonl");
    assert_eq!(vectors.len(), DEALS);
    for (line, vector) in vectors.iter().enumerate() {
        let rules = vector.rules.rule_set();
        let deal = Deal::new(&rules, seed_from_hex(&vector.seed), vector.shift);
        assert_eq!(vector.hands.len(), rules.players());
        for (seat, expected) in vector.hands.iter().enumerate() {
            let hand: Vec<Value> = deal
                .cards(Seat::new(seat))
                .map(|card| card_json(card, rules.faces()))
                .collect();
            assert_eq!(&hand, expected, "deal {line}, seat {seat}");

            let packed = deal.hands()[Seat::new(seat)];
            let mut sorted: Vec<u64> = expected
                .iter()
                .map(|card| card.as_u64().unwrap_or(rules.faces().into()))
                .collect();
            sorted.sort_unstable();
            assert_eq!(
                packed
                    .ascending(rules.faces())
                    .map(u64::from)
                    .collect::<Vec<_>>(),
                sorted,
                "deal {line}"
            );
            assert_eq!(
                packed.has_golden(),
                expected.contains(&json!("G")),
                "deal {line}"
            );
        }
        assert_eq!(deal.leader(), Seat::new(vector.leader), "deal {line}");
    }
}

fn card_json(card: Card, faces: u8) -> Value {
    match card {
        Card::Plain(face) => json!(face.get()),
        Card::Golden => json!("G"),
        Card::Joker => json!(faces + 1),
    }
}

#[derive(Deserialize)]
struct GameVector {
    rules: VectorRules,
    seed: String,
    steps: Vec<(usize, u16, Vec<u16>)>,
    shifts: Vec<Value>,
    scores: Vec<u64>,
    winner: usize,
}

#[test]
fn games() {
    let vectors: Vec<GameVector> = lines("games.jsonl");
    assert_eq!(vectors.len(), GAMES);
    for (line, vector) in vectors.iter().enumerate() {
        let mut shifts = Vec::new();
        let mut on_event = |event: Event| {
            if let Some(shift) = shift_json(&event) {
                shifts.push(shift);
            }
        };
        let mut game = Game::new(
            vector.rules.rule_set(),
            seed_from_hex(&vector.seed),
            &mut on_event,
        );
        for (step, (seat, action, legal)) in vector.steps.iter().enumerate() {
            let decision = game
                .decision()
                .unwrap_or_else(|| panic!("game {line} ended before step {step}"));
            assert_eq!(decision.seat.index(), *seat, "game {line}, step {step}");
            let mask = game.legal_actions();
            assert_eq!(
                mask.iter().map(ActionId::index).collect::<Vec<_>>(),
                *legal,
                "game {line}, step {step}"
            );
            assert_eq!(mask.len(), legal.len(), "game {line}, step {step}");
            game.apply(ActionId::new(*action), &mut on_event).unwrap();
        }
        assert!(game.is_over(), "game {line}");
        assert_eq!(shifts, vector.shifts, "game {line}");
        let standings = game.standings().unwrap();
        assert_eq!(standings.points.as_slice(), vector.scores, "game {line}");
        assert_eq!(standings.winner().index(), vector.winner, "game {line}");
    }
}

/// The end of a Shift as the vectors write it.
fn shift_json(event: &Event) -> Option<Value> {
    let Event::ShiftEnded(end) = event else {
        return None;
    };
    let ShiftEnd {
        shift,
        order,
        starter,
        pizzas,
        laps,
        turns,
        special,
        adjudicated,
        ..
    } = **end;
    let special = special.map(|special| match special {
        SpecialAction::FoodFight => "food_fight",
        SpecialAction::DinnerIsServed => "dinner_is_served",
    });
    Some(json!({
        "shift": shift,
        "order": order.as_slice().iter().map(|seat| seat.index()).collect::<Vec<_>>(),
        "starter": starter.index(),
        "pizzas": pizzas,
        "laps": laps,
        "turns": turns,
        "special": special,
        "adjudicated": adjudicated,
    }))
}
