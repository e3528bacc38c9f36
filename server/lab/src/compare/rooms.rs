//! The games of a comparison in which a command plays: each in a room of a server, with the seeds that
//! it has in this process. Agents of this process take their seats as clients.

use std::pin::pin;
use std::process::ExitStatus;
use std::time::Duration;

use chefshat_cli::error::CommandError;
use chefshat_cli::progress;
use chefshat_cli::remote::RemoteAgent;
use chefshat_client::{PlayError, PlayOptions};
use chefshat_engine::Seat;
use chefshat_examiner::{AgentCommand, AgentProcess};
use chefshat_proto::v1::{self, game_event::Kind, record_line::Line};
use chefshat_record::convert::{plain_policy, rules_to_proto};
use chefshat_simulation::{Comparison, Contender, Duplicate, Tally};
use futures::stream::FuturesUnordered;
use futures::{StreamExt as _, TryStreamExt as _, stream};
use tokio::io::AsyncWriteExt as _;
use tokio::process::ChildStdin;
use tokio::sync::{Mutex, watch};
use tokio::time::{sleep, timeout};
use tokio_util::task::TaskTracker;

use crate::agent_host::{AgentHost, END, EXIT, exited, explained, game_line, patience, record};
use crate::open_room::OpenRoom;

/// Time for a decision, in milliseconds: generous, because other games may slow it down.
const DECISION_MS: u32 = 300_000;
/// Time for all agents to take their seats, in milliseconds.
const WAITING_MS: u32 = 600_000;

/// Who plays the seats of A, or of B.
pub(super) enum Player {
    /// An agent of this process.
    Here(Contender),
    /// A program, and its name in the rooms.
    Program(AgentCommand, String),
}

/// Plays all games, `parallel` at a time. The rooms of games that do not end are closed by tasks of
/// `closing`. Wait for them after the future was dropped.
///
/// # Errors
/// The server does not answer, or an agent did not play a game by itself to its end.
pub(super) async fn run(
    duplicate: &Duplicate,
    players: &[Player; 2],
    server: Option<&str>,
    parallel: usize,
    closing: &TaskTracker,
) -> Result<Comparison, CommandError> {
    let host = AgentHost::open(server).await?;
    let played = played(duplicate, players, &host, parallel, closing).await;
    closing.close();
    closing.wait().await;
    let games = played?;
    host.close().await?;
    let seatings = duplicate.seatings().len();
    Ok(duplicate.total(|deal| {
        let first = deal as usize * seatings;
        games[first..first + seatings].to_vec()
    }))
}

/// What was reached in each game, deal by deal and seating by seating.
async fn played(
    duplicate: &Duplicate,
    players: &[Player; 2],
    host: &AgentHost,
    parallel: usize,
    closing: &TaskTracker,
) -> Result<Vec<Tally>, CommandError> {
    let mut processes = Vec::new();
    let mut readers = [Vec::new(), Vec::new()];
    for (whose, player) in players.iter().enumerate() {
        let Player::Program(command, name) = player else {
            continue;
        };
        for _ in 0..most_seats(duplicate, whose) {
            if command.reads_games() {
                let mut process = host.start(command, name, String::new()).await?;
                readers[whose].extend(process.games().map(Mutex::new));
                processes.push(process);
            }
        }
    }
    let rooms = Rooms {
        duplicate,
        players,
        host,
        closing,
        readers,
    };
    let played = tokio::select! {
        played = rooms.play(parallel) => played,
        (index, error) = first_exit(&mut processes) => {
            return Err(explained(error, processes.swap_remove(index)).await);
        }
    };
    if let Err(error) = played {
        // Games fail when an agent that reads them has exited: then that is what to say.
        if !processes.is_empty()
            && let Ok((index, error)) = timeout(END, first_exit(&mut processes)).await
        {
            return Err(explained(error, processes.swap_remove(index)).await);
        }
        return Err(error);
    }
    // They read no more games, and exit.
    drop(rooms);
    let_exit(&mut processes).await;
    played
}

/// The most seats that A (0) or B (1) has in a game.
fn most_seats(duplicate: &Duplicate, whose: usize) -> usize {
    let players = duplicate.rules().players();
    let seats = duplicate.seatings().iter().map(|seating| match whose {
        0 => seating.a_seats(),
        _ => players - seating.a_seats(),
    });
    seats.max().unwrap_or(0)
}

/// Waits until processes have exited after their last game. Those that take too long are killed when they
/// are dropped.
async fn let_exit(processes: &mut [AgentProcess]) {
    let exits = stream::iter(processes).for_each_concurrent(None, async |process| {
        let _exited = process.ended().await;
    });
    let _exited = timeout(EXIT, exits).await;
}

/// Waits until one of these processes has exited, for ever if there is none. Returns its index and
/// what to say. Cancel safe.
async fn first_exit(processes: &mut [AgentProcess]) -> (usize, CommandError) {
    let (index, status) = first_status(processes).await;
    (index, status.map_or_else(Into::into, exited))
}

async fn first_status(processes: &mut [AgentProcess]) -> (usize, std::io::Result<ExitStatus>) {
    let mut exits: FuturesUnordered<_> = (processes.iter_mut().enumerate())
        .map(async |(index, process)| (index, process.ended().await))
        .collect();
    match exits.next().await {
        Some(exit) => exit,
        None => std::future::pending().await,
    }
}

/// The rooms of a comparison.
struct Rooms<'a> {
    duplicate: &'a Duplicate,
    players: &'a [Player; 2],
    host: &'a AgentHost,
    closing: &'a TaskTracker,
    /// Of A and B, the programs that read which games to play, one for each seat.
    readers: [Vec<Mutex<ChildStdin>>; 2],
}

/// A program's seat in a game.
struct ProgramSeat<'a> {
    seat: Seat,
    command: &'a AgentCommand,
    name: &'a str,
    /// Where its process reads which games to play.
    reads: Option<&'a Mutex<ChildStdin>>,
}

impl Rooms<'_> {
    async fn play(&self, parallel: usize) -> Result<Vec<Tally>, CommandError> {
        let (deals, seatings) = (self.duplicate.deals(), self.duplicate.seatings().len());
        let bar = progress::of_items(deals * seatings as u64, "games");
        let games = (0..deals).flat_map(|deal| (0..seatings).map(move |seating| (deal, seating)));
        let games = stream::iter(games).map(async |(deal, seating)| {
            let played = self.game(deal, seating).await;
            bar.inc(1);
            played.map_err(|error| {
                let seed = hex::encode(self.duplicate.game_seed(deal).0);
                CommandError::from(format!(
                    "deal {deal}, seating {seating} (game seed {seed}): {error}"
                ))
            })
        });
        let games = games.buffered(parallel).try_collect().await?;
        bar.finish_and_clear();
        Ok(games)
    }

    /// Plays a deal in a seating.
    async fn game(&self, deal: u64, seating: usize) -> Result<Tally, CommandError> {
        let request = self.request(deal, seating);
        let (created, open) = OpenRoom::create(&self.host.client, self.closing, request).await?;
        let room = created.room.unwrap_or_default();
        // Programs take the first free seat: first the agents of this process have theirs, and then one
        // program after the other.
        let agents = self.join(&created.join_code, deal, seating).await?;
        let mut processes = Vec::new();
        tokio::try_join!(
            self.until_over(&room.room_id, &created.join_code, seating, &mut processes),
            self.play_here(agents),
        )?;
        open.leave_open();
        let_exit(&mut processes).await;
        let lines = record(&self.host.client, &room.game_id).await?;
        self.tally(seating, &lines)
    }

    fn request(&self, deal: u64, seating: usize) -> v1::CreateRoomRequest {
        let rules = self.duplicate.rules();
        let open = v1::SeatConfig {
            filled_by: Some(v1::seat_config::FilledBy::ReservedFor(
                v1::ParticipantKind::Unspecified.into(),
            )),
            name: String::new(),
        };
        v1::CreateRoomRequest {
            name: format!("deal {deal}, seating {seating}"),
            rules: Some(rules_to_proto(rules)),
            seats: vec![open; rules.players()],
            policy: Some(v1::RoomPolicy {
                decision_time_ms: Some(DECISION_MS),
                bank_ms: Some(0),
                max_timeouts: Some(1),
                abort: v1::AbortPolicy::Never.into(),
                waiting_time_ms: Some(WAITING_MS),
                // A server without a store keeps them in memory.
                durability: v1::Durability::Unspecified.into(),
                ..plain_policy()
            }),
            game_seed: self.duplicate.game_seed(deal).0.to_vec(),
            ..v1::CreateRoomRequest::default()
        }
    }

    /// Who plays each seat of a seating: A (0) or B (1), from the first seat on.
    fn seats(&self, seating: usize) -> impl Iterator<Item = (Seat, usize)> {
        let seats = self.duplicate.seatings()[seating];
        let players = self.duplicate.rules().players();
        (0..players).map(move |index| {
            let seat = Seat::new(index);
            (seat, usize::from(!seats.is_a(seat)))
        })
    }

    /// Takes the seats of the agents of this process. Returns their tickets.
    async fn join(
        &self,
        code: &str,
        deal: u64,
        seating: usize,
    ) -> Result<Vec<(String, RemoteAgent)>, CommandError> {
        let mut agents = Vec::new();
        for (seat, whose) in self.seats(seating) {
            let Player::Here(contender) = &self.players[whose] else {
                continue;
            };
            let request = v1::JoinRoomRequest {
                join_code: code.to_owned(),
                name: ["A", "B"][whose].to_owned(),
                seat: Some(seat.index() as u32),
                ..v1::JoinRoomRequest::default()
            };
            let joined = self.host.client.join(request).await?;
            let agent = self.duplicate.agent(contender, deal, seating, seat);
            agents.push((joined.ticket, RemoteAgent::new(agent, Duration::ZERO)));
        }
        Ok(agents)
    }

    /// Lets the agents of this process play.
    async fn play_here(&self, agents: Vec<(String, RemoteAgent)>) -> Result<(), CommandError> {
        if agents.is_empty() {
            return Ok(());
        }
        let options = PlayOptions::default();
        let outcomes = self.host.client.play_many_with(agents, &options).await;
        let outcomes = outcomes.into_iter().collect::<Result<Vec<_>, PlayError>>();
        outcomes.map(drop).map_err(Into::into)
    }

    /// Lets the programs play in a room, until its game is over. Leaves the processes that were started
    /// for it in `processes`.
    async fn until_over(
        &self,
        room_id: &str,
        code: &str,
        seating: usize,
        processes: &mut Vec<AgentProcess>,
    ) -> Result<(), CommandError> {
        let (seated, is_seated) = watch::channel(0);
        let failed = tokio::select! {
            over = self.follow(room_id, &seated) => return over,
            failed = self.start_programs(code, seating, is_seated, processes) => failed,
        };
        let (index, error) = match failed {
            Err(error) => return Err(error),
            Ok(exit) => exit,
        };
        Err(explained(error, processes.swap_remove(index)).await)
    }

    /// Follows the game to its end. Notes who has a seat, in a set of bits.
    async fn follow(&self, room_id: &str, seated: &watch::Sender<u32>) -> Result<(), CommandError> {
        let mut spectator = self.host.client.spectate(room_id, 0);
        while let Some(event) = spectator.next().await? {
            match event.kind {
                Some(Kind::Seated(taken)) => {
                    seated.send_modify(|seats| *seats |= 1u32.unbounded_shl(taken.seat));
                }
                Some(Kind::Substituted(v1::Substituted { seat, .. })) => {
                    return Err(format!("the agent on seat {seat} did not decide in time").into());
                }
                Some(Kind::GameAborted(aborted)) => {
                    let reason = aborted.reason().as_str_name();
                    return Err(format!("the game was aborted: {reason}").into());
                }
                Some(Kind::GameEnded(_)) => return Ok(()),
                _ => {}
            }
        }
        Err("the server has removed the room".into())
    }

    /// Lets one program after the other take its seat. Then waits until a process that was started for
    /// this game has exited, and the game has not ended soon: returns its index, and what to say.
    async fn start_programs(
        &self,
        code: &str,
        seating: usize,
        mut seated: watch::Receiver<u32>,
        processes: &mut Vec<AgentProcess>,
    ) -> Result<(usize, CommandError), CommandError> {
        for program in self.programs(seating) {
            match program.reads {
                Some(reads) => {
                    let line = game_line(&self.host.address, code, program.name);
                    let written = reads.lock().await.write_all(line.as_bytes()).await;
                    written.map_err(|error| format!("the agent reads no more games: {error}"))?;
                }
                None => {
                    let code = code.to_owned();
                    let started = self.host.start(program.command, program.name, code);
                    processes.push(started.await?);
                }
            }
            let seat = 1 << program.seat.index();
            let mut taken = pin!(seated.wait_for(|seats| seats & seat != 0));
            tokio::select! {
                _taken = &mut taken => {}
                (index, error) = late_exit(processes) => return Ok((index, error)),
            }
        }
        Ok(late_exit(processes).await)
    }

    /// The programs of a seating, by seat.
    fn programs(&self, seating: usize) -> Vec<ProgramSeat<'_>> {
        let mut seats_of = [0; 2];
        let seats = self.seats(seating).filter_map(|(seat, whose)| {
            let Player::Program(command, name) = &self.players[whose] else {
                return None;
            };
            let reads = self.readers[whose].get(seats_of[whose]);
            seats_of[whose] += 1;
            Some(ProgramSeat {
                seat,
                command,
                name,
                reads,
            })
        });
        seats.collect()
    }

    /// What A and B reached in a game, by its record.
    fn tally(&self, seating: usize, lines: &[v1::RecordLine]) -> Result<Tally, CommandError> {
        let seats = self.duplicate.seatings()[seating];
        let mut tally = Tally::default();
        for line in lines.iter().filter_map(|line| line.line.as_ref()) {
            match line {
                Line::Decision(decision) if decision.source() != v1::DecisionSource::Agent => {
                    let (seat, attempts) = (decision.seat, decision.invalid_attempts.len());
                    return Err(match decision.source() {
                        v1::DecisionSource::Invalid => format!(
                            "the agent on seat {seat} answered a decision with {attempts} illegal actions"
                        ),
                        _ => format!("the agent on seat {seat} did not decide in time"),
                    }
                    .into());
                }
                Line::Event(v1::GameEvent {
                    kind: Some(Kind::ShiftEnded(end)),
                    ..
                }) => {
                    for (place, seat) in (1..).zip(&end.order) {
                        let seat = *seat as usize;
                        let points = end.shift_points.get(seat).copied().unwrap_or_default();
                        tally.add(seats.is_a(Seat::new(seat)), points.into(), place);
                    }
                }
                _ => {}
            }
        }
        Ok(tally)
    }
}

/// [`first_exit`], and the time that the game then has to end.
async fn late_exit(processes: &mut [AgentProcess]) -> (usize, CommandError) {
    let (index, status) = first_status(processes).await;
    if let Ok(status) = &status {
        sleep(patience(*status)).await;
    }
    (index, status.map_or_else(Into::into, exited))
}
