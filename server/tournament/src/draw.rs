//! Drawing a round: when it is time, and by which format. How tables are found is in the modules of the formats; which seats their
//! participants take, but in a round robin, in `seats`.

use super::Tournament;
use super::chance::Chance;
use super::change::Change;
use super::course::State;
use super::settings::Format;
use super::{knockout, round_robin, seats, swiss};

/// Who plays whom in a round.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Drawing {
    /// Participants by table, in the order of their seats.
    pub(super) tables: Vec<Vec<usize>>,
    /// Those who do not play.
    pub(super) byes: Vec<usize>,
}

impl Tournament {
    /// The drawing of the next round, if it is time for it.
    pub(super) fn drawing(&mut self) -> Option<Change> {
        let course = &self.course;
        if course.state != State::Playing || course.drawn >= course.rounds {
            return None;
        }
        let format = course.settings.format;
        if format != Format::RoundRobin && !course.is_round_over() {
            return None;
        }
        let round = course.drawn + 1;
        let drawing = match format {
            Format::RoundRobin => self.planned(round)?,
            Format::Knockout | Format::Swiss => {
                let mut chance = Chance::of_round(course.settings.draw_seed, round);
                let mut drawing = match format {
                    Format::Knockout => knockout::draw(course, &mut chance),
                    _ => swiss::draw(course, &mut chance),
                };
                seats::spread(course, &mut drawing.tables, &mut chance);
                drawing
            }
        };
        Some(Change::Drawn {
            round,
            tables: drawing.tables,
            byes: drawing.byes,
        })
    }

    /// A round of the plan of a round robin, which is made when it is first needed. It depends on nothing but the settings and the number of
    /// participants, so that it comes out the same after a restart.
    fn planned(&mut self, round: u32) -> Option<Drawing> {
        let course = &self.course;
        let plan = self.plan.get_or_insert_with(|| {
            let mut chance = Chance::of_round(course.settings.draw_seed, 0);
            round_robin::plan(
                course.participants.len(),
                course.settings.players,
                course.rounds,
                &mut chance,
            )
        });
        let drawing = plan.get(round as usize - 1).cloned();
        if round == course.rounds {
            self.plan = None;
        }
        drawing
    }
}
