//! The table of expressions: one row per expression, public or for the record only. Rows are
//! gathered in `gather`.

use std::sync::Arc;

use chefshat_proto::v1::{Expression, ExpressionSource, GazeFrame, GazePoint, expression::About};

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
        "Kind of participant: `agent`, `human`, `robot`, `model` or `built_in`; null if the seat was free.",
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
        "Source: `face`, `voice`, `self_report`, `model` or `wizard` (a person who played the seat as another kind); null if not stated.",
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
    Column::new(
        "about_seat",
        Type::Uint8,
        "The seat that it is about; null if none.",
        |row| match row.expression.about {
            Some(About::AboutSeat(seat)) => seat.into(),
            _ => Value::Null,
        },
    ),
    Column::new(
        "gaze_x",
        Type::Float32,
        "The point that the participant looked at, from the left edge (0) to the right edge (1) of the frame; null if not stated.",
        |row| gaze(&row.expression).map(|gaze| gaze.x).into(),
    ),
    Column::new(
        "gaze_y",
        Type::Float32,
        "The same from the top edge (0) to the bottom edge (1).",
        |row| gaze(&row.expression).map(|gaze| gaze.y).into(),
    ),
    Column::new(
        "gaze_frame",
        Type::Text,
        "What the coordinates belong to: `screen`, `camera` or `table`; null if not stated.",
        |row| gaze_frame(&row.expression).into(),
    ),
    Column::new(
        "shown_kind",
        Type::Text,
        "What everybody else saw, `robot`, `agent` or `model`, where a person played the seat as that (Wizard of Oz); null for all others.",
        |row| {
            row.player
                .as_ref()
                .and_then(|player| player.shown_kind)
                .into()
        },
    ),
];

/// Names, types and descriptions of the columns.
pub(super) fn columns() -> Vec<ColumnInfo> {
    COLUMNS.iter().map(Column::info).collect()
}

/// The point of gaze of an expression, if it is about one.
fn gaze(expression: &Expression) -> Option<&GazePoint> {
    match &expression.about {
        Some(About::Gaze(gaze)) => Some(gaze),
        _ => None,
    }
}

/// What the coordinates of a point of gaze belong to, if stated.
fn gaze_frame(expression: &Expression) -> Option<&'static str> {
    match gaze(expression)?.frame() {
        GazeFrame::Unspecified => None,
        GazeFrame::Screen => Some("screen"),
        GazeFrame::Camera => Some("camera"),
        GazeFrame::Table => Some("table"),
    }
}

/// The source of an expression, if stated.
fn expression_source(expression: &Expression) -> Option<&'static str> {
    match expression.source() {
        ExpressionSource::Unspecified => None,
        ExpressionSource::Face => Some("face"),
        ExpressionSource::Voice => Some("voice"),
        ExpressionSource::SelfReport => Some("self_report"),
        ExpressionSource::Model => Some("model"),
        ExpressionSource::Wizard => Some("wizard"),
    }
}

/// Microseconds since the Unix epoch, truncated.
fn moment_us(moment: &chefshat_proto::Timestamp) -> i64 {
    moment
        .seconds
        .saturating_mul(1_000_000)
        .saturating_add(i64::from(moment.nanos / 1000))
}
