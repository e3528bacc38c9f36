//! Values as the database has them, which the files of this folder share.

use std::borrow::Cow;
use std::time::Duration;

use crate::StoreError;
use crate::sql::integer;
use crate::units::UnitKind;
use chefshat_room::ids::UnitId;

/// The epoch of what has just been created.
pub(super) const FIRST_EPOCH: i64 = 1;

/// Most bytes of a name by which games are found: an index takes no long ones.
const MAX_INDEXED_NAME: usize = 512;

/// The number of rooms in the column `kind` of what nodes own.
pub(super) const ROOM: i16 = 0;
/// That of tournaments.
const TOURNAMENT: i16 = 1;
/// That of studies.
const STUDY: i16 = 2;

/// The number of a kind of unit.
pub(super) fn number_of(kind: UnitKind) -> i16 {
    match kind {
        UnitKind::Tournament => TOURNAMENT,
        UnitKind::Study => STUDY,
    }
}

/// The kind of unit with a number, unless it is a room.
pub(super) fn kind_of(number: i16) -> Option<UnitKind> {
    match number {
        TOURNAMENT => Some(UnitKind::Tournament),
        STUDY => Some(UnitKind::Study),
        _ => None,
    }
}

/// A room or tournament, and the epoch at which its owner writes.
#[derive(Debug, Clone, Copy)]
pub(super) struct Owned {
    pub(super) id: UnitId,
    pub(super) unit: UnitId,
    pub(super) epoch: i64,
}

impl Owned {
    /// Why its owner may not write any more.
    pub(super) fn fenced(self) -> StoreError {
        StoreError::Fenced(self.unit)
    }
}

/// A time in milliseconds.
pub(super) fn millis(time: Duration) -> i64 {
    integer(u64::try_from(time.as_millis()).unwrap_or(u64::MAX))
}

/// A text as the database takes it: it has no NUL.
pub(super) fn text(text: &str) -> Cow<'_, str> {
    match text.contains('\0') {
        true => text.replace('\0', "\u{fffd}").into(),
        false => text.into(),
    }
}

/// A name by which games are found, as the database takes it: the beginning of a long one, as an
/// imported record may have.
pub(super) fn indexed_name(name: &str) -> Cow<'_, str> {
    text(&name[..name.floor_char_boundary(MAX_INDEXED_NAME)])
}
