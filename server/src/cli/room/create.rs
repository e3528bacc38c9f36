//! `chefshat room create`: a room as the flags describe it, and the secrets it comes with.

use std::fs::File;
use std::io::{self, Write as _};
use std::os::unix::fs::OpenOptionsExt as _;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use chefshat_arena::AgentKind;
use chefshat_client::v1::{self, seat_config::FilledBy};
use chefshat_engine::RewardScheme;
use chefshat_records::convert::reward_scheme_to_proto;
use clap::Args;
use clap::builder::PossibleValuesParser;

use super::super::connect::{ServerArg, free_seats};
use super::super::rules_args::{RulesArgs, by_flag};
use super::super::{CommandError, say};

/// Names of the reward schemes, in the order of the protocol's numbers from 1.
const REWARDS: [&str; 5] = ["validity", "paper", "paper_intended", "winning", "points"];

/// Make a room and say how to join it.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  chefshat room create --name friday --seat greedy --seat random\n  \
                  chefshat room create --preset rulebook --target-shifts 10 --decision-time-ms 60000\n  \
                  chefshat room create --code-file ./join-code"
)]
pub(super) struct Create {
    /// Name to show.
    #[arg(long, default_value = "")]
    name: String,
    #[command(flatten)]
    server: ServerArg,
    /// How the next seat is filled: random, random_unmasked or greedy (played by the server), or open, agent, human or robot (for whom
    /// it is free). Repeatable; seats not named are open.
    #[arg(long = "seat", value_name = "SEAT", value_parser = seat)]
    seats: Vec<FilledBy>,
    /// The game seed, 64 hexadecimal digits, for experiments; such a game has no seed commitment.
    #[arg(long, value_name = "HEX", value_parser = game_seed)]
    game_seed: Option<[u8; 32]>,
    /// Leave the join code in this file, readable to its owner alone; waits for the server if it is not there yet.
    #[arg(long, value_name = "FILE")]
    code_file: Option<PathBuf>,
    /// Print the room with its secrets as a JSON line.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    rules: RulesArgs,
    #[command(flatten)]
    policy: PolicyArgs,
}

/// Times and limits of a room.
#[derive(Debug, Args)]
#[command(next_help_heading = "Times and limits")]
struct PolicyArgs {
    /// Milliseconds for a decision; standard 10000.
    #[arg(long, value_name = "MS")]
    decision_time_ms: Option<u32>,
    /// Milliseconds each seat may use beyond that over the whole game; standard 60000.
    #[arg(long, value_name = "MS")]
    bank_ms: Option<u32>,
    /// Invalid attempts at one decision before the default is taken, 0 for no limit; standard 10.
    #[arg(long, value_name = "N")]
    max_invalid_attempts: Option<u32>,
    /// Decisions in a row lost to the clock before a seat is substituted; standard 3.
    #[arg(long, value_name = "N")]
    max_timeouts: Option<u32>,
    /// Milliseconds that the server's own agents wait before they decide; standard 0.
    #[arg(long, value_name = "MS")]
    pace_ms: Option<u32>,
    /// Milliseconds to wait for the seats to be filled; standard 3600000.
    #[arg(long, value_name = "MS")]
    waiting_time_ms: Option<u32>,
    /// Rewards told to the seats.
    #[arg(long, value_name = "SCHEME", value_parser = PossibleValuesParser::new(REWARDS))]
    reward: Option<String>,
    /// Decisions by which spectators are behind; standard 0.
    #[arg(long, value_name = "N")]
    spectator_delay: Option<u32>,
}

impl Create {
    pub(super) async fn run(self) -> Result<ExitCode, CommandError> {
        let request = self.request()?;
        let client = match &self.code_file {
            Some(_) => self.server.connect_patiently().await?,
            None => self.server.connect().await?,
        };
        // Before there is a room: whoever cannot be told its code has no use for it.
        let code_file = (self.code_file.as_deref())
            .map(CodeFile::prepare)
            .transpose()?;
        let made = client.create_room(request).await.map_err(refused)?;
        let room = made
            .room
            .ok_or("the server did not say which room it made")?;
        let left = code_file.map_or(Ok(()), |file| file.leave(&made.join_code));
        let (code, owner) = (made.join_code, made.owner_token);
        if self.json {
            let line = serde_json::json!({
                "event": "created", "room": room, "join_code": code, "owner_token": owner,
            });
            say(format_args!("{line}"))?;
        } else {
            say(format_args!("room         {}", room.room_id))?;
            say(format_args!("game         {}", room.game_id))?;
            say(format_args!("join code    {code}"))?;
            say(format_args!("owner token  {owner}"))?;
            if let Some(words) = next_step(&room, self.server.url(), &code) {
                say(words)?;
            }
        }
        // Only now, so that the secrets are told all the same.
        left?;
        Ok(ExitCode::SUCCESS)
    }

    fn request(&self) -> Result<v1::CreateRoomRequest, CommandError> {
        let players = self.rules.rules()?.players();
        if self.seats.len() > players {
            let described = self.seats.len();
            return Err(
                format!("--seat: {described} seats are described, but {players} play").into(),
            );
        }
        let open = FilledBy::ReservedFor(v1::ParticipantKind::Unspecified.into());
        let all = self.seats.iter().cloned().chain(std::iter::repeat(open));
        Ok(v1::CreateRoomRequest {
            name: self.name.clone(),
            rules: Some(self.rules.message()),
            seats: all
                .take(players)
                .map(|filled_by| v1::SeatConfig {
                    filled_by: Some(filled_by),
                })
                .collect(),
            policy: Some(self.policy.message()),
            game_seed: self.game_seed.map_or_else(Vec::new, |seed| seed.to_vec()),
        })
    }
}

impl PolicyArgs {
    fn message(&self) -> v1::RoomPolicy {
        let scheme = self.reward.as_deref().and_then(RewardScheme::from_name);
        v1::RoomPolicy {
            decision_time_ms: self.decision_time_ms,
            bank_ms: self.bank_ms,
            max_invalid_attempts: self.max_invalid_attempts,
            max_timeouts: self.max_timeouts,
            pace_ms: self.pace_ms,
            waiting_time_ms: self.waiting_time_ms,
            reward_scheme: reward_scheme_to_proto(scheme).into(),
            spectator_delay_decisions: self.spectator_delay,
            ..v1::RoomPolicy::default()
        }
    }
}

fn seat(word: &str) -> Result<FilledBy, String> {
    let reserved = match word {
        "open" => v1::ParticipantKind::Unspecified,
        "agent" => v1::ParticipantKind::Agent,
        "human" => v1::ParticipantKind::Human,
        "robot" => v1::ParticipantKind::Robot,
        _ => {
            return AgentKind::from_name(word)
                .map(|kind| FilledBy::BuiltInAgent(kind.name().to_owned()))
                .ok_or_else(|| {
                    let known = AgentKind::ALL.map(AgentKind::name).join(", ");
                    format!("use one of {known}, open, agent, human, robot")
                });
        }
    };
    Ok(FilledBy::ReservedFor(reserved.into()))
}

fn game_seed(digits: &str) -> Result<[u8; 32], String> {
    let mut seed = [0; 32];
    hex::decode_to_slice(digits, &mut seed)
        .map(|()| seed)
        .map_err(|_| "a game seed is 64 hexadecimal digits".to_owned())
}

/// A refusal of the server in the words of the command line.
fn refused(error: chefshat_client::Error) -> CommandError {
    match (error.reason(), error.metadata().get("field")) {
        (Some("RULE_SET_REFUSED" | "POLICY_REFUSED" | "NAME_REFUSED"), Some(field)) => {
            let message = error.message();
            let said = format!("{field}: ");
            by_flag(field, message.strip_prefix(&said).unwrap_or(message)).into()
        }
        _ => error.into(),
    }
}

/// How the seats that are free can be filled.
fn next_step(room: &v1::Room, server: &str, code: &str) -> Option<String> {
    let free = free_seats(room);
    let first = room.seats.iter().find(|seat| seat.name.is_empty())?;
    let kind = match first.reserved_for() {
        v1::ParticipantKind::Unspecified | v1::ParticipantKind::Agent => "",
        v1::ParticipantKind::Human => " --kind-of human",
        v1::ParticipantKind::Robot => " --kind-of robot",
    };
    let free = match free {
        1 => "1 seat is free; fill it with:".to_owned(),
        _ => format!("{free} seats are free; fill each with:"),
    };
    Some(format!(
        "{free} chefshat agent greedy --server {server} --code {code}{kind}"
    ))
}

/// A file that a join code is going to be left in: whole or not at all, and for its owner alone.
struct CodeFile<'a> {
    file: &'a Path,
    part: PathBuf,
    whole: File,
}

impl<'a> CodeFile<'a> {
    /// Begins it under another name, beside where it is to be.
    ///
    /// # Errors
    /// It cannot be written.
    fn prepare(file: &'a Path) -> Result<Self, CommandError> {
        let mut part = file.as_os_str().to_owned();
        part.push(".part");
        let part = PathBuf::from(part);
        let open = || {
            if file.is_dir() {
                return Err(io::ErrorKind::IsADirectory.into());
            }
            // One left behind by a process that was stopped may have been made otherwise.
            match std::fs::remove_file(&part) {
                Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
                _ => {}
            }
            let mut options = File::options();
            options.write(true).create_new(true).mode(0o600).open(&part)
        };
        match open() {
            Ok(whole) => Ok(Self { file, part, whole }),
            Err(error) => {
                let file = file.display();
                Err(format!(
                    "--code-file: a join code cannot be left in {file}: {error}; no room was made"
                )
                .into())
            }
        }
    }

    /// Leaves the code.
    fn leave(mut self, code: &str) -> Result<(), CommandError> {
        writeln!(self.whole, "{code}")
            .and_then(|()| std::fs::rename(&self.part, self.file))
            .map_err(|error| {
                format!(
                    "the room was made, but its join code cannot be left in {}: {error}",
                    self.file.display()
                )
                .into()
            })
    }
}

impl Drop for CodeFile<'_> {
    fn drop(&mut self) {
        // Nothing is there any more once the code was left.
        let _ = std::fs::remove_file(&self.part);
    }
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;

    #[derive(Parser)]
    struct Only {
        #[command(flatten)]
        create: Create,
    }

    fn request(flags: &str) -> Result<v1::CreateRoomRequest, CommandError> {
        let words = std::iter::once("test").chain(flags.split_whitespace());
        let only = Only::try_parse_from(words).expect("the flags are known");
        only.create.request()
    }

    #[test]
    fn seats_not_named_are_open() {
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
    fn too_many_seats_are_refused() {
        let error = request("--players 2 --seat open --seat open --seat open")
            .expect_err("three seats for two");
        assert!(error.to_string().contains("3 seats"), "{error}");
    }

    #[test]
    fn every_reward_has_its_scheme() {
        for name in REWARDS {
            let policy = request(&format!("--reward {name}"))
                .expect("a room")
                .policy
                .expect("a policy");
            let wire = policy.reward_scheme().as_str_name();
            assert_eq!(wire, format!("REWARD_SCHEME_{}", name.to_uppercase()));
        }
    }

    #[test]
    fn a_code_is_left_for_its_owner_alone() {
        use std::os::unix::fs::PermissionsExt as _;
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("code");
        for code in ["BCDF2345", "BCDF2346"] {
            let prepared = CodeFile::prepare(&file).expect("it can be written");
            prepared.leave(code).expect("written");
        }
        assert_eq!(std::fs::read_to_string(&file).expect("read"), "BCDF2346\n");
        let mode = std::fs::metadata(&file)
            .expect("it is there")
            .permissions()
            .mode();
        assert_eq!(mode & 0o777, 0o600);
    }

    #[test]
    fn a_file_that_gets_no_code_leaves_nothing_behind() {
        let folder = tempfile::tempdir().expect("a folder");
        drop(CodeFile::prepare(&folder.path().join("code")).expect("it can be written"));
        let left = std::fs::read_dir(folder.path())
            .expect("the folder")
            .count();
        assert_eq!(left, 0);
        assert!(CodeFile::prepare(folder.path()).is_err(), "a folder");
    }

    #[test]
    fn free_seats_come_with_the_line_that_fills_them() {
        let seat = |name: &str, kind: v1::ParticipantKind| v1::Participant {
            name: name.into(),
            reserved_for: kind.into(),
            ..v1::Participant::default()
        };
        let words = |seats: Vec<v1::Participant>| {
            let room = v1::Room {
                seats,
                ..v1::Room::default()
            };
            next_step(&room, "http://[::1]:7", "BCDF2345")
        };
        let (any, human) = (v1::ParticipantKind::Unspecified, v1::ParticipantKind::Human);
        assert_eq!(words(vec![seat("Ada", any)]), None);
        assert_eq!(
            words(vec![seat("Ada", any), seat("", human)]).as_deref(),
            Some(
                "1 seat is free; fill it with: \
                 chefshat agent greedy --server http://[::1]:7 --code BCDF2345 --kind-of human"
            )
        );
        let two = words(vec![seat("", any), seat("", any)]).expect("two are free");
        assert!(two.starts_with("2 seats are free;"), "{two}");
    }
}
