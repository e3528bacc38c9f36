//! Participants and results for tests; games end without being played.

use std::iter::repeat_n;

pub(crate) use chefshat_tournament::testing::{NO_SHOW_MS, begin, entrant, settings};
use chefshat_tournament::{
    Change, Ended, Format, SeatStatistics, Settings, Standing, State, Tournament, testing,
};

/// A tournament with this number of participants, all present.
pub(crate) fn joined(settings: Settings, participants: usize) -> Tournament {
    testing::joined(settings, repeat_n(None, participants))
}

/// The same, begun.
pub(crate) fn begun(settings: Settings, participants: usize) -> Tournament {
    testing::begun(settings, repeat_n(None, participants))
}

/// A Swiss tournament of one round at two tables.
pub(crate) fn two_tables(change: impl FnOnce(&mut Settings)) -> Tournament {
    let mut settings = settings(Format::Swiss);
    settings.rounds = Some(1);
    change(&mut settings);
    begun(settings, 8)
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

/// A result in which this participant wins, and lower numbers are ahead of higher.
pub(crate) fn won_by(winner: usize, seats: &[usize]) -> Ended {
    let key = |who: usize| (who != winner, who);
    let better = |who: usize| seats.iter().filter(|&&other| key(other) < key(who)).count();
    let places: Vec<usize> = seats.iter().map(|&who| better(who) + 1).collect();
    played(&places)
}

/// A result in which lower participant numbers win.
pub(crate) fn played_by_number(tournament: &Tournament, game: usize) -> Ended {
    let seats = &tournament.games()[game].seats;
    won_by(*seats.iter().min().unwrap(), seats)
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

/// Ends a game; lower numbers win.
pub(crate) fn play(tournament: &mut Tournament, game: usize) -> Change {
    let ended = played_by_number(tournament, game);
    end(tournament, game, ended)
}

/// Plays to the end, one game at a time, each won by its first seat. Returns the order of the games.
pub(crate) fn play_in_turn(tournament: &mut Tournament) -> Vec<usize> {
    let mut order = vec![];
    while tournament.state() == State::Playing {
        let game = tournament.playing().next().unwrap();
        order.push(game);
        let counted = end(tournament, game, played(&[1, 2, 3, 4]));
        assert!(matches!(counted, Change::Counted { .. }));
        follow(tournament, 0);
    }
    order
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
            changes.push(play(tournament, game));
        }
    }
    changes
}

/// The participants in the order of the standings.
pub(crate) fn order(tournament: &Tournament) -> Vec<usize> {
    let standings = tournament.standings();
    standings.iter().map(|line| line.participant).collect()
}

/// The line of a participant in the standings.
pub(crate) fn line_of(tournament: &Tournament, who: usize) -> Standing {
    let mut standings = tournament.standings().into_iter();
    standings.find(|line| line.participant == who).unwrap()
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
