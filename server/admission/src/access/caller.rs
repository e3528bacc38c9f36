//! Who calls: role, scope and address.

use std::fmt;
use std::net::IpAddr;
use std::str::FromStr;

use chefshat_room::ids::{RoomId, SecretHash, TournamentId};
use serde::{Deserialize, Serialize};

use super::secrets::{Relation, Secrets};
use super::token::TokenId;

/// What a caller may do. Each role may do everything that lower ones may.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default, Serialize, Deserialize,
)]
#[serde(rename_all = "lowercase")]
pub enum Role {
    /// Learns what the server is. The role of callers without a token, unless the server admits
    /// them as something more.
    #[default]
    Anyone,
    /// Watches rooms, follows tournaments and reads records.
    Spectator,
    /// Joins rooms and tournaments with their join codes, and plays.
    Player,
    /// Creates rooms and tournaments.
    Host,
    /// Operates the server.
    Admin,
}

impl Role {
    /// The roles that a token can have, lowest first.
    pub const OF_TOKENS: [Self; 4] = [Self::Spectator, Self::Player, Self::Host, Self::Admin];

    /// Its name on the command line and in the tokens file.
    pub fn name(self) -> &'static str {
        match self {
            Self::Anyone => "anyone",
            Self::Spectator => "spectator",
            Self::Player => "player",
            Self::Host => "host",
            Self::Admin => "admin",
        }
    }
}

impl fmt::Display for Role {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.pad(self.name())
    }
}

impl FromStr for Role {
    type Err = String;

    /// Reads the name of a role that a token can have.
    fn from_str(text: &str) -> Result<Self, String> {
        let found = Self::OF_TOKENS.into_iter().find(|it| it.name() == text);
        found.ok_or_else(|| "use spectator, player, host or admin".to_owned())
    }
}

/// The only room or tournament that a token is valid for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Scope {
    /// One room.
    Room(RoomId),
    /// One tournament with its rooms.
    Tournament(TournamentId),
}

impl fmt::Display for Scope {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Room(id) => write!(formatter, "room {id}"),
            Self::Tournament(id) => write!(formatter, "tournament {id}"),
        }
    }
}

/// Who sent a request.
#[derive(Debug, Clone, Default)]
pub struct Caller {
    /// The peer's address; `None` for connections without one, such as those of a unix socket.
    pub address: Option<IpAddr>,
    /// The token that it sent, if it is valid.
    pub token: Option<TokenId>,
    /// The hash of that token.
    pub token_hash: Option<SecretHash>,
    /// What it may do.
    pub role: Role,
    /// The only room or tournament that it may reach, if limited to one.
    pub scope: Option<Scope>,
    /// The owner tokens and tickets that it shows.
    pub secrets: Secrets,
}

impl Caller {
    /// The caller of a request. Without the layer of `grpc/access.rs` in front of a service, it
    /// may do nothing.
    pub fn of(extensions: &http::Extensions) -> Self {
        extensions.get().cloned().unwrap_or_default()
    }

    /// Whether its scope includes a room. `tournament` is the tournament that the room belongs to.
    pub fn reaches_room(&self, room: RoomId, tournament: Option<TournamentId>) -> bool {
        match self.scope {
            None => true,
            Some(Scope::Room(only)) => only == room,
            Some(Scope::Tournament(only)) => tournament == Some(only),
        }
    }

    /// Whether its scope includes a tournament.
    pub fn reaches_tournament(&self, tournament: TournamentId) -> bool {
        self.scope
            .is_none_or(|only| only == Scope::Tournament(tournament))
    }

    /// The same caller, who also shows a secret that its request contains.
    pub fn showing(&self, secret: &str) -> Self {
        Self {
            secrets: self.secrets.with(secret),
            ..self.clone()
        }
    }

    /// The same caller as its secrets alone make it, without its token and address.
    pub fn by_secrets(&self) -> Self {
        Self {
            secrets: self.secrets.clone(),
            ..Self::default()
        }
    }

    /// Whether the caller is the operator of the server, who sees everything.
    pub fn is_operator(&self) -> bool {
        self.role == Role::Admin && self.scope.is_none()
    }

    /// What its token makes of it where its scope reaches: the operator is like the owner of
    /// everything, and so is a host in the scope of its token.
    pub fn relation(&self) -> Relation {
        match (self.role, self.scope) {
            (Role::Admin, _) | (Role::Host, Some(_)) => Relation::Owner,
            (_, Some(_)) => Relation::Participant,
            (_, None) => Relation::Stranger,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scope_is_one_room_or_one_tournament_with_its_rooms() {
        let (room, tournament) = (RoomId::random(), TournamentId::random());
        let scoped = |scope| Caller {
            scope,
            ..Caller::default()
        };
        let everywhere = scoped(None);
        assert!(everywhere.reaches_room(room, None) && everywhere.reaches_tournament(tournament));
        let in_room = scoped(Some(Scope::Room(room)));
        assert!(in_room.reaches_room(room, None) && in_room.reaches_room(room, Some(tournament)));
        assert!(!in_room.reaches_room(RoomId::random(), Some(tournament)));
        assert!(!in_room.reaches_tournament(tournament));
        assert!(!in_room.reaches_tournament(TournamentId::from_bytes(*room.bytes())));
        let in_tournament = scoped(Some(Scope::Tournament(tournament)));
        assert!(in_tournament.reaches_room(room, Some(tournament)));
        assert!(!in_tournament.reaches_room(room, None));
        let other = TournamentId::random();
        assert!(!in_tournament.reaches_room(room, Some(other)));
        assert!(in_tournament.reaches_tournament(tournament));
        assert!(!in_tournament.reaches_tournament(other));
    }
}
