//! The tasks that live as long as the server, a room or a stream, by name. Such a task sleeps while
//! nothing is due for it: `serve/idle_tests.rs` drives them on a stopped clock, through a shutdown
//! and a drain, and counts how often each is polled. In every test, a task that does not sleep while
//! the clock stands still ends the process of the tests.

use std::pin::Pin;

macro_rules! long_tasks {
    ($($(#[$doc:meta])* $name:ident,)*) => {
        /// A task that lives long.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
        pub enum LongTask {
            $($(#[$doc])* $name,)*
        }

        #[cfg(any(test, feature = "testing"))]
        impl LongTask {
            /// All of them.
            pub const ALL: &[Self] = &[$(Self::$name,)*];
        }
    };
}

long_tasks! {
    /// A room.
    Room,
    /// A tournament.
    Tournament,
    /// A study.
    Study,
    /// A node of a cluster.
    Node,
    /// Asks other nodes to reach one that has joined.
    Joining,
    /// Probes the other nodes of a cluster.
    Probing,
    /// Notices pauses of the process.
    ProcessClock,
    /// Reports whether the server serves.
    Health,
    /// Deletes old games.
    Retention,
    /// Deletes studies at their dates.
    StudyDeletion,
    /// Delivers webhooks.
    Webhooks,
    /// Closes connections whose answers are not read.
    StalledConnections,
    /// Follows the file of tokens.
    TokenFile,
    /// Follows the files of certificates.
    Certificates,
    /// Writes to the database of a data directory.
    SqliteWriter,
    /// Writes to a PostgreSQL database.
    PostgresWriter,
    /// Hears of units that other nodes hand over.
    PostgresHandover,
    /// Reads a stream of seats.
    PlayReader,
    /// Ends a stream of seats.
    PlayEnd,
    /// Follows seats.
    Watch,
    /// Ends a stream of a spectator.
    Spectate,
    /// Follows a tournament.
    FollowTournament,
    /// Follows a study, for its owner.
    FollowStudy,
    /// Follows a study, for a participant.
    Participation,
    /// A stream of seats to another node.
    PeerStream,
    /// A stream to another node that spectators share.
    SharedStream,
    /// Tells another node how many spectators share a stream.
    Sharing,
}

/// A future to spawn, boxed so that spawning is compiled once for each type of output, not once for each
/// task.
pub type Task<T> = Pin<Box<dyn Future<Output = T> + Send>>;

/// Names a task that is about to be spawned.
#[cfg(not(any(test, feature = "testing")))]
pub fn named<T>(_: LongTask, future: impl Future<Output = T> + Send + 'static) -> Task<T> {
    Box::pin(future)
}

/// Marks a task that is about to be spawned and ends by itself. `_does`: what it does.
#[cfg(not(any(test, feature = "testing")))]
pub fn short<T>(_does: &'static str, future: impl Future<Output = T> + Send + 'static) -> Task<T> {
    Box::pin(future)
}

#[cfg(any(test, feature = "testing"))]
pub use counting::{named, polls, short, short_polls};

#[cfg(any(test, feature = "testing"))]
mod counting {
    use std::cell::{Cell, RefCell};
    use std::collections::BTreeMap;
    use std::io::Write as _;
    use std::pin::Pin;
    use std::task::{Context, Poll};

    use tokio::time::Instant;

    use super::{LongTask, Task};

    /// A task that is polled more often at one instant of a stopped clock never sleeps.
    const SPINNING: u64 = 20_000;

    #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
    enum Name {
        Long(LongTask),
        /// What it does.
        Short(&'static str),
    }

    std::thread_local! {
        /// How often the tasks of this thread, which are those of one test, were polled.
        static POLLS: RefCell<BTreeMap<Name, u64>> = const { RefCell::new(BTreeMap::new()) };
        /// The task that this test expects to spin.
        static MAY_SPIN: Cell<Option<Name>> = const { Cell::new(None) };
    }

    /// Names a task that is about to be spawned, and counts its polls. If it spins, the process of
    /// the tests ends: the clock of its test would stand still for ever.
    pub fn named<T: 'static>(
        task: LongTask,
        future: impl Future<Output = T> + Send + 'static,
    ) -> Task<T> {
        counted(Name::Long(task), Box::pin(future))
    }

    /// The same of a task that ends by itself.
    pub fn short<T: 'static>(
        does: &'static str,
        future: impl Future<Output = T> + Send + 'static,
    ) -> Task<T> {
        counted(Name::Short(does), Box::pin(future))
    }

    fn counted<T: 'static>(name: Name, future: Task<T>) -> Task<T> {
        Box::pin(Counted {
            name,
            future,
            at: None,
        })
    }

    struct Counted<T> {
        name: Name,
        future: Task<T>,
        /// When it was polled last, and how often at that instant.
        at: Option<(Instant, u64)>,
    }

    impl<T> Future for Counted<T> {
        type Output = T;

        fn poll(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<T> {
            let (name, now) = (self.name, Instant::now());
            POLLS.with_borrow_mut(|polls| *polls.entry(name).or_default() += 1);
            let (at, count) = self.at.filter(|(at, _)| *at == now).unwrap_or((now, 0));
            self.at = Some((at, count + 1));
            if count >= SPINNING {
                spins(name);
                return Poll::Pending;
            }
            self.future.as_mut().poll(context)
        }
    }

    fn spins(name: Name) {
        if MAY_SPIN.replace(None) == Some(name) {
            return;
        }
        // Not by a panic, which the runtime catches, nor by a macro, whose output a test captures.
        let thread = std::thread::current();
        let test = thread.name().unwrap_or("a test");
        let message = format!("{test}: {name:?} never sleeps although nothing is due\n");
        let _ = std::io::stderr().write_all(message.as_bytes());
        std::process::exit(101);
    }

    /// How often the tasks of this test that live long have been polled.
    pub fn polls() -> BTreeMap<LongTask, u64> {
        let of = |(name, polls): (&Name, &u64)| match name {
            Name::Long(task) => Some((*task, *polls)),
            Name::Short(_) => None,
        };
        POLLS.with_borrow(|polls| polls.iter().filter_map(of).collect())
    }

    /// How often the others have been polled.
    pub fn short_polls() -> u64 {
        let is_short = |(name, _): &(&Name, &u64)| matches!(name, Name::Short(_));
        POLLS.with_borrow(|polls| polls.iter().filter(is_short).map(|(_, polls)| polls).sum())
    }

    #[cfg(test)]
    #[tokio::test(start_paused = true)]
    async fn a_task_that_never_sleeps_is_noticed() {
        MAY_SPIN.set(Some(Name::Short("one record")));
        let sleeping = tokio::spawn(named(LongTask::Retention, async {
            for _ in 0..2 * SPINNING {
                tokio::time::sleep(std::time::Duration::from_millis(1)).await;
            }
        }));
        tokio::spawn(short("one record", async {
            loop {
                tokio::task::yield_now().await;
            }
        }));
        sleeping.await.expect("it ends");
        assert_eq!(MAY_SPIN.get(), None, "it was noticed");
        assert!(short_polls() > SPINNING);
    }
}

#[cfg(test)]
mod tests {
    use std::path::{Path, PathBuf};

    /// How a call that spawns a task begins. The task has a name, or is said to end by itself.
    const NAMED: [&str; 4] = ["named(", "short(", "tasks::named(", "running)"];
    /// The other calls, by file, and why they need no name.
    const OTHERS: [(&str, &str, &str); 3] = [
        (
            "base/src/threads.rs",
            "move || {",
            "work for a pool of threads",
        ),
        ("gateway/src/web/preview.rs", ");", "another process"),
        (
            "src/host.rs",
            "serve(listener, config, store, stopped)),",
            "the server itself",
        ),
    ];

    /// Where tasks are spawned.
    const PARTS: [&str; 7] = [
        "admission/src",
        "base/src",
        "gateway/src",
        "hosting/src",
        "src",
        "store/src",
        "wire/src",
    ];

    fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
        for entry in std::fs::read_dir(folder).expect("it exists") {
            let path = entry.expect("readable").path();
            if path.is_dir() {
                sources(&path, found);
            } else if path.extension().is_some_and(|it| it == "rs") {
                found.push(path);
            }
        }
    }

    /// What a file spawns without a name: the beginning of each call.
    fn unnamed(source: &str) -> Vec<String> {
        let is_module = |rest: &str| rest.lines().next().is_some_and(|line| line.ends_with('{'));
        // Up to the tests in the file.
        let source = source.replace("#[cfg(all(test, unix))]", "#[cfg(test)]");
        let parts = source.split("#[cfg(test)]\nmod ");
        let code: Vec<&str> = parts
            .enumerate()
            .take_while(|(index, part)| *index == 0 || !is_module(part))
            .map(|(_, part)| part)
            .collect();
        let code = code.concat();
        let spawned = code.split("spawn(").skip(1).map(str::trim_start);
        let unnamed = spawned.filter(|rest| !NAMED.iter().any(|start| rest.starts_with(start)));
        unnamed
            .map(|rest| rest.chars().take_while(|it| *it != '\n').collect())
            .collect()
    }

    #[test]
    fn every_task_that_is_spawned_has_a_name_or_ends_by_itself() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
        let mut files = Vec::new();
        for part in PARTS {
            sources(&root.join(part), &mut files);
        }
        let mut found = Vec::new();
        for path in files {
            let name = path.strip_prefix(&root).expect("below it");
            let name = name.display().to_string();
            let is_test =
                name.contains("tests") || name == "src/serve/fuzz.rs" || name.ends_with("tasks.rs");
            let source = std::fs::read_to_string(&path).expect("readable");
            // Functions that spawn, and their calls.
            let source = ["fn spawn(", "self.spawn(", " task::spawn("]
                .iter()
                .fold(source, |source, own| source.replace(own, ""));
            let unnamed = unnamed(&source);
            if !is_test {
                found.extend(unnamed.into_iter().map(|call| (name.clone(), call)));
            }
        }
        found.sort();
        let known = OTHERS.map(|(file, call, _)| (file.to_owned(), call.to_owned()));
        assert_eq!(
            found, known,
            "name a task that lives long (`tasks::named`), say of a short one what it does \
             (`tasks::short`), or list the call here"
        );
    }
}
