//! The table of decisions: one row per decision, with observation, action and outcome. Rows are
//! gathered in `gather`.

use std::sync::Arc;

use chefshat_engine::{Cards, Mask, Observation, RewardScheme};

use super::column::{Column, ColumnInfo, Type, Value};
use super::expressions::LatestExpression;
use super::game::{GameInfo, SeatInfo};
use chefshat_record::convert::PERSON_TIME_KEY;

/// Name of the table.
pub(super) const TABLE: &str = "decisions";

/// Rewards by scheme, in the order of [`RewardScheme::ALL`].
pub(super) type Rewards = [f32; RewardScheme::ALL.len()];

/// The source of decisions taken over from another game.
pub(super) const RECORDED: &str = "recorded";

/// One decision.
#[derive(Debug, Clone)]
pub(super) struct DecisionRow {
    /// The game.
    pub(super) game: Arc<GameInfo>,
    /// The observation of the seat. Hand and gifts are valid only where known.
    pub(super) seen: Observation,
    pub(super) hand_known: bool,
    pub(super) golden_known: bool,
    pub(super) gave_known: bool,
    pub(super) received_known: bool,
    pub(super) number: u64,
    pub(super) decision_id: u64,
    pub(super) turn: Option<u32>,
    pub(super) phase: &'static str,
    pub(super) seat: usize,
    pub(super) mask: Mask,
    pub(super) action: u16,
    pub(super) text: String,
    pub(super) invalid_attempts: Vec<u32>,
    pub(super) source: &'static str,
    pub(super) hinted: bool,
    pub(super) decision_time_us: Option<u64>,
    pub(super) person_decision_time_ms: Option<u64>,
    pub(super) elapsed_ms: u64,
    /// The latest expression of each seat, index = seat.
    pub(super) expressions: Vec<Option<LatestExpression>>,
    pub(super) rewards: Rewards,
    pub(super) invalid_rewards: Rewards,
    pub(super) shift_points: Option<u32>,
    pub(super) shift_place: Option<u8>,
    pub(super) game_points: Option<u64>,
    pub(super) game_place: Option<u8>,
}

impl DecisionRow {
    fn faces(&self) -> u8 {
        self.seen.faces
    }

    /// The seat's player; `None` for a decision taken over from another game.
    fn player(&self) -> Option<&SeatInfo> {
        (self.source != RECORDED).then(|| &*self.game.seats[self.seat])
    }

    fn known(&self, value: impl Into<Value>) -> Value {
        if self.hand_known {
            value.into()
        } else {
            Value::Null
        }
    }

    fn cards(&self, cards: Cards) -> Value {
        Value::List(cards.counts(self.faces()).map(Value::from).collect())
    }

    /// Cards given or received: null if none or unknown.
    fn exchanged(&self, cards: Cards, known: bool) -> Value {
        if known && !cards.is_empty() {
            self.cards(cards)
        } else {
            Value::Null
        }
    }
}

const EXPRESSION: Type = Type::Struct(&[
    ("label", Type::Text),
    ("valence", Type::Float32),
    ("arousal", Type::Float32),
    ("dominance", Type::Float32),
    ("confidence", Type::Float32),
    ("source", Type::Text),
    ("public", Type::Bool),
    ("age_ms", Type::Uint64),
]);

const COUNTS: Type = Type::List(&Type::Uint8);

/// The columns, in the order of the files.
pub(super) const COLUMNS: &[Column<DecisionRow>] = &[
    Column::new(
        "game_id",
        Type::Text,
        "Identifies the game: 32 hexadecimal digits.",
        |row| (&row.game.game_id).into(),
    ),
    Column::new("room_name", Type::Text, "Name of the room.", |row| {
        (&row.game.room_name).into()
    }),
    Column::new(
        "origin",
        Type::Text,
        "Origin of the game: `dealt`, `fixed_seed`, `scripted`, `branched`, `imported` or `physical`.",
        |row| row.game.origin.into(),
    ),
    Column::new(
        "rules",
        Type::Text,
        "The rule set, as the JSON of `chefshat.v1.RuleSet`.",
        |row| (&row.game.rules).into(),
    ),
    Column::new(
        "rules_version",
        Type::Uint32,
        "Version of the rules of the game.",
        |row| row.game.rules_version.into(),
    ),
    Column::new(
        "created_at",
        Type::Time,
        "When the room was created; null for a simulated game.",
        |row| row.game.created_at.map_or(Value::Null, Value::Time),
    ),
    Column::new(
        "finished",
        Type::Bool,
        "Whether the game finished; false if it was aborted.",
        |row| row.game.finished.into(),
    ),
    Column::new("players", Type::Uint8, "Number of seats.", |row| {
        row.game.players.into()
    }),
    Column::new(
        "study",
        Type::Text,
        "Name of the study, for researchers; null for a game outside of studies.",
        |row| row.game.study.as_ref().map(|it| &it.name).into(),
    ),
    Column::new(
        "condition",
        Type::Text,
        "The condition of the study; null for a game outside of studies.",
        |row| row.game.study.as_ref().map(|it| &it.condition).into(),
    ),
    Column::new(
        "participant",
        Type::Text,
        "Pseudonym of the participant of the study who played the game, at whatever seat the row is; of several who play together, of the one at the seat of the row, and null at other seats; null for a game outside of studies.",
        |row| {
            let study = row.game.study.as_ref();
            let participant = study.and_then(|study| {
                let is_at = |seat: u32| usize::try_from(seat) == Ok(row.seat);
                let mut others = study.others.iter();
                let other = others
                    .find(|other| is_at(other.seat))
                    .map(|it| &it.participant);
                // Of a group, nobody is whose seat an agent has.
                let first = study.group == 0 || is_at(study.seat);
                other.or(first.then_some(&study.participant))
            });
            participant.into()
        },
    ),
    Column::new(
        "number",
        Type::Uint64,
        "Number of the decision in its game, from 1, over all seats.",
        |row| row.number.into(),
    ),
    Column::new(
        "shift",
        Type::Uint32,
        "Number of the Shift, from 1.",
        |row| row.seen.shift.into(),
    ),
    Column::new(
        "pizza",
        Type::Uint32,
        "Number of the pizza in its Shift, from 1; null before the Shift's first turn.",
        |row| Some(row.seen.pizza).filter(|pizza| *pizza > 0).into(),
    ),
    Column::new(
        "turn",
        Type::Uint32,
        "Number of the turn in its Shift, from 1; null for decisions that are not turns.",
        |row| row.turn.into(),
    ),
    Column::new(
        "seat",
        Type::Uint8,
        "The seat that decided, from 0.",
        |row| Value::Uint(row.seat as u64),
    ),
    Column::new(
        "agent",
        Type::Text,
        "Name of the player; null for a decision taken over from another game, which may have had another player in the seat.",
        |row| row.player().map(|player| player.name.as_str()).into(),
    ),
    Column::new(
        "agent_kind",
        Type::Text,
        "Kind of player: `agent` (a program), `human`, `robot`, `model` (a language model) or `built_in` (an agent of the server); null where `agent` is.",
        |row| row.player().map(|player| player.kind).into(),
    ),
    Column::new(
        "built_in_agent",
        Type::Text,
        "Name of the built-in agent; for a network file `network:` and the first 16 hexadecimal digits of the SHA-256 of the file; null for other players, and where `agent` is.",
        |row| {
            row.player()
                .and_then(|player| player.built_in.as_ref())
                .into()
        },
    ),
    Column::new(
        "name_fingerprint",
        Type::Text,
        "Fingerprint of the player's name and its key, 16 hexadecimal digits: it tells players of one name apart; null without a key, and where `agent` is.",
        |row| {
            row.player()
                .and_then(|player| player.name_fingerprint.as_ref())
                .into()
        },
    ),
    Column::new(
        "decision_id",
        Type::Uint64,
        "Number of the decision at its seat, from 1.",
        |row| row.decision_id.into(),
    ),
    Column::new(
        "phase",
        Type::Text,
        "Kind of decision: `turn` (play or pass), `exchange` (give a card) or `special_action` (declare or decline).",
        |row| row.phase.into(),
    ),
    Column::new(
        "hand",
        COUNTS,
        "The seat's hand before the decision, F+1 counts: index f-1 counts face f, index F the jokers; null if unknown.",
        |row| row.known(row.cards(row.seen.hand)),
    ),
    Column::new(
        "golden",
        Type::Bool,
        "Whether the hand contains the Golden card; null if unknown.",
        |row| match row.golden_known {
            true => row.known(row.seen.hand.has_golden()),
            false => Value::Null,
        },
    ),
    Column::new(
        "board_face",
        Type::Uint8,
        "Face on the board: 0 if empty, 1..F, F+1 for a lone joker.",
        |row| row.seen.board.face.into(),
    ),
    Column::new(
        "board_size",
        Type::Uint8,
        "Number of cards on the board, including jokers.",
        |row| row.seen.board.size.into(),
    ),
    Column::new(
        "board_jokers",
        Type::Uint8,
        "Number of jokers on the board.",
        |row| row.seen.board.jokers.into(),
    ),
    Column::new(
        "board_owner",
        Type::Uint8,
        "The seat that played the cards on the board; null if it is empty.",
        |row| row.seen.board_owner.map(|seat| seat.index() as u8).into(),
    ),
    Column::new(
        "cards_left",
        COUNTS,
        "Cards in each hand, index = seat.",
        |row| row.seen.cards_left.as_slice().into(),
    ),
    Column::new(
        "passed",
        Type::List(&Type::Bool),
        "Whether each seat has passed in this pizza, index = seat.",
        |row| row.seen.passed.as_slice().into(),
    ),
    Column::new(
        "places",
        COUNTS,
        "Place of each seat in the Shift, from 1; 0 if it has not finished; index = seat.",
        |row| row.seen.places.as_slice().into(),
    ),
    Column::new(
        "roles",
        COUNTS,
        "Role of each seat: 1 Chef, 2 Sous-Chef, 3 Cook, 4 Waiter, 5 Dishwasher, 0 none (first Shift); index = seat.",
        |row| {
            Value::List(
                row.seen
                    .roles
                    .values()
                    .map(|role| role.map_or(0, |role| role as u8).into())
                    .collect(),
            )
        },
    ),
    Column::new(
        "points",
        Type::List(&Type::Uint64),
        "Points of each seat from earlier Shifts, index = seat.",
        |row| row.seen.points.as_slice().into(),
    ),
    Column::new(
        "played",
        COUNTS,
        "Cards played so far in the Shift by all seats, F+1 counts.",
        |row| row.cards(row.seen.played),
    ),
    Column::new(
        "gave",
        COUNTS,
        "Cards the seat gave in the Shift's exchange, F+1 counts; null if none or unknown.",
        |row| row.exchanged(row.seen.gave, row.gave_known),
    ),
    Column::new(
        "received",
        COUNTS,
        "Cards the seat received in the Shift's exchange, F+1 counts; null if none or unknown.",
        |row| row.exchanged(row.seen.received, row.received_known),
    ),
    Column::new(
        "mask",
        Type::Binary,
        "Legal actions as bits: bit i%8 of byte i/8 is action i (numpy.unpackbits with bitorder=\"little\"); null if the hand is unknown.",
        |row| row.known(Value::Binary(row.mask.to_bytes(row.game.actions))),
    ),
    Column::new(
        "legal_actions",
        Type::List(&Type::Uint16),
        "Legal actions as ascending indices; null if the hand is unknown.",
        |row| {
            row.known(Value::List(
                row.mask
                    .iter()
                    .map(|action| action.index().into())
                    .collect(),
            ))
        },
    ),
    Column::new("action", Type::Uint16, "Index of the action.", |row| {
        row.action.into()
    }),
    Column::new(
        "text",
        Type::Text,
        "The action as text: `C{face};Q{quantity};J{jokers}`, `pass`, `give C{face}`, `give J`, `declare` or `decline`.",
        |row| (&row.text).into(),
    ),
    Column::new(
        "valid",
        Type::Bool,
        "Whether there was no invalid attempt before the decision.",
        |row| row.invalid_attempts.is_empty().into(),
    ),
    Column::new(
        "invalid_count",
        Type::Uint32,
        "Number of invalid attempts before the decision.",
        |row| Value::Uint(row.invalid_attempts.len() as u64),
    ),
    Column::new(
        "invalid_attempts",
        Type::List(&Type::Uint32),
        "Indices of the invalid attempts, in order.",
        |row| (&row.invalid_attempts).into(),
    ),
    Column::new(
        "source",
        Type::Text,
        "Who decided: `agent` (the seat's own player), `substitute` (a built-in agent in its place), `timeout`, `invalid` or `disconnected` (the default decision, with its reason), `recorded` (taken over from the parent game of a branch), `table` (reported from a physical table).",
        |row| row.source.into(),
    ),
    Column::new(
        "hinted",
        Type::Bool,
        "Whether the seat was given a hint for the decision.",
        |row| row.hinted.into(),
    ),
    Column::new(
        "decision_time_us",
        Type::Uint64,
        "Measured decision time, microseconds; null for built-in agents, substitutes and recorded decisions, and if not measured.",
        |row| row.decision_time_us.into(),
    ),
    Column::new(
        PERSON_TIME_KEY,
        Type::Uint64,
        "Decision time measured by the person's device, milliseconds; null if it sent none.",
        |row| row.person_decision_time_ms.into(),
    ),
    Column::new(
        "elapsed_ms",
        Type::Uint64,
        "Time of the decision, milliseconds since the room was created.",
        |row| row.elapsed_ms.into(),
    ),
    Column::new(
        "expressions",
        Type::List(&EXPRESSION),
        "The last expression of each participant before the decision, index = seat, null if none; `public` is false for expressions for the record only, `age_ms` is the age in milliseconds.",
        |row| {
            Value::List(
                row.expressions
                    .iter()
                    .map(|latest| {
                        latest
                            .as_ref()
                            .map_or(Value::Null, |latest| latest.value_at(row.elapsed_ms))
                    })
                    .collect(),
            )
        },
    ),
    Column::new(
        "reward_validity",
        Type::Float32,
        "Reward by the scheme `validity`: 1 for every turn.",
        |row| row.rewards[0].into(),
    ),
    Column::new(
        "reward_paper",
        Type::Float32,
        "Reward by the scheme `paper` (the paper's Experiment 3 as printed).",
        |row| row.rewards[1].into(),
    ),
    Column::new(
        "reward_paper_intended",
        Type::Float32,
        "Reward by the scheme `paper_intended` (the same with the share of cards already shed).",
        |row| row.rewards[2].into(),
    ),
    Column::new(
        "reward_winning",
        Type::Float32,
        "Reward by the scheme `winning`: 1 for finishing first, else -0.001.",
        |row| row.rewards[3].into(),
    ),
    Column::new(
        "reward_points",
        Type::Float32,
        "Reward by the scheme `points`: on a seat's last turn of a Shift its points, else 0.",
        |row| row.rewards[4].into(),
    ),
    Column::new(
        "invalid_reward_validity",
        Type::Float32,
        "Total reward of the invalid attempts before the decision by `validity`.",
        |row| row.invalid_rewards[0].into(),
    ),
    Column::new(
        "invalid_reward_paper",
        Type::Float32,
        "The same by `paper`.",
        |row| row.invalid_rewards[1].into(),
    ),
    Column::new(
        "invalid_reward_paper_intended",
        Type::Float32,
        "The same by `paper_intended`.",
        |row| row.invalid_rewards[2].into(),
    ),
    Column::new(
        "invalid_reward_winning",
        Type::Float32,
        "The same by `winning`.",
        |row| row.invalid_rewards[3].into(),
    ),
    Column::new(
        "invalid_reward_points",
        Type::Float32,
        "The same by `points`.",
        |row| row.invalid_rewards[4].into(),
    ),
    Column::new(
        "shift_points",
        Type::Uint32,
        "Points of the seat in this Shift; null if the Shift was aborted.",
        |row| row.shift_points.into(),
    ),
    Column::new(
        "shift_place",
        Type::Uint8,
        "Place of the seat in this Shift, from 1; null if the Shift was aborted.",
        |row| row.shift_place.into(),
    ),
    Column::new(
        "game_points",
        Type::Uint64,
        "Points of the seat at the end of the game; null if the game was aborted.",
        |row| row.game_points.into(),
    ),
    Column::new(
        "game_place",
        Type::Uint8,
        "Place of the seat in the game, from 1; null if the game was aborted.",
        |row| row.game_place.into(),
    ),
    Column::new(
        "signed_by",
        Type::Text,
        "Public key of the server that signed the record, as `chefshat key show` prints it; null if unsigned.",
        |row| row.game.signed_by.get().map(String::as_str).into(),
    ),
    Column::new(
        "shown_kind",
        Type::Text,
        "What everybody else saw, `robot`, `agent` or `model`, where a person played the seat as that (Wizard of Oz); null for all others, and where `agent` is.",
        |row| row.player().and_then(|player| player.shown_kind).into(),
    ),
];

pub(super) fn columns() -> Vec<ColumnInfo> {
    COLUMNS.iter().map(Column::info).collect()
}
