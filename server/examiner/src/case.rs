//! The cases of an examination as data: the room or tournament of each, where the examiner
//! interferes, and what the agent must be faced with. `exam` judges them.

use std::time::Duration;

use chefshat_proto::v1::{self, create_room_request::Start, rule_set::Stop};

/// Time limits of an examination. Every wait for the agent uses one of them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Patience {
    /// For starting and taking a seat.
    pub start: Duration,
    /// For each other step: answering, reconnecting, leaving, exiting.
    pub each: Duration,
}

impl Patience {
    /// A case may take this multiple of [`Patience::each`] in total.
    const CASE: u32 = 120;

    /// For a complete case.
    pub fn case(&self) -> Duration {
        self.start + self.each * Self::CASE
    }
}

/// An interference of the examiner. They happen one after the other, each at a turn with a choice.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Interference {
    /// An answer is replaced by an illegal one on its way to the server, so that it is refused as
    /// INVALID.
    Refuse,
    /// The connection is cut when an answer arrives; the server never receives the answer.
    CutBeforeAnswer,
    /// The connection is cut after an answer has been accepted, before the agent receives the
    /// result.
    CutBeforeResult,
    /// The connection is cut in place of a request.
    CutBeforeRequest,
    /// An answer is held back until its decision has timed out.
    HoldAnswer,
    /// Answers are dropped until a substitute plays for the seat.
    DropAnswers,
    /// When an answer arrives, the port is closed with all connections, and the server restarted;
    /// it never receives the answer.
    Restart,
}

/// One case.
#[derive(Debug)]
pub struct Case {
    /// Its name on the command line.
    pub name: &'static str,
    /// What is examined.
    pub about: &'static str,
    /// The examiner's interferences, in order.
    pub interferences: &'static [Interference],
    /// Kinds of decisions that the case always contains.
    pub kinds: &'static [v1::DecisionKind],
    /// The time is so short that a busy machine may lose a decision: only the share of lost
    /// decisions is judged.
    pub hurried: bool,
    /// Where it is played.
    pub place: Place,
}

/// Where a case is played.
#[derive(Debug, Clone, Copy)]
pub enum Place {
    /// In a room, with one seat for the agent.
    Room(fn(&Patience) -> v1::CreateRoomRequest),
    /// In a tournament, as one participant. It has its own command.
    Tournament(fn(&Patience) -> v1::TournamentSettings),
}

use v1::DecisionKind::{Exchange, SpecialAction, Turn};

/// All cases, in order.
pub static CASES: [Case; 12] = [
    Case {
        name: "game",
        about: "a complete game to 15 points: legal answers of all kinds, clean exit",
        interferences: &[],
        kinds: &[Turn, Exchange],
        hurried: false,
        place: Place::Room(whole_game),
    },
    Case {
        name: "special-action",
        about: "a decision on a special action",
        interferences: &[],
        kinds: &[Turn, SpecialAction],
        hurried: false,
        place: Place::Room(special_action),
    },
    Case {
        name: "small",
        about: "two players and four faces: 39 actions",
        interferences: &[],
        kinds: &[Turn],
        hurried: false,
        place: Place::Room(small),
    },
    Case {
        name: "large",
        about: "six players and fifteen faces: 380 actions",
        interferences: &[],
        kinds: &[Turn],
        hurried: false,
        place: Place::Room(large),
    },
    Case {
        name: "deadlines",
        about: "400 milliseconds for a decision: most answers arrive",
        interferences: &[],
        kinds: &[Turn],
        hurried: true,
        place: Place::Room(deadlines),
    },
    Case {
        name: "refusal",
        about: "an answer is refused as INVALID: the agent answers again",
        interferences: &[
            Interference::Refuse,
            Interference::Refuse,
            Interference::Refuse,
        ],
        kinds: &[Turn],
        hurried: false,
        place: Place::Room(unhurried),
    },
    Case {
        name: "disconnect",
        about: "the connection is lost at a decision: the agent attaches again",
        interferences: &[
            Interference::CutBeforeAnswer,
            Interference::CutBeforeRequest,
            Interference::CutBeforeResult,
        ],
        kinds: &[Turn],
        hurried: false,
        place: Place::Room(unhurried),
    },
    Case {
        name: "restart",
        about: "the server restarts with its port closed: the agent attaches again",
        interferences: &[Interference::Restart],
        kinds: &[Turn],
        hurried: false,
        place: Place::Room(durable),
    },
    Case {
        name: "stale",
        about: "an answer is held back until its time is up: the agent plays on",
        interferences: &[Interference::HoldAnswer],
        kinds: &[Turn],
        hurried: true,
        place: Place::Room(held_back),
    },
    Case {
        name: "substitution",
        about: "answers are lost, a substitute plays: the agent takes over again",
        interferences: &[Interference::DropAnswers],
        kinds: &[Turn],
        hurried: true,
        place: Place::Room(substitution),
    },
    Case {
        name: "original",
        about: "the rules of 2020: any top face opens, a pass binds for one turn",
        interferences: &[],
        kinds: &[Turn],
        hurried: false,
        place: Place::Room(original),
    },
    Case {
        name: "many-seats",
        about: "several games of a tournament at once, on one stream (--many)",
        interferences: &[],
        kinds: &[Turn],
        hurried: false,
        place: Place::Tournament(many_seats),
    },
];

impl Case {
    /// The case with this name.
    pub fn named(name: &str) -> Option<&'static Case> {
        CASES.iter().find(|case| case.name == name)
    }

    /// Whether its server is restarted.
    pub fn restarts(&self) -> bool {
        self.interferences.contains(&Interference::Restart)
    }

    /// Whether it is played in a tournament.
    pub fn is_tournament(&self) -> bool {
        matches!(self.place, Place::Tournament(_))
    }
}

/// Time for a decision in cases where the examiner lets the time of some run out.
const RUN_OUT_MS: u32 = 1_000;
/// Time for a decision in the case of short deadlines.
const SHORT_MS: u32 = 400;
/// Pace of built-in agents in a tournament, so that its games are played at the same time.
const MANY_PACE_MS: u32 = 10;
/// Pace of built-in agents in a case with a substitute, so that the agent can take over before the
/// game is over.
const PACE_MS: u32 = 60;

fn milliseconds(duration: Duration) -> u32 {
    u32::try_from(duration.as_millis()).unwrap_or(u32::MAX)
}

/// A room with the agent on this seat and built-in agents on the others.
fn room(players: u32, seat: u32, stop: Stop, decision_time_ms: u32) -> v1::CreateRoomRequest {
    use v1::seat_config::FilledBy;
    let seats = (0..players).map(|other| v1::SeatConfig {
        filled_by: Some(if other == seat {
            FilledBy::ReservedFor(v1::ParticipantKind::Unspecified.into())
        } else {
            FilledBy::BuiltInAgent(["greedy", "random"][other as usize % 2].into())
        }),
        ..v1::SeatConfig::default()
    });
    v1::CreateRoomRequest {
        rules: Some(v1::RuleSet {
            players: Some(players),
            stop: Some(stop),
            ..v1::RuleSet::default()
        }),
        seats: seats.collect(),
        policy: Some(v1::RoomPolicy {
            decision_time_ms: Some(decision_time_ms),
            bank_ms: Some(0),
            max_timeouts: Some(1_000),
            abort: v1::AbortPolicy::Never.into(),
            durability: v1::Durability::Ephemeral.into(),
            reward_scheme: v1::RewardScheme::Points.into(),
            ..v1::RoomPolicy::default()
        }),
        ..v1::CreateRoomRequest::default()
    }
}

fn with_rules(
    mut room: v1::CreateRoomRequest,
    set: impl FnOnce(&mut v1::RuleSet),
) -> v1::CreateRoomRequest {
    set(room.rules.get_or_insert_default());
    room
}

fn whole_game(patience: &Patience) -> v1::CreateRoomRequest {
    let seat = 1;
    let mut room = room(4, seat, Stop::TargetPoints(15), milliseconds(patience.each));
    // As Chef it gives two cards before its first turn.
    room.start = Some(second_shift(vec![seat, 2, 3, 0], None));
    room
}

fn special_action(patience: &Patience) -> v1::CreateRoomRequest {
    let seat = 2;
    let mut room = room(4, seat, Stop::TargetShifts(2), milliseconds(patience.each));
    // As Dishwasher with two jokers it may declare a Food Fight, and then gives cards as Chef.
    room.start = Some(second_shift(vec![0, 1, 3, seat], Some(seat)));
    room
}

fn small(patience: &Patience) -> v1::CreateRoomRequest {
    let room = room(2, 1, Stop::TargetShifts(3), milliseconds(patience.each));
    with_rules(room, |rules| rules.faces = Some(4))
}

fn large(patience: &Patience) -> v1::CreateRoomRequest {
    let room = room(6, 3, Stop::TargetShifts(1), milliseconds(patience.each));
    with_rules(room, |rules| rules.faces = Some(15))
}

fn original(patience: &Patience) -> v1::CreateRoomRequest {
    let room = room(4, 0, Stop::TargetShifts(2), milliseconds(patience.each));
    with_rules(room, |rules| rules.preset = "original2020".into())
}

fn deadlines(_: &Patience) -> v1::CreateRoomRequest {
    room(4, 2, Stop::TargetShifts(1), SHORT_MS)
}

fn unhurried(patience: &Patience) -> v1::CreateRoomRequest {
    room(4, 1, Stop::TargetShifts(3), milliseconds(patience.each))
}

fn durable(patience: &Patience) -> v1::CreateRoomRequest {
    let mut room = unhurried(patience);
    room.policy.get_or_insert_default().durability = v1::Durability::Durable.into();
    room
}

fn held_back(_: &Patience) -> v1::CreateRoomRequest {
    room(4, 3, Stop::TargetShifts(2), RUN_OUT_MS)
}

fn substitution(_: &Patience) -> v1::CreateRoomRequest {
    let mut room = room(2, 0, Stop::TargetShifts(2), RUN_OUT_MS);
    if let Some(policy) = &mut room.policy {
        policy.max_timeouts = Some(2);
        policy.pace_ms = Some(PACE_MS);
    }
    with_rules(room, |rules| rules.faces = Some(8))
}

fn many_seats(patience: &Patience) -> v1::TournamentSettings {
    v1::TournamentSettings {
        name: "examination".into(),
        format: v1::TournamentFormat::RoundRobin.into(),
        rules: Some(v1::RuleSet {
            stop: Some(Stop::TargetShifts(1)),
            ..v1::RuleSet::default()
        }),
        policy: Some(v1::RoomPolicy {
            decision_time_ms: Some(milliseconds(patience.each)),
            bank_ms: Some(0),
            max_timeouts: Some(1_000),
            pace_ms: Some(MANY_PACE_MS),
            durability: v1::Durability::Ephemeral.into(),
            ..v1::RoomPolicy::default()
        }),
        rounds: 2,
        games_per_pairing: 4,
        built_in_agents: ["greedy", "random", "random"].map(str::to_owned).to_vec(),
        start_when_joined: 4,
        no_show_time_ms: milliseconds(patience.each).max(1_000),
        max_calls: 1,
        ..v1::TournamentSettings::default()
    }
}

/// Starts a default game with its second Shift: cards dealt one by one from a sorted deck, so that
/// all hands are alike. `jokers`: the seat that gets both jokers.
fn second_shift(last_order: Vec<u32>, jokers: Option<u32>) -> Start {
    const SEATS: u32 = 4;
    const FACES: u32 = 11;
    const JOKER: u32 = FACES + 1;
    let deck = (1..=FACES)
        .flat_map(|face| (0..face).map(move |_| face))
        .chain([JOKER, JOKER]);
    let mut hands: Vec<v1::SeatCards> = (0..SEATS)
        .map(|seat| v1::SeatCards {
            seat,
            ..v1::SeatCards::default()
        })
        .collect();
    for (index, card) in deck.enumerate() {
        hands[index % SEATS as usize].cards.push(card);
    }
    hands[0].golden = true;
    if let Some(seat) = jokers {
        let seat = seat as usize;
        // Each joker elsewhere is swapped with a card of medium face, of which every hand has some.
        for (other, own) in (0..hands.len()).filter(|other| *other != seat).zip(5..) {
            let Some(at) = hands[other].cards.iter().position(|card| *card == JOKER) else {
                continue;
            };
            let card = std::mem::replace(&mut hands[seat].cards[own], JOKER);
            hands[other].cards[at] = card;
        }
        hands.iter_mut().for_each(|hand| hand.cards.sort_unstable());
    }
    Start::Scripted(v1::ScriptedShift {
        shift: 2,
        hands,
        last_order,
        ..v1::ScriptedShift::default()
    })
}

#[cfg(test)]
mod tests {
    use chefshat_record::convert::{rules_from_proto, script_from_proto};

    use crate::case::*;

    /// Longest description that leaves a line of the report within 100 columns.
    const ABOUT: usize = 68;

    #[test]
    fn every_case_has_a_unique_name_and_a_valid_room() {
        let patience = Patience {
            start: Duration::from_secs(30),
            each: Duration::from_secs(5),
        };
        let mut names: Vec<_> = CASES.iter().map(|case| case.name).collect();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), CASES.len());
        assert!(CASES.iter().all(|case| case.about.len() <= ABOUT));
        for case in &CASES {
            assert!(std::ptr::eq(Case::named(case.name).expect("named"), case));
            let Place::Room(room) = case.place else {
                continue;
            };
            let room = room(&patience);
            let rules = rules_from_proto(&room.rules.expect("rules")).expect("valid rules");
            assert_eq!(room.seats.len(), rules.players(), "{}", case.name);
            if let Some(Start::Scripted(script)) = room.start {
                let script = script_from_proto(&script, &rules).expect("a script");
                chefshat_engine::Game::scripted(
                    rules,
                    chefshat_engine::Seed([0; 32]),
                    &script,
                    |_| {},
                )
                .expect("a reachable position");
            }
        }
    }
}
