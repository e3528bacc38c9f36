//! All deals that lead to what a seat saw, found by trying every deal in the engine. Shares nothing
//! with the sampler.

use std::collections::HashMap;

use chefshat_engine::{
    Action, ActionId, BySeat, Cards, DecisionKind, Event, Face, Game, Opening, RuleSet, Script,
    Seat, Seed, Viewer,
};

use crate::scenario::{Moment, Scenario};

/// The hands now, and what each seat gave in the exchange.
pub(crate) type Outcome = (BySeat<Cards>, BySeat<Cards>);

/// The number of ways to each outcome: physical deals, times physical gifts that the seat did not
/// see, times seats drawn for the opening.
pub(crate) fn enumerate(scenario: &Scenario, number: usize) -> HashMap<Outcome, f64> {
    let moment = &scenario.moments[number];
    let seen = Seen {
        scenario,
        moment,
        turns: scenario.moments[..number]
            .iter()
            .filter(|before| before.kind == DecisionKind::Turn)
            .map(|before| (before.seat, before.action))
            .collect(),
        gifts: gifts_by(scenario, moment.seat, &scenario.moments[..number]),
        declared: scenario.moments[..number].iter().find_map(|before| {
            let declares = before.action == scenario.rules.actions().declare();
            declares.then_some(before.seat)
        }),
    };
    let mut found = HashMap::new();
    let drawn: Vec<Option<Seat>> = match scenario.rules.opening() {
        Opening::Golden => vec![None],
        Opening::AnyTopFace => (0..scenario.rules.players())
            .map(|seat| Some(Seat::new(seat)))
            .collect(),
    };
    for (hands, ways) in deals(scenario, moment.seat) {
        for drawn in &drawn {
            let script = Script {
                hands,
                drawn: *drawn,
                ..scenario.script.clone()
            };
            let mut events = Vec::new();
            let viewer = Viewer::Seat(moment.seat);
            let game = Game::scripted(scenario.rules, Seed([0; 32]), &script, |event| {
                events.push(event.seen_by(viewer));
            });
            let game = game.expect("every deal can be scripted").closing_copy();
            seen.follow(game, events, 0, [0; 6], ways, &mut found);
        }
    }
    found
}

/// The gifts that a seat made or will have received, by giver, as it knows them.
fn gifts_by(scenario: &Scenario, seat: Seat, before: &[Moment]) -> Vec<Vec<ActionId>> {
    let mut gifts = vec![Vec::new(); scenario.rules.players()];
    let gives = |moment: &&Moment| moment.kind == DecisionKind::Exchange;
    for moment in before.iter().filter(gives) {
        gifts[moment.seat.index()].push(moment.action);
    }
    let received = scenario.moments[before.len()].observation.received;
    let complete = scenario.moments[before.len()].kind == DecisionKind::Turn;
    for (giver, gifts) in gifts.iter_mut().enumerate() {
        let to_seat = complete && !received.is_empty() && {
            let space = scenario.rules.actions();
            let mut counts = vec![0; usize::from(scenario.rules.faces()) + 1];
            for gift in gifts.iter() {
                match space.decode(*gift) {
                    Some(Action::Give(face)) => counts[usize::from(face.get()) - 1] += 1,
                    _ => counts[usize::from(scenario.rules.faces())] += 1,
                }
            }
            // The partner is public: the events name it.
            is_partner(scenario, before.len(), giver, seat)
                && received.counts(scenario.rules.faces()).eq(counts)
        };
        if giver != seat.index() && !to_seat {
            gifts.clear();
        }
    }
    gifts
}

fn is_partner(scenario: &Scenario, number: usize, giver: usize, seat: Seat) -> bool {
    scenario.moments[number]
        .history
        .events()
        .iter()
        .any(|event| {
            matches!(event, Event::CardsExchanged { giver: from, receiver, .. }
            if from.index() == giver && *receiver == seat)
        })
}

/// What a seat saw.
struct Seen<'a> {
    scenario: &'a Scenario,
    moment: &'a Moment,
    turns: Vec<(Seat, ActionId)>,
    gifts: Vec<Vec<ActionId>>,
    declared: Option<Seat>,
}

impl Seen<'_> {
    /// Follows a game as far as the seat saw it, and notes where it ends if the seat saw the same.
    fn follow(
        &self,
        mut game: Game,
        mut events: Vec<Event>,
        turn: usize,
        given: [usize; 6],
        ways: f64,
        found: &mut HashMap<Outcome, f64>,
    ) {
        let (rules, seat) = (&self.scenario.rules, self.moment.seat);
        let viewer = Viewer::Seat(seat);
        let Some(decision) = game.decision() else {
            return;
        };
        let own = decision.seat == seat && decision.kind == self.moment.kind;
        let giver = decision.seat.index();
        let known = match decision.kind {
            DecisionKind::Turn => self.turns.get(turn).map(|(mover, action)| {
                if *mover == decision.seat {
                    Some(*action)
                } else {
                    None
                }
            }),
            DecisionKind::SpecialAction if self.declared == Some(decision.seat) => {
                Some(Some(rules.actions().declare()))
            }
            DecisionKind::SpecialAction if own => None,
            DecisionKind::SpecialAction => Some(Some(rules.actions().decline())),
            DecisionKind::Exchange if decision.seat == seat || !self.gifts[giver].is_empty() => {
                self.gifts[giver].get(given[giver]).copied().map(Some)
            }
            DecisionKind::Exchange => {
                return self.imagine(&game, &events, turn, given, ways, found);
            }
        };
        match known {
            None => {
                let same = own
                    && game.observe(viewer) == self.moment.observation
                    && events == self.moment.history.events();
                if same {
                    *found.entry((*game.hands(), *game.gave())).or_default() += ways;
                }
            }
            Some(None) => {}
            Some(Some(action)) => {
                let tell = |event: Event| events.push(event.seen_by(viewer));
                if game.apply(action, tell).is_err() {
                    return;
                }
                let mut given = given;
                given[giver] += usize::from(decision.kind == DecisionKind::Exchange);
                let turn = turn + usize::from(decision.kind == DecisionKind::Turn);
                self.follow(game, events, turn, given, ways, found);
            }
        }
    }

    /// Follows every gift that another seat may have made to another. Each physical card is as
    /// likely, and so is each order of two of them.
    fn imagine(
        &self,
        game: &Game,
        events: &[Event],
        turn: usize,
        given: [usize; 6],
        ways: f64,
        found: &mut HashMap<Outcome, f64>,
    ) {
        let giver = game.decision().expect("a gift is open").seat;
        for action in game.legal_actions().iter() {
            let hand = game.hands()[giver];
            let cards = match self.scenario.rules.actions().decode(action) {
                Some(Action::Give(face)) => hand.count(face),
                _ => hand.jokers(),
            };
            let (mut game, mut events, mut given) = (game.clone(), events.to_vec(), given);
            let viewer = Viewer::Seat(self.moment.seat);
            game.apply(action, |event| events.push(event.seen_by(viewer)))
                .expect("a legal gift");
            given[giver.index()] += 1;
            let orders = given[giver.index()] as f64;
            let ways = ways * f64::from(cards) / orders;
            self.follow(game, events, turn, given, ways, found);
        }
    }
}

/// All deals in which a seat has the hand that it was dealt, with the number of physical deals.
fn deals(scenario: &Scenario, seat: Seat) -> Vec<(BySeat<Cards>, f64)> {
    let rules = &scenario.rules;
    let own = scenario.script.hands[seat];
    let faces = rules.faces();
    // Faces, the Golden card, jokers.
    let mut kinds: Vec<(Option<Face>, bool, u8)> = (1..=faces)
        .filter_map(Face::new)
        .map(|face| {
            let golden = u8::from(face.get() == faces);
            let plain_own = own.count(face) - u8::from(own.has_golden()) * golden;
            (Some(face), false, face.get() - golden - plain_own)
        })
        .collect();
    kinds.push((Face::new(faces), true, u8::from(!own.has_golden())));
    kinds.push((None, false, rules.jokers() - own.jokers()));
    let mut sizes = vec![rules.hand_size(); rules.players()];
    sizes[seat.index()] = 0;
    sizes.push(rules.deck_size() - rules.hand_size() * rules.players() as u8);
    let mut counts = vec![vec![0; usize::from(faces) + 1]; sizes.len()];
    let mut deals = Vec::new();
    deal_kinds(
        rules,
        &kinds,
        &mut sizes,
        &mut counts,
        None,
        1.0,
        &mut |counts, golden, ways| {
            let hands = BySeat::from_fn(rules.players(), |holder| {
                if holder == seat {
                    return own;
                }
                let golden = golden == Some(holder.index());
                Cards::from_counts(faces, &counts[holder.index()], golden).expect("a hand")
            });
            deals.push((hands, ways));
        },
    );
    deals
}

/// Deals kind after kind in every way.
fn deal_kinds(
    rules: &RuleSet,
    kinds: &[(Option<Face>, bool, u8)],
    sizes: &mut Vec<u8>,
    counts: &mut Vec<Vec<u8>>,
    golden: Option<usize>,
    ways: f64,
    found: &mut impl FnMut(&[Vec<u8>], Option<usize>, f64),
) {
    let Some(((face, is_golden, count), rest)) = kinds.split_first() else {
        return found(counts, golden, ways);
    };
    let kind = face.map_or(usize::from(rules.faces()), |face| {
        usize::from(face.get()) - 1
    });
    // Each physical card of the kind in turn goes to a holder; equal cards in ascending order, so
    // that every split comes once, with its number of orders.
    let mut splits = vec![Vec::new()];
    for _ in 0..*count {
        splits = splits
            .into_iter()
            .flat_map(|split: Vec<usize>| {
                let from = split.last().copied().unwrap_or(0);
                (from..sizes.len()).map(move |holder| {
                    let mut split = split.clone();
                    split.push(holder);
                    split
                })
            })
            .collect();
    }
    for split in splits {
        let mut per_holder = vec![0u8; sizes.len()];
        split.iter().for_each(|&holder| per_holder[holder] += 1);
        let fits = per_holder
            .iter()
            .zip(sizes.iter())
            .all(|(more, size)| more <= size);
        // The Golden card is never set aside.
        if !fits || (*is_golden && per_holder.last() == Some(&1)) {
            continue;
        }
        let orders = factorial(*count) / per_holder.iter().map(|&n| factorial(n)).product::<f64>();
        for (holder, more) in per_holder.iter().enumerate() {
            sizes[holder] -= more;
            counts[holder][kind] += more;
        }
        let golden = if *is_golden {
            split.first().copied()
        } else {
            golden
        };
        deal_kinds(rules, rest, sizes, counts, golden, ways * orders, found);
        for (holder, more) in per_holder.iter().enumerate() {
            sizes[holder] += more;
            counts[holder][kind] -= more;
        }
    }
}

fn factorial(n: u8) -> f64 {
    (1..=n).map(f64::from).product()
}
