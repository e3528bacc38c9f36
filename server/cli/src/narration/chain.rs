//! The line of a pizza, which grows as the pizza is made: plays in order, then the cards left in
//! each hand. Passes are shown only before a later play: at the end of a pizza everyone has passed.

use chefshat_client::v1;
use chefshat_record::words::reason;

use super::story::cards;
use super::text::{BOLD, DIM, GOLD, PLAIN, Piece, WIDTH, clean, columns, seat_style};
use super::view::GameView;
use crate::numbers::ordinal;

/// Columns for the pizza's number.
const START: usize = 7;
/// Columns for the cards left, all seats together.
const SIDE: usize = 42;
/// Columns reserved after a last play for the place.
const PLACE: usize = 4;

/// Writes the pizzas of a Shift, one line each.
#[derive(Debug, Default)]
pub(super) struct Chain {
    /// Columns written on the line; 0 between lines.
    column: usize,
    /// The line has an item to link the next one to.
    linked: bool,
    /// Another line interrupted this one; the next item starts a new line.
    broken: bool,
    /// The passes since the last play.
    passed: Vec<(u32, v1::DecisionSource)>,
    /// Columns for the cards left of one seat.
    side: usize,
    has_header: bool,
}

impl Chain {
    /// The pizzas of a new Shift.
    pub(super) fn new(view: &GameView) -> Self {
        let seats = view.seats.len().max(1);
        let longest = view.seats.iter().map(|seat| columns(&seat.name)).max();
        Self {
            side: longest
                .unwrap_or(0)
                .min((SIDE / seats).saturating_sub(2))
                .max(4)
                + 2,
            ..Self::default()
        }
    }

    /// Adds a play.
    pub(super) fn play(&mut self, play: &v1::Play, view: &GameView) -> String {
        let mut out = self.open(view);
        out.push_str(&self.passes(view, |_| true));
        let mut item = Piece::new(seat_style(play.seat), &view.name(play.seat))
            .and(PLAIN, &format!(" {}", cards(play)));
        if view.plays_golden(play) {
            item = item.and(GOLD, "★");
        }
        if let Some(why) = reason(play.source()) {
            item = item.and(DIM, &format!(" {why}"));
        }
        let place = if play.cards_left == 0 { PLACE } else { 0 };
        out.push_str(&self.put("› ", &item, place, view));
        out
    }

    /// Notes a pass; it is written before the next play.
    pub(super) fn pass(&mut self, pass: &v1::Pass) {
        self.passed.push((pass.seat, pass.source()));
    }

    /// Adds the place of the seat that has just played its last card.
    pub(super) fn finished(&mut self, finished: &v1::SeatFinished) -> String {
        if self.column == 0 {
            return String::new();
        }
        let mut out = self.resumed();
        let place = Piece::new(BOLD, &format!(" {}", ordinal(finished.place)));
        self.column += place.width();
        out.push_str(place.as_str());
        out
    }

    /// Ends the line of a pizza that is done.
    pub(super) fn done(&mut self, done: &v1::PizzaDone, view: &GameView) -> String {
        let mut out = self.open(view);
        if done.last_to_play.is_none() {
            out.push_str(&self.put("› ", &Piece::new(DIM, "nobody plays"), 0, view));
        }
        out.push_str(&self.close(view));
        out
    }

    /// Ends an open line without the cards left.
    pub(super) fn break_off(&mut self) -> &'static str {
        let open = self.column > 0 && !self.broken;
        *self = Self::default();
        if open { "\n" } else { "" }
    }

    /// Ends an open line whose last items are void; the next item begins another.
    pub(super) fn restart(&mut self) -> &'static str {
        let (side, has_header) = (self.side, self.has_header);
        let end = self.break_off();
        (self.side, self.has_header) = (side, has_header);
        end
    }

    /// Ends an open line.
    pub(super) fn close(&mut self, view: &GameView) -> String {
        let mut out = String::new();
        if self.column > 0 {
            // Of the last passes only those that the server decided are worth showing.
            out.push_str(&self.passes(view, |source| reason(source).is_some()));
            out.push_str(&self.resumed());
            let gap = self.body(view).saturating_sub(self.column);
            out.push_str(&" ".repeat(gap));
            for (number, seat) in (0u32..).zip(&view.seats) {
                let piece = match (seat.finished, seat.cards) {
                    (Some(place), _) => Piece::new(seat_style(number), &ordinal(place)),
                    (None, count @ ..=3) => Piece::new(BOLD, &count.to_string()),
                    (None, count) => Piece::new(DIM, &count.to_string()),
                };
                out.push_str(piece.right(self.side).as_str());
            }
            out.push('\n');
        }
        self.passed.clear();
        self.column = 0;
        self.linked = false;
        out
    }

    /// Writes a separate line in the middle of this one, which continues below it.
    pub(super) fn interrupted_by(&mut self, line: &str) -> String {
        if self.column == 0 {
            return format!("{line}\n");
        }
        let end = if std::mem::replace(&mut self.broken, true) {
            ""
        } else {
            "\n"
        };
        self.column = START;
        self.linked = false;
        format!("{end}{line}\n")
    }

    /// Continues below an interruption.
    fn resumed(&mut self) -> String {
        if std::mem::take(&mut self.broken) {
            " ".repeat(START)
        } else {
            String::new()
        }
    }

    /// Begins a line, unless one is open.
    fn open(&mut self, view: &GameView) -> String {
        if self.column > 0 {
            return String::new();
        }
        let mut out = String::new();
        if !std::mem::replace(&mut self.has_header, true) {
            let mut head = Piece::new(DIM, "pizza").padded(self.body(view));
            for seat in (0u32..).take(view.seats.len()) {
                let name = clean(&view.name(seat), self.side.saturating_sub(2));
                head = head.join(&Piece::new(seat_style(seat), &name).right(self.side));
            }
            out = format!("\n{}\n", head.as_str());
        }
        let number = Piece::new(DIM, &format!("{:>5}  ", view.pizza));
        out.push_str(number.as_str());
        self.column = START;
        out
    }

    /// Adds an item after a link, with `reserve` free columns behind it.
    fn put(&mut self, link: &str, item: &Piece, reserve: usize, view: &GameView) -> String {
        let mut out = self.resumed();
        if self.linked {
            let wanted = self.column + 1 + columns(link) + item.width() + reserve;
            if wanted > self.body(view) {
                out.push('\n');
                out.push_str(&" ".repeat(START));
                self.column = START;
            } else {
                out.push(' ');
                self.column += 1;
            }
            let link = Piece::new(DIM, link);
            out.push_str(link.as_str());
            self.column += link.width();
        }
        out.push_str(item.as_str());
        self.column += item.width();
        self.linked = true;
        out
    }

    /// Writes the passes whose source is `worth` showing, in brackets.
    fn passes(&mut self, view: &GameView, worth: impl Fn(v1::DecisionSource) -> bool) -> String {
        let passed: Vec<String> = std::mem::take(&mut self.passed)
            .into_iter()
            .filter(|(_, source)| worth(*source))
            .map(|(seat, source)| {
                let name = view.name(seat);
                reason(source).map_or(name.clone(), |why| format!("{name} {why}"))
            })
            .collect();
        let mut out = String::new();
        let last = passed.len().saturating_sub(1);
        for (index, pass) in passed.iter().enumerate() {
            let before = if index == 0 { "(" } else { "" };
            let after = if index == last { ")" } else { "," };
            let link = if index == 0 { "› " } else { "" };
            let item = Piece::new(DIM, &format!("{before}{pass}{after}"));
            out.push_str(&self.put(link, &item, 0, view));
        }
        out
    }

    fn body(&self, view: &GameView) -> usize {
        WIDTH.saturating_sub(self.side * view.seats.len())
    }
}
