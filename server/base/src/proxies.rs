//! The proxies that are trusted to name their clients: their networks, and what they say. The layer
//! that asks them is in `forwarded`.

use std::net::IpAddr;
use std::str::FromStr;
use std::sync::Arc;

use http::HeaderMap;
pub use ipnet::IpNet;

/// The header in which proxies list the addresses they forward for, the nearest last.
pub const FORWARDED_FOR: &str = "x-forwarded-for";

/// Where a proxy connects from that is trusted to name its clients.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TrustedProxy {
    /// An address in this network.
    Network(IpNet),
    /// The unix socket of the server.
    UnixSocket,
}

/// The proxies that are trusted to name their clients.
#[derive(Debug, Clone, Default)]
pub struct TrustedProxies(Arc<[TrustedProxy]>);

impl TrustedProxies {
    /// Trusts these proxies.
    pub fn new(proxies: impl IntoIterator<Item = TrustedProxy>) -> Self {
        Self(proxies.into_iter().collect())
    }

    /// Whether this is the address of a trusted proxy; `None` is that of all peers at a unix socket.
    pub fn contains(&self, address: Option<IpAddr>) -> bool {
        let address = address.map(|address| address.to_canonical());
        self.0.iter().any(|proxy| match (proxy, address) {
            (TrustedProxy::Network(network), Some(address)) => network.contains(&address),
            (TrustedProxy::UnixSocket, None) => true,
            _ => false,
        })
    }

    /// The client for which trusted proxies forward: the last address that is not theirs. Stops at
    /// what is no address: only what trusted proxies wrote counts.
    pub fn client(&self, headers: &HeaderMap) -> Option<IpAddr> {
        let lines = headers.get_all(FORWARDED_FOR).iter().rev();
        let mut nearest = None;
        for entry in lines.flat_map(|line| line.as_bytes().rsplit(|&byte| byte == b',')) {
            let Some(address) = parse(entry) else {
                return nearest;
            };
            nearest = Some(address);
            if !self.contains(Some(address)) {
                return nearest;
            }
        }
        nearest
    }
}

/// An address, with or without a port.
fn parse(entry: &[u8]) -> Option<IpAddr> {
    let text = str::from_utf8(entry).ok()?.trim();
    let socket = || std::net::SocketAddr::from_str(text).map(|socket| socket.ip());
    let address = IpAddr::from_str(text).or_else(|_| socket()).ok()?;
    Some(address.to_canonical())
}

/// A network of addresses of IPv4 that are written as those of IPv6, as one of IPv4: so are the
/// addresses that are looked for in it.
fn canonical(network: IpNet) -> IpNet {
    let mapped = match (network.addr().to_canonical(), network.prefix_len()) {
        (address @ IpAddr::V4(_), length @ 96..) => IpNet::new(address, length - 96).ok(),
        _ => None,
    };
    mapped.unwrap_or(network)
}

impl FromStr for TrustedProxy {
    type Err = String;

    /// Reads an address, a network such as 10.0.0.0/8, or `unix`.
    fn from_str(text: &str) -> Result<Self, String> {
        if text == "unix" {
            return Ok(Self::UnixSocket);
        }
        let single = || IpAddr::from_str(text).map(IpNet::from);
        let network = text.parse().or_else(|_| single());
        network.map(canonical).map(Self::Network).map_err(|_| {
            "use an address or a network, for example 127.0.0.1 or 10.0.0.0/8, or unix for the server's unix socket"
                .to_owned()
        })
    }
}
