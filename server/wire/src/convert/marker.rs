//! Markers in the protocol.

use std::time::Duration;

use chefshat_proto::v1;
use chefshat_room::{Core, Marker};

/// The marker with this index in a room.
pub fn marker_to_proto(index: usize, marker: &Marker) -> v1::Marker {
    let micros = |time: Duration| u64::try_from(time.as_micros()).unwrap_or(u64::MAX);
    v1::Marker {
        number: u64::try_from(index + 1).unwrap_or(u64::MAX),
        label: marker.marked.label.clone(),
        elapsed_us: micros(marker.marked.moment),
        received_ms: micros(marker.received) / 1000,
    }
}

/// The last marker of a room.
pub(super) fn last_marker(core: &Core) -> Option<v1::Marker> {
    let (index, marker) = core.markers().iter().enumerate().next_back()?;
    Some(marker_to_proto(index, marker))
}
