//! The addresses of clients behind proxies. A layer in front of all others notes the client that a
//! trusted proxy names in `x-forwarded-for`; [`peer_address`] then gives that client's address
//! instead of the proxy's. What others write there counts for nothing.

use http::Request;
use tower::util::MapRequestLayer;

use crate::connections::{ForwardedClient, peer_address};
use chefshat_base::proxies::TrustedProxies;

/// Notes the clients that these proxies name.
pub fn note_clients<B>(
    trusted: TrustedProxies,
) -> MapRequestLayer<impl Fn(Request<B>) -> Request<B> + Clone + Send> {
    MapRequestLayer::new(move |mut request: Request<B>| {
        let by_proxy = trusted.contains(peer_address(request.extensions()));
        if by_proxy && let Some(client) = trusted.client(request.headers()) {
            request.extensions_mut().insert(ForwardedClient(client));
        }
        request
    })
}

#[cfg(test)]
mod tests {
    use std::convert::Infallible;
    use std::net::SocketAddr;

    use futures::FutureExt as _;
    use tonic::transport::server::TcpConnectInfo;
    use tower::{Service as _, ServiceBuilder, service_fn};

    use super::*;
    use chefshat_base::proxies::{FORWARDED_FOR, TrustedProxy};

    /// The address that the services see for a request of `peer`, an address or a unix socket, with
    /// these headers.
    fn seen(trusted: &[&str], peer: &str, headers: &[&str]) -> String {
        let trusted = trusted.iter().map(|text| text.parse().expect("a proxy"));
        let layer = note_clients(TrustedProxies::new(trusted));
        let mut services = ServiceBuilder::new().layer(layer).service(service_fn(
            |request: Request<()>| async move {
                Ok::<_, Infallible>(peer_address(request.extensions()))
            },
        ));
        let mut request = Request::new(());
        for line in headers {
            let line = line.parse().unwrap();
            request.headers_mut().append(FORWARDED_FOR, line);
        }
        if peer != "unix" {
            request.extensions_mut().insert(TcpConnectInfo {
                local_addr: None,
                remote_addr: Some(SocketAddr::new(peer.parse().unwrap(), 1)),
            });
        }
        let answer = services.call(request).now_or_never().expect("ready");
        let address = answer.expect("infallible");
        address.map_or("unix".to_owned(), |address| address.to_string())
    }

    #[test]
    fn only_trusted_proxies_name_their_clients() {
        for (peer, headers, client) in [
            ("10.1.2.3", &["198.51.100.4"][..], "198.51.100.4"),
            ("::ffff:10.1.2.3", &["198.51.100.4"], "198.51.100.4"),
            ("192.0.2.7", &["198.51.100.4:5000"], "198.51.100.4"),
            ("fd00::1", &["[2001:db8::1]:5000"], "2001:db8::1"),
            // What the client wrote itself comes before what the proxy added.
            ("10.1.2.3", &["1.1.1.1, 198.51.100.4"], "198.51.100.4"),
            ("10.1.2.3", &["1.1.1.1", "198.51.100.4"], "198.51.100.4"),
            (
                "10.1.2.3",
                &["1.1.1.1, 198.51.100.4, 10.9.9.9"],
                "198.51.100.4",
            ),
            ("10.1.2.3", &["unknown, 10.9.9.9"], "10.9.9.9"),
            ("10.1.2.3", &["1.1.1.1, nonsense"], "10.1.2.3"),
            ("10.1.2.3", &[], "10.1.2.3"),
            // A stranger.
            ("198.51.100.9", &["10.0.0.1"], "198.51.100.9"),
            ("192.0.2.8", &["1.1.1.1"], "192.0.2.8"),
            ("unix", &["1.1.1.1"], "unix"),
        ] {
            let trusted = ["10.0.0.0/8", "192.0.2.7", "fd00::/8"];
            let seen = seen(&trusted, peer, headers);
            assert_eq!(seen, client, "{peer} {headers:?}");
        }
        assert_eq!(seen(&["unix"], "unix", &["1.1.1.1"]), "1.1.1.1");
        for mapped in ["::ffff:10.1.2.3", "::ffff:10.0.0.0/104"] {
            assert_eq!(seen(&[mapped], "10.1.2.3", &["1.1.1.1"]), "1.1.1.1");
            assert_eq!(seen(&[mapped], "11.1.2.3", &["1.1.1.1"]), "11.1.2.3");
        }
        assert_eq!(seen(&["unix"], "127.0.0.1", &["1.1.1.1"]), "127.0.0.1");
    }

    #[test]
    fn a_proxy_is_an_address_a_network_or_the_unix_socket() {
        for good in ["127.0.0.1", "10.0.0.0/8", "::1", "fd00::/8", "unix"] {
            assert!(good.parse::<TrustedProxy>().is_ok(), "{good}");
        }
        for bad in ["", "localhost", "10.0.0.0/33", "10.0.0", "*"] {
            assert!(bad.parse::<TrustedProxy>().is_err(), "{bad}");
        }
    }
}
