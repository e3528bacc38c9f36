//! A receiver of webhooks that refuses what is about some rooms, and remembers the others.

use std::collections::HashSet;
use std::convert::Infallible;
use std::net::{Ipv4Addr, SocketAddr};
use std::sync::{Arc, Mutex};

use bytes::Bytes;
use http::{Request, Response, StatusCode};
use http_body_util::{BodyExt as _, Empty};
use hyper::body::Incoming;
use hyper::server::conn::http1;
use hyper::service::service_fn;
use hyper_util::rt::TokioIo;
use serde_json::Value;
use tokio::net::TcpListener;
use tokio_util::task::AbortOnDropHandle;

use crate::error::HostileError;

/// Rooms with this name are those whose events the receiver refuses.
pub(crate) const REFUSED: &str = "refused";

/// Ids of rooms of which the receiver has heard.
#[derive(Debug, Clone, Default)]
pub(crate) struct Announced(Arc<Mutex<HashSet<String>>>);

impl Announced {
    /// Whether an event of this room has arrived.
    pub(crate) fn has(&self, room_id: &str) -> bool {
        let rooms = self.0.lock().expect("nothing panics under this lock");
        rooms.contains(room_id)
    }

    /// Answers a webhook.
    async fn receive(&self, request: Request<Incoming>) -> StatusCode {
        let Ok(body) = request.into_body().collect().await else {
            return StatusCode::BAD_REQUEST;
        };
        let event: Value = serde_json::from_slice(&body.to_bytes()).unwrap_or_default();
        if event["data"]["name"] == REFUSED {
            return StatusCode::BAD_REQUEST;
        }
        if let Some(room_id) = event["data"]["room_id"].as_str() {
            let mut rooms = self.0.lock().expect("nothing panics under this lock");
            rooms.insert(room_id.to_owned());
        }
        StatusCode::NO_CONTENT
    }
}

/// The receiver, until it is dropped.
pub(crate) struct Receiver {
    address: SocketAddr,
    /// What it has received.
    pub(crate) announced: Announced,
    _accepting: AbortOnDropHandle<()>,
}

impl Receiver {
    /// Starts it on a free port.
    ///
    /// # Errors
    /// There is none.
    pub(crate) async fn start() -> Result<Self, HostileError> {
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).await;
        let listener = listener.map_err(HostileError::io("listening for webhooks"))?;
        let address = (listener.local_addr()).map_err(HostileError::io("listening"))?;
        let announced = Announced::default();
        let accepting = tokio::spawn(accept(listener, announced.clone()));
        Ok(Self {
            address,
            announced,
            _accepting: AbortOnDropHandle::new(accepting),
        })
    }

    /// Its URL.
    pub(crate) fn url(&self) -> String {
        format!("http://{}/", self.address)
    }
}

async fn accept(listener: TcpListener, announced: Announced) {
    while let Ok((stream, _)) = listener.accept().await {
        let announced = announced.clone();
        let service = service_fn(move |request| {
            let announced = announced.clone();
            async move {
                let mut response = Response::new(Empty::<Bytes>::new());
                *response.status_mut() = announced.receive(request).await;
                Ok::<_, Infallible>(response)
            }
        });
        // It ends with the connection or with this process.
        tokio::spawn(http1::Builder::new().serve_connection(TokioIo::new(stream), service));
    }
}
