//! The game of a room. That of a physical room: the referee, the rulings on reports, and which
//! events of the log stand after corrections.

use std::collections::BTreeMap;
use std::time::Duration;

use chefshat_engine::{
    BySeat, Decision, DecisionKind, Event, Game, Observation, RuleSet, Seat, Viewer,
};
use chefshat_referee::{Corrected, Referee, Ruling, Stage};

use crate::answers::ReportOutcome;
use crate::journal::{Decided, Report, ReportSource, Reported, Source};

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
    /// Each report and the ruling on it, by the id its client chose.
    outcomes: BTreeMap<String, (Reported, ReportOutcome)>,
    /// When and by whom each report was made, by its number.
    made: BTreeMap<u64, Made>,
    /// The events of the game that no correction has voided, in order.
    standing: Vec<StandingEvent>,
    /// Since when the table waits for what it waits for.
    awaited_since: Duration,
    /// Since when it is paused.
    paused_since: Option<Duration>,
    /// When something was reported last; at first, when the game started.
    last_report: Duration,
}

/// How a report was made.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Made {
    /// Time of the report since the room was created.
    pub at: Duration,
    /// Who reported.
    pub source: ReportSource,
    /// The time between the event and the report.
    pub age: Duration,
    /// The measured time of the decision that was reported, microseconds; 0 if it is not known.
    pub time_us: u64,
}

/// An event of the game that stands.
#[derive(Debug, Clone, Copy)]
pub(super) struct StandingEvent {
    /// Its position in the log.
    pub(super) position: usize,
    /// The decision that it states.
    pub(super) taken: Option<Taken>,
}

/// Who or what took a decision, and how long it took.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Taken {
    pub(super) seat: Seat,
    pub(super) kind: DecisionKind,
    pub(super) source: Source,
    pub(super) time_us: u64,
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
            last_report: at,
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

    /// The report with this id, and the ruling on it.
    pub(super) fn outcome(&self, id: &str) -> Option<&(Reported, ReportOutcome)> {
        self.outcomes.get(id)
    }

    /// Number of reports.
    pub(super) fn reports(&self) -> usize {
        self.outcomes.len()
    }

    /// When something was reported last; before the first report, when the game started.
    pub(super) fn last_report(&self) -> Duration {
        self.last_report
    }

    /// Since when the table waits for what it waits for.
    pub(super) fn awaited_since(&self) -> Duration {
        self.awaited_since
    }

    /// Since when the table is paused.
    pub(super) fn paused_since(&self) -> Option<Duration> {
        self.paused_since
    }

    /// Pauses the game, or continues it: then what it waits for counts from now.
    pub(super) fn set_paused(&mut self, at: Duration, paused: bool) {
        self.paused_since = paused.then_some(at);
        if !paused {
            self.awaited_since = at;
        }
    }

    /// Adds events of the game that stand.
    pub(super) fn stand(&mut self, events: impl Iterator<Item = StandingEvent>) {
        self.standing.extend(events);
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
    pub(super) fn report(&mut self, at: Duration, number: u64, reported: &Reported) -> Ruling {
        let stage = self.referee.stage();
        let ruling = self.referee.report(number, &reported.report);
        let happened = at.saturating_sub(reported.age);
        self.last_report = at;
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
        let outcome = ReportOutcome {
            number,
            verdict: ruling.verdict.clone(),
            void_reports: (ruling.corrected.as_ref())
                .map_or_else(Vec::new, |corrected| corrected.void_reports.clone()),
        };
        (self.outcomes).insert(reported.id.clone(), (reported.clone(), outcome));
        ruling
    }

    /// Confirms the end of the game.
    pub(super) fn confirm_end(&mut self, number: u64) -> Ruling {
        self.referee.report(number, &Report::EndConfirmed)
    }

    /// Remembers since when the table waits for something else than before.
    fn note_progress(&mut self, before: Stage, events: &[Event], happened: Duration) {
        if !events.is_empty() || self.referee.stage() != before {
            self.awaited_since = happened;
        }
    }

    /// Voids the last events of the game. Returns the position of the first of them, and the
    /// decisions that they stated.
    pub(super) fn void(&mut self, corrected: &Corrected) -> (Option<usize>, Vec<Taken>) {
        let from = self.standing.len().saturating_sub(corrected.void_events);
        let void = self.standing.split_off(from);
        let first = void.first().map(|event| event.position);
        (first, void.iter().filter_map(|event| event.taken).collect())
    }
}

/// The decision that an event of the game states.
pub(super) fn stated(event: &Event) -> Option<(Seat, DecisionKind)> {
    match *event {
        Event::Played { seat, .. } | Event::Passed { seat, .. } => Some((seat, DecisionKind::Turn)),
        Event::SpecialActionDeclared { seat, .. } => Some((seat, DecisionKind::SpecialAction)),
        _ => None,
    }
}

/// Whole microseconds.
pub(super) fn micros(time: Duration) -> u64 {
    u64::try_from(time.as_micros()).unwrap_or(u64::MAX)
}
