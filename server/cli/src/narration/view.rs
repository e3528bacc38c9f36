//! The state of a game as a viewer knows it from its events: seats, board, hands, turn. The
//! narrator and the terminal client are drawn from it. Nothing here draws or decides.

use chefshat_client::v1::{self, game_event::Kind};
use chefshat_engine::{PassScope, RuleSet};
use chefshat_record::convert::rules_from_proto;

use super::hand::Hand;
use super::text::{MAX_NAME, clean};
use crate::numbers::seat_number;

/// Maximum columns of a room's name, as in the server.
const MAX_ROOM_NAME: usize = 64;

/// A seat as the viewer knows it.
#[derive(Debug, Clone, Default)]
pub struct SeatView {
    /// Display name; empty while the seat is free.
    pub name: String,
    /// What the participant is.
    pub kind: v1::ParticipantKind,
    /// The built-in agent that plays it or substitutes for its participant; empty otherwise.
    pub built_in: String,
    /// Its participant is connected.
    pub connected: bool,
    /// Whether a built-in agent plays for it.
    pub substituted: bool,
    /// The role in this Shift.
    pub role: v1::Role,
    /// Cards in hand.
    pub cards: u32,
    /// The points so far.
    pub points: u64,
    /// Out of this pizza.
    pub passed: bool,
    /// Place in this Shift, from 1, once it has finished.
    pub finished: Option<u32>,
    /// The hand, if the viewer may see it.
    pub hand: Option<Hand>,
}

/// The play on the board and its seat.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct OnBoard {
    /// The seat that played.
    pub seat: u32,
    /// F+1 for a joker alone.
    pub face: u32,
    /// How many cards, jokers included.
    pub quantity: u32,
    /// How many of them are jokers.
    pub jokers: u32,
    /// The Golden card is among them.
    pub golden: bool,
}

/// How a game ended.
#[derive(Debug, Clone, PartialEq)]
pub enum End {
    /// It has a result.
    Finished(Vec<v1::Standing>),
    /// It has none.
    Aborted(v1::AbortReason),
}

/// A game as the viewer knows it.
#[derive(Debug, Clone, Default)]
pub struct GameView {
    /// The name of the room.
    pub room_name: String,
    /// The id of the game.
    pub game_id: String,
    /// The rules, once they are known.
    pub rules: Option<RuleSet>,
    /// How many cards each seat is dealt.
    pub hand_size: u32,
    /// Index = seat.
    pub seats: Vec<SeatView>,
    /// Whether the first Shift has started.
    pub started: bool,
    /// Shift, from 1; 0 before the first.
    pub shift: u32,
    /// Pizza of the Shift, from 1.
    pub pizza: u32,
    /// Turns of this Shift so far.
    pub turns: u32,
    /// The play that must be beaten.
    pub board: Option<OnBoard>,
    /// The seat to act, once the events determine it.
    pub turn: Option<u32>,
    /// Seats in the order in which they finished the last Shift.
    pub last_order: Vec<u32>,
    /// How the game ended.
    pub end: Option<End>,
    /// At a physical table: the game is paused, and the clocks stand still.
    pub paused: bool,
    /// At a physical table: what a correction rebuilds the view from.
    pub history: Option<Box<History>>,
}

/// The events of a physical table that are not void, and the view before them.
#[derive(Debug, Clone, Default)]
pub struct History {
    start: GameView,
    events: Vec<v1::GameEvent>,
}

impl GameView {
    /// A room before its first event.
    pub fn of_room(room: &v1::Room) -> Self {
        let mut view = Self {
            room_name: clean(&room.name, MAX_ROOM_NAME),
            game_id: room.game_id.clone(),
            rules: room.rules.as_ref().and_then(|it| rules_from_proto(it).ok()),
            ..Self::default()
        };
        view.hand_size = view.rules.map_or(0, |rules| rules.hand_size().into());
        view.seat_all(&room.seats);
        if room.origin() == v1::GameOrigin::Physical {
            view.history = Some(Box::new(History {
                start: view.clone(),
                events: Vec::new(),
            }));
        }
        view
    }

    /// Faces of the deck.
    pub fn faces(&self) -> u32 {
        self.rules.map_or(11, |rules| rules.faces().into())
    }

    /// A seat, if the game has it.
    pub fn seat(&self, seat: u32) -> Option<&SeatView> {
        self.seats.get(usize::try_from(seat).ok()?)
    }

    /// A substitute plays for a seat from now on: an agent of this name; `None`: none does.
    pub fn substitute(&mut self, seat: u32, agent: Option<&str>) {
        self.with(seat, |place| {
            if agent.is_some() || place.substituted {
                place.substituted = agent.is_some();
                place.built_in = clean(agent.unwrap_or_default(), MAX_NAME);
            }
        });
    }

    /// Takes a snapshot in place of the events so far. It does not say whose turn it is, and of the
    /// turns of this Shift only whether there were any.
    pub fn restore(&mut self, snapshot: &v1::Snapshot, me: Option<u32>) {
        let (Some(start), Some(seen)) = (&snapshot.game_started, &snapshot.observation) else {
            return;
        };
        self.game_started(start);
        self.shift = seen.shift;
        self.pizza = seen.pizza.max(1);
        self.turns = u32::from(self.pizza > 1 || seen.played.iter().any(|count| *count > 0));
        self.turn = None;
        self.last_order.clear();
        self.board = seen.board_owner.map(|seat| OnBoard {
            seat,
            face: seen.board_face,
            quantity: if seen.board_face > self.faces() {
                0
            } else {
                seen.board_size.saturating_sub(seen.board_jokers)
            },
            jokers: seen.board_jokers,
            golden: false,
        });
        // The events of an exchange come when it is complete, and take what is given already.
        let is_exchange = seen.pizza == 0;
        let of = |counts: &[u8], index: usize| counts.get(index).copied().unwrap_or_default();
        for (index, place) in self.seats.iter_mut().enumerate() {
            place.cards = if is_exchange {
                start.hand_size
            } else {
                of(&seen.cards_left, index).into()
            };
            place.passed = of(&seen.passed, index) > 0;
            place.finished = Some(of(&seen.places, index).into()).filter(|place| *place > 0);
            place.role = i32::from(of(&seen.roles, index))
                .try_into()
                .unwrap_or_default();
            place.points = seen.points.get(index).copied().unwrap_or_default();
        }
        if let Some(me) = me.filter(|_| !seen.hand.is_empty()) {
            let given = if is_exchange { &*seen.gave } else { &[] };
            let held = seen.hand.iter().enumerate();
            let hand = Hand {
                counts: held
                    .map(|(index, count)| count.saturating_add(of(given, index)))
                    .collect(),
                golden: seen.golden,
            };
            self.with(me, |place| place.hand = Some(hand));
        }
    }

    fn seat_mut(&mut self, seat: u32) -> Option<&mut SeatView> {
        self.seats.get_mut(usize::try_from(seat).ok()?)
    }

    /// Display name of a seat.
    pub fn name(&self, seat: u32) -> String {
        match self.seat(seat) {
            Some(place) if !place.name.is_empty() => place.name.clone(),
            _ => format!("seat {}", seat_number(seat)),
        }
    }

    /// Whether the cards are real and those of a seat are not yet known to the server.
    pub fn awaits_hand(&self, seat: u32) -> bool {
        let unknown = |it: &SeatView| it.hand.is_none() && it.cards > 0;
        self.history.is_some() && self.seat(seat).is_some_and(unknown)
    }

    /// Number of free seats.
    pub fn free_seats(&self) -> usize {
        let free = |place: &&SeatView| place.name.is_empty();
        self.seats.iter().filter(free).count()
    }

    /// Applies an event.
    pub fn apply(&mut self, event: &v1::GameEvent) {
        let Some(mut history) = self.history.take() else {
            return self.step(event);
        };
        history.events.push(event.clone());
        match first_void(event) {
            None => self.step(event),
            Some(first) => {
                (history.events).retain(|past| past.sequence < first || is_of_room(past));
                self.clone_from(&history.start);
                history.events.iter().for_each(|past| self.step(past));
            }
        }
        self.history = Some(history);
    }

    fn step(&mut self, event: &v1::GameEvent) {
        let Some(kind) = &event.kind else {
            return;
        };
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
                    *place = SeatView::default();
                }
            }
            Kind::Disconnected(seat) => self.with(seat.seat, |place| place.connected = false),
            Kind::Returned(seat) => {
                self.with(seat.seat, |place| place.connected = true);
                self.substitute(seat.seat, None);
            }
            Kind::Substituted(seat) => self.substitute(seat.seat, Some(&seat.built_in_agent)),
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
                // The turn may have been assigned to this seat.
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
            Kind::HandReported(reported) => self.hand_reported(reported),
            Kind::SpecialActionDeclared(_)
            | Kind::ExpressionShown(_)
            | Kind::ServerRestarted(_)
            | Kind::Violation(_)
            | Kind::Correction(_) => {}
            Kind::TablePaused(table) => self.paused = table.paused,
        }
    }

    fn with(&mut self, seat: u32, change: impl FnOnce(&mut SeatView)) {
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
            .map(|(name, seat)| SeatView {
                name: if seat.name.is_empty() {
                    String::new()
                } else {
                    name
                },
                kind: seat.kind(),
                built_in: clean(&seat.built_in_agent, MAX_NAME),
                connected: seat.connected,
                substituted: seat.substituted,
                ..SeatView::default()
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
        // The events of a long game may begin in its middle.
        self.started = true;
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

    /// Without cards, the viewer may not see them.
    fn hand_reported(&mut self, reported: &v1::HandReported) {
        let faces = usize::try_from(self.faces()).unwrap_or(0);
        if let Some(hand) = reported.hand.as_ref().filter(|it| !it.cards.is_empty()) {
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

    /// Whether a play that comes next contains the Golden card: it opens a Shift if the rules say
    /// so; otherwise it is the last of its face to be played, which only a known hand shows.
    pub fn plays_golden(&self, play: &v1::Play) -> bool {
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

/// The first event that a correction makes void.
fn first_void(event: &v1::GameEvent) -> Option<u64> {
    match &event.kind {
        Some(Kind::Correction(correction)) => Some(correction.first_void).filter(|it| *it > 0),
        _ => None,
    }
}

/// Whether an event stays when a correction makes the events of the game before it void.
fn is_of_room(event: &v1::GameEvent) -> bool {
    matches!(
        event.kind,
        Some(
            Kind::Seated(_)
                | Kind::Vacated(_)
                | Kind::Disconnected(_)
                | Kind::Returned(_)
                | Kind::Substituted(_)
                | Kind::ExpressionShown(_)
                | Kind::ServerRestarted(_)
                | Kind::HandReported(_)
                | Kind::Violation(_)
                | Kind::Correction(_)
                | Kind::TablePaused(_)
        )
    )
}

/// Display names: short, safe and unique.
fn names(seats: &[v1::Participant]) -> Vec<String> {
    let short: Vec<String> = seats
        .iter()
        .map(|seat| clean(&seat.name, MAX_NAME))
        .collect();
    (0u32..)
        .zip(&short)
        .map(|(seat, name)| {
            let number = seat_number(seat);
            let alike = short.iter().filter(|other| *other == name).count();
            if name.is_empty() {
                format!("seat {number}")
            } else if alike > 1 {
                format!("{}#{number}", clean(name, MAX_NAME - 2))
            } else {
                name.clone()
            }
        })
        .collect()
}
