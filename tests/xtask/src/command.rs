//! Starts other programs. Their output is passed through, or captured where several run side by
//! side.

use std::ffi::OsStr;
use std::process::{Command, Stdio};
use std::time::Duration;

use crate::failure::Failure;
use crate::places::Places;

/// The Cargo that started this program, if any, else the one on the path.
pub(crate) fn cargo() -> Command {
    Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()))
}

/// A module run by the Python packages' interpreter, in the folder of one of them, with all caches
/// in the build folder.
pub(crate) fn python_command(places: &Places, package: &str, module: &str) -> Command {
    let mut command = with_environment(places, Command::new(places.python()));
    command
        .args(["-m", module])
        .current_dir(places.root.join(package));
    command.env("RUFF_CACHE_DIR", places.own.join("ruff"));
    // Shared: the packages import the same ones.
    command.env("MYPY_CACHE_DIR", places.own.join("mypy"));
    // Most of the time of the learning tests is spent compiling; compiled programs are cached.
    command.env("JAX_COMPILATION_CACHE_DIR", places.own.join("jax"));
    command.env("JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS", "0");
    command.env("JAX_PERSISTENT_CACHE_MIN_ENTRY_SIZE_BYTES", "-1");
    command
}

/// Git, in the source tree.
pub(crate) fn git(places: &Places) -> Command {
    let mut git = Command::new("git");
    git.current_dir(&places.root);
    git
}

/// Tells tests where the server, the other languages and the protocol are.
pub(crate) fn with_environment(places: &Places, mut command: Command) -> Command {
    command.env("CHEFSHAT_BIN", places.chefshat());
    command.env("CHEFSHAT_PYTHON", places.python());
    command.env("CHEFSHAT_NODE_DIR", places.node());
    command.env("CHEFSHAT_CPP_AGENT", places.cpp_agent());
    command.env("CHEFSHAT_WEB_DIR", places.web());
    command.env("CHEFSHAT_PROTO", places.root.join("proto"));
    // Several suites run at a time: threads of one computation would wait for each other.
    for library in [
        "OMP_NUM_THREADS",
        "OPENBLAS_NUM_THREADS",
        "MKL_NUM_THREADS",
        "OPENCV_FOR_THREADS_NUM",
    ] {
        command.env(library, "1");
    }
    // Otherwise Python would write its caches among the sources, also when a Rust test starts it.
    command.env("PYTHONPYCACHEPREFIX", places.own.join("pycache"));
    command
}

/// Runs a command; an exit code other than 0 is a failure that names the command line.
pub(crate) fn run(command: &mut Command) -> Result<(), Failure> {
    println!("    {}", line(command));
    let status = command
        .status()
        .map_err(|error| cannot_start(command, &error))?;
    if status.success() {
        Ok(())
    } else {
        Err(Failure::new(format!("`{}`: {status}", line(command))))
    }
}

/// What a command printed, and the processor time that it and what it started took.
pub(crate) struct Captured {
    pub(crate) printed: String,
    pub(crate) computed: Duration,
    pub(crate) result: Result<(), Failure>,
}

/// Under the shell's `time`: on a busy machine, processor time says more about a step than the time
/// on a clock. What hangs is ended, with what it started, so that the run ends and names it.
const TIMED: &str = r#"
limit=$1
shift
if command -v timeout > /dev/null; then set -- timeout --kill-after=60 "$limit" "$@"; fi
TIMEFORMAT=$'\n%U %S'; time "$@"
"#;

/// What `timeout` exits with when it has ended a command, and when that took a SIGKILL.
const HUNG: [i32; 2] = [124, 137];

/// The longest time of a command, on the busiest machine.
const LIMIT: Duration = Duration::from_mins(40);

/// Runs a command until it ends.
pub(crate) fn run_captured(command: &Command) -> Captured {
    captured_within(command, LIMIT)
}

fn captured_within(command: &Command, limit: Duration) -> Captured {
    let mut shell = Command::new("bash");
    shell.args(["-c", TIMED, "bash", &limit.as_secs().to_string()]);
    shell.env("LC_NUMERIC", "C").env_remove("LC_ALL");
    shell.arg(command.get_program()).args(command.get_args());
    for (name, value) in command.get_envs() {
        match value {
            Some(value) => shell.env(name, value),
            None => shell.env_remove(name),
        };
    }
    if let Some(folder) = command.get_current_dir() {
        shell.current_dir(folder);
    }
    let output = match shell.stdin(Stdio::null()).output() {
        Ok(output) => output,
        Err(error) => {
            return Captured {
                printed: String::new(),
                computed: Duration::ZERO,
                result: Err(cannot_start(&shell, &error)),
            };
        }
    };
    let errors = String::from_utf8_lossy(&output.stderr);
    let (errors, computed) = without_times(errors.trim_end());
    let printed = format!("{}{errors}", String::from_utf8_lossy(&output.stdout));
    let result = match output.status.code() {
        Some(0) => Ok(()),
        Some(code) if HUNG.contains(&code) => Err(Failure::new(format!(
            "`{}` has not ended in {} s",
            line(command),
            limit.as_secs()
        ))),
        _ => Err(Failure::new(format!(
            "`{}`: {}",
            line(command),
            output.status
        ))),
    };
    Captured {
        printed,
        computed,
        result,
    }
}

/// What a command wrote to standard error before the line with its user and system time, and their
/// sum; nothing if another program wrote last.
fn without_times(errors: &str) -> (&str, Duration) {
    let (before, last) = errors.rsplit_once('\n').unwrap_or(("", errors));
    let times: Option<Vec<Duration>> = last
        .split(' ')
        .map(|it| Duration::try_from_secs_f64(it.parse().ok()?).ok())
        .collect();
    match times.as_deref() {
        Some([user, system]) => (before.trim_end(), *user + *system),
        _ => (errors, Duration::ZERO),
    }
}

/// The standard output of a command, without the final line break; its errors are hidden.
pub(crate) fn read(command: &mut Command) -> Result<String, Failure> {
    let output = command
        .stderr(Stdio::null())
        .output()
        .map_err(|error| cannot_start(command, &error))?;
    if output.status.success() {
        Ok(String::from_utf8_lossy(&output.stdout)
            .trim_end()
            .to_owned())
    } else {
        Err(Failure::new(format!(
            "`{}`: {}",
            line(command),
            output.status
        )))
    }
}

/// Whether the program can be started and succeeds, without output.
pub(crate) fn succeeds(program: impl AsRef<OsStr>, arguments: &[&str]) -> bool {
    read(Command::new(program).args(arguments)).is_ok()
}

fn cannot_start(command: &Command, error: &std::io::Error) -> Failure {
    Failure::new(format!(
        "cannot start `{}`: {error}",
        command.get_program().to_string_lossy()
    ))
}

/// The command as typed in a shell (without quoting, which no argument here needs).
fn line(command: &Command) -> String {
    let words = std::iter::once(command.get_program()).chain(command.get_args());
    words
        .map(OsStr::to_string_lossy)
        .collect::<Vec<_>>()
        .join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn failures_name_the_command() {
        let failure = run(Command::new("sh").args(["-c", "exit 3"])).unwrap_err();
        assert_eq!(failure.to_string(), "`sh -c exit 3`: exit status: 3");
        let failure = run(&mut Command::new("no-such-program")).unwrap_err();
        assert!(
            failure
                .to_string()
                .starts_with("cannot start `no-such-program`: ")
        );
    }

    #[test]
    fn what_is_captured_comes_with_its_processor_time() {
        let script =
            "echo $WORD; echo wrong >&2; i=0; while [ $i -lt 200000 ]; do i=$((i+1)); done; exit 4";
        let mut command = Command::new("sh");
        command.args(["-c", script]).env("WORD", "said");
        let captured = run_captured(&command);
        assert_eq!(captured.printed, "said\nwrong");
        assert!(captured.computed > Duration::ZERO);
        let failure = captured.result.unwrap_err().to_string();
        assert!(failure.ends_with(": exit status: 4"), "{failure}");
        for last in ["", "words", "1", "1 2 3", "-1 2", "nan 1", "inf 1", "1,5 2"] {
            let errors = format!("wrong\n{last}");
            assert_eq!(without_times(&errors), (&*errors, Duration::ZERO), "{last}");
        }
        let hung = captured_within(Command::new("sleep").arg("600"), Duration::from_secs(1));
        let failure = hung.result.unwrap_err().to_string();
        assert_eq!(failure, "`sleep 600` has not ended in 1 s");
        let missing = run_captured(&Command::new("no-such-program"));
        assert!(missing.result.is_err() && missing.printed.contains("no-such-program"));
    }

    #[test]
    fn output_is_read_without_the_final_line_break() {
        assert_eq!(
            read(Command::new("echo").arg("two words")).unwrap(),
            "two words"
        );
        assert!(
            succeeds("true", &[]) && !succeeds("false", &[]) && !succeeds("no-such-program", &[])
        );
    }
}
