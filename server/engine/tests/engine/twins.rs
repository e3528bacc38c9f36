//! Twins: two games that differ only in cards hidden from a viewer, played by the same decisions
//! and compared as the viewer sees them. `secrecy` creates them and states what is expected.

use chefshat_engine::{
    BySeat, Cards, DecisionKind, Event, Face, Game, Observation, RuleSet, Seat, Viewer,
};

use crate::support::Chance;

/// How a viewer sees a game: the engine's way, or one that leaks.
#[derive(Copy, Clone)]
pub(crate) struct View {
    pub(crate) event: fn(&Event, Viewer) -> Event,
    pub(crate) observe: fn(&Game, Viewer) -> Observation,
}

pub(crate) const HONEST: View = View {
    event: Event::seen_by,
    observe: Game::observe,
};

/// The number of comparisons without a difference, or the first difference.
pub(crate) type Verdict = Result<u32, String>;

/// Plays twins by the same decisions while these are legal in both, and compares what the viewer
/// sees after each. Returns the number of comparisons.
pub(crate) fn compare(
    view: View,
    viewer: Viewer,
    mut twins: [Game; 2],
    chance: &mut Chance,
) -> Verdict {
    let mut compared = 0;
    let mut seen = [Vec::new(), Vec::new()];
    loop {
        // Only the seat itself knows that it declines; not even the number of events may show it.
        for (twin, seen) in twins.iter_mut().zip(&mut seen) {
            settle(twin, viewer, |event| {
                seen.push((view.event)(&event, viewer))
            });
        }
        let [decision, other] = [0, 1].map(|index| twins[index].decision());
        // The viewer may know the cards it received and the seat that opens the Shift.
        let received = |game: &Game| own(viewer).map(|seat| game.received()[seat]);
        if decision != other || received(&twins[0]) != received(&twins[1]) {
            return Ok(compared);
        }
        if seen[0] != seen[1] {
            return Err(format!("events: {:?} and {:?}", seen[0], seen[1]));
        }
        let observations = [0, 1].map(|index| (view.observe)(&twins[index], viewer));
        if observations[0] != observations[1] {
            return Err(format!("observations: {observations:?}"));
        }
        compared += 1;
        let Some(decision) = decision else {
            return Ok(compared);
        };
        let masks = [0, 1].map(|index| twins[index].legal_actions());
        if own(viewer) == Some(decision.seat) && masks[0] != masks[1] {
            return Err(format!("masks: {masks:?}"));
        }
        let both: Vec<_> = masks[0]
            .iter()
            .filter(|&action| masks[1].contains(action))
            .collect();
        if both.is_empty() {
            return Ok(compared);
        }
        let action = both[chance.below(both.len())];
        for (twin, seen) in twins.iter_mut().zip(&mut seen) {
            twin.apply(action, |event| seen.push((view.event)(&event, viewer)))
                .unwrap();
        }
    }
}

pub(crate) fn own(viewer: Viewer) -> Option<Seat> {
    match viewer {
        Viewer::Seat(seat) => Some(seat),
        Viewer::Spectator | Viewer::Everything => None,
    }
}

/// Declines special actions of all seats but the viewer.
fn settle(game: &mut Game, viewer: Viewer, on_event: impl FnMut(Event)) {
    if let Some(decision) = game.decision()
        && decision.kind == DecisionKind::SpecialAction
        && own(viewer) != Some(decision.seat)
    {
        let decline = game.rules().actions().decline();
        game.apply(decline, on_event).unwrap();
    }
}

/// A card that can be swapped: a plain card of a face, or a joker.
#[derive(Copy, Clone, Eq, PartialEq, Debug)]
enum Hidden {
    Plain(Face),
    Joker,
}

fn hidden_cards(hand: Cards, faces: u8) -> Vec<Hidden> {
    let mut all: Vec<Hidden> = Vec::new();
    for face in (1..=faces).filter_map(Face::new) {
        let golden = u8::from(hand.has_golden() && face.get() == faces);
        all.extend((golden..hand.count(face)).map(|_| Hidden::Plain(face)));
    }
    all.extend((0..hand.jokers()).map(|_| Hidden::Joker));
    all
}

/// A hand with one card exchanged for another; the Golden card stays.
fn replaced(hand: Cards, faces: u8, out: Hidden, into: Hidden) -> Cards {
    let mut counts: Vec<u8> = hand.counts(faces).collect();
    let index = |card| match card {
        Hidden::Plain(face) => usize::from(face.get()) - 1,
        Hidden::Joker => usize::from(faces),
    };
    counts[index(out)] -= 1;
    counts[index(into)] += 1;
    Cards::from_counts(faces, &counts, hand.has_golden()).unwrap()
}

/// Draws a hidden card of each of two seats and swaps them; `None` if the two are equal or known to
/// the viewer.
pub(crate) fn swapped(
    game_hands: &BySeat<Cards>,
    rules: &RuleSet,
    viewer: Viewer,
    known: Cards,
    chance: &mut Chance,
) -> Option<BySeat<Cards>> {
    let others: Vec<Seat> = game_hands
        .seats()
        .filter(|&seat| own(viewer) != Some(seat))
        .collect();
    let (a, b) = (
        others[chance.below(others.len())],
        others[chance.below(others.len())],
    );
    let draw = |seat: Seat, chance: &mut Chance| {
        let cards = hidden_cards(game_hands[seat], rules.faces());
        (!cards.is_empty()).then(|| cards[chance.below(cards.len())])
    };
    let (from_a, from_b) = (draw(a, chance)?, draw(b, chance)?);
    let is_known = |card| match card {
        Hidden::Plain(face) => known.count(face) > 0,
        Hidden::Joker => known.jokers() > 0,
    };
    if a == b || from_a == from_b || is_known(from_a) || is_known(from_b) {
        return None;
    }
    let mut hands = *game_hands;
    hands[a] = replaced(hands[a], rules.faces(), from_a, from_b);
    hands[b] = replaced(hands[b], rules.faces(), from_b, from_a);
    Some(hands)
}
