//! Physical rooms: reports about the table, the rulings on them, and what follows in the log.

use std::time::Duration;

use chefshat_engine::{BySeat, Event, Seat};
use chefshat_referee::{Ruling, Stage};

use crate::answers::{ReportError, ReportOutcome};
use crate::journal::{Change, Fill, Reported, Source};
use crate::log::{Correction, HandReported, RoomEvent};
use crate::table::{PhysicalTable, RoomGame, StandingEvent, Taken, stated};
use crate::{Core, State};

impl Core {
    /// The physical table, once its game has started.
    pub fn table(&self) -> Option<&PhysicalTable> {
        match &self.game {
            Some(RoomGame::Physical(table)) => Some(table),
            _ => None,
        }
    }

    /// Whether the game of a physical table is over unless the play that ended it is corrected.
    pub(super) fn awaits_confirmation(&self) -> bool {
        self.state == State::Playing
            && (self.table()).is_some_and(|table| table.referee().stage() == Stage::Confirmation)
    }

    /// Whether the game of a physical table is paused.
    pub fn is_paused(&self) -> bool {
        self.paused_since().is_some()
    }

    /// Since when the game of a physical table is paused.
    pub(super) fn paused_since(&self) -> Option<Duration> {
        self.table().and_then(PhysicalTable::paused_since)
    }

    /// Takes a report from the physical table. A repeated report, which has a known id, changes
    /// nothing and gets the same ruling again.
    ///
    /// # Errors
    /// The report is not accepted. Nothing has changed.
    pub fn report(
        &mut self,
        now: Duration,
        reported: Reported,
    ) -> Result<ReportOutcome, ReportError> {
        let id = reported.id.clone();
        if let Some((first, outcome)) = self.table().and_then(|table| table.outcome(&id)) {
            return match first.is_repeated_by(&reported) {
                true => Ok(outcome.clone()),
                false => Err(ReportError::IdUsed),
            };
        }
        if self.state.is_over() {
            return Err(ReportError::GameOver);
        }
        let table = self.table().ok_or(ReportError::GameNotStarted)?;
        table.referee().check(&reported.report)?;
        self.commit(now, Change::Reported(Box::new(reported)));
        let outcome = self.table().and_then(|table| table.outcome(&id));
        let (_, outcome) = outcome.expect("the report has just been folded");
        let outcome = outcome.clone();
        self.advance(now);
        Ok(outcome)
    }

    /// Starts the game of a physical table.
    pub(super) fn begin_physical(&mut self, at: Duration) {
        let remote = BySeat::from_fn(self.seats.len(), |seat| {
            !matches!(self.seats[seat.index()].fill, Fill::AtTable(_))
        });
        let names = self.all_seats().map(|seat| self.name_of(seat)).collect();
        let mut table = PhysicalTable::new(self.header.rules, remote, names, at);
        let events = table.start();
        self.game = Some(RoomGame::Physical(Box::new(table)));
        self.log_physical(at, events, Vec::new(), |_| (Source::Table, 0));
    }

    /// Applies a report to the game and the log.
    pub(super) fn fold_report(&mut self, at: Duration, reported: &Reported) {
        let number = self.changes;
        let Some(RoomGame::Physical(table)) = &mut self.game else {
            return;
        };
        let was_paused = table.referee().paused();
        let ruling = table.report(at, number, reported);
        let is_paused = table.referee().paused();
        let time_us = table.made(number).map_or(0, |made| made.time_us);
        let changes_game = ruling.corrected.is_some() || !ruling.events.is_empty();
        self.fold_ruling(at, number, ruling, |_| (Source::Table, time_us));
        if is_paused != was_paused {
            self.fold_pause(at, is_paused);
        }
        if changes_game {
            self.note_decision();
        }
        // A decision stays open unless the game before it has changed.
        let awaited = self.game.as_ref().and_then(RoomGame::decision);
        let open = self.open.as_ref().map(|open| open.decision);
        if changes_game || awaited != open {
            self.open_next(at);
        }
    }

    /// Moves what follows from the report or decision `number` to the log. `by`: source and time of
    /// a seat's decision.
    pub(super) fn fold_ruling(
        &mut self,
        at: Duration,
        number: u64,
        ruling: Ruling,
        by: impl Fn(Seat) -> (Source, u64),
    ) {
        let mut void = Vec::new();
        let report = (ruling.corrected.as_ref()).map_or(number, |corrected| corrected.number);
        if let (Some(corrected), Some(RoomGame::Physical(table))) =
            (ruling.corrected, &mut self.game)
        {
            let first;
            (first, void) = table.void(&corrected);
            let first = first.and_then(|position| u64::try_from(position + 1).ok());
            let correction = Correction {
                report,
                void_reports: corrected.void_reports,
                first_void: first.unwrap_or(0),
                text: corrected.text,
            };
            self.log
                .push(at, RoomEvent::Correction(Box::new(correction)));
        }
        if let Some((seat, cards, dealt)) = ruling.hand {
            let hand = HandReported {
                report,
                seat,
                cards,
                dealt,
            };
            self.log.push(at, RoomEvent::HandReported(Box::new(hand)));
        }
        self.log_physical(at, ruling.events, void, by);
        for violation in ruling.violations {
            self.log.push(at, RoomEvent::Violation(Box::new(violation)));
        }
    }

    /// Ends the game, since nobody corrected the play that ended it.
    pub(super) fn fold_confirmation(&mut self, at: Duration) {
        let number = self.changes;
        if let Some(RoomGame::Physical(table)) = &mut self.game {
            let ruling = table.confirm_end(number);
            self.fold_ruling(at, number, ruling, |_| (Source::Table, 0));
        }
    }

    fn fold_pause(&mut self, at: Duration, paused: bool) {
        if let Some(RoomGame::Physical(table)) = &mut self.game {
            table.set_paused(at, paused);
        }
        if let Some(open) = self.open.as_mut().filter(|_| !paused) {
            open.reopen(at);
        }
        self.log.push(at, RoomEvent::Paused(paused));
    }

    /// Moves events of a physical game to the log. Decisions that were void and are stated again
    /// keep their source and time.
    fn log_physical(
        &mut self,
        at: Duration,
        events: Vec<Event>,
        mut void: Vec<Taken>,
        by: impl Fn(Seat) -> (Source, u64),
    ) {
        let mut events = events.into_iter().peekable();
        while let Some(first) = events.next() {
            let taken = stated(&first).map(|(seat, kind)| {
                let again = |it: &Taken| it.seat == seat && it.kind == kind;
                match void.iter().position(again) {
                    Some(index) => void.remove(index),
                    None => {
                        let (source, time_us) = by(seat);
                        Taken {
                            seat,
                            kind,
                            source,
                            time_us,
                        }
                    }
                }
            });
            // Up to the next decision, so that rewards are those of one action.
            self.events.push(first);
            while let Some(next) = events.next_if(|event| stated(event).is_none()) {
                self.events.push(next);
            }
            let from = self.log.len();
            let (source, time_us) =
                taken.map_or((Source::Table, 0), |taken| (taken.source, taken.time_us));
            self.log_events(at, source, time_us);
            let standing = (from..self.log.len()).map(|position| StandingEvent {
                position,
                taken: taken.filter(|_| position == from),
            });
            if let Some(RoomGame::Physical(table)) = &mut self.game {
                table.stand(standing);
            }
        }
    }
}
