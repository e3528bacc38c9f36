//! The table of markers: one row per marker that the owner of a room or an instrument added. Rows are
//! gathered in `gather`.

use std::sync::Arc;

use chefshat_proto::v1::Marker;

use super::column::{Column, ColumnInfo, Type};
use super::game::GameInfo;

/// Name of the table.
pub(super) const TABLE: &str = "markers";

/// One marker.
#[derive(Debug, Clone)]
pub(super) struct MarkerRow {
    pub(super) game: Arc<GameInfo>,
    pub(super) decisions_before: u64,
    pub(super) marker: Marker,
}

/// The columns, in the order of the files.
pub(super) const COLUMNS: &[Column<MarkerRow>] = &[
    Column::new(
        "game_id",
        Type::Text,
        "Identifies the game: 32 hexadecimal digits.",
        |row| (&row.game.game_id).into(),
    ),
    Column::new(
        "number",
        Type::Uint64,
        "Number of the marker in its game, from 1.",
        |row| row.marker.number.into(),
    ),
    Column::new("label", Type::Text, "What the marker says.", |row| {
        (&row.marker.label).into()
    }),
    Column::new(
        "elapsed_us",
        Type::Uint64,
        "The marked moment, microseconds since the room was created.",
        |row| row.marker.elapsed_us.into(),
    ),
    Column::new(
        "received_ms",
        Type::Uint64,
        "When the server received it, milliseconds since the room was created.",
        |row| row.marker.received_ms.into(),
    ),
    Column::new(
        "decisions_before",
        Type::Uint64,
        "Number of decisions before it was received.",
        |row| row.decisions_before.into(),
    ),
];

/// Names, types and descriptions of the columns.
pub(super) fn columns() -> Vec<ColumnInfo> {
    COLUMNS.iter().map(Column::info).collect()
}
