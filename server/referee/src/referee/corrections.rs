//! Corrections: an earlier report was wrong. What came after it is replayed.

use chefshat_engine::{Action, Seat, Viewer};

use super::turns::seat_of;
use super::{Judged, Referee};
use crate::shift::{Act, Entry, Misfit};
use crate::{Corrected, Report, Ruling, Verdict, ViolatedRule};

const NOT_ALIKE: &str = "A report can be replaced only by one of the same kind and seat.";

impl Referee {
    /// Takes a pass back.
    pub(super) fn withdraw_pass(&mut self, seat: Seat, ruling: &mut Ruling) -> Judged {
        let passed =
            |entry: &&Entry| matches!(entry.act, Act::Turn(of, Action::Pass) if of == seat);
        let shift = self.shift();
        let last = shift.entries.iter().rfind(passed);
        // When a pizza is over, all take their pass cards back.
        let still_passed = self.game().observe(Viewer::Spectator).passed[seat]
            || shift.turns().next_back() == Some((seat, Action::Pass));
        match last
            .filter(|_| still_passed)
            .map(|entry| (entry.number, entry.report.is_some()))
        {
            Some((_, false)) => Err((
                Some(seat),
                (
                    ViolatedRule::Decision,
                    format!("{} has decided to pass.", self.names.of(seat)),
                ),
            )),
            Some((number, true)) => self.correct(number, Some(seat), None, ruling),
            None => Ok(Verdict::Known),
        }
    }

    /// Replaces a report, or removes it. `seat`: of the entry, if one report has several.
    pub(super) fn correct(
        &mut self,
        number: u64,
        seat: Option<Seat>,
        instead: Option<&Report>,
        ruling: &mut Ruling,
    ) -> Judged {
        let judged = self.or_undo(|it| it.correct_unless_refused(number, seat, instead, ruling));
        if judged.is_err() {
            ruling.corrected = None;
        }
        judged
    }

    fn correct_unless_refused(
        &mut self,
        number: u64,
        seat: Option<Seat>,
        instead: Option<&Report>,
        ruling: &mut Ruling,
    ) -> Judged {
        let refuse = |text: &str| Err((None, (ViolatedRule::Correction, text.to_owned())));
        // A report that still waits is simply dropped or replaced.
        if let Some(index) = self.held.iter().position(|(held, _)| *held == number) {
            let old = &self.held[index].1;
            match instead {
                Some(instead) if !is_alike(old, instead) => return refuse(NOT_ALIKE),
                Some(instead) => self.held[index].1 = as_seat_of(old, instead),
                None => drop(self.held.remove(index)),
            }
            self.held = self.drop_question();
            self.judge_held(ruling);
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
        let entries = self.shift().entries.clone();
        // Passes that were confirmed with one answer have one number: the seat tells them apart.
        let seat = seat.or_else(|| instead.and_then(seat_of));
        let matches = |entry: &Entry| {
            let report = (entry.report.as_ref()).filter(|_| entry.number == number);
            report.is_some_and(|report| {
                let of = seat_of(report);
                seat.is_none_or(|seat| of.is_none_or(|of| of == seat))
            })
        };
        let Some(index) = entries.iter().position(matches) else {
            return refuse(NOT_ALIKE);
        };
        let old = entries[index].report.clone().expect("it is a report");
        let named = entries[index].named().expect("it is a report");
        // Passes that were inferred from the report fall with it.
        let inferred = |entry: &&Entry| entry.number == number && entry.report.is_none();
        let first = index - entries[..index].iter().rev().take_while(inferred).count();
        if instead.is_some_and(|instead| !is_alike(&old, instead)) {
            return refuse(NOT_ALIKE);
        }
        let waiting = self.drop_question();
        self.set_entries(entries[..first].to_vec())
            .map_err(|misfit| (None, (ViolatedRule::Correction, misfit.text)))?;
        let mut verdict = Verdict::Accepted;
        if let Some(instead) = instead {
            let instead = as_seat_of(&old, instead);
            verdict = self.judge(number, &instead, ruling);
            match &verdict {
                Verdict::Accepted | Verdict::Held { .. } => {}
                Verdict::Violation(violation) => {
                    return Err((violation.seat, (violation.rule, violation.text.clone())));
                }
                Verdict::Known => {
                    return refuse("With this correction it would not be this player's turn.");
                }
            }
        }
        let void_reports = self.replay(&entries[index + 1..]);
        let text = match instead {
            Some(instead) => {
                let instead = as_seat_of(&named, instead);
                format!(
                    "Corrected: {}. (Before: {}.)",
                    self.describe(&instead),
                    self.describe(&named)
                )
            }
            None => format!("Removed: {}.", self.describe(&named)),
        };
        ruling.corrected = Some(Corrected {
            number,
            void_events: 0,
            void_reports,
            text,
        });
        self.violation = None;
        self.held.extend(waiting);
        if self.asked.is_none() {
            self.judge_held(ruling);
        }
        Ok(verdict)
    }

    /// Judges again what came after a corrected report; what no longer fits is void.
    pub(super) fn replay(&mut self, later: &[Entry]) -> Vec<u64> {
        let mut void = Vec::new();
        let shift = self.shifts.len();
        for entry in later {
            let fits = self.shifts.len() == shift
                && match (&entry.report, entry.act) {
                    (Some(report), Act::Turn(..)) if self.asked.is_some() => {
                        self.held.push((entry.number, report.clone()));
                        true
                    }
                    (Some(report), Act::Turn(..)) => self.take_turn(entry.number, report).is_ok(),
                    // A pass that followed from reports is inferred again, if it still follows.
                    (None, Act::Turn(seat, _)) if !self.remote[seat] => true,
                    (None, Act::Turn(..)) if self.asked.is_some() || !void.is_empty() => false,
                    _ => self.add(entry).is_ok(),
                };
            if !fits {
                void.push(entry.number);
            }
        }
        void
    }

    fn add(&mut self, entry: &Entry) -> Result<(), Misfit> {
        let mut entries = self.shift().entries.clone();
        entries.push(Entry {
            pizza: self.game().observe(Viewer::Spectator).pizza,
            ..entry.clone()
        });
        self.set_entries(entries)
    }

    /// Withdraws the referee's question; the reports that waited for its answer.
    fn drop_question(&mut self) -> Vec<(u64, Report)> {
        if let Some(asked) = self.asked.take() {
            self.questions.retain(|question| question.id != asked.id);
        }
        std::mem::take(&mut self.held)
    }

    /// Whether a report of this Shift counts.
    pub(super) fn has(&self, number: u64) -> bool {
        let counts = |entry: &Entry| entry.number == number && entry.report.is_some();
        self.shift().entries.iter().any(counts)
    }
}

/// A report about the seat of another.
fn as_seat_of(old: &Report, new: &Report) -> Report {
    match (seat_of(old), seat_of(new)) {
        (Some(seat), None) => new.with_seat(seat),
        _ => new.clone(),
    }
}

/// Whether a report can replace another: of the same seat, if both name one, and kind. A play can
/// replace a pass.
fn is_alike(old: &Report, new: &Report) -> bool {
    match (old, new) {
        (Report::Laid { .. } | Report::Pass { .. }, Report::Laid { .. } | Report::Pass { .. }) => {
            let (old, new) = (seat_of(old), seat_of(new));
            old.is_none() || new.is_none() || old == new
        }
        (Report::Hand { seat: old, .. }, Report::Hand { seat: new, .. })
        | (Report::Gift { seat: old, .. }, Report::Gift { seat: new, .. }) => old == new,
        (Report::Special { .. }, Report::Special { .. }) => true,
        _ => false,
    }
}
