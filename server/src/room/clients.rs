//! The clients that took seats in a room: a policy may admit each to one seat only.

use chefshat_engine::Seat;
use chefshat_room::{Core, JoinError};

use crate::limits::Key;

/// The clients that took seats, with the secrets of their tickets.
#[derive(Default)]
pub(super) struct Clients(Vec<(Key, [u8; 32])>);

impl Clients {
    /// Adds a client, if it is known, that took a seat.
    pub(super) fn add(&mut self, client: Option<Key>, ticket_secret: [u8; 32]) {
        (self.0).extend(client.map(|client| (client, ticket_secret)));
    }

    /// The seats that these clients took and did not leave.
    pub(super) fn seats_of(&self, core: &Core, clients: [Key; 2]) -> Vec<Seat> {
        (self.0.iter())
            .filter(|(seated, _)| clients.contains(seated))
            .filter_map(|(_, secret)| core.seat_of_ticket(secret))
            .collect()
    }

    /// Checks that a client may take a seat, by those it took and did not leave.
    pub(super) fn check(&mut self, core: &Core, client: Option<Key>) -> Result<(), JoinError> {
        if !core.header().policy.one_seat_per_client {
            return Ok(());
        }
        (self.0).retain(|(_, secret)| core.seat_of_ticket(secret).is_some());
        match (self.0.iter()).any(|(seated, _)| Some(*seated) == client) {
            true => Err(JoinError::ClientHasSeat),
            false => Ok(()),
        }
    }
}
