//! Replays the game of a record line by line: applies each decision and requires exactly the
//! events that follow from it.

use std::collections::VecDeque;

use chefshat_engine::{BySeat, DecisionKind, Event, Game};
use chefshat_proto::v1::{self, game_event::Kind, record_line::Line};
use chefshat_referee::PhysicalGame;

use super::decision::OpenDecision;
use super::difference::{difference, kind_name, must_be};
use super::fault::Fault;
use super::header::{Setup, check};
use super::seats::Seats;
use super::seed::Seeds;
use crate::convert::{
    By, LAST_MS, check_marker, event_kind, final_table, seat_number, with_rewards,
};
use crate::signature::{PublicKey, Signed, TextHash};
use crate::stated::facts_of_record;

/// The cause of the first deal, which follows from no decision.
const NO_DECISION: By = By {
    source: v1::DecisionSource::Agent,
    decision_time_us: 0,
};

/// The result of a verified record.
#[derive(Debug, Clone, PartialEq)]
pub struct Replayed {
    /// Finished or aborted.
    pub state: v1::RoomState,
    /// The number of decisions.
    pub decisions: u64,
    /// The number of events.
    pub events: u64,
    /// The final standings, best first; empty for an aborted game.
    pub standings: Vec<v1::Standing>,
    /// The key that signed it; `None` if it is unsigned, or if the signature is uncheckable.
    pub signed_by: Option<PublicKey>,
    /// The key of a signature that cannot be checked any more (`Signed::Uncheckable`).
    pub uncheckable: Option<PublicKey>,
    /// Whether the record says that parts of it were removed after the game.
    pub redacted: bool,
}

/// A record being replayed.
pub(super) struct Replay<'a> {
    pub(super) header: &'a v1::RecordHeader,
    pub(super) lines: &'a [v1::RecordLine],
    pub(super) setup: Setup,
    pub(super) seats: Seats,
    seeds: Option<Seeds>,
    /// The Shifts of a game with real cards.
    pub(super) physical: Option<PhysicalGame>,
    pub(super) game: Option<Game>,
    /// Events that must follow, with their rewards.
    expected: VecDeque<(Kind, Vec<v1::SeatReward>)>,
    /// A seat that was away or late too often, until it is substituted.
    lost: Option<u32>,
    pub(super) decisions: u64,
    pub(super) events: u64,
    markers: u64,
    elapsed_ms: u64,
    last_decision_ms: u64,
    pub(super) over: Option<v1::RoomState>,
    pub(super) ended: bool,
    /// The hash of the text of the file that it is from.
    pub(super) text: Option<TextHash>,
    pub(super) signed: Signed,
    pub(super) redacted: bool,
}

impl<'a> Replay<'a> {
    pub(super) fn new(
        header: &'a v1::RecordHeader,
        lines: &'a [v1::RecordLine],
        text: Option<TextHash>,
    ) -> Result<Self, Fault> {
        let setup = check(header)?;
        Ok(Self {
            seats: Seats::new(header),
            header,
            lines,
            seeds: None,
            physical: setup
                .physical
                .is_some()
                .then(|| PhysicalGame::new(setup.rules, facts_of_record(&setup.rules, lines))),
            setup,
            game: None,
            expected: VecDeque::new(),
            lost: None,
            decisions: 0,
            events: 0,
            markers: 0,
            elapsed_ms: 0,
            last_decision_ms: 0,
            over: None,
            ended: false,
            text,
            signed: Signed::Not,
            redacted: false,
        })
    }

    pub(super) fn game(&self) -> Option<&Game> {
        self.game.as_ref()
    }

    /// Whether each hand is known, and whether it is known to contain the Golden card or not.
    pub(super) fn known(&self) -> (BySeat<bool>, BySeat<bool>) {
        match (&self.physical, &self.game) {
            (Some(physical), Some(game)) => {
                (physical.hands_known(game), physical.golden_known(game))
            }
            (physical, _) => {
                let all = BySeat::filled(self.setup.rules.players(), physical.is_none());
                (all, all)
            }
        }
    }

    /// The result; `None` before the footer.
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
            signed_by: self.signed.by(),
            uncheckable: match self.signed {
                Signed::Uncheckable(key) => Some(key),
                Signed::Not | Signed::By(_) => None,
            },
            redacted: self.redacted,
        })
    }

    /// Checks a line that is neither a header nor a decision.
    pub(super) fn take(&mut self, line: usize, entry: &Line) -> Result<(), Fault> {
        if self.ended {
            return Err("the record continues after its footer".into());
        }
        match entry {
            Line::Event(event) => self.event(line, event),
            Line::PrivateExpression(private) => {
                self.not_over()?;
                self.time(private.elapsed_ms)?;
                Ok(self.seats.private(private)?)
            }
            Line::Marker(marker) => {
                self.not_over()?;
                self.time(marker.received_ms)?;
                self.markers += 1;
                let checked = check_marker(marker, self.markers);
                checked.map_err(|problem| format!("marker.{problem}").into())
            }
            Line::Footer(footer) => self.end(footer),
            Line::Header(_) | Line::Decision(_) => unreachable!("taken by the caller"),
        }
    }

    /// Checks and applies a decision.
    pub(super) fn decide(&mut self, line: usize, record: &v1::DecisionRecord) -> Result<(), Fault> {
        if self.ended {
            return Err("the record continues after its footer".into());
        }
        self.not_over()?;
        self.check_complete()?;
        if let Some(seat) = self.lost {
            return Err(must_be_substituted(seat));
        }
        self.time(record.elapsed_ms)?;
        self.check_facts(line)?;
        let (known, _) = self.known();
        let game = self
            .game
            .as_mut()
            .ok_or("a decision, but the game has not started")?;
        if self
            .physical
            .as_ref()
            .is_some_and(|physical| !physical.is_open())
        {
            return Err("a decision, but its Shift has not started".into());
        }
        let open = game
            .decision()
            .ok_or("a decision, but by the rules the game is over")?;
        let taken_over: u64 = self
            .setup
            .taken_over
            .iter()
            .map(|part| part.decisions)
            .sum();
        let longest_decision_ms = self.seats.longest_decision_ms();
        // A study that hides the other seats gives each the time of its participant.
        let shortest_special_ms = match (&self.header.study, self.setup.special_actions_have_phase)
        {
            (_, true) => 0,
            (Some(_), false) => self.seats.shortest_decision_ms(),
            (None, false) => self.seats.clock(open.seat).decision_time_ms,
        };
        let clock = self.seats.clock(open.seat);
        let open_decision = OpenDecision {
            setup: &self.setup,
            game,
            seat: open.seat,
            kind: open.kind,
            clock,
            taken_over: self.decisions < taken_over,
            hand_known: known[open.seat],
            since_last_ms: record.elapsed_ms.saturating_sub(self.last_decision_ms),
            longest_decision_ms,
            shortest_special_ms,
        };
        let action = open_decision.check(record)?;
        clock.count(open.kind, record);
        // A seat that was away or late too often is substituted at once. In a physical room a
        // correction may have voided some of its timeouts.
        let limit = self
            .header
            .policy
            .as_ref()
            .map(v1::RoomPolicy::max_timeouts);
        let is_late = matches!(
            record.source(),
            v1::DecisionSource::Timeout | v1::DecisionSource::Disconnected
        );
        if is_late
            && open.kind != DecisionKind::SpecialAction
            && self.physical.is_none()
            && (clock.absent || limit.is_some_and(|limit| clock.timeouts >= limit))
        {
            self.lost = Some(seat_number(open.seat));
        }
        let mut events = Vec::new();
        game.apply(action, |event| events.push(event))
            .map_err(|error| error.to_string())?;
        if let Some(physical) = &mut self.physical {
            physical.count_decision(open.seat, open.kind);
            physical
                .advance(game, &mut events)
                .map_err(|error| error.to_string())?;
        }
        self.decisions += 1;
        if let Some(seeds) = &self.seeds {
            game.reseed(seeds.after(self.decisions));
        }
        self.last_decision_ms = record.elapsed_ms;
        self.seats.decided(record.elapsed_ms);
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
            let event = match &self.physical {
                Some(physical) => physical.redact(event.clone()),
                None => event.clone(),
            };
            if let Some(kind) = event_kind(&event, space, by) {
                self.expected.push_back((kind, rewards));
            }
        }
    }

    fn event(&mut self, line: usize, event: &v1::GameEvent) -> Result<(), Fault> {
        self.not_over()?;
        self.check_facts(line)?;
        self.events += 1;
        if event.sequence != self.events {
            return Err(must_be("sequence", event.sequence, self.events).into());
        }
        self.time(event.elapsed_ms)?;
        let kind = event.kind.as_ref().ok_or("the event is empty")?;
        if self.expected.is_empty()
            && let Some(seat) = self.lost.take()
        {
            match kind {
                Kind::Substituted(substituted) if substituted.seat == seat => {}
                Kind::GameAborted(_) | Kind::GameEnded(_) => {}
                _ => return Err(must_be_substituted(seat)),
            }
        }
        let is_room_event = match kind {
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
            kind => self.seats.take(kind, event.elapsed_ms, self.header)?,
        };
        if is_room_event {
            return match event.rewards.as_slice() {
                [] => Ok(()),
                _ => Err("rewards are present, but this event has none".into()),
            };
        }
        self.game_event(line, event)
    }

    /// Checks an event of the game against the next one that follows from the last decision.
    fn game_event(&mut self, line: usize, event: &v1::GameEvent) -> Result<(), Fault> {
        let Some((kind, rewards)) = self.expected.pop_front() else {
            return Err(format!(
                "`{}` follows from no decision; a decision or the end of the game must come here",
                kind_name(event)
            )
            .into());
        };
        let expected = v1::GameEvent {
            kind: Some(kind),
            rewards,
            // The time of the last decision, in the narrower type of events.
            elapsed_ms: self.last_decision_ms.min(u32::MAX.into()),
            ..event.clone()
        };
        if *event == expected {
            return Ok(());
        }
        let (found, needed) = (kind_name(event), kind_name(&expected));
        if found != needed {
            return Err(format!("the event is `{found}` and must be `{needed}`").into());
        }
        let problem = difference(event, &expected).unwrap_or_else(|| "a number is wrong".into());
        let first_deal = matches!(&event.kind, Some(Kind::ShiftStarted(_))) && self.decisions == 0;
        match self
            .reveal_line()
            .filter(|_| first_deal && self.setup.script.is_none())
        {
            Some(reveal) if reveal != line => {
                Err(format!("{problem}, by the seed revealed on line {reveal}").into())
            }
            _ => Err(problem.into()),
        }
    }

    fn begin(&mut self, started: &v1::GameStarted) -> Result<(), Fault> {
        if self.seats.has_started() {
            return Err("the game starts a second time".into());
        }
        self.seats.begin(started, self.header, &self.setup.rules)?;
        self.last_decision_ms = self.elapsed_ms;
        if let (Some(physical), Some(start)) = (&mut self.physical, &self.setup.physical) {
            let mut events = Vec::new();
            self.game = physical
                .start(start, &mut events)
                .map_err(|error| error.to_string())?;
            self.expect(&events, NO_DECISION);
            return Ok(());
        }
        let own = self.dealing_seed()?;
        let seeds = Seeds {
            taken_over: self.setup.taken_over.clone(),
            own,
        };
        let (rules, seed) = (self.setup.rules, seeds.after(0));
        let mut events = Vec::new();
        let push = |event| events.push(event);
        let mut game = match &self.setup.script {
            None => Game::new(rules, seed, push),
            Some(script) => Game::scripted(rules, seed, script, push)
                .map_err(|error| format!("start.scripted of the header: {error}"))?,
        };
        game.reseed(seeds.after(0));
        self.seeds = Some(seeds);
        self.game = Some(game);
        self.expect(&events, NO_DECISION);
        Ok(())
    }

    fn time(&mut self, elapsed_ms: u64) -> Result<(), Fault> {
        if elapsed_ms < self.elapsed_ms {
            return Err(format!(
                "elapsedMs is {elapsed_ms}, but an earlier line has {}",
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

    /// Checks a line of a game with real cards against the facts before it.
    fn check_facts(&self, line: usize) -> Result<(), Fault> {
        match self
            .physical
            .as_ref()
            .and_then(|physical| physical.contradiction(line))
        {
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

    pub(super) fn check_complete(&self) -> Result<(), Fault> {
        match self.expected.front() {
            None => Ok(()),
            Some((kind, _)) => {
                let event = v1::GameEvent {
                    kind: Some(kind.clone()),
                    ..v1::GameEvent::default()
                };
                Err(format!(
                    "`{}` must come here: it follows from the last decision",
                    kind_name(&event)
                )
                .into())
            }
        }
    }
}

fn must_be_substituted(seat: u32) -> Fault {
    format!(
        "`substituted` must come here: seat {seat} was away, or has reached the limit of timeouts"
    )
    .into()
}
