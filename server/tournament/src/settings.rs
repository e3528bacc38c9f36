//! What a tournament is to be, and whether it can be held. Rules and clocks of its games, who may join and who owns it are the server's
//! affair.

use thiserror::Error;

use chefshat_agents::AgentKind;

/// Most games of a tournament; more would be held in memory for nothing that anybody could follow.
pub const MAX_GAMES: usize = 100_000;
/// Most participants, fillers aside.
pub const MAX_PARTICIPANTS: usize = 1024;
/// Fewest participants, fillers aside.
pub const MIN_PARTICIPANTS: usize = 2;
/// Most rounds.
pub const MAX_ROUNDS: u32 = 1000;
/// Most games of a pairing, or most deals where each is played once for each seat.
pub const MAX_GAMES_PER_PAIRING: u32 = 1000;
/// Most games that a participant may play at a time.
pub const MAX_GAMES_AT_A_TIME: usize = 64;

/// Seats of a table of a knockout, half of which advance.
pub(super) const KNOCKOUT_SEATS: usize = 4;

/// Who plays whom.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Format {
    /// Tables of four, of each of which the first two advance, in two halves that meet in a final of four.
    Knockout,
    /// A fixed number of rounds, in which all meet as evenly as their number allows. Its rounds need not wait for each other.
    RoundRobin,
    /// A fixed number of rounds; those who score alike meet, with as few repeated meetings as possible.
    Swiss,
}

impl Format {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Knockout, Self::RoundRobin, Self::Swiss];

    /// The name by which people and messages call it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Knockout => "knockout",
            Self::RoundRobin => "round_robin",
            Self::Swiss => "swiss",
        }
    }

    /// The format of a name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|format| format.name() == name)
    }
}

/// How the games are dealt.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
pub enum Deals {
    /// Every game anew.
    #[default]
    Independent,
    /// All tables of a round alike, game by game: nobody meets a deal twice.
    SameAtAllTables,
    /// Every pairing plays each deal once for each seat, its participants rotated. For those who remember nothing.
    Rotated,
}

impl Deals {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Independent, Self::SameAtAllTables, Self::Rotated];

    /// The name by which people and messages call it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Independent => "independent",
            Self::SameAtAllTables => "same",
            Self::Rotated => "rotated",
        }
    }

    /// The way of dealing of a name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|deals| deals.name() == name)
    }
}

/// What a tournament is to be, not yet checked: [`Tournament::new`](super::Tournament::new) does.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Settings {
    /// Who plays whom.
    pub format: Format,
    /// Seats of a game, 2..=6; 4 in a knockout.
    pub players: usize,
    /// What a game is worth by place in it, one number for each seat, none larger than the one before.
    pub points: Vec<u32>,
    /// Rounds, 1..=1000; `None`: as many as the format suggests. None in a knockout, whose size decides.
    pub rounds: Option<u32>,
    /// Games of a pairing, 1..=1000, seats rotating by one from game to game. With rotated deals: deals, each of which is played as often
    /// as there are seats.
    pub games_per_pairing: u32,
    /// How the games are dealt.
    pub deals: Deals,
    /// Most participants, fillers aside, 2..=1024.
    pub max_participants: usize,
    /// Begins by itself when so many have joined, 2..=`max_participants`.
    pub start_when_joined: Option<usize>,
    /// Milliseconds that a game waits for participants who are absent, 1000..=86400000.
    pub no_show_ms: u64,
    /// How often a game is called before those who do not come forfeit it, 1..=10.
    pub max_calls: u32,
    /// Most games at a time, 1..=256.
    pub max_parallel: usize,
    /// What decides every draw: of seats, tables, ties. No deal depends on it.
    pub draw_seed: [u8; 32],
    /// The built-in agent that fills up tables.
    pub filler: AgentKind,
}

/// Why a tournament cannot be held.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("{field}: {problem}")]
pub struct SettingsProblem {
    /// The field at fault, as the protocol's settings call it.
    pub field: &'static str,
    /// What is wrong with it, in words.
    pub problem: String,
}

impl Settings {
    /// Finds the first field that cannot be.
    pub(super) fn check(&self) -> Result<(), SettingsProblem> {
        let refuse = |field, problem: String| Err(SettingsProblem { field, problem });
        if !(2..=6).contains(&self.players) || self.points.len() != self.players {
            let (players, points) = (self.players, self.points.len());
            return refuse("rules", format!("{players} players, points for {points}"));
        }
        if self.points.is_sorted_by(|better, worse| better >= worse) {
            // As it has to be.
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
        let games = self.games_for(most);
        if games > MAX_GAMES {
            let problem = format!(
                "up to {games} games with {most} participants; {MAX_GAMES} is the most: take fewer participants, rounds or games of a pairing"
            );
            return refuse("games_per_pairing", problem);
        }
        Ok(())
    }

    /// How many take part if so many joined: what it is filled up to.
    pub(super) fn field_for(&self, joined: usize) -> usize {
        match self.format {
            Format::Knockout => joined.next_power_of_two().max(KNOCKOUT_SEATS),
            Format::RoundRobin | Format::Swiss => joined.max(self.players),
        }
    }

    /// Rounds for a field of so many.
    pub(super) fn rounds_for(&self, field: usize) -> u32 {
        let doublings = field.next_power_of_two().trailing_zeros();
        let standard = match self.format {
            // Four are left for the last round.
            Format::Knockout => doublings - 1,
            Format::RoundRobin => field as u32 - 1,
            Format::Swiss => doublings,
        };
        self.rounds.unwrap_or(standard.max(1))
    }

    /// Games of a pairing.
    pub(super) fn games_of_pairing(&self) -> u32 {
        match self.deals {
            Deals::Independent | Deals::SameAtAllTables => self.games_per_pairing,
            Deals::Rotated => self.games_per_pairing * self.players as u32,
        }
    }

    /// Games in all, if so many joined.
    pub(super) fn games_for(&self, joined: usize) -> usize {
        let field = self.field_for(joined);
        let pairings = match self.format {
            // Half as many tables from round to round, down to one.
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
