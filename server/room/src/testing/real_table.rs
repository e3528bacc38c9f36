//! A real table under test: a dealt game is the truth, of which the reports that a room needs are
//! made.

use chefshat_engine::{
    Action, ActionId, BySeat, Cards, DecisionKind, Event, Game, RuleSet, Seat, Seed,
};
use chefshat_referee::counts::{Counts, JOKER, index};
use chefshat_referee::{Report, SeenCards, Stage};

pub struct RealTable {
    pub truth: Game,
    /// Every decision of the truth, in order.
    pub decisions: Vec<(Seat, ActionId)>,
    /// The hands as dealt, by Shift.
    pub dealt: Vec<BySeat<Cards>>,
    at_table: BySeat<bool>,
    rules: RuleSet,
    chosen: usize,
}

impl RealTable {
    pub fn new(rules: RuleSet, seed: Seed, at_table: BySeat<bool>) -> Self {
        let truth = Game::new(rules, seed, |_| {});
        Self {
            dealt: vec![*truth.hands()],
            truth,
            decisions: Vec::new(),
            at_table,
            rules,
            chosen: 0,
        }
    }

    /// The next report for a room that waits for `stage`; `None` if a remote seat decides.
    pub fn next_report(&mut self, stage: Stage) -> Option<Report> {
        if let Stage::Hand(seat) = stage {
            return Some(self.hand(seat));
        }
        let open = self.truth.decision()?;
        let decides_at_table = self.at_table[open.seat];
        match (stage, open.kind) {
            (Stage::Special(_), DecisionKind::SpecialAction) if decides_at_table => {
                let action = self.choose();
                let declares = self.rules.actions().decode(action) == Some(Action::Declare);
                Some(Report::Special {
                    seat: declares.then_some(open.seat),
                })
            }
            (Stage::Special(None), kind) if kind != DecisionKind::SpecialAction => {
                Some(Report::Special { seat: None })
            }
            _ if !decides_at_table => None,
            (_, DecisionKind::Exchange) => {
                while (self.truth.decision())
                    .is_some_and(|it| (it.seat, it.kind) == (open.seat, open.kind))
                {
                    self.choose();
                }
                let gave = self.truth.gave()[open.seat];
                Some(Report::Gift {
                    seat: open.seat,
                    cards: Some(self.seen(gave)),
                })
            }
            _ => {
                let action = self.choose();
                Some(self.turn(open.seat, action))
            }
        }
    }

    /// Applies the decision of a remote seat.
    pub fn decide(&mut self, action: ActionId) {
        let open = self.truth.decision().expect("the game is not over");
        self.decisions.push((open.seat, action));
        let mut dealt = None;
        self.truth
            .apply(action, |event| {
                if let Event::ShiftStarted { hands, .. } = event {
                    dealt = Some(hands.map(Option::unwrap_or_default));
                }
            })
            .expect("the room checked it");
        self.dealt.extend(dealt);
    }

    /// The report of a hand.
    pub fn hand(&self, seat: Seat) -> Report {
        Report::Hand {
            seat,
            cards: self.seen(self.truth.hands()[seat]),
        }
    }

    /// The report of a turn.
    pub fn turn(&self, seat: Seat, action: ActionId) -> Report {
        let seat = Some(seat);
        let mut counts: Counts = [0; JOKER + 1];
        match self.rules.actions().decode(action) {
            Some(Action::Play {
                face,
                quantity,
                jokers,
            }) => {
                counts[index(face)] = quantity;
                counts[JOKER] = jokers;
            }
            Some(Action::LoneJoker) => counts[JOKER] = 1,
            _ => return Report::Pass { seat },
        }
        let golden = None;
        Report::Laid {
            seat,
            cards: SeenCards { counts, golden },
        }
    }

    fn seen(&self, cards: Cards) -> SeenCards {
        let faces = self.rules.faces();
        let mut counts: Counts = [0; JOKER + 1];
        for (slot, count) in counts.iter_mut().zip(cards.counts(faces)) {
            *slot = count;
        }
        counts[usize::from(faces)] = 0;
        counts[JOKER] = cards.jokers();
        SeenCards {
            counts,
            golden: Some(cards.has_golden()),
        }
    }

    /// Takes a decision at the table: any legal one.
    fn choose(&mut self) -> ActionId {
        let legal = self.truth.legal_actions();
        self.chosen = self.chosen.wrapping_mul(31).wrapping_add(7);
        let action = legal.nth(self.chosen % legal.len()).expect("one is legal");
        self.decide(action);
        action
    }
}
