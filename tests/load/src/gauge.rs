//! What the kernel says of a process: its CPU time and its memory, read from `/proc`; and binding a process to a core.

use std::io;
use std::time::Duration;

use rustix::thread::{CpuSet, sched_setaffinity};

/// Fields of `/proc/PID/stat` from the state on that come before the CPU times (proc(5): state is field 3, utime is field 14).
const FIELDS_BEFORE_CPU: usize = 11;

/// CPU time of a process so far, its own and the kernel's for it, in steps of the kernel's tick (10 ms as a rule).
pub(crate) fn cpu_time(pid: u32) -> io::Result<Duration> {
    let stat = std::fs::read_to_string(format!("/proc/{pid}/stat"))?;
    // The name of the process comes in parentheses and may hold anything, spaces and parentheses included.
    let ticks: Option<u64> = stat.rsplit_once(')').and_then(|(_, fields)| {
        let mut fields = fields.split_ascii_whitespace().skip(FIELDS_BEFORE_CPU);
        let user: u64 = fields.next()?.parse().ok()?;
        let system: u64 = fields.next()?.parse().ok()?;
        Some(user + system)
    });
    let ticks = ticks.ok_or_else(|| unreadable("stat"))?;
    let per_second = rustix::param::clock_ticks_per_second();
    Ok(Duration::from_secs_f64(ticks as f64 / per_second as f64))
}

/// Memory of a process that is in RAM now, bytes.
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
        format!("/proc/PID/{file} does not read as proc(5) says"),
    )
}
