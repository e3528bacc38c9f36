//! The modules: agents ([`Agent`]), connections and calls ([`Client`]), results of games
//! ([`Outcome`], [`PlayError`]), watching ([`Spectator`]), tickets of those who decide slowly
//! ([`TicketFollower`]), physical tables ([`TableFollower`]). The
//! messages of the protocol are re-exported as [`v1`]. The crate contains no rules of the game: the
//! server sends the legal actions.
#![doc = ""]
#![doc = include_str!("../README.md")]

mod agent;
mod backoff;
mod client;
mod clock;
mod connection;
mod error;
mod mask;
mod options;
mod outcome;
mod random;
mod repeat;
mod run;
mod seat;
mod session;
mod spectate;
mod stream;
mod table;
mod ticket_follower;
mod tickets;
mod tournaments;
mod vector;

pub use agent::{ActionId, Agent};
pub use backoff::{Backoff, FIRST_DELAY, GIVE_UP_AFTER, MAX_DELAY};
pub use chefshat_proto::v1;
pub use client::Client;
pub use clock::ServerClock;
pub use connection::{ConnectOptions, Connection, MAX_RESPONSE_BYTES};
pub use error::{Error, PlayError};
pub use mask::{count_in, is_legal, legal_actions, legal_count, nth_in, nth_legal};
pub use options::{ENTROPY_BYTES, Entropy, PlayOptions};
pub use outcome::{Ending, Outcome};
pub use random::RandomAgent;
#[doc(hidden)]
pub use repeat::repeated;
pub use spectate::{Spectator, Watched};
pub use table::TableFollower;
pub use ticket_follower::{Followed, SeatFollower, TicketFollower};
pub use tournaments::TournamentFollower;
pub use vector::VectorGames;
