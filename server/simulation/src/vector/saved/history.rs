//! The bytes of a history, a part of a saved game.

use chefshat_engine::ActionId;

use super::reader::Reader;
use crate::vector::columns::NO_SEAT;
use crate::vector::error::StateError;
use crate::vector::history::{Entry, History, Seen};
use crate::vector::terms::Terms;

/// Bytes of an entry.
const ENTRY: usize = 5;

pub(super) fn put_history(out: &mut Vec<u8>, history: &History) {
    out.extend(history.dropped.to_le_bytes());
    out.push(history.declined.map_or(NO_SEAT, |seat| seat.index() as u8));
    out.push(history.exchanged.into());
    out.extend((history.entries.len() as u32).to_le_bytes());
    for entry in &history.entries {
        out.push(entry.seat.index() as u8);
        out.extend(entry.action.index().to_le_bytes());
        out.extend(match entry.seen {
            Seen::Public => [0, NO_SEAT],
            Seen::Own => [1, NO_SEAT],
            Seen::Gift(receiver) => [2, receiver.index() as u8],
        });
    }
}

pub(super) fn history(reader: &mut Reader<'_>, terms: &Terms) -> Result<History, StateError> {
    let impossible = StateError::Malformed("its history is impossible");
    let players = terms.rules.players();
    let size = terms.rules.actions().size();
    let dropped = reader.u32()?;
    let declined = reader.seat_or_none(players)?;
    let exchanged = reader.flag()?;
    let count = reader.count(ENTRY)?;
    if count > History::most_kept(terms.history) || dropped > terms.rules.max_turns() {
        return Err(impossible);
    }
    let entries = (0..count).map(|_| {
        let (seat, action) = (reader.seat(players)?, ActionId::new(reader.u16()?));
        let seen = match (reader.u8()?, reader.seat_or_none(players)?) {
            (0, None) => Seen::Public,
            (1, None) => Seen::Own,
            (2, Some(receiver)) => Seen::Gift(receiver),
            _ => return Err(impossible.clone()),
        };
        if action.index() >= size {
            return Err(impossible.clone());
        }
        Ok(Entry { seat, action, seen })
    });
    Ok(History {
        entries: entries.collect::<Result<_, _>>()?,
        dropped,
        declined,
        exchanged,
    })
}
