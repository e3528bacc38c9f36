//! `chefshat agent llm` with a scripted endpoint, which may lie, stall, talk nonsense or cost more
//! than there is: the seat decides in time.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use bytes::Bytes;
use chefshat_client::{count_in, nth_in, v1};
use chefshat_proto::v1::seat_config::FilledBy;
use chefshat_tests::{TestServer, one_shift, patiently, set_up};
use http::{HeaderMap, Response, StatusCode};
use http_body_util::{BodyExt as _, Full};
use hyper_util::rt::TokioIo;
use serde_json::{Value, json};
use sha2::{Digest as _, Sha256};
use tokio::net::TcpListener;
use tokio::process::Command;

use crate::played::{EndedGame, built_in, until_over};

/// The key of the endpoint.
const KEY: &str = "sk-test-0123";
/// The model's seat.
const SEAT: u32 = 0;

/// What an endpoint answers to the question with this number, from 0, with these messages.
type Script = fn(usize, &[Value]) -> Said;

/// An answer.
enum Said {
    /// A completion with this text, and the tokens that it took.
    Text(String, u64),
    /// A body that means success.
    Whole(Value),
    /// A status and a body.
    Other(StatusCode, Vec<u8>),
    /// None, ever.
    Nothing,
}

/// A question as it arrived.
#[derive(Debug)]
struct Asked {
    headers: HeaderMap,
    body: Value,
}

impl Asked {
    /// Whether it is the one that is asked before a seat is taken.
    fn is_first(&self) -> bool {
        let first = self.body["messages"][0]["content"].as_str();
        first.is_some_and(|words| words.starts_with("Before the game"))
    }
}

/// Serves a script. Returns the address and what arrives.
async fn endpoint(script: Script) -> (String, Arc<Mutex<Vec<Asked>>>) {
    let listener = TcpListener::bind("127.0.0.1:0").await.expect("a port");
    let port = listener.local_addr().expect("bound").port();
    let asked: Arc<Mutex<Vec<Asked>>> = Arc::default();
    let questions = asked.clone();
    tokio::spawn(async move {
        while let Ok((stream, _)) = listener.accept().await {
            let questions = questions.clone();
            let answer = move |request: http::Request<hyper::body::Incoming>| {
                let questions = questions.clone();
                async move {
                    assert_eq!(request.uri().path(), "/v1/chat/completions");
                    let (head, body) = request.into_parts();
                    let body = body.collect().await?.to_bytes();
                    let body: Value = serde_json::from_slice(&body).expect("JSON");
                    let said = {
                        let mut questions = questions.lock().expect("no panic");
                        let messages = body["messages"].as_array().expect("messages");
                        let said = script(questions.len(), messages);
                        let headers = head.headers;
                        questions.push(Asked { headers, body });
                        said
                    };
                    let response = match said {
                        Said::Text(text, tokens) => Response::new(Bytes::from(
                            json!({
                                "choices": [{"message": {"role": "assistant", "content": text}}],
                                "usage": {
                                    "prompt_tokens": tokens.saturating_sub(8), "completion_tokens": 8, "total_tokens": tokens,
                                    "prompt_tokens_details": {"cached_tokens": 5},
                                    "completion_tokens_details": null,
                                },
                            })
                            .to_string(),
                        )),
                        Said::Whole(body) => Response::new(Bytes::from(body.to_string())),
                        Said::Other(status, body) => {
                            let mut response = Response::new(Bytes::from(body));
                            *response.status_mut() = status;
                            response
                                .headers_mut()
                                .insert("retry-after", "0".parse().expect("a value"));
                            response
                        }
                        Said::Nothing => std::future::pending().await,
                    };
                    Ok::<_, hyper::Error>(response.map(Full::new))
                }
            };
            tokio::spawn(
                hyper::server::conn::http1::Builder::new()
                    .serve_connection(TokioIo::new(stream), hyper::service::service_fn(answer)),
            );
        }
    });
    (format!("http://127.0.0.1:{port}/v1"), asked)
}

/// The ids of the options in the last message.
fn options(messages: &[Value]) -> Vec<u32> {
    let last = messages.last().and_then(|it| it["content"].as_str());
    let (_, options) = last
        .and_then(|it| it.rsplit_once("options\n"))
        .expect("options");
    let ids = options.lines().map(|line| {
        let (id, _) = line.split_once('=').expect("an option");
        id.strip_prefix('a').expect("an id")
    });
    ids.map(|id| id.parse().expect("a number")).collect()
}

/// The first option, in the words of a model that explains itself.
fn honest(_: usize, messages: &[Value]) -> Said {
    let action = options(messages)[0];
    let text = format!(
        "<think>{{cards}}</think>\n```json\n{{\"action\": {action}, \"reason\": \"the first of them\"}}\n```"
    );
    Said::Text(text, 500)
}

/// `chefshat` with these arguments and the key of the endpoint.
fn chefshat(arguments: &[&str], key: &str) -> Command {
    let mut command = Command::new(set_up("CHEFSHAT_BIN"));
    command.args(arguments);
    command.env("CHEFSHAT_LLM_KEY", key).kill_on_drop(true);
    command
}

/// A game of one Shift in which the model has the first seat.
struct Played {
    game: EndedGame,
    /// What the program printed.
    result: Value,
    asked: Arc<Mutex<Vec<Asked>>>,
}

impl Played {
    /// The model's decisions with more than one legal action, with their annotations.
    fn choices(&self) -> Vec<(&v1::DecisionRecord, BTreeMap<&str, &str>)> {
        let decisions = self.game.decisions().into_iter();
        let own = decisions.filter(|it| it.seat == SEAT && count_in(&it.action_mask) > 1);
        let annotated = own.map(|decision| {
            let extra = decision.annotations.as_ref().map(|it| it.extra.iter());
            let extra = extra.into_iter().flatten();
            let extra = extra.map(|(key, words)| (key.as_str(), words.as_str()));
            (decision, extra.collect())
        });
        annotated.collect()
    }

    /// Why the fallback decided, by decision; `None` where it did not.
    fn fallbacks(&self) -> Vec<Option<String>> {
        let choices = self.choices().into_iter();
        let why = choices.map(|(_, said)| said.get("fallback").map(|&it| it.to_owned()));
        why.collect()
    }

    /// The questions of the game: without the one before it.
    fn questions(&self) -> usize {
        let asked = self.asked.lock().expect("no panic");
        asked.iter().filter(|asked| !asked.is_first()).count()
    }

    /// Checks that the model's seat decided in time, and that the program counts as the record does.
    fn check(&self) {
        let fallbacks = self.fallbacks();
        let fallen = fallbacks.iter().flatten().count();
        assert_eq!(self.result["event"], "result", "{}", self.result);
        assert_eq!(self.result["decisions"], fallbacks.len());
        assert_eq!(self.result["fallbacks"], fallen);
        for (decision, said) in self.choices() {
            assert_eq!(decision.source(), v1::DecisionSource::Agent, "{said:?}");
            assert_eq!(said["model"], "ada/test-1");
        }
    }
}

/// A game in which the seat decides in time, whatever the model says.
async fn play(script: Script, decision_time: Duration, arguments: &[&str]) -> Played {
    let policy = v1::RoomPolicy {
        decision_time_ms: Some(u32::try_from(decision_time.as_millis()).expect("short")),
        ..v1::RoomPolicy::default()
    };
    let played = play_by(script, policy, arguments).await;
    played.check();
    played
}

async fn play_by(script: Script, policy: v1::RoomPolicy, arguments: &[&str]) -> Played {
    let server = TestServer::start().await;
    let client = server.client().await;
    let (url, asked) = endpoint(script).await;
    let others = (0..3).map(|_| built_in("greedy"));
    let open = v1::SeatConfig {
        filled_by: Some(FilledBy::ReservedFor(v1::ParticipantKind::Model.into())),
        ..v1::SeatConfig::default()
    };
    let created = client.create_room(v1::CreateRoomRequest {
        rules: Some(one_shift()),
        policy: Some(v1::RoomPolicy {
            max_invalid_attempts: Some(3),
            ..policy
        }),
        seats: std::iter::once(open).chain(others).collect(),
        // Deals in which the model has more decisions than the tests look at.
        game_seed: vec![7; 32],
        ..v1::CreateRoomRequest::default()
    });
    let created = created.await.expect("a room");
    let mut command = chefshat(&["agent", "llm", "--server", &server.url(), "--json"], KEY);
    command.args(["--code", &created.join_code, "--seed", "7"]);
    command
        .args(["--endpoint", &url, "--model", "ada/test-1"])
        // Some of these scripts leave the game to the fallback.
        .args(["--max-fallbacks", "1"])
        .args(arguments);
    let output = patiently("the game", command.output())
        .await
        .expect("it runs");
    let problems = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{problems}");
    assert!(!problems.contains(KEY), "{problems}");
    let result = serde_json::from_slice(&output.stdout).expect("a line of JSON");
    let room = created.room.expect("a room");
    let game = until_over(&client, room.room_id).await;
    assert_eq!(game.room.seats[0].name, "test-1");
    Played {
        game,
        result,
        asked,
    }
}

/// Time enough for decisions on a busy machine.
const AMPLE: Duration = Duration::from_secs(600);

#[tokio::test(flavor = "multi_thread")]
async fn a_model_plays_and_its_reasons_are_recorded() {
    let played = play(honest, AMPLE, &["--temperature", "0.5"]).await;
    let choices = played.choices();
    assert!(choices.len() > 3, "{}", choices.len());
    assert_eq!(played.questions(), choices.len());
    assert_eq!(played.result["tokens"], 500 * choices.len());
    for (decision, said) in &choices {
        let first = nth_in(&decision.action_mask, 0).map(|id| id.0);
        assert_eq!(Some(decision.action), first);
        assert_eq!(
            (said["reason"], said["tokens"]),
            ("the first of them", "500")
        );
        assert_eq!(said.get("fallback"), None);
        assert_eq!(
            said["usage"],
            r#"{"prompt":492,"cached":5,"completion":8,"reasoning":0}"#
        );
    }
    let asked = played.asked.lock().expect("no panic");
    assert!(asked[0].is_first());
    // How the model was asked is said once.
    let first = &choices[0].1;
    let sampling: Value = serde_json::from_str(first["sampling"]).expect("JSON");
    let expected = json!({ "max_tokens": 1_000, "temperature": 0.5, "seed": 7 });
    assert_eq!(sampling, expected);
    let host = asked[1].headers["host"].to_str().expect("text");
    assert_eq!(first["endpoint"], host);
    let prompt = asked[1].body["messages"][0]["content"].as_str();
    let digest = hex::encode(&Sha256::digest(prompt.expect("text"))[..8]);
    let version = env!("CARGO_PKG_VERSION");
    assert_eq!(first["prompt"], format!("{version} {digest}"));
    let again = choices[1..]
        .iter()
        .any(|(_, said)| said.contains_key("prompt"));
    assert!(!again);
    for asked in asked.iter().skip(1) {
        assert_eq!(asked.headers["authorization"], format!("Bearer {KEY}"));
        assert_eq!(asked.body["model"], "ada/test-1");
        assert_eq!(asked.body["temperature"], 0.5);
        assert_eq!(asked.body["seed"], 7);
        let roles = asked.body["messages"].as_array().expect("messages").iter();
        assert_eq!(
            roles.map(|it| &it["role"]).collect::<Vec<_>>(),
            ["system", "user"]
        );
        assert!(!asked.body.to_string().contains(KEY));
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn another_first_message_and_what_the_game_costs_are_said() {
    let folder = tempfile::tempdir().expect("a folder");
    let own = folder.path().join("first-message.txt");
    std::fs::write(&own, "Play like a thief.\n{rules}\n{form}\n").expect("written");
    let own = own.to_str().expect("text");
    let arguments = ["--prompt", own, "--price", "0.5,2,0.1"];
    let played = play(honest, AMPLE, &arguments).await;
    let choices = played.choices();
    let asked = played.asked.lock().expect("no panic")[1].body.clone();
    let prompt = asked["messages"][0]["content"].as_str();
    let prompt = prompt.expect("text");
    assert!(
        prompt.starts_with("Play like a thief.\nThe rules in short"),
        "{prompt}"
    );
    assert!(prompt.contains(r#"{"action": "a84""#), "{prompt}");
    let digest = hex::encode(&Sha256::digest(prompt)[..8]);
    let first = &choices[0].1;
    assert_eq!(first["prompt"], format!("own {digest}"));
    assert_eq!(
        first["price"],
        r#"{"questions":0.5,"answers":2.0,"cached":0.1}"#
    );
    // Of each question 5 of 492 tokens were cached, and the answer has 8.
    let expected = choices.len() as f64 * (487.0 * 0.5 + 5.0 * 0.1 + 8.0 * 2.0) / 1e6;
    let cost = played.result["cost"].as_f64().expect("a number");
    assert!((cost - expected).abs() < 1e-9, "{cost} {expected}");
    // A part of the tokens is not enough.
    let silent: Script = |number, messages| match number {
        2 => {
            let action = options(messages)[0].to_string();
            Said::Whole(json!({"choices": [{"message": {"content": action}}]}))
        }
        _ => honest(number, messages),
    };
    let arguments = ["--price", "0.5,2", "--keep-answers"];
    let played = play(silent, AMPLE, &arguments).await;
    assert_eq!(played.result.get("cost"), None);
    // Of the decision whose tokens are not known in parts, the record has no parts.
    let choices = played.choices();
    let usages = choices
        .iter()
        .filter(|(_, said)| said.contains_key("usage"));
    assert_eq!(usages.count() + 1, choices.len());
    for (decision, said) in &choices {
        let answers: Vec<String> = serde_json::from_str(said["answers"]).expect("JSON");
        let [answer] = &*answers else {
            panic!("one question: {answers:?}");
        };
        assert!(answer.contains(&decision.action.to_string()), "{answer}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn illegal_answers_are_told_and_counted() {
    let lies: Script = |number, messages| match messages {
        [_] => honest(number, messages),
        [_, _] => Said::Text(r#"{"action": 77777, "reason": "trust me"}"#.to_owned(), 0),
        [.., told] => {
            let told = told["content"].as_str().expect("words");
            assert!(told.starts_with("Illegal: a77777: "), "{told}");
            honest(number, messages)
        }
        [] => unreachable!("there is a question"),
    };
    let played = play(lies, AMPLE, &[]).await;
    let choices = played.choices();
    for (decision, said) in &choices {
        assert_eq!(decision.invalid_attempts, [77777]);
        assert_eq!(said["reason"], "the first of them");
    }
    assert_eq!(played.questions(), 2 * choices.len());
    // What it says about its tokens is not believed.
    assert!(played.result["tokens"].as_u64() > Some(500 * choices.len() as u64));
}

#[tokio::test(flavor = "multi_thread")]
async fn only_illegal_answers_end_with_the_fallback() {
    let lies: Script = |_, _| Said::Text(r#"{"action": 77777}"#.to_owned(), 0);
    let played = play(lies, AMPLE, &["--fallback", "random", "--retries", "9"]).await;
    let choices = played.choices();
    for (decision, said) in &choices {
        assert!(said["fallback"].starts_with("random: "), "{said:?}");
        // A third one would have left the decision to the server.
        assert!(decision.invalid_attempts.len() <= 2, "{decision:?}");
    }
    assert!(!choices[0].0.invalid_attempts.is_empty());
}

#[tokio::test(flavor = "multi_thread")]
async fn without_a_fallback_the_server_decides_and_a_substitute_keeps_the_seat() {
    let nonsense: Script = |_, _| Said::Text("I fold.".to_owned(), 900);
    let policy = v1::RoomPolicy {
        decision_time_ms: Some(2_000),
        bank_ms: Some(0),
        max_timeouts: Some(1),
        abort: v1::AbortPolicy::Never.into(),
        ..v1::RoomPolicy::default()
    };
    let played = play_by(nonsense, policy, &["--fallback", "none", "--retries", "0"]).await;
    let choices = played.choices();
    for (decision, said) in &choices {
        assert_ne!(decision.source(), v1::DecisionSource::Agent, "{said:?}");
        assert!(said.is_empty(), "{said:?}");
    }
    let last = choices.last().map(|(decision, _)| decision.source());
    assert_eq!(last, Some(v1::DecisionSource::Substitute));
    // From then on nobody is asked any more.
    let asked = played.result["decisions"].as_u64().expect("a number");
    assert!(asked < choices.len() as u64, "{asked} of {}", choices.len());
    assert_eq!(played.result["fallbacks"], asked);
    assert!(played.result["unrequested"].as_u64() > Some(0));
}

#[tokio::test(flavor = "multi_thread")]
async fn without_usable_answers_the_fallback_plays_and_soon_nobody_asks_any_more() {
    let nonsense: Script = |_, _| Said::Text("I fold. {\"action\": \"fold\"}".to_owned(), 900);
    // What begins after the first question.
    let endless: Script = |number, messages| match number {
        0 => honest(number, messages),
        _ => Said::Other(StatusCode::OK, vec![b' '; 3 << 20]),
    };
    let forbidden: Script = |number, messages| match number {
        0 => honest(number, messages),
        // What the record does not show.
        _ => {
            let body = json!({"error": {"message": "Ada's account is closed"}});
            Said::Other(StatusCode::UNAUTHORIZED, body.to_string().into_bytes())
        }
    };
    let broken: Script = |number, messages| match number {
        0 => honest(number, messages),
        _ => Said::Other(StatusCode::OK, b"<html>".to_vec()),
    };
    let cut: Script = |_, _| {
        Said::Whole(json!({
            "choices": [{"message": {"content": "<think> a 7 or"}, "finish_reason": "length"}],
        }))
    };
    let cases: [(Script, usize, &str); 5] = [
        (nonsense, 2, "no action in the answer"),
        (cut, 2, "the answer was cut before its action"),
        (endless, 2, "the answer has more than"),
        // Asking again would be the same again.
        (forbidden, 1, "the endpoint answered 401"),
        (broken, 1, "the answer is not a chat completion"),
    ];
    for (script, attempts, why) in cases {
        let played = play(script, AMPLE, &["--retries", "1"]).await;
        let fallbacks = played.fallbacks();
        assert!(fallbacks.len() > 3, "{}", fallbacks.len());
        for (number, fallback) in fallbacks.iter().enumerate() {
            let said = fallback.as_ref().expect("the fallback decides");
            let expected = match number {
                0..3 => why,
                _ => "no usable answers before in this Shift",
            };
            assert!(said.starts_with(&format!("greedy: {expected}")), "{said}");
            assert!(!said.contains("account"), "{said}");
        }
        assert_eq!(played.questions(), 3 * attempts);
    }
}

/// The forms in which servers and models answer, besides a text with an object.
#[tokio::test(flavor = "multi_thread")]
async fn an_answer_in_any_usual_form_is_read() {
    let forms: Script = |number, messages| {
        let asked = messages.last().and_then(|it| it["content"].as_str());
        let (_, options) = asked
            .and_then(|it| it.rsplit_once("options\n"))
            .expect("options");
        let (action, cards) = options
            .lines()
            .next()
            .and_then(|it| it.split_once('='))
            .expect("one");
        // A number alone is an id.
        let cards = match cards.parse::<u32>() {
            Ok(_) => action,
            Err(_) => cards,
        };
        let digits = action.strip_prefix('a').expect("an id");
        let message = match number % 5 {
            0 => {
                json!({"content": [{"type": "reasoning"}, {"type": "text", "text": format!("{digits}.0")}]})
            }
            1 => json!({"content": null, "reasoning_content": "{\"action\": 0}", "tool_calls": [
                {"function": {"name": "play", "arguments": json!({"action": cards}).to_string()}}]}),
            2 => json!({"content": "", "tool_calls": [
                {"function": {"name": "play", "arguments": {"action": action}}}]}),
            3 => json!({"content": format!("I play **action {action}**.")}),
            _ => json!({"content": cards}),
        };
        Said::Whole(json!({
            "choices": [{"message": message, "finish_reason": "stop"}],
            "usage": {"total_tokens": -1, "prompt_tokens": 3.5},
        }))
    };
    let played = play(forms, AMPLE, &["--extra", r#"{"reasoning_effort": "low"}"#]).await;
    let choices = played.choices();
    // One of each form.
    assert!(choices.len() >= 5, "{}", choices.len());
    assert_eq!(played.questions(), choices.len());
    for (decision, said) in &choices {
        let first = nth_in(&decision.action_mask, 0).map(|id| id.0);
        assert_eq!(Some(decision.action), first, "{said:?}");
    }
    assert_eq!(played.result["played_by_model"], true);
    for asked in played.asked.lock().expect("no panic").iter() {
        assert_eq!(asked.body["reasoning_effort"], "low");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_server_that_names_the_limit_of_an_answer_otherwise_is_understood() {
    let later: Script = |number, messages| match number {
        0 => {
            let problem = "Unsupported parameter: use 'max_completion_tokens' instead.";
            let body = json!({"error": {"message": problem}}).to_string();
            Said::Other(StatusCode::BAD_REQUEST, body.into_bytes())
        }
        _ => honest(number, messages),
    };
    let played = play(later, AMPLE, &["--answer-tokens", "77"]).await;
    assert_eq!(played.fallbacks().iter().flatten().count(), 0);
    let asked = played.asked.lock().expect("no panic");
    assert_eq!(asked[0].body["max_tokens"], 77);
    for asked in asked.iter().skip(1) {
        assert_eq!(asked.body["max_completion_tokens"], 77);
        assert_eq!(asked.body.get("max_tokens"), None);
    }
}

/// Otherwise a key that does not work would play as the fallback under the model's name.
#[tokio::test(flavor = "multi_thread")]
async fn a_model_that_cannot_be_asked_takes_no_seat() {
    let keyless: Script = |_, _| {
        let body = json!({"error": {"message": format!("no such key: {KEY}")}});
        Said::Other(StatusCode::UNAUTHORIZED, body.to_string().into_bytes())
    };
    let forbidden: Script = |_, _| Said::Other(StatusCode::FORBIDDEN, Vec::new());
    let refused: Script = |_, _| {
        let body = json!({"error": {"message": "temperature is unsupported"}});
        Said::Other(StatusCode::BAD_REQUEST, body.to_string().into_bytes())
    };
    let unknown: Script = |_, _| Said::Other(StatusCode::NOT_FOUND, Vec::new());
    let cut: Script = |_, _| {
        let body = br#"{"choices": [{"message": {"content": "rea"#;
        Said::Other(StatusCode::OK, body.to_vec())
    };
    let moved: Script = |_, _| Said::Other(StatusCode::PERMANENT_REDIRECT, Vec::new());
    let page: Script = |_, _| Said::Other(StatusCode::OK, b"<html>".to_vec());
    let endless: Script = |_, _| Said::Other(StatusCode::OK, vec![b' '; 3 << 20]);
    let cases: [(Script, &str); 8] = [
        (keyless, "401 Unauthorized: no such key: …"),
        (forbidden, "403 Forbidden"),
        (refused, "400 Bad Request: temperature is unsupported"),
        (unknown, "404 Not Found"),
        (moved, "308 Permanent Redirect, which means another address"),
        (page, "the answer is not a chat completion"),
        (cut, "the answer is not a chat completion"),
        (endless, "the answer has more than"),
    ];
    for (script, why) in cases {
        let (url, _) = endpoint(script).await;
        for command in [
            &["agent", "llm"][..],
            &["tournament", "join", "--agent", "llm"],
        ] {
            // Nothing listens there: the program ends before it connects to the game server.
            let mut command = chefshat(command, KEY);
            command.args(["--server", "http://127.0.0.1:1", "--code", "BCDF2345"]);
            command.args(["--endpoint", &url, "--model", "ada/test-1"]);
            let output = patiently("the program", command.output()).await;
            let output = output.expect("it runs");
            assert_eq!(output.status.code(), Some(1), "{why}");
            let problems = String::from_utf8_lossy(&output.stderr);
            assert!(
                problems.contains("ada/test-1 cannot be asked"),
                "{problems}"
            );
            assert!(problems.contains(why), "{problems}");
            assert!(!problems.contains(KEY), "{problems}");
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_busy_endpoint_is_asked_again() {
    let busy: Script = |number, messages| match number % 2 {
        0 => Said::Other(StatusCode::TOO_MANY_REQUESTS, Vec::new()),
        _ => honest(number, messages),
    };
    let played = play(busy, AMPLE, &[]).await;
    assert_eq!(played.fallbacks().iter().flatten().count(), 0);
    // Also the first one, before the game.
    let asked = played.asked.lock().expect("no panic").len();
    assert_eq!(asked, 2 + 2 * played.choices().len());
}

#[tokio::test(flavor = "multi_thread")]
async fn who_does_not_answer_in_time_is_not_waited_for() {
    let silent: Script = |number, messages| match number {
        0 => honest(number, messages),
        _ => Said::Nothing,
    };
    let played = play(silent, Duration::from_secs(4), &[]).await;
    let fallbacks = played.fallbacks();
    assert!(fallbacks.iter().all(Option::is_some), "{fallbacks:?}");
    assert!(played.questions() <= 9);
}

#[tokio::test(flavor = "multi_thread")]
async fn the_budget_ends_and_the_game_goes_on() {
    let played = play(honest, AMPLE, &["--budget", "1200"]).await;
    let fallbacks = played.fallbacks();
    assert_eq!(fallbacks[..3], [None, None, None]);
    assert!(fallbacks.len() > 3, "{}", fallbacks.len());
    for fallback in &fallbacks[3..] {
        let expected = "greedy: the budget of 1200 tokens is spent";
        assert_eq!(fallback.as_deref(), Some(expected));
    }
    assert_eq!(played.result["tokens"], 1500);
}

/// The participants of a tournament, their programs and their kinds.
const PARTICIPANTS: [(&str, v1::ParticipantKind); 4] = [
    ("honest", v1::ParticipantKind::Model),
    ("nonsense", v1::ParticipantKind::Model),
    ("Gustav", v1::ParticipantKind::Agent),
    ("Rolf", v1::ParticipantKind::Robot),
];

#[tokio::test(flavor = "multi_thread")]
async fn models_agents_and_a_robot_play_a_tournament() {
    let server = TestServer::start().await;
    let client = server.client().await;
    let model = v1::ParticipantKind::Model;
    let settings = v1::TournamentSettings {
        name: "Models".into(),
        format: v1::TournamentFormat::RoundRobin.into(),
        rounds: 2,
        rules: Some(one_shift()),
        start_when_joined: 4,
        policy: Some(v1::RoomPolicy {
            clocks: vec![v1::KindClock {
                kind: model.into(),
                decision_time_ms: Some(600_000),
                ..v1::KindClock::default()
            }],
            ..v1::RoomPolicy::default()
        }),
        ..v1::TournamentSettings::default()
    };
    let made = client.create_tournament(settings).await.expect("created");
    let tournament_id = made.tournament.expect("a tournament").tournament_id;
    let nonsense: Script = |_, _| Said::Text("I fold.".to_owned(), 10);
    let scripts = [honest, nonsense].map(endpoint);
    let [(honest, _), (nonsense, _)] = futures::future::join_all(scripts)
        .await
        .try_into()
        .expect("two");
    let arguments = [
        vec![
            "--agent",
            "llm",
            "--endpoint",
            &honest,
            "--model",
            "ada/honest",
        ],
        vec![
            "--agent",
            "llm",
            "--endpoint",
            &nonsense,
            "--model",
            "nonsense",
            "--retries",
            "0",
        ],
        vec!["--agent", "greedy", "--name", "Gustav"],
        vec!["--agent", "greedy", "--name", "Rolf", "--kind-of", "robot"],
    ];
    let running = arguments.map(|arguments| {
        let mut command = chefshat(&["tournament", "join", "--server", &server.url()], KEY);
        command
            .args(["--code", &made.join_code, "--json"])
            .args(arguments);
        command.output()
    });
    let outputs = patiently("the tournament", futures::future::join_all(running)).await;
    let mut told = outputs
        .into_iter()
        .zip(PARTICIPANTS)
        .map(|(output, (name, _))| {
            let output = output.expect("it runs");
            let problems = String::from_utf8_lossy(&output.stderr);
            // A game that the fallback has played is not the model's.
            assert_eq!(
                output.status.success(),
                name != "nonsense",
                "{name}: {problems}"
            );
            let lines = serde_json::Deserializer::from_slice(&output.stdout).into_iter();
            lines
                .map(|line| line.expect("JSON"))
                .collect::<Vec<Value>>()
        });
    let tournament = client.tournament(tournament_id).await.expect("it is known");
    let participants = tournament.participants;
    for (name, kind) in PARTICIPANTS {
        let entry = participants.iter().find(|it| it.name == name);
        assert_eq!(entry.expect("it took part").kind(), kind, "{name}");
        let told = told.next().expect("its program");
        let [games @ .., over] = &told[..] else {
            panic!("{told:?}")
        };
        assert_eq!((games.len(), &over["event"]), (2, &json!("over")));
        for game in games {
            let asked = game["decisions"].as_u64();
            assert_eq!(asked.is_some(), kind == model, "{game}");
            let fallbacks = if name == "nonsense" {
                asked
            } else {
                asked.map(|_| 0)
            };
            assert_eq!(game["fallbacks"].as_u64(), fallbacks, "{game}");
            if kind == model {
                assert_eq!(game["played_by_model"], name != "nonsense", "{game}");
            }
        }
    }
    let request = v1::GetLeaderboardRequest {
        kind: model.into(),
        ..v1::GetLeaderboardRequest::default()
    };
    let board = client.leaderboard(request).await.expect("a leaderboard");
    let mut names: Vec<_> = board.rated.iter().map(|it| it.name.as_str()).collect();
    names.sort_unstable();
    assert_eq!(names, ["honest", "nonsense"]);
}

#[tokio::test]
async fn what_cannot_be_asked_is_refused_before_a_seat_is_taken() {
    let refused = async |arguments: &[&str], key: &str| {
        let mut command = chefshat(&["agent"], key);
        command.args(arguments).args(["--code", "BCDF2345"]);
        let output = patiently("the program", command.output())
            .await
            .expect("it runs");
        assert!(!output.status.success());
        String::from_utf8_lossy(&output.stderr).into_owned()
    };
    let cases: [(&[&str], &str, &str); 5] = [
        (&["llm"], "", "--endpoint <URL>"),
        (
            &["llm", "--endpoint", "here", "--model", "m"],
            "",
            "an example is http://127.0.0.1:8080/v1",
        ),
        (
            &["llm", "--endpoint", "http://127.0.0.1:1", "--model", "m"],
            "a\nb",
            "a key has letters",
        ),
        (
            &[
                "llm",
                "--endpoint",
                "http://127.0.0.1:1",
                "--model",
                "m",
                "--temperature",
                "3",
            ],
            "",
            "from 0 to 2",
        ),
        (
            &["greedy", "--model", "m"],
            "",
            "--endpoint and --model are for the agent llm",
        ),
    ];
    for (arguments, key, expected) in cases {
        let said = refused(arguments, key).await;
        assert!(said.contains(expected), "{arguments:?}: {said}");
    }
}

/// The result of a model in two games of the benchmark.
async fn benchmark(script: Script) -> Value {
    let (url, _) = endpoint(script).await;
    let folder = tempfile::tempdir().expect("a folder");
    let program = set_up("CHEFSHAT_BIN");
    let program = program.to_str().expect("a path in UTF-8");
    let out = folder.path().to_str().expect("a path in UTF-8");
    let start = ["bench", "run", "language_model", "--deals", "2", "--json"];
    let mut command = chefshat(&start, KEY);
    command.args(["--name", "test-1", "--out", out, "--", program]);
    command.args(["agent", "llm", "--server", "{url}", "--code", "{code}"]);
    command.args(["--endpoint", &url, "--model", "ada/test-1"]);
    command.args(["--price", "0.5,2"]);
    let output = patiently("two games", command.output()).await;
    let output = output.expect("it runs");
    let problems = String::from_utf8_lossy(&output.stderr);
    assert_eq!(
        output.status.code(),
        Some(1),
        "two of 100 deals: {problems}"
    );
    serde_json::from_slice(&output.stdout).unwrap_or_else(|error| panic!("{error}: {problems}"))
}

#[tokio::test(flavor = "multi_thread")]
async fn a_model_has_a_result_in_the_benchmark_only_if_it_decides() {
    let honest = benchmark(honest).await;
    assert_eq!(honest["played_by"], json!(["test-1"]));
    assert_eq!(honest["fallback_decisions"], 0);
    assert_eq!(honest["problems"], json!(["2 of 100 deals"]));
    let choices = honest["choices"].as_u64().expect("a number");
    let taken = &honest["language_model"];
    assert_eq!(taken["tokens"], 500 * choices);
    let expected = choices as f64 * (492.0 * 0.5 + 8.0 * 2.0) / 1e6;
    let cost = taken["cost"].as_f64().expect("a number");
    assert!((cost - expected).abs() < 1e-9, "{cost} {expected}");
    let silent = benchmark(|asked, messages| match asked {
        // The question before each game.
        _ if messages.len() == 1 => Said::Text("{\"action\": 1}".into(), 10),
        _ => Said::Text("I would rather not say.".into(), 10),
    });
    let silent = silent.await;
    assert_eq!(silent["fallback_decisions"], silent["choices"]);
    assert!(
        silent["problems"][1]
            .as_str()
            .expect("a second problem")
            .contains("fallback")
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn several_models_play_a_series_within_a_budget() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("models.toml");
    let out = folder.path().join("results");
    let program = set_up("CHEFSHAT_BIN");
    let mut text = "task = \"language_model\"\n[[agents]]\nagent = \"greedy\"\n".to_owned();
    for name in ["ada", "bea"] {
        let (url, _) = endpoint(honest).await;
        let words = [program.to_str().expect("a path in UTF-8"), "agent", "llm"];
        let asked = ["--endpoint", &url, "--model", name, "--price", "0.5,2"];
        let game = ["--server", "{url}", "--code", "{code}"];
        let command = [&words[..], &asked, &game].concat();
        text += &format!("[[agents]]\nname = {name:?}\ncommand = {command:?}\n");
    }
    let broken = "[[agents]]\nname = \"broken\"\ncommand = [\"false\", \"{url}\", \"{code}\"]\n";
    let play = async |text: &str, budget: &str| {
        std::fs::write(&file, text).expect("written");
        let mut command = chefshat(&["bench", "series", "--deals", "6", "--json"], KEY);
        command
            .args(["--budget", budget, "--out"])
            .arg(&out)
            .arg(&file);
        let output = patiently("the series", command.output()).await;
        let output = output.expect("it runs");
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        let table: Value = serde_json::from_slice(&output.stdout).expect(&said);
        let rows = table["tasks"][0]["rows"].as_array().expect("rows").clone();
        (output.status.code(), rows, said)
    };
    let of = |rows: &[Value], name: &str, what: &str| {
        let row = rows.iter().find(|row| row["agent"]["name"] == name);
        row.expect(name)
            .pointer(what)
            .and_then(Value::as_f64)
            .expect(what)
    };
    // Six games of both cost more.
    let budget = 0.02;
    let (code, rows, said) = play(&format!("{text}{broken}"), &budget.to_string()).await;
    assert_eq!(code, Some(1), "{said}");
    assert!(said.contains("ends the series"), "{said}");
    assert!(said.contains("broken has fewer than two records"), "{said}");
    let cost = |rows: &[Value], name: &str| of(rows, name, "/language_model/cost");
    let spent = cost(&rows, "ada") + cost(&rows, "bea");
    assert!(spent <= budget, "{spent}");
    let deals = ["greedy", "ada", "bea"].map(|name| of(&rows, name, "/deals"));
    assert!((2.0..6.0).contains(&deals[0]), "{deals:?}");
    assert_eq!(deals, [deals[0]; 3]);
    // The budget is raised, and what is missing is played.
    let (code, more, said) = play(&text, "1").await;
    assert_eq!(code, Some(0), "{said}");
    for name in ["greedy", "ada", "bea"] {
        assert_eq!(of(&more, name, "/deals"), 6.0, "{said}");
    }
    assert!(cost(&more, "ada") > cost(&rows, "ada"));

    let unpriced = text.replace("\"--price\", \"0.5,2\", ", "");
    assert_ne!(unpriced, text);
    let other = folder.path().join("unpriced");
    let mut command = chefshat(&["bench", "series", "--deals", "6", "--budget", "1"], KEY);
    std::fs::write(&file, unpriced).expect("written");
    command.arg("--out").arg(&other).arg(&file);
    let output = patiently("the series", command.output())
        .await
        .expect("it runs");
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(said.contains("Add --price to its command"), "{said}");
    assert_eq!(output.status.code(), Some(1));
}
