//! Roles (`docs/rules.md` §3.2) and special actions (§3.3).

use crate::{BySeat, Seat, SeatOrder};

/// The role of a seat in a Shift, given by its place in the last Shift. The first Shift has no
/// roles.
#[derive(Copy, Clone, Eq, PartialEq, Ord, PartialOrd, Hash, Debug)]
pub enum Role {
    /// Finished the last Shift first.
    Chef = 1,
    /// Second, with four players or more.
    SousChef = 2,
    /// Between Sous-Chef and Waiter with five or six players, the middle one of three.
    Cook = 3,
    /// Last but one, with four players or more.
    Waiter = 4,
    /// Last.
    Dishwasher = 5,
}

impl Role {
    /// The role of a rank, counted from 0, among `players` seats.
    pub fn of_rank(rank: usize, players: usize) -> Role {
        if rank == 0 {
            Role::Chef
        } else if rank + 1 == players {
            Role::Dishwasher
        } else if players >= 4 && rank == 1 {
            Role::SousChef
        } else if players >= 4 && rank + 2 == players {
            Role::Waiter
        } else {
            Role::Cook
        }
    }

    /// The role of each seat, given the seats from Chef down to Dishwasher.
    pub(crate) fn by_seat(ranking: &SeatOrder) -> BySeat<Option<Role>> {
        let mut roles = BySeat::filled(ranking.len(), None);
        for (rank, &seat) in ranking.as_slice().iter().enumerate() {
            roles[seat] = Some(Role::of_rank(rank, ranking.len()));
        }
        roles
    }

    /// The roles of a game with this many seats, from the first place of the last Shift to the
    /// last.
    pub fn in_order(players: usize) -> impl ExactSizeIterator<Item = Role> {
        (0..players).map(move |rank| Role::of_rank(rank, players))
    }

    /// The role's name as the rulebook prints it.
    pub const fn name(self) -> &'static str {
        match self {
            Role::Chef => "Chef",
            Role::SousChef => "Sous-Chef",
            Role::Cook => "Cook",
            Role::Waiter => "Waiter",
            Role::Dishwasher => "Dishwasher",
        }
    }
}

/// A declaration that a seat dealt two jokers may make before the exchange.
#[derive(Copy, Clone, Eq, PartialEq, Ord, PartialOrd, Hash, Debug)]
pub enum SpecialAction {
    /// By the Dishwasher: all roles are reversed for this Shift.
    FoodFight = 1,
    /// By any other role: no exchange in this Shift.
    DinnerIsServed = 2,
}

impl SpecialAction {
    /// The special action that a seat may declare, given the seats from Chef to Dishwasher.
    pub fn of_seat(seat: Seat, ranking: &SeatOrder) -> SpecialAction {
        if ranking.as_slice().last() == Some(&seat) {
            SpecialAction::FoodFight
        } else {
            SpecialAction::DinnerIsServed
        }
    }

    /// The special action's name as the rulebook prints it.
    pub const fn name(self) -> &'static str {
        match self {
            SpecialAction::FoodFight => "Food Fight",
            SpecialAction::DinnerIsServed => "Dinner is Served",
        }
    }
}
