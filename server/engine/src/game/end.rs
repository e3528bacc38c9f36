//! The end of a Shift and of a game (`docs/rules.md` §5): places, points, final table.

use super::shift_state::bit;
use super::{Game, Stage};
use crate::{BySeat, Deal, Event, Seat, SeatOrder, ShiftEnd, Standings, Stop};

impl Game {
    /// Orders the seats that still hold cards when a Shift reaches its limit of turns (§5.4):
    /// fewest cards first, ties by distance to the left of the seat that acted last.
    /// [`Game::end_shift`] gives them their places.
    pub(super) fn adjudicate(&mut self, acted_last: Seat) {
        let state = &self.state;
        let mut waiting = SeatOrder::EMPTY;
        for seat in self
            .hands
            .seats()
            .filter(|&seat| state.holding & bit(seat) != 0)
        {
            waiting.push(seat);
        }
        waiting.sort_by_key(|&seat| {
            (
                self.cards_left[seat],
                state.distance_left(acted_last, bit(seat)),
            )
        });
        for &seat in waiting.as_slice() {
            self.state.order.push(seat);
        }
    }

    /// Gives the points of the Shift and starts the next one, or ends the game.
    pub(super) fn end_shift(&mut self, adjudicated: bool, on_event: &mut impl FnMut(Event)) {
        let finished = self
            .state
            .places
            .values()
            .filter(|&&place| place > 0)
            .count() as u8;
        if !adjudicated {
            let last = Seat::new(self.state.holding.trailing_zeros() as usize);
            self.state.order.push(last);
        }
        let order = self.state.order;
        let mut points = BySeat::filled(order.len(), 0);
        for (&seat, place) in order.as_slice().iter().zip(1u8..) {
            self.state.places[seat] = place;
            points[seat] = self.rules.points(place);
            // Fewer than 2^32 Shifts of less than 2^32 points each cannot exceed 64 bits.
            self.scores[seat] += u64::from(points[seat]);
        }
        self.last_order = order;
        on_event(Event::ShiftEnded(Box::new(ShiftEnd {
            shift: self.shift,
            order,
            finished,
            points,
            scores: self.scores,
            starter: self.state.starter,
            pizzas: self.state.pizza,
            laps: self.state.laps,
            turns: self.state.turns,
            special: self.special,
            adjudicated,
        })));
        if self.is_decided() {
            self.stage = Stage::Over;
            on_event(Event::GameEnded {
                standings: Box::new(self.final_table()),
            });
        } else {
            let shift = self.shift + 1;
            let deal = Deal::new(&self.rules, self.seed, shift);
            self.start_shift(shift, deal.hands(), deal.drawn(), order, on_event);
        }
    }

    pub(super) fn is_decided(&self) -> bool {
        // After 2^32 - 1 Shifts there is no number for another one.
        self.shift == u32::MAX
            || match self.rules.stop() {
                Stop::Points(target) => self
                    .scores
                    .values()
                    .any(|&score| score >= u64::from(target)),
                Stop::Shifts(target) => self.shift >= target,
            }
    }

    /// Most points first, ties broken by the better place in the last Shift (§5.3).
    pub(super) fn final_table(&self) -> Standings {
        let mut order = self.last_order;
        // The sort is stable, so seats with equal points keep the order of the last Shift.
        order.sort_by_key(|&seat| std::cmp::Reverse(self.scores[seat]));
        Standings {
            order,
            points: self.scores,
        }
    }
}
