//! Plays a tournament of built-in agents offline, on all cores. The result depends on the
//! tournament and the seed alone, never on the number of threads.

use chefshat_engine::{
    ActionId, Decision, Event, MAX_SEATS, MetricsRecorder, RuleSet, Seat, Seed, ShiftMetrics,
};
use rayon::prelude::*;
use thiserror::Error;

use crate::Progress;
use chefshat_agents::is_wrong_action;
use chefshat_agents::seating_agent_seed;
use chefshat_agents::{BuiltInAgent, Listener, NamedAgent, game_seed, play_agents};
use chefshat_search::named_agent;
use chefshat_tournament::{Change, Ended, Game, SeatStatistics};
use chefshat_tournament::{State, Tournament};

/// Why a tournament cannot be played offline.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum OfflineProblem {
    /// The rule set is for another number of players.
    #[error("rules for {rules} players, tables of {seats}")]
    Players {
        /// Players of the rule set.
        rules: usize,
        /// Seats of a game of the tournament.
        seats: usize,
    },
    /// A participant is not a built-in agent.
    #[error("participant {0} is not a built-in agent")]
    NotBuiltIn(usize),
}

/// Plays a tournament that has begun to its end, on the current rayon pool. Game n is dealt as game
/// n of a batch of this seed, or as game d if its deal has the number d. `progress` is called from
/// any thread with the number of games finished since its last call.
///
/// # Errors
/// If a participant is not a built-in agent, or the rule set is for another number of players.
pub fn play_offline(
    tournament: &mut Tournament,
    rules: RuleSet,
    seed: u64,
    progress: Progress<'_>,
) -> Result<(), OfflineProblem> {
    let (players, seats) = (rules.players(), tournament.settings().players);
    if players != seats {
        return Err(OfflineProblem::Players {
            rules: players,
            seats,
        });
    }
    let agents = tournament.participants().iter().enumerate();
    let agents =
        agents.map(|(who, entrant)| entrant.built_in.ok_or(OfflineProblem::NotBuiltIn(who)));
    let agents: Vec<NamedAgent> = agents.collect::<Result<_, _>>()?;
    while tournament.state() == State::Playing {
        // Built-in agents never wait, so time stands still.
        let Some(change) = tournament.next(0) else {
            play_called(tournament, &agents, rules, seed, progress);
            continue;
        };
        tournament.fold(&change);
    }
    Ok(())
}

/// Plays all games that have been called.
fn play_called(
    tournament: &mut Tournament,
    agents: &[NamedAgent],
    rules: RuleSet,
    seed: u64,
    progress: Progress<'_>,
) {
    let called: Vec<usize> = tournament.playing().collect();
    assert!(
        !called.is_empty(),
        "a tournament of built-in agents always has a next game"
    );
    let changes: Vec<Change> = called
        .into_par_iter()
        .map(|index| {
            let ended = play_game(&tournament.games()[index], index, agents, rules, seed);
            progress(1);
            tournament
                .ended(index, ended)
                .expect("it is one of the games being played")
        })
        .collect();
    changes.iter().for_each(|change| tournament.fold(change));
}

fn play_game(game: &Game, index: usize, named: &[NamedAgent], rules: RuleSet, seed: u64) -> Ended {
    let deal = game.deal.map_or(index as u64, u64::from);
    let dealt_by = game_seed(seed, deal);
    let mut agents: [BuiltInAgent; MAX_SEATS] = std::array::from_fn(|seat| {
        let kind = game.seats.get(seat).map(|&who| named[who]);
        named_agent(
            kind.unwrap_or_default(),
            &rules,
            agent_seed(dealt_by, index, seat),
        )
    });
    let mut listener = Witness {
        recorder: MetricsRecorder::new(rules, None),
        seats: vec![SeatStatistics::default(); game.seats.len()],
        last_shift: None,
    };
    let standings = play_agents(rules, dealt_by, None, &mut agents, &mut listener);
    let last = listener.last_shift.expect("a game has at least one Shift");
    let mut seats = listener.seats;
    for (place, seat, points) in standings.iter() {
        let played = &mut seats[seat.index()];
        played.place = usize::from(place);
        played.points = points;
        played.performance_score = last.seats[seat].performance;
    }
    Ended::Played {
        shifts: last.shift,
        seats,
    }
}

/// Seeds differ from game to game, also with the same deal.
fn agent_seed(dealt_by: Seed, index: usize, seat: usize) -> [u8; 32] {
    seating_agent_seed(dealt_by, index, Seat::new(seat))
}

/// Counts what happens on the seats of a game.
struct Witness {
    recorder: MetricsRecorder,
    seats: Vec<SeatStatistics>,
    last_shift: Option<ShiftMetrics>,
}

impl Listener for Witness {
    fn on_event(&mut self, event: &Event) {
        if let Some(shift) = self.recorder.on_event(event) {
            self.last_shift = Some(shift);
        }
    }

    fn on_decision(&mut self, decision: Decision, _: ActionId) {
        self.seats[decision.seat.index()].decisions += 1;
    }

    fn on_invalid(&mut self, decision: Decision, _: ActionId) {
        if is_wrong_action(decision) {
            self.seats[decision.seat.index()].wrong_actions += 1;
        }
    }
}
