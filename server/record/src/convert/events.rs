//! Converts events of the engine to the protocol, and those of a Shift back. Redaction comes
//! before, in `Event::seen_by`: everything present is written.

use chefshat_engine::{ActionSpace, BySeat, Event, Role, RuleSet, SpecialAction, Standings};
use chefshat_proto::v1::{self, game_event::Kind};

use super::numbers::{
    action_id, ascending, cards_from_numbers, seat_cards, seat_from_number, seat_number,
};
use super::rules::{FieldProblem, role_from_number};

/// The cause of an event.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct By {
    /// The source of the decision.
    pub source: v1::DecisionSource,
    /// Measured decision time, microseconds; 0 for built-in agents.
    pub decision_time_us: u64,
}

/// Converts an event. `None` for the end of the game, which the room reports with the seed reveal.
pub fn event_kind(event: &Event, space: ActionSpace, by: By) -> Option<Kind> {
    let faces = space.faces();
    Some(match *event {
        Event::ShiftStarted { shift, ref hands } => Kind::ShiftStarted(v1::ShiftStarted {
            shift,
            hands: hands
                .iter()
                .filter_map(|(seat, hand)| hand.map(|hand| seat_cards(seat, hand, faces)))
                .collect(),
        }),
        Event::RolesAssigned { ref roles } => Kind::RolesAssigned(v1::RolesAssigned {
            roles: roles_to_proto(roles),
        }),
        Event::SpecialActionDeclared { seat, special } => {
            Kind::SpecialActionDeclared(Box::new(v1::SpecialActionDeclared {
                seat: seat_number(seat),
                action: special_to_proto(special).into(),
                source: by.source.into(),
                decision_time_us: by.decision_time_us,
            }))
        }
        Event::CardsExchanged {
            giver,
            receiver,
            count,
            cards,
        } => Kind::CardsExchanged(Box::new(v1::CardsExchanged {
            giver: seat_number(giver),
            receiver: seat_number(receiver),
            count: count.into(),
            cards: cards.map_or_else(Vec::new, |cards| ascending(cards, faces)),
            golden: cards.is_some_and(|cards| cards.has_golden()),
        })),
        Event::Played {
            seat,
            action,
            face,
            quantity,
            jokers,
            cards_left,
        } => Kind::Play(v1::Play {
            seat: seat_number(seat),
            action: action.index().into(),
            face: face.into(),
            quantity: quantity.into(),
            jokers: jokers.into(),
            cards_left: cards_left.into(),
            source: by.source.into(),
            decision_time_us: by.decision_time_us,
        }),
        Event::Passed { seat, .. } => Kind::Pass(v1::Pass {
            seat: seat_number(seat),
            source: by.source.into(),
            decision_time_us: by.decision_time_us,
        }),
        Event::SeatFinished { seat, place } => Kind::SeatFinished(v1::SeatFinished {
            seat: seat_number(seat),
            place: place.into(),
        }),
        Event::PizzaDone {
            pizza,
            last_to_play,
            next_leader,
        } => Kind::PizzaDone(v1::PizzaDone {
            pizza,
            last_to_play: last_to_play.map(seat_number),
            next_leader: seat_number(next_leader),
        }),
        Event::ShiftEnded(ref end) => Kind::ShiftEnded(Box::new(v1::ShiftEnded {
            shift: end.shift,
            order: (end.order.as_slice().iter().copied())
                .map(seat_number)
                .collect(),
            shift_points: end.points.values().copied().collect(),
            points: end.scores.values().copied().collect(),
            starter: seat_number(end.starter),
            pizzas: end.pizzas,
            laps: end.laps,
            turns: end.turns,
            adjudicated: end.adjudicated,
        })),
        Event::GameEnded { .. } => return None,
    })
}

/// Reads an event of a Shift that is not over, as a seat saw it. `None` for events that say nothing
/// about the cards.
///
/// # Errors
/// The first field that does not match the rules.
pub fn event_from_proto(kind: &Kind, rules: &RuleSet) -> Result<Option<Event>, FieldProblem> {
    let players = rules.players();
    let problem = |words: &str| FieldProblem::new("events", words);
    let seat_of = |number| {
        seat_from_number(number, players).ok_or_else(|| problem("the game has no such seat"))
    };
    let cards_of = |numbers: &[u32], golden| {
        cards_from_numbers(numbers, golden, rules.faces())
            .ok_or_else(|| problem("no deck of these rules has these cards"))
    };
    Ok(Some(match kind {
        Kind::ShiftStarted(started) => {
            let mut hands = BySeat::filled(players, None);
            for hand in &started.hands {
                hands[seat_of(hand.seat)?] = Some(cards_of(&hand.cards, hand.golden)?);
            }
            Event::ShiftStarted {
                shift: started.shift,
                hands: Box::new(hands),
            }
        }
        Kind::RolesAssigned(assigned) => {
            let roles: Vec<Option<Role>> = (assigned.roles.iter())
                .map(|&role| u8::try_from(role).ok().and_then(role_from_number))
                .collect();
            let roles = BySeat::from_slice(&roles).filter(|roles| roles.len() == players);
            Event::RolesAssigned {
                roles: roles.ok_or_else(|| problem("roles must have one entry per seat"))?,
            }
        }
        Kind::SpecialActionDeclared(declared) => Event::SpecialActionDeclared {
            seat: seat_of(declared.seat)?,
            special: match declared.action() {
                v1::SpecialAction::FoodFight => SpecialAction::FoodFight,
                v1::SpecialAction::DinnerIsServed => SpecialAction::DinnerIsServed,
                v1::SpecialAction::Unspecified => return Err(problem("unknown special action")),
            },
        },
        Kind::CardsExchanged(gift) => Event::CardsExchanged {
            giver: seat_of(gift.giver)?,
            receiver: seat_of(gift.receiver)?,
            count: u8::try_from(gift.count).map_err(|_| problem("too many cards exchanged"))?,
            cards: match gift.cards.as_slice() {
                [] => None,
                cards => Some(cards_of(cards, gift.golden)?),
            },
        },
        Kind::Play(play) => {
            let small = |number: u32| u8::try_from(number).unwrap_or(u8::MAX);
            Event::Played {
                seat: seat_of(play.seat)?,
                action: action_id(play.action),
                face: small(play.face),
                quantity: small(play.quantity),
                jokers: small(play.jokers),
                cards_left: small(play.cards_left),
            }
        }
        // The number of cards left is not sent.
        Kind::Pass(pass) => Event::Passed {
            seat: seat_of(pass.seat)?,
            cards_left: 0,
        },
        _ => return Ok(None),
    }))
}

fn roles_to_proto(roles: &BySeat<Option<Role>>) -> Vec<i32> {
    roles
        .values()
        .map(|role| role.map_or(0, |role| role as i32))
        .collect()
}

/// Converts a special action.
pub fn special_to_proto(special: SpecialAction) -> v1::SpecialAction {
    match special {
        SpecialAction::FoodFight => v1::SpecialAction::FoodFight,
        SpecialAction::DinnerIsServed => v1::SpecialAction::DinnerIsServed,
    }
}

/// Converts final standings, best first.
pub fn final_table(standings: &Standings) -> Vec<v1::Standing> {
    standings
        .iter()
        .map(|(place, seat, points)| v1::Standing {
            seat: seat_number(seat),
            points,
            place: place.into(),
        })
        .collect()
}
