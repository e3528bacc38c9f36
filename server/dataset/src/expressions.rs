//! The table of expressions: one row for each signal of affect or attention in a game, public or for the record only. How rows are gathered
//! from a record is in `gather`.

use std::sync::Arc;

use chefshat_proto::v1::Expression;

use super::column::{Column, ColumnInfo, Type, Value};
use super::game::{GameInfo, SeatInfo};
use super::gather::{expression_source, moment_us};

/// One expression.
#[derive(Debug, Clone)]
pub(super) struct ExpressionRow {
    pub(super) game: Arc<GameInfo>,
    pub(super) seat: usize,
    /// Who sat there; nobody may have.
    pub(super) player: Option<Arc<SeatInfo>>,
    pub(super) elapsed_ms: u64,
    pub(super) decisions_before: u64,
    pub(super) public: bool,
    pub(super) expression: Expression,
}

/// The columns, in the order of the files.
pub(super) const COLUMNS: &[Column<ExpressionRow>] = &[
    Column::new(
        "game_id",
        Type::Text,
        "Identifies the game: 32 hexadecimal digits.",
        |row| (&row.game.game_id).into(),
    ),
    Column::new(
        "seat",
        Type::Uint8,
        "Whose it was: the number of the seat, from 0.",
        |row| Value::Uint(row.seat as u64),
    ),
    Column::new(
        "agent",
        Type::Text,
        "Name of who sat there then, which before the game began may have been another than in the game; null if nobody did.",
        |row| row.player.as_ref().map(|player| &player.name).into(),
    ),
    Column::new(
        "agent_kind",
        Type::Text,
        "What that player is: `agent`, `human`, `robot` or `built_in`; null if nobody sat there.",
        |row| row.player.as_ref().map(|player| player.kind).into(),
    ),
    Column::new(
        "elapsed_ms",
        Type::Uint64,
        "When the server received it, milliseconds since the room was created.",
        |row| row.elapsed_ms.into(),
    ),
    Column::new(
        "decisions_before",
        Type::Uint64,
        "Decisions of the game that had been taken by then: it came before the decision with the next `number`.",
        |row| row.decisions_before.into(),
    ),
    Column::new(
        "public",
        Type::Bool,
        "Whether the room was told; false if it was for the record only.",
        |row| row.public.into(),
    ),
    Column::new(
        "label",
        Type::Text,
        "Short label, for instance `joy`.",
        |row| (&row.expression.label).into(),
    ),
    Column::new(
        "valence",
        Type::Float32,
        "Valence, -1..1; null if not given.",
        |row| row.expression.valence.into(),
    ),
    Column::new(
        "arousal",
        Type::Float32,
        "Arousal, -1..1; null if not given.",
        |row| row.expression.arousal.into(),
    ),
    Column::new(
        "dominance",
        Type::Float32,
        "Dominance, -1..1; null if not given.",
        |row| row.expression.dominance.into(),
    ),
    Column::new(
        "confidence",
        Type::Float32,
        "Confidence of the reading, 0..1; null if not given.",
        |row| row.expression.confidence.into(),
    ),
    Column::new(
        "source",
        Type::Text,
        "Where it was read from: `face`, `voice`, `self_report` or `model`; null if not said.",
        |row| expression_source(&row.expression).into(),
    ),
    Column::new(
        "media",
        Type::Text,
        "Reference to recorded media; null if there is none.",
        |row| {
            Some(&row.expression.media)
                .filter(|media| !media.is_empty())
                .into()
        },
    ),
    Column::new(
        "taken_at",
        Type::Time,
        "When the sender took it, by its own clock; null if not said.",
        |row| {
            row.expression
                .taken_at
                .as_ref()
                .map_or(Value::Null, |at| Value::Time(moment_us(at)))
        },
    ),
];

/// Names, types and descriptions of the columns.
pub(super) fn columns() -> Vec<ColumnInfo> {
    COLUMNS.iter().map(Column::info).collect()
}
