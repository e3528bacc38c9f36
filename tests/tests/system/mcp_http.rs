//! `chefshat mcp --listen`: who is answered, and that a table needs its handle. The tests of the
//! Python SDK play whole games over HTTP.

use std::process::Stdio;
use std::sync::Arc;
use std::time::Duration;

use bytes::Bytes;
use chefshat_client::v1;
use chefshat_server::config::ServerConfig;
use chefshat_server::scrape;
use chefshat_server::serve::Server;
use chefshat_server::store::MemoryStore;
use chefshat_server::web::Origins;
use chefshat_tests::{Held, Link, TestServer, get, patiently, set_up};
use http::{Request, StatusCode};
use http_body_util::{BodyExt as _, Full};
use hyper_util::client::legacy::Client as HttpClient;
use hyper_util::client::legacy::connect::HttpConnector;
use hyper_util::rt::TokioExecutor;
use serde_json::{Value, json};
use tokio::io::{AsyncBufReadExt as _, AsyncReadExt as _, AsyncWriteExt as _, BufReader};
use tokio::net::{TcpListener, TcpStream};
use tokio::process::{Child, Command};

/// The current revision of the protocol.
const REVISION: &str = "2026-07-28";

/// Headers of a request, beside those that the protocol asks for.
type Headers<'a> = &'a [(&'a str, &'a str)];

/// The program serving HTTP.
struct Listening {
    url: String,
    client: HttpClient<HttpConnector, Full<Bytes>>,
    _child: Child,
}

impl Listening {
    async fn start(server: &TestServer, arguments: &[&str]) -> Self {
        Self::start_at(&server.url(), arguments).await
    }

    async fn start_at(server: &str, arguments: &[&str]) -> Self {
        let mut command = Command::new(set_up("CHEFSHAT_BIN"));
        command.args(["mcp", "--server", server, "--listen", "127.0.0.1:0"]);
        command.args(arguments).env_remove("CHEFSHAT_TICKET");
        command.stdout(Stdio::piped()).kill_on_drop(true);
        let mut child = command.spawn().expect("the program starts");
        let mut lines = BufReader::new(child.stdout.take().expect("a pipe")).lines();
        let line = patiently("the program to listen", lines.next_line()).await;
        let line = line.expect("text").expect("a line");
        let url = line.strip_prefix("listening on ").expect("its address");
        Self {
            url: url.to_owned(),
            client: HttpClient::builder(TokioExecutor::new()).build_http(),
            _child: child,
        }
    }

    /// A request of the current revision, which needs no session.
    fn request(&self, headers: Headers<'_>, method: &str, params: Value) -> Request<String> {
        let mut params = params;
        params["_meta"] = json!({
            "io.modelcontextprotocol/protocolVersion": REVISION,
            "io.modelcontextprotocol/clientInfo": {"name": "test", "version": "1"},
            "io.modelcontextprotocol/clientCapabilities": {},
        });
        let name = params["name"].as_str().unwrap_or_default().to_owned();
        let body = json!({"jsonrpc": "2.0", "id": 1, "method": method, "params": params});
        let mut request = Request::post(&self.url)
            .header("content-type", "application/json")
            .header("accept", "application/json, text/event-stream")
            .header("mcp-protocol-version", REVISION)
            .header("mcp-method", method);
        if !name.is_empty() {
            request = request.header("mcp-name", name);
        }
        for (name, value) in headers {
            request = request.header(*name, *value);
        }
        request.body(body.to_string()).expect("a request")
    }

    /// Sends a request; returns its status and the message of the answer.
    async fn post(&self, headers: Headers<'_>, method: &str, params: Value) -> (StatusCode, Value) {
        let request = self.request(headers, method, params).map(Full::from);
        let response = patiently(method, self.client.request(request)).await;
        let (head, body) = response.expect("an answer").into_parts();
        let body = patiently("the answer", body.collect())
            .await
            .expect("its end")
            .to_bytes();
        let text = String::from_utf8(body.to_vec()).expect("text");
        // An answer, or a stream of events with one.
        let message = text
            .lines()
            .map(|line| line.strip_prefix("data:").unwrap_or(line));
        let message = message
            .filter_map(|line| serde_json::from_str(line.trim()).ok())
            .next_back();
        (head.status, message.unwrap_or(Value::Null))
    }

    /// Sends a request over a connection of its own.
    async fn send(&self, request: Request<String>) -> TcpStream {
        let (head, body) = request.into_parts();
        let address = head.uri.authority().expect("an address").as_str();
        let mut connection = TcpStream::connect(address).await.expect("it listens");
        let path = head.uri.path();
        let length = body.len();
        let mut text =
            format!("POST {path} HTTP/1.1\r\nhost: {address}\r\ncontent-length: {length}\r\n");
        for (name, value) in &head.headers {
            text += &format!("{name}: {}\r\n", value.to_str().expect("text"));
        }
        text += &format!("\r\n{body}");
        let written = connection.write_all(text.as_bytes()).await;
        written.expect("it is read");
        connection
    }

    async fn tool(&self, name: &str, arguments: Value) -> (String, bool) {
        let params = json!({"name": name, "arguments": arguments});
        let (status, answer) = self.post(&[], "tools/call", params).await;
        assert_eq!(status, StatusCode::OK, "{answer}");
        let text = answer["result"]["content"][0]["text"].as_str();
        let text = text
            .unwrap_or_else(|| panic!("no text: {answer}"))
            .to_owned();
        (text, answer["result"]["isError"] == json!(true))
    }
}

#[tokio::test]
async fn pages_and_foreign_names_are_refused() {
    let server = TestServer::start().await;
    let open = Listening::start(&server, &[]).await;
    let excepted = [
        "--allow-host",
        "games.example",
        "--allow-origin",
        "https://games.example",
    ];
    let with_exceptions = Listening::start(&server, &excepted).await;
    let foreign = ("host", "games.example");
    let page = ("origin", "https://games.example");
    let table: [(Headers<'_>, bool, bool); 6] = [
        (&[], true, true),
        (&[("host", "localhost")], true, true),
        (&[foreign], false, true),
        (&[page], false, true),
        (&[("origin", "http://localhost:3000")], false, false),
        (&[foreign, ("origin", "null")], false, false),
    ];
    for (headers, by_default, excepted) in table {
        for (program, allowed) in [(&open, by_default), (&with_exceptions, excepted)] {
            let (status, answer) = program.post(headers, "tools/list", json!({})).await;
            if allowed {
                assert_eq!(status, StatusCode::OK, "{headers:?} {answer}");
                let tools = answer["result"]["tools"].as_array().map(Vec::len);
                assert_eq!(tools, Some(8), "{answer}");
            } else {
                assert_eq!(status, StatusCode::FORBIDDEN, "{headers:?} {answer}");
            }
        }
    }
}

#[tokio::test]
async fn a_table_is_reached_with_its_handle_alone() {
    let server = TestServer::start().await;
    let client = server.client().await;
    let made = client
        .create_room(v1::CreateRoomRequest::default())
        .await
        .expect("a new room");
    let program = Listening::start(&server, &["--code", &made.join_code]).await;
    let mut handles = Vec::new();
    for name in ["Ada", "Bo"] {
        let (joined, error) = program.tool("join_room", json!({"name": name})).await;
        assert!(!error, "{joined}");
        let handle = joined
            .lines()
            .next()
            .and_then(|line| line.strip_prefix("table "));
        handles.push(handle.expect("a handle").to_owned());
    }
    assert_ne!(handles[0], handles[1]);
    let (unnamed, error) = program.tool("get_table", json!({})).await;
    assert!(error && unnamed.contains("handle"), "{unnamed}");
    for guess in ["1", "2", ""] {
        let (text, error) = program.tool("get_table", json!({"table": guess})).await;
        assert!(error && text.contains("no such table"), "{text}");
    }
    for handle in &handles {
        let (table, error) = program.tool("get_table", json!({"table": handle})).await;
        assert!(
            !error && table.contains("seats Ada, Bo, free, free"),
            "{table}"
        );
    }
    // A list that everybody can read names no handle.
    let (_, listed) = program.post(&[], "resources/list", json!({})).await;
    let listed = listed.to_string();
    assert!(listed.contains("chefshat://rules"), "{listed}");
    assert!(
        handles.iter().all(|handle| !listed.contains(handle)),
        "{listed}"
    );
}

#[tokio::test]
async fn clients_of_older_revisions_leave_no_session_behind() {
    let server = TestServer::start().await;
    let program = Listening::start(&server, &[]).await;
    let client = json!({"name": "test", "version": "1"});
    for revision in ["2025-03-26", "2025-06-18"] {
        let send = async |method: &str, params: Value| {
            let body = json!({"jsonrpc": "2.0", "id": 1, "method": method, "params": params});
            let request = Request::post(&program.url)
                .header("content-type", "application/json")
                .header("accept", "application/json, text/event-stream")
                .header("mcp-protocol-version", revision)
                .body(Full::from(body.to_string()))
                .expect("a request");
            let answer = patiently(method, program.client.request(request)).await;
            let (head, body) = answer.expect("an answer").into_parts();
            let body = patiently("the answer", body.collect())
                .await
                .expect("its end");
            let text = String::from_utf8_lossy(&body.to_bytes()).into_owned();
            assert_eq!(head.status, StatusCode::OK, "{text}");
            (head.headers, text)
        };
        for _ in 0..100 {
            let params =
                json!({"protocolVersion": revision, "capabilities": {}, "clientInfo": client});
            let (headers, text) = send("initialize", params).await;
            assert!(text.contains(revision), "{text}");
            // What it would have to remember, somebody could ask for again and again.
            assert!(!headers.contains_key("mcp-session-id"), "{headers:?}");
        }
        let (_, text) = send("tools/list", json!({})).await;
        assert!(text.contains("join_room"), "{text}");
    }
}

#[tokio::test]
async fn the_seat_of_a_client_that_has_gone_is_given_back() {
    let server = TestServer::start().await;
    let client = server.client().await;
    let made = client
        .create_room(v1::CreateRoomRequest::default())
        .await
        .expect("a new room");
    let room = made.room.expect("a room").room_id;
    let seats_taken = async || {
        let room = client.get_room(room.clone()).await.expect("the room");
        room.seats
            .iter()
            .filter(|seat| !seat.name.is_empty())
            .count()
    };
    let address = server.url().trim_start_matches("http://").parse();
    let link = Link::to(address.expect("an address")).await;
    let program = Listening::start_at(&format!("http://{}", link.address), &[]).await;
    let (_, error) = program.tool("list_rooms", json!({})).await;
    assert!(!error, "it is connected");
    link.way().hold(Held::Answers);
    let arguments = json!({"join_code": made.join_code});
    let params = json!({"name": "join_room", "arguments": arguments});
    let mut connection = program
        .send(program.request(&[], "tools/call", params))
        .await;
    patiently("the seat to be taken", async {
        while seats_taken().await == 0 {
            tokio::time::sleep(Duration::from_millis(10)).await;
        }
    })
    .await;
    // The client leaves, and the program closes the connection too.
    connection.shutdown().await.expect("open");
    let read = patiently("the end", connection.read_to_end(&mut Vec::new())).await;
    read.expect("the end");
    // The client has gone before the program knew its seat.
    link.way().hold(Held::Nothing);
    patiently("the seat to be given back", async {
        while seats_taken().await > 0 {
            tokio::time::sleep(Duration::from_millis(10)).await;
        }
    })
    .await;
}

#[tokio::test]
async fn the_room_of_a_client_that_has_gone_is_closed() {
    let store = Arc::new(MemoryStore::default());
    let server = Server::restored(ServerConfig::default(), store).await;
    let server = server.expect("an empty store");
    let listener = TcpListener::bind("127.0.0.1:0").await.expect("a port");
    let scraped = TcpListener::bind("127.0.0.1:0").await.expect("a port");
    let address = listener.local_addr().expect("bound");
    let metrics = scraped.local_addr().expect("bound");
    let names = Origins::new(&[], Some(Vec::new()));
    tokio::spawn(scrape::serve(scraped, Arc::clone(server.metrics()), names));
    tokio::spawn(server.serve(listener, std::future::pending()));
    // The room is in no list.
    let until_waiting = async |rooms: &str| loop {
        let text = get(&format!("http://{metrics}/metrics")).await;
        let waiting = "chefshat_rooms{state=\"waiting\"} ";
        let count = text.lines().find_map(|line| line.strip_prefix(waiting));
        if count.expect("it is counted") == rooms {
            break;
        }
        tokio::time::sleep(Duration::from_millis(10)).await;
    };
    let link = Link::to(address).await;
    let program = Listening::start_at(&format!("http://{}", link.address), &[]).await;
    let (_, error) = program.tool("list_rooms", json!({})).await;
    assert!(!error, "it is connected");
    link.way().hold(Held::Answers);
    let params = json!({"name": "create_room", "arguments": {}});
    let mut connection = program
        .send(program.request(&[], "tools/call", params))
        .await;
    patiently("the room", until_waiting("1")).await;
    // The client leaves before the program knows its room.
    connection.shutdown().await.expect("open");
    let read = patiently("the end", connection.read_to_end(&mut Vec::new())).await;
    read.expect("the end");
    link.way().hold(Held::Nothing);
    patiently("the room to be closed", until_waiting("0")).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_connection_makes_one_request_at_a_time() {
    let server = TestServer::start().await;
    let listening = Listening::start(&server, &[]).await;
    let address = listening
        .url
        .trim_start_matches("http://")
        .split('/')
        .next();
    let connected = TcpStream::connect(address.expect("an address")).await;
    let mut connection = connected.expect("it listens");
    // A client that begins with HTTP/2 would have many at a time.
    let begun = connection
        .write_all(b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n")
        .await;
    begun.expect("it is read");
    let mut answer = Vec::new();
    let read = patiently("the end", connection.read_to_end(&mut answer)).await;
    // What it does not read resets the connection.
    let _ = read;
    assert!(
        answer.is_empty()
            || answer.starts_with(b"HTTP/1.1 4")
            || answer.starts_with(b"HTTP/1.1 505"),
        "{}",
        String::from_utf8_lossy(&answer)
    );
}
