//! The table of attacks.

use std::fmt::Write as _;

use crate::attacks::Attack;
use crate::honest::Noticed;
use crate::probe::Served;
use crate::tally::Counts;

/// Bytes of a mebibyte.
pub(crate) const MIB: f64 = 1024.0 * 1024.0;

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
    /// Decisions that the server took for honest agents, in all phases.
    missed: u64,
    /// Honest games that ended with a result, and those that did not.
    games: u64,
    lost_games: u64,
    /// Whether the last honest game ended after the attack.
    last_game_ended: bool,
    /// Calls and connections of the honest room that were refused or too slow.
    not_served: u64,
    others: Served,
    memory_before_mib: f64,
    memory_peak_mib: f64,
    memory_after_mib: f64,
    disk_mib: f64,
    /// Lines that the server printed or logged.
    log_lines: usize,
}

impl Row {
    /// A row from what was noticed in quiet, under attack, and afterwards.
    pub(crate) fn new(
        attack: &Attack,
        (quiet, attacked, last): (&Noticed, &Noticed, Option<&Noticed>),
        others: Served,
        counts: Counts,
        memory: [u64; 3],
        disk: u64,
        log_lines: usize,
    ) -> Self {
        let phases = [Some(quiet), Some(attacked), last];
        let sum = |of: fn(&Noticed) -> u64| phases.into_iter().flatten().map(of).sum();
        let [before, peak, after] = memory.map(|bytes| round(bytes as f64 / MIB));
        Self {
            attack: attack.name,
            what: attack.what,
            counts,
            quiet_p50_ms: round(quiet.percentile_ms(50.0)),
            quiet_p99_ms: round(quiet.percentile_ms(99.0)),
            p50_ms: round(attacked.percentile_ms(50.0)),
            p99_ms: round(attacked.percentile_ms(99.0)),
            missed: sum(|noticed| noticed.missed),
            games: sum(|noticed| noticed.games),
            lost_games: sum(|noticed| noticed.lost_games),
            last_game_ended: last.is_some(),
            not_served: sum(|noticed| noticed.not_served),
            others,
            memory_before_mib: before,
            memory_peak_mib: peak,
            memory_after_mib: after,
            disk_mib: round(disk as f64 / MIB),
            log_lines,
        }
    }

    fn to_markdown(&self) -> String {
        let reasons = self.counts.reasons.keys().cloned().collect::<Vec<_>>();
        format!(
            "| {} | {} | {} | {} | {} | {:.1} / {:.1} | {:.1} / {:.1} | {} | {} | {}/{} | {:.0} / {:.0} / {:.0} | {:.1} |",
            self.what,
            self.counts.tried,
            self.counts.granted,
            self.counts.refused,
            reasons.join(", "),
            self.quiet_p50_ms,
            self.quiet_p99_ms,
            self.p50_ms,
            self.p99_ms,
            self.missed,
            self.not_served + self.lost_games + u64::from(!self.last_game_ended),
            self.others.served,
            self.others.tried,
            self.memory_before_mib,
            self.memory_peak_mib,
            self.memory_after_mib,
            self.disk_mib,
        )
    }
}

/// All results.
#[derive(Debug, serde::Serialize)]
pub(crate) struct Report {
    attacks: Vec<Row>,
}

impl Report {
    /// A report of these rows.
    pub(crate) fn new(attacks: Vec<Row>) -> Self {
        Self { attacks }
    }

    /// One JSON document.
    pub(crate) fn to_json(&self) -> String {
        serde_json::to_string_pretty(self).expect("a report is plain data")
    }

    /// A Markdown table.
    pub(crate) fn to_markdown(&self) -> String {
        let mut text = String::new();
        if self.attacks.is_empty() {
            return text;
        }
        text.push_str(
            "| attack | tried | granted | refused | reasons | quiet p50 / p99, ms | under attack p50 / p99, ms | decisions missed | honest calls and games lost | others served | memory before / peak / after, MiB | disk, MiB |\n\
             |---|---|---|---|---|---|---|---|---|---|---|---|\n",
        );
        for row in &self.attacks {
            writeln!(text, "{}", row.to_markdown()).expect("a String grows as needed");
        }
        text
    }
}

/// Two decimals.
pub(crate) fn round(number: f64) -> f64 {
    (number * 100.0).round() / 100.0
}
