//! Bounds on the lists of a line. An entry of a few bytes in a file can take a hundred in memory,
//! so the length of the line alone does not bound it. The replay checks exact lengths.

use chefshat_engine::limits::MAX_ATTEMPTS;
use chefshat_engine::{MAX_FACES, MAX_JOKERS, MAX_SEATS};
use chefshat_proto::v1::{self, game_event::Kind, record_line::Line};

/// The most cards of a deck, and so of a hand.
const MAX_CARDS: usize = MAX_FACES as usize * (MAX_FACES as usize + 1) / 2 + MAX_JOKERS as usize;
/// The most scores or keys of annotations; a server accepts no more.
const MAX_ANNOTATIONS: usize = 1_024;
/// The most clocks of a policy, one of each kind of participant.
const MAX_CLOCKS: usize = 4;
/// The most parts a branched game may have taken over, one per branch before it.
const MAX_TAKEN_OVER: usize = 2_048;

/// A list that is too long.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Excess {
    /// The field, as the file spells it.
    pub field: &'static str,
    /// The most entries allowed.
    pub most: usize,
}

/// The first list of a line that exceeds its bound.
pub fn excess(line: &Line) -> Option<Excess> {
    match line {
        Line::Header(header) => of_header(header),
        Line::Decision(decision) => of_decision(decision),
        Line::Event(event) => first([("rewards", event.rewards.len(), MAX_SEATS)])
            .or_else(|| of_event(event.kind.as_ref()?)),
        Line::PrivateExpression(_) | Line::Marker(_) | Line::Footer(_) => None,
    }
}

fn of_header(header: &v1::RecordHeader) -> Option<Excess> {
    let script = header
        .start
        .as_ref()
        .and_then(|start| start.scripted.as_ref());
    let taken_over = header
        .start
        .as_ref()
        .map_or(0, |start| start.taken_over.len());
    first([
        ("seats", header.seats.len(), MAX_SEATS),
        ("takenOver", taken_over, MAX_TAKEN_OVER),
    ])
    .or_else(|| of_rules(header.rules.as_ref()))
    .or_else(|| of_policy(header.policy.as_ref()))
    .or_else(|| {
        let script = script?;
        first([
            ("lastOrder", script.last_order.len(), MAX_SEATS),
            ("points", script.points.len(), MAX_SEATS),
        ])
        .or_else(|| of_hands(&script.hands))
    })
}

fn of_decision(decision: &v1::DecisionRecord) -> Option<Excess> {
    let (scores, extra) = decision.annotations.as_ref().map_or((0, 0), |annotations| {
        (annotations.action_scores.len(), annotations.extra.len())
    });
    first([
        (
            "invalidAttempts",
            decision.invalid_attempts.len(),
            MAX_ATTEMPTS as usize,
        ),
        ("actionScores", scores, MAX_ANNOTATIONS),
        ("extra", extra, MAX_ANNOTATIONS),
    ])
}

fn of_event(kind: &Kind) -> Option<Excess> {
    match kind {
        Kind::GameStarted(started) => first([("seats", started.seats.len(), MAX_SEATS)])
            .or_else(|| of_rules(started.rules.as_ref()))
            .or_else(|| of_policy(started.policy.as_ref())),
        Kind::ShiftStarted(started) => of_hands(&started.hands),
        Kind::RolesAssigned(assigned) => first([("roles", assigned.roles.len(), MAX_SEATS)]),
        Kind::CardsExchanged(exchanged) => first([("cards", exchanged.cards.len(), MAX_CARDS)]),
        Kind::ShiftEnded(ended) => first([
            ("order", ended.order.len(), MAX_SEATS),
            ("shiftPoints", ended.shift_points.len(), MAX_SEATS),
            ("points", ended.points.len(), MAX_SEATS),
        ]),
        Kind::GameEnded(ended) => first([("standings", ended.standings.len(), MAX_SEATS)])
            .or_else(|| of_reveal(ended.reveal.as_ref())),
        Kind::GameAborted(aborted) => of_reveal(aborted.reveal.as_ref()),
        Kind::HandReported(reported) => of_hands(reported.hand.as_slice()),
        // No lists.
        Kind::Seated(_)
        | Kind::Vacated(_)
        | Kind::Disconnected(_)
        | Kind::Returned(_)
        | Kind::ServerRestarted(_)
        | Kind::Substituted(_)
        | Kind::SpecialActionDeclared(_)
        | Kind::Play(_)
        | Kind::Pass(_)
        | Kind::PizzaDone(_)
        | Kind::SeatFinished(_)
        | Kind::ExpressionShown(_)
        | Kind::Violation(_)
        | Kind::Correction(_)
        | Kind::TablePaused(_) => None,
    }
}

fn of_rules(rules: Option<&v1::RuleSet>) -> Option<Excess> {
    first([("points", rules?.points.len(), MAX_SEATS)])
}

fn of_policy(policy: Option<&v1::RoomPolicy>) -> Option<Excess> {
    first([("clocks", policy?.clocks.len(), MAX_CLOCKS)])
}

fn of_hands(hands: &[v1::SeatCards]) -> Option<Excess> {
    first([("hands", hands.len(), MAX_SEATS)]).or_else(|| {
        hands
            .iter()
            .find_map(|hand| first([("cards", hand.cards.len(), MAX_CARDS)]))
    })
}

fn of_reveal(reveal: Option<&v1::SeedReveal>) -> Option<Excess> {
    first([("seatEntropy", reveal?.seat_entropy.len(), MAX_SEATS)])
}

/// The first list that exceeds its bound, of lists given with length and bound.
fn first<const N: usize>(lists: [(&'static str, usize, usize); N]) -> Option<Excess> {
    lists
        .into_iter()
        .find(|(_, length, most)| length > most)
        .map(|(field, _, most)| Excess { field, most })
}
