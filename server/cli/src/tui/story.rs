//! What happened, in lines of words for a narrow column. Which seat a line is about is kept beside it, so that its name can have its colour.

use chefshat_client::v1::{self, game_event::Kind};

use super::super::narrator::{MAX_NAME, abort_reason, cards, clean, reason, title};
use super::super::numbers::ordinal;
use super::table::Table;

/// A line of the story.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Line {
    /// The seat it begins with, if it does.
    pub(crate) seat: Option<u32>,
    /// What is said, without that seat's name.
    pub(crate) words: String,
    /// It begins something: a Shift, a pizza.
    pub(crate) heading: bool,
}

/// The lines of an event at a table that has not yet taken it.
pub(super) fn of(table: &Table, kind: &Kind) -> Vec<Line> {
    let line = match kind {
        Kind::Play(play) => {
            let why = because(play.source());
            let star = if table.plays_golden(play) { "★" } else { "" };
            about(play.seat, format!("{}{star}{why}", cards(play)))
        }
        Kind::Pass(pass) => about(pass.seat, format!("passes{}", because(pass.source()))),
        Kind::PizzaDone(done) => heading(format!(
            "pizza {} · {}",
            done.pizza.saturating_add(1),
            table.name(done.next_leader)
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
                v1::SpecialAction::FoodFight => "Food Fight! All roles turn around",
                v1::SpecialAction::DinnerIsServed => "Dinner is served! No exchange",
                v1::SpecialAction::Unspecified => "a special action",
            };
            about(declared.seat, format!("✦ {words}"))
        }
        Kind::CardsExchanged(cards) => about(cards.giver, exchanged(table, cards)),
        Kind::ShiftEnded(end) => return shift_ended(table, end),
        Kind::GameStarted(_) => heading("the game begins".into()),
        Kind::GameEnded(_) => heading("the game is over".into()),
        Kind::GameAborted(end) => heading(format!("aborted: {}", abort_reason(end.reason()))),
        Kind::Seated(seated) => Line {
            seat: None,
            words: format!(
                "{} takes seat {}",
                clean(&seated.name, MAX_NAME),
                seated.seat
            ),
            heading: false,
        },
        Kind::Vacated(seat) => about(seat.seat, "leaves the table".into()),
        Kind::Disconnected(seat) => about(seat.seat, "is disconnected".into()),
        Kind::Returned(seat) => about(seat.seat, "is back".into()),
        Kind::Substituted(seat) => {
            let agent = clean(&seat.built_in_agent, MAX_NAME);
            about(seat.seat, format!("is replaced by {agent}"))
        }
        Kind::ServerRestarted(_) => heading("the server was restarted".into()),
        Kind::ExpressionShown(shown) => {
            let label = shown.expression.as_ref().map_or("", |it| &it.label);
            about(shown.seat, format!("shows {}", clean(label, 20)))
        }
    };
    vec![line]
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

/// The order in which all finished, and what each got for it.
fn shift_ended(table: &Table, end: &v1::ShiftEnded) -> Vec<Line> {
    let mut lines = vec![heading(format!("Shift {} ends", end.shift))];
    for (place, seat) in (1u32..).zip(&end.order) {
        let index = usize::try_from(*seat).unwrap_or(usize::MAX);
        let now = end.points.get(index).copied().unwrap_or(0);
        let before = table.seat(*seat).map_or(0, |it| it.points);
        let got = now.saturating_sub(before);
        lines.push(about(*seat, format!("{}, +{got}", ordinal(place))));
    }
    lines
}

/// What made a decision other than the seat itself.
fn because(source: v1::DecisionSource) -> String {
    reason(source).map_or_else(String::new, |why| format!(" ({why})"))
}

/// Who got how many cards, and which, where that may be known.
fn exchanged(table: &Table, cards: &v1::CardsExchanged) -> String {
    let top = table.faces();
    let receiver = table.name(cards.receiver);
    if cards.cards.is_empty() {
        return format!("gives {} to {receiver}", cards.count);
    }
    let named = cards.cards.iter().map(|card| {
        if *card > top {
            "J".to_owned()
        } else if *card == top && cards.golden {
            format!("★{card}")
        } else {
            card.to_string()
        }
    });
    let named = named.collect::<Vec<_>>().join(", ");
    format!("gives {named} to {receiver}")
}
