//! The games of participants and their rooms: a due game is assigned a room, which is created once
//! that is committed, and its outcome counts: as the room says, or, if the server was restarted in
//! between, as the store has it. The core decides which game comes next.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use chefshat_engine::Seat;
use chefshat_study::{Outcome, Participant, PlayedGame, Status};

use super::task::StudyTask;
use crate::room::GameEnd;
use crate::rooms::{NewRoom, PartOf, Seating};
use chefshat_base::tasks::short;
use chefshat_room::ids::{GameId, RoomId};
use chefshat_room::journal::{Change, Fill, GameStart, SeatedParticipant, StudyGame, StudyMember};
use chefshat_room::policy::Policy;
use chefshat_store::{StoreError, StoredGame};
use chefshat_wire::convert::{self, PARTICIPANT_KIND};

impl StudyTask {
    /// Assigns rooms to the games of participants who are there and have none.
    pub(super) fn place_due_games(&mut self) {
        for number in std::mem::take(&mut self.touched) {
            if !self.unit.state.is_connected(number) {
                continue;
            }
            let (room, game) = (RoomId::random(), GameId::random());
            for change in self.unit.state.place(number, *room.bytes(), *game.bytes()) {
                self.fold(change);
            }
        }
        // Placing a game touches its participant, for whom nothing is due then.
        self.touched.clear();
    }

    /// Counts games that have ended. A game ends for all who play it at once.
    pub(super) async fn count_ended_games(&mut self) -> Result<(), StoreError> {
        let mut games: BTreeMap<[u8; 16], (PlayedGame, Vec<u32>)> = BTreeMap::new();
        for number in &self.playing {
            let participant = self.unit.state.participant(*number);
            if let Some(game) = participant.and_then(|it| it.games.last()) {
                let entry = games.entry(game.placed.game);
                let (_, players) = entry.or_insert_with(|| (game.clone(), Vec::new()));
                players.push(*number);
            }
        }
        for (game, players) in games.into_values() {
            let is_played = players.iter().any(|number| self.is_active(*number));
            if players
                .iter()
                .any(|number| self.without_room.contains(number))
            {
                if !is_played {
                    self.end_games(&players, &game, Outcome::Aborted);
                }
                continue;
            }
            let room = convert::room_of(&game.placed);
            if self.unit.rooms.is_unfinished(room) {
                continue;
            }
            match self.outcome(&game).await? {
                Some(outcome) => self.end_games(&players, &game, outcome),
                // The server ended before the room was created.
                None if is_played => self.without_room.extend(players),
                None => self.end_games(&players, &game, Outcome::Aborted),
            }
        }
        Ok(())
    }

    fn end_games(&mut self, players: &[u32], game: &PlayedGame, outcome: Outcome) {
        for number in players {
            self.end_game(*number, game, outcome);
        }
    }

    fn end_game(&mut self, number: u32, game: &PlayedGame, outcome: Outcome) {
        let id = game.placed.game;
        if let Some(change) = (self.unit.state).game_ended(number, id, outcome, (self.now)()) {
            self.fold(change);
        }
        let room = convert::room_of(&game.placed);
        self.closing.remove(&room);
        self.retired.remove(&(room, number));
    }

    /// The outcome of a game whose room is over or gone; `None` if it has no room yet.
    async fn outcome(&self, game: &PlayedGame) -> Result<Option<Outcome>, StoreError> {
        match self.unit.rooms.end_of(convert::room_of(&game.placed)) {
            Some(GameEnd::Finished(_)) => return Ok(Some(Outcome::Finished)),
            Some(GameEnd::Aborted(_) | GameEnd::NotDealt) => return Ok(Some(Outcome::Aborted)),
            Some(GameEnd::Failed) | None => {}
        }
        let read = |stored| match stored {
            StoredGame::Hosted(_, entries, _) => {
                let is_abort = |change: &Change| matches!(change, Change::Aborted(_));
                let was_aborted = entries.iter().any(|it| is_abort(&it.change));
                Some(match was_aborted {
                    true => Outcome::Aborted,
                    false => Outcome::Finished,
                })
            }
            _ => None,
        };
        let id = convert::game_of(&game.placed);
        let found = self.unit.read_record(id, Outcome::Aborted, read).await?;
        if found.is_some() {
            return Ok(found);
        }
        // A game that was aborted before it began has no record.
        let had_room = self
            .unit
            .rooms
            .get(convert::room_of(&game.placed))
            .is_some();
        Ok(had_room.then_some(Outcome::Aborted))
    }

    /// Creates the rooms of placed games.
    pub(super) async fn make_rooms(&mut self) -> Result<(), StoreError> {
        // What waited for a room may have ended without one.
        if !self.unit.retry.take(!self.without_room.is_empty()) {
            return Ok(());
        }
        let without_room = self.without_room.iter().copied();
        let wanted = without_room.filter_map(|number| Some((number, self.new_room(number)?)));
        let wanted = wanted.collect();
        let rooms = self.unit.create_rooms(wanted).await?;
        for number in rooms.created {
            self.without_room.remove(&number);
            self.unit.handle.notify_participant(number);
        }
        // The game was aborted before it began, and then the server was restarted; or its id is taken by
        // another one.
        for number in rooms.taken {
            let participant = self.unit.state.participant(number);
            if let Some(game) = participant.and_then(|it| it.games.last()).cloned() {
                self.end_game(number, &game, Outcome::Aborted);
            }
        }
        Ok(())
    }

    /// Closes the rooms of participants who have left, or gives up their seats where others play on.
    pub(super) fn close_rooms(&mut self) {
        for number in &self.playing {
            let participant = self.unit.state.participant(*number);
            let left = participant.filter(|it| it.status != Status::Active);
            let Some(game) = left.and_then(|it| it.games.last()) else {
                continue;
            };
            let (room, seat) = (convert::room_of(&game.placed), Seat::new(game.placed.seat));
            let Some(handle) = self.unit.rooms.get(room) else {
                continue;
            };
            if self.unit.state.plays_with_others(*number) {
                if self.retired.insert((room, *number)) {
                    let retiring = async move { handle.retire(seat).await };
                    tokio::spawn(short("one message", retiring));
                }
            } else if self.closing.insert(room) {
                let closing = async move { handle.close_without_token().await };
                tokio::spawn(short("one message", closing));
            }
        }
    }

    /// The settings of the room of a participant's game.
    fn new_room(&self, number: u32) -> Option<NewRoom> {
        let participant = self.unit.state.participant(number)?;
        let placed = &participant.games.last()?.placed;
        let settings = self.unit.state.settings();
        let condition = &settings.conditions[placed.condition];
        let plan = &self.unit.handle.plan.conditions[placed.condition];
        let small = |number: usize| u32::try_from(number).unwrap_or(u32::MAX);
        let room = convert::room_of(placed);
        let players = self.unit.state.players_of(number).into_iter();
        let players = players.filter_map(|it| Some((it, self.unit.state.participant(it)?)));
        let players: Vec<_> = players.collect();
        let seat_of = |player: &Participant| player.games.last().map_or(0, |it| it.placed.seat);
        let seats_of_group = self.unit.state.seats_of_group(participant, placed);
        // The other seats make room for those of the participants.
        let (mut fills, mut others) = (Vec::new(), Vec::new());
        let mut fills_of_others = plan.fills.iter();
        for seat in 0..condition.players {
            fills.push(if players.iter().any(|(_, it)| seat_of(it) == seat) {
                Fill::Open {
                    reserved_for: Some(PARTICIPANT_KIND),
                }
            } else if !seats_of_group.contains(&seat)
                && let Some(fill) = fills_of_others.next()
            {
                others.push(seat);
                *fill
            } else {
                // Somebody of the group is missing.
                Fill::BuiltIn(plan.policy.substitute)
            });
        }
        let names = plan.names.iter();
        let display_names =
            names.filter_map(|(index, name)| Some((*others.get(*index)?, name.clone())));
        let seated = players.iter().map(|(number, it)| {
            let participant = SeatedParticipant {
                name: it.pseudonym.clone(),
                name_fingerprint: String::new(),
                kind: PARTICIPANT_KIND,
                ticket: self.unit.handle.ticket_of(room, *number).hash(),
            };
            (seat_of(it), participant)
        });
        let members = players.iter().map(|(number, it)| StudyMember {
            number: *number,
            participant: it.pseudonym.clone(),
            session: it.session,
            seat: Seat::new(seat_of(it)),
        });
        let seeds = match condition.seeds.is_empty() {
            true => &settings.seeds,
            false => &condition.seeds,
        };
        Some(NewRoom {
            // What everybody with a seat sees: it must not name the condition.
            name: settings
                .title
                .chars()
                .take(convert::MAX_NAME_CHARS)
                .collect(),
            rules: match placed.practice {
                true => plan.practice_rules,
                false => plan.rules,
            },
            policy: match (settings.groups, placed.practice) {
                // Others do not wait longer for one who does not come.
                (Some(groups), false) => Policy {
                    waiting_time: plan
                        .policy
                        .waiting_time
                        .min(Duration::from_millis(groups.wait_ms)),
                    ..plan.policy.clone()
                },
                _ => plan.policy.clone(),
            },
            fills,
            display_names: display_names.collect(),
            recorded: BTreeMap::new(),
            wizards: (plan.wizards.iter())
                .filter_map(|index| others.get(*index).copied())
                .collect(),
            start: GameStart::default(),
            game_seed: placed.seed_index.map(|index| seeds[index]),
            physical: false,
            request: None,
            charged: self.unit.handle.charged,
            creator: None,
            seating: Some(Seating {
                part_of: PartOf::Study(Arc::new(StudyGame {
                    study: self.unit.handle.id(),
                    name: self.unit.handle.plan.name.clone(),
                    condition: condition.id.clone(),
                    levels: condition.levels.clone(),
                    members: members.collect(),
                    group: participant.group.filter(|_| !placed.practice),
                    step: small(placed.step),
                    practice: placed.practice,
                    seed_index: placed.seed_index.map(small),
                    attempt: placed.attempt,
                    labels: plan.labels,
                })),
                owner: self.unit.handle.room_owner(room),
                game_id: convert::game_of(placed),
                participants: seated.collect(),
                server_seed: None,
            }),
        })
    }
}
