//! One game of a vector environment: takes the client's actions, advances the game with built-in
//! agents to the client's next decision, and writes rewards, ended episodes and counts.

use chefshat_engine::{
    Action, ActionId, BySeat, Decision, Event, Mask, MetricsRecorder, Standings, Viewer,
};

use super::columns::{Ending, PlayedGame, Row, places_taken};
use super::history::{Entry, History};
use super::part::{OpenRow, Part, cost_of};
use super::running::{Open, RunningGame};
use super::saved::SavedGame;
use super::setup::{Episode, VectorSetup};
use super::start::Start;
use super::terms::Decisions;
use super::waiting::Waiting;
use chefshat_agents::{BuiltInAgent, ask, is_wrong_action};
use chefshat_engine::PlayedDecision;

/// Maximum number of Shifts that end in one game within one step, not counting one that the
/// client's action ends.
const MAX_SHIFTS_PER_STEP: u64 = 2;

/// Most bytes of a row of a batch without the columns that a setup asks for.
const MAX_ROW_BYTES: usize = 256;

/// A sequence of games with the same number.
#[derive(Debug)]
pub(super) struct Slot {
    number: u32,
    index: u64,
    /// `None` once the last game is over.
    running: Option<RunningGame>,
    /// Shifts that have ended in this step, not counting one that the client's action ended.
    shifts: u64,
}

// Here, because a slot is the largest part.
impl VectorSetup {
    /// The bytes that the games and two batches of them take, roughly.
    pub fn memory(&self) -> u64 {
        let agents = self.rules().players() * size_of::<BuiltInAgent>();
        let row = MAX_ROW_BYTES + self.all_hands_width() + 2 * usize::from(self.history());
        // A decision, and the end of an episode for each seat.
        let rows = u64::from(self.games()) + self.seats_played();
        let game = size_of::<Slot>() + agents + usize::from(self.history()) * size_of::<Entry>();
        u64::from(self.games()) * game as u64 + 2 * rows * row as u64
    }
}

impl Slot {
    /// A slot without a game.
    pub(super) fn new(number: u32) -> Slot {
        Slot {
            number,
            index: u64::from(number),
            running: None,
            shifts: 0,
        }
    }

    /// The number of its games.
    pub(super) fn number(&self) -> u32 {
        self.number
    }

    /// Ends or abandons the game and begins the one with the next index, if there is one.
    pub(super) fn begin_next(&mut self, setup: &VectorSetup, part: &mut Part) {
        self.running = None;
        let next = self.index.saturating_add(setup.games().into());
        if setup.has_game(next) {
            self.index = next;
            self.begin(setup, part);
        }
    }

    /// Begins the game with this index.
    pub(super) fn begin(&mut self, setup: &VectorSetup, part: &mut Part) {
        let running = RunningGame::begin(setup, self.index);
        part.batch
            .beginnings
            .push(self.number, self.index, &running.seed.0);
        self.running = Some(running);
    }

    /// The state of the game.
    pub(super) fn save(&self, setup: &VectorSetup) -> SavedGame {
        SavedGame::new(setup.terms(), self.index, self.running.clone())
    }

    /// Replaces the game.
    pub(super) fn restore(&mut self, saved: SavedGame) {
        self.index = saved.index();
        self.running = saved.into_running();
    }

    /// Whether the last game is over.
    pub(super) fn is_over(&self) -> bool {
        self.running.is_none()
    }

    /// Number of decisions and attempts kept of the game.
    pub(super) fn kept(&self) -> u64 {
        self.running.as_ref().map_or(0, |running| running.kept)
    }

    /// Applies the client's action to the open decision.
    pub(super) fn answer(&mut self, action: ActionId, setup: &VectorSetup, part: &mut Part) {
        let Some(running) = &mut self.running else {
            return;
        };
        let Some(open) = &mut running.open else {
            return;
        };
        let (decision, legal) = (open.decision, &open.legal);
        let mut taken = action;
        if !legal.contains(action) {
            open.attempts = open.attempts.saturating_add(1);
            open.reward = 0.0;
            let attempts = open.attempts;
            part.totals.invalid_attempts += 1;
            running.refuse(setup, decision, action);
            let limit = setup.max_invalid_attempts();
            if limit.is_none_or(|limit| attempts < limit.get()) {
                return;
            }
            taken = running
                .game
                .default_action()
                .expect("an open decision has a default");
        }
        running.open = None;
        part.totals.client_decisions += 1;
        self.take(taken, taken != action, setup, part);
    }

    /// Advances until the client or a network has to decide, the last game is over, or the step's
    /// limit is reached. Decisions and attempts of built-in agents count against the part's budget.
    /// `place` is that of the slot among those of the part.
    pub(super) fn advance(
        &mut self,
        place: usize,
        setup: &VectorSetup,
        part: &mut Part,
        waiting: &mut Waiting,
    ) {
        self.shifts = 0;
        self.continue_step(place, setup, part, waiting);
    }

    /// Takes a network's action, for which the game has waited, and advances on.
    pub(super) fn advance_with(
        &mut self,
        action: ActionId,
        place: usize,
        setup: &VectorSetup,
        part: &mut Part,
        waiting: &mut Waiting,
    ) {
        self.take_counted(action, false, setup, part);
        self.continue_step(place, setup, part, waiting);
    }

    fn continue_step(
        &mut self,
        place: usize,
        setup: &VectorSetup,
        part: &mut Part,
        waiting: &mut Waiting,
    ) {
        while part.budget > 0 && self.shifts < MAX_SHIFTS_PER_STEP {
            let Some(running) = &mut self.running else {
                return;
            };
            if running.open.is_some() {
                return;
            }
            let Some(decision) = running.game.decision() else {
                self.finish(setup, part);
                continue;
            };
            let budget = &mut part.budget;
            match running.decide(place, setup, decision, budget, waiting) {
                Decided::Action(action, by_default) => {
                    self.take_counted(action, by_default, setup, part);
                }
                Decided::Later => return,
            }
        }
    }

    /// Writes the row of the open decision, if there is one.
    pub(super) fn write_row(&mut self, setup: &VectorSetup, part: &mut Part) {
        let Some(running) = &mut self.running else {
            return;
        };
        let Some(open) = &mut running.open else {
            return;
        };
        let seat = open.decision.seat;
        open.reward += std::mem::take(&mut running.rewards[seat]);
        part.batch.push(&Row {
            game: self.number,
            seat,
            attempts: open.attempts,
            reward: open.reward,
            observation: &running.game.observe(Viewer::Seat(seat)),
            history: running.history.as_ref(),
            legal: &open.legal,
            all_hands: setup.all_hands().then(|| running.game.hands()),
        });
        part.open.push(OpenRow {
            game: self.number,
            seat,
            legal: open.legal,
        });
    }

    /// Applies a legal action of an agent, and counts a Shift that it ends.
    fn take_counted(
        &mut self,
        action: ActionId,
        by_default: bool,
        setup: &VectorSetup,
        part: &mut Part,
    ) {
        let before = part.totals.shifts;
        self.take(action, by_default, setup, part);
        self.shifts += part.totals.shifts - before;
    }

    /// Applies a legal action and records its effects.
    fn take(&mut self, action: ActionId, by_default: bool, setup: &VectorSetup, part: &mut Part) {
        let Part { batch, totals, .. } = part;
        let running = self.running.as_mut().expect("a game is being played");
        totals.decisions += 1;
        if setup.keeps_records() {
            running.kept += 1 + running.attempts.len() as u64;
            running.decisions.push(PlayedDecision {
                action,
                attempts: std::mem::take(&mut running.attempts),
                by_default,
            });
        }
        // If the Shift may end, keep a copy for the final observations, which the next deal would
        // overwrite.
        let closing = running
            .may_end_shift(action)
            .then(|| running.game.closing_copy());
        running.events.clear();
        let required = match &running.history {
            Some(_) => running.game.requirement(),
            None => None,
        };
        let actor = running.game.decision().map(|decision| decision.seat);
        running
            .game
            .apply(action, |event| running.events.push(event))
            .expect("an action of the mask is legal");
        if let Some(scheme) = setup.scheme() {
            scheme.of_events(setup.rules(), &running.events, |seat, reward, _| {
                if setup.agents()[seat].is_none() {
                    running.rewards[seat] += reward;
                }
            });
        }
        if let (Some(history), Some(seat)) = (&mut running.history, actor) {
            let space = setup.rules().actions();
            let events = &running.events;
            history.add(setup.history(), seat, required, action, events, space);
        }
        let standings = running.game.standings();
        if let Some(recorder) = &mut running.recorder {
            let winner = standings.as_ref().map(Standings::winner);
            let shifts = running
                .events
                .iter()
                .filter_map(|event| recorder.on_event(event));
            for shift in shifts {
                batch.shifts.push(self.number, self.index, &shift, winner);
            }
        }
        let end = running.events.iter().find_map(|event| match event {
            Event::ShiftEnded(end) => Some(end.order),
            _ => None,
        });
        let Some(order) = end else {
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
                    reward: std::mem::take(&mut running.rewards[seat]),
                    game_over: standings.is_some(),
                    place: places[seat],
                    observation: &closing.observe(Viewer::Seat(seat)),
                    history: running.history.as_ref(),
                });
            }
        }
        if let Some(history) = &mut running.history {
            *history = History::new();
        }
    }

    /// Ends a finished game and begins the next one, if there is one.
    fn finish(&mut self, setup: &VectorSetup, part: &mut Part) {
        if setup.keeps_records()
            && let Some(running) = &mut self.running
        {
            part.batch.played.push(PlayedGame {
                game: self.number,
                index: self.index,
                seed: running.seed,
                decisions: std::mem::take(&mut running.decisions),
            });
        }
        self.begin_next(setup, part);
    }
}

/// The result of asking those who decide without the client.
enum Decided {
    /// An action, and whether it is the default after invalid attempts.
    Action(ActionId, bool),
    /// None yet: the client or a network has to be asked.
    Later,
}

/// The only legal action, if there is no other.
fn only(legal: &Mask) -> Option<ActionId> {
    (legal.len() == 1).then(|| legal.nth(0)).flatten()
}

impl RunningGame {
    /// Begins the game with this index.
    fn begin(setup: &VectorSetup, index: u64) -> RunningGame {
        let seed = setup.game_seed(index);
        if let Start::Saved { games, same_deals } = setup.start() {
            let saved = &games[(index % games.len() as u64) as usize];
            return saved.begin((!same_deals).then_some(seed));
        }
        let mut history = (setup.history() > 0).then(History::new);
        let game = setup.begin(index, seed, |before, action, events| {
            if let (Some(history), Some(open)) = (&mut history, before.decision()) {
                let required = before.requirement();
                let space = setup.rules().actions();
                history.add(setup.history(), open.seat, required, action, events, space);
            }
        });
        RunningGame {
            seed,
            recorder: setup
                .statistics()
                .then(|| MetricsRecorder::joining(&game, setup.scheme())),
            game,
            agents: RunningGame::agents(&setup.terms(), seed),
            rewards: BySeat::filled(setup.rules().players(), 0.0),
            open: None,
            events: Vec::with_capacity(8),
            attempts: Vec::new(),
            decisions: Vec::new(),
            kept: 0,
            history,
        }
    }

    /// Takes a decision without the client. Opens it if it is the client's; if a network has to be
    /// asked, adds it to those that wait.
    fn decide(
        &mut self,
        place: usize,
        setup: &VectorSetup,
        decision: Decision,
        budget: &mut u64,
        waiting: &mut Waiting,
    ) -> Decided {
        *budget = budget.saturating_sub(1);
        let seat = decision.seat;
        let owned = setup.agents()[seat].is_none();
        if owned {
            let asked = setup.decisions() == Decisions::All || is_wrong_action(decision);
            if asked {
                let legal = self.game.legal_actions();
                if setup.skip_forced()
                    && let Some(action) = only(&legal)
                {
                    return Decided::Action(action, false);
                }
                self.open = Some(Open {
                    decision,
                    legal,
                    attempts: 0,
                    reward: 0.0,
                });
                return Decided::Later;
            }
        }
        if let Some(number) = setup.network_at(seat) {
            let legal = self.game.legal_actions();
            let network = setup.network(number);
            let chosen = only(&legal).or_else(|| {
                let seen = self.game.observe(Viewer::Seat(seat));
                waiting.decide_or_wait(number, network, place, &seen, &legal)
            });
            let Some(action) = chosen else {
                *budget = budget.saturating_sub(cost_of(network));
                return Decided::Later;
            };
            return Decided::Action(action, false);
        }
        let agent = self.agents.get_mut(seat.index());
        let Some(agent) = agent.and_then(Option::as_mut) else {
            let action = self.game.default_action();
            return Decided::Action(action.expect("an open decision has a default"), false);
        };
        let legal = self.game.legal_actions();
        let answer = ask(
            &self.game,
            seat,
            &legal,
            setup.max_invalid_attempts(),
            |observation| agent.decide(observation, &legal),
            |action| {
                if let Some(recorder) = &mut self.recorder
                    && is_wrong_action(decision)
                {
                    recorder.wrong(seat);
                }
                *budget = budget.saturating_sub(1);
                if setup.keeps_records() {
                    self.attempts.push(action);
                }
            },
        );
        Decided::Action(answer.action, answer.by_default)
    }

    /// Records an illegal action of the client.
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

    /// Whether this action may end the Shift: it reaches the limit of turns, or leaves one seat
    /// with cards.
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
