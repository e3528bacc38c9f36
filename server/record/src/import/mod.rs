//! Records of games played with real cards, from a transcript ([`import`]) or from a physical room
//! ([`PhysicalRoom`]).
//!
//! A transcript ([`transcript`]) or a room states part of a game. The cards it does not state are completed
//! ([`PhysicalGame`]) so that the rule engine can play each Shift; the first row that no game can
//! contain is reported. The record contains only what was stated or follows from it.

mod facts;
mod notation;
mod notes;
mod room;
mod start;
mod transcript;

use chefshat_engine::{
    Action, ActionSpace, BySeat, DecisionKind, Event, Game, MAX_SEATS, RULES_VERSION, RewardScheme,
    Role, RuleSet, Seat,
};
use chefshat_proto::v1::{self, game_event::Kind, record_line::Line};
use chefshat_referee::{PhysicalGame, ShiftFacts, StartState};
use sha2::{Digest as _, Sha256};

use crate::convert::{
    By, action_id, action_space, decision_kind, event_kind, final_table, invalid_reward,
    plain_policy, reward_scheme_from_proto, rules_to_proto, seat_number, with_rewards,
};
use crate::jsonl::FORMAT_VERSION;
use crate::replay::{game_started, replay};
use facts::facts_of_transcript;
use notes::RuledShifts;
pub use room::{PhysicalRoom, RoomEntry};
use start::start_of_transcript;
use transcript::{Entry, Row, Transcript, read, wrong};
pub use transcript::{MAX_TRANSCRIPT_BYTES, TranscriptError};

/// Milliseconds of a day, the longest time a policy allows: a real table has no clock.
const DAY_MS: u32 = 86_400_000;

/// Converts a transcript to a record. The same transcript always gives the same record.
///
/// # Errors
/// The first row that is malformed or that no game can contain.
pub fn import(bytes: &[u8]) -> Result<Vec<v1::RecordLine>, TranscriptError> {
    let transcript = read(bytes)?;
    let hash: [u8; 32] = Sha256::new()
        .chain_update(b"chefshat.v1 transcript")
        .chain_update(bytes)
        .finalize()
        .into();
    let last_line = transcript.last_line;
    let lines =
        Importer::of_transcript(&transcript, &hex::encode(&hash[..16]))?.run(&transcript)?;
    // Readers of the record see its lines alone.
    match replay(&lines) {
        Ok(_) => Ok(lines),
        Err(error) => Err(wrong(
            last_line,
            format!("the resulting record does not verify: {error}"),
        )),
    }
}

struct Importer {
    rules: RuleSet,
    scheme: Option<RewardScheme>,
    header: v1::RecordHeader,
    start: StartState,
    physical: PhysicalGame,
    game: Option<Game>,
    lines: Vec<v1::RecordLine>,
    events: u64,
    decisions: BySeat<u64>,
    elapsed_ms: u64,
    /// Chosen gifts the engine has not asked for yet.
    gifts: Vec<Stated>,
    /// Illegal plays that each seat took back since its last decision.
    attempts: [Vec<u32>; MAX_SEATS],
    ruled: RuledShifts,
}

/// A stated decision.
#[derive(Debug)]
struct Stated {
    seat: Seat,
    action: Action,
    /// Its line of the record, without what follows from the game.
    record: v1::DecisionRecord,
}

impl Stated {
    /// A decision of a transcript.
    fn of_row(row: &Row, action: Action) -> Self {
        Self {
            seat: row.seat,
            action,
            record: v1::DecisionRecord {
                source: v1::DecisionSource::Agent.into(),
                decision_time_us: row.took_us,
                ..v1::DecisionRecord::default()
            },
        }
    }
}

impl Importer {
    fn of_transcript(transcript: &Transcript, game_id: &str) -> Result<Self, TranscriptError> {
        let start = start_of_transcript(transcript)?;
        let header = header(transcript, &start, game_id);
        let shifts = facts_of_transcript(transcript)?;
        Ok(Self::new(transcript.rules, header, start, shifts))
    }

    fn new(
        rules: RuleSet,
        header: v1::RecordHeader,
        start: StartState,
        shifts: Vec<ShiftFacts>,
    ) -> Self {
        let policy = header.policy.as_ref();
        let scheme = policy.map_or(v1::RewardScheme::Unspecified, |policy| {
            policy.reward_scheme()
        });
        Self {
            rules,
            scheme: reward_scheme_from_proto(scheme),
            physical: PhysicalGame::new(rules, shifts),
            decisions: BySeat::filled(rules.players(), 0),
            header,
            start,
            game: None,
            lines: Vec::new(),
            events: 0,
            elapsed_ms: 0,
            gifts: Vec::new(),
            attempts: Default::default(),
            ruled: RuledShifts::default(),
        }
    }

    fn run(mut self, transcript: &Transcript) -> Result<Vec<v1::RecordLine>, TranscriptError> {
        self.push(Line::Header(Box::new(self.header.clone())));
        for seat in self.header.seats.clone() {
            self.room_event(Kind::Seated(Box::new(v1::Seated {
                seat: seat.seat,
                name: seat.name,
                kind: seat.kind,
            })));
        }
        let rows = &transcript.rows;
        let first_line = rows.first().map_or(transcript.last_line, |row| row.line);
        self.begin().map_err(|problem| wrong(first_line, problem))?;
        for row in rows {
            self.row(row)?;
        }
        if let Some(seat) = self.attempts.iter().position(|tried| !tried.is_empty()) {
            return Err(wrong(
                transcript.last_line,
                format!("seat {seat} tried a play, but its turn is missing"),
            ));
        }
        // A transcript that breaks off has no result.
        self.end(v1::AbortReason::Closed);
        Ok(self.lines)
    }

    /// Starts the game.
    fn begin(&mut self) -> Result<(), String> {
        let started = game_started(&self.header, &self.rules);
        self.room_event(Kind::GameStarted(Box::new(started)));
        let mut events = Vec::new();
        self.game = self
            .physical
            .start(&self.start, &mut events)
            .map_err(|error| error.to_string())?;
        let by = By {
            source: v1::DecisionSource::Agent,
            decision_time_us: 0,
        };
        self.push_events(&events, by);
        Ok(())
    }

    fn row(&mut self, row: &Row) -> Result<(), TranscriptError> {
        let at = |problem: String| wrong(row.line, problem);
        if let Some(problem) = self.physical.contradiction(row.line) {
            return Err(at(problem.to_owned()));
        }
        if let Some(ms) = row.at_ms {
            if ms < self.elapsed_ms {
                return Err(at("`seconds` is earlier than on a line before".into()));
            }
            self.elapsed_ms = ms;
        }
        let Some(game) = &self.game else {
            return Err(at("no Shift has begun".into()));
        };
        let over = game.is_over();
        match &row.entry {
            Entry::Hand(_) | Entry::Gives(None) => self.check_shift(row),
            Entry::Gives(Some((_, moves))) => {
                self.check_shift(row)?;
                // Forced gifts are not decisions.
                if self.is_chooser(row.seat) {
                    let moves = moves.iter().map(|gift| Stated::of_row(row, *gift));
                    self.gifts.extend(moves);
                }
                self.apply_gifts().map_err(at)
            }
            Entry::Special(declared) => {
                self.check_shift(row)?;
                let decision = if *declared {
                    Action::Declare
                } else {
                    Action::Decline
                };
                self.apply_decision(Stated::of_row(row, decision))
                    .map_err(at)?;
                self.apply_gifts().map_err(at)
            }
            Entry::Tries(attempt) => {
                let action = self.space().encode(*attempt);
                let action =
                    action.ok_or_else(|| at("no deck has that many cards of one face".into()))?;
                self.attempts[row.seat.index()].push(action.index().into());
                Ok(())
            }
            Entry::Turn(turn) => {
                self.check_shift(row)?;
                self.apply_decision(Stated::of_row(row, *turn)).map_err(at)
            }
            Entry::Role(_) | Entry::Points(_) | Entry::Finishes(_) => {
                self.ruled.check(row, game).map_err(at)
            }
            Entry::Expresses(_) if over => Err(at("the game was over before this line".into())),
            Entry::Expresses(expression) => {
                self.room_event(Kind::ExpressionShown(Box::new(v1::ExpressionShown {
                    seat: seat_number(row.seat),
                    expression: Some((**expression).clone()),
                })));
                Ok(())
            }
        }
    }

    /// Applies the stated gifts the engine asks for now.
    fn apply_gifts(&mut self) -> Result<(), String> {
        loop {
            let open = self.game.as_ref().and_then(Game::decision);
            let next = self.gifts.iter().position(|gift| {
                open.is_some_and(|open| {
                    open.kind == DecisionKind::Exchange && open.seat == gift.seat
                })
            });
            let Some(next) = next else { return Ok(()) };
            let gift = self.gifts.remove(next);
            self.apply_decision(gift)?;
        }
    }

    /// Applies a stated decision and pushes its lines.
    fn apply_decision(&mut self, stated: Stated) -> Result<(), String> {
        let seat = stated.seat;
        let Some(game) = self.game.as_mut() else {
            return Err("the game has not started".into());
        };
        let known = self.physical.hands_known(game);
        let open = game
            .decision()
            .filter(|_| self.physical.is_open())
            .ok_or("by the rules, the Shift or the game ended before this line")?;
        if open.seat != seat {
            return Err(format!(
                "it is seat {}'s decision, not seat {seat}'s",
                open.seat
            ));
        }
        let space = self.rules.actions();
        let action = space
            .encode(stated.action)
            .ok_or("no deck has that many cards of one face")?;
        let legal = game.legal_actions();
        let attempts = std::mem::take(&mut self.attempts[seat.index()]);
        if let Some(tried) = attempts
            .iter()
            .find(|tried| known[seat] && legal.contains(action_id(**tried)))
        {
            let text = space.text(action_id(*tried)).unwrap_or_default();
            return Err(format!(
                "seat {seat} tried {text} before, but that was legal"
            ));
        }
        let mut events = Vec::new();
        game.apply(action, |event| events.push(event))
            .map_err(|error| error.to_string())?;
        self.decisions[seat] += 1;
        let mut record = stated.record;
        record.invalid_attempts.extend(attempts);
        let attempts = record.invalid_attempts.len();
        let record = v1::DecisionRecord {
            seat: seat_number(seat),
            decision_id: self.decisions[seat],
            kind: decision_kind(open.kind).into(),
            action: action.index().into(),
            text: space.text(action).unwrap_or_default(),
            invalid_reward: invalid_reward(self.scheme, open.kind, attempts),
            action_mask: if known[seat] {
                legal.to_bytes(space.size())
            } else {
                Vec::new()
            },
            elapsed_ms: self.elapsed_ms,
            ..record
        };
        self.physical.count_decision(seat, open.kind);
        self.physical
            .advance(game, &mut events)
            .map_err(|error| error.to_string())?;
        let by = By {
            source: record.source(),
            decision_time_us: record.decision_time_us,
        };
        self.push(Line::Decision(record));
        self.push_events(&events, by);
        Ok(())
    }

    /// Pushes the events of a decision with their rewards.
    fn push_events(&mut self, events: &[Event], by: By) {
        let (rules, space) = (self.rules, self.space());
        for (event, rewards) in with_rewards(events, &rules, self.scheme) {
            self.ruled.note(event);
            if let Some(kind) = event_kind(&self.physical.redact(event.clone()), space, by) {
                self.event(kind, rewards);
            }
        }
    }

    /// Checks that a row belongs to the Shift in progress.
    fn check_shift(&self, row: &Row) -> Result<(), TranscriptError> {
        let game = self.game.as_ref();
        match game.filter(|game| !game.is_over() && self.physical.is_open()) {
            Some(game) if game.shift() != row.shift => Err(wrong(
                row.line,
                format!(
                    "by the rules, Shift {} is in progress, not Shift {}",
                    game.shift(),
                    row.shift
                ),
            )),
            _ => Ok(()),
        }
    }

    /// Whether the seat chooses its gift in this Shift.
    fn is_chooser(&self, seat: Seat) -> bool {
        let role = self.game.as_ref().and_then(|game| game.roles()[seat]);
        matches!(role, Some(Role::Chef | Role::SousChef))
    }

    /// Ends the record. `aborted`: why the game has no result, if by the rules it is not over.
    fn end(&mut self, aborted: v1::AbortReason) {
        let standings = self.game.as_ref().and_then(Game::standings);
        let state = match standings {
            Some(standings) => {
                self.room_event(Kind::GameEnded(Box::new(v1::GameEnded {
                    standings: final_table(&standings),
                    reveal: None,
                })));
                v1::RoomState::Finished
            }
            None => {
                self.room_event(Kind::GameAborted(Box::new(v1::GameAborted {
                    reason: aborted.into(),
                    reveal: None,
                })));
                v1::RoomState::Aborted
            }
        };
        self.push(Line::Footer(v1::RecordFooter {
            state: state.into(),
            events: self.events,
            decisions: self.decisions.values().sum(),
            ..v1::RecordFooter::default()
        }));
    }

    fn space(&self) -> ActionSpace {
        self.rules.actions()
    }

    fn room_event(&mut self, kind: Kind) {
        self.event(kind, Vec::new());
    }

    fn event(&mut self, kind: Kind, rewards: Vec<v1::SeatReward>) {
        self.events += 1;
        self.push(Line::Event(v1::GameEvent {
            sequence: self.events,
            elapsed_ms: self.elapsed_ms,
            rewards,
            kind: Some(kind),
        }));
    }

    fn push(&mut self, line: Line) {
        self.lines.push(v1::RecordLine { line: Some(line) });
    }
}

fn header(transcript: &Transcript, start: &StartState, game_id: &str) -> v1::RecordHeader {
    let later = (start.shift > 1).then(|| v1::ScriptedShift {
        shift: start.shift,
        last_order: start.last_order.map_or_else(Vec::new, |order| {
            order.as_slice().iter().copied().map(seat_number).collect()
        }),
        points: start.scores.values().copied().collect(),
        ..v1::ScriptedShift::default()
    });
    v1::RecordHeader {
        format_version: FORMAT_VERSION,
        game_id: game_id.to_owned(),
        // There was no room.
        room_id: game_id.to_owned(),
        room_name: transcript.table.clone(),
        origin: v1::GameOrigin::Imported.into(),
        rules: Some(rules_to_proto(&transcript.rules)),
        rules_version: RULES_VERSION,
        policy: Some(policy(transcript.scheme)),
        seats: (0..)
            .zip(&transcript.players)
            .map(|(seat, player)| v1::Participant {
                seat,
                name: player.name.clone(),
                kind: player.kind.into(),
                ..v1::Participant::default()
            })
            .collect(),
        created_at_ms: transcript.began_ms,
        server_version: env!("CARGO_PKG_VERSION").into(),
        action_space: Some(action_space(&transcript.rules.actions())),
        start: later.map(|scripted| v1::GameStart {
            scripted: Some(scripted),
            ..v1::GameStart::default()
        }),
        ..v1::RecordHeader::default()
    }
}

/// The policy of a real table: no clock in effect and no substitution.
fn policy(scheme: v1::RewardScheme) -> v1::RoomPolicy {
    v1::RoomPolicy {
        decision_time_ms: Some(DAY_MS),
        bank_ms: Some(0),
        max_invalid_attempts: Some(0),
        max_timeouts: Some(1000),
        substitute: "random".into(),
        abort: v1::AbortPolicy::Never.into(),
        reward_scheme: scheme.into(),
        waiting_time_ms: Some(DAY_MS),
        ..plain_policy()
    }
}
