//! Every end of a search. None depends on how fast the machine is.

use std::sync::mpsc;

use chefshat_engine::Mask;
use chefshat_room::journal::Fill;
use chefshat_room::policy::Policy;
use chefshat_room::testing::{Table, ms, one_shift};
use futures::FutureExt as _;
use futures::future::BoxFuture;
use tokio::sync::oneshot;

use super::*;
use crate::limits::Permit;

/// Longer than any test.
const PATIENT: Duration = Duration::from_secs(100_000);

/// A decision with a choice between several actions, as a room has it searched.
fn request(agent: &str) -> (RuleSet, SearchRequest) {
    let fills = vec![Fill::BuiltIn(agent.parse().expect("an agent")); 4];
    let mut table = Table::with_rules(Policy::default(), fills, one_shift());
    table.core.begin_if_all_built_in(table.now);
    table.commit();
    let request = loop {
        match table.core.start_search() {
            Some(request) => break request,
            None => table.pass_time(ms(1_000)),
        }
    };
    let rules = table.core.header().rules;
    let patience = PATIENT;
    (
        rules,
        SearchRequest {
            patience,
            ..request
        },
    )
}

fn searches() -> Arc<Searches> {
    Arc::new(Searches::new(Arc::default()).expect("threads"))
}

fn turns(searches: &Searches) -> Vec<Permit> {
    let take = || searches.turns.try_take(Key::Resumed);
    std::iter::from_fn(take).collect()
}

/// Searches, and checks that this is counted and noted as `outcome`.
async fn check(
    searches: &Arc<Searches>,
    (rules, request): (RuleSet, SearchRequest),
    outcome: SearchOutcome,
) {
    let before = searches.metrics.searches(outcome);
    let legal = request.legal;
    let found = Arc::clone(searches)
        .search(Key::Local, rules, request)
        .await;
    assert_eq!(searches.metrics.searches(outcome), before + 1);
    if outcome == SearchOutcome::Searched {
        assert!(found.action.is_some_and(|action| legal.contains(action)));
        assert_eq!(found.annotations, None);
    } else {
        assert_eq!(found.action, None);
        let written = found.annotations.expect("a note");
        let read = v1::Annotations::decode(&*written).expect("annotations");
        assert_eq!(read.extra["search"], outcome.label());
    }
}

#[tokio::test]
async fn each_end_is_counted_and_noted() {
    let searches = searches();
    let decision = request("monte_carlo:400:random");
    check(&searches, decision.clone(), SearchOutcome::Searched).await;

    let hasty = request("monte_carlo:1:random");
    check(&searches, hasty, SearchOutcome::TooFewDeals).await;

    let (rules, mut unknown) = decision.clone();
    unknown.history.clear();
    check(&searches, (rules, unknown), SearchOutcome::Impossible).await;

    // No agent can play without an action.
    let (rules, mut broken) = decision.clone();
    broken.legal = Mask::default();
    check(&searches, (rules, broken), SearchOutcome::Failed).await;

    let all = turns(&searches);
    let (rules, mut impatient) = decision.clone();
    impatient.patience = ms(1);
    check(&searches, (rules, impatient), SearchOutcome::Busy).await;
    drop(all);
    check(&searches, decision, SearchOutcome::Searched).await;
}

#[tokio::test]
async fn those_with_patience_are_searched_later() {
    let searches = searches();
    let all = turns(&searches);
    let mut waiting = check(
        &searches,
        request("monte_carlo:400:random"),
        SearchOutcome::Searched,
    )
    .boxed();
    assert!((&mut waiting).now_or_never().is_none());
    drop(all);
    waiting.await;
}

/// The other ends of work that begins, waits for a message, and then says whether it is to stop.
struct HeldUp {
    begins: oneshot::Receiver<()>,
    go_on: mpsc::Sender<()>,
    stopping: oneshot::Receiver<bool>,
}

/// Starts to run such work.
fn held_up(searches: &Searches) -> (BoxFuture<'_, Result<(), SearchOutcome>>, HeldUp) {
    let (begun, begins) = oneshot::channel();
    let (go_on, goes_on) = mpsc::channel();
    let (stops, stopping) = oneshot::channel();
    let work = move |stopped: &dyn Fn() -> bool| {
        let _ = begun.send(());
        let _ = goes_on.recv();
        let _ = stops.send(stopped());
        Ok(())
    };
    let held_up = HeldUp {
        begins,
        go_on,
        stopping,
    };
    (searches.run(Key::Local, PATIENT, work).boxed(), held_up)
}

#[tokio::test]
async fn a_search_that_nobody_waits_for_stops() {
    let searches = searches();
    let (mut running, held_up) = held_up(&searches);
    assert!((&mut running).now_or_never().is_none());
    held_up.begins.await.expect("it begins");
    drop(running);
    assert_eq!(searches.turns.taken(), 1, "until it ends");
    held_up.go_on.send(()).expect("it waits");
    assert!(held_up.stopping.await.expect("it continues"));
}

#[tokio::test(start_paused = true)]
async fn a_thread_that_does_not_get_on_is_not_waited_for() {
    let searches = searches();
    let (running, held_up) = held_up(&searches);
    // Nothing else happens, so the clock of the test moves on to the end of the wait.
    assert_eq!(running.await, Err(SearchOutcome::Busy));
    assert_eq!(searches.turns.taken(), 1, "until it ends");
    held_up.go_on.send(()).expect("it waits");
    assert!(held_up.stopping.await.expect("it continues"));
}

#[tokio::test]
async fn each_hint_of_a_decision_imagines_other_deals() {
    let searches = searches();
    let hint = async |hints| {
        let (rules, request) = request("monte_carlo:400:random");
        let request = SearchRequest { hints, ..request };
        let hint = Arc::clone(&searches).hint(Key::Local, rules, request).await;
        assert!(!hint.estimates.is_empty());
        hint.estimates
    };
    assert_eq!(hint(0).await, hint(0).await);
    assert_ne!(hint(0).await, hint(1).await);
}
