//! The table as a viewer knows it from the events of a game: who sits there, what lies on the board, who holds how much. Events go in one by
//! one; nothing here draws, waits or decides.

use std::collections::VecDeque;

use chefshat_client::v1::{self, game_event::Kind};
use chefshat_engine::{PassScope, RuleSet};
use chefshat_record::convert::rules_from_proto;

use super::super::narrator::{MAX_NAME, clean, names};
use super::hand::Hand;
use super::story::{self, Line};

/// Most columns of a room's name: the server takes no longer one.
const MAX_ROOM_NAME: usize = 64;
/// Most lines of the story that are kept.
const MAX_LINES: usize = 2000;

/// One seat.
#[derive(Debug, Clone, Default)]
pub(crate) struct Place {
    /// Name to show; empty while the seat is free.
    pub(crate) name: String,
    pub(crate) kind: v1::ParticipantKind,
    /// The built-in agent that plays it, or that stands in for its own; empty otherwise.
    pub(crate) built_in: String,
    /// Somebody is connected to it.
    pub(crate) connected: bool,
    pub(crate) substituted: bool,
    pub(crate) role: v1::Role,
    /// Cards left.
    pub(crate) cards: u32,
    pub(crate) points: u64,
    /// Out of this pizza.
    pub(crate) passed: bool,
    /// Place in this Shift, from 1, once it has finished.
    pub(crate) finished: Option<u32>,
    /// The hand, where it is known.
    pub(crate) hand: Option<Hand>,
}

/// What lies on the board, and whose it was.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct OnBoard {
    pub(crate) seat: u32,
    /// F+1 for a joker alone.
    pub(crate) face: u32,
    pub(crate) quantity: u32,
    pub(crate) jokers: u32,
    /// The Golden card is among them.
    pub(crate) golden: bool,
}

/// How a game ended.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum End {
    Finished(Vec<v1::Standing>),
    Aborted(v1::AbortReason),
}

/// A table.
#[derive(Debug, Clone, Default)]
pub(crate) struct Table {
    pub(crate) room_name: String,
    pub(crate) game_id: String,
    pub(crate) rules: Option<RuleSet>,
    pub(crate) hand_size: u32,
    /// Index = seat.
    pub(crate) seats: Vec<Place>,
    pub(crate) started: bool,
    /// Shift, from 1; 0 before the first.
    pub(crate) shift: u32,
    /// Pizza of the Shift, from 1.
    pub(crate) pizza: u32,
    /// Turns of this Shift so far.
    pub(crate) turns: u32,
    pub(crate) board: Option<OnBoard>,
    /// Who is to act, where the events say so.
    pub(crate) turn: Option<u32>,
    /// Seats in the order in which they finished the last Shift.
    pub(crate) last_order: Vec<u32>,
    /// What happened, oldest first: the last of the lines that were told.
    pub(crate) story: VecDeque<Line>,
    /// How many lines were told.
    pub(crate) told: usize,
    pub(crate) end: Option<End>,
}

impl Table {
    /// The table of a room before any of its events is known.
    pub(crate) fn of_room(room: &v1::Room) -> Self {
        let mut table = Self {
            room_name: clean(&room.name, MAX_ROOM_NAME),
            game_id: room.game_id.clone(),
            rules: room.rules.as_ref().and_then(|it| rules_from_proto(it).ok()),
            ..Self::default()
        };
        table.seat_all(&room.seats);
        table
    }

    /// Faces of the deck.
    pub(crate) fn faces(&self) -> u32 {
        self.rules.map_or(11, |rules| rules.faces().into())
    }

    /// A seat, if the table has it.
    pub(crate) fn seat(&self, seat: u32) -> Option<&Place> {
        self.seats.get(usize::try_from(seat).ok()?)
    }

    fn seat_mut(&mut self, seat: u32) -> Option<&mut Place> {
        self.seats.get_mut(usize::try_from(seat).ok()?)
    }

    /// What a seat is called.
    pub(crate) fn name(&self, seat: u32) -> String {
        match self.seat(seat) {
            Some(place) if !place.name.is_empty() => place.name.clone(),
            _ => format!("seat {seat}"),
        }
    }

    /// How many seats nobody has taken yet.
    pub(crate) fn free_seats(&self) -> usize {
        let free = |place: &&Place| place.name.is_empty();
        self.seats.iter().filter(free).count()
    }

    /// Takes one event.
    pub(crate) fn apply(&mut self, event: &v1::GameEvent) {
        let Some(kind) = &event.kind else {
            return;
        };
        // Told first: whose cards they were is forgotten afterwards.
        let lines = story::of(self, kind);
        self.fold(kind);
        self.told += lines.len();
        self.story.extend(lines);
        while self.story.len() > MAX_LINES {
            self.story.pop_front();
        }
    }

    fn fold(&mut self, kind: &Kind) {
        match kind {
            Kind::Seated(seated) => {
                let name = clean(&seated.name, MAX_NAME);
                if let Some(place) = self.seat_mut(seated.seat) {
                    place.name = name;
                    place.kind = seated.kind();
                }
            }
            Kind::Vacated(seat) => {
                if let Some(place) = self.seat_mut(seat.seat) {
                    *place = Place::default();
                }
            }
            Kind::Disconnected(seat) => self.with(seat.seat, |place| place.connected = false),
            Kind::Returned(seat) => self.with(seat.seat, |place| {
                place.connected = true;
                if place.substituted {
                    place.substituted = false;
                    place.built_in.clear();
                }
            }),
            Kind::Substituted(seat) => {
                let agent = clean(&seat.built_in_agent, MAX_NAME);
                self.with(seat.seat, |place| {
                    place.substituted = true;
                    place.built_in = agent;
                });
            }
            Kind::GameStarted(start) => self.game_started(start),
            Kind::ShiftStarted(start) => self.shift_started(start),
            Kind::RolesAssigned(assigned) => {
                for (place, role) in self.seats.iter_mut().zip(assigned.roles()) {
                    place.role = role;
                }
            }
            Kind::CardsExchanged(cards) => self.exchanged(cards),
            Kind::Play(play) => self.played(play),
            Kind::Pass(pass) => {
                self.turns = self.turns.saturating_add(1);
                self.with(pass.seat, |place| place.passed = true);
                self.turn = self.next_after(pass.seat);
            }
            Kind::PizzaDone(done) => {
                self.board = None;
                self.pizza = done.pizza.saturating_add(1);
                self.forget_passes();
                self.turn = Some(done.next_leader);
            }
            Kind::SeatFinished(finished) => {
                self.with(finished.seat, |place| {
                    place.finished = Some(finished.place);
                });
                // Its turn may have been thought to come again.
                self.turn = self.next_after(finished.seat);
            }
            Kind::ShiftEnded(end) => {
                for (place, seat) in (1u32..).zip(&end.order) {
                    self.with(*seat, |it| it.finished = Some(place));
                }
                for (place, points) in self.seats.iter_mut().zip(&end.points) {
                    place.points = *points;
                }
                self.last_order.clone_from(&end.order);
                self.turn = None;
            }
            Kind::GameEnded(end) => self.end = Some(End::Finished(end.standings.clone())),
            Kind::GameAborted(end) => {
                self.turn = None;
                self.end = Some(End::Aborted(end.reason()));
            }
            Kind::SpecialActionDeclared(_)
            | Kind::ExpressionShown(_)
            | Kind::ServerRestarted(_) => {}
        }
    }

    fn with(&mut self, seat: u32, change: impl FnOnce(&mut Place)) {
        if let Some(place) = self.seat_mut(seat) {
            change(place);
        }
    }

    fn forget_passes(&mut self) {
        for place in &mut self.seats {
            place.passed = false;
        }
    }

    fn seat_all(&mut self, seats: &[v1::Participant]) {
        let named = names(seats).into_iter().zip(seats);
        self.seats = named
            .map(|(name, seat)| Place {
                name: if seat.name.is_empty() {
                    String::new()
                } else {
                    name
                },
                kind: seat.kind(),
                built_in: clean(&seat.built_in_agent, MAX_NAME),
                connected: seat.connected,
                substituted: seat.substituted,
                ..Place::default()
            })
            .collect();
    }

    fn game_started(&mut self, start: &v1::GameStarted) {
        self.started = true;
        self.game_id.clone_from(&start.game_id);
        self.rules = (start.rules.as_ref()).and_then(|it| rules_from_proto(it).ok());
        self.hand_size = start.hand_size;
        self.seat_all(&start.seats);
    }

    fn shift_started(&mut self, start: &v1::ShiftStarted) {
        self.shift = start.shift;
        self.pizza = 1;
        self.turns = 0;
        self.board = None;
        self.turn = None;
        let hand_size = self.hand_size;
        for place in &mut self.seats {
            place.cards = hand_size;
            place.passed = false;
            place.finished = None;
            place.role = v1::Role::Unspecified;
            place.hand = None;
        }
        let faces = usize::try_from(self.faces()).unwrap_or(0);
        for hand in &start.hands {
            let known = Hand::of(faces, &hand.cards, hand.golden);
            self.with(hand.seat, |place| place.hand = Some(known));
        }
    }

    fn exchanged(&mut self, cards: &v1::CardsExchanged) {
        let count = cards.count;
        self.with(cards.giver, |place| {
            place.cards = place.cards.saturating_sub(count);
            if let Some(hand) = &mut place.hand {
                for card in &cards.cards {
                    hand.take(*card, 1);
                }
                hand.golden &= !cards.golden;
            }
        });
        self.with(cards.receiver, |place| {
            place.cards = place.cards.saturating_add(count);
            if let Some(hand) = &mut place.hand {
                hand.put(&cards.cards);
                hand.golden |= cards.golden;
            }
        });
    }

    fn played(&mut self, play: &v1::Play) {
        let golden = self.plays_golden(play);
        self.turns = self.turns.saturating_add(1);
        if self.rules.map(|rules| rules.pass_scope()) == Some(PassScope::Turn) {
            self.forget_passes();
        }
        let top = self.faces();
        self.with(play.seat, |place| {
            place.cards = play.cards_left;
            place.passed = false;
            if let Some(hand) = &mut place.hand {
                if play.face <= top {
                    hand.take(play.face, play.quantity);
                }
                hand.take(top + 1, play.jokers);
                hand.golden &= !golden;
            }
        });
        self.board = Some(OnBoard {
            seat: play.seat,
            face: play.face,
            quantity: play.quantity,
            jokers: play.jokers,
            golden,
        });
        self.turn = self.next_after(play.seat);
    }

    /// Whether the Golden card is among what is being played, as far as that is known: it opens a Shift where the rules say so; else it goes
    /// last of its face, which only a known hand can tell.
    pub(super) fn plays_golden(&self, play: &v1::Play) -> bool {
        if play.face != self.faces() {
            return false;
        }
        let opens = self.turns == 0
            && self.rules.map(|rules| rules.opening()) == Some(chefshat_engine::Opening::Golden);
        let last = self.seat(play.seat).and_then(|place| place.hand.as_ref());
        let last = last.is_some_and(|hand| {
            let of_face = hand.counts.iter().rev().nth(1).copied().unwrap_or(0);
            hand.golden && u32::from(of_face) <= play.quantity
        });
        opens || last
    }

    /// The next seat to the left that holds cards and has not passed.
    fn next_after(&self, seat: u32) -> Option<u32> {
        let seats = u32::try_from(self.seats.len()).ok()?;
        (1..=seats)
            .map(|step| seat.saturating_add(step) % seats)
            .find(|seat| {
                self.seat(*seat)
                    .is_some_and(|place| place.cards > 0 && !place.passed)
            })
    }
}
