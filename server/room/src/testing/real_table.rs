//! A real table under test: a dealt game is the truth, of which the reports that a room needs are
//! made.

use chefshat_agents::{AgentKind, NamedAgent};
use chefshat_engine::{
    Action, ActionId, BySeat, Cards, DecisionKind, Event, Game, RuleSet, Seat, Seed,
};
use chefshat_referee::counts::{Counts, JOKER, index};
use chefshat_referee::{Report, SeenCards, Stage};

use super::{OPEN, Table, ms, shifts};
use crate::ReportVerdict;
use crate::journal::{Fill, ParticipantKind, Source};
use crate::log::RoomEvent;
use crate::policy::Policy;

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
        if stage == Stage::Confirmation {
            return Some(Report::EndConfirmed);
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

pub const PERSON: Fill = Fill::AtTable(ParticipantKind::Human);
/// Two players at the table, a remote agent and a built-in agent.
pub const MIXED: [Fill; 4] = [
    PERSON,
    OPEN,
    Fill::BuiltIn(NamedAgent::Kind(AgentKind::Greedy)),
    PERSON,
];

/// A policy with short times.
pub fn policy() -> Policy {
    Policy {
        decision_time: ms(1_000),
        bank: ms(500),
        pace: Some(ms(0)),
        // As in the recorded games of earlier servers.
        absence_time: None,
        ..Policy::default()
    }
}

/// A room with players at the table, a remote agent and a built-in agent, beside the truth.
pub struct Mixed {
    pub table: Table,
    pub real: RealTable,
}

impl Mixed {
    pub fn new(fills: [Fill; 4], count: u32, seed: u8) -> Self {
        let at_table = BySeat::from_fn(4, |seat: Seat| {
            matches!(fills[seat.index()], Fill::AtTable(_))
        });
        let mut table = Table::physical(policy(), fills.to_vec(), shifts(count));
        for seat in table.core.all_seats() {
            if matches!(fills[seat.index()], Fill::Open { .. }) {
                table.join(ParticipantKind::Agent).expect("a free seat");
                table.attach(seat);
            }
        }
        let real = RealTable::new(table.core.header().rules, Seed([seed; 32]), at_table);
        Self { table, real }
    }

    pub fn stage(&self) -> Stage {
        self.table
            .core
            .table()
            .expect("a physical room")
            .referee()
            .stage()
    }

    /// Lets the next thing happen: a report, or the answer of the remote agent.
    pub fn step(&mut self) {
        self.follow();
        self.table.now += ms(10);
        if let Some(open) = self.table.core.awaited() {
            let (seat, id) = (open.decision.seat, open.id);
            let action = self.table.legal(id as usize);
            self.table.answer(seat, id, action);
        } else {
            let stage = self.stage();
            let report = self.real.next_report(stage);
            let report = report.unwrap_or_else(|| panic!("nobody acts, but {stage:?}"));
            let outcome = self.table.report(report.clone());
            assert_eq!(outcome.verdict, ReportVerdict::Accepted, "{report:?}");
        }
        self.follow();
    }

    /// Applies the decisions of remote seats to the truth.
    pub fn follow(&mut self) {
        self.table.pass_time(ms(0));
        let at_table = |seat: Seat| matches!(self.table.core.standing(seat).fill, Fill::AtTable(_));
        let known = (self.real.decisions.iter()).filter(|(seat, _)| !at_table(*seat));
        for (_, action) in self.table.decided().into_iter().skip(known.count()) {
            self.real.decide(action);
        }
    }

    /// Plays to the end of the game at the table.
    pub fn finish(&mut self) {
        self.until(|it| it.table.core.state().is_over());
        self.assert_same_end();
    }

    /// The game is over as it is at the table.
    pub fn assert_same_end(&self) {
        let standings = self.table.core.game().expect("a game").standings();
        assert_eq!(standings, self.real.truth.standings());
    }

    pub fn until(&mut self, done: impl Fn(&Self) -> bool) {
        for _ in 0..5_000 {
            if done(self) {
                return;
            }
            self.step();
        }
        panic!("it never came: {:?}", self.stage());
    }

    /// The standing events of the game.
    pub fn events(&self) -> Vec<Event> {
        let mut events: Vec<Option<Event>> = Vec::new();
        for entry in self.table.core.log().since(0) {
            if let RoomEvent::Correction(correction) = &entry.event
                && let Some(from) = correction.first_void.checked_sub(1)
            {
                events[usize::try_from(from).expect("small")..].fill(None);
            }
            events.push(match &entry.event {
                RoomEvent::Game(game) => Some(game.event.clone()),
                _ => None,
            });
        }
        events.into_iter().flatten().collect()
    }

    pub fn sources(&self) -> Vec<(Source, u64)> {
        let turns = self.table.core.log().since(0);
        turns
            .filter_map(|entry| match &entry.event {
                RoomEvent::Game(game)
                    if matches!(game.event, Event::Played { .. } | Event::Passed { .. }) =>
                {
                    Some((game.source, game.time_us))
                }
                _ => None,
            })
            .collect()
    }

    /// A play that was misread as one with other cards, and the report that states it.
    pub fn misread(&mut self) -> (u64, Report) {
        for _ in 0..200 {
            let stage = self.stage();
            let at_table = matches!(stage, Stage::Turn(seat) if matches!(self.table.core.standing(seat).fill, Fill::AtTable(_)));
            if at_table && self.table.core.open().is_none() && self.sources().len() > 1 {
                self.table.now += ms(10);
                let right = self.real.next_report(stage).expect("a turn");
                if let Report::Laid { seat, cards } = &right
                    && let Some(face) = (3..11).find(|face| cards.counts[*face] == 1)
                {
                    let mut wrong = *cards;
                    wrong.counts[face] = 0;
                    wrong.counts[face - 1] = 1;
                    let outcome = self.table.report(Report::Laid {
                        seat: *seat,
                        cards: wrong,
                    });
                    if outcome.verdict == ReportVerdict::Accepted {
                        return (outcome.number, right);
                    }
                }
                self.table.report(right);
                self.follow();
                continue;
            }
            self.step();
        }
        panic!("nothing to misread");
    }
}
