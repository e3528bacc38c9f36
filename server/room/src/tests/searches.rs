//! Agents that search: the core waits for what others found.

use chefshat_agents::{AgentKind, Budget, BuiltInAgent, MonteCarlo, NamedAgent};
use chefshat_engine::{ActionId, DecisionKind, Event, Viewer};

use crate::testing::first_connection;
use crate::tests::*;
use crate::{
    HintError, MAX_HINTS, MAX_SEARCH_TIME, SEARCH_PATIENCE, SEARCH_PATIENCE_UNATTENDED,
    SearchRequest, Searched,
};

const SEARCHER: Fill = Fill::BuiltIn(NamedAgent::MonteCarlo(MonteCarlo {
    budget: Budget::Rollouts(1),
    rollouts: AgentKind::Trained,
    belief: false,
    prior: AgentKind::Trained,
}));

/// Annotations.
const NOTE: [u8; 3] = [1, 2, 3];

fn searching(pace: u64) -> Table {
    let policy = Policy {
        pace: Some(ms(pace)),
        ..Policy::default()
    };
    let fills = vec![
        SEARCHER,
        Fill::BuiltIn(AgentKind::Greedy.into()),
        SEARCHER,
        SEARCHER,
    ];
    let mut table = Table::with_rules(policy, fills, one_shift());
    table.core.begin_if_all_built_in(table.now);
    table.commit();
    table
}

/// Plays until the next search starts; `None` at the end of the game.
fn next_search(table: &mut Table) -> Option<SearchRequest> {
    while !table.core.state().is_over() {
        if let Some(request) = table.core.start_search() {
            return Some(request);
        }
        table.pass_time(ms(1_000));
    }
    None
}

fn found(action: Option<ActionId>) -> Searched {
    Searched {
        action,
        annotations: action.is_none().then(|| NOTE.into()),
    }
}

fn last_legal(request: &SearchRequest) -> Searched {
    found(request.legal.iter().last())
}

/// Says what was found for a request.
fn answer(table: &mut Table, request: &SearchRequest, found: Searched) {
    (table.core).searched(request.seat, request.decision, found);
}

#[test]
fn a_decision_waits_for_the_search_and_takes_what_it_found() {
    let mut table = searching(0);
    let (mut with, mut without) = (0, 0);
    while let Some(request) = next_search(&mut table) {
        let decisions = table.core.decisions();
        table.pass_time(SEARCH_PATIENCE_UNATTENDED);
        assert_eq!(table.core.decisions(), decisions, "it waits");
        assert!(table.core.start_search().is_none(), "it is started once");
        assert!(
            request.legal.len() > 1
                && request.observation.kind != Some(DecisionKind::SpecialAction)
        );

        let action = last_legal(&request);
        let given = action.action.filter(|_| decisions.is_multiple_of(2));
        table
            .core
            .searched(request.seat, request.decision + 1, action);
        table.pass_time(ms(1));
        assert_eq!(
            table.core.decisions(),
            decisions,
            "that was for another decision"
        );
        answer(&mut table, &request, found(given));
        let mut prior = BuiltInAgent::new(AgentKind::Trained, [0; 32]);
        let expected = given.unwrap_or_else(|| prior.decide(&request.observation, &request.legal));
        let length = table.journal.len();
        table.pass_time(ms(0));
        let taken = (table.journal[length..].iter()).find_map(|entry| match &entry.change {
            Change::Decided(decided) => Some(decided.clone()),
            _ => None,
        });
        let taken = taken.expect("a decision");
        let who = (taken.seat, taken.action, taken.source);
        assert_eq!(who, (request.seat, expected, Source::Agent));
        let note = given.is_none().then(|| NOTE.into());
        assert_eq!(taken.annotations, note);
        with += usize::from(given.is_some());
        without += usize::from(given.is_none());
    }
    assert_eq!(table.core.state(), State::Finished);
    assert!(with > 5 && without > 5, "{with} {without}");
    table.assert_replays();
}

#[test]
fn a_search_without_end_is_given_up() {
    let mut table = searching(0);
    let longest = SEARCH_PATIENCE_UNATTENDED + MAX_SEARCH_TIME;
    for _ in 0..10 {
        let request = next_search(&mut table).expect("a search");
        assert_eq!(request.patience, SEARCH_PATIENCE_UNATTENDED);
        let (decisions, start) = (table.core.decisions(), table.now);
        let deadline = table.core.deadline().expect("it ends");
        assert!(deadline <= start + longest && deadline + ms(1_000) >= start + longest);
        table.pass_time(deadline - start - ms(1));
        assert_eq!(table.core.decisions(), decisions, "it waits");
        table.pass_time(ms(1));
        assert!(table.core.decisions() > decisions);
    }
    table.assert_replays();
}

#[test]
fn an_illegal_result_counts_as_none() {
    let mut table = searching(0);
    let request = next_search(&mut table).expect("a search");
    let illegal = (0..u16::MAX)
        .map(ActionId::new)
        .find(|action| !request.legal.contains(*action));
    answer(&mut table, &request, found(illegal));
    table.pass_time(ms(0));
    assert!(table.core.decisions() > 0);
    table.assert_replays();
}

#[test]
fn a_search_is_part_of_the_pace() {
    let mut table = searching(500);
    let request = next_search(&mut table).expect("a search");
    let decisions = table.core.decisions();
    answer(&mut table, &request, last_legal(&request));
    table.pass_time(ms(499));
    assert_eq!(table.core.decisions(), decisions);
    table.pass_time(ms(1));
    assert_eq!(table.core.decisions(), decisions + 1);
}

#[test]
fn after_a_restart_the_open_decision_is_searched_again_from_what_the_seat_knows() {
    let play = |restart: bool| {
        let mut table = searching(0);
        let mut number = 0;
        while let Some(mut request) = next_search(&mut table) {
            number += 1;
            if restart && number % 3 == 0 {
                let before = request;
                table.restart(ms(10));
                request = table
                    .core
                    .start_search()
                    .expect("the decision is still open");
                assert_eq!(
                    (before.seat, before.decision, before.seed),
                    (request.seat, request.decision, request.seed)
                );
                assert_eq!(before.observation, request.observation);
                assert_eq!(before.history, request.history);
            }
            let seat = Viewer::Seat(request.seat);
            assert!(matches!(
                request.history.first(),
                Some(Event::ShiftStarted { .. })
            ));
            assert!((request.history.iter()).all(|event| event.seen_by(seat) == *event));
            let found = last_legal(&request);
            answer(&mut table, &request, found);
        }
        table.assert_replays();
        table.decided()
    };
    assert_eq!(play(true), play(false));
}

#[test]
fn a_seat_that_returns_from_a_substitute_is_not_played_by_its_search() {
    let policy = Policy {
        substitute: NamedAgent::MonteCarlo(MonteCarlo::default()),
        max_timeouts: 1,
        ..Policy::default()
    };
    let mut table = Table::playing(policy);
    let (seat, _) = table.open();
    let late = table.core.time_left(table.now);
    table.pass_time(late.0 + late.1);
    assert!(table.core.standing(seat).substituted);
    let request = loop {
        match table.core.start_search() {
            Some(request) => break request,
            None => table.play_one(),
        };
    };
    assert_eq!(request.seat, seat);
    assert_eq!(request.patience, SEARCH_PATIENCE, "others wait");
    table.attach(seat);
    let decisions = table.core.decisions();
    answer(&mut table, &request, last_legal(&request));
    table.core.tick(table.now, None);
    assert_eq!(table.core.decisions(), decisions, "the seat decides itself");
    assert_eq!(table.play_one(), seat);
}

#[test]
fn a_hint_is_recorded_and_bounded() {
    let policy = Policy {
        hints: true,
        ..Policy::default()
    };
    let mut table = Table::playing(policy);
    let (seat, decision) = table.open();
    let other = table.core.all_seats().find(|it| *it != seat);
    let other = other.expect("another seat");
    let ask = |table: &mut Table, seat, decision| {
        let started = table.core.start_hint(seat, decision, MonteCarlo::default());
        started.map(|request| (request.seat, request.decision))
    };
    assert_eq!(ask(&mut table, other, 1), Err(HintError::Closed));
    assert_eq!(ask(&mut table, seat, decision + 1), Err(HintError::Closed));
    for number in 1..=MAX_HINTS {
        assert_eq!(ask(&mut table, seat, decision), Ok((seat, decision)));
        assert_eq!(ask(&mut table, seat, decision), Err(HintError::TooMany));
        assert_eq!(table.core.hinted(table.now, seat, decision), Ok(()));
        table.commit();
        if number == 2 {
            table.restart(ms(10));
            table.attach(seat);
        }
    }
    assert_eq!(ask(&mut table, seat, decision), Err(HintError::TooMany));
    let hints = |table: &Table| {
        let entries = table.journal.iter();
        let hinted =
            entries.filter(|entry| matches!(entry.change, Change::Hinted(it) if it == seat));
        hinted.count()
    };
    assert_eq!(u32::try_from(hints(&table)), Ok(MAX_HINTS));
    table.play_one();
    assert_eq!(ask(&mut table, seat, decision), Err(HintError::Closed));
    assert_eq!(
        table.core.hinted(table.now, seat, decision),
        Err(HintError::Closed)
    );
    table.assert_replays();
}

#[test]
fn a_hint_that_runs_counts_while_its_seat_returns_from_a_lost_server() {
    let policy = Policy {
        hints: true,
        ..Policy::default()
    };
    let mut table = Table::playing(policy);
    let (seat, decision) = table.open();
    let ask = |table: &mut Table| {
        let started = table.core.start_hint(seat, decision, MonteCarlo::default());
        started.map(drop)
    };
    assert_eq!(ask(&mut table), Ok(()));
    (table.core).lost_with_node(table.now, seat, first_connection(seat), None);
    table.commit();
    table.attach(seat);
    assert_eq!(table.open(), (seat, decision));
    assert_eq!(ask(&mut table), Err(HintError::TooMany));
    assert_eq!(table.core.hinted(table.now, seat, decision), Ok(()));
    assert_eq!(ask(&mut table), Ok(()));
    // A hint that could not be computed does not count.
    table.core.hint_ended(seat, decision);
    assert_eq!(ask(&mut table), Ok(()));
}

#[test]
fn a_room_gives_no_hints_unless_its_policy_says_so() {
    let mut table = Table::playing(Policy::default());
    let (seat, decision) = table.open();
    let started = table.core.start_hint(seat, decision, MonteCarlo::default());
    assert_eq!(started.map(|_| ()), Err(HintError::Off));
}
