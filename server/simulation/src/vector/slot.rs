//! One game of an owner: taking the owner's answers, letting built-in agents go on until the owner has to decide, and what that brings in
//! rewards, ended episodes and counts. Several games together, and the form of what is told, are decided beside this.

use chefshat_engine::{
    Action, ActionId, BySeat, Decision, Event, Game, MAX_SEATS, Mask, MetricsRecorder, Seat, Seed,
    Standings, Viewer,
};

use super::columns::{Batch, Ending, Row, Totals, places_taken};
use super::{Decisions, Episode, MAX_SHIFTS_PER_STEP, VectorSetup};
use chefshat_agents::is_wrong_action;
use chefshat_agents::{AgentKind, BuiltInAgent, agent_seed};
use chefshat_engine::PlayedDecision;

/// A game that ended, with all its decisions.
#[derive(Clone, Eq, PartialEq, Debug)]
pub struct PlayedGame {
    /// The game, from 0.
    pub game: u32,
    /// Its index.
    pub index: u64,
    /// Its seed.
    pub seed: Seed,
    /// Its decisions.
    pub decisions: Vec<PlayedDecision>,
}

/// One game and the games that follow it.
#[derive(Debug)]
pub(super) struct Slot {
    number: u32,
    index: u64,
    /// `None` when it is over and none follows.
    table: Option<Table>,
}

/// A game being played.
#[derive(Debug)]
struct Table {
    seed: Seed,
    game: Game,
    /// Those of the owner's seats take the decisions that the owner does not.
    agents: [Option<BuiltInAgent>; MAX_SEATS],
    /// Counts what Shifts say, if that is asked for.
    recorder: Option<MetricsRecorder>,
    /// Rewards since each seat last decided.
    rewards: BySeat<f32>,
    /// The decision that waits for the owner.
    open: Option<Open>,
    /// What happened by the last decision.
    events: Vec<Event>,
    /// Attempts at the decision being taken, if they are kept.
    attempts: Vec<ActionId>,
    decisions: Vec<PlayedDecision>,
    /// Number of decisions and attempts in `decisions`.
    kept: u64,
}

#[derive(Debug)]
struct Open {
    decision: Decision,
    legal: Mask,
    attempts: u32,
    /// What the row says of rewards, as long as nothing is answered.
    reward: f32,
}

impl Slot {
    /// The first game of a number.
    pub(super) fn new(number: u32, setup: &VectorSetup, batch: &mut Batch) -> Slot {
        let mut slot = Slot {
            number,
            index: u64::from(number),
            table: None,
        };
        slot.begin(setup, batch);
        slot
    }

    /// Leaves the game, ended or given up, for the next of its indices, if that is among those to be played in all.
    pub(super) fn begin_next(&mut self, setup: &VectorSetup, batch: &mut Batch) {
        self.table = None;
        let next = self.index + u64::from(setup.games());
        if setup.has_game(next) {
            self.index = next;
            self.begin(setup, batch);
        }
    }

    fn begin(&mut self, setup: &VectorSetup, batch: &mut Batch) {
        let table = Table::new(setup, setup.game_seed(self.index));
        batch
            .beginnings
            .push(self.number, self.index, &table.seed.0);
        self.table = Some(table);
    }

    /// Whether the game is over and none follows.
    pub(super) fn is_over(&self) -> bool {
        self.table.is_none()
    }

    /// Decisions and attempts that are kept of the game.
    pub(super) fn kept(&self) -> u64 {
        self.table.as_ref().map_or(0, |table| table.kept)
    }

    /// The seat whose open decision does not allow this action.
    pub(super) fn refuses(&self, action: ActionId) -> Option<Seat> {
        let open = self.table.as_ref()?.open.as_ref()?;
        (!open.legal.contains(action)).then_some(open.decision.seat)
    }

    /// Takes the owner's answer to the open decision.
    pub(super) fn answer(
        &mut self,
        action: ActionId,
        setup: &VectorSetup,
        batch: &mut Batch,
        totals: &mut Totals,
    ) {
        let Some(table) = &mut self.table else { return };
        let Some(open) = &mut table.open else { return };
        let (decision, legal) = (open.decision, &open.legal);
        let mut taken = action;
        if !legal.contains(action) {
            open.attempts += 1;
            open.reward = 0.0;
            let attempts = open.attempts;
            totals.invalid_attempts += 1;
            table.refuse(setup, decision, action);
            if attempts < setup.max_invalid_attempts() {
                return;
            }
            taken = table
                .game
                .default_action()
                .expect("an open decision has a default");
        }
        table.open = None;
        totals.client_decisions += 1;
        self.take(taken, taken != action, setup, batch, totals);
    }

    /// Goes on until the owner has to decide, the game is over and none follows, or the step is long enough. Decisions and attempts of
    /// built-in agents are taken off `budget`.
    pub(super) fn go_on(
        &mut self,
        setup: &VectorSetup,
        batch: &mut Batch,
        totals: &mut Totals,
        budget: &mut u64,
    ) {
        let shifts_before = totals.shifts;
        while *budget > 0 && totals.shifts - shifts_before < MAX_SHIFTS_PER_STEP {
            let Some(table) = &mut self.table else { return };
            if table.open.is_some() {
                return;
            }
            let Some(decision) = table.game.decision() else {
                self.follow(setup, batch);
                continue;
            };
            if let Some((action, by_default)) = table.built_in_action(setup, decision, budget) {
                self.take(action, by_default, setup, batch, totals);
            } else {
                return;
            }
        }
    }

    /// Writes the row of the open decision, if there is one.
    pub(super) fn put_row(&mut self, batch: &mut Batch) -> bool {
        let Some(table) = &mut self.table else {
            return false;
        };
        let Some(open) = &mut table.open else {
            return false;
        };
        let seat = open.decision.seat;
        open.reward += std::mem::take(&mut table.rewards[seat]);
        batch.push(&Row {
            game: self.number,
            seat,
            attempts: open.attempts,
            reward: open.reward,
            observation: &table.game.observe(Viewer::Seat(seat)),
            legal: &open.legal,
        });
        true
    }

    /// Takes a legal action and tells what it brought.
    fn take(
        &mut self,
        action: ActionId,
        by_default: bool,
        setup: &VectorSetup,
        batch: &mut Batch,
        totals: &mut Totals,
    ) {
        let table = self.table.as_mut().expect("a game is being played");
        totals.decisions += 1;
        if setup.keeps_records() {
            table.kept += 1 + table.attempts.len() as u64;
            table.decisions.push(PlayedDecision {
                action,
                attempts: std::mem::take(&mut table.attempts),
                by_default,
            });
        }
        // Where the Shift may end the seats' last view of it is wanted, which the next deal wipes away.
        let closing = table
            .may_end_shift(action)
            .then(|| table.game.closing_copy());
        table.events.clear();
        table
            .game
            .apply(action, |event| table.events.push(event))
            .expect("an action of the mask is legal");
        if let Some(scheme) = setup.scheme() {
            scheme.of_events(setup.rules(), &table.events, |seat, reward, _| {
                table.rewards[seat] += reward;
            });
        }
        let standings = table.game.standings();
        if let Some(recorder) = &mut table.recorder {
            let winner = standings.as_ref().map(Standings::winner);
            let shifts = table
                .events
                .iter()
                .filter_map(|event| recorder.on_event(event));
            for shift in shifts {
                batch.shifts.push(self.number, self.index, &shift, winner);
            }
        }
        let end = table.events.iter().find_map(|event| match event {
            Event::ShiftEnded(end) => Some((end.order, end.adjudicated)),
            _ => None,
        });
        let Some((order, adjudicated)) = end else {
            return;
        };
        totals.shifts += 1;
        totals.games += u64::from(standings.is_some());
        if setup.episode() == Episode::Shift || standings.is_some() {
            let mut closing = closing.expect("a Shift ends when it may");
            closing
                .apply(action, |_| {})
                .expect("the copy stands where the game stood");
            let standings = standings.as_ref();
            let places = places_taken(setup.episode(), &order, standings);
            for seat in setup.client_seats() {
                batch.endings.push(&Ending {
                    game: self.number,
                    index: self.index,
                    seat,
                    reward: std::mem::take(&mut table.rewards[seat]),
                    cut_short: adjudicated,
                    game_over: standings.is_some(),
                    place: places[seat],
                    observation: &closing.observe(Viewer::Seat(seat)),
                });
            }
        }
    }

    /// After the end of a game: the next one, if one follows.
    fn follow(&mut self, setup: &VectorSetup, batch: &mut Batch) {
        if setup.keeps_records()
            && let Some(table) = &mut self.table
        {
            batch.played.push(PlayedGame {
                game: self.number,
                index: self.index,
                seed: table.seed,
                decisions: std::mem::take(&mut table.decisions),
            });
        }
        self.begin_next(setup, batch);
    }
}

impl Table {
    fn new(setup: &VectorSetup, seed: Seed) -> Table {
        let game = setup.begin(seed);
        let players = setup.rules().players();
        let others = match setup.decisions() {
            Decisions::All | Decisions::Turns { others: None } => None,
            Decisions::Turns { others } => others,
        };
        // An array, because agents with their generators are no values to copy by seat.
        let agents = std::array::from_fn(|index| {
            let seat = Seat::new(index);
            let kind: Option<AgentKind> =
                setup.agents().get(seat).and_then(|agent| agent.or(others));
            kind.map(|kind| BuiltInAgent::new(kind, agent_seed(seed, seat)))
        });
        Table {
            seed,
            recorder: setup
                .statistics()
                .then(|| MetricsRecorder::joining(&game, setup.scheme())),
            game,
            agents,
            rewards: BySeat::filled(players, 0.0),
            open: None,
            events: Vec::with_capacity(8),
            attempts: Vec::new(),
            decisions: Vec::new(),
            kept: 0,
        }
    }

    /// What is decided here without the owner, and whether it is the default after invalid attempts; `None`, the decision now being open,
    /// where the owner is to decide.
    fn built_in_action(
        &mut self,
        setup: &VectorSetup,
        decision: Decision,
        budget: &mut u64,
    ) -> Option<(ActionId, bool)> {
        *budget = budget.saturating_sub(1);
        let seat = decision.seat;
        let owned = setup.agents()[seat].is_none();
        if owned {
            let asked = setup.decisions() == Decisions::All || is_wrong_action(decision);
            if asked {
                let legal = self.game.legal_actions();
                if setup.skip_forced() && legal.len() == 1 {
                    return legal.nth(0).map(|action| (action, false));
                }
                self.open = Some(Open {
                    decision,
                    legal,
                    attempts: 0,
                    reward: 0.0,
                });
                return None;
            }
        }
        let Some(agent) = &mut self.agents[seat.index()] else {
            return self.game.default_action().map(|action| (action, false));
        };
        let legal = self.game.legal_actions();
        let seen = self.game.observe(Viewer::Seat(seat));
        for _ in 0..setup.max_invalid_attempts() {
            let action = agent.decide(&seen, &legal);
            if legal.contains(action) {
                return Some((action, false));
            }
            if let Some(recorder) = &mut self.recorder
                && is_wrong_action(decision)
            {
                recorder.wrong(seat);
            }
            *budget = budget.saturating_sub(1);
            if setup.keeps_records() {
                self.attempts.push(action);
            }
        }
        self.game.default_action().map(|action| (action, true))
    }

    /// An attempt of the owner that is not legal.
    fn refuse(&mut self, setup: &VectorSetup, decision: Decision, action: ActionId) {
        if is_wrong_action(decision) {
            if let Some(recorder) = &mut self.recorder {
                recorder.wrong(decision.seat);
            }
            if let Some(scheme) = setup.scheme() {
                self.rewards[decision.seat] += scheme.invalid();
            }
        }
        if setup.keeps_records() {
            self.attempts.push(action);
        }
    }

    /// Whether this action may be the Shift's last: it reaches the limit of turns, or leaves one seat with cards.
    fn may_end_shift(&self, action: ActionId) -> bool {
        let rules = self.game.rules();
        if self.game.shift_turns() + 1 >= rules.max_turns() {
            return true;
        }
        let mut holding = self
            .game
            .hands()
            .iter()
            .filter(|(_, hand)| !hand.is_empty());
        let (Some(one), Some(other), None) = (holding.next(), holding.next(), holding.next())
        else {
            return false;
        };
        let size = match rules.actions().decode(action) {
            Some(Action::Play {
                quantity, jokers, ..
            }) => quantity + jokers,
            Some(Action::LoneJoker) => 1,
            _ => return false,
        };
        one.1.len() == size || other.1.len() == size
    }
}
