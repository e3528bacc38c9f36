//! Records of simulated games, in the form of those of hosted ones: the games of a batch are played again, their decisions noted, and
//! written down with the events that follow from them. There is no clock in them: all times are zero, and so is that of their making.

use std::path::Path;

use chefshat_arena::{Batch, Listener};
use chefshat_engine::{Action, BySeat, Decision, Event, Game, RULES_VERSION};
use chefshat_proto::v1::{self, game_event::Kind, record_line::Line};
use chefshat_records::convert::{
    By, action_space, event_kind, final_table, invalid_reward, rules_to_proto, seat_number,
    with_rewards,
};
use chefshat_records::jsonl::{self, FORMAT_VERSION, RecordFileError};
use sha2::{Digest as _, Sha256};

use crate::convert::{decision_kind, policy_to_proto};
use crate::room::policy::Policy;

/// Most invalid attempts after which a record can say that the default was taken.
pub(super) const MAX_INVALID_ATTEMPTS: u32 = 1000;

/// Plays a game of a batch, by its index from 0, and writes its record into a folder.
///
/// # Errors
/// Whatever the file system has against it.
pub(super) fn write(batch: &Batch, index: u64, folder: &Path) -> Result<(), RecordFileError> {
    let mut notes = Notes::default();
    batch.play_game(index, &mut notes);
    let header = header(batch, index);
    let path = folder.join(format!("{}.jsonl", header.game_id));
    jsonl::write(
        &path,
        &Writer::new(batch, header).record(batch, index, &notes),
    )
}

/// The decisions of a game, each after the attempts that were refused.
#[derive(Default)]
struct Notes {
    decisions: Vec<(Action, Vec<u32>)>,
    attempts: Vec<u32>,
}

impl Listener for Notes {
    fn on_invalid(&mut self, _: Decision, action: Action) {
        self.attempts.push(action.index().into());
    }

    fn on_decision(&mut self, _: Decision, action: Action) {
        self.decisions
            .push((action, std::mem::take(&mut self.attempts)));
    }
}

fn header(batch: &Batch, index: u64) -> v1::RecordHeader {
    let policy = Policy {
        max_invalid_attempts: batch.max_invalid_attempts().map(|attempts| attempts.get()),
        reward_scheme: batch.scheme(),
        ..Policy::default()
    };
    let seats = batch
        .agents()
        .iter()
        .map(|(seat, agent)| v1::Participant {
            seat: seat_number(seat),
            name: agent.name().to_owned(),
            kind: v1::ParticipantKind::Agent.into(),
            built_in_agent: agent.name().to_owned(),
            connected: true,
            ..v1::Participant::default()
        })
        .collect();
    let mut header = v1::RecordHeader {
        format_version: FORMAT_VERSION,
        room_name: "simulate".to_owned(),
        origin: v1::GameOrigin::FixedSeed.into(),
        rules: Some(rules_to_proto(batch.rules())),
        rules_version: RULES_VERSION,
        policy: Some(policy_to_proto(&policy)),
        seats,
        server_version: env!("CARGO_PKG_VERSION").to_owned(),
        action_space: Some(action_space(&batch.rules().actions())),
        ..v1::RecordHeader::default()
    };
    // What the game follows from names it, so that the same game has the same record.
    let mut hash = Sha256::new()
        .chain_update(b"chefshat.v1 simulated game")
        .chain_update(batch.game_seed(index).0);
    hash.update(serde_json::to_vec(&header).expect("a header is written without failing"));
    let id = hex::encode(&hash.finalize()[..16]);
    header.room_id.clone_from(&id);
    header.game_id = id;
    header
}

struct Writer {
    lines: Vec<v1::RecordLine>,
    events: u64,
}

impl Writer {
    fn new(batch: &Batch, header: v1::RecordHeader) -> Self {
        let started = v1::GameStarted {
            game_id: header.game_id.clone(),
            rules: header.rules.clone(),
            rules_version: header.rules_version,
            policy: header.policy.clone(),
            seats: header.seats.clone(),
            action_space: header.action_space.clone(),
            hand_size: batch.rules().hand_size().into(),
            seed_commitment: Vec::new(),
        };
        let mut writer = Self {
            lines: Vec::new(),
            events: 0,
        };
        writer.line(Line::Header(header));
        writer.event(Kind::GameStarted(Box::new(started)), Vec::new());
        writer
    }

    /// Plays the noted decisions and writes everything down.
    fn record(mut self, batch: &Batch, index: u64, notes: &Notes) -> Vec<v1::RecordLine> {
        let rules = *batch.rules();
        let seed = batch.game_seed(index);
        let mut events = Vec::new();
        let mut game = Game::new(rules, seed, |event| events.push(event));
        self.events(batch, &events, v1::DecisionSource::Agent);
        let mut numbers = BySeat::filled(rules.players(), 0);
        for (action, attempts) in &notes.decisions {
            let open = game.decision().expect("the game goes as it went");
            numbers[open.seat] += 1;
            let exhausted = batch
                .max_invalid_attempts()
                .is_some_and(|limit| attempts.len() >= limit.get() as usize);
            let source = if exhausted {
                v1::DecisionSource::Invalid
            } else {
                v1::DecisionSource::Agent
            };
            self.line(Line::Decision(v1::DecisionRecord {
                seat: seat_number(open.seat),
                decision_id: numbers[open.seat],
                kind: decision_kind(open.kind).into(),
                action: action.index().into(),
                text: rules.actions().text(*action).unwrap_or_default(),
                source: source.into(),
                bank_left_ms: crate::convert::millis(Policy::default().bank),
                invalid_attempts: attempts.clone(),
                action_mask: game.legal_actions().to_bytes(rules.actions().size()),
                invalid_reward: invalid_reward(batch.scheme(), open.kind, attempts.len()),
                ..v1::DecisionRecord::default()
            }));
            events.clear();
            game.apply(*action, |event| events.push(event))
                .expect("the game goes as it went");
            self.events(batch, &events, source);
        }
        let standings = game.standings().expect("the game has ended");
        let ended = v1::GameEnded {
            standings: final_table(&standings),
            reveal: Some(v1::SeedReveal {
                game_seed: seed.0.to_vec(),
                ..v1::SeedReveal::default()
            }),
        };
        self.event(Kind::GameEnded(Box::new(ended)), Vec::new());
        self.line(Line::Footer(v1::RecordFooter {
            state: v1::RoomState::Finished.into(),
            events: self.events,
            decisions: notes.decisions.len() as u64,
        }));
        self.lines
    }

    fn events(&mut self, batch: &Batch, events: &[Event], source: v1::DecisionSource) {
        let by = By {
            source,
            decision_time_us: 0,
        };
        for (event, rewards) in with_rewards(events, batch.rules(), batch.scheme()) {
            if let Some(kind) = event_kind(event, batch.rules().actions(), by) {
                self.event(kind, rewards);
            }
        }
    }

    fn event(&mut self, kind: Kind, rewards: Vec<v1::SeatReward>) {
        self.events += 1;
        self.line(Line::Event(v1::GameEvent {
            sequence: self.events,
            elapsed_ms: 0,
            rewards,
            kind: Some(kind),
        }));
    }

    fn line(&mut self, line: Line) {
        self.lines.push(v1::RecordLine { line: Some(line) });
    }
}
