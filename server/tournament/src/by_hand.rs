//! What participants and the organiser change by hand: leaving, replacing, pausing, postponing and
//! calling again. When each is possible, and its effect on the state. `scheduler` checks the games
//! that may then be called.

use thiserror::Error;

use super::Tournament;
use super::change::{Change, Entrant, Former, Game, GameState};
use super::entry::JoinProblem;
use super::settings::{Deals, Format};
use super::state::{State, TournamentState};

/// Maximum number of pauses, replacements, and games moved in the queue by the organiser, which
/// bounds what is stored of them. Resuming, removing and closing are not counted.
pub const MAX_CHANGES_BY_HAND: u32 = 10_000;
/// Maximum number of participants who withdraw by themselves before the beginning. After it each
/// does so once.
pub const MAX_EARLY_WITHDRAWALS: u32 = 1_000;
/// Maximum number of times that one participant postpones games.
pub const MAX_POSTPONEMENTS: u32 = 100;
/// Maximum number of times that a place is taken by somebody else.
pub const MAX_REPLACEMENTS: usize = 4;

/// Why a change by hand is not possible.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum ByHandProblem {
    /// There is no such participant.
    #[error("this tournament has no participant with this number")]
    NoParticipant,
    /// A filler cannot leave.
    #[error("a filler only fills up the tables and cannot leave; replace it instead")]
    Filler,
    /// The tournament is finished or closed.
    #[error("the tournament is over")]
    Over,
    /// The tournament has not begun, or is over.
    #[error("the tournament is not being played: start it first, unless it is over")]
    NotPlaying,
    /// The place was taken by others too often.
    #[error("this place was taken by somebody else {MAX_REPLACEMENTS} times, which is the maximum")]
    TooManyReplacements,
    /// The new participant cannot join.
    #[error(transparent)]
    Join(#[from] JoinProblem),
    /// There is no such game.
    #[error("this tournament has not drawn a game with this number")]
    NoGame,
    /// The game is being played, or has ended.
    #[error("the game is being played or has ended")]
    NotDue,
    /// The participant does not play the game.
    #[error("only the organiser and participants of the game can postpone it")]
    NotInGame,
    /// The participant has postponed the game too often.
    #[error("you have postponed this game {0} times, which is the maximum; ask the organiser")]
    PostponedTooOften(u32),
    /// All participants of the game have left.
    #[error("all participants of this game have left; replace one of them first")]
    NobodyLeft,
    /// Too many changes by hand.
    #[error("this was changed by hand too often: at most {0} times")]
    TooMany(u32),
}

/// Who makes a participant leave.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Leaving {
    /// It leaves by itself.
    Itself,
    /// The organiser withdraws it.
    ByOrganiser,
    /// The organiser removes it.
    Removed,
}

impl Tournament {
    /// The participant with this number has left.
    pub fn is_withdrawn(&self, participant: usize) -> bool {
        self.state.withdrawn.get(participant) == Some(&true)
    }

    /// Who had the place of a participant before, in order.
    pub fn former(&self, participant: usize) -> &[Former] {
        let former = self.state.former.get(participant);
        former.map_or(&[], Vec::as_slice)
    }

    /// The name under which a participant was called to a game, if somebody else has its place now.
    pub fn former_name(&self, game: &Game, participant: usize) -> Option<&str> {
        let (_, index) = game.former.iter().find(|(who, _)| *who == participant)?;
        let former = self.former(participant).get(*index)?;
        Some(&former.entrant.name)
    }

    /// Number of changes by hand so far.
    pub fn changes_by_hand(&self) -> u32 {
        self.state.by_hand
    }

    /// Whether no game is called until the tournament is resumed.
    pub fn is_paused(&self) -> bool {
        self.state.paused
    }

    /// The change by which a participant leaves; `None` if it has left. One that left by itself can
    /// still be removed.
    ///
    /// # Errors
    /// If it cannot leave.
    pub fn withdraw(
        &self,
        participant: usize,
        leaving: Leaving,
    ) -> Result<Option<Change>, ByHandProblem> {
        let entrant = self.place(participant)?;
        if entrant.filler {
            return Err(ByHandProblem::Filler);
        }
        let (state, removed) = (&self.state, leaving == Leaving::Removed);
        if state.withdrawn[participant] && (!removed || state.removed[participant]) {
            return Ok(None);
        }
        if leaving == Leaving::Itself && state.phase == State::Open {
            within(state.withdrawn_early, MAX_EARLY_WITHDRAWALS)?;
        }
        Ok(Some(Change::Withdrawn {
            participant,
            removed,
        }))
    }

    /// The change by which somebody else takes the place of a participant.
    ///
    /// # Errors
    /// If the new participant cannot take it.
    pub fn replace(&self, participant: usize, by: Entrant) -> Result<Change, ByHandProblem> {
        self.place(participant)?;
        if self.state.phase == State::Open && self.is_withdrawn(participant) {
            // It is not among the participants any more, and anybody can join.
            return Err(ByHandProblem::NoParticipant);
        }
        self.few_by_organiser()?;
        if self.former(participant).len() >= MAX_REPLACEMENTS {
            return Err(ByHandProblem::TooManyReplacements);
        }
        self.admits(&by, Some(participant))?;
        Ok(Change::Replaced { participant, by })
    }

    /// The change that pauses or resumes the tournament; `None` if it is paused or not already.
    ///
    /// # Errors
    /// It is not being played.
    pub fn set_paused(&self, paused: bool) -> Result<Option<Change>, ByHandProblem> {
        self.being_played()?;
        if self.state.paused == paused {
            return Ok(None);
        }
        if !paused {
            return Ok(Some(Change::Resumed));
        }
        self.few_by_organiser()?;
        Ok(Some(Change::Paused))
    }

    /// The change that postpones a game; `by` a participant, or the organiser.
    ///
    /// # Errors
    /// It cannot be postponed.
    pub fn postpone(&self, game: usize, by: Option<usize>) -> Result<Change, ByHandProblem> {
        self.being_played()?;
        let found = (self.games().get(game)).ok_or(ByHandProblem::NoGame)?;
        if let Some(by) = by
            && (!found.seats.contains(&by) || self.is_withdrawn(by))
        {
            return Err(ByHandProblem::NotInGame);
        }
        if found.state != GameState::Due {
            return Err(ByHandProblem::NotDue);
        }
        let most = self.state.settings.max_calls;
        let times = found.postponed.iter().filter(|&&who| who == by).count();
        match by {
            None => self.few_by_organiser()?,
            Some(_) if times >= most as usize => {
                return Err(ByHandProblem::PostponedTooOften(most));
            }
            Some(by) => within(self.state.postponements[by], MAX_POSTPONEMENTS)?,
        }
        Ok(Change::Postponed { game, by })
    }

    /// The change that calls a due or void game again, before all others. While the tournament is
    /// paused, no round is drawn and it does not end, so the last void game can still be called.
    ///
    /// # Errors
    /// It cannot be called.
    pub fn recall(&self, game: usize) -> Result<Change, ByHandProblem> {
        self.being_played()?;
        self.few_by_organiser()?;
        let found = (self.games().get(game)).ok_or(ByHandProblem::NoGame)?;
        // Who advanced to the next round of a knockout has been decided.
        let is_decided =
            self.state.settings.format == Format::Knockout && found.round < self.state.drawn;
        match found.state {
            GameState::Due => {}
            GameState::Void if !is_decided => {}
            _ => return Err(ByHandProblem::NotDue),
        }
        if found.seats.iter().all(|&who| self.is_withdrawn(who)) {
            // It would be void at once.
            return Err(ByHandProblem::NobodyLeft);
        }
        Ok(Change::Recalled { game })
    }

    /// A participant of a tournament that is not over.
    fn place(&self, participant: usize) -> Result<&Entrant, ByHandProblem> {
        if self.state.phase.is_over() {
            return Err(ByHandProblem::Over);
        }
        let entrant = self.state.participants.get(participant);
        entrant.ok_or(ByHandProblem::NoParticipant)
    }

    fn being_played(&self) -> Result<(), ByHandProblem> {
        match self.state.phase {
            State::Playing => Ok(()),
            State::Open | State::Finished | State::Closed => Err(ByHandProblem::NotPlaying),
        }
    }

    /// Whether the organiser can make one more change that is counted.
    fn few_by_organiser(&self) -> Result<(), ByHandProblem> {
        within(self.state.by_organiser, MAX_CHANGES_BY_HAND)
    }
}

fn within(count: u32, most: u32) -> Result<(), ByHandProblem> {
    match count < most {
        true => Ok(()),
        false => Err(ByHandProblem::TooMany(most)),
    }
}

impl TournamentState {
    pub(super) fn withdraw(&mut self, participant: usize, removed: bool) {
        if participant >= self.participants.len() {
            return;
        }
        self.by_hand += 1;
        self.withdrawn_early += u32::from(self.phase == State::Open && !removed);
        self.leave_games(participant);
        self.withdrawn[participant] = true;
        self.removed[participant] |= removed;
        self.set_physical_of(participant);
    }

    pub(super) fn replace(&mut self, participant: usize, by: &Entrant) {
        if participant >= self.participants.len() {
            return;
        }
        self.by_hand += 1;
        self.by_organiser += 1;
        self.leave_games(participant);
        self.withdrawn[participant] = false;
        self.removed[participant] = false;
        self.postponements[participant] = 0;
        let games = self.sums[participant].games;
        let entrant = std::mem::replace(&mut self.participants[participant], by.clone());
        let former = self.former[participant].len();
        self.former[participant].push(Former { entrant, games });
        for game in self
            .games
            .iter_mut()
            .filter(|game| game.state != GameState::Due)
        {
            let is_known = game.former.iter().any(|(who, _)| *who == participant);
            if game.seats.contains(&participant) && !is_known {
                game.former.push((participant, former));
            }
        }
        // What the former participant missed is not the new one's.
        for &(_, index) in &self.due {
            let game = &mut self.games[index];
            game.missing.retain(|&who| who != participant);
            game.forfeited.retain(|&who| who != participant);
        }
        for &index in &self.playing {
            let game = &mut self.games[index];
            if game.forfeited.contains(&participant) {
                game.forgiven.push(participant);
            }
        }
        self.set_physical_of(participant);
    }

    /// A participant leaves the games that it is playing, unless it holds the cards of a physical
    /// table.
    fn leave_games(&mut self, participant: usize) {
        if self.participants[participant].at_table {
            return;
        }
        for &index in &self.playing {
            let game = &mut self.games[index];
            if game.is_played_by(participant) {
                game.left.push(participant);
                self.busy[participant] -= 1;
            }
        }
    }

    pub(super) fn postpone(&mut self, index: usize, by: Option<usize>) {
        if !self.is_due(index) {
            return;
        }
        self.by_hand += 1;
        match by {
            None => self.by_organiser += 1,
            Some(by) => {
                if let Some(times) = self.postponements.get_mut(by) {
                    *times += 1;
                }
            }
        }
        self.leave(index);
        let game = &mut self.games[index];
        game.missing.clear();
        game.postponed.push(by);
        self.queue(index);
    }

    pub(super) fn recall(&mut self, index: usize) {
        if self.is_due(index) {
            self.leave(index);
        } else if self
            .games
            .get(index)
            .is_some_and(|game| game.state == GameState::Void)
        {
            self.revive(index);
        } else {
            return;
        }
        self.by_hand += 1;
        self.by_organiser += 1;
        let game = &mut self.games[index];
        game.state = GameState::Due;
        game.calls = 0;
        game.forfeited.clear();
        game.missing.clear();
        game.left.clear();
        game.former.clear();
        game.forgiven.clear();
        game.turn = self.front_turn;
        self.due.insert((self.front_turn, index));
        self.front_turn -= 1;
        self.set_physical(index);
    }

    /// Makes a void game one that is still to be played.
    fn revive(&mut self, index: usize) {
        self.over -= 1;
        let game = &mut self.games[index];
        if game.dealt && self.settings.deals == Deals::SameAtAllTables {
            // Its participants have seen the deal.
            game.deal = None;
        }
        match game.deal.and_then(|deal| self.deals.get_mut(deal as usize)) {
            // Its deal may be known.
            Some(0) => game.deal = None,
            Some(left) => *left += 1,
            None => {}
        }
    }

    fn is_due(&self, index: usize) -> bool {
        let game = self.games.get(index);
        game.is_some_and(|game| game.state == GameState::Due)
    }

    /// Sets of the due games of a participant whether they need a physical table.
    fn set_physical_of(&mut self, participant: usize) {
        let due = self.due.iter().map(|&(_, index)| index);
        let its = due.filter(|&index| self.games[index].seats.contains(&participant));
        for index in its.collect::<Vec<usize>>() {
            self.set_physical(index);
        }
    }

    /// Sets whether a game needs a physical table: a participant plays at one.
    pub(super) fn set_physical(&mut self, index: usize) {
        let mut seats = self.games[index].seats.iter();
        let is_at_table = |&who: &usize| self.participants[who].at_table && !self.withdrawn[who];
        let physical = seats.any(is_at_table);
        self.games[index].physical = physical;
    }
}
