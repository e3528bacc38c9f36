//! The game of a physical room: the referee, the rulings on reports, and which events of the log
//! stand after corrections.

use std::collections::BTreeMap;
use std::time::Duration;

use chefshat_engine::{
    BySeat, Decision, DecisionKind, Event, Game, Observation, RuleSet, Seat, Viewer,
};
use chefshat_referee::{Corrected, MAX_QUESTIONS, Referee, Report, Ruling, Stage};

use crate::Core;
use crate::answers::{ReportError, ReportOutcome};
use crate::journal::{Change, Decided, Fill, ReportSource, Reported, Source};
use crate::limits::MAX_REPORTS;
use crate::log::{Correction, HandReported, RoomEvent};

/// The game of a room.
#[derive(Debug)]
pub(super) enum RoomGame {
    /// The server deals the cards.
    Dealt(Box<Game>),
    /// The cards are real.
    Physical(Box<PhysicalTable>),
}

impl RoomGame {
    /// The game. Of a physical game only what is public and the known hands are true.
    pub(super) fn game(&self) -> &Game {
        match self {
            Self::Dealt(game) => game,
            Self::Physical(table) => table.referee.game(),
        }
    }

    /// What a viewer may see.
    pub(super) fn observe(&self, viewer: Viewer) -> Observation {
        match self {
            Self::Dealt(game) => game.observe(viewer),
            Self::Physical(table) => table.referee.observe(viewer),
        }
    }

    /// The decision of a participant or built-in agent that the game waits for.
    pub(super) fn decision(&self) -> Option<Decision> {
        match self {
            Self::Dealt(game) => game.decision(),
            Self::Physical(table) => table.referee.decision(),
        }
    }
}

/// A physical table: its referee and what was reported.
#[derive(Debug)]
pub struct PhysicalTable {
    referee: Referee,
    /// The ruling on each report, by the id its client chose.
    outcomes: BTreeMap<String, ReportOutcome>,
    /// When and by whom each report was made, by its number.
    made: BTreeMap<u64, Made>,
    /// The events of the game that no correction has voided, in order.
    standing: Vec<StandingEvent>,
    /// Since when the table waits for what it waits for.
    awaited_since: Duration,
    /// Since when it is paused.
    paused_since: Option<Duration>,
}

/// How a report was made.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Made {
    /// Time of the report since the room was created.
    pub at: Duration,
    /// Who reported.
    pub source: ReportSource,
    /// The time between the happening and the report.
    pub age: Duration,
    /// The measured time of the decision that was reported, microseconds; 0 if it is not known.
    pub time_us: u64,
}

/// An event of the game that stands.
#[derive(Debug, Clone, Copy)]
struct StandingEvent {
    /// Its position in the log.
    position: usize,
    /// The decision that it states.
    taken: Option<Taken>,
}

/// Who or what took a decision, and how long it took.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Taken {
    seat: Seat,
    kind: DecisionKind,
    source: Source,
    time_us: u64,
}

impl PhysicalTable {
    pub(super) fn new(
        rules: RuleSet,
        remote: BySeat<bool>,
        names: Vec<String>,
        at: Duration,
    ) -> Self {
        Self {
            referee: Referee::new(rules, remote, names),
            outcomes: BTreeMap::new(),
            made: BTreeMap::new(),
            standing: Vec::new(),
            awaited_since: at,
            paused_since: None,
        }
    }

    /// The referee.
    pub fn referee(&self) -> &Referee {
        &self.referee
    }

    /// How the report with this number was made.
    pub fn made(&self, number: u64) -> Option<Made> {
        self.made.get(&number).copied()
    }

    /// Since when the table is paused.
    pub(super) fn paused_since(&self) -> Option<Duration> {
        self.paused_since
    }

    pub(super) fn start(&mut self) -> Vec<Event> {
        self.referee.start()
    }

    /// Judges the decision of a remote seat and what waited for it.
    pub(super) fn decide(&mut self, at: Duration, number: u64, decided: &Decided) -> Ruling {
        let stage = self.referee.stage();
        let ruling = self.referee.decide(number, decided.seat, decided.action);
        self.note_progress(stage, &ruling.events, at);
        ruling
    }

    /// Judges a report.
    fn report(&mut self, at: Duration, number: u64, reported: &Reported) -> Ruling {
        let stage = self.referee.stage();
        let ruling = self.referee.report(number, &reported.report);
        let happened = at.saturating_sub(reported.age);
        // If several decisions became known at once, their times are not known.
        let decisions = ruling.events.iter().filter_map(stated).count();
        let is_measured = decisions == 1 && ruling.corrected.is_none();
        let time = happened.saturating_sub(self.awaited_since);
        self.made.insert(
            number,
            Made {
                at,
                source: reported.source,
                age: reported.age,
                time_us: if is_measured { micros(time) } else { 0 },
            },
        );
        self.note_progress(stage, &ruling.events, happened);
        self.outcomes.insert(
            reported.id.clone(),
            ReportOutcome {
                number,
                verdict: ruling.verdict.clone(),
                void_reports: (ruling.corrected.as_ref())
                    .map_or_else(Vec::new, |corrected| corrected.void_reports.clone()),
            },
        );
        ruling
    }

    /// Remembers since when the table waits for something else than before.
    fn note_progress(&mut self, before: Stage, events: &[Event], happened: Duration) {
        if !events.is_empty() || self.referee.stage() != before {
            self.awaited_since = happened;
        }
    }

    /// Voids the last events of the game. Returns the position of the first of them, and the
    /// decisions that they stated.
    fn void(&mut self, corrected: &Corrected) -> (Option<usize>, Vec<Taken>) {
        let from = self.standing.len().saturating_sub(corrected.void_events);
        let void = self.standing.split_off(from);
        let first = void.first().map(|event| event.position);
        (first, void.iter().filter_map(|event| event.taken).collect())
    }
}

/// The decision that an event of the game states.
fn stated(event: &Event) -> Option<(Seat, DecisionKind)> {
    match *event {
        Event::Played { seat, .. } | Event::Passed { seat, .. } => Some((seat, DecisionKind::Turn)),
        Event::SpecialActionDeclared { seat, .. } => Some((seat, DecisionKind::SpecialAction)),
        _ => None,
    }
}

impl Core {
    /// The physical table, once its game has started.
    pub fn table(&self) -> Option<&PhysicalTable> {
        match &self.game {
            Some(RoomGame::Physical(table)) => Some(table),
            _ => None,
        }
    }

    /// Whether the game of a physical table is paused.
    pub fn is_paused(&self) -> bool {
        self.paused_since().is_some()
    }

    /// Since when the game of a physical table is paused.
    pub(super) fn paused_since(&self) -> Option<Duration> {
        self.table().and_then(PhysicalTable::paused_since)
    }

    /// Takes a report from the physical table. A report with a known id changes nothing and gets
    /// the same ruling again.
    ///
    /// # Errors
    /// The report is not accepted. Nothing has changed.
    pub fn report(
        &mut self,
        now: Duration,
        reported: Reported,
    ) -> Result<ReportOutcome, ReportError> {
        let (id, is_question) = (
            reported.id.clone(),
            matches!(reported.report, Report::Question(_)),
        );
        if let Some(outcome) = self.table().and_then(|table| table.outcomes.get(&id)) {
            return Ok(outcome.clone());
        }
        if self.state.is_over() {
            return Err(ReportError::GameOver);
        }
        let table = self.table().ok_or(ReportError::GameNotStarted)?;
        if table.outcomes.len() >= MAX_REPORTS {
            return Err(ReportError::TooMany);
        }
        if is_question && table.referee.questions().len() >= MAX_QUESTIONS {
            return Err(ReportError::TooManyQuestions);
        }
        self.commit(now, Change::Reported(Box::new(reported)));
        let outcome = self.table().and_then(|table| table.outcomes.get(&id));
        let outcome = outcome.expect("the report has just been folded").clone();
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
        let was_paused = table.referee.paused();
        let ruling = table.report(at, number, reported);
        let is_paused = table.referee.paused();
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

    /// Moves what follows from the report or decision `number` to the log. `by`: source and time of a seat's
    /// decision.
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

    fn fold_pause(&mut self, at: Duration, paused: bool) {
        if let Some(RoomGame::Physical(table)) = &mut self.game {
            table.paused_since = paused.then_some(at);
            if !paused {
                table.awaited_since = at;
            }
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
                table.standing.extend(standing);
            }
        }
    }
}

/// Whole microseconds.
pub(super) fn micros(time: Duration) -> u64 {
    u64::try_from(time.as_micros()).unwrap_or(u64::MAX)
}
