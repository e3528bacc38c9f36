//! What the seat that decides has seen of the Shift in progress: the events of its history, as it
//! may know them, and its observation. A state has the cards of all seats, and none but those of
//! the seat get here.

use chefshat_engine::{
    Action, BySeat, Cards, Event, Game, Observation, Opening, Role, RuleSet, Seat, SpecialAction,
    Viewer,
};

use super::error::StateError;
use super::history::Known;
use super::saved::SavedGame;

/// What a seat has seen of the Shift in progress at a decision of its own.
#[derive(Clone, PartialEq, Debug)]
pub struct SeenShift {
    /// The rule set.
    pub rules: RuleSet,
    /// What the seat sees now.
    pub observation: Observation,
    /// The events since the Shift began that say something about cards.
    pub events: Vec<Event>,
}

impl SavedGame {
    /// What the seat of the open decision has seen of the Shift.
    ///
    /// # Errors
    /// If no decision is open, or the history does not reach back to the start of the Shift.
    pub fn seen(&self) -> Result<SeenShift, StateError> {
        let running = self.running().ok_or(StateError::NoDecision)?;
        let open = running.open.as_ref().ok_or(StateError::NoDecision)?;
        let seat = open.decision.seat;
        let history = running.history.as_ref();
        let state = running.game.state();
        let entries = history.and_then(|history| history.complete(seat, &state));
        let entries = entries.ok_or(StateError::HistoryTooShort)?;
        let observation = running.game.observe(Viewer::Seat(seat));
        Ok(SeenShift {
            rules: *running.game.rules(),
            events: events(&running.game, seat, &observation, &entries)
                .ok_or(StateError::Malformed("its history does not fit its cards"))?,
            observation,
        })
    }
}

/// The events that a history stands for.
fn events(game: &Game, seat: Seat, seen: &Observation, entries: &[Known]) -> Option<Vec<Event>> {
    let rules = game.rules();
    let (players, space) = (rules.players(), rules.actions());
    let mut hands = BySeat::filled(players, None);
    hands[seat] = Some(dealt(rules, seat, seen, entries)?);
    let mut events = vec![Event::ShiftStarted {
        shift: seen.shift,
        hands: Box::new(hands),
    }];
    let mut last_order = game.state().ranking;
    if game.state().special == Some(SpecialAction::FoodFight)
        && let Some(order) = &mut last_order
    {
        order.reverse();
    }
    if let Some(order) = last_order {
        let mut roles = BySeat::filled(players, None);
        for (seat, role) in order.as_slice().iter().zip(Role::in_order(players)) {
            roles[*seat] = Some(role);
        }
        events.push(Event::RolesAssigned { roles });
    }
    let mut left = BySeat::filled(players, rules.hand_size());
    for (index, entry) in entries.iter().enumerate() {
        let actor = entry.seat;
        if let Some(receiver) = entry.receiver {
            // One event for all cards of a giver.
            let of_actor = |other: &&Known| other.seat == actor && other.receiver.is_some();
            if entries[..index].iter().any(|other| of_actor(&other)) {
                continue;
            }
            events.push(Event::CardsExchanged {
                giver: actor,
                receiver,
                count: u8::try_from(entries.iter().filter(of_actor).count()).ok()?,
                cards: if seat == actor {
                    Some(seen.gave)
                } else if seat == receiver {
                    Some(seen.received)
                } else {
                    None
                },
            });
            continue;
        }
        let action = entry.action?;
        match space.decode(action)? {
            Action::Declare => {
                let special = SpecialAction::of_seat(actor, &last_order?);
                events.push(Event::SpecialActionDeclared {
                    seat: actor,
                    special,
                });
            }
            Action::Pass => {
                let cards_left = left[actor];
                events.push(Event::Passed {
                    seat: actor,
                    cards_left,
                });
            }
            Action::Decline => {}
            other => {
                let (face, quantity, jokers) = cards_of(other, rules)?;
                left[actor] = left[actor].checked_sub(quantity + jokers)?;
                events.push(Event::Played {
                    seat: actor,
                    action,
                    face,
                    quantity,
                    jokers,
                    cards_left: left[actor],
                });
            }
        }
    }
    Some(events)
}

/// The face that an action plays, one above all faces for a joker alone, and how many natural cards
/// and jokers; `None` if it is not a play.
fn cards_of(action: Action, rules: &RuleSet) -> Option<(u8, u8, u8)> {
    match action {
        Action::Play {
            face,
            quantity,
            jokers,
        } => Some((face.get(), quantity, jokers)),
        Action::LoneJoker => Some((rules.faces() + 1, 0, 1)),
        _ => None,
    }
}

/// The hand that the seat was dealt, from what it holds, played, gave and received.
fn dealt(rules: &RuleSet, seat: Seat, seen: &Observation, entries: &[Known]) -> Option<Cards> {
    let (space, faces) = (rules.actions(), rules.faces());
    let top = usize::from(faces) - 1;
    let joker = usize::from(faces);
    let mut counts = seen.hand.count_array(faces);
    let mut add = |kind: usize, count: u8| {
        counts[kind] = counts[kind].checked_add(count)?;
        Some(())
    };
    let mut opener = None;
    for entry in entries.iter().filter(|entry| entry.receiver.is_none()) {
        let action = space.decode(entry.action?)?;
        let cards = cards_of(action, rules);
        if cards.is_some() || action == Action::Pass {
            opener = opener.or(Some(entry.seat));
        }
        if let (true, Some((face, quantity, jokers))) = (entry.seat == seat, cards) {
            add(usize::from(face) - 1, quantity)?;
            add(joker, jokers)?;
        }
    }
    let (gave, received) = (
        seen.gave.count_array(faces),
        seen.received.count_array(faces),
    );
    for ((count, gave), received) in counts.iter_mut().zip(gave).zip(received) {
        *count = count.checked_add(gave)?.checked_sub(received)?;
    }
    // By the Golden opening the first seat to act held the Golden card, and has played it if it does
    // not hold it. By the other one the card is like any of its face.
    let opened = rules.opening() == Opening::Golden && opener == Some(seat);
    let held = seen.hand.has_golden() || seen.gave.has_golden() || opened;
    let golden = held && !seen.received.has_golden() && counts[top] > 0;
    Cards::from_counts(faces, &counts[..=joker], golden)
}
