//! Flags for games that begin with given hands, or at a point of a recorded game.

use std::path::{Path, PathBuf};

use chefshat_client::Client;
use chefshat_client::v1::{self, create_room_request::Start};
use clap::Args;

use super::super::CommandError;

/// Flags for the beginning of a game.
#[derive(Debug, Default, Args)]
#[command(next_help_heading = "Beginning")]
pub(super) struct StartArgs {
    /// Continue a recorded game of the server after this many of its decisions, with its rules; 0
    /// keeps only its first deal.
    #[arg(long, value_name = "GAME-ID@DECISIONS", value_parser = branch_point, conflicts_with = "hands")]
    branch: Option<v1::BranchPoint>,
    /// With --branch: deal later Shifts as in the recorded game. Anyone who knows its record then
    /// knows hidden cards.
    #[arg(long, requires = "branch")]
    same_deals: bool,
    /// Start with the hands in this file: a ScriptedShift in canonical JSON, for example {"hands":
    /// [{"seat": 0, "cards": [1, 4, 12], "golden": true}, ...]} with every seat's cards (seats
    /// count from 0; a joker is the number of faces plus 1).
    #[arg(long, value_name = "FILE")]
    hands: Option<PathBuf>,
}

impl StartArgs {
    /// The recorded game to continue.
    pub(super) fn branch(&self) -> Option<&v1::BranchPoint> {
        self.branch.as_ref()
    }

    /// The beginning for the server.
    ///
    /// # Errors
    /// The file of hands is unreadable.
    pub(super) fn message(&self) -> Result<Option<Start>, CommandError> {
        if let Some(point) = &self.branch {
            return Ok(Some(Start::Branch(v1::BranchPoint {
                same_deals: self.same_deals,
                ..point.clone()
            })));
        }
        let hands = self.hands.as_deref().map(read_hands).transpose()?;
        Ok(hands.map(Start::Scripted))
    }
}

fn branch_point(words: &str) -> Result<v1::BranchPoint, String> {
    let point = words.split_once('@').and_then(|(game_id, decisions)| {
        Some(v1::BranchPoint {
            game_id: game_id.to_owned(),
            decisions: decisions.parse().ok()?,
            same_deals: false,
        })
    });
    point.ok_or_else(|| "use the ID of a recorded game, @, and a number of decisions".to_owned())
}

fn read_hands(file: &Path) -> Result<v1::ScriptedShift, CommandError> {
    let name = file.display();
    let text =
        std::fs::read_to_string(file).map_err(|error| format!("--hands: {name}: {error}"))?;
    serde_json::from_str(&text)
        .map_err(|error| format!("--hands: {name} is not a ScriptedShift: {error}").into())
}

/// Number of players of a recorded game, from the header of its record.
///
/// # Errors
/// `GAME_UNKNOWN`, `GAME_RUNNING`.
pub(super) async fn players_of(client: &Client, game_id: &str) -> Result<usize, CommandError> {
    let header = client.record_header(game_id).await?;
    Ok(header.seats.len())
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use crate::room::start::*;

    #[derive(Parser)]
    struct Only {
        #[command(flatten)]
        start: StartArgs,
    }

    fn start(flags: &[&str]) -> Result<Option<Start>, CommandError> {
        let words = std::iter::once(&"test").chain(flags);
        Only::try_parse_from(words)?.start.message()
    }

    #[test]
    fn a_point_of_a_record_is_a_game_and_a_number() {
        let point = |same_deals| v1::BranchPoint {
            game_id: "5f0c6a4de2b14b7f8a3d9c1e7b60425d".into(),
            decisions: 40,
            same_deals,
        };
        let flag = "--branch=5f0c6a4de2b14b7f8a3d9c1e7b60425d@40";
        let branch = |flags: &[&str]| start(flags).expect("they make sense");
        assert_eq!(branch(&[]), None);
        assert_eq!(branch(&[flag]), Some(Start::Branch(point(false))));
        let same = branch(&[flag, "--same-deals"]);
        assert_eq!(same, Some(Start::Branch(point(true))));
        for refused in [
            &["--branch", "5f0c6a4d"][..],
            &["--branch", "5f0c6a4d@x"],
            &["--branch", "5f0c6a4d@-1"],
            &["--same-deals"],
            &[flag, "--hands", "hands.json"],
        ] {
            assert!(start(refused).is_err(), "{refused:?}");
        }
    }

    #[test]
    fn hands_are_read_from_a_file() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("hands.json");
        let path = file.to_str().expect("a name");
        let text = r#"{"hands": [{"seat": 0, "cards": [1, 4, 4], "golden": true}, {"seat": 1, "cards": [2, 5]}]}"#;
        std::fs::write(&file, text).expect("written");
        let Some(Start::Scripted(script)) = start(&["--hands", path]).expect("it can be read")
        else {
            panic!("hands are a script");
        };
        assert_eq!(script.shift, 0);
        assert_eq!(script.hands[0].cards, [1, 4, 4]);
        assert!(script.hands[0].golden);
        assert_eq!(
            (script.hands[1].seat, &script.hands[1].cards[..]),
            (1, &[2, 5][..])
        );
        for nonsense in ["", "[]", r#"{"cards": []}"#] {
            std::fs::write(&file, nonsense).expect("written");
            let error = start(&["--hands", path]).expect_err(nonsense);
            assert!(error.to_string().starts_with("--hands: "), "{error}");
        }
        std::fs::remove_file(&file).expect("removed");
        assert!(start(&["--hands", path]).is_err());
    }
}
