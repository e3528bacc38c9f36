//! The events of the Shift in progress, as one seat saw them. Nothing hidden from that seat gets
//! past [`ShiftHistory::on_event`].

use chefshat_engine::{Event, Seat, Viewer};

/// What a seat has seen of the Shift in progress.
#[derive(Clone, Debug)]
pub struct ShiftHistory {
    seat: Seat,
    events: Vec<Event>,
}

impl ShiftHistory {
    /// An empty history of a seat. It is complete from the next start of a Shift on.
    pub fn new(seat: Seat) -> ShiftHistory {
        ShiftHistory {
            seat,
            events: Vec::new(),
        }
    }

    /// What a seat has seen of these events, from which on it is complete as above.
    pub fn of<'a>(seat: Seat, events: impl IntoIterator<Item = &'a Event>) -> ShiftHistory {
        let mut history = ShiftHistory::new(seat);
        events.into_iter().for_each(|event| history.on_event(event));
        history
    }

    /// Adds an event, redacted for the seat. The start of a Shift clears what came before.
    pub fn on_event(&mut self, event: &Event) {
        if matches!(event, Event::ShiftStarted { .. }) {
            self.events.clear();
        }
        self.events.push(event.seen_by(Viewer::Seat(self.seat)));
    }

    /// The seat.
    pub fn seat(&self) -> Seat {
        self.seat
    }

    /// The events since the Shift started, as the seat saw them.
    pub fn events(&self) -> &[Event] {
        &self.events
    }
}
