//! Valid settings, joining, beginning and closing.

use chefshat_agents::AgentKind;
use chefshat_tournament::{
    BeginProblem, Change, Deals, Entrant, Format, JoinProblem, Settings, State, Tournament,
};

use super::support::{begin, begun, end, entrant, follow, joined, played, settings};

#[test]
fn settings_are_refused_by_the_name_of_their_field() {
    type Spoil = fn(&mut Settings);
    let cases: [(&str, Spoil); 22] = [
        ("rules", |settings| settings.points = vec![5, 3, 1]),
        ("rules", |settings| settings.points = vec![5, 3, 1, 2]),
        ("rules", |settings| {
            settings.players = 7;
            settings.points = vec![0; 7];
        }),
        ("format", |settings| {
            settings.format = Format::Knockout;
            settings.players = 3;
            settings.points = vec![5, 3, 0];
        }),
        ("rounds", |settings| {
            settings.format = Format::Knockout;
            settings.rounds = Some(2);
        }),
        ("rounds", |settings| settings.rounds = Some(0)),
        ("rounds", |settings| settings.rounds = Some(1001)),
        ("games_per_pairing", |settings| {
            settings.games_per_pairing = 0
        }),
        ("games_per_pairing", |settings| {
            settings.games_per_pairing = 1001;
        }),
        ("games_per_pairing", |settings| {
            // 16 tables, 6 rounds, 4000 games each.
            settings.games_per_pairing = 1000;
            settings.deals = Deals::Rotated;
        }),
        ("max_participants", |settings| settings.max_participants = 1),
        ("max_participants", |settings| {
            settings.max_participants = 1025
        }),
        ("start_when_joined", |settings| {
            settings.start_when_joined = Some(1)
        }),
        ("start_when_joined", |settings| {
            settings.start_when_joined = Some(65);
        }),
        ("no_show_time_ms", |settings| settings.no_show_ms = 999),
        ("no_show_time_ms", |settings| {
            settings.no_show_ms = 86_400_001
        }),
        ("max_calls", |settings| settings.max_calls = 0),
        ("max_calls", |settings| settings.max_calls = 11),
        ("max_parallel_games", |settings| settings.max_parallel = 0),
        ("max_parallel_games", |settings| settings.max_parallel = 257),
        ("physical_tables", |settings| settings.physical_tables = 65),
        ("physical_tables", |settings| {
            settings.physical_tables = 1;
            settings.deals = Deals::SameAtAllTables;
        }),
    ];
    for (field, spoil) in cases {
        let mut settings = settings(Format::Swiss);
        assert!(Tournament::new(settings.clone()).is_ok());
        spoil(&mut settings);
        let problem = Tournament::new(settings).unwrap_err();
        assert_eq!(problem.field, field, "{problem}");
        assert!(problem.to_string().starts_with(field));
    }
}

#[test]
fn names_of_formats_and_deals_round_trip() {
    for format in Format::ALL {
        assert_eq!(Format::from_name(format.name()), Some(format));
    }
    for deals in Deals::ALL {
        assert_eq!(Deals::from_name(deals.name()), Some(deals));
    }
    assert_eq!(Format::from_name("league"), None);
    assert_eq!(Deals::from_name("marked"), None);
}

#[test]
fn joining_is_refused_with_a_reason() {
    let mut settings = settings(Format::Swiss);
    settings.max_participants = 3;
    settings.deals = Deals::Rotated;
    let mut tournament = joined(settings, 2);
    let join = |tournament: &Tournament, change: fn(&mut Entrant)| {
        let mut entrant = entrant("Eve");
        change(&mut entrant);
        tournament.join(entrant)
    };
    for (problem, change) in [
        (
            JoinProblem::NameTaken,
            (|entrant| entrant.name = "agent 1".to_owned()) as fn(&mut Entrant),
        ),
        (JoinProblem::NameTaken, |entrant| {
            entrant.name = "Agent\u{a0}\u{fe0f} 1\u{fe0f}".to_owned();
        }),
        (JoinProblem::NotStateless, |entrant| {
            entrant.stateless = false;
        }),
        (JoinProblem::MaxGames, |entrant| entrant.max_games = 0),
        (JoinProblem::MaxGames, |entrant| entrant.max_games = 65),
    ] {
        assert_eq!(join(&tournament, change), Err(problem));
    }
    let built_in = join(&tournament, |entrant| {
        entrant.stateless = false;
        entrant.built_in = Some(AgentKind::Greedy.into());
    });
    tournament.fold(&built_in.unwrap());
    assert!(tournament.is_present(2), "a built-in agent always is");
    assert_eq!(join(&tournament, |_| {}), Err(JoinProblem::Full));
    begin(&mut tournament);
    assert_eq!(join(&tournament, |_| {}), Err(JoinProblem::Started));
    assert_eq!(tournament.participants().len(), 4, "a filler was added");
}

#[test]
fn it_starts_once_and_with_enough_participants() {
    let too_few = BeginProblem::TooFew { have: 1, need: 2 };
    for format in Format::ALL {
        let mut tournament = joined(settings(format), 1);
        assert_eq!(tournament.begin(), Err(too_few));
        tournament.fold(&tournament.join(entrant("Eve")).unwrap());
        assert_eq!(tournament.state(), State::Open);
        let changes = tournament.begin().unwrap();
        assert!(matches!(
            changes[0],
            Change::Joined(Entrant { filler: true, .. })
        ));
        assert!(matches!(changes[2], Change::Begun { .. }));
        assert!(matches!(changes[3], Change::Drawn { round: 1, .. }));
        assert_eq!(tournament.state(), State::Open, "nothing has happened yet");
        changes.iter().for_each(|change| tournament.fold(change));
        assert_eq!(tournament.state(), State::Playing);
        assert_eq!(tournament.begin(), Err(BeginProblem::Started));
    }
}

#[test]
fn a_filler_takes_a_name_that_is_free() {
    let mut tournament = joined(settings(Format::Swiss), 1);
    // Journals of before the names of fillers were reserved.
    for name in ["Filler 1", "filler"] {
        tournament.fold(&Change::Joined(entrant(name)));
    }
    begin(&mut tournament);
    assert_eq!(tournament.participants()[3].name, "Filler 2");
}

#[test]
fn it_starts_automatically_at_the_set_number() {
    for format in Format::ALL {
        let mut settings = settings(format);
        settings.start_when_joined = Some(6);
        let mut by_itself = joined(settings, 5);
        assert_eq!(follow(&mut by_itself, 0), []);
        by_itself.fold(&by_itself.join(entrant("Eve")).unwrap());
        by_itself.set_present(5, true);
        let by_owner = by_itself.clone();
        let begun = by_owner.begin().unwrap();
        let followed = follow(&mut by_itself, 0);
        assert_eq!(followed[..begun.len()], begun);
        assert!(matches!(followed[begun.len()], Change::Called { .. }));
        // As after a restart between the changes.
        for cut in 0..begun.len() {
            let mut resumed = by_owner.clone();
            begun[..cut].iter().for_each(|change| resumed.fold(change));
            let mut rest = begun[..cut].to_vec();
            while let Some(change) = resumed.next(0) {
                if rest.len() == begun.len() {
                    break;
                }
                resumed.fold(&change);
                rest.push(change);
            }
            assert_eq!(rest, begun, "{format:?}, cut at {cut}");
        }
    }
}

#[test]
fn closing_voids_unfinished_games() {
    let mut tournament = begun(settings(Format::RoundRobin), 8);
    follow(&mut tournament, 0);
    end(&mut tournament, 0, played(&[1, 2, 3, 4]));
    let standings = tournament.standings();
    let close = tournament.close().unwrap();
    assert_eq!(close, Change::Closed);
    tournament.fold(&close);
    assert_eq!(tournament.state(), State::Closed);
    assert_eq!(
        (tournament.playing().count(), tournament.games_over()),
        (0, 14)
    );
    assert_eq!(tournament.standings(), standings, "what counted stays");
    assert_eq!(tournament.ended(1, played(&[1, 2, 3, 4])), None, "too late");
    assert_eq!((tournament.close(), tournament.next(0)), (None, None));
    assert_eq!(tournament.wake_at(), None);
    assert_eq!(tournament.join(entrant("Eve")), Err(JoinProblem::Started));
    assert_eq!(tournament.begin(), Err(BeginProblem::Started));

    let mut open = joined(settings(Format::Swiss), 3);
    open.fold(&open.close().unwrap());
    assert_eq!(open.state(), State::Closed);
}
