//! Who has which seat at the tables of all rounds, so that everybody has each seat equally often, or once more than another.
//!
//! Take two seats. Each table is a line from the participant who has the first to the one who has the second. Lines can be turned so that
//! at everybody as many go out as come in, but for one where their number is odd: walk along lines until there is none left, turning each
//! in the direction of the walk, beginning with those of an odd number. That evens these two seats out and leaves the others as they
//! are; done for any two seats that differ by more, it comes to an end, since the sum of the squares falls every time.

/// Orders the participants of every table.
pub(super) fn spread(mut tables: Vec<&mut Vec<usize>>, participants: usize, seats: usize) {
    loop {
        let mut is_even = true;
        for first in 0..seats {
            for second in first + 1..seats {
                if differ(&tables, participants, first, second) {
                    is_even = false;
                    turn(&mut tables, participants, first, second);
                }
            }
        }
        if is_even {
            return;
        }
    }
}

/// Whether somebody has one of the two seats more than once more often than the other.
fn differ(tables: &[&mut Vec<usize>], participants: usize, first: usize, second: usize) -> bool {
    let mut balance = vec![0i64; participants];
    for table in tables {
        balance[table[first]] += 1;
        balance[table[second]] -= 1;
    }
    balance.iter().any(|more| more.abs() > 1)
}

/// Evens two seats out.
fn turn(tables: &mut [&mut Vec<usize>], participants: usize, first: usize, second: usize) {
    let mut lines: Vec<Vec<usize>> = vec![Vec::new(); participants];
    for (index, table) in tables.iter().enumerate() {
        lines[table[first]].push(index);
        lines[table[second]].push(index);
    }
    let mut is_turned = vec![false; tables.len()];
    // Walks from those of an odd number end at others of an odd number; after that every walk ends where it began.
    let odd: Vec<usize> = (0..participants)
        .filter(|&who| lines[who].len() % 2 == 1)
        .collect();
    for start in odd.into_iter().chain(0..participants) {
        let mut who = start;
        while let Some(line) = lines[who].pop() {
            if std::mem::replace(&mut is_turned[line], true) {
                continue;
            }
            if tables[line][first] != who {
                tables[line].swap(first, second);
            }
            who = tables[line][second];
        }
    }
}
