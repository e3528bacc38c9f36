//! Applies a legal turn: moves the cards, then gives the turn to the next seat, or ends the pizza
//! (`docs/rules.md` §4.6) or the Shift (§4.7).

use super::shift_state::bit;
use super::{Game, Stage};
use crate::{ActionId, Board, Event, Face, Opening, PassScope, Seat};

impl Game {
    pub(super) fn play_face(
        &mut self,
        seat: Seat,
        action: ActionId,
        face: Face,
        quantity: u8,
        jokers: u8,
        on_event: &mut impl FnMut(Event),
    ) {
        let number = face.get();
        let hand = &mut self.hands[seat];
        hand.remove_counts(number, quantity, jokers);
        if hand.has_golden() && number == self.rules.faces() {
            // The opening plays the Golden card first, every later turn plays it last (§8.1).
            let opens = self.state.is_first_turn() && self.rules.opening() == Opening::Golden;
            if opens || hand.count(face) == 0 {
                hand.set_golden(false);
            }
        }
        self.played.add_counts(number, quantity, jokers);
        let size = quantity + jokers;
        self.state.board = Board {
            face: number,
            size,
            jokers,
        };
        self.cards_left[seat] -= size;
        let cards_left = self.cards_left[seat];
        on_event(Event::Played {
            seat,
            action,
            face: number,
            quantity,
            jokers,
            cards_left,
        });
        self.after_play(seat, cards_left, on_event);
    }

    pub(super) fn play_lone_joker(
        &mut self,
        seat: Seat,
        action: ActionId,
        on_event: &mut impl FnMut(Event),
    ) {
        let joker = self.hands[seat].take_joker();
        self.played.add(joker);
        let face = self.rules.faces() + 1;
        self.state.board = Board {
            face,
            size: 1,
            jokers: 1,
        };
        self.cards_left[seat] -= 1;
        let cards_left = self.cards_left[seat];
        on_event(Event::Played {
            seat,
            action,
            face,
            quantity: 0,
            jokers: 1,
            cards_left,
        });
        self.after_play(seat, cards_left, on_event);
    }

    pub(super) fn pass(&mut self, seat: Seat, on_event: &mut impl FnMut(Event)) {
        self.state.passed |= bit(seat);
        on_event(Event::Passed {
            seat,
            cards_left: self.cards_left[seat],
        });
        self.end_turn(seat, on_event);
    }

    #[inline]
    fn after_play(&mut self, seat: Seat, cards_left: u8, on_event: &mut impl FnMut(Event)) {
        let state = &mut self.state;
        state.idle = 0;
        state.last_to_play = Some(seat);
        if self.rules.pass_scope() == PassScope::Turn {
            state.passed = 0;
        }
        if cards_left == 0 {
            let place = state.finish(seat);
            on_event(Event::SeatFinished { seat, place });
        }
        self.end_turn(seat, on_event);
    }

    /// Gives the turn to the left, or ends the pizza or the Shift.
    #[inline]
    fn end_turn(&mut self, seat: Seat, on_event: &mut impl FnMut(Event)) {
        let state = &mut self.state;
        state.turns += 1;
        if state.holding & (state.holding - 1) == 0 {
            return self.end_shift(false, on_event);
        }
        if state.turns >= self.rules.max_turns() {
            self.adjudicate(seat);
            return self.end_shift(true, on_event);
        }
        let next = if state.others_in_pizza() == 0 {
            let (pizza, last_to_play) = (state.pizza, state.last_to_play);
            let next_leader = state.next_pizza();
            on_event(Event::PizzaDone {
                pizza,
                last_to_play,
                next_leader,
            });
            state.move_turn(seat, state.distance_left(seat, bit(next_leader)))
        } else {
            state.move_turn(
                seat,
                state.distance_left(seat, state.holding & !state.passed),
            )
        };
        self.stage = Stage::Turn(next);
    }
}
