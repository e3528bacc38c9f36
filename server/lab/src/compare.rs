//! `chefshat compare A B`: compares two agents on duplicate deals, which `chefshat-simulation`
//! plays, or rooms of a server where one of them is a command. The output depends only on what is
//! compared, not on time or the number of threads.

mod rooms;

use std::io::Write as _;
use std::num::NonZeroU32;
use std::path::Path;
use std::process::ExitCode;
use std::sync::Arc;

use chefshat_agents::{AgentNameError, NamedAgent, Network};
use chefshat_examiner::AgentCommand;
use chefshat_search::{MARGIN, Searchers};
use chefshat_simulation::{Comparison, Contender, Duplicate, Figure, RulesForm, SeatPlan};
use clap::{Args, ValueEnum};
use serde_json::{Value, json};
use tokio_util::task::TaskTracker;

use chefshat_cli::error::CommandError;
use chefshat_cli::numbers::{counted, signed};
use chefshat_cli::output::{self, heading, line, table};
use chefshat_cli::program::in_runtime;
use chefshat_cli::rules_args::RulesArgs;
use chefshat_cli::stops::{Stop, Stops};
use chefshat_cli::{progress, threads};

/// Maximum length of an agent's name in the title.
const MAX_NAME: usize = 25;
/// Maximum length of an agent's name in a table.
const MAX_LABEL: usize = 14;

const HELP: &str = "\
A and B are built-in agents (random, greedy and so on), network files, as chefshat.learn writes them, or commands that start agents in \
any language. Every deal is played in all seatings of the two, so that the cards favour neither. The gain depends on the agents: the \
last line of the output says how many Shifts of independent deals would give the same precision. A network plays the legal action with \
the highest output.

A command is several words in quotes, as for `chefshat bench run`: with {code} it is started for each game and seat, otherwise once for \
each seat, and reads a line for each game. The games are then played in rooms of a server, on the same deals, some dozens of Shifts a \
second. An agent that does not play a game by itself to its end ends the comparison.

Figures are per seat and Shift, for a seat of A and for a seat of B. The 95 % interval is 1.96 standard errors to either side of the \
difference, with deals as independent samples. Roles and exchange begin with the second Shift of a game. All seatings have the same \
deals, but agents with random choices make new ones in each.

Examples:
  chefshat compare greedy random
  chefshat compare trained.safetensors greedy --deals 500 --seed 7
  chefshat compare deep_q.safetensors random --seats one --preset original2020 --json
  chefshat compare 'python agent.py' greedy --seats one --deals 50 --shifts 1

The same seed gives the same output, on any number of threads, unless monte_carlo has a budget in milliseconds.";

/// Compare two agents on duplicate deals: the same deals for both, in all seats.
#[derive(Debug, Args)]
#[command(
    after_help = HELP,
    mut_arg("target_points", |arg| arg.hide(true)),
    mut_arg("target_shifts", |arg| arg.hide(true))
)]
pub(super) struct Compare {
    /// A built-in agent, a network file, or a command in quotes. monte_carlo takes a budget for each
    /// decision and the agent of its rollouts: monte_carlo:50ms or monte_carlo:400:greedy (rollouts).
    /// With :belief, as in monte_carlo:50ms:belief, it guesses hands from what the others did.
    a: String,
    /// The agent to compare it with.
    b: String,
    /// Number of deals, each played in all seatings.
    #[arg(long, default_value_t = 1000, value_parser = clap::value_parser!(u64).range(2..))]
    deals: u64,
    /// Number of Shifts in each game.
    #[arg(long, default_value = "4")]
    shifts: NonZeroU32,
    /// How the two agents share the seats.
    #[arg(long, default_value = "half")]
    seats: SeatsFlag,
    /// Seed of all random choices.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Number of threads, at most 256 and one per deal; 0 means one per core.
    #[arg(long, value_name = "N", default_value_t = 0)]
    threads: usize,
    /// For a command: games that are open at a time. Only for agents that play several at a time.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=256))]
    parallel: u16,
    /// For a command: a server to play on; CHEFSHAT_TOKEN and CHEFSHAT_CA are for it and for the agents.
    /// Default: one in this process.
    #[arg(long, value_name = "URL")]
    server: Option<String>,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    rules: RulesArgs,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum SeatsFlag {
    /// Half of the seats each, in all combinations (6 with four players).
    Half,
    /// One seat for A and the others for B, in all combinations, as in the paper's tables.
    One,
}

/// An agent that plays in this process.
pub(crate) struct Entrant {
    /// As given on the command line.
    pub(crate) given: String,
    /// Short name for the title and tables.
    pub(crate) label: String,
    pub(crate) contender: Contender,
    /// Of an agent that searches.
    search: Option<Searchers>,
}

impl Compare {
    pub(super) fn run(self) -> Result<ExitCode, CommandError> {
        if self.rules.message().stop.is_some() {
            return Err(
                "--target-points, --target-shifts: use --shifts to set the length of games".into(),
            );
        }
        let rules = self.rules.rules()?;
        let sides = [Side::of(&self.a)?, Side::of(&self.b)?];
        let plan = match self.seats {
            SeatsFlag::Half => SeatPlan::Half,
            SeatsFlag::One => SeatPlan::One,
        };
        let duplicate = Duplicate::new(rules, self.shifts, plan, self.deals, self.seed)
            .map_err(|error| format!("--deals: {error}"))?;
        for side in &sides {
            side.check(&duplicate)?;
        }
        let comparison = match &sides {
            [Side::Here(a), Side::Here(b)] => self.play_here(&duplicate, [a, b])?,
            sides => match in_runtime(self.play_in_rooms(&duplicate, sides))? {
                Ok(comparison) => comparison,
                Err(stop) => return Ok(stop.exit_code()),
            },
        };
        let played = Played {
            compare: &self,
            sides: &sides,
            duplicate: &duplicate,
            comparison: &comparison,
        };
        let mut out = anstream::stdout().lock();
        if self.json {
            writeln!(out, "{}", played.json())?;
        } else {
            write!(out, "{}", played.text())?;
        }
        Ok(ExitCode::SUCCESS)
    }

    /// Plays the games of agents of this process.
    fn play_here(
        &self,
        duplicate: &Duplicate,
        entrants: [&Entrant; 2],
    ) -> Result<Comparison, CommandError> {
        if self.server.is_some() {
            return Err("--server: these agents play in this process; it is for commands".into());
        }
        let contenders = entrants.map(|entrant| entrant.contender.clone());
        let bar = progress::of_items(self.deals, "deals");
        let pool = threads::pool(self.threads, self.deals)?;
        let comparison = pool.install(|| duplicate.run(&contenders, &|deals| bar.inc(deals)))?;
        bar.finish_and_clear();
        Ok(comparison)
    }

    /// Plays the games of commands, until somebody stops the program.
    async fn play_in_rooms(
        &self,
        duplicate: &Duplicate,
        sides: &[Side; 2],
    ) -> Result<Result<Comparison, Stop>, CommandError> {
        let mut stops = Stops::catch()?;
        let closing = TaskTracker::new();
        let players = sides.each_ref().map(Side::player);
        let (server, parallel) = (self.server.as_deref(), usize::from(self.parallel));
        let playing = rooms::run(duplicate, &players, server, parallel, &closing);
        tokio::select! {
            comparison = playing => comparison.map(Ok),
            // The agents' processes, which are in process groups of their own, end with what plays them.
            stop = stops.next() => {
                closing.close();
                closing.wait().await;
                Ok(Err(stop))
            }
        }
    }
}

/// An agent that is compared.
enum Side {
    /// It plays in this process.
    Here(Entrant),
    /// A command starts it.
    Command {
        /// As given on the command line.
        given: String,
        command: AgentCommand,
    },
}

impl Side {
    /// Reads a built-in agent, a network file, or else a command of several words.
    fn of(given: &str) -> Result<Self, CommandError> {
        let is_command = given.contains([' ', '{']) && !Path::new(given).exists();
        if !is_command {
            return Ok(Self::Here(Entrant::of(given)?));
        }
        let words = shlex::split(given).filter(|words| !words.is_empty());
        let words = words.ok_or_else(|| format!("{given}: a quote is missing in the command"))?;
        let command = AgentCommand::for_games(words);
        Ok(Self::Command {
            given: given.to_owned(),
            command: command.map_err(|error| format!("{given}: {error}"))?,
        })
    }

    /// Refuses a network that was trained for other games.
    fn check(&self, duplicate: &Duplicate) -> Result<(), CommandError> {
        let Self::Here(entrant) = self else {
            return Ok(());
        };
        let checked = duplicate.check(&entrant.contender);
        Ok(checked.map_err(|error| {
            let given = &entrant.given;
            format!("{given}: {error}: change --players, --faces or --jokers")
        })?)
    }

    /// Who plays in rooms.
    fn player(&self) -> rooms::Player {
        match self {
            Self::Here(entrant) => rooms::Player::Here(entrant.contender.clone()),
            Self::Command { command, .. } => {
                let program = command.words().first().map_or("", String::as_str);
                let name = Path::new(program).file_name().unwrap_or_default();
                let name = name.to_string_lossy().chars().take(MAX_NAME).collect();
                rooms::Player::Program(command.clone(), name)
            }
        }
    }

    /// Short name for the title and tables.
    fn label(&self) -> &str {
        match self {
            Self::Here(entrant) => &entrant.label,
            Self::Command { given, .. } => given,
        }
    }

    fn search(&self) -> Option<&Searchers> {
        match self {
            Self::Here(entrant) => entrant.search.as_ref(),
            Self::Command { .. } => None,
        }
    }

    fn json(&self) -> Value {
        match self {
            Self::Here(entrant) => entrant_json(entrant),
            Self::Command { given, .. } => json!({"command": given}),
        }
    }
}

impl Entrant {
    /// Reads a built-in agent, or else a network file.
    pub(crate) fn of(given: &str) -> Result<Entrant, CommandError> {
        match given.parse() {
            Ok(NamedAgent::Kind(kind)) => {
                return Ok(Entrant {
                    given: given.to_owned(),
                    label: given.to_owned(),
                    contender: Contender::Kind(kind),
                    search: None,
                });
            }
            Ok(NamedAgent::MonteCarlo(plays)) => {
                let search = Searchers::new(plays);
                return Ok(Entrant {
                    given: given.to_owned(),
                    label: plays.to_string(),
                    contender: Contender::Made(Arc::new(search.clone())),
                    search: Some(search),
                });
            }
            Err(AgentNameError::MonteCarlo(error)) => return Err(error.to_string().into()),
            Err(AgentNameError::Unknown(_)) => {}
        }
        let path = Path::new(given);
        if !path.exists() {
            let known = NamedAgent::NAMES.join(", ");
            return Err(format!(
                "{given}: neither a built-in agent ({known}) nor a file that exists"
            )
            .into());
        }
        if path.is_dir() {
            return Err(format!("{given} is a directory: name the network file in it").into());
        }
        let network = Network::load(path).map_err(|error| format!("{given}: {error}"))?;
        let stem = path.file_stem().unwrap_or_default().to_string_lossy();
        Ok(Entrant {
            given: given.to_owned(),
            label: stem.chars().filter(|letter| !letter.is_control()).collect(),
            contender: Contender::Network(Arc::new(network)),
            search: None,
        })
    }
}

/// A finished comparison.
struct Played<'c> {
    compare: &'c Compare,
    sides: &'c [Side; 2],
    duplicate: &'c Duplicate,
    comparison: &'c Comparison,
}

impl Played<'_> {
    /// The result as one JSON object.
    fn json(&self) -> Value {
        let comparison = self.comparison;
        let [a, b] = self.sides.each_ref().map(Side::json);
        json!({
            "a": a,
            "b": b,
            "seats": match self.compare.seats {
                SeatsFlag::Half => "half",
                SeatsFlag::One => "one",
            },
            "seed": self.compare.seed,
            "rules": RulesForm::from(self.duplicate.rules()),
            "deals": comparison.deals,
            "seatings": self.duplicate.seatings().len(),
            "shifts_per_game": self.compare.shifts,
            "games": comparison.games,
            "shifts": comparison.shifts,
            "points_per_shift": figure_json(&comparison.points),
            "mean_place": figure_json(&comparison.places),
            "shifts_won": figure_json(&comparison.wins),
        })
    }

    /// The result as lines of at most 100 columns.
    fn text(&self) -> String {
        let comparison = self.comparison;
        let mut text = String::new();
        let [a, b] = (self.sides.each_ref()).map(|side| shortened(side.label(), MAX_NAME));
        let seed = self.compare.seed;
        heading(
            &mut text,
            &format!(
                "{a} against {b}: {}, seed {seed}",
                counted(comparison.deals, "deal")
            ),
        );
        let seats = match self.compare.seats {
            SeatsFlag::Half => "half of the seats each",
            SeatsFlag::One => "one seat against the others",
        };
        line(
            &mut text,
            &format!(
                "each in {} ({seats}): {}, {}",
                counted(self.duplicate.seatings().len() as u64, "seating"),
                counted(comparison.games, "game"),
                counted(comparison.shifts, "Shift"),
            ),
        );
        line(&mut text, &output::rules_in_short(self.duplicate.rules()));
        let variations = output::variations(self.duplicate.rules());
        for words in output::variation_lines(&variations) {
            line(&mut text, &words);
        }
        text.push('\n');
        heading(
            &mut text,
            "Per seat and Shift (95 % interval of the difference)",
        );
        let [a, b] = self.columns();
        let header = [
            "",
            &a,
            &b,
            "Difference",
            "95 % interval",
            "Standard\nerror",
            "independent\ndeals",
        ];
        let rows = [
            ("Points", &comparison.points, 1.0),
            ("Place", &comparison.places, 1.0),
            ("Shifts won, %", &comparison.wins, 100.0),
        ];
        let rows = rows.map(|(what, figure, scale)| {
            let interval = figure.interval95();
            vec![
                what.to_owned(),
                format!("{:.3}", scale * figure.a()),
                format!("{:.3}", scale * figure.b()),
                signed(scale * figure.difference()),
                format!(
                    "{} … {}",
                    signed(scale * interval.low),
                    signed(scale * interval.high)
                ),
                format!("{:.4}", scale * figure.standard_error()),
                format!("{:.4}", scale * figure.independent_standard_error()),
            ]
        });
        table(&mut text, &header, &[0], rows.into_iter());
        text.push('\n');
        for search in self.sides.iter().filter_map(Side::search) {
            line(&mut text, &searched(search));
        }
        line(&mut text, &self.gain());
        text
    }

    /// How many independent deals would have been needed, in words.
    fn gain(&self) -> String {
        let shifts = self.comparison.shifts;
        match self.comparison.points.gain() {
            None => "All deals had the same result: chance had no influence.".to_owned(),
            Some(gain) => format!(
                "This is as precise as {} of independent deals ({gain:.1} times as many).",
                counted((gain * shifts as f64).round() as u64, "Shift")
            ),
        }
    }

    /// Column headings of the two agents: their names, or A and B if these are equal.
    fn columns(&self) -> [String; 2] {
        let [a, b] = (self.sides.each_ref()).map(|side| shortened(side.label(), MAX_LABEL));
        if a == b {
            ["A".to_owned(), "B".to_owned()]
        } else {
            [a, b]
        }
    }
}

/// How an agent that searches took its decisions, in words.
fn searched(search: &Searchers) -> String {
    let decisions = &search.decisions;
    let others = decisions.too_many_deals() + decisions.history_unknown();
    let searched = decisions.searched();
    let rollouts = (decisions.rollouts() as f64 / searched.max(1) as f64).round();
    format!(
        "{}: {} searched (about {} each), {} taken as {} does.",
        search.plays,
        counted(searched, "decision"),
        counted(rollouts as u64, "rollout"),
        counted(others, "decision"),
        search.plays.prior.name(),
    )
}

fn shortened(label: &str, most: usize) -> String {
    if label.chars().count() <= most {
        return label.to_owned();
    }
    let beginning: String = label.chars().take(most - 1).collect();
    format!("{beginning}…")
}

fn entrant_json(entrant: &Entrant) -> Value {
    if let Some(search) = &entrant.search {
        return json!({
            "agent": search.plays.to_string(),
            "prior": search.plays.prior.name(),
            "margin": MARGIN,
            "decisions": {
                "searched": search.decisions.searched(),
                "rollouts": search.decisions.rollouts(),
                "too_many_deals": search.decisions.too_many_deals(),
                "history_unknown": search.decisions.history_unknown(),
            },
        });
    }
    match &entrant.contender {
        Contender::Kind(kind) => json!({"agent": kind.name()}),
        Contender::Made(_) => json!({"agent": entrant.given}),
        Contender::Network(network) => {
            let info = network.info();
            json!({
                "file": entrant.given,
                "name": info.name,
                "input": info.input.name(),
                "output": info.output.name(),
                "masked": info.masked,
                "trained_by": info.trained_by,
            })
        }
    }
}

fn figure_json(figure: &Figure) -> Value {
    let interval = figure.interval95();
    json!({
        "a": figure.a(),
        "b": figure.b(),
        "difference": figure.difference(),
        "difference_95": [interval.low, interval.high],
        "standard_error": figure.standard_error(),
        "independent_standard_error": figure.independent_standard_error(),
        "gain": figure.gain(),
    })
}
