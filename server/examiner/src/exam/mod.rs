//! A case in progress: every message between the agent and the server passes through here, and is
//! recorded, judged and sometimes changed. It is synchronous, without IO and with a clock passed
//! in, so that every sequence of events can be tested as data. `relay` carries the messages,
//! `seats` holds what is known of each seat and decision.

mod answers;
mod life;
mod seats;
#[cfg(test)]
mod tests;

use std::collections::{BTreeMap, VecDeque};
use std::time::Duration;

use chefshat_proto::v1::{self, game_event::Kind, seat_command::Command, seat_update::Update};

use super::case::{Case, Interference, Patience};
use super::fault::{Fault, Finding};
use seats::{SeatKey, SeatSeen, StreamSeen};

/// Unrequested commands that an agent may send in a case.
const UNREQUESTED_COMMANDS: u64 = 200;
/// Commands that an agent may send for each update it receives.
const COMMANDS_PER_UPDATE: u64 = 4;
/// Most different faults recorded in a case.
const MAX_FINDINGS: usize = 16;

/// Number of a stream in its case, from 0.
pub type StreamId = usize;

/// The messages to forward in place of a message.
#[derive(Debug, Default, PartialEq)]
pub struct Passed {
    /// Commands for the server.
    pub to_server: Vec<v1::SeatCommand>,
    /// Updates for the agent, after which the stream may be cut.
    pub to_agent: Vec<v1::SeatUpdate>,
    /// The stream is cut here.
    pub cut: bool,
}

/// What the agent takes part in.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Venue {
    /// A room.
    Room {
        /// Its id.
        room_id: String,
        /// Its join code.
        join_code: String,
    },
    /// A tournament.
    Tournament {
        /// Its id.
        tournament_id: String,
    },
}

/// The phase of a case.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Phase {
    /// The agent has no seat.
    Starting,
    /// It has a seat but is not attached.
    Joined,
    /// It plays.
    Playing,
    /// Its game is over, and it has received the end.
    Over,
    /// The case is over.
    Done,
}

/// Something that must happen next, and the fault if it does not.
#[derive(Debug)]
struct Demand {
    fault: Fault,
    expected: String,
    /// The deadline; `None`: set by the game's own clock.
    by: Option<Duration>,
}

/// A case that is being played.
#[derive(Debug)]
pub struct Exam {
    case: &'static Case,
    patience: Patience,
    /// Whether the examiner started the agent's process and therefore sees it exit.
    started: bool,
    venue: Venue,
    phase: Phase,
    demand: Option<Demand>,
    /// Interferences still to come.
    plan: VecDeque<Interference>,
    /// Decisions answered without interference since the last one.
    quiet: u32,
    /// Answers of the agent are dropped.
    dropping: bool,
    /// The server must be restarted.
    restart_due: bool,
    streams: Vec<StreamSeen>,
    seats: BTreeMap<SeatKey, SeatSeen>,
    tickets: BTreeMap<String, SeatKey>,
    findings: Vec<Finding>,
    received: u64,
    commands_sent: u64,
    /// Most seats of the venue that were attached at a time.
    together: usize,
}

impl Exam {
    /// Creates a case in this room, at time zero.
    pub fn new(case: &'static Case, patience: Patience, venue: Venue, started: bool) -> Self {
        Self {
            case,
            patience,
            started,
            phase: Phase::Starting,
            demand: Some(Demand {
                fault: Fault::NeverJoined,
                expected: match &venue {
                    Venue::Room { .. } => "a seat taken with the join code".into(),
                    Venue::Tournament { .. } => {
                        "joining the tournament, and attaching its ticket to a stream".into()
                    }
                },
                by: Some(patience.start),
            }),
            venue,
            plan: case.interferences.iter().copied().collect(),
            quiet: 0,
            dropping: false,
            restart_due: false,
            streams: Vec::new(),
            seats: BTreeMap::new(),
            tickets: BTreeMap::new(),
            findings: Vec::new(),
            received: 0,
            commands_sent: 0,
            together: 0,
        }
    }

    /// Whether the case is over.
    pub fn is_done(&self) -> bool {
        self.phase == Phase::Done
    }

    /// The faults found so far.
    pub fn findings(&self) -> &[Finding] {
        &self.findings
    }

    /// Handles a message of the agent on a stream.
    pub fn from_agent(
        &mut self,
        stream: StreamId,
        request: v1::PlayRequest,
        now: Duration,
    ) -> Passed {
        let mut passed = Passed::default();
        // An empty message counts too.
        self.commands_sent += u64::from(request.commands.is_empty());
        for command in request.commands {
            if self.is_done() || self.streams[stream].cut {
                break;
            }
            self.commands_sent += 1;
            if self.commands_sent > UNREQUESTED_COMMANDS + COMMANDS_PER_UPDATE * self.received {
                let (commands_sent, received) = (self.commands_sent, self.received);
                self.fatal(
                    Fault::Flooding,
                    "about one command for each decision",
                    format!("{commands_sent} commands, after {received} updates in total"),
                );
                break;
            }
            self.command(stream, command, now, &mut passed);
        }
        passed.cut = self.streams[stream].cut;
        passed
    }

    fn command(
        &mut self,
        stream: StreamId,
        command: v1::SeatCommand,
        now: Duration,
        passed: &mut Passed,
    ) {
        let handle = command.handle;
        match command.command {
            Some(Command::Attach(mut attach)) => {
                self.attaching(stream, &attach);
                // The examiner reads every mask; agents that do not want masks do not receive them.
                attach.no_mask = false;
                passed.to_server.push(v1::SeatCommand {
                    handle,
                    command: Some(Command::Attach(attach)),
                });
                return;
            }
            None => {}
            Some(_) if !self.streams[stream].knows(handle) => self.fault(
                Fault::HandleUnknown,
                "commands for handles that were announced on the stream",
                format!("a command for handle {handle}"),
            ),
            Some(Command::Answer(answer)) => {
                let seen = &self.streams[stream];
                if let Some(key) = seen.bound.get(&handle).cloned() {
                    self.answer(stream, key, handle, answer, now, passed);
                    return;
                }
                // Commands on their way when a seat is detached are not a fault.
                if !seen.ended.contains(&handle) {
                    let id = answer.decision_id;
                    self.fault(
                        Fault::AnsweredUnasked,
                        "answers to decisions that were requested",
                        format!("an answer to decision {id} before the seat was attached"),
                    );
                }
                passed.to_server.push(v1::SeatCommand {
                    handle,
                    command: Some(Command::Answer(answer)),
                });
                return;
            }
            Some(Command::Resume(_)) => self.fulfil(Fault::NeverResumed),
            Some(Command::Detach(_)) if self.phase == Phase::Playing => {
                self.fatal(
                    Fault::LeftEarly,
                    "the agent to stay until its game is over",
                    "it detached from its seat",
                );
            }
            Some(_) => {}
        }
        passed.to_server.push(command);
    }

    /// Handles a message of the server on a stream.
    pub fn from_server(
        &mut self,
        stream: StreamId,
        response: v1::PlayResponse,
        now: Duration,
    ) -> Passed {
        let mut passed = Passed::default();
        if self.is_done() || self.streams[stream].cut {
            passed.cut = self.streams[stream].cut;
            return passed;
        }
        if self.cuts_instead(stream, &response, now) {
            passed.cut = true;
            return passed;
        }
        for v1::SeatUpdate { handle, update } in response.updates {
            self.received += 1;
            let Some(mut update) = update else { continue };
            self.update(stream, handle, &mut update, now, &mut passed);
            passed.to_agent.push(v1::SeatUpdate {
                handle,
                update: Some(update),
            });
        }
        passed
    }

    fn update(
        &mut self,
        stream: StreamId,
        handle: u32,
        update: &mut Update,
        now: Duration,
        passed: &mut Passed,
    ) {
        match update {
            Update::Attached(attached) => self.attached(stream, handle, attached),
            Update::Refused(refused) => self.refused(stream, handle, refused),
            Update::Events(batch) => {
                self.received += batch.events.len() as u64;
                if let Some(key) = self.streams[stream].bound.get(&handle).cloned() {
                    for event in &batch.events {
                        self.event(&key, event, now);
                    }
                }
            }
            Update::Snapshot(snapshot) => {
                if let Some(key) = self.streams[stream].bound.get(&handle) {
                    let seen = self.seats.entry(key.clone()).or_default();
                    seen.last_event = snapshot.next_sequence.saturating_sub(1);
                    if let Some(started) = &snapshot.game_started {
                        seen.learn(started);
                    }
                }
            }
            Update::Decision(request) => {
                if let Some(key) = self.streams[stream].bound.get(&handle).cloned() {
                    self.decision_requested(&key, handle, request, passed);
                }
            }
            Update::Result(result) => {
                if let Some(key) = self.streams[stream].bound.get(&handle).cloned() {
                    self.result(&key, result);
                }
            }
            Update::Detached(detached) => {
                self.detached(stream, handle, detached.reason(), now);
            }
            Update::Entered(entered) => self.entered(stream, handle, entered),
            // Nothing is asked of the agent, or not in the rooms of an examination.
            Update::Awaited(_) | Update::Substitution(_) => {}
        }
    }

    fn event(&mut self, key: &SeatKey, event: &v1::GameEvent, now: Duration) {
        let seen = self.seats.entry(key.clone()).or_default();
        seen.last_event = seen.last_event.max(event.sequence);
        let live = event.sequence >= seen.live_from;
        match &event.kind {
            Some(Kind::GameStarted(started)) => seen.learn(started),
            Some(Kind::Substituted(it)) if it.seat == key.seat && live => {
                if std::mem::take(&mut self.dropping) {
                    self.interfered();
                }
                self.demand(
                    Fault::NeverResumed,
                    "ResumeSeat or a new attachment after a substitute took over",
                    Some(now + self.patience.each),
                );
            }
            Some(Kind::Returned(it)) if it.seat == key.seat && live => {
                self.fulfil(Fault::NeverResumed);
            }
            Some(Kind::GameAborted(aborted)) => self.fatal(
                Fault::GameAborted,
                "a game with a result",
                format!("it was aborted ({})", aborted.reason().as_str_name()),
            ),
            _ => {}
        }
    }

    /// Records a fault; the case continues.
    fn fault(&mut self, fault: Fault, expected: impl Into<String>, got: impl Into<String>) {
        if let Some(known) = self.findings.iter_mut().find(|it| it.fault == fault) {
            known.times = known.times.saturating_add(1);
        } else if self.findings.len() < MAX_FINDINGS {
            self.findings.push(Finding {
                fault,
                expected: expected.into(),
                got: got.into(),
                times: 1,
            });
        }
    }

    /// Records a fault that ends the case.
    fn fatal(&mut self, fault: Fault, expected: impl Into<String>, got: impl Into<String>) {
        self.fault(fault, expected, got);
        self.phase = Phase::Done;
    }

    fn demand(&mut self, fault: Fault, expected: &str, by: Option<Duration>) {
        self.demand = Some(Demand {
            fault,
            expected: expected.into(),
            by,
        });
    }

    /// Something required has happened.
    fn fulfil(&mut self, fault: Fault) {
        self.demand.take_if(|demand| demand.fault == fault);
    }

    /// Something required did not happen; `fault` applies if nothing specific was required.
    fn failed(&mut self, fault: Fault, expected: &str, got: impl Into<String>) {
        match self.demand.take() {
            Some(demand) => self.fatal(demand.fault, demand.expected, got),
            None => self.fatal(fault, expected, got),
        }
    }

    /// The current interference is complete.
    fn interfered(&mut self) {
        self.plan.pop_front();
        self.quiet = 0;
    }
}
