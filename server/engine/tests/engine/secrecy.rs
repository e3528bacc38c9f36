//! Two games that differ only in cards hidden from a viewer, played by the same decisions, look the
//! same to that viewer. The same check must catch views that leak on purpose.

use chefshat_engine::{
    BySeat, Cards, DecisionKind, Event, Game, Observation, Opening, PassScope, RuleSet,
    RuleSetSpec, Script, Seat, Seed, Viewer,
};

use crate::support::{Chance, hands, order};
use crate::twins::{HONEST, Verdict, View, compare, own, swapped};

fn rule_sets() -> Vec<RuleSet> {
    let standard = RuleSetSpec::default;
    let specs = [
        standard(),
        RuleSetSpec::preset("original2020").unwrap(),
        RuleSetSpec {
            players: 3,
            faces: 7,
            jokers: 1,
            ..standard()
        },
        RuleSetSpec {
            players: 6,
            faces: 15,
            pass_scope: PassScope::Turn,
            ..standard()
        },
        RuleSetSpec {
            players: 5,
            faces: 5,
            opening: Opening::AnyTopFace,
            ..standard()
        },
        RuleSetSpec {
            exchange: false,
            ..standard()
        },
    ];
    specs.iter().map(|spec| spec.validate().unwrap()).collect()
}

fn viewers(rules: &RuleSet) -> Vec<Viewer> {
    (0..rules.players())
        .map(|seat| Viewer::Seat(Seat::new(seat)))
        .chain([Viewer::Spectator])
        .collect()
}

/// Twins that differ from the middle of a Shift on: two other seats swap hidden cards.
fn check_turns(view: View, rounds: usize) -> Verdict {
    let mut chance = Chance(11);
    let mut compared = 0;
    for rules in rule_sets() {
        for round in 0..rounds {
            let mut seed = [0; 32];
            seed[0] = round as u8;
            let mut game = Game::new(rules, Seed(seed), |_| {});
            for _ in 0..chance.below(150) {
                if !game.is_over() {
                    let action = chance.legal_action(&game);
                    game.apply(action, |_| {}).unwrap();
                }
            }
            for viewer in viewers(&rules) {
                // The viewer knows the cards it gave to be in another hand.
                let known = own(viewer).map_or(Cards::EMPTY, |seat| game.gave()[seat]);
                let twin = swapped(game.hands(), &rules, viewer, known, &mut chance);
                if let Some(twin) = twin.and_then(|hands| game.with_hands(hands).ok()) {
                    compared += compare(view, viewer, [game.clone(), twin], &mut chance)?;
                }
            }
        }
    }
    Ok(compared)
}

/// Twins that differ from the deal on, before special action and exchange.
fn check_deals(view: View, rounds: usize) -> Verdict {
    let mut chance = Chance(12);
    let mut compared = 0;
    for rules in rule_sets() {
        for round in 0..rounds {
            let mut seed = [1; 32];
            seed[0] = round as u8;
            let dealt = chefshat_engine::Deal::new(&rules, Seed(seed), 2);
            let mut seats: Vec<usize> = (0..rules.players()).collect();
            seats.rotate_left(chance.below(rules.players()));
            let start = |hands: BySeat<Cards>| {
                let script = Script {
                    shift: 2,
                    last_order: Some(order(&seats)),
                    drawn: dealt.drawn(),
                    ..Script::first_shift(hands)
                };
                let mut events = Vec::new();
                let game =
                    Game::scripted(rules, Seed(seed), &script, |event| events.push(event)).unwrap();
                (game, events)
            };
            for viewer in viewers(&rules) {
                let Some(twin) = swapped(&dealt.hands(), &rules, viewer, Cards::EMPTY, &mut chance)
                else {
                    continue;
                };
                let gifts = |hands: &BySeat<Cards>| hands.map(|hand| hand.faces_len().min(2));
                if gifts(&dealt.hands()) != gifts(&twin) {
                    // How many cards are given is public.
                    continue;
                }
                let [(game, events), (twin, twin_events)] = [start(dealt.hands()), start(twin)];
                let seen = |events: &[Event]| {
                    events
                        .iter()
                        .map(|event| (view.event)(event, viewer))
                        .collect::<Vec<_>>()
                };
                if seen(&events) != seen(&twin_events) {
                    return Err(format!("the deal: {events:?} and {twin_events:?}"));
                }
                compared += compare(view, viewer, [game, twin], &mut chance)?;
            }
        }
    }
    Ok(compared)
}

#[test]
fn games_that_differ_in_hidden_cards_look_the_same() {
    let turns = check_turns(HONEST, 40).unwrap();
    let deals = check_deals(HONEST, 40).unwrap();
    assert!(
        turns > 10_000 && deals > 10_000,
        "{turns} and {deals} comparisons"
    );
}

#[test]
fn planted_leaks_are_caught() {
    let leaks: [(&str, View); 6] = [
        (
            "another hand",
            View {
                observe: leaky_hand,
                ..HONEST
            },
        ),
        (
            "gifts of others",
            View {
                observe: leaky_gifts,
                ..HONEST
            },
        ),
        (
            "the golden card among cards played",
            View {
                observe: leaky_golden,
                ..HONEST
            },
        ),
        (
            "all hands at the deal",
            View {
                event: leaky_deal,
                ..HONEST
            },
        ),
        (
            "the content of every exchange",
            View {
                event: leaky_exchange,
                ..HONEST
            },
        ),
        (
            "another's open decision",
            View {
                observe: leaky_decision,
                ..HONEST
            },
        ),
    ];
    for (name, leaky) in leaks {
        let checks = check_turns(leaky, 40)
            .and_then(|_| check_deals(leaky, 40))
            .and_then(|_| silent_decline(leaky))
            .and_then(|_| golden_swap(leaky));
        assert!(checks.is_err(), "{name} was not noticed");
    }
}

#[test]
fn the_golden_card_is_not_recognised_when_played() {
    assert!(golden_swap(HONEST).unwrap() > 100);
}

#[test]
fn declining_a_special_action_is_hidden() {
    assert!(silent_decline(HONEST).unwrap() > 100);
}

/// Twins of which one has a seat that may declare, and declines. No other viewer can tell them
/// apart, even while the decision is open.
fn silent_decline(view: View) -> Verdict {
    let rules = RuleSetSpec {
        players: 4,
        faces: 5,
        ..RuleSetSpec::default()
    }
    .validate()
    .unwrap();
    let start = |lines: &[&str]| {
        let script = Script {
            shift: 2,
            last_order: Some(order(&[2, 0, 3, 1])),
            ..Script::first_shift(hands(5, lines))
        };
        Game::scripted(rules, Seed([4; 32]), &script, |_| {}).unwrap()
    };
    // Seats 0 and 3 swap a joker and a 5, which is not a forced gift.
    let offered = start(&["3 4 J J", "2 3 5 5", "1 2 4 G", "3 4 4 5"]);
    let other = start(&["3 4 5 J", "2 3 5 5", "1 2 4 G", "3 4 4 J"]);
    assert_eq!(
        offered.decision().unwrap().kind,
        DecisionKind::SpecialAction
    );
    assert_eq!(other.decision().unwrap().kind, DecisionKind::Exchange);
    let mut compared = 0;
    for viewer in [Viewer::Seat(Seat::new(1)), Viewer::Spectator] {
        let asked = [
            (view.observe)(&offered, viewer),
            (view.observe)(&other, viewer),
        ];
        if asked[0] != asked[1] {
            return Err(format!("while it is asked: {asked:?}"));
        }
        for round in 0..20 {
            compared += compare(
                view,
                viewer,
                [offered.clone(), other.clone()],
                &mut Chance(round),
            )?;
        }
    }
    Ok(compared)
}

/// Twins in which two seats swap the Golden card and a plain card of its face, with an opening that
/// does not reveal it.
fn golden_swap(view: View) -> Verdict {
    let rules = RuleSetSpec {
        players: 3,
        faces: 4,
        opening: Opening::AnyTopFace,
        ..RuleSetSpec::default()
    }
    .validate()
    .unwrap();
    let start = |lines: &[&str]| {
        let script = Script {
            drawn: Some(Seat::new(0)),
            ..Script::first_shift(hands(4, lines))
        };
        Game::scripted(rules, Seed([4; 32]), &script, |_| {}).unwrap()
    };
    let twins = [
        start(&["3 4 4 J", "1 2 2 G", "3 3 4 J"]),
        start(&["3 4 4 J", "1 2 2 4", "3 3 G J"]),
    ];
    let mut compared = 0;
    for round in 0..20 {
        compared += compare(
            view,
            Viewer::Seat(Seat::new(0)),
            twins.clone(),
            &mut Chance(round),
        )?;
    }
    Ok(compared)
}

fn left_neighbour(game: &Game, viewer: Viewer) -> Seat {
    Seat::new((own(viewer).map_or(0, Seat::index) + 1) % game.rules().players())
}

fn leaky_hand(game: &Game, viewer: Viewer) -> Observation {
    Observation {
        hand: game.hands()[left_neighbour(game, viewer)],
        ..game.observe(viewer)
    }
}

fn leaky_gifts(game: &Game, viewer: Viewer) -> Observation {
    Observation {
        received: game.received()[left_neighbour(game, viewer)],
        ..game.observe(viewer)
    }
}

fn leaky_golden(game: &Game, viewer: Viewer) -> Observation {
    let mut view = game.observe(viewer);
    let held = game.hands().values().any(|hand| hand.has_golden());
    let counts: Vec<u8> = view.played.counts(view.faces).collect();
    if let Some(played) = Cards::from_counts(view.faces, &counts, !held) {
        view.played = played;
    }
    view
}

fn leaky_decision(game: &Game, viewer: Viewer) -> Observation {
    Observation {
        kind: game.decision().map(|decision| decision.kind),
        ..game.observe(viewer)
    }
}

fn leaky_deal(event: &Event, viewer: Viewer) -> Event {
    match event {
        Event::ShiftStarted { .. } => event.clone(),
        _ => event.seen_by(viewer),
    }
}

fn leaky_exchange(event: &Event, viewer: Viewer) -> Event {
    match event {
        Event::CardsExchanged { .. } => event.clone(),
        _ => event.seen_by(viewer),
    }
}

#[test]
fn only_private_fields_are_redacted() {
    let rules = RuleSetSpec::default().validate().unwrap();
    let mut events = Vec::new();
    let mut game = Game::new(rules, Seed([2; 32]), |event| events.push(event));
    let mut chance = Chance(4);
    while !game.is_over() {
        let action = chance.legal_action(&game);
        game.apply(action, |event| events.push(event)).unwrap();
    }
    let (mut deals, mut exchanges) = (0, 0);
    for event in &events {
        assert_eq!(event.seen_by(Viewer::Everything), *event);
        for viewer in viewers(&rules) {
            let seen = event.seen_by(viewer);
            assert_eq!(std::mem::discriminant(&seen), std::mem::discriminant(event));
            assert_eq!(
                seen.seen_by(viewer),
                seen,
                "redacting twice changes nothing"
            );
            match (event.clone(), seen.clone()) {
                (Event::ShiftStarted { hands, .. }, Event::ShiftStarted { hands: shown, .. }) => {
                    deals += 1;
                    for (seat, hand) in shown.iter() {
                        assert_eq!(*hand, hands[seat].filter(|_| own(viewer) == Some(seat)));
                    }
                }
                (
                    Event::CardsExchanged {
                        giver,
                        receiver,
                        cards,
                        ..
                    },
                    Event::CardsExchanged { cards: shown, .. },
                ) => {
                    exchanges += 1;
                    let party = own(viewer) == Some(giver) || own(viewer) == Some(receiver);
                    assert_eq!(shown, cards.filter(|_| party));
                }
                _ => assert_eq!(seen, *event),
            }
        }
    }
    assert!(
        deals >= 15 && exchanges >= 40,
        "{deals} deals, {exchanges} exchanges"
    );
}
