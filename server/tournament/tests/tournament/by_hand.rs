//! Changes by hand: leaving, replacing, pausing, postponing, calling again; and how long a game
//! waits for those who had to wait themselves.

use chefshat_agents::AgentKind;
use chefshat_tournament::{
    ByHandProblem, Change, Deals, Ended, Entrant, Format, GameState, JoinProblem, Leaving,
    MAX_CHANGES_BY_HAND, MAX_EARLY_WITHDRAWALS, MAX_POSTPONEMENTS, MAX_REPLACEMENTS, Settings,
    State, Tournament,
};

use super::support::{
    NO_SHOW_MS, begin, begun, end, entrant, follow, joined, line_of, order, play, play_in_turn,
    play_through, played, played_by_number, settings, two_tables,
};

fn withdraw(tournament: &mut Tournament, who: usize) {
    tournament.fold(&tournament.withdraw(who, Leaving::Itself).unwrap().unwrap());
}

fn pause(tournament: &mut Tournament, paused: bool) {
    tournament.fold(&tournament.set_paused(paused).unwrap().unwrap());
}

fn called(changes: &[Change]) -> Vec<(usize, Vec<usize>)> {
    let games = changes.iter().filter_map(|change| match change {
        Change::Called { game, forfeited } => Some((*game, forfeited.clone())),
        _ => None,
    });
    games.collect()
}

/// A Swiss tournament of one round at two tables, with two games at each.
fn two_games_each(change: impl FnOnce(&mut Settings)) -> Tournament {
    two_tables(|settings| {
        settings.games_per_pairing = 2;
        change(settings);
    })
}

#[test]
fn before_the_start_a_place_and_its_name_become_free_but_not_its_number() {
    let mut tournament = joined(settings(Format::Knockout), 4);
    withdraw(&mut tournament, 1);
    assert!(tournament.is_withdrawn(1));
    let again = tournament.withdraw(1, Leaving::ByOrganiser);
    assert_eq!(again, Ok(None), "it has left");
    assert_eq!(tournament.standings().len(), 3);
    assert_eq!(tournament.next_number(), 4);
    tournament.fold(&tournament.join(entrant("agent 1")).unwrap());
    assert!(tournament.is_withdrawn(1) && !tournament.is_withdrawn(4));
    assert_eq!(tournament.standings().len(), 4);
    withdraw(&mut tournament, 3);
    withdraw(&mut tournament, 0);
    begin(&mut tournament);
    let lines = tournament.standings();
    let mut field: Vec<_> = (lines.iter())
        .map(|line| tournament.participants()[line.participant].name.as_str())
        .collect();
    field.sort_unstable();
    assert_eq!(field, ["Filler 1", "Filler 2", "agent 1", "agent 2"]);
}

#[test]
fn those_who_left_before_the_start_are_not_paired() {
    for format in Format::ALL {
        let mut tournament = joined(settings(format), 9);
        for who in [0, 4, 8] {
            withdraw(&mut tournament, who);
        }
        begin(&mut tournament);
        let is_out = |who: &usize| [4, 8].contains(who) && format != Format::Knockout;
        play_through(&mut tournament);
        assert_eq!(tournament.state(), State::Finished);
        assert_eq!(tournament.games().len(), tournament.games_expected());
        let seats = tournament.games().iter().flat_map(|game| &game.seats);
        assert!(!seats.into_iter().any(is_out), "{format:?}");
        let expected = if format == Format::Knockout { 8 } else { 6 };
        assert_eq!(tournament.standings().len(), expected, "{format:?}");
    }
}

#[test]
fn who_leaves_forfeits_what_comes_without_being_waited_for() {
    let mut tournament = two_games_each(|_| {});
    follow(&mut tournament, 0);
    let leaver = tournament.games()[0].seats[0];
    withdraw(&mut tournament, leaver);
    assert_eq!(tournament.games()[0].left, [leaver]);
    assert!(!tournament.games()[0].is_played_by(leaver));
    // The substitute plays the game to its end; it counts for the participant.
    end(&mut tournament, 0, played(&[1, 2, 3, 4]));
    assert_eq!(called(&follow(&mut tournament, 0)), [(1, vec![leaver])]);
    play(&mut tournament, 1);
    let line = line_of(&tournament, leaver);
    assert_eq!((line.games, line.forfeited, line.score), (2, 1, 5));
}

#[test]
fn a_game_that_could_not_start_is_called_again_without_those_who_left() {
    let mut tournament = two_games_each(|settings| settings.max_calls = 1);
    follow(&mut tournament, 0);
    let (leaver, other) = (
        tournament.games()[0].seats[0],
        tournament.games()[0].seats[1],
    );
    withdraw(&mut tournament, leaver);
    // The other had not taken its seat when the room was closed; that is not its fault.
    let missing = vec![leaver, other];
    end(&mut tournament, 0, Ended::NeverStarted { missing });
    assert_eq!(tournament.games()[0].state, GameState::Due);
    // The second game at the table comes first.
    assert_eq!(called(&follow(&mut tournament, 0)), [(1, vec![leaver])]);
    end(&mut tournament, 1, played(&[1, 2, 3, 4]));
    assert_eq!(called(&follow(&mut tournament, 0)), [(0, vec![leaver])]);
}

#[test]
fn who_left_does_not_advance() {
    let mut tournament = begun(settings(Format::Knockout), 8);
    follow(&mut tournament, 0);
    let best = *tournament.games()[0].seats.iter().min().unwrap();
    withdraw(&mut tournament, best);
    for game in [0, 1] {
        play(&mut tournament, game);
    }
    follow(&mut tournament, 0);
    let finalists = &tournament.games()[2].seats;
    assert!(!finalists.contains(&best), "{finalists:?}");
    // If nobody else can, they do.
    let mut tournament = begun(settings(Format::Knockout), 8);
    follow(&mut tournament, 0);
    let seats = tournament.games()[0].seats.clone();
    seats[1..]
        .iter()
        .for_each(|&who| withdraw(&mut tournament, who));
    for game in [0, 1] {
        play(&mut tournament, game);
    }
    let changes = follow(&mut tournament, 0);
    let [(2, forfeited)] = &called(&changes)[..] else {
        panic!("{changes:?}");
    };
    assert_eq!(forfeited.len(), 1);
}

#[test]
fn a_paused_tournament_calls_nothing_and_waits_anew_afterwards() {
    let mut tournament = two_games_each(|_| {});
    let away = tournament.games()[0].seats[0];
    tournament.set_present(away, false);
    assert_eq!(called(&follow(&mut tournament, 0)), [(2, vec![])]);
    pause(&mut tournament, true);
    assert_eq!(tournament.set_paused(true), Ok(None));
    assert_eq!(follow(&mut tournament, 5 * NO_SHOW_MS), []);
    assert_eq!(tournament.wake_at(), None);
    end(&mut tournament, 2, played(&[1, 2, 3, 4]));
    assert_eq!(follow(&mut tournament, 6 * NO_SHOW_MS), []);
    pause(&mut tournament, false);
    assert_eq!(
        called(&follow(&mut tournament, 7 * NO_SHOW_MS)),
        [(3, vec![])]
    );
    assert_eq!(tournament.wake_at(), Some(8 * NO_SHOW_MS));
}

#[test]
fn a_postponed_game_goes_to_the_end_of_the_queue_and_costs_no_call() {
    let mut tournament = two_games_each(|settings| settings.max_parallel = 1);
    let who = tournament.games()[2].seats[0];
    assert_eq!(called(&follow(&mut tournament, 0)), [(0, vec![])]);
    assert_eq!(tournament.postpone(0, None), Err(ByHandProblem::NotDue));
    let stranger = tournament.games()[0].seats[0];
    assert_eq!(
        tournament.postpone(2, Some(stranger)),
        Err(ByHandProblem::NotInGame)
    );
    for _ in 0..2 {
        tournament.fold(&tournament.postpone(2, Some(who)).unwrap());
    }
    assert_eq!(
        tournament.postpone(2, Some(who)),
        Err(ByHandProblem::PostponedTooOften(2))
    );
    assert_eq!(play_in_turn(&mut tournament), [0, 1, 3, 2]);
    assert_eq!(tournament.games()[2].calls, 1);
}

#[test]
fn postponing_restarts_the_wait_for_the_absent() {
    let mut tournament = two_games_each(|settings| settings.max_calls = 1);
    let away = tournament.games()[0].seats[0];
    tournament.set_present(away, false);
    follow(&mut tournament, 0);
    for game in [0, 1] {
        tournament.fold(&tournament.postpone(game, None).unwrap());
    }
    assert_eq!(follow(&mut tournament, NO_SHOW_MS - 1), []);
    assert_eq!(follow(&mut tournament, 2 * NO_SHOW_MS - 2), []);
    let changes = follow(&mut tournament, 2 * NO_SHOW_MS - 1);
    assert_eq!(called(&changes), [(0, vec![away])]);
}

#[test]
fn a_void_game_can_be_called_again_before_all_others() {
    let mut tournament = two_games_each(|settings| {
        settings.max_calls = 1;
        settings.max_parallel = 1;
    });
    follow(&mut tournament, 0);
    end(&mut tournament, 0, Ended::Aborted);
    assert_eq!(tournament.games()[0].state, GameState::Void);
    follow(&mut tournament, 0);
    tournament.fold(&tournament.recall(0).unwrap());
    tournament.fold(&tournament.recall(3).unwrap());
    assert_eq!(
        (tournament.games_over(), tournament.games()[0].calls),
        (0, 0)
    );
    assert_eq!(play_in_turn(&mut tournament), [1, 3, 0, 2]);
    assert_eq!(tournament.recall(0), Err(ByHandProblem::NotPlaying));
}

#[test]
fn a_void_game_of_an_earlier_round_of_a_knockout_stays_void() {
    let mut tournament = begun(
        Settings {
            max_calls: 1,
            ..settings(Format::Knockout)
        },
        8,
    );
    follow(&mut tournament, 0);
    end(&mut tournament, 0, Ended::Aborted);
    assert!(tournament.recall(0).is_ok());
    end(&mut tournament, 1, played(&[1, 2, 3, 4]));
    follow(&mut tournament, 0);
    assert_eq!(tournament.recall(0), Err(ByHandProblem::NotDue));
}

#[test]
fn whoever_takes_a_place_has_its_results_and_is_waited_for() {
    let mut tournament = two_games_each(|settings| settings.max_calls = 1);
    follow(&mut tournament, 0);
    let place = tournament.games()[0].seats[0];
    withdraw(&mut tournament, place);
    end(&mut tournament, 0, played(&[1, 2, 3, 4]));
    tournament.fold(&tournament.replace(place, entrant("Bo")).unwrap());
    assert_eq!(tournament.participants()[place].name, "Bo");
    let [former] = tournament.former(place) else {
        panic!("one former participant");
    };
    assert_eq!((former.games, former.entrant.built_in), (1, None));
    assert_eq!(called(&follow(&mut tournament, 0)), [], "Bo is not there");
    tournament.set_present(place, true);
    assert_eq!(called(&follow(&mut tournament, 0)), [(1, vec![])]);
    assert_eq!(
        tournament.replace(place, entrant("Filler 7")),
        Err(ByHandProblem::Join(JoinProblem::NameReserved))
    );
    let taken = tournament.participants()[(place + 1) % 8].name.clone();
    assert_eq!(
        tournament.replace(place, entrant(&taken)),
        Err(ByHandProblem::Join(JoinProblem::NameTaken))
    );
    for _ in 1..MAX_REPLACEMENTS {
        tournament.fold(&tournament.replace(place, entrant("Bo")).unwrap());
    }
    assert_eq!(
        tournament.replace(place, entrant("Bo")),
        Err(ByHandProblem::TooManyReplacements)
    );
}

#[test]
fn games_keep_the_names_of_those_who_were_called_to_them() {
    let mut tournament = two_games_each(|settings| settings.max_calls = 1);
    follow(&mut tournament, 0);
    let place = tournament.games()[0].seats[0];
    let first = tournament.participants()[place].name.clone();
    let names = |tournament: &Tournament| {
        let games = tournament.games().iter();
        let games = games.filter(|game| game.seats.contains(&place));
        let names = games.map(|game| tournament.former_name(game, place).map(str::to_owned));
        names.collect::<Vec<_>>()
    };
    end(&mut tournament, 0, played(&[1, 2, 3, 4]));
    for by in ["Bo", "Cy"] {
        tournament.fold(&tournament.replace(place, entrant(by)).unwrap());
        tournament.set_present(place, true);
        follow(&mut tournament, 0);
    }
    // The second game was called after the first replacement.
    let second = names(&tournament)[1].clone();
    assert_eq!(names(&tournament)[0].as_deref(), Some(&*first));
    assert!(matches!(second.as_deref(), Some("Bo") | None), "{second:?}");
    // Somebody whose data are deleted has no name there either.
    assert!(tournament.rename(|it| it.name == first, "player 1"));
    assert_eq!(names(&tournament)[0].as_deref(), Some("player 1"));
}

#[test]
fn a_built_in_agent_plays_on_at_once_and_somebody_can_take_the_place_of_a_filler() {
    let mut tournament = begun(settings(Format::Knockout), 3);
    let filler = 3;
    assert_eq!(
        tournament.withdraw(filler, Leaving::Removed),
        Err(ByHandProblem::Filler)
    );
    tournament.set_present(0, false);
    assert_eq!(called(&follow(&mut tournament, 0)), []);
    let by = Entrant {
        built_in: Some(AgentKind::Greedy.into()),
        ..entrant("greedy")
    };
    for change in [
        tournament.replace(0, by),
        tournament.replace(filler, entrant("Late")),
    ] {
        tournament.fold(&change.unwrap());
    }
    assert_eq!(tournament.games_expected(), 1);
    tournament.set_present(filler, true);
    assert_eq!(called(&follow(&mut tournament, 0)), [(0, vec![])]);
}

#[test]
fn nothing_changes_by_hand_before_the_start_or_after_the_end() {
    let mut tournament = joined(settings(Format::Swiss), 4);
    assert_eq!(tournament.set_paused(true), Err(ByHandProblem::NotPlaying));
    assert_eq!(tournament.recall(0), Err(ByHandProblem::NotPlaying));
    assert_eq!(
        tournament.withdraw(4, Leaving::Itself),
        Err(ByHandProblem::NoParticipant)
    );
    begin(&mut tournament);
    assert_eq!(tournament.postpone(99, None), Err(ByHandProblem::NoGame));
    play_through(&mut tournament);
    assert_eq!(
        tournament.withdraw(0, Leaving::Itself),
        Err(ByHandProblem::Over)
    );
    let someone = entrant("someone");
    assert_eq!(tournament.replace(0, someone), Err(ByHandProblem::Over));
}

#[test]
fn names_of_fillers_are_reserved() {
    let tournament = joined(settings(Format::Swiss), 2);
    for name in ["Filler 1", "filler 2", "FILLER12", "Filler", " f-iller_3"] {
        let refused = tournament.join(entrant(name));
        assert_eq!(refused, Err(JoinProblem::NameReserved), "{name}");
    }
    for name in ["Filler X", "Fill 1", "Phil Filler 1"] {
        assert!(tournament.join(entrant(name)).is_ok(), "{name}");
    }
}

#[test]
fn a_finalist_is_waited_for_as_long_as_it_waited_for_the_final() {
    for (table_took_ms, patience_ms) in [(500, NO_SHOW_MS), (90_000, 90_000), (9_000_000, 600_000)]
    {
        let mut tournament = begun(settings(Format::Knockout), 8);
        follow(&mut tournament, 0);
        play(&mut tournament, 0);
        follow(&mut tournament, 0);
        // It waits for a while, then looks away from its screen.
        let finalist = *tournament.games()[0].seats.iter().min().unwrap();
        tournament.set_present(finalist, false);
        let now = table_took_ms;
        play(&mut tournament, 1);
        assert_eq!(called(&follow(&mut tournament, now)), []);
        assert_eq!(tournament.wake_at(), Some(now + patience_ms));
        assert_eq!(follow(&mut tournament, now + patience_ms - 1), []);
        let missing = vec![finalist];
        let change = Change::Rescheduled {
            game: 2,
            missing,
            never_started: false,
        };
        assert_eq!(follow(&mut tournament, now + patience_ms), [change]);
        // The second call is an ordinary one.
        let later = now + patience_ms + NO_SHOW_MS;
        assert_eq!(tournament.wake_at(), Some(later));
    }
}

#[test]
fn who_was_away_when_its_last_game_ended_is_not_waited_for_longer() {
    let mut tournament = begun(settings(Format::Knockout), 8);
    follow(&mut tournament, 0);
    let finalist = *tournament.games()[0].seats.iter().min().unwrap();
    tournament.set_present(finalist, false);
    play(&mut tournament, 0);
    follow(&mut tournament, 0);
    play(&mut tournament, 1);
    follow(&mut tournament, 90_000);
    assert_eq!(tournament.wake_at(), Some(90_000 + NO_SHOW_MS));
}

#[test]
fn who_left_a_game_to_a_substitute_is_waited_for_since_it_went() {
    for (ended_at, waits_until) in [(400, 1_000), (90_000, 90_000)] {
        let mut tournament = begun(settings(Format::Knockout), 8);
        follow(&mut tournament, 0);
        let finalist = *tournament.games()[0].seats.iter().min().unwrap();
        tournament.set_present(finalist, false);
        follow(&mut tournament, 0);
        let Ended::Played { shifts, mut seats } = played_by_number(&tournament, 0) else {
            unreachable!("it is played");
        };
        seats.iter_mut().for_each(|seat| seat.substituted = true);
        end(&mut tournament, 0, Ended::Played { shifts, seats });
        play(&mut tournament, 1);
        let mut returned = tournament.clone();

        let mut changes = follow(&mut tournament, ended_at);
        if ended_at < waits_until {
            assert_eq!(called(&changes), []);
            assert_eq!(tournament.wake_at(), Some(waits_until));
            changes = follow(&mut tournament, waits_until);
        }
        // Both calls are over.
        assert_eq!(called(&changes), [(2, vec![finalist])]);

        returned.set_present(finalist, true);
        assert_eq!(called(&follow(&mut returned, ended_at)), [(2, vec![])]);
    }
}

#[test]
fn who_has_not_played_stands_behind_who_has() {
    let mut settings = settings(Format::Knockout);
    settings.max_calls = 1;
    let mut tournament = begun(settings, 8);
    let absent: Vec<usize> = tournament.games()[0].seats[1..].to_vec();
    absent
        .iter()
        .for_each(|&who| tournament.set_present(who, false));
    follow(&mut tournament, 0);
    play(&mut tournament, 1);
    follow(&mut tournament, NO_SHOW_MS);
    end(&mut tournament, 0, played(&[1, 2, 3, 4]));
    follow(&mut tournament, 2 * NO_SHOW_MS);
    follow(&mut tournament, 3 * NO_SHOW_MS);
    let finalists = tournament.games()[2].seats.clone();
    play(&mut tournament, 2);
    assert!(
        finalists.iter().any(|who| absent.contains(who)),
        "by forfeits"
    );
    let mut last = order(&tournament)[5..].to_vec();
    last.sort_unstable();
    let mut expected = absent;
    expected.sort_unstable();
    assert_eq!(last, expected);
}

/// Joins and withdraws this often.
fn come_and_go(tournament: &mut Tournament, times: u32) {
    for _ in 0..times {
        let who = tournament.next_number();
        tournament.fold(&tournament.join(entrant("fickle")).unwrap());
        withdraw(tournament, who);
    }
}

#[test]
fn participants_who_come_and_go_take_nothing_from_the_organiser() {
    let mut tournament = joined(settings(Format::Knockout), 4);
    come_and_go(&mut tournament, MAX_EARLY_WITHDRAWALS);
    let too_many = Err(ByHandProblem::TooMany(MAX_EARLY_WITHDRAWALS));
    assert_eq!(tournament.withdraw(0, Leaving::Itself), too_many);
    for leaving in [Leaving::ByOrganiser, Leaving::Removed] {
        assert!(matches!(tournament.withdraw(0, leaving), Ok(Some(_))));
    }
    begin(&mut tournament);
    pause(&mut tournament, true);
    pause(&mut tournament, false);
    // After the beginning everybody can leave, once.
    withdraw(&mut tournament, 0);
}

#[test]
fn an_organiser_who_has_changed_too_much_can_still_resume_remove_and_close() {
    let mut tournament = two_games_each(|_| {});
    for _ in 0..MAX_CHANGES_BY_HAND - 1 {
        tournament.fold(&tournament.postpone(0, None).unwrap());
    }
    pause(&mut tournament, true);
    let too_many = ByHandProblem::TooMany(MAX_CHANGES_BY_HAND);
    assert_eq!(tournament.postpone(0, None), Err(too_many));
    assert_eq!(tournament.recall(0), Err(too_many));
    assert_eq!(tournament.replace(0, entrant("Bo")), Err(too_many));
    tournament.fold(&tournament.withdraw(0, Leaving::Removed).unwrap().unwrap());
    pause(&mut tournament, false);
    assert_eq!(tournament.set_paused(true), Err(too_many));
    withdraw(&mut tournament, 1);
    assert!(tournament.close().is_some());
}

#[test]
fn a_participant_postpones_a_bounded_number_of_games() {
    let mut tournament = two_games_each(|settings| settings.games_per_pairing = 100);
    let who = tournament.games()[0].seats[0];
    let its: Vec<usize> = (0..tournament.games().len())
        .filter(|&game| tournament.games()[game].seats.contains(&who))
        .collect();
    for &game in &its[..MAX_POSTPONEMENTS as usize] {
        tournament.fold(&tournament.postpone(game, Some(who)).unwrap());
    }
    assert_eq!(
        tournament.postpone(its[0], Some(who)),
        Err(ByHandProblem::TooMany(MAX_POSTPONEMENTS))
    );
    let other = tournament.games()[its[0]].seats[1];
    assert!(tournament.postpone(its[0], Some(other)).is_ok());
    assert!(tournament.postpone(its[0], None).is_ok());
}

#[test]
fn who_left_can_still_be_removed_once() {
    let mut tournament = two_games_each(|_| {});
    withdraw(&mut tournament, 2);
    assert_eq!(tournament.withdraw(2, Leaving::ByOrganiser), Ok(None));
    tournament.fold(&tournament.withdraw(2, Leaving::Removed).unwrap().unwrap());
    assert_eq!(tournament.withdraw(2, Leaving::Removed), Ok(None));
}

#[test]
fn what_a_former_participant_forfeited_is_not_forfeited_by_the_next() {
    // Replaced while the game that it forfeited is due again, or is being played.
    for is_due in [true, false] {
        let mut tournament = two_games_each(|settings| settings.max_calls = 2);
        let away = tournament.games()[0].seats[0];
        tournament.set_present(away, false);
        follow(&mut tournament, 0);
        end(&mut tournament, 2, played(&[1, 2, 3, 4]));
        // The first call is missed in the queue, the second starts it without the absent.
        follow(&mut tournament, NO_SHOW_MS);
        end(&mut tournament, 3, played(&[1, 2, 3, 4]));
        follow(&mut tournament, 2 * NO_SHOW_MS);
        follow(&mut tournament, 3 * NO_SHOW_MS);
        let played = tournament.playing().next().unwrap();
        assert_eq!(tournament.games()[played].forfeited, [away]);
        let recall = |tournament: &mut Tournament| {
            // It never started, for another reason.
            let change = Change::Rescheduled {
                game: played,
                missing: vec![],
                never_started: true,
            };
            tournament.fold(&change);
            assert_eq!(tournament.games()[played].state, GameState::Due);
        };
        if is_due {
            recall(&mut tournament);
        }
        tournament.fold(&tournament.replace(away, entrant("Bo")).unwrap());
        tournament.set_present(away, true);
        if !is_due {
            // As long as it is being played, the filler has the seat.
            assert!(!tournament.games()[played].is_played_by(away));
            recall(&mut tournament);
        }
        let forfeited = loop {
            let calls = called(&follow(&mut tournament, 3 * NO_SHOW_MS));
            let [(game, forfeited)] = &calls[..] else {
                panic!("one game at a time: {calls:?}");
            };
            if *game == played {
                break forfeited.clone();
            }
            play(&mut tournament, *game);
        };
        assert!(forfeited.is_empty(), "{forfeited:?}");
    }
}

#[test]
fn a_game_that_never_started_keeps_its_deal_when_somebody_was_replaced() {
    let mut tournament = two_games_each(|settings| settings.deals = Deals::SameAtAllTables);
    follow(&mut tournament, 0);
    let deal = tournament.games()[0].deal;
    assert!(deal.is_some() && deal == tournament.games()[2].deal);
    let place = tournament.games()[0].seats[0];
    tournament.fold(&tournament.replace(place, entrant("Bo")).unwrap());
    let missing = vec![place];
    end(&mut tournament, 0, Ended::NeverStarted { missing });
    assert_eq!(tournament.games()[0].deal, deal, "nobody has seen it");
    tournament.set_present(place, true);
    follow(&mut tournament, 0);
    // At the other table it was seen.
    end(&mut tournament, 2, Ended::Aborted);
    assert_eq!(tournament.games()[2].deal, None);
}

#[test]
fn while_it_is_paused_the_last_void_game_can_be_called() {
    for format in Format::ALL {
        let mut settings = settings(format);
        settings.max_calls = 1;
        settings.rounds = (format != Format::Knockout).then_some(1);
        let mut tournament = begun(settings, 8);
        follow(&mut tournament, 0);
        play(&mut tournament, 1);
        pause(&mut tournament, true);
        end(&mut tournament, 0, Ended::Aborted);
        assert_eq!(follow(&mut tournament, 0), [], "it neither ends nor draws");
        tournament.fold(&tournament.recall(0).unwrap());
        pause(&mut tournament, false);
        assert_eq!(called(&follow(&mut tournament, 0)), [(0, vec![])]);
        play_through(&mut tournament);
        assert!(
            (tournament.games().iter()).all(|game| matches!(game.state, GameState::Counted(_)))
        );
    }
}

#[test]
fn a_game_of_which_all_have_left_cannot_be_called() {
    let mut tournament = two_games_each(|settings| settings.max_parallel = 1);
    let seats = tournament.games()[2].seats.clone();
    seats.iter().for_each(|&who| withdraw(&mut tournament, who));
    assert_eq!(tournament.recall(2), Err(ByHandProblem::NobodyLeft));
    tournament.fold(&tournament.replace(seats[0], entrant("Bo")).unwrap());
    assert!(tournament.recall(2).is_ok());
}

#[test]
fn a_void_game_whose_deal_was_seen_gets_a_new_one() {
    // Aborted at its last call, or nobody came: the other table still has the deal to play.
    for is_kept in [false, true] {
        let mut tournament = two_games_each(|settings| {
            settings.deals = Deals::SameAtAllTables;
            settings.max_calls = 1;
        });
        let seats = tournament.games()[0].seats.clone();
        seats
            .iter()
            .for_each(|&who| tournament.set_present(who, !is_kept));
        let deal = tournament.games()[0].deal;
        follow(&mut tournament, 0);
        if is_kept {
            follow(&mut tournament, NO_SHOW_MS);
            seats
                .iter()
                .for_each(|&who| tournament.set_present(who, true));
        } else {
            end(&mut tournament, 0, Ended::Aborted);
        }
        assert_eq!(tournament.games()[0].state, GameState::Void);
        tournament.fold(&tournament.recall(0).unwrap());
        let expected = deal.filter(|_| is_kept);
        assert_eq!(tournament.games()[0].deal, expected);
        // The count of what is left to play of the deal holds.
        play_through(&mut tournament);
        assert!(deal.is_some_and(|deal| tournament.is_deal_open(deal)));
    }
}

/// Two games need the only physical table. The participant at it leaves the tournament during its
/// game: played again without it, that game needs no table, and the other one gets it.
#[test]
fn a_table_that_its_participant_gives_up_goes_to_the_next_game() {
    let with_two_games_at_tables = (0..).find_map(|seed| {
        let mut tournament = Tournament::new(Settings {
            players: 2,
            points: vec![1, 0],
            rounds: Some(1),
            physical_tables: 1,
            draw_seed: [seed; 32],
            ..settings(Format::Swiss)
        })
        .unwrap();
        for number in 0..4 {
            let change = tournament.join(Entrant {
                at_table: number < 2,
                ..entrant(&format!("entrant {number}"))
            });
            tournament.fold(&change.unwrap());
            tournament.set_present(number, true);
        }
        begin(&mut tournament);
        follow(&mut tournament, 0);
        let at_tables = tournament.games().iter().filter(|game| game.physical);
        (at_tables.count() == 2).then_some(tournament)
    });
    let mut tournament = with_two_games_at_tables.unwrap();
    let [game] = *tournament.playing().collect::<Vec<_>>() else {
        panic!("one table, one game");
    };
    let seats = &tournament.games()[game].seats;
    let at_table = *seats.iter().find(|who| **who < 2).unwrap();
    let withdrawn = tournament.withdraw(at_table, Leaving::Removed);
    tournament.fold(&withdrawn.unwrap().unwrap());
    assert_eq!(follow(&mut tournament, 0), [], "the table is still in use");
    end(&mut tournament, game, Ended::Aborted);
    follow(&mut tournament, 0);
    assert_eq!(tournament.playing().count(), 2);
    play_through(&mut tournament);
}
