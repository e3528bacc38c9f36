//! What must hold in every state of a cluster, and what must be reached at least once, so that nothing holds for want of events.

use std::collections::BTreeSet;

use chefshat_cluster::Phase;
use stateright::{Model as _, Property};

use super::{Bounds, Cluster, ROOM, Transition, UNIT, World};

/// Ticks within which a cluster without further trouble serves everything again: a lease expires, and another node, which may
/// just have regained its own, claims the unit.
const RECOVERS_WITHIN: u64 = 8;

/// Most events in these ticks.
const MOST_EVENTS: usize = 200;

/// The properties of a cluster within some bounds.
pub(super) fn all(bounds: &Bounds) -> Vec<Property<Cluster>> {
    let mut all = vec![
        Property::always("published is committed", |_, world: &World| {
            world.published.iter().all(|((item, position), rows)| {
                let row = world.tables.journal(*item).get(*position as usize);
                let row = row.map(|row| row.entries);
                rows.iter().all(|(_, published)| Some(*published) == row)
            })
        }),
        Property::always("a position is published once", |_, world: &World| {
            world.published.values().all(|rows| rows.len() == 1)
        }),
        Property::always(
            "nothing is published after a takeover",
            |_, world: &World| !world.published_late,
        ),
        Property::always("rows are of the owner", |_, world: &World| {
            [UNIT, ROOM]
                .iter()
                .all(|item| rows_are_of_owner(world, *item))
        }),
        Property::always("a decision is committed once", |_, world: &World| {
            let items = [UNIT, ROOM].into_iter();
            let rows = items.flat_map(|item| world.tables.journal(item));
            let decisions = rows.map(|row| row.entries.decision);
            let mut seen = BTreeSet::new();
            decisions.filter(|it| *it > 0).all(|it| seen.insert(it))
        }),
        Property::always(
            "what is over stays as its owner ended it",
            |_, world: &World| {
                world.ended.iter().all(|(item, (epoch, rows))| {
                    let journal = world.tables.journal(*item);
                    let is_owner = world.tables.epoch(*item) == Some(*epoch);
                    is_owner && journal.len() as u64 == *rows
                })
            },
        ),
        Property::always("one node serves", |_, world: &World| {
            let servers = 0..world.servers.len();
            servers.filter(|server| world.serves(*server)).count() <= 1
        }),
        Property::always("it recovers", recovers),
    ];
    let reached: [(bool, Property<Cluster>); 6] = [
        (
            bounds.until > 3,
            Property::sometimes("another node takes over", |_, world: &World| {
                world.serves(1)
            }),
        ),
        (
            bounds.lost > 0 && bounds.decisions > 0,
            Property::sometimes("published in spite of a loss", |_, world: &World| {
                world.lost > 0 && !world.published.is_empty()
            }),
        ),
        (
            bounds.drains > 0,
            Property::sometimes(
                "a drained unit is served before its lease ends",
                |_, world: &World| {
                    let left = world.servers[0].as_ref().is_some_and(|it| it.left);
                    left && world.serves(1) && world.now < 3
                },
            ),
        ),
        (
            bounds.handovers > 1,
            Property::sometimes(
                "a unit that was handed over comes back before a lease ends",
                |_, world: &World| {
                    let epoch = world.tables.epoch(UNIT);
                    world.serves(0) && world.now < 3 && epoch.is_some_and(|epoch| epoch.0 == 3)
                },
            ),
        ),
        (
            bounds.ends > 0,
            Property::sometimes("an item ends after a takeover", |_, world: &World| {
                world.ended.values().any(|(epoch, _)| epoch.0 > 1)
            }),
        ),
        (
            bounds.creations > 0,
            Property::sometimes("a created room is taken over", |_, world: &World| {
                world.serves(1) && world.tables.open_items(UNIT).contains(&ROOM)
            }),
        ),
    ];
    let reached = reached.into_iter().filter(|(applies, _)| *applies);
    all.extend(reached.map(|(_, property)| property));
    all
}

/// Whether each row was written by the node that owned the unit at its epoch.
fn rows_are_of_owner(world: &World, item: u8) -> bool {
    let journal = world.tables.journal(item);
    journal.is_sorted_by_key(|row| row.epoch)
        && (journal.iter()).all(|row| world.owners[&row.epoch] == row.entries.server)
}

/// Whether, if from here on nothing fails, all units are served after a while, and drained nodes have left.
fn recovers(cluster: &Cluster, world: &World) -> bool {
    let calm = Cluster {
        bounds: Bounds {
            until: world.now + RECOVERS_WITHIN,
            slow_beats: cluster.bounds.slow_beats,
            removes: cluster.bounds.removes,
            ..Bounds::NONE
        },
        fault: cluster.fault,
    };
    let mut world = world.clone();
    let mut actions = Vec::new();
    for _ in 0..MOST_EVENTS {
        actions.clear();
        calm.actions(&world, &mut actions);
        // Time passes only when nothing else happens.
        let next = (actions.iter().rposition(|it| *it != Transition::Tick))
            .or_else(|| actions.iter().position(|it| *it == Transition::Tick));
        let is_quiet = next.is_none_or(|next| actions[next] == Transition::Tick);
        if is_quiet && is_well(&world) {
            return true;
        }
        let Some(next) = next else { return false };
        calm.apply(&mut world, actions.swap_remove(next));
    }
    false
}

fn is_well(world: &World) -> bool {
    let servers = || world.servers.iter().flatten();
    let drained = servers().all(|it| it.node.phase() != Phase::Draining);
    let phases = servers().map(|it| it.node.phase());
    let any_serving = phases.clone().any(|phase| phase == Phase::Serving);
    let open = world.tables.open_items(UNIT);
    // A server may run an item that a late request has ended: its next write says so.
    let runs = |server: usize| {
        let it = world.servers[server].as_ref();
        it.is_some_and(|it| open.iter().all(|item| it.running.contains_key(item)))
    };
    let served = (0..world.servers.len()).any(|server| world.serves(server) && runs(server));
    drained && (open.is_empty() || served || !any_serving)
}
