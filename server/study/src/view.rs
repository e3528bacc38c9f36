//! What a participant may see of a study. No type here has a place for a condition, a slot, an
//! identifier that researchers chose, or the names of other seats, so none of them can be sent by
//! mistake.

use std::collections::BTreeSet;

use crate::Study;
use crate::games::Phase;
use crate::item_kind::ItemKind;
use crate::picture::names;
use crate::questionnaire::{Questionnaire, ShownItemIf};
use crate::recruiting::Recruiting;
use crate::settings::{Hide, Labels};
use crate::stage::{Consent, ExternalQuestionnaire, Task, Text};
use crate::state::{Participant, Status};
use crate::templates::Language;

/// What to show to a participant now.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct View {
    /// Title of the study.
    pub title: String,
    /// Language of the page.
    pub language: Language,
    /// The participant's pseudonym; empty after its data were deleted.
    pub pseudonym: String,
    /// The step, from 0; the number of steps after the last.
    pub step: usize,
    /// Number of steps, the same for all participants.
    pub steps: usize,
    /// Whether interface traces are recorded.
    pub traces: bool,
    /// Whether this is a test participant.
    pub test: bool,
    /// When all data of the study are deleted, in milliseconds since the Unix epoch.
    pub deletes_at_ms: Option<u64>,
    /// The content.
    pub content: Content,
}

/// The content of a view.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Content {
    /// A text to agree to.
    Consent(Consent),
    /// A questionnaire.
    Questionnaire(ShownQuestionnaire),
    /// An external questionnaire, its address complete.
    External(ExternalQuestionnaire),
    /// A text to read.
    Text(Text),
    /// A game, or practice.
    Game(ShownGame),
    /// A group that is not complete yet.
    Arrival(ShownArrival),
    /// Nothing more.
    End {
        /// Why.
        reason: End,
        /// Where the page sends the participant next, if anywhere.
        url: Option<String>,
        /// What the study says to those who are screened out, or empty.
        text: String,
    },
}

/// A questionnaire, as participants see it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ShownQuestionnaire {
    /// Title, or empty.
    pub title: String,
    /// Text above the items, or empty.
    pub instructions: String,
    /// The items in the order in which to show them.
    pub items: Vec<ShownItem>,
}

/// An item, as participants see it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ShownItem {
    /// Index of the item in the questionnaire's definition.
    pub item: usize,
    /// The question or statement.
    pub text: String,
    /// Whether it must be answered.
    pub required: bool,
    /// How it is answered.
    pub kind: ItemKind,
    /// It is shown, and answered, only while all of these hold.
    pub shown_if: Vec<ShownItemIf>,
}

/// A game, as its participant sees it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ShownGame {
    /// Whether it is practice.
    pub practice: bool,
    /// Number of the game in this step, from 1.
    pub game: u32,
    /// Number of games in this step.
    pub games: u32,
    /// Parts of the page that are hidden; empty until there is a room.
    pub hide: BTreeSet<Hide>,
    /// Ids of its room and of the game, once there is a room.
    pub place: Option<([u8; 16], [u8; 16])>,
    /// Whether the game has ended.
    pub ended: bool,
    /// Whether the other seats have names in place of their own; `false` until there is a room.
    pub labelled: bool,
    /// Number of others of its group for whom the game waits.
    pub waits_for: u32,
}

/// A group that is not complete yet, as a participant sees it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ShownArrival {
    /// What to read meanwhile, or empty.
    pub text: String,
    /// Number of participants of the group.
    pub size: u32,
    /// Number of those who are here, with this one.
    pub here: u32,
    /// How long the wait takes at most, in milliseconds.
    pub wait_ms: u64,
}

/// Why nothing more is shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum End {
    /// The participant has completed the study.
    Completed,
    /// It has withdrawn; its data so far are kept.
    Withdrawn,
    /// Its data were deleted.
    DataDeleted,
    /// It was away for too long.
    DroppedOut,
    /// It was removed by the study's owner.
    Removed,
    /// It was screened out by its answers.
    ScreenedOut,
    /// Its group was not complete in time.
    LeftOver,
}

impl View {
    /// Whether a text that is shown names a picture.
    pub fn names(&self, picture: &str) -> bool {
        let texts: Vec<&str> = match &self.content {
            Content::Consent(consent) => vec![&consent.text],
            Content::Questionnaire(shown) => {
                let questions = shown.items.iter().map(|item| item.text.as_str());
                questions.chain([shown.instructions.as_str()]).collect()
            }
            Content::External(external) => vec![&external.text],
            Content::Text(text) => vec![&text.text],
            Content::Arrival(arrival) => vec![&arrival.text],
            Content::End { text, .. } => vec![text],
            Content::Game(_) => Vec::new(),
        };
        texts.iter().any(|text| names(text, picture))
    }
}

impl Study {
    /// What to show to a participant now; `None` if it has not begun or is unknown.
    pub fn view(&self, number: u32) -> Option<View> {
        let participant = self.participant(number)?;
        let content = match participant.status {
            Status::Invited => return None,
            Status::Active => self.content(number, participant)?,
            _ if participant.data_deleted => self.end(participant, End::DataDeleted),
            Status::Completed => self.end(participant, End::Completed),
            Status::Withdrawn => self.end(participant, End::Withdrawn),
            Status::DroppedOut => self.end(participant, End::DroppedOut),
            Status::Removed => self.end(participant, End::Removed),
            Status::ScreenedOut => self.end(participant, End::ScreenedOut),
            Status::LeftOver => self.end(participant, End::LeftOver),
        };
        let settings = self.settings();
        Some(View {
            title: settings.title.clone(),
            language: settings.language,
            pseudonym: participant.pseudonym.clone(),
            step: participant.step(),
            steps: self.step_count(),
            traces: settings.traces,
            test: participant.test,
            deletes_at_ms: settings.deletes_at_ms,
            content,
        })
    }

    fn end(&self, participant: &Participant, reason: End) -> Content {
        let recruiting = &self.settings().recruiting;
        let url = match participant.status {
            Status::Completed => &recruiting.completed_url,
            Status::Withdrawn | Status::DroppedOut | Status::Removed => &recruiting.left_url,
            Status::ScreenedOut => recruiting.screened_out_url(),
            Status::LeftOver => recruiting.left_over_url(),
            Status::Invited | Status::Active => "",
        };
        // What a panel pays for was not done in a test.
        let url = match participant.test {
            true => None,
            false => Recruiting::filled_in(url, participant.panel_id()),
        };
        let text = match self.step_of(participant).map(|step| step.task) {
            Some(Task::ScreenOut(out)) if reason == End::ScreenedOut => out.text.clone(),
            _ => String::new(),
        };
        Content::End { reason, url, text }
    }

    fn content(&self, number: u32, participant: &Participant) -> Option<Content> {
        Some(match self.step_of(participant)?.task {
            Task::Consent(consent) => Content::Consent(consent.clone()),
            Task::Questionnaire(questionnaire) => {
                let items = self.items_after(participant, participant.step(), questionnaire);
                let mut order = self.item_order(number, participant.step())?;
                order.retain(|index| items.contains(index));
                Content::Questionnaire(ShownQuestionnaire::of(questionnaire, &order))
            }
            Task::External(it) => Content::External(it.filled_in(&participant.pseudonym)),
            Task::Text(text) => Content::Text(text.clone()),
            Task::ScreenOut(_) => self.end(participant, End::ScreenedOut),
            Task::Arrival(arrival) => Content::Arrival(self.shown_arrival(participant, arrival)),
            Task::Practice { .. } => Content::Game(self.shown_game(number, participant, true, 1)),
            Task::Games { count } => {
                Content::Game(self.shown_game(number, participant, false, *count))
            }
        })
    }

    fn shown_game(
        &self,
        number: u32,
        participant: &Participant,
        practice: bool,
        games: u32,
    ) -> ShownGame {
        let (game, ended) = match Phase::of(participant) {
            Phase::Due { .. } => (None, false),
            Phase::Playing(game) => (Some(&game.placed), false),
            Phase::Over(game) => (Some(&game.placed), true),
        };
        let conditions = &self.settings().conditions;
        ShownGame {
            practice,
            game: participant.games_done() + 1,
            games,
            hide: game.map_or_else(BTreeSet::new, |it| conditions[it.condition].hide.clone()),
            place: game.map(|it| (it.room, it.game)),
            ended,
            labelled: game.is_some_and(|it| conditions[it.condition].labels != Labels::AsTheyAre),
            waits_for: match game {
                None => self.late_for(number).len() as u32,
                Some(_) => 0,
            },
        }
    }
}

impl ShownQuestionnaire {
    fn of(questionnaire: &Questionnaire, order: &[usize]) -> Self {
        let shown = |&index: &usize| {
            let item = &questionnaire.items[index];
            ShownItem {
                item: index,
                text: item.text.clone(),
                required: item.required,
                kind: item.kind.clone(),
                shown_if: questionnaire.shown_if(item),
            }
        };
        Self {
            title: questionnaire.title.clone(),
            instructions: questionnaire.instructions.clone(),
            items: order.iter().map(shown).collect(),
        }
    }
}
