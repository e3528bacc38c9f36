//! The game of a record, played again line by line: its decisions are applied, and the events that follow from each must be the next ones.

use std::collections::VecDeque;

use chefshat_engine::{BySeat, Event, Game};
use chefshat_proto::v1::{self, game_event::Kind, record_line::Line};

use super::decision::Asked;
use super::header::{Setup, check};
use super::seats::Seats;
use super::seed::Seeds;
use super::words::{difference, kind_name, must_be};
use super::{Fault, Replayed};
use crate::convert::{By, LAST_MS, event_kind, final_table, with_rewards};
use crate::table::{Table, facts_of_record};

/// How nobody decided: the deal at the beginning.
const NOBODY: By = By {
    source: v1::DecisionSource::Agent,
    decision_time_us: 0,
};

/// A record being replayed.
pub(super) struct Replay<'a> {
    pub(super) header: &'a v1::RecordHeader,
    pub(super) lines: &'a [v1::RecordLine],
    pub(super) setup: Setup,
    pub(super) seats: Seats,
    seeds: Option<Seeds>,
    /// The Shifts of an imported game.
    pub(super) table: Option<Table>,
    pub(super) game: Option<Game>,
    /// Events that must follow, with the rewards they bring.
    expected: VecDeque<(Kind, Vec<v1::SeatReward>)>,
    pub(super) decisions: u64,
    pub(super) events: u64,
    elapsed_ms: u64,
    last_decision_ms: u64,
    pub(super) over: Option<v1::RoomState>,
    pub(super) ended: bool,
}

impl<'a> Replay<'a> {
    pub(super) fn new(
        header: &'a v1::RecordHeader,
        lines: &'a [v1::RecordLine],
    ) -> Result<Self, Fault> {
        let setup = check(header)?;
        Ok(Self {
            seats: Seats::new(header),
            header,
            lines,
            seeds: None,
            table: (setup.origin == v1::GameOrigin::Imported)
                .then(|| Table::new(setup.rules, facts_of_record(&setup.rules, lines))),
            setup,
            game: None,
            expected: VecDeque::new(),
            decisions: 0,
            events: 0,
            elapsed_ms: 0,
            last_decision_ms: 0,
            over: None,
            ended: false,
        })
    }

    pub(super) fn game(&self) -> Option<&Game> {
        self.game.as_ref()
    }

    /// Whose hands are known, and of whom it is known whether it holds the Golden card.
    pub(super) fn known(&self) -> (BySeat<bool>, BySeat<bool>) {
        match (&self.table, &self.game) {
            (Some(table), Some(game)) => (table.hands_known(game), table.golden_known(game)),
            (table, _) => {
                let all = BySeat::filled(self.setup.rules.players(), table.is_none());
                (all, all)
            }
        }
    }

    /// What the record says, if it has come to its end.
    pub(super) fn finish(self) -> Option<Replayed> {
        let state = self.over.filter(|_| self.ended)?;
        let standings = match (state, &self.game) {
            (v1::RoomState::Finished, Some(game)) => game.standings(),
            _ => None,
        };
        Some(Replayed {
            state,
            decisions: self.decisions,
            events: self.events,
            standings: standings.as_ref().map_or_else(Vec::new, final_table),
        })
    }

    /// Takes a line that is neither a header nor a decision.
    pub(super) fn take(&mut self, line: usize, entry: &Line) -> Result<(), Fault> {
        if self.ended {
            return Err("the record goes on after its footer".into());
        }
        match entry {
            Line::Event(event) => self.event(line, event),
            Line::PrivateExpression(private) => {
                self.not_over()?;
                self.time(private.elapsed_ms)?;
                Ok(self.seats.private(private)?)
            }
            Line::Footer(footer) => self.end(footer),
            Line::Header(_) | Line::Decision(_) => unreachable!("taken by the caller"),
        }
    }

    /// Takes a decision.
    pub(super) fn decide(&mut self, line: usize, record: &v1::DecisionRecord) -> Result<(), Fault> {
        if self.ended {
            return Err("the record goes on after its footer".into());
        }
        self.not_over()?;
        self.nothing_missing()?;
        self.time(record.elapsed_ms)?;
        self.fits_table(line)?;
        let (known, _) = self.known();
        let game = self
            .game
            .as_mut()
            .ok_or("a decision, but the game has not begun")?;
        if self.table.as_ref().is_some_and(|table| !table.is_open()) {
            return Err("a decision, but its Shift has not been started".into());
        }
        let open = game
            .decision()
            .ok_or("a decision, but the rules have ended the game")?;
        let taken_over: u64 = self
            .setup
            .taken_over
            .iter()
            .map(|part| part.decisions)
            .sum();
        let clock = self.seats.clock(open.seat);
        let asked = Asked {
            setup: &self.setup,
            game,
            seat: open.seat,
            kind: open.kind,
            clock,
            taken_over: self.decisions < taken_over,
            hand_known: known[open.seat],
            since_last_ms: record.elapsed_ms.saturating_sub(self.last_decision_ms),
        };
        let action = asked.check(record)?;
        clock.decisions += 1;
        clock.bank_ms = record.bank_left_ms;
        let mut events = Vec::new();
        game.apply(action, |event| events.push(event))
            .map_err(|error| error.to_string())?;
        if let Some(table) = &mut self.table {
            table.took_told(open.seat, open.kind);
            table
                .applied(game, &mut events)
                .map_err(|error| error.to_string())?;
        }
        self.decisions += 1;
        if let Some(seeds) = &self.seeds {
            game.reseed(seeds.after(self.decisions));
        }
        self.last_decision_ms = record.elapsed_ms;
        let by = By {
            source: record.source(),
            decision_time_us: record.decision_time_us,
        };
        self.expect(&events, by);
        Ok(())
    }

    fn expect(&mut self, events: &[Event], by: By) {
        let space = self.setup.rules.actions();
        for (event, rewards) in with_rewards(events, &self.setup.rules, self.setup.scheme) {
            let told = match &self.table {
                Some(table) => table.as_told(event.clone()),
                None => event.clone(),
            };
            if let Some(kind) = event_kind(&told, space, by) {
                self.expected.push_back((kind, rewards));
            }
        }
    }

    fn event(&mut self, line: usize, event: &v1::GameEvent) -> Result<(), Fault> {
        self.not_over()?;
        self.fits_table(line)?;
        self.events += 1;
        if event.sequence != self.events {
            return Err(must_be("sequence", event.sequence, self.events).into());
        }
        self.time(event.elapsed_ms)?;
        let kind = event
            .kind
            .as_ref()
            .ok_or("the event does not say what happened")?;
        let of_the_room = match kind {
            Kind::GameStarted(started) => {
                self.begin(started)?;
                true
            }
            Kind::GameEnded(ended) => {
                self.game_ended(ended)?;
                true
            }
            Kind::GameAborted(aborted) => {
                self.game_aborted(aborted)?;
                true
            }
            kind => self.seats.take(kind, self.header)?,
        };
        if of_the_room {
            return match event.rewards.as_slice() {
                [] => Ok(()),
                _ => Err("rewards are there, but this event brings none".into()),
            };
        }
        self.game_event(line, event)
    }

    /// An event of the game itself, which must be the next that follows from the decision before.
    fn game_event(&mut self, line: usize, event: &v1::GameEvent) -> Result<(), Fault> {
        let Some((kind, rewards)) = self.expected.pop_front() else {
            return Err(format!(
                "`{}` follows from no decision: a decision or the end of the game must come here",
                kind_name(event)
            )
            .into());
        };
        let right = v1::GameEvent {
            kind: Some(kind),
            rewards,
            // It happened with the decision before. Events count in fewer bits than decisions.
            elapsed_ms: self.last_decision_ms.min(u32::MAX.into()),
            ..event.clone()
        };
        if *event == right {
            return Ok(());
        }
        let (found, needed) = (kind_name(event), kind_name(&right));
        if found != needed {
            return Err(format!("the event is `{found}` and must be `{needed}`").into());
        }
        let problem = difference(event, &right)
            .unwrap_or_else(|| "a number is not the one that follows".into());
        let first_deal = matches!(&event.kind, Some(Kind::ShiftStarted(_))) && self.decisions == 0;
        match self
            .reveal_line()
            .filter(|_| first_deal && self.setup.script.is_none())
        {
            Some(reveal) if reveal != line => Err(format!(
                "{problem}, as the seed deals that is revealed on line {reveal}"
            )
            .into()),
            _ => Err(problem.into()),
        }
    }

    fn begin(&mut self, started: &v1::GameStarted) -> Result<(), Fault> {
        if self.seats.have_begun() {
            return Err("the game begins a second time".into());
        }
        self.seats.begin(started, self.header, &self.setup.rules)?;
        self.last_decision_ms = self.elapsed_ms;
        if let (Some(table), Some(beginning)) = (&mut self.table, &self.setup.table) {
            let mut events = Vec::new();
            self.game = table
                .begin(beginning, &mut events)
                .map_err(|error| error.to_string())?;
            self.expect(&events, NOBODY);
            return Ok(());
        }
        let own = self.dealing_seed()?;
        let seeds = Seeds {
            taken_over: self.setup.taken_over.clone(),
            own,
        };
        let (rules, seed) = (self.setup.rules, seeds.after(0));
        let mut events = Vec::new();
        let note = |event| events.push(event);
        let mut game = match &self.setup.script {
            None => Game::new(rules, seed, note),
            Some(script) => Game::scripted(rules, seed, script, note)
                .map_err(|error| format!("start.scripted of the header: {error}"))?,
        };
        game.reseed(seeds.after(0));
        self.seeds = Some(seeds);
        self.game = Some(game);
        self.expect(&events, NOBODY);
        Ok(())
    }

    fn time(&mut self, elapsed_ms: u64) -> Result<(), Fault> {
        if elapsed_ms < self.elapsed_ms {
            return Err(format!(
                "elapsedMs is {elapsed_ms}, earlier than the {} of a line before",
                self.elapsed_ms
            )
            .into());
        }
        let since_epoch_ms = self.header.created_at_ms.saturating_add(elapsed_ms);
        if since_epoch_ms > LAST_MS {
            return Err(format!(
                "elapsedMs is {elapsed_ms}, which with the header's createdAtMs is after the year 9999"
            )
            .into());
        }
        self.elapsed_ms = elapsed_ms;
        Ok(())
    }

    /// Whether what a line tells of a real table can be, and is about a Shift that has begun.
    fn fits_table(&self, line: usize) -> Result<(), Fault> {
        match self.table.as_ref().and_then(|table| table.misfit(line)) {
            Some(problem) => Err(problem.into()),
            None => Ok(()),
        }
    }

    fn not_over(&self) -> Result<(), Fault> {
        match self.over {
            Some(_) => Err("the game was over before this line".into()),
            None => Ok(()),
        }
    }

    pub(super) fn nothing_missing(&self) -> Result<(), Fault> {
        match self.expected.front() {
            None => Ok(()),
            Some((kind, _)) => {
                let event = v1::GameEvent {
                    kind: Some(kind.clone()),
                    ..v1::GameEvent::default()
                };
                Err(format!(
                    "`{}` must come here, which follows from the decision before",
                    kind_name(&event)
                )
                .into())
            }
        }
    }
}
