//! From joining to leaving: seats, streams, the end of the game and of the process, and time
//! limits.

use std::collections::BTreeSet;
use std::process::ExitStatus;
use std::time::Duration;

use chefshat_proto::v1;
use tonic::{Code, Status};

use super::seats::{DecisionState, RequestedAttach, SeatKey, StreamSeen};
use super::{Exam, Phase, StreamId, Venue};
use crate::fault::Fault;

const AFTER_RESTART: &str =
    "a new stream, and an attachment with the same ticket, after the server was restarted";

impl Exam {
    /// The agent requested a seat with this join code, with this result.
    pub fn joined(
        &mut self,
        code: &str,
        answer: Result<&v1::JoinRoomResponse, &Status>,
        now: Duration,
    ) {
        if self.is_done() {
            return;
        }
        let Venue::Room { join_code, .. } = &self.venue else {
            return;
        };
        if !code.eq_ignore_ascii_case(join_code) {
            if let (Err(status), Phase::Starting) = (answer, self.phase) {
                let got = format!("join code {code:?}: {}", status.message());
                self.fatal(Fault::JoinRefused, "exactly the given join code", got);
            }
            return;
        }
        if self.phase != Phase::Starting {
            return self.fatal(
                Fault::JoinedAgain,
                "the ticket of the seat it has",
                "a second request for a seat with the same join code",
            );
        }
        match answer {
            Ok(_) => {
                self.phase = Phase::Joined;
                self.demand(
                    Fault::NeverAttached,
                    "an attachment with the ticket it received",
                    Some(now + self.patience.each),
                );
            }
            Err(status) => {
                let got = status.message().to_owned();
                self.fatal(Fault::JoinRefused, "a request that the server accepts", got);
            }
        }
    }

    /// The agent's process could not be started.
    pub fn not_started(&mut self, why: &str) {
        self.fatal(Fault::CommandFailed, "a program that starts", why);
    }

    /// The agent opened a Play stream.
    pub fn opened(&mut self) -> StreamId {
        self.streams.push(StreamSeen::default());
        self.streams.len() - 1
    }

    /// The agent uses calls that are not examined.
    pub fn unexamined(&mut self, call: &str) {
        if !self.is_done() {
            let got = format!("a call of PlayService.{call}");
            self.fatal(Fault::NoPlayStream, "a stream of PlayService.Play", got);
        }
    }

    pub(super) fn attaching(&mut self, stream: StreamId, attach: &v1::Attach) {
        if let Some(key) = self.tickets.get(&attach.ticket) {
            let next = self.seats.get(key).map_or(1, |seen| seen.last_event + 1);
            if attach.from_sequence > next && !attach.snapshot {
                let from = attach.from_sequence;
                self.fault(
                    Fault::EventsSkipped,
                    format!("events requested from {next} on, or from the beginning"),
                    format!("events requested from {from} on"),
                );
            }
        }
        let seen = &mut self.streams[stream];
        let requested = RequestedAttach {
            ticket: attach.ticket.clone(),
            no_mask: attach.no_mask,
        };
        seen.requested.insert(seen.attachments, requested);
        seen.attachments += 1;
    }

    pub(super) fn attached(&mut self, stream: StreamId, handle: u32, attached: &v1::Attached) {
        let key = SeatKey {
            room_id: attached.room_id.clone(),
            seat: attached.seat,
        };
        let requested = self.streams[stream].requested.remove(&handle);
        self.streams[stream].bound.insert(handle, key.clone());
        let seen = self.seats.entry(key.clone()).or_default();
        seen.live_from = attached.next_sequence;
        seen.own = match &self.venue {
            Venue::Room { room_id, .. } => *room_id == attached.room_id,
            Venue::Tournament { tournament_id } => *tournament_id == attached.tournament_id,
        };
        let own = seen.own;
        seen.no_mask = requested
            .as_ref()
            .is_some_and(|requested| requested.no_mask);
        let newest = seen.newest();
        if let Some(decision) = seen.decisions.get_mut(&newest)
            && decision.state == DecisionState::Answered
        {
            // The agent cannot know whether its answer arrived: it may send it again.
            decision.state = DecisionState::Open;
            decision.tampered = true;
        }
        if let Some(requested) = requested {
            self.tickets.insert(requested.ticket, key.clone());
        }
        if own {
            let attached = self.streams.iter().flat_map(|stream| stream.bound.values());
            self.together = self.together.max(attached.count());
            if self.phase == Phase::Joined {
                self.phase = Phase::Playing;
            }
            for answered in [
                Fault::NeverAttached,
                Fault::DidNotReconnect,
                Fault::LeftEarly,
                Fault::NeverResumed,
            ] {
                self.fulfil(answered);
            }
        }
    }

    pub(super) fn refused(&mut self, stream: StreamId, handle: u32, refused: &v1::Refused) {
        let got = format!("{} ({})", refused.message, refused.reason);
        if self.streams[stream].requested.remove(&handle).is_some() {
            self.fatal(Fault::AttachRefused, "a valid attachment", got);
        } else if refused.reason != "HANDLE_UNKNOWN" {
            self.fault(Fault::CommandRefused, "valid commands", got);
        }
    }

    pub(super) fn detached(
        &mut self,
        stream: StreamId,
        handle: u32,
        reason: v1::DetachReason,
        now: Duration,
    ) {
        let seen = &mut self.streams[stream];
        seen.ended.insert(handle);
        let key = seen.bound.remove(&handle);
        if reason == v1::DetachReason::TournamentOver {
            return self.tournament_over(now);
        }
        let Some(key) = key.filter(|_| reason == v1::DetachReason::GameOver) else {
            return;
        };
        self.settle_before(&key, u64::MAX);
        let seen = self.seats.entry(key.clone()).or_default();
        seen.over = true;
        let (own, met) = (seen.own, seen.kinds.clone());
        if own && matches!(self.venue, Venue::Room { .. }) {
            self.check_losses(&key);
            self.game_over(&met, now);
        }
    }

    /// The agent is attached as a participant of the tournament.
    pub(super) fn entered(&mut self, stream: StreamId, handle: u32, entered: &v1::Entered) {
        self.streams[stream].requested.remove(&handle);
        let Venue::Tournament { tournament_id } = &self.venue else {
            return;
        };
        if *tournament_id == entered.tournament_id {
            if self.phase == Phase::Starting {
                self.phase = Phase::Playing;
            }
            for answered in [Fault::NeverJoined, Fault::LeftEarly] {
                self.fulfil(answered);
            }
        }
    }

    /// The agent has received the end of the tournament.
    fn tournament_over(&mut self, now: Duration) {
        let together = self.together;
        if together < 2 && !self.is_done() {
            self.fault(
                Fault::OneAtATime,
                "several games at a time",
                format!("never more than {together}"),
            );
        }
        let met: BTreeSet<i32> = (self.seats.values())
            .flat_map(|seen| seen.kinds.iter().copied())
            .collect();
        self.game_over(&met, now);
    }

    /// The agent has received the end of its game.
    fn game_over(&mut self, met: &BTreeSet<i32>, now: Duration) {
        if self.is_done() {
            return;
        }
        let asked_since = (self.seats.values()).any(|seen| seen.newest() > seen.read_after);
        if let Some(demand) = self.demand.take()
            && (demand.fault == Fault::NeverResumed
                || demand.fault == Fault::StoppedAfterClosed && asked_since)
        {
            self.fault(
                demand.fault,
                demand.expected,
                "none before the game was over",
            );
        }
        let missed = (self.case.kinds.iter()).find(|kind| !met.contains(&i32::from(**kind)));
        if let Some(kind) = missed {
            let got = format!("none ({})", kind.as_str_name());
            self.fault(
                Fault::NotExamined,
                "decisions of every kind of the case",
                got,
            );
        }
        if !self.plan.is_empty() && self.findings.is_empty() {
            self.fault(
                Fault::NotExamined,
                "a game that is long enough for the case",
                "the game ended before the examiner could interfere",
            );
        }
        self.phase = Phase::Over;
        self.demand(
            Fault::NeverLeft,
            match self.venue {
                Venue::Room { .. } => "the end of the stream after Detached (GAME_OVER)",
                Venue::Tournament { .. } => {
                    "the end of the stream after Detached (TOURNAMENT_OVER)"
                }
            },
            Some(now + self.patience.each),
        );
    }

    /// The examiner cuts a stream.
    pub(super) fn cut(&mut self, stream: StreamId, now: Duration) {
        self.streams[stream].cut = true;
        self.demand(
            Fault::DidNotReconnect,
            "a new stream, and an attachment with the same ticket, after the connection was lost",
            Some(now + self.patience.each),
        );
    }

    /// The examiner closes the port, with all streams, and restarts the server.
    pub(super) fn restart(&mut self) {
        self.streams.iter_mut().for_each(|stream| stream.cut = true);
        self.restart_due = true;
        self.demand(Fault::DidNotReconnect, AFTER_RESTART, None);
    }

    /// Whether the server must be restarted now; says so once.
    pub fn takes_restart(&mut self) -> bool {
        std::mem::take(&mut self.restart_due)
    }

    /// The server was restarted, and its port is open.
    pub fn restarted(&mut self, now: Duration) {
        let by = now + self.patience.each;
        if let Some(demand) = &mut self.demand {
            demand.by.get_or_insert(by);
        }
    }

    /// The agent half-closed or ended a stream, the latter possibly with an error in `status`.
    pub fn left(&mut self, stream: StreamId, status: Option<&Status>, now: Duration) {
        let seen = &mut self.streams[stream];
        if self.phase == Phase::Done || seen.cut || std::mem::replace(&mut seen.closed, true) {
            return;
        }
        if let Some(status) = status.filter(|status| status.code() == Code::OutOfRange) {
            let got = status.message().to_owned();
            return self.fatal(Fault::MessageRefused, "messages of at most 64 KiB", got);
        }
        match self.phase {
            Phase::Over if self.streams.iter().all(|it| it.closed || it.cut) => {
                if self.started {
                    self.demand(
                        Fault::NeverExited,
                        "the process to exit after its game",
                        Some(now + self.patience.each),
                    );
                } else {
                    self.phase = Phase::Done;
                }
            }
            Phase::Playing if self.demand.is_none() => self.demand(
                Fault::LeftEarly,
                "the agent to stay until its game is over",
                Some(now + self.patience.each),
            ),
            _ => {}
        }
    }

    /// The server ended a stream.
    pub fn ended(&mut self, stream: StreamId, status: Option<&Status>) {
        self.streams[stream].closed = true;
        if let Some(status) = status.filter(|_| !self.is_done()) {
            let got = format!("the server ended the stream: {}", status.message());
            self.fatal(
                Fault::MessageRefused,
                "messages that the server accepts",
                got,
            );
        }
    }

    /// The agent has not read its stream for as long as the examiner waits.
    pub fn not_reading(&mut self) {
        if !self.is_done() {
            self.fatal(
                Fault::NotReading,
                "an agent that reads its stream",
                "its stream was not read for too long",
            );
        }
    }

    /// The agent's process has exited.
    pub fn exited(&mut self, status: ExitStatus) {
        match self.phase {
            Phase::Done => {}
            Phase::Over if status.success() => self.phase = Phase::Done,
            Phase::Over => self.fatal(
                Fault::ExitStatus,
                "exit status 0 after a finished game",
                status.to_string(),
            ),
            _ => {
                self.demand
                    .take_if(|demand| demand.fault == Fault::LeftEarly);
                let expected = "the agent to play until its game is over";
                self.failed(
                    Fault::ExitedEarly,
                    expected,
                    format!("its process exited: {status}"),
                );
            }
        }
    }

    /// When [`Exam::tick`] must be called if nothing happens before.
    pub fn wake_at(&self) -> Duration {
        let limit = self.patience.case();
        let by = self.demand.as_ref().and_then(|demand| demand.by);
        by.map_or(limit, |by| by.min(limit))
    }

    /// Checks the time limits.
    pub fn tick(&mut self, now: Duration) {
        if self.is_done() || now < self.wake_at() {
            return;
        }
        if now >= self.patience.case() {
            let got = format!("the case was not over after {} s", now.as_secs());
            return self.fatal(Fault::CaseTooLong, "an end of the case", got);
        }
        let waited = match self.phase {
            Phase::Starting => self.patience.start,
            _ => self.patience.each,
        };
        let got = format!("nothing within {:.1} s", waited.as_secs_f64());
        self.failed(Fault::CaseTooLong, "an end of the case", got);
    }
}
