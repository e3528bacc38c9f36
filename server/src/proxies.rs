//! The proxies that are trusted to name their clients: their networks, and what they say. The layer
//! that asks them is in `forwarded`.

use std::net::IpAddr;
use std::str::FromStr;
use std::sync::Arc;

use http::HeaderMap;
pub use ipnet::IpNet;

/// The header in which proxies list the addresses they forward for, the nearest last.
pub(crate) const FORWARDED_FOR: &str = "x-forwarded-for";

/// The networks of the proxies that are trusted to name their clients.
#[derive(Debug, Clone, Default)]
pub struct TrustedProxies(Arc<[IpNet]>);

impl TrustedProxies {
    /// Trusts the proxies in these networks.
    pub fn new(networks: impl IntoIterator<Item = IpNet>) -> Self {
        Self(networks.into_iter().collect())
    }

    /// Whether this is the address of a trusted proxy.
    pub fn contains(&self, address: IpAddr) -> bool {
        let address = address.to_canonical();
        self.0.iter().any(|network| network.contains(&address))
    }

    /// The client for which trusted proxies forward: the last address that is not theirs. Stops at
    /// what is no address: only what trusted proxies wrote counts.
    pub(crate) fn client(&self, headers: &HeaderMap) -> Option<IpAddr> {
        let lines = headers.get_all(FORWARDED_FOR).iter().rev();
        let mut nearest = None;
        for entry in lines.flat_map(|line| line.as_bytes().rsplit(|&byte| byte == b',')) {
            let Some(address) = parse(entry) else {
                return nearest;
            };
            nearest = Some(address);
            if !self.contains(address) {
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

/// A network, such as 10.0.0.0/8, or a single address.
///
/// # Errors
/// The text is neither.
pub fn network(text: &str) -> Result<IpNet, String> {
    let single = || IpAddr::from_str(text).map(IpNet::from);
    text.parse()
        .or_else(|_| single())
        .map_err(|_| "use an address or a network, for example 127.0.0.1 or 10.0.0.0/8".to_owned())
}
