//! Shifts played at random, with what each seat saw of them.

use chefshat_engine::{
    ActionId, BySeat, Cards, Deal, Decision, DecisionKind, Event, Game, Mask, Observation, RuleSet,
    Script, Seat, SeatOrder, Seed, Viewer,
};
use chefshat_search::{Knowledge, ShiftHistory};

/// A decision of a Shift, and the game before it.
pub(crate) struct Moment {
    pub(crate) seat: Seat,
    pub(crate) kind: DecisionKind,
    pub(crate) action: ActionId,
    pub(crate) legal: Mask,
    pub(crate) observation: Observation,
    pub(crate) history: ShiftHistory,
}

/// A Shift that was played.
pub(crate) struct Scenario {
    pub(crate) rules: RuleSet,
    pub(crate) script: Script,
    pub(crate) moments: Vec<Moment>,
}

impl Scenario {
    /// Plays a Shift at random: the first one, or one after a Shift that seats finished in the order
    /// of `places`.
    pub(crate) fn random(rules: RuleSet, number: u64, places: Option<&[usize]>) -> Scenario {
        let seed = Seed([number as u8; 32]);
        let deal = Deal::new(&rules, seed, 1);
        let script = Script {
            shift: if places.is_some() { 2 } else { 1 },
            hands: deal.hands(),
            last_order: places.map(|places| {
                let seats: Vec<Seat> = places.iter().map(|&place| Seat::new(place)).collect();
                SeatOrder::from_slice(&seats).expect("an order")
            }),
            scores: BySeat::filled(rules.players(), 0),
            drawn: deal.drawn(),
        };
        let mut dice = number.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
        let choose = |_: Decision, legal: &Mask| {
            dice ^= dice << 13;
            dice ^= dice >> 7;
            dice ^= dice << 17;
            legal.nth((dice >> 11) as usize % legal.len())
        };
        Scenario::played(rules, script, choose)
    }

    /// This Shift with other cards dealt, up to and with a decision. Turns are the same; gifts that
    /// are no longer possible are others. `None` if a turn is not possible.
    pub(crate) fn with_deal(&self, hands: BySeat<Cards>, number: usize) -> Option<Scenario> {
        let script = Script {
            hands,
            ..self.script.clone()
        };
        let upto = &self.moments[..=number];
        let mut turns = upto
            .iter()
            .filter(|moment| moment.kind == DecisionKind::Turn);
        let mut gifts: Vec<&Moment> = upto
            .iter()
            .filter(|moment| moment.kind == DecisionKind::Exchange)
            .collect();
        let declare = self.rules.actions().declare();
        let declared = upto.iter().find(|moment| moment.action == declare);
        let other = Scenario::played(self.rules, script, |decision, legal| match decision.kind {
            DecisionKind::SpecialAction => match declared {
                Some(moment) if moment.seat == decision.seat => Some(declare),
                _ => Some(self.rules.actions().decline()),
            },
            DecisionKind::Exchange => {
                let same = gifts.iter().position(|gift| gift.seat == decision.seat);
                let same = same.map(|gift| gifts.remove(gift).action);
                same.filter(|gift| legal.contains(*gift)).or(legal.nth(0))
            }
            DecisionKind::Turn => turns.next().map(|turn| turn.action),
        });
        let last = other.moments.last()?;
        (turns.next().is_none() && last.seat == self.moments[number].seat).then_some(other)
    }

    /// Plays a Shift until `choose` gives no action, or an illegal one.
    pub(crate) fn played(
        rules: RuleSet,
        script: Script,
        mut choose: impl FnMut(Decision, &Mask) -> Option<ActionId>,
    ) -> Scenario {
        let mut histories: Vec<ShiftHistory> = (0..rules.players())
            .map(|seat| ShiftHistory::new(Seat::new(seat)))
            .collect();
        let mut tell = |event: Event| {
            histories
                .iter_mut()
                .for_each(|history| history.on_event(&event));
        };
        let game = Game::scripted(rules, Seed([0; 32]), &script, &mut tell).expect("a script");
        let mut game = game.closing_copy();
        let mut moments = Vec::new();
        while let Some(decision) = game.decision() {
            let legal = game.legal_actions();
            let Some(action) = choose(decision, &legal).filter(|action| legal.contains(*action))
            else {
                break;
            };
            moments.push(Moment {
                seat: decision.seat,
                kind: decision.kind,
                action,
                legal,
                observation: game.observe(Viewer::Seat(decision.seat)),
                history: histories[decision.seat.index()].clone(),
            });
            let mut tell = |event: Event| {
                histories
                    .iter_mut()
                    .for_each(|history| history.on_event(&event));
            };
            game.apply(action, &mut tell).expect("a legal action");
        }
        Scenario {
            rules,
            script,
            moments,
        }
    }

    /// What is legal at a decision.
    pub(crate) fn legal(&self, number: usize) -> Mask {
        self.moments[number].legal
    }

    /// What the seat of a decision knows there.
    pub(crate) fn knowledge(&self, number: usize) -> Knowledge {
        let moment = &self.moments[number];
        Knowledge::new(self.rules, &moment.observation, &moment.history).expect("a decision")
    }
}

/// The turn with the most legal actions.
pub(crate) fn busiest(scenario: &Scenario) -> usize {
    (0..scenario.moments.len())
        .max_by_key(|&moment| scenario.legal(moment).len())
        .expect("a decision")
}
