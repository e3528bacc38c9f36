//! Pairs the next round when it is due. The tables come from the module of the format; except in a
//! round robin, `seats` assigns the seats.

use super::Tournament;
use super::chance::Chance;
use super::change::Change;
use super::settings::Format;
use super::state::Pairings;
use super::{knockout, round_robin, seats, swiss};

impl Tournament {
    /// Pairs the next round, if it is due.
    pub(super) fn pairings(&mut self) -> Option<Change> {
        let state = &self.state;
        if !state.is_draw_due() {
            return None;
        }
        let format = state.settings.format;
        let round = state.drawn + 1;
        let pairings = match format {
            Format::RoundRobin => self.planned(round)?,
            Format::Knockout | Format::Swiss => {
                let mut chance = Chance::of_round(state.settings.draw_seed, round);
                let mut pairings = match format {
                    Format::Knockout => knockout::draw(state, &mut chance),
                    _ => swiss::draw(state, &mut chance),
                };
                seats::spread_round(state, &mut pairings.tables, &mut chance);
                pairings
            }
        };
        Some(Change::Drawn {
            round,
            tables: pairings.tables,
            byes: pairings.byes,
        })
    }

    /// A round of a round robin's plan, which is computed when first needed. The plan depends on
    /// the settings and the field only, so a restart reproduces it.
    fn planned(&mut self, round: u32) -> Option<Pairings> {
        let state = &self.state;
        let plan = self.plan.get_or_insert_with(|| {
            let mut chance = Chance::of_round(state.settings.draw_seed, 0);
            let mut plan = round_robin::plan(
                state.field.len(),
                state.settings.players,
                state.rounds,
                &mut chance,
            );
            for pairings in &mut plan {
                let numbers = pairings.tables.iter_mut().flatten();
                (numbers.chain(&mut pairings.byes)).for_each(|who| *who = state.field[*who]);
            }
            plan
        });
        let pairings = plan.get(round as usize - 1).cloned();
        if round == state.rounds {
            self.plan = None;
        }
        pairings
    }
}
