//! The core of a room under an invented clock: what happens when is said by the tests.

mod clocks;
mod hidden;
mod revival;
mod seats;
mod strange;

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use chefshat_engine::{ActionId, RULES_VERSION, RuleSetSpec, Seat, Stop};
use chefshat_records::seeds::SeedPlan;

use super::{AnswerInput, Answered, ConnectionId, Core, State, Verdict};
use crate::ids::{Id, SecretHash};
use crate::room::log::Happening;
use crate::room::policy::Policy;
use crate::store::journal::{
    Change, Decided, Entry, Fill, GameHeader, GameStart, ParticipantKind, SeatedParticipant, Source,
};

const OPEN: Fill = Fill::Open { reserved_for: None };

fn ms(milliseconds: u64) -> Duration {
    Duration::from_millis(milliseconds)
}

/// A room on a table: the core, a clock, and the journal that a store would have kept.
struct Table {
    core: Core,
    now: Duration,
    journal: Vec<Entry>,
    connections: u64,
    /// How long the store takes for what it is given next.
    store_takes: Duration,
}

impl Table {
    /// A room whose seats are free.
    fn empty(policy: Policy, fills: Vec<Fill>) -> Self {
        Self::with_rules(policy, fills, RuleSetSpec::default())
    }

    fn with_rules(policy: Policy, fills: Vec<Fill>, rules: RuleSetSpec) -> Self {
        let header = Arc::new(GameHeader {
            room_id: Id([1; 16]),
            game_id: Id([2; 16]),
            name: "table".into(),
            rules: rules.validate().expect("the rule set makes sense"),
            rules_version: RULES_VERSION,
            policy,
            called: BTreeMap::new(),
            recorded: BTreeMap::new(),
            start: GameStart::default(),
            fills,
            seed: SeedPlan::Fixed { game_seed: [7; 32] },
            created_at_ms: 0,
            join_code: "CODE".into(),
            owner: SecretHash::of(b"owner"),
            tournament: None,
        });
        Self {
            core: Core::new(header),
            now: Duration::ZERO,
            journal: Vec::new(),
            connections: 0,
            store_takes: Duration::ZERO,
        }
    }

    /// A room of four remote agents whose game has begun.
    fn playing(policy: Policy) -> Self {
        let mut table = Self::empty(policy, vec![OPEN; 4]);
        table.fill();
        table
    }

    fn fill(&mut self) {
        let seats: Vec<Seat> = self.core.all_seats().collect();
        for _ in &seats {
            let _ = self.join(ParticipantKind::Agent);
        }
        for seat in seats {
            self.attach(seat);
        }
    }

    fn join(&mut self, kind: ParticipantKind) -> Result<Seat, super::JoinError> {
        let joined = self.core.join(
            self.now,
            None,
            SeatedParticipant {
                name: "somebody".into(),
                kind,
                ticket: SecretHash::of(b"ticket"),
            },
        );
        self.keep();
        joined
    }

    fn attach(&mut self, seat: Seat) -> ConnectionId {
        self.connections += 1;
        let connection = ConnectionId(self.connections);
        // The connection before it, where there is one, has handed over everything.
        let handed = (self.core.standing(seat).connected).then_some(self.now);
        self.core
            .attach(self.now, seat, connection, Vec::new(), self.now, handed);
        self.keep();
        connection
    }

    fn lost(&mut self, seat: Seat, connection: ConnectionId) {
        self.core.lost(self.now, seat, connection, None);
        self.keep();
    }

    /// Lets time pass, ringing at every deadline on the way.
    fn pass_time(&mut self, time: Duration) {
        let until = self.now + time;
        while let Some(deadline) = self.core.deadline().filter(|deadline| *deadline <= until) {
            self.now = self.now.max(deadline);
            // The transport, where there is one, took every request the moment it was released.
            let connected = |seat| self.core.standing(seat).connected;
            let handed = (self.core.open())
                .filter(|open| connected(open.decision.seat))
                .map(|open| open.released);
            self.core.tick(self.now, handed);
            self.keep();
        }
        self.now = until;
    }

    fn open(&self) -> (Seat, u64) {
        let open = self.core.open().expect("a decision is open");
        (open.decision.seat, open.id)
    }

    fn legal(&self, index: usize) -> u32 {
        let legal = self.core.legal_actions();
        let action = legal.nth(index % legal.len()).expect("below the length");
        action.index().into()
    }

    /// An action that is not legal now.
    fn illegal(&self) -> u32 {
        let legal = self.core.legal_actions();
        (0..500)
            .find(|number| !legal.contains(ActionId::new(*number)))
            .expect("not everything is legal")
            .into()
    }

    fn answer(&mut self, seat: Seat, decision_id: u64, action: u32) -> Answered {
        let handed = self.core.open().map(|open| open.released);
        let answered = self.core.answer(
            self.now,
            AnswerInput {
                seat,
                decision_id,
                action,
                annotations: None,
                annotations_refused: false,
                arrived: self.now,
                handed,
            },
        );
        self.keep();
        answered
    }

    /// The seat whose decision is open takes its first legal action.
    fn play_one(&mut self) -> Seat {
        let (seat, id) = self.open();
        let action = self.legal(0);
        assert_eq!(self.answer(seat, id, action).verdict, Verdict::Accepted);
        seat
    }

    fn keep(&mut self) {
        self.journal.append(self.core.unkept());
        self.now += std::mem::take(&mut self.store_takes);
        self.core.released(self.now);
    }

    fn last_decision(&self) -> &Decided {
        self.journal
            .iter()
            .rev()
            .find_map(|entry| match &entry.change {
                Change::Decided(decided) => Some(decided),
                _ => None,
            })
            .expect("a decision has been taken")
    }

    fn happened(&self, wanted: impl Fn(&Happening) -> bool) -> usize {
        self.core
            .log()
            .since(0)
            .iter()
            .filter(|entry| wanted(&entry.happening))
            .count()
    }

    /// The journal, folded anew, gives the same log and the same game.
    fn assert_replays(&self) {
        let replayed = Core::replay(Arc::clone(self.core.header()), &self.journal);
        assert_eq!(
            format!("{:?}", replayed.log()),
            format!("{:?}", self.core.log())
        );
        assert_eq!(replayed.state(), self.core.state());
        assert_eq!(replayed.decisions(), self.core.decisions());
        assert_eq!(
            replayed.open().map(|open| (open.decision, open.id)),
            self.core.open().map(|open| (open.decision, open.id))
        );
    }
}

/// Rules under which a game is over after one Shift.
fn one_shift() -> RuleSetSpec {
    RuleSetSpec {
        stop: Stop::Shifts(1),
        ..RuleSetSpec::default()
    }
}
