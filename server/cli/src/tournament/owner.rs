//! Commands for the owner of a tournament: `chefshat tournament start`, `pause`, `resume` and
//! `close`, `add` for a participant at a physical table, and `table` for the secrets of such a table.

use std::process::ExitCode;

use crate::kind::KindArg;
use chefshat_client::{Client, v1};
use clap::Args;

use super::super::connect::{OwnerArgs, ServerArg, attendant_link};
use super::super::{CommandError, say};
use super::words::state;

/// The tournament and the proof of ownership.
#[derive(Debug, Args)]
pub(super) struct Owned {
    /// ID of the tournament.
    #[arg(value_name = "TOURNAMENT-ID")]
    pub(super) tournament_id: String,
    #[command(flatten)]
    pub(super) owner: OwnerArgs,
    #[command(flatten)]
    pub(super) server: ServerArg,
    /// Print the result as a JSON line.
    #[arg(long)]
    pub(super) json: bool,
}

/// Add a participant who plays at a physical table with real cards.
#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  chefshat tournament add 5f0c6a4de2b14b7f8a3d9c1e7b60425d --name Ada --owner-file ./owner"
)]
pub(super) struct Add {
    #[command(flatten)]
    owned: Owned,
    /// Display name, 1 to 64 characters, unique in the tournament.
    #[arg(long)]
    name: String,
    /// Kind of the participant.
    #[arg(long, value_enum, default_value_t = KindArg::Human)]
    kind: KindArg,
}

/// Show the secrets of the physical table at which a game is being played: the attendant's link and
/// the ticket for a camera or `chefshat table`.
#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  chefshat tournament table 5f0c6a4de2b14b7f8a3d9c1e7b60425d 3 --owner-file ./owner\n\n\
                  `chefshat tournament games` shows the numbers of the games."
)]
pub(super) struct Table {
    #[command(flatten)]
    owned: Owned,
    /// Number of the game.
    #[arg(value_name = "GAME")]
    game: u32,
}

impl Add {
    pub(super) async fn run(self) -> Result<ExitCode, CommandError> {
        let (client, token) = self.owned.client().await?;
        let request = v1::AddTableParticipantRequest {
            tournament_id: self.owned.tournament_id.clone(),
            owner_token: token,
            name: self.name,
            kind: v1::ParticipantKind::from(self.kind).into(),
            ..v1::AddTableParticipantRequest::default()
        };
        let added = client.add_table_participant(request).await?;
        if self.owned.json {
            let (tournament, participant) = (added.tournament, added.participant);
            say(serde_json::json!({
                "event": "added", "tournament": tournament, "participant": participant,
            }))?;
        } else {
            say(format_args!("participant {}", added.participant))?;
        }
        Ok(ExitCode::SUCCESS)
    }
}

impl Table {
    pub(super) async fn run(self) -> Result<ExitCode, CommandError> {
        let (client, token) = self.owned.client().await?;
        let table = client
            .physical_table(self.owned.tournament_id.as_str(), token, self.game)
            .await?;
        let (room, ticket, owner) = (table.room_id, table.table_ticket, table.owner_token);
        let link = attendant_link(&self.owned.server.page(), &room, &ticket);
        if self.owned.json {
            say(serde_json::json!({
                "event": "table", "game": self.game, "room_id": room, "table_ticket": ticket,
                "owner_token": owner, "attendant_link": link,
            }))?;
        } else {
            say(format_args!("room         {room}"))?;
            say(format_args!("owner token  {owner}"))?;
            say(format_args!("table ticket {ticket}"))?;
            say(format_args!("attendant    {link}"))?;
        }
        Ok(ExitCode::SUCCESS)
    }
}

/// What the owner does with the whole tournament.
#[derive(Debug, Clone, Copy)]
pub(super) enum Change {
    /// Starts it with the participants who have joined.
    Start,
    Close,
    Pause,
    Resume,
}

impl Owned {
    /// The server, which is shown the owner token with each call, and that token.
    pub(super) async fn client(&self) -> Result<(Client, String), CommandError> {
        let token = self.owner.token()?;
        let client = self.server.connect().await?.with_secrets([&token])?;
        Ok((client, token))
    }

    /// Changes the tournament.
    pub(super) async fn change(self, change: Change) -> Result<ExitCode, CommandError> {
        let (client, token) = self.client().await?;
        let id = self.tournament_id.as_str();
        let (event, changed) = match change {
            Change::Start => ("started", client.start_tournament(id, token).await),
            Change::Close => ("closed", client.close_tournament(id, token).await),
            Change::Pause => ("paused", client.pause_tournament(id, token).await),
            Change::Resume => ("resumed", client.resume_tournament(id, token).await),
        };
        let tournament = changed?;
        if self.json {
            say(serde_json::json!({"event": event, "tournament": tournament}))?;
        } else {
            let state = match tournament.paused {
                true => "paused",
                false => state(tournament.state()),
            };
            say(format_args!(
                "tournament {} is {state}",
                tournament.tournament_id
            ))?;
        }
        Ok(ExitCode::SUCCESS)
    }
}
