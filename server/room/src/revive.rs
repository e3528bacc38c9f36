//! Resumes a game after a restart of the server: reads its journal entry by entry and checks each
//! one before folding it, because a file can be damaged. Built-in agents decide again, so that
//! their generators reach the same state.

use std::sync::Arc;
use std::time::Duration;

use chefshat_engine::MAX_ENTROPY;
use chefshat_engine::{Seat, Viewer};

use super::{Core, MAX_EVENTS_KEPT, MAX_MARKERS};
use crate::journal::{Change, Entry, Fill, GameHeader, Report, Source};

/// How long a journal need not say again that the server was restarted: what takes a room over
/// writes it before the room is restored.
const SAID_FOR: Duration = Duration::from_secs(1);

/// Why a game cannot be resumed.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("entry {entry} of its journal is inconsistent: {problem}")]
pub struct BadJournal {
    /// Number of the entry, from 1.
    pub entry: usize,
    /// The inconsistency.
    pub problem: &'static str,
}

impl Core {
    /// Restores the room of a journal, with all connections lost unless its game is over.
    ///
    /// # Errors
    /// The first entry that is inconsistent with those before it.
    pub fn revived(
        header: Arc<GameHeader>,
        journal: &[Entry],
        now: Duration,
    ) -> Result<Self, BadJournal> {
        let mut core = Self::new(header);
        for (index, entry) in journal.iter().enumerate() {
            core.check(&entry.change).map_err(|problem| BadJournal {
                entry: index + 1,
                problem,
            })?;
            core.advance_agents(&entry.change);
            core.refold(entry);
            core.drop_log_before(core.log.len().saturating_sub(MAX_EVENTS_KEPT));
        }
        let just_said = journal.last().is_some_and(|last| {
            let says_so = matches!(last.change, Change::ServerRestarted);
            says_so && now.saturating_sub(last.at) < SAID_FOR
        });
        if !core.state.is_over() && !just_said {
            core.commit(now, Change::ServerRestarted);
        }
        Ok(core)
    }

    fn check(&self, change: &Change) -> Result<(), &'static str> {
        if self.state.is_over() {
            // A server that takes a room over says so without knowing whether its game was over.
            return match change {
                Change::ServerRestarted => Ok(()),
                _ => Err("the game was already over"),
            };
        }
        let begun = self.game.is_some();
        match change {
            Change::Seated { seat, .. } if self.is_at_table(*seat) => {
                check(!begun, "the game has already started")
            }
            Change::Seated { seat, .. } | Change::Vacated(seat) => {
                self.check_open_seat(*seat)?;
                check(!begun, "the game has already started")
            }
            Change::Disconnected { seat, .. }
            | Change::Returned(seat)
            | Change::Substituted(seat)
            | Change::Retired(seat) => self.check_open_seat(*seat),
            Change::Started { entropy } => {
                check(!begun, "the game starts twice")?;
                check(
                    entropy.len() == self.seats.len(),
                    "it does not have one part for each seat",
                )?;
                let bounded = entropy.iter().all(|bytes| bytes.len() <= MAX_ENTROPY);
                check(bounded, "a seat's contribution to the seed is too long")
            }
            Change::Attempted { seat, .. } | Change::Hinted(seat) => self.check_decision(*seat),
            Change::Decided(decided) => {
                self.check_decision(decided.seat)?;
                let legal = self.legal_actions().contains(decided.action);
                check(legal, "the action is not legal")
            }
            Change::Expressed { seat, .. } => self.check_seat(*seat),
            Change::Reported(reported) => {
                check(self.table().is_some(), "its room has no physical table")?;
                check(
                    (seats_of(&reported.report)).all(|seat| seat.index() < self.seats.len()),
                    "a reported seat does not exist",
                )
            }
            Change::EndConfirmed => check(self.awaits_confirmation(), "the game is not over"),
            Change::Marked(_) => check(self.markers.len() < MAX_MARKERS, "it has too many markers"),
            Change::Aborted(_) | Change::ServerRestarted => Ok(()),
        }
    }

    fn check_seat(&self, seat: Seat) -> Result<(), &'static str> {
        check(seat.index() < self.seats.len(), "this seat does not exist")
    }

    fn check_open_seat(&self, seat: Seat) -> Result<(), &'static str> {
        self.check_seat(seat)?;
        let open = matches!(self.seats[seat.index()].fill, Fill::Open { .. });
        check(open, "nobody can join this seat")
    }

    fn is_at_table(&self, seat: Seat) -> bool {
        let state = self.seats.get(seat.index());
        state.is_some_and(|state| matches!(state.fill, Fill::AtTable(_)))
    }

    fn check_decision(&self, seat: Seat) -> Result<(), &'static str> {
        let open = self.open.as_ref().map(|open| open.decision.seat);
        check(open == Some(seat), "this seat has no open decision")
    }

    /// Advances the generators of built-in agents to their state after a change.
    fn advance_agents(&mut self, change: &Change) {
        let asked = match change {
            Change::Attempted { seat, .. } => *seat,
            Change::Decided(decided)
                if matches!(decided.source, Source::Agent | Source::Substitute) =>
            {
                decided.seat
            }
            Change::Substituted(seat) | Change::Retired(seat) => {
                self.give_substitute(*seat);
                return;
            }
            _ => return,
        };
        let agent = self.seats[asked.index()].agent.as_ref();
        if !self.is_automatic(asked) || !agent.is_some_and(|agent| agent.has_generator()) {
            return;
        }
        let legal = self.legal_actions();
        let observation = self.observe(Viewer::Seat(asked));
        if let (Some(observation), Some(agent)) =
            (observation, &mut self.seats[asked.index()].agent)
        {
            agent.decide(&observation, &legal);
        }
    }
}

/// The seats named in a report.
fn seats_of(report: &Report) -> impl Iterator<Item = Seat> {
    let instead = match report {
        Report::Correction { instead, .. } => instead.as_deref(),
        _ => None,
    };
    let nested: Vec<Seat> = instead.map(|it| seats_of(it).collect()).unwrap_or_default();
    report.seat().into_iter().chain(nested)
}

fn check(holds: bool, problem: &'static str) -> Result<(), &'static str> {
    if holds { Ok(()) } else { Err(problem) }
}
