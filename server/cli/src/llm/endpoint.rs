//! The chat completions that servers of language models share: `POST …/chat/completions` with
//! messages, and a text with the tokens it took.

use std::fmt;
use std::time::Duration;

use chefshat_server::post::{PostError, Target};
use serde::{Deserialize, Serialize};
use serde_json::json;

/// Maximum bytes of an answer.
const MAX_ANSWER_BYTES: usize = 1 << 20;
/// Bytes of text that take at least one token, to count what a server does not.
const MOST_BYTES_PER_TOKEN: usize = 8;
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
}

/// Why there is no completion.
#[derive(Debug, thiserror::Error)]
pub(super) enum EndpointError {
    /// Trying again may help, after this time at the earliest.
    #[error("{problem}")]
    Passing { problem: String, pause: Duration },
    /// It would be the same again.
    #[error("{0}")]
    Lasting(String),
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
}

#[derive(Deserialize)]
struct Answered {
    #[serde(default)]
    choices: Vec<Choice>,
    #[serde(default)]
    usage: Option<Usage>,
}

#[derive(Deserialize)]
struct Choice {
    message: Said,
}

#[derive(Deserialize)]
struct Said {
    #[serde(default)]
    content: Option<String>,
}

#[derive(Deserialize)]
struct Usage {
    #[serde(default)]
    total_tokens: Option<u64>,
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
            PostError::Address(_) => format!(
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
        })
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
        let mut question = json!({
            "model": self.model,
            "messages": messages,
            "max_tokens": self.answer_tokens,
            "stream": false,
        });
        if let Some(temperature) = self.temperature {
            question["temperature"] = json!(temperature);
        }
        if let Some(seed) = self.seed {
            question["seed"] = json!(seed);
        }
        let asked: usize = messages.iter().map(|message| message.content.len()).sum();
        let body = question.to_string();
        let key = self.key.iter();
        let headers = key.map(|key| ("authorization", format!("Bearer {key}")));
        let answer = self
            .target
            .post(body, headers, time, MAX_ANSWER_BYTES)
            .await;
        let answer = answer.map_err(|error| problem(error, asked))?;
        let lasting = |problem: &str| (EndpointError::Lasting(problem.to_owned()), at_least(asked));
        let answered: Answered = serde_json::from_slice(&answer.body)
            .map_err(|_| lasting("the answer is not a chat completion"))?;
        let choice = answered.choices.into_iter().next();
        let text = choice.ok_or_else(|| lasting("the answer has no choice"))?;
        let text = text.message.content.unwrap_or_default();
        let reported = answered.usage.and_then(|usage| usage.total_tokens);
        let tokens = reported.unwrap_or(0).max(at_least(asked + text.len()));
        Ok(Completion { text, tokens })
    }
}

/// Tokens that a text with this number of bytes has at least, whatever a server reports.
fn at_least(bytes: usize) -> u64 {
    u64::try_from(bytes.div_ceil(MOST_BYTES_PER_TOKEN)).unwrap_or(u64::MAX)
}

/// An error in words, and what the question has cost.
fn problem(error: PostError, asked: usize) -> (EndpointError, u64) {
    let passing = |problem: String, pause| EndpointError::Passing { problem, pause };
    match error {
        PostError::Status(answer) if answer.status.is_server_error() || answer.status == 429 => {
            let pause = answer.retry_after.unwrap_or(Duration::from_secs(1));
            (
                passing(format!("the endpoint answered {}", answer.status), pause),
                0,
            )
        }
        PostError::Status(answer) => {
            let problem = format!("the endpoint answered {}", answer.status);
            (EndpointError::Lasting(problem), 0)
        }
        // The model may have worked on it.
        error @ (PostError::Timeout(_) | PostError::Body(_)) => {
            (passing(error.to_string(), Duration::ZERO), at_least(asked))
        }
        error => (passing(error.to_string(), Duration::from_secs(1)), 0),
    }
}
