//! The chat completions that servers of language models share: `POST …/chat/completions` with
//! messages, and a text with the tokens it took.

use std::fmt;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use chefshat_record::language_model::Usage;
use chefshat_server::post::{Answer, PostError, Target};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};
use sha2::{Digest as _, Sha256};

/// Maximum bytes of an answer.
const MAX_ANSWER_BYTES: usize = 1 << 20;
/// Bytes of text that take at least one token, to count what a server does not.
const MOST_BYTES_PER_TOKEN: usize = 8;
/// Maximum characters of a server's own words about an error.
const MAX_PROBLEM_CHARS: usize = 300;
/// The members of a question that limit an answer: the usual one, and that of models which think
/// first.
const ANSWER_LIMIT: &str = "max_tokens";
const LATER_ANSWER_LIMIT: &str = "max_completion_tokens";
/// How long the first question may take: a server may have to load the model.
const FIRST_ANSWER: Duration = Duration::from_secs(120);
/// How often it is asked.
const FIRST_ATTEMPTS: u32 = 3;
/// The first question, which no game depends on, in the form of those that follow.
const FIRST_QUESTION: &str = "\
Before the game: a question to see whether you can be asked. Answer with one JSON object: {\"action\": \"a199\"}\noptions\na199=pass";
/// Longest text in which a record says how a model is asked.
const MAX_SAMPLING_BYTES: usize = 1_024;
/// What follows the address that is given.
const PATH: &str = "/chat/completions";

/// A message of a conversation.
#[derive(Debug, Clone, Serialize)]
pub(super) struct Message {
    role: &'static str,
    content: String,
}

impl Message {
    /// What the model is.
    pub(super) fn system(content: impl Into<String>) -> Self {
        let (role, content) = ("system", content.into());
        Self { role, content }
    }

    /// What it is asked.
    pub(super) fn user(content: impl Into<String>) -> Self {
        let (role, content) = ("user", content.into());
        Self { role, content }
    }

    /// What it has answered.
    pub(super) fn assistant(content: impl Into<String>) -> Self {
        let (role, content) = ("assistant", content.into());
        Self { role, content }
    }
}

/// What a server has answered.
#[derive(Debug)]
pub(super) struct Completion {
    pub(super) text: String,
    /// Tokens of the question and the answer.
    pub(super) tokens: u64,
    /// The same in parts, if the server reports them.
    pub(super) usage: Option<Usage>,
    /// Whether it ends because it may not be longer.
    pub(super) cut: bool,
}

/// Why there is no completion.
#[derive(Debug)]
pub(super) struct EndpointError {
    /// In the words of this program.
    pub(super) problem: String,
    /// In those of the server, without the key. They may name an account, which no record shows.
    pub(super) words: Option<String>,
    /// Trying again may help, after this time at the earliest; `None`: it would be the same again.
    pub(super) pause: Option<Duration>,
}

impl fmt::Display for EndpointError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.problem)?;
        match &self.words {
            Some(words) => write!(f, ": {words}"),
            None => Ok(()),
        }
    }
}

/// A server of language models.
pub(crate) struct Endpoint {
    target: Target,
    key: Option<String>,
    model: String,
    /// Maximum tokens of an answer.
    pub(super) answer_tokens: u32,
    pub(super) temperature: Option<f32>,
    pub(super) seed: Option<u64>,
    /// Further members of each question.
    pub(super) extra: Map<String, Value>,
    /// Whether this server wants [`LATER_ANSWER_LIMIT`].
    wants_later_limit: AtomicBool,
}

#[derive(Deserialize)]
struct Answered {
    #[serde(default)]
    choices: Vec<Choice>,
    /// A [`Reported`], if it can be read: without it an answer is still one.
    #[serde(default)]
    usage: Value,
}

#[derive(Deserialize)]
struct Choice {
    message: Said,
    #[serde(default)]
    finish_reason: Option<String>,
}

#[derive(Deserialize)]
struct Said {
    #[serde(default)]
    content: Option<Content>,
    #[serde(default)]
    tool_calls: Option<Vec<ToolCall>>,
}

#[derive(Deserialize)]
#[serde(untagged)]
enum Content {
    Text(String),
    Parts(Vec<Part>),
}

/// A part of a text; those of other types have none.
#[derive(Deserialize)]
struct Part {
    #[serde(default)]
    text: String,
}

#[derive(Deserialize)]
struct ToolCall {
    function: Called,
}

#[derive(Deserialize)]
struct Called {
    arguments: Value,
}

impl Said {
    /// What was said, or else what a tool was called with: some models answer so without being
    /// offered one.
    fn text(self) -> String {
        let text = match self.content {
            Some(Content::Text(text)) => text,
            Some(Content::Parts(parts)) => parts.into_iter().map(|part| part.text).collect(),
            None => String::new(),
        };
        let call = self.tool_calls.and_then(|calls| calls.into_iter().next());
        match call {
            Some(call) if text.trim().is_empty() => match call.function.arguments {
                Value::String(arguments) => arguments,
                arguments => arguments.to_string(),
            },
            _ => text,
        }
    }
}

#[derive(Deserialize)]
struct Reported {
    #[serde(default)]
    total_tokens: Option<u64>,
    #[serde(default)]
    prompt_tokens: Option<u64>,
    #[serde(default)]
    completion_tokens: Option<u64>,
    #[serde(default)]
    prompt_tokens_details: Option<PromptDetails>,
    #[serde(default)]
    completion_tokens_details: Option<CompletionDetails>,
}

#[derive(Deserialize)]
struct PromptDetails {
    #[serde(default)]
    cached_tokens: Option<u64>,
}

#[derive(Deserialize)]
struct CompletionDetails {
    #[serde(default)]
    reasoning_tokens: Option<u64>,
}

impl Reported {
    fn parts(&self) -> Option<Usage> {
        let (prompt, completion) = (&self.prompt_tokens_details, &self.completion_tokens_details);
        let cached = prompt.as_ref().and_then(|it| it.cached_tokens);
        let reasoning = completion.as_ref().and_then(|it| it.reasoning_tokens);
        let usage = Usage {
            prompt: self.prompt_tokens.unwrap_or(0),
            cached: cached.unwrap_or(0),
            completion: self.completion_tokens.unwrap_or(0),
            reasoning: reasoning.unwrap_or(0),
        };
        (usage != Usage::default()).then_some(usage)
    }
}

/// Leaves out the key.
impl fmt::Debug for Endpoint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Endpoint").field(&self.model).finish()
    }
}

impl Endpoint {
    /// A model of a server. `address`: up to the version, for example `http://127.0.0.1:8080/v1`.
    ///
    /// # Errors
    /// The address or the key cannot be used.
    pub(super) fn new(address: &str, key: Option<String>, model: &str) -> Result<Self, String> {
        let address = address.trim_end_matches('/');
        let address = address.strip_suffix(PATH).unwrap_or(address);
        let target = Target::new(&format!("{address}{PATH}"), None).map_err(|error| match error {
            PostError::Address => format!(
                "{address:?} is not the address of a server of language models; an example is http://127.0.0.1:8080/v1"
            ),
            error => error.to_string(),
        })?;
        if let Some(key) = &key
            && !key.bytes().all(|byte| byte.is_ascii_graphic())
        {
            return Err("a key has letters, digits and punctuation only".to_owned());
        }
        Ok(Self {
            target,
            key,
            model: model.to_owned(),
            answer_tokens: 1_000,
            temperature: None,
            seed: None,
            extra: Map::new(),
            wants_later_limit: AtomicBool::new(false),
        })
    }

    /// Asks a first question, so that a wrong address, key, model or setting shows before a seat is
    /// taken.
    ///
    /// # Errors
    /// The server does not answer with a chat completion.
    pub(crate) async fn check(&self) -> Result<(), String> {
        let question = [Message::user(FIRST_QUESTION)];
        let mut attempts = 0;
        loop {
            attempts += 1;
            match self.complete(&question, FIRST_ANSWER).await {
                Ok(_) => return Ok(()),
                Err((error, _)) => match error.pause {
                    Some(pause) if attempts < FIRST_ATTEMPTS && pause <= FIRST_ANSWER => {
                        tokio::time::sleep(pause).await;
                    }
                    _ => return Err(format!("{} cannot be asked: {error}", self.model)),
                },
            }
        }
    }

    /// The model's name.
    pub(super) fn model(&self) -> &str {
        &self.model
    }

    /// Asks for the next message of a conversation, which arrives within `time` or not at all.
    ///
    /// # Errors
    /// There is none, and the tokens that the question has cost at least.
    pub(super) async fn complete(
        &self,
        messages: &[Message],
        time: Duration,
    ) -> Result<Completion, (EndpointError, u64)> {
        let asked: usize = messages.iter().map(|message| message.content.len()).sum();
        let answer = self.post(messages, time).await;
        let answer = answer.map_err(|error| self.problem(error, asked))?;
        let lasting = |problem: &str| {
            let error = EndpointError {
                problem: problem.to_owned(),
                words: None,
                pause: None,
            };
            (error, at_least(asked))
        };
        let answered: Answered = serde_json::from_slice(&answer.body)
            .map_err(|_| lasting("the answer is not a chat completion"))?;
        let choice = answered.choices.into_iter().next();
        let choice = choice.ok_or_else(|| lasting("the answer has no choice"))?;
        let cut = choice.finish_reason.as_deref() == Some("length");
        let text = choice.message.text();
        let reported = serde_json::from_value::<Reported>(answered.usage).ok();
        let usage = reported.as_ref().and_then(Reported::parts);
        let reported = reported.and_then(|usage| usage.total_tokens);
        let tokens = reported.unwrap_or(0).max(at_least(asked + text.len()));
        Ok(Completion {
            text,
            tokens,
            usage,
            cut,
        })
    }

    /// What is asked with every question, in its form: `limit` is the member that limits the answer.
    fn sampling(&self, limit: &str) -> Value {
        let mut sampling = json!({ limit: self.answer_tokens });
        if let Some(temperature) = self.temperature {
            sampling["temperature"] = json!(temperature);
        }
        if let Some(seed) = self.seed {
            sampling["seed"] = json!(seed);
        }
        for (name, value) in &self.extra {
            sampling[name] = value.clone();
        }
        sampling
    }

    /// How the model is asked, as a record says it: host and port, and a JSON object of what is asked
    /// with every question, or its digest if that is long.
    pub(super) fn described(&self) -> (String, String) {
        let sampling = self.sampling(ANSWER_LIMIT).to_string();
        let sampling = match sampling.len() {
            ..=MAX_SAMPLING_BYTES => sampling,
            _ => format!("sha256:{}", hex::encode(Sha256::digest(sampling))),
        };
        (self.target.authority(), sampling)
    }

    async fn post(&self, messages: &[Message], time: Duration) -> Result<Answer, PostError> {
        let limit = match self.wants_later_limit.load(Ordering::Relaxed) {
            true => LATER_ANSWER_LIMIT,
            false => ANSWER_LIMIT,
        };
        let mut question = self.sampling(limit);
        question["model"] = json!(self.model);
        question["messages"] = json!(messages);
        question["stream"] = json!(false);
        let key = self.key.iter();
        let headers = key.map(|key| ("authorization", format!("Bearer {key}")));
        (self.target)
            .post(question.to_string(), headers, time, MAX_ANSWER_BYTES)
            .await
    }

    /// An error in words, and what the question has cost.
    fn problem(&self, error: PostError, asked: usize) -> (EndpointError, u64) {
        let (pause, tokens) = match &error {
            PostError::Status(answer) => return (self.refusal(answer), 0),
            // The model may have worked on it.
            PostError::Timeout(_) | PostError::Body(_) => (Duration::ZERO, at_least(asked)),
            _ => (Duration::from_secs(1), 0),
        };
        let error = EndpointError {
            problem: error.to_string(),
            words: None,
            pause: Some(pause),
        };
        (error, tokens)
    }

    /// A refusal of the server.
    fn refusal(&self, answer: &Answer) -> EndpointError {
        let mut problem = format!("the endpoint answered {}", answer.status);
        if answer.status.is_redirection() {
            problem += ", which means another address: give that";
        }
        let passes =
            answer.status.is_server_error() || answer.status == 429 || self.learns_limit(answer);
        EndpointError {
            problem,
            words: self.words_of(&answer.body),
            pause: passes.then(|| answer.retry_after.unwrap_or(Duration::from_secs(1))),
        }
    }

    /// Whether an answer says for the first time that this server wants [`LATER_ANSWER_LIMIT`].
    fn learns_limit(&self, answer: &Answer) -> bool {
        answer.status == 400
            && String::from_utf8_lossy(&answer.body).contains(LATER_ANSWER_LIMIT)
            && !self.wants_later_limit.swap(true, Ordering::Relaxed)
    }

    /// What a server says about an error, without the key.
    fn words_of(&self, body: &[u8]) -> Option<String> {
        let body: Value = serde_json::from_slice(body).ok()?;
        let error = body.get("error").unwrap_or(&body);
        let words = error.get("message").unwrap_or(error).as_str()?;
        let words = match &self.key {
            Some(key) => words.replace(key.as_str(), "…"),
            None => words.to_owned(),
        };
        let words = words.chars().filter(|it| !it.is_control());
        Some(words.take(MAX_PROBLEM_CHARS).collect())
    }
}

/// Tokens that a text with this number of bytes has at least, whatever a server reports.
fn at_least(bytes: usize) -> u64 {
    u64::try_from(bytes.div_ceil(MOST_BYTES_PER_TOKEN)).unwrap_or(u64::MAX)
}
