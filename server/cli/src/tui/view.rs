//! Draws the table: header, seats, story, pizza, and popups. `play` and `watch` draw what is below
//! it.

use chefshat_client::v1;
use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::text::{Line, Span};
use ratatui::widgets::{Block, BorderType, Clear, Paragraph, Wrap};

use super::super::numbers::{counted, ordinal};
use super::cards::fan;
use super::log::{self, Log};
use super::theme::{Theme, ingredient, kind};
use crate::narration::view::{End, GameView};
use crate::narration::{MAX_NAME, aborted, clean, columns, title};
use crate::output::stop_in_words;

/// Minimum size of the window.
pub(crate) const MIN_COLUMNS: u16 = 80;
pub(crate) const MIN_ROWS: u16 = 24;

/// Columns of the box of seats.
const SEATS_COLUMNS: u16 = 54;
/// Its title, with a word over each column of numbers.
const SEATS_TITLE: &str = " at the table ───────────── cards points ";
/// Rows of the box of the pizza.
const PIZZA_ROWS: u16 = 5;
/// Minimum rows of seats and story.
const UPPER_ROWS: u16 = 8;

/// Draws the table; returns the area below it, `rows` high.
pub(crate) fn draw(
    frame: &mut Frame<'_>,
    theme: Theme,
    table: &GameView,
    me: Option<u32>,
    status: &str,
    log: &Log,
    rows: u16,
) -> Option<Rect> {
    let area = frame.area();
    if is_too_small(frame) {
        return None;
    }
    let [header, upper, pizza, lower] = Layout::vertical([
        Constraint::Length(1),
        Constraint::Min(UPPER_ROWS),
        Constraint::Length(PIZZA_ROWS),
        Constraint::Length(rows),
    ])
    .areas(area);
    draw_header(frame, theme, table, status, header);
    if log.is_open() {
        log::draw_back(frame, theme, table, log, upper.union(pizza));
        return Some(lower);
    }
    let [seats, story] =
        Layout::horizontal([Constraint::Length(SEATS_COLUMNS), Constraint::Min(1)]).areas(upper);
    draw_seats(frame, theme, table, me, seats);
    log::draw(frame, theme, table, log, story);
    draw_pizza(frame, theme, table, me, pizza);
    Some(lower)
}

/// Draws a message if the window is too small.
pub(crate) fn is_too_small(frame: &mut Frame<'_>) -> bool {
    let area = frame.area();
    let small = area.width < MIN_COLUMNS || area.height < MIN_ROWS;
    if small {
        let words = format!(
            "The table needs {MIN_COLUMNS}×{MIN_ROWS}; this window has {}×{}. Make it larger, or the letters smaller.",
            area.width, area.height
        );
        frame.render_widget(Paragraph::new(words).wrap(Wrap { trim: true }), area);
    }
    small
}

/// A popup in the middle of the screen.
pub(crate) fn popup(frame: &mut Frame<'_>, theme: Theme, title: &str, lines: Vec<Line<'_>>) {
    let area = frame.area();
    let longest = lines.iter().map(Line::width).max().unwrap_or(0);
    let width = u16::try_from(longest + 6).unwrap_or(u16::MAX);
    let height = u16::try_from(lines.len() + 2).unwrap_or(u16::MAX);
    let (width, height) = (width.min(area.width), height.min(area.height));
    let place = Rect {
        x: area.x + (area.width - width) / 2,
        y: area.y + (area.height - height) / 2,
        width,
        height,
    };
    frame.render_widget(Clear, place);
    let block = Block::bordered()
        .border_type(BorderType::Double)
        .border_style(theme.gold())
        .title(format!(" {title} "))
        .padding(ratatui::widgets::Padding::horizontal(2));
    frame.render_widget(Paragraph::new(lines).block(block), place);
}

/// The end of a game in lines: its standings, or why there are none.
pub(crate) fn end_lines(theme: Theme, table: &GameView, end: &End) -> Vec<Line<'static>> {
    match end {
        End::Aborted(reason) => vec![Line::from(aborted(*reason))],
        End::Finished(standings) => standings
            .iter()
            .map(|line| {
                let name = padded(&table.name(line.seat), MAX_NAME + 1);
                let words = format!("{:>3}  ", ordinal(line.place));
                let points = counted(line.points, "point");
                let mut spans = vec![
                    Span::raw(words),
                    Span::styled(name, theme.seat(line.seat)),
                    Span::raw(format!("{points:>10}")),
                ];
                if line.place == 1 {
                    spans.push(Span::styled("  ★ wins the game", theme.gold()));
                }
                Line::from(spans)
            })
            .collect(),
    }
}

/// Pads text with spaces to a width.
pub(crate) fn padded(text: &str, width: usize) -> String {
    let missing = width.saturating_sub(columns(text));
    format!("{text}{}", " ".repeat(missing))
}

fn draw_header(frame: &mut Frame<'_>, theme: Theme, table: &GameView, status: &str, area: Rect) {
    let mut progress = String::new();
    if table.shift > 0 {
        progress.push_str(&format!(" · Shift {} · pizza {}", table.shift, table.pizza));
    }
    if let Some(rules) = &table.rules {
        progress.push_str(&format!(" · {}", stop_in_words(rules.stop())));
    }
    if table.paused {
        progress.push_str(" · paused");
    }
    let width = usize::from(area.width).saturating_sub(columns(status) + 1);
    let space = width.saturating_sub(columns(&progress) + 2);
    let room = &table.room_name;
    // A long room name replaces the name of the game, and is cut if necessary.
    let named = match room.is_empty() {
        true => "Chef's Hat".to_owned(),
        false => format!("Chef's Hat · {room}"),
    };
    let named = match columns(&named) <= space {
        true => named,
        false => clean(room, space),
    };
    let words = format!(" {named}{progress}");
    let line = Line::from(format!("{}{status} ", padded(&words, width)));
    frame.render_widget(Paragraph::new(line).style(theme.header()), area);
}

fn draw_seats(frame: &mut Frame<'_>, theme: Theme, table: &GameView, me: Option<u32>, area: Rect) {
    let lines = (0u32..).zip(&table.seats).map(|(seat, place)| {
        let marker = if table.turn == Some(seat) {
            "▶ "
        } else {
            "  "
        };
        let (symbol, word) = kind(place);
        let name = if place.name.is_empty() {
            "(free)".to_owned()
        } else if me == Some(seat) {
            format!("{} (you)", place.name)
        } else {
            place.name.clone()
        };
        let name_style = if table.turn == Some(seat) {
            theme.seat(seat).patch(theme.bold())
        } else {
            theme.seat(seat)
        };
        let role = match place.role {
            v1::Role::Unspecified => "",
            role => title(role),
        };
        let name = padded(&clean(&name, 16), 17);
        let mut spans = vec![
            Span::styled(marker, theme.bold()),
            Span::styled(name, name_style),
            Span::raw(format!("{symbol} {word:<6} ")),
        ];
        if table.started {
            let cards = match place.finished {
                Some(place) => ordinal(place),
                None => place.cards.to_string(),
            };
            spans.push(Span::styled(format!("{cards:>5}"), theme.bold()));
            spans.push(Span::raw(format!("{:>7} ", place.points)));
            spans.push(match note_of(place) {
                Some(note) => Span::styled(note, theme.dim()),
                None => Span::raw(role),
            });
        }
        Line::from(spans)
    });
    let lines: Vec<Line<'_>> = lines.collect();
    frame.render_widget(Paragraph::new(lines).block(theme.boxed(SEATS_TITLE)), area);
}

/// A note about a seat that is shown instead of its role.
fn note_of(place: &crate::narration::view::SeatView) -> Option<String> {
    if place.substituted {
        return Some("substitute".to_owned());
    }
    if !place.connected {
        return Some("not here".to_owned());
    }
    (place.passed && place.finished.is_none()).then(|| "passed".to_owned())
}

fn draw_pizza(frame: &mut Frame<'_>, theme: Theme, table: &GameView, me: Option<u32>, area: Rect) {
    let block = theme.boxed(" the pizza ");
    let inner = block.inner(area);
    frame.render_widget(block, area);
    let Some(play) = table.board else {
        if table.turns == 0 && !table.last_order.is_empty() && table.end.is_none() {
            let lines = between(theme, table, me);
            frame.render_widget(Paragraph::new(lines).wrap(Wrap { trim: false }), inner);
            return;
        }
        let words = match (table.started, table.turn) {
            (false, _) => waiting(table),
            (true, Some(seat)) if me == Some(seat) => "The board is empty: you play.".to_owned(),
            (true, Some(seat)) => format!("The board is empty: {} plays.", table.name(seat)),
            (true, None) => "The board is empty.".to_owned(),
        };
        let lines = vec![Line::default(), Line::from(format!("  {words}"))];
        frame.render_widget(Paragraph::new(lines), inner);
        return;
    };
    let faces = table.faces();
    let [first, second, third] = fan(theme, faces, play);
    let width = u16::try_from(first.width())
        .unwrap_or(u16::MAX)
        .saturating_add(1);
    let [left, right] = Layout::horizontal([
        Constraint::Length(width.min(inner.width)),
        Constraint::Min(0),
    ])
    .areas(inner);
    frame.render_widget(Paragraph::new(vec![first, second, third]), left);
    let size = play.quantity.saturating_add(play.jokers);
    let name = if me == Some(play.seat) {
        "you".to_owned()
    } else {
        table.name(play.seat)
    };
    let what = ingredient(play.face, faces).map_or_else(String::new, |name| format!(" ({name})"));
    let beat = match play.face {
        1 => "Nothing is rarer than face 1.".to_owned(),
        face => format!("Beaten by {}.", beating(face.saturating_sub(1), size)),
    };
    let lines = vec![
        Line::from(vec![
            Span::raw(" "),
            Span::styled(name, theme.seat(play.seat)),
            Span::raw(" played"),
        ]),
        Line::from(Span::styled(
            format!(
                " {}{what}",
                play_words(play.face, play.quantity, play.jokers, faces)
            ),
            theme.bold(),
        )),
        Line::from(format!(" {beat}")),
    ];
    frame.render_widget(Paragraph::new(lines), right);
}

/// Between two Shifts: how the last one ended, and the person's new role.
fn between(theme: Theme, table: &GameView, me: Option<u32>) -> Vec<Line<'static>> {
    let last = table.shift.saturating_sub(1);
    let mut spans = vec![Span::raw(format!("  Shift {last} ended: "))];
    for (place, seat) in (1u32..).zip(&table.last_order) {
        let dot = if place > 1 { " · " } else { "" };
        spans.push(Span::raw(format!("{dot}{} ", ordinal(place))));
        spans.push(Span::styled(table.name(*seat), theme.seat(*seat)));
    }
    let mine = me.and_then(|me| table.seat(me)).map(|place| place.role);
    let role = match mine {
        Some(role) if role != v1::Role::Unspecified => format!(" You are {}.", title(role)),
        _ => String::new(),
    };
    let now = format!("  Shift {} is dealt.{role}", table.shift);
    vec![Line::from(now), Line::from(spans)]
}

/// A play in words: `2 × 7 + 1 joker`.
pub(crate) fn play_words(face: u32, quantity: u32, jokers: u32, faces: u32) -> String {
    if face > faces || quantity == 0 {
        return "a joker alone".to_owned();
    }
    match jokers {
        0 => format!("{quantity} × {face}"),
        jokers => format!(
            "{quantity} × {face} + {}",
            counted(u64::from(jokers), "joker")
        ),
    }
}

/// What beats the board, in words: `7 or lower, at least 2 cards`.
pub(crate) fn beating(highest_face: u32, fewest_cards: u32) -> String {
    let lower = if highest_face > 1 { " or lower" } else { "" };
    let cards = counted(u64::from(fewest_cards), "card");
    format!("{highest_face}{lower}, at least {cards}")
}

fn waiting(table: &GameView) -> String {
    match table.free_seats() {
        0 if table.seats.is_empty() => "Waiting for the table.".to_owned(),
        0 => "All seats are taken: the game is about to start.".to_owned(),
        free => format!(
            "Waiting for {} to be taken.",
            counted(u64::try_from(free).unwrap_or(0), "seat")
        ),
    }
}
