//! Decisions: what is put to a seat, what it answers, what becomes of the answer.

use chefshat_engine::{
    Board, BySeat, Cards, DecisionKind, Mask, Observation, Requirement, RuleSet, Seat,
};
use chefshat_proto::v1;
use chefshat_records::convert::{
    FieldProblem, check_expression, role_from_number, seat_number, special_to_proto,
};
use prost::Message as _;

use crate::room::core::{Answered, Verdict};
use crate::store::journal::Source;

/// A mask as the protocol writes it.
pub(super) fn mask_bytes(mask: &Mask, rules: &RuleSet) -> Vec<u8> {
    mask.to_bytes(rules.actions().size())
}

/// The protocol's name for a kind of decision.
pub fn decision_kind(kind: DecisionKind) -> v1::DecisionKind {
    match kind {
        DecisionKind::Turn => v1::DecisionKind::Turn,
        DecisionKind::Exchange => v1::DecisionKind::Exchange,
        DecisionKind::SpecialAction => v1::DecisionKind::SpecialAction,
    }
}

/// The protocol's name for how a decision came about.
pub(super) fn source_to_proto(source: Source) -> v1::DecisionSource {
    match source {
        Source::Agent => v1::DecisionSource::Agent,
        Source::Timeout => v1::DecisionSource::Timeout,
        Source::Invalid => v1::DecisionSource::Invalid,
        Source::Disconnected => v1::DecisionSource::Disconnected,
        Source::Substitute => v1::DecisionSource::Substitute,
        Source::Recorded => v1::DecisionSource::Recorded,
    }
}

/// What a viewer may know, as a message.
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
    }
}

/// Fills in what the rules require of the decision.
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

/// The observation a decision request carries, for agents that are built in but play over the wire.
///
/// # Errors
/// The field that does not fit the rules the game is played by.
pub fn observation_from_proto(
    request: &v1::DecisionRequest,
    seat: Seat,
    rules: &RuleSet,
) -> Result<Observation, FieldProblem> {
    let message = request
        .observation
        .as_ref()
        .ok_or_else(|| FieldProblem::new("observation", "a decision request has one"))?;
    let faces = rules.faces();
    let players = rules.players();
    let cards = |field, counts: &[u8], golden| {
        if counts.is_empty() {
            return Ok(Cards::EMPTY);
        }
        Cards::from_counts(faces, counts, golden)
            .ok_or_else(|| FieldProblem::new(field, "not the counts of a hand of this deck"))
    };
    let of_seats = |field, bytes: &[u8]| {
        if bytes.len() == players {
            Ok(BySeat::from_fn(players, |seat: Seat| bytes[seat.index()]))
        } else {
            Err(FieldProblem::new(field, "not one byte for each seat"))
        }
    };
    let small = |field, value: u32| {
        u8::try_from(value).map_err(|_| FieldProblem::new(field, "far out of range"))
    };
    if message.points.len() != players {
        return Err(FieldProblem::new("points", "not one number for each seat"));
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

/// What became of an answer, as a message.
pub fn answer_result(decision_id: u64, action: u32, answered: Answered) -> v1::AnswerResult {
    let mut result = v1::AnswerResult {
        decision_id,
        action,
        decision_time_us: u64::try_from(answered.time.as_micros()).unwrap_or(u64::MAX),
        annotations_dropped: answered.annotations_dropped,
        ..v1::AnswerResult::default()
    };
    let status = match answered.verdict {
        Verdict::Accepted => v1::AnswerStatus::Accepted,
        Verdict::Invalid {
            detail,
            attempts_left,
            reward,
        } => {
            result.detail = detail;
            result.invalid_attempts_left = attempts_left;
            result.reward = reward;
            v1::AnswerStatus::Invalid
        }
        Verdict::Closed => v1::AnswerStatus::Closed,
        Verdict::Unknown => v1::AnswerStatus::UnknownDecision,
    };
    result.set_status(status);
    result
}

/// Annotations hold a number that is not finite, which no record could hold.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct NotFinite;

/// Annotations as they are kept: encoded.
///
/// # Errors
/// A number in them is not finite.
pub fn annotations_from_proto(
    annotations: Option<v1::Annotations>,
) -> Result<Option<Box<[u8]>>, NotFinite> {
    let Some(annotations) = annotations else {
        return Ok(None);
    };
    let mut numbers = annotations
        .action_scores
        .iter()
        .chain(&annotations.value_estimate);
    if !numbers.all(|number| number.is_finite()) {
        return Err(NotFinite);
    }
    let bytes = annotations.encode_to_vec().into_boxed_slice();
    Ok(Some(bytes).filter(|bytes| !bytes.is_empty()))
}

/// An expression as it is kept: checked and encoded.
///
/// # Errors
/// The field out of its range.
pub fn expression_from_proto(expression: &v1::Expression) -> Result<Box<[u8]>, FieldProblem> {
    check_expression(expression)?;
    Ok(expression.encode_to_vec().into_boxed_slice())
}

fn counts(cards: Cards, faces: u8) -> Vec<u8> {
    cards.counts(faces).collect()
}
