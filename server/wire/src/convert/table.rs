//! Reports from a physical table as messages and back, and the state of the table.

use std::collections::BTreeMap;
use std::time::Duration;

use chefshat_engine::{Cards, MAX_FACES, MAX_SEATS, Requirement, RuleSet, Seat, Viewer};
use chefshat_proto::v1::{self, table_report::Kind};
use chefshat_record::convert::{
    FieldProblem, decision_kind, observation_to_proto, put_requirement, role_from_number,
    seat_from_number, seat_number,
};
use chefshat_referee::counts::{Counts, JOKER};
use chefshat_referee::{Question, Report, SeenCards, Stage, ToLay, Violation};
use chefshat_room::journal::{Fill, ReportSource, Reported};
use chefshat_room::{Core, PhysicalTable, ReportOutcome, ReportVerdict, State};

use super::mirrored::Mirrored as _;
use super::name::checked_text;
use super::room::describe;

/// Longest id of a report or question, characters.
const MAX_ID: usize = 64;
/// Longest text of a question, characters.
const MAX_QUESTION: usize = 200;
/// Longest option of a question, characters.
const MAX_OPTION: usize = 64;
/// Numbers of options of a question.
const OPTIONS: std::ops::RangeInclusive<usize> = 2..=16;
/// Largest picture of a question, bytes.
const MAX_PICTURE_BYTES: usize = 32 * 1024;
/// Oldest event that can be reported, milliseconds.
const MAX_AGE_MS: u32 = 3_600_000;
/// Most cards in one report: more than a deck, since cards can be read twice.
const MAX_CARDS: usize = 255;

/// The numbers of faces and seats that a report may name.
#[derive(Debug, Clone, Copy)]
pub struct Deck {
    faces: u8,
    players: usize,
}

impl Deck {
    /// Those of the largest rule sets: reports are stored like this, so that they can be read
    /// without their game.
    pub const LARGEST: Self = Self {
        faces: MAX_FACES,
        players: MAX_SEATS,
    };

    /// Those of a rule set.
    pub fn of(rules: &RuleSet) -> Self {
        Self {
            faces: rules.faces(),
            players: rules.players(),
        }
    }
}

/// A report with its id.
///
/// # Errors
/// The first field that is malformed.
pub fn reported_from_proto(
    report_id: &str,
    message: &v1::TableReport,
    deck: Deck,
) -> Result<Reported, FieldProblem> {
    if message.age_ms > MAX_AGE_MS {
        return Err(FieldProblem::new(
            "age_ms",
            format!("{} is not in 0..={MAX_AGE_MS}", message.age_ms),
        ));
    }
    Ok(Reported {
        id: checked_text("report_id", report_id, 1..=MAX_ID)?,
        source: ReportSource::from_proto("source", message.source)?.unwrap_or(ReportSource::Camera),
        age: Duration::from_millis(message.age_ms.into()),
        report: report_from_proto(message, deck)?,
    })
}

/// The content of a report.
///
/// # Errors
/// The first field that is malformed.
fn report_from_proto(message: &v1::TableReport, deck: Deck) -> Result<Report, FieldProblem> {
    let seat = |field, number: u32| {
        let players = deck.players;
        seat_from_number(number, players).ok_or_else(|| {
            FieldProblem::new(field, format!("{number} is not in 0..={}", players - 1))
        })
    };
    let optional_seat =
        |field, number: Option<u32>| number.map(|number| seat(field, number)).transpose();
    let cards = |field, cards: &Option<v1::SeenCards>| {
        let cards = cards.as_ref();
        let cards = cards.ok_or_else(|| FieldProblem::new(field, "set the cards that are seen"))?;
        seen_cards(field, cards, deck)
    };
    let kind = (message.kind.as_ref())
        .ok_or_else(|| FieldProblem::new("kind", "say what happened: set one kind of report"))?;
    Ok(match kind {
        Kind::Hand(hand) => Report::Hand {
            seat: seat("hand.seat", hand.seat)?,
            cards: cards("hand.cards", &hand.cards)?,
        },
        Kind::Laid(laid) => Report::Laid {
            seat: optional_seat("laid.seat", laid.seat)?,
            cards: cards("laid.cards", &laid.cards)?,
        },
        Kind::Pass(pass) => Report::Pass {
            seat: optional_seat("pass.seat", pass.seat)?,
        },
        Kind::PassWithdrawn(pass) => Report::PassWithdrawn {
            seat: seat("pass_withdrawn.seat", pass.seat)?,
        },
        Kind::Cleared(_) => Report::Cleared,
        Kind::Special(special) => Report::Special {
            seat: optional_seat("special.seat", special.seat)?,
        },
        Kind::Gift(gift) => Report::Gift {
            seat: seat("gift.seat", gift.seat)?,
            cards: match &gift.cards {
                Some(cards) => Some(seen_cards("gift.cards", cards, deck)?),
                None => None,
            },
        },
        Kind::Role(taken) => Report::Role {
            seat: seat("role.seat", taken.seat)?,
            role: u8::try_from(taken.role)
                .ok()
                .and_then(role_from_number)
                .ok_or_else(|| FieldProblem::new("role.role", "not a role"))?,
        },
        Kind::Correction(correction) => Report::Correction {
            number: correction.report,
            instead: match &correction.instead {
                Some(instead) => Some(Box::new(replacement(instead, deck)?)),
                None => None,
            },
        },
        Kind::Question(question) => Report::Question(question_from_proto(question, deck)?),
        Kind::Answer(answer) => Report::Answer {
            id: checked_text("answer.question_id", &answer.question_id, 1..=MAX_ID)?,
            option: answer.option.map(|option| {
                // An option that does not fit does not exist, which the referee says.
                usize::try_from(option).unwrap_or(usize::MAX)
            }),
        },
        Kind::Pause(pause) => Report::Pause(pause.paused),
        Kind::EndConfirmed(_) => Report::EndConfirmed,
    })
}

/// The report that replaces a corrected one.
fn replacement(message: &v1::TableReport, deck: Deck) -> Result<Report, FieldProblem> {
    match message.kind {
        Some(Kind::Hand(_) | Kind::Laid(_) | Kind::Pass(_) | Kind::Gift(_) | Kind::Special(_)) => {
            report_from_proto(message, deck)
        }
        _ => Err(FieldProblem::new(
            "correction.instead",
            "only hand, laid, pass, gift or special can replace a report",
        )),
    }
}

fn seen_cards(
    field: &'static str,
    message: &v1::SeenCards,
    deck: Deck,
) -> Result<SeenCards, FieldProblem> {
    let faces = u32::from(deck.faces);
    if message.cards.len() > MAX_CARDS {
        return Err(FieldProblem::new(
            field,
            format!("{} cards are more than {MAX_CARDS}", message.cards.len()),
        ));
    }
    let mut counts: Counts = [0; JOKER + 1];
    for card in &message.cards {
        let kind = match *card {
            joker if joker == faces + 1 => JOKER,
            face if (1..=faces).contains(&face) => usize::try_from(face - 1).unwrap_or(JOKER),
            _ => {
                return Err(FieldProblem::new(
                    field,
                    format!(
                        "{card} is not a card: faces are 1..={faces}, a joker is {}",
                        faces + 1
                    ),
                ));
            }
        };
        counts[kind] += 1;
    }
    Ok(SeenCards {
        counts,
        golden: message.golden,
    })
}

fn question_from_proto(message: &v1::TableQuestion, deck: Deck) -> Result<Question, FieldProblem> {
    if !OPTIONS.contains(&message.options.len()) {
        return Err(FieldProblem::new(
            "question.options",
            format!(
                "{} options are not in {}..={}",
                message.options.len(),
                OPTIONS.start(),
                OPTIONS.end()
            ),
        ));
    }
    if message.picture.len() > MAX_PICTURE_BYTES {
        return Err(FieldProblem::new(
            "question.picture",
            format!(
                "{} bytes are more than {MAX_PICTURE_BYTES}; send a smaller part of it",
                message.picture.len()
            ),
        ));
    }
    let options = message.options.iter();
    Ok(Question {
        id: checked_text("question.question_id", &message.question_id, 1..=MAX_ID)?,
        text: checked_text("question.text", &message.text, 1..=MAX_QUESTION)?,
        options: options
            .map(|option| checked_text("question.options", option, 1..=MAX_OPTION))
            .collect::<Result<_, _>>()?,
        seat: match message.seat {
            None => None,
            Some(number) => Some(seat_from_number(number, deck.players).ok_or_else(|| {
                FieldProblem::new("question.seat", format!("there is no seat {number}"))
            })?),
        },
    })
}

/// A report as a message, without the picture of a question.
pub fn report_to_proto(reported: &Reported, deck: Deck) -> v1::TableReport {
    table_report(&reported.report, reported.source, reported.age, deck)
}

fn table_report(
    report: &Report,
    source: ReportSource,
    age: Duration,
    deck: Deck,
) -> v1::TableReport {
    v1::TableReport {
        source: source.to_proto().into(),
        age_ms: u32::try_from(age.as_millis()).unwrap_or(u32::MAX),
        kind: Some(kind_of_report(report, deck)),
    }
}

fn kind_of_report(report: &Report, deck: Deck) -> Kind {
    let seat = |seat: &Option<Seat>| seat.map(seat_number);
    let cards = |cards: &SeenCards| Some(seen_to_proto(cards, deck));
    match report {
        Report::Hand { seat, cards: seen } => Kind::Hand(v1::HandSeen {
            seat: seat_number(*seat),
            cards: cards(seen),
        }),
        Report::Laid {
            seat: by,
            cards: seen,
        } => Kind::Laid(v1::CardsLaid {
            seat: seat(by),
            cards: cards(seen),
        }),
        Report::Pass { seat: by } => Kind::Pass(v1::PassShown { seat: seat(by) }),
        Report::PassWithdrawn { seat } => Kind::PassWithdrawn(v1::PassWithdrawn {
            seat: seat_number(*seat),
        }),
        Report::Cleared => Kind::Cleared(v1::BoardCleared {}),
        Report::Special { seat: by } => Kind::Special(v1::SpecialActionSeen { seat: seat(by) }),
        Report::Gift { seat, cards: seen } => Kind::Gift(v1::GiftSeen {
            seat: seat_number(*seat),
            cards: seen.as_ref().and_then(cards),
        }),
        Report::Role { seat, role } => Kind::Role(v1::RoleTaken {
            seat: seat_number(*seat),
            role: *role as i32,
        }),
        Report::Correction { number, instead } => {
            Kind::Correction(Box::new(v1::ReportCorrection {
                report: *number,
                instead: instead.as_ref().map(|instead| {
                    Box::new(v1::TableReport {
                        kind: Some(kind_of_report(instead, deck)),
                        ..v1::TableReport::default()
                    })
                }),
            }))
        }
        Report::Question(question) => Kind::Question(question_to_proto(question, Vec::new())),
        Report::Answer { id, option } => Kind::Answer(answer_to_proto(id, *option)),
        Report::Pause(paused) => Kind::Pause(v1::TablePause { paused: *paused }),
        Report::EndConfirmed => Kind::EndConfirmed(v1::EndConfirmed {}),
    }
}

fn seen_to_proto(seen: &SeenCards, deck: Deck) -> v1::SeenCards {
    let kinds = seen.counts.iter().enumerate();
    let faces = usize::from(deck.faces);
    v1::SeenCards {
        cards: kinds
            .filter(|(kind, _)| *kind < faces || *kind == JOKER)
            .flat_map(|(kind, count)| {
                let card = u32::try_from(kind.min(faces) + 1).unwrap_or(u32::MAX);
                std::iter::repeat_n(card, usize::from(*count))
            })
            .collect(),
        golden: seen.golden,
    }
}

fn known_cards(cards: Cards, faces: u8) -> v1::SeenCards {
    v1::SeenCards {
        cards: cards.ascending(faces).map(u32::from).collect(),
        golden: Some(cards.has_golden()),
    }
}

fn question_to_proto(question: &Question, picture: Vec<u8>) -> v1::TableQuestion {
    v1::TableQuestion {
        question_id: question.id.clone(),
        text: question.text.clone(),
        options: question.options.clone(),
        seat: question.seat.map(seat_number),
        picture,
    }
}

fn answer_to_proto(question: &str, option: Option<usize>) -> v1::QuestionAnswered {
    v1::QuestionAnswered {
        question_id: question.to_owned(),
        option: option.map(|option| u32::try_from(option).unwrap_or(u32::MAX)),
    }
}

/// A violation that a report stated.
pub(super) fn violation_to_proto(report: u64, violation: &Violation) -> v1::Violation {
    v1::Violation {
        seat: violation.seat.map(seat_number),
        rule: violation.rule.to_proto().into(),
        text: violation.text.clone(),
        report,
    }
}

/// The response to a report.
pub fn report_response(outcome: &ReportOutcome, state: v1::TableState) -> v1::ReportResponse {
    let (verdict, detail) = match &outcome.verdict {
        ReportVerdict::Accepted => (v1::ReportVerdict::Accepted, String::new()),
        ReportVerdict::Known => (v1::ReportVerdict::Known, "This was known already.".into()),
        ReportVerdict::Violation(violation) => {
            (v1::ReportVerdict::Violation, violation.text.clone())
        }
        ReportVerdict::Held { question } => {
            let asked = (state.questions.iter()).find(|it| it.question_id == *question);
            let detail = asked.map_or_else(String::new, |asked| asked.text.clone());
            (v1::ReportVerdict::Held, detail)
        }
    };
    v1::ReportResponse {
        report: outcome.number,
        verdict: verdict.into(),
        detail,
        void_reports: outcome.void_reports.clone(),
        state: Some(state),
    }
}

/// The state of a physical table. `pictures`: of open questions, by their ids.
pub fn table_state(core: &Core, pictures: &BTreeMap<String, Vec<u8>>) -> v1::TableState {
    let mut state = v1::TableState {
        room: Some(describe(core)),
        stage: v1::TableStage::Waiting.into(),
        waiting_for: match core.state() {
            State::Waiting => "Waiting for the remote seats.".into(),
            _ => "The game is over.".into(),
        },
        ..v1::TableState::default()
    };
    if core.state().is_over() {
        state.stage = v1::TableStage::Over.into();
    }
    state.seats = (core.all_seats())
        .map(|seat| v1::TableSeat {
            at_table: matches!(core.standing(seat).fill, Fill::AtTable(_)),
            hand_known: (core.table()).is_some_and(|table| table.referee().hand_known(seat)),
        })
        .collect();
    if let Some(table) = core.table() {
        put_table(&mut state, core, table, pictures);
    }
    state
}

/// Adds what the referee knows.
fn put_table(
    state: &mut v1::TableState,
    core: &Core,
    table: &PhysicalTable,
    pictures: &BTreeMap<String, Vec<u8>>,
) {
    let referee = table.referee();
    let deck = Deck::of(&core.header().rules);
    if !core.state().is_over() {
        let (stage, seat) = stage_to_proto(referee.stage());
        state.stage = stage.into();
        state.seat = seat.map(seat_number);
        state.waiting_for = referee.waiting_for();
        state.paused = core.is_paused();
        state.play_requirement = play_requirement(core, stage);
    }
    let observation = referee.observe(Viewer::Spectator);
    state.observation = Some(observation_to_proto(&observation));
    let to_lay = referee.to_lay().iter();
    state.to_lay = to_lay
        .map(|it| to_lay_to_proto(it, referee.describe_to_lay(it), deck))
        .collect();
    state.answers = (referee.answers())
        .map(|answer| answer_to_proto(&answer.question, answer.option))
        .collect();
    let questions = referee.questions().iter();
    state.questions = questions
        .map(|question| {
            let picture = pictures.get(&question.id).cloned().unwrap_or_default();
            question_to_proto(question, picture)
        })
        .collect();
    let accepted = referee.accepted();
    state.reports = accepted
        .map(|accepted| {
            let (number, report) = (accepted.number, &accepted.report);
            let made = table.made(number);
            let (source, age) = made.map_or((ReportSource::Camera, Duration::ZERO), |made| {
                (made.source, made.age)
            });
            let elapsed = made.map_or(0, |made| made.at.as_millis());
            v1::AcceptedReport {
                report: number,
                seat: report.seat().map(seat_number),
                text: referee.describe(report),
                elapsed_ms: u64::try_from(elapsed).unwrap_or(u64::MAX),
                content: Some(without_hand(table_report(report, source, age, deck))),
                assumed_seat: accepted.is_assumed,
            }
        })
        .collect();
    let violation = referee.last_violation();
    state.violation = violation.map(|(report, violation)| violation_to_proto(*report, violation));
}

/// What a play must be, if a turn is awaited.
fn play_requirement(core: &Core, stage: v1::TableStage) -> Option<v1::PlayRequirement> {
    let requirement = core.requirement().filter(|requirement| {
        matches!(requirement, Requirement::Play(_))
            && matches!(stage, v1::TableStage::Turn | v1::TableStage::Opening)
    })?;
    let mut request = v1::DecisionRequest::default();
    put_requirement(&mut request, requirement);
    request.play_requirement
}

fn stage_to_proto(stage: Stage) -> (v1::TableStage, Option<Seat>) {
    match stage {
        Stage::Hand(seat) => (v1::TableStage::Hand, Some(seat)),
        // Nobody learns who has both jokers and keeps quiet (`docs/rules.md` §3.3).
        Stage::Special(_) => (v1::TableStage::SpecialAction, None),
        Stage::Gift(seat) => (v1::TableStage::Gift, Some(seat)),
        Stage::Opening => (v1::TableStage::Opening, None),
        Stage::Turn(seat) => (v1::TableStage::Turn, Some(seat)),
        Stage::Question => (v1::TableStage::Question, None),
        Stage::Confirmation => (v1::TableStage::Confirmation, None),
        Stage::Over => (v1::TableStage::Over, None),
    }
}

fn to_lay_to_proto(it: &ToLay, text: String, deck: Deck) -> v1::CardsToLay {
    v1::CardsToLay {
        seat: seat_number(it.seat),
        kind: decision_kind(it.kind).into(),
        cards: Some(known_cards(it.cards, deck.faces)),
        text,
        receiver: it.receiver.map(seat_number),
        shift: it.shift,
        pizza: it.pizza,
    }
}

/// A report without the cards of a hand, which the attendant must not see.
fn without_hand(mut report: v1::TableReport) -> v1::TableReport {
    if let Some(Kind::Hand(hand)) = &mut report.kind {
        hand.cards = None;
    }
    report
}
