//! Settings of a tournament and their validation. Rules and clocks of its games, admission and
//! ownership belong to the server.

use thiserror::Error;

use chefshat_agents::NamedAgent;

/// Maximum number of games of a tournament, which bounds its memory.
pub const MAX_GAMES: usize = 100_000;
/// Maximum number of participants without fillers.
pub const MAX_PARTICIPANTS: usize = 1024;
/// Minimum number of participants without fillers.
pub const MIN_PARTICIPANTS: usize = 2;
/// Maximum number of rounds.
pub const MAX_ROUNDS: u32 = 1000;
/// Maximum number of games of a pairing; with rotated deals, of deals.
pub const MAX_GAMES_PER_PAIRING: u32 = 1000;
/// Maximum number of games that a participant may play at a time.
pub const MAX_GAMES_AT_A_TIME: usize = 64;
/// Maximum number of physical tables.
pub const MAX_PHYSICAL_TABLES: usize = 64;

/// Seats of a knockout table, half of which advance.
pub(super) const KNOCKOUT_SEATS: usize = 4;

/// The format of a tournament.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Format {
    /// Tables of four. The first two of each advance, in two halves that meet in a final of four.
    Knockout,
    /// A fixed number of rounds in which all meet as evenly as possible. Rounds need not wait for
    /// each other.
    RoundRobin,
    /// A fixed number of rounds. Participants with similar scores meet, with as few repeated
    /// meetings as possible.
    Swiss,
}

impl Format {
    /// All formats.
    pub const ALL: [Self; 3] = [Self::Knockout, Self::RoundRobin, Self::Swiss];

    /// The name in messages and commands.
    pub fn name(self) -> &'static str {
        match self {
            Self::Knockout => "knockout",
            Self::RoundRobin => "round_robin",
            Self::Swiss => "swiss",
        }
    }

    /// The format with this name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|format| format.name() == name)
    }
}

/// How games are dealt.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
pub enum Deals {
    /// Every game has its own deal.
    #[default]
    Independent,
    /// All tables of a round have the same deals, game by game. Nobody plays a deal twice.
    SameAtAllTables,
    /// Every pairing plays each deal once for each seat, with its participants rotated. For
    /// stateless agents.
    Rotated,
}

impl Deals {
    /// All ways of dealing.
    pub const ALL: [Self; 3] = [Self::Independent, Self::SameAtAllTables, Self::Rotated];

    /// The name in messages and commands.
    pub fn name(self) -> &'static str {
        match self {
            Self::Independent => "independent",
            Self::SameAtAllTables => "same",
            Self::Rotated => "rotated",
        }
    }

    /// The way of dealing with this name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|deals| deals.name() == name)
    }
}

/// Settings of a tournament, checked by [`Tournament::new`](super::Tournament::new).
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Settings {
    /// The format.
    pub format: Format,
    /// Seats of a game, 2..=6; 4 in a knockout.
    pub players: usize,
    /// Tournament score by place in a game, one for each seat, non-increasing.
    pub points: Vec<u32>,
    /// Number of rounds, 1..=1000; `None` for the format's suggestion. Must be `None` in a
    /// knockout.
    pub rounds: Option<u32>,
    /// Games of a pairing, 1..=1000, with seats rotating by one from game to game. With rotated
    /// deals: number of deals, each of which is played once for each seat.
    pub games_per_pairing: u32,
    /// How games are dealt.
    pub deals: Deals,
    /// Maximum number of participants without fillers, 2..=1024.
    pub max_participants: usize,
    /// Begin when this many have joined, 2..=`max_participants`.
    pub start_when_joined: Option<usize>,
    /// No-show time: how long a game waits for absent participants, in milliseconds,
    /// 1000..=86400000.
    pub no_show_ms: u64,
    /// Calls of a game after which absent participants forfeit it, 1..=10.
    pub max_calls: u32,
    /// Maximum number of games at a time, 1..=256.
    pub max_parallel: usize,
    /// Number of physical tables, 0..=64: maximum number of games with real cards at a time. Only
    /// with independent deals.
    pub physical_tables: usize,
    /// Seed of all random choices: seats, tables, tie breaks. No deal depends on it.
    pub draw_seed: [u8; 32],
    /// The built-in agent that fills tables up.
    pub filler: NamedAgent,
}

/// An invalid setting.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("{field}: {problem}")]
pub struct SettingsProblem {
    /// The field's name in the protocol.
    pub field: &'static str,
    /// What is wrong with it.
    pub problem: String,
}

impl Settings {
    /// Returns the first invalid field.
    pub(super) fn check(&self) -> Result<(), SettingsProblem> {
        let refuse = |field, problem: String| Err(SettingsProblem { field, problem });
        if !(2..=6).contains(&self.players) || self.points.len() != self.players {
            let (players, points) = (self.players, self.points.len());
            return refuse("rules", format!("{players} players, points for {points}"));
        }
        if self.points.is_sorted_by(|better, worse| better >= worse) {
            // Valid.
        } else {
            return refuse("rules", "a better place is worth fewer points".to_owned());
        }
        if self.format == Format::Knockout {
            if self.players != KNOCKOUT_SEATS {
                let players = self.players;
                let problem = format!("a knockout is for games of 4, not of {players} players");
                return refuse("format", problem);
            }
            if self.rounds.is_some() {
                let problem = "the rounds of a knockout follow from its participants";
                return refuse("rounds", problem.to_owned());
            }
        }
        let (least, most) = (MIN_PARTICIPANTS, self.max_participants);
        within("max_participants", most, least, MAX_PARTICIPANTS)?;
        within("rounds", self.rounds.unwrap_or(1), 1, MAX_ROUNDS)?;
        let games = self.games_per_pairing;
        within("games_per_pairing", games, 1, MAX_GAMES_PER_PAIRING)?;
        let start = self.start_when_joined.unwrap_or(least);
        within("start_when_joined", start, least, most)?;
        within("no_show_time_ms", self.no_show_ms, 1000, 86_400_000)?;
        within("max_calls", self.max_calls, 1, 10)?;
        within("max_parallel_games", self.max_parallel, 1, 256)?;
        within(
            "physical_tables",
            self.physical_tables,
            0,
            MAX_PHYSICAL_TABLES,
        )?;
        if self.physical_tables > 0 && self.deals != Deals::Independent {
            let problem = "real cards cannot be dealt again; set `deals` to independent";
            return refuse("physical_tables", problem.to_owned());
        }
        let games = self.games_for(most);
        if games > MAX_GAMES {
            let problem = format!(
                "up to {games} games with {most} participants; at most {MAX_GAMES} are allowed: choose fewer participants, rounds or games of a pairing"
            );
            return refuse("games_per_pairing", problem);
        }
        Ok(())
    }

    /// Number of participants with fillers, if `joined` have joined.
    pub(super) fn field_for(&self, joined: usize) -> usize {
        match self.format {
            Format::Knockout => joined.next_power_of_two().max(KNOCKOUT_SEATS),
            Format::RoundRobin | Format::Swiss => joined.max(self.players),
        }
    }

    /// Number of rounds for a field of this size.
    pub(super) fn rounds_for(&self, field: usize) -> u32 {
        let doublings = field.next_power_of_two().trailing_zeros();
        let standard = match self.format {
            // The last round has four participants.
            Format::Knockout => doublings - 1,
            Format::RoundRobin => field as u32 - 1,
            Format::Swiss => doublings,
        };
        self.rounds.unwrap_or(standard.max(1))
    }

    /// Number of games of a pairing.
    pub(super) fn games_of_pairing(&self) -> u32 {
        match self.deals {
            Deals::Independent | Deals::SameAtAllTables => self.games_per_pairing,
            Deals::Rotated => self.games_per_pairing * self.players as u32,
        }
    }

    /// Total number of games, if `joined` have joined.
    pub(super) fn games_for(&self, joined: usize) -> usize {
        let field = self.field_for(joined);
        let pairings = match self.format {
            // The number of tables halves from round to round, down to one.
            Format::Knockout => field / 2 - 1,
            Format::RoundRobin | Format::Swiss => {
                field / self.players * self.rounds_for(field) as usize
            }
        };
        pairings * self.games_of_pairing() as usize
    }
}

fn within<T: PartialOrd + std::fmt::Display>(
    field: &'static str,
    number: T,
    least: T,
    most: T,
) -> Result<(), SettingsProblem> {
    if (&least..=&most).contains(&&number) {
        return Ok(());
    }
    Err(SettingsProblem {
        field,
        problem: format!("{number} is not within {least}..={most}"),
    })
}
