//! The start of a Shift (`docs/rules.md` §3): deal, roles, special action, exchange, first turn.

use super::shift_state::ShiftState;
use super::{Game, Stage};
use crate::deal::opening_leader;
use crate::{Action, BySeat, Cards, Event, ExchangePair, Role, Seat, SeatOrder, SpecialAction};

impl Game {
    /// Starts a Shift with these hands. `ranking` is the order of the last Shift, empty in the
    /// first.
    pub(super) fn start_shift(
        &mut self,
        shift: u32,
        hands: BySeat<Cards>,
        drawn: Option<Seat>,
        ranking: SeatOrder,
        on_event: &mut impl FnMut(Event),
    ) {
        let players = self.rules.players();
        self.shift = shift;
        self.hands = hands;
        self.cards_left = hands.map(Cards::len);
        self.drawn = drawn;
        self.ranking = ranking;
        self.roles = BySeat::filled(players, None);
        self.played = Cards::EMPTY;
        self.gave = BySeat::filled(players, Cards::EMPTY);
        self.received = BySeat::filled(players, Cards::EMPTY);
        self.special = None;
        self.state = ShiftState::new(players);
        on_event(Event::ShiftStarted {
            shift,
            hands: Box::new(hands.map(Some)),
        });
        if ranking.is_empty() {
            return self.open_first_turn();
        }
        self.assign_roles(on_event);
        let dealt_two_jokers = hands.seats().find(|&seat| hands[seat].jokers() == 2);
        match dealt_two_jokers.filter(|_| self.rules.special_actions()) {
            Some(seat) => self.stage = Stage::Special(seat),
            None => self.start_exchange(on_event),
        }
    }

    fn assign_roles(&mut self, on_event: &mut impl FnMut(Event)) {
        self.roles = Role::by_seat(&self.ranking);
        on_event(Event::RolesAssigned { roles: self.roles });
    }

    /// The special action that a seat may declare.
    pub(super) fn special_of(&self, seat: Seat) -> SpecialAction {
        SpecialAction::of_seat(seat, &self.ranking)
    }

    pub(super) fn declare(&mut self, seat: Seat, on_event: &mut impl FnMut(Event)) {
        let special = self.special_of(seat);
        self.special = Some(special);
        on_event(Event::SpecialActionDeclared { seat, special });
        match special {
            SpecialAction::FoodFight => {
                self.ranking.reverse();
                self.assign_roles(on_event);
                self.start_exchange(on_event);
            }
            SpecialAction::DinnerIsServed => self.open_first_turn(),
        }
    }

    /// Asks for the first gift.
    pub(super) fn start_exchange(&mut self, on_event: &mut impl FnMut(Event)) {
        if !self.rules.exchange() {
            return self.open_first_turn();
        }
        let gifts = |rank| {
            ExchangePair::of_rank(&self.ranking, rank)
                .map_or(0, |pair| pair.gifts(self.hands[pair.forced]))
        };
        let (chef_left, sous_chef_left) = (gifts(0), gifts(1));
        self.ask_for_gift(chef_left, sous_chef_left, on_event);
    }

    fn ask_for_gift(
        &mut self,
        chef_left: u8,
        sous_chef_left: u8,
        on_event: &mut impl FnMut(Event),
    ) {
        let rank = match (chef_left, sous_chef_left) {
            (0, 0) => return self.complete_exchange(on_event),
            (0, _) => 1,
            _ => 0,
        };
        let giver = self.ranking.as_slice()[rank];
        self.stage = Stage::Exchange {
            giver,
            chef_left,
            sous_chef_left,
        };
    }

    /// Moves a legal gift out of the giver's hand.
    pub(super) fn give(
        &mut self,
        giver: Seat,
        gift: Action,
        chef_left: u8,
        sous_chef_left: u8,
        on_event: &mut impl FnMut(Event),
    ) {
        let hand = &mut self.hands[giver];
        let card = match gift {
            Action::Give(face) => hand.take_face(face, 1),
            _ => hand.take_joker(),
        };
        self.gave[giver].add(card);
        self.cards_left[giver] -= 1;
        if chef_left > 0 {
            self.ask_for_gift(chef_left - 1, sous_chef_left, on_event);
        } else {
            self.ask_for_gift(0, sous_chef_left - 1, on_event);
        }
    }

    /// Hands over all gifts at once, so that nobody chooses after seeing what it receives (§3.4).
    fn complete_exchange(&mut self, on_event: &mut impl FnMut(Event)) {
        let ranking = self.ranking;
        for pair in ExchangePair::all(&ranking) {
            self.gave[pair.forced] = self.hands[pair.forced].take_rarest(pair.size);
            self.hand_over(pair.forced, pair.chooser, on_event);
            self.hand_over(pair.chooser, pair.forced, on_event);
        }
        self.cards_left = self.hands.map(Cards::len);
        self.open_first_turn();
    }

    fn hand_over(&mut self, giver: Seat, receiver: Seat, on_event: &mut impl FnMut(Event)) {
        let cards = self.gave[giver];
        if !cards.is_empty() {
            self.hands[receiver].add(cards);
            self.received[receiver] = cards;
            on_event(Event::CardsExchanged {
                giver,
                receiver,
                count: cards.len(),
                cards: Some(cards),
            });
        }
    }

    fn open_first_turn(&mut self) {
        let starter = opening_leader(&self.rules, &self.hands, self.drawn);
        self.state.open(starter);
        self.stage = Stage::Turn(starter);
    }
}
