//! A game of a real table, played by the rule engine: each Shift is completed from what is told of it and put in place of the one the engine
//! would deal. Decisions that nobody wrote down are taken silently, as the completion has them; what is not known is left out of the events.

use chefshat_engine::{
    Action, ActionId, BySeat, Deal, DecisionKind, Event, Face, Game, RuleSet, Script, ScriptError,
    Seat, SeatOrder, Seed,
};
use chefshat_proto::v1;

use super::complete::{Completer, Misfit, Plan};
use super::facts::{Fact, JOKER, ShiftFacts, index};
use super::known::Known;
use crate::convert::{FieldProblem, script_from_proto};

/// No cards come from it: it stands where the engine wants a seed.
const NO_SEED: Seed = Seed([0; 32]);

/// Where a game begins of which not all Shifts were watched.
#[derive(Debug, Clone)]
pub(crate) struct Beginning {
    /// Number of the first Shift that is told of.
    pub(crate) shift: u32,
    /// The order of the Shift before; `None` for the first.
    pub(crate) last_order: Option<SeatOrder>,
    /// Points before.
    pub(crate) scores: BySeat<u32>,
}

impl Beginning {
    /// What the header of an imported record says: a scripted Shift without hands, or nothing.
    pub(crate) fn of(
        scripted: Option<&v1::ScriptedShift>,
        rules: &RuleSet,
    ) -> Result<Self, FieldProblem> {
        let scripted = scripted.cloned().unwrap_or_default();
        if !scripted.hands.is_empty() || scripted.drawn_seat.is_some() {
            return Err(FieldProblem::new(
                "hands",
                "the Shifts of a real table tell of their hands themselves",
            ));
        }
        let deal = Deal::new(rules, NO_SEED, 1);
        let any_hands = v1::ScriptedShift {
            hands: deal
                .hands()
                .iter()
                .map(|(seat, &hand)| crate::convert::seat_cards(seat, hand, rules.faces()))
                .collect(),
            drawn_seat: deal.drawn().map(crate::convert::seat_number),
            ..scripted
        };
        let script = script_from_proto(&any_hands, rules)?;
        Ok(Self {
            shift: script.shift,
            last_order: script.last_order,
            scores: script.scores,
        })
    }
}

/// The Shifts of a real table, one after the other.
#[derive(Debug)]
pub(crate) struct Table {
    rules: RuleSet,
    shifts: Vec<ShiftFacts>,
    completer: Completer,
    /// How many Shifts have begun.
    begun: usize,
    plan: Option<Plan>,
    misfit: Option<Misfit>,
    /// What is told of the decisions before the first turn and has not been taken yet.
    told: BySeat<ToldDecisions>,
}

/// Decisions of one seat before a Shift's first turn.
#[derive(Debug, Clone, Copy, Default)]
struct ToldDecisions {
    special: u8,
    gifts: u8,
}

impl ToldDecisions {
    fn of_kind(&mut self, kind: DecisionKind) -> Option<&mut u8> {
        match kind {
            DecisionKind::SpecialAction => Some(&mut self.special),
            DecisionKind::Exchange => Some(&mut self.gifts),
            DecisionKind::Turn => None,
        }
    }
}

impl Table {
    pub(crate) fn new(rules: RuleSet, shifts: Vec<ShiftFacts>) -> Self {
        Self {
            rules,
            shifts,
            completer: Completer::default(),
            begun: 0,
            plan: None,
            misfit: None,
            told: BySeat::filled(rules.players(), ToldDecisions::default()),
        }
    }

    /// Begins the game: with its first Shift, if there is one. `None` if nothing is told of any.
    pub(crate) fn begin(
        &mut self,
        beginning: &Beginning,
        events: &mut Vec<Event>,
    ) -> Result<Option<Game>, ScriptError> {
        let started = self.start_shift(
            beginning.shift,
            beginning.last_order,
            beginning.scores,
            events,
        )?;
        Ok(started)
    }

    /// Whether a Shift is being played that is told of.
    pub(crate) fn is_open(&self) -> bool {
        self.plan.is_some()
    }

    /// Why what a line tells cannot be, if it cannot.
    pub(crate) fn misfit(&self, line: usize) -> Option<&str> {
        self.misfit
            .as_ref()
            .filter(|misfit| misfit.line == line)
            .map(|misfit| misfit.problem.as_str())
    }

    /// A decision has been applied: goes on with the next Shift, or with decisions that nobody wrote down, as far as it can.
    pub(crate) fn applied(
        &mut self,
        game: &mut Game,
        events: &mut Vec<Event>,
    ) -> Result<(), ScriptError> {
        let ended = events.iter().find_map(|event| match event {
            Event::ShiftEnded(end) => Some((end.shift, end.order, end.scores)),
            _ => None,
        });
        let Some((shift, order, scores)) = ended.filter(|_| !game.is_over()) else {
            self.decide_silently(game, events);
            return Ok(());
        };
        // The engine has dealt a Shift of its own, which was never played.
        let end = events
            .iter()
            .position(|event| matches!(event, Event::ShiftEnded(_)));
        events.truncate(end.map_or(0, |end| end + 1));
        // Points of a real game are far below the bound.
        let scores = scores.map(|score| u32::try_from(score).unwrap_or(u32::MAX));
        if let Some(next) = self.start_shift(shift + 1, Some(order), scores, events)? {
            *game = next;
        }
        Ok(())
    }

    /// A decision has been taken that was told.
    pub(crate) fn took_told(&mut self, seat: Seat, kind: DecisionKind) {
        if let Some(told) = self.told[seat].of_kind(kind) {
            *told = told.saturating_sub(1);
        }
    }

    /// Whose hand is known as it stands in the game, but for which card of the top face is the Golden one.
    pub(crate) fn hands_known(&self, game: &Game) -> BySeat<bool> {
        self.known(game)
            .map_or_else(|| self.all(false), |known| known.hands)
    }

    /// Whose hand is known, the Golden card in it too, if it is there.
    pub(crate) fn golden_known(&self, game: &Game) -> BySeat<bool> {
        let Some(known) = self.known(game) else {
            return self.all(false);
        };
        let top = Face::new(self.rules.faces());
        BySeat::from_fn(known.hands.len(), |seat| {
            let without = top.is_some_and(|top| game.hands()[seat].count(top) == 0);
            known.hands[seat] && (known.golden || without)
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

    /// An event with what nobody wrote down left out.
    pub(crate) fn as_told(&self, event: Event) -> Event {
        let facts = self.current().map_or(&[][..], |shift| &shift.facts);
        match event {
            Event::ShiftStarted { shift, hands } => Event::ShiftStarted {
                shift,
                hands: Box::new(BySeat::from_fn(hands.len(), |seat| {
                    let told = |(_, fact): &(usize, Fact)| matches!(fact, Fact::Hand(told, _) if *told == seat);
                    hands[seat].filter(|_| facts.iter().any(told))
                })),
            },
            Event::CardsExchanged {
                giver,
                receiver,
                count,
                cards,
            } => {
                let told = |(_, fact): &(usize, Fact)| matches!(fact, Fact::Given(told, Some(_)) if *told == giver);
                Event::CardsExchanged {
                    giver,
                    receiver,
                    count,
                    cards: cards.filter(|_| facts.iter().any(told)),
                }
            }
            public => public,
        }
    }

    fn current(&self) -> Option<&ShiftFacts> {
        self.shifts.get(self.begun.checked_sub(1)?)
    }

    fn start_shift(
        &mut self,
        shift: u32,
        last_order: Option<SeatOrder>,
        scores: BySeat<u32>,
        events: &mut Vec<Event>,
    ) -> Result<Option<Game>, ScriptError> {
        self.plan = None;
        let Some(told) = self.shifts.get(self.begun) else {
            return Ok(None);
        };
        self.begun += 1;
        let (plan, misfit) = self
            .completer
            .complete(&self.rules, last_order, &told.facts);
        self.misfit = misfit;
        self.told = told_decisions(&told.facts, &plan);
        let script = Script {
            shift,
            hands: plan.dealt,
            last_order,
            scores,
            drawn: plan.drawn,
        };
        self.plan = Some(plan);
        let mut game = Game::scripted(self.rules, NO_SEED, &script, |event| events.push(event))?;
        self.decide_silently(&mut game, events);
        Ok(Some(game))
    }

    /// Takes the decisions before the first turn that nobody wrote down, if anything is told that comes after them.
    fn decide_silently(&self, game: &mut Game, events: &mut Vec<Event>) {
        let Some(plan) = &self.plan else { return };
        while let Some(open) = game.decision() {
            let silent = match open.kind {
                DecisionKind::Turn => None,
                kind if self.is_told(open.seat, kind) => None,
                DecisionKind::SpecialAction if self.goes_on_after(open.kind) => {
                    Some(Action::Decline)
                }
                DecisionKind::Exchange if self.goes_on_after(open.kind) => {
                    self.next_gift(game, plan, open.seat)
                }
                _ => None,
            };
            let action = silent.and_then(|decision| self.rules.actions().encode(decision));
            let taken = action.is_some_and(|action| self.take(game, action, events));
            if !taken {
                return;
            }
        }
    }

    fn is_told(&self, seat: Seat, kind: DecisionKind) -> bool {
        let mut told = self.told[seat];
        told.of_kind(kind).is_some_and(|told| *told > 0)
    }

    fn take(&self, game: &mut Game, action: ActionId, events: &mut Vec<Event>) -> bool {
        game.apply(action, |event| events.push(event)).is_ok()
    }

    /// Whether something is told that can only come after a decision of this kind.
    fn goes_on_after(&self, kind: DecisionKind) -> bool {
        let later = |(_, fact): &(usize, Fact)| match fact {
            Fact::Hand(..) | Fact::Special { .. } => false,
            Fact::Gives(..) => kind == DecisionKind::SpecialAction,
            Fact::Given(..) | Fact::Turn(..) => true,
        };
        self.current()
            .is_some_and(|shift| shift.facts.iter().any(later))
    }

    /// The next card of a seat's planned gift.
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

/// Whether the hands are still those that were dealt.
fn before_first_turn(game: &Game) -> bool {
    game.decision()
        .is_some_and(|open| open.kind != DecisionKind::Turn)
}

/// The decisions before the first turn that are told: special actions, and every card of a gift that was chosen.
fn told_decisions(facts: &[(usize, Fact)], plan: &Plan) -> BySeat<ToldDecisions> {
    let mut told = plan.choosers.map(|_| ToldDecisions::default());
    for (_, fact) in facts {
        match *fact {
            Fact::Special { seat, .. } => told[seat].special = 1,
            Fact::Gives(seat, _) => told[seat].gifts = told[seat].gifts.saturating_add(1),
            Fact::Given(seat, Some(cards)) if plan.choosers[seat] => {
                told[seat].gifts = told[seat].gifts.max(cards.len());
            }
            _ => {}
        }
    }
    told
}
