//! Checks the end of a game: final standings, revealed seed and footer.

use chefshat_engine::{Game, Seed};
use chefshat_proto::v1::{self, game_event::Kind, record_line::Line};

use super::difference::difference;
use super::fault::Fault;
use super::game::Replay;
use super::seed::{check_reveal, dealing_seed, reveal};
use crate::convert::final_table;
use crate::signature::check;

const NOT_OVER: &str = "the footer comes here, but the game is not over";

impl Replay<'_> {
    /// The game's own seed, revealed at the end of the record.
    pub(super) fn dealing_seed(&self) -> Result<Seed, Fault> {
        let Some(line) = self.reveal_line() else {
            return Err(Fault {
                line: Some(self.lines.len() + 1),
                problem: "the record is truncated: it ends before the game does".into(),
            });
        };
        reveal(&self.lines[line - 1])
            .and_then(|reveal| dealing_seed(self.header, &self.setup.game_id, reveal))
            .ok_or_else(|| Fault {
                line: Some(line),
                problem: match &self.lines[line - 1].line {
                    Some(Line::Footer(_)) => NOT_OVER,
                    _ => "the game's seed is not revealed: reveal.gameSeed is missing or not 32 bytes",
                }
                .into(),
            })
    }

    /// The line that ends the game and reveals the seed, or the footer if it comes first.
    pub(super) fn reveal_line(&self) -> Option<usize> {
        let end = |line: &v1::RecordLine| match &line.line {
            Some(Line::Event(event)) => {
                matches!(event.kind, Some(Kind::GameEnded(_) | Kind::GameAborted(_)))
            }
            Some(Line::Footer(_)) => true,
            _ => false,
        };
        self.lines.iter().position(end).map(|index| index + 1)
    }

    pub(super) fn game_ended(&mut self, ended: &v1::GameEnded) -> Result<(), Fault> {
        self.check_complete()?;
        let game = self
            .game
            .as_ref()
            .ok_or("the game ends, but it has not started")?;
        let standings = game
            .standings()
            .ok_or("the game ends here, but by the rules it is not over")?;
        self.check_reveal(ended.reveal.as_ref())?;
        let expected = v1::GameEnded {
            standings: final_table(&standings),
            reveal: ended.reveal.clone(),
        };
        if let Some(problem) = difference(ended, &expected) {
            return Err(format!("gameEnded.{problem}").into());
        }
        self.over = Some(v1::RoomState::Finished);
        Ok(())
    }

    pub(super) fn game_aborted(&mut self, aborted: &v1::GameAborted) -> Result<(), Fault> {
        use v1::AbortReason::{NeverStarted, Unspecified};
        self.check_complete()?;
        if self.game.as_ref().is_some_and(Game::is_over) {
            return Err("the game is aborted, but by the rules it has ended with a result".into());
        }
        let reason = v1::AbortReason::try_from(aborted.reason).unwrap_or(Unspecified);
        if reason == Unspecified || (reason == NeverStarted && self.game.is_some()) {
            return Err(format!(
                "gameAborted.reason is {}, which is impossible here",
                reason.as_str_name()
            )
            .into());
        }
        match (&self.game, &aborted.reveal) {
            (None, Some(_)) => Err("gameAborted.reveal is present, but nothing was dealt".into()),
            (None, None) => Ok(()),
            (Some(_), reveal) => self.check_reveal(reveal.as_ref()),
        }?;
        self.over = Some(v1::RoomState::Aborted);
        Ok(())
    }

    fn check_reveal(&self, reveal: Option<&v1::SeedReveal>) -> Result<(), Fault> {
        if self.physical.is_some() {
            return match reveal {
                Some(_) => Err("reveal is present, but a real table has no seed".into()),
                None => Ok(()),
            };
        }
        let reveal = reveal.ok_or("reveal is missing")?;
        Ok(check_reveal(self.header, &self.setup.game_id, reveal)?)
    }

    pub(super) fn end(&mut self, footer: &v1::RecordFooter) -> Result<(), Fault> {
        self.check_complete()?;
        let state = self.over.ok_or(NOT_OVER)?;
        let expected = v1::RecordFooter {
            state: state.into(),
            events: self.events,
            decisions: self.decisions,
            // These say what was done to the record after the game.
            signature: footer.signature.clone(),
            participant_removed: footer.participant_removed,
            parts_withheld: footer.parts_withheld,
        };
        if let Some(problem) = difference(footer, &expected) {
            return Err(format!("footer.{problem}").into());
        }
        self.signed =
            check(self.lines, self.text).map_err(|problem| format!("footer.{problem}"))?;
        self.redacted = footer.participant_removed || footer.parts_withheld;
        self.seats.end(self.header)?;
        self.ended = true;
        Ok(())
    }
}
