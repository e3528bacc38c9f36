//! The tasks that live as long as the server, a room or a stream, by name. Such a task sleeps while
//! nothing is due for it: `serve/idle_tests.rs` drives them on a stopped clock, through a shutdown
//! and a drain, and counts how often each is polled. In every test, a task that does not sleep while
//! the clock stands still ends the process of the tests.

macro_rules! long_tasks {
    ($($(#[$doc:meta])* $name:ident,)*) => {
        /// A task that lives long.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
        pub(crate) enum LongTask {
            $($(#[$doc])* $name,)*
        }

        #[cfg(test)]
        impl LongTask {
            /// All of them.
            pub(crate) const ALL: &[Self] = &[$(Self::$name,)*];
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
    /// Notices pauses of the process.
    ProcessClock,
    /// Reports a node as healthy while it has a lease.
    NodeHealth,
    /// Deletes old games.
    Retention,
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

/// Names a task that is about to be spawned.
#[cfg(not(test))]
pub(crate) fn named<F: Future>(_: LongTask, future: F) -> F {
    future
}

#[cfg(test)]
pub(crate) use counting::{named, polls};

#[cfg(test)]
mod counting {
    use std::cell::{Cell, RefCell};
    use std::collections::BTreeMap;
    use std::io::Write as _;
    use std::pin::Pin;
    use std::task::{Context, Poll};

    use tokio::time::Instant;

    use super::LongTask;

    /// A task that is polled more often at one instant of a stopped clock never sleeps.
    const SPINNING: u64 = 20_000;

    std::thread_local! {
        /// How often the tasks of this thread, which are those of one test, were polled.
        static POLLS: RefCell<BTreeMap<LongTask, u64>> = const { RefCell::new(BTreeMap::new()) };
        /// The task that this test expects to spin.
        static MAY_SPIN: Cell<Option<LongTask>> = const { Cell::new(None) };
    }

    /// Names a task that is about to be spawned, and counts its polls. If it spins, the process of
    /// the tests ends: the clock of its test would stand still for ever.
    pub(crate) fn named<F: Future>(task: LongTask, future: F) -> impl Future<Output = F::Output> {
        Counted {
            task,
            future: Box::pin(future),
            at: None,
        }
    }

    struct Counted<F> {
        task: LongTask,
        future: Pin<Box<F>>,
        /// When it was polled last, and how often at that instant.
        at: Option<(Instant, u64)>,
    }

    impl<F: Future> Future for Counted<F> {
        type Output = F::Output;

        fn poll(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<F::Output> {
            let (task, now) = (self.task, Instant::now());
            POLLS.with_borrow_mut(|polls| *polls.entry(task).or_default() += 1);
            let (at, count) = self.at.filter(|(at, _)| *at == now).unwrap_or((now, 0));
            self.at = Some((at, count + 1));
            if count >= SPINNING {
                spins(task);
                return Poll::Pending;
            }
            self.future.as_mut().poll(context)
        }
    }

    fn spins(task: LongTask) {
        if MAY_SPIN.replace(None) == Some(task) {
            return;
        }
        // Not by a panic, which the runtime catches, nor by a macro, whose output a test captures.
        let thread = std::thread::current();
        let test = thread.name().unwrap_or("a test");
        let message = format!("{test}: the task {task:?} never sleeps although nothing is due\n");
        let _ = std::io::stderr().write_all(message.as_bytes());
        std::process::exit(101);
    }

    /// How often the tasks of this test have been polled.
    pub(crate) fn polls() -> BTreeMap<LongTask, u64> {
        POLLS.with_borrow(Clone::clone)
    }

    #[tokio::test(start_paused = true)]
    async fn a_task_that_never_sleeps_is_noticed() {
        MAY_SPIN.set(Some(LongTask::Webhooks));
        let sleeping = tokio::spawn(named(LongTask::Retention, async {
            for _ in 0..2 * SPINNING {
                tokio::time::sleep(std::time::Duration::from_millis(1)).await;
            }
        }));
        tokio::spawn(named(LongTask::Webhooks, async {
            loop {
                tokio::task::yield_now().await;
            }
        }));
        sleeping.await.expect("it ends");
        assert_eq!(MAY_SPIN.get(), None, "it was noticed");
        assert!(polls()[&LongTask::Webhooks] > SPINNING);
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;
    use std::path::{Path, PathBuf};

    /// Where tasks are spawned that end by themselves: by file, how many and why. All others have a
    /// name, and sleep while nothing is due.
    const SHORT: [(&str, usize, &str); 22] = [
        (
            "cluster/node.rs",
            7,
            "one request to the database, within its time limit",
        ),
        ("grpc/admin.rs", 2, "one call"),
        ("grpc/analysis.rs", 1, "one call"),
        (
            "grpc/play/attaching.rs",
            1,
            "one search for a room, within its time limit",
        ),
        ("grpc/records.rs", 2, "one call"),
        ("grpc/studies.rs", 1, "one export"),
        (
            "grpc/vector.rs",
            1,
            "waits for the client alone, within its time limit",
        ),
        ("host.rs", 1, "the server itself, for samples"),
        ("limits/background.rs", 1, "one pause"),
        ("post.rs", 1, "one request"),
        ("record_writer.rs", 1, "one record"),
        ("room/task.rs", 1, "one search"),
        ("rooms/creation.rs", 1, "one room"),
        ("scrape.rs", 1, "one connection, within its time limit"),
        ("store/postgres/reader.rs", 1, "gives one connection back"),
        ("studies/games.rs", 1, "one message"),
        ("studies/handle.rs", 1, "one message"),
        ("studies/mod.rs", 2, "one study"),
        ("tls.rs", 1, "one handshake, within its time limit"),
        ("tournaments/games.rs", 1, "one message"),
        ("tournaments/handle.rs", 1, "one message"),
        ("web/preview.rs", 1, "a program that draws one picture"),
    ];
    /// The same of files whose tasks are found by another name.
    const OTHERS: [(&str, usize, &str); 4] = [
        (
            "room/handle.rs",
            1,
            "the call that spawns the task of a room",
        ),
        ("threads.rs", 1, "work for a pool of threads"),
        ("tournaments/mod.rs", 1, "one tournament"),
        ("tournaments/shared.rs", 1, "one computation"),
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

    /// The number of tasks that are spawned in a file without a name.
    fn unnamed(source: &str) -> usize {
        let is_module = |rest: &str| rest.lines().next().is_some_and(|line| line.ends_with('{'));
        // Up to the tests in the file.
        let parts = source.split("#[cfg(test)]\nmod ");
        let code: Vec<&str> = parts
            .enumerate()
            .take_while(|(index, part)| *index == 0 || !is_module(part))
            .map(|(_, part)| part)
            .collect();
        let code = code.concat();
        let spawned = code.split("spawn(").skip(1);
        let has_name = |rest: &str| {
            let rest = rest.trim_start();
            let named = ["named(", "tasks::named(", "until_closing(", "running)"];
            named.iter().any(|start| rest.starts_with(start))
        };
        spawned.filter(|rest| !has_name(rest)).count()
    }

    #[test]
    fn every_task_that_is_spawned_has_a_name_or_ends_by_itself() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
        let mut files = Vec::new();
        sources(&root, &mut files);
        let mut found = BTreeMap::new();
        for path in files {
            let name = path
                .strip_prefix(&root)
                .expect("below it")
                .display()
                .to_string();
            let is_test =
                name.contains("tests") || name.starts_with("serve/fuzz") || name == "tasks.rs";
            let source = std::fs::read_to_string(&path).expect("readable");
            // Functions that spawn are not calls.
            let count = unnamed(&source.replace("fn spawn(", ""));
            if count > 0 && !is_test {
                found.insert(name, count);
            }
        }
        let known = SHORT.iter().chain(&OTHERS);
        let known: BTreeMap<String, usize> = known
            .map(|(file, count, _)| ((*file).to_owned(), *count))
            .collect();
        assert_eq!(
            found, known,
            "name a task that lives long (`tasks::named`), or list it here"
        );
    }
}
