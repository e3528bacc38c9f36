//! Where webhooks go, and what signs them.

use std::fmt;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use chefshat_base::post::{PostError, Target};

/// Pause after the first attempt; it doubles with each further one.
pub const FIRST_PAUSE: Duration = Duration::from_secs(1);

/// Where webhooks go.
#[derive(Clone)]
pub struct WebhookSettings {
    pub(super) target: Arc<Target>,
    /// The secret that signs requests.
    pub(super) secret: Arc<[u8]>,
    pub(super) first_pause: Duration,
}

/// Without the secret, and the address, which may contain one.
impl fmt::Debug for WebhookSettings {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("WebhookSettings")
    }
}

impl WebhookSettings {
    /// Sends webhooks to an address, http or https, signed with a secret. `ca`: the file of the
    /// authorities that certify the receiver; `None`: the system's.
    ///
    /// # Errors
    /// The address or the file cannot be used.
    pub fn new(url: &str, secret: &[u8], ca: Option<&Path>) -> Result<Self, PostError> {
        Ok(Self {
            target: Arc::new(Target::new(url, ca)?),
            secret: secret.into(),
            first_pause: FIRST_PAUSE,
        })
    }

    /// Repeats with shorter pauses, for tests.
    #[must_use]
    pub fn pausing(self, first_pause: Duration) -> Self {
        Self {
            first_pause,
            ..self
        }
    }
}
