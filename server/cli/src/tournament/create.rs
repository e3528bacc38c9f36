//! `chefshat tournament create`: creates a tournament and prints its secrets.

use std::path::PathBuf;
use std::process::ExitCode;

use crate::kind::KindArg;
use chefshat_agents::NamedAgent;
use chefshat_client::{Error, v1};
use clap::Args;

use super::super::connect::ServerArg;
use super::super::policy_args::PolicyArgs;
use super::super::remote::named_agent;
use super::super::rules_args::{RulesArgs, by_flag};
use super::super::secret_file::{SecretFile, write_all};
use super::super::{CommandError, say};
use super::words::{DealsArg, FormatArg, time, time_in_words};

/// Maximum number of participants.
const MAX_BUILT_IN: usize = 1024;

/// Create a tournament and print how to take part.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  chefshat tournament create --name cup --format knockout --built-in 'greedy*4' --start-when 16\n  \
                  chefshat tournament create --name league --format round_robin --deals same --games-per-pairing 4 --code-file ./join-code\n  \
                  chefshat tournament create --name mixed --format swiss --rounds 5 --target-shifts 3 \\\n    \
                  --clock human:60000:300000 --clock robot:30000 --no-show-time-ms 300000 --owner-file ./owner\n\n\
                  docs/tournaments.md says what the formats and deals are, and what happens to those who do not come."
)]
pub(super) struct Create {
    /// Display name, 1 to 64 characters.
    #[arg(long)]
    name: String,
    /// Format of the tournament.
    #[arg(long, value_enum)]
    format: FormatArg,
    #[command(flatten)]
    server: ServerArg,
    /// Built-in participants: random, greedy or trained, or several as in greedy*4, separated by
    /// commas, for example greedy*4,trained. Repeatable.
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = built_in)]
    built_in: Vec<BuiltIn>,
    /// Start when this many have joined, built-in agents included. Default: `chefshat tournament
    /// start` starts it.
    #[arg(long, value_name = "N")]
    start_when: Option<u32>,
    /// Start by itself at this time, with those who have joined: as in 2026-05-01T18:00:00Z,
    /// 2026-05-01T20:00:00+02:00, or 30m from now.
    #[arg(long, value_name = "TIME", value_parser = time)]
    start_at: Option<u64>,
    /// Rounds of round_robin and swiss. Default: one less than participants; for swiss, enough to
    /// find a winner.
    #[arg(long, value_name = "N")]
    rounds: Option<u32>,
    /// Games of each table of a round, with seats rotated between games; with rotated deals: deals.
    /// Default: 1.
    #[arg(long, value_name = "N")]
    games_per_pairing: Option<u32>,
    /// How games are dealt.
    #[arg(long, value_enum, default_value_t = DealsArg::Independent)]
    deals: DealsArg,
    /// Kinds of participants that may join. Repeatable. Default: all.
    #[arg(long = "kind", value_enum, value_name = "KIND")]
    kinds: Vec<KindArg>,
    /// Maximum number of participants, built-in agents included, 2 to 1024. Default: 64.
    #[arg(long, value_name = "N")]
    max_participants: Option<u32>,
    /// Milliseconds that a game waits for participants who are not connected. Default: 60000.
    #[arg(long, value_name = "MS")]
    no_show_time_ms: Option<u32>,
    /// How often a game is called before absent participants forfeit it, 1 to 10. Default: 2.
    #[arg(long, value_name = "N")]
    max_calls: Option<u32>,
    /// Maximum number of games at a time, 1 to 256. Default: 64.
    #[arg(long, value_name = "N")]
    max_parallel_games: Option<u32>,
    /// Number of physical tables, 1 to 64, where participants play with real cards, one game at a
    /// time each; `chefshat tournament add` adds these participants. Default: none.
    #[arg(long, value_name = "N")]
    physical_tables: Option<u32>,
    /// Seed of pairings and seats, 64 hexadecimal digits, to repeat a draw. The deals do not depend
    /// on it.
    #[arg(long, value_name = "HEX", value_parser = seed)]
    draw_seed: Option<[u8; 32]>,
    /// Seed of all deals, 64 hexadecimal digits, for experiments: anyone who knows it knows the
    /// cards, and games are not rated.
    #[arg(long, value_name = "HEX", value_parser = seed)]
    deal_seed: Option<[u8; 32]>,
    /// Built-in agent that fills up a knockout and plays for participants who forfeit. Default:
    /// random.
    #[arg(long, value_name = "AGENT", value_parser = agent_name)]
    filler: Option<String>,
    /// Write the join code to this file, readable only by its owner; waits for the server to start.
    #[arg(long, value_name = "FILE")]
    code_file: Option<PathBuf>,
    /// Write the owner token to this file, readable only by its owner; `start` and `close` read it.
    #[arg(long, value_name = "FILE")]
    owner_file: Option<PathBuf>,
    /// Print the tournament with its secrets as a JSON line.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    rules: RulesArgs,
    #[command(flatten)]
    policy: PolicyArgs,
}

/// A number of equal built-in agents.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct BuiltIn {
    pub(super) name: String,
    pub(super) count: usize,
}

impl Create {
    pub(super) async fn run(self) -> Result<ExitCode, CommandError> {
        let settings = self.settings()?;
        let client = match &self.code_file {
            Some(_) => self.server.connect_patiently().await?,
            None => self.server.connect().await?,
        };
        // Before the tournament is created: without a file for its secrets it would be useless.
        let code_file = (self.code_file.as_deref())
            .map(|file| SecretFile::prepare(file, "--code-file", "a join code"))
            .transpose()?;
        let owner_file = (self.owner_file.as_deref())
            .map(SecretFile::for_owner)
            .transpose()?;
        let created = client.create_tournament(settings).await.map_err(refused)?;
        let tournament = created
            .tournament
            .ok_or("the server did not return the created tournament")?;
        let (code, owner) = (created.join_code, created.owner_token);
        let written = write_all([(code_file, &code), (owner_file, &owner)]);
        if self.json {
            let line = serde_json::json!({
                "event": "created", "tournament": tournament, "join_code": code, "owner_token": owner,
            });
            say(line)?;
        } else {
            say(format_args!("tournament   {}", tournament.tournament_id))?;
            say(format_args!("join code    {code}"))?;
            say(format_args!("owner token  {owner}"))?;
            say(self.next_steps(&tournament, &code))?;
        }
        // Last, so that the secrets are printed even if this fails.
        written?;
        Ok(ExitCode::SUCCESS)
    }

    /// The request; flags that are not given are left to the server's defaults.
    fn settings(&self) -> Result<v1::TournamentSettings, CommandError> {
        // Errors name the flag and come before any request.
        self.rules.rules()?;
        let built_in: usize = self.built_in.iter().map(|some| some.count).sum();
        if built_in > MAX_BUILT_IN {
            return Err(format!("--built-in: {built_in} of at most {MAX_BUILT_IN} agents").into());
        }
        let named = |some: &BuiltIn| std::iter::repeat_n(some.name.clone(), some.count);
        Ok(v1::TournamentSettings {
            name: self.name.clone(),
            format: self.format.format().into(),
            rules: Some(self.rules.message()),
            policy: Some(self.policy.message()),
            rounds: asked("--rounds", self.rounds)?,
            games_per_pairing: asked("--games-per-pairing", self.games_per_pairing)?,
            deals: self.deals.deals().into(),
            kinds: self
                .kinds
                .iter()
                .map(|kind| v1::ParticipantKind::from(*kind).into())
                .collect(),
            max_participants: asked("--max-participants", self.max_participants)?,
            built_in_agents: self.built_in.iter().flat_map(named).collect(),
            start_when_joined: asked("--start-when", self.start_when)?,
            no_show_time_ms: asked("--no-show-time-ms", self.no_show_time_ms)?,
            max_calls: asked("--max-calls", self.max_calls)?,
            max_parallel_games: asked("--max-parallel-games", self.max_parallel_games)?,
            draw_seed: self.draw_seed.map_or_else(Vec::new, |seed| seed.to_vec()),
            deal_seed: self.deal_seed.map_or_else(Vec::new, |seed| seed.to_vec()),
            filler: self.filler.clone().unwrap_or_default(),
            physical_tables: asked("--physical-tables", self.physical_tables)?,
            start_at_ms: self.start_at.unwrap_or(0),
        })
    }

    /// How others take part, and how the tournament starts.
    fn next_steps(&self, tournament: &v1::Tournament, code: &str) -> String {
        let (id, there) = (&tournament.tournament_id, self.server.flags());
        if tournament.state() != v1::TournamentState::Open {
            return format!(
                "it has started; follow it with: chefshat tournament follow {id} {there}"
            );
        }
        let join = format!("chefshat tournament join --agent greedy {there} --code {code}");
        let owner = match &self.owner_file {
            Some(file) => format!("--owner-file {}", file.display()),
            None => "--owner-token TOKEN".to_owned(),
        };
        let starts = match (self.start_when, self.start_at) {
            (Some(count), None) => format!("it starts when {count} have joined"),
            (None, Some(at)) => format!("it starts at {}", time_in_words(at)),
            (Some(count), Some(at)) => {
                let at = time_in_words(at);
                format!("it starts when {count} have joined, at the latest at {at}")
            }
            (None, None) => {
                format!("start it with: chefshat tournament start {id} {there} {owner}")
            }
        };
        let at_table = match self.physical_tables {
            Some(_) => format!(
                "add those at a physical table with: chefshat tournament add {id} --name NAME {there} {owner}\n"
            ),
            None => String::new(),
        };
        format!("join with: {join}\n{at_table}{starts}")
    }
}

/// A number for the protocol, where 0 means not set.
fn asked(flag: &str, number: Option<u32>) -> Result<u32, CommandError> {
    match number {
        Some(0) => Err(format!("{flag}: 0 is too few; leave out the flag for the default").into()),
        number => Ok(number.unwrap_or(0)),
    }
}

/// Parses `greedy` or `greedy*4`.
pub(super) fn built_in(words: &str) -> Result<BuiltIn, String> {
    let (name, count) = match words.split_once('*') {
        None => (words, Some(1)),
        Some((name, count)) => (name, count.parse().ok()),
    };
    match count {
        Some(count @ 1..=MAX_BUILT_IN) => Ok(BuiltIn {
            name: agent_name(name)?,
            count,
        }),
        _ => Err(format!("after * give a number from 1 to {MAX_BUILT_IN}")),
    }
}

pub(super) fn agent_name(name: &str) -> Result<String, String> {
    named_agent(name).map(NamedAgent::name)
}

fn seed(digits: &str) -> Result<[u8; 32], String> {
    let mut seed = [0; 32];
    hex::decode_to_slice(digits, &mut seed)
        .map(|()| seed)
        .map_err(|_| "a seed is 64 hexadecimal digits".to_owned())
}

/// A refusal of the server, with flags instead of fields.
fn refused(error: Error) -> CommandError {
    let known = [
        "RULE_SET_REFUSED",
        "POLICY_REFUSED",
        "SETTINGS_REFUSED",
        "NAME_REFUSED",
    ];
    let field = error.metadata().get("field");
    match (error.reason(), field.map(String::as_str)) {
        (Some(reason), Some(field)) if known.contains(&reason) => flagged(field, error.message()),
        _ => error.into(),
    }
}

/// The problem with a field of the settings, with the flag instead of the field.
fn flagged(field: &str, message: &str) -> CommandError {
    let said = format!("{field}: ");
    let message = message.strip_prefix(&said).unwrap_or(message);
    match field {
        // The inner field is a flag, if there is one.
        "rules" | "policy" => match message.split_once(": ") {
            Some((inner, rest)) if !inner.contains(' ') => by_flag(inner, rest),
            _ => message.to_owned(),
        },
        "start_when_joined" => by_flag("start_when", message),
        "start_at_ms" => by_flag("start_at", message),
        "built_in_agents" => by_flag("built_in", message),
        "kinds" => by_flag("kind", message),
        _ => by_flag(field, message),
    }
    .into()
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use crate::tournament::create::*;

    #[derive(Parser)]
    struct Only {
        #[command(flatten)]
        create: Create,
    }

    fn settings(flags: &str) -> Result<v1::TournamentSettings, CommandError> {
        let words = "test --name cup --format swiss".split(' ');
        let create = Only::try_parse_from(words.chain(flags.split_whitespace()))?.create;
        create.settings()
    }

    #[test]
    fn every_flag_sets_its_field() {
        let seed = "07".repeat(32);
        let flags = format!(
            "--built-in greedy*2,trained --built-in random --start-when 9 --rounds 5 --games-per-pairing 3 --deals same --kind human \
             --kind robot --max-participants 20 --no-show-time-ms 5000 --max-calls 3 --max-parallel-games 7 --draw-seed {seed} --deal-seed {seed} \
             --filler greedy --physical-tables 2 --start-at 2026-05-01T20:00:00+02:00 --target-shifts 3 --decision-time-ms 700 --clock human:60000"
        );
        let rules = v1::RuleSet {
            preset: "paper".into(),
            stop: Some(v1::rule_set::Stop::TargetShifts(3)),
            ..v1::RuleSet::default()
        };
        let clock = v1::KindClock {
            kind: v1::ParticipantKind::Human.into(),
            decision_time_ms: Some(60_000),
            bank_ms: None,
            absence_time_ms: None,
        };
        let policy = v1::RoomPolicy {
            decision_time_ms: Some(700),
            clocks: vec![clock],
            ..v1::RoomPolicy::default()
        };
        let expected = v1::TournamentSettings {
            name: "cup".into(),
            format: v1::TournamentFormat::Swiss.into(),
            rules: Some(rules),
            policy: Some(policy),
            rounds: 5,
            games_per_pairing: 3,
            deals: v1::TournamentDeals::SameAtAllTables.into(),
            kinds: vec![
                v1::ParticipantKind::Human.into(),
                v1::ParticipantKind::Robot.into(),
            ],
            max_participants: 20,
            built_in_agents: ["greedy", "greedy", "trained", "random"]
                .map(String::from)
                .into(),
            start_when_joined: 9,
            no_show_time_ms: 5000,
            max_calls: 3,
            max_parallel_games: 7,
            draw_seed: vec![7; 32],
            deal_seed: vec![7; 32],
            filler: "greedy".into(),
            physical_tables: 2,
            start_at_ms: 1_777_658_400_000,
        };
        assert_eq!(settings(&flags).expect("they make sense"), expected);
    }

    #[test]
    fn errors_name_the_flag() {
        for (flags, words) in [
            ("--faces 3", "--faces: "),
            ("--rounds 0", "--rounds: 0 is too few"),
            ("--physical-tables 0", "--physical-tables: 0 is too few"),
            ("--built-in greedy*", "after * give a number"),
            ("--built-in greedy*0", "after * give a number"),
            ("--built-in gready", "use one of random"),
            (
                "--built-in greedy*600,random*600",
                "--built-in: 1200 of at most 1024",
            ),
            ("--draw-seed 07", "64 hexadecimal digits"),
            ("--start-at 18:00", "2026-05-01T18:00:00Z"),
        ] {
            let error = settings(flags).expect_err(flags).to_string();
            assert!(error.contains(words), "{error}");
        }
        for (field, message, words) in [
            ("rounds", "rounds: too many", "--rounds: too many"),
            (
                "start_when_joined",
                "start_when_joined: 3",
                "--start-when: 3",
            ),
            (
                "policy",
                "policy: decision_time_ms: 1",
                "--decision-time-ms: 1",
            ),
            ("policy", "policy: no", "no"),
            ("rules", "rules: no such game: why", "no such game: why"),
            (
                "physical_tables",
                "physical_tables: 65",
                "--physical-tables: 65",
            ),
        ] {
            assert_eq!(flagged(field, message).to_string(), words);
        }
    }
}
