//! A room under a simulated clock, for tests of the core and of the server.
#![allow(missing_docs, reason = "test support")]

mod chance;
pub mod real_table;

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::Duration;

use chefshat_engine::{
    ActionId, BySeat, Cards, Deal, Game, RULES_VERSION, RuleSet, RuleSetSpec, Script, Seat,
    SeatOrder, Seed, SeedPlan, Stop,
};

use crate::ids::{Id, SecretHash};
use crate::journal::{
    Change, Decided, Entry, Fill, GameHeader, GameStart, ParticipantKind, Report, ReportSource,
    Reported, SeatLabels, SeatedParticipant, StudyGame, StudyMember,
};
use crate::log::RoomEvent;
use crate::policy::Policy;
use crate::table::RoomGame;
use crate::{Answer, Answered, ConnectionId, Core, JoinError, ReportOutcome, Verdict};
pub use chance::Chance;

pub const OPEN: Fill = Fill::Open { reserved_for: None };

pub fn ms(milliseconds: u64) -> Duration {
    Duration::from_millis(milliseconds)
}

/// The id with this number.
pub const fn id<T>(number: u8) -> Id<T> {
    Id::from_bytes([number; 16])
}

/// The header of a game with a known seed.
pub fn header(policy: Policy, fills: Vec<Fill>, rules: RuleSetSpec) -> GameHeader {
    GameHeader {
        room_id: id(1),
        game_id: id(2),
        name: "table".into(),
        rules: rules.validate().expect("a valid rule set"),
        rules_version: RULES_VERSION,
        server_version: String::new(),
        participant_removed: false,
        policy,
        display_names: BTreeMap::new(),
        wizards: BTreeSet::new(),
        recorded: BTreeMap::new(),
        start: GameStart::default(),
        fills,
        seed: SeedPlan::Fixed { game_seed: [7; 32] },
        created_at_ms: 0,
        join_code: "CODE".into(),
        owner: SecretHash::of(b"owner"),
        tournament: None,
        table: None,
        study: None,
    }
}

/// A participant without a key.
pub fn participant(name: &str, kind: ParticipantKind) -> SeatedParticipant {
    SeatedParticipant {
        name: name.into(),
        name_fingerprint: String::new(),
        kind,
        ticket: SecretHash::of(b"ticket"),
    }
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
        Self {
            core: Core::new(Arc::new(header(policy, fills, rules))),
            now: Duration::ZERO,
            journal: Vec::new(),
            connections: 0,
            store_takes: Duration::ZERO,
        }
    }

    /// Creates a physical room: players at the table sit there from the start.
    pub fn physical(policy: Policy, fills: Vec<Fill>, rules: RuleSetSpec) -> Self {
        let mut table = Self::with_rules(policy, fills, rules);
        let mut header = GameHeader::clone(table.core.header());
        header.table = Some(SecretHash::of(b"table"));
        table.core = Core::new(Arc::new(header));
        for seat in table.core.all_seats() {
            if let Fill::AtTable(kind) = table.core.standing(seat).fill {
                let player = participant(&format!("player {seat}"), kind);
                table.core.seat(seat, player);
            }
        }
        table.core.begin_if_all_built_in(table.now);
        table.commit();
        table
    }

    /// Starts the game from a script. The seats are free.
    pub fn scripted(policy: Policy, fills: Vec<Fill>, rules: RuleSetSpec, script: Script) -> Self {
        let mut table = Self::with_rules(policy, fills, rules);
        let mut header = GameHeader::clone(table.core.header());
        header.start.script = Some(script);
        table.core = Core::new(Arc::new(header));
        table
    }

    /// Reports something from the table.
    pub fn report(&mut self, report: Report) -> ReportOutcome {
        self.report_late(report, Duration::ZERO)
    }

    /// Reports something that happened `age` ago.
    pub fn report_late(&mut self, report: Report, age: Duration) -> ReportOutcome {
        let reported = Reported {
            id: format!("report {}", self.core.changes()),
            source: ReportSource::Camera,
            age,
            report,
        };
        let outcome = self.core.report(self.now, reported);
        self.commit();
        outcome.expect("the report is accepted")
    }

    /// Creates a room of four remote agents whose game has started.
    pub fn playing(policy: Policy) -> Self {
        let mut table = Self::empty(policy, vec![OPEN; 4]);
        table.fill();
        table
    }

    /// Creates a room at the start of the second Shift, in which these seats hold the jokers.
    pub fn with_jokers_at(policy: Policy, fills: Vec<Fill>, holders: [Seat; 2]) -> Self {
        let rules = RuleSetSpec::default();
        let valid = rules.validate().expect("a valid rule set");
        let hands = dealt(&valid, 3, holders).expect("every seat has cards to swap");
        let mut table = Self::scripted(policy, fills, rules, second_shift(hands));
        table.fill();
        table
    }

    pub fn fill(&mut self) {
        self.join_all(ParticipantKind::Agent);
        self.attach_all();
    }

    /// Takes all free seats.
    pub fn join_all(&mut self, kind: ParticipantKind) {
        while self.join(kind).is_ok() {}
    }

    pub fn attach_all(&mut self) {
        for seat in self.core.all_seats() {
            self.attach(seat);
        }
    }

    pub fn join(&mut self, kind: ParticipantKind) -> Result<Seat, JoinError> {
        let joined = (self.core).join(self.now, None, participant("somebody", kind));
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

    /// Plays until a seat has to decide.
    pub fn play_until(&mut self, seat: Seat) {
        while self.open().0 != seat {
            self.play_one();
        }
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

    /// All decisions, with their seats.
    pub fn decided(&self) -> Vec<(Seat, ActionId)> {
        let decided = |entry: &Entry| match &entry.change {
            Change::Decided(decided) => Some((decided.seat, decided.action)),
            _ => None,
        };
        self.journal.iter().filter_map(decided).collect()
    }

    /// How often a substitute has taken a seat.
    pub fn substituted(&self) -> usize {
        self.happened(|event| matches!(event, RoomEvent::Substituted(_)))
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
        // A long log has dropped its first events.
        let first = replayed.log().first().max(self.core.log().first());
        let kept = |core: &Core| {
            let events: Vec<_> = core.log().since(first).collect();
            format!("{} {events:?}", core.log().len())
        };
        assert_eq!(kept(&replayed), kept(&self.core));
        assert_eq!(replayed.state(), self.core.state());
        assert_eq!(replayed.decisions(), self.core.decisions());
        assert_eq!(
            replayed.open().map(|open| (open.decision, open.id)),
            self.core.open().map(|open| (open.decision, open.id))
        );
    }
}

/// The connection that a seat got when its table was filled.
pub fn first_connection(seat: Seat) -> ConnectionId {
    ConnectionId(seat.index() as u64 + 1)
}

/// The second Shift of a game, in which the seats were ranked by their numbers.
pub fn second_shift(hands: BySeat<Cards>) -> Script {
    let seats: Vec<Seat> = hands.seats().collect();
    Script {
        shift: 2,
        last_order: SeatOrder::from_slice(&seats),
        ..Script::first_shift(hands)
    }
}

/// The hands dealt from a seed, with the jokers moved to these seats.
pub fn dealt(rules: &RuleSet, seed: u8, jokers: [Seat; 2]) -> Option<BySeat<Cards>> {
    let hands = Deal::new(rules, Seed([seed; 32]), 2).hands();
    with_jokers_at(jokers, &hands, rules.faces())
}

/// The hands after the jokers were exchanged for cards of these seats: for those of the highest
/// face below the top face, so that neither forced gifts nor the holder of the Golden card change.
pub fn with_jokers_at(
    holders: [Seat; 2],
    hands: &BySeat<Cards>,
    faces: u8,
) -> Option<BySeat<Cards>> {
    let joker = usize::from(faces);
    let mut counts: Vec<Vec<u8>> = (hands.seats())
        .map(|seat| hands[seat].counts(faces).collect())
        .collect();
    let wanted = |seat| holders.iter().filter(|it| it.index() == seat).count();
    loop {
        let held = |seat: usize| usize::from(counts[seat][joker]);
        let mut seats = 0..hands.len();
        let Some(to) = seats.clone().find(|seat| held(*seat) < wanted(*seat)) else {
            break;
        };
        let from = seats.find(|seat| held(*seat) > wanted(*seat))?;
        let face = (0..joker - 1).rev().find(|face| counts[to][*face] > 0)?;
        for (seat, gets, gives) in [(to, joker, face), (from, face, joker)] {
            counts[seat][gets] += 1;
            counts[seat][gives] -= 1;
        }
    }
    let mut changed = *hands;
    for (seat, counts) in hands.seats().zip(&counts) {
        changed[seat] = Cards::from_counts(faces, counts, hands[seat].has_golden())?;
    }
    Some(changed)
}

/// The game of a study whose participant has seat 0.
pub fn study_game(labels: SeatLabels) -> StudyGame {
    StudyGame {
        study: id(9),
        name: "study".into(),
        condition: "condition".into(),
        levels: [("factor".to_owned(), "level".to_owned())].into(),
        members: vec![study_member(1, "Ana", 0)],
        group: None,
        step: 0,
        practice: false,
        seed_index: Some(0),
        attempt: 1,
        labels,
    }
}

/// A participant of a study.
pub fn study_member(number: u32, participant: &str, seat: usize) -> StudyMember {
    StudyMember {
        number,
        participant: participant.into(),
        session: 1,
        seat: Seat::new(seat),
    }
}

/// Rules for games of one Shift.
pub fn one_shift() -> RuleSetSpec {
    shifts(1)
}

/// Rules for games of a number of Shifts.
pub fn shifts(count: u32) -> RuleSetSpec {
    RuleSetSpec {
        stop: Stop::Shifts(count),
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
        let game = self.game().expect("the game has started");
        let hands = change(game)?;
        let game = game.with_hands(hands).ok()?;
        self.game = Some(RoomGame::Dealt(Box::new(game)));
        self.log.replace_hands(&hands);
        Some(())
    }
}
