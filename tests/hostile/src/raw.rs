//! Connections below gRPC: streams over HTTP/2 with chosen windows, and frames byte by byte.

use std::net::{IpAddr, SocketAddr};
use std::sync::Arc;
use std::time::Duration;

use bytes::{BufMut as _, Bytes, BytesMut};
use h2::client::SendRequest;
use h2::{RecvStream, SendStream};
use http::header::AUTHORIZATION;
use http::{HeaderMap, Method, Request, StatusCode};
use prost::Message;
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tokio::net::{TcpSocket, TcpStream};
use tokio::time::sleep;

use crate::tally::Tally;

/// The connection preface of HTTP/2 with empty settings.
const PREFACE: &[u8] = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n\x00\x00\x00\x04\x00\x00\x00\x00\x00";
/// Bytes that are read and thrown away at a time.
const SINK: usize = 64 * 1024;
/// Frames that are written at a time.
pub(crate) const FRAMES_AT_A_TIME: usize = 512;

/// Opens a connection from one of this machine's addresses.
pub(crate) async fn connect(to: SocketAddr, from: IpAddr) -> std::io::Result<TcpStream> {
    let socket = TcpSocket::new_v4()?;
    socket.set_reuseaddr(true)?;
    socket.bind(SocketAddr::new(from, 0))?;
    let stream = socket.connect(to).await?;
    stream.set_nodelay(true)?;
    Ok(stream)
}

/// A message as gRPC frames it.
pub(crate) fn framed(message: &impl Message) -> Bytes {
    let mut bytes = BytesMut::with_capacity(5 + message.encoded_len());
    bytes.put_u8(0);
    bytes.put_u32(u32::try_from(message.encoded_len()).expect("a small message"));
    message.encode(&mut bytes).expect("the buffer grows");
    bytes.freeze()
}

/// An HTTP/2 connection whose receive windows stay at `window` bytes.
pub(crate) async fn http2(
    to: SocketAddr,
    from: IpAddr,
    window: u32,
) -> std::io::Result<SendRequest<Bytes>> {
    let stream = connect(to, from).await?;
    let (sender, connection) = h2::client::Builder::new()
        .initial_window_size(window)
        .max_concurrent_reset_streams(0)
        .handshake(stream)
        .await
        .map_err(std::io::Error::other)?;
    tokio::spawn(async move {
        // It ends with the server or with the attack.
        let _ = connection.await;
    });
    Ok(sender)
}

/// A stream that is open for as long as this value exists.
pub(crate) struct OpenStream {
    _sending: SendStream<Bytes>,
    receiving: Option<RecvStream>,
}

impl OpenStream {
    /// Reads what arrives, a window a second, until the stream ends.
    pub(crate) async fn read_slowly(mut self) {
        while let Some(receiving) = &mut self.receiving
            && let Some(Ok(bytes)) = receiving.data().await
        {
            sleep(Duration::from_secs(1)).await;
            // It ends with the stream.
            let _ = receiving.flow_control().release_capacity(bytes.len());
        }
    }
}

/// Opens a stream for a method. Sends `body`, if any, and half-closes then; otherwise stays silent.
/// Counts what becomes of it.
pub(crate) async fn open(
    sender: &SendRequest<Bytes>,
    method: &str,
    body: Option<Bytes>,
    tally: &Arc<Tally>,
) -> Option<OpenStream> {
    tally.tried(1);
    let opened = async {
        let mut ready = sender.clone().ready().await?;
        let (response, mut sending) = ready.send_request(grpc(method), false)?;
        if let Some(body) = body {
            sending.send_data(body, true)?;
        }
        let response = response.await?;
        Ok::<_, h2::Error>((response, sending))
    };
    match opened.await {
        Ok((response, sending)) => {
            match refusal(response.headers()) {
                Some(reason) => tally.refusal(&reason),
                None => tally.granted(1),
            }
            Some(OpenStream {
                _sending: sending,
                receiving: Some(response.into_body()),
            })
        }
        Err(error) => {
            reset(&error, tally);
            None
        }
    }
}

/// A request over HTTP/2 with its bytes as they are sent.
#[derive(Debug, Clone)]
pub(crate) struct RawRequest {
    head: Request<()>,
    body: Vec<Bytes>,
}

impl RawRequest {
    /// A call of gRPC with framed messages.
    pub(crate) fn grpc(method: &str, messages: Vec<Bytes>) -> Self {
        Self {
            head: grpc(method),
            body: messages,
        }
    }

    /// A request for a page.
    pub(crate) fn get(path: &str) -> Self {
        let head = Request::get(format!("http://localhost{path}"));
        Self {
            head: head.body(()).expect("a request"),
            body: Vec::new(),
        }
    }

    /// The same with a token.
    pub(crate) fn with_token(mut self, token: &str) -> Self {
        let value = format!("Bearer {token}").parse().expect("a header");
        self.head.headers_mut().insert(AUTHORIZATION, value);
        self
    }
}

fn grpc(method: &str) -> Request<()> {
    Request::builder()
        .method(Method::POST)
        .uri(format!("http://localhost/chefshat.v1.{method}"))
        .header("content-type", "application/grpc")
        .header("te", "trailers")
        .body(())
        .expect("a request")
}

/// Sends a request, reads the whole answer and counts what became of it. Returns whether the
/// connection can still be used.
pub(crate) async fn call(sender: &SendRequest<Bytes>, request: RawRequest, tally: &Tally) -> bool {
    tally.tried(1);
    let answered = async {
        let mut ready = sender.clone().ready().await?;
        let last = request.body.len();
        let (response, mut sending) = ready.send_request(request.head, last == 0)?;
        for (number, part) in (1..).zip(request.body) {
            // A server that refuses a call early does not read the rest of it.
            if sending.send_data(part, number == last).is_err() {
                break;
            }
        }
        let (head, mut body) = response.await?.into_parts();
        while let Some(part) = body.data().await {
            body.flow_control().release_capacity(part?.len())?;
        }
        let trailers = body.trailers().await?.unwrap_or_default();
        Ok::<_, h2::Error>(match head.status {
            StatusCode::OK => refusal(&head.headers).or_else(|| refusal(&trailers)),
            status => Some(format!("HTTP {}", status.as_u16())),
        })
    };
    match answered.await {
        Ok(None) => tally.granted(1),
        Ok(Some(reason)) => tally.refusal(&reason),
        Err(error) => return reset(&error, tally),
    }
    true
}

/// Counts the end of a stream without an answer. Returns whether the connection is still there.
fn reset(error: &h2::Error, tally: &Tally) -> bool {
    match (error.reason()).filter(|_| error.is_reset() && error.is_remote()) {
        Some(reason) => {
            tally.refusal(reason.description());
            true
        }
        None => {
            tally.lost();
            false
        }
    }
}

/// The reason of a response that only refuses.
fn refusal(headers: &HeaderMap) -> Option<String> {
    let code = headers.get("grpc-status")?.to_str().ok()?;
    if code == "0" {
        return None;
    }
    let status = tonic::Status::from_header_map(headers)?;
    use tonic_types::StatusExt as _;
    Some(
        (status.get_details_error_info())
            .map_or_else(|| status.code().to_string(), |info| info.reason),
    )
}

/// A frame of HTTP/2.
pub(crate) fn frame(kind: u8, flags: u8, stream: u32, payload: &[u8]) -> Vec<u8> {
    let length = u32::try_from(payload.len())
        .expect("a short payload")
        .to_be_bytes();
    let mut bytes = length[1..].to_vec();
    bytes.extend([kind, flags]);
    bytes.extend(stream.to_be_bytes());
    bytes.extend(payload);
    bytes
}

/// Writes frames as fast as the server takes them, and throws away what it sends. `next` makes the
/// n-th frame. Returns when the server ends the connection.
pub(crate) async fn flood(
    to: SocketAddr,
    from: IpAddr,
    tally: &Tally,
    mut next: impl FnMut(u32) -> Vec<u8>,
) {
    let Ok(stream) = connect(to, from).await else {
        return tally.lost();
    };
    let (mut reading, mut writing) = stream.into_split();
    let sink = async {
        let mut buffer = vec![0; SINK];
        while reading.read(&mut buffer).await.is_ok_and(|count| count > 0) {}
    };
    let writing = async {
        writing.write_all(PREFACE).await?;
        let mut number = 0;
        loop {
            let mut bytes = Vec::new();
            for _ in 0..FRAMES_AT_A_TIME {
                bytes.extend(next(number));
                number += 1;
            }
            tally.tried(FRAMES_AT_A_TIME as u64);
            writing.write_all(&bytes).await?;
            tally.granted(FRAMES_AT_A_TIME as u64);
        }
    };
    let ended: Result<(), std::io::Error> = tokio::select! {
        ended = writing => ended,
        () = sink => Ok(()),
    };
    // The server ended it: that is how such a flood is refused.
    drop(ended);
    tally.refusal("CONNECTION_CLOSED");
}
