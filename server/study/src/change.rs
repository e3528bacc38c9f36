//! The changes of a study and the values in them. `state` applies them; `commands` and `games`
//! decide when they follow.

use std::sync::Arc;

use crate::device::Device;
use crate::questionnaire::ItemAnswer;

/// A step of a study. Folding the same changes again restores the study.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Change {
    /// A participant was added.
    Added {
        /// Its number, from 1.
        number: u32,
        /// Its pseudonym.
        pseudonym: String,
        /// How it joined, if not by being added by a researcher.
        joined: Option<Joined>,
        /// Whether it is a test participant.
        test: bool,
        /// The first of those with whom it is to play, if that is planned; otherwise it plays with whom
        /// it arrives.
        planned: Option<u32>,
    },
    /// A participant opened a session, which supersedes its earlier ones.
    Opened {
        /// The participant.
        number: u32,
        /// The slot that it gets, if this is its first session and it gets none by its consent.
        slot: Option<u32>,
        /// When, in milliseconds since the Unix epoch.
        at_ms: u64,
        /// On which device, if it is known.
        device: Option<Device>,
    },
    /// A participant consented, and is at its next step.
    Consented {
        /// The participant.
        number: u32,
        /// The slot that it gets, if it had none.
        slot: Option<u32>,
        /// The consent.
        consent: ConsentGiven,
    },
    /// A participant answered a questionnaire, and is at its next step.
    Answered {
        /// The participant.
        number: u32,
        /// The answers.
        answers: Arc<[ItemAnswer]>,
        /// Number of steps that it passes over then.
        passed_over: u32,
        /// When, in milliseconds since the Unix epoch.
        at_ms: u64,
    },
    /// What a participant has entered in a questionnaire so far was saved.
    Saved {
        /// The participant.
        number: u32,
        /// All of it. Replaces what was saved before.
        answers: Arc<[ItemAnswer]>,
    },
    /// A game of a participant was assigned a room, before the room is created.
    Placed {
        /// The participant.
        number: u32,
        /// The game.
        game: PlacedGame,
    },
    /// The participant's game ended.
    GameEnded {
        /// The participant.
        number: u32,
        /// How.
        outcome: Outcome,
        /// When, in milliseconds since the Unix epoch.
        at_ms: u64,
    },
    /// A participant continued from a text, an external questionnaire or a game.
    Continued {
        /// The participant.
        number: u32,
        /// Whether it is at its next step; otherwise at the next game of its step.
        step_over: bool,
        /// Number of steps that it passes over then.
        passed_over: u32,
        /// When, in milliseconds since the Unix epoch.
        at_ms: u64,
    },
    /// A participant belongs to a group, and is at its next step. The changes of all participants of
    /// a group follow each other.
    Grouped {
        /// The participant.
        number: u32,
        /// Number of the group, from 1.
        group: u32,
        /// The slot that it gets.
        slot: u32,
        /// Number of steps that it passes over then.
        passed_over: u32,
        /// When, in milliseconds since the Unix epoch.
        at_ms: u64,
    },
    /// The group of a participant was not complete in time.
    LeftOver {
        /// The participant.
        number: u32,
        /// When, in milliseconds since the Unix epoch.
        at_ms: u64,
    },
    /// A participant had no session open for too long, or others waited for it for too long.
    DroppedOut {
        /// The participant.
        number: u32,
        /// When, in milliseconds since the Unix epoch.
        at_ms: u64,
    },
    /// A participant came to a step that screens it out.
    ScreenedOut {
        /// The participant.
        number: u32,
        /// When, in milliseconds since the Unix epoch.
        at_ms: u64,
    },
    /// A participant withdrew.
    Withdrew {
        /// The participant.
        number: u32,
        /// Whether its data are deleted.
        delete_data: bool,
        /// When, in milliseconds since the Unix epoch.
        at_ms: u64,
    },
    /// The study's owner removed a participant.
    Removed {
        /// The participant.
        number: u32,
        /// When, in milliseconds since the Unix epoch.
        at_ms: u64,
    },
    /// The study was closed.
    Closed,
}

impl Change {
    /// The participant that it is about; `None` if it is about the study.
    pub fn number(&self) -> Option<u32> {
        match self {
            Self::Added { number, .. }
            | Self::Opened { number, .. }
            | Self::Consented { number, .. }
            | Self::Answered { number, .. }
            | Self::Saved { number, .. }
            | Self::Placed { number, .. }
            | Self::GameEnded { number, .. }
            | Self::Continued { number, .. }
            | Self::Grouped { number, .. }
            | Self::LeftOver { number, .. }
            | Self::DroppedOut { number, .. }
            | Self::ScreenedOut { number, .. }
            | Self::Withdrew { number, .. }
            | Self::Removed { number, .. } => Some(*number),
            Self::Closed => None,
        }
    }

    /// Deletes the data of a participant who withdrew and had them deleted: its pseudonym, its id at
    /// the panel, its devices and its answers. The changes fold to the same study as before. Returns
    /// whether this one is different now and must be stored again.
    pub fn forget(&mut self, forgotten: u32) -> bool {
        match self {
            Self::Added {
                number,
                pseudonym,
                joined,
                ..
            } if *number == forgotten => {
                let panel_id = joined.as_mut().map(|it| std::mem::take(&mut it.panel_id));
                let had_panel_id = panel_id.is_some_and(|it| !it.is_empty());
                !std::mem::take(pseudonym).is_empty() || had_panel_id
            }
            Self::Opened { number, device, .. } if *number == forgotten => device.take().is_some(),
            Self::Answered {
                number, answers, ..
            }
            | Self::Saved { number, answers }
                if *number == forgotten =>
            {
                !std::mem::take(answers).is_empty()
            }
            _ => false,
        }
    }
}

/// How a participant joined by the open link.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Joined {
    /// SHA-256 of the request id. The same request again adds nobody.
    pub request_sha256: [u8; 32],
    /// Its id at the panel; empty if none is asked for.
    pub panel_id: String,
}

/// A consent that was given.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ConsentGiven {
    /// SHA-256 of the text, in UTF-8.
    pub text_sha256: [u8; 32],
    /// Version of the text.
    pub version: String,
    /// Code of the page's language.
    pub language: String,
    /// When, in milliseconds since the Unix epoch.
    pub at_ms: u64,
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
