//! Who may do what: roles and scopes, tokens and the file that holds them, and the minimal role of
//! every call. Everything here decides and nothing here knows gRPC: `grpc/access.rs` asks
//! [`Access`] about each request and puts the [`Caller`] into its extensions.
//!
//! Join codes, owner tokens and tickets are another matter: they authorise for one room, seat or
//! tournament, beside the role.

mod caller;
mod calls;
mod file;
mod guard;
mod secrets;
mod token;

pub use caller::{Caller, Role, Scope};
pub use calls::{
    CALLS, COST_OF_STREAM, Call, MAX_INPUTS_PER_MESSAGE, MAX_MESSAGE_BYTES,
    MAX_STUDY_MESSAGE_BYTES, MAX_VECTOR_MESSAGE_BYTES, MessageLimits, Scoped,
};
pub use file::{Entry, NewToken, StoredToken, TOKENS_FILE, TokenFile, TokenFileError, Unreadable};
pub use guard::{Access, AccessSettings, Ended, Granted, Mode, Refusal};
pub use secrets::{MAX_SECRETS, Relation, SECRET_HEADER, Secrets, SecretsRefused};
pub use token::{AccessToken, TokenId};
