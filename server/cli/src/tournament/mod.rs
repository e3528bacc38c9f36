//! `chefshat tournament`: creates, joins, starts, changes, follows and closes tournaments of a server,
//! and shows results. Pairings and standings are those of `chefshat_tournament`, computed by the
//! server.

mod by_hand;
mod create;
mod files;
mod follow;
mod join;
mod list;
mod owner;
mod results;
mod simulate;
pub(super) mod tables;
pub(super) mod words;

use std::process::ExitCode;

use clap::{Args, Subcommand};

use super::CommandError;
use owner::Change;

/// Create, join and follow tournaments, and show their results.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  chefshat tournament create --name cup --format swiss --built-in 'greedy*4' --start-when 12\n  \
                  chefshat tournament join --agent greedy --name Gustav --code BCDF2345\n  \
                  chefshat tournament follow TOURNAMENT-ID\n  chefshat tournament results TOURNAMENT-ID --csv standings.csv"
)]
pub(super) struct TournamentCommand {
    #[command(subcommand)]
    action: TournamentAction,
}

#[derive(Debug, Subcommand)]
enum TournamentAction {
    /// Create a tournament and print how to take part.
    Create(Box<create::Create>),
    /// Take part with a built-in agent, until the tournament is over.
    Join(join::Join),
    /// Start a tournament with the participants who have joined.
    #[command(
        after_help = "Example:\n  chefshat tournament start 5f0c6a4de2b14b7f8a3d9c1e7b60425d --owner-file ./owner"
    )]
    Start(owner::Owned),
    /// Add a participant who plays at a physical table with real cards.
    Add(owner::Add),
    /// Show the secrets of the physical table at which a game is being played.
    Table(owner::Table),
    /// Withdraw a participant, with its ticket or the owner token.
    Withdraw(by_hand::Withdraw),
    /// Remove a participant: it is withdrawn, and its ticket ends.
    Remove(by_hand::Remove),
    /// Give the place of a participant to a built-in agent or to somebody else.
    Replace(by_hand::Replace),
    /// Pause a tournament: no game is called until it is resumed. Games in progress continue.
    #[command(
        after_help = "Example:\n  chefshat tournament pause 5f0c6a4de2b14b7f8a3d9c1e7b60425d --owner-file ./owner"
    )]
    Pause(owner::Owned),
    /// Resume a paused tournament.
    #[command(
        after_help = "Example:\n  chefshat tournament resume 5f0c6a4de2b14b7f8a3d9c1e7b60425d --owner-file ./owner"
    )]
    Resume(owner::Owned),
    /// Postpone a game that is not in progress: it moves to the end of the queue.
    Postpone(by_hand::Postpone),
    /// Call a due or void game before all others.
    Call(by_hand::CallAgain),
    /// Close a tournament early: games in progress are aborted, counted games keep their results.
    #[command(
        after_help = "Example:\n  chefshat tournament close 5f0c6a4de2b14b7f8a3d9c1e7b60425d --owner-file ./owner"
    )]
    Close(owner::Owned),
    /// Follow a tournament to its end.
    Follow(follow::Follow),
    /// Show the standings of a tournament and their confidence.
    Results(results::Results),
    /// Play a tournament of built-in agents offline.
    Simulate(simulate::Simulate),
    /// List the tournaments of a server.
    List(list::List),
    /// List the games of a tournament.
    Games(list::Games),
}

impl TournamentCommand {
    pub(super) async fn run(self) -> Result<ExitCode, CommandError> {
        match self.action {
            TournamentAction::Create(command) => command.run().await,
            TournamentAction::Join(command) => command.run().await,
            TournamentAction::Start(owned) => owned.change(Change::Start).await,
            TournamentAction::Add(command) => command.run().await,
            TournamentAction::Table(command) => command.run().await,
            TournamentAction::Withdraw(command) => command.run().await,
            TournamentAction::Remove(command) => command.run().await,
            TournamentAction::Replace(command) => command.run().await,
            TournamentAction::Pause(owned) => owned.change(Change::Pause).await,
            TournamentAction::Resume(owned) => owned.change(Change::Resume).await,
            TournamentAction::Postpone(command) => command.run().await,
            TournamentAction::Call(command) => command.run().await,
            TournamentAction::Close(owned) => owned.change(Change::Close).await,
            TournamentAction::Follow(command) => command.run().await,
            TournamentAction::Results(command) => command.run().await,
            TournamentAction::Simulate(command) => command.run(),
            TournamentAction::List(command) => command.run().await,
            TournamentAction::Games(command) => command.run().await,
        }
    }
}
