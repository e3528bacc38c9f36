//! A built-in agent as a remote client: converts a decision request to the engine's observation, so
//! that the agent decides as it would inside the server.

use std::sync::{Arc, OnceLock};
use std::time::Duration;

use chefshat_agents::{AgentKind, AgentMaker, AgentNameError, BuiltInAgent, NamedAgent};
use chefshat_client::{ActionId, Agent, nth_legal, v1};
use chefshat_engine::{Mask, RuleSet};
use chefshat_record::convert::{event_from_proto, rules_from_proto, seat_from_number};
use chefshat_search::Searchers;
use rayon::ThreadPool;
use sha2::{Digest as _, Sha256};
use tracing::warn;

use chefshat_record::convert::observation_from_proto;
use chefshat_room::ids::random_bytes;

/// Maximum wait of a remote agent before a decision, in milliseconds: well within the default time.
pub(super) const MAX_PACE_MS: u64 = 5_000;

/// A built-in agent that plays a seat of a server. Keeps its random generator from game to game.
#[derive(Debug)]
pub struct RemoteAgent {
    agent: BuiltInAgent,
    /// Creates the agent of each game, with this seed, when the rules are known.
    maker: Option<(Arc<dyn AgentMaker>, [u8; 32])>,
    pace: Duration,
    seat: Option<u32>,
    rules: Option<RuleSet>,
}

impl RemoteAgent {
    /// Plays as this agent; waits for `pace` before each decision.
    pub fn new(agent: BuiltInAgent, pace: Duration) -> Self {
        Self {
            agent,
            maker: None,
            pace,
            seat: None,
            rules: None,
        }
    }

    /// Plays as a built-in agent. One that searches does so on the threads of a pool for all of this
    /// process.
    pub(super) fn named(named: NamedAgent, seed: [u8; 32], pace: Duration) -> Self {
        match named {
            NamedAgent::Kind(kind) => Self::new(BuiltInAgent::new(kind, seed), pace),
            NamedAgent::MonteCarlo(plays) => {
                let searchers = Searchers {
                    pool: search_pool(),
                    ..Searchers::new(plays)
                };
                Self::made_by(Arc::new(searchers), seed, pace)
            }
        }
    }

    /// Plays each game as an agent of this maker.
    pub(super) fn made_by(maker: Arc<dyn AgentMaker>, seed: [u8; 32], pace: Duration) -> Self {
        Self {
            // Replaced before the first decision.
            agent: BuiltInAgent::new(AgentKind::default(), seed),
            maker: Some((maker, seed)),
            pace,
            seat: None,
            rules: None,
        }
    }

    /// The agent's action; an error if the request does not fit the rules.
    fn consider(&mut self, request: &v1::DecisionRequest) -> Result<ActionId, String> {
        let (Some(rules), Some(seat)) = (self.rules, self.seat) else {
            return Err("the server sent a decision before the rules".into());
        };
        let seat = seat_from_number(seat, rules.players())
            .ok_or("the server assigned a seat that the game does not have")?;
        let observation = observation_from_proto(request, seat, &rules)
            .map_err(|problem| format!("invalid observation: {problem}"))?;
        let legal = Mask::from_bytes(&request.action_mask)
            .filter(|mask| !mask.is_empty())
            .ok_or("invalid mask of legal actions")?;
        let action = if self.agent.follows_events() {
            // It takes its time.
            tokio::task::block_in_place(|| self.agent.decide(&observation, &legal))
        } else {
            self.agent.decide(&observation, &legal)
        };
        Ok(ActionId(action.index().into()))
    }
}

impl RemoteAgent {
    /// Begins a game, or resumes one whose events before this are unknown.
    fn begin(&mut self, start: &v1::GameStarted) {
        self.rules = match start.rules.as_ref().map(rules_from_proto) {
            Some(Ok(rules)) => Some(rules),
            Some(Err(problem)) => {
                warn!(%problem, "the rules of the game cannot be read");
                None
            }
            None => None,
        };
        if let (Some((maker, seed)), Some(rules)) = (&self.maker, &self.rules) {
            self.agent = maker.agent(rules, *seed);
        }
    }

    /// Shows an event of a Shift to an agent that follows them.
    fn follow(&mut self, event: &v1::GameEvent) {
        let (Some(kind), Some(rules), Some(seat)) = (&event.kind, &self.rules, self.seat) else {
            return;
        };
        let Some(seat) = seat_from_number(seat, rules.players()) else {
            return;
        };
        if self.agent.follows_events() {
            match event_from_proto(kind, rules) {
                Ok(Some(event)) => self.agent.on_event(seat, &event),
                Ok(None) => {}
                Err(problem) => warn!(%problem, "an event of the game cannot be read"),
            }
        }
    }
}

impl Agent for RemoteAgent {
    fn decide(&mut self, request: &v1::DecisionRequest) -> ActionId {
        if !self.pace.is_zero() {
            tokio::task::block_in_place(|| std::thread::sleep(self.pace));
        }
        self.consider(request).unwrap_or_else(|problem| {
            warn!(problem, "playing the first legal action instead");
            nth_legal(request, 0).unwrap_or(ActionId(0))
        })
    }

    fn on_attached(&mut self, attached: &v1::Attached) {
        self.seat = Some(attached.seat);
    }

    fn on_event(&mut self, event: &v1::GameEvent) {
        match &event.kind {
            Some(v1::game_event::Kind::GameStarted(start)) => self.begin(start),
            _ => self.follow(event),
        }
    }

    fn on_snapshot(&mut self, snapshot: &v1::Snapshot) {
        if let Some(start) = &snapshot.game_started {
            self.begin(start);
        }
    }
}

/// The threads of searches, one for each core; `None` if the operating system starts none.
fn search_pool() -> Option<Arc<ThreadPool>> {
    static POOL: OnceLock<Option<Arc<ThreadPool>>> = OnceLock::new();
    let start = || rayon::ThreadPoolBuilder::new().build().ok().map(Arc::new);
    POOL.get_or_init(start).clone()
}

/// Derives a seed for one purpose from the user's number: SHA-256(purpose ‖ number, 8 bytes
/// little-endian); random without a number.
pub(super) fn seed_for(purpose: &str, number: Option<u64>) -> [u8; 32] {
    match number {
        Some(number) => Sha256::new()
            .chain_update(purpose)
            .chain_update(number.to_le_bytes())
            .finalize()
            .into(),
        None => random_bytes(),
    }
}

/// The names of the built-in agents that people choose from. `random_unmasked`, which tests how
/// wrong actions are handled, is accepted too.
pub(super) fn offered_agents() -> String {
    let names = NamedAgent::NAMES.into_iter();
    let offered = names.filter(|name| *name != AgentKind::RandomUnmasked.name());
    offered.collect::<Vec<_>>().join(", ")
}

/// Parses the name of a built-in agent.
pub(super) fn named_agent(name: &str) -> Result<NamedAgent, String> {
    name.parse().map_err(|error| match error {
        AgentNameError::Unknown(_) => format!("use one of {}", offered_agents()),
        AgentNameError::MonteCarlo(error) => error.to_string(),
    })
}

#[cfg(test)]
mod tests {
    use chefshat_agents::MonteCarlo;
    use chefshat_agents::RecordedPlayer;
    use chefshat_engine::RecordedDecision;
    use chefshat_engine::{DecisionKind, Game, RuleSetSpec, Seat, Seed, Stop, Viewer};
    use chefshat_record::convert::{By, event_kind, rules_to_proto};

    use crate::remote::*;
    use chefshat_record::convert::observation_to_proto;

    #[test]
    fn the_agent_that_ignores_the_mask_is_accepted_but_not_offered() {
        let accepted = named_agent("random_unmasked");
        assert_eq!(accepted, Ok(AgentKind::RandomUnmasked.into()));
        let offered = "use one of random, greedy, trained, monte_carlo".to_owned();
        assert_eq!(named_agent("nobody"), Err(offered));
    }

    /// The open decision of a game as a server requests it.
    fn request(game: &Game) -> v1::DecisionRequest {
        let decision = game.decision().expect("a decision is open");
        let observation = game.observe(Viewer::Seat(decision.seat));
        v1::DecisionRequest {
            kind: match decision.kind {
                DecisionKind::Turn => v1::DecisionKind::Turn,
                DecisionKind::Exchange => v1::DecisionKind::Exchange,
                DecisionKind::SpecialAction => v1::DecisionKind::SpecialAction,
            }
            .into(),
            observation: Some(observation_to_proto(&observation)),
            action_mask: game.legal_actions().to_bytes(game.rules().actions().size()),
            ..v1::DecisionRequest::default()
        }
    }

    fn started(game: &Game) -> v1::GameEvent {
        v1::GameEvent {
            kind: Some(v1::game_event::Kind::GameStarted(Box::new(
                v1::GameStarted {
                    rules: Some(rules_to_proto(game.rules())),
                    ..v1::GameStarted::default()
                },
            ))),
            ..v1::GameEvent::default()
        }
    }

    #[test]
    fn decides_remotely_as_it_does_inside_the_server() {
        let rules = RuleSetSpec::default().validate().expect("the standard");
        // Before its first decision a seat receives the start of the game or, if it is resumed late, a
        // snapshot.
        let ways = AgentKind::ALL.map(|kind| [(kind, false), (kind, true)]);
        for (kind, is_late) in ways.into_iter().flatten() {
            let mut game = Game::new(rules, Seed([5; 32]), |_| {});
            let mut inside = BuiltInAgent::new(kind, [9; 32]);
            let mut remote = RemoteAgent::new(inside.clone(), Duration::ZERO);
            match (is_late, started(&game).kind) {
                (true, Some(v1::game_event::Kind::GameStarted(start))) => {
                    remote.on_snapshot(&v1::Snapshot {
                        game_started: Some(*start),
                        ..v1::Snapshot::default()
                    });
                }
                _ => remote.on_event(&started(&game)),
            }
            let mut turns = 0;
            while game.shift() == 1 {
                let decision = game.decision().expect("the first Shift is not the last");
                remote.on_attached(&v1::Attached {
                    seat: u32::try_from(decision.seat.index()).expect("a seat is below six"),
                    ..v1::Attached::default()
                });
                let observation = game.observe(Viewer::Seat(decision.seat));
                let expected = inside.decide(&observation, &game.legal_actions());
                assert_eq!(
                    remote.decide(&request(&game)).0,
                    u32::from(expected.index())
                );
                let action = if game.legal_actions().contains(expected) {
                    expected
                } else {
                    game.default_action().expect("a decision has a default")
                };
                game.apply(action, |_| {}).expect("the action is legal");
                turns += 1;
            }
            assert!(turns > 20, "{kind:?} played {turns} turns only");
        }
    }

    /// What it sees of others reaches it as events, in this form as in the engine's.
    #[test]
    fn an_agent_that_searches_follows_the_events() {
        let plays: MonteCarlo = "monte_carlo:40:random".parse().expect("a valid agent");
        let rules = RuleSetSpec {
            stop: Stop::Shifts(2),
            ..RuleSetSpec::default()
        };
        let rules = rules.validate().expect("a rule set");
        let seat = Seat::new(1);
        let searchers = Searchers::new(plays);
        let mut inside = searchers.agent(&rules, [3; 32]);
        let mut remote = RemoteAgent::made_by(Arc::new(searchers), [3; 32], Duration::ZERO);
        remote.on_attached(&v1::Attached {
            seat: 1,
            ..v1::Attached::default()
        });
        let mut events = Vec::new();
        let mut game = Game::new(rules, Seed([6; 32]), |event| events.push(event));
        remote.on_event(&started(&game));
        let mut others = BuiltInAgent::new(AgentKind::Random, [4; 32]);
        let by = By {
            source: v1::DecisionSource::Agent,
            decision_time_us: 0,
        };
        let mut asked = 0;
        while let Some(decision) = game.decision() {
            for event in events.drain(..) {
                inside.on_event(seat, &event);
                let seen = event.seen_by(Viewer::Seat(seat));
                remote.on_event(&v1::GameEvent {
                    kind: event_kind(&seen, rules.actions(), by),
                    ..v1::GameEvent::default()
                });
            }
            let observation = game.observe(Viewer::Seat(decision.seat));
            let legal = game.legal_actions();
            let mut action = others.decide(&observation, &legal);
            if decision.seat == seat {
                action = inside.decide(&observation, &legal);
                let answer = remote.decide(&request(&game)).0;
                assert_eq!(answer, u32::from(action.index()));
                asked += 1;
            }
            game.apply(action, |event| events.push(event))
                .expect("the action is legal");
        }
        assert!(asked > 10, "{asked}");
    }

    #[test]
    fn a_recorded_player_recognises_its_observations() {
        let rules = RuleSetSpec::default().validate().expect("the standard");
        let mut chance = BuiltInAgent::new(AgentKind::Random, [4; 32]);
        let mut game = Game::new(rules, Seed([5; 32]), |_| {});
        let (mut requests, mut decisions) = (Vec::new(), Vec::new());
        while let Some(decision) = game.decision() {
            let observation = game.observe(Viewer::Seat(decision.seat));
            let legal = game.legal_actions();
            let action = chance.decide(&observation, &legal);
            requests.push((decision, request(&game), action));
            decisions.push(RecordedDecision {
                observation,
                legal,
                action,
                // No model: only identical observations have an action.
                own: false,
            });
            game.apply(action, |_| {}).expect("the action is legal");
        }
        let player = Arc::new(RecordedPlayer::new(decisions));
        let mut remote = RemoteAgent::new(BuiltInAgent::replay(player), Duration::ZERO);
        remote.on_event(&started(&game));
        for (decision, request, action) in requests {
            remote.on_attached(&v1::Attached {
                seat: u32::try_from(decision.seat.index()).expect("a seat is below six"),
                ..v1::Attached::default()
            });
            assert_eq!(remote.decide(&request).0, u32::from(action.index()));
        }
    }

    #[test]
    fn malformed_requests_are_answered() {
        let rules = RuleSetSpec::default().validate().expect("the standard");
        let game = Game::new(rules, Seed([5; 32]), |_| {});
        let mut remote = RemoteAgent::new(
            BuiltInAgent::new(AgentKind::Greedy, [9; 32]),
            Duration::ZERO,
        );
        let first = game.legal_actions().nth(0).expect("an action is legal");
        assert_eq!(remote.decide(&request(&game)).0, u32::from(first.index()));
        remote.on_event(&started(&game));
        remote.on_attached(&v1::Attached {
            seat: 77,
            ..v1::Attached::default()
        });
        assert_eq!(remote.decide(&request(&game)).0, u32::from(first.index()));
        assert_eq!(remote.decide(&v1::DecisionRequest::default()), ActionId(0));
    }

    #[test]
    fn seeds_differ_by_use_and_number() {
        assert_eq!(seed_for("a", Some(1)), seed_for("a", Some(1)));
        assert_ne!(seed_for("a", Some(1)), seed_for("a", Some(2)));
        assert_ne!(seed_for("a", Some(1)), seed_for("b", Some(1)));
        assert_ne!(seed_for("a", None), seed_for("a", None));
    }
}
