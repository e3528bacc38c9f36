//! Calls of games: order, waiting for absent participants, forfeits, voided games.

use chefshat_tournament::{Change, Ended, Format, Game, GameResult, GameState, State, Tournament};

use super::support::{
    NO_SHOW_MS, begun, end, follow, line_of, play_in_turn, played, settings, two_tables,
};

fn called(game: usize) -> Change {
    Change::Called {
        game,
        forfeited: vec![],
    }
}

fn forfeited(game: usize, forfeited: &[usize]) -> Change {
    Change::Called {
        game,
        forfeited: forfeited.to_vec(),
    }
}

fn rescheduled(game: usize, missing: &[usize]) -> Change {
    Change::Rescheduled {
        game,
        missing: missing.to_vec(),
        never_started: false,
    }
}

fn not_started(game: usize, missing: &[usize]) -> Change {
    Change::Rescheduled {
        game,
        missing: missing.to_vec(),
        never_started: true,
    }
}

fn state(tournament: &Tournament, game: usize) -> &GameState {
    &tournament.games()[game].state
}

fn seat(tournament: &Tournament, game: usize, seat: usize) -> usize {
    tournament.games()[game].seats[seat]
}

fn places(result: &GameResult) -> Vec<usize> {
    let seats = result.seats.iter();
    seats.map(|seat| seat.statistics.place).collect()
}

#[test]
fn games_are_called_in_order_up_to_the_maximum() {
    let mut tournament = two_tables(|settings| {
        settings.games_per_pairing = 2;
        settings.max_parallel = 1;
    });
    assert_eq!(follow(&mut tournament, 0), [called(0)]);
    assert_eq!(tournament.wake_at(), None);
    assert_eq!(play_in_turn(&mut tournament), [0, 1, 2, 3]);
    assert_eq!(tournament.state(), State::Finished);
}

#[test]
fn nobody_exceeds_its_games_at_a_time() {
    let mut tournament = two_tables(|settings| settings.games_per_pairing = 3);
    assert_eq!(follow(&mut tournament, 0), [called(0), called(3)]);
    end(&mut tournament, 0, played(&[1, 2, 3, 4]));
    assert_eq!(follow(&mut tournament, 0), [called(1)]);
}

#[test]
fn absent_participants_are_waited_for_then_called_again_then_forfeit() {
    let mut tournament = two_tables(|_| {});
    let away = seat(&tournament, 0, 2);
    tournament.set_present(away, false);
    assert_eq!(follow(&mut tournament, 50), [called(1)]);
    assert_eq!(tournament.wake_at(), Some(50 + NO_SHOW_MS));
    assert_eq!(follow(&mut tournament, 50 + NO_SHOW_MS - 1), []);
    assert_eq!(
        follow(&mut tournament, 50 + NO_SHOW_MS),
        [rescheduled(0, &[away])]
    );
    let game = &tournament.games()[0];
    assert_eq!((game.calls, &game.missing), (1, &vec![away]));
    assert_eq!(tournament.wake_at(), Some(50 + 2 * NO_SHOW_MS));
    assert_eq!(
        follow(&mut tournament, 50 + 2 * NO_SHOW_MS),
        [forfeited(0, &[away])]
    );
    assert_eq!(tournament.wake_at(), None);
    let game = &tournament.games()[0];
    assert_eq!((game.calls, &game.forfeited), (2, &vec![away]));

    // The filler in the forfeited seat wins; the others move up.
    end(&mut tournament, 0, played(&[2, 3, 1, 4]));
    let result = tournament.games()[0].result().unwrap();
    let scores: Vec<u32> = result.seats.iter().map(|seat| seat.score).collect();
    assert_eq!(
        (places(result), scores),
        (vec![1, 2, 4, 3], vec![5, 3, 0, 1])
    );
    let forfeit = result.seats[2];
    assert!(forfeit.forfeited);
    assert_eq!(
        (forfeit.statistics.points, forfeit.statistics.decisions),
        (0, 0),
        "the filler's play is not the participant's"
    );
    let line = line_of(&tournament, away);
    assert_eq!((line.games, line.forfeited, line.score), (1, 1, 0));
    assert_eq!(line.places, [0, 0, 0, 1]);
}

#[test]
fn participants_who_come_in_time_play() {
    let mut tournament = two_tables(|_| {});
    let away = seat(&tournament, 0, 0);
    tournament.set_present(away, false);
    follow(&mut tournament, 0);
    follow(&mut tournament, NO_SHOW_MS);
    tournament.set_present(away, true);
    assert_eq!(follow(&mut tournament, 2 * NO_SHOW_MS - 1), [called(0)]);
    assert_eq!(tournament.wake_at(), None);
}

#[test]
fn waiting_time_counts_only_while_only_absence_blocks_a_game() {
    let mut settings = settings(Format::RoundRobin);
    settings.rounds = Some(2);
    let mut tournament = begun(settings, 4);
    let away = seat(&tournament, 1, 0);
    assert_eq!(follow(&mut tournament, 0), [called(0)]);
    // The participant left its game, where a substitute plays: the next game waits for the others
    // too.
    tournament.set_present(away, false);
    assert_eq!(follow(&mut tournament, 10_000), []);
    assert_eq!(tournament.wake_at(), None);
    end(&mut tournament, 0, played(&[1, 2, 3, 4]));
    assert_eq!(follow(&mut tournament, 20_000), []);
    assert_eq!(tournament.wake_at(), Some(20_000 + NO_SHOW_MS));
}

#[test]
fn a_rescheduled_game_comes_after_the_others() {
    let mut settings = settings(Format::RoundRobin);
    settings.rounds = Some(3);
    settings.max_calls = 3;
    let mut tournament = begun(settings, 4);
    follow(&mut tournament, 0);
    assert_eq!(end(&mut tournament, 0, Ended::Aborted), rescheduled(0, &[]));
    follow(&mut tournament, 0);
    assert_eq!(play_in_turn(&mut tournament), [1, 2, 0]);
}

#[test]
fn missing_the_last_call_forfeits_even_when_connected() {
    let mut tournament = two_tables(|_| {});
    let [silent, late] = [1, 3].map(|place| seat(&tournament, 0, place));
    let never_started = |missing: &[usize]| Ended::NeverStarted {
        missing: missing.to_vec(),
    };
    follow(&mut tournament, 0);
    assert_eq!(
        end(&mut tournament, 0, never_started(&[silent])),
        not_started(0, &[silent])
    );
    assert_eq!(follow(&mut tournament, 0), [called(0)], "once more");
    assert_eq!(
        end(&mut tournament, 0, never_started(&[silent])),
        not_started(0, &[silent])
    );
    assert_eq!(
        follow(&mut tournament, 0),
        [forfeited(0, &[silent])],
        "the wait is over"
    );
    // Now another participant is absent.
    end(&mut tournament, 0, never_started(&[silent, late]));
    let mut both = [silent, late];
    both.sort_by_key(|&who| {
        let game: &Game = &tournament.games()[0];
        game.seats.iter().position(|&other| other == who)
    });
    assert_eq!(follow(&mut tournament, 0), [forfeited(0, &both)]);
    end(&mut tournament, 0, played(&[4, 1, 2, 3]));
    assert_eq!(
        places(tournament.games()[0].result().unwrap()),
        [2, 3, 1, 4],
        "those who forfeited, in the order of their seats"
    );
}

#[test]
fn a_game_aborted_on_its_last_call_is_voided() {
    for ended in [
        Ended::Aborted,
        // No such participant.
        Ended::NeverStarted { missing: vec![] },
        Ended::NeverStarted { missing: vec![99] },
        // The wrong number of seats.
        played(&[1, 2, 3]),
    ] {
        let mut tournament = two_tables(|_| {});
        follow(&mut tournament, 0);
        let again = match ended {
            Ended::NeverStarted { .. } => not_started(0, &[]),
            _ => rescheduled(0, &[]),
        };
        assert_eq!(end(&mut tournament, 0, ended.clone()), again);
        assert_eq!(follow(&mut tournament, 0), [called(0)]);
        let given_up = Change::Voided { game: 0 };
        assert_eq!(end(&mut tournament, 0, ended.clone()), given_up);
        assert_eq!(state(&tournament, 0), &GameState::Void);
        end(&mut tournament, 1, played(&[1, 2, 3, 4]));
        assert_eq!(follow(&mut tournament, 0), [Change::Finished]);
        let standings = tournament.standings();
        assert_eq!(standings.iter().filter(|line| line.games == 0).count(), 4);
    }
}

#[test]
fn a_game_that_everyone_forfeits_is_voided() {
    let mut tournament = two_tables(|settings| settings.max_calls = 1);
    for place in 0..4 {
        let who = seat(&tournament, 0, place);
        tournament.set_present(who, false);
    }
    follow(&mut tournament, 0);
    assert_eq!(
        follow(&mut tournament, NO_SHOW_MS),
        [Change::Voided { game: 0 }]
    );
}

#[test]
fn only_a_game_that_is_being_played_can_end() {
    let mut tournament = two_tables(|_| {});
    assert_eq!(tournament.ended(0, Ended::Aborted), None, "not yet called");
    assert_eq!(tournament.ended(99, Ended::Aborted), None);
    follow(&mut tournament, 0);
    let counted = end(&mut tournament, 0, played(&[1, 2, 3, 4]));
    assert_eq!(tournament.ended(0, played(&[4, 3, 2, 1])), None);
    let before = tournament.clone();
    // Folding a change twice has no further effect.
    tournament.fold(&counted);
    tournament.fold(&Change::Voided { game: 0 });
    tournament.fold(&called(0));
    tournament.fold(&rescheduled(0, &[]));
    tournament.fold(&called(99));
    assert!(tournament == before);
    assert_eq!(tournament.games_over(), 1);
}

#[test]
fn unknown_participants_are_never_present() {
    let mut tournament = two_tables(|_| {});
    tournament.set_present(99, true);
    assert!(!tournament.is_present(99));
    assert!(tournament.is_present(0));
}

#[test]
fn coming_and_going_does_not_prolong_the_wait_for_others() {
    let mut tournament = two_tables(|_| {});
    let (away, restless) = (seat(&tournament, 0, 1), seat(&tournament, 0, 3));
    tournament.set_present(away, false);
    let mut changes = follow(&mut tournament, 0);
    for now_ms in (100..NO_SHOW_MS).step_by(100) {
        tournament.set_present(restless, now_ms % 200 == 0);
        changes.extend(follow(&mut tournament, now_ms));
    }
    assert_eq!(changes, [called(1)]);
    tournament.set_present(restless, true);
    assert_eq!(
        follow(&mut tournament, NO_SHOW_MS),
        [rescheduled(0, &[away])]
    );
}

#[test]
fn after_a_restart_only_those_who_missed_the_last_call_forfeit_at_once() {
    let mut tournament = two_tables(|_| {});
    let [silent, away] = [1, 2].map(|place| seat(&tournament, 0, place));
    let never_started = Ended::NeverStarted {
        missing: vec![silent],
    };
    for _ in 0..2 {
        follow(&mut tournament, 0);
        end(&mut tournament, 0, never_started.clone());
    }
    assert_eq!(tournament.games()[0].calls, 2, "that was the last call");
    // After a restart nobody is present, and nobody has lost a game by it.
    for who in 0..8 {
        tournament.set_present(who, false);
    }
    assert_eq!(follow(&mut tournament, 0), []);
    assert_eq!(tournament.wake_at(), Some(NO_SHOW_MS));
    let mut all_back = tournament.clone();
    for who in (0..8).filter(|who| ![silent, away].contains(who)) {
        tournament.set_present(who, true);
    }
    assert_eq!(follow(&mut tournament, NO_SHOW_MS - 1), []);
    assert_eq!(
        follow(&mut tournament, NO_SHOW_MS),
        [forfeited(0, &[silent, away])],
        "the others were waited for, once"
    );
    for who in (0..8).filter(|who| *who != silent) {
        all_back.set_present(who, true);
    }
    assert_eq!(
        follow(&mut all_back, 10),
        [forfeited(0, &[silent])],
        "the game does not wait for participants who missed the last call"
    );
}
