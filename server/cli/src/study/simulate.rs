//! `chefshat study simulate`: how likely a study is to find a known effect, by simulating it many
//! times. Participants are normally distributed opinions, or a built-in agent that plays the
//! games of each condition; `chefshat_simulation::power` simulates and tests.

use std::collections::BTreeSet;
use std::io::Write as _;
use std::path::PathBuf;
use std::process::ExitCode;
use std::str::FromStr;

use chefshat_agents::NamedAgent;
use chefshat_room::journal::Fill;
use chefshat_server::convert::{ConditionPlan, StudyPlan, complete_settings, study_plan};
use chefshat_simulation::power::{Answers, Design, Measure, Power, power};
use chefshat_simulation::{Batch, Progress};
use chefshat_study::{MAX_PARTICIPANTS, Order, Settings, Study, Task};
use clap::Args;
use serde_json::{Value, json};

use super::file;
use crate::numbers::{counted, grouped, signed};
use crate::output::{heading, line, percent, table};
use crate::remote::named_agent;
use crate::{CommandError, progress, say, threads};

/// Games of a condition that are played for its measure.
const GAMES: u64 = 2_000;
/// The measures of games.
const GAME_MEASURES: [&str; 2] = ["points", "place"];
/// The power that is usually asked for.
const USUAL: f64 = 0.8;

const HELP: &str = "\
The measure is a scale of a questionnaire, or an item that belongs to none (nasa_tlx/effort), or the points or the place of a game. \
Everybody answers all of its items: opinions with the deviation --sd, rounded to the values of the item and kept within them. SIZE shifts \
the opinions, in points (0.5) or in deviations (0.5sd). The games of points and place are played by --agent in every condition, with random \
deals: their effect is what the conditions make of it.

A participant counts once, with its mean in each condition, and a group once, as in the sample analysis. Conditions with the level are \
compared with the others: between participants by Welch's t-test, within them by a paired one, two-sided. Slots of those who leave are \
given to others, so everybody completes the study.

Examples:
  chefshat study simulate docs/studies/example.toml --measure nasa_tlx/effort --effect strength=strong:0.5sd
  chefshat study simulate docs/studies/example.toml --measure points --effect strength=strong --participants 16,32

The same seed gives the same output, on any number of threads.";

/// Simulate a study with a known effect, to learn how likely it is to be found.
#[derive(Debug, Args)]
#[command(after_help = HELP)]
pub(super) struct Simulate {
    /// The settings of the study, as for `create`. Nothing is sent to a server.
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// What is measured: QUESTIONNAIRE/SCALE, QUESTIONNAIRE/ITEM, points or place.
    #[arg(long)]
    measure: String,
    /// The level that has an effect, and by how much answers are higher with it.
    #[arg(long, value_name = "FACTOR=LEVEL[:SIZE]")]
    effect: Effect,
    /// Numbers of participants to try; by default the file's, twice and four times as many.
    #[arg(long, value_name = "N,…", value_delimiter = ',', value_parser = clap::value_parser!(u32).range(2..=i64::from(MAX_PARTICIPANTS)))]
    participants: Vec<u32>,
    /// Standard deviation of opinions, in points; by default a quarter of the item's range.
    #[arg(long, value_name = "POINTS", allow_negative_numbers = true, value_parser = positive)]
    sd: Option<f64>,
    /// Mean opinion without the level, in points; by default the middle of the item's range.
    #[arg(long, value_name = "POINTS", allow_negative_numbers = true)]
    mean: Option<f64>,
    /// Correlation of two opinions of a participant in two conditions.
    #[arg(long, value_name = "R", default_value_t = 0.5, value_parser = correlation)]
    correlation: f64,
    /// Correlation of two items of the measure in one condition; by default 0.7, or --correlation if
    /// that is higher.
    #[arg(long, value_name = "R", value_parser = correlation)]
    item_correlation: Option<f64>,
    /// Correlation of two opinions of different participants of a group; by default 0.2, or
    /// --correlation if that is lower.
    #[arg(long, value_name = "R", value_parser = correlation)]
    group_correlation: Option<f64>,
    /// The built-in agent that plays the participants' games.
    #[arg(long, default_value = "greedy", value_parser = named_agent)]
    agent: NamedAgent,
    /// Number of simulated studies for each number of participants.
    #[arg(long, value_name = "N", default_value_t = 2_000, value_parser = clap::value_parser!(u64).range(100..=1_000_000))]
    studies: u64,
    /// Level of the test.
    #[arg(long, default_value_t = 0.05, value_parser = level)]
    alpha: f64,
    /// Seed of all random choices.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Number of threads, at most 256; 0 means one per core.
    #[arg(long, value_name = "N", default_value_t = 0)]
    threads: usize,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// The level whose effect is looked for, and how large that is.
#[derive(Debug, Clone, PartialEq)]
struct Effect {
    factor: String,
    level: String,
    size: Option<Size>,
}

/// How much higher answers are.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Size {
    /// In points of the item.
    Points(f64),
    /// In standard deviations of opinions.
    Deviations(f64),
}

impl FromStr for Effect {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (of, size) = match text.rsplit_once(':') {
            Some((of, size)) => (of, Some(size)),
            None => (text, None),
        };
        let (factor, level) =
            (of.split_once('=')).ok_or("write FACTOR=LEVEL or FACTOR=LEVEL:SIZE")?;
        let number = |digits: &str| {
            let number = digits.parse::<f64>().ok().filter(|it| it.is_finite());
            number.ok_or_else(|| {
                format!("{digits:?} is not a number of points, or of deviations (0.5sd)")
            })
        };
        let size = size.map(|size| match size.strip_suffix("sd") {
            Some(digits) => number(digits).map(Size::Deviations),
            None => number(size).map(Size::Points),
        });
        Ok(Self {
            factor: factor.to_owned(),
            level: level.to_owned(),
            size: size.transpose()?,
        })
    }
}

fn within(text: &str, range: impl Fn(f64) -> bool, words: &str) -> Result<f64, String> {
    let number = text.parse::<f64>().ok().filter(|number| range(*number));
    number.ok_or_else(|| words.to_owned())
}

fn positive(text: &str) -> Result<f64, String> {
    let range = |number: f64| number > 0.0 && number.is_finite();
    within(text, range, "give a number above 0")
}

fn correlation(text: &str) -> Result<f64, String> {
    let range = |number: f64| (0.0..=1.0).contains(&number);
    within(text, range, "give a number from 0 to 1")
}

fn level(text: &str) -> Result<f64, String> {
    let range = |number: f64| number > 0.0 && number < 1.0;
    within(text, range, "give a number between 0 and 1")
}

impl Simulate {
    pub(super) fn run(self) -> Result<ExitCode, CommandError> {
        let settings = file::settings(&self.file)?;
        let shown = self.file.display();
        let plan = complete_settings(settings, || [0; 32], true);
        let plan = plan.and_then(|settings| study_plan(&settings));
        let plan = plan.map_err(|problem| format!("{shown}: {problem}"))?;
        let study =
            Study::new(plan.core.clone()).map_err(|problem| format!("{shown}: {problem}"))?;
        let has_level = self.conditions_with_level(&plan.core)?;
        let designs = self.designs(&study, &has_level)?;
        let pool = threads::pool(self.threads, self.studies)?;
        let measure = pool.install(|| self.measured(&plan))?;
        let bar = progress::of_items(self.studies * designs.len() as u64, "studies");
        let results: Vec<(u32, Design, Power)> = (designs.into_iter())
            .map(|(participants, design)| {
                let simulate = || {
                    let count = |studies| bar.inc(studies);
                    power(
                        &design,
                        &measure,
                        self.alpha,
                        self.studies,
                        self.seed,
                        &count,
                    )
                };
                let power = pool.install(simulate);
                (participants, design, power)
            })
            .collect();
        bar.finish_and_clear();
        match self.json {
            true => say(self.json(&plan, &measure, &results))?,
            false => write!(
                anstream::stdout().lock(),
                "{}",
                self.text(&plan, &measure, &results)
            )?,
        }
        Ok(ExitCode::SUCCESS)
    }

    /// By condition, whether it has the level of the effect.
    fn conditions_with_level(&self, settings: &Settings) -> Result<Vec<bool>, CommandError> {
        let Effect { factor, level, .. } = &self.effect;
        let known = |names: &mut dyn Iterator<Item = &str>| names.collect::<Vec<_>>().join(", ");
        let Some(of) = settings.factors.iter().find(|it| it.name == *factor) else {
            let all = known(&mut settings.factors.iter().map(|it| it.name.as_str()));
            return Err(format!("--effect: no factor {factor:?}; the file has {all}").into());
        };
        if !of.levels.contains(level) {
            let all = known(&mut of.levels.iter().map(String::as_str));
            return Err(format!("--effect: {factor} has no level {level:?}, but {all}").into());
        }
        let conditions = settings.conditions.iter();
        let has_level: Vec<bool> = conditions
            .map(|it| it.levels.get(factor) == Some(level))
            .collect();
        if has_level.iter().all(|has| *has == has_level[0]) {
            let words =
                "there is nothing to compare: all conditions have the level, or none has it";
            return Err(format!("--effect: {words}").into());
        }
        Ok(has_level)
    }

    /// What is measured, with the effect.
    fn measured(&self, plan: &StudyPlan) -> Result<Measure, CommandError> {
        if GAME_MEASURES.contains(&self.measure.as_str()) {
            if self.effect.size.is_some() {
                let words = "what the conditions make of games is their effect: leave out the size";
                return Err(format!("--effect: {words}").into());
            }
            return self.games(plan);
        }
        let ((min, max, step), count) = self.scale(&plan.core)?;
        let (min, max) = (f64::from(min), f64::from(max));
        let sd = self.sd.unwrap_or((max - min) / 4.0);
        let effect = match self.effect.size {
            Some(Size::Points(points)) => points,
            Some(Size::Deviations(deviations)) => deviations * sd,
            None => {
                return Err(
                    "--effect: add its size in points (:0.5) or deviations (:0.5sd)".into(),
                );
            }
        };
        let mean = self.mean.unwrap_or(f64::midpoint(min, max));
        if !(min..=max).contains(&mean) {
            return Err(format!("--mean: answers are from {min} to {max}").into());
        }
        let item_correlation = self.item_correlation.unwrap_or(self.correlation.max(0.7));
        if item_correlation < self.correlation {
            let words = format!("it must be at least --correlation, {}", self.correlation);
            return Err(format!("--item-correlation: {words}").into());
        }
        let group_correlation = match plan.core.groups {
            Some(_) => self.group_correlation.unwrap_or(self.correlation.min(0.2)),
            None => 0.0,
        };
        if group_correlation > self.correlation {
            let words = format!("it must be at most --correlation, {}", self.correlation);
            return Err(format!("--group-correlation: {words}").into());
        }
        Ok(Measure::Answers(Answers {
            min,
            max,
            step: step.max(1).into(),
            count,
            mean,
            sd,
            item_correlation,
            correlation: self.correlation,
            group_correlation,
            effect,
        }))
    }

    /// The lowest and highest value of a measure of questionnaires and the distance of two, and how many of
    /// its items a participant answers in each condition. All conditions have the same steps.
    fn scale(&self, settings: &Settings) -> Result<((i32, i32, u32), usize), CommandError> {
        let refuse = |words: &str| Err(format!("--measure: {words}").into());
        let sequence = &settings.sequences()[0];
        let (mut known, mut ranges) = (BTreeSet::new(), BTreeSet::new());
        let (mut played, mut count) = (false, 0);
        for step in settings.steps(sequence) {
            played |= matches!(step.task, Task::Games { .. });
            let Task::Questionnaire(questionnaire) = step.task else {
                continue;
            };
            for item in &questionnaire.items {
                let Some(range) = item
                    .kind
                    .numbers()
                    .filter(|_| item.attention_check.is_none())
                else {
                    continue;
                };
                let of = if item.scale.is_empty() {
                    &item.id
                } else {
                    &item.scale
                };
                let name = format!("{}/{of}", questionnaire.id);
                let is_measured = name == self.measure;
                known.insert(name);
                if !is_measured {
                    continue;
                }
                if !played {
                    return refuse(
                        "it is answered before the first game, so no condition changes it",
                    );
                }
                if !step.shown_if.is_empty() || !item.shown_if.is_empty() {
                    return refuse("not everybody answers it (shown_if)");
                }
                ranges.insert(range);
                // What is answered once belongs to the condition of somebody who has only one.
                let is_of_first = step
                    .block
                    .map_or(settings.order == Order::Between, |it| it == sequence[0]);
                count += usize::from(is_of_first);
            }
        }
        match (ranges.first(), ranges.len(), count) {
            (None, ..) => {
                let known = known.iter().map(String::as_str);
                let known: Vec<&str> = GAME_MEASURES.into_iter().chain(known).collect();
                let words = format!("no {:?}; the study has {}", self.measure, known.join(", "));
                refuse(&words)
            }
            (_, _, 0) => {
                refuse("it is not answered in each condition: ask for it in per_condition")
            }
            (Some(range), 1, count) => Ok((*range, count)),
            _ => refuse("the items of this scale have different ranges"),
        }
    }

    /// Plays the games of each condition.
    fn games(&self, plan: &StudyPlan) -> Result<Measure, CommandError> {
        let settings = &plan.core;
        let (count, _) = settings.games();
        if count == 0 {
            return Err("--measure: the study has no games".into());
        }
        // Of all conditions of a participant together.
        let conditions = settings.sequences()[0].len();
        let bar = progress::of_items(GAMES * plan.conditions.len() as u64, "games");
        let values = (plan.conditions.iter().enumerate())
            .map(|(index, condition)| {
                self.played(settings, index, condition, &|games| bar.inc(games))
            })
            .collect::<Result<_, _>>();
        bar.finish_and_clear();
        Ok(Measure::Games {
            values: values?,
            count: (count as usize / conditions).max(1),
        })
    }

    /// What a participant, or the mean of a group, has in games of a condition.
    fn played(
        &self,
        settings: &Settings,
        index: usize,
        condition: &ConditionPlan,
        progress: Progress<'_>,
    ) -> Result<Vec<f64>, CommandError> {
        let core = &settings.conditions[index];
        let first: Vec<usize> = match core.participant_seat {
            Some(seat) => vec![seat],
            None => (0..core.players).collect(),
        };
        let mut values = Vec::new();
        for first_seat in &first {
            let own = settings.seats_of_group(index, *first_seat);
            let mut others = condition.fills.iter();
            let agents: Vec<NamedAgent> = (0..core.players)
                .map(|seat| match own.contains(&seat) {
                    true => Ok(self.agent),
                    false => match others.next() {
                        Some(Fill::BuiltIn(agent)) => Ok(*agent),
                        _ => Err(format!(
                            "--measure: condition {:?} has seats without a built-in agent, whose games cannot be simulated",
                            core.id
                        )),
                    },
                })
                .collect::<Result<_, _>>()?;
            let games = GAMES / first.len() as u64;
            let batch = Batch::new(condition.rules, &agents, games, self.seed)?;
            values.extend(batch.results(progress).iter().map(|standings| {
                let rows = standings
                    .iter()
                    .filter(|(_, seat, _)| own.contains(&seat.index()));
                let of_rows: Vec<f64> = rows
                    .map(
                        |(place, _, points)| match self.measure == GAME_MEASURES[0] {
                            true => points as f64,
                            false => place.into(),
                        },
                    )
                    .collect();
                mean(&of_rows)
            }));
        }
        Ok(values)
    }

    /// The designs to simulate, by number of participants.
    fn designs(
        &self,
        study: &Study,
        has_level: &[bool],
    ) -> Result<Vec<(u32, Design)>, CommandError> {
        let settings = study.settings();
        let size = settings.group_size();
        let wanted = match self.participants.is_empty() {
            true => [1, 2, 4]
                .map(|times| times * settings.participants)
                .to_vec(),
            false => self.participants.clone(),
        };
        let wanted = wanted.into_iter().filter(|it| *it <= MAX_PARTICIPANTS);
        wanted
            .map(|participants| {
                if participants % size != 0 {
                    let problem =
                        format!("{participants} is not a multiple of {size}, the size of groups");
                    return Err(format!("--participants: {problem}").into());
                }
                let firsts = (0..participants).step_by(size as usize);
                let design = Design {
                    units: firsts.map(|slot| study.sequence(slot).to_vec()).collect(),
                    members: size as usize,
                    has_level: has_level.to_vec(),
                };
                if design.sizes().iter().any(|units| *units < 2) {
                    let problem =
                        "with and without the level, at least 2 participants or groups are needed";
                    return Err(format!("--participants: {participants}: {problem}").into());
                }
                Ok((participants, design))
            })
            .collect()
    }
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// What counts once.
fn units(settings: &Settings) -> &'static str {
    match settings.groups {
        Some(_) => "groups",
        None => "participants",
    }
}

impl Simulate {
    fn text(
        &self,
        plan: &StudyPlan,
        measure: &Measure,
        results: &[(u32, Design, Power)],
    ) -> String {
        let Effect { factor, level, .. } = &self.effect;
        let settings = &plan.core;
        let (units, is_within) = (units(settings), settings.order == Order::Within);
        let order = if is_within { "within" } else { "between" };
        let conditions = counted(settings.conditions.len() as u64, "condition");
        let mut lines = vec![format!(
            "{conditions} {order} participants; two-sided t-test of {units}, alpha {}",
            self.alpha
        )];
        match measure {
            Measure::Answers(it) => {
                let (min, max, count) = (it.min, it.max, counted(it.count as u64, "answer"));
                lines.push(format!(
                    "{count} from {min} to {max} in each condition; mean of opinions {}, deviation {}, effect {}",
                    it.mean,
                    it.sd,
                    signed(it.effect)
                ));
                let mut correlations = vec![format!("of a participant {}", it.correlation)];
                if it.count > 1 {
                    correlations.push(format!("of its items {}", it.item_correlation));
                }
                if settings.groups.is_some() {
                    correlations.push(format!("of a group {}", it.group_correlation));
                }
                lines.push(format!("correlations: {}", correlations.join(", ")));
            }
            Measure::Games { values, count } => {
                let games = counted(*count as u64, "game");
                let played = grouped(values.first().map_or(0, Vec::len) as u64);
                lines.push(format!(
                    "{games} of {} in each condition; means of {played} games:",
                    self.agent.name()
                ));
                let conditions = settings.conditions.iter().zip(values);
                lines.extend(conditions.map(|(it, of)| format!("  {}: {:.2}", it.id, mean(of))));
            }
        }
        let mut text = String::new();
        let words = format!(
            "Power of {:?} to find the effect of {factor} = {level} on {}",
            plan.name, self.measure
        );
        heading(&mut text, &words);
        lines.iter().for_each(|words| line(&mut text, words));
        text.push('\n');
        let header = [
            "participants",
            if is_within { units } else { "with | without" },
            "power",
            "95 %",
            "difference",
            if is_within { "d_z" } else { "d" },
            "found without effect",
        ];
        let rows = results.iter().map(|(participants, design, power)| {
            let [with, without] = design.sizes();
            let (interval, false_positives) = (power.interval95(), power.false_positives95());
            vec![
                participants.to_string(),
                match is_within {
                    true => with.to_string(),
                    false => format!("{with} | {without}"),
                },
                percent(power.share()),
                format!(
                    "{:.1} to {:.1}",
                    100.0 * interval.low,
                    100.0 * interval.high
                ),
                signed(power.difference.mean()),
                signed(power.standardized()),
                format!(
                    "{:.1} to {:.1} %",
                    100.0 * false_positives.low,
                    100.0 * false_positives.high
                ),
            ]
        });
        table(&mut text, &header, &[], rows);
        text.push('\n');
        let enough = results.iter().find(|(.., power)| power.share() >= USUAL);
        let enough = match enough {
            Some((participants, ..)) => {
                format!("{participants} are the fewest of these with a power of 80 %")
            }
            None => "None of these reaches a power of 80 %".to_owned(),
        };
        let studies = grouped(self.studies);
        line(
            &mut text,
            &format!(
                "{enough} ({studies} simulated studies each, seed {})",
                self.seed
            ),
        );
        text
    }

    fn json(&self, plan: &StudyPlan, measure: &Measure, results: &[(u32, Design, Power)]) -> Value {
        let Effect { factor, level, .. } = &self.effect;
        let measured = match measure {
            Measure::Answers(it) => json!({
                "min": it.min, "max": it.max, "step": it.step, "answers": it.count, "mean": it.mean, "sd": it.sd,
                "item_correlation": it.item_correlation, "correlation": it.correlation, "group_correlation": it.group_correlation, "effect": it.effect,
            }),
            Measure::Games { values, count } => {
                let means: serde_json::Map<_, _> = (plan.core.conditions.iter().zip(values))
                    .map(|(it, of)| (it.id.clone(), mean(of).into()))
                    .collect();
                json!({"games": count, "agent": self.agent.name(), "means": means})
            }
        };
        let results: Vec<Value> = results
            .iter()
            .map(|(participants, design, power)| {
                let [with, without] = design.sizes();
                let (interval, false_positives) = (power.interval95(), power.false_positives95());
                json!({
                    "participants": participants,
                    "with_level": with, "without_level": without,
                    "power": power.share(), "power_low": interval.low, "power_high": interval.high,
                    "difference": power.difference.mean(), "standardized": power.standardized(),
                    "found_without_effect": power.false_positives as f64 / power.studies.max(1) as f64,
                    "found_without_effect_low": false_positives.low,
                    "found_without_effect_high": false_positives.high,
                })
            })
            .collect();
        json!({
            "study": plan.name, "measure": self.measure, "factor": factor, "level": level,
            "units": units(&plan.core), "measured": measured, "alpha": self.alpha,
            "studies": self.studies, "seed": self.seed, "results": results,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_effect_has_a_level_and_perhaps_a_size() {
        let effect = |text: &str| text.parse::<Effect>();
        let of = |size| Effect {
            factor: "strength".to_owned(),
            level: "strong".to_owned(),
            size,
        };
        assert_eq!(effect("strength=strong"), Ok(of(None)));
        assert_eq!(
            effect("strength=strong:-0.5"),
            Ok(of(Some(Size::Points(-0.5))))
        );
        assert_eq!(
            effect("strength=strong:0.5sd"),
            Ok(of(Some(Size::Deviations(0.5))))
        );
        for (text, expected) in [
            ("strong", "FACTOR=LEVEL"),
            ("strength=strong:much", "not a number"),
            ("strength=strong:inf", "not a number"),
        ] {
            let problem = effect(text).expect_err(text);
            assert!(problem.contains(expected), "{text}: {problem}");
        }
    }
}
