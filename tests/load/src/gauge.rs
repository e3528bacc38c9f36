//! CPU time and memory of a process, read from `/proc`; and binding a process to a core.

use std::io;
use std::process::Command;
use std::time::Duration;

use rustix::thread::{CpuSet, sched_setaffinity};

/// CPU time of a process so far, user and system, of its current threads; runtimes do not end
/// theirs.
pub(crate) fn cpu_time(pid: u32) -> io::Result<Duration> {
    let mut total = Duration::ZERO;
    for thread in std::fs::read_dir(format!("/proc/{pid}/task"))? {
        // A thread may end between listing and reading.
        let Ok(times) = std::fs::read_to_string(thread?.path().join("schedstat")) else {
            continue;
        };
        let on_cpu_ns = times
            .split_ascii_whitespace()
            .next()
            .and_then(|number| number.parse().ok())
            .ok_or_else(|| unreadable("schedstat"))?;
        total += Duration::from_nanos(on_cpu_ns);
    }
    Ok(total)
}

/// Instructions that a process under callgrind has executed, in its current threads.
pub(crate) fn instructions(pid: u32) -> io::Result<u64> {
    let mut command = Command::new("callgrind_control");
    let output = command.arg("-e").arg(pid.to_string()).output()?;
    executed(&String::from_utf8_lossy(&output.stdout))
        .ok_or_else(|| io::Error::other("callgrind_control names no threads"))
}

/// The sum of the counts of threads, each on a line such as `   Th 1  139,758,902`.
fn executed(counts: &str) -> Option<u64> {
    let threads = (counts.lines()).filter(|line| line.trim_start().starts_with("Th"));
    let counts: Vec<u64> = threads
        .filter_map(|line| line.split_ascii_whitespace().next_back())
        .filter_map(|count| count.replace(',', "").parse().ok())
        .collect();
    (!counts.is_empty()).then(|| counts.into_iter().sum())
}

/// Resident memory of a process, bytes.
pub(crate) fn resident_bytes(pid: u32) -> io::Result<u64> {
    let status = std::fs::read_to_string(format!("/proc/{pid}/status"))?;
    status
        .lines()
        .find_map(|line| {
            let kib = line
                .strip_prefix("VmRSS:")?
                .split_ascii_whitespace()
                .next()?;
            kib.parse::<u64>().ok()
        })
        .map(|kib| kib * 1024)
        .ok_or_else(|| unreadable("status"))
}

/// Binds this thread, and every thread it starts from now on, to one core.
pub(crate) fn bind_to_core(core: usize) -> io::Result<()> {
    if core >= CpuSet::MAX_CPU {
        return Err(io::Error::new(
            io::ErrorKind::InvalidInput,
            format!("there is no core {core}"),
        ));
    }
    let mut set = CpuSet::new();
    set.set(core);
    Ok(sched_setaffinity(None, &set)?)
}

fn unreadable(file: &str) -> io::Error {
    io::Error::new(
        io::ErrorKind::InvalidData,
        format!("the kernel's {file} does not read as its documentation says"),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn instructions_of_all_threads_are_summed() {
        let counts = "PID 7: server\n\n  Totals:         Ir \n   Th 1  139,758,902 \n   Th10      117,220 \n";
        assert_eq!(executed(counts), Some(139_876_122));
        assert_eq!(executed("No active callgrind runs detected.\n"), None);
    }
}
