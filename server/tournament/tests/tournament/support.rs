//! Participants and results for tests; games end without being played.

use std::iter::repeat_n;

pub(crate) use chefshat_tournament::testing::{entrant, settings};
use chefshat_tournament::{Change, Ended, SeatStatistics, Settings, State, Tournament, testing};

/// A tournament with this number of participants, all present.
pub(crate) fn joined(settings: Settings, participants: usize) -> Tournament {
    testing::joined(settings, repeat_n(None, participants))
}

/// The same, begun.
pub(crate) fn begun(settings: Settings, participants: usize) -> Tournament {
    testing::begun(settings, repeat_n(None, participants))
}

/// A result with these places by seat, and 10 points minus the place.
pub(crate) fn played(places: &[usize]) -> Ended {
    let seats = places.iter().map(|&place| SeatStatistics {
        place,
        points: 10 - place as u64,
        decisions: 20,
        ..SeatStatistics::default()
    });
    Ended::Played {
        shifts: 3,
        seats: seats.collect(),
    }
}

/// A result in which lower participant numbers win.
pub(crate) fn played_by_number(tournament: &Tournament, game: usize) -> Ended {
    let seats = &tournament.games()[game].seats;
    let better = |who: usize| seats.iter().filter(|&&other| other < who).count();
    let places: Vec<usize> = seats.iter().map(|&who| better(who) + 1).collect();
    played(&places)
}

/// Folds all changes that follow at this time.
pub(crate) fn follow(tournament: &mut Tournament, now_ms: u64) -> Vec<Change> {
    let mut changes = Vec::new();
    while let Some(change) = tournament.next(now_ms) {
        tournament.fold(&change);
        changes.push(change);
    }
    changes
}

/// Ends a game that is being played.
pub(crate) fn end(tournament: &mut Tournament, game: usize, ended: Ended) -> Change {
    let change = tournament.ended(game, ended).unwrap();
    tournament.fold(&change);
    change
}

/// Plays to the end with all participants present; lower numbers win. Returns the changes.
pub(crate) fn play_through(tournament: &mut Tournament) -> Vec<Change> {
    let mut changes = Vec::new();
    while tournament.state() == State::Playing {
        changes.extend(follow(tournament, 0));
        let playing: Vec<usize> = tournament.playing().collect();
        assert!(
            !playing.is_empty() || tournament.state() != State::Playing,
            "the tournament is stuck"
        );
        for game in playing {
            let ended = played_by_number(tournament, game);
            changes.push(end(tournament, game, ended));
        }
    }
    changes
}

/// The pairings of a round.
#[derive(Debug, Clone)]
pub(crate) struct Round {
    pub(crate) tables: Vec<Vec<usize>>,
    pub(crate) byes: Vec<usize>,
}

impl Round {
    /// Every participant is at a full table or has a bye, with as few byes as possible.
    pub(crate) fn check(&self, participants: usize, players: usize) {
        assert!(self.tables.iter().all(|table| table.len() == players));
        assert_eq!(self.byes.len(), participants % players);
        let mut everybody = [self.tables.concat(), self.byes.clone()].concat();
        everybody.sort_unstable();
        assert_eq!(everybody, (0..participants).collect::<Vec<_>>());
    }
}

/// The rounds paired by these changes.
pub(crate) fn drawn(changes: &[Change]) -> Vec<Round> {
    changes
        .iter()
        .filter_map(|change| match change {
            Change::Drawn { tables, byes, .. } => Some(Round {
                tables: tables.clone(),
                byes: byes.clone(),
            }),
            _ => None,
        })
        .collect()
}

/// How often each two participants met.
pub(crate) fn meetings<'t>(
    tables: impl Iterator<Item = &'t Vec<usize>>,
    participants: usize,
) -> Vec<u32> {
    let mut met = vec![vec![0; participants]; participants];
    for table in tables {
        for (index, &a) in table.iter().enumerate() {
            for &b in &table[index + 1..] {
                met[a.min(b)][a.max(b)] += 1;
            }
        }
    }
    (0..participants)
        .flat_map(|a| met[a][a + 1..].to_vec())
        .collect()
}

/// Minimum and maximum.
pub(crate) fn range(numbers: impl Iterator<Item = u32> + Clone) -> (u32, u32) {
    (numbers.clone().min().unwrap(), numbers.max().unwrap())
}
