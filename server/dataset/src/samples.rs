//! The table of samples: one row per value of a channel, from the files beside the records.

use std::io;
use std::path::Path;
use std::sync::Arc;

use chefshat_proto::v1::SampleChunk;
use chefshat_record::samples;

use super::column::{Column, ColumnInfo, Type, Value};
use super::export::Skipped;
use super::game::{GameInfo, SeatInfo};

/// Name of the table.
pub(super) const TABLE: &str = "samples";

/// One value of a channel.
#[derive(Debug, Clone)]
pub(super) struct SampleRow {
    pub(super) game: Arc<GameInfo>,
    pub(super) seat: usize,
    pub(super) player: Arc<SeatInfo>,
    pub(super) stream: Arc<str>,
    pub(super) channel: Arc<str>,
    pub(super) elapsed_us: u64,
    pub(super) value: f32,
}

/// The columns, in the order of the files.
pub(super) const COLUMNS: &[Column<SampleRow>] = &[
    Column::new(
        "game_id",
        Type::Text,
        "Identifies the game: 32 hexadecimal digits.",
        |row| (&row.game.game_id).into(),
    ),
    Column::new("seat", Type::Uint8, "The seat, from 0.", |row| {
        Value::Uint(row.seat as u64)
    }),
    Column::new("agent", Type::Text, "Name of the participant.", |row| {
        (&row.player.name).into()
    }),
    Column::new(
        "agent_kind",
        Type::Text,
        "Kind of participant: `agent`, `human`, `robot` or `model`.",
        |row| row.player.kind.into(),
    ),
    Column::new(
        "stream",
        Type::Text,
        "Name of the stream, for example `affect`.",
        |row| (&*row.stream).into(),
    ),
    Column::new(
        "channel",
        Type::Text,
        "Name of the channel, for example `valence`.",
        |row| (&*row.channel).into(),
    ),
    Column::new(
        "elapsed_us",
        Type::Uint64,
        "Time of the sample, microseconds since the room was created.",
        |row| row.elapsed_us.into(),
    ),
    Column::new(
        "value",
        Type::Float32,
        "The value; null where there was none.",
        |row| Some(row.value).filter(|value| !value.is_nan()).into(),
    ),
];

/// Names, types and descriptions of the columns.
pub(super) fn columns() -> Vec<ColumnInfo> {
    COLUMNS.iter().map(Column::info).collect()
}

/// Passes the rows of a game to `write`, chunk by chunk: those of the files beside its record.
/// Returns the files that cannot be read to their end, whose chunks before are passed on.
///
/// # Errors
/// `write` fails.
pub(super) fn of_game(
    record: &Path,
    game: &Arc<GameInfo>,
    mut write: impl FnMut(&[SampleRow]) -> io::Result<()>,
) -> io::Result<Vec<Skipped>> {
    let mut damaged = Vec::new();
    for (seat, player) in game.seats.iter().enumerate() {
        let Some(path) = samples::beside(record, &game.game_id, seat) else {
            continue;
        };
        let mut written = Ok(());
        let read = samples::read(&path, |chunk| {
            if written.is_ok() {
                written = write(&rows(game, (seat, player), &chunk));
            }
        });
        written?;
        damaged.extend(read.err().map(|error| Skipped {
            path,
            problem: error.to_string(),
        }));
    }
    Ok(damaged)
}

fn rows(
    game: &Arc<GameInfo>,
    (seat, player): (usize, &Arc<SeatInfo>),
    chunk: &SampleChunk,
) -> Vec<SampleRow> {
    let stream: Arc<str> = chunk.stream.as_str().into();
    let channels: Vec<Arc<str>> = chunk.channels.iter().map(|it| it.as_str().into()).collect();
    let samples = chunk
        .elapsed_us
        .iter()
        .zip(chunk.values.chunks(channels.len()));
    let row = |elapsed_us, channel: &Arc<str>, value| SampleRow {
        game: Arc::clone(game),
        seat,
        player: Arc::clone(player),
        stream: Arc::clone(&stream),
        channel: Arc::clone(channel),
        elapsed_us,
        value,
    };
    samples
        .flat_map(|(at, values)| {
            let values = channels.iter().zip(values);
            values.map(move |(channel, value)| (*at, channel, *value))
        })
        .map(|(at, channel, value)| row(at, channel, value))
        .collect()
}
