//! Who did what since a Shift began, as each seat may know it: an information state with perfect
//! recall. Plays, passes and declarations are public. A gift is an entry of its giver; its card is
//! seen by the giver, and by the receiver once the exchange is complete: two cards of one giver then
//! ascending, since they arrive together. A declined special action is seen by the seat that
//! declined alone.

use std::collections::VecDeque;

use chefshat_engine::{
    Action, ActionId, ActionSpace, Cards, Event, Face, GameState, Requirement, Seat,
};

/// The most entries of a history column.
pub const MAX_HISTORY: u16 = 1024;
/// Entries kept at least, so that an exchange is complete in them.
const LEAST_KEPT: usize = 16;

/// Who sees the action of an entry.
#[derive(Copy, Clone, Eq, PartialEq, Debug)]
pub(super) enum Seen {
    /// Everybody.
    Public,
    /// The seat alone; others do not see that there is an entry.
    Own,
    /// The giver, and the receiver after the exchange; others see that a card was given.
    Gift(Seat),
}

/// An action of a seat.
#[derive(Copy, Clone, Eq, PartialEq, Debug)]
pub(super) struct Entry {
    pub(super) seat: Seat,
    pub(super) action: ActionId,
    pub(super) seen: Seen,
}

/// An entry as a seat may know it.
#[derive(Copy, Clone, PartialEq, Debug)]
pub(super) struct Known {
    pub(super) seat: Seat,
    /// `None` for a gift of an unknown card.
    pub(super) action: Option<ActionId>,
    /// Who received the card, if it is a gift.
    pub(super) receiver: Option<Seat>,
}

/// The latest actions of a Shift.
#[derive(Clone, PartialEq, Debug)]
pub(super) struct History {
    pub(super) entries: VecDeque<Entry>,
    /// Entries of this Shift that are not kept any more, without that of `declined`.
    pub(super) dropped: u32,
    /// The seat whose entry [`Seen::Own`] is not kept any more.
    pub(super) declined: Option<Seat>,
    /// Whether the exchange of this Shift is complete.
    pub(super) exchanged: bool,
}

/// The number of an entry in a column: 0 for none, else 1 + seat * (A+1) + action, where action A
/// is a gift of an unknown card.
fn number(space: ActionSpace, seat: Seat, action: Option<ActionId>) -> u16 {
    let code = action.map_or(space.size(), ActionId::index);
    1 + seat.index() as u16 * (space.size() + 1) + code
}

impl History {
    /// A Shift without actions.
    pub(super) fn new() -> History {
        History {
            entries: VecDeque::new(),
            dropped: 0,
            declined: None,
            exchanged: false,
        }
    }

    /// The most entries kept for a column of this width.
    pub(super) fn most_kept(width: u16) -> usize {
        // One more than the column shows, because one may be hidden.
        usize::from(width).max(LEAST_KEPT) + 1
    }

    /// Adds a decision, given what it had to be, and its events up to the next deal.
    pub(super) fn add(
        &mut self,
        width: u16,
        seat: Seat,
        required: Option<Requirement>,
        action: ActionId,
        events: &[Event],
        space: ActionSpace,
    ) {
        let seen = match (required, space.decode(action)) {
            (Some(Requirement::Gift(gift)), _) => Seen::Gift(gift.receiver),
            (_, Some(Action::Decline)) => Seen::Own,
            _ => Seen::Public,
        };
        self.push(width, Entry { seat, action, seen });
        for event in events {
            match *event {
                Event::ShiftStarted { .. } => return,
                Event::CardsExchanged {
                    giver,
                    receiver,
                    cards: Some(cards),
                    ..
                } => {
                    self.exchanged = true;
                    self.forced(width, giver, receiver, cards, space);
                }
                _ => {}
            }
        }
    }

    /// Adds the gifts of a seat that had no choice.
    fn forced(
        &mut self,
        width: u16,
        giver: Seat,
        receiver: Seat,
        cards: Cards,
        space: ActionSpace,
    ) {
        let mut given = self.entries.iter();
        if given.any(|entry| entry.seat == giver && matches!(entry.seen, Seen::Gift(_))) {
            return;
        }
        for face in (1..=space.faces()).filter_map(Face::new) {
            for _ in 0..cards.count(face) {
                let action = space.give(face).expect("a face of the deck");
                let seen = Seen::Gift(receiver);
                let seat = giver;
                self.push(width, Entry { seat, action, seen });
            }
        }
    }

    fn push(&mut self, width: u16, entry: Entry) {
        self.entries.push_back(entry);
        if self.entries.len() > History::most_kept(width) {
            match self.entries.pop_front() {
                Some(Entry {
                    seat,
                    seen: Seen::Own,
                    ..
                }) => self.declined = Some(seat),
                _ => self.dropped = self.dropped.saturating_add(1),
            }
        }
    }

    /// The gift that a receiver sees in place of this one: of the two cards that one giver gives at
    /// most, the lower comes first. If the first is not kept any more, no column shows the second.
    fn received(&self, index: usize) -> ActionId {
        let gift = self.entries[index];
        let mut others = self.entries.iter().enumerate().filter(|(other, entry)| {
            *other != index && entry.seat == gift.seat && matches!(entry.seen, Seen::Gift(_))
        });
        match others.next() {
            Some((first, entry)) if first < index => gift.action.max(entry.action),
            Some((_, entry)) => gift.action.min(entry.action),
            None => gift.action,
        }
    }

    /// The kept entries that a seat may know.
    fn known(&self, viewer: Seat) -> impl Iterator<Item = Known> + Clone {
        let entries = self.entries.iter().enumerate();
        entries.filter_map(move |(index, entry)| {
            let own = entry.seat == viewer;
            let (action, receiver) = match entry.seen {
                Seen::Public => (Some(entry.action), None),
                Seen::Own if own => (Some(entry.action), None),
                Seen::Own => return None,
                Seen::Gift(to) if own => (Some(entry.action), Some(to)),
                Seen::Gift(to) => {
                    let known = to == viewer && self.exchanged;
                    (known.then(|| self.received(index)), Some(to))
                }
            };
            Some(Known {
                seat: entry.seat,
                action,
                receiver,
            })
        })
    }

    /// The entries of the Shift that a seat may know, gifts only once the exchange is complete.
    /// `None` if it has not all that led to this state: some are not kept any more, or the game
    /// began within the Shift.
    pub(super) fn complete(&self, viewer: Seat, state: &GameState) -> Option<Vec<Known>> {
        let count = |of: fn(Seen) -> bool| self.entries.iter().filter(|it| of(it.seen)).count();
        let gifts = count(|seen| matches!(seen, Seen::Gift(_)));
        let given: usize = (state.gave.values())
            .map(|cards| usize::from(cards.len()))
            .sum();
        let public = count(|seen| seen == Seen::Public);
        let done = state.turns as usize + usize::from(state.special.is_some());
        let due = |known: &Known| self.exchanged || known.receiver.is_none();
        ((gifts, public) == (given, done)).then(|| self.known(viewer).filter(due).collect())
    }

    /// Writes the latest entries that a seat may know, the most recent last, after zeros. Returns
    /// the number of all such entries of the Shift.
    pub(super) fn write(
        &self,
        width: u16,
        viewer: Seat,
        space: ActionSpace,
        out: &mut Vec<u8>,
    ) -> u32 {
        let seen = self
            .known(viewer)
            .map(|known| number(space, known.seat, known.action));
        let width = usize::from(width);
        let visible = seen.clone().count();
        let zeros = width.saturating_sub(visible);
        out.extend(std::iter::repeat_n(0, 2 * zeros));
        for number in seen.skip(visible.saturating_sub(width)) {
            out.extend(number.to_le_bytes());
        }
        let kept = visible as u32 + u32::from(self.declined == Some(viewer));
        self.dropped.saturating_add(kept)
    }
}
