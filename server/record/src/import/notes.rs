//! Checks of the optional rows `role`, `points` and `finishes` against the rules.

use chefshat_engine::{BySeat, Event, Game, Role};

use super::transcript::{Entry, Row};

/// The results of each Shift by the rules.
#[derive(Debug, Default)]
pub(super) struct RuledShifts {
    shifts: Vec<RuledShift>,
}

#[derive(Debug)]
struct RuledShift {
    shift: u32,
    /// After a Food Fight, the reversed roles.
    roles: BySeat<Option<Role>>,
    /// From 1; 0 for a seat that has not finished.
    places: BySeat<u8>,
}

impl RuledShifts {
    /// Records an event of the engine.
    pub(super) fn note(&mut self, event: &Event) {
        if let Event::ShiftStarted { shift, ref hands } = *event {
            self.shifts.push(RuledShift {
                shift,
                roles: BySeat::filled(hands.len(), None),
                places: BySeat::filled(hands.len(), 0),
            });
        }
        let Some(last) = self.shifts.last_mut() else {
            return;
        };
        match *event {
            Event::RolesAssigned { roles } => last.roles = roles,
            Event::SeatFinished { seat, place } => last.places[seat] = place,
            Event::ShiftEnded(ref end) => {
                for (place, seat) in (1..).zip(end.order.as_slice()) {
                    last.places[*seat] = place;
                }
            }
            _ => {}
        }
    }

    /// Checks a row against the rules. Other kinds of rows pass.
    ///
    /// # Errors
    /// What the rules say instead.
    pub(super) fn check(&self, row: &Row, game: &Game) -> Result<(), String> {
        let ruled = self.shifts.iter().rev().find(|of| of.shift == row.shift);
        let ruled =
            ruled.ok_or_else(|| format!("by the rules, Shift {} has not begun", row.shift))?;
        match &row.entry {
            Entry::Role(name) => ruled.check_role(row, name),
            Entry::Points(points) => check_points(row, *points, game.scores()[row.seat]),
            Entry::Finishes(place) => ruled.check_place(row, *place),
            _ => Ok(()),
        }
    }
}

impl RuledShift {
    fn check_role(&self, row: &Row, name: &str) -> Result<(), String> {
        match self.roles[row.seat] {
            Some(role) if role.name() == name => Ok(()),
            Some(role) => Err(format!(
                "by the rules, seat {} is {}, not {name}",
                row.seat,
                role.name()
            )),
            None => Err("the first Shift has no roles".into()),
        }
    }

    fn check_place(&self, row: &Row, place: u8) -> Result<(), String> {
        match self.places[row.seat] {
            found if found == place => Ok(()),
            0 => Err(format!("by the rules, seat {} has not finished", row.seat)),
            found => Err(format!(
                "by the rules, seat {} has place {found}, not {place}",
                row.seat
            )),
        }
    }
}

fn check_points(row: &Row, points: u64, score: u64) -> Result<(), String> {
    if score == points {
        Ok(())
    } else {
        Err(format!(
            "by the rules, seat {} has {score} points, not {points}",
            row.seat
        ))
    }
}
