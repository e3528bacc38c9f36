//! `chefshat mcp --listen`: who is answered, and that a table needs its handle. The tests of the
//! Python SDK play whole games over HTTP.

use std::process::Stdio;

use bytes::Bytes;
use chefshat_client::v1;
use chefshat_tests::{TestServer, patiently, set_up};
use http::{Request, StatusCode};
use http_body_util::{BodyExt as _, Full};
use hyper_util::client::legacy::Client as HttpClient;
use hyper_util::client::legacy::connect::HttpConnector;
use hyper_util::rt::TokioExecutor;
use serde_json::{Value, json};
use tokio::io::{AsyncBufReadExt as _, BufReader};
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
        let mut command = Command::new(set_up("CHEFSHAT_BIN"));
        command.args(["mcp", "--server", &server.url(), "--listen", "127.0.0.1:0"]);
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

    /// Sends a request of the current revision, which needs no session; returns its status and the
    /// message of the answer.
    async fn post(&self, headers: Headers<'_>, method: &str, params: Value) -> (StatusCode, Value) {
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
        let request = request
            .body(Full::from(body.to_string()))
            .expect("a request");
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
                assert_eq!(tools, Some(7), "{answer}");
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
