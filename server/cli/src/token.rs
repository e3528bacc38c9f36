//! `chefshat token`: creates, lists and revokes the tokens of a server, in its data directory. A
//! running server notices the change by itself.

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

use chefshat_room::ids::{Id, Room, RoomId, Tournament, TournamentId};
use chefshat_server::access::{
    AccessToken, NewToken, Role, Scope, StoredToken, TokenFile, TokenId,
};
use chefshat_server::clock::since_epoch_ms;
use clap::{Args, Subcommand};
use serde_json::{Value, json};

use super::error::tell;
use super::numbers::{counted, duration};
use super::output::table;
use super::{CommandError, data_dir, say};

/// Longest label, characters.
const MAX_LABEL_CHARS: usize = 64;

/// Create, list and revoke the tokens of a server. A server whose data directory has tokens
/// requires one with every call.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  chefshat token create --role host --label \"Ana's laptop\" --expires 30d\n  \
                  chefshat token create --role player --link https://chef.example.org\n  \
                  chefshat token list\n  chefshat token revoke 1a2b3c4d"
)]
pub(super) struct TokenCommand {
    #[command(subcommand)]
    action: TokenAction,
}

#[derive(Debug, Subcommand)]
enum TokenAction {
    /// Create a token and print it. It is shown only once.
    Create(Create),
    /// List the tokens, without their secrets.
    List(List),
    /// Revoke a token; what it has open on a running server ends within seconds.
    Revoke(Revoke),
}

/// Create a token and print it. It is shown only once.
#[derive(Debug, Args)]
struct Create {
    /// What its bearer may do: watch (spectator), also join and play (player), also create rooms and
    /// tournaments (host), also operate the server (admin).
    #[arg(long, value_name = "spectator|player|host|admin")]
    role: Role,
    /// What or whom it is for, at most 64 characters. Shown in the list and in nothing else.
    #[arg(long, default_value = "", hide_default_value = true, value_parser = label)]
    label: String,
    /// How long it is valid, such as 90m, 12h or 30d. Default: until it is revoked.
    #[arg(long, value_name = "TIME", value_parser = duration)]
    expires: Option<Duration>,
    /// Make it valid for one room only.
    #[arg(long, value_name = "ROOM-ID", value_parser = id::<Room>)]
    room: Option<RoomId>,
    /// Make it valid for one tournament and its rooms only.
    #[arg(long, value_name = "TOURNAMENT-ID", value_parser = id::<Tournament>, conflicts_with = "room")]
    tournament: Option<TournamentId>,
    /// Print a link for a browser instead: this address of a page, with the token. Anyone who has
    /// the link has the token.
    #[arg(long, value_name = "URL", value_parser = page)]
    link: Option<String>,
    #[command(flatten)]
    place: Place,
}

/// List the tokens, without their secrets.
#[derive(Debug, Args)]
struct List {
    #[command(flatten)]
    place: Place,
}

/// Revoke a token; what it has open on a running server ends within seconds.
#[derive(Debug, Args)]
struct Revoke {
    /// ID of the token: the 8 characters after `chefshat_`, which `token list` shows.
    #[arg(value_name = "TOKEN-ID")]
    id: TokenId,
    #[command(flatten)]
    place: Place,
}

#[derive(Debug, Args)]
struct Place {
    /// Data directory of the server. Default: chefshat in the user's data directory.
    #[arg(long, env = "CHEFSHAT_DATA_DIR")]
    data_dir: Option<PathBuf>,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

impl TokenCommand {
    pub(super) fn run(self) -> Result<ExitCode, CommandError> {
        match self.action {
            TokenAction::Create(command) => command.run(),
            TokenAction::List(command) => command.run(),
            TokenAction::Revoke(command) => command.run(),
        }?;
        Ok(ExitCode::SUCCESS)
    }
}

impl Create {
    fn run(self) -> Result<(), CommandError> {
        let file = TokenFile::of(&data_dir::prepare(self.place.data_dir.clone())?);
        let is_first = file.read()?.is_none();
        let room = self.room.map(Scope::Room);
        let created = file.create(NewToken {
            role: self.role,
            label: self.label,
            lifetime: self.expires,
            scope: room.or(self.tournament.map(Scope::Tournament)),
        })?;
        let link = self.link.map(|page| link(&page, &created));
        if self.place.json {
            let mut line = json!({
                "id": created.id.to_string(),
                "role": self.role.name(),
                "token": created.to_text(),
            });
            if let Some(link) = link {
                line["link"] = link.into();
            }
            say(line)?;
        } else {
            say(link.unwrap_or_else(|| created.to_text()))?;
            let place = match &self.place.data_dir {
                Some(folder) => format!(" --data-dir {}", folder.display()),
                None => String::new(),
            };
            tell(format_args!(
                "this is shown only once; revoke it with `chefshat token revoke {}{place}`",
                created.id
            ));
        }
        if is_first {
            tell(
                "this is the first token here: a server that is running without tokens requires them once it is restarted",
            );
        }
        Ok(())
    }
}

impl List {
    fn run(self) -> Result<(), CommandError> {
        let data_dir = data_dir::name(self.place.data_dir)?;
        if !data_dir.is_dir() {
            return Err(format!(
                "there is no folder {}; name the server's with --data-dir",
                data_dir.display()
            )
            .into());
        }
        let entries = TokenFile::of(&data_dir).entries()?.unwrap_or_default();
        let (tokens, unreadable): (Vec<_>, Vec<_>) = entries.into_iter().partition(Result::is_ok);
        let tokens: Vec<_> = tokens.into_iter().flatten().collect();
        for unreadable in unreadable.into_iter().filter_map(Result::err) {
            tell(format_args!(
                "an entry grants nothing: {}",
                unreadable.problem
            ));
        }
        let now_ms = since_epoch_ms();
        if self.place.json {
            let lines = tokens.iter().map(|token| line_of(token, now_ms));
            return say(json!({ "tokens": lines.collect::<Vec<_>>() }));
        }
        if tokens.is_empty() {
            return say("no tokens");
        }
        let mut text = String::new();
        let rows = tokens.iter().map(|token| {
            vec![
                token.id.to_string(),
                token.role.to_string(),
                validity(token, now_ms),
                token
                    .scope
                    .map_or_else(|| "everything".to_owned(), |it| it.to_string()),
                token.label.clone(),
            ]
        });
        let header = ["id", "role", "valid", "for", "label"];
        table(&mut text, &header, &[0, 1, 2, 3, 4], rows);
        say(text.trim_end())
    }
}

impl Revoke {
    fn run(self) -> Result<(), CommandError> {
        let file = TokenFile::of(&data_dir::name(self.place.data_dir)?);
        // Before it is locked: locking creates a file.
        let unknown = || format!("unknown token {}; see `chefshat token list`", self.id);
        file.entries()?.ok_or_else(unknown)?;
        let revoked = file.revoke(self.id)?.ok_or_else(unknown)?;
        match (self.place.json, revoked) {
            (true, Ok(revoked)) => say(line_of(&revoked, since_epoch_ms()))?,
            (true, Err(_)) => say(json!({ "id": self.id.to_string() }))?,
            (false, Ok(revoked)) => say(format!("revoked {} ({})", revoked.id, revoked.role))?,
            (false, Err(_)) => say(format!("revoked {}", self.id))?,
        }
        Ok(())
    }
}

fn line_of(token: &StoredToken, now_ms: u64) -> Value {
    let (room, tournament) = match token.scope {
        None => (None, None),
        Some(Scope::Room(id)) => (Some(id.to_string()), None),
        Some(Scope::Tournament(id)) => (None, Some(id.to_string())),
    };
    json!({
        "id": token.id.to_string(),
        "role": token.role.name(),
        "label": token.label,
        "room": room,
        "tournament": tournament,
        "created_at_ms": token.created_at_ms,
        "expires_at_ms": token.expires_at_ms,
        "expired": token.is_expired(now_ms),
    })
}

/// How long a token is still valid, in words.
fn validity(token: &StoredToken, now_ms: u64) -> String {
    let Some(expiry) = token.expires_at_ms else {
        return "until revoked".to_owned();
    };
    let seconds = expiry.saturating_sub(now_ms) / 1_000;
    match seconds {
        _ if token.is_expired(now_ms) => "expired".to_owned(),
        0..7_200 => counted(seconds / 60 + 1, "minute"),
        7_200..172_800 => counted(seconds / 3_600, "hour"),
        _ => counted(seconds / 86_400, "day"),
    }
}

/// The page with a token in its fragment, which browsers send to no server.
fn link(page: &str, token: &AccessToken) -> String {
    format!("{page}#token={}", token.to_text())
}

fn label(text: &str) -> Result<String, String> {
    if text.chars().count() > MAX_LABEL_CHARS || text.chars().any(char::is_control) {
        return Err(format!(
            "use at most {MAX_LABEL_CHARS} characters in one line"
        ));
    }
    Ok(text.to_owned())
}

fn id<T>(text: &str) -> Result<Id<T>, String> {
    Id::parse(text).ok_or_else(|| "use the 32 hexadecimal digits of its id".to_owned())
}

fn page(text: &str) -> Result<String, String> {
    let is_web = text.starts_with("https://") || text.starts_with("http://");
    match is_web && !text.contains(['#', ' ']) {
        true => Ok(text.to_owned()),
        false => Err("use the address of a page, such as https://chef.example.org".to_owned()),
    }
}
