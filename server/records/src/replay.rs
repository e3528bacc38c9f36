//! Replaying a record: the rules are applied to its decisions again, and every line must be what follows from them. What does not fit is
//! named with its line.

use std::collections::VecDeque;

use chefshat_engine::{Action, BySeat, Event, Game, RewardScheme, RuleSet, Standings};
use chefshat_proto::v1::{self, game_event::Kind, record_line::Line};

use crate::convert::{
    By, action_space, event_kind, reward_scheme_from_proto, rules_from_proto, seat_number,
};
use crate::jsonl::FORMAT_VERSION;
use crate::seeds::{MAX_ENTROPY, SeedPlan};

/// What a record that replays says.
#[derive(Debug, Clone, PartialEq)]
pub struct Replayed {
    /// How the game ended.
    pub state: v1::RoomState,
    /// Decisions in it.
    pub decisions: u64,
    /// Events in it.
    pub events: u64,
    /// The final table, best first; empty for an aborted game.
    pub standings: Vec<v1::Standing>,
}

/// The first line of a record that does not fit, and why.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("line {line}: {problem}")]
pub struct ReplayError {
    /// Number of the line, from 1; one more than there are lines when something is missing at the end.
    pub line: usize,
    /// What does not fit.
    pub problem: String,
}

/// Replays a record: seeds, deals, masks, decisions, events, rewards, scores and counts.
///
/// # Errors
/// The first line that does not fit.
pub fn replay(lines: &[v1::RecordLine]) -> Result<Replayed, ReplayError> {
    let mut replay = None;
    for (index, line) in lines.iter().enumerate() {
        let at = |problem: String| ReplayError {
            line: index + 1,
            problem,
        };
        let line = line
            .line
            .as_ref()
            .ok_or_else(|| at("the line is empty".into()))?;
        match (&mut replay, line) {
            (None, Line::Header(header)) => {
                replay = Some(Replay::new(header, lines).map_err(at)?);
            }
            (None, _) => return Err(at("the first line must be the header".into())),
            (Some(_), Line::Header(_)) => return Err(at("a second header".into())),
            (Some(replay), line) => replay.take(line).map_err(at)?,
        }
    }
    replay
        .and_then(|replay| replay.result)
        .ok_or_else(|| ReplayError {
            line: lines.len() + 1,
            problem: "the record ends before its footer".into(),
        })
}

struct Replay {
    rules: RuleSet,
    scheme: Option<RewardScheme>,
    plan: Option<(SeedPlan, v1::SeedReveal)>,
    game: Option<Game>,
    /// Events that must follow, with the rewards they bring.
    expected: VecDeque<(Kind, Vec<v1::SeatReward>)>,
    decisions_of: BySeat<u64>,
    decisions: u64,
    events: u64,
    over: Option<v1::RoomState>,
    result: Option<Replayed>,
}

impl Replay {
    fn new(header: &v1::RecordHeader, lines: &[v1::RecordLine]) -> Result<Self, String> {
        if header.format_version != FORMAT_VERSION {
            return Err(format!(
                "the record has form {}; this version reads form {FORMAT_VERSION}",
                header.format_version
            ));
        }
        if header.rules_version != chefshat_engine::RULES_VERSION {
            return Err(format!(
                "the game was played by version {} of the rules; this version knows version {}",
                header.rules_version,
                chefshat_engine::RULES_VERSION
            ));
        }
        let rules = header
            .rules
            .as_ref()
            .ok_or("the header has no rule set")
            .map_err(str::to_owned)
            .and_then(|rules| rules_from_proto(rules).map_err(|error| error.to_string()))?;
        if header.action_space.as_ref() != Some(&action_space(&rules.actions())) {
            return Err("the action space is not that of the rule set".into());
        }
        let scheme = header
            .policy
            .as_ref()
            .and_then(|policy| reward_scheme_from_proto(policy.reward_scheme()));
        let plan = lines
            .iter()
            .rev()
            .find_map(reveal)
            .map(|reveal| seed_plan(header, reveal).map(|plan| (plan, reveal.clone())))
            .transpose()?;
        Ok(Self {
            decisions_of: BySeat::filled(rules.players(), 0),
            rules,
            scheme,
            plan,
            game: None,
            expected: VecDeque::new(),
            decisions: 0,
            events: 0,
            over: None,
            result: None,
        })
    }

    fn take(&mut self, line: &Line) -> Result<(), String> {
        if self.result.is_some() {
            return Err("the record goes on after its footer".into());
        }
        match line {
            Line::Decision(decision) => self.decide(decision),
            Line::Event(event) => self.event(event),
            Line::PrivateExpression(_) => Ok(()),
            Line::Footer(footer) => self.end(footer),
            Line::Header(_) => unreachable!("headers are taken by the caller"),
        }
    }

    fn decide(&mut self, record: &v1::DecisionRecord) -> Result<(), String> {
        if !self.expected.is_empty() {
            return Err("events of the decision before are missing".into());
        }
        let game = self
            .game
            .as_mut()
            .ok_or("a decision before the game began")?;
        let open = game.decision().ok_or("a decision after the game ended")?;
        if seat_number(open.seat) != record.seat {
            return Err(format!(
                "seat {} decides, but it is seat {}'s decision",
                record.seat, open.seat
            ));
        }
        self.decisions_of[open.seat] += 1;
        let count = self.decisions_of[open.seat];
        if record.decision_id != count {
            return Err(format!(
                "decision {} of seat {} is numbered {}",
                count, open.seat, record.decision_id
            ));
        }
        let legal = game.legal_actions();
        if record.action_mask != legal.to_bytes(self.rules.actions().size()) {
            return Err("the mask is not that of the legal actions".into());
        }
        let action = Action::new(u16::try_from(record.action).unwrap_or(u16::MAX));
        if self.rules.actions().text(action).as_deref() != Some(&record.text) {
            return Err(format!(
                "action {} does not mean {:?}",
                record.action, record.text
            ));
        }
        for attempt in &record.invalid_attempts {
            let attempt = Action::new(u16::try_from(*attempt).unwrap_or(u16::MAX));
            if legal.contains(attempt) {
                return Err(format!(
                    "action {} was refused, but it is legal",
                    attempt.index()
                ));
            }
        }
        let mut events = Vec::new();
        game.apply(action, |event| events.push(event))
            .map_err(|error| error.to_string())?;
        self.decisions += 1;
        let by = By {
            source: record.source(),
            decision_time_us: record.decision_time_us,
        };
        self.expect(&events, by);
        Ok(())
    }

    fn expect(&mut self, events: &[Event], by: By) {
        let space = self.rules.actions();
        for (position, event) in events.iter().enumerate() {
            let mut rewards = Vec::new();
            if let Some(scheme) = self.scheme {
                scheme.of_events(&self.rules, events, |seat, value, bringer| {
                    if bringer == position {
                        rewards.push(v1::SeatReward {
                            seat: seat_number(seat),
                            value,
                        });
                    }
                });
            }
            if let Some(kind) = event_kind(event, space, by) {
                self.expected.push_back((kind, rewards));
            }
        }
    }

    fn event(&mut self, event: &v1::GameEvent) -> Result<(), String> {
        self.events += 1;
        if event.sequence != self.events {
            return Err(format!(
                "event {} is numbered {}",
                self.events, event.sequence
            ));
        }
        if self.over.is_some() {
            return Err("an event after the game was over".into());
        }
        let kind = event.kind.as_ref().ok_or("an event of no kind")?;
        match kind {
            Kind::Seated(_)
            | Kind::Vacated(_)
            | Kind::Disconnected(_)
            | Kind::Returned(_)
            | Kind::Substituted(_)
            | Kind::ExpressionShown(_) => Ok(()),
            Kind::GameStarted(_) => self.begin(),
            Kind::GameEnded(ended) => self.ended(ended),
            Kind::GameAborted(_) => {
                self.over = Some(v1::RoomState::Aborted);
                Ok(())
            }
            kind => {
                let Some((expected, rewards)) = self.expected.pop_front() else {
                    return Err("an event that follows from no decision".into());
                };
                if *kind != expected {
                    return Err(format!("the event must be {expected:?}"));
                }
                if event.rewards != rewards {
                    return Err(format!("the rewards must be {rewards:?}"));
                }
                Ok(())
            }
        }
    }

    fn begin(&mut self) -> Result<(), String> {
        if self.game.is_some() {
            return Err("the game begins a second time".into());
        }
        let (plan, reveal) = self
            .plan
            .as_ref()
            .ok_or("the game began, but its seed is not revealed at its end")?;
        let seed = plan.game_seed(&reveal.seat_entropy);
        if reveal.game_seed != seed.0 {
            return Err(
                "the game seed does not follow from the server's seed and the seats' bytes".into(),
            );
        }
        let mut events = Vec::new();
        self.game = Some(Game::new(self.rules, seed, |event| events.push(event)));
        let by = By {
            source: v1::DecisionSource::Agent,
            decision_time_us: 0,
        };
        self.expect(&events, by);
        Ok(())
    }

    fn ended(&mut self, ended: &v1::GameEnded) -> Result<(), String> {
        if !self.expected.is_empty() {
            return Err("events are missing before the end of the game".into());
        }
        let game = self.game.as_ref().ok_or("a game ends that never began")?;
        let standings = game
            .standings()
            .filter(|_| game.is_over())
            .ok_or("the game ends before the rules end it")?;
        let standings = final_table(&standings);
        if ended.standings != standings {
            return Err(format!("the standings must be {standings:?}"));
        }
        self.over = Some(v1::RoomState::Finished);
        Ok(())
    }

    fn end(&mut self, footer: &v1::RecordFooter) -> Result<(), String> {
        let state = self.over.ok_or("the game is not over")?;
        let right = v1::RecordFooter {
            state: state.into(),
            events: self.events,
            decisions: self.decisions,
        };
        if *footer != right {
            return Err(format!("the footer must be {right:?}"));
        }
        let standings = match (state, &self.game) {
            (v1::RoomState::Finished, Some(game)) => game.standings(),
            _ => None,
        };
        self.result = Some(Replayed {
            state,
            decisions: self.decisions,
            events: self.events,
            standings: standings.as_ref().map_or_else(Vec::new, final_table),
        });
        Ok(())
    }
}

fn reveal(line: &v1::RecordLine) -> Option<&v1::SeedReveal> {
    match line.line.as_ref()? {
        Line::Event(event) => match event.kind.as_ref()? {
            Kind::GameEnded(ended) => ended.reveal.as_ref(),
            Kind::GameAborted(aborted) => aborted.reveal.as_ref(),
            _ => None,
        },
        _ => None,
    }
}

/// The plan a header and a reveal tell of, with its commitment checked.
fn seed_plan(header: &v1::RecordHeader, reveal: &v1::SeedReveal) -> Result<SeedPlan, String> {
    let bytes = |name: &str, bytes: &[u8]| -> Result<[u8; 32], String> {
        bytes
            .try_into()
            .map_err(|_| format!("the {name} of the reveal is not 32 bytes"))
    };
    if header.seed_commitment.is_empty() {
        return Ok(SeedPlan::Fixed {
            game_seed: bytes("game seed", &reveal.game_seed)?,
        });
    }
    if reveal
        .seat_entropy
        .iter()
        .any(|bytes| bytes.len() > MAX_ENTROPY)
    {
        return Err(format!("a seat added more than {MAX_ENTROPY} bytes"));
    }
    let plan = SeedPlan::Committed {
        server_seed: bytes("server seed", &reveal.server_seed)?,
        nonce: bytes("nonce", &reveal.nonce)?,
    };
    let mut game_id = [0; 16];
    hex::decode_to_slice(&header.game_id, &mut game_id)
        .map_err(|_| "the game id is not 32 hexadecimal digits".to_owned())?;
    if plan.commitment(&game_id).map(Vec::from).as_ref() != Some(&header.seed_commitment) {
        return Err("the seed revealed at the end is not the one committed to".into());
    }
    Ok(plan)
}

fn final_table(standings: &Standings) -> Vec<v1::Standing> {
    standings
        .iter()
        .map(|(place, seat, points)| v1::Standing {
            seat: seat_number(seat),
            points,
            place: place.into(),
        })
        .collect()
}
