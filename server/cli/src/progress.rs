//! Progress bars on standard error; nothing is shown where it is not a terminal.

use indicatif::{ProgressBar, ProgressStyle};

/// A bar that counts `total` items, for example games.
pub fn of_items(total: u64, items: &str) -> ProgressBar {
    styled(
        ProgressBar::new(total),
        &format!("{{bar:40}} {{human_pos}} of {{human_len}} {items}, {{eta}} left"),
    )
}

/// A bar that counts the bytes of records.
pub fn of_record_bytes(total: u64) -> ProgressBar {
    styled(
        ProgressBar::new(total),
        "{bar:40} {bytes} of {total_bytes} of records, {eta} left",
    )
}

/// Gives a bar a style.
pub fn styled(bar: ProgressBar, template: &str) -> ProgressBar {
    let style = ProgressStyle::with_template(template).expect("the template is valid");
    bar.with_style(style)
}
