//! What the server has sent a seat so far: the state of the game, its events in words, the open
//! decision. Takes updates, and has no connection or clock: `seat` has them, `text` words the state.

use chefshat_client::v1::{self, game_event::Kind, seat_update::Update};
use chefshat_engine::ActionSpace;

use super::events::{self, EventText};
use crate::narration::awaited::{AwaitedSeat, left_ms};
use crate::narration::hand::Hand;
use crate::narration::story;
use crate::narration::view::GameView;

/// An open decision.
#[derive(Debug)]
pub struct Open {
    /// The request.
    pub request: v1::DecisionRequest,
    /// When it arrived, or the game was resumed.
    since_ms: u64,
}

/// A seat as its participant knows it.
#[derive(Debug)]
pub struct Live {
    /// What the seat sees.
    pub view: GameView,
    /// The seat, once it is known.
    pub me: Option<u32>,
    /// What happened, oldest first.
    pub events: Vec<EventText>,
    /// The decision that is open.
    pub open: Option<Open>,
    /// Whom the game waits for.
    pub awaited: Option<AwaitedSeat>,
    /// Cards that all seats have played in this Shift.
    pub played: Hand,
    /// Why no more updates come although the game has not ended.
    pub lost: Option<String>,
    /// Whether that is because the game is over, or the server does not know the seat.
    pub is_gone: bool,
}

impl Live {
    /// A seat of a room, before its first update.
    pub fn new(view: GameView, me: Option<u32>) -> Self {
        Self {
            view,
            me,
            events: Vec::new(),
            open: None,
            awaited: None,
            played: Hand::default(),
            lost: None,
            is_gone: false,
        }
    }

    /// Number of the last event; 0 before the first.
    pub fn sequence(&self) -> u64 {
        self.events.last().map_or(0, |event| event.sequence)
    }

    /// The numbering of actions.
    pub fn space(&self) -> ActionSpace {
        let faces = u8::try_from(self.view.faces()).ok();
        faces
            .and_then(ActionSpace::new)
            .expect("rule sets have 4 to 15 faces")
    }

    /// Whether the game has ended for this seat.
    pub fn is_over(&self) -> bool {
        self.view.end.is_some() || self.lost.is_some()
    }

    /// Whether a substitute plays for this seat, until it says that it is back.
    pub fn is_substituted(&self) -> bool {
        let me = self.me.and_then(|me| self.view.seat(me));
        !self.is_over() && me.is_some_and(|seat| seat.substituted)
    }

    /// Whether the participant has to act, or will never have to again.
    pub fn concerns_me(&self) -> bool {
        self.open.is_some() || self.is_over()
    }

    /// Milliseconds left for the open decision, and then in the time bank: all of them while a
    /// physical table is paused, and again from then on.
    pub fn left_ms(&self, now_ms: u64) -> Option<(u64, u64)> {
        let open = self.open.as_ref()?;
        let gone_ms = match self.view.paused {
            true => 0,
            false => now_ms.saturating_sub(open.since_ms),
        };
        Some(left_ms(&open.request, gone_ms))
    }

    /// Takes an update that arrived at `now_ms`.
    pub fn take(&mut self, update: Update, now_ms: u64) {
        match update {
            Update::Attached(attached) => {
                self.me = Some(attached.seat);
                self.open = None;
                self.awaited = None;
                self.view.substitute(attached.seat, None);
            }
            Update::Substitution(substitution) => {
                if let Some(me) = self.me {
                    self.view.substitute(me, substitution.active.then_some(""));
                }
            }
            Update::Awaited(awaited) => self.awaited = AwaitedSeat::new(&awaited, now_ms),
            Update::Events(batch) => {
                (batch.events.iter()).for_each(|event| self.event(event, now_ms));
            }
            Update::Decision(request) => {
                self.awaited = None;
                self.open = Some(Open {
                    request,
                    since_ms: now_ms,
                });
            }
            Update::Snapshot(snapshot) => {
                self.view.restore(&snapshot, self.me);
                self.played = Hand::default();
                if let Some(seen) = &snapshot.observation {
                    self.played.counts = seen.played.to_vec();
                }
                self.events.push(EventText {
                    sequence: snapshot.next_sequence.saturating_sub(1),
                    words: story::unknown_before().words,
                    begins_shift: true,
                });
            }
            Update::Result(_) | Update::Refused(_) | Update::Detached(_) | Update::Entered(_) => {}
        }
    }

    /// Closes a decision that was answered, unless the next one is open already.
    pub fn close(&mut self, decision_id: u64) {
        (self.open).take_if(|open| open.request.decision_id == decision_id);
    }

    /// Closes the open decision if it is this one or an earlier one.
    pub fn close_before(&mut self, decision_id: u64) {
        (self.open).take_if(|open| open.request.decision_id <= decision_id);
    }

    fn event(&mut self, event: &v1::GameEvent, now_ms: u64) {
        if self.is_decided_by(event) {
            self.open = None;
        }
        if let (Some(Kind::TablePaused(table)), Some(open)) = (&event.kind, &mut self.open)
            && !table.paused
        {
            open.since_ms = now_ms;
        }
        let text = events::advance(&mut self.view, self.me, event);
        match &event.kind {
            Some(Kind::ShiftStarted(_)) => self.played = Hand::default(),
            Some(Kind::Play(play)) => self.put(play),
            _ => {}
        }
        self.events.push(text);
    }

    fn put(&mut self, play: &v1::Play) {
        let faces = self.view.faces();
        if self.played.counts.is_empty() {
            self.played = Hand::of(usize::try_from(faces).unwrap_or(0), &[], false);
        }
        self.played.add(play.face, play.quantity);
        self.played.add(faces + 1, play.jokers);
    }

    /// Whether an event shows that the open decision was taken without the participant, by a timeout
    /// or a substitute, or makes it void. A decision that is still open is asked again.
    fn is_decided_by(&self, event: &v1::GameEvent) -> bool {
        match &event.kind {
            Some(Kind::Play(play)) => Some(play.seat) == self.me,
            Some(Kind::Pass(pass)) => Some(pass.seat) == self.me,
            Some(Kind::Correction(correction)) => correction.first_void > 0,
            Some(
                Kind::CardsExchanged(_)
                | Kind::SpecialActionDeclared(_)
                | Kind::GameEnded(_)
                | Kind::GameAborted(_),
            ) => true,
            _ => false,
        }
    }
}
