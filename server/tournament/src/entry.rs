//! Joining and beginning. Join codes, tickets and admitted kinds belong to the server.

use thiserror::Error;

use super::Tournament;
use chefshat_agents::ParticipantKind;

use super::change::{Change, Entrant};
use super::settings::{Deals, MAX_GAMES_AT_A_TIME, MIN_PARTICIPANTS};
use super::state::State;

/// Maximum number of participants who ever join, also if they leave before the beginning.
const MAX_NUMBERS: usize = 4_096;

/// Why joining fails.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum JoinProblem {
    /// The maximum number of participants has joined.
    #[error("the tournament is full")]
    Full,
    /// The tournament has begun or is over.
    #[error("the tournament no longer accepts participants: it has begun or was closed")]
    Started,
    /// Another participant has this name.
    #[error("another participant has this name")]
    NameTaken,
    /// Fillers have names like this.
    #[error("built-in agents that fill up tables have names like this; choose another")]
    NameReserved,
    /// Deals are rotated, and the entrant did not declare itself stateless.
    #[error("each deal is met several times, so only stateless agents may take part")]
    NotStateless,
    /// The entrant plays at a physical table, and there is none.
    #[error("this tournament has no physical tables; create it with `physical_tables`")]
    NoTables,
    /// The number of games at a time is out of range.
    #[error("games at a time: 1..={MAX_GAMES_AT_A_TIME}")]
    MaxGames,
}

/// Why a tournament cannot begin.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum BeginProblem {
    /// Too few participants.
    #[error("{have} of at least {need} participants have joined")]
    TooFew {
        /// Participants that joined.
        have: usize,
        /// Participants needed.
        need: usize,
    },
    /// The tournament has begun or is over.
    #[error("the tournament has begun")]
    Started,
}

impl Tournament {
    /// The change by which an entrant joins, with the number [`Tournament::next_number`].
    ///
    /// # Errors
    /// If the entrant cannot join.
    pub fn join(&self, entrant: Entrant) -> Result<Change, JoinProblem> {
        let state = &self.state;
        if state.phase != State::Open {
            return Err(JoinProblem::Started);
        }
        let is_at_limit = state.participants.len() >= MAX_NUMBERS;
        if is_at_limit || self.joined() >= state.settings.max_participants {
            return Err(JoinProblem::Full);
        }
        self.admits(&entrant, None)?;
        Ok(Change::Joined(entrant))
    }

    /// Whether it has not begun, and enough have joined to begin.
    pub fn can_begin(&self) -> bool {
        self.state.phase == State::Open && self.joined() >= MIN_PARTICIPANTS
    }

    /// The number of the next participant to join.
    pub fn next_number(&self) -> usize {
        self.state.participants.len()
    }

    /// Checks an entrant; `place`: the participant whose place it takes.
    pub(super) fn admits(
        &self,
        entrant: &Entrant,
        place: Option<usize>,
    ) -> Result<(), JoinProblem> {
        let state = &self.state;
        if !(1..=MAX_GAMES_AT_A_TIME).contains(&entrant.max_games) {
            return Err(JoinProblem::MaxGames);
        }
        if is_reserved(&entrant.name) {
            return Err(JoinProblem::NameReserved);
        }
        if self.is_name_taken(&entrant.name, place) {
            return Err(JoinProblem::NameTaken);
        }
        if entrant.at_table && state.settings.physical_tables == 0 {
            return Err(JoinProblem::NoTables);
        }
        let forgets = entrant.stateless || entrant.built_in.is_some();
        if state.settings.deals == Deals::Rotated && !forgets {
            return Err(JoinProblem::NotStateless);
        }
        Ok(())
    }

    /// The changes that begin the tournament: fillers, the beginning, and all rounds that can be
    /// paired without results. For a round robin with hundreds of participants this takes seconds.
    ///
    /// # Errors
    /// If there are too few participants, or the tournament has begun.
    pub fn begin(&self) -> Result<Vec<Change>, BeginProblem> {
        if self.state.phase != State::Open {
            return Err(BeginProblem::Started);
        }
        let (have, need) = (self.joined(), MIN_PARTICIPANTS);
        if have < need {
            return Err(BeginProblem::TooFew { have, need });
        }
        let mut begun = self.clone();
        let mut changes = Vec::new();
        while let Some(change) = begun.beginning() {
            begun.fold(&change);
            changes.push(change);
        }
        Ok(changes)
    }

    /// The next change of the beginning.
    pub(super) fn beginning(&mut self) -> Option<Change> {
        match self.state.phase {
            State::Open => {
                let state = &self.state;
                let present = state.everybody().len();
                let field = state.settings.field_for(self.joined());
                Some(if present < field {
                    Change::Joined(self.filler())
                } else {
                    let rounds = state.settings.rounds_for(present);
                    Change::Begun { rounds }
                })
            }
            State::Playing => self.pairings(),
            State::Finished | State::Closed => None,
        }
    }

    /// Number of participants without fillers and without those who left before the beginning.
    pub(super) fn joined(&self) -> usize {
        let everybody = self.state.everybody().into_iter();
        everybody
            .filter(|&who| !self.state.participants[who].filler)
            .count()
    }

    fn filler(&self) -> Entrant {
        let name = (1..)
            .map(|number| format!("{FILLER} {number}"))
            .find(|name| !self.is_name_taken(name, None))
            .expect("there are more numbers than participants");
        Entrant {
            name,
            name_fingerprint: String::new(),
            kind: ParticipantKind::Agent,
            built_in: Some(self.state.settings.filler),
            filler: true,
            stateless: true,
            max_games: MAX_GAMES_AT_A_TIME,
            at_table: false,
        }
    }

    /// Whether another participant than the one at `place` has this name.
    pub fn is_name_taken(&self, name: &str, place: Option<usize>) -> bool {
        let mut others = (self.state.everybody().into_iter()).filter(|&who| Some(who) != place);
        // Names that look the same would be indistinguishable in the standings.
        let name = looks(name);
        others.any(|who| looks(&self.state.participants[who].name) == name)
    }
}

/// A name as it looks: without capitals, without what only chooses the form of a symbol, and with one
/// space for all kinds of them.
fn looks(name: &str) -> String {
    let symbols = name.replace(|letter| matches!(letter, '\u{fe00}'..='\u{fe0f}'), "");
    let words: Vec<&str> = symbols.split_whitespace().collect();
    words.join(" ").to_lowercase()
}

/// Name of fillers, before their number.
const FILLER: &str = "Filler";

/// Whether a name is, or looks like, that of a filler.
fn is_reserved(name: &str) -> bool {
    let name = name.to_lowercase();
    let mut rest = name.chars().filter(|symbol| symbol.is_alphanumeric());
    let mut filler = FILLER.chars().flat_map(char::to_lowercase);
    filler.all(|symbol| rest.next() == Some(symbol)) && rest.all(char::is_numeric)
}
