//! What somebody noted at a real table of roles, points and places, compared with what the rules say of the Shift that the row is about. It
//! moves nothing in the game, and a transcript need not have it.

use chefshat_engine::{BySeat, Event, Game, Role};

use super::transcript::{Row, Seen};

/// What the rules said of each Shift.
#[derive(Debug, Default)]
pub(super) struct Ruled {
    shifts: Vec<RuledShift>,
}

#[derive(Debug)]
struct RuledShift {
    shift: u32,
    /// After a Food Fight, those that follow from it.
    roles: BySeat<Option<Role>>,
    /// From 1; 0 for a seat that has not finished.
    places: BySeat<u8>,
}

impl Ruled {
    /// Takes the next event of the game, as the engine has it.
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

    /// Compares what a row notes of the game. Rows that tell of anything else are not looked at.
    ///
    /// # Errors
    /// What the rules say instead.
    pub(super) fn check(&self, row: &Row, game: &Game) -> Result<(), String> {
        let ruled = self.shifts.iter().rev().find(|of| of.shift == row.shift);
        let ruled =
            ruled.ok_or_else(|| format!("by the rules Shift {} has not begun", row.shift))?;
        match &row.seen {
            Seen::Role(name) => ruled.check_role(row, name),
            Seen::Points(points) => check_points(row, *points, game.scores()[row.seat]),
            Seen::Finishes(place) => ruled.check_place(row, *place),
            _ => Ok(()),
        }
    }
}

impl RuledShift {
    fn check_role(&self, row: &Row, name: &str) -> Result<(), String> {
        match self.roles[row.seat] {
            Some(role) if role.name() == name => Ok(()),
            Some(role) => Err(format!(
                "seat {} is {} by the rules, not {name}",
                row.seat,
                role.name()
            )),
            None => Err("in the first Shift there are no roles".into()),
        }
    }

    fn check_place(&self, row: &Row, place: u8) -> Result<(), String> {
        match self.places[row.seat] {
            found if found == place => Ok(()),
            0 => Err(format!("seat {} has not finished by the rules", row.seat)),
            found => Err(format!(
                "seat {} has place {found} by the rules, not {place}",
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
            "seat {} has {score} points by the rules, not {points}",
            row.seat
        ))
    }
}
