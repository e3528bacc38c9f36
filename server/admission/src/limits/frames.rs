//! Drops connections whose protocol stays unknown, and slows down those that send frames of HTTP/2
//! which cost work and carry nothing: PING, SETTINGS, PRIORITY, RST_STREAM and frames of unknown
//! types. The transport answers them without limit. Requests and data are not slowed down here.
//! Drops connections of HTTP/1.1 with headers that are too long: there, the transport has no setting
//! for it.

use std::io;
use std::pin::Pin;
use std::task::{Context, Poll, ready};
use std::time::Duration;

use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::time::{Instant, Sleep};
use tonic::transport::server::Connected;

/// Largest headers of a request, bytes.
pub const MAX_HEADER_BYTES: u32 = 16 * 1024;
/// Most headers of a request of HTTP/1.1: the transport refuses more.
const MAX_HEADERS: usize = 100;
/// Control frames that a connection may send in a second.
pub const PER_SECOND: u32 = 1_000;
/// Control frames that it may send at once.
pub const BURST: u32 = 4_000;
/// Window updates that cost as much as one control frame. A client sends about one for each
/// message that it reads.
const WINDOW_UPDATES: u32 = 20;
/// What clients of HTTP/2 send first.
const PREFACE: &[u8] = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n";
/// Bytes after which the protocol of a connection is known: the preface of HTTP/2 and the header of
/// its first frame. No request of HTTP/1.1 is shorter, and its headers have a time limit, too.
const FIRST_BYTES: usize = PREFACE.len() + HEADER;
/// Bytes of the header of a frame.
const HEADER: usize = 9;

/// A connection whose first bytes must come in time, and whose control frames are counted.
#[derive(Debug)]
pub struct Metered<S> {
    stream: S,
    unknown: Option<Unknown>,
    position: Position,
    /// When the allowance is full again.
    full_at: Option<Instant>,
    pause: Option<Pin<Box<Sleep>>>,
}

/// The state of a connection whose protocol is not yet known.
#[derive(Debug)]
struct Unknown {
    bytes: usize,
    until: Pin<Box<Sleep>>,
}

/// Where the bytes of a connection are.
#[derive(Debug)]
enum Position {
    /// In the preface, of which this many bytes were read.
    Preface(usize),
    /// In frames: the header of the next one, as far as it was read, and bytes before it.
    Frames {
        header: [u8; HEADER],
        read: usize,
        skip: usize,
    },
    /// In requests of HTTP/1.1.
    Http1(Http1),
    /// Not read: a connection of a trusted peer.
    Other,
}

impl Position {
    /// Reads bytes; returns the cost of the frames that begin in them, in window updates, or `None` if
    /// the headers of a request are too long.
    fn advance(&mut self, mut bytes: &[u8]) -> Option<u32> {
        if let Self::Preface(read) = self {
            let length = bytes.len().min(PREFACE.len() - *read);
            if bytes[..length] != PREFACE[*read..*read + length] {
                *self = Self::Http1(Http1 {
                    read: PREFACE[..*read].to_vec(),
                    ..Http1::default()
                });
                return self.advance(bytes);
            }
            *read += length;
            bytes = &bytes[length..];
            if *read == PREFACE.len() {
                *self = Self::Frames {
                    header: [0; HEADER],
                    read: 0,
                    skip: 0,
                };
            }
        }
        let (header, read, skip) = match self {
            Self::Frames { header, read, skip } => (header, read, skip),
            Self::Http1(requests) => {
                return requests.advance(bytes).then_some(0);
            }
            Self::Preface(_) | Self::Other => return Some(0),
        };
        let mut cost = 0;
        while !bytes.is_empty() {
            let skipped = bytes.len().min(*skip);
            *skip -= skipped;
            bytes = &bytes[skipped..];
            let length = bytes.len().min(HEADER - *read);
            header[*read..*read + length].copy_from_slice(&bytes[..length]);
            *read += length;
            bytes = &bytes[length..];
            if *read == HEADER {
                *read = 0;
                *skip = usize::from(header[0]) << 16
                    | usize::from(header[1]) << 8
                    | usize::from(header[2]);
                cost += match header[3] {
                    // DATA, HEADERS, CONTINUATION: the services and the transport limit them.
                    0 | 1 | 9 => 0,
                    8 => 1,
                    _ => WINDOW_UPDATES,
                };
            }
        }
        Some(cost)
    }
}

/// Where the bytes of a connection of HTTP/1.1 are.
#[derive(Debug, Default)]
struct Http1 {
    part: Part,
    /// What was read of it.
    read: Vec<u8>,
    /// Bytes of a body before it.
    skip: u64,
}

/// A part of a request that ends with a line.
#[derive(Debug, Default, Clone, Copy)]
enum Part {
    /// The first line and the headers.
    #[default]
    Head,
    /// The size of a chunk of its body.
    ChunkSize,
    /// The empty line after a chunk.
    ChunkEnd,
    /// The headers after the last chunk.
    Trailers,
}

impl Http1 {
    /// Reads bytes; returns whether the headers in them are short enough.
    fn advance(&mut self, mut bytes: &[u8]) -> bool {
        while !bytes.is_empty() {
            let skipped = usize::try_from(self.skip).map_or(bytes.len(), |it| it.min(bytes.len()));
            self.skip -= skipped as u64;
            bytes = &bytes[skipped..];
            let line = bytes.iter().position(|byte| *byte == b'\n');
            let length = line.map_or(bytes.len(), |end| end + 1);
            if self.read.len() + length > MAX_HEADER_BYTES as usize {
                return false;
            }
            self.read.extend_from_slice(&bytes[..length]);
            bytes = &bytes[length..];
            if line.is_some() {
                self.end_line();
            }
        }
        true
    }

    /// Ends a line. After one that it refuses, the transport answers and reads no further request.
    fn end_line(&mut self) {
        let is_end = [&b"\n\n"[..], b"\n\r\n"]
            .iter()
            .any(|end| self.read.ends_with(end));
        let is_empty = matches!(&self.read[..], b"\n" | b"\r\n");
        self.part = match self.part {
            // Before a request.
            Part::Head if is_empty => Part::Head,
            Part::Head if !is_end => return,
            Part::Head => {
                // As the transport reads them.
                let mut headers = [httparse::EMPTY_HEADER; MAX_HEADERS];
                let mut request = httparse::Request::new(&mut headers);
                let _ = request.parse(&self.read);
                let named = |name: &str| {
                    let named = |it: &&httparse::Header<'_>| it.name.eq_ignore_ascii_case(name);
                    request.headers.iter().find(named).map(|it| it.value)
                };
                let length = named("content-length").and_then(|it| std::str::from_utf8(it).ok());
                match named("transfer-encoding") {
                    Some(_) => Part::ChunkSize,
                    None => {
                        self.skip = length.and_then(|it| it.parse().ok()).unwrap_or(0);
                        Part::Head
                    }
                }
            }
            Part::ChunkSize => match httparse::parse_chunk_size(&self.read) {
                Ok(httparse::Status::Complete((_, 0))) => Part::Trailers,
                Ok(httparse::Status::Complete((_, size))) => {
                    self.skip = size;
                    Part::ChunkEnd
                }
                _ => Part::Head,
            },
            Part::ChunkEnd => Part::ChunkSize,
            Part::Trailers if is_empty || is_end => Part::Head,
            Part::Trailers => return,
        };
        self.read.clear();
    }
}

impl<S> Metered<S> {
    /// Watches a connection from its start on. Its protocol must be known in time.
    pub fn new(stream: S, first_bytes_timeout: Duration) -> Self {
        Self {
            stream,
            unknown: Some(Unknown {
                bytes: 0,
                until: Box::pin(tokio::time::sleep(first_bytes_timeout)),
            }),
            position: Position::Preface(0),
            full_at: None,
            pause: None,
        }
    }

    /// Watches a connection of a trusted peer, whose frames have no limit once its protocol is known.
    pub fn of_trusted(stream: S, first_bytes_timeout: Duration) -> Self {
        Self {
            position: Position::Other,
            ..Self::new(stream, first_bytes_timeout)
        }
    }

    fn charge(&mut self, cost: u32) {
        let unit = Duration::from_secs(1) / (PER_SECOND * WINDOW_UPDATES);
        let now = Instant::now();
        let full_at = self.full_at.map_or(now, |at| at.max(now)) + unit * cost;
        self.full_at = Some(full_at);
        let most = unit * (BURST * WINDOW_UPDATES);
        let wait = full_at.duration_since(now).saturating_sub(most);
        if !wait.is_zero() {
            self.pause = Some(Box::pin(tokio::time::sleep(wait)));
        }
    }
}

impl<S: Connected> Connected for Metered<S> {
    type ConnectInfo = S::ConnectInfo;

    fn connect_info(&self) -> Self::ConnectInfo {
        self.stream.connect_info()
    }
}

impl<S: AsyncRead + Unpin> AsyncRead for Metered<S> {
    fn poll_read(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        if let Some(pause) = &mut self.pause {
            ready!(pause.as_mut().poll(context));
            self.pause = None;
        }
        let before = buffer.filled().len();
        let this = &mut *self;
        let read = Pin::new(&mut this.stream).poll_read(context, buffer);
        if let Some(unknown) = &mut this.unknown {
            unknown.bytes += buffer.filled().len() - before;
            if unknown.bytes >= FIRST_BYTES {
                this.unknown = None;
            } else if unknown.until.as_mut().poll(context).is_ready() {
                return Poll::Ready(Err(io::ErrorKind::TimedOut.into()));
            }
        }
        match this.position.advance(&buffer.filled()[before..]) {
            None => return Poll::Ready(Err(io::ErrorKind::InvalidData.into())),
            Some(0) => {}
            Some(cost) => this.charge(cost),
        }
        read
    }
}

impl<S: AsyncWrite + Unpin> AsyncWrite for Metered<S> {
    fn poll_write(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<io::Result<usize>> {
        Pin::new(&mut self.stream).poll_write(context, bytes)
    }

    fn poll_flush(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_flush(context)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_shutdown(context)
    }

    fn poll_write_vectored(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[io::IoSlice<'_>],
    ) -> Poll<io::Result<usize>> {
        Pin::new(&mut self.stream).poll_write_vectored(context, bytes)
    }

    fn is_write_vectored(&self) -> bool {
        self.stream.is_write_vectored()
    }
}

#[cfg(test)]
mod tests {
    use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};

    use super::*;

    fn frame(kind: u8, length: u8) -> Vec<u8> {
        let mut bytes = vec![0, 0, length, kind, 0, 0, 0, 0, 0];
        bytes.extend(vec![6; length.into()]);
        bytes
    }

    #[test]
    fn frames_are_counted_however_they_are_cut() {
        let mut bytes = PREFACE.to_vec();
        for (kind, length) in [(4, 0), (1, 40), (0, 200), (8, 4), (6, 8), (9, 3), (200, 0)] {
            bytes.extend(frame(kind, length));
        }
        let expected = 3 * WINDOW_UPDATES + 1;
        for size in [1, 2, 7, 64, 1_000] {
            let mut position = Position::Preface(0);
            let cost: Option<u32> = bytes.chunks(size).map(|part| position.advance(part)).sum();
            assert_eq!(cost, Some(expected), "in parts of {size} bytes");
        }
        let mut other = Position::Preface(0);
        assert_eq!(other.advance(b"POST / HTTP/1.1\r\n"), Some(0));
        assert_eq!(other.advance(&frame(6, 8)), Some(0), "not HTTP/2");
    }

    #[test]
    fn headers_of_http_1_have_a_limit_and_bodies_have_none() {
        let long = "a".repeat(2 * MAX_HEADER_BYTES as usize);
        let size = long.len();
        let requests = [
            "\r\nPUT / HTTP/1.1\r\nHost: here\r\n\r\n".to_owned(),
            format!("POST / HTTP/1.1\r\nContent-LENGTH: {size}\r\n\r\n{long}"),
            format!(
                "POST / HTTP/1.1\r\ntransfer-encoding: chunked\r\n\r\n{size:x};a=b\r\n{long}\r\n"
            ),
            "1\r\n\n\r\n0\r\nafter: it\r\n\r\nGET / HTTP/1.1\n\n".to_owned(),
        ];
        let requests = requests.concat();
        let head = format!("GET / HTTP/1.1\r\na: {long}");
        for size in [1, 2, 7, 1_000, usize::MAX] {
            let read = |bytes: &str| {
                let mut position = Position::Preface(0);
                let read: Option<u32> = (bytes.as_bytes().chunks(size))
                    .map(|part| position.advance(part))
                    .sum();
                (read, position)
            };
            let (all, position) = read(&requests);
            assert_eq!(all, Some(0), "in parts of {size} bytes");
            let Position::Http1(Http1 {
                part: Part::Head,
                read: left,
                skip: 0,
            }) = position
            else {
                panic!("{position:?} in parts of {size} bytes");
            };
            assert!(left.is_empty());
            assert_eq!(read(&head).0, None, "in parts of {size} bytes");
            assert_eq!(
                read(&format!("{requests}{head}")).0,
                None,
                "a later request"
            );
        }
    }

    #[tokio::test(start_paused = true)]
    async fn a_flood_is_slowed_down_and_requests_are_not() {
        let (mut client, server) = tokio::io::duplex(1 << 20);
        let mut server = Metered::new(server, Duration::from_secs(60));
        let seconds = 3;
        let mut flood = PREFACE.to_vec();
        for _ in 0..BURST + seconds * PER_SECOND {
            flood.extend(frame(6, 8));
        }
        flood.extend(frame(1, 10));
        let begun = Instant::now();
        client.write_all(&flood).await.expect("space");
        // Small reads: a connection is slowed down between two of them.
        let mut part = [0; 1_024];
        let mut left = flood.len();
        while left > 0 {
            left -= server.read(&mut part).await.expect("open");
        }
        let took = begun.elapsed().as_secs_f64();
        assert!((took - f64::from(seconds)).abs() < 0.2, "{took}");
        let (mut client, server) = tokio::io::duplex(1 << 20);
        let mut server = Metered::new(server, Duration::from_secs(60));
        let begun = Instant::now();
        client.write_all(PREFACE).await.expect("space");
        for _ in 0..20_000 {
            client.write_all(&frame(1, 20)).await.expect("space");
            let mut bytes = [0; 29];
            server.read_exact(&mut bytes).await.expect("open");
        }
        assert_eq!(begun.elapsed(), Duration::ZERO);
    }

    #[tokio::test(start_paused = true)]
    async fn a_connection_of_one_byte_ends() {
        let (mut client, server) = tokio::io::duplex(64);
        client.write_all(b"P").await.expect("a byte");
        let mut server = Metered::new(server, Duration::from_secs(10));
        let read = server.read_to_end(&mut Vec::new()).await;
        let error = read.expect_err("the protocol stays unknown");
        assert_eq!(error.kind(), io::ErrorKind::TimedOut);
    }

    #[tokio::test(start_paused = true)]
    async fn those_who_are_trusted_send_what_they_want_once_their_protocol_is_known() {
        let (mut client, server) = tokio::io::duplex(1 << 20);
        let mut server = Metered::of_trusted(server, Duration::from_secs(10));
        let begun = Instant::now();
        let mut flood = PREFACE.to_vec();
        for _ in 0..2 * BURST {
            flood.extend(frame(6, 8));
        }
        client.write_all(&flood).await.expect("space");
        let mut read = vec![0; flood.len()];
        server.read_exact(&mut read).await.expect("open");
        assert_eq!(begun.elapsed(), Duration::ZERO);

        let (_client, server) = tokio::io::duplex(1 << 20);
        let mut server = Metered::of_trusted(server, Duration::from_secs(10));
        let read = server.read_to_end(&mut Vec::new()).await;
        let error = read.expect_err("the protocol stays unknown");
        assert_eq!(error.kind(), io::ErrorKind::TimedOut);
    }
}
