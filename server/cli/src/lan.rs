//! How browsers of the local network reach a server that listens on every address of its machine:
//! the machine's own addresses, as text and as a QR code.

use std::io::{self, IsTerminal as _, Write as _};
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr, UdpSocket};
use std::path::Path;

use anstyle::{Ansi256Color, Style};
use qrcode::QrCode;
use qrcode::render::unicode::Dense1x2;

use super::error::tell;

/// Addresses for documentation (RFC 5737, RFC 3849): the route to them is the route to the internet.
const FAR_AWAY: [IpAddr; 2] = [
    IpAddr::V4(Ipv4Addr::new(192, 0, 2, 1)),
    IpAddr::V6(Ipv6Addr::new(0x2001, 0xdb8, 0, 0, 0, 0, 0, 1)),
];
const ANY_PORT: u16 = 9;
/// Files that Docker and Podman put into a container.
const IN_CONTAINERS: [&str; 2] = ["/.dockerenv", "/run/.containerenv"];
/// A variable that Kubernetes sets in a container.
const IN_PODS: &str = "KUBERNETES_SERVICE_HOST";
/// White on black, which a terminal's theme does not change: a QR code needs both.
const WHITE_ON_BLACK: Style = Style::new()
    .fg_color(Some(anstyle::Color::Ansi256(Ansi256Color(231))))
    .bg_color(Some(anstyle::Color::Ansi256(Ansi256Color(16))));

/// Prints where a browser of the network finds the page, if the server listens on every address of
/// the machine; with a QR code if a person sees it. A container does not know the addresses at
/// which its machine is reached.
pub(super) fn print_addresses(listening_on: SocketAddr, scheme: &str) {
    if !listening_on.ip().is_unspecified() || is_container() {
        return;
    }
    let urls = urls(listening_on, scheme, &own_addresses());
    for url in &urls {
        tell(format_args!("in a browser of this network: {url}"));
    }
    if let Some(code) = (urls.first()).and_then(|url| qr_code(url))
        && io::stderr().is_terminal()
    {
        // Its colours are for the terminal.
        let _ = writeln!(anstream::stderr().lock(), "{code}");
    }
}

fn is_container() -> bool {
    IN_CONTAINERS.iter().any(|file| Path::new(file).exists()) || std::env::var_os(IN_PODS).is_some()
}

/// The addresses of this machine on the way to the internet. None without a route there.
fn own_addresses() -> Vec<IpAddr> {
    let own = FAR_AWAY.iter().filter_map(|far| {
        let any = match far {
            IpAddr::V4(_) => IpAddr::V4(Ipv4Addr::UNSPECIFIED),
            IpAddr::V6(_) => IpAddr::V6(Ipv6Addr::UNSPECIFIED),
        };
        let socket = UdpSocket::bind((any, 0)).ok()?;
        // Chooses a route, and sends nothing.
        socket.connect((*far, ANY_PORT)).ok()?;
        Some(socket.local_addr().ok()?.ip())
    });
    own.filter(|own| !own.is_loopback() && !own.is_unspecified())
        .collect()
}

/// The URLs of a server at the addresses of its machine. A socket for IPv6 accepts IPv4, too.
fn urls(listening_on: SocketAddr, scheme: &str, own: &[IpAddr]) -> Vec<String> {
    let reached = own
        .iter()
        .filter(|own| own.is_ipv4() || listening_on.is_ipv6());
    let port = listening_on.port();
    reached
        .map(|own| format!("{scheme}://{}", SocketAddr::new(*own, port)))
        .collect()
}

/// A QR code in characters of half a line, white on black. `None` if the text is too long.
fn qr_code(text: &str) -> Option<String> {
    let code = QrCode::new(text).ok()?;
    let mut image = code.render::<Dense1x2>();
    // What is drawn is the light part of the code.
    image.dark_color(Dense1x2::Light);
    image.light_color(Dense1x2::Dark);
    let image = image.build();
    let lines = image.lines();
    let coloured = lines.map(|line| format!("{WHITE_ON_BLACK}{line}{WHITE_ON_BLACK:#}"));
    Some(coloured.collect::<Vec<_>>().join("\n"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_browser_gets_addresses_that_it_can_open() {
        let own = ["192.168.1.5", "fd00::5"].map(|own| own.parse().expect("an address"));
        let urls = |listening_on: &str| {
            let listening_on = listening_on.parse().expect("an address and port");
            urls(listening_on, "http", &own)
        };
        assert_eq!(urls("0.0.0.0:7"), ["http://192.168.1.5:7"]);
        assert_eq!(
            urls("[::]:7"),
            ["http://192.168.1.5:7", "http://[fd00::5]:7"]
        );
        for own in own_addresses() {
            assert!(!own.is_unspecified() && !own.is_loopback(), "{own}");
        }
    }

    #[test]
    fn the_qr_code_is_a_square_with_a_margin() {
        let code = qr_code("http://192.168.1.5:50051").expect("a short text");
        let (colours, reset) = ("\u{1b}[38;5;231m\u{1b}[48;5;16m", "\u{1b}[0m");
        let cells = |line| str::strip_prefix(line, colours)?.strip_suffix(reset);
        let lines: Option<Vec<&str>> = code.lines().map(cells).collect();
        let lines = lines.expect("every line sets both colours");
        let columns = lines[0].chars().count();
        assert_eq!(lines.len(), columns.div_ceil(2), "\n{code}");
        assert!(lines.iter().all(|line| line.chars().count() == columns));
        // The margin is light, and drawn.
        assert!(lines[0].chars().all(|cell| cell == '█'), "\n{code}");
    }
}
