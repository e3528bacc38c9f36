//! The settings of a study, checked, and what researchers see of it. `study_view` has what
//! participants see.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use chefshat_engine::RuleSet;
use chefshat_proto::v1::{self, rule_set, study_item, study_stage};
use chefshat_record::convert::{FieldProblem, rules_from_proto, rules_to_proto};
use chefshat_room::ids::{GameId, Id, RoomId, StudyId};
use chefshat_room::journal::{Fill, ParticipantKind, SeatLabels};
use chefshat_room::policy::{Durability, Policy, Visibility};
use chefshat_study::{
    AnswerSet, Arrival, Condition, Consent, Device, ExternalQuestionnaire, Factor, GROUP_SIZES,
    Groups, Hide, Item, ItemKind, Labels, Language, LeftOverPolicy, Order, Outcome, Part,
    Participant, Picture, PlacedGame, PlayedGame, Pointer, Questionnaire, Recruiting,
    RequiredDevice, ScreenOut, Settings, SettingsProblem, ShownIf, Stage, Status, Study, Task,
    Template, Text,
};

use super::agent::check_budget;
use super::mirrored::Mirrored as _;
use super::name::checked_name;
use super::number;
use super::policy::{policy_from_proto, policy_to_proto, requested_policy};
use super::room::{display_names_from_proto, fills_from_proto, wizards_from_proto};

/// Most Shifts of a hosted game, and highest target in points.
pub const MAX_HOSTED_SHIFTS: u32 = chefshat_record::MAX_RECORDED_SHIFTS;

/// How long a participant may be away by default, milliseconds.
const DEFAULT_DROP_OUT_MS: u64 = 1_800_000;
/// How long participants wait for others by default, milliseconds.
const DEFAULT_WAIT_MS: u64 = 600_000;
/// Longest text for programs of the researcher, characters.
const MAX_ROBOT_BEHAVIOUR: usize = 2000;

/// The checked settings of a study.
#[derive(Debug)]
pub struct StudyPlan {
    /// The settings of its core.
    pub core: Arc<Settings>,
    /// Name for researchers.
    pub name: String,
    /// What the core does not know of each condition.
    pub conditions: Vec<ConditionPlan>,
}

/// The games of a condition.
#[derive(Debug)]
pub struct ConditionPlan {
    /// The rules.
    pub rules: RuleSet,
    /// The rules of practice: the same for one Shift.
    pub practice_rules: RuleSet,
    /// The policy.
    pub policy: Policy,
    /// What fills the other seats, in their order.
    pub fills: Vec<Fill>,
    /// Display names of built-in agents, by index in `fills`.
    pub names: BTreeMap<usize, String>,
    /// Those that a person plays as another kind, by index in `fills`.
    pub wizards: BTreeSet<usize>,
    /// Text for programs of the researcher.
    pub robot_behaviour: String,
    /// What is shown of the seats.
    pub labels: SeatLabels,
}

fn problem(field: impl Into<String>, problem: impl Into<String>) -> SettingsProblem {
    SettingsProblem {
        field: field.into(),
        problem: problem.into(),
    }
}

/// The settings of a request with every field set. `random` returns random bytes; `durable` says
/// whether the server's games survive a restart.
///
/// # Errors
/// The first invalid field among those that have defaults.
pub fn complete_settings(
    mut message: v1::StudySettings,
    mut random: impl FnMut() -> [u8; 32],
    durable: bool,
) -> Result<v1::StudySettings, SettingsProblem> {
    message.name = checked_name("name", &message.name, 1).map_err(|it| inner("", &it))?;
    if message.language.is_empty() {
        message.language = Language::English.code().to_owned();
    }
    let language = language(&message.language)?;
    if message.order() == v1::StudyOrder::Unspecified {
        message.order = v1::StudyOrder::Between.into();
    }
    if message.assignment_seed.is_empty() {
        message.assignment_seed = random().to_vec();
    }
    if message.drop_out_after_ms == 0 {
        message.drop_out_after_ms = DEFAULT_DROP_OUT_MS;
    }
    message.recruiting.get_or_insert_default();
    if let Some(groups) = &mut message.groups {
        if groups.wait_ms == 0 {
            groups.wait_ms = DEFAULT_WAIT_MS;
        }
        if groups.left_over() == v1::StudyLeftOver::Unspecified {
            groups.left_over = v1::StudyLeftOver::Dismiss.into();
        }
    }
    for (index, condition) in message.conditions.iter_mut().enumerate() {
        let field = format!("conditions[{index}]");
        complete_condition(&field, condition, durable)?;
        let abort = condition.policy.as_ref().map(v1::RoomPolicy::abort);
        if message.groups.is_some() && abort != Some(v1::AbortPolicy::Never) {
            let words = "with groups it is NEVER: agents play on for those who leave";
            return Err(problem(format!("{field}.policy.abort"), words));
        }
    }
    for stage in &mut message.stages {
        let stages = match &mut stage.stage {
            Some(study_stage::Stage::PerCondition(block)) => block.stages.iter_mut().collect(),
            _ => vec![stage],
        };
        for stage in stages {
            if let Some(study_stage::Stage::Questionnaire(it)) = &mut stage.stage {
                complete_questionnaire(it, language)?;
            }
        }
    }
    let has_own = |condition: &v1::StudyCondition| !condition.seeds.is_empty();
    if message.seeds.is_empty() && !message.conditions.iter().all(has_own) {
        // As many as a participant has games.
        let probe = v1::StudySettings {
            seeds: vec![vec![0; 32]],
            ..message.clone()
        };
        let plan = study_plan(&probe)?;
        Study::new(Arc::clone(&plan.core))?;
        let (games, _) = plan.core.games();
        message.seeds = (0..games.max(1)).map(|_| random().to_vec()).collect();
    }
    if message.block_size == 0 {
        let plan = study_plan(&message)?;
        Study::new(Arc::clone(&plan.core))?;
        message.block_size = number(plan.core.sequences().len());
    }
    Ok(message)
}

fn complete_condition(
    field: &str,
    condition: &mut v1::StudyCondition,
    durable: bool,
) -> Result<(), SettingsProblem> {
    let rules = rules_from_proto(&condition.rules.clone().unwrap_or_default())
        .map_err(|it| inner(&format!("{field}.rules."), &it))?;
    condition.rules = Some(rules_to_proto(&rules));
    let length = match rules.stop() {
        chefshat_engine::Stop::Points(length) | chefshat_engine::Stop::Shifts(length) => length,
    };
    if length > MAX_HOSTED_SHIFTS {
        let words = format!("a game ends after at most {MAX_HOSTED_SHIFTS} points or Shifts");
        return Err(problem(format!("{field}.rules"), words));
    }
    let mut asked = condition.policy.clone().unwrap_or_default();
    if asked.abort() == v1::AbortPolicy::Unspecified {
        asked.abort = v1::AbortPolicy::Never.into();
    }
    asked.spectators_see_hands = None;
    let of_policy = |it: FieldProblem| inner(&format!("{field}.policy."), &it);
    let mut policy = requested_policy(&asked).map_err(of_policy)?;
    check_budget("substitute", policy.substitute).map_err(of_policy)?;
    policy.visibility = Visibility::Private;
    policy.spectators = false;
    policy.durability = match durable {
        true => Durability::Durable,
        false => Durability::Ephemeral,
    };
    condition.policy = Some(policy_to_proto(&policy));
    if condition.labels() == v1::StudyLabels::Unspecified {
        condition.labels = v1::StudyLabels::AsTheyAre.into();
    }
    Ok(())
}

fn complete_questionnaire(
    message: &mut v1::StudyQuestionnaire,
    language: Language,
) -> Result<(), SettingsProblem> {
    if message.template.is_empty() {
        return Ok(());
    }
    let name = &message.template;
    let template = Template::from_name(name)
        .ok_or_else(|| problem("stages", format!("there is no template {name:?}")))?;
    let Some(standard) = template.questionnaire(language) else {
        if message.items.is_empty() {
            let what = "has no texts in the language of the study";
            let todo = "list its items, from a validated translation";
            return Err(problem(
                "stages",
                format!("the template {name:?} {what}: {todo}"),
            ));
        }
        if message.id.is_empty() {
            message.id.clone_from(name);
        }
        return Ok(());
    };
    let default = |text: &mut String, standard: String| {
        if text.is_empty() {
            *text = standard;
        }
    };
    default(&mut message.id, standard.id);
    default(&mut message.title, standard.title);
    default(&mut message.instructions, standard.instructions);
    if message.items.is_empty() {
        message.items = standard.items.iter().map(item_to_proto).collect();
    }
    Ok(())
}

/// Reads complete settings. What the core knows is checked by [`Study::new`].
///
/// # Errors
/// The first invalid field.
pub fn study_plan(message: &v1::StudySettings) -> Result<StudyPlan, SettingsProblem> {
    let groups = message.groups.as_ref().map(groups).transpose()?;
    let device = message.device.as_ref().map(required_device).transpose()?;
    let group_size = groups.map_or(1, |groups| groups.size as usize);
    let mut plans = Vec::new();
    let mut conditions = Vec::new();
    for (index, condition) in message.conditions.iter().enumerate() {
        let field = format!("conditions[{index}]");
        let (condition, plan) = condition_of(&field, condition, group_size)?;
        conditions.push(condition);
        plans.push(plan);
    }
    let mut stages = Vec::new();
    for (index, stage) in message.stages.iter().enumerate() {
        stages.push(stage_of(&format!("stages[{index}]"), stage)?);
    }
    Ok(StudyPlan {
        core: Arc::new(Settings {
            title: message.title.clone(),
            language: language(&message.language)?,
            participants: message.participants,
            factors: (message.factors.iter())
                .map(|factor| Factor {
                    name: factor.name.clone(),
                    levels: factor.levels.clone(),
                })
                .collect(),
            conditions,
            order: Order::from_proto("order", message.order)
                .map_err(|_| problem("order", "it is not an order"))?
                .unwrap_or(Order::Between),
            block_size: usize::try_from(message.block_size)
                .ok()
                .filter(|size| *size > 0),
            assignment_seed: seed("assignment_seed", &message.assignment_seed)?,
            seeds: seeds("seeds", &message.seeds)?,
            stages,
            traces: message.traces,
            drop_out_after_ms: message.drop_out_after_ms,
            closes_at_ms: Some(message.closes_at_ms).filter(|at_ms| *at_ms > 0),
            deletes_at_ms: Some(message.deletes_at_ms).filter(|at_ms| *at_ms > 0),
            recruiting: recruiting(message.recruiting.clone().unwrap_or_default()),
            groups,
            device,
            pictures: (message.pictures.iter())
                .map(|picture| Picture::new(picture.name.clone(), &picture.data))
                .collect(),
        }),
        name: message.name.clone(),
        conditions: plans,
    })
}

/// A participant's device; `None` if it is not of the form of the protocol.
pub fn device_from_proto(message: v1::StudyDevice) -> Option<Device> {
    let device = Device {
        width: message.width,
        height: message.height,
        pixels: message.pixels,
        pointer: Pointer::of(message.pointer()).map_or(0, |it| it as u32),
        time_zone: message.time_zone,
    };
    device.is_valid().then_some(device)
}

/// A participant's device as a message.
pub fn device_to_proto(device: &Device) -> v1::StudyDevice {
    let pointer = device.pointer();
    let pointer = pointer.map_or(v1::StudyPointer::Unspecified, Pointer::to_proto);
    v1::StudyDevice {
        width: device.width,
        height: device.height,
        pixels: device.pixels,
        pointer: pointer.into(),
        time_zone: device.time_zone.clone(),
    }
}

fn recruiting(message: v1::StudyRecruiting) -> Recruiting {
    Recruiting {
        open_link: message.open_link,
        id_parameter: message.id_parameter,
        completed_url: message.completed_url,
        left_url: message.left_url,
        full_url: message.full_url,
        screened_out_url: message.screened_out_url,
        left_over_url: message.left_over_url,
    }
}

fn required_device(message: &v1::StudyRequiredDevice) -> Result<RequiredDevice, SettingsProblem> {
    Ok(RequiredDevice {
        pointer: Pointer::from_proto("pointer", message.pointer)
            .map_err(|_| problem("device.pointer", "choose FINE or COARSE"))?,
        // The core refuses one that does not fit.
        min_width: u16::try_from(message.min_width).unwrap_or(u16::MAX),
    })
}

fn groups(message: &v1::StudyGroups) -> Result<Groups, SettingsProblem> {
    let left_over = LeftOverPolicy::from_proto("left_over", message.left_over)
        .map_err(|_| problem("groups.left_over", "choose DISMISS or AGENTS"))?
        .unwrap_or(LeftOverPolicy::Dismiss);
    if !GROUP_SIZES.contains(&message.size) {
        let (least, most) = (GROUP_SIZES.start(), GROUP_SIZES.end());
        let words = format!("{} is not within {least}..={most}", message.size);
        return Err(problem("groups.size", words));
    }
    Ok(Groups {
        size: message.size,
        wait_ms: message.wait_ms,
        left_over,
    })
}

fn condition_of(
    field: &str,
    message: &v1::StudyCondition,
    group_size: usize,
) -> Result<(Condition, ConditionPlan), SettingsProblem> {
    let rules_message = message.rules.clone().unwrap_or_default();
    let rules =
        rules_from_proto(&rules_message).map_err(|it| inner(&format!("{field}.rules."), &it))?;
    let practice_rules = rules_from_proto(&v1::RuleSet {
        stop: Some(rule_set::Stop::TargetShifts(1)),
        ..rules_message
    })
    .map_err(|it| inner(&format!("{field}.rules."), &it))?;
    let policy = policy_from_proto(&message.policy.clone().unwrap_or_default())
        .map_err(|it| inner(&format!("{field}.policy."), &it))?;
    let players = rules.players();
    let seats_field = format!("{field}.seats");
    let Some(expected) = players.checked_sub(group_size) else {
        let words = format!("{players} players are fewer than a group of {group_size}");
        return Err(problem(format!("{field}.rules.players"), words));
    };
    if message.seats.len() != expected {
        let others = message.seats.len();
        let people = match group_size {
            1 => "one is the participant".to_owned(),
            _ => format!("{group_size} are a group of participants"),
        };
        let words = format!(
            "{others} other seats are described, but the rule set has {players} players, of whom {people}: describe {expected}"
        );
        return Err(problem(seats_field, words));
    }
    let of_seats = |it: FieldProblem| problem(seats_field.clone(), it.message);
    let mut seats = message.seats.clone();
    // Only the number of seats counts here.
    seats.resize_with(players, v1::SeatConfig::default);
    let mut fills = fills_from_proto(&seats, &rules).map_err(of_seats)?;
    let names = display_names_from_proto(&seats).map_err(of_seats)?;
    fills.truncate(message.seats.len());
    for fill in &fills {
        match fill {
            Fill::Open { .. } => {}
            Fill::BuiltIn(agent) => check_budget("seats", *agent).map_err(of_seats)?,
            Fill::Replay(_) | Fill::AtTable(_) => {
                let words = "choose a built-in agent or `reserved_for`";
                return Err(problem(seats_field, words));
            }
        }
    }
    let behaviour = message.robot_behaviour.chars().count();
    if behaviour > MAX_ROBOT_BEHAVIOUR {
        let words = format!("{behaviour} characters are more than {MAX_ROBOT_BEHAVIOUR}");
        return Err(problem(format!("{field}.robot_behaviour"), words));
    }
    let labels = v1::StudyLabels::try_from(message.labels)
        .map_err(|_| problem(format!("{field}.labels"), "they are not labels"))?;
    let condition = Condition {
        id: message.id.clone(),
        levels: (message.levels.iter())
            .map(|(factor, level)| (factor.clone(), level.clone()))
            .collect(),
        players,
        participant_seat: (message.participant_seat)
            .map(|seat| usize::try_from(seat).unwrap_or(usize::MAX)),
        hide: hidden(&format!("{field}.hide"), &message.hide)?,
        labels: Labels::of(labels).unwrap_or_default(),
        seeds: seeds(&format!("{field}.seeds"), &message.seeds)?,
    };
    let plan = ConditionPlan {
        rules,
        practice_rules,
        policy,
        fills,
        names,
        wizards: wizards_from_proto(&message.seats),
        robot_behaviour: message.robot_behaviour.clone(),
        labels: SeatLabels::of(labels).unwrap_or_default(),
    };
    Ok((condition, plan))
}

fn hidden(field: &str, messages: &[i32]) -> Result<BTreeSet<Hide>, SettingsProblem> {
    let hide = |message: &i32| {
        let part = Hide::from_proto("hide", *message).ok().flatten();
        part.ok_or_else(|| problem(field, format!("{message} is not a part of the page")))
    };
    messages.iter().map(hide).collect()
}

fn stage_of(field: &str, message: &v1::StudyStage) -> Result<Stage, SettingsProblem> {
    if let Some(study_stage::Stage::PerCondition(block)) = &message.stage {
        if !message.shown_if.is_empty() {
            return Err(problem(
                format!("{field}.shown_if"),
                "set it for the stages of the block",
            ));
        }
        let mut parts = Vec::new();
        for (index, stage) in block.stages.iter().enumerate() {
            let field = format!("{field}.per_condition.stages[{index}]");
            parts.push(part_of(&field, stage)?);
        }
        return Ok(Stage::PerCondition(parts));
    }
    part_of(field, message).map(Stage::Once)
}

fn part_of(field: &str, message: &v1::StudyStage) -> Result<Part, SettingsProblem> {
    Ok(Part {
        task: task_of(field, message)?,
        shown_if: shown_if(&message.shown_if),
    })
}

/// Conditions. Those without answers are refused as empty ones.
fn shown_if(messages: &[v1::StudyShownIf]) -> Vec<ShownIf> {
    let condition = |message: &v1::StudyShownIf| ShownIf {
        questionnaire: (!message.questionnaire.is_empty()).then(|| message.questionnaire.clone()),
        item: message.item.clone(),
        answers: message.answers.as_ref().map(answer_set).unwrap_or_default(),
        not: message.not,
    };
    messages.iter().map(condition).collect()
}

fn answer_set(message: &v1::StudyAnswerSet) -> AnswerSet {
    let options = message.options.iter();
    AnswerSet {
        min: message.min,
        max: message.max,
        options: options
            .map(|option| usize::try_from(*option).unwrap_or(usize::MAX))
            .collect(),
    }
}

/// Some of the answers to an item, as a message.
pub(super) fn answer_set_to_proto(answers: &AnswerSet) -> v1::StudyAnswerSet {
    v1::StudyAnswerSet {
        min: answers.min,
        max: answers.max,
        options: answers.options.iter().copied().map(number).collect(),
    }
}

fn task_of(field: &str, message: &v1::StudyStage) -> Result<Task, SettingsProblem> {
    use study_stage::Stage as Message;
    Ok(match &message.stage {
        None => return Err(problem(field, "the stage is empty")),
        Some(Message::PerCondition(_)) => {
            return Err(problem(field, "a block cannot have another block in it"));
        }
        Some(Message::Consent(consent)) => Task::Consent(Consent {
            text: consent.text.clone(),
            version: consent.version.clone(),
        }),
        Some(Message::Questionnaire(it)) => {
            let mut items = Vec::new();
            for (index, item) in it.items.iter().enumerate() {
                items.push(item_of(
                    &format!("{field}.questionnaire.items[{index}]"),
                    item,
                )?);
            }
            Task::Questionnaire(Questionnaire {
                id: it.id.clone(),
                title: it.title.clone(),
                instructions: it.instructions.clone(),
                items,
                shuffled: it.shuffled,
            })
        }
        Some(Message::ExternalQuestionnaire(it)) => Task::External(ExternalQuestionnaire {
            text: it.text.clone(),
            url: it.url.clone(),
        }),
        Some(Message::Practice(practice)) => Task::Practice {
            in_data: practice.in_data,
        },
        Some(Message::Games(games)) => Task::Games { count: games.count },
        Some(Message::Text(text)) => Task::Text(Text {
            title: text.title.clone(),
            text: text.text.clone(),
        }),
        Some(Message::Arrival(arrival)) => Task::Arrival(Arrival {
            text: arrival.text.clone(),
        }),
        Some(Message::ScreenOut(out)) => Task::ScreenOut(ScreenOut {
            text: out.text.clone(),
        }),
    })
}

fn item_of(field: &str, message: &v1::StudyItem) -> Result<Item, SettingsProblem> {
    use study_item::Kind;
    let kind = match message.kind.clone() {
        None => return Err(problem(field, "say how the item is answered")),
        Some(Kind::Likert(it)) => ItemKind::Likert {
            points: it.points,
            labels: it.labels,
        },
        Some(Kind::SemanticDifferential(it)) => ItemKind::SemanticDifferential {
            points: it.points,
            left: it.left,
            right: it.right,
        },
        Some(Kind::Slider(it)) => ItemKind::Slider {
            min: it.min,
            max: it.max,
            step: it.step,
            left: it.left,
            right: it.right,
        },
        Some(Kind::Choice(it)) => ItemKind::Choice {
            options: it.options,
            multiple: it.multiple,
        },
        Some(Kind::FreeText(it)) => ItemKind::FreeText {
            max_characters: usize::try_from(it.max_characters).unwrap_or(usize::MAX),
        },
        Some(Kind::Number(it)) => ItemKind::Number {
            min: it.min,
            max: it.max,
            unit: it.unit,
        },
    };
    Ok(Item {
        id: message.id.clone(),
        scale: message.scale.clone(),
        text: message.text.clone(),
        required: !message.optional,
        kind,
        shown_if: shown_if(&message.shown_if),
        attention_check: message.attention_check.as_ref().map(answer_set),
    })
}

fn item_to_proto(item: &Item) -> v1::StudyItem {
    v1::StudyItem {
        id: item.id.clone(),
        scale: item.scale.clone(),
        text: item.text.clone(),
        optional: !item.required,
        kind: Some(item_kind(item.kind.clone())),
        // Templates, whose items these are, have neither.
        ..v1::StudyItem::default()
    }
}

/// How an item is answered, as a message.
pub(super) fn item_kind(kind: ItemKind) -> study_item::Kind {
    use study_item::Kind;
    match kind {
        ItemKind::Likert { points, labels } => Kind::Likert(v1::StudyLikert { points, labels }),
        ItemKind::SemanticDifferential {
            points,
            left,
            right,
        } => Kind::SemanticDifferential(v1::StudySemanticDifferential {
            points,
            left,
            right,
        }),
        ItemKind::Slider {
            min,
            max,
            step,
            left,
            right,
        } => Kind::Slider(v1::StudySlider {
            min,
            max,
            step,
            left,
            right,
        }),
        ItemKind::Choice { options, multiple } => {
            Kind::Choice(v1::StudyChoice { options, multiple })
        }
        ItemKind::FreeText { max_characters } => Kind::FreeText(v1::StudyFreeText {
            max_characters: number(max_characters),
        }),
        ItemKind::Number { min, max, unit } => Kind::Number(v1::StudyNumber { min, max, unit }),
    }
}

fn language(code: &str) -> Result<Language, SettingsProblem> {
    Language::from_code(code).ok_or_else(|| {
        problem(
            "language",
            format!(
                "{code:?} is not a language of the page: choose from {}",
                Language::ALL.map(Language::code).join(", ")
            ),
        )
    })
}

fn seed(field: &str, bytes: &[u8]) -> Result<[u8; 32], SettingsProblem> {
    bytes
        .try_into()
        .map_err(|_| problem(field, format!("{} bytes; a seed has 32", bytes.len())))
}

fn seeds(field: &str, seeds: &[Vec<u8>]) -> Result<Vec<[u8; 32]>, SettingsProblem> {
    let seeds = seeds.iter().enumerate();
    seeds
        .map(|(index, bytes)| seed(&format!("{field}[{index}]"), bytes))
        .collect()
}

/// A problem within a message, under the path of the message.
fn inner(path: &str, of_field: &FieldProblem) -> SettingsProblem {
    problem(
        format!("{path}{}", of_field.field),
        of_field.message.clone(),
    )
}

/// The room of a game of a study, whose core knows only the bytes of ids.
pub fn room_of(placed: &PlacedGame) -> RoomId {
    Id::from_bytes(placed.room)
}

/// The id of a game of a study.
pub fn game_of(placed: &PlacedGame) -> GameId {
    Id::from_bytes(placed.game)
}

/// A study as a message, for researchers.
pub fn study_to_proto(
    id: StudyId,
    settings: &v1::StudySettings,
    created_at_ms: u64,
    open_link: String,
    study: &Study,
) -> v1::Study {
    let (games, practice_games) = study.settings().games();
    let participants = study.participants().values();
    let (tests, participants): (Vec<_>, Vec<_>) = participants.partition(|it| it.test);
    let mut counts = [0; 4];
    for participant in &participants {
        counts[match participant.status {
            Status::Invited => 0,
            Status::Active => 1,
            Status::Completed => 2,
            Status::Withdrawn
            | Status::DroppedOut
            | Status::Removed
            | Status::ScreenedOut
            | Status::LeftOver => 3,
        }] += 1;
    }
    let [invited, active, completed, left] = counts;
    let mut settings = settings.clone();
    for picture in &mut settings.pictures {
        picture.data.clear();
    }
    v1::Study {
        study_id: id.to_string(),
        settings: Some(settings),
        seeds_sha256: study.settings().seeds_sha256().to_vec(),
        created_at_ms,
        closed: study.is_closed(),
        steps: number(study.step_count()),
        games,
        practice_games,
        added: number(participants.len()),
        invited,
        active,
        completed,
        left,
        open_link,
        test_participants: number(tests.len()),
    }
}

/// A participant as a message, for researchers. `join_code` has that of the room of a running game.
pub fn study_participant(
    study: &Study,
    plan: &StudyPlan,
    number_of: u32,
    join_code: impl Fn(RoomId) -> String,
) -> Option<v1::StudyParticipant> {
    let participant = study.participant(number_of)?;
    let conditions = &study.settings().conditions;
    let sequence = study.sequence_of(participant).unwrap_or_default();
    Some(v1::StudyParticipant {
        number: number_of,
        pseudonym: participant.pseudonym.clone(),
        state: participant.status.to_proto().into(),
        slot: participant.slot,
        conditions: (sequence.iter())
            .map(|condition| conditions[*condition].id.clone())
            .collect(),
        step: number(participant.step()),
        connected: study.is_connected(number_of),
        sessions: participant.session,
        began_at_ms: participant.reached_at_ms.first().copied().unwrap_or(0),
        ended_at_ms: participant.ended_at_ms.unwrap_or(0),
        consent: participant
            .consent
            .as_ref()
            .map(|consent| v1::StudyConsentGiven {
                text_sha256: consent.text_sha256.clone(),
                version: consent.version.clone(),
                language: consent.language.clone(),
                at_ms: consent.at_ms,
            }),
        games: (participant.games.iter())
            .map(|game| study_game(study, plan, (number_of, participant), game, &join_code))
            .collect(),
        data_deleted: participant.data_deleted,
        panel_id: participant.panel_id().to_owned(),
        test: participant.test,
        group: participant.group.unwrap_or(0),
        planned_with: participant.planned.unwrap_or(0),
    })
}

fn study_game(
    study: &Study,
    plan: &StudyPlan,
    (number_of, participant): (u32, &Participant),
    game: &PlayedGame,
    join_code: &impl Fn(RoomId) -> String,
) -> v1::StudyGame {
    let placed = &game.placed;
    let condition = &plan.conditions[placed.condition];
    let (ended, ended_at_ms) = match game.ended {
        None => (v1::RoomState::Unspecified, 0),
        Some((Outcome::Finished, at_ms)) => (v1::RoomState::Finished, at_ms),
        Some((Outcome::Aborted, at_ms)) => (v1::RoomState::Aborted, at_ms),
    };
    let runs = game.ended.is_none() && participant.status == Status::Active;
    // Programs join the room of a group once.
    let is_first = runs && study.players_of(number_of).first() == Some(&number_of);
    let has_open = (condition.fills.iter()).any(|fill| matches!(fill, Fill::Open { .. }));
    v1::StudyGame {
        step: number(placed.step),
        condition: study.settings().conditions[placed.condition].id.clone(),
        practice: placed.practice,
        seed_index: placed.seed_index.map(number),
        seat: number(placed.seat),
        attempt: placed.attempt,
        room_id: room_of(placed).to_string(),
        game_id: game_of(placed).to_string(),
        ended: ended.into(),
        ended_at_ms,
        join_code: match is_first && has_open {
            true => join_code(room_of(placed)),
            false => String::new(),
        },
        robot_behaviour: match runs {
            true => condition.robot_behaviour.clone(),
            false => String::new(),
        },
    }
}

/// The kind of the participant's seat.
pub const PARTICIPANT_KIND: ParticipantKind = ParticipantKind::Human;
