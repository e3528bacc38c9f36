//! The text of the table picture: title, open decision, log.

use chefshat_engine::{PlayRequirement, Seat, SpecialAction, Viewer};
use chefshat_record::words::ordinal;
use serde::Serialize;

use super::super::card::Card;
use super::super::chronicle::LogEntry;
use super::super::paint::Painter;
use super::super::scene::{Hand, Now, Scene};

/// Width of the columns beside the board.
pub(super) const COLUMN: f32 = 302.0;
/// Width of a space, which is not measured at the edge of a text.
pub(super) const SPACE: f32 = 5.0;
/// Width of a name within a log line.
const IN_A_LINE: f32 = 92.0;

/// The open decision, or the result.
#[derive(Serialize)]
pub(super) struct Notice {
    pub(super) heading: String,
    pub(super) seat: Option<usize>,
    pub(super) tiles: Vec<Tile>,
    pub(super) lines: Vec<String>,
    pub(super) rows: Vec<Row>,
}

/// A part of the requirement of a play, readable from a distance.
#[derive(Serialize)]
pub(super) struct Tile {
    pub(super) sign: &'static str,
    pub(super) number: String,
    pub(super) text: &'static str,
}

/// A line of a result.
#[derive(Serialize)]
pub(super) struct Row {
    pub(super) place: String,
    pub(super) seat: usize,
    pub(super) name: String,
    pub(super) points: String,
}

/// The name of a seat's participant.
pub(super) fn name(scene: &Scene, seat: Seat) -> String {
    match scene.seats.get(seat.index()) {
        Some(shown) if !shown.participant.name.is_empty() => shown.participant.name.clone(),
        _ => format!("seat {seat}"),
    }
}

/// The name of a seat where its number is not shown: with the number if the name is ambiguous.
pub(super) fn short_name(
    painter: &Painter,
    scene: &Scene,
    seat: Seat,
    (size, bold): (f32, bool),
    width: f32,
) -> String {
    let full = name(scene, seat);
    let mut others = (0..scene.seats.len())
        .map(Seat::new)
        .filter(|other| *other != seat);
    let number = if others.any(|other| name(scene, other) == full) {
        format!(" ({seat})")
    } else {
        String::new()
    };
    let room = width - painter.width(&number, size, bold) - SPACE;
    painter.fit(&full, size, bold, room) + &number
}

/// The state of the game.
pub(super) fn title(scene: &Scene) -> String {
    let shift = scene.shift;
    match &scene.now {
        Now::GameOver(_) => "The game is over".to_owned(),
        Now::Aborted => "The game was aborted".to_owned(),
        Now::ShiftOver { .. } => format!("Shift {shift} is over"),
        _ if scene.pizza == 0 => format!("Shift {shift} · before the first pizza"),
        _ => format!(
            "Shift {shift} · Pizza {} · Turn {}",
            scene.pizza, scene.turn
        ),
    }
}

/// The viewer, and the number of the decision unless it is hidden.
pub(super) fn perspective(painter: &Painter, scene: &Scene) -> String {
    let perspective = match scene.viewer {
        Viewer::Everything => "all hands open".to_owned(),
        Viewer::Spectator => "as spectators see it".to_owned(),
        Viewer::Seat(seat) => {
            let name = short_name(painter, scene, seat, (18.0, false), 170.0);
            format!("as {name} sees it")
        }
    };
    match scene.decision {
        Some(decision) => format!("decision {decision} · {perspective}"),
        None => perspective,
    }
}

/// The number of cards in a hand.
pub(super) fn held(hand: &Hand) -> String {
    let count = match hand {
        Hand::Open(cards) => cards.len(),
        Hand::Hidden(count) | Hand::Unknown(count) => usize::from(*count),
    };
    match count {
        0 => "no cards".to_owned(),
        1 => "1 card".to_owned(),
        count => format!("{count} cards"),
    }
}

/// The chip of the seat that decides.
pub(super) fn to_decide(now: &Now) -> &'static str {
    match now {
        Now::Special(..) => "to declare?",
        Now::Exchange(..) => "to give",
        _ => "to play",
    }
}

/// The cards of a play or a gift.
pub(super) fn play(cards: &[Card]) -> String {
    let jokers = cards.iter().filter(|card| **card == Card::Joker).count();
    let golden = cards.iter().any(|card| matches!(card, Card::Golden(_)));
    let jokers_too = match jokers {
        0 => String::new(),
        1 => " + joker".to_owned(),
        jokers => format!(" + {jokers} jokers"),
    };
    let quantity = cards.len() - jokers;
    match cards.first().and_then(|card| card.face()) {
        None if jokers > 1 => format!("{jokers} jokers"),
        None => "a joker".to_owned(),
        Some(face) if golden => format!("{quantity} × {face}, Golden{jokers_too}"),
        Some(face) => format!("{quantity} × {face}{jokers_too}"),
    }
}

/// Cards of any faces.
fn gift(cards: &[Card]) -> String {
    let words = cards.chunk_by(|one, next| one.face() == next.face());
    words.map(play).collect::<Vec<_>>().join(", ")
}

/// A log line: seat and text.
pub(super) fn log_entry(
    painter: &Painter,
    scene: &Scene,
    entry: &LogEntry,
) -> (Option<Seat>, String) {
    let because = |cause: &Option<&str>| cause.map_or_else(String::new, |why| format!(" ({why})"));
    match entry {
        LogEntry::Dealt(shift) => (None, format!("Cards are dealt for Shift {shift}")),
        LogEntry::Played { seat, cards, cause } => {
            (Some(*seat), format!("{}{}", play(cards), because(cause)))
        }
        LogEntry::Passed { seat, cause } => (Some(*seat), format!("passes{}", because(cause))),
        LogEntry::Finished { seat, place } => {
            (Some(*seat), format!("finishes {}", ordinal(*place)))
        }
        LogEntry::PizzaDone { pizza, next } => {
            let next = short_name(painter, scene, *next, (16.0, false), IN_A_LINE);
            (None, format!("Pizza {pizza} done, {next} leads"))
        }
        LogEntry::Declared { seat, special } => (Some(*seat), format!("{}!", special.name())),
        LogEntry::Gave {
            giver,
            receiver,
            count,
            cards,
        } => {
            let what = match cards {
                Some(cards) => gift(cards),
                None if *count == 1 => "a card".to_owned(),
                None => format!("{count} cards"),
            };
            let receiver = short_name(painter, scene, *receiver, (16.0, false), IN_A_LINE);
            (Some(*giver), format!("gives {what} to {receiver}"))
        }
        LogEntry::ShiftOver { shift, winner } => {
            let winner = short_name(painter, scene, *winner, (16.0, false), IN_A_LINE);
            (None, format!("Shift {shift} over, {winner} first"))
        }
        LogEntry::Expressed { seat, label, words } => {
            let text = match words {
                Some(words) => format!("says “{words}”"),
                None => format!("shows {label}"),
            };
            (Some(*seat), text)
        }
    }
}

/// The open decision, or the result.
pub(super) fn notice(painter: &Painter, scene: &Scene) -> Notice {
    let seat = scene.seats.iter().position(|seat| seat.deciding);
    let who = seat.map_or_else(String::new, |seat| {
        painter.fit(&name(scene, Seat::new(seat)), 20.0, true, COLUMN - 150.0)
    });
    let (mut tiles, mut lines) = (Vec::new(), Vec::new());
    let heading = match &scene.now {
        Now::Dealt => {
            lines.push("The cards have been dealt.".to_owned());
            "Before the first pizza".to_owned()
        }
        Now::Special(_, special) => {
            lines.extend(
                match special {
                    SpecialAction::FoodFight => {
                        ["Both jokers: Food Fight", "would reverse all roles."]
                    }
                    SpecialAction::DinnerIsServed => {
                        ["Both jokers: Dinner is Served", "would skip the exchange."]
                    }
                }
                .map(str::to_owned),
            );
            format!("{who} may declare")
        }
        Now::Exchange(_, receiver) => {
            let receiver = short_name(painter, scene, *receiver, (18.0, false), COLUMN - 160.0);
            lines.push(format!("The exchange, to {receiver}."));
            format!("{who} gives a card")
        }
        Now::Turn { requirement, .. } => {
            tiles = requirement_tiles(requirement);
            lines.push(turn_line(requirement).to_owned());
            format!("{who} to play")
        }
        Now::ShiftOver { adjudicated, .. } => {
            if *adjudicated {
                lines.push("Ended by the turn limit.".to_owned());
            }
            "Points of this Shift".to_owned()
        }
        Now::GameOver(_) => "Final standings".to_owned(),
        Now::Aborted => {
            lines.push("There is no result.".to_owned());
            "Aborted".to_owned()
        }
    };
    Notice {
        heading,
        seat: seat.filter(|_| !scene.now.is_end()),
        tiles,
        lines,
        rows: rows(painter, scene),
    }
}

fn requirement_tiles(play: &PlayRequirement) -> Vec<Tile> {
    let tile = |sign, number: u8, text| Tile {
        sign,
        number: number.to_string(),
        text,
    };
    let (face, size) = (play.highest_face, play.fewest_cards);
    if play.golden_card {
        vec![tile("", face, "and the Golden one")]
    } else if play.is_opening() {
        vec![tile("", face, "and no other face")]
    } else if play.lone_joker || face == 0 {
        Vec::new()
    } else {
        vec![
            tile("≤", face, if face == 1 { "face 1" } else { "face" }),
            tile("≥", size, if size == 1 { "card" } else { "cards" }),
        ]
    }
}

fn turn_line(play: &PlayRequirement) -> &'static str {
    match play.may_pass {
        false if play.is_opening() => "Opens the Shift and may not pass.",
        true if play.is_opening() => "Opens the Shift.",
        true if play.lone_joker => "The board is empty: any play.",
        false if play.lone_joker => "The board is empty: must play.",
        _ if play.highest_face == 0 => "Nothing beats this: pass.",
        true => "A rarer face, no fewer cards.",
        false => "May not pass.",
    }
}

/// The lines of the result, best first.
fn rows(painter: &Painter, scene: &Scene) -> Vec<Row> {
    let row = |place: u8, seat: Seat, points: String| Row {
        place: ordinal(place.into()),
        seat: seat.index(),
        name: painter.fit(&name(scene, seat), 18.0, false, COLUMN - 158.0),
        points,
    };
    match &scene.now {
        Now::ShiftOver { points, .. } => {
            let mut rows: Vec<(u8, Row)> = points
                .iter()
                .map(|(seat, points)| {
                    let place = scene.seats.get(seat.index()).map_or(0, |seat| seat.place);
                    (place, row(place, seat, format!("+{points}")))
                })
                .collect();
            rows.sort_by_key(|(place, _)| *place);
            rows.into_iter().map(|(_, row)| row).collect()
        }
        Now::GameOver(standings) => standings
            .iter()
            .map(|(place, seat, points)| row(place, seat, points.to_string()))
            .collect(),
        _ => Vec::new(),
    }
}
