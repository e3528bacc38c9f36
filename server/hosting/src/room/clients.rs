//! The clients that took seats in a room: a policy may admit each to one seat only, and an owner who
//! breaks the game off has lost it at the seats that are its own.

use chefshat_engine::Seat;
use chefshat_room::{Core, JoinError};

use chefshat_admission::limits::{Key, Payer};

/// The clients that took seats, with the secrets of their tickets.
#[derive(Default)]
pub(super) struct Clients(Vec<(Payer, [u8; 32])>);

impl Clients {
    /// Adds a client, if it is known, that took a seat.
    pub(super) fn add(&mut self, client: Option<Payer>, ticket_secret: [u8; 32]) {
        (self.0).extend(client.map(|client| (client, ticket_secret)));
    }

    /// The seats that one of these clients took and did not leave, or to which it is connected:
    /// after a restart, who took a seat is unknown.
    pub(super) fn seats_of(
        &self,
        core: &Core,
        connected: impl IntoIterator<Item = (Seat, Payer)>,
        clients: &[Payer],
    ) -> Vec<Seat> {
        let seated = (self.0.iter())
            .filter_map(|(client, secret)| Some((core.seat_of_ticket(secret)?, *client)));
        let mut seats: Vec<Seat> = (seated.chain(connected))
            .filter(|(_, one)| clients.iter().any(|other| are_one(*one, *other)))
            .map(|(seat, _)| seat)
            .collect();
        seats.sort();
        seats.dedup();
        seats
    }

    /// Checks that a client may take a seat, by those it took and did not leave.
    pub(super) fn check(&mut self, core: &Core, client: Option<Key>) -> Result<(), JoinError> {
        if !core.header().policy.one_seat_per_client {
            return Ok(());
        }
        (self.0).retain(|(_, secret)| core.seat_of_ticket(secret).is_some());
        match (self.0.iter()).any(|(seated, _)| Some(seated.key) == client) {
            true => Err(JoinError::ClientHasSeat),
            false => Ok(()),
        }
    }
}

/// Whether two callers may be one party: they have the same token, or the same address unless both
/// have a token. Otherwise who shows its token only now and then would be two.
fn are_one(one: Payer, other: Payer) -> bool {
    match (one.key, other.key) {
        (Key::Token(one), Key::Token(other)) => one == other,
        _ => one.address == other.address,
    }
}
