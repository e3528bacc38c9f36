//! The file that holds the tokens of a server, as hashes: `tokens.json` in its data directory.
//! `chefshat token` edits it, also while a server runs; every change replaces the file atomically,
//! under a lock between editors. Readers need no lock.

use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use std::time::Duration;

use chefshat_record::atomic_file::{AtomicFile, WriteError};
use chefshat_record::private;
use chefshat_room::ids::{Id, SecretHash, random_bytes};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use tracing::warn;

use super::caller::{Role, Scope};
use super::token::{AccessToken, TokenId};
use chefshat_base::clock::since_epoch_ms;

/// Name of the file in the data directory. A data directory that contains it belongs to a server
/// that requires tokens.
pub const TOKENS_FILE: &str = "tokens.json";
/// The file that editors lock.
const LOCK_FILE: &str = "tokens.lock";
/// The form of the file that is written, and the newest that is read.
const VERSION: u32 = 1;

/// Why the tokens file cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum TokenFileError {
    /// It cannot be read.
    #[error("cannot read the tokens in {path}: {source}")]
    Read {
        /// The file.
        path: PathBuf,
        /// The error of the file system.
        source: io::Error,
    },
    /// It cannot be written.
    #[error("cannot write the tokens to {0}")]
    Write(#[from] WriteError),
    /// It cannot be locked.
    #[error("cannot lock {path}: {source}")]
    Lock {
        /// The lock file.
        path: PathBuf,
        /// The error of the file system.
        source: io::Error,
    },
    /// Its content is not that of a tokens file.
    #[error(
        "{path} is not a file of tokens: {problem}; restore it from a backup, or move it away and create new tokens"
    )]
    Malformed {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        problem: String,
    },
    /// It no longer exists, although it had tokens.
    #[error("{0} is gone; restore it, and revoke tokens with `chefshat token revoke`")]
    Gone(PathBuf),
    /// A later version of the program wrote it.
    #[error("{path} was written by a newer version of chefshat (form {version}); use that version")]
    TooNew {
        /// The file.
        path: PathBuf,
        /// Its form.
        version: u32,
    },
}

/// A token as stored.
#[derive(Debug, Clone)]
pub struct StoredToken {
    /// Its public part.
    pub id: TokenId,
    /// The hash of its secret.
    pub hash: SecretHash,
    /// What its bearer may do.
    pub role: Role,
    /// What it was created for, in words.
    pub label: String,
    /// Milliseconds since the Unix epoch when it was created.
    pub created_at_ms: u64,
    /// Milliseconds since the Unix epoch from which it is invalid, if ever.
    pub expires_at_ms: Option<u64>,
    /// The only room or tournament that it is valid for, if limited to one.
    pub scope: Option<Scope>,
}

impl StoredToken {
    /// Whether it is invalid at a time.
    pub fn is_expired(&self, now_ms: u64) -> bool {
        self.expires_at_ms.is_some_and(|expiry| expiry <= now_ms)
    }

    /// Whether `other` grants the same to the same bearer, until the same time.
    pub fn grants_the_same_as(&self, other: &Self) -> bool {
        self.hash.is(&other.hash)
            && self.role == other.role
            && self.scope == other.scope
            && self.expires_at_ms == other.expires_at_ms
    }
}

/// An entry of the file that is not that of a token. It grants nothing, and stays in the file until
/// it is revoked.
#[derive(Debug, Clone)]
pub struct Unreadable {
    /// The entry.
    entry: Value,
    /// What is wrong.
    pub problem: String,
}

impl Unreadable {
    /// The public part of the token, if it has one.
    pub fn id(&self) -> Option<TokenId> {
        self.entry.get("id")?.as_str()?.parse().ok()
    }
}

/// A token of the file, or an entry that is not that of one.
pub type Entry = Result<StoredToken, Unreadable>;

fn id_of(entry: &Entry) -> Option<TokenId> {
    match entry {
        Ok(token) => Some(token.id),
        Err(unreadable) => unreadable.id(),
    }
}

/// The settings of a new token.
#[derive(Debug, Clone)]
pub struct NewToken {
    /// What its bearer may do.
    pub role: Role,
    /// What it is for, in words.
    pub label: String,
    /// How long it is valid, if not for ever.
    pub lifetime: Option<Duration>,
    /// The only room or tournament that it is valid for, if limited to one.
    pub scope: Option<Scope>,
}

/// The tokens file of a data directory. It may not exist: then there are no tokens.
#[derive(Debug, Clone)]
pub struct TokenFile {
    path: PathBuf,
}

impl TokenFile {
    /// The file of this data directory.
    pub fn of(data_dir: &Path) -> Self {
        let path = data_dir.join(TOKENS_FILE);
        Self { path }
    }

    /// Its path.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The tokens, in the order of creation; `None` if there is no file. Logs entries that are not
    /// those of tokens.
    ///
    /// # Errors
    /// The file is unreadable.
    pub fn read(&self) -> Result<Option<Vec<StoredToken>>, TokenFileError> {
        let Some(entries) = self.entries()? else {
            return Ok(None);
        };
        let readable = |entry: Entry| match entry {
            Ok(token) => Some(token),
            Err(Unreadable { problem, .. }) => {
                warn!(problem, "an entry of the tokens file grants nothing");
                None
            }
        };
        Ok(Some(entries.into_iter().filter_map(readable).collect()))
    }

    /// All entries, in the order of creation, without copies of the same token; `None` if there is no
    /// file.
    ///
    /// # Errors
    /// The file is unreadable.
    pub fn entries(&self) -> Result<Option<Vec<Entry>>, TokenFileError> {
        let path = || self.path.clone();
        let text = match std::fs::read(&self.path) {
            Ok(text) => text,
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
            Err(source) => {
                return Err(TokenFileError::Read {
                    path: path(),
                    source,
                });
            }
        };
        let malformed = |problem: String| TokenFileError::Malformed {
            path: path(),
            problem,
        };
        let form: Form = serde_json::from_slice(&text).map_err(|it| malformed(it.to_string()))?;
        if form.version > VERSION {
            return Err(TokenFileError::TooNew {
                path: path(),
                version: form.version,
            });
        }
        let read: Tokens<Value> =
            serde_json::from_slice(&text).map_err(|it| malformed(it.to_string()))?;
        let mut entries: Vec<Entry> = Vec::new();
        for entry in read.tokens {
            let line = Line::deserialize(&entry).map_err(|it| it.to_string());
            let read = line.and_then(Line::read).and_then(|token| {
                match entries.iter().flatten().find(|other| other.id == token.id) {
                    None => Ok(Some(token)),
                    Some(other) if other.grants_the_same_as(&token) => Ok(None),
                    Some(_) => Err("another token has the same id".to_owned()),
                }
            });
            let read = read.map_err(|problem| {
                let id = entry.get("id").unwrap_or(&Value::Null);
                let problem = format!("token {id}: {problem}");
                Unreadable { entry, problem }
            });
            entries.extend(read.transpose());
        }
        Ok(Some(entries))
    }

    /// Adds a token and returns it with its secret, which is stored nowhere.
    ///
    /// # Errors
    /// The file cannot be read or written.
    pub fn create(&self, new: NewToken) -> Result<AccessToken, TokenFileError> {
        let _lock = self.lock()?;
        let mut entries = self.entries()?.unwrap_or_default();
        let id = loop {
            let id = TokenId(random_bytes());
            if entries.iter().all(|entry| id_of(entry) != Some(id)) {
                break id;
            }
        };
        let token = AccessToken::random(id);
        let now = since_epoch_ms();
        let lifetime_ms = |it: Duration| u64::try_from(it.as_millis()).unwrap_or(u64::MAX);
        entries.push(Ok(StoredToken {
            id,
            hash: token.hash(),
            role: new.role,
            label: new.label,
            created_at_ms: now,
            expires_at_ms: new.lifetime.map(|it| now.saturating_add(lifetime_ms(it))),
            scope: new.scope,
        }));
        self.write(&entries)?;
        Ok(token)
    }

    /// Removes the entries with this id and returns the first; `None` if there is none.
    ///
    /// # Errors
    /// The file cannot be read or written.
    pub fn revoke(&self, id: TokenId) -> Result<Option<Entry>, TokenFileError> {
        let _lock = self.lock()?;
        let entries = self.entries()?.unwrap_or_default();
        let is_revoked = |entry: &Entry| id_of(entry) == Some(id);
        let (revoked, kept): (Vec<_>, Vec<_>) = entries.into_iter().partition(is_revoked);
        let revoked = revoked.into_iter().next();
        if revoked.is_some() {
            self.write(&kept)?;
        }
        Ok(revoked)
    }

    /// Locks the file against other editors, until the lock is dropped.
    fn lock(&self) -> Result<File, TokenFileError> {
        let path = self.path.with_file_name(LOCK_FILE);
        let open = || {
            let mut options = private::options();
            options.create(true).write(true).truncate(false);
            let file = options.open(&path)?;
            file.lock()?;
            Ok(file)
        };
        open().map_err(|source| TokenFileError::Lock {
            path: path.clone(),
            source,
        })
    }

    fn write(&self, entries: &[Entry]) -> Result<(), TokenFileError> {
        let written = |entry: &Entry| match entry {
            Ok(token) => Written::Line(Line::of(token)),
            Err(unreadable) => Written::Unreadable(unreadable.entry.clone()),
        };
        let tokens = Tokens {
            version: VERSION,
            tokens: entries.iter().map(written).collect(),
        };
        let text = serde_json::to_vec_pretty(&tokens).expect("the form has only texts and numbers");
        let mut file = AtomicFile::create_private(&self.path)?;
        file.write_all(&text)?;
        file.write_all(b"\n")?;
        Ok(file.finish()?)
    }
}

/// What every version of the file has.
#[derive(Deserialize)]
struct Form {
    version: u32,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Tokens<T> {
    version: u32,
    tokens: Vec<T>,
}

#[derive(Serialize)]
#[serde(untagged)]
enum Written {
    Line(Line),
    Unreadable(Value),
}

/// A token in the file.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Line {
    id: String,
    role: Role,
    #[serde(default, skip_serializing_if = "String::is_empty")]
    label: String,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    room: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    tournament: Option<String>,
    created_at_ms: u64,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    expires_at_ms: Option<u64>,
    sha256: String,
}

impl Line {
    fn of(token: &StoredToken) -> Self {
        let (room, tournament) = match token.scope {
            None => (None, None),
            Some(Scope::Room(id)) => (Some(id.to_string()), None),
            Some(Scope::Tournament(id)) => (None, Some(id.to_string())),
        };
        Self {
            id: token.id.to_string(),
            role: token.role,
            label: token.label.clone(),
            room,
            tournament,
            created_at_ms: token.created_at_ms,
            expires_at_ms: token.expires_at_ms,
            sha256: hex::encode(token.hash.bytes()),
        }
    }

    fn read(self) -> Result<StoredToken, String> {
        let id: TokenId = self.id.parse()?;
        let wrong = |field: &str| format!("`{field}` is not valid");
        let scope = match (&self.room, &self.tournament) {
            (None, None) => None,
            (Some(room), None) => Some(Scope::Room(Id::parse(room).ok_or_else(|| wrong("room"))?)),
            (None, Some(it)) => Some(Scope::Tournament(
                Id::parse(it).ok_or_else(|| wrong("tournament"))?,
            )),
            (Some(_), Some(_)) => return Err(wrong("room")),
        };
        let mut hash = [0; 32];
        hex::decode_to_slice(&self.sha256, &mut hash).map_err(|_| wrong("sha256"))?;
        Ok(StoredToken {
            id,
            hash: SecretHash::from_bytes(hash),
            role: self.role,
            label: self.label,
            created_at_ms: self.created_at_ms,
            expires_at_ms: self.expires_at_ms,
            scope,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn player(label: &str) -> NewToken {
        NewToken {
            role: Role::Player,
            label: label.to_owned(),
            lifetime: None,
            scope: None,
        }
    }

    #[test]
    fn created_tokens_are_read_back_until_they_are_revoked() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = TokenFile::of(folder.path());
        assert!(file.read().expect("readable").is_none());
        let ana = file.create(player("Ana")).expect("written");
        let room = Id::random();
        let host = file
            .create(NewToken {
                role: Role::Host,
                label: String::new(),
                lifetime: Some(Duration::from_secs(60)),
                scope: Some(Scope::Room(room)),
            })
            .expect("written");
        let text = std::fs::read_to_string(file.path()).expect("a file");
        for token in [&ana, &host] {
            let (_, secret) = token
                .to_text()
                .rsplit_once(&format!("{}_", token.id))
                .map(|(prefix, secret)| (prefix.to_owned(), secret.to_owned()))
                .expect("an id");
            assert!(!text.contains(&secret), "{text}");
        }
        let tokens = file.read().expect("readable").expect("a file");
        assert_eq!(tokens.len(), 2);
        assert!(tokens[0].hash.is(&ana.hash()) && tokens[0].label == "Ana");
        assert_eq!((tokens[0].role, tokens[0].scope), (Role::Player, None));
        assert_eq!(tokens[1].scope, Some(Scope::Room(room)));
        let expiry = tokens[1].expires_at_ms.expect("it expires");
        assert_eq!(expiry, tokens[1].created_at_ms + 60_000);
        assert!(tokens[1].is_expired(expiry) && !tokens[1].is_expired(expiry - 1));
        assert!(file.revoke(ana.id).expect("written").is_some());
        assert!(file.revoke(ana.id).expect("written").is_none());
        assert_eq!(file.read().expect("readable").expect("a file").len(), 1);
    }

    #[cfg(unix)]
    #[test]
    fn only_its_owner_reads_the_file() {
        use std::os::unix::fs::PermissionsExt as _;
        let folder = tempfile::tempdir().expect("a folder");
        let file = TokenFile::of(folder.path());
        file.create(player("")).expect("written");
        let mode = std::fs::metadata(file.path())
            .expect("a file")
            .permissions()
            .mode();
        assert_eq!(mode & 0o777, 0o600);
    }

    #[test]
    fn a_damaged_file_is_refused_and_left_as_it_is() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = TokenFile::of(folder.path());
        for (text, problem) in [
            ("", "is not a file of tokens"),
            (r#"{"version":2,"tokens":[],"more":1}"#, "newer version"),
            (
                r#"{"version":1,"tokens":[],"more":1}"#,
                "unknown field `more`",
            ),
        ] {
            std::fs::write(file.path(), text).expect("written");
            let error = file.read().expect_err("damaged").to_string();
            assert!(error.contains(problem), "{error}");
            assert!(file.create(player("")).is_err());
            assert_eq!(std::fs::read_to_string(file.path()).expect("a file"), text);
        }
    }

    #[test]
    fn an_entry_that_is_not_a_token_grants_nothing_and_stays_until_it_is_revoked() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = TokenFile::of(folder.path());
        let line = r#"{"id":"0000000N","role":"ROLE","created_at_ms":0,"sha256":"HASH"}"#;
        let line = |number: &str, role: &str, hash: &str| {
            let line = line.replace("0000000N", &format!("0000000{number}"));
            line.replace("ROLE", role).replace("HASH", hash)
        };
        let (hash, other) = ("0".repeat(64), "1".repeat(64));
        let lines = [
            line("1", "operator", &hash),
            line("2", "host", "short"),
            line("3", "host", &hash),
            // A copy, and a different token with its id.
            line("3", "host", &hash),
            line("3", "host", &other),
            "7".to_owned(),
        ];
        let text = format!(r#"{{"version":1,"tokens":[{}]}}"#, lines.join(","));
        std::fs::write(file.path(), text).expect("written");
        let problems = || {
            let entries = file.entries().expect("readable").expect("a file");
            let problems = entries.into_iter().filter_map(Result::err);
            problems.map(|it| it.problem).collect::<Vec<_>>()
        };
        let found = problems();
        for (problem, said) in found.iter().zip([
            "token \"00000001\": unknown variant `operator`",
            "token \"00000002\": `sha256` is not valid",
            "token \"00000003\": another token has the same id",
            "token null: invalid type",
        ]) {
            assert!(problem.starts_with(said), "{problem}");
        }
        assert_eq!(found.len(), 4);
        let ids = || {
            let tokens = file.read().expect("readable").expect("a file");
            tokens
                .iter()
                .map(|it| it.id.to_string())
                .collect::<Vec<_>>()
        };
        assert_eq!(ids(), ["00000003"]);
        let revoke = |id: &str| file.revoke(id.parse().expect("an id")).expect("written");
        assert!(revoke("00000003").is_some_and(|entry| entry.is_ok()));
        assert_eq!(ids(), [""; 0], "all copies are gone");
        assert_eq!(problems().len(), 3);
        assert!(revoke("00000001").is_some_and(|entry| entry.is_err()));
        file.create(player("Ana")).expect("written");
        assert_eq!((ids().len(), problems().len()), (1, 2));
    }
}
