//! A room under a simulated clock, for tests of the core and of the server.
#![allow(missing_docs, reason = "test support")]

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use chefshat_engine::{
    ActionId, BySeat, Cards, Game, RULES_VERSION, RuleSetSpec, Seat, SeedPlan, Stop,
};

use crate::ids::{Id, SecretHash};
use crate::journal::{
    Change, Decided, Entry, Fill, GameHeader, GameStart, ParticipantKind, SeatedParticipant,
};
use crate::log::RoomEvent;
use crate::policy::Policy;
use crate::{Answer, Answered, ConnectionId, Core, JoinError, Verdict};

pub const OPEN: Fill = Fill::Open { reserved_for: None };

pub fn ms(milliseconds: u64) -> Duration {
    Duration::from_millis(milliseconds)
}

/// A room under test: the core, a clock, and the journal of committed changes.
pub struct Table {
    pub core: Core,
    pub now: Duration,
    pub journal: Vec<Entry>,
    pub connections: u64,
    /// How long the next commit takes.
    pub store_takes: Duration,
}

impl Table {
    /// Creates a room whose seats are free.
    pub fn empty(policy: Policy, fills: Vec<Fill>) -> Self {
        Self::with_rules(policy, fills, RuleSetSpec::default())
    }

    pub fn with_rules(policy: Policy, fills: Vec<Fill>, rules: RuleSetSpec) -> Self {
        let header = Arc::new(GameHeader {
            room_id: Id([1; 16]),
            game_id: Id([2; 16]),
            name: "table".into(),
            rules: rules.validate().expect("a valid rule set"),
            rules_version: RULES_VERSION,
            policy,
            display_names: BTreeMap::new(),
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

    /// Creates a room of four remote agents whose game has started.
    pub fn playing(policy: Policy) -> Self {
        let mut table = Self::empty(policy, vec![OPEN; 4]);
        table.fill();
        table
    }

    pub fn fill(&mut self) {
        let seats: Vec<Seat> = self.core.all_seats().collect();
        for _ in &seats {
            let _ = self.join(ParticipantKind::Agent);
        }
        for seat in seats {
            self.attach(seat);
        }
    }

    pub fn join(&mut self, kind: ParticipantKind) -> Result<Seat, JoinError> {
        let joined = self.core.join(
            self.now,
            None,
            SeatedParticipant {
                name: "somebody".into(),
                kind,
                ticket: SecretHash::of(b"ticket"),
            },
        );
        self.commit();
        joined
    }

    pub fn attach(&mut self, seat: Seat) -> ConnectionId {
        self.connections += 1;
        let connection = ConnectionId(self.connections);
        // The transport of an earlier connection has received everything.
        let handed = (self.core.standing(seat).connected).then_some(self.now);
        self.core
            .attach(self.now, seat, connection, Vec::new(), self.now, handed);
        self.commit();
        connection
    }

    pub fn lost(&mut self, seat: Seat, connection: ConnectionId) {
        self.core.lost(self.now, seat, connection, None);
        self.commit();
    }

    /// Advances the time, ticking at every deadline on the way.
    pub fn pass_time(&mut self, time: Duration) {
        let until = self.now + time;
        while let Some(deadline) = self.core.deadline().filter(|deadline| *deadline <= until) {
            self.now = self.now.max(deadline);
            // The transport received every request as soon as it was released.
            let connected = |seat| self.core.standing(seat).connected;
            let handed = (self.core.open())
                .filter(|open| connected(open.decision.seat))
                .map(|open| open.released);
            self.core.tick(self.now, handed);
            self.commit();
        }
        self.now = until;
    }

    pub fn open(&self) -> (Seat, u64) {
        let open = self.core.open().expect("a decision is open");
        (open.decision.seat, open.id)
    }

    pub fn legal(&self, index: usize) -> u32 {
        let legal = self.core.legal_actions();
        let action = legal.nth(index % legal.len()).expect("below the length");
        action.index().into()
    }

    /// An action that is illegal now.
    pub fn illegal(&self) -> u32 {
        let legal = self.core.legal_actions();
        (0..500)
            .find(|number| !legal.contains(ActionId::new(*number)))
            .expect("some action is illegal")
            .into()
    }

    pub fn answer(&mut self, seat: Seat, decision_id: u64, action: u32) -> Answered {
        let handed = self.core.open().map(|open| open.released);
        let answer = Answer::new(decision_id, action);
        let answered = self.core.answer(self.now, seat, answer, self.now, handed);
        self.commit();
        answered
    }

    /// Plays the first legal action of the open decision. Returns its seat.
    pub fn play_one(&mut self) -> Seat {
        let (seat, id) = self.open();
        let action = self.legal(0);
        assert_eq!(self.answer(seat, id, action).verdict, Verdict::Accepted);
        seat
    }

    pub fn commit(&mut self) {
        self.journal.append(self.core.pending());
        self.now += std::mem::take(&mut self.store_takes);
        self.core.released(self.now);
    }

    pub fn last_decision(&self) -> &Decided {
        self.journal
            .iter()
            .rev()
            .find_map(|entry| match &entry.change {
                Change::Decided(decided) => Some(decided),
                _ => None,
            })
            .expect("a decision has been taken")
    }

    pub fn happened(&self, wanted: impl Fn(&RoomEvent) -> bool) -> usize {
        self.core
            .log()
            .since(0)
            .filter(|entry| wanted(&entry.event))
            .count()
    }

    /// Folding the journal again gives the same log and the same game.
    pub fn assert_replays(&self) {
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

/// Rules for games of one Shift.
pub fn one_shift() -> RuleSetSpec {
    RuleSetSpec {
        stop: Stop::Shifts(1),
        ..RuleSetSpec::default()
    }
}

impl Core {
    /// Replaces the dealt hands in the game and in the log, for tests of redaction. `None` if the
    /// hands are inconsistent.
    pub fn replace_hands(
        &mut self,
        change: impl FnOnce(&Game) -> Option<BySeat<Cards>>,
    ) -> Option<()> {
        let game = self.game.as_ref().expect("the game has started");
        let hands = change(game)?;
        self.game = Some(Box::new(game.with_hands(hands).ok()?));
        self.log.replace_hands(&hands);
        Some(())
    }
}
