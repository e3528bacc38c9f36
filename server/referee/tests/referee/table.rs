//! A physical table as the tests know it: a game whose cards are all known (the truth), reported to
//! a referee that knows only what is reported to it.

use chefshat_engine::{
    Action, ActionId, BySeat, Cards, DecisionKind, Event, Game, PassScope, RuleSet, RuleSetSpec,
    Seat, Seed, Stop, Viewer,
};
use chefshat_referee::counts::{JOKER, NOTHING, index};
use chefshat_referee::{Referee, Report, Ruling, SeenCards, Stage, Verdict};
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

/// The players, by seat.
pub(crate) const NAMES: [&str; 6] = ["Ada", "Bo", "Cy", "Di", "Ed", "Flo"];

/// Rules with a fixed number of Shifts.
pub(crate) fn rules(players: u8, faces: u8, shifts: u32) -> RuleSet {
    RuleSetSpec {
        players,
        faces,
        stop: Stop::Shifts(shifts),
        points: Vec::new(),
        ..RuleSetSpec::default()
    }
    .validate()
    .unwrap()
}

/// The rule sets of the tests: all that a physical table allows.
pub(crate) fn varied(faces: u8, shifts: u32, variation: u8) -> RuleSet {
    let bit = |bit: u8| variation >> bit & 1 == 1;
    RuleSetSpec {
        exchange: !bit(0),
        special_actions: !bit(1),
        pass_scope: if bit(2) {
            PassScope::Turn
        } else {
            PassScope::Pizza
        },
        max_idle_pizzas: if bit(3) { 1 } else { 3 },
        ..rules(4, faces, shifts).spec()
    }
    .validate()
    .unwrap()
}

/// Cards as a camera sees them.
pub(crate) fn seen(cards: Cards, faces: u8) -> SeenCards {
    let mut counts = NOTHING;
    for (slot, count) in counts.iter_mut().zip(cards.counts(faces)) {
        *slot = count;
    }
    counts[usize::from(faces)..JOKER].fill(0);
    counts[JOKER] = cards.jokers();
    SeenCards {
        counts,
        golden: Some(cards.has_golden()),
    }
}

/// The cards of a play as a camera sees them; `None` for a pass.
pub(crate) fn laid(action: Action, golden: Option<bool>) -> Option<SeenCards> {
    let mut counts = NOTHING;
    match action {
        Action::Play {
            face,
            quantity,
            jokers,
        } => {
            counts[index(face)] = quantity;
            counts[JOKER] = jokers;
        }
        Action::LoneJoker => counts[JOKER] = 1,
        _ => return None,
    }
    Some(SeenCards { counts, golden })
}

/// The truth and its referee.
pub(crate) struct Table {
    pub(crate) truth: Game,
    pub(crate) referee: Referee,
    pub(crate) remote: BySeat<bool>,
    pub(crate) rng: ChaCha8Rng,
    /// Decisions of the truth in this Shift: turns.
    pub(crate) turns: Vec<(Seat, Action)>,
    /// Decisions of the truth in earlier Shifts.
    pub(crate) story: Vec<Vec<(Seat, Action)>>,
    /// Hands as dealt, by Shift.
    pub(crate) dealt: Vec<BySeat<Cards>>,
    /// Public events of the truth, and those the referee reported.
    pub(crate) true_events: Vec<Event>,
    pub(crate) events: Vec<Event>,
    pub(crate) rulings: Vec<Ruling>,
    number: u64,
}

impl Table {
    pub(crate) fn new(rules: RuleSet, seed: u64, remote: u8) -> Self {
        let players = rules.players();
        let remote = BySeat::from_fn(players, |seat| remote >> seat.index() & 1 == 1);
        let names = NAMES[..players].iter().map(ToString::to_string).collect();
        let mut bytes = [0; 32];
        bytes[..8].copy_from_slice(&seed.to_le_bytes());
        let mut true_events = Vec::new();
        let truth = Game::new(rules, Seed(bytes), |event| true_events.push(event));
        let mut referee = Referee::new(rules, remote, names);
        let events = referee.start();
        Self {
            dealt: vec![*truth.hands()],
            truth,
            referee,
            remote,
            rng: ChaCha8Rng::seed_from_u64(seed),
            turns: Vec::new(),
            story: Vec::new(),
            true_events,
            events,
            rulings: Vec::new(),
            number: 0,
        }
    }

    fn rules(&self) -> RuleSet {
        *self.truth.rules()
    }

    /// Takes in a ruling: its events replace those that are void.
    fn take(&mut self, ruling: Ruling) -> Verdict {
        let void = ruling.corrected.as_ref().map_or(0, |it| it.void_events);
        self.events.truncate(self.events.len() - void);
        self.events.extend(ruling.events.iter().cloned());
        let verdict = ruling.verdict.clone();
        self.rulings.push(ruling);
        verdict
    }

    pub(crate) fn report(&mut self, report: &Report) -> (u64, Verdict) {
        self.number += 1;
        let ruling = self.referee.report(self.number, report);
        (self.number, self.take(ruling))
    }

    fn decide(&mut self, seat: Seat, action: ActionId) {
        self.number += 1;
        let ruling = self.referee.decide(self.number, seat, action);
        self.take(ruling);
    }

    /// A legal action of the truth. Passes now and then, so that pizzas end.
    fn choose(&mut self) -> ActionId {
        let legal = self.truth.legal_actions();
        let pass = self.rules().actions().pass();
        if legal.contains(pass) && self.rng.random_bool(0.3) {
            return pass;
        }
        let count = legal.len();
        legal.nth(self.rng.random_range(0..count)).unwrap()
    }

    fn apply(&mut self, action: ActionId) {
        let shift = self.truth.shift();
        let mut events = Vec::new();
        self.truth
            .apply(action, |event| events.push(event))
            .unwrap();
        self.true_events.extend(events);
        if self.truth.shift() != shift || self.truth.is_over() {
            self.story.push(std::mem::take(&mut self.turns));
            self.dealt.push(*self.truth.hands());
        }
    }

    /// Checks that a remote seat gets exactly what it would get at a table with dealt cards.
    fn check_decision(&self, seat: Seat) {
        let open = self.referee.decision();
        let open = open.unwrap_or_else(|| {
            panic!(
                "{seat} decides: {:?} {:?}, truth {:?}",
                self.referee.stage(),
                self.referee.game().decision(),
                self.truth.decision()
            )
        });
        assert_eq!(Some(open), self.truth.decision());
        assert_eq!(
            self.referee.game().legal_actions(),
            self.truth.legal_actions()
        );
        let mut expected = self.truth.observe(Viewer::Seat(seat));
        let observation = self.referee.observe(Viewer::Seat(seat));
        // What a partner at the table gave is unknown, unless it follows from the hand.
        if observation.received.is_empty() {
            expected.received = Cards::EMPTY;
        }
        assert_eq!(observation, expected);
    }

    /// Does what the table waits for before the next turn; whether a turn is next.
    pub(crate) fn prepare(&mut self) -> bool {
        let faces = self.rules().faces();
        let space = self.rules().actions();
        match self.referee.stage() {
            Stage::Hand(seat) => {
                let cards = seen(self.truth.hands()[seat], faces);
                let (_, verdict) = self.report(&Report::Hand { seat, cards });
                assert_eq!(verdict, Verdict::Accepted, "the hand of {seat}");
            }
            Stage::Special(_) => {
                let open = self.truth.decision();
                let open = open.filter(|open| open.kind == DecisionKind::SpecialAction);
                let Some(open) = open else {
                    let (_, verdict) = self.report(&Report::Special { seat: None });
                    assert_eq!(verdict, Verdict::Accepted);
                    return false;
                };
                let action = self.choose();
                let declared = action == space.declare();
                if self.remote[open.seat] {
                    self.check_decision(open.seat);
                    self.decide(open.seat, action);
                } else {
                    let seat = declared.then_some(open.seat);
                    let (_, verdict) = self.report(&Report::Special { seat });
                    assert_eq!(verdict, Verdict::Accepted);
                }
                self.apply(action);
            }
            Stage::Gift(seat) if self.remote[seat] => {
                self.check_decision(seat);
                let action = self.choose();
                self.decide(seat, action);
                self.apply(action);
            }
            Stage::Gift(seat) => {
                while self
                    .truth
                    .decision()
                    .is_some_and(|open| open.kind == DecisionKind::Exchange && open.seat == seat)
                {
                    let action = self.choose();
                    self.apply(action);
                }
                let known = self.rng.random_bool(0.5);
                let cards = known.then(|| seen(self.truth.gave()[seat], faces));
                let (_, verdict) = self.report(&Report::Gift { seat, cards });
                assert_eq!(verdict, Verdict::Accepted);
            }
            Stage::Confirmation => {
                assert!(!self.events.iter().any(is_end), "it can still be corrected");
                let (_, verdict) = self.report(&Report::EndConfirmed);
                assert_eq!(verdict, Verdict::Accepted);
            }
            Stage::Opening | Stage::Turn(_) => return true,
            Stage::Question | Stage::Over => unreachable!("handled by the caller"),
        }
        false
    }

    /// The truth takes its next turn: the seat, the action, and the report of it.
    pub(crate) fn turn(&mut self) -> (Seat, Action, Report) {
        let open = self.truth.decision().unwrap();
        assert_eq!(open.kind, DecisionKind::Turn);
        let opening = self.turns.is_empty();
        let id = self.choose();
        let action = self.rules().actions().decode(id).unwrap();
        self.turns.push((open.seat, action));
        if self.remote[open.seat] {
            self.check_decision(open.seat);
            self.decide(open.seat, id);
        }
        self.apply(id);
        let report = report_of(open.seat, action, opening);
        (open.seat, action, report)
    }

    /// The turns that the referee counts in the Shift in which the truth last acted.
    pub(crate) fn counted(&self) -> Vec<(u64, Seat, Action)> {
        let at = self.story.len() - usize::from(self.turns.is_empty() && !self.story.is_empty());
        let story = self.referee.story();
        let shift = story.get(at).map(|shift| shift.decisions.clone());
        let is_turn = |action| {
            matches!(
                action,
                Action::Play { .. } | Action::LoneJoker | Action::Pass
            )
        };
        (shift.unwrap_or_default().into_iter())
            .filter(|(_, _, action)| is_turn(*action))
            .collect()
    }

    /// The turns of the truth in the Shift in which it last acted.
    pub(crate) fn true_turns(&self) -> &[(Seat, Action)] {
        if self.turns.is_empty() {
            self.story.last().map_or(&[], Vec::as_slice)
        } else {
            &self.turns
        }
    }

    /// Checks the end of the game: the referee knows the same game, and no card that is wrong.
    pub(crate) fn check_end(&self) {
        assert_eq!(self.referee.stage(), Stage::Over);
        assert_eq!(self.referee.game().standings(), self.truth.standings());
        let public = |events: &[Event]| -> Vec<Event> {
            events
                .iter()
                .map(|event| event.seen_by(Viewer::Spectator))
                .collect()
        };
        assert_eq!(public(&self.events), public(&self.true_events));
        for (shift, story) in self.referee.story().iter().enumerate() {
            for (seat, hand) in story.hands.iter() {
                if let Some(hand) = hand {
                    assert_eq!(*hand, self.dealt[shift][seat], "Shift {shift}, seat {seat}");
                }
            }
        }
    }
}

fn is_end(event: &Event) -> bool {
    matches!(event, Event::GameEnded { .. })
}

/// The report of a turn.
pub(crate) fn report_of(seat: Seat, action: Action, opening: bool) -> Report {
    match laid(action, Some(opening)) {
        Some(cards) => Report::Laid {
            seat: Some(seat),
            cards,
        },
        None => Report::Pass { seat: Some(seat) },
    }
}
