//! Memory of a process, read from `/proc`, the size of a folder, and the limits of this process.

use std::io;
use std::path::Path;
use std::sync::{Arc, Mutex, MutexGuard};
use std::time::Duration;

use rustix::process::{Resource, Rlimit, getrlimit, nice, setrlimit};
use tokio_util::task::AbortOnDropHandle;

/// Time between two looks at a process that is followed.
const SAMPLE_INTERVAL: Duration = Duration::from_millis(100);
/// How much the threads of an attack give way to the server and the honest room. An attacker has a
/// machine of its own; here it shares one with what is measured.
const ATTACKER_NICENESS: i32 = 15;

/// The memory of a process, bytes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Memory {
    /// Resident now.
    pub(crate) resident: u64,
    /// Most that has ever been resident.
    pub(crate) peak: u64,
}

/// Reads the memory of a process.
pub(crate) fn memory(pid: u32) -> io::Result<Memory> {
    let status = std::fs::read_to_string(format!("/proc/{pid}/status"))?;
    let field = |name: &str| {
        let line = status.lines().find_map(|line| line.strip_prefix(name))?;
        let kib: u64 = line.split_ascii_whitespace().next()?.parse().ok()?;
        Some(kib * 1024)
    };
    match (field("VmRSS:"), field("VmHWM:")) {
        (Some(resident), Some(peak)) => Ok(Memory { resident, peak }),
        _ => Err(io::Error::new(
            io::ErrorKind::InvalidData,
            "the process has no memory: it has ended",
        )),
    }
}

/// Follows the memory of a process, which may end meanwhile.
pub(crate) struct Watched {
    pid: u32,
    last: Arc<Mutex<Memory>>,
    sampling: AbortOnDropHandle<()>,
}

impl Watched {
    /// Follows it from now on.
    ///
    /// # Errors
    /// There is no such process.
    pub(crate) fn new(pid: u32) -> io::Result<Self> {
        let last = Arc::new(Mutex::new(memory(pid)?));
        let sampled = Arc::clone(&last);
        let sampling = AbortOnDropHandle::new(tokio::spawn(async move {
            while let Ok(memory) = memory(pid) {
                *lock(&sampled) = memory;
                tokio::time::sleep(SAMPLE_INTERVAL).await;
            }
        }));
        Ok(Self {
            pid,
            last,
            sampling,
        })
    }

    /// Its memory now, or when it was last seen.
    pub(crate) fn memory(&self) -> Memory {
        memory(self.pid).unwrap_or_else(|_| *lock(&self.last))
    }

    /// Whether the process still runs.
    pub(crate) fn is_alive(&self) -> bool {
        !self.sampling.is_finished() && memory(self.pid).is_ok()
    }
}

fn lock(memory: &Mutex<Memory>) -> MutexGuard<'_, Memory> {
    memory.lock().expect("nothing panics under this lock")
}

/// Bytes of all files of a folder.
pub(crate) fn folder_bytes(folder: &Path) -> u64 {
    let Ok(entries) = std::fs::read_dir(folder) else {
        return 0;
    };
    entries
        .flatten()
        .map(|entry| match entry.metadata() {
            Ok(about) if about.is_dir() => folder_bytes(&entry.path()),
            Ok(about) => about.len(),
            // It has been deleted since.
            Err(_) => 0,
        })
        .sum()
}

/// Lets this process open as many connections as the system allows.
pub(crate) fn raise_descriptor_limit() {
    let limit = getrlimit(Resource::Nofile);
    let raised = Rlimit {
        current: limit.maximum,
        maximum: limit.maximum,
    };
    // An attack that gets fewer connections than it wants counts them.
    let _ = setrlimit(Resource::Nofile, raised);
}

/// Lets the calling thread give way to others.
pub(crate) fn give_way() {
    // It is refused nowhere; if it were, the attacks would only be a little stronger.
    let _ = nice(ATTACKER_NICENESS);
}
