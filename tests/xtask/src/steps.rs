//! The steps of a task: announced, timed, and summarised at the end.

use std::fmt::Write as _;
use std::process::Command;
use std::sync::Mutex;
use std::thread;
use std::time::{Duration, Instant};

use crate::command;
use crate::failure::Failure;

/// How a step ended.
enum Outcome {
    Passed,
    /// With the last lines that its program printed, if those were captured.
    Failed {
        output: String,
    },
    Skipped {
        reason: String,
    },
}

struct Step {
    name: String,
    outcome: Outcome,
    took: Duration,
    /// Processor time of its program, if that was captured.
    computed: Option<Duration>,
}

/// How many lanes run at a time: most wait for downloads, servers and clocks, and two processors have
/// something to compute until the last one ends.
const LANES: usize = 4;

/// Steps that run beside those of other lanes.
pub(crate) type Lane<'a> = Box<dyn FnOnce(&mut Steps) -> Result<(), Failure> + Send + 'a>;

/// The steps of a task so far.
#[derive(Default)]
pub(crate) struct Steps {
    done: Vec<Step>,
    /// Whether other lanes print at the same time: what a program prints appears when it has ended.
    in_lane: bool,
}

impl Steps {
    /// Runs one step. A failure names the step; the caller stops there.
    pub(crate) fn run(
        &mut self,
        name: &str,
        work: impl FnOnce() -> Result<(), Failure>,
    ) -> Result<(), Failure> {
        self.record(name, || (work(), None))
    }

    /// Runs one step that returns also what its program printed and computed.
    fn record(
        &mut self,
        name: &str,
        work: impl FnOnce() -> (Result<(), Failure>, Option<(String, Duration)>),
    ) -> Result<(), Failure> {
        println!("\n==> {name}");
        let start = Instant::now();
        let (result, program) = work();
        let computed = program.as_ref().map(|(_, computed)| *computed);
        let outcome = match result {
            Ok(()) => Outcome::Passed,
            Err(_) => Outcome::Failed {
                output: program.map_or_else(String::new, |(output, _)| last_lines(&output)),
            },
        };
        self.done.push(Step {
            name: name.to_owned(),
            outcome,
            took: start.elapsed(),
            computed,
        });
        result.map_err(|failure| Failure::new(format!("{name} failed: {failure}")))
    }

    /// Runs one program as a step.
    pub(crate) fn program(&mut self, name: &str, command: &mut Command) -> Result<(), Failure> {
        match self.in_lane {
            false => self.run(name, || command::run(command)),
            true => self.record(name, || {
                let command::Captured {
                    printed,
                    computed,
                    result,
                } = command::run_captured(command);
                println!("\n==> {name}, ended\n{}", printed.trim_end());
                (result, Some((printed, computed)))
            }),
        }
    }

    /// Runs lanes in their order, at most `LANES` at a time. A failure ends its lane and no other.
    pub(crate) fn beside(&mut self, lanes: Vec<Lane<'_>>) -> Result<(), Failure> {
        let waiting = Mutex::new(lanes.into_iter().enumerate());
        let ended = Mutex::new(Vec::new());
        let next = || waiting.lock().expect("lanes do not panic").next();
        thread::scope(|scope| {
            for _ in 0..LANES {
                scope.spawn(|| {
                    while let Some((number, lane)) = next() {
                        let mut steps = Steps {
                            in_lane: true,
                            ..Steps::default()
                        };
                        let result = lane(&mut steps);
                        let mut ended = ended.lock().expect("nothing panics under this lock");
                        ended.push((number, steps, result));
                    }
                });
            }
        });
        let mut ended = ended.into_inner().expect("lanes do not panic");
        ended.sort_by_key(|(number, ..)| *number);
        let mut results = Vec::new();
        for (_, steps, result) in ended {
            self.done.extend(steps.done);
            results.push(result);
        }
        Failure::of_any(results)
    }

    /// Reports a step that cannot be run.
    pub(crate) fn skip(&mut self, name: &str, reason: &str) {
        println!("\n==> {name}: SKIPPED, {reason}");
        let outcome = Outcome::Skipped {
            reason: reason.to_owned(),
        };
        self.done.push(Step {
            name: name.to_owned(),
            outcome,
            took: Duration::ZERO,
            computed: None,
        });
    }

    /// The last lines of the failed programs, then a line for each step that was reached, and last
    /// the lines that name failures: where a log is cut, its end tells what failed.
    pub(crate) fn summary(&self) -> String {
        let mut text = String::new();
        for step in &self.done {
            if let Outcome::Failed { output } = &step.outcome
                && !output.is_empty()
            {
                let name = &step.name;
                writeln!(
                    text,
                    "\n==> {name} failed; the end of its output:\n{output}"
                )
                .expect("a String grows as needed");
            }
        }
        text.push('\n');
        let width = self
            .done
            .iter()
            .map(|step| step.name.len())
            .max()
            .unwrap_or(0);
        for Step {
            name,
            outcome,
            took,
            computed,
        } in &self.done
        {
            let seconds = took.as_secs_f64();
            let computed = computed.map_or_else(String::new, |computed| {
                format!(", {:.1} s of processors", computed.as_secs_f64())
            });
            let line = match outcome {
                Outcome::Passed => format!("ok       {name:width$}  {seconds:6.1} s{computed}"),
                Outcome::Failed { .. } => {
                    format!("FAILED   {name:width$}  {seconds:6.1} s{computed}")
                }
                Outcome::Skipped { reason } => format!("skipped  {name:width$}  {reason}"),
            };
            writeln!(text, "{line}").expect("a String grows as needed");
        }
        for step in &self.done {
            if let Outcome::Failed { output } = &step.outcome {
                for line in naming(output.lines(), MOST_NAMED) {
                    writeln!(text, "{}: {line}", step.name).expect("a String grows as needed");
                }
            }
        }
        text
    }
}

/// The last lines, `most` of them, that name a failure; what is said often, once.
fn naming<'a>(lines: impl DoubleEndedIterator<Item = &'a str>, most: usize) -> Vec<&'a str> {
    const NAMING: [&str; 5] = ["FAIL", "failed", "panicked", "Error", "error:"];
    let passed = |line: &str| line.contains(" 0 failed") || line.ends_with("... ok");
    let names = |line: &&str| NAMING.iter().any(|word| line.contains(word)) && !passed(line);
    let mut naming = Vec::new();
    for line in lines.rev().filter(names) {
        if naming.len() < most && !naming.contains(&line) {
            naming.push(line);
        }
    }
    naming.reverse();
    naming
}

/// The lines of a log that tell most about a failure: those that name it, then the last ones.
fn last_lines(output: &str) -> String {
    let lines: Vec<&str> = output.lines().collect();
    let (earlier, last) = lines.split_at(lines.len().saturating_sub(LAST_LINES));
    let mut kept = naming(earlier.iter().copied(), LAST_LINES);
    kept.extend(last);
    kept.join("\n")
}

/// The most lines of a failed program that are shown again at the end, besides as many that name
/// failures.
const LAST_LINES: usize = 60;

/// The most lines of a failed program that name failures and are shown once more as the last ones.
const MOST_NAMED: usize = 12;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failure_names_its_step_and_is_in_the_summary() {
        let mut steps = Steps::default();
        steps.run("first", || Ok(())).unwrap();
        steps.skip("second", "nothing there");
        let failure = steps
            .run("third", || Err(Failure::new("exit status 1")))
            .unwrap_err();
        assert_eq!(failure.to_string(), "third failed: exit status 1");
        let summary = steps.summary();
        let lines: Vec<&str> = summary.lines().filter(|line| !line.is_empty()).collect();
        assert_eq!(lines.len(), 3);
        assert!(lines[0].starts_with("ok       first "));
        assert_eq!(lines[1], "skipped  second  nothing there");
        assert!(lines[2].starts_with("FAILED   third "));
    }

    #[test]
    fn of_a_long_output_the_failures_and_the_end_are_kept() {
        let mut lines = vec!["progress".to_owned(); 500];
        lines[10] = "a test failed: 1 is not 2".to_owned();
        lines[20] = "test result: ok. 3 passed; 0 failed".to_owned();
        lines[30] = "test what_failed_is_named ... ok".to_owned();
        lines.push("the end".to_owned());
        let kept = last_lines(&lines.join("\n"));
        assert!(kept.starts_with("a test failed: 1 is not 2\n"), "{kept}");
        assert!(kept.ends_with("\nthe end"), "{kept}");
        assert_eq!(kept.lines().count(), LAST_LINES + 1);
    }

    #[test]
    fn lanes_end_alone_and_all_steps_and_failures_are_named() {
        let program = |steps: &mut Steps, name: &str, script: &str| {
            steps.program(name, Command::new("sh").args(["-c", script]))
        };
        let mut steps = Steps::default();
        let lanes: Vec<Lane<'_>> = vec![
            Box::new(move |steps| {
                program(steps, "first", "echo a test FAILED; echo words; exit 1")?;
                program(steps, "never", "exit 0")
            }),
            Box::new(move |steps| program(steps, "second", "exit 0")),
        ];
        let failure = steps.beside(lanes).unwrap_err();
        let failure = failure.to_string();
        assert!(failure.starts_with("first failed: `sh -c "), "{failure}");
        let summary = steps.summary();
        assert!(summary.contains("FAILED   first "), "{summary}");
        assert!(summary.contains("ok       second "), "{summary}");
        assert!(!summary.contains("never"), "{summary}");
        assert!(summary.contains("words\n"), "{summary}");
        assert!(summary.ends_with("first: a test FAILED\n"), "{summary}");
    }
}
