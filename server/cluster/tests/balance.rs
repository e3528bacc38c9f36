//! How rooms are shared between nodes.

use chefshat_cluster::{Load, place, surplus};

const CAPACITY: u64 = 1_000;

fn loads(rooms: &[u64]) -> Vec<(usize, Load)> {
    let load = |rooms| Load {
        rooms,
        capacity: CAPACITY,
    };
    rooms.iter().map(|rooms| load(*rooms)).enumerate().collect()
}

/// What a node of these hands over.
fn given(nodes: &[(usize, Load)], node: usize) -> Vec<(usize, u64)> {
    let mut others = nodes.to_vec();
    let (_, own) = others.remove(node);
    surplus(own, &others)
}

/// Lets all nodes hand over at once what they have too many of.
fn balanced(mut nodes: Vec<(usize, Load)>) -> Vec<u64> {
    let moves: Vec<_> = (0..nodes.len()).map(|it| given(&nodes, it)).collect();
    for (from, moves) in moves.into_iter().enumerate() {
        for (to, rooms) in moves {
            nodes[from].1.rooms -= rooms;
            nodes[to].1.rooms += rooms;
        }
    }
    nodes.into_iter().map(|(_, load)| load.rooms).collect()
}

#[test]
fn nodes_that_hand_over_at_once_end_up_equally_full() {
    assert_eq!(balanced(loads(&[100, 100, 100, 0])), [75, 75, 75, 75]);
    assert_eq!(balanced(loads(&[0, 0, 90])), [30, 30, 30]);
    for rooms in [
        &[900, 10, 500, 0, 0][..],
        // The second has few too many, but the third lacks many.
        &[22, 29, 15],
        &[1_000, 1_000, 0],
        &[37, 61, 250, 3],
        // More nodes than rooms to hand over.
        &[&[28][..], &[10; 19]].concat(),
        &[&[20][..], &[8; 12]].concat(),
    ] {
        let after = balanced(loads(rooms));
        assert_eq!(after.iter().sum::<u64>(), rooms.iter().sum::<u64>());
        let (least, most) = (after.iter().min(), after.iter().max());
        let (least, most) = (*least.expect("nodes"), *most.expect("nodes"));
        assert!(most - least <= least / 5, "{rooms:?}: {after:?}");
    }
}

#[test]
fn a_larger_node_has_more() {
    let mut nodes = loads(&[300, 0]);
    nodes[1].1.capacity = 2 * CAPACITY;
    assert_eq!(balanced(nodes), [100, 200]);
}

#[test]
fn small_differences_move_nothing() {
    for rooms in [
        &[104, 98, 98][..],
        &[3, 0, 0],
        &[25, 22, 19],
        &[0, 0, 0],
        &[109, 91],
        &[50],
    ] {
        let nodes = loads(rooms);
        for node in 0..nodes.len() {
            assert_eq!(given(&nodes, node), [], "{rooms:?}");
        }
    }
    // Nor do nodes that take no rooms.
    let nothing = Load {
        rooms: 0,
        capacity: 0,
    };
    assert_eq!(surplus(nothing, &[((), nothing)]), []);
}

#[test]
fn a_new_room_is_for_a_node_with_space() {
    let at = |own: u64, others: &[u64]| place(loads(&[own])[0].1, &loads(others));
    assert_eq!(at(0, &[0, 0]), None);
    assert_eq!(at(50, &[48, 47]), None);
    assert_eq!(at(100, &[95, 0]), Some(1));
    // A full node creates none, however full the others are.
    assert_eq!(at(CAPACITY, &[999, 998]), Some(1));
    assert_eq!(at(CAPACITY + 20, &[CAPACITY, 999]), Some(1));
    assert_eq!(at(CAPACITY, &[CAPACITY]), None);
    assert_eq!(at(CAPACITY, &[]), None);
}
