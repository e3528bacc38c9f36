//! The help of the program: its commands in groups, and examples.

use std::fmt::Write as _;

use clap::Command;

/// The commands, as the help lists them: what most people look for first.
pub(crate) const GROUPS: [(&str, &[&str]); 6] = [
    ("Start here", &["demo", "serve", "play", "agent"]),
    (
        "Play and watch",
        &["room", "watch", "table", "leaderboard", "mcp"],
    ),
    ("Organise", &["tournament", "study"]),
    (
        "Records and research",
        &[
            "records",
            "verify",
            "import",
            "export",
            "render",
            "simulate",
            "compare",
            "bench",
            "ratings",
            "experiment",
            "check-agent",
            "conformance",
        ],
    ),
    (
        "Operate a server",
        &[
            "config",
            "token",
            "key",
            "admin",
            "health",
            "participant",
            "backup",
            "restore",
            "migrate",
            "cluster",
        ],
    ),
    ("Shell", &["completions", "man", "help"]),
];

/// A command line whose help lists its commands in groups.
pub(crate) fn grouped(mut command: Command) -> Command {
    command.build();
    let styles = command.get_styles();
    let (header, literal) = (*styles.get_header(), *styles.get_literal());
    let mut list = String::new();
    for (heading, names) in GROUPS {
        let _ = writeln!(list, "{header}{heading}:{header:#}");
        for name in names {
            let about = command.find_subcommand(name).and_then(Command::get_about);
            let about = about.map(ToString::to_string).unwrap_or_default();
            let _ = writeln!(list, "  {literal}{name:12}{literal:#} {about}");
        }
        list.push('\n');
    }
    let examples = "Examples:
  chefshat demo                       a server, four agents and their game
  chefshat serve                      a server at http://127.0.0.1:50051
  chefshat play --local               a game against built-in agents, in this terminal
  chefshat room create --help         the options of a command";
    command.help_template(format!(
        "{{about}}\n\n{{usage-heading}} {{usage}}\n\n{list}{header}Options:{header:#}\n{{options}}\n\n{examples}\n"
    ))
}
