//! The dataset card: the `README.md` of a dataset, with front matter for dataset hubs.

use std::fmt::Write as _;

use super::column::markdown;
use super::export::{Export, Exported, Layout};
use super::formats::{Format, file_name};
use super::sheet;
use super::{TABLES_VERSION, decisions, expressions, markers, samples};
use chefshat_record::jsonl::FORMAT_VERSION;

/// Name of the file.
pub(super) const FILE_NAME: &str = "README.md";

/// The line of the front matter that identifies our cards.
const NAME_LINE: &str = "pretty_name: Games of Chef's Hat";
/// The line before and after the front matter.
const FENCE: &str = "---";

/// The paper of the game.
const CITATION: &str = "\
@article{barros2020chefshat,
  title   = {The Chef's Hat Simulation Environment for Reinforcement-Learning-Based Agents},
  author  = {Barros, Pablo and Bloem, Anne C. and Hootsmans, Inge M. and Opheij, Lena M. and Toebosch, Romain H. A. and
             Barakova, Emilia and Sciutti, Alessandra},
  journal = {arXiv preprint arXiv:2003.05861},
  year    = {2020},
  doi     = {10.48550/arXiv.2003.05861}
}";

/// The size categories of dataset hubs.
const SIZES: [(u64, &str); 7] = [
    (1_000, "n<1K"),
    (10_000, "1K<n<10K"),
    (100_000, "10K<n<100K"),
    (1_000_000, "100K<n<1M"),
    (10_000_000, "1M<n<10M"),
    (100_000_000, "10M<n<100M"),
    (u64::MAX, "n>100M"),
];

/// The text of the card.
pub(super) fn write(export: &Export, exported: &Exported) -> String {
    let mut text = front_matter(export, exported);
    text.push_str("\n# Games of Chef's Hat\n\n");
    text.push_str(match export.layout {
        Layout::Tables => {
            "Games of the card game Chef's Hat, decision by decision: observation, legal actions, action,\n\
             time and outcome. Every game was verified by replaying its record.\n"
        }
        Layout::ChefsHatGym => {
            "Games of the card game Chef's Hat in the columns of the file `Dataset.pkl.csv` of the package `chefshatgym`, one file per\n\
             game. Every game was verified by replaying its record.\n"
        }
    });
    contents(&mut text, export, exported);
    match export.layout {
        Layout::Tables => columns(&mut text),
        Layout::ChefsHatGym => sheets(&mut text),
    }
    checksums(&mut text, exported);
    let _ = write!(
        text,
        "\n## Licence and citation\n\nLicence: {}. The game and its environment are described in this paper:\n\n```bibtex\n{CITATION}\n```\n",
        export.licence
    );
    text
}

fn front_matter(export: &Export, exported: &Exported) -> String {
    let mut yaml = format!(
        "{FENCE}\nlicense: {}\n{NAME_LINE}\ntask_categories:\n- reinforcement-learning\ntags:\n- chefs-hat\n- card-game\n\
         - multi-agent\n- games\nsize_categories:\n- {}\nconfigs:\n",
        quoted(&export.licence.to_lowercase()),
        size_category(exported.decisions)
    );
    match export.layout {
        Layout::Tables => {
            let format = preferred(&export.formats);
            for (table, rows) in [
                (decisions::TABLE, exported.decisions),
                (expressions::TABLE, exported.expressions),
                (markers::TABLE, exported.markers),
                (samples::TABLE, exported.samples),
            ] {
                let default = table == decisions::TABLE;
                // Hubs cannot infer types without rows.
                if !default && rows == 0 && format != Format::Parquet {
                    continue;
                }
                let _ = write!(
                    yaml,
                    "- config_name: {table}\n  data_files: {}\n",
                    file_name(table, format)
                );
                if default {
                    yaml.push_str("  default: true\n");
                }
            }
        }
        Layout::ChefsHatGym => {
            let _ = write!(
                yaml,
                "- config_name: games\n  data_files: \"*/{}\"\n  default: true\n",
                sheet::FILE_NAME
            );
        }
    }
    yaml + FENCE + "\n"
}

/// Whether a text starts with the front matter of one of our cards.
pub(super) fn is_ours(text: &str) -> bool {
    let mut lines = text.lines();
    lines.next() == Some(FENCE)
        && lines
            .take_while(|line| *line != FENCE)
            .any(|line| line == NAME_LINE)
}

/// The format for hubs.
fn preferred(formats: &[Format]) -> Format {
    Format::ALL
        .into_iter()
        .find(|format| formats.contains(format))
        .unwrap_or(Format::Parquet)
}

fn contents(text: &mut String, export: &Export, exported: &Exported) {
    let counted = |counts: &std::collections::BTreeMap<&str, u64>| {
        let parts: Vec<String> = counts
            .iter()
            .map(|(what, count)| format!("{count} `{what}`"))
            .collect();
        parts.join(", ")
    };
    let listed = |values: Vec<String>| values.join(", ");
    let _ = write!(
        text,
        "\n## Contents\n\n| | |\n|---|---|\n\
         | games | {} ({} finished, {} aborted) |\n\
         | origins | {} |\n\
         | players | {} |\n\
         | decisions | {} |\n",
        exported.games,
        exported.finished,
        exported.games - exported.finished,
        counted(&exported.origins),
        counted(&exported.kinds),
        exported.decisions
    );
    if export.layout == Layout::Tables {
        let _ = writeln!(text, "| expressions | {} |", exported.expressions);
        let _ = writeln!(text, "| markers | {} |", exported.markers);
        let _ = writeln!(text, "| values of samples | {} |", exported.samples);
        let _ = writeln!(text, "| columns version | {TABLES_VERSION} |");
    }
    let _ = write!(
        text,
        "| record format version | {FORMAT_VERSION} |\n\
         | rules version | {} |\n\
         | server version | {} |\n\
         | exporter version | {} |\n",
        listed(exported.rules_versions.iter().map(u32::to_string).collect()),
        listed(exported.servers.iter().cloned().collect()),
        export.version
    );
}

fn columns(text: &mut String) {
    let _ = write!(
        text,
        "\n## Table `{}`\n\nOne row per decision, in order of games and decisions.\n\n{}\
         \n## Table `{}`\n\nOne row per expression of a player, in the same order.\n\n{}\
         \n## Table `{}`\n\nOne row per marker of an instrument or the researcher, in the same order.\n\n{}\
         \n## Table `{}`\n\nOne row per value of a channel of the streams of a seat, in order of games, seats and times of receiving.\n\n{}\
         \nThe types are Arrow's. F is the number of faces (11 in the standard game). In CSV, lists and structs are JSON and\n\
         null is an empty cell; in CSV and JSON Lines, binary is hexadecimal and times are RFC 3339.\n",
        decisions::TABLE,
        markdown(&decisions::columns()),
        expressions::TABLE,
        markdown(&expressions::columns()),
        markers::TABLE,
        markdown(&markers::columns()),
        samples::TABLE,
        markdown(&samples::columns())
    );
}

fn sheets(text: &mut String) {
    text.push_str(
        "\nA \"match\" is a Shift, a \"round\" a pizza. `Source` is a player's name or `SYSTEM`; lists and dictionaries are Python\n\
         literals (read them with `ast.literal_eval`).\n",
    );
}

fn checksums(text: &mut String, exported: &Exported) {
    text.push_str("\n## Files\n\n| file | bytes | SHA-256 |\n|---|---|---|\n");
    for file in &exported.files {
        let _ = writeln!(
            text,
            "| {} | {} | `{}` |",
            file.path, file.bytes, file.sha256
        );
    }
}

fn size_category(rows: u64) -> &'static str {
    SIZES
        .iter()
        .find(|(below, _)| rows < *below)
        .map_or("n>100M", |(_, name)| name)
}

/// A YAML string: plain if possible, or else a JSON string.
fn quoted(text: &str) -> String {
    let plain = text.starts_with(|letter: char| letter.is_ascii_alphabetic())
        && text
            .chars()
            .all(|letter| letter.is_ascii_alphanumeric() || "-.".contains(letter));
    if plain {
        text.to_owned()
    } else {
        serde_json::Value::from(text).to_string()
    }
}
