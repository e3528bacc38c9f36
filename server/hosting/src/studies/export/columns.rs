//! The tables of a study's data but those of questionnaires, with their columns in order.

use chefshat_engine::SeatStatistics;
use chefshat_proto::v1::{self, StudyTraceKind, game_event::Kind as EventKind, record_line::Line};
use chefshat_record::outcome;
use chefshat_study::{
    Condition, DeviceSession, Outcome, Participant, PlayedGame, Pointer, Settings, Status, Study,
    Task,
};

use super::table::{Code, Column, Kind, Sheet, Table};
use chefshat_room::ids::GameId;
use chefshat_wire::convert::{self, Mirrored as _};

/// A time of day.
pub(super) const SINCE_EPOCH: Kind = Kind::Integer("milliseconds since 1970-01-01 00:00 UTC");
pub(super) const MILLISECONDS: Kind = Kind::Integer("milliseconds");
const CSS_PIXELS: Kind = Kind::Integer("CSS pixels");
/// A number of something, or the number or index of one.
pub(super) const COUNT: Kind = Kind::Integer("");

pub(super) const NUMBER: &str = "number of the participant in the study, from 1";
pub(super) const PSEUDONYM: &str = "pseudonym of the participant, its name in games";
pub(super) const CONDITION: &str = "condition";
const SESSION: &str = "number of the session of the participant, from 1";
pub(super) const STEP: &str = "step of the study, from 0";
const DELETED: &str = "its data were deleted";
const NO_RECORD: &str = "the game has not ended, its record cannot be read, or it was deleted with \
    the data of another participant";
const NO_RESULT: &str = "the game was not finished, its record cannot be read, or it was deleted \
    with the data of another participant";
const GROUP: &str = "number of the group, from 1";

pub(super) fn text(value: impl ToString) -> String {
    value.to_string()
}

pub(super) fn optional(value: Option<impl ToString>) -> String {
    value.map_or_else(String::new, text)
}

/// The code of a value of the protocol, whose name begins with `prefix`.
fn code_of(name: &str, prefix: &str) -> String {
    name.trim_start_matches(prefix).to_lowercase()
}

/// The codes of the study's conditions.
pub(super) fn conditions(settings: &Settings) -> Vec<Code> {
    let ids = settings.conditions.iter().map(|it| Code::new(&it.id, ""));
    ids.collect()
}

/// Adds the columns of the factors. `levels`: the level of a factor in a row, or several separated
/// by spaces.
pub(super) fn with_factors<R>(
    table: Table<R>,
    settings: &Settings,
    several: bool,
    missing: Option<&'static str>,
    levels: impl Fn(&R, &str) -> String + Copy + Send + Sync + 'static,
) -> Table<R> {
    settings.factors.iter().fold(table, |table, factor| {
        let codes = factor.levels.iter().map(|level| Code::new(level, ""));
        let codes = codes.collect();
        let name = factor.name.clone();
        let table = table.with(
            format!("factor_{name}"),
            Kind::Codes { codes, several },
            "level of this factor in the condition",
            move |row| levels(row, &name),
        );
        match missing {
            Some(when) => table.empty(when),
            None => table,
        }
    })
}

/// When the group of a participant is empty.
pub(super) const NO_GROUP: &str = "it has no group";

/// Adds the column of the group in a study with groups. `group`: that of a row; `missing`: when it has
/// none.
pub(super) fn with_group<R>(
    table: Table<R>,
    settings: &Settings,
    missing: &'static str,
    group: impl Fn(&R) -> Option<u32> + Send + Sync + 'static,
) -> Table<R> {
    match settings.groups.is_some() {
        true => table
            .with("group", COUNT, GROUP, move |row| optional(group(row)))
            .empty(missing),
        false => table,
    }
}

pub(super) fn level(condition: &Condition, factor: &str) -> String {
    condition.levels.get(factor).cloned().unwrap_or_default()
}

/// A participant, with its number.
pub(super) struct ParticipantRow<'s> {
    pub(super) study: &'s Study,
    pub(super) number: u32,
    pub(super) participant: &'s Participant,
}

/// A group, with those of its members whose data are exported, by number.
pub(super) struct GroupRow<'s> {
    pub(super) study: &'s Study,
    pub(super) group: u32,
    pub(super) members: Vec<(u32, &'s Participant)>,
}

impl GroupRow<'_> {
    /// When its members became a group: when they reached the step after their arrival.
    fn formed_at_ms(&self) -> Option<u64> {
        let (_, first) = self.members.first()?;
        let steps = self.study.settings().steps(self.study.sequence_of(first)?);
        let mut steps = steps.iter();
        let arrival = steps.position(|step| matches!(step.task, Task::Arrival(_)))?;
        first.reached_at_ms.get(arrival + 1).copied()
    }
}

/// `what` of each condition of a participant, in order, separated by spaces.
fn of_each_condition(
    study: &Study,
    participant: &Participant,
    what: impl Fn(&Condition) -> String,
) -> String {
    let sequence = study.sequence_of(participant).unwrap_or_default();
    let conditions = &study.settings().conditions;
    let words: Vec<String> = sequence.iter().map(|it| what(&conditions[*it])).collect();
    words.join(" ")
}

pub(super) fn groups<'s>(settings: &Settings) -> Table<GroupRow<'s>> {
    type Row<'s> = GroupRow<'s>;
    let conditions = Kind::Codes {
        codes: conditions(settings),
        several: true,
    };
    let of_each = |row: &Row<'_>, what: &dyn Fn(&Condition) -> String| {
        let first = row.members.first();
        first.map_or_else(String::new, |(_, it)| {
            of_each_condition(row.study, it, what)
        })
    };
    let table = Table::new("groups.csv", "a group of participants", &["group"])
        .with("group", COUNT, GROUP, |row: &Row<'s>| text(row.group))
        .with(
            "conditions",
            conditions,
            "its conditions in order",
            move |row| of_each(row, &|condition| condition.id.clone()),
        );
    with_factors(table, settings, true, None, move |row, factor| {
        of_each(row, &|condition| level(condition, factor))
    })
    .with(
        "formed_at_ms",
        SINCE_EPOCH,
        "when its participants became a group",
        |row| optional(row.formed_at_ms()),
    )
    .with(
        "participants",
        COUNT,
        "number of participants who became this group; agents played in place of those missing",
        |row| text(row.members.len()),
    )
    .with(
        "numbers",
        Kind::Text,
        "their numbers in the study, separated by spaces",
        |row| {
            let numbers = row.members.iter().map(|(number, _)| text(number));
            numbers.collect::<Vec<_>>().join(" ")
        },
    )
    .with(
        "completed",
        COUNT,
        "number of them who completed the study",
        |row| {
            let completed = |(_, it): &&(u32, &Participant)| it.status == Status::Completed;
            text(row.members.iter().filter(completed).count())
        },
    )
}

impl ParticipantRow<'_> {
    /// Number of attention checks that it has answered, and of those that it passed.
    fn attention_checks(&self) -> Option<(usize, usize)> {
        let is_kept = !self.participant.data_deleted;
        is_kept.then(|| self.study.attention_checks(self.participant))
    }

    /// `what` of each of its conditions, in order, separated by spaces.
    fn of_each(&self, what: impl Fn(&Condition) -> String) -> String {
        of_each_condition(self.study, self.participant, what)
    }
}

pub(super) fn participants<'s>(settings: &Settings) -> Table<ParticipantRow<'s>> {
    type Row<'s> = ParticipantRow<'s>;
    const NO_SLOT: &str =
        "it was assigned no slot: it has not begun, not consented, or has no group";
    const SLOT: &str = "its slot in the assignment of conditions, from 0: those of a group follow each \
        other; of one that has left the slot it had, which another may have now";
    const AT_STEP: &str =
        "step it is at, from 0; the number of steps once it has completed the study";
    const PANEL_ID: &str = "its id at the panel that recruited it";
    const NO_CONSENT: &str = "it has not consented";
    const PLANNED: &str = "number of the first of those with whom it was planned to play";
    let states = STATES.map(|(status, label)| Code::new(state_name(status), label));
    let conditions = Kind::Codes {
        codes: conditions(settings),
        several: true,
    };
    let table = Table::new("participants.csv", "a participant", &["number"])
        .with("number", COUNT, NUMBER, |row: &Row<'s>| text(row.number))
        .with("participant", Kind::Text, PSEUDONYM, |row| {
            row.participant.pseudonym.clone()
        })
        .empty(DELETED)
        .with("panel_id", Kind::Text, PANEL_ID, |row| {
            row.participant.panel_id().to_owned()
        })
        .empty("it did not join from a panel, or its data were deleted")
        .with(
            "test",
            Kind::Boolean,
            "whether it is a test participant",
            |row| text(row.participant.test),
        )
        .with(
            "state",
            Kind::one_of(states),
            "state of the participant",
            |row| state_name(row.participant.status),
        )
        .with("slot", COUNT, SLOT, |row| optional(row.participant.slot))
        .empty(NO_SLOT);
    let table = with_group(table, settings, NO_GROUP, |row| row.participant.group);
    let table = match settings.groups.is_some() {
        true => table
            .with("planned_with", COUNT, PLANNED, |row: &Row<'s>| {
                optional(row.participant.planned)
            })
            .empty("nobody was planned to play with it"),
        false => table,
    };
    let table = table
        .with("conditions", conditions, "its conditions in order", |row| {
            row.of_each(|condition| condition.id.clone())
        })
        .empty(NO_SLOT);
    with_factors(table, settings, true, Some(NO_SLOT), |row, factor| {
        row.of_each(|condition| level(condition, factor))
    })
    .with("step", COUNT, AT_STEP, |row| text(row.participant.step()))
    .with(
        "sessions",
        COUNT,
        "number of times that it opened the study",
        |row| text(row.participant.session),
    )
    .with("began_at_ms", SINCE_EPOCH, "when it began", |row| {
        optional(row.participant.reached_at_ms.first())
    })
    .empty("it has not begun")
    .with(
        "ended_at_ms",
        SINCE_EPOCH,
        "when it completed the study or left it",
        |row| optional(row.participant.ended_at_ms),
    )
    .empty("it has done neither")
    .with("consent_at_ms", SINCE_EPOCH, "when it consented", |row| {
        optional(row.participant.consent.as_ref().map(|it| it.at_ms))
    })
    .empty(NO_CONSENT)
    .with(
        "consent_version",
        Kind::Text,
        "version of the text that it consented to",
        |row| optional(row.participant.consent.as_ref().map(|it| &it.version)),
    )
    .empty(NO_CONSENT)
    .with(
        "consent_text_sha256",
        Kind::Text,
        "SHA-256 of that text in UTF-8, in hexadecimal digits",
        |row| {
            optional(
                row.participant
                    .consent
                    .as_ref()
                    .map(|it| hex::encode(&it.text_sha256)),
            )
        },
    )
    .empty(NO_CONSENT)
    .with(
        "consent_language",
        Kind::Text,
        "language of the page on which it consented",
        |row| optional(row.participant.consent.as_ref().map(|it| &it.language)),
    )
    .empty(NO_CONSENT)
    .with(
        "attention_checks",
        COUNT,
        "number of attention checks that it has answered",
        |row| optional(row.attention_checks().map(|(answered, _)| answered)),
    )
    .empty(DELETED)
    .with(
        "attention_checks_passed",
        COUNT,
        "number of these that it passed",
        |row| optional(row.attention_checks().map(|(_, passed)| passed)),
    )
    .empty(DELETED)
    .with(
        "data_deleted",
        Kind::Boolean,
        "whether its data were deleted",
        |row| text(row.participant.data_deleted),
    )
}

fn state_name(status: Status) -> String {
    let name = status.to_proto().as_str_name();
    code_of(name, "STUDY_PARTICIPANT_STATE_")
}

/// What participants can be, as in `StudyParticipantState`.
const STATES: [(Status, &str); 8] = [
    (Status::Invited, "has not opened its link"),
    (Status::Active, "has begun"),
    (Status::Completed, "has completed all steps"),
    (Status::Withdrawn, "has withdrawn"),
    (
        Status::DroppedOut,
        "had no page open for too long, or others of its group waited for it for too long",
    ),
    (Status::Removed, "was removed by the study's owner"),
    (Status::ScreenedOut, "was screened out by its answers"),
    (Status::LeftOver, "its group was not complete in time"),
];

/// A game of a participant.
pub(super) struct GameRow<'s> {
    pub(super) study: &'s Study,
    /// Name of the study.
    pub(super) name: &'s str,
    pub(super) number: u32,
    pub(super) participant: &'s Participant,
    pub(super) game: &'s PlayedGame,
    pub(super) result: Option<GameResult>,
}

/// What the record of a game says.
#[derive(Default)]
pub(super) struct GameResult {
    /// `None` if it has not started.
    started_at_ms: Option<u64>,
    /// Hints that the participant was given.
    hints: u32,
    /// Shifts played and the participant's statistics; `None` if it was not finished.
    outcome: Option<(u32, SeatStatistics)>,
}

impl GameResult {
    /// `seat`: the participant's.
    pub(super) fn of(lines: &[v1::RecordLine], seat: usize) -> Self {
        let mut result = Self::default();
        let mut created_at_ms = 0_u64;
        for line in lines.iter().filter_map(|line| line.line.as_ref()) {
            match line {
                Line::Header(header) => created_at_ms = header.created_at_ms,
                Line::Event(event) if matches!(event.kind, Some(EventKind::GameStarted(_))) => {
                    result.started_at_ms = Some(created_at_ms.saturating_add(event.elapsed_ms));
                }
                Line::Decision(decision) if decision.seat as usize == seat => {
                    result.hints = result.hints.saturating_add(decision.hints);
                }
                _ => {}
            }
        }
        result.outcome = outcome::outcome(lines).ok().and_then(|outcome| {
            let seat = outcome.seats.into_iter().nth(seat)?;
            Some((outcome.shifts, seat.statistics))
        });
        result
    }
}

impl GameRow<'_> {
    fn condition(&self) -> &Condition {
        &self.study.settings().conditions[self.game.placed.condition]
    }

    /// The group that plays the game.
    fn group(&self) -> Option<u32> {
        self.participant
            .group
            .filter(|_| !self.game.placed.practice)
    }

    /// Number of participants who began the game.
    fn players(&self) -> usize {
        self.study.began_with(self.number, self.game.placed.game)
    }

    fn seed(&self) -> Option<String> {
        let own = &self.condition().seeds;
        let seeds = match own.is_empty() {
            true => &self.study.settings().seeds,
            false => own,
        };
        self.game
            .placed
            .seed_index
            .map(|index| hex::encode(seeds[index]))
    }

    /// `what` of the outcome, or an empty cell.
    fn outcome<T: ToString>(&self, what: impl Fn(u32, &SeatStatistics) -> T) -> String {
        let result = self.result.as_ref();
        let outcome = result.and_then(|result| result.outcome.as_ref());
        optional(outcome.map(|(shifts, statistics)| what(*shifts, statistics)))
    }

    /// `what` of the participant's statistics, or an empty cell.
    fn statistics<T: ToString>(&self, what: impl Fn(&SeatStatistics) -> T) -> String {
        self.outcome(|_, statistics| what(statistics))
    }
}

pub(super) fn games<'s>(settings: &Settings) -> Table<GameRow<'s>> {
    type Row<'s> = GameRow<'s>;
    const PRACTICE: &str = "practice has no seed of the list";
    const ATTEMPT: &str =
        "attempt at this game, from 1: a game that ends without a result is played again";
    const SEED_INDEX: &str =
        "index of its seed in the list of the condition, or else of the study, from 0";
    const GAME: &str = "identifies the game; records/<game_id>.jsonl is its record, if it has one";
    const PLAYERS: &str = "number of participants of the study who began it together";
    const SUBSTITUTED: &str = "whether a substitute played for the participant, for a while or to the end: \
        place and points are then not its own alone";
    const DECISIONS: &str =
        "decisions of the participant, with those that timed out, without those of a substitute";
    const TIME: &str = "sum of the times of timed_decisions, measured by the server";
    let outcomes = [
        Code::new("playing", "has not ended"),
        Code::new("finished", "was played to its end"),
        Code::new("aborted", "ended without a result"),
    ];
    let condition = Kind::one_of(conditions(settings));
    let keys = &["number", "game_id"];
    let table = Table::new("games.csv", "a game of a participant", keys)
        .with("study", Kind::Text, "name of the study", |row: &Row<'s>| {
            row.name.to_owned()
        })
        .with("number", COUNT, NUMBER, |row| text(row.number))
        .with("participant", Kind::Text, PSEUDONYM, |row| {
            row.participant.pseudonym.clone()
        })
        .with("condition", condition, CONDITION, |row| {
            row.condition().id.clone()
        });
    let table = with_factors(table, settings, false, None, |row, factor| {
        level(row.condition(), factor)
    });
    let table = with_group(table, settings, "practice is played alone", GameRow::group);
    let table = match settings.groups.is_some() {
        true => table.with("participants", COUNT, PLAYERS, |row: &Row<'s>| {
            text(row.players())
        }),
        false => table,
    };
    table
        .with("step", COUNT, STEP, |row| text(row.game.placed.step))
        .with("practice", Kind::Boolean, "whether it is practice", |row| {
            text(row.game.placed.practice)
        })
        .with("attempt", COUNT, ATTEMPT, |row| {
            text(row.game.placed.attempt)
        })
        .with("seed_index", COUNT, SEED_INDEX, |row| {
            optional(row.game.placed.seed_index)
        })
        .empty(PRACTICE)
        .with(
            "seed",
            Kind::Text,
            "its seed, in hexadecimal digits",
            |row| optional(row.seed()),
        )
        .empty(PRACTICE)
        .with("seat", COUNT, "seat of the participant, from 0", |row| {
            text(row.game.placed.seat)
        })
        .with("game_id", Kind::Text, GAME, |row| {
            text(convert::game_of(&row.game.placed))
        })
        .with("outcome", Kind::one_of(outcomes), "how it ended", |row| {
            let outcome = match row.game.ended {
                None => "playing",
                Some((Outcome::Finished, _)) => "finished",
                Some((Outcome::Aborted, _)) => "aborted",
            };
            outcome.to_owned()
        })
        .with("started_at_ms", SINCE_EPOCH, "when it started", |row| {
            optional(row.result.as_ref().and_then(|it| it.started_at_ms))
        })
        .empty("it has not started, or has no record yet")
        .with("ended_at_ms", SINCE_EPOCH, "when it ended", |row| {
            optional(row.game.ended.map(|(_, at_ms)| at_ms))
        })
        .empty("it has not ended")
        .with("place", COUNT, "place of the participant, from 1", |row| {
            row.statistics(|it| it.place)
        })
        .empty(NO_RESULT)
        .with("points", COUNT, "points of the participant", |row| {
            row.statistics(|it| it.points)
        })
        .empty(NO_RESULT)
        .with("substituted", Kind::Boolean, SUBSTITUTED, |row| {
            row.statistics(|it| it.substituted)
        })
        .empty(NO_RESULT)
        .with("shifts", COUNT, "Shifts played", |row| {
            row.outcome(|shifts, _| shifts)
        })
        .empty(NO_RESULT)
        .with("decisions", COUNT, DECISIONS, |row| {
            row.statistics(|it| it.decisions)
        })
        .empty(NO_RESULT)
        .with(
            "invalid_answers",
            COUNT,
            "invalid attempts at them",
            |row| row.statistics(|it| it.wrong_actions),
        )
        .empty(NO_RESULT)
        .with("timeouts", COUNT, "those of them that timed out", |row| {
            row.statistics(|it| it.timeouts)
        })
        .empty(NO_RESULT)
        .with(
            "hints",
            COUNT,
            "hints that the participant was given",
            |row| optional(row.result.as_ref().map(|it| it.hints)),
        )
        .empty(NO_RECORD)
        .with(
            "timed_decisions",
            COUNT,
            "those of them that the participant took in time",
            |row| row.statistics(|it| it.timed_decisions),
        )
        .empty(NO_RESULT)
        .with(
            "decision_time_us",
            Kind::Integer("microseconds"),
            TIME,
            |row| row.statistics(|it| it.decision_time_us),
        )
        .empty(NO_RESULT)
}

/// A game whose record or samples cannot be read, and why.
pub(super) fn unreadable() -> Table<(GameId, String)> {
    Table::new(
        "unreadable.csv",
        "a game whose record or samples cannot be read",
        &["game_id"],
    )
    .with(
        "game_id",
        Kind::Text,
        "identifies the game",
        |(game, _): &(GameId, String)| text(game),
    )
    .with(
        "problem",
        Kind::Text,
        "why they cannot be read",
        |(_, problem)| problem.clone(),
    )
}

/// A session of a participant on a device that is known.
pub(super) struct SessionRow<'s> {
    pub(super) number: u32,
    pub(super) participant: &'s Participant,
    pub(super) session: u32,
    pub(super) opened: &'s DeviceSession,
}

pub(super) fn sessions<'s>() -> Table<SessionRow<'s>> {
    type Row<'s> = SessionRow<'s>;
    const OF: &str =
        "a session of a participant: the study opened on a device that says what it is";
    const PIXELS: &str = "pixels of the display in a hundred CSS pixels";
    const POINTER: &str = "most exact pointer of the device, as the media features of CSS have it";
    let pointers = POINTERS.map(|(_, code, label)| Code::new(code, label));
    Table::new("sessions.csv", OF, &["number", "session"])
        .with("number", COUNT, NUMBER, |row: &Row<'s>| text(row.number))
        .with("participant", Kind::Text, PSEUDONYM, |row| {
            row.participant.pseudonym.clone()
        })
        .with("session", COUNT, SESSION, |row| text(row.session))
        .with("opened_at_ms", SINCE_EPOCH, "when it was opened", |row| {
            text(row.opened.at_ms)
        })
        .with("width", CSS_PIXELS, "width of the page", |row| {
            text(row.opened.device.width)
        })
        .with("height", CSS_PIXELS, "height of the page", |row| {
            text(row.opened.device.height)
        })
        .with("pixels", COUNT, PIXELS, |row| {
            text(row.opened.device.pixels)
        })
        .with("pointer", Kind::one_of(pointers), POINTER, |row| {
            let known = (POINTERS.iter()).find(|(it, ..)| Some(*it) == row.opened.device.pointer());
            known.map_or_else(String::new, |(_, code, _)| (*code).to_owned())
        })
        .empty("it is not known")
        .with("time_zone", Kind::Text, "time zone of the device", |row| {
            row.opened.device.time_zone.clone()
        })
}

const POINTERS: [(Pointer, &str, &str); 3] = [
    (Pointer::None, "none", "there is none"),
    (Pointer::Coarse, "coarse", "such as a finger"),
    (Pointer::Fine, "fine", "such as a mouse"),
];

/// An event of the interface.
pub(super) struct TraceRow<'s> {
    pub(super) number: u32,
    pub(super) session: u32,
    pub(super) pseudonym: &'s str,
    pub(super) condition: &'s Condition,
    pub(super) game: GameId,
    pub(super) trace: &'s v1::StudyTrace,
}

pub(super) fn traces<'s>(settings: &Settings) -> Table<TraceRow<'s>> {
    type Row<'s> = TraceRow<'s>;
    let kinds = TRACES.map(|(kind, label)| Code::new(trace_name(kind), label));
    let condition = Kind::one_of(conditions(settings));
    let table = Table::new("traces.csv", "an event of a participant's interface", &[])
        .with("number", COUNT, NUMBER, |row: &Row<'s>| text(row.number))
        .with("participant", Kind::Text, PSEUDONYM, |row| {
            row.pseudonym.to_owned()
        })
        .with("condition", condition, CONDITION, |row| {
            row.condition.id.clone()
        });
    with_factors(table, settings, false, None, |row, factor| {
        level(row.condition, factor)
    })
    .with("game_id", Kind::Text, "identifies the game", |row| {
        text(row.game)
    })
    .with("session", COUNT, SESSION, |row| match row.session {
        0 => String::new(),
        session => text(session),
    })
    .empty("it was stored by an earlier version")
    .with(
        "decision_id",
        COUNT,
        "decision of the participant that was open, from 1; 0 if none was",
        |row| text(row.trace.decision_id),
    )
    .with(
        "at_ms",
        MILLISECONDS,
        "time since the page began the game, by a clock of the device that never goes back",
        |row| text(row.trace.at_ms),
    )
    .with("kind", Kind::one_of(kinds), "what happened", |row| {
        trace_name(row.trace.kind())
    })
    .with("target", Kind::Text, "what it happened to", |row| {
        row.trace.target.clone()
    })
    .empty("it happened to nothing")
    .with(
        "duration_ms",
        MILLISECONDS,
        "how long it lasted; 0 of what has no duration",
        |row| text(row.trace.duration_ms),
    )
}

fn trace_name(kind: StudyTraceKind) -> String {
    code_of(kind.as_str_name(), "STUDY_TRACE_KIND_")
}

/// The kinds of events that are stored.
const TRACES: [(StudyTraceKind, &str); 8] = [
    (StudyTraceKind::DecisionShown, "the decision was shown"),
    (StudyTraceKind::CardPicked, "a card of the hand was picked"),
    (StudyTraceKind::CardPutBack, "a picked card was put back"),
    (StudyTraceKind::Hover, "the pointer was over something"),
    (StudyTraceKind::Focus, "something had the keyboard's focus"),
    (StudyTraceKind::AnswerSent, "the answer was sent"),
    (
        StudyTraceKind::PageLeft,
        "the page was hidden or lost the window's focus",
    ),
    (
        StudyTraceKind::PageReturned,
        "the page was shown or had the window's focus again",
    ),
];

/// A column of a table.
pub(super) struct CodebookRow<'s> {
    pub(super) sheet: &'s Sheet,
    /// Its index.
    pub(super) index: usize,
}

impl CodebookRow<'_> {
    fn column(&self) -> &Column {
        &self.sheet.columns[self.index]
    }
}

pub(super) fn codebook<'s>() -> Table<CodebookRow<'s>> {
    type Row<'s> = CodebookRow<'s>;
    let types = [
        Code::new("string", "any text"),
        Code::new("integer", "an integer"),
        Code::new("boolean", "true or false"),
        Code::new("code", "one of the codes"),
        Code::new("codes", "codes separated by spaces"),
    ];
    Table::new("codebook.csv", "a column of a table", &["file", "column"])
        .with(
            "file",
            Kind::Text,
            "name of the table's file",
            |row: &Row<'s>| row.sheet.file.to_owned(),
        )
        .with(
            "position",
            COUNT,
            "place of the column in the table, from 1",
            |row| text(row.index + 1),
        )
        .with("column", Kind::Text, "name of the column", |row| {
            row.column().name.clone()
        })
        .with("type", Kind::one_of(types), "what its cells hold", |row| {
            row.column().kind().to_owned()
        })
        .with("unit", Kind::Text, "unit of its numbers", |row| {
            row.column().unit().to_owned()
        })
        .empty("it has none")
        .with("meaning", Kind::Text, "what it means", |row| {
            row.column().meaning.to_owned()
        })
        .with(
            "codes",
            Kind::Text,
            "its codes, with what they mean",
            |row| row.column().codes(),
        )
        .empty("it has no codes")
        .with("empty", Kind::Text, "when a cell is empty", |row| {
            optional(row.column().missing)
        })
        .empty("it never is")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_a_game_without_an_outcome_the_start_and_the_hints_are_known() {
        let event = |elapsed_ms, kind| {
            Line::Event(v1::GameEvent {
                elapsed_ms,
                kind: Some(kind),
                ..v1::GameEvent::default()
            })
        };
        let decision = |seat, hints| {
            Line::Decision(v1::DecisionRecord {
                seat,
                hints,
                ..v1::DecisionRecord::default()
            })
        };
        let lines = [
            Line::Header(Box::new(v1::RecordHeader {
                created_at_ms: 5_000,
                ..v1::RecordHeader::default()
            })),
            event(400, EventKind::GameStarted(Box::default())),
            decision(1, 2),
            decision(0, 1),
            decision(1, 1),
            event(900, EventKind::GameAborted(Box::default())),
        ];
        let lines = lines.map(|line| v1::RecordLine { line: Some(line) });
        let result = GameResult::of(&lines, 1);
        assert_eq!(result.started_at_ms, Some(5_400));
        assert_eq!(result.hints, 3);
        assert_eq!(result.outcome, None);
        assert_eq!(GameResult::of(&[], 1).started_at_ms, None);
    }
}
