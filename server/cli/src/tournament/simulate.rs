//! `chefshat tournament simulate`: plays a tournament of built-in agents offline on all cores, with
//! the pairings and standings of a server.

use std::io::Write as _;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

use chefshat_agents::{AgentKind, NamedAgent};
use chefshat_engine::RuleSet;
use chefshat_proto::v1;
use chefshat_record::atomic_file::AtomicFile;
use chefshat_simulation::RulesForm;
use chefshat_simulation::tournament::play_offline;
use chefshat_tournament::{
    Deals, Entrant, Format, MAX_GAMES_AT_A_TIME, MAX_PARTICIPANTS, ParticipantKind, Settings,
    SettingsProblem, Tournament,
};
use clap::Args;
use serde_json::{Value, json};

use super::super::error::tell;
use super::super::numbers::{counted, grouped};
use super::super::output::{self, heading, line};
use super::super::rules_args::{RulesArgs, by_flag};
use super::super::{CommandError, progress, threads};
use super::create::{BuiltIn, built_in};
use super::files;
use super::results::of_deals;
use super::tables::{self, Field};
use super::words::{DealsArg, FormatArg};
use chefshat_server::convert;

/// Maximum number of games at a time, which are played in parallel.
const MAX_PARALLEL: usize = 256;

/// Play a tournament of built-in agents offline on all cores; print the standings and their
/// confidence.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  chefshat tournament simulate --format round_robin --agents greedy*4,trained*4,random*4 --games-per-pairing 100\n  \
                  chefshat tournament simulate --format swiss --agents greedy,trained,random --participants 40 --games-per-pairing 50 --deals same\n  \
                  chefshat tournament simulate --format knockout --agents trained*5,greedy*8 --seed 7 --json\n\n\
                  The same seed gives the same output, on any number of threads. The duration is printed to standard error."
)]
pub(super) struct Simulate {
    /// Format of the tournament.
    #[arg(long, value_enum)]
    format: FormatArg,
    /// Participants: random, random_unmasked, greedy or trained, or several as in greedy*4,
    /// separated by commas, for example greedy*4,trained.
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = built_in, required = true)]
    agents: Vec<BuiltIn>,
    /// Number of participants, 2 to 1024: the list of agents is repeated. Default: each once.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(2..=MAX_PARTICIPANTS as i64))]
    participants: Option<u32>,
    /// Rounds of round_robin and swiss. Default: one less than participants; for swiss, enough to
    /// find a winner.
    #[arg(long, value_name = "N")]
    rounds: Option<u32>,
    /// Games of each table of a round, with seats rotated between games; with rotated deals: deals.
    #[arg(long, value_name = "N", default_value_t = 1)]
    games_per_pairing: u32,
    /// How games are dealt.
    #[arg(long, value_enum, default_value_t = DealsArg::Independent)]
    deals: DealsArg,
    /// Seed of all random choices.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Number of threads, at most 256; 0 means one per core.
    #[arg(long, value_name = "N", default_value_t = 0)]
    threads: usize,
    /// Write complete standings to this CSV file, one line per participant.
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    rules: RulesArgs,
}

impl Simulate {
    pub(super) fn run(&self) -> Result<ExitCode, CommandError> {
        let rules = self.rules.rules()?;
        let mut tournament = self.tournament(&rules)?;
        // Before the games, so that none is played for a file that cannot be written.
        let csv = (self.csv.as_deref()).map(AtomicFile::create).transpose()?;
        let games = tournament.games_expected() as u64;
        let pool = threads::pool(self.threads, games)?;
        let bar = progress::of_items(games, "games");
        let start = Instant::now();
        for change in tournament.begin()? {
            tournament.fold(&change);
        }
        pool.install(|| play_offline(&mut tournament, rules, self.seed, &|games| bar.inc(games)))?;
        bar.finish_and_clear();
        tell(format_args!(
            "{} in {:.1} s",
            counted(games, "game"),
            start.elapsed().as_secs_f64()
        ));
        let results = self.results(&tournament);
        let written = csv.map(|file| files::write_standings(file, &results));
        let mut out = anstream::stdout().lock();
        let printed = match self.json {
            true => writeln!(out, "{}", self.json(&rules, &tournament, &results)),
            false => write!(out, "{}", self.text(&rules, &tournament, &results)),
        };
        let printed = printed.and_then(|()| out.flush());
        // A reader who has closed the output does not hide that the file is missing.
        written.transpose()?;
        printed?;
        Ok(ExitCode::SUCCESS)
    }

    /// The tournament with all participants, before its start.
    fn tournament(&self, rules: &RuleSet) -> Result<Tournament, CommandError> {
        let entrants = self.entrants()?;
        let settings = Settings {
            format: self.format.core(),
            players: rules.players(),
            points: rules.spec().points.clone(),
            rounds: self.rounds,
            games_per_pairing: self.games_per_pairing,
            deals: self.deals.core(),
            max_participants: entrants.len(),
            start_when_joined: None,
            no_show_ms: 60_000,
            max_calls: 1,
            max_parallel: MAX_PARALLEL,
            physical_tables: 0,
            draw_seed: self.draw_seed(),
            filler: AgentKind::Random.into(),
        };
        let mut tournament = Tournament::new(settings).map_err(refused)?;
        for entrant in entrants {
            let joined = tournament.join(entrant)?;
            tournament.fold(&joined);
        }
        Ok(tournament)
    }

    /// The participants: `greedy 1`, `greedy 2`, …, or `greedy` if there is only one.
    fn entrants(&self) -> Result<Vec<Entrant>, CommandError> {
        let kinds = |some: &BuiltIn| {
            let agent: NamedAgent =
                (some.name.parse()).expect("the name was read as one of theirs");
            std::iter::repeat_n(agent, some.count)
        };
        let listed: Vec<NamedAgent> = self.agents.iter().flat_map(kinds).collect();
        let count = self
            .participants
            .map_or(listed.len(), |count| count as usize);
        if count > MAX_PARTICIPANTS {
            return Err(format!("--agents: {count} of at most {MAX_PARTICIPANTS}").into());
        }
        let kinds: Vec<NamedAgent> = listed.into_iter().cycle().take(count).collect();
        let of_kind =
            |kinds: &[NamedAgent], kind| kinds.iter().filter(|&&other| other == kind).count();
        let entrants = kinds.iter().enumerate().map(|(index, &kind)| Entrant {
            name: match of_kind(&kinds, kind) {
                1 => kind.name(),
                _ => format!("{} {}", kind.name(), of_kind(&kinds[..=index], kind)),
            },
            name_fingerprint: String::new(),
            kind: ParticipantKind::Agent,
            built_in: Some(kind),
            filler: false,
            stateless: true,
            max_games: MAX_GAMES_AT_A_TIME,
            at_table: false,
        });
        Ok(entrants.collect())
    }

    /// The seed of pairings: the seed, 8 bytes little-endian.
    fn draw_seed(&self) -> [u8; 32] {
        let mut seed = [0; 32];
        seed[..8].copy_from_slice(&self.seed.to_le_bytes());
        seed
    }

    fn results(&self, tournament: &Tournament) -> v1::GetTournamentResultsResponse {
        v1::GetTournamentResultsResponse {
            tournament: Some(v1::Tournament {
                settings: Some(v1::TournamentSettings {
                    format: self.format.format().into(),
                    ..v1::TournamentSettings::default()
                }),
                participants: convert::tournament_participants(tournament),
                ..v1::Tournament::default()
            }),
            standings: convert::standings_to_proto(tournament, &tournament.ratings()),
            confidence: convert::confidence_to_proto(tournament),
        }
    }

    /// The result for people, in lines of at most 100 columns.
    fn text(
        &self,
        rules: &RuleSet,
        tournament: &Tournament,
        results: &v1::GetTournamentResultsResponse,
    ) -> String {
        let mut text = String::new();
        let format = tournament.settings().format.name().replace('_', " ");
        let participants = counted(tournament.participants().len() as u64, "participant");
        heading(
            &mut text,
            &format!("{format} of {participants}, seed {}", self.seed),
        );
        line(
            &mut text,
            &format!(
                "{}, {} of each pairing, {} games in all",
                counted(tournament.rounds().into(), "round"),
                counted(self.games_of_pairing(tournament).into(), "game"),
                grouped(tournament.games().len() as u64),
            ),
        );
        line(&mut text, &output::rules_in_short(rules));
        for words in output::variation_lines(&output::variations(rules)) {
            line(&mut text, &words);
        }
        if let Some(words) = of_deals(self.deals.deals()) {
            line(&mut text, words);
        }
        let described = results.tournament.clone().unwrap_or_default();
        let field = Field::new(&described);
        text.push('\n');
        tables::standings(&mut text, &field, &results.standings);
        text.push('\n');
        tables::order(&mut text, &field, &results.confidence);
        text.push('\n');
        tables::play(&mut text, &field, &results.standings);
        text
    }

    /// The result as JSON: parameters, standings and confidence.
    fn json(
        &self,
        rules: &RuleSet,
        tournament: &Tournament,
        results: &v1::GetTournamentResultsResponse,
    ) -> Value {
        let settings = tournament.settings();
        let participants = results.tournament.as_ref();
        json!({
            "format": settings.format.name(),
            "deals": settings.deals.name(),
            "rounds": tournament.rounds(),
            "games_per_pairing": settings.games_per_pairing,
            "games": tournament.games().len(),
            "seed": self.seed,
            "rules": RulesForm::from(rules),
            "participants": participants.map(|tournament| &tournament.participants),
            "standings": results.standings,
            "confidence": results.confidence,
        })
    }

    fn games_of_pairing(&self, tournament: &Tournament) -> u32 {
        match tournament.settings().deals {
            Deals::Independent | Deals::SameAtAllTables => self.games_per_pairing,
            Deals::Rotated => self.games_per_pairing * tournament.settings().players as u32,
        }
    }
}

impl FormatArg {
    fn core(self) -> Format {
        match self {
            Self::Knockout => Format::Knockout,
            Self::RoundRobin => Format::RoundRobin,
            Self::Swiss => Format::Swiss,
        }
    }
}

impl DealsArg {
    fn core(self) -> Deals {
        match self {
            Self::Independent => Deals::Independent,
            Self::Same => Deals::SameAtAllTables,
            Self::Rotated => Deals::Rotated,
        }
    }
}

/// The problem with the settings, with flags instead of fields.
fn refused(problem: SettingsProblem) -> CommandError {
    let field = match problem.field {
        "max_participants" => "participants",
        "rules" | "format" => "format",
        field => field,
    };
    by_flag(field, &problem.problem).into()
}
