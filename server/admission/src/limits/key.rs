//! Who is charged for what a request takes, and how much of a limit one of them may use.

use std::net::{IpAddr, Ipv6Addr};

use chefshat_room::ids::{StudyId, TournamentId};

use crate::access::{Caller, TokenId};

/// Who is charged. Addresses of one IPv6 network count as one: a client has many of them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Key {
    /// The callers at an address.
    Address(IpAddr),
    /// The callers with a token, wherever they are.
    Token(TokenId),
    /// Callers without an address, such as those of a unix socket.
    Local,
    /// The trusted proxies, which are charged for connections alone: the callers behind them have
    /// addresses of their own.
    Proxies,
    /// A tournament that was resumed: who created it is unknown.
    Tournament(TournamentId),
    /// A study that was resumed: who created it is unknown.
    Study(StudyId),
    /// Rooms that were resumed: who created them is unknown.
    Resumed,
}

impl Key {
    /// The key of an address.
    pub fn of_address(address: Option<IpAddr>) -> Self {
        match address.map(|address| address.to_canonical()) {
            None => Self::Local,
            Some(IpAddr::V6(address)) if !address.is_loopback() => {
                let network = address.to_bits() & !u128::from(u64::MAX);
                Self::Address(Ipv6Addr::from_bits(network).into())
            }
            Some(address) => Self::Address(address),
        }
    }

    /// The key of a caller.
    pub fn of_caller(caller: &Caller) -> Self {
        match caller.token {
            Some(token) => Self::Token(token),
            None => Self::of_address(caller.address),
        }
    }

    /// The key of its site, under which wrong join codes count: a site often has 65,536 networks of
    /// IPv6 (/48).
    pub fn site(self) -> Self {
        match self {
            Self::Address(IpAddr::V6(network)) if !network.is_loopback() => {
                let site = network.to_bits() & (u128::MAX << 80);
                Self::Address(Ipv6Addr::from_bits(site).into())
            }
            key => key,
        }
    }

    /// The site of a network of IPv6, whose networks share what one of them may not have alone.
    pub(super) fn site_of_networks(self) -> Option<Self> {
        let is_network =
            matches!(self, Self::Address(IpAddr::V6(network)) if !network.is_loopback());
        is_network.then(|| self.site())
    }

    /// Whether these callers run on the server's machine, or their work is the server's own.
    fn is_local(self) -> bool {
        match self {
            Self::Address(address) => address.is_loopback(),
            Self::Token(_) | Self::Proxies => false,
            Self::Local | Self::Tournament(_) | Self::Study(_) | Self::Resumed => true,
        }
    }
}

/// Who is charged for a computation: a caller, within the share of the address it calls from. Behind
/// a trusted proxy that is the address of its client.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Payer {
    /// The address, or the caller if it has none.
    pub address: Key,
    /// The caller.
    pub key: Key,
}

impl From<Key> for Payer {
    /// A caller without an address besides its key.
    fn from(key: Key) -> Self {
        Self { address: key, key }
    }
}

impl Payer {
    /// Who is charged for what this caller computes.
    pub fn of_caller(caller: &Caller) -> Self {
        let key = Key::of_caller(caller);
        let address = caller.address.map(|it| Key::of_address(Some(it)));
        Self {
            address: address.unwrap_or(key),
            key,
        }
    }

    /// The address and the caller: one of them if they are the same.
    pub fn keys(self) -> impl Iterator<Item = Key> {
        let Self { address, key } = self;
        std::iter::once(address).chain((key != address).then_some(key))
    }
}

/// How much of each limit one caller may use, percent.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shares {
    /// Callers on the server's machine.
    pub local: u8,
    /// All others.
    pub remote: u8,
}

impl Default for Shares {
    fn default() -> Self {
        Self {
            local: 50,
            remote: 10,
        }
    }
}

impl Shares {
    /// Everything: for what is only shared in turns.
    pub const ALL: Self = Self {
        local: 100,
        remote: 100,
    };

    /// For the tokens of one address, or the networks of one site, together: half, as for the
    /// server's machine, or more.
    pub fn of_addresses(self) -> Self {
        Self {
            remote: self.remote.max(Self::default().local),
            ..self
        }
    }

    /// How much of `total` a caller may use: at least one.
    pub fn of(self, key: Key, total: usize) -> usize {
        let percent = match key {
            Key::Proxies => 100,
            key if key.is_local() => self.local,
            _ => self.remote,
        };
        (total.saturating_mul(percent.into()) / 100).max(1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn key(address: &str) -> Key {
        Key::of_address(Some(address.parse().expect("an address")))
    }

    #[test]
    fn an_ipv6_network_is_one_caller_and_mapped_addresses_are_those_of_ipv4() {
        assert_eq!(key("2001:db8::1"), key("2001:db8::ffff:2"));
        assert_ne!(key("2001:db8::1"), key("2001:db8:0:1::1"));
        assert_eq!(key("::ffff:192.0.2.1"), key("192.0.2.1"));
        assert_ne!(key("192.0.2.1"), key("192.0.2.2"));
        assert_eq!(key("2001:db8::1").site(), key("2001:db8:0:1::1").site());
        assert_ne!(key("2001:db8::1").site(), key("2001:db8:1::1").site());
        assert_eq!(key("192.0.2.1").site(), key("192.0.2.1"));
    }

    #[test]
    fn a_share_is_never_nothing() {
        let shares = Shares::default();
        assert_eq!(shares.of(key("192.0.2.1"), 2), 1);
        assert_eq!(shares.of(key("192.0.2.1"), 10_000), 1_000);
        assert_eq!(shares.of(key("::1"), 10_000), 5_000);
        assert_eq!(shares.of(Key::Local, 8), 4);
    }
}
