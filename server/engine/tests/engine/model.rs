//! A second, plain implementation of the rules: it follows a game by its events, keeps every card
//! in a list, and decides from an action's text whether it is legal. It shares no table and no
//! packed number with the engine.

use chefshat_engine::{Cards, DecisionKind, Event, Game, Opening, RuleSet};

/// The state of a game.
pub(crate) struct Model {
    rules: RuleSet,
    /// Each seat's cards, F+1 for a joker.
    hands: Vec<Vec<u8>>,
    /// The seat that holds the Golden card, until it is played.
    golden: Option<usize>,
    /// Cards played in this Shift.
    played: Vec<u8>,
    aside: Vec<u8>,
    board: Option<(u8, u8)>,
    turns: u32,
    idle_pizzas: u32,
}

impl Model {
    pub(crate) fn new(rules: RuleSet) -> Model {
        Model {
            rules,
            hands: Vec::new(),
            golden: None,
            played: Vec::new(),
            aside: Vec::new(),
            board: None,
            turns: 0,
            idle_pizzas: 0,
        }
    }

    /// Follows an event that shows everything.
    pub(crate) fn follow(&mut self, event: &Event) {
        let faces = self.rules.faces();
        match *event {
            Event::ShiftStarted { ref hands, .. } => {
                self.hands = hands
                    .values()
                    .map(|hand| self.list(hand.unwrap()))
                    .collect();
                let golden: Vec<usize> = (0..hands.len())
                    .filter(|&s| hands.as_slice()[s].unwrap().has_golden())
                    .collect();
                assert_eq!(golden.len(), 1, "one seat is dealt the Golden card");
                self.golden = golden.first().copied();
                self.aside = whole_deck(&self.rules);
                for hand in &self.hands {
                    assert_eq!(hand.len(), usize::from(self.rules.hand_size()));
                    hand.iter().for_each(|&card| remove(&mut self.aside, card));
                }
                (self.played, self.board, self.turns, self.idle_pizzas) = (Vec::new(), None, 0, 0);
            }
            Event::CardsExchanged {
                giver,
                receiver,
                count,
                cards,
            } => {
                let given = self.list(cards.unwrap());
                assert_eq!(given.len(), usize::from(count));
                for card in given {
                    remove(&mut self.hands[giver.index()], card);
                    self.hands[receiver.index()].push(card);
                }
                if cards.unwrap().has_golden() {
                    assert_eq!(self.golden, Some(giver.index()));
                    self.golden = Some(receiver.index());
                }
            }
            Event::Played {
                seat,
                face,
                quantity,
                jokers,
                cards_left,
                ..
            } => {
                let hand = &mut self.hands[seat.index()];
                for _ in 0..quantity {
                    remove(hand, face);
                    self.played.push(face);
                }
                for _ in 0..jokers {
                    remove(hand, faces + 1);
                    self.played.push(faces + 1);
                }
                assert_eq!(hand.len(), usize::from(cards_left));
                let opening = self.turns == 0 && self.rules.opening() == Opening::Golden;
                if self.golden == Some(seat.index())
                    && face == faces
                    && (opening || !hand.contains(&faces))
                {
                    self.golden = None;
                }
                self.board = Some((face, quantity + jokers));
                self.turns += 1;
                self.idle_pizzas = 0;
            }
            Event::Passed { seat, cards_left } => {
                assert_eq!(self.hands[seat.index()].len(), usize::from(cards_left));
                self.turns += 1;
            }
            Event::PizzaDone { last_to_play, .. } => {
                self.board = None;
                if last_to_play.is_none() {
                    self.idle_pizzas += 1;
                }
            }
            _ => {}
        }
    }

    /// Whether the rules allow the action with this text now.
    pub(crate) fn allows(&self, game: &Game, text: &str) -> bool {
        let Some(decision) = game.decision() else {
            return false;
        };
        // A card given in the exchange leaves the hand at once.
        let mut hand = self.hands[decision.seat.index()].clone();
        if decision.kind == DecisionKind::Exchange {
            self.list(game.gave()[decision.seat])
                .iter()
                .for_each(|&card| remove(&mut hand, card));
        }
        let faces = self.rules.faces();
        let holds = |card: u8, n: usize| hand.iter().filter(|&&other| other == card).count() >= n;
        let first_turn = self.turns == 0;
        match decision.kind {
            DecisionKind::SpecialAction => text == "decline" || text == "declare",
            DecisionKind::Exchange => match text.strip_prefix("give ") {
                Some("J") => holds(faces + 1, 1),
                Some(face) => holds(face.strip_prefix('C').unwrap().parse().unwrap(), 1),
                None => false,
            },
            DecisionKind::Turn if text == "pass" => {
                let forbidden_at_opening = first_turn && !self.rules.opening_pass();
                let forced_leader =
                    self.board.is_none() && self.idle_pizzas >= self.rules.max_idle_pizzas();
                !forbidden_at_opening && !forced_leader
            }
            DecisionKind::Turn if text == "C0;Q0;J1" => {
                holds(faces + 1, 1) && self.board.is_none() && !first_turn
            }
            DecisionKind::Turn => {
                let Some((face, quantity, jokers)) = play_of(text) else {
                    return false;
                };
                let held =
                    holds(face, usize::from(quantity)) && holds(faces + 1, usize::from(jokers));
                let beats = self
                    .board
                    .is_none_or(|(on_board, size)| face < on_board && quantity + jokers >= size);
                held && beats && (!first_turn || face == faces)
            }
        }
    }

    /// Checks that the engine has the same cards in the same places, none lost or duplicated.
    pub(crate) fn check_cards(&self, game: &Game) {
        let in_exchange = game
            .decision()
            .is_some_and(|decision| decision.kind == DecisionKind::Exchange);
        let mut all = self.aside.clone();
        all.extend(self.list(game.played()));
        for (seat, &hand) in game.hands().iter() {
            let mut list = self.list(hand);
            let mut golden = hand.has_golden();
            if in_exchange {
                list.extend(self.list(game.gave()[seat]));
                golden |= game.gave()[seat].has_golden();
            }
            assert_eq!(
                sorted(&list),
                sorted(&self.hands[seat.index()]),
                "cards of seat {seat}"
            );
            assert_eq!(
                golden,
                self.golden == Some(seat.index()),
                "Golden card of seat {seat}"
            );
            all.extend(list);
        }
        assert_eq!(sorted(&self.list(game.played())), sorted(&self.played));
        assert_eq!(sorted(&all), whole_deck(&self.rules), "cards are conserved");
    }

    fn list(&self, cards: Cards) -> Vec<u8> {
        cards.ascending(self.rules.faces()).collect()
    }
}

fn whole_deck(rules: &RuleSet) -> Vec<u8> {
    let mut deck = Vec::new();
    for face in 1..=rules.faces() {
        (0..face).for_each(|_| deck.push(face));
    }
    (0..rules.jokers()).for_each(|_| deck.push(rules.faces() + 1));
    deck
}

fn remove(cards: &mut Vec<u8>, card: u8) {
    let index = cards
        .iter()
        .position(|&other| other == card)
        .unwrap_or_else(|| panic!("no card {card} in {cards:?}"));
    cards.remove(index);
}

fn sorted(cards: &[u8]) -> Vec<u8> {
    let mut sorted = cards.to_vec();
    sorted.sort_unstable();
    sorted
}

/// Face, quantity and jokers of a text such as `C5;Q2;J1`.
fn play_of(text: &str) -> Option<(u8, u8, u8)> {
    let numbers: Vec<u8> = text
        .split(';')
        .filter_map(|part| part.get(1..)?.parse().ok())
        .collect();
    match numbers[..] {
        [face, quantity, jokers] if face > 0 => Some((face, quantity, jokers)),
        _ => None,
    }
}
