//! The line of a pizza: who played what, in order, growing while the pizza is made; and at its right, once the pizza is done, how many
//! cards each seat has left. Passes are told only where somebody still plays after them: at the end of a pizza everybody has passed.

use chefshat_client::v1;

use super::super::numbers::ordinal;
use super::name_of;
use super::text::{BOLD, DIM, GOLD, PLAIN, Piece, WIDTH, clean, columns, seat_style};

/// Columns before the first play of a line: the pizza's number.
const START: usize = 7;
/// Columns for what each seat has left, all seats together.
const SIDE: usize = 42;
/// Room kept behind a last card for the place it brings.
const PLACE: usize = 4;

/// What a seat holds.
#[derive(Debug, Clone, Copy)]
enum Left {
    Cards(u32),
    Place(u32),
}

/// The pizzas of a Shift, one line after the other.
#[derive(Debug, Default)]
pub(super) struct Chain {
    pizza: u32,
    /// Columns of the line that have been written; 0 between lines.
    column: usize,
    /// Something stands on the line to which the next item is linked.
    linked: bool,
    /// A line of another kind has come between; what follows is to begin below it.
    broken: bool,
    /// Who has passed since somebody last played.
    passed: Vec<(u32, v1::DecisionSource)>,
    left: Vec<Left>,
    /// Width of what each seat has left.
    side: usize,
    head_told: bool,
    /// The next play holds the Golden card.
    golden: bool,
}

impl Chain {
    /// The pizzas of a new Shift; `golden`: it opens with the Golden card.
    pub(super) fn new(names: &[String], hand_size: u32, golden: bool) -> Self {
        let seats = names.len().max(1);
        let longest = names.iter().map(|name| columns(name)).max().unwrap_or(0);
        Self {
            pizza: 1,
            left: vec![Left::Cards(hand_size); names.len()],
            side: longest.min(SIDE / seats - 2).max(4) + 2,
            golden,
            ..Self::default()
        }
    }

    /// A seat has played.
    pub(super) fn play(&mut self, play: &v1::Play, names: &[String]) -> String {
        let mut out = self.open(names);
        out.push_str(&self.passes(names, |_| true));
        let mut item = Piece::new(seat_style(play.seat), &name_of(names, play.seat))
            .and(PLAIN, &format!(" {}", cards(play)));
        if std::mem::take(&mut self.golden) {
            item = item.and(GOLD, "★");
        }
        if let Some(why) = reason(play.source()) {
            item = item.and(DIM, &format!(" {why}"));
        }
        let place = if play.cards_left == 0 { PLACE } else { 0 };
        out.push_str(&self.put(&item, place));
        self.set_left(play.seat, Left::Cards(play.cards_left));
        out
    }

    /// A seat has passed: told when somebody plays after it.
    pub(super) fn pass(&mut self, pass: &v1::Pass) {
        self.golden = false;
        self.passed.push((pass.seat, pass.source()));
    }

    /// The seat that has just played has no cards left.
    pub(super) fn finished(&mut self, finished: &v1::SeatFinished) -> String {
        self.set_left(finished.seat, Left::Place(finished.place));
        if self.column == 0 {
            return String::new();
        }
        let mut out = self.resumed();
        let place = Piece::new(BOLD, &format!(" {}", ordinal(finished.place)));
        self.column += place.width();
        out.push_str(place.as_str());
        out
    }

    /// The pizza is done: the line ends.
    pub(super) fn done(&mut self, done: &v1::PizzaDone, names: &[String]) -> String {
        let mut out = self.open(names);
        if done.last_to_play.is_none() {
            out.push_str(&self.put(&Piece::new(DIM, "nobody plays"), 0));
        }
        out.push_str(&self.close(names));
        self.pizza = done.pizza.saturating_add(1);
        out
    }

    /// Ends the line, if one is open, without a word of how the cards stand.
    pub(super) fn break_off(&mut self) -> &'static str {
        let open = self.column > 0 && !self.broken;
        *self = Self::default();
        if open { "\n" } else { "" }
    }

    /// Ends the line, if one is open.
    pub(super) fn close(&mut self, names: &[String]) -> String {
        // Whoever passed last of all has not much to say, unless the pass was not its own.
        let mut out = String::new();
        if self.column > 0 {
            out.push_str(&self.passes(names, |source| reason(source).is_some()));
            out.push_str(&self.resumed());
            let gap = self.body().saturating_sub(self.column);
            out.push_str(&" ".repeat(gap));
            for (seat, left) in (0u32..).zip(&self.left) {
                let piece = match *left {
                    Left::Place(place) => Piece::new(seat_style(seat), &ordinal(place)),
                    Left::Cards(count) if count <= 3 => Piece::new(BOLD, &count.to_string()),
                    Left::Cards(count) => Piece::new(DIM, &count.to_string()),
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

    /// A line of its own in the middle of this one, which goes on below it.
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

    /// Goes on below what came between.
    fn resumed(&mut self) -> String {
        if std::mem::take(&mut self.broken) {
            " ".repeat(START)
        } else {
            String::new()
        }
    }

    /// Begins a line, unless one is open.
    fn open(&mut self, names: &[String]) -> String {
        if self.column > 0 {
            return String::new();
        }
        let mut out = String::new();
        if !std::mem::replace(&mut self.head_told, true) {
            let mut head = Piece::new(DIM, "pizza").padded(self.body());
            for (seat, name) in (0u32..).zip(names) {
                let name = clean(name, self.side.saturating_sub(2));
                head = head.join(&Piece::new(seat_style(seat), &name).right(self.side));
            }
            out = format!("\n{}\n", head.as_str());
        }
        let number = Piece::new(DIM, &format!("{:>5}  ", self.pizza));
        out.push_str(number.as_str());
        self.column = START;
        out
    }

    /// An item of the line, linked to the one before it, with so many columns kept free behind it.
    fn put(&mut self, item: &Piece, reserve: usize) -> String {
        self.put_after("› ", item, reserve)
    }

    fn put_after(&mut self, link: &str, item: &Piece, reserve: usize) -> String {
        let mut out = self.resumed();
        if self.linked {
            let wanted = self.column + 1 + columns(link) + item.width() + reserve;
            if wanted > self.body() {
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

    /// Those who have passed and are worth telling, in brackets.
    fn passes(&mut self, names: &[String], worth: impl Fn(v1::DecisionSource) -> bool) -> String {
        let passed: Vec<String> = std::mem::take(&mut self.passed)
            .into_iter()
            .filter(|(_, source)| worth(*source))
            .map(|(seat, source)| {
                let name = name_of(names, seat);
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
            out.push_str(&self.put_after(link, &item, 0));
        }
        out
    }

    fn body(&self) -> usize {
        WIDTH.saturating_sub(self.side * self.left.len())
    }

    fn set_left(&mut self, seat: u32, left: Left) {
        if let Some(place) = usize::try_from(seat)
            .ok()
            .and_then(|seat| self.left.get_mut(seat))
        {
            *place = left;
        }
    }
}

/// Cards as they lie on the board: three 9 and a joker are `3×9+J`.
pub(crate) fn cards(play: &v1::Play) -> String {
    match (play.quantity, play.jokers) {
        (0, _) => "J".into(),
        (quantity, 0) => format!("{quantity}×{}", play.face),
        (quantity, 1) => format!("{quantity}×{}+J", play.face),
        (quantity, jokers) => format!("{quantity}×{}+{jokers}J", play.face),
    }
}

/// Why a decision was not the seat's own, in a word.
pub(crate) fn reason(source: v1::DecisionSource) -> Option<&'static str> {
    match source {
        v1::DecisionSource::Timeout => Some("too late"),
        v1::DecisionSource::Invalid => Some("invalid"),
        v1::DecisionSource::Disconnected => Some("absent"),
        v1::DecisionSource::Agent
        | v1::DecisionSource::Substitute
        | v1::DecisionSource::Recorded
        | v1::DecisionSource::Unspecified => None,
    }
}
