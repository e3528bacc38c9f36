//! Records for tests: games played by random choices and recorded as a server records them, and
//! transcripts of them; random edits of such inputs.
#![allow(
    clippy::unwrap_used,
    missing_docs,
    reason = "test support: panics where a test fails"
)]

mod edits;
mod transcript;

pub use edits::Edits;
pub use transcript::{Observed, transcript};

use crate::branch::Branch;
use crate::convert::{By, action_space, event_kind, rules_to_proto, script_to_proto, seat_number};
use chefshat_engine::{
    ActionId, BySeat, DecisionKind, Event, Game, RuleSet, RuleSetSpec, Script, Seed, Stop,
};
use chefshat_proto::v1::{self, game_event::Kind, record_line::Line};

/// Invalid attempts after which the default decision is taken.
const ATTEMPTS: u32 = 10;
/// Time for a decision, without a bank.
const DECISION_TIME_MS: u32 = 10_000;

/// A game to play and record.
pub struct TestGame<'a> {
    pub rules: RuleSet,
    pub seed: Seed,
    pub script: Option<Script>,
    pub branch: Option<&'a Branch>,
    /// Seeds the players' random choices.
    pub choices: u64,
}

impl TestGame<'_> {
    /// A game dealt from `seed` in every byte.
    pub fn dealt(rules: RuleSet, seed: u8, choices: u64) -> Self {
        TestGame {
            rules,
            seed: Seed([seed; 32]),
            script: None,
            branch: None,
            choices,
        }
    }

    /// Plays the game; every participant decides itself.
    pub fn played(&self) -> Vec<v1::RecordLine> {
        self.record(|_| v1::DecisionSource::Agent)
    }

    /// Plays the game. `source` gives the source of each decision by its index in the game.
    pub fn record(&self, source: impl Fn(u64) -> v1::DecisionSource) -> Vec<v1::RecordLine> {
        let mut lines = Lines {
            lines: vec![Line::Header(Box::new(self.header()))],
            events: 0,
            elapsed_ms: 0,
        };
        for seat in self.header().seats {
            lines.event(Kind::Seated(Box::new(v1::Seated {
                seat: seat.seat,
                name: seat.name,
                kind: seat.kind,
            })));
        }
        lines.event(Kind::GameStarted(Box::new(self.started())));
        let taken_over: Vec<(Seed, ActionId)> = self
            .branch
            .iter()
            .flat_map(|branch| &branch.taken_over)
            .flat_map(|part| part.actions.iter().map(|action| (part.seed, *action)))
            .collect();
        let seed_at = |decisions: usize| {
            let part = taken_over.get(decisions);
            part.map_or(self.seed, |(seed, _)| *seed)
        };
        let first = self
            .branch
            .map_or(self.seed, |branch| branch.taken_over[0].seed);
        let mut events = Vec::new();
        let push = |event| events.push(event);
        let mut game = match &self.script {
            None => Game::new(self.rules, first, push),
            Some(script) => Game::scripted(self.rules, first, script, push).unwrap(),
        };
        self.push_events(&mut lines, &mut events, v1::DecisionSource::Agent, 0);
        let mut random = self.choices;
        let mut numbers = BySeat::filled(self.rules.players(), 0);
        let mut substituted = BySeat::filled(self.rules.players(), false);
        let mut connected = BySeat::filled(self.rules.players(), true);
        let mut decisions: u64 = 0;
        while let Some(open) = game.decision() {
            let index = usize::try_from(decisions).unwrap();
            game.reseed(seed_at(index));
            let legal = game.legal_actions();
            let (action, source) = match taken_over.get(index) {
                Some((_, action)) => (*action, v1::DecisionSource::Recorded),
                None => {
                    random = random
                        .wrapping_mul(6364136223846793005)
                        .wrapping_add(1442695040888963407);
                    let pick = (random >> 33) as usize % legal.len();
                    match source(decisions) {
                        source @ (v1::DecisionSource::Agent | v1::DecisionSource::Substitute) => {
                            (legal.nth(pick).unwrap(), source)
                        }
                        by_default => (game.default_action().unwrap(), by_default),
                    }
                }
            };
            let by_substitute = source == v1::DecisionSource::Substitute;
            if by_substitute != std::mem::replace(&mut substituted[open.seat], by_substitute) {
                let seat = seat_number(open.seat);
                lines.event(if by_substitute {
                    Kind::Substituted(v1::Substituted {
                        seat,
                        built_in_agent: "random".into(),
                        for_good: false,
                    })
                } else {
                    Kind::Returned(v1::Returned { seat })
                });
            }
            let seat = seat_number(open.seat);
            match source {
                v1::DecisionSource::Disconnected if connected[open.seat] => {
                    connected[open.seat] = false;
                    lines.event(Kind::Disconnected(v1::Disconnected {
                        seat,
                        ..v1::Disconnected::default()
                    }));
                }
                v1::DecisionSource::Timeout if !connected[open.seat] => {
                    connected[open.seat] = true;
                    lines.event(Kind::Returned(v1::Returned { seat }));
                }
                _ => {}
            }
            let took_ms = match source {
                v1::DecisionSource::Timeout | v1::DecisionSource::Disconnected => DECISION_TIME_MS,
                _ => 0,
            };
            lines.elapsed_ms += u64::from(took_ms);
            numbers[open.seat] += 1;
            decisions += 1;
            let space = self.rules.actions();
            let illegal = (0..space.size())
                .find(|action| !legal.contains(ActionId::new(*action)))
                .unwrap();
            let attempts = match source {
                v1::DecisionSource::Invalid => ATTEMPTS as usize,
                _ => 0,
            };
            lines.lines.push(Line::Decision(v1::DecisionRecord {
                seat: seat_number(open.seat),
                decision_id: numbers[open.seat],
                kind: match open.kind {
                    DecisionKind::Turn => v1::DecisionKind::Turn,
                    DecisionKind::Exchange => v1::DecisionKind::Exchange,
                    DecisionKind::SpecialAction => v1::DecisionKind::SpecialAction,
                }
                .into(),
                action: action.index().into(),
                text: space.text(action).unwrap(),
                source: source.into(),
                decision_time_us: u64::from(took_ms) * 1000,
                elapsed_ms: lines.elapsed_ms,
                invalid_attempts: vec![illegal.into(); attempts],
                action_mask: legal.to_bytes(space.size()),
                ..v1::DecisionRecord::default()
            }));
            game.apply(action, |event| events.push(event)).unwrap();
            self.push_events(&mut lines, &mut events, source, took_ms);
        }
        if let Line::Header(header) = &mut lines.lines[0] {
            for (seat, substituted) in header.seats.iter_mut().zip(substituted.values()) {
                seat.substituted = *substituted;
            }
        }
        let standings = game.standings().unwrap();
        lines.event(Kind::GameEnded(Box::new(v1::GameEnded {
            standings: standings
                .iter()
                .map(|(place, seat, points)| v1::Standing {
                    seat: seat_number(seat),
                    points,
                    place: place.into(),
                })
                .collect(),
            reveal: Some(v1::SeedReveal {
                game_seed: self.seed.0.to_vec(),
                ..v1::SeedReveal::default()
            }),
        })));
        lines.lines.push(Line::Footer(v1::RecordFooter {
            state: v1::RoomState::Finished.into(),
            events: lines.events,
            decisions,
            ..v1::RecordFooter::default()
        }));
        lines
            .lines
            .into_iter()
            .map(|line| v1::RecordLine { line: Some(line) })
            .collect()
    }

    fn push_events(
        &self,
        lines: &mut Lines,
        events: &mut Vec<Event>,
        source: v1::DecisionSource,
        took_ms: u32,
    ) {
        let by = By {
            source,
            decision_time_us: u64::from(took_ms) * 1000,
        };
        for event in events.drain(..) {
            if let Some(kind) = event_kind(&event, self.rules.actions(), by) {
                lines.event(kind);
            }
        }
    }

    fn header(&self) -> v1::RecordHeader {
        let start = v1::GameStart {
            scripted: (self.script.as_ref())
                .map(|script| script_to_proto(script, self.rules.faces())),
            branched_from: self.branch.map(|branch| v1::BranchPoint {
                game_id: "0123456789abcdef0123456789abcdef".into(),
                decisions: taken_over(branch),
                same_deals: false,
            }),
            taken_over: (self.branch.iter().flat_map(|branch| &branch.taken_over))
                .map(|part| v1::TakenOver {
                    decisions: part.actions.len() as u64,
                    game_seed: part.seed.0.to_vec(),
                })
                .collect(),
        };
        let origin = match (&self.branch, &self.script) {
            (Some(_), _) => v1::GameOrigin::Branched,
            (None, Some(_)) => v1::GameOrigin::Scripted,
            (None, None) => v1::GameOrigin::FixedSeed,
        };
        v1::RecordHeader {
            format_version: 1,
            game_id: "89abcdef0123456789abcdef01234567".into(),
            origin: origin.into(),
            rules: Some(rules_to_proto(&self.rules)),
            rules_version: chefshat_engine::RULES_VERSION,
            room_id: "fedcba9876543210fedcba9876543210".into(),
            policy: Some(v1::RoomPolicy {
                decision_time_ms: Some(DECISION_TIME_MS),
                bank_ms: Some(0),
                max_invalid_attempts: Some(ATTEMPTS),
                // No seat is substituted because of its timeouts.
                max_timeouts: Some(1_000),
                substitute: "random".into(),
                pace_ms: Some(0),
                waiting_time_ms: Some(1_000),
                spectators: Some(true),
                spectator_delay_decisions: Some(0),
                spectators_see_hands: Some(false),
                ..v1::RoomPolicy::default()
            }),
            seats: (0..)
                .take(self.rules.players())
                .map(|seat| v1::Participant {
                    seat,
                    name: format!("player {seat}"),
                    kind: v1::ParticipantKind::Agent.into(),
                    connected: true,
                    ..v1::Participant::default()
                })
                .collect(),
            action_space: Some(action_space(&self.rules.actions())),
            start: (origin != v1::GameOrigin::FixedSeed).then_some(start),
            ..v1::RecordHeader::default()
        }
    }

    fn started(&self) -> v1::GameStarted {
        let header = self.header();
        v1::GameStarted {
            game_id: header.game_id,
            rules: header.rules,
            rules_version: header.rules_version,
            policy: header.policy,
            seats: header.seats,
            action_space: header.action_space,
            hand_size: self.rules.hand_size().into(),
            seed_commitment: header.seed_commitment,
        }
    }
}

/// A game of one Shift with the opening `any_top_face`, in which plays do not reveal the Golden
/// card.
pub struct HiddenGolden {
    pub rules: RuleSet,
    pub lines: Vec<v1::RecordLine>,
    /// The seat dealt the Golden card.
    pub holder: u32,
}

impl HiddenGolden {
    /// Plays and records the game.
    pub fn record() -> Self {
        let spec = RuleSetSpec {
            stop: Stop::Shifts(1),
            ..RuleSetSpec::preset("original2020").unwrap()
        };
        let rules = spec.validate().unwrap();
        let game = TestGame::dealt(rules, 7, 1);
        let start = Game::new(rules, game.seed, |_| {});
        let hands = start.hands();
        let holder = hands.seats().find(|&seat| hands[seat].has_golden());
        HiddenGolden {
            rules,
            lines: game.played(),
            holder: seat_number(holder.unwrap()),
        }
    }
}

/// The record of the same game aborted after its first `after` lines.
pub fn aborted(mut lines: Vec<v1::RecordLine>, after: usize) -> Vec<v1::RecordLine> {
    let reveal = events(&lines).find_map(|(_, kind)| match kind {
        Kind::GameEnded(ended) => ended.reveal.clone(),
        _ => None,
    });
    lines.truncate(after);
    let decisions = decisions(&lines).count() as u64;
    let is_dealt = events(&lines).any(|(_, kind)| matches!(kind, Kind::ShiftStarted(_)));
    let elapsed_ms = events(&lines).last().map(|(event, _)| event.elapsed_ms);
    let events = events(&lines).count() as u64 + 1;
    let end = v1::GameEvent {
        sequence: events,
        elapsed_ms: elapsed_ms.unwrap_or_default(),
        kind: Some(Kind::GameAborted(Box::new(v1::GameAborted {
            reason: v1::AbortReason::Closed.into(),
            reveal: reveal.filter(|_| is_dealt),
        }))),
        ..v1::GameEvent::default()
    };
    let footer = v1::RecordFooter {
        state: v1::RoomState::Aborted.into(),
        events,
        decisions,
        ..v1::RecordFooter::default()
    };
    let end = [Line::Event(end), Line::Footer(footer)];
    lines.extend(end.map(|line| v1::RecordLine { line: Some(line) }));
    lines
}

/// The header of a record.
pub fn header(lines: &mut [v1::RecordLine]) -> &mut v1::RecordHeader {
    match &mut lines[0].line {
        Some(Line::Header(header)) => header,
        other => panic!("{other:?}"),
    }
}

/// The footer of a record.
pub fn footer(lines: &mut [v1::RecordLine]) -> &mut v1::RecordFooter {
    match &mut lines.last_mut().unwrap().line {
        Some(Line::Footer(footer)) => footer,
        other => panic!("{other:?}"),
    }
}

/// The decisions of a record.
pub fn decisions(lines: &[v1::RecordLine]) -> impl Iterator<Item = &v1::DecisionRecord> {
    lines.iter().filter_map(|line| match &line.line {
        Some(Line::Decision(decision)) => Some(decision),
        _ => None,
    })
}

/// The events of a record, with what each says.
pub fn events(lines: &[v1::RecordLine]) -> impl Iterator<Item = (&v1::GameEvent, &Kind)> {
    lines.iter().filter_map(|line| match &line.line {
        Some(Line::Event(event)) => Some((event, event.kind.as_ref()?)),
        _ => None,
    })
}

/// The default rules for a number of Shifts.
pub fn shifts(count: u32) -> RuleSet {
    let spec = RuleSetSpec {
        stop: Stop::Shifts(count),
        ..RuleSetSpec::default()
    };
    spec.validate().unwrap()
}

/// The number of decisions taken over.
pub fn taken_over(branch: &Branch) -> u64 {
    branch
        .taken_over
        .iter()
        .map(|part| part.actions.len() as u64)
        .sum()
}

struct Lines {
    lines: Vec<Line>,
    events: u64,
    elapsed_ms: u64,
}

impl Lines {
    fn event(&mut self, kind: Kind) {
        self.events += 1;
        self.lines.push(Line::Event(v1::GameEvent {
            sequence: self.events,
            elapsed_ms: self.elapsed_ms,
            kind: Some(kind),
            ..v1::GameEvent::default()
        }));
    }
}
