//! The tables of a game: who got which place in a Shift and how far everybody is, and the standings at the end.

use chefshat_client::v1;
use chefshat_engine::Stop;

use super::super::numbers::ordinal;
use super::text::{BOLD, DIM, GOLD, PLAIN, Piece, clean, columns, heading, seat_style};
use super::{INDENT, Narrator, name_of};

/// Columns of the bar that shows how far a seat is.
const BAR: u64 = 45;
/// Least width of a column of names.
const MIN_NAME_COLUMN: usize = 12;

impl Narrator {
    /// The end of a Shift: places, points, totals.
    pub(super) fn shift_ended(&mut self, end: &v1::ShiftEnded) -> String {
        let mut out = self.chain.close(&self.names);
        let before = std::mem::replace(&mut self.scores, end.points.clone());
        let mut words = format!("{} pizzas, {} turns", end.pizzas, end.turns);
        if end.adjudicated {
            words.push_str("; stopped at the limit of turns: fewest cards first");
        }
        out.push_str(&format!("\n{INDENT}{}\n", Piece::new(DIM, &words).as_str()));
        let full = self.full(end);
        let column = self.name_column();
        for (place, seat) in (1u32..).zip(&end.order) {
            let score = of(&end.points, *seat);
            let points = of(&end.shift_points, *seat);
            let old = of(&before, *seat).min(score);
            let cells = |points: u64| points.saturating_mul(BAR).saturating_add(full / 2) / full;
            let style = seat_style(*seat);
            let bar = Piece::new(style, &"█".repeat(length(cells(old))))
                .and(style, &"▓".repeat(length(cells(score) - cells(old))))
                .and(DIM, &"░".repeat(length(BAR.saturating_sub(cells(score)))));
            let line = Piece::new(PLAIN, INDENT)
                .and(PLAIN, &ordinal(place))
                .and(PLAIN, "  ")
                .join(&self.name(*seat).padded(column))
                .join(&Piece::new(PLAIN, &format!("+{points}")).right(5))
                .join(&Piece::new(BOLD, &score.to_string()).right(6))
                .and(PLAIN, "  ")
                .join(&bar);
            out.push_str(&format!("{}\n", line.as_str()));
        }
        out
    }

    /// The end of a game: its standings.
    pub(super) fn game_ended(&mut self, end: &v1::GameEnded) -> String {
        let mut out = self.chain.close(&self.names);
        out.push_str(&heading("Standings"));
        let column = self.name_column();
        let tied = |points| {
            end.standings
                .iter()
                .filter(|line| line.points == points)
                .count()
                > 1
        };
        for line in &end.standings {
            let first = line.place == 1;
            let style = seat_style(line.seat);
            let style = if first { style.bold() } else { style };
            let name = Piece::new(style, &name_of(&self.names, line.seat)).padded(column + 2);
            let label = usize::try_from(line.seat)
                .ok()
                .and_then(|seat| self.labels.get(seat))
                .map_or("", String::as_str);
            let points = match line.points {
                1 => "1 point".to_owned(),
                points => format!("{points} points"),
            };
            let row = Piece::new(PLAIN, INDENT)
                .and(PLAIN, &ordinal(line.place))
                .and(PLAIN, "  ")
                .join(&name);
            let points = Piece::new(PLAIN, &points).right(10);
            let mut row = row
                .join(&Piece::new(DIM, &clean(label, 16)).padded(16))
                .join(&points);
            if first {
                let words = if tied(line.points) {
                    "   ★ wins by its place in the last Shift"
                } else {
                    "   ★ wins the game"
                };
                row = row.and(GOLD, words);
            }
            out.push_str(&format!("{}\n", row.as_str()));
        }
        out
    }

    /// Width of a column of names.
    fn name_column(&self) -> usize {
        let widths = self.names.iter().map(|name| columns(name));
        widths.max().unwrap_or(0).max(MIN_NAME_COLUMN)
    }

    /// Points that fill a bar: those that end the game, or the most that anybody has or may get.
    fn full(&self, end: &v1::ShiftEnded) -> u64 {
        let most = end.points.iter().copied().max().unwrap_or(0);
        let goal = self.rules.map_or(0, |rules| match rules.stop() {
            Stop::Points(points) => u64::from(points),
            Stop::Shifts(shifts) => {
                let first = rules.points_slice().first().copied().unwrap_or(0);
                u64::from(shifts) * u64::from(first)
            }
        });
        most.max(goal).max(1)
    }
}

/// Why a game has no result, in words.
pub(crate) fn abort_reason(reason: v1::AbortReason) -> &'static str {
    match reason {
        v1::AbortReason::Unspecified => "the server does not say why",
        v1::AbortReason::Closed => "its room was closed",
        v1::AbortReason::Shutdown => "the server shut down",
        v1::AbortReason::ParticipantsLost => "its participants were lost",
        v1::AbortReason::NeverStarted => "its seats were never filled",
        v1::AbortReason::TooLong => "it grew beyond the server's limit",
    }
}

fn of<T: Copy + Into<u64>>(values: &[T], seat: u32) -> u64 {
    usize::try_from(seat)
        .ok()
        .and_then(|seat| values.get(seat).copied())
        .map_or(0, Into::into)
}

fn length(cells: u64) -> usize {
    usize::try_from(cells.min(BAR)).unwrap_or(0)
}
