//! The table of expressions: one row per expression, public or for the record only. Rows are
//! gathered in `gather`.

use std::sync::Arc;

use chefshat_proto::v1::{Expression, ExpressionSource};

use super::column::{Column, ColumnInfo, Type, Value};
use super::game::{GameInfo, SeatInfo};

/// Name of the table.
pub(super) const TABLE: &str = "expressions";

/// One expression.
#[derive(Debug, Clone)]
pub(super) struct ExpressionRow {
    pub(super) game: Arc<GameInfo>,
    pub(super) seat: usize,
    /// `None` if the seat was free.
    pub(super) player: Option<Arc<SeatInfo>>,
    pub(super) elapsed_ms: u64,
    pub(super) decisions_before: u64,
    pub(super) public: bool,
    pub(super) expression: Expression,
}

/// The last expression of a seat.
#[derive(Debug, Clone)]
pub(super) struct LatestExpression {
    pub(super) expression: Arc<Expression>,
    pub(super) public: bool,
    pub(super) elapsed_ms: u64,
}

impl LatestExpression {
    /// The value in the column `expressions` at a later time.
    pub(super) fn value_at(&self, elapsed_ms: u64) -> Value {
        let expression = &self.expression;
        Value::Struct(vec![
            (&expression.label).into(),
            expression.valence.into(),
            expression.arousal.into(),
            expression.dominance.into(),
            expression.confidence.into(),
            expression_source(expression).into(),
            self.public.into(),
            elapsed_ms.saturating_sub(self.elapsed_ms).into(),
        ])
    }
}

/// The columns, in the order of the files.
pub(super) const COLUMNS: &[Column<ExpressionRow>] = &[
    Column::new(
        "game_id",
        Type::Text,
        "Identifies the game: 32 hexadecimal digits.",
        |row| (&row.game.game_id).into(),
    ),
    Column::new("seat", Type::Uint8, "The seat, from 0.", |row| {
        Value::Uint(row.seat as u64)
    }),
    Column::new(
        "agent",
        Type::Text,
        "Name of the participant at that time (before the game the seat may have another one); null if the seat was free.",
        |row| row.player.as_ref().map(|player| &player.name).into(),
    ),
    Column::new(
        "agent_kind",
        Type::Text,
        "Kind of participant: `agent`, `human`, `robot` or `built_in`; null if the seat was free.",
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
        "Number of decisions before it: it precedes the decision with the next `number`.",
        |row| row.decisions_before.into(),
    ),
    Column::new(
        "public",
        Type::Bool,
        "Whether it was public; false if it was for the record only.",
        |row| row.public.into(),
    ),
    Column::new(
        "label",
        Type::Text,
        "Short label, for example `joy`.",
        |row| (&row.expression.label).into(),
    ),
    Column::new(
        "valence",
        Type::Float32,
        "Valence, -1..1; null if not stated.",
        |row| row.expression.valence.into(),
    ),
    Column::new(
        "arousal",
        Type::Float32,
        "Arousal, -1..1; null if not stated.",
        |row| row.expression.arousal.into(),
    ),
    Column::new(
        "dominance",
        Type::Float32,
        "Dominance, -1..1; null if not stated.",
        |row| row.expression.dominance.into(),
    ),
    Column::new(
        "confidence",
        Type::Float32,
        "Confidence of the reading, 0..1; null if not stated.",
        |row| row.expression.confidence.into(),
    ),
    Column::new(
        "source",
        Type::Text,
        "Source: `face`, `voice`, `self_report` or `model`; null if not stated.",
        |row| expression_source(&row.expression).into(),
    ),
    Column::new(
        "media",
        Type::Text,
        "Reference to recorded media; null if none.",
        |row| {
            Some(&row.expression.media)
                .filter(|media| !media.is_empty())
                .into()
        },
    ),
    Column::new(
        "taken_at",
        Type::Time,
        "When the sender captured it, by its own clock; null if not stated.",
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

/// The source of an expression, if stated.
fn expression_source(expression: &Expression) -> Option<&'static str> {
    match expression.source() {
        ExpressionSource::Unspecified => None,
        ExpressionSource::Face => Some("face"),
        ExpressionSource::Voice => Some("voice"),
        ExpressionSource::SelfReport => Some("self_report"),
        ExpressionSource::Model => Some("model"),
    }
}

/// Microseconds since the Unix epoch, truncated.
fn moment_us(moment: &chefshat_proto::Timestamp) -> i64 {
    moment
        .seconds
        .saturating_mul(1_000_000)
        .saturating_add(i64::from(moment.nanos / 1000))
}
