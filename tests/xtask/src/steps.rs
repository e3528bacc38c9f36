//! The steps of a task: announced, timed, and summarised at the end.

use std::fmt::Write as _;
use std::process::Command;
use std::sync::mpsc;
use std::thread;
use std::time::{Duration, Instant};

use crate::command;
use crate::failure::Failure;

/// How a step ended.
enum Outcome {
    Passed,
    Failed,
    Skipped { reason: String },
}

struct Step {
    name: String,
    outcome: Outcome,
    took: Duration,
}

/// The steps of a task so far.
#[derive(Default)]
pub(crate) struct Steps {
    done: Vec<Step>,
}

impl Steps {
    /// Runs one step. A failure names the step; the caller stops there.
    pub(crate) fn run(
        &mut self,
        name: &str,
        work: impl FnOnce() -> Result<(), Failure>,
    ) -> Result<(), Failure> {
        println!("\n==> {name}");
        let start = Instant::now();
        let result = work();
        let outcome = if result.is_ok() {
            Outcome::Passed
        } else {
            Outcome::Failed
        };
        self.done.push(Step {
            name: name.to_owned(),
            outcome,
            took: start.elapsed(),
        });
        result.map_err(|failure| Failure::new(format!("{name} failed: {failure}")))
    }

    /// Runs one program as a step.
    pub(crate) fn program(&mut self, name: &str, command: &mut Command) -> Result<(), Failure> {
        self.run(name, || command::run(command))
    }

    /// Runs programs side by side, each as a step: for those that often wait. Of several, what each
    /// prints appears when it has ended.
    pub(crate) fn programs(&mut self, mut programs: Vec<(String, Command)>) -> Result<(), Failure> {
        if let [(name, command)] = programs.as_mut_slice() {
            return self.program(name, command);
        }
        let start = Instant::now();
        let mut failed = Vec::new();
        thread::scope(|scope| {
            let (ended, results) = mpsc::channel();
            for (name, mut command) in programs {
                println!("\n==> {name}, beside others");
                let ended = ended.clone();
                scope.spawn(move || {
                    let result = command::run_captured(&mut command);
                    // The receiver lives until the last program has ended.
                    let _ = ended.send((name, result, start.elapsed()));
                });
            }
            drop(ended);
            for (name, result, took) in results {
                println!("\n==> {name}");
                let outcome = match result {
                    Ok(output) => {
                        print!("{output}");
                        Outcome::Passed
                    }
                    Err(failure) => {
                        println!("{failure}");
                        failed.push(name.clone());
                        Outcome::Failed
                    }
                };
                self.done.push(Step {
                    name,
                    outcome,
                    took,
                });
            }
        });
        match failed.as_slice() {
            [] => Ok(()),
            names => Err(Failure::new(format!("{} failed", names.join(", ")))),
        }
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
        });
    }

    /// A line for each step that was reached.
    pub(crate) fn summary(&self) -> String {
        let mut text = String::from("\n");
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
        } in &self.done
        {
            let seconds = took.as_secs_f64();
            let line = match outcome {
                Outcome::Passed => format!("ok       {name:width$}  {seconds:6.1} s"),
                Outcome::Failed => format!("FAILED   {name:width$}  {seconds:6.1} s"),
                Outcome::Skipped { reason } => format!("skipped  {name:width$}  {reason}"),
            };
            writeln!(text, "{line}").expect("a String grows as needed");
        }
        text
    }
}

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
    fn of_programs_side_by_side_all_are_in_the_summary_and_each_failure_is_named() {
        let program = |name: &str, script: &str| {
            let mut shell = Command::new("sh");
            shell.args(["-c", script]);
            (name.to_owned(), shell)
        };
        let mut steps = Steps::default();
        let failing = program("first", "echo words; exit 1");
        let failure = steps
            .programs(vec![failing, program("second", "exit 0")])
            .unwrap_err();
        assert_eq!(failure.to_string(), "first failed");
        let summary = steps.summary();
        assert!(summary.contains("FAILED   first "), "{summary}");
        assert!(summary.contains("ok       second "), "{summary}");
    }
}
