//! Text of known width: styled pieces, wrapped items, names that are safe to print.

use anstyle::{AnsiColor, Color, Style};
use chefshat_record::words::is_invisible;
use unicode_width::{UnicodeWidthChar as _, UnicodeWidthStr as _};

/// Maximum columns of a line.
pub(super) const WIDTH: usize = 98;
/// Maximum columns of a name.
pub const MAX_NAME: usize = 15;

/// Columns of the label of a line outside Shifts.
const LABEL: usize = 17;

/// The colours of the seats, by number.
const SEAT_COLOURS: [AnsiColor; 6] = [
    AnsiColor::Cyan,
    AnsiColor::Yellow,
    AnsiColor::Magenta,
    AnsiColor::Green,
    AnsiColor::Blue,
    AnsiColor::Red,
];

/// Secondary text.
pub(super) const DIM: Style = Style::new().dimmed();
/// Emphasised text.
pub(super) const BOLD: Style = Style::new().bold();
/// The Golden card and special actions.
pub(super) const GOLD: Style = Style::new()
    .fg_color(Some(Color::Ansi(AnsiColor::BrightYellow)))
    .bold();
/// Plain text.
pub(super) const PLAIN: Style = Style::new();

/// The colour of a seat.
pub(super) fn seat_style(seat: u32) -> Style {
    let index = usize::try_from(seat).unwrap_or(0) % SEAT_COLOURS.len();
    Style::new().fg_color(Some(Color::Ansi(SEAT_COLOURS[index])))
}

/// Columns of a text on a terminal.
pub fn columns(text: &str) -> usize {
    text.width()
}

/// Styled text and its width; a single line.
#[derive(Debug, Clone, Default)]
pub(super) struct Piece {
    text: String,
    width: usize,
}

impl Piece {
    /// Text in one style.
    pub(super) fn new(style: Style, text: &str) -> Self {
        Self::default().and(style, text)
    }

    /// Appends text in a style.
    #[must_use]
    pub(super) fn and(mut self, style: Style, text: &str) -> Self {
        self.width += columns(text);
        if style == PLAIN {
            self.text.push_str(text);
        } else {
            self.text.push_str(&format!("{style}{text}{style:#}"));
        }
        self
    }

    /// Appends a piece.
    #[must_use]
    pub(super) fn join(mut self, other: &Self) -> Self {
        self.width += other.width;
        self.text.push_str(&other.text);
        self
    }

    /// Pads on the right to a width.
    #[must_use]
    pub(super) fn padded(self, width: usize) -> Self {
        let missing = width.saturating_sub(self.width);
        self.and(PLAIN, &" ".repeat(missing))
    }

    /// Pads on the left to a width.
    #[must_use]
    pub(super) fn right(self, width: usize) -> Self {
        let missing = width.saturating_sub(self.width);
        Self::new(PLAIN, &" ".repeat(missing)).join(&self)
    }

    /// Its width in columns.
    pub(super) fn width(&self) -> usize {
        self.width
    }

    /// The text with its styles.
    pub(super) fn as_str(&self) -> &str {
        &self.text
    }
}

/// Items separated by dots, wrapped, with continuation lines indented by the width of `start`.
pub(super) fn wrapped(start: &Piece, items: &[Piece]) -> String {
    let mut out = start.as_str().to_owned();
    let mut column = start.width();
    for (index, item) in items.iter().enumerate() {
        if index > 0 {
            if column + 3 + item.width() > WIDTH {
                out.push('\n');
                out.push_str(&" ".repeat(start.width()));
                column = start.width();
            } else {
                out.push_str(Piece::new(DIM, " · ").as_str());
                column += 3;
            }
        }
        out.push_str(item.as_str());
        column += item.width();
    }
    out.push('\n');
    out
}

/// A heading: text in a rule across the page.
pub fn heading(words: &str) -> String {
    let words = clean(words, WIDTH - 10);
    let rest = WIDTH.saturating_sub(columns(&words) + 4);
    let line = Piece::new(BOLD, "━━ ")
        .and(BOLD, &words)
        .and(BOLD, " ")
        .and(BOLD, &"━".repeat(rest));
    format!("\n{}\n", line.as_str())
}

/// The label of a line outside Shifts.
pub(super) fn label(words: &str) -> Piece {
    Piece::new(PLAIN, "   ").and(DIM, words).padded(LABEL)
}

/// A line outside Shifts: a label and text. Not wrapped, so that addresses and paths can be copied.
pub fn row(words: &str, text: &str) -> String {
    let line = label(words).and(PLAIN, text);
    format!("{}\n", line.as_str())
}

/// Text from outside, made safe to print: without control and invisible characters, at most `width` columns.
pub fn clean(text: &str, width: usize) -> String {
    let shown = |letter: &char| !letter.is_control() && !is_invisible(*letter);
    let safe: String = text.chars().filter(shown).collect();
    if columns(&safe) <= width {
        return safe;
    }
    let mut cut = String::new();
    let mut used = 1;
    for letter in safe.chars() {
        used += letter.width().unwrap_or(0);
        if used > width {
            break;
        }
        cut.push(letter);
    }
    cut.push('…');
    cut
}

#[cfg(test)]
mod tests {
    use crate::narration::text::*;

    #[test]
    fn names_are_safe_and_short() {
        let table = [
            ("Greta", "Greta"),
            ("Wilhelmina the Great", "Wilhelmina the…"),
            ("a\u{1b}[31mb\u{7}", "a[31mb"),
            ("\u{202e}drow\u{fe00}\u{e0041}", "drow"),
            ("料理長のとても長い名前", "料理長のとても…"),
            ("random_unmasked", "random_unmasked"),
        ];
        for (name, expected) in table {
            assert_eq!(clean(name, MAX_NAME), expected);
        }
    }

    #[test]
    fn items_wrap_behind_their_start() {
        let item = Piece::new(PLAIN, &"x".repeat(40));
        let text = wrapped(
            &Piece::new(PLAIN, "   a "),
            &[item.clone(), item.clone(), item],
        );
        let text = anstream::adapter::strip_str(&text).to_string();
        let x = "x".repeat(40);
        assert_eq!(text, format!("   a {x} · {x}\n     {x}\n"));
    }
}
