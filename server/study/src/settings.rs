//! Settings of a study and their checks. Its name for researchers, the rules, policies, other seats
//! and robots' behaviours of its conditions belong to the server.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::RangeInclusive;

use sha2::{Digest as _, Sha256};

use crate::assignment::Order;
use crate::checks::{Checked, characters, identifier, refuse, unique, within};
use crate::device::RequiredDevice;
use crate::picture::{MAX_BYTES_IN_ALL, MAX_PICTURES, Picture};
use crate::recruiting::Recruiting;
use crate::stage::{MAX_BLOCK, MAX_STAGES, Stage, Step, Task, steps};
use crate::templates::Language;

/// Maximum number of slots, and of participants with those who left.
pub const MAX_PARTICIPANTS: u32 = 10_000;
/// Maximum number of test participants.
pub const MAX_TESTS: u32 = 1000;
/// Maximum number of factors.
pub const MAX_FACTORS: usize = 8;
/// Maximum number of levels of a factor.
pub const MAX_LEVELS: usize = 16;
/// Maximum number of seeds of a list.
pub const MAX_SEEDS: usize = 1000;
/// Maximum number of steps of a participant.
pub const MAX_STEPS: usize = 200;
/// Maximum number of games of a participant, with practice.
pub const MAX_GAMES: u32 = 1000;
/// Numbers of participants who can be a group.
pub const GROUP_SIZES: RangeInclusive<u32> = 2..=6;
/// Maximum number of times that a sequence occurs in a block.
const MAX_REPEATS: usize = 16;
const MAX_TITLE: usize = 128;

/// Settings of a study, checked by [`Study::new`](crate::Study::new).
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Settings {
    /// Title that participants see, 1..=128 characters.
    pub title: String,
    /// Language of the page and the templates.
    pub language: Language,
    /// Number of slots, 1..=10000.
    pub participants: u32,
    /// The factors, at most 8.
    pub factors: Vec<Factor>,
    /// The conditions: 1..=32 between, 1..=12 within participants.
    pub conditions: Vec<Condition>,
    /// How conditions are assigned.
    pub order: Order,
    /// Number of slots in a block, 1..=16 times the number of sequences; `None`: once.
    pub block_size: Option<usize>,
    /// Seed of the assignment and of shuffled items.
    pub assignment_seed: [u8; 32],
    /// The list of game seeds, at most 1000. May be empty only if every condition has its own.
    pub seeds: Vec<[u8; 32]>,
    /// The stages, 1..=50.
    pub stages: Vec<Stage>,
    /// Whether interface traces are recorded.
    pub traces: bool,
    /// How long an active participant may have no session open, in milliseconds,
    /// 60000..=604800000.
    pub drop_out_after_ms: u64,
    /// When the study closes, in milliseconds since the Unix epoch.
    pub closes_at_ms: Option<u64>,
    /// When all its data are deleted, in milliseconds since the Unix epoch.
    pub deletes_at_ms: Option<u64>,
    /// How people without a link of their own take part.
    pub recruiting: Recruiting,
    /// Participants who play together, if any do.
    pub groups: Option<Groups>,
    /// The device that participants need, if not any.
    pub device: Option<RequiredDevice>,
    /// Pictures in texts, at most 16, together at most 524288 bytes.
    pub pictures: Vec<Picture>,
}

/// How participants play together.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Groups {
    /// Number of participants of a group, 2..=6.
    pub size: u32,
    /// How long participants wait for others, in milliseconds, 10000..=3600000.
    pub wait_ms: u64,
    /// What becomes of those whose group is not complete in time.
    pub left_over: LeftOverPolicy,
}

/// What becomes of participants whose group is not complete in time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LeftOverPolicy {
    /// Their participation ends.
    Dismiss,
    /// They are a group of fewer.
    Agents,
}

/// The last date that is written with four digits of the year, in milliseconds since the Unix epoch.
const MAX_TIME_MS: u64 = 253_402_300_799_999;

/// A factor of the design.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Factor {
    /// Its name, a column of exported data.
    pub name: String,
    /// Its levels, 1..=16.
    pub levels: Vec<String>,
}

/// A condition.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Condition {
    /// Identifies it in the study.
    pub id: String,
    /// Its level of each factor, by the factor's name.
    pub levels: BTreeMap<String, String>,
    /// Number of players of its games, 2..=6.
    pub players: usize,
    /// The participant's seat; `None`: it rotates.
    pub participant_seat: Option<usize>,
    /// Parts of the page that are hidden.
    pub hide: BTreeSet<Hide>,
    /// What the participant learns about the other seats.
    pub labels: Labels,
    /// Its own game seeds, at most 1000; empty: the study's.
    pub seeds: Vec<[u8; 32]>,
}

/// A part of the page that can be hidden.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Hide {
    /// The log of events.
    Log,
    /// The grid of plays.
    Lookup,
    /// Expressions.
    Expressions,
    /// The cards played in the Shift.
    Played,
    /// Links to other pages.
    Pages,
}

/// What the participant learns about the other seats. The server applies it to all that the
/// participant receives of a room.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Labels {
    /// Names and kinds.
    #[default]
    AsTheyAre,
    /// Kinds.
    Kinds,
    /// Neither.
    Players,
}

impl Settings {
    /// The sequences of conditions that participants have.
    pub fn sequences(&self) -> Vec<Vec<usize>> {
        self.order.sequences(self.conditions.len())
    }

    /// Number of slots in a block.
    pub(crate) fn slots_of_block(&self) -> usize {
        self.block_size.unwrap_or_else(|| self.sequences().len())
    }

    /// The steps of a participant with this sequence of conditions.
    pub fn steps(&self, sequence: &[usize]) -> Vec<Step<'_>> {
        steps(&self.stages, sequence)
    }

    /// Whether participants are asked for their consent, which is what they do first.
    pub fn asks_for_consent(&self) -> bool {
        self.stages.first().is_some_and(Stage::is_consent)
    }

    /// Number of participants who play together.
    pub fn group_size(&self) -> u32 {
        self.groups.map_or(1, |groups| groups.size)
    }

    /// Whether participants get their slots by their consent, so that nobody who declines takes one:
    /// they are asked for it before they play or meet a condition. Groups get theirs when they are
    /// formed.
    pub fn assigns_by_consent(&self) -> bool {
        if self.groups.is_some() {
            return false;
        }
        let plays = |stage: &&Stage| match stage {
            Stage::Once(part) => matches!(part.task, Task::Practice { .. } | Task::Games { .. }),
            Stage::PerCondition(_) => true,
        };
        let mut before = self.stages.iter().take_while(|stage| !plays(stage));
        before.any(Stage::is_consent)
    }

    /// SHA-256 of the seeds one after the other, for a preregistration.
    pub fn seeds_sha256(&self) -> [u8; 32] {
        Sha256::digest(self.seeds.concat()).into()
    }

    /// Number of games of a participant: those with seeds, and practice.
    pub fn games(&self) -> (u32, u32) {
        let sequence = &self.sequences()[0];
        let mut games = (0, 0);
        for step in self.steps(sequence) {
            match step.task {
                Task::Games { count } => games.0 += count,
                Task::Practice { .. } => games.1 += 1,
                _ => {}
            }
        }
        games
    }

    /// Returns the first invalid field.
    pub(crate) fn check(&self) -> Checked {
        characters("title", &self.title, 1..=MAX_TITLE)?;
        within("participants", self.participants, 1..=MAX_PARTICIPANTS)?;
        self.check_design()?;
        self.check_stages()?;
        self.check_groups()?;
        self.recruiting.check("recruiting")?;
        self.device.unwrap_or_default().check("device")?;
        self.check_pictures()?;
        let away = self.drop_out_after_ms;
        within("drop_out_after_ms", away, 60_000..=604_800_000)?;
        for (field, at_ms) in [
            ("closes_at_ms", self.closes_at_ms),
            ("deletes_at_ms", self.deletes_at_ms),
        ] {
            within(field, at_ms.unwrap_or(0), 0..=MAX_TIME_MS)?;
        }
        match (self.closes_at_ms, self.deletes_at_ms) {
            (Some(closes), Some(deletes)) if closes > deletes => {
                refuse("deletes_at_ms", "the study closes only after that")
            }
            _ => Ok(()),
        }
    }

    /// When the study closes, in milliseconds since the Unix epoch.
    pub(crate) fn end_ms(&self) -> Option<u64> {
        self.closes_at_ms.or(self.deletes_at_ms)
    }

    fn check_design(&self) -> Checked {
        within("factors", self.factors.len(), 0..=MAX_FACTORS)?;
        for (index, factor) in self.factors.iter().enumerate() {
            factor.check(&format!("factors[{index}]"))?;
        }
        let names = self.factors.iter().map(|factor| factor.name.as_str());
        unique(names, |index| format!("factors[{index}].name"))?;
        let most = match self.order {
            Order::Between => 32,
            Order::Within => 12,
        };
        within("conditions", self.conditions.len(), 1..=most)?;
        for (index, condition) in self.conditions.iter().enumerate() {
            condition.check(&format!("conditions[{index}]"), self)?;
        }
        let ids = self
            .conditions
            .iter()
            .map(|condition| condition.id.as_str());
        unique(ids, |index| format!("conditions[{index}].id"))?;
        let (size, sequences) = (self.slots_of_block(), self.sequences().len());
        if size == 0 || size % sequences != 0 || size / sequences > MAX_REPEATS {
            let problem = format!(
                "{size} is not a multiple of {sequences}, the number of conditions or of their \
                 orders, or more than {MAX_REPEATS} times it"
            );
            return refuse("block_size", problem);
        }
        within("seeds", self.seeds.len(), 0..=MAX_SEEDS)?;
        let has_own = |condition: &Condition| !condition.seeds.is_empty();
        if self.seeds.is_empty() && !self.conditions.iter().all(has_own) {
            return refuse("seeds", "empty, and a condition has no seeds of its own");
        }
        Ok(())
    }

    fn check_pictures(&self) -> Checked {
        within("pictures", self.pictures.len(), 0..=MAX_PICTURES)?;
        for (index, picture) in self.pictures.iter().enumerate() {
            picture.check(&format!("pictures[{index}]"))?;
        }
        let names = self.pictures.iter().map(|picture| picture.name.as_str());
        unique(names, |index| format!("pictures[{index}].name"))?;
        let bytes: usize = self.pictures.iter().map(|picture| picture.bytes).sum();
        within("pictures", bytes, 0..=MAX_BYTES_IN_ALL)
    }

    fn check_groups(&self) -> Checked {
        let parts = self.stages.iter().enumerate();
        let mut arrivals = parts.filter(|(_, stage)| {
            let mut parts = stage.parts().iter();
            parts.any(|part| matches!(part.task, Task::Arrival(_)))
        });
        let first = arrivals.next();
        let field = |index: usize| format!("stages[{index}]");
        let Some(groups) = &self.groups else {
            return match first {
                Some((index, _)) => refuse(
                    field(index),
                    "people arrive in groups: add groups, or remove this stage",
                ),
                None => Ok(()),
            };
        };
        within("groups.size", groups.size, GROUP_SIZES)?;
        within("groups.wait_ms", groups.wait_ms, 10_000..=3_600_000)?;
        for (index, condition) in self.conditions.iter().enumerate() {
            let players = condition.players as u32;
            within(
                &format!("conditions[{index}].rules.players"),
                players,
                groups.size..=6,
            )?;
        }
        if !self.participants.is_multiple_of(groups.size) {
            let (all, size) = (self.participants, groups.size);
            let problem = format!("{all} is not a multiple of {size}, the size of groups");
            return refuse("participants", problem);
        }
        let Some((index, stage)) = first else {
            return refuse(
                "stages",
                "a stage arrival is missing, at which groups are formed",
            );
        };
        if let Some((second, _)) = arrivals.next() {
            return refuse(field(second), "there is one arrival: remove this one");
        }
        let has_games = |stage: &Stage| match stage {
            Stage::Once(part) => matches!(part.task, Task::Games { .. }),
            Stage::PerCondition(_) => true,
        };
        if matches!(stage, Stage::PerCondition(_)) || self.stages[..index].iter().any(has_games) {
            let problem = "arrival must come before games and `per_condition`";
            return refuse(field(index), problem);
        }
        Ok(())
    }

    fn check_stages(&self) -> Checked {
        within("stages", self.stages.len(), 1..=MAX_STAGES)?;
        let (mut questionnaires, mut fields) = (Vec::new(), Vec::new());
        for (index, stage) in self.stages.iter().enumerate() {
            let field = format!("stages[{index}]");
            if let Stage::PerCondition(parts) = stage {
                let field = format!("{field}.per_condition.stages");
                within(&field, parts.len(), 1..=MAX_BLOCK)?;
            }
            for (part_index, part) in stage.parts().iter().enumerate() {
                let field = stage.path(&field, part_index);
                part.check(&field, &questionnaires)?;
                let is_once = matches!(stage, Stage::Once(_));
                match &part.task {
                    Task::Consent(_) if index > 0 || !is_once => {
                        return refuse(field, "consent must be the first stage, outside blocks");
                    }
                    Task::Games { .. } if is_once && self.order == Order::Within => {
                        return refuse(
                            field,
                            "games of a study within participants must be in `per_condition`",
                        );
                    }
                    Task::Questionnaire(it) => {
                        questionnaires.push(it);
                        fields.push(field);
                    }
                    _ => {}
                }
            }
        }
        let ids = questionnaires.iter().map(|it| it.id.as_str());
        unique(ids, |index| format!("{}.questionnaire.id", fields[index]))?;
        let steps = self.steps(&self.sequences()[0]).len();
        within("stages", steps, 1..=MAX_STEPS)?;
        let (counted, practice) = self.games();
        within("stages", counted + practice, 0..=MAX_GAMES)
    }
}

impl Factor {
    fn check(&self, field: &str) -> Checked {
        identifier(&format!("{field}.name"), &self.name)?;
        let field = format!("{field}.levels");
        within(&field, self.levels.len(), 1..=MAX_LEVELS)?;
        let mut levels = self.levels.iter();
        levels.try_for_each(|level| identifier(&field, level))?;
        unique(self.levels.iter().map(String::as_str), |_| field.clone())
    }
}

impl Condition {
    fn check(&self, field: &str, settings: &Settings) -> Checked {
        identifier(&format!("{field}.id"), &self.id)?;
        let levels = format!("{field}.levels");
        for factor in &settings.factors {
            let name = &factor.name;
            match self.levels.get(name) {
                None => return refuse(levels, format!("the level of {name:?} is missing")),
                Some(level) if !factor.levels.contains(level) => {
                    return refuse(levels, format!("{name:?} has no level {level:?}"));
                }
                Some(_) => {}
            }
        }
        if self.levels.len() > settings.factors.len() {
            return refuse(levels, "it names a factor that the study does not have");
        }
        within(&format!("{field}.rules.players"), self.players, 2..=6)?;
        let seat = self.participant_seat.unwrap_or(0);
        within(
            &format!("{field}.participant_seat"),
            seat,
            0..=self.players - 1,
        )?;
        within(&format!("{field}.seeds"), self.seeds.len(), 0..=MAX_SEEDS)
    }
}
