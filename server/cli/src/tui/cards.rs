//! Cards as text: the stacks of a hand side by side, a play as a fan. The caller says which of them
//! may be played.

use ratatui::style::Style;
use ratatui::text::{Line, Span};

use super::theme::Theme;
use crate::narration::hand::Stack;
use crate::narration::view::OnBoard;

/// Maximum columns of a stack, with the space behind it.
const STACK_COLUMNS: usize = 6;
/// Minimum columns of a legible stack.
const MIN_STACK_COLUMNS: usize = 4;

/// Maximum number of cards in a fan: more than any deck has.
const MAX_FAN: usize = 64;

/// How a stack of a hand is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Shown {
    pub(crate) stack: Stack,
    /// A legal action uses it.
    pub(crate) active: bool,
    /// Number of selected cards, if the cursor is on it.
    pub(crate) picked: Option<u8>,
    /// Number of jokers selected with another stack.
    pub(crate) along: u8,
    /// The key that selects it, unless it is the card's own label.
    pub(crate) key: Option<char>,
}

/// A hand in five lines: four for the cards, one for the selection.
pub(crate) fn hand(
    theme: Theme,
    faces: u32,
    stacks: &[Shown],
    columns: usize,
) -> Vec<Line<'static>> {
    let width = (columns / stacks.len().max(1)).clamp(MIN_STACK_COLUMNS, STACK_COLUMNS);
    // One column of the six is the space between two cards; narrower ones have none.
    let gap = usize::from(width == STACK_COLUMNS);
    let inner = width - gap - 2;
    let mut rows: Vec<Vec<Span<'static>>> = vec![Vec::new(); 5];
    for shown in stacks {
        let stack = shown.stack;
        let frame = frame_of(shown);
        let style = style_of(theme, faces, shown);
        let face = if stack.joker {
            "J".to_owned()
        } else if stack.golden {
            format!("{}★", stack.face)
        } else {
            stack.face.to_string()
        };
        let count = format!("×{}", stack.count);
        let [left, line, right, side, low_left, low_right] = frame;
        let space = " ".repeat(gap);
        rows[0].push(Span::styled(
            format!("{left}{}{right}{space}", top(line, inner, shown.key)),
            style,
        ));
        // Faces and counts must stay legible: only the frame is coloured or dimmed.
        let ink = if shown.active || shown.picked.is_some() {
            theme.bold()
        } else {
            Style::new()
        };
        let words = [format!("{face:>inner$}"), format!("{count:<inner$}")];
        for (row, words) in rows[1..3].iter_mut().zip(words) {
            row.push(Span::styled(side, style));
            row.push(Span::styled(words, ink));
            row.push(Span::styled(format!("{side}{space}"), style));
        }
        rows[3].push(Span::styled(
            format!("{low_left}{}{low_right}{space}", line.repeat(inner)),
            style,
        ));
        let mark = match (shown.picked, shown.along) {
            (Some(picked), _) => format!("▲{picked}"),
            (None, 0) => String::new(),
            (None, along) => format!("+{along}"),
        };
        rows[4].push(Span::styled(format!("{mark:^width$}"), theme.bold()));
    }
    rows.into_iter().map(Line::from).collect()
}

/// The upper edge of a card, with a key in the middle.
fn top(line: &str, inner: usize, key: Option<char>) -> String {
    let Some(key) = key else {
        return line.repeat(inner);
    };
    let left = inner / 2;
    let right = inner.saturating_sub(left + 1);
    format!("{}{key}{}", line.repeat(left), line.repeat(right))
}

/// Corners and edges of a card: heavy under the cursor, broken if no legal action uses it.
fn frame_of(shown: &Shown) -> [&'static str; 6] {
    match (shown.picked.is_some(), shown.active) {
        (true, _) => ["┏", "━", "┓", "┃", "┗", "┛"],
        (false, true) => ["╭", "─", "╮", "│", "╰", "╯"],
        (false, false) => ["╭", "┄", "╮", "┆", "╰", "╯"],
    }
}

fn style_of(theme: Theme, faces: u32, shown: &Shown) -> Style {
    let style = theme.card(shown.stack.face, faces);
    match (shown.picked.is_some(), shown.active) {
        (true, _) => style.patch(theme.bold()),
        (false, true) => style,
        (false, false) => style.patch(theme.dim()),
    }
}

/// A play as a fan of overlapping cards, three lines high; twelve cards fit in 37 columns.
pub(crate) fn fan(theme: Theme, faces: u32, play: OnBoard) -> [Line<'static>; 3] {
    let plain = usize::try_from(play.quantity)
        .unwrap_or(MAX_FAN)
        .min(MAX_FAN);
    let jokers = usize::try_from(play.jokers).unwrap_or(MAX_FAN).min(MAX_FAN);
    let cards = std::iter::repeat_n(false, plain).chain(std::iter::repeat_n(true, jokers));
    let mut rows: [Vec<Span<'static>>; 3] = Default::default();
    let mut last = Style::new();
    for (index, joker) in cards.enumerate() {
        let face = if joker { faces + 1 } else { play.face };
        let style = theme.card(face, faces);
        let words = match (joker, play.golden && index == 0) {
            (true, _) => " J".to_owned(),
            (false, true) => format!("{face:<2}"),
            (false, false) => format!("{face:>2}"),
        };
        let golden = play.golden && index == 0;
        let (edge, style) = if golden {
            ("★", theme.gold())
        } else {
            ("│", style)
        };
        rows[0].push(Span::styled("╭──", style));
        rows[1].push(Span::styled(format!("{edge}{words}"), style));
        rows[2].push(Span::styled("╰──", style));
        last = style;
    }
    if !rows[0].is_empty() {
        for (row, end) in rows.iter_mut().zip(["╮", "│", "╯"]) {
            row.push(Span::styled(end, last));
        }
    }
    rows.map(Line::from)
}
