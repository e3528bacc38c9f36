//! Decides about each request, and ends what a token started once the token is revoked or expires.
//! Answers come from memory alone; the tokens file is read again, on a thread for it, when it
//! changes. A request with a token that is not in memory may wait for one look at the file.

use std::collections::{HashMap, HashSet};
use std::net::IpAddr;
use std::path::PathBuf;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, RwLock};
use std::time::Duration;

use tokio::time::{Instant, sleep_until};
use tokio_util::sync::CancellationToken;
use tracing::{debug, error, info, warn};

use super::caller::{Caller, Role, Scope};
use super::calls::{Call, Scoped};
use super::file::{StoredToken, TokenFile, TokenFileError};
use super::secrets::Secrets;
use super::token::{AccessToken, TokenId};
use chefshat_base::clock::since_epoch_ms;
use chefshat_base::file_watch::FileWatch;
use chefshat_base::lock::Lock;

/// How often the tokens file is looked at, and expired tokens are searched for.
const INTERVAL: Duration = Duration::from_secs(1);
/// Least time between looks at the file for tokens that are not in memory.
const LOOK_INTERVAL: Duration = Duration::from_millis(100);
/// Most unknown tokens that are remembered, so that each leads to one look.
const MAX_UNKNOWN: usize = 4_096;
/// How an `authorization` header with a token starts.
const BEARER: &[u8] = b"bearer ";

/// Whether callers need a token.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Mode {
    /// Callers without a token are hosts.
    Open,
    /// Callers need a token.
    Tokens,
}

/// The settings of access.
#[derive(Debug, Clone)]
pub struct AccessSettings {
    /// Whether callers need a token; `None`: if the tokens file exists.
    pub mode: Option<Mode>,
    /// The role of callers without a token in mode [`Mode::Tokens`].
    pub anonymous: Role,
    /// The role that is required to read records, if higher than that of the calls.
    pub records: Role,
}

impl Default for AccessSettings {
    fn default() -> Self {
        Self {
            mode: None,
            anonymous: Role::Anyone,
            records: Role::Spectator,
        }
    }
}

/// Why a request is refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Refusal {
    /// It needs a token and has none.
    TokenMissing {
        /// The minimal role.
        required: Role,
    },
    /// Its token was never created, is mistyped, or was revoked.
    TokenUnknown,
    /// Its token is no longer valid.
    TokenExpired,
    /// Its role is too low.
    RoleTooLow {
        /// The minimal role.
        required: Role,
        /// The caller's role.
        role: Role,
    },
    /// Its token is limited to something else.
    OutOfScope {
        /// What the token is valid for.
        scope: Scope,
    },
}

impl Refusal {
    /// Checks that a caller has at least this role.
    ///
    /// # Errors
    /// Its role is too low.
    pub fn of_role(caller: &Caller, required: Role) -> Result<(), Self> {
        if caller.role >= required {
            return Ok(());
        }
        Err(match caller.token {
            None => Self::TokenMissing { required },
            Some(_) => Self::RoleTooLow {
                required,
                role: caller.role,
            },
        })
    }
}

/// A caller that may proceed.
#[derive(Debug)]
pub struct Granted {
    /// The caller.
    pub caller: Caller,
    /// Ends with its token; `None` without a token.
    pub ended: Option<Ended>,
}

/// Completes when a token is revoked, expires, or comes to grant something else.
#[derive(Debug, Clone)]
pub struct Ended {
    token: CancellationToken,
    expires_at_ms: Option<u64>,
}

impl Ended {
    /// The signal.
    pub fn signal(&self) -> &CancellationToken {
        &self.token
    }

    /// Why the token is invalid, after the signal.
    pub fn refusal(&self) -> Refusal {
        match self.expires_at_ms {
            Some(expiry) if expiry <= since_epoch_ms() => Refusal::TokenExpired,
            _ => Refusal::TokenUnknown,
        }
    }
}

/// A token that the server knows.
#[derive(Debug)]
struct Known {
    token: StoredToken,
    ended: CancellationToken,
}

/// The tokens file, and what it was like when it was last read.
#[derive(Debug)]
struct Followed {
    file: TokenFile,
    watch: Lock<FileWatch>,
}

impl Followed {
    fn new(file: TokenFile) -> Self {
        let watch = Lock::new(FileWatch::of([file.path()]));
        Self { file, watch }
    }
}

/// Decides who may do what.
#[derive(Debug)]
pub struct Access {
    mode: Mode,
    /// Whether the mode was chosen, not found by the tokens file.
    is_mode_chosen: bool,
    anonymous: Role,
    records: Role,
    file: Option<Followed>,
    known: RwLock<HashMap<TokenId, Known>>,
    /// The hashes of tokens that the file did not have when it was last looked at for them.
    unknown: Lock<HashSet<[u8; 32]>>,
    /// Number of such looks that have begun.
    looks_begun: AtomicU64,
    /// The number of the last one that has ended, and when it began. Held while looking.
    looked: tokio::sync::Mutex<Option<(u64, Instant)>>,
    /// How often the file was looked at.
    #[cfg(test)]
    looks: AtomicU64,
}

impl Access {
    /// Reads the tokens of a data directory; without one there are none.
    ///
    /// # Errors
    /// The tokens file is unreadable.
    pub fn open(
        settings: &AccessSettings,
        data_dir: Option<&PathBuf>,
    ) -> Result<Self, TokenFileError> {
        // Watched before it is read: a later change is noticed.
        let file = data_dir.map(|folder| Followed::new(TokenFile::of(folder)));
        let read = file.as_ref().map(|followed| followed.file.read());
        let tokens = read.transpose()?.flatten();
        let exists = tokens.is_some();
        let access = Self {
            is_mode_chosen: settings.mode.is_some(),
            mode: settings.mode.unwrap_or(match exists {
                true => Mode::Tokens,
                false => Mode::Open,
            }),
            anonymous: settings.anonymous,
            records: settings.records,
            file,
            known: RwLock::default(),
            unknown: Lock::default(),
            looks_begun: AtomicU64::default(),
            looked: tokio::sync::Mutex::default(),
            #[cfg(test)]
            looks: AtomicU64::default(),
        };
        access.replace(tokens.unwrap_or_default());
        Ok(access)
    }

    /// Whether callers need a token.
    pub fn mode(&self) -> Mode {
        self.mode
    }

    /// Number of tokens.
    pub fn tokens(&self) -> usize {
        self.known().len()
    }

    /// The role of callers without a token.
    pub fn role_without_token(&self) -> Role {
        match self.mode {
            // Operating a server always needs a token: a proxy makes strangers look local.
            Mode::Open => Role::Host,
            Mode::Tokens => self.anonymous,
        }
    }

    /// Decides about a request. `authorization` is the value of that header.
    ///
    /// # Errors
    /// It is refused.
    pub fn check(
        &self,
        call: &Call,
        authorization: Option<&[u8]>,
        address: Option<IpAddr>,
    ) -> Result<Granted, Refusal> {
        let required = match call.reads_records {
            true => call.role.max(self.records),
            false => call.role,
        };
        let granted = match self.identify(authorization, address) {
            Ok(granted) => granted,
            // What needs no token needs no valid token either.
            Err(_) if required <= self.role_without_token() => self.without_token(address),
            Err(refusal) => return Err(refusal),
        };
        Refusal::of_role(&granted.caller, required)?;
        match granted.caller.scope {
            Some(scope) if call.scoped == Scoped::Refused => Err(Refusal::OutOfScope { scope }),
            _ => Ok(granted),
        }
    }

    fn identify(
        &self,
        authorization: Option<&[u8]>,
        address: Option<IpAddr>,
    ) -> Result<Granted, Refusal> {
        let Some(value) = authorization else {
            return Ok(self.without_token(address));
        };
        let token = bearer(value).ok_or(Refusal::TokenUnknown)?;
        let found = self.find(&token, address);
        found.unwrap_or(Err(Refusal::TokenUnknown))
    }

    /// Whether the tokens file may have a token that is not in memory: one that has just been
    /// created. The request should wait for [`Self::look_again`].
    pub fn may_be_new(&self, authorization: Option<&[u8]>) -> bool {
        let token = authorization.filter(|_| self.file.is_some());
        token.and_then(bearer).is_some_and(|token| {
            let hash = token.hash();
            let known = self.known();
            let is_known = (known.get(&token.id)).is_some_and(|known| known.token.hash.is(&hash));
            !is_known && !self.unknown.lock().contains(hash.bytes())
        })
    }

    /// Looks at the tokens file for a token that is not in memory. Everybody who asks meanwhile
    /// waits for the same look, and a token that is not in the file then is looked for once.
    pub async fn look_again(self: &Arc<Self>, authorization: Option<&[u8]>) {
        let begun_before = self.looks_begun.load(Ordering::SeqCst);
        let mut looked = self.looked.lock().await;
        if looked.is_none_or(|(number, _)| number <= begun_before) {
            if let Some((_, last)) = *looked {
                sleep_until(last + LOOK_INTERVAL).await;
            }
            let number = self.looks_begun.fetch_add(1, Ordering::SeqCst) + 1;
            let began = Instant::now();
            self.read_on_thread().await;
            *looked = Some((number, began));
        }
        drop(looked);
        if self.may_be_new(authorization)
            && let Some(token) = authorization.and_then(bearer)
        {
            let mut unknown = self.unknown.lock();
            if unknown.len() >= MAX_UNKNOWN {
                unknown.clear();
            }
            unknown.insert(*token.hash().bytes());
        }
    }

    /// What a token grants; `None` if it is unknown.
    fn find(
        &self,
        token: &AccessToken,
        address: Option<IpAddr>,
    ) -> Option<Result<Granted, Refusal>> {
        let known = self.known();
        let Known { token, ended } =
            (known.get(&token.id)).filter(|known| known.token.hash.is(&token.hash()))?;
        if token.is_expired(since_epoch_ms()) {
            return Some(Err(Refusal::TokenExpired));
        }
        // A token takes nothing away, unless it is limited to something.
        let role = match token.scope {
            None => token.role.max(self.role_without_token()),
            Some(_) => token.role,
        };
        Some(Ok(Granted {
            caller: Caller {
                address,
                token: Some(token.id),
                token_hash: Some(token.hash),
                role,
                scope: token.scope,
                secrets: Secrets::default(),
            },
            ended: Some(Ended {
                token: ended.clone(),
                expires_at_ms: token.expires_at_ms,
            }),
        }))
    }

    fn without_token(&self, address: Option<IpAddr>) -> Granted {
        let caller = Caller {
            address,
            role: self.role_without_token(),
            ..Caller::default()
        };
        Granted {
            caller,
            ended: None,
        }
    }

    /// Follows the tokens file and the expiry of tokens, until it is dropped.
    pub async fn follow(self: Arc<Self>) {
        let mut open_noted = self.is_mode_chosen || self.mode == Mode::Tokens;
        loop {
            tokio::time::sleep(INTERVAL).await;
            self.read_on_thread().await;
            if !open_noted && self.tokens() > 0 {
                open_noted = true;
                warn!("the server has tokens but requires none until it is restarted");
            }
            self.follow_expiry(since_epoch_ms());
        }
    }

    /// Reads the tokens file again if it has changed, on a thread that may block.
    async fn read_on_thread(self: &Arc<Self>) {
        let access = Arc::clone(self);
        let reading = tokio::task::spawn_blocking(move || access.read_if_changed());
        if let Err(error) = reading.await {
            error!(%error, "the tokens were not read");
        }
    }

    /// Reads the tokens file again if it has changed. Blocks.
    fn read_if_changed(&self) {
        let Some(Followed { file, watch }) = &self.file else {
            return;
        };
        #[cfg(test)]
        self.looks.fetch_add(1, Ordering::Relaxed);
        let mut watch = watch.lock();
        let read = watch.read_changed(|| {
            // An editor may have removed it before it writes a new one, and a server may not forget
            // its tokens because a disk is not mounted.
            let gone = || TokenFileError::Gone(file.path().to_path_buf());
            let tokens = file.read()?.ok_or_else(gone)?;
            debug!(tokens = tokens.len(), "tokens read again");
            self.replace(tokens);
            Ok::<_, TokenFileError>(())
        });
        if let Err(error) = read {
            error!(%error, "the tokens stay as they were");
        }
    }

    /// Replaces the tokens. What those started that are gone or grant something else ends.
    fn replace(&self, tokens: Vec<StoredToken>) {
        let mut known = self
            .known
            .write()
            .expect("no code that holds this lock can panic");
        let mut before = std::mem::take(&mut *known);
        for token in tokens {
            let same = before.remove(&token.id);
            let ended = match same {
                Some(same) if same.token.grants_the_same_as(&token) => same.ended,
                Some(other) => {
                    other.ended.cancel();
                    CancellationToken::new()
                }
                None => CancellationToken::new(),
            };
            known.insert(token.id, Known { token, ended });
        }
        drop(known);
        self.unknown.lock().clear();
        for (id, gone) in before {
            info!(token = %id, "a token was revoked");
            gone.ended.cancel();
        }
    }

    /// Ends what expired tokens have started. A token that is valid again, because the clock was ahead,
    /// starts anew.
    fn follow_expiry(&self, now_ms: u64) {
        let differs = |it: &Known| it.token.is_expired(now_ms) != it.ended.is_cancelled();
        if !self.known().values().any(differs) {
            return;
        }
        let mut known = self
            .known
            .write()
            .expect("no code that holds this lock can panic");
        for (id, it) in known.iter_mut().filter(|(_, it)| differs(it)) {
            if it.ended.is_cancelled() {
                info!(token = %id, "a token that had expired is valid: the clock was ahead");
                it.ended = CancellationToken::new();
            } else {
                info!(token = %id, "a token has expired");
                it.ended.cancel();
            }
        }
    }

    fn known(&self) -> std::sync::RwLockReadGuard<'_, HashMap<TokenId, Known>> {
        self.known
            .read()
            .expect("no code that holds this lock can panic")
    }
}

/// The token of an `authorization` header: `Bearer TOKEN`.
fn bearer(value: &[u8]) -> Option<AccessToken> {
    let (scheme, token) = value.split_at_checked(BEARER.len())?;
    let token = scheme.eq_ignore_ascii_case(BEARER).then_some(token)?;
    AccessToken::parse(std::str::from_utf8(token).ok()?.trim())
}

#[cfg(test)]
mod tests {
    use tempfile::TempDir;

    use super::*;
    use crate::access::NewToken;
    use chefshat_room::ids::Id;

    struct Setup {
        _folder: TempDir,
        file: TokenFile,
        access: Arc<Access>,
    }

    impl Setup {
        fn new(settings: &AccessSettings) -> Self {
            let folder = tempfile::tempdir().expect("a folder");
            let path = folder.path().to_path_buf();
            let access = Access::open(settings, Some(&path)).expect("readable");
            Self {
                file: TokenFile::of(&path),
                _folder: folder,
                access: Arc::new(access),
            }
        }

        fn add(&self, role: Role, scope: Option<Scope>, lifetime: Option<Duration>) -> AccessToken {
            let token = self.file.create(NewToken {
                role,
                label: String::new(),
                lifetime,
                scope,
            });
            let token = token.expect("written");
            self.access.read_if_changed();
            token
        }

        fn check(&self, method: &str, token: Option<&AccessToken>) -> Result<Granted, Refusal> {
            let path = format!("/chefshat.v1.{method}");
            let header = token.map(|token| format!("Bearer {}", token.to_text()));
            let call = Call::find(&path).expect("a call");
            let value = header.as_deref().map(str::as_bytes);
            self.access.check(call, value, None)
        }
    }

    fn required() -> AccessSettings {
        AccessSettings {
            mode: Some(Mode::Tokens),
            ..AccessSettings::default()
        }
    }

    #[test]
    fn tokens_are_required_once_the_file_exists() {
        let setup = Setup::new(&AccessSettings::default());
        assert_eq!(setup.access.mode(), Mode::Open);
        let granted = setup.check("RoomService/CreateRoom", None).expect("open");
        assert_eq!(granted.caller.role, Role::Host);
        let token = setup.add(Role::Player, None, None);
        setup.file.revoke(token.id).expect("written");
        let folder = setup.file.path().parent().expect("a folder").to_path_buf();
        let access = Access::open(&AccessSettings::default(), Some(&folder)).expect("readable");
        assert_eq!((access.mode(), access.tokens()), (Mode::Tokens, 0));
    }

    #[test]
    fn a_role_is_enough_or_too_low() {
        let setup = Setup::new(&required());
        let host = setup.add(Role::Host, None, None);
        let player = setup.add(Role::Player, None, None);
        let granted = setup
            .check("RoomService/CreateRoom", Some(&host))
            .expect("a host");
        assert_eq!(granted.caller.token, Some(host.id));
        let missing = setup.check("RoomService/CreateRoom", None).map(|_| ());
        assert_eq!(
            missing,
            Err(Refusal::TokenMissing {
                required: Role::Host
            })
        );
        let refused = setup
            .check("RoomService/CreateRoom", Some(&player))
            .map(|_| ());
        let (required, role) = (Role::Host, Role::Player);
        assert_eq!(refused, Err(Refusal::RoleTooLow { required, role }));
        let stranger = AccessToken::random(host.id);
        let refused = setup
            .check("RoomService/CreateRoom", Some(&stranger))
            .map(|_| ());
        assert_eq!(refused, Err(Refusal::TokenUnknown));
        // What the server is, everybody learns.
        let granted = setup.check("ServerService/GetServerInfo", Some(&stranger));
        assert_eq!(granted.expect("for everybody").caller.role, Role::Anyone);
    }

    fn header(token: &AccessToken) -> Vec<u8> {
        format!("Bearer {}", token.to_text()).into_bytes()
    }

    #[tokio::test(start_paused = true)]
    async fn a_thousand_unknown_tokens_take_few_looks_at_the_file_and_none_twice() {
        let setup = Setup::new(&required());
        let looks = || setup.access.looks.load(Ordering::Relaxed);
        let unknown: Vec<_> = (0..1_000u32)
            .map(|id| header(&AccessToken::random(TokenId(id.to_be_bytes()))))
            .collect();
        let look = |header: &'_ Vec<u8>| {
            let (access, header) = (Arc::clone(&setup.access), header.clone());
            async move {
                assert!(access.may_be_new(Some(&header)));
                access.look_again(Some(&header)).await;
                assert!(!access.may_be_new(Some(&header)), "it was looked for");
            }
        };
        futures::future::join_all(unknown.iter().map(look)).await;
        // The first waits for one look; those who asked since it began wait for the next.
        assert_eq!(looks(), 2);
        let before = looks();
        for header in &unknown {
            let call = Call::find("/chefshat.v1.PlayService/Play").expect("a call");
            let refused = setup.access.check(call, Some(header), None).map(|_| ());
            assert_eq!(refused, Err(Refusal::TokenUnknown));
            assert!(!setup.access.may_be_new(Some(header)));
        }
        assert_eq!(looks(), before, "answered from memory");
        // A token is known as soon as it is created.
        let token = setup.file.create(NewToken {
            role: Role::Player,
            label: String::new(),
            lifetime: None,
            scope: None,
        });
        let token = token.expect("written");
        let value = header(&token);
        assert!(setup.access.may_be_new(Some(&value)));
        setup.access.look_again(Some(&value)).await;
        setup
            .check("PlayService/Play", Some(&token))
            .expect("known");
    }

    #[test]
    fn a_scoped_token_calls_nothing_that_has_no_scope() {
        let setup = Setup::new(&required());
        let scope = Scope::Room(Id::random());
        let host = setup.add(Role::Host, Some(scope), None);
        let refused = setup
            .check("RoomService/CreateRoom", Some(&host))
            .map(|_| ());
        assert_eq!(refused, Err(Refusal::OutOfScope { scope }));
        let granted = setup
            .check("RoomService/CloseRoom", Some(&host))
            .expect("its room");
        assert_eq!(granted.caller.scope, Some(scope));
    }

    #[test]
    fn reading_records_may_require_more() {
        let setup = Setup::new(&AccessSettings {
            records: Role::Host,
            ..required()
        });
        let player = setup.add(Role::Player, None, None);
        let host = setup.add(Role::Host, None, None);
        assert!(
            setup
                .check("RecordService/GetRecord", Some(&player))
                .is_err()
        );
        assert!(setup.check("RecordService/GetRecord", Some(&host)).is_ok());
        assert!(setup.check("RoomService/GetRoom", Some(&player)).is_ok());
    }

    #[test]
    fn what_a_token_started_ends_with_it() {
        let setup = Setup::new(&required());
        let revoked = setup.add(Role::Player, None, None);
        let expiring = setup.add(Role::Player, None, Some(Duration::from_secs(60)));
        let other = setup.add(Role::Player, None, None);
        let ended = |token| {
            let granted = setup.check("PlayService/Play", Some(token)).expect("valid");
            granted.ended.expect("with a token")
        };
        let (first, second, third) = (ended(&revoked), ended(&expiring), ended(&other));
        setup.file.revoke(revoked.id).expect("written");
        setup.access.read_if_changed();
        assert!(first.signal().is_cancelled());
        assert_eq!(first.refusal(), Refusal::TokenUnknown);
        setup.access.follow_expiry(since_epoch_ms());
        assert!(!second.signal().is_cancelled());
        setup.access.follow_expiry(since_epoch_ms() + 60_000);
        assert!(second.signal().is_cancelled());
        assert!(!third.signal().is_cancelled());
        let refused = setup.check("PlayService/Play", Some(&revoked)).map(|_| ());
        assert_eq!(refused, Err(Refusal::TokenUnknown));
    }

    #[test]
    fn tokens_stay_while_their_file_is_gone() {
        let setup = Setup::new(&required());
        let token = setup.add(Role::Player, None, None);
        let granted = setup.check("PlayService/Play", Some(&token));
        let ended = granted.expect("valid").ended.expect("with a token");
        std::fs::remove_file(setup.file.path()).expect("a file");
        setup.access.read_if_changed();
        setup
            .check("PlayService/Play", Some(&token))
            .expect("valid");
        let other = setup.add(Role::Player, None, None);
        assert!(ended.signal().is_cancelled(), "a new file without it");
        setup
            .check("PlayService/Play", Some(&other))
            .expect("valid");
    }

    #[test]
    fn a_token_that_the_file_has_twice_can_be_revoked() {
        let setup = Setup::new(&required());
        let token = setup.add(Role::Player, None, None);
        let text = std::fs::read_to_string(setup.file.path()).expect("a file");
        let (before, line) = text.split_once('[').expect("a list");
        let (line, after) = line.rsplit_once(']').expect("a list");
        let text = format!("{before}[{line},{line}]{after}");
        std::fs::write(setup.file.path(), text).expect("written");
        setup.access.read_if_changed();
        let granted = setup.check("PlayService/Play", Some(&token));
        let ended = granted.expect("valid").ended.expect("with a token");
        assert!(setup.file.revoke(token.id).expect("written").is_some());
        setup.access.read_if_changed();
        assert!(ended.signal().is_cancelled());
    }

    #[test]
    fn a_token_is_valid_again_when_a_clock_that_was_ahead_is_corrected() {
        let setup = Setup::new(&required());
        let token = setup.add(Role::Player, None, Some(Duration::from_secs(60)));
        setup.access.follow_expiry(since_epoch_ms() + 60_000);
        setup.access.follow_expiry(since_epoch_ms());
        let granted = setup
            .check("PlayService/Play", Some(&token))
            .expect("valid");
        let ended = granted.ended.expect("with a token");
        assert!(!ended.signal().is_cancelled());
    }

    #[test]
    fn an_expired_token_is_named_as_such() {
        let setup = Setup::new(&required());
        let token = setup.add(Role::Player, None, Some(Duration::ZERO));
        let refused = setup.check("PlayService/Play", Some(&token)).map(|_| ());
        assert_eq!(refused, Err(Refusal::TokenExpired));
    }

    #[test]
    fn only_bearer_tokens_are_read() {
        let text = AccessToken::random(TokenId([1; 4])).to_text();
        assert!(bearer(format!("Bearer {text}").as_bytes()).is_some());
        assert!(bearer(format!("bearer {text}").as_bytes()).is_some());
        for wrong in ["", "Bearer", "Bearer ", "Basic YTpi", &text] {
            assert!(bearer(wrong.as_bytes()).is_none(), "{wrong}");
        }
    }
}
