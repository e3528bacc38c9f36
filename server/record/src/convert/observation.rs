//! Converts observations and kinds of decisions.

use chefshat_engine::{
    Board, BySeat, Cards, DecisionKind, Observation, Requirement, RuleSet, Seat,
};
use chefshat_proto::v1;

use super::{FieldProblem, role_from_number, seat_from_number, seat_number, special_to_proto};

/// Converts a kind of decision.
pub fn decision_kind(kind: DecisionKind) -> v1::DecisionKind {
    match kind {
        DecisionKind::Turn => v1::DecisionKind::Turn,
        DecisionKind::Exchange => v1::DecisionKind::Exchange,
        DecisionKind::SpecialAction => v1::DecisionKind::SpecialAction,
    }
}

/// Converts an observation.
pub fn observation_to_proto(observation: &Observation) -> v1::Observation {
    let faces = observation.faces;
    let own = |cards: Cards| {
        if cards.is_empty() {
            Vec::new()
        } else {
            counts(cards, faces)
        }
    };
    v1::Observation {
        shift: observation.shift,
        pizza: observation.pizza,
        hand: match observation.seat {
            Some(_) => counts(observation.hand, faces),
            None => Vec::new(),
        },
        golden: observation.hand.has_golden(),
        board_face: observation.board.face.into(),
        board_size: observation.board.size.into(),
        board_jokers: observation.board.jokers.into(),
        cards_left: observation.cards_left.values().copied().collect(),
        passed: observation.passed.values().copied().map(u8::from).collect(),
        places: observation.places.values().copied().collect(),
        roles: observation
            .roles
            .values()
            .map(|role| role.map_or(0, |role| role as u8))
            .collect(),
        points: observation.points.values().copied().collect(),
        played: counts(observation.played, faces),
        gave: own(observation.gave),
        received: own(observation.received),
        board_owner: observation.board_owner.map(seat_number),
    }
}

/// Sets the requirement of a decision.
pub fn put_requirement(request: &mut v1::DecisionRequest, requirement: Requirement) {
    match requirement {
        Requirement::Play(play) => {
            request.play_requirement = Some(v1::PlayRequirement {
                lowest_face: play.lowest_face.into(),
                highest_face: play.highest_face.into(),
                fewest_cards: play.fewest_cards.into(),
                golden_card: play.golden_card,
                lone_joker: play.lone_joker,
                may_pass: play.may_pass,
            });
        }
        Requirement::Gift(gift) => {
            request.gift_requirement = Some(v1::GiftRequirement {
                number: gift.number.into(),
                total: gift.total.map(u32::from),
                receiver: seat_number(gift.receiver),
            });
        }
        Requirement::SpecialAction(special) => {
            request.set_special_action(special_to_proto(special));
        }
    }
}

/// Reads the observation of a decision request, for built-in agents that play over the protocol.
///
/// # Errors
/// The first field that does not match the rules.
pub fn observation_from_proto(
    request: &v1::DecisionRequest,
    seat: Seat,
    rules: &RuleSet,
) -> Result<Observation, FieldProblem> {
    let message = request
        .observation
        .as_ref()
        .ok_or_else(|| FieldProblem::new("observation", "missing from the decision request"))?;
    let faces = rules.faces();
    let players = rules.players();
    let cards = |field, counts: &[u8], golden| {
        if counts.is_empty() {
            return Ok(Cards::EMPTY);
        }
        Cards::from_counts(faces, counts, golden)
            .ok_or_else(|| FieldProblem::new(field, "not the counts of a hand from this deck"))
    };
    let of_seats = |field, bytes: &[u8]| {
        if bytes.len() == players {
            Ok(BySeat::from_fn(players, |seat: Seat| bytes[seat.index()]))
        } else {
            Err(FieldProblem::new(field, "must have one byte per seat"))
        }
    };
    let small = |field, value: u32| {
        u8::try_from(value).map_err(|_| FieldProblem::new(field, "out of range"))
    };
    if message.points.len() != players {
        return Err(FieldProblem::new("points", "must have one number per seat"));
    }
    Ok(Observation {
        seat: Some(seat),
        kind: match request.kind() {
            v1::DecisionKind::Unspecified => None,
            v1::DecisionKind::Turn => Some(DecisionKind::Turn),
            v1::DecisionKind::Exchange => Some(DecisionKind::Exchange),
            v1::DecisionKind::SpecialAction => Some(DecisionKind::SpecialAction),
        },
        faces,
        hand_size: rules.hand_size(),
        shift: message.shift,
        pizza: message.pizza,
        hand: cards("hand", &message.hand, message.golden)?,
        board: Board {
            face: small("board_face", message.board_face)?,
            size: small("board_size", message.board_size)?,
            jokers: small("board_jokers", message.board_jokers)?,
        },
        board_owner: match message.board_owner {
            Some(number) => Some(
                seat_from_number(number, players)
                    .ok_or_else(|| FieldProblem::new("board_owner", "no such seat"))?,
            ),
            None => None,
        },
        cards_left: of_seats("cards_left", &message.cards_left)?,
        passed: of_seats("passed", &message.passed)?.map(|byte| byte != 0),
        places: of_seats("places", &message.places)?,
        roles: of_seats("roles", &message.roles)?.map(role_from_number),
        points: BySeat::from_fn(players, |seat: Seat| message.points[seat.index()]),
        played: cards("played", &message.played, false)?,
        gave: cards("gave", &message.gave, false)?,
        received: cards("received", &message.received, false)?,
    })
}

fn counts(cards: Cards, faces: u8) -> Vec<u8> {
    cards.counts(faces).collect()
}
