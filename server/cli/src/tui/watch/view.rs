//! Draws `chefshat watch`: the table, the known hands, and the position.

use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::text::{Line, Span};
use ratatui::widgets::Paragraph;

use super::reel::Reel;
use crate::narration::MAX_NAME;
use crate::narration::hand::Hand;
use crate::tui::theme::Theme;
use crate::tui::view::{draw as draw_table, end_lines, padded, popup};

const KEYS: &str = " space stop  ←→ step  ↑↓ speed  s S Shift  PgUp story  h hands  ? keys  q end";

const HELP: [&str; 10] = [
    "space        pause, resume",
    "← →          one event back, one forward",
    "s S          next deal, previous deal",
    "PgUp PgDn    scroll through what happened",
    "Home End     beginning, end (and follow a live game)",
    "↑ ↓          faster, slower",
    "h            show or hide the hands (known once a game is over)",
    "q            quit",
    "",
    "any key returns",
];

/// Draws everything.
pub(super) fn draw(frame: &mut Frame<'_>, theme: Theme, reel: &Reel) {
    let table = &reel.table;
    let seats = u16::try_from(table.seats.len()).unwrap_or(0);
    let hands = if reel.hands {
        seats.saturating_add(2)
    } else {
        0
    };
    // With six hands at the minimum height the key hints are cut; ? shows them too.
    let rows = hands.saturating_add(2);
    let status = match (reel.live, reel.running) {
        (true, _) if reel.at < reel.len() => "● live, behind",
        (true, true) => "● live",
        (_, false) => "‖ stopped",
        (false, true) if reel.at == reel.len() => "■ the end",
        (false, true) => "▶ running",
    };
    let Some(area) = draw_table(frame, theme, table, None, status, &reel.log, rows) else {
        return;
    };
    let [hands, bar, keys] = Layout::vertical([
        Constraint::Length(hands),
        Constraint::Length(1),
        Constraint::Length(1),
    ])
    .areas(area);
    if reel.hands {
        draw_hands(frame, theme, reel, hands);
    }
    draw_bar(frame, theme, reel, bar);
    frame.render_widget(Paragraph::new(KEYS).style(theme.dim()), keys);
    if reel.help {
        let lines = HELP.iter().map(|line| Line::from(*line)).collect();
        popup(frame, theme, "help", lines);
    } else if let (Some(end), true, false) = (&table.end, reel.at == reel.len(), reel.log.is_open())
    {
        let mut lines = end_lines(theme, table, end);
        lines.push(Line::default());
        lines.push(Line::from(format!("game {}", table.game_id)));
        popup(frame, theme, "the game is over", lines);
    }
}

fn draw_hands(frame: &mut Frame<'_>, theme: Theme, reel: &Reel, area: Rect) {
    let table = &reel.table;
    let unknown = match (reel.recorded, &table.end) {
        (true, _) => "not recorded",
        (false, None) => "not shown while the game is played",
        // Its record may have them.
        (false, Some(_)) => "not shown to spectators",
    };
    let lines = (0u32..).zip(&table.seats).map(|(seat, place)| {
        let name = Span::styled(padded(&table.name(seat), MAX_NAME + 1), theme.seat(seat));
        let mut spans = vec![Span::raw(" "), name];
        match &place.hand {
            Some(hand) => spans.extend(cards(theme, table.faces(), hand)),
            None if table.started => spans.push(Span::styled(unknown, theme.dim())),
            None => {}
        }
        Line::from(spans)
    });
    let lines: Vec<Line<'_>> = lines.collect();
    frame.render_widget(Paragraph::new(lines).block(theme.boxed(" hands ")), area);
}

/// A hand in a line: `2 3×5 2×11★ J`.
fn cards(theme: Theme, faces: u32, hand: &Hand) -> Vec<Span<'static>> {
    let stacks = hand.stacks().into_iter();
    stacks
        .map(|stack| {
            let star = if stack.golden { "★" } else { "" };
            let words = match (stack.count, stack.joker) {
                (1, true) => "J".to_owned(),
                (count, true) => format!("{count}J"),
                (1, false) => format!("{}{star}", stack.face),
                (count, false) => format!("{count}×{}{star}", stack.face),
            };
            let style = theme.card(stack.face, faces);
            Span::styled(format!("{words} "), style)
        })
        .collect()
}

fn draw_bar(frame: &mut Frame<'_>, theme: Theme, reel: &Reel, area: Rect) {
    if let Some(why) = &reel.lost {
        let words = format!(" ! no more events: {why}");
        frame.render_widget(Paragraph::new(words).style(theme.warning()), area);
        return;
    }
    if let Some(waiting) = &reel.waiting {
        frame.render_widget(Paragraph::new(format!(" {waiting}")), area);
        return;
    }
    let words = format!(" {}/{} · {}/s ", reel.at, reel.len(), reel.per_second());
    let room = usize::from(area.width).saturating_sub(words.chars().count() + 2);
    let filled = (room * reel.at).checked_div(reel.len()).unwrap_or(0);
    let bar = format!(" {}{}", "━".repeat(filled), "─".repeat(room - filled));
    let line = Line::from(vec![Span::styled(bar, theme.frame()), Span::raw(words)]);
    frame.render_widget(Paragraph::new(line), area);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hand_is_counted_as_plays_are() {
        for (held, golden, expected) in [
            (&[2, 5, 5, 5, 11, 11, 12][..], true, "2 3×5 2×11★ J "),
            (&[11, 12, 12], true, "11★ 2J "),
            (&[11, 4], false, "4 11 "),
            (&[], false, ""),
        ] {
            let spans = cards(Theme::new(false), 11, &Hand::of(11, held, golden));
            assert_eq!(Line::from(spans).to_string(), expected);
        }
    }
}
