//! Getting into a tournament: who may join, and what happens when nobody may any more. Join codes, tickets and which kinds are admitted
//! are the server's affair.

use thiserror::Error;

use super::Tournament;
use super::change::{Change, Entrant, EntrantKind};
use super::course::State;
use super::settings::{Deals, MAX_GAMES_AT_A_TIME, MIN_PARTICIPANTS};

/// Why somebody cannot join.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum JoinProblem {
    /// It has as many participants as it takes.
    #[error("the tournament is full")]
    Full,
    /// It has begun, or is over.
    #[error("the tournament takes nobody any more: it has begun, or was closed")]
    Started,
    /// Another participant has the name.
    #[error("another participant has this name")]
    NameTaken,
    /// Deals are rotated, and the entrant did not declare itself stateless.
    #[error("each deal is met several times, so only stateless agents may take part")]
    NotStateless,
    /// Not a number of games at a time.
    #[error("games at a time: 1..={MAX_GAMES_AT_A_TIME}")]
    MaxGames,
}

/// Why a tournament cannot begin.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum BeginProblem {
    /// Too few participants.
    #[error("{have} of at least {need} participants have joined")]
    TooFew {
        /// How many there are.
        have: usize,
        /// How many are needed.
        need: usize,
    },
    /// It has begun, or is over.
    #[error("the tournament has begun")]
    Started,
}

impl Tournament {
    /// The change by which somebody joins; its number will be that of the participants so far.
    ///
    /// # Errors
    /// If it cannot.
    pub fn join(&self, entrant: Entrant) -> Result<Change, JoinProblem> {
        let course = &self.course;
        if course.state != State::Open {
            return Err(JoinProblem::Started);
        }
        if self.joined() >= course.settings.max_participants {
            return Err(JoinProblem::Full);
        }
        if !(1..=MAX_GAMES_AT_A_TIME).contains(&entrant.max_games) {
            return Err(JoinProblem::MaxGames);
        }
        if self.is_name_taken(&entrant.name) {
            return Err(JoinProblem::NameTaken);
        }
        let forgets = entrant.stateless || entrant.built_in.is_some();
        if course.settings.deals == Deals::Rotated && !forgets {
            return Err(JoinProblem::NotStateless);
        }
        Ok(Change::Joined(entrant))
    }

    /// The changes with which it begins: fillers, the beginning itself, what can be drawn without results (of a round robin every round;
    /// with hundreds of participants that takes seconds).
    ///
    /// # Errors
    /// If there are too few participants, or it has begun.
    pub fn begin(&self) -> Result<Vec<Change>, BeginProblem> {
        if self.course.state != State::Open {
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

    /// The next of the changes with which it begins, as far as it has come.
    pub(super) fn beginning(&mut self) -> Option<Change> {
        match self.course.state {
            State::Open => {
                let course = &self.course;
                let present = course.participants.len();
                let field = course.settings.field_for(self.joined());
                Some(if present < field {
                    Change::Joined(self.filler())
                } else {
                    let rounds = course.settings.rounds_for(present);
                    Change::Begun { rounds }
                })
            }
            State::Playing => self.drawing(),
            State::Finished | State::Closed => None,
        }
    }

    /// Participants, fillers aside.
    pub(super) fn joined(&self) -> usize {
        let participants = self.course.participants.iter();
        participants.filter(|entrant| !entrant.filler).count()
    }

    fn filler(&self) -> Entrant {
        let name = (1..)
            .map(|number| format!("Filler {number}"))
            .find(|name| !self.is_name_taken(name))
            .expect("there are more numbers than participants");
        Entrant {
            name,
            kind: EntrantKind::Agent,
            built_in: Some(self.course.settings.filler),
            filler: true,
            stateless: true,
            max_games: MAX_GAMES_AT_A_TIME,
        }
    }

    fn is_name_taken(&self, name: &str) -> bool {
        let mut participants = self.course.participants.iter();
        // Whoever reads the standings could not tell them apart.
        let name = name.to_lowercase();
        participants.any(|entrant| entrant.name.to_lowercase() == name)
    }
}
