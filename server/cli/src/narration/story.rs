//! The sentences of a game: each event as lines for a narrow column. A line keeps the seat it
//! begins with, so that its name can be coloured.

use chefshat_client::v1::{self, game_event::Kind};
use chefshat_record::words;

use super::text::{MAX_NAME, clean};
use super::view::GameView;
use crate::kind::kind_name;
use crate::numbers::{counted, ordinal, seat_number};

/// Longest text of a referee, characters.
const MAX_TEXT: usize = 200;

/// A line of the story.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Line {
    /// The seat whose name it begins with.
    pub seat: Option<u32>,
    /// The text without that name.
    pub words: String,
    /// It opens a section: a Shift, a pizza.
    pub heading: bool,
}

/// That a substitute plays for a seat from now on, or no longer, where no event says so.
pub fn substitution(seat: u32, active: bool) -> Line {
    let words = if active {
        "is replaced by a substitute"
    } else {
        "is back"
    };
    Line {
        seat: Some(seat),
        words: words.to_owned(),
        heading: false,
    }
}

/// That a snapshot stands for what happened before.
pub fn unknown_before() -> Line {
    Line {
        seat: None,
        words: "what happened before is no longer known".to_owned(),
        heading: false,
    }
}

/// Applies an event and returns its lines.
pub fn advance(view: &mut GameView, event: &v1::GameEvent) -> Vec<Line> {
    // The lines first: they need the state before the event.
    let lines = (event.kind.as_ref()).map_or_else(Vec::new, |kind| lines_of(view, kind));
    view.apply(event);
    lines
}

/// The line of a decision for which the seat was given hints, before the line of the decision.
pub fn after_hints(seat: u32, hints: u32) -> Line {
    let words = match hints {
        1 => "gets a hint".to_owned(),
        hints => format!("gets {hints} hints"),
    };
    about(seat, words)
}

/// The lines of an event, from the state before it.
fn lines_of(view: &GameView, kind: &Kind) -> Vec<Line> {
    let line = match kind {
        Kind::Play(play) => {
            let why = because(play.source());
            let star = if view.plays_golden(play) { "★" } else { "" };
            about(play.seat, format!("{}{star}{why}", cards(play)))
        }
        Kind::Pass(pass) => about(pass.seat, format!("passes{}", because(pass.source()))),
        Kind::PizzaDone(done) => heading(format!(
            "pizza {} · {}",
            done.pizza.saturating_add(1),
            view.name(done.next_leader)
        )),
        Kind::SeatFinished(finished) => about(
            finished.seat,
            format!("finishes {}", ordinal(finished.place)),
        ),
        Kind::ShiftStarted(start) => heading(format!("Shift {}", start.shift)),
        Kind::RolesAssigned(assigned) => {
            let roles = (0u32..).zip(assigned.roles());
            let chef = roles.filter(|(_, role)| *role == v1::Role::Chef);
            return chef
                .map(|(seat, role)| about(seat, format!("is {}", title(role))))
                .collect();
        }
        Kind::SpecialActionDeclared(declared) => {
            let words = match declared.action() {
                v1::SpecialAction::FoodFight => "Food Fight! Two jokers: all roles are reversed",
                v1::SpecialAction::DinnerIsServed => "Dinner is Served! Two jokers: no exchange",
                v1::SpecialAction::Unspecified => "A special action!",
            };
            about(declared.seat, format!("✦ {words}"))
        }
        Kind::CardsExchanged(cards) => about(cards.giver, exchanged(view, cards)),
        Kind::ShiftEnded(end) => return shift_ended(end),
        Kind::GameStarted(_) => heading("the game begins".into()),
        Kind::GameEnded(_) => heading("the game is over".into()),
        Kind::GameAborted(end) => heading(format!("aborted: {}", abort_reason(end.reason()))),
        Kind::Seated(seated) => plain(format!(
            "{} ({}) takes seat {}",
            clean(&seated.name, MAX_NAME),
            kind_name(seated.kind()),
            seat_number(seated.seat)
        )),
        Kind::Vacated(seat) => plain(format!("{} leaves the table", view.name(seat.seat))),
        Kind::Disconnected(lost) => about(
            lost.seat,
            match lost.with_node {
                false => "is disconnected".into(),
                true => "is disconnected, since its node is lost".into(),
            },
        ),
        Kind::Returned(seat) => about(seat.seat, "is back".into()),
        Kind::Substituted(seat) => {
            let agent = clean(&seat.built_in_agent, MAX_NAME);
            about(seat.seat, format!("is replaced by {agent}"))
        }
        Kind::ServerRestarted(_) => heading("the server was restarted; the game resumes".into()),
        Kind::ExpressionShown(shown) => {
            let said = shown.expression.as_ref();
            let words = said.and_then(|it| words::from_data_url(&it.media));
            let label = said.map_or("", |it| &it.label);
            about(
                shown.seat,
                match words {
                    Some(words) => format!("says “{}”", clean(&words, MAX_TEXT)),
                    None => format!("shows {}", clean(label, 40)),
                },
            )
        }
        Kind::HandReported(reported) => {
            let seat = reported.hand.as_ref().map_or(0, |hand| hand.seat);
            about(seat, "has a known hand".into())
        }
        Kind::Violation(violation) => {
            let name = violation.seat.map(|seat| view.name(seat) + ": ");
            let text = clean(&violation.text, MAX_TEXT);
            plain(format!("⚠ {}{text}", name.unwrap_or_default()))
        }
        Kind::Correction(correction) if correction.text.is_empty() => {
            plain("earlier decisions no longer count".into())
        }
        Kind::Correction(correction) => plain(clean(&correction.text, MAX_TEXT)),
        Kind::TablePaused(table) if table.paused => heading("the game is paused".into()),
        Kind::TablePaused(_) => heading("the game is resumed".into()),
    };
    vec![line]
}

fn plain(words: String) -> Line {
    Line {
        seat: None,
        words,
        heading: false,
    }
}

fn about(seat: u32, words: String) -> Line {
    Line {
        seat: Some(seat),
        words,
        heading: false,
    }
}

fn heading(words: String) -> Line {
    Line {
        seat: None,
        words,
        heading: true,
    }
}

/// The finishing order, with the points of each seat.
fn shift_ended(end: &v1::ShiftEnded) -> Vec<Line> {
    let mut lines = vec![heading(format!("Shift {} ends", end.shift))];
    for (place, seat) in (1u32..).zip(&end.order) {
        let index = usize::try_from(*seat).unwrap_or(usize::MAX);
        let got = end.shift_points.get(index).copied().unwrap_or(0);
        lines.push(about(*seat, format!("{}, +{got}", ordinal(place))));
    }
    lines
}

/// Why the server decided for the seat, in brackets.
fn because(source: v1::DecisionSource) -> String {
    words::reason(source).map_or_else(String::new, |why| format!(" ({why})"))
}

/// The receiver and the number of cards, or the cards themselves if the viewer may see them.
fn exchanged(view: &GameView, cards: &v1::CardsExchanged) -> String {
    let top = view.faces();
    let receiver = view.name(cards.receiver);
    if cards.cards.is_empty() {
        let cards = counted(cards.count.into(), "card");
        return format!("gives {cards} to {receiver}");
    }
    let equal = cards.cards.chunk_by(|one, next| one == next);
    let named = equal.map(|equal| match (equal.len(), equal[0]) {
        (1, card) if card > top => "J".to_owned(),
        (jokers, card) if card > top => format!("{jokers}J"),
        // Only one of them is the Golden card.
        (count, card) if card == top && cards.golden => format!("{count}×{card}★"),
        (count, card) => format!("{count}×{card}"),
    });
    let named = named.collect::<Vec<_>>().join(", ");
    format!("gives {named} to {receiver}")
}

/// The cards of a play: three 9s and a joker are `3×9+J`.
pub fn cards(play: &v1::Play) -> String {
    match (play.quantity, play.jokers) {
        (0, _) => "J".into(),
        (quantity, 0) => format!("{quantity}×{}", play.face),
        (quantity, 1) => format!("{quantity}×{}+J", play.face),
        (quantity, jokers) => format!("{quantity}×{}+{jokers}J", play.face),
    }
}

/// The sentence about an aborted game.
pub fn aborted(reason: v1::AbortReason) -> String {
    let reason = abort_reason(reason);
    format!("The game was aborted and has no result: {reason}.")
}

/// Why a game has no result.
pub fn abort_reason(reason: v1::AbortReason) -> &'static str {
    match reason {
        v1::AbortReason::Unspecified => "the server gave no reason",
        v1::AbortReason::Closed => "its room was closed",
        v1::AbortReason::Shutdown => "the server shut down",
        v1::AbortReason::ParticipantsLost => "its participants were lost",
        v1::AbortReason::NeverStarted => "its seats were never filled",
        v1::AbortReason::TooLong => "it grew beyond the server's limit",
    }
}

/// Name of a role.
pub fn title(role: v1::Role) -> &'static str {
    match role {
        v1::Role::Unspecified => "no role",
        v1::Role::Chef => "Chef",
        v1::Role::SousChef => "Sous-Chef",
        v1::Role::Cook => "Cook",
        v1::Role::Waiter => "Waiter",
        v1::Role::Dishwasher => "Dishwasher",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gift_names_its_number_of_cards_or_the_cards() {
        let gift = |count, cards: &[u32], golden| v1::CardsExchanged {
            giver: 0,
            receiver: 1,
            count,
            cards: cards.to_vec(),
            golden,
        };
        let view = GameView::default();
        let receiver = view.name(1);
        for (gift, expected) in [
            (gift(1, &[], false), "1 card"),
            (gift(2, &[], false), "2 cards"),
            (gift(2, &[3, 12], false), "1×3, J"),
            (gift(2, &[11, 11], false), "2×11"),
            (gift(2, &[11, 11], true), "2×11★"),
            (gift(2, &[11, 12], true), "1×11★, J"),
            (gift(2, &[12, 12], false), "2J"),
        ] {
            let words = exchanged(&view, &gift);
            assert_eq!(words, format!("gives {expected} to {receiver}"));
        }
    }
}
