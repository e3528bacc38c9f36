//! A transcript of a real table becomes a record. The engine plays what is told; the first row that the rules do not allow, or that cannot
//! be with the cards of the deck, is named.

use chefshat_engine::{Action, ActionSpace, BySeat, DecisionKind, Event, Game, Role, Seat};
use chefshat_proto::v1::{self, game_event::Kind, record_line::Line};
use sha2::{Digest as _, Sha256};

use super::checks::Ruled;
use super::head::header;
use super::play::{Beginning, Table};
use super::shifts::{shifts_of, wrong};
use super::transcript::{Row, Seen, Transcript, TranscriptError, read};
use crate::convert::{
    By, event_kind, final_table, invalid_reward, reward_scheme_from_proto, seat_number,
    with_rewards,
};
use crate::replay::{game_started, kind_to_proto, number, replay};

/// The record of a game of which a transcript tells. The same transcript gives the same record.
///
/// # Errors
/// The first row that cannot be.
pub fn import(transcript: &[u8]) -> Result<Vec<v1::RecordLine>, TranscriptError> {
    let told = read(transcript)?;
    let hash: [u8; 32] = Sha256::new()
        .chain_update(b"chefshat.v1 transcript")
        .chain_update(transcript)
        .finalize()
        .into();
    let last_line = told.last_line;
    let lines = Importing::new(told, &hex::encode(&hash[..16]))?.run()?;
    // Whoever reads the record will judge it by its lines alone.
    match replay(&lines) {
        Ok(_) => Ok(lines),
        Err(error) => Err(wrong(
            last_line,
            format!("the record that would be made of it does not fit: {error}"),
        )),
    }
}

struct Importing {
    told: Transcript,
    header: v1::RecordHeader,
    beginning: Beginning,
    table: Table,
    game: Option<Game>,
    lines: Vec<v1::RecordLine>,
    events: u64,
    decisions: BySeat<u64>,
    elapsed_ms: u64,
    /// Cards that seats gave by their own choice and that the engine has not asked for yet.
    gifts: Vec<(Seat, Action, u64)>,
    attempts: Vec<(Seat, u32)>,
    ruled: Ruled,
}

impl Importing {
    fn new(told: Transcript, game_id: &str) -> Result<Self, TranscriptError> {
        let rules = told.rules;
        let (beginning, shifts) = shifts_of(&told)?;
        let header = header(&told, &beginning, game_id);
        Ok(Self {
            table: Table::new(rules, shifts),
            decisions: BySeat::filled(rules.players(), 0),
            told,
            header,
            beginning,
            game: None,
            lines: Vec::new(),
            events: 0,
            elapsed_ms: 0,
            gifts: Vec::new(),
            attempts: Vec::new(),
            ruled: Ruled::default(),
        })
    }

    fn run(mut self) -> Result<Vec<v1::RecordLine>, TranscriptError> {
        self.push(Line::Header(self.header.clone()));
        for seat in self.header.seats.clone() {
            self.room_event(Kind::Seated(Box::new(v1::Seated {
                seat: seat.seat,
                name: seat.name,
                kind: seat.kind,
            })));
        }
        self.room_event(Kind::GameStarted(Box::new(game_started(
            &self.header,
            &self.told.rules,
        ))));
        let rows = std::mem::take(&mut self.told.rows);
        let first_line = rows.first().map_or(self.told.last_line, |row| row.line);
        let mut events = Vec::new();
        self.game = self
            .table
            .begin(&self.beginning, &mut events)
            .map_err(|error| wrong(first_line, error.to_string()))?;
        self.tell(&events, 0);
        for row in &rows {
            self.row(row)?;
        }
        if let Some((seat, _)) = self.attempts.first() {
            return Err(wrong(
                self.told.last_line,
                format!("seat {seat} tried a play, but its turn is not told of"),
            ));
        }
        self.end();
        Ok(self.lines)
    }

    fn row(&mut self, row: &Row) -> Result<(), TranscriptError> {
        let at = |problem: String| wrong(row.line, problem);
        if let Some(problem) = self.table.misfit(row.line) {
            return Err(at(problem.to_owned()));
        }
        if let Some(ms) = row.at_ms {
            if ms < self.elapsed_ms {
                return Err(at("`seconds` is earlier than on a line before".into()));
            }
            self.elapsed_ms = ms;
        }
        let Some(game) = &self.game else {
            return Err(at("nothing can be told before the first Shift".into()));
        };
        let over = game.is_over();
        match &row.seen {
            Seen::Hand(_) | Seen::Gives(None) => self.is_current(row),
            Seen::Gives(Some((_, moves))) => {
                self.is_current(row)?;
                // Whoever gives without a choice is not asked.
                if self.is_chooser(row.seat) {
                    let moves = moves.iter().map(|gift| (row.seat, *gift, row.took_us));
                    self.gifts.extend(moves);
                }
                self.take_gifts(row.line)
            }
            Seen::Special(declared) => {
                self.is_current(row)?;
                let decision = if *declared {
                    Action::Declare
                } else {
                    Action::Decline
                };
                self.decide(row.line, row.seat, decision, row.took_us)?;
                self.take_gifts(row.line)
            }
            Seen::Tries(attempt) => {
                let action = self.space().encode(*attempt);
                let action =
                    action.ok_or_else(|| at("no deck has so many cards of a face".into()))?;
                self.attempts.push((row.seat, action.index().into()));
                Ok(())
            }
            Seen::Turn(turn) => {
                self.is_current(row)?;
                self.decide(row.line, row.seat, *turn, row.took_us)
            }
            Seen::Role(_) | Seen::Points(_) | Seen::Finishes(_) => {
                self.ruled.check(row, game).map_err(at)
            }
            Seen::Expresses(_) if over => Err(at("the game was over before this line".into())),
            Seen::Expresses(expression) => {
                self.room_event(Kind::ExpressionShown(Box::new(v1::ExpressionShown {
                    seat: seat_number(row.seat),
                    expression: Some((**expression).clone()),
                })));
                Ok(())
            }
        }
    }

    /// Gives the cards that the engine asks for now.
    fn take_gifts(&mut self, line: usize) -> Result<(), TranscriptError> {
        loop {
            let open = self.game.as_ref().and_then(Game::decision);
            let next = self.gifts.iter().position(|(seat, ..)| {
                open.is_some_and(|open| open.kind == DecisionKind::Exchange && open.seat == *seat)
            });
            let Some(next) = next else { return Ok(()) };
            let (seat, gift, took_us) = self.gifts.remove(next);
            self.decide(line, seat, gift, took_us)?;
        }
    }

    /// Takes a decision that is told.
    fn decide(
        &mut self,
        line: usize,
        seat: Seat,
        decision: Action,
        took_us: u64,
    ) -> Result<(), TranscriptError> {
        let at = |problem: String| wrong(line, problem);
        let Some(game) = self.game.as_mut() else {
            return Err(at("the game has not begun".into()));
        };
        let known = self.table.hands_known(game);
        let open = game
            .decision()
            .filter(|_| self.table.is_open())
            .ok_or_else(|| {
                at("by the rules the Shift, or the game, ended before this line".into())
            })?;
        if open.seat != seat {
            return Err(at(format!(
                "it is seat {}'s decision, not seat {seat}'s",
                open.seat
            )));
        }
        let space = self.told.rules.actions();
        let action = space
            .encode(decision)
            .ok_or_else(|| at("no deck has so many cards of a face".into()))?;
        let legal = game.legal_actions();
        let (attempts, others) = self.attempts.iter().partition(|(tried, _)| *tried == seat);
        let attempts: Vec<(Seat, u32)> = attempts;
        self.attempts = others;
        if let Some((_, tried)) = attempts
            .iter()
            .find(|(_, tried)| known[seat] && legal.contains(number(*tried)))
        {
            let text = space.text(number(*tried)).unwrap_or_default();
            return Err(at(format!(
                "seat {seat} tried {text} before, which was legal"
            )));
        }
        let mut events = Vec::new();
        game.apply(action, |event| events.push(event))
            .map_err(|error| at(error.to_string()))?;
        self.decisions[seat] += 1;
        let scheme = reward_scheme_from_proto(self.told.scheme);
        let record = v1::DecisionRecord {
            seat: seat_number(seat),
            decision_id: self.decisions[seat],
            kind: kind_to_proto(open.kind).into(),
            action: action.index().into(),
            text: space.text(action).unwrap_or_default(),
            source: v1::DecisionSource::Agent.into(),
            decision_time_us: took_us,
            invalid_reward: invalid_reward(scheme, open.kind, attempts.len()),
            invalid_attempts: attempts.into_iter().map(|(_, tried)| tried).collect(),
            action_mask: if known[seat] {
                legal.to_bytes(space.size())
            } else {
                Vec::new()
            },
            elapsed_ms: self.elapsed_ms,
            ..v1::DecisionRecord::default()
        };
        self.table.took_told(seat, open.kind);
        self.table
            .applied(game, &mut events)
            .map_err(|error| at(error.to_string()))?;
        self.push(Line::Decision(record));
        self.tell(&events, took_us);
        Ok(())
    }

    /// Writes the events of a decision down, with the rewards they brought.
    fn tell(&mut self, events: &[Event], took_us: u64) {
        let (rules, space) = (self.told.rules, self.space());
        let by = By {
            source: v1::DecisionSource::Agent,
            decision_time_us: took_us,
        };
        let scheme = reward_scheme_from_proto(self.told.scheme);
        for (event, rewards) in with_rewards(events, &rules, scheme) {
            self.ruled.note(event);
            if let Some(kind) = event_kind(&self.table.as_told(event.clone()), space, by) {
                self.event(kind, rewards);
            }
        }
    }

    /// A turn must be of the Shift that is being played.
    fn is_current(&self, row: &Row) -> Result<(), TranscriptError> {
        let game = self.game.as_ref();
        match game.filter(|game| !game.is_over() && self.table.is_open()) {
            Some(game) if game.shift() != row.shift => Err(wrong(
                row.line,
                format!(
                    "by the rules Shift {} is being played, not Shift {}",
                    game.shift(),
                    row.shift
                ),
            )),
            _ => Ok(()),
        }
    }

    /// Whether a seat chooses what it gives in this Shift.
    fn is_chooser(&self, seat: Seat) -> bool {
        let role = self.game.as_ref().and_then(|game| game.roles()[seat]);
        matches!(role, Some(Role::Chef | Role::SousChef))
    }

    fn end(&mut self) {
        let standings = self.game.as_ref().and_then(Game::standings);
        let state = match standings {
            Some(standings) => {
                self.room_event(Kind::GameEnded(Box::new(v1::GameEnded {
                    standings: final_table(&standings),
                    reveal: None,
                })));
                v1::RoomState::Finished
            }
            // Whoever watched saw no end of it.
            None => {
                self.room_event(Kind::GameAborted(Box::new(v1::GameAborted {
                    reason: v1::AbortReason::Closed.into(),
                    reveal: None,
                })));
                v1::RoomState::Aborted
            }
        };
        self.push(Line::Footer(v1::RecordFooter {
            state: state.into(),
            events: self.events,
            decisions: self.decisions.values().sum(),
        }));
    }

    fn space(&self) -> ActionSpace {
        self.told.rules.actions()
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
