//! Events in the text form for a language model (docs/mcp.md). Rare ones have the words of the
//! narration.

use chefshat_client::v1::{self, game_event::Kind};

use super::cards::{cards, hand, name, subject};
use crate::narration::hand::Hand;
use crate::narration::story;
use crate::narration::view::GameView;
use crate::narration::{clean, title, words};
use crate::numbers::{counted, ordinal};

/// Maximum characters of what another participant says.
const MAX_SAID: usize = 100;
/// Maximum columns of the label of an expression.
const MAX_LABEL: usize = 40;

/// An event in words.
#[derive(Debug)]
pub struct EventText {
    /// Number of the event.
    pub sequence: u64,
    /// What happened.
    pub words: String,
    /// Whether a Shift begins with it, or what is known of one.
    pub begins_shift: bool,
}

/// Applies an event and returns it in words for a reader at seat `me`.
pub fn advance(view: &mut GameView, me: Option<u32>, event: &v1::GameEvent) -> EventText {
    let words = match &event.kind {
        None => String::new(),
        // The names come with the beginning of the game; other words need the state before the event.
        Some(kind @ Kind::GameStarted(_)) => {
            view.apply(event);
            in_words(view, me, kind)
        }
        Some(kind) => {
            let words = in_words(view, me, kind);
            view.apply(event);
            words
        }
    };
    EventText {
        sequence: event.sequence,
        words,
        begins_shift: matches!(event.kind, Some(Kind::ShiftStarted(_))),
    }
}

/// An event in words, from the state before it.
fn in_words(view: &GameView, me: Option<u32>, kind: &Kind) -> String {
    let name = |seat| name(view, me, seat);
    let because = |source| words::reason(source).map_or_else(String::new, |it| format!(" ({it})"));
    match kind {
        Kind::GameStarted(start) => {
            let seats = start.seats.iter().map(|it| name(it.seat));
            format!("The game begins: {}", seats.collect::<Vec<_>>().join(", "))
        }
        Kind::ShiftStarted(start) => format!("Shift {}", start.shift),
        Kind::RolesAssigned(assigned) => {
            let mut seats: Vec<(u32, v1::Role)> = (0u32..).zip(assigned.roles()).collect();
            seats.sort_by_key(|(_, role)| *role);
            let seats = seats
                .iter()
                .map(|(seat, role)| format!("{} {}", title(*role), name(*seat)));
            seats.collect::<Vec<_>>().join(", ")
        }
        Kind::SpecialActionDeclared(declared) => {
            let what = match declared.action() {
                v1::SpecialAction::FoodFight => "Food Fight: all roles are reversed",
                _ => "Dinner is Served: no exchange",
            };
            format!("{}: {what}", name(declared.seat))
        }
        Kind::CardsExchanged(gift) => {
            let what = match gift.cards.as_slice() {
                [] => counted(gift.count.into(), "card"),
                known => {
                    let faces = usize::try_from(view.faces()).unwrap_or(0);
                    hand(&Hand::of(faces, known, gift.golden))
                }
            };
            format!("{} to {}: {what}", name(gift.giver), name(gift.receiver))
        }
        Kind::Play(play) => {
            let played = match play.quantity {
                0 => cards(0, 0, 1, false),
                quantity => cards(play.face, quantity, play.jokers, view.plays_golden(play)),
            };
            format!("{} {played}{}", name(play.seat), because(play.source()))
        }
        Kind::Pass(pass) => format!("{} pass{}", name(pass.seat), because(pass.source())),
        Kind::PizzaDone(done) => format!("| {} leads", name(done.next_leader)),
        Kind::SeatFinished(seat) => format!("{} {}", name(seat.seat), ordinal(seat.place)),
        Kind::ShiftEnded(end) => {
            let points = end.order.iter().map(|seat| {
                let index = usize::try_from(*seat).unwrap_or(usize::MAX);
                let points = end.shift_points.get(index).copied().unwrap_or(0);
                format!("{} +{points}", name(*seat))
            });
            let points = points.collect::<Vec<_>>().join(", ");
            format!("Shift {} ends: {points}", end.shift)
        }
        Kind::GameEnded(end) => format!("Game over: {}", standings(view, me, &end.standings)),
        Kind::ExpressionShown(shown) => expression(&subject(view, me, shown.seat), shown),
        _ => {
            let mut view = view.clone();
            let event = v1::GameEvent {
                kind: Some(kind.clone()),
                ..v1::GameEvent::default()
            };
            let lines = story::advance(&mut view, &event).into_iter();
            let lines = lines.map(|line| match line.seat {
                Some(seat) => format!("{} {}", subject(&view, me, seat), line.words),
                None => line.words,
            });
            lines.collect::<Vec<_>>().join(", ")
        }
    }
}

/// What a participant shows, with its words in quotes.
fn expression(name: &str, shown: &v1::ExpressionShown) -> String {
    let Some(it) = &shown.expression else {
        return String::new();
    };
    match words::from_data_url(&it.media) {
        Some(words) => format!("{name} says {:?}", clean(&words, MAX_SAID)),
        None => format!("{name} shows {}", clean(&it.label, MAX_LABEL)),
    }
}

fn standings(view: &GameView, me: Option<u32>, table: &[v1::Standing]) -> String {
    let lines = table.iter().map(|line| {
        let name = name(view, me, line.seat);
        format!("{} {name} {}", ordinal(line.place), line.points)
    });
    lines.collect::<Vec<_>>().join(", ")
}

/// Events in one line for each Shift and each pizza.
pub fn history<'a>(events: impl IntoIterator<Item = &'a EventText>) -> String {
    let mut text = String::new();
    for EventText { words, .. } in events.into_iter().filter(|it| !it.words.is_empty()) {
        if words.starts_with("Shift ") && !text.is_empty() {
            text.push('\n');
        } else if !text.is_empty() && !text.ends_with('\n') {
            text.push_str(if words.starts_with('|') { " " } else { "; " });
        }
        text.push_str(words);
        if words.starts_with('|') {
            text.push('\n');
        }
    }
    text.truncate(text.trim_end().len());
    text
}
