//! The way from a game to its state and back. [`Game::from_state`] refuses every state that no game
//! can have, so a state may come from anywhere. It checks what follows from the rules at one
//! moment; the decisions that led there are not part of a state.

use super::Game;
use super::shift_state::{ShiftState, bit};
use super::state::{GameState, Stage, StateError, ensure};
use crate::deal::opening_leader;
use crate::{
    Board, BySeat, Cards, ExchangePair, Face, Opening, PassScope, Role, Seat, SeatOrder,
    SpecialAction,
};

impl Game {
    /// The complete state.
    pub fn state(&self) -> GameState {
        let state = &self.state;
        let order = |order: SeatOrder| Some(order).filter(|order| !order.is_empty());
        GameState {
            rules: self.rules,
            seed: self.seed,
            shift: self.shift,
            stage: self.stage,
            board: state.board,
            turns: state.turns,
            laps: state.laps,
            pizza: state.pizza,
            idle: state.idle,
            starter: state.starter,
            leader: state.leader,
            last_to_play: state.last_to_play,
            passed: BySeat::from_fn(self.rules.players(), |seat| state.passed & bit(seat) != 0),
            places: state.places,
            hands: self.hands,
            played: self.played,
            gave: self.gave,
            received: self.received,
            scores: self.scores,
            ranking: order(self.ranking),
            special: self.special,
            drawn: self.drawn,
            last_order: order(self.last_order),
        }
    }

    /// The game with this state. It equals the game that the state was taken from.
    ///
    /// # Errors
    /// If no game with this rule set can have this state.
    pub fn from_state(state: &GameState) -> Result<Game, StateError> {
        state.check_seats()?;
        let game = Game {
            state: state.shift_state()?,
            roles: match &state.ranking {
                Some(ranking) => Role::by_seat(ranking),
                None => BySeat::filled(state.rules.players(), None),
            },
            cards_left: state.hands.map(Cards::len),
            rules: state.rules,
            seed: state.seed,
            shift: state.shift,
            stage: state.stage,
            hands: state.hands,
            played: state.played,
            gave: state.gave,
            received: state.received,
            scores: state.scores,
            ranking: state.ranking.unwrap_or(SeatOrder::EMPTY),
            special: state.special,
            drawn: state.drawn,
            last_order: state.last_order.unwrap_or(SeatOrder::EMPTY),
        };
        game.check_shifts()?;
        game.check_cards()?;
        match game.stage {
            Stage::Special(seat) => game.check_special(seat)?,
            Stage::Exchange {
                giver,
                chef_left,
                sous_chef_left,
            } => game.check_exchange(giver, chef_left, sous_chef_left)?,
            Stage::Turn(seat) => game.check_turn_order(seat)?,
            Stage::Over => game.check_end()?,
        }
        Ok(game)
    }

    /// Checks the number of the Shift, points, and orders of seats.
    fn check_shifts(&self) -> Result<(), StateError> {
        let over = self.is_over();
        ensure(self.shift > 0, "Shifts are numbered from 1")?;
        ensure(
            (self.shift == 1) == self.ranking.is_empty(),
            "there is a ranking from the second Shift on",
        )?;
        // A Shift gives a seat less than 2^32 points, and so does a script.
        let most = u64::from(u32::MAX) * (u64::from(self.shift) + u64::from(over));
        let bounded = self.scores.values().all(|&score| score <= most);
        ensure(bounded, "a seat has more points than its Shifts give")?;
        if over {
            ensure(self.is_decided(), "the game is over but not decided")?;
        } else if self.shift > 1 {
            let before = Game {
                shift: self.shift - 1,
                ..self.clone()
            };
            ensure(!before.is_decided(), "the game was decided before")?;
        }
        if !over && !self.last_order.is_empty() {
            let mut ranking = self.last_order;
            if self.special == Some(SpecialAction::FoodFight) {
                ranking.reverse();
            }
            let ranks = "the ranking is not the order of the last Shift";
            ensure(ranking == self.ranking, ranks)?;
        }
        if self.special.is_some() {
            let possible = self.shift > 1 && self.rules.special_actions();
            ensure(possible, "no special action is possible")?;
        }
        let drawn = self.rules.opening() == Opening::AnyTopFace;
        let draws = "a seat is drawn for the opening with any top face, and for no other";
        ensure(self.drawn.is_some() == drawn, draws)
    }

    /// Checks that all cards dealt are in one place each, and the Golden card among them.
    fn check_cards(&self) -> Result<(), StateError> {
        let exchange_open = matches!(self.stage, Stage::Exchange { .. });
        let deck = Cards::deck(self.rules.faces(), self.rules.jokers());
        let not_in_deck = StateError("there are more cards than the deck has");
        let top = Face::of(self.rules.faces());
        let (mut all, mut dealt) = (self.played, self.played.len());
        ensure(!all.has_golden(), "cards played have no Golden card's flag")?;
        let mut exchanged = Cards::EMPTY;
        for (seat, &hand) in self.hands.iter() {
            let gave = self.gave[seat];
            exchanged = exchanged.union(gave).ok_or(not_in_deck)?;
            let mut held = hand;
            if exchange_open {
                held = held.union(gave).ok_or(not_in_deck)?;
            }
            let size = held.len();
            ensure(size <= self.rules.hand_size(), "a hand is too large")?;
            let golden = [hand, gave, self.received[seat]];
            let golden = golden.iter().all(|cards| {
                !cards.has_golden() || (cards.count(top) > 0 && cards.highest() == Some(top))
            });
            ensure(golden, "the Golden card has the top face")?;
            dealt += size;
            all = all.union(held).ok_or(not_in_deck)?;
        }
        let in_deck = deck.contains(all) && deck.contains(exchanged);
        in_deck.then_some(()).ok_or(not_in_deck)?;
        let players = self.rules.players() as u8;
        let missing = dealt != players * self.rules.hand_size();
        ensure(!missing, "not all cards dealt are there")?;
        let played = self.state.turns > 0 && self.played.count(top) > 0;
        let golden = all.has_golden() || played;
        ensure(golden, "the Golden card is missing")
    }

    /// Checks a special action that may be declared.
    fn check_special(&self, seat: Seat) -> Result<(), StateError> {
        let possible = self.shift > 1 && self.rules.special_actions() && self.special.is_none();
        ensure(possible, "no special action is possible")?;
        ensure(
            self.hands[seat].jokers() == 2,
            "only a seat with two jokers may declare",
        )?;
        self.check_unexchanged()?;
        self.check_fresh()
    }

    /// Checks an exchange in progress.
    fn check_exchange(
        &self,
        giver: Seat,
        chef_left: u8,
        sous_chef_left: u8,
    ) -> Result<(), StateError> {
        ensure(self.exchanges(), "no cards are exchanged")?;
        let unknown = StateError("the exchange asks for the wrong gift");
        let left = [chef_left, sous_chef_left];
        let mut open = None;
        let mut choosers = 0;
        for (pair, left) in ExchangePair::all(&self.ranking).zip(left) {
            let given = self.gave[pair.chooser].len();
            let due = pair.gifts(self.hands[pair.forced]);
            if left > due || given != due - left {
                return Err(unknown);
            }
            open = open.or((left > 0).then_some(pair.chooser));
            choosers |= bit(pair.chooser);
        }
        let one_pair = ExchangePair::all(&self.ranking).count() == 1;
        if open != Some(giver) || (one_pair && sous_chef_left > 0) {
            return Err(unknown);
        }
        let early = self.hands.seats().all(|seat| {
            self.received[seat].is_empty()
                && (choosers & bit(seat) != 0 || self.gave[seat].is_empty())
        });
        ensure(early, "cards were exchanged too early")?;
        self.check_fresh()
    }

    /// Checks an open turn.
    fn check_turn_order(&self, seat: Seat) -> Result<(), StateError> {
        self.check_exchanged()?;
        let state = &self.state;
        let below = state.turns < self.rules.max_turns();
        ensure(below, "the Shift has reached its limit of turns")?;
        self.check_pizza()?;
        ensure(
            state.holding.count_ones() >= 2,
            "fewer than two seats hold cards, so the Shift has ended",
        )?;
        ensure(
            state.holding & !state.passed & bit(seat) != 0,
            "the open turn belongs to a seat that cannot play",
        )?;
        let finished = state.holding.count_ones() as usize + state.order.len();
        let empty = self
            .hands
            .iter()
            .all(|(seat, hand)| hand.is_empty() == (state.places[seat] > 0));
        let all = empty && finished == self.rules.players();
        ensure(all, "the seats without cards are those with a place")?;
        if state.is_first_turn() {
            let opens = opening_leader(&self.rules, &self.hands, self.drawn) == seat
                && (state.starter, state.leader) == (seat, seat)
                && self.played.is_empty();
            ensure(opens, "the Shift's first turn is wrong")?;
        }
        self.check_passed(seat)
    }

    /// Checks who has passed: the seats between the one that the turn started from and the one
    /// that has it now.
    fn check_passed(&self, seat: Seat) -> Result<(), StateError> {
        let state = &self.state;
        let (from, mut between) = match state.last_to_play {
            Some(played) => (played, 0),
            None => {
                let holds = state.holding & bit(state.leader) != 0;
                ensure(holds, "the leader of an empty board holds cards")?;
                let leads = state.leader == seat;
                (state.leader, if leads { 0 } else { bit(state.leader) })
            }
        };
        let starts = state.last_to_play.is_none() && from == seat;
        if !starts {
            let distance = state.distance_left(from, bit(seat));
            for distance in 1..distance {
                between |= bit(state.left_of(from, distance));
            }
            let itself = state.last_to_play == Some(seat);
            ensure(!itself, "the last to play has the turn again")?;
        }
        between &= state.holding;
        let exact = state.last_to_play.is_none() || self.rules.pass_scope() == PassScope::Turn;
        let right = if exact {
            state.passed == between
        } else {
            between & !state.passed == 0
        };
        ensure(right, "other seats must have passed")
    }

    /// Checks the end of a game.
    fn check_end(&self) -> Result<(), StateError> {
        self.check_exchanged()?;
        let state = &self.state;
        self.check_pizza()?;
        let complete = state.order.len() == self.rules.players();
        ensure(complete, "not every seat has a place")?;
        ensure(
            self.last_order == state.order,
            "the last Shift has another order",
        )?;
        let adjudicated = state.holding.count_ones() >= 2;
        ensure(state.holding != 0, "a seat keeps its cards")?;
        let in_time = state.turns <= self.rules.max_turns();
        let limit = in_time && (!adjudicated || state.turns == self.rules.max_turns());
        ensure(limit, "the Shift ended before its end")?;
        let left = state.order.as_slice();
        let sorted = left.is_sorted_by_key(|&seat| self.cards_left[seat]);
        ensure(sorted, "a seat with more cards has a better place")
    }

    /// Checks the board and the counts of a Shift whose first turn was opened.
    fn check_pizza(&self) -> Result<(), StateError> {
        let state = &self.state;
        let first = state.is_first_turn();
        let counted = (1..=u64::from(state.turns) + 1).contains(&u64::from(state.laps))
            && (1..=u64::from(state.turns) + 1).contains(&u64::from(state.pizza));
        ensure(counted, "laps or pizzas do not fit the turns")?;
        let idle = state.idle <= self.rules.max_idle_pizzas()
            && state.idle < state.pizza
            && (state.last_to_play.is_none() || state.idle == 0);
        ensure(idle, "the pizzas without a play do not fit")?;
        let acted = (state.passed & state.holding).count_ones() as usize + state.order.len();
        let acted = self.is_over() || acted as u64 <= u64::from(state.turns);
        ensure(acted, "more seats have acted than turns were taken")?;
        let out = state.passed & !state.holding == 0
            && state
                .last_to_play
                .is_none_or(|seat| state.passed & bit(seat) == 0);
        ensure(out, "a seat that cannot pass has passed")?;
        let nothing_played = self.played.is_empty();
        let opened = first || !nothing_played || self.rules.opening_pass();
        ensure(opened, "the first turn was a pass")?;
        let golden = self.rules.opening() == Opening::Golden
            && !first
            && !self.rules.opening_pass()
            && self.hands.values().any(|hand| hand.has_golden());
        ensure(!golden, "the first turn was without the Golden card")?;
        self.check_board()
    }

    fn check_board(&self) -> Result<(), StateError> {
        let Board { face, size, jokers } = self.state.board;
        let empty = self.state.last_to_play.is_none();
        let possible = if empty {
            self.state.board == Board::default()
        } else if face == self.rules.faces() + 1 {
            (size, jokers) == (1, 1) && self.played.jokers() > 0
        } else {
            (1..=self.rules.faces()).contains(&face)
                && jokers <= self.played.jokers()
                && jokers < size
                && size - jokers <= self.played.count(Face::of(face))
        };
        ensure(possible, "the board is impossible")
    }

    /// Whether cards are exchanged in this Shift.
    fn exchanges(&self) -> bool {
        self.rules.exchange()
            && self.shift > 1
            && self.special != Some(SpecialAction::DinnerIsServed)
    }

    /// Checks that no card was exchanged.
    fn check_unexchanged(&self) -> Result<(), StateError> {
        let mut cards = self.gave.values().chain(self.received.values());
        let none = cards.all(|cards| cards.is_empty());
        ensure(none, "cards were exchanged without an exchange")
    }

    /// Checks a complete exchange. Hands are not compared with it: see [`Game::with_hands`].
    fn check_exchanged(&self) -> Result<(), StateError> {
        if !self.exchanges() {
            return self.check_unexchanged();
        }
        let mut others = BySeat::filled(self.rules.players(), true);
        for pair in ExchangePair::all(&self.ranking) {
            let (forced, chosen) = (self.gave[pair.forced], self.gave[pair.chooser]);
            let size = pair.least_gifts(&self.rules)..=pair.size;
            let fits = size.contains(&forced.len())
                && forced.jokers() == 0
                && chosen.len() == forced.len()
                && self.received[pair.chooser] == forced
                && self.received[pair.forced] == chosen;
            ensure(fits, "the cards exchanged do not fit")?;
            others[pair.forced] = false;
            others[pair.chooser] = false;
        }
        let mut others = others.iter().filter(|(_, other)| **other);
        let none =
            others.all(|(seat, _)| self.gave[seat].is_empty() && self.received[seat].is_empty());
        ensure(none, "a seat exchanged cards without a partner")
    }

    /// Checks that no turn of the Shift is open yet.
    fn check_fresh(&self) -> Result<(), StateError> {
        let fresh = self.state == ShiftState::new(self.rules.players()) && self.played.is_empty();
        ensure(fresh, "turns were taken before the Shift's first turn")
    }
}
