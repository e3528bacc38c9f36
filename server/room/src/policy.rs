//! The validated policy of a room: times, limits, and the response to lost participants.

use std::time::Duration;

use chefshat_agents::{AgentKind, NamedAgent, ParticipantKind};
use chefshat_engine::RewardScheme;

/// When a game is aborted because participants are lost.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AbortPolicy {
    /// When every seat without a built-in agent has been substituted.
    AllLost,
    /// When one seat would be substituted.
    AnyLost,
    /// Never.
    Never,
}

/// What unfinished games survive.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Durability {
    /// A crash or restart of the server.
    Durable,
    /// Nothing: only a finished game is stored.
    Ephemeral,
}

/// Who sees a room or tournament, and the records of its games.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Visibility {
    /// Listed, and reached by its id.
    #[default]
    Public,
    /// Reached by its id, but listed only for those who show a secret of it.
    Unlisted,
    /// Listed and reached only for those who show a secret of it.
    Private,
}

/// Times for participants of one kind, which override the room's.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct KindClock {
    /// The kind.
    pub kind: ParticipantKind,
    /// Time for a decision; `None`: the room's.
    pub decision_time: Option<Duration>,
    /// The bank; `None`: the room's.
    pub bank: Option<Duration>,
    /// The absence time; `None`: the room's.
    pub absence_time: Option<Duration>,
}

impl KindClock {
    /// The default times for language models, which think before they answer.
    pub const MODELS: Self = Self {
        kind: ParticipantKind::Model,
        decision_time: Some(Duration::from_secs(60)),
        bank: Some(Duration::from_secs(300)),
        absence_time: Some(Duration::from_secs(60)),
    };

    /// The default times for people.
    pub const PEOPLE: Self = Self {
        kind: ParticipantKind::Human,
        decision_time: Some(Duration::from_secs(60)),
        bank: Some(Duration::from_secs(300)),
        absence_time: Some(ABSENCE_TIME_OF_PEOPLE),
    };
}

/// The default absence time of people.
pub const ABSENCE_TIME_OF_PEOPLE: Duration = Duration::from_secs(20);

/// The same in tournaments, where those at other tables wait too: two absences, one in each of two
/// games, together hold nobody up for half a minute.
pub const ABSENCE_TIME_IN_TOURNAMENTS: Duration = Duration::from_secs(12);

/// Default pace of built-in agents and substitutes in a game with people.
const PACE_WITH_PEOPLE: Duration = Duration::from_secs(1);

/// The policy of a room. `convert::policy` in `chefshat-wire` checks the ranges stated in
/// `room.proto`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Policy {
    /// Time for a decision.
    pub decision_time: Duration,
    /// Extra time of each seat, for the whole game.
    pub bank: Duration,
    /// Invalid attempts after which the default decision is taken; `None`: unlimited.
    pub max_invalid_attempts: Option<u32>,
    /// Timeouts in a row after which a seat is substituted.
    pub max_timeouts: u32,
    /// The agent that plays for a substituted seat.
    pub substitute: NamedAgent,
    /// When the game is aborted instead of substituting a seat.
    pub abort: AbortPolicy,
    /// The scheme of the rewards that seats receive.
    pub reward_scheme: Option<RewardScheme>,
    /// How long a built-in agent or substitute waits before it decides; `None`: depends on whether
    /// people play.
    pub pace: Option<Duration>,
    /// How long the room waits for its seats to be attached.
    pub waiting_time: Duration,
    /// Whether spectators may watch.
    pub spectators: bool,
    /// By how many decisions spectators are delayed.
    pub spectator_delay_decisions: usize,
    /// Whether spectators see all hands.
    pub spectators_see_hands: bool,
    /// What the unfinished game survives.
    pub durability: Durability,
    /// Times for kinds of participants, each kind at most once.
    pub clocks: Vec<KindClock>,
    /// Whether a client may take only one seat.
    pub one_seat_per_client: bool,
    /// Who sees the room and its record.
    pub visibility: Visibility,
    /// Whether seats may ask for hints.
    pub hints: bool,
    /// Whether people may write.
    pub chat: bool,
    /// How long the game waits, at each decision, for a seat that is not connected. `None`, in
    /// games of earlier servers: an absence changes nothing.
    pub absence_time: Option<Duration>,
}

impl Policy {
    /// Time for a decision of a kind of participant. Built-in agents (`None`) use the room's.
    pub fn decision_time_of(&self, kind: Option<ParticipantKind>) -> Duration {
        (self.clock_of(kind).and_then(|clock| clock.decision_time)).unwrap_or(self.decision_time)
    }

    /// The bank of a kind of participant.
    pub fn bank_of(&self, kind: Option<ParticipantKind>) -> Duration {
        (self.clock_of(kind).and_then(|clock| clock.bank)).unwrap_or(self.bank)
    }

    /// The absence time of a kind of participant: at most its decision time.
    pub fn absence_time_of(&self, kind: Option<ParticipantKind>) -> Option<Duration> {
        let own = self.clock_of(kind).and_then(|clock| clock.absence_time);
        let time = own.or(self.absence_time)?;
        Some(time.min(self.decision_time_of(kind)))
    }

    /// Sets the absence times that were not chosen: this one for people, the decision time for
    /// others.
    pub fn set_default_absence_times(&mut self, of_people: Duration) {
        if self.absence_time.is_some() {
            return;
        }
        self.absence_time = Some(self.decision_time);
        for clock in &mut self.clocks {
            let standard = match clock.kind {
                ParticipantKind::Human => Some(of_people),
                _ => clock.decision_time,
            };
            clock.absence_time = clock.absence_time.or(standard);
        }
        let has_people = |clock: &KindClock| clock.kind == ParticipantKind::Human;
        if !self.clocks.iter().any(has_people) && self.decision_time > of_people {
            self.clocks.push(KindClock {
                kind: ParticipantKind::Human,
                decision_time: None,
                bank: None,
                absence_time: Some(of_people),
            });
        }
    }

    /// How long a built-in agent or substitute waits before it decides. `with_people`: whether
    /// people play.
    pub fn pace_of(&self, with_people: bool) -> Duration {
        let standard = match with_people {
            true => PACE_WITH_PEOPLE,
            false => Duration::ZERO,
        };
        self.pace.unwrap_or(standard)
    }

    fn clock_of(&self, kind: Option<ParticipantKind>) -> Option<&KindClock> {
        self.clocks.iter().find(|clock| Some(clock.kind) == kind)
    }
}

impl Default for Policy {
    fn default() -> Self {
        Self {
            decision_time: Duration::from_secs(10),
            bank: Duration::from_secs(60),
            max_invalid_attempts: Some(10),
            max_timeouts: 3,
            substitute: NamedAgent::Kind(AgentKind::Random),
            abort: AbortPolicy::AllLost,
            reward_scheme: None,
            pace: None,
            waiting_time: Duration::from_secs(3600),
            spectators: true,
            spectator_delay_decisions: 0,
            spectators_see_hands: false,
            durability: Durability::Durable,
            clocks: vec![KindClock::PEOPLE, KindClock::MODELS],
            one_seat_per_client: false,
            visibility: Visibility::Public,
            hints: false,
            chat: false,
            absence_time: Some(Duration::from_secs(10)),
        }
    }
}
