//! What a seat knows of the Shift in progress, gathered from its observation and from the events it
//! saw, and turning a possible deal into the game that it would be. Which deals are possible is in
//! `holders` and `table`.

use chefshat_engine::{
    Action, ActionId, BySeat, Cards, DecisionKind, Event, ExchangePair, Face, Game, Observation,
    Opening, Role, RuleSet, Script, Seat, SeatOrder, Seed, Viewer,
};
use thiserror::Error;

use crate::ShiftHistory;

/// Why nothing can be sampled.
#[derive(Copy, Clone, Eq, PartialEq, Debug, Error)]
pub enum KnowledgeError {
    /// The seat has no open decision.
    #[error("the seat has no open decision: ask at a decision of this seat")]
    NoDecision,
    /// The history is not that of one Shift.
    #[error("the history must begin with the start of the Shift and hold all its events")]
    History,
    /// The observation and the history contradict each other, or the rules.
    #[error("no deal by these rules leads to this observation and history: check both")]
    Inconsistent,
    /// There are too many possible hands to count.
    #[error(
        "counting the possible deals takes more than {0} steps: ask later in the Shift, or raise the limit"
    )]
    TooManySteps(u64),
}

/// Cards that one seat gave to another before the first pizza.
#[derive(Copy, Clone, Debug)]
pub(crate) struct Gift {
    pub(crate) giver: Seat,
    pub(crate) receiver: Seat,
    pub(crate) count: u8,
    /// `None` between other seats.
    pub(crate) cards: Option<Cards>,
}

/// What a seat knows at a decision of its own.
#[derive(Clone, Debug)]
pub struct Knowledge {
    pub(crate) rules: RuleSet,
    pub(crate) seat: Seat,
    pub(crate) kind: DecisionKind,
    pub(crate) observation: Observation,
    /// The own hand as dealt.
    pub(crate) dealt: Cards,
    /// The seats from Chef to Dishwasher as the Shift began.
    pub(crate) last_order: Option<SeatOrder>,
    /// The seat that declared a special action.
    pub(crate) declared: Option<Seat>,
    /// The gifts of a complete exchange.
    pub(crate) gifts: Vec<Gift>,
    /// Plays and passes so far.
    pub(crate) turns: Vec<(Seat, ActionId)>,
}

/// A possible deal, with the choices of others that the seat did not see.
#[derive(Clone, Eq, PartialEq, Debug)]
pub struct World {
    /// All hands as dealt.
    pub dealt: BySeat<Cards>,
    /// Cards that other seats chose to give to each other.
    pub gifts: BySeat<Cards>,
    /// The seat drawn for [`Opening::AnyTopFace`].
    pub drawn: Option<Seat>,
}

impl Knowledge {
    /// What the seat of `history` knows at its open decision.
    ///
    /// # Errors
    /// If it has no open decision, or the history is not that of its Shift.
    pub fn new(
        rules: RuleSet,
        observation: &Observation,
        history: &ShiftHistory,
    ) -> Result<Knowledge, KnowledgeError> {
        let seat = history.seat();
        let kind = match (observation.seat, observation.kind) {
            (Some(own), Some(kind)) if own == seat => kind,
            _ => return Err(KnowledgeError::NoDecision),
        };
        let mut events = history.events().iter();
        let dealt = match events.next() {
            Some(Event::ShiftStarted { shift, hands }) if *shift == observation.shift => {
                hands.get(seat).copied().flatten()
            }
            _ => None,
        };
        let mut knowledge = Knowledge {
            rules,
            seat,
            kind,
            observation: *observation,
            dealt: dealt.ok_or(KnowledgeError::History)?,
            last_order: None,
            declared: None,
            gifts: Vec::new(),
            turns: Vec::new(),
        };
        events.try_for_each(|event| knowledge.add(event))?;
        knowledge.check()?;
        Ok(knowledge)
    }

    fn add(&mut self, event: &Event) -> Result<(), KnowledgeError> {
        match event {
            Event::RolesAssigned { roles } => {
                // A Food Fight assigns roles again.
                if self.last_order.is_none() {
                    self.last_order = Some(order_of(roles).ok_or(KnowledgeError::History)?);
                }
            }
            Event::SpecialActionDeclared { seat, .. } => self.declared = Some(*seat),
            Event::CardsExchanged {
                giver,
                receiver,
                count,
                cards,
            } => self.gifts.push(Gift {
                giver: *giver,
                receiver: *receiver,
                count: *count,
                cards: *cards,
            }),
            Event::Played { seat, action, .. } => self.turns.push((*seat, *action)),
            Event::Passed { seat, .. } => {
                self.turns.push((*seat, self.rules.actions().pass()));
            }
            Event::SeatFinished { .. } | Event::PizzaDone { .. } => {}
            Event::ShiftStarted { .. } | Event::ShiftEnded(_) | Event::GameEnded { .. } => {
                return Err(KnowledgeError::History);
            }
        }
        Ok(())
    }

    /// Checks what the rest relies on. That the rules allow it all shows when a deal is replayed.
    fn check(&self) -> Result<(), KnowledgeError> {
        let players = self.rules.players();
        let inside = |seat: Seat| seat.index() < players;
        let gift_is_sound = |gift: &Gift| {
            let own = gift.giver == self.seat || gift.receiver == self.seat;
            inside(gift.giver)
                && inside(gift.receiver)
                && (1..=2).contains(&gift.count)
                && own == gift.cards.is_some()
                && gift.cards.is_none_or(|cards| cards.len() == gift.count)
        };
        let sound = self.observation.cards_left.len() == players
            && inside(self.seat)
            && self.observation.faces == self.rules.faces()
            && self.dealt.len() == self.rules.hand_size()
            && self.last_order.is_none_or(|order| order.len() == players)
            && self.declared.is_none_or(inside)
            && self.gifts.iter().all(gift_is_sound)
            && self.turns.iter().all(|(seat, _)| inside(*seat))
            && (self.observation.shift == 1) == self.last_order.is_none()
            && (self.kind == DecisionKind::Turn
                || (self.gifts.is_empty() && self.turns.is_empty()));
        let complete = self.kind != DecisionKind::Turn || self.exchange_is_complete();
        (sound && complete)
            .then_some(())
            .ok_or(KnowledgeError::Inconsistent)
    }

    /// Whether each pair that exchanges cards has done so, and nobody else.
    fn exchange_is_complete(&self) -> bool {
        let pairs = self.pairs();
        let gift = |giver: Seat, receiver: Seat| {
            let fits = |gift: &&Gift| gift.giver == giver && gift.receiver == receiver;
            self.gifts.iter().find(fits).map_or(0, |gift| gift.count)
        };
        self.gifts.len() == 2 * pairs.len()
            && pairs.iter().all(|pair| {
                let count = gift(pair.chooser, pair.forced);
                (1..=pair.size).contains(&count) && count == gift(pair.forced, pair.chooser)
            })
    }

    /// The seat.
    pub fn seat(&self) -> Seat {
        self.seat
    }

    /// The rule set.
    pub fn rules(&self) -> &RuleSet {
        &self.rules
    }

    /// What the seat sees at its decision.
    pub fn observation(&self) -> &Observation {
        &self.observation
    }

    /// The pairs that exchange cards in this Shift, by the roles that count for the exchange.
    pub(crate) fn pairs(&self) -> Vec<ExchangePair> {
        let Some(mut order) = self.last_order else {
            return Vec::new();
        };
        if let Some(seat) = self.declared {
            if order.as_slice().last() != Some(&seat) {
                return Vec::new();
            }
            order.reverse();
        }
        if !self.rules.exchange() {
            return Vec::new();
        }
        ExchangePair::all(&order).collect()
    }

    /// The seat that took, or takes, the Shift's first turn; `None` before.
    pub(crate) fn starter(&self) -> Option<Seat> {
        match self.turns.first() {
            Some((seat, _)) => Some(*seat),
            None => (self.kind == DecisionKind::Turn).then_some(self.seat),
        }
    }

    /// The game if this is the deal: the same Shift, played up to the open decision. `later` deals
    /// the Shifts after this one.
    ///
    /// # Errors
    /// If the deal does not lead to what the seat sees.
    pub fn game(&self, world: &World, later: Seed) -> Result<Game, KnowledgeError> {
        self.replay(world, later, |_, _| {})
            .ok_or(KnowledgeError::Inconsistent)
    }

    /// The start of the Shift if this is the deal, and the actions of all seats from there to the
    /// open decision.
    ///
    /// # Errors
    /// As [`Knowledge::game`].
    pub fn start(&self, world: &World) -> Result<(Script, Vec<ActionId>), KnowledgeError> {
        let mut actions = Vec::new();
        self.replay(world, Seed([0; 32]), |_, action| actions.push(action))
            .and_then(|_| Some((self.script(world)?, actions)))
            .ok_or(KnowledgeError::Inconsistent)
    }

    /// The game if this is the deal, and if it leads to what the seat sees.
    /// Shows every decision on the way with its action.
    pub(crate) fn replay(
        &self,
        world: &World,
        later: Seed,
        on_action: impl FnMut(&Game, ActionId),
    ) -> Option<Game> {
        self.played(world, later, on_action).filter(|game| {
            let seen = game.observe(Viewer::Seat(self.seat));
            let observed = Observation {
                // Clients and servers of earlier versions do not say who played the board.
                board_owner: self.observation.board_owner.or(seen.board_owner),
                ..self.observation
            };
            without_golden_gifts(seen) == without_golden_gifts(observed)
        })
    }

    fn script(&self, world: &World) -> Option<Script> {
        let mut scores = BySeat::filled(self.rules.players(), 0);
        for seat in scores.seats() {
            scores[seat] = u32::try_from(*self.observation.points.get(seat)?).ok()?;
        }
        Some(Script {
            shift: self.observation.shift,
            hands: world.dealt,
            last_order: self.last_order,
            scores,
            drawn: world.drawn,
        })
    }

    /// Plays the deal up to the open decision.
    fn played(
        &self,
        world: &World,
        later: Seed,
        mut on_action: impl FnMut(&Game, ActionId),
    ) -> Option<Game> {
        let script = self.script(world)?;
        let mut game = Game::scripted(self.rules, later, &script, |_| {}).ok()?;
        let space = self.rules.actions();
        let mut gifts = self.choices(world);
        let mut turns = self.turns.iter();
        while let Some(decision) = game.decision() {
            let own = decision.seat == self.seat;
            let action = match decision.kind {
                DecisionKind::SpecialAction if self.declared == Some(decision.seat) => {
                    space.declare()
                }
                DecisionKind::SpecialAction => {
                    if own && self.kind == DecisionKind::SpecialAction {
                        return Some(game);
                    }
                    space.decline()
                }
                DecisionKind::Exchange => match take_one(&mut gifts[decision.seat], &self.rules) {
                    Some(gift) => space.encode(gift)?,
                    None => return (own && self.kind == DecisionKind::Exchange).then_some(game),
                },
                DecisionKind::Turn => match turns.next() {
                    Some((seat, action)) if *seat == decision.seat => *action,
                    Some(_) => return None,
                    None => return Some(game),
                },
            };
            on_action(&game, action);
            game.apply(action, |_| {}).ok()?;
        }
        None
    }

    /// The cards that each seat chose to give.
    fn choices(&self, world: &World) -> BySeat<Cards> {
        let mut gifts = world.gifts;
        gifts[self.seat] = self.observation.gave;
        for gift in &self.gifts {
            if let Some(cards) = gift.cards {
                gifts[gift.giver] = cards;
            }
        }
        gifts
    }

    /// Whether other seats gave cards that this seat has to imagine while the exchange is open: the
    /// giver, and how many.
    pub(crate) fn pending_gift(&self) -> Option<(Seat, u8)> {
        if self.kind != DecisionKind::Exchange {
            return None;
        }
        let chef = self.pairs().first()?.chooser;
        let given = self
            .rules
            .hand_size()
            .checked_sub(*self.observation.cards_left.get(chef)?)?;
        (chef != self.seat && given > 0).then_some((chef, given))
    }

    /// Whether the first turn goes to the first seat with the top face from a drawn one.
    pub(crate) fn draws_starter(&self) -> bool {
        self.rules.opening() == Opening::AnyTopFace
    }
}

/// An observation that does not tell the Golden card from others given and received: that of a
/// message does not, but the events of the exchange do.
fn without_golden_gifts(mut seen: Observation) -> Observation {
    for cards in [&mut seen.gave, &mut seen.received] {
        let counts = cards.count_array(seen.faces);
        let counts = &counts[..=usize::from(seen.faces)];
        *cards = Cards::from_counts(seen.faces, counts, false).expect("the same cards");
    }
    seen
}

/// Takes the first of the cards to give.
fn take_one(cards: &mut Cards, rules: &RuleSet) -> Option<Action> {
    // Plain cards of a face go before the Golden one.
    let faces = (1..=rules.faces()).filter_map(Face::new);
    for face in faces {
        if let Some(left) = cards.without_face(face, 1) {
            *cards = left;
            return Some(Action::Give(face));
        }
    }
    *cards = cards.without_jokers(1)?;
    Some(Action::GiveJoker)
}

/// The seats from Chef to Dishwasher. Cooks, who are alike, in the order of their seats.
fn order_of(roles: &BySeat<Option<Role>>) -> Option<SeatOrder> {
    let mut seats: Vec<Seat> = roles.seats().collect();
    if roles.values().any(Option::is_none) {
        return None;
    }
    seats.sort_by_key(|seat| roles[*seat]);
    let expected = Role::in_order(seats.len());
    let matches = seats
        .iter()
        .zip(expected)
        .all(|(seat, role)| roles[*seat] == Some(role));
    SeatOrder::from_slice(&seats).filter(|_| matches)
}
