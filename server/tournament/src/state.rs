//! The state of a tournament, and the effect of each change on it; that of changes by hand is in
//! `by_hand`. Nothing here decides what happens next. A change that does not fit (for a finished game, say) has no effect, so the same
//! changes always lead to the same state.

use std::collections::BTreeSet;
use std::ops::Range;

use super::change::{Change, Entrant, Former, Game, GameResult, GameState};
use super::settings::{Deals, Format, Settings};

/// The phase of a tournament.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum State {
    /// Participants may join.
    Open,
    /// Games are being played.
    Playing,
    /// All games are counted or voided; the standings are final.
    Finished,
    /// Closed early.
    Closed,
}

impl State {
    /// Whether no further change can follow.
    pub fn is_over(self) -> bool {
        match self {
            State::Open | State::Playing => false,
            State::Finished | State::Closed => true,
        }
    }
}

/// A table of one round and its games.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Pairing {
    pub(super) round: u32,
    /// Participants in the seat order of the first game.
    pub(super) table: Vec<usize>,
    pub(super) games: Range<usize>,
}

/// The pairings of a round.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Pairings {
    /// Participants by table, in the order of their seats.
    pub(super) tables: Vec<Vec<usize>>,
    /// Participants with a bye.
    pub(super) byes: Vec<usize>,
}

/// Totals of a participant over the games that counted.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Sums {
    pub(super) games: u32,
    pub(super) byes: u32,
    pub(super) last_round: u32,
    pub(super) score: u64,
    pub(super) points: u64,
    pub(super) places: Vec<u32>,
    pub(super) forfeited: u32,
    pub(super) substituted: u32,
    pub(super) wrong_actions: u64,
    pub(super) timeouts: u64,
    pub(super) decision_time_us: u64,
    pub(super) timed_decisions: u64,
    pub(super) performance: f64,
}

impl Sums {
    /// Whether it has played a game, that is, not forfeited it.
    pub(super) fn has_played(&self) -> bool {
        self.games > self.forfeited
    }
}

/// Position in the queue of the first game. Recalled games come before it.
const FIRST_TURN: u64 = 1 << 40;

/// The state of a tournament.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct TournamentState {
    pub(super) settings: Settings,
    pub(super) phase: State,
    pub(super) paused: bool,
    pub(super) participants: Vec<Entrant>,
    /// By participant: whether it has left.
    pub(super) withdrawn: Vec<bool>,
    /// By participant: who had its place before.
    pub(super) former: Vec<Vec<Former>>,
    /// The participants of the games, ascending; empty before the beginning.
    pub(super) field: Vec<usize>,
    /// By participant: whether the organiser has removed it.
    pub(super) removed: Vec<bool>,
    /// By participant: how often it has postponed games.
    pub(super) postponements: Vec<u32>,
    /// Number of changes that a participant or the organiser made by hand.
    pub(super) by_hand: u32,
    /// How many of them the organiser made, without removals and the ends of pauses.
    pub(super) by_organiser: u32,
    /// Number of withdrawals before the beginning, without removals.
    pub(super) withdrawn_early: u32,
    pub(super) sums: Vec<Sums>,
    /// Total number of rounds; 0 before the beginning.
    pub(super) rounds: u32,
    /// Number of rounds that have been paired.
    pub(super) drawn: u32,
    pub(super) pairings: Vec<Pairing>,
    pub(super) games: Vec<Game>,
    /// Games waiting to be called, in queue order.
    pub(super) due: BTreeSet<(u64, usize)>,
    pub(super) playing: BTreeSet<usize>,
    /// By participant: number of games it is playing.
    pub(super) busy: Vec<usize>,
    /// Number of physical tables at which a game is being played.
    tables_in_use: usize,
    /// Number of games that are counted or void.
    pub(super) over: usize,
    /// By deal: number of games that are not over.
    pub(super) deals: Vec<usize>,
    next_turn: u64,
    /// The position in the queue before all others.
    pub(super) front_turn: u64,
}

impl TournamentState {
    pub(super) fn new(settings: Settings) -> TournamentState {
        TournamentState {
            settings,
            phase: State::Open,
            paused: false,
            participants: Vec::new(),
            withdrawn: Vec::new(),
            former: Vec::new(),
            field: Vec::new(),
            removed: Vec::new(),
            postponements: Vec::new(),
            by_hand: 0,
            by_organiser: 0,
            withdrawn_early: 0,
            sums: Vec::new(),
            rounds: 0,
            drawn: 0,
            pairings: Vec::new(),
            games: Vec::new(),
            due: BTreeSet::new(),
            playing: BTreeSet::new(),
            busy: Vec::new(),
            tables_in_use: 0,
            over: 0,
            deals: Vec::new(),
            next_turn: FIRST_TURN,
            front_turn: FIRST_TURN - 1,
        }
    }

    /// The participants: before the beginning those who have not left, then those who were there at
    /// the beginning.
    pub(super) fn everybody(&self) -> Vec<usize> {
        if self.rounds > 0 {
            return self.field.clone();
        }
        let numbers = 0..self.participants.len();
        numbers.filter(|&who| !self.withdrawn[who]).collect()
    }

    /// Whether all games of the rounds paired so far are over.
    pub(super) fn is_round_over(&self) -> bool {
        self.over == self.games.len()
    }

    /// Whether the next round is to be drawn.
    pub(super) fn is_draw_due(&self) -> bool {
        self.phase == State::Playing
            && self.drawn < self.rounds
            && (self.settings.format == Format::RoundRobin || self.is_round_over())
    }

    /// Whether a participant can play one more game now.
    pub(super) fn has_capacity(&self, participant: usize) -> bool {
        let entrant = &self.participants[participant];
        entrant.built_in.is_some() || self.busy[participant] < entrant.max_games
    }

    /// Whether a physical table is free.
    pub(super) fn has_free_table(&self) -> bool {
        self.tables_in_use < self.settings.physical_tables
    }

    /// Whether a participant forfeits a due game: it has left, or it missed the last call and is no
    /// longer waited for.
    pub(super) fn forfeits(&self, game: &Game, participant: usize) -> bool {
        let is_decided = game.calls >= self.settings.max_calls;
        self.withdrawn[participant]
            || game.forfeited.contains(&participant)
            || is_decided && game.missing.contains(&participant)
    }

    pub(super) fn fold(&mut self, change: &Change) {
        match change {
            Change::Joined(entrant) => self.join(entrant),
            Change::Withdrawn {
                participant,
                removed,
            } => self.withdraw(*participant, *removed),
            Change::Replaced { participant, by } => self.replace(*participant, by),
            Change::Paused | Change::Resumed => {
                self.by_hand += 1;
                self.paused = *change == Change::Paused;
                self.by_organiser += u32::from(self.paused);
            }
            Change::Postponed { game, by } => self.postpone(*game, *by),
            Change::Recalled { game } => self.recall(*game),
            Change::Begun { rounds } => {
                self.phase = State::Playing;
                self.field = self.everybody();
                self.rounds = *rounds;
            }
            Change::Drawn {
                round,
                tables,
                byes,
            } => self.draw(*round, tables, byes),
            Change::Called { game, forfeited } => self.call(*game, forfeited),
            Change::Rescheduled {
                game,
                missing,
                never_started,
            } => self.reschedule(*game, missing, *never_started),
            Change::Counted { game, result } => self.count(*game, result),
            Change::Voided { game } => self.void(*game),
            Change::Finished => self.phase = State::Finished,
            Change::Closed => {
                (0..self.games.len()).for_each(|game| self.void(game));
                self.phase = State::Closed;
            }
        }
    }

    fn join(&mut self, entrant: &Entrant) {
        self.participants.push(entrant.clone());
        self.withdrawn.push(false);
        self.removed.push(false);
        self.postponements.push(0);
        self.former.push(Vec::new());
        self.busy.push(0);
        self.sums.push(Sums {
            places: vec![0; self.settings.players],
            ..Sums::default()
        });
    }

    fn draw(&mut self, round: u32, tables: &[Vec<usize>], byes: &[usize]) {
        let known = |participant: &usize| *participant < self.participants.len();
        if !tables.iter().flatten().chain(byes).all(known) {
            return;
        }
        self.drawn = round;
        byes.iter().for_each(|&who| self.sums[who].byes += 1);
        let games = self.settings.games_of_pairing();
        let round_deals = self.deals.len();
        for (table, number) in tables.iter().zip(1..) {
            for &participant in table {
                self.sums[participant].last_round = round;
            }
            let first = self.games.len();
            let pairing_deals = self.deals.len();
            for game in 0..games {
                let deal = match self.settings.deals {
                    Deals::Independent => None,
                    Deals::SameAtAllTables => Some(round_deals + game as usize),
                    Deals::Rotated => Some(pairing_deals + game as usize / table.len().max(1)),
                };
                self.add_game(round, number, game, table, deal);
            }
            self.pairings.push(Pairing {
                round,
                table: table.clone(),
                games: first..self.games.len(),
            });
        }
    }

    /// Adds a game, by its number in the pairing from 0.
    fn add_game(
        &mut self,
        round: u32,
        table: u32,
        game: u32,
        participants: &[usize],
        deal: Option<usize>,
    ) {
        let mut seats = participants.to_vec();
        let by = game as usize % seats.len().max(1);
        seats.rotate_left(by);
        if let Some(deal) = deal {
            self.deals.resize(self.deals.len().max(deal + 1), 0);
            self.deals[deal] += 1;
        }
        let index = self.games.len();
        self.games.push(Game {
            round,
            table,
            number: game + 1,
            seats,
            physical: false,
            deal: deal.map(|deal| deal as u32),
            state: GameState::Due,
            calls: 0,
            forfeited: Vec::new(),
            missing: Vec::new(),
            left: Vec::new(),
            former: Vec::new(),
            postponed: Vec::new(),
            forgiven: Vec::new(),
            dealt: false,
            turn: 0,
        });
        self.set_physical(index);
        self.queue(index);
    }

    /// Queues a game behind the others.
    pub(super) fn queue(&mut self, index: usize) {
        let game = &mut self.games[index];
        game.state = GameState::Due;
        game.turn = self.next_turn;
        self.due.insert((self.next_turn, index));
        self.next_turn += 1;
    }

    fn call(&mut self, index: usize, forfeited: &[usize]) {
        let Some(game) = self.games.get_mut(index) else {
            return;
        };
        if game.state != GameState::Due {
            return;
        }
        self.due.remove(&(game.turn, index));
        game.state = GameState::Playing;
        game.calls += 1;
        game.dealt = true;
        game.forfeited = forfeited.to_vec();
        game.missing.clear();
        self.playing.insert(index);
        self.tables_in_use += usize::from(game.physical);
        for participant in &game.seats {
            if !game.forfeited.contains(participant) {
                self.busy[*participant] += 1;
            }
        }
    }

    fn reschedule(&mut self, index: usize, missing: &[usize], never_started: bool) {
        let Some(game) = self.games.get_mut(index) else {
            return;
        };
        match game.state {
            // The participants it waited for did not come, which counts as a call.
            GameState::Due => game.calls += 1,
            GameState::Playing => {}
            GameState::Counted(_) | GameState::Void => return,
        }
        game.missing = missing.to_vec();
        game.dealt = false;
        let is_seen = missing.is_empty() && !never_started;
        if is_seen && self.settings.deals == Deals::SameAtAllTables {
            let deal = game.deal.take();
            self.end_of_deal(deal);
        }
        self.leave(index);
        let game = &mut self.games[index];
        game.left.clear();
        game.former.clear();
        let forgiven = std::mem::take(&mut game.forgiven);
        game.forfeited.retain(|who| !forgiven.contains(who));
        self.set_physical(index);
        self.queue(index);
    }

    fn count(&mut self, index: usize, result: &GameResult) {
        let Some(game) = self.games.get(index) else {
            return;
        };
        let known = |participant| participant < self.sums.len();
        if game.is_over() || !result.seats.iter().all(|seat| known(seat.participant)) {
            return;
        }
        self.leave(index);
        for seat in &result.seats {
            let sums = &mut self.sums[seat.participant];
            sums.games += 1;
            sums.score += u64::from(seat.score);
            let did = &seat.statistics;
            sums.points += did.points;
            if let Some(times) = sums.places.get_mut(did.place.wrapping_sub(1)) {
                *times += 1;
            }
            sums.forfeited += u32::from(seat.forfeited);
            sums.substituted += u32::from(did.substituted);
            sums.wrong_actions += did.wrong_actions;
            sums.timeouts += did.timeouts;
            sums.decision_time_us += did.decision_time_us;
            sums.timed_decisions += did.timed_decisions;
            sums.performance += did.performance_score;
        }
        self.end(index, GameState::Counted(result.clone()));
    }

    fn void(&mut self, index: usize) {
        if self.games.get(index).is_some_and(|game| !game.is_over()) {
            self.leave(index);
            self.end(index, GameState::Void);
        }
    }

    /// Removes a game from the queue and from the games being played.
    pub(super) fn leave(&mut self, index: usize) {
        let game = &self.games[index];
        self.due.remove(&(game.turn, index));
        if self.playing.remove(&index) {
            self.tables_in_use -= usize::from(game.physical);
            for participant in &game.seats {
                if game.is_played_by(*participant) {
                    self.busy[*participant] -= 1;
                }
            }
        }
    }

    fn end(&mut self, index: usize, state: GameState) {
        let game = &mut self.games[index];
        game.state = state;
        let deal = game.deal;
        self.over += 1;
        self.end_of_deal(deal);
    }

    /// Counts down the games of a deal.
    fn end_of_deal(&mut self, deal: Option<u32>) {
        if let Some(left) = deal.and_then(|deal| self.deals.get_mut(deal as usize)) {
            *left -= 1;
        }
    }
}
