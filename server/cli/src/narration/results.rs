//! The tables of a game: places and points of a Shift with bars of the totals, and the final
//! standings.

use chefshat_client::v1;
use chefshat_engine::Stop;

use super::text::{BOLD, DIM, GOLD, PLAIN, Piece, clean, columns, heading, seat_style};
use super::{INDENT, Narrator};
use crate::numbers::{counted, ordinal};

/// Columns of the bar of points.
const BAR: u64 = 45;
/// Minimum width of a column of names.
const MIN_NAME_COLUMN: usize = 12;

impl Narrator {
    /// Places, points and totals of a Shift.
    pub fn shift_ended(&mut self, end: &v1::ShiftEnded) -> String {
        let mut out = self.chain.close(&self.view);
        let pizzas = counted(end.pizzas.into(), "pizza");
        let mut words = format!("{pizzas}, {}", counted(end.turns.into(), "turn"));
        if end.adjudicated {
            words.push_str("; stopped at the turn limit: fewest cards first");
        }
        out.push_str(&format!("\n{INDENT}{}\n", Piece::new(DIM, &words).as_str()));
        let full = self.full(end);
        let column = self.name_column();
        for (place, seat) in (1u32..).zip(&end.order) {
            let score = of(&end.points, *seat);
            let points = of(&end.shift_points, *seat);
            let old = score.saturating_sub(points);
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

    /// The final standings.
    pub fn game_ended(&mut self, end: &v1::GameEnded) -> String {
        let mut out = self.chain.close(&self.view);
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
            let name = Piece::new(style, &self.view.name(line.seat)).padded(column + 2);
            let label = usize::try_from(line.seat)
                .ok()
                .and_then(|seat| self.labels.get(seat))
                .map_or("", String::as_str);
            let points = counted(line.points, "point");
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
        let widths = self.view.seats.iter().map(|seat| columns(&seat.name));
        widths.max().unwrap_or(0).max(MIN_NAME_COLUMN)
    }

    /// Points of a full bar: the target, or the highest total if that is more.
    fn full(&self, end: &v1::ShiftEnded) -> u64 {
        let most = end.points.iter().copied().max().unwrap_or(0);
        let goal = self.view.rules.map_or(0, |rules| match rules.stop() {
            Stop::Points(points) => u64::from(points),
            Stop::Shifts(shifts) => {
                let first = rules.points_slice().first().copied().unwrap_or(0);
                u64::from(shifts) * u64::from(first)
            }
        });
        most.max(goal).max(1)
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
