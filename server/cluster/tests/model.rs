//! Explores every order in which requests of several nodes can reach the database, answers come back or get lost, clocks advance,
//! nodes sleep, die and are drained, within small bounds. Several small configurations allow one kind of trouble each. `world`
//! is what the servers and the database around the core do; faults that are planted there are found, each by a property.

mod world;

use stateright::{Checker as _, Expectation, HasDiscoveries, Model as _};
use world::{Bounds, Cluster, Fault};

/// A node sleeps beyond its lease or its append arrives late, and another takes over. An answer gets lost.
const TAKEOVER: Bounds = Bounds {
    until: 7,
    decisions: 2,
    lost: 1,
    ..Bounds::NONE
};

/// A node dies, and an answer to the other gets lost.
const CRASH: Bounds = Bounds {
    until: 6,
    crashes: 1,
    ..TAKEOVER
};

/// Two decisions, without losses.
const DECISIONS: Bounds = Bounds {
    until: 7,
    decisions: 3,
    ..Bounds::NONE
};

/// Beats and their answers take time and get lost.
const SLOW_BEATS: Bounds = Bounds {
    until: 4,
    decisions: 1,
    lost: 1,
    slow_beats: true,
    ..Bounds::NONE
};

/// A node is drained, and an answer gets lost.
const DRAIN: Bounds = Bounds {
    until: 3,
    drains: 1,
    ..TAKEOVER
};

/// A node hands the unit over and stays, twice, and an answer gets lost.
const HANDOVER: Bounds = Bounds {
    until: 3,
    handovers: 2,
    ..TAKEOVER
};

/// A game ends while others may take it over.
const END: Bounds = Bounds {
    until: 5,
    ends: 1,
    ..TAKEOVER
};

/// A tournament creates a room while others may take it over.
const TOURNAMENT: Bounds = Bounds {
    until: 5,
    creations: 1,
    ..TAKEOVER
};

/// A tournament or its room ends while others may take it over.
const TOURNAMENT_END: Bounds = Bounds {
    until: 4,
    creations: 1,
    ends: 1,
    ..Bounds::NONE
};

/// Expired nodes are removed from the database.
const REMOVED: Bounds = Bounds {
    until: 7,
    decisions: 2,
    removes: true,
    ..Bounds::NONE
};

/// Checks a configuration, until a fault is found if one is planted. Returns the names of the properties that fail.
fn check(name: &str, bounds: Bounds, planted: Option<(Fault, &'static str)>) -> Vec<&'static str> {
    let fault = planted.map(|(fault, _)| fault);
    let finish_when = match planted {
        None => HasDiscoveries::AnyFailures,
        Some((_, property)) => HasDiscoveries::AnyOf([property].into()),
    };
    let checker = (Cluster { bounds, fault }.checker().threads(2))
        .finish_when(finish_when)
        .spawn_bfs()
        .join();
    println!("{name}: {} states", checker.unique_state_count());
    let found = checker.discoveries();
    let properties = checker.model().properties();
    let fails = (properties.iter()).filter(|property| {
        let is_discovered = found.contains_key(property.name);
        is_discovered == (property.expectation == Expectation::Always)
    });
    let fails: Vec<_> = fails.map(|property| property.name).collect();
    for name in &fails {
        if let Some(path) = found.get(name).filter(|_| fault.is_none()) {
            for action in path.clone().into_actions() {
                println!("{name}: {action:?}");
            }
        }
    }
    fails
}

/// Whether everything within the bounds is explored, not only what happens before their last tick:
/// `CHEFSHAT_MODEL=all`, as `cargo xtask test --slow` asks for. It takes several times as long.
fn everything() -> bool {
    std::env::var("CHEFSHAT_MODEL").is_ok_and(|value| value == "all")
}

#[test]
fn every_order_is_safe_and_recovers() {
    let earlier = u64::from(!everything());
    for (name, bounds) in [
        ("takeover", TAKEOVER),
        ("crash", CRASH),
        ("decisions", DECISIONS),
        ("slow beats", SLOW_BEATS),
        ("drain", DRAIN),
        ("handover", HANDOVER),
        ("end", END),
        ("tournament", TOURNAMENT),
        ("tournament's end", TOURNAMENT_END),
        ("removed", REMOVED),
    ] {
        let until = bounds.until - earlier;
        let bounds = Bounds { until, ..bounds };
        assert_eq!(check(name, bounds, None), [""; 0], "{name}");
    }
}

#[test]
fn planted_faults_are_found() {
    let mut missed = Vec::new();
    for (bounds, fault, property) in [
        (
            TOURNAMENT,
            Fault::AppendWithoutEpoch,
            "rows are of the owner",
        ),
        (TOURNAMENT, Fault::ClaimKeepsEpoch, "rows are of the owner"),
        (TAKEOVER, Fault::PublishedEarly, "published is committed"),
        (
            TAKEOVER,
            Fault::UnknownIsCommitted,
            "published is committed",
        ),
        (TAKEOVER, Fault::LocalClocks, "one node serves"),
        (TAKEOVER, Fault::LeaseNotChecked, "one node serves"),
        (SLOW_BEATS, Fault::LeaseFromReceiving, "one node serves"),
        (
            TAKEOVER,
            Fault::PublishedWhileSuspended,
            "nothing is published after a takeover",
        ),
        (
            TOURNAMENT_END,
            Fault::FinishWithoutEpoch,
            "what is over stays as its owner ended it",
        ),
        (
            END,
            Fault::FinishWithoutRows,
            "what is over stays as its owner ended it",
        ),
        (
            TOURNAMENT,
            Fault::CreationWithoutEpoch,
            "rows are of the owner",
        ),
    ] {
        let fails = check(&format!("{fault:?}"), bounds, Some((fault, property)));
        if !fails.contains(&property) {
            missed.push(format!("{fault:?} by {property:?}, but {fails:?}"));
        }
    }
    assert_eq!(missed, [""; 0], "not found");
}
