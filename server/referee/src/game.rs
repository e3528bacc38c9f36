//! A game at a real table, played by the rule engine. Each Shift is completed from its facts and
//! replaces the one the engine would deal. Unstated decisions are applied without a line of their
//! own; cards that were not stated are redacted from the events.

use chefshat_engine::{
    Action, BySeat, Cards, DecisionKind, Event, Face, Game, RuleSet, Script, ScriptError, Seat,
    SeatOrder,
};

use crate::complete::{Completer, Contradiction};
use crate::counts::{JOKER, index};
use crate::facts::{Fact, ShiftFacts};
use crate::known::Known;
use crate::search::Plan;
use crate::start::{NO_SEED, StartState};

/// A game at a real table in progress.
#[derive(Debug)]
pub struct PhysicalGame {
    rules: RuleSet,
    shifts: Vec<ShiftFacts>,
    completer: Completer,
    /// The number of Shifts started.
    started: usize,
    plan: Option<Plan>,
    contradiction: Option<Contradiction>,
    /// Stated decisions before the first turn that have not been applied yet.
    pending: BySeat<PendingDecisions>,
}

/// Numbers of stated decisions of one seat before the first turn.
#[derive(Debug, Clone, Copy, Default)]
struct PendingDecisions {
    special: u8,
    gifts: u8,
}

impl PendingDecisions {
    fn of_kind(&mut self, kind: DecisionKind) -> Option<&mut u8> {
        match kind {
            DecisionKind::SpecialAction => Some(&mut self.special),
            DecisionKind::Exchange => Some(&mut self.gifts),
            DecisionKind::Turn => None,
        }
    }
}

impl PhysicalGame {
    /// Creates a game from the facts of its Shifts.
    pub fn new(rules: RuleSet, shifts: Vec<ShiftFacts>) -> Self {
        Self {
            rules,
            shifts,
            completer: Completer::default(),
            started: 0,
            plan: None,
            contradiction: None,
            pending: BySeat::filled(rules.players(), PendingDecisions::default()),
        }
    }

    /// Starts the first stated Shift; `None` if there is none.
    ///
    /// # Errors
    /// The completed Shift cannot be played.
    pub fn start(
        &mut self,
        start: &StartState,
        events: &mut Vec<Event>,
    ) -> Result<Option<Game>, ScriptError> {
        self.start_shift(start.shift, start.last_order, start.scores, events)
    }

    /// Whether a stated Shift is in progress.
    pub fn is_open(&self) -> bool {
        self.plan.is_some()
    }

    /// The reason why a line contradicts the facts before it.
    pub fn contradiction(&self, line: usize) -> Option<&str> {
        self.contradiction
            .as_ref()
            .filter(|found| found.line == line)
            .map(|found| found.problem.as_str())
    }

    /// The reason why the facts contradict each other, if they do.
    pub fn problem(&self) -> Option<&str> {
        self.contradiction
            .as_ref()
            .map(|found| found.problem.as_str())
    }

    /// Whether the search for hands ended before everything was tried: the facts may fit after all.
    pub fn is_unresolved(&self) -> bool {
        (self.contradiction.as_ref()).is_some_and(|found| found.is_unresolved)
    }

    /// Whether the gift of each seat is known; true if it gives none.
    pub fn gifts_known(&self) -> BySeat<bool> {
        self.plan
            .as_ref()
            .map_or_else(|| self.all(false), |plan| plan.given_known)
    }

    /// The hand of a seat as dealt, if it is known, with the Golden card.
    pub fn dealt(&self, seat: Seat) -> Option<Cards> {
        let plan = self.plan.as_ref()?;
        let hand = plan.dealt[seat];
        let top = Face::new(self.rules.faces())?;
        let golden = plan.dealt_known.golden[seat] || hand.count(top) == 0;
        (plan.dealt_known.hands[seat] && golden).then_some(hand)
    }

    /// Continues after a decision: starts the next Shift or applies unstated decisions.
    ///
    /// # Errors
    /// The completed Shift cannot be played.
    pub fn advance(&mut self, game: &mut Game, events: &mut Vec<Event>) -> Result<(), ScriptError> {
        let ended = events.iter().find_map(|event| match event {
            Event::ShiftEnded(end) => Some((end.shift, end.order, end.scores)),
            _ => None,
        });
        let Some((shift, order, scores)) = ended.filter(|_| !game.is_over()) else {
            self.apply_unstated(game, events);
            return Ok(());
        };
        // Drop the Shift the engine has dealt.
        let end = events
            .iter()
            .position(|event| matches!(event, Event::ShiftEnded(_)));
        events.truncate(end.map_or(0, |end| end + 1));
        let scores = scores.map(|score| u32::try_from(score).unwrap_or(u32::MAX));
        if let Some(next) = self.start_shift(shift + 1, Some(order), scores, events)? {
            *game = next;
        }
        Ok(())
    }

    /// Counts a stated decision as applied.
    pub fn count_decision(&mut self, seat: Seat, kind: DecisionKind) {
        if let Some(pending) = self.pending[seat].of_kind(kind) {
            *pending = pending.saturating_sub(1);
        }
    }

    /// Whether each hand is known as counts, not necessarily which top-face card is Golden.
    pub fn hands_known(&self, game: &Game) -> BySeat<bool> {
        self.known(game)
            .map_or_else(|| self.all(false), |known| known.hands)
    }

    /// Whether each hand is known, including whether it contains the Golden card.
    pub fn golden_known(&self, game: &Game) -> BySeat<bool> {
        let Some(known) = self.known(game) else {
            return self.all(false);
        };
        let top = Face::new(self.rules.faces());
        BySeat::from_fn(known.hands.len(), |seat| {
            let without = top.is_some_and(|top| game.hands()[seat].count(top) == 0);
            known.hands[seat] && (known.golden[seat] || without)
        })
    }

    fn known(&self, game: &Game) -> Option<Known> {
        self.plan.as_ref().map(|plan| {
            if before_first_turn(game) {
                plan.dealt_known
            } else {
                plan.held_known
            }
        })
    }

    fn all(&self, known: bool) -> BySeat<bool> {
        BySeat::filled(self.rules.players(), known)
    }

    /// Removes the cards that were not stated from an event.
    pub fn redact(&self, event: Event) -> Event {
        let facts = self.current().map_or(&[][..], |shift| &shift.facts);
        match event {
            Event::ShiftStarted { shift, hands } => Event::ShiftStarted {
                shift,
                hands: Box::new(BySeat::from_fn(hands.len(), |seat| {
                    let stated = |(_, fact): &(usize, Fact)| matches!(fact, Fact::Hand(of, _) if *of == seat);
                    hands[seat].filter(|_| facts.iter().any(stated))
                })),
            },
            Event::CardsExchanged {
                giver,
                receiver,
                count,
                cards,
            } => {
                let stated = |(_, fact): &(usize, Fact)| matches!(fact, Fact::Given(of, Some(_)) if *of == giver);
                Event::CardsExchanged {
                    giver,
                    receiver,
                    count,
                    cards: cards.filter(|_| facts.iter().any(stated)),
                }
            }
            public => public,
        }
    }

    fn current(&self) -> Option<&ShiftFacts> {
        self.shifts.get(self.started.checked_sub(1)?)
    }

    fn choosing(&self) -> Option<Seat> {
        self.current().and_then(|shift| shift.choosing)
    }

    fn start_shift(
        &mut self,
        shift: u32,
        last_order: Option<SeatOrder>,
        scores: BySeat<u32>,
        events: &mut Vec<Event>,
    ) -> Result<Option<Game>, ScriptError> {
        self.plan = None;
        let Some(shift_facts) = self.shifts.get(self.started) else {
            return Ok(None);
        };
        self.started += 1;
        let (plan, contradiction) =
            self.completer
                .complete(&self.rules, last_order, &shift_facts.facts);
        self.contradiction = contradiction;
        self.pending = pending_decisions(&shift_facts.facts, &plan);
        let script = Script {
            shift,
            hands: plan.dealt,
            last_order,
            scores,
            drawn: plan.drawn,
        };
        self.plan = Some(plan);
        let mut game = Game::scripted(self.rules, NO_SEED, &script, |event| events.push(event))?;
        self.apply_unstated(&mut game, events);
        Ok(Some(game))
    }

    /// Applies unstated decisions before the first turn, as planned, if a later fact requires
    /// them.
    fn apply_unstated(&self, game: &mut Game, events: &mut Vec<Event>) {
        let Some(plan) = &self.plan else { return };
        while let Some(open) = game.decision() {
            let planned = match open.kind {
                DecisionKind::Turn => None,
                kind if self.is_pending(open.seat, kind) => None,
                DecisionKind::Exchange if self.choosing() == Some(open.seat) => None,
                DecisionKind::SpecialAction if self.continues_after(open.kind) => {
                    Some(Action::Decline)
                }
                DecisionKind::Exchange if self.continues_after(open.kind) => {
                    self.next_gift(game, plan, open.seat)
                }
                _ => None,
            };
            let action = planned.and_then(|action| self.rules.actions().encode(action));
            if action.is_none_or(|id| game.apply(id, |event| events.push(event)).is_err()) {
                return;
            }
        }
    }

    fn is_pending(&self, seat: Seat, kind: DecisionKind) -> bool {
        let mut pending = self.pending[seat];
        pending.of_kind(kind).is_some_and(|number| *number > 0)
    }

    /// Whether a fact implies that the decisions of this kind are over.
    fn continues_after(&self, kind: DecisionKind) -> bool {
        let later = |(_, fact): &(usize, Fact)| match fact {
            Fact::Hand(..) | Fact::Special { .. } => false,
            Fact::Gives(..) => kind == DecisionKind::SpecialAction,
            Fact::Held(..) | Fact::Given(..) | Fact::Turn(..) => true,
        };
        let is_special = kind == DecisionKind::SpecialAction;
        self.current().is_some_and(|shift| {
            (is_special && shift.special_is_settled) || shift.facts.iter().any(later)
        })
    }

    /// The next card of the planned gift.
    fn next_gift(&self, game: &Game, plan: &Plan, seat: Seat) -> Option<Action> {
        let gave = game.gave()[seat];
        let faces = (1..=self.rules.faces()).filter_map(Face::new);
        let mut planned = plan.gifts[seat];
        planned[JOKER] = planned[JOKER].saturating_sub(gave.jokers());
        faces
            .into_iter()
            .find(|&face| planned[index(face)] > gave.count(face))
            .map(Action::Give)
            .or((planned[JOKER] > 0).then_some(Action::GiveJoker))
    }
}

/// Whether the hands are still as dealt.
fn before_first_turn(game: &Game) -> bool {
    game.decision()
        .is_some_and(|open| open.kind != DecisionKind::Turn)
}

/// Counts the stated decisions before the first turn: special actions and chosen gifts, card by
/// card.
fn pending_decisions(facts: &[(usize, Fact)], plan: &Plan) -> BySeat<PendingDecisions> {
    let mut pending = plan.choosers.map(|_| PendingDecisions::default());
    for (_, fact) in facts {
        match *fact {
            Fact::Special { seat, .. } => pending[seat].special = 1,
            Fact::Gives(seat, _) => pending[seat].gifts = pending[seat].gifts.saturating_add(1),
            Fact::Given(seat, Some(cards)) if plan.choosers[seat] => {
                pending[seat].gifts = pending[seat].gifts.max(cards.len());
            }
            _ => {}
        }
    }
    pending
}
