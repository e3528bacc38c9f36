//! Records of games played without a room (simulated, or stepped by a client), in the format of
//! hosted games. All times are zero.

use crate::convert::{
    By, action_space, event_kind, final_table, invalid_reward, rules_to_proto, seat_number,
    with_rewards,
};
use crate::jsonl::FORMAT_VERSION;
use chefshat_engine::PlayedDecision;
use chefshat_engine::{BySeat, Event, Game, RULES_VERSION, RewardScheme, RuleSet, Seed};
use chefshat_proto::v1::{self, game_event::Kind, record_line::Line};
use sha2::{Digest as _, Sha256};

use super::decision_kind;

/// The most invalid attempts before a default decision that a record can state.
pub const MAX_RECORDED_ATTEMPTS: u32 = 1000;

/// The policy of a record without clocks of kinds, pauses, hints and chat. The caller sets its times
/// and limits.
pub fn plain_policy() -> v1::RoomPolicy {
    v1::RoomPolicy {
        decision_time_ms: None,
        bank_ms: None,
        max_invalid_attempts: None,
        max_timeouts: None,
        substitute: String::new(),
        abort: v1::AbortPolicy::Unspecified.into(),
        reward_scheme: v1::RewardScheme::Unspecified.into(),
        pace_ms: Some(0),
        waiting_time_ms: None,
        spectators: Some(true),
        spectator_delay_decisions: Some(0),
        spectators_see_hands: Some(false),
        durability: v1::Durability::Durable.into(),
        clocks: Vec::new(),
        one_seat_per_client: false,
        visibility: v1::Visibility::Unspecified.into(),
        hints: false,
        chat: false,
        absence_time_ms: None,
    }
}

/// A complete game: dealt from a seed, with all decisions.
#[derive(Debug, Clone, Copy)]
pub struct Played<'a> {
    /// The program that played it, recorded as the room name.
    pub by: &'a str,
    /// The rule set.
    pub rules: &'a RuleSet,
    /// The built-in agent of each seat; `None` for a client's.
    pub agents: &'a BySeat<Option<&'a str>>,
    /// Its seed.
    pub seed: Seed,
    /// The scheme of rewards.
    pub scheme: Option<RewardScheme>,
    /// The policy of the header; only its limits and rewards have a meaning.
    pub policy: &'a v1::RoomPolicy,
    /// All its decisions.
    pub decisions: &'a [PlayedDecision],
}

impl Played<'_> {
    /// The lines of the record.
    ///
    /// # Panics
    /// If the decisions are illegal or incomplete.
    pub fn record(&self) -> Vec<v1::RecordLine> {
        let mut lines = Lines::new(self);
        let rules = *self.rules;
        let mut events = Vec::new();
        let mut game = Game::new(rules, self.seed, |event| events.push(event));
        lines.events(self, &events, v1::DecisionSource::Agent);
        let mut numbers = BySeat::filled(rules.players(), 0);
        for decision in self.decisions {
            let open = game
                .decision()
                .expect("the decisions are those of this game");
            numbers[open.seat] += 1;
            let action = decision.action;
            let source = if decision.by_default {
                v1::DecisionSource::Invalid
            } else {
                v1::DecisionSource::Agent
            };
            let attempts = decision.attempts.iter();
            lines.line(Line::Decision(v1::DecisionRecord {
                seat: seat_number(open.seat),
                decision_id: numbers[open.seat],
                kind: decision_kind(open.kind).into(),
                action: action.index().into(),
                text: rules.actions().text(action).unwrap_or_default(),
                source: source.into(),
                bank_left_ms: self.policy.bank_ms(),
                invalid_attempts: attempts.map(|action| action.index().into()).collect(),
                action_mask: game.legal_actions().to_bytes(rules.actions().size()),
                invalid_reward: invalid_reward(self.scheme, open.kind, decision.attempts.len()),
                ..v1::DecisionRecord::default()
            }));
            events.clear();
            game.apply(action, |event| events.push(event))
                .expect("the decisions are those of this game");
            lines.events(self, &events, source);
        }
        let standings = game.standings().expect("the game has ended");
        lines.end(self, final_table(&standings))
    }

    /// The game id, also the name of its file.
    pub fn game_id(&self) -> String {
        self.header().game_id
    }

    fn header(&self) -> v1::RecordHeader {
        let seats = self
            .agents
            .iter()
            .map(|(seat, agent)| v1::Participant {
                seat: seat_number(seat),
                name: agent.unwrap_or("client").to_owned(),
                kind: v1::ParticipantKind::Agent.into(),
                built_in_agent: agent.unwrap_or_default().to_owned(),
                connected: true,
                ..v1::Participant::default()
            })
            .collect();
        let mut header = v1::RecordHeader {
            format_version: FORMAT_VERSION,
            room_name: self.by.to_owned(),
            origin: v1::GameOrigin::FixedSeed.into(),
            rules: Some(rules_to_proto(self.rules)),
            rules_version: RULES_VERSION,
            policy: Some(self.policy.clone()),
            seats,
            server_version: env!("CARGO_PKG_VERSION").to_owned(),
            action_space: Some(action_space(&self.rules.actions())),
            ..v1::RecordHeader::default()
        };
        // Derived from the inputs, so the same game has the same record.
        let mut hash = Sha256::new()
            .chain_update(b"chefshat.v1 simulated game")
            .chain_update(self.seed.0);
        hash.update(serde_json::to_vec(&header).expect("a header serializes"));
        for decision in self.decisions {
            for attempt in &decision.attempts {
                hash.update(attempt.index().to_le_bytes());
            }
            hash.update(decision.action.index().to_le_bytes());
        }
        let id = hex::encode(&hash.finalize()[..16]);
        header.room_id.clone_from(&id);
        header.game_id = id;
        header
    }
}

struct Lines {
    lines: Vec<v1::RecordLine>,
    events: u64,
}

impl Lines {
    fn new(played: &Played<'_>) -> Self {
        let header = played.header();
        let clients = (header.seats.iter())
            .filter(|seat| seat.built_in_agent.is_empty())
            .map(|seat| v1::Seated {
                seat: seat.seat,
                name: seat.name.clone(),
                kind: seat.kind,
            })
            .collect::<Vec<_>>();
        let started = v1::GameStarted {
            game_id: header.game_id.clone(),
            rules: header.rules.clone(),
            rules_version: header.rules_version,
            policy: header.policy.clone(),
            seats: header.seats.clone(),
            action_space: header.action_space.clone(),
            hand_size: played.rules.hand_size().into(),
            seed_commitment: Vec::new(),
        };
        let mut lines = Self {
            lines: Vec::new(),
            events: 0,
        };
        lines.line(Line::Header(Box::new(header)));
        for seated in clients {
            lines.event(Kind::Seated(Box::new(seated)), Vec::new());
        }
        lines.event(Kind::GameStarted(Box::new(started)), Vec::new());
        lines
    }

    fn end(mut self, played: &Played<'_>, standings: Vec<v1::Standing>) -> Vec<v1::RecordLine> {
        let ended = v1::GameEnded {
            standings,
            reveal: Some(v1::SeedReveal {
                game_seed: played.seed.0.to_vec(),
                ..v1::SeedReveal::default()
            }),
        };
        self.event(Kind::GameEnded(Box::new(ended)), Vec::new());
        self.line(Line::Footer(v1::RecordFooter {
            state: v1::RoomState::Finished.into(),
            events: self.events,
            decisions: played.decisions.len() as u64,
            ..v1::RecordFooter::default()
        }));
        self.lines
    }

    fn events(&mut self, played: &Played<'_>, events: &[Event], source: v1::DecisionSource) {
        let by = By {
            source,
            decision_time_us: 0,
        };
        for (event, rewards) in with_rewards(events, played.rules, played.scheme) {
            if let Some(kind) = event_kind(event, played.rules.actions(), by) {
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
