//! The table of attacks, and which of them are within the figure that the server must keep.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::time::Duration;

use crate::attacks::Attack;
use crate::error::HostileError;
use crate::honest::Noticed;
use crate::probe::Served;
use crate::tally::Counts;

/// Bytes of a mebibyte.
pub(crate) const MIB: f64 = 1024.0 * 1024.0;
/// The honest room's 99th percentile under attack is at most this many times the greater one of its
/// own in quiet and of the control's at the same time.
const P99_RATIO: f64 = 2.0;
/// The attacked process never takes more memory, bytes.
const MEMORY_PEAK: u64 = 512 * 1024 * 1024;
/// Afterwards it takes at most this much more than before, bytes.
pub(crate) const MEMORY_GROWTH: u64 = 64 * 1024 * 1024;

/// What the honest room noticed in each phase.
pub(crate) struct Phases {
    pub(crate) quiet: Noticed,
    pub(crate) quiet_time: Duration,
    pub(crate) attacked: Noticed,
    /// What the control noticed during the attack.
    pub(crate) control: Noticed,
    pub(crate) attack_time: Duration,
    /// Afterwards; `None` if the last game does not end.
    pub(crate) last: Option<Noticed>,
}

/// What the server paid.
pub(crate) struct Burden {
    /// Resident memory before, at most, and after, bytes.
    pub(crate) memory: [u64; 3],
    /// Growth of its folder, bytes.
    pub(crate) disk: u64,
    /// Lines that it printed or logged.
    pub(crate) log_lines: usize,
    /// Whether the attacked process still runs.
    pub(crate) is_alive: bool,
    /// Whether it starts again on its data.
    pub(crate) starts_again: bool,
}

/// The result of one attack.
#[derive(Debug, serde::Serialize)]
pub(crate) struct Row {
    attack: &'static str,
    what: &'static str,
    #[serde(flatten)]
    counts: Counts,
    quiet_p50_ms: f64,
    quiet_p99_ms: f64,
    p50_ms: f64,
    p99_ms: f64,
    /// Of the control during the attack.
    control_p99_ms: f64,
    /// `p99_ms` by the greater one of `quiet_p99_ms` and `control_p99_ms`.
    p99_ratio: f64,
    /// `p99_ms` by `quiet_p99_ms`: what the attack costs the server and the machine together.
    quiet_p99_ratio: f64,
    /// Decisions of the honest room in a second.
    quiet_rate: f64,
    rate: f64,
    /// Decisions that the server took for honest agents, in all phases.
    missed: u64,
    /// Honest games that ended with a result, and those that did not.
    games: u64,
    lost_games: u64,
    /// Whether the last honest game ended after the attack.
    last_game_ended: bool,
    /// Calls and connections of the honest room that were refused or too slow, by reason.
    not_served: BTreeMap<String, u64>,
    others: Served,
    memory_before_mib: f64,
    memory_peak_mib: f64,
    memory_after_mib: f64,
    disk_mib: f64,
    /// Lines that the server printed or logged.
    log_lines: usize,
    /// Whether the attacked process was still running at the end.
    alive: bool,
    /// Whether the server starts again on its data.
    starts_again: bool,
    /// What exceeds the figure; empty if nothing does.
    exceeds: Vec<String>,
}

impl Row {
    /// A row from what was noticed and paid.
    pub(crate) fn new(
        attack: &Attack,
        phases: Phases,
        others: Served,
        counts: Counts,
        burden: Burden,
    ) -> Self {
        let Phases {
            quiet,
            quiet_time,
            attacked,
            control,
            attack_time,
            last,
        } = phases;
        let all = [Some(&quiet), Some(&attacked), last.as_ref()];
        let mut whole = Noticed::new();
        all.into_iter()
            .flatten()
            .for_each(|noticed| whole.add(noticed));
        let [before, peak, after] = burden.memory;
        let mib = |bytes| round(bytes as f64 / MIB);
        let rate = |of: &Noticed, time: Duration| of.latencies.len() as f64 / time.as_secs_f64();
        let [quiet_p99, p99, control_p99] =
            [&quiet, &attacked, &control].map(|noticed| noticed.percentile_ms(99.0));
        let mut row = Self {
            attack: attack.name,
            what: attack.what,
            counts,
            quiet_p50_ms: round(quiet.percentile_ms(50.0)),
            quiet_p99_ms: round(quiet_p99),
            p50_ms: round(attacked.percentile_ms(50.0)),
            p99_ms: round(p99),
            control_p99_ms: round(control_p99),
            p99_ratio: round(p99 / quiet_p99.max(control_p99)),
            quiet_p99_ratio: round(p99 / quiet_p99),
            quiet_rate: round(rate(&quiet, quiet_time)),
            rate: round(rate(&attacked, attack_time)),
            missed: whole.missed,
            games: whole.games,
            lost_games: whole.lost_games,
            last_game_ended: last.is_some(),
            not_served: whole.not_served,
            others,
            memory_before_mib: mib(before),
            memory_peak_mib: mib(peak),
            memory_after_mib: mib(after),
            disk_mib: mib(burden.disk),
            log_lines: burden.log_lines,
            alive: burden.is_alive,
            starts_again: burden.starts_again,
            exceeds: Vec::new(),
        };
        row.exceeds = row.excesses(peak, after.saturating_sub(before));
        row
    }

    fn excesses(&self, peak: u64, growth: u64) -> Vec<String> {
        let tests = [
            (
                // Without a decision there is no percentile.
                self.p99_ratio > P99_RATIO || self.rate == 0.0,
                format!("p99 is {} times that of the control", self.p99_ratio),
            ),
            (self.missed > 0, format!("{} decisions missed", self.missed)),
            (
                peak > MEMORY_PEAK,
                format!("{} MiB of memory", self.memory_peak_mib),
            ),
            (
                growth > MEMORY_GROWTH,
                format!("{} MiB more afterwards", round(growth as f64 / MIB)),
            ),
            (
                !self.last_game_ended,
                "the last game did not end".to_owned(),
            ),
            (!self.alive, "the process ended".to_owned()),
            (!self.starts_again, "it does not start again".to_owned()),
        ];
        let exceeded = tests.into_iter().filter(|(exceeds, _)| *exceeds);
        exceeded.map(|(_, what)| what).collect()
    }

    /// Whether it is within the figure, and what is not.
    pub(crate) fn verdict(&self) -> String {
        match self.exceeds.is_empty() {
            true => "within".to_owned(),
            false => self.exceeds.join(", "),
        }
    }

    fn to_markdown(&self) -> String {
        let reasons = self.counts.reasons.keys().cloned().collect::<Vec<_>>();
        format!(
            "| {} | {} | {} | {} | {} | {:.1} / {:.1} | {:.1} / {:.1} | {:.1} | {:.1} / {:.1} | {:.0} / {:.0} | {} | {} | {}/{} | {:.0} / {:.0} / {:.0} | {:.1} | {} |",
            self.what,
            self.counts.tried,
            self.counts.granted,
            self.counts.refused,
            reasons.join(", "),
            self.quiet_p50_ms,
            self.quiet_p99_ms,
            self.p50_ms,
            self.p99_ms,
            self.control_p99_ms,
            self.p99_ratio,
            self.quiet_p99_ratio,
            self.quiet_rate,
            self.rate,
            self.missed,
            self.not_served.values().sum::<u64>()
                + self.lost_games
                + u64::from(!self.last_game_ended),
            self.others.served,
            self.others.tried,
            self.memory_before_mib,
            self.memory_peak_mib,
            self.memory_after_mib,
            self.disk_mib,
            self.verdict(),
        )
    }
}

/// All results.
#[derive(Debug, Default, serde::Serialize)]
pub(crate) struct Report {
    attacks: Vec<Row>,
    /// Names of the attacks within the figure, and of the others.
    within: Vec<&'static str>,
    exceeding: Vec<&'static str>,
    /// Attacks that this machine cannot run, and those that failed, with the reason.
    skipped: BTreeMap<&'static str, String>,
    failed: BTreeMap<&'static str, String>,
}

impl Report {
    /// Adds a row.
    pub(crate) fn add(&mut self, row: Row) {
        match row.exceeds.is_empty() {
            true => self.within.push(row.attack),
            false => self.exceeding.push(row.attack),
        }
        self.attacks.push(row);
    }

    /// Notes that an attack was not measured.
    pub(crate) fn miss(&mut self, attack: &Attack, error: &HostileError) {
        let missed = match error {
            HostileError::Lacks(_) => &mut self.skipped,
            _ => &mut self.failed,
        };
        missed.insert(attack.name, error.to_string());
    }

    /// Whether every attack that this machine can run was measured.
    pub(crate) fn is_complete(&self) -> bool {
        self.failed.is_empty()
    }

    /// One JSON document.
    pub(crate) fn to_json(&self) -> String {
        serde_json::to_string_pretty(self).expect("a report is plain data")
    }

    /// A Markdown table and a summary.
    pub(crate) fn to_markdown(&self) -> String {
        let mut text = String::new();
        if !self.attacks.is_empty() {
            text.push_str(
                "| attack | tried | granted | refused | reasons | quiet p50 / p99, ms | under attack p50 / p99, ms | control p99, ms | p99 ratio to the control / to quiet | decisions a second | decisions missed | honest calls and games lost | others served | memory before / peak / after, MiB | disk, MiB | figure |\n\
                 |---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|\n",
            );
            for row in &self.attacks {
                writeln!(text, "{}", row.to_markdown()).expect("a String grows as needed");
            }
            let (within, all) = (self.within.len(), self.attacks.len());
            writeln!(text, "\n{within} of {all} attacks within the figure.")
                .expect("a String grows as needed");
        }
        let exceeding = self.attacks.iter().filter(|row| !row.exceeds.is_empty());
        let exceeding = exceeding.map(|row| (row.attack, "not within", row.verdict()));
        let of = |missed: &'static str, errors: &BTreeMap<_, String>| {
            let line =
                move |(name, error): (&&'static str, &String)| (*name, missed, error.clone());
            errors.iter().map(line).collect::<Vec<_>>()
        };
        let missed = [of("skipped", &self.skipped), of("failed", &self.failed)].concat();
        for (name, what, why) in exceeding.chain(missed) {
            writeln!(text, "{name}: {what}: {why}").expect("a String grows as needed");
        }
        text
    }
}

/// Two decimals.
pub(crate) fn round(number: f64) -> f64 {
    (number * 100.0).round() / 100.0
}
