//! The changes of a study and the values in them. `state` applies them; `commands` and `games`
//! decide when they follow.
//!
//! They are stored as they stand here: fields and kinds are only ever added, and none gets another
//! number.

use std::array::TryFromSliceError;

use prost::Message;

use crate::device::Device;
use crate::questionnaire::Answers;

/// A step of a study. Folding the same changes again restores the study.
#[derive(Clone, PartialEq, Eq, prost::Oneof)]
pub enum Change {
    /// A participant was added.
    #[prost(message, tag = "1")]
    Added(Added),
    /// A participant opened a session, which supersedes its earlier ones.
    #[prost(message, tag = "2")]
    Opened(Opened),
    /// A participant consented, and is at its next step.
    #[prost(message, tag = "3")]
    Consented(Consented),
    /// A participant answered a questionnaire, and is at its next step.
    #[prost(message, tag = "4")]
    Answered(Answered),
    /// A game of a participant was assigned a room, before the room is created.
    #[prost(message, tag = "5")]
    Placed(Placed),
    /// The participant's game ended.
    #[prost(message, tag = "6")]
    GameEnded(GameEnded),
    /// A participant continued from a text, an external questionnaire or a game.
    #[prost(message, tag = "7")]
    Continued(Continued),
    /// A participant had no session open for too long, or others waited for it for too long.
    #[prost(message, tag = "8")]
    DroppedOut(Ended),
    /// A participant withdrew.
    #[prost(message, tag = "9")]
    Withdrew(Withdrew),
    /// The study's owner removed a participant.
    #[prost(message, tag = "10")]
    Removed(Ended),
    /// The study was closed; always `true`.
    #[prost(bool, tag = "11")]
    Closed(bool),
    /// What a participant has entered in a questionnaire so far was saved.
    #[prost(message, tag = "12")]
    Saved(Saved),
    /// A participant came to a step that screens it out.
    #[prost(message, tag = "13")]
    ScreenedOut(Ended),
    /// A participant belongs to a group, and is at its next step. The changes of all participants of
    /// a group follow each other.
    #[prost(message, tag = "14")]
    Grouped(Grouped),
    /// The group of a participant was not complete in time.
    #[prost(message, tag = "15")]
    LeftOver(Ended),
}

/// A new participant.
#[derive(Clone, PartialEq, Eq, Message)]
pub struct Added {
    /// Its number, from 1.
    #[prost(uint32, tag = "1")]
    pub number: u32,
    /// Its pseudonym.
    #[prost(string, tag = "2")]
    pub pseudonym: String,
    /// How it joined, if not by being added by a researcher.
    #[prost(message, optional, tag = "3")]
    pub joined: Option<Joined>,
    /// Whether it is a test participant.
    #[prost(bool, tag = "4")]
    pub test: bool,
    /// The first of those with whom it is to play, if that is planned; otherwise it plays with whom
    /// it arrives.
    #[prost(uint32, optional, tag = "5")]
    pub planned: Option<u32>,
}

/// How a participant joined by the open link.
#[derive(Clone, PartialEq, Eq, Message)]
pub struct Joined {
    /// SHA-256 of the request id. The same request again adds nobody.
    #[prost(bytes = "vec", tag = "1")]
    pub request_sha256: Vec<u8>,
    /// Its id at the panel; empty if none is asked for.
    #[prost(string, tag = "2")]
    pub panel_id: String,
}

/// A new session.
#[derive(Clone, PartialEq, Eq, Message)]
pub struct Opened {
    /// The participant.
    #[prost(uint32, tag = "1")]
    pub number: u32,
    /// The slot that it gets, if this is its first session and it gets none by its consent.
    #[prost(uint32, optional, tag = "2")]
    pub slot: Option<u32>,
    /// When, in milliseconds since the Unix epoch.
    #[prost(uint64, tag = "3")]
    pub at_ms: u64,
    /// On which device, if it is known.
    #[prost(message, optional, tag = "4")]
    pub device: Option<Device>,
}

/// A consent that was given.
#[derive(Clone, PartialEq, Eq, Message)]
pub struct Consented {
    /// The participant.
    #[prost(uint32, tag = "1")]
    pub number: u32,
    /// SHA-256 of the text, in UTF-8.
    #[prost(bytes = "vec", tag = "2")]
    pub text_sha256: Vec<u8>,
    /// Version of the text.
    #[prost(string, tag = "3")]
    pub version: String,
    /// Code of the page's language.
    #[prost(string, tag = "4")]
    pub language: String,
    /// When, in milliseconds since the Unix epoch.
    #[prost(uint64, tag = "5")]
    pub at_ms: u64,
    /// The slot that the participant gets, if it had none.
    #[prost(uint32, optional, tag = "6")]
    pub slot: Option<u32>,
}

/// Answers to a questionnaire.
#[derive(Clone, PartialEq, Eq, Message)]
pub struct Answered {
    /// The participant.
    #[prost(uint32, tag = "1")]
    pub number: u32,
    /// The answers.
    #[prost(message, repeated, tag = "2")]
    pub answers: Answers,
    /// When, in milliseconds since the Unix epoch.
    #[prost(uint64, tag = "3")]
    pub at_ms: u64,
    /// Number of steps that the participant passes over then.
    #[prost(uint32, tag = "4")]
    pub passed_over: u32,
}

/// Answers that were entered so far.
#[derive(Clone, PartialEq, Eq, Message)]
pub struct Saved {
    /// The participant.
    #[prost(uint32, tag = "1")]
    pub number: u32,
    /// All of them. They replace what was saved before.
    #[prost(message, repeated, tag = "2")]
    pub answers: Answers,
}

/// A game that gets a room: a [`PlacedGame`] as it is stored.
#[derive(Clone, PartialEq, Eq, Message)]
pub struct Placed {
    /// The participant.
    #[prost(uint32, tag = "1")]
    pub number: u32,
    #[prost(uint32, tag = "2")]
    step: u32,
    #[prost(uint32, tag = "3")]
    condition: u32,
    #[prost(bool, tag = "4")]
    practice: bool,
    #[prost(uint32, optional, tag = "5")]
    seed_index: Option<u32>,
    #[prost(uint32, tag = "6")]
    seat: u32,
    #[prost(uint32, tag = "7")]
    attempt: u32,
    #[prost(bytes = "vec", tag = "8")]
    room: Vec<u8>,
    #[prost(bytes = "vec", tag = "9")]
    game: Vec<u8>,
}

/// The end of a game.
#[derive(Clone, PartialEq, Eq, Message)]
pub struct GameEnded {
    /// The participant.
    #[prost(uint32, tag = "1")]
    pub number: u32,
    /// When, in milliseconds since the Unix epoch.
    #[prost(uint64, tag = "2")]
    pub at_ms: u64,
    /// Whether it has a result.
    #[prost(bool, tag = "3")]
    pub finished: bool,
}

/// A step, or a game of it, that a participant continued from.
#[derive(Clone, PartialEq, Eq, Message)]
pub struct Continued {
    /// The participant.
    #[prost(uint32, tag = "1")]
    pub number: u32,
    /// When, in milliseconds since the Unix epoch.
    #[prost(uint64, tag = "2")]
    pub at_ms: u64,
    /// Whether the participant is at its next step; otherwise at the next game of its step.
    #[prost(bool, tag = "3")]
    pub step_over: bool,
    /// Number of steps that it passes over then.
    #[prost(uint32, tag = "4")]
    pub passed_over: u32,
}

/// A withdrawal.
#[derive(Clone, PartialEq, Eq, Message)]
pub struct Withdrew {
    /// The participant.
    #[prost(uint32, tag = "1")]
    pub number: u32,
    /// When, in milliseconds since the Unix epoch.
    #[prost(uint64, tag = "2")]
    pub at_ms: u64,
    /// Whether the participant's data are deleted.
    #[prost(bool, tag = "3")]
    pub delete_data: bool,
}

/// The place of a participant in a group.
#[derive(Clone, PartialEq, Eq, Message)]
pub struct Grouped {
    /// The participant.
    #[prost(uint32, tag = "1")]
    pub number: u32,
    /// Number of the group, from 1.
    #[prost(uint32, tag = "2")]
    pub group: u32,
    /// The slot that the participant gets.
    #[prost(uint32, tag = "3")]
    pub slot: u32,
    /// Number of steps that it passes over then.
    #[prost(uint32, tag = "4")]
    pub passed_over: u32,
    /// When, in milliseconds since the Unix epoch.
    #[prost(uint64, tag = "5")]
    pub at_ms: u64,
}

/// An end of a participation.
#[derive(Clone, PartialEq, Eq, Message)]
pub struct Ended {
    /// The participant.
    #[prost(uint32, tag = "1")]
    pub number: u32,
    /// When, in milliseconds since the Unix epoch.
    #[prost(uint64, tag = "2")]
    pub at_ms: u64,
}

impl Change {
    /// The participant that it is about; `None` if it is about the study.
    pub fn number(&self) -> Option<u32> {
        Some(match self {
            Self::Added(it) => it.number,
            Self::Opened(it) => it.number,
            Self::Consented(it) => it.number,
            Self::Answered(it) => it.number,
            Self::Saved(it) => it.number,
            Self::Placed(it) => it.number,
            Self::GameEnded(it) => it.number,
            Self::Continued(it) => it.number,
            Self::Grouped(it) => it.number,
            Self::Withdrew(it) => it.number,
            Self::LeftOver(it)
            | Self::DroppedOut(it)
            | Self::ScreenedOut(it)
            | Self::Removed(it) => it.number,
            Self::Closed(_) => return None,
        })
    }

    /// Deletes the data of a participant who withdrew and had them deleted: its pseudonym, its id at
    /// the panel, its devices and its answers. The changes fold to the same study as before. Returns
    /// whether this one is different now and must be stored again.
    pub fn forget(&mut self, forgotten: u32) -> bool {
        match self {
            Self::Added(added) if added.number == forgotten => {
                let joined = added.joined.as_mut();
                let panel_id = joined.map(|it| std::mem::take(&mut it.panel_id));
                let had_panel_id = panel_id.is_some_and(|it| !it.is_empty());
                !std::mem::take(&mut added.pseudonym).is_empty() || had_panel_id
            }
            Self::Opened(opened) if opened.number == forgotten => opened.device.take().is_some(),
            Self::Answered(Answered {
                number, answers, ..
            })
            | Self::Saved(Saved { number, answers })
                if *number == forgotten =>
            {
                !std::mem::take(answers).is_empty()
            }
            _ => false,
        }
    }
}

impl Placed {
    /// The change by which a game of a participant gets a room.
    pub fn new(number: u32, game: &PlacedGame) -> Self {
        Self {
            number,
            step: small(game.step),
            condition: small(game.condition),
            practice: game.practice,
            seed_index: game.seed_index.map(small),
            seat: small(game.seat),
            attempt: game.attempt,
            room: game.room.to_vec(),
            game: game.game.to_vec(),
        }
    }

    /// The game.
    ///
    /// # Errors
    /// The id of the room or of the game does not have 16 bytes.
    pub fn game(&self) -> Result<PlacedGame, TryFromSliceError> {
        Ok(PlacedGame {
            step: self.step as usize,
            condition: self.condition as usize,
            practice: self.practice,
            seed_index: self.seed_index.map(|index| index as usize),
            seat: self.seat as usize,
            attempt: self.attempt,
            room: self.room[..].try_into()?,
            game: self.game[..].try_into()?,
        })
    }
}

fn small(number: usize) -> u32 {
    u32::try_from(number).unwrap_or(u32::MAX)
}

/// A game of a participant that has a room.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PlacedGame {
    /// The step in which it is played, from 0.
    pub step: usize,
    /// Index of the condition.
    pub condition: usize,
    /// Whether it is practice.
    pub practice: bool,
    /// Index of its seed in the list of the condition if that has one, else of the study; `None`
    /// for practice.
    pub seed_index: Option<usize>,
    /// The participant's seat.
    pub seat: usize,
    /// Attempt at this game, from 1.
    pub attempt: u32,
    /// Id of the room.
    pub room: [u8; 16],
    /// Id of the game.
    pub game: [u8; 16],
}

/// How a game ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    /// With a result.
    Finished,
    /// Without a result.
    Aborted,
}
