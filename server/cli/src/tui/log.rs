//! The log: what happened, in sentences. The newest lines are drawn beside the seats; scrolled
//! back, earlier ones replace seats and pizza.

use std::collections::VecDeque;

use chefshat_client::v1;
use ratatui::Frame;
use ratatui::crossterm::event::KeyCode;
use ratatui::layout::Rect;
use ratatui::text::{Line, Span};
use ratatui::widgets::Paragraph;

use super::theme::Theme;
use crate::narration::columns;
use crate::narration::story;
use crate::narration::view::GameView;

/// Maximum number of lines.
const MAX_LINES: usize = 2000;
/// Lines per key press, for the first and the following ones: less than the smallest window shows.
const FIRST: usize = 5;
const PAGE: usize = 10;
/// Indentation of wrapped lines.
const INDENT: usize = 2;

/// What happened in a game, and how far it is scrolled back.
#[derive(Debug, Default)]
pub(crate) struct Log {
    /// The newest lines, oldest first.
    lines: VecDeque<story::Line>,
    /// Number of lines so far, with those no longer in `lines`.
    count: usize,
    /// Number of the line after the last shown one, of all lines so far; none while the newest are
    /// shown beside the seats.
    end: Option<usize>,
}

impl Log {
    /// Applies an event to the table and adds its lines.
    pub(crate) fn follow(&mut self, table: &mut GameView, event: &v1::GameEvent) {
        self.add(story::advance(table, event));
    }

    /// Adds lines.
    pub(crate) fn add(&mut self, lines: Vec<story::Line>) {
        self.count += lines.len();
        self.lines.extend(lines);
        while self.lines.len() > MAX_LINES {
            self.lines.pop_front();
        }
    }

    /// Number of lines that are no longer in `lines`.
    fn dropped(&self) -> usize {
        self.count - self.lines.len()
    }

    /// Whether earlier lines replace the table.
    pub(crate) fn is_open(&self) -> bool {
        self.end.is_some()
    }

    /// Handles a key; false if it is not for the log. `PgUp` always is, all others only while
    /// earlier lines are shown.
    pub(crate) fn key(&mut self, code: KeyCode) -> bool {
        // At least one page stays visible.
        let first = (self.dropped() + PAGE).min(self.count);
        self.end = match (code, self.end) {
            (KeyCode::PageUp, None) => Some(self.count.saturating_sub(FIRST).max(first)),
            (KeyCode::PageUp, Some(end)) => Some(end.saturating_sub(PAGE).max(first)),
            (KeyCode::Home, Some(_)) => Some(first),
            (KeyCode::PageDown, Some(end)) => Some(end + PAGE).filter(|end| *end < self.count),
            (_, Some(_)) => None,
            (_, None) => return false,
        };
        true
    }
}

/// Draws the newest lines.
pub(super) fn draw(frame: &mut Frame<'_>, theme: Theme, table: &GameView, log: &Log, area: Rect) {
    let lines = last_lines(theme, table, log, log.count, area);
    let block = theme.boxed(" what happened ");
    frame.render_widget(Paragraph::new(lines).block(block), area);
}

/// Draws earlier lines.
pub(super) fn draw_back(
    frame: &mut Frame<'_>,
    theme: Theme,
    table: &GameView,
    log: &Log,
    area: Rect,
) {
    let end = log.end.unwrap_or(log.count).min(log.count);
    let lines = last_lines(theme, table, log, end, area);
    let after = match log.count - end {
        0 => "the newest".to_owned(),
        after => format!("{after} more after these"),
    };
    let block = theme
        .boxed(format!(" what happened · {after} "))
        .title_bottom(" PgUp earlier · PgDn later · any other key: the table ");
    frame.render_widget(Paragraph::new(lines).block(block), area);
}

/// The lines before line number `end` that fit in the area, wrapped.
fn last_lines(
    theme: Theme,
    table: &GameView,
    log: &Log,
    end: usize,
    area: Rect,
) -> Vec<Line<'static>> {
    let rows = usize::from(area.height.saturating_sub(2));
    let width = usize::from(area.width.saturating_sub(2));
    let shown = end.saturating_sub(log.dropped()).min(log.lines.len());
    let mut lines: Vec<Line<'static>> = Vec::new();
    for line in log.lines.range(..shown).rev() {
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

/// A line, wrapped between words.
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
