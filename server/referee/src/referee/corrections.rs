//! Corrections: an earlier report was wrong. What came after it is replayed.

use chefshat_engine::{Seat, Viewer};

use super::turns::{seat_of, with_seat};
use super::{Judged, Referee};
use crate::shift::{Act, Entry};
use crate::{Corrected, Report, Ruling, Verdict, ViolatedRule};

impl Referee {
    /// Takes a pass back.
    pub(super) fn withdraw_pass(&mut self, seat: Seat, ruling: &mut Ruling) -> Judged {
        let passed = |entry: &&Entry| matches!(entry.act, Act::Turn(of, chefshat_engine::Action::Pass) if of == seat);
        let last = self.shift().entries.iter().rfind(passed);
        match last.map(|entry| (entry.number, entry.report.is_some())) {
            Some((_, false)) => Err((
                Some(seat),
                (
                    ViolatedRule::Decision,
                    format!("{} has decided to pass.", self.names.of(seat)),
                ),
            )),
            Some((number, true)) if self.is_correctable(number) => {
                self.correct(number, None, ruling)
            }
            _ => Ok(Verdict::Known),
        }
    }

    /// Replaces a report, or removes it.
    pub(super) fn correct(
        &mut self,
        number: u64,
        instead: Option<&Report>,
        ruling: &mut Ruling,
    ) -> Judged {
        let before = self.clone();
        let judged = self.correct_unless_refused(number, instead, ruling);
        if judged.is_err() {
            *self = before;
            ruling.corrected = None;
        }
        judged
    }

    fn correct_unless_refused(
        &mut self,
        number: u64,
        instead: Option<&Report>,
        ruling: &mut Ruling,
    ) -> Judged {
        let refuse = |text: &str| Err((None, (ViolatedRule::Correction, text.to_owned())));
        // A report that still waits is simply dropped or replaced.
        if let Some(index) = self.held.iter().position(|(held, _)| *held == number) {
            match instead {
                Some(instead) => self.held[index].1 = instead.clone(),
                None => drop(self.held.remove(index)),
            }
            self.reopen(ruling);
            return Ok(Verdict::Accepted);
        }
        if !self.has(number) && self.shift().entries.is_empty() && self.shifts.len() > 1 {
            self.shifts.pop();
            self.played.pop();
        }
        if !self.has(number) {
            return refuse(
                "This report cannot be corrected: it is no report of this Shift that counts.",
            );
        }
        if !self.is_correctable(number) {
            return refuse("This report cannot be corrected any more: its pizza is over.");
        }
        let entries = self.shift().entries.clone();
        let first = entries
            .iter()
            .position(|entry| entry.number == number && entry.report.is_some())
            .expect("it counts");
        let old = entries[first].report.clone().expect("it is a report");
        if instead.is_some_and(|instead| !is_alike(&old, instead)) {
            return refuse("A report can be replaced only by one of the same kind.");
        }
        self.set_entries(entries[..first].to_vec())
            .map_err(|problem| (None, (ViolatedRule::Correction, problem)))?;
        if let Some(instead) = instead {
            let instead = match (seat_of(&old), seat_of(instead)) {
                (Some(seat), None) => with_seat(instead, seat),
                _ => instead.clone(),
            };
            // The question that this would raise is what the correction must answer.
            self.asked = None;
            let held = std::mem::take(&mut self.held);
            match self.judge(number, &instead, ruling) {
                Verdict::Accepted => {}
                Verdict::Violation(violation) => {
                    return Err((violation.seat, (violation.rule, violation.text)));
                }
                Verdict::Known | Verdict::Held { .. } => {
                    return refuse("With this correction it would not be this player's turn.");
                }
            }
            self.held = held;
        }
        let void_reports = self.replay(&entries[first + 1..]);
        let text = match instead {
            Some(instead) => {
                let instead = match seat_of(&old) {
                    Some(seat) => with_seat(instead, seat),
                    None => instead.clone(),
                };
                format!(
                    "Corrected: {}. (Before: {}.)",
                    self.describe(&instead),
                    self.describe(&old)
                )
            }
            None => format!("Removed: {}.", self.describe(&old)),
        };
        ruling.corrected = Some(Corrected {
            number,
            void_events: 0,
            void_reports,
            text,
        });
        self.violation = None;
        self.reopen(ruling);
        Ok(Verdict::Accepted)
    }

    /// Adds what came after a corrected report, as far as it still fits.
    fn replay(&mut self, later: &[Entry]) -> Vec<u64> {
        let mut void = Vec::new();
        let mut turns_fit = true;
        for entry in later {
            let is_turn = matches!(entry.act, Act::Turn(..));
            let mut entries = self.shift().entries.clone();
            let pizza = self.game().observe(Viewer::Spectator).pizza;
            entries.push(Entry {
                pizza,
                ..entry.clone()
            });
            let fits = (turns_fit || !is_turn) && self.set_entries(entries).is_ok();
            if !fits {
                void.push(entry.number);
                turns_fit &= !is_turn;
            }
        }
        void
    }

    /// Withdraws the referee's question and judges again what waited for it.
    fn reopen(&mut self, ruling: &mut Ruling) {
        if let Some(asked) = self.asked.take() {
            self.questions.retain(|question| question.id != asked.id);
        }
        self.judge_held(ruling);
    }

    fn has(&self, number: u64) -> bool {
        let counts = |entry: &Entry| entry.number == number && entry.report.is_some();
        self.shift().entries.iter().any(counts)
    }

    /// Whether a report of this Shift can still be corrected: turns within their pizza, or while
    /// nobody has acted since it ended.
    pub(super) fn is_correctable(&self, number: u64) -> bool {
        let entries = &self.shift().entries;
        let last = entries
            .iter()
            .rfind(|entry| matches!(entry.act, Act::Turn(..)));
        entries.iter().any(|entry| {
            entry.number == number
                && entry.report.is_some()
                && (!matches!(entry.act, Act::Turn(..))
                    || last.is_some_and(|last| last.pizza == entry.pizza))
        })
    }
}

/// Whether a report can replace another: of the same seat and kind. A play can replace a pass.
fn is_alike(old: &Report, new: &Report) -> bool {
    match (old, new) {
        (Report::Laid { .. } | Report::Pass { .. }, Report::Laid { .. } | Report::Pass { .. }) => {
            seat_of(new).is_none() || seat_of(old) == seat_of(new)
        }
        (Report::Hand { seat: old, .. }, Report::Hand { seat: new, .. })
        | (Report::Gift { seat: old, .. }, Report::Gift { seat: new, .. }) => old == new,
        (Report::Special { .. }, Report::Special { .. }) => true,
        _ => false,
    }
}
