//! Draws the story: its newest lines beside the seats or, scrolled back, earlier ones in place of seats and pizza.

use ratatui::Frame;
use ratatui::crossterm::event::KeyCode;
use ratatui::layout::Rect;
use ratatui::text::{Line, Span};
use ratatui::widgets::Paragraph;

use super::theme::Theme;
use super::view::boxed;
use crate::narration::columns;
use crate::narration::story;
use crate::narration::view::GameView;

/// Lines per key press, for the first and the following ones: less than the smallest window shows.
const FIRST: usize = 5;
const PAGE: usize = 10;
/// Indentation of wrapped lines.
const INDENT: usize = 2;

/// The scroll position of the story.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct Scroll {
    /// Number of the line after the last shown one, of all lines so far; none while the newest are shown beside the seats.
    end: Option<usize>,
}

impl Scroll {
    /// Whether earlier lines replace the table.
    pub(crate) fn is_open(self) -> bool {
        self.end.is_some()
    }

    /// Handles a key; false if it is not for the story. `PgUp` always is, all others only while earlier lines are shown.
    pub(crate) fn key(&mut self, code: KeyCode, table: &GameView) -> bool {
        // At least one page stays visible.
        let first = (table.story_len - table.story.len() + PAGE).min(table.story_len);
        self.end = match (code, self.end) {
            (KeyCode::PageUp, None) => Some(table.story_len.saturating_sub(FIRST).max(first)),
            (KeyCode::PageUp, Some(end)) => Some(end.saturating_sub(PAGE).max(first)),
            (KeyCode::Home, Some(_)) => Some(first),
            (KeyCode::PageDown, Some(end)) => Some(end + PAGE).filter(|end| *end < table.story_len),
            (_, Some(_)) => None,
            (_, None) => return false,
        };
        true
    }
}

/// Draws the newest lines.
pub(super) fn draw(frame: &mut Frame<'_>, theme: Theme, table: &GameView, area: Rect) {
    let lines = last_lines(theme, table, table.story_len, area);
    let block = boxed(theme, " what happened ");
    frame.render_widget(Paragraph::new(lines).block(block), area);
}

/// Draws earlier lines.
pub(super) fn draw_back(
    frame: &mut Frame<'_>,
    theme: Theme,
    table: &GameView,
    scroll: Scroll,
    area: Rect,
) {
    let end = scroll.end.unwrap_or(table.story_len).min(table.story_len);
    let lines = last_lines(theme, table, end, area);
    let after = match table.story_len - end {
        0 => "the newest".to_owned(),
        after => format!("{after} more after these"),
    };
    let block = boxed(theme, format!(" what happened · {after} "))
        .title_bottom(" PgUp earlier · PgDn later · any other key: the table ");
    frame.render_widget(Paragraph::new(lines).block(block), area);
}

/// The lines before line number `end` that fit in the area, wrapped.
fn last_lines(theme: Theme, table: &GameView, end: usize, area: Rect) -> Vec<Line<'static>> {
    let rows = usize::from(area.height.saturating_sub(2));
    let width = usize::from(area.width.saturating_sub(2));
    let told_before = table.story_len - table.story.len();
    let shown = end.saturating_sub(told_before).min(table.story.len());
    let mut lines: Vec<Line<'static>> = Vec::new();
    for line in table.story.range(..shown).rev() {
        let wrapped = wrap(theme, table, line, width);
        lines.extend(wrapped.into_iter().rev());
        if lines.len() >= rows {
            break;
        }
    }
    lines.truncate(rows);
    lines.reverse();
    lines
}

/// A line of the story, wrapped between words.
fn wrap(theme: Theme, table: &GameView, line: &story::Line, width: usize) -> Vec<Line<'static>> {
    let (lead, words) = match (line.heading, line.seat) {
        (true, _) => (None, format!("─ {}", line.words)),
        (false, Some(seat)) => (Some((table.name(seat), seat)), format!(" {}", line.words)),
        (false, None) => (None, line.words.clone()),
    };
    let style = if line.heading {
        theme.bold()
    } else {
        ratatui::style::Style::new()
    };
    let mut rows = Vec::new();
    let mut used = lead.as_ref().map_or(0, |(name, _)| columns(name));
    let mut spans: Vec<Span<'static>> = lead
        .map(|(name, seat)| Span::styled(name, theme.seat(seat)))
        .into_iter()
        .collect();
    let mut text = String::new();
    for word in words.split_inclusive(' ') {
        if used + columns(word.trim_end()) > width && used > INDENT {
            spans.push(Span::styled(std::mem::take(&mut text), style));
            rows.push(Line::from(std::mem::take(&mut spans)));
            text.push_str(&" ".repeat(INDENT));
            used = INDENT;
        }
        text.push_str(word);
        used += columns(word);
    }
    spans.push(Span::styled(text, style));
    rows.push(Line::from(spans));
    rows
}
