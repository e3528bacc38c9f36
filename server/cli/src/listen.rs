//! The socket of a server: on an address and port, on a unix socket, or one that systemd opened
//! (socket activation), which takes precedence.

use std::fmt;
use std::io;
use std::net::SocketAddr;
#[cfg(unix)]
use std::path::Path;
use std::path::PathBuf;

use chefshat_server::connections::Listener;
use listenfd::ListenFd;
use tokio::net::TcpListener;
#[cfg(unix)]
use tokio::net::UnixListener;

use crate::error::CommandError;

/// Prefix of the path of a unix socket.
const UNIX: &str = "unix:";

/// Where a server listens.
#[derive(Debug, Clone)]
pub(super) enum Address {
    /// On an address and port.
    Ip(SocketAddr),
    /// On a unix socket.
    #[cfg_attr(not(unix), expect(dead_code, reason = "there are none"))]
    Unix(PathBuf),
}

impl Address {
    /// Whether only programs of this machine can connect.
    pub(super) fn is_local(&self) -> bool {
        self.is_loopback() || matches!(self, Self::Unix(_))
    }

    /// Whether browsers of this machine can connect, and only they.
    pub(super) fn is_loopback(&self) -> bool {
        matches!(self, Self::Ip(address) if address.ip().is_loopback())
    }

    /// Its URL, or what stands for it.
    pub(super) fn url(&self, scheme: &str) -> String {
        match self {
            Self::Ip(address) => format!("{scheme}://{address}"),
            Self::Unix(_) => self.to_string(),
        }
    }
}

impl fmt::Display for Address {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Ip(address) => write!(formatter, "{address}"),
            Self::Unix(path) => write!(formatter, "{UNIX}{}", path.display()),
        }
    }
}

/// The socket that systemd opened, or else a new one on the address of `--listen`.
///
/// # Errors
/// The address is in use or not of this machine, or systemd passed something else.
pub(super) async fn listen(address: &str) -> Result<(Listener, Address), CommandError> {
    let mut passed = ListenFd::from_env();
    match passed.len() {
        0 => {}
        1 => return activated(&mut passed).map_err(|error| {
            format!("the socket that systemd passes cannot be used: {error}; use ListenStream with one address").into()
        }),
        count => return Err(format!("systemd passes {count} sockets; use one ListenStream").into()),
    }
    let Some(path) = address.strip_prefix(UNIX) else {
        let listener = tcp(address, "--listen").await?;
        let address = Address::Ip(listener.local_addr()?);
        return Ok((listener.into(), address));
    };
    #[cfg(unix)]
    {
        let path = Path::new(path);
        let listener = unix(path).map_err(|error| {
            format!("cannot listen on {address}: {error}; choose another path with --listen")
        })?;
        Ok((listener.into(), Address::Unix(path.to_owned())))
    }
    #[cfg(not(unix))]
    {
        let system = std::env::consts::OS;
        Err(format!(
            "cannot listen on the unix socket {path} on {system}; use HOST:PORT with --listen"
        )
        .into())
    }
}

/// A socket on an address and port. `flag`: its setting, for errors.
///
/// # Errors
/// The address is in use or not of this machine.
pub(super) async fn tcp(address: &str, flag: &str) -> Result<TcpListener, CommandError> {
    let listener = TcpListener::bind(address).await.map_err(|error| {
        format!("cannot listen on {address}: {error}; choose another address with {flag}")
    })?;
    Ok(listener)
}

/// Takes the socket that systemd opened.
fn activated(passed: &mut ListenFd) -> io::Result<(Listener, Address)> {
    if let Ok(Some(listener)) = passed.take_tcp_listener(0) {
        listener.set_nonblocking(true)?;
        let address = Address::Ip(listener.local_addr()?);
        return Ok((TcpListener::from_std(listener)?.into(), address));
    }
    #[cfg(unix)]
    {
        let listener = passed.take_unix_listener(0)?;
        let listener = listener.expect("the only socket was not taken before");
        listener.set_nonblocking(true)?;
        let path = listener.local_addr()?.as_pathname().map(Path::to_owned);
        let listener = UnixListener::from_std(listener)?;
        Ok((listener.into(), Address::Unix(path.unwrap_or_default())))
    }
    #[cfg(not(unix))]
    Err(io::Error::other("it is not a TCP socket"))
}

/// Listens on a path. Removes the socket of a server that has died.
#[cfg(unix)]
fn unix(path: &Path) -> io::Result<UnixListener> {
    match UnixListener::bind(path) {
        Err(error) if error.kind() == io::ErrorKind::AddrInUse && is_dead(path) => {
            std::fs::remove_file(path)?;
            UnixListener::bind(path)
        }
        bound => bound,
    }
}

#[cfg(unix)]
fn is_dead(path: &Path) -> bool {
    let connected = std::os::unix::net::UnixStream::connect(path);
    connected.is_err_and(|error| error.kind() == io::ErrorKind::ConnectionRefused)
}

/// Checks the form of the address of a listener: a unix socket, or host and port.
pub(super) fn address(text: &str) -> Result<String, String> {
    match text.strip_prefix(UNIX) {
        Some("") => Err("add a path, for example unix:/run/chefshat/chefshat.sock".to_owned()),
        Some(_) => Ok(text.to_owned()),
        None => host_and_port(text),
    }
}

/// Checks the form of an address; the host is resolved later.
pub(super) fn host_and_port(text: &str) -> Result<String, String> {
    let is_complete = |(host, port): (&str, &str)| !host.is_empty() && port.parse::<u16>().is_ok();
    match text.rsplit_once(':').is_some_and(is_complete) {
        true => Ok(text.to_owned()),
        false => Err("use IP:PORT or HOST:PORT, for example 127.0.0.1:50051".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_have_a_host_and_a_port_or_a_path() {
        for good in ["127.0.0.1:0", "localhost:50051", "[::1]:50051", "unix:a"] {
            assert_eq!(address(good).as_deref(), Ok(good));
        }
        for bad in [
            "",
            "50051",
            ":50051",
            "localhost",
            "localhost:http",
            "localhost:70000",
            "unix:",
        ] {
            assert!(address(bad).is_err(), "{bad}");
        }
        assert!(host_and_port("unix:a").is_err());
    }
}
