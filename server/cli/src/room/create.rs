//! `chefshat room create`: creates a room and prints its secrets. `start` has the flags for the
//! beginning of its game.

use std::path::PathBuf;
use std::process::ExitCode;

use chefshat_agents::{AgentNameError, NamedAgent};
use chefshat_client::v1::{self, create_room_request::Start, seat_config::FilledBy};
use chefshat_engine::{MAX_SEATS, RuleSet};
use chefshat_record::convert::kind_from_name;
use clap::Args;

use super::super::connect::{ServerArg, TABLE_TICKET, attendant_link};
use super::super::policy_args::PolicyArgs;
use super::super::remote::offered_agents;
use super::super::rules_args::{RulesArgs, by_flag};
use super::super::secret_file::{SecretFile, write_all};
use super::super::{CommandError, say};
use super::start::{StartArgs, players_of};

/// Create a room and print how to join it.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  chefshat room create --name friday --seat greedy --seat random=Rolf\n  \
                  chefshat room create --preset rulebook --target-shifts 10 --decision-time-ms 60000\n  \
                  chefshat room create --code-file ./join-code\n  \
                  chefshat room create --branch GAME-ID@40 --seat replay:GAME-ID:0 --seat greedy\n  \
                  chefshat room create --hands ./hands.json --durability ephemeral\n  \
                  chefshat room create --physical --seat table=Ada --seat table=Bo --seat greedy --seat open"
)]
pub(super) struct Create {
    /// Display name.
    #[arg(long, default_value = "")]
    name: String,
    #[command(flatten)]
    server: ServerArg,
    /// How to fill the next seat: random, greedy, trained or monte_carlo (played by the server),
    /// replay:GAME-ID:SEAT (imitates the player who had that seat, from 0, in a recorded game), each
    /// optionally with =NAME for another name; open, agent, human, robot or model (who may join);
    /// wizard (a person who plays as a robot, and joins as one); or, with --physical, table=NAME or
    /// table_robot=NAME (a person or a robot at the table). Several seats as in human*3. Repeatable;
    /// seats not listed are open.
    #[arg(long = "seat", value_name = "SEAT", value_parser = seats)]
    seats: Vec<Seats>,
    /// Play with real cards: the server deals nothing, and what happens at the table is reported, by
    /// a camera, on the page, or with `chefshat table`.
    #[arg(long, conflicts_with_all = ["game_seed", "branch", "hands"])]
    physical: bool,
    /// Game seed, 64 hexadecimal digits, for experiments; such a game has no seed commitment.
    #[arg(long, value_name = "HEX", value_parser = game_seed)]
    game_seed: Option<[u8; 32]>,
    /// Write the join code to this file, readable only by its owner; waits for the server to start.
    #[arg(long, value_name = "FILE")]
    code_file: Option<PathBuf>,
    /// Write the owner token to this file, readable only by its owner; `close` and commands that
    /// show a private room read it.
    #[arg(long, value_name = "FILE")]
    owner_file: Option<PathBuf>,
    /// Print the room with its secrets as a JSON line.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    start: StartArgs,
    #[command(flatten)]
    rules: RulesArgs,
    #[command(flatten)]
    policy: PolicyArgs,
    /// Milliseconds to wait for all seats to be taken. Default: 3600000.
    #[arg(long, value_name = "MS", help_heading = "Times and limits")]
    waiting_time_ms: Option<u32>,
    /// Let each client take only one seat. Clients are distinguished by their tokens, or else by their
    /// addresses. By default one client may take several seats with the join code.
    #[arg(long, help_heading = "Times and limits")]
    one_seat_per_client: bool,
    /// Let seats ask for hints; records say which decisions had one.
    #[arg(long)]
    hints: bool,
    /// Let people write to everybody at the table.
    #[arg(long)]
    chat: bool,
}

impl Create {
    pub(super) async fn run(self) -> Result<ExitCode, CommandError> {
        let start = self.start.message()?;
        let rules = self.rules()?;
        let client = match &self.code_file {
            Some(_) => self.server.connect_patiently().await?,
            None => self.server.connect().await?,
        };
        let players = match (rules, self.start.branch()) {
            (Some(rules), _) => rules.players(),
            // Without --seat all seats are open, and their number may be left to the preset.
            (None, Some(point)) if !self.seats.is_empty() => {
                players_of(&client, &point.game_id).await?
            }
            (None, _) => 0,
        };
        let request = self.request(start, players)?;
        let is_wizard =
            |seat: &&v1::SeatConfig| matches!(seat.filled_by, Some(FilledBy::Wizard(_)));
        let wizards = request.seats.iter().filter(is_wizard).count();
        // Before the room is created: without a file for its code it would be useless.
        let code_file = (self.code_file.as_deref())
            .map(|file| SecretFile::prepare(file, "--code-file", "a join code"))
            .transpose()?;
        let owner_file = (self.owner_file.as_deref())
            .map(SecretFile::for_owner)
            .transpose()?;
        let created = client.create_room(request).await.map_err(refused)?;
        let room = created
            .room
            .ok_or("the server did not return the created room")?;
        let (code, owner) = (created.join_code, created.owner_token);
        let written = write_all([(code_file, &code), (owner_file, &owner)]);
        let table = self.physical.then(|| Table {
            link: attendant_link(&self.server.page(), &room.room_id, &created.table_ticket),
            ticket: created.table_ticket,
        });
        if self.json {
            let mut line = serde_json::json!({
                "event": "created", "room": room, "join_code": code, "owner_token": owner,
            });
            if let Some(table) = table {
                line["table_ticket"] = table.ticket.into();
                line["attendant_link"] = table.link.into();
            }
            say(format_args!("{line}"))?;
        } else {
            say(format_args!("room         {}", room.room_id))?;
            say(format_args!("game         {}", room.game_id))?;
            say(format_args!("join code    {code}"))?;
            say(format_args!("owner token  {owner}"))?;
            if let Some(table) = table {
                say(format_args!("table ticket {}", table.ticket))?;
                say(format_args!("attendant    {}", table.link))?;
                let report = self
                    .server
                    .with_ticket(TABLE_TICKET, &table.ticket, "table");
                say(format_args!(
                    "or report what happens at the table here: {report}"
                ))?;
            }
            for words in next_steps(&room, wizards, &self.server, &code) {
                say(words)?;
            }
        }
        // Last, so that the secrets are printed even if this fails.
        written?;
        Ok(ExitCode::SUCCESS)
    }

    /// The rule set, unless a recorded game sets it.
    fn rules(&self) -> Result<Option<RuleSet>, CommandError> {
        if self.start.branch().is_none() {
            return Ok(Some(self.rules.rules()?));
        }
        if !self.rules.are_standard() {
            return Err(
                "--branch: the rules of the recorded game apply; leave out the flags for rules"
                    .into(),
            );
        }
        Ok(None)
    }

    fn request(
        &self,
        start: Option<Start>,
        players: usize,
    ) -> Result<v1::CreateRoomRequest, CommandError> {
        let seats: Vec<_> = (self.seats.iter().flat_map(Seats::each)).collect();
        if seats.len() > players {
            let described = seats.len();
            return Err(
                format!("--seat: {described} seats are described, but {players} play").into(),
            );
        }
        let at_table = |seat: &v1::SeatConfig| matches!(seat.filled_by, Some(FilledBy::AtTable(_)));
        if !self.physical && seats.iter().any(at_table) {
            return Err("--seat table: only a room with --physical has seats at a table".into());
        }
        let open = v1::SeatConfig {
            filled_by: Some(FilledBy::ReservedFor(0)),
            ..v1::SeatConfig::default()
        };
        let all = seats.into_iter().chain(std::iter::repeat(open));
        Ok(v1::CreateRoomRequest {
            name: self.name.clone(),
            rules: (self.start.branch().is_none()).then(|| self.rules.message()),
            seats: all.take(players).collect(),
            policy: Some(v1::RoomPolicy {
                waiting_time_ms: self.waiting_time_ms,
                one_seat_per_client: self.one_seat_per_client,
                hints: self.hints,
                chat: self.chat,
                ..self.policy.message()
            }),
            game_seed: self.game_seed.map_or_else(Vec::new, |seed| seed.to_vec()),
            start,
            physical: self.physical,
            ..v1::CreateRoomRequest::default()
        })
    }
}

/// What the attendant of a physical table needs.
struct Table {
    ticket: String,
    link: String,
}

/// Seats that are filled in the same way.
#[derive(Debug, Clone)]
struct Seats {
    seat: v1::SeatConfig,
    count: usize,
}

impl Seats {
    fn each(&self) -> impl Iterator<Item = v1::SeatConfig> {
        std::iter::repeat_n(self.seat.clone(), self.count)
    }
}

fn seats(word: &str) -> Result<Seats, String> {
    // A name may contain an asterisk: only a number after the last one is a count.
    let is_number = |count: &str| count.bytes().all(|byte| byte.is_ascii_digit());
    let (word, count) = match word.rsplit_once('*') {
        Some((word, count)) if is_number(count) => (word, count.parse().ok()),
        _ => (word, Some(1)),
    };
    let count = count.filter(|count| (1..=MAX_SEATS).contains(count));
    let count = count.ok_or_else(|| format!("after * give a number from 1 to {MAX_SEATS}"))?;
    Ok(Seats {
        seat: seat(word)?,
        count,
    })
}

fn seat(word: &str) -> Result<v1::SeatConfig, String> {
    let (filled_by, name) = match word.split_once('=') {
        Some((_, "")) => return Err("the name after the = is empty".into()),
        Some((agent, name)) => (filled_by(agent)?, name),
        None => (filled_by(word)?, ""),
    };
    let is_open = matches!(filled_by, FilledBy::ReservedFor(_) | FilledBy::Wizard(_));
    if !name.is_empty() && is_open {
        return Err(
            "only a built-in agent or a player at the table can be named; participants bring their own names".into(),
        );
    }
    if name.is_empty() && matches!(filled_by, FilledBy::AtTable(_)) {
        return Err(format!("name the player at the table: {word}=NAME"));
    }
    Ok(v1::SeatConfig {
        filled_by: Some(filled_by),
        name: name.to_owned(),
    })
}

fn filled_by(word: &str) -> Result<FilledBy, String> {
    if let Some(player) = word.strip_prefix("replay:") {
        return recorded_player(player).map(FilledBy::Replay);
    }
    let at_table = match word {
        "table" => Some(v1::ParticipantKind::Human),
        "table_robot" => Some(v1::ParticipantKind::Robot),
        _ => None,
    };
    if let Some(kind) = at_table {
        return Ok(FilledBy::AtTable(kind.into()));
    }
    if word == "wizard" {
        return Ok(FilledBy::Wizard(v1::ParticipantKind::Robot.into()));
    }
    let reserved = match word {
        "open" => Some(v1::ParticipantKind::Unspecified),
        _ => kind_from_name(word),
    };
    if let Some(kind) = reserved {
        return Ok(FilledBy::ReservedFor(kind.into()));
    }
    match word.parse::<NamedAgent>() {
        Ok(agent) => Ok(FilledBy::BuiltInAgent(agent.name())),
        Err(AgentNameError::Unknown(_)) => {
            let offered = offered_agents();
            Err(format!(
                "use one of {offered}, replay:GAME-ID:SEAT, open, agent, human, robot, model, wizard or, with --physical, table=NAME, table_robot=NAME"
            ))
        }
        Err(error) => Err(error.to_string()),
    }
}

fn recorded_player(words: &str) -> Result<v1::RecordedPlayer, String> {
    let player = words.split_once(':').and_then(|(game_id, seat)| {
        Some(v1::RecordedPlayer {
            game_id: game_id.to_owned(),
            seat: seat.parse().ok()?,
        })
    });
    player.ok_or_else(|| {
        "use replay:, the ID of a recorded game, a colon, and a seat, from 0".to_owned()
    })
}

fn game_seed(digits: &str) -> Result<[u8; 32], String> {
    let mut seed = [0; 32];
    hex::decode_to_slice(digits, &mut seed)
        .map(|()| seed)
        .map_err(|_| "a game seed is 64 hexadecimal digits".to_owned())
}

/// A refusal of the server, with flags instead of fields.
fn refused(error: chefshat_client::Error) -> CommandError {
    match (error.reason(), error.metadata().get("field")) {
        (Some("RULE_SET_REFUSED" | "POLICY_REFUSED" | "NAME_REFUSED"), Some(field)) => {
            let message = error.message();
            let said = format!("{field}: ");
            by_flag(field, message.strip_prefix(&said).unwrap_or(message)).into()
        }
        (Some("SCRIPT_REFUSED"), _) => format!("--hands: {}", error.message()).into(),
        (Some("BRANCH_REFUSED"), _) => format!("--branch: {}", error.message()).into(),
        _ => error.into(),
    }
}

/// How to fill the free seats: a line for each kind of participant that they are for. The room shows
/// those of wizards as robots'; a program there would be recorded as a person.
fn next_steps(room: &v1::Room, wizards: usize, server: &ServerArg, code: &str) -> Vec<String> {
    let kinds = [
        v1::ParticipantKind::Unspecified,
        v1::ParticipantKind::Agent,
        v1::ParticipantKind::Robot,
        v1::ParticipantKind::Model,
        v1::ParticipantKind::Human,
    ];
    let free = |kind: v1::ParticipantKind| {
        let free = room.seats.iter().filter(|seat| seat.name.is_empty());
        let free = free.filter(|seat| seat.reserved_for() == kind).count();
        match kind {
            v1::ParticipantKind::Robot => free.saturating_sub(wizards),
            _ => free,
        }
    };
    let there = format!("{} --code {code}", server.flags());
    let page = format!("{}/join/{code}", server.page());
    let steps = kinds.into_iter().filter_map(|kind| {
        let (whom, command) = match kind {
            v1::ParticipantKind::Unspecified => ("", format!("chefshat agent greedy {there}")),
            v1::ParticipantKind::Agent => (" for agents", format!("chefshat agent greedy {there}")),
            v1::ParticipantKind::Robot => {
                let command = format!("chefshat agent greedy {there} --kind-of robot");
                (" for robots", command)
            }
            v1::ParticipantKind::Model => {
                let command = format!("chefshat agent llm {there} --endpoint URL --model NAME");
                (" for language models", command)
            }
            v1::ParticipantKind::Human => {
                let command = format!("chefshat play {there}, or in a browser at {page}");
                (" for people", command)
            }
        };
        match free(kind) {
            0 => None,
            1 => Some(format!("1 seat is free{whom}; fill it with: {command}")),
            free => Some(format!(
                "{free} seats are free{whom}; fill each with: {command}"
            )),
        }
    });
    let page = format!("{page}?as=robot");
    let as_robot = (wizards > 0).then(|| match wizards {
        1 => format!("1 seat is for a person who plays as a robot; join it at {page}"),
        seats => format!("{seats} seats are for people who play as robots; join each at {page}"),
    });
    steps.chain(as_robot).collect()
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use crate::room::create::*;

    #[derive(Parser)]
    struct Only {
        #[command(flatten)]
        create: Create,
    }

    fn request(flags: &str) -> Result<v1::CreateRoomRequest, CommandError> {
        let words = std::iter::once("test").chain(flags.split_whitespace());
        let create = Only::try_parse_from(words)
            .expect("the flags are known")
            .create;
        let players = create.rules()?.map_or(4, |rules| rules.players());
        create.request(create.start.message()?, players)
    }

    #[test]
    fn seats_not_listed_are_open() {
        let request = request("--seat greedy --seat human").expect("a room");
        let seats: Vec<FilledBy> = request
            .seats
            .into_iter()
            .filter_map(|seat| seat.filled_by)
            .collect();
        let open = FilledBy::ReservedFor(0);
        let human = FilledBy::ReservedFor(v1::ParticipantKind::Human.into());
        assert_eq!(
            seats,
            [
                FilledBy::BuiltInAgent("greedy".into()),
                human,
                open.clone(),
                open
            ]
        );
    }

    #[test]
    fn a_seat_can_imitate_a_recorded_player() {
        let request = request("--seat replay:5f0c6a4d:3").expect("a room");
        let replay = FilledBy::Replay(v1::RecordedPlayer {
            game_id: "5f0c6a4d".into(),
            seat: 3,
        });
        assert_eq!(request.seats[0].filled_by, Some(replay));
        for word in [
            "replay",
            "replay:5f0c6a4d",
            "replay:5f0c6a4d:x",
            "ada",
            "human=Ada",
            "greedy=",
        ] {
            assert!(seat(word).is_err(), "{word}");
        }
    }

    #[test]
    fn a_built_in_agent_may_have_another_name() {
        let request = request("--seat greedy=Greta --seat random").expect("a room");
        let names: Vec<&str> = request.seats.iter().map(|seat| &*seat.name).collect();
        assert_eq!(names, ["Greta", "", "", ""]);
        let greedy = FilledBy::BuiltInAgent("greedy".into());
        assert_eq!(request.seats[0].filled_by, Some(greedy));
    }

    #[test]
    fn a_player_at_the_table_has_a_name() {
        let request =
            request("--physical --seat table=Ada --seat table_robot=Pepper").expect("a room");
        assert!(request.physical);
        let names: Vec<&str> = request.seats.iter().map(|seat| &*seat.name).collect();
        assert_eq!(names, ["Ada", "Pepper", "", ""]);
        let kinds = [v1::ParticipantKind::Human, v1::ParticipantKind::Robot];
        for (seat, kind) in request.seats.iter().zip(kinds) {
            assert_eq!(seat.filled_by, Some(FilledBy::AtTable(kind.into())));
        }
        assert!(seat("table").is_err());
    }

    #[test]
    fn only_a_physical_room_has_seats_at_a_table() {
        let error = request("--seat table=Ada").expect_err("the cards are not real");
        assert!(error.to_string().contains("--physical"), "{error}");
    }

    #[test]
    fn the_attendants_link_opens_the_page() {
        assert_eq!(
            attendant_link("http://[::1]:7", "5f", "ab"),
            "http://[::1]:7/rooms/5f/table#ticket=ab"
        );
    }

    #[test]
    fn a_branch_takes_its_rules_from_the_record() {
        let branch = request("--branch 5f0c6a4d@7 --seat greedy").expect("a room");
        assert_eq!(branch.rules, None);
        assert_eq!(branch.seats.len(), 4);
        let Some(Start::Branch(point)) = branch.start else {
            panic!("a branch begins with a point");
        };
        assert_eq!((&*point.game_id, point.decisions), ("5f0c6a4d", 7));
        assert!(request("--branch 5f0c6a4d@7 --faces 9").is_err());
    }

    #[test]
    fn too_many_seats_are_refused() {
        let error = request("--players 2 --seat open --seat open --seat open")
            .expect_err("three seats for two");
        assert!(error.to_string().contains("3 seats"), "{error}");
    }

    #[test]
    fn free_seats_come_with_the_command_that_fills_them() {
        let seat = |name: &str, kind: v1::ParticipantKind| v1::Participant {
            name: name.into(),
            reserved_for: kind.into(),
            ..v1::Participant::default()
        };
        let words = |wizards, seats: Vec<v1::Participant>| {
            let room = v1::Room {
                seats,
                ..v1::Room::default()
            };
            let ca = Some(PathBuf::from("ca.pem"));
            let server = ServerArg::new("http://[::1]:7/".to_owned(), None, ca);
            next_steps(&room, wizards, &server, "BCDF2345")
        };
        let any = v1::ParticipantKind::Unspecified;
        let (human, robot) = (v1::ParticipantKind::Human, v1::ParticipantKind::Robot);
        assert!(words(0, vec![seat("Ada", any)]).is_empty());
        let there = "--server http://[::1]:7/ --ca ca.pem --code BCDF2345";
        let page = "http://[::1]:7/join/BCDF2345";
        let people = format!("chefshat play {there}, or in a browser at {page}");
        assert_eq!(
            words(0, vec![seat("Ada", any), seat("", human)]),
            [format!("1 seat is free for people; fill it with: {people}")]
        );
        assert_eq!(
            words(0, vec![seat("", any), seat("", any)]),
            [format!(
                "2 seats are free; fill each with: chefshat agent greedy {there}"
            )]
        );
        // Each command is for seats that admit its kind.
        let all = [robot, human, human, human].map(|kind| seat("", kind));
        assert_eq!(
            words(0, all.to_vec()),
            [
                format!(
                    "1 seat is free for robots; fill it with: chefshat agent greedy {there} --kind-of robot"
                ),
                format!("3 seats are free for people; fill each with: {people}"),
            ]
        );
        let as_robot =
            format!("1 seat is for a person who plays as a robot; join it at {page}?as=robot");
        assert_eq!(
            words(1, vec![seat("Ada", any), seat("", robot)]),
            [as_robot]
        );
    }

    #[test]
    fn several_seats_may_be_filled_at_once() {
        let request = request("--seat robot --seat human*3").expect("a room");
        let kinds = [
            v1::ParticipantKind::Robot,
            v1::ParticipantKind::Human,
            v1::ParticipantKind::Human,
            v1::ParticipantKind::Human,
        ];
        assert_eq!(request.seats.len(), 4);
        for (seat, kind) in request.seats.iter().zip(kinds) {
            assert_eq!(seat.filled_by, Some(FilledBy::ReservedFor(kind.into())));
        }
        for word in ["human*", "human*0", "human*x", "*3"] {
            assert!(seats(word).is_err(), "{word}");
        }
        // A name may contain an asterisk.
        for (word, name, count) in [("greedy=A*B", "A*B", 1), ("greedy=A*B*2", "A*B", 2)] {
            let filled = seats(word).expect(word);
            assert_eq!((&*filled.seat.name, filled.count), (name, count));
        }
    }

    #[test]
    fn a_person_plays_as_a_robot() {
        let asked = request("--seat wizard").expect("a room");
        let robot = v1::ParticipantKind::Robot.into();
        assert_eq!(asked.seats[0].filled_by, Some(FilledBy::Wizard(robot)));
        assert!(Only::try_parse_from(["test", "--seat", "wizard=Robbie"]).is_err());
    }
}
