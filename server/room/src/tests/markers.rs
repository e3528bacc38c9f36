//! Markers of the owner: they are recorded, bounded, and change nothing.

use super::*;
use crate::journal::{AbortReason, Marked};
use crate::{MARKERS_AT_ONCE, MARKERS_PER_SECOND, MAX_MARKER_AHEAD, MAX_MARKERS, MarkError};

fn marked(moment: Duration) -> Marked {
    Marked {
        label: "EEG on".into(),
        moment,
    }
}

#[test]
fn markers_are_numbered_and_in_no_event() {
    let mut table = Table::empty(Policy::default(), vec![OPEN; 4]);
    let events = table.core.log().len();
    let now = Duration::from_secs(5);
    let early = marked(Duration::from_secs(2));
    assert_eq!(table.core.mark(now, early.clone()), Ok(1));
    assert_eq!(table.core.mark(now, marked(now + MAX_MARKER_AHEAD)), Ok(2));
    let late = marked(now + MAX_MARKER_AHEAD + Duration::from_micros(1));
    assert_eq!(table.core.mark(now, late), Err(MarkError::Future));
    assert_eq!(table.core.markers().len(), 2);
    assert_eq!(table.core.markers()[0].marked, early);
    assert_eq!(table.core.markers()[0].received, now);
    assert_eq!(table.core.log().len(), events);
    table.core.abort(now, AbortReason::Closed);
    assert_eq!(table.core.mark(now, marked(now)), Err(MarkError::GameOver));
}

#[test]
fn markers_are_bounded_in_rate_and_number() {
    let mut table = Table::empty(Policy::default(), vec![OPEN; 4]);
    let mut now = Duration::from_secs(1);
    for number in 1..=MARKERS_AT_ONCE {
        let number = usize::try_from(number).expect("a small number");
        assert_eq!(table.core.mark(now, marked(now)), Ok(number));
    }
    assert_eq!(table.core.mark(now, marked(now)), Err(MarkError::TooFast));
    now += Duration::from_secs(1);
    for _ in 0..MARKERS_PER_SECOND {
        assert!(table.core.mark(now, marked(now)).is_ok());
    }
    assert_eq!(table.core.mark(now, marked(now)), Err(MarkError::TooFast));
    while table.core.markers().len() < MAX_MARKERS {
        now += Duration::from_secs(1);
        assert!(table.core.mark(now, marked(now)).is_ok());
    }
    now += Duration::from_secs(60);
    assert_eq!(table.core.mark(now, marked(now)), Err(MarkError::TooMany));
}
