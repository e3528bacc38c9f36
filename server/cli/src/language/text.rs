//! The text form of a table for a language model: as few tokens as possible, and nothing that a
//! reader of the rules could not read. docs/mcp.md describes it line by line. `live` has the state,
//! `events` words what happens, `cards` cards and actions.

use std::fmt::Write as _;

use chefshat_client::legal_count;
use chefshat_client::v1;

use super::cards::{GOLDEN, cards, hand, name, options};
use super::events::history;
use super::live::{Live, Open};
use crate::narration::hand::Hand;
use crate::narration::story;
use crate::narration::title;
use crate::narration::view::End;
use crate::numbers::ordinal;

/// What happened after an event, then the open decision, or whom the game waits for.
pub fn since(live: &Live, after: u64, now_ms: u64) -> String {
    let mut text = format!("seq {}", live.sequence());
    let news = history(live.events.iter().filter(|it| it.sequence > after));
    if !news.is_empty() {
        write!(text, "\n{news}").expect("a String takes everything");
    }
    write!(text, "\n{}", now(live, now_ms)).expect("a String takes everything");
    text
}

/// The open decision with what it needs, or whom the game waits for.
fn now(live: &Live, now_ms: u64) -> String {
    if let Some(over) = over(live) {
        return over;
    }
    if let Some(open) = &live.open {
        let mut lines = vec![asked(live, open, now_ms)];
        // Who has no choice does not need to see what it depends on.
        if legal_count(&open.request) > 1 {
            if open.request.kind() == v1::DecisionKind::Turn {
                lines.push(board(live));
            }
            lines.extend([own(live), left(live)]);
        }
        lines.push(format!("options\n{}", options(live.space(), &open.request)));
        return lines.join("\n");
    }
    waiting(live, now_ms)
}

/// Why no further decision comes; `None` while the game runs.
pub fn over(live: &Live) -> Option<String> {
    let lost = live
        .lost
        .as_deref()
        .map(|why| format!("You have lost this seat: {why}."));
    let end = live.view.end.as_ref().map(|end| match end {
        End::Finished(table) => {
            let own = table.iter().find(|line| Some(line.seat) == live.me);
            let place = own.map_or_else(String::new, |own| {
                format!(" You are {} of {}.", ordinal(own.place), table.len())
            });
            format!(
                "The game is over.{place} Its record: chefshat://records/{}",
                live.view.game_id
            )
        }
        End::Aborted(reason) => story::aborted(*reason),
    });
    end.or(lost)
}

fn waiting(live: &Live, now_ms: u64) -> String {
    let view = &live.view;
    let what = if !view.started {
        match view.free_seats() {
            0 => "The game is about to begin".to_owned(),
            free => format!("The game has not begun, free seats: {free}"),
        }
    } else {
        let awaited = (live.awaited.as_ref()).and_then(|it| it.words(view, now_ms));
        awaited.unwrap_or_else(|| "Not your turn".to_owned())
    };
    format!("{what}. Call wait_for_turn again.")
}

/// The decision: its number, what it must be, the time for it.
fn asked(live: &Live, open: &Open, now_ms: u64) -> String {
    let request = &open.request;
    let what = match request.kind() {
        v1::DecisionKind::Exchange => {
            let gift = request.gift_requirement.unwrap_or_default();
            let of = gift
                .total
                .map_or_else(String::new, |total| format!(" of {total}"));
            format!(
                "give card {}{of} to {}",
                gift.number,
                live.view.name(gift.receiver)
            )
        }
        v1::DecisionKind::SpecialAction => "declare or decline".to_owned(),
        _ => turn(request.play_requirement),
    };
    let (time, bank) = live.left_ms(now_ms).unwrap_or_default();
    let bank = match bank {
        0 => String::new(),
        bank => format!(" +{}", bank / 1000),
    };
    format!(
        "decision {}: {what}; {} s{bank}",
        request.decision_id,
        time / 1000
    )
}

/// What a play must be.
fn turn(rule: Option<v1::PlayRequirement>) -> String {
    let Some(rule) = rule else {
        return "your turn".to_owned();
    };
    let must = if rule.lowest_face > 1 {
        let golden = if rule.golden_card { GOLDEN } else { "" };
        format!("open with {}{golden}", rule.lowest_face)
    } else if rule.highest_face == 0 {
        "nothing beats the board".to_owned()
    } else if rule.lone_joker {
        "lead".to_owned()
    } else {
        format!("{}+ cards of 1-{}", rule.fewest_cards, rule.highest_face)
    };
    match rule.may_pass {
        true => must,
        false => format!("{must}, no pass"),
    }
}

fn board(live: &Live) -> String {
    let Some(board) = live.view.board else {
        return "board empty".to_owned();
    };
    let on = match board.quantity {
        0 => cards(0, 0, 1, false),
        quantity => cards(board.face, quantity, board.jokers, board.golden),
    };
    format!("board {on} by {}", name(&live.view, live.me, board.seat))
}

/// The reader's hand. While a decision is open, the request knows it better than the events: cards
/// given so far are gone.
fn own(live: &Live) -> String {
    let asked = live
        .open
        .as_ref()
        .and_then(|open| open.request.observation.as_ref());
    let cards = match asked {
        Some(observation) => hand(&Hand {
            counts: observation.hand.clone(),
            golden: observation.golden,
        }),
        None => {
            let seat = live.me.and_then(|me| live.view.seat(me));
            seat.and_then(|seat| seat.hand.as_ref())
                .map_or_else(String::new, hand)
        }
    };
    match cards.as_str() {
        "" => "hand none".to_owned(),
        cards => format!("hand {cards}"),
    }
}

/// Cards left in each hand, with those who have passed or finished.
fn left(live: &Live) -> String {
    let seats = (0u32..).zip(&live.view.seats).map(|(seat, it)| {
        let name = name(&live.view, live.me, seat);
        let state = match (it.finished, it.passed) {
            (Some(place), _) => return format!("{name} {}", ordinal(place)),
            (None, true) => " passed",
            (None, false) => "",
        };
        let substitute = if it.substituted { " (substitute)" } else { "" };
        format!("{name} {}{state}{substitute}", it.cards)
    });
    format!("left {}", seats.collect::<Vec<_>>().join(", "))
}

/// What happened in this Shift, then the whole table, for a reader who remembers nothing.
pub fn decision(live: &Live, now_ms: u64) -> String {
    let shift = live.events.iter().rposition(|event| event.begins_shift);
    let news = history(live.events.iter().skip(shift.unwrap_or(0)));
    format!("{news}\n{}", state(live, now_ms))
}

/// The number of the last event, then the whole table.
pub fn table(live: &Live, now_ms: u64) -> String {
    format!("seq {}\n{}", live.sequence(), state(live, now_ms))
}

fn state(live: &Live, now_ms: u64) -> String {
    let view = &live.view;
    let mut lines = Vec::new();
    if view.started {
        lines.push(format!("shift {} pizza {}", view.shift, view.pizza));
        let points = (0u32..).zip(&view.seats).map(|(seat, it)| {
            let role = match it.role {
                v1::Role::Unspecified => String::new(),
                role => format!(" ({})", title(role)),
            };
            format!("{} {}{role}", name(view, live.me, seat), it.points)
        });
        lines.push(format!("points {}", points.collect::<Vec<_>>().join(", ")));
        lines.extend(played(live));
        let choice = live
            .open
            .as_ref()
            .is_some_and(|open| legal_count(&open.request) > 1);
        if !choice {
            lines.extend([board(live), own(live), left(live)]);
        }
    } else {
        let seats = view.seats.iter().map(|it| match it.name.as_str() {
            "" => "free".to_owned(),
            name => name.to_owned(),
        });
        lines.push(format!("seats {}", seats.collect::<Vec<_>>().join(", ")));
    }
    lines.push(now(live, now_ms));
    lines.join("\n")
}

/// The cards played in this Shift, by face: what can no longer be in a hand.
fn played(live: &Live) -> Option<String> {
    let stacks = hand(&live.played);
    (!stacks.is_empty()).then(|| format!("played {stacks}"))
}
