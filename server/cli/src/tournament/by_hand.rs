//! Commands that change a tournament by hand: `chefshat tournament withdraw`, `remove`, `replace`,
//! `postpone` and `call`.

use std::path::PathBuf;
use std::process::ExitCode;

use chefshat_client::{Client, v1};
use clap::{ArgGroup, Args};

use super::super::connect::{OwnerArgs, ServerArg, secret_in, ticket_in_environment};
use super::super::secret_file::{SecretFile, write_all};
use super::super::{CommandError, say};
use super::list::game_in_a_line;
use super::owner::Owned;
use crate::kind::KindArg;
use crate::narration::clean;

/// Withdraw a participant, with its ticket or the owner token. Before the start its place is free
/// again. After that a substitute plays its games in progress, and it forfeits the others.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  chefshat tournament withdraw 5f0c6a4de2b14b7f8a3d9c1e7b60425d --ticket TICKET\n  \
                  chefshat tournament withdraw 5f0c6a4de2b14b7f8a3d9c1e7b60425d --participant Ada --owner-file ./owner"
)]
pub(super) struct Withdraw {
    #[command(flatten)]
    asker: Asker,
    /// Name or number of the participant, with the owner token.
    #[arg(long, value_name = "PARTICIPANT")]
    participant: Option<String>,
}

/// Remove a participant: it is withdrawn, and its ticket ends.
#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  chefshat tournament remove 5f0c6a4de2b14b7f8a3d9c1e7b60425d Ada --owner-file ./owner"
)]
pub(super) struct Remove {
    #[command(flatten)]
    owned: Owned,
    /// Name or number of the participant.
    #[arg(value_name = "PARTICIPANT")]
    participant: String,
}

/// Give the place of a participant, with its results, to a built-in agent or to somebody else.
#[derive(Debug, Args)]
#[command(
    group = ArgGroup::new("newcomer").required(true).multiple(true).args(["built_in", "name"]),
    after_help = "Examples:\n  chefshat tournament replace 5f0c6a4de2b14b7f8a3d9c1e7b60425d Ada --built-in greedy --owner-file ./owner\n  \
                  chefshat tournament replace 5f0c6a4de2b14b7f8a3d9c1e7b60425d Ada --name Bo --ticket-file ./bo --owner-file ./owner\n\n\
                  Games in progress are played to their end by a substitute. Somebody else takes part with the ticket that is printed."
)]
pub(super) struct Replace {
    #[command(flatten)]
    owned: Owned,
    /// Name or number of the participant.
    #[arg(value_name = "PARTICIPANT")]
    participant: String,
    /// Built-in agent that takes the place.
    #[arg(long, value_name = "AGENT", value_parser = super::create::agent_name)]
    built_in: Option<String>,
    /// Display name of the new participant. Default with --built-in: the agent's.
    #[arg(long)]
    name: Option<String>,
    /// Kind of the new participant. Default: that of the former one.
    #[arg(long, value_enum, conflicts_with = "built_in")]
    kind: Option<KindArg>,
    /// Maximum number of games at a time.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=64))]
    games: u32,
    /// The new participant remembers nothing between games.
    #[arg(long)]
    stateless: bool,
    /// Write the ticket to this file, readable only by its owner.
    #[arg(long, value_name = "FILE", conflicts_with = "built_in")]
    ticket_file: Option<PathBuf>,
}

/// Postpone a game that is not in progress, with a ticket of it or the owner token: it moves to the
/// end of the queue, and its wait for absent participants restarts.
#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  chefshat tournament postpone 5f0c6a4de2b14b7f8a3d9c1e7b60425d 3 --owner-file ./owner\n\n\
                  `chefshat tournament games` shows the numbers of the games."
)]
pub(super) struct Postpone {
    #[command(flatten)]
    asker: Asker,
    /// Number of the game.
    #[arg(value_name = "GAME")]
    game: u32,
}

/// Call a due or void game before all others, with as many calls as at first.
#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  chefshat tournament call 5f0c6a4de2b14b7f8a3d9c1e7b60425d 3 --owner-file ./owner\n\n\
                  `chefshat tournament games` shows the numbers of the games."
)]
pub(super) struct CallAgain {
    #[command(flatten)]
    owned: Owned,
    /// Number of the game.
    #[arg(value_name = "GAME")]
    game: u32,
}

/// The tournament, and who asks: a participant with its ticket, or the owner.
#[derive(Args)]
struct Asker {
    /// ID of the tournament.
    #[arg(value_name = "TOURNAMENT-ID")]
    tournament_id: String,
    /// The participant's ticket. CHEFSHAT_TICKET does the same, unless a flag gives the owner token.
    #[arg(long)]
    ticket: Option<String>,
    /// File with that ticket.
    #[arg(long, value_name = "FILE", conflicts_with = "ticket")]
    ticket_file: Option<PathBuf>,
    #[command(flatten)]
    owner: OwnerArgs,
    #[command(flatten)]
    server: ServerArg,
    /// Print the result as a JSON line.
    #[arg(long)]
    json: bool,
}

/// Leaves out the secrets.
impl std::fmt::Debug for Asker {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_tuple("Asker").field(&self.tournament_id).finish()
    }
}

impl Asker {
    /// The ticket and the owner token; one of them is empty.
    fn secrets(&self) -> Result<(String, String), CommandError> {
        let of_owner = |token| (String::new(), token);
        let of_participant = |ticket| (ticket, String::new());
        if let Some(ticket) = self.ticket.clone().filter(|ticket| !ticket.is_empty()) {
            return Ok(of_participant(ticket));
        }
        if let Some(file) = &self.ticket_file {
            return Ok(of_participant(secret_in(file, "--ticket-file")?));
        }
        if let Some(token) = self.owner.by_flag()? {
            return Ok(of_owner(token));
        }
        match ticket_in_environment() {
            Some(ticket) => Ok(of_participant(ticket)),
            None => Ok(of_owner(self.owner.token().map_err(|_| NO_SECRET)?)),
        }
    }
}

const NO_SECRET: &str = "give --ticket of a participant, or --owner-token or --owner-file";

impl Withdraw {
    pub(super) async fn run(self) -> Result<ExitCode, CommandError> {
        let (ticket, owner_token) = self.asker.secrets()?;
        let client = self.asker.server.connect().await?;
        let participant = match &self.participant {
            Some(_) if owner_token.is_empty() => {
                return Err("--participant goes with the owner token, not with --ticket".into());
            }
            Some(who) => {
                let client = client.with_secrets([&owner_token])?;
                number_of(&client, &self.asker.tournament_id, who).await?
            }
            None if ticket.is_empty() => return Err("give --participant, or --ticket".into()),
            None => 0,
        };
        let request = v1::WithdrawParticipantRequest {
            tournament_id: self.asker.tournament_id.clone(),
            ticket,
            owner_token,
            participant,
        };
        let tournament = client.withdraw_participant(request).await?;
        report("withdrawn", self.asker.json, &tournament, None)
    }
}

impl Remove {
    pub(super) async fn run(self) -> Result<ExitCode, CommandError> {
        let id = &self.owned.tournament_id;
        let (client, token) = self.owned.client().await?;
        let participant = number_of(&client, id, &self.participant).await?;
        let tournament = client
            .remove_participant(id.as_str(), token, participant)
            .await?;
        report("removed", self.owned.json, &tournament, None)
    }
}

impl Replace {
    pub(super) async fn run(self) -> Result<ExitCode, CommandError> {
        let id = &self.owned.tournament_id;
        let (client, token) = self.owned.client().await?;
        let participant = number_of(&client, id, &self.participant).await?;
        let ticket_file = (self.ticket_file.as_deref())
            .map(|file| SecretFile::new_only(file, "--ticket-file", "a ticket"))
            .transpose()?;
        let kind = self
            .kind
            .map_or(v1::ParticipantKind::Unspecified, Into::into);
        let request = v1::ReplaceParticipantRequest {
            tournament_id: id.clone(),
            owner_token: token,
            participant,
            built_in_agent: self.built_in.clone().unwrap_or_default(),
            name: self.name.clone().unwrap_or_default(),
            kind: kind.into(),
            max_games: self.games,
            stateless: self.stateless,
            ..v1::ReplaceParticipantRequest::default()
        };
        let replaced = client.replace_participant(request).await?;
        let ticket = Some(replaced.ticket).filter(|ticket| !ticket.is_empty());
        let tournament = replaced.tournament.unwrap_or_default();
        let ticket = ticket.as_deref();
        let written = write_all([(
            ticket_file.filter(|_| ticket.is_some()),
            ticket.unwrap_or(""),
        )]);
        let code = report("replaced", self.owned.json, &tournament, ticket)?;
        // Last, so that the ticket is printed even if this fails.
        written?;
        Ok(code)
    }
}

impl Postpone {
    pub(super) async fn run(self) -> Result<ExitCode, CommandError> {
        let (ticket, owner_token) = self.asker.secrets()?;
        let shown = if ticket.is_empty() {
            &owner_token
        } else {
            &ticket
        };
        let client = self.asker.server.connect().await?.with_secrets([shown])?;
        let request = v1::PostponeGameRequest {
            tournament_id: self.asker.tournament_id.clone(),
            ticket,
            owner_token,
            game: self.game,
        };
        let game = client.postpone_game(request).await?;
        let (id, json) = (&self.asker.tournament_id, self.asker.json);
        report_game("postponed", json, &client, id, &game).await
    }
}

impl CallAgain {
    pub(super) async fn run(self) -> Result<ExitCode, CommandError> {
        let id = &self.owned.tournament_id;
        let (client, token) = self.owned.client().await?;
        let game = client.call_game(id.as_str(), token, self.game).await?;
        report_game("called", self.owned.json, &client, id, &game).await
    }
}

/// The number of a participant, by its name or number.
async fn number_of(client: &Client, id: &str, who: &str) -> Result<u32, CommandError> {
    let tournament = client.tournament(id).await?;
    let participants = &tournament.participants;
    let wanted = who.to_lowercase();
    let named = participants
        .iter()
        .filter(|it| it.name.to_lowercase() == wanted);
    // A withdrawn participant may have joined again under the same name.
    let by_name = named.max_by_key(|it| (!it.withdrawn, it.participant));
    let number = by_name.map(|it| it.participant).or(who.parse().ok());
    number.ok_or_else(|| format!("no participant of this tournament is named {who}").into())
}

fn report(
    event: &str,
    json: bool,
    tournament: &v1::Tournament,
    ticket: Option<&str>,
) -> Result<ExitCode, CommandError> {
    if json {
        say(serde_json::json!({"event": event, "tournament": tournament, "ticket": ticket}))?;
        return Ok(ExitCode::SUCCESS);
    }
    let playing = tournament.participants.iter().filter(|it| !it.withdrawn);
    let names: Vec<String> = playing.map(|it| clean(&it.name, 64)).collect();
    say(format_args!("participants  {}", names.join(", ")))?;
    if let Some(ticket) = ticket {
        say(format_args!("ticket        {ticket}"))?;
    }
    Ok(ExitCode::SUCCESS)
}

async fn report_game(
    event: &str,
    json: bool,
    client: &Client,
    id: &str,
    game: &v1::TournamentGame,
) -> Result<ExitCode, CommandError> {
    if json {
        say(serde_json::json!({"event": event, "game": game}))?;
    } else {
        let participants = client.tournament(id).await?.participants;
        say(game_in_a_line(game, &participants))?;
    }
    Ok(ExitCode::SUCCESS)
}
