//! A physical table over a real socket: a simulated one plays the truth with the rule engine, and a
//! bridge reports it.

use std::collections::VecDeque;
use std::time::Duration;

use chefshat_client::{Client, Error, Spectator, TableFollower};
use chefshat_engine::{Action, ActionId, BySeat, DecisionKind, Face, RuleSet, Seat, Seed};
use chefshat_proto::v1::{self, game_event::Kind, record_line::Line, table_report};
use chefshat_record::convert::{final_table, seat_number};
use chefshat_record::replay;
use chefshat_referee::{Report, Stage};
use chefshat_room::journal::{ReportSource, Reported};
use chefshat_room::testing::real_table::RealTable;
use chefshat_server::convert::{Deck, report_to_proto};
use chefshat_tests::patiently;

/// A real table with a bridge that reports what happens there.
pub(crate) struct Bridge {
    client: Client,
    pub(crate) ticket: String,
    pub(crate) follower: TableFollower,
    events: Spectator,
    /// Turns of remote seats that the truth has not followed yet, with the numbers of their events.
    turns: VecDeque<(u64, ActionId)>,
    /// Corrections whose events have not been read.
    corrections: u32,
    real: RealTable,
    deck: Deck,
    at_table: BySeat<bool>,
    pub(crate) state: v1::TableState,
    pub(crate) reports: u32,
}

impl Bridge {
    /// Attaches to the table of a room with its ticket, at which these seats play a game dealt from
    /// `seed`, and waits for its state.
    pub(crate) async fn attach(
        client: &Client,
        room_id: &str,
        ticket: String,
        rules: RuleSet,
        seed: Seed,
        at_table: BySeat<bool>,
    ) -> Self {
        let mut bridge = Self {
            follower: client.follow_table(&ticket),
            events: client.spectate(room_id, 0),
            turns: VecDeque::new(),
            corrections: 0,
            ticket,
            client: client.clone(),
            real: RealTable::new(rules, seed, at_table),
            deck: Deck::of(&rules),
            at_table,
            state: v1::TableState::default(),
            reports: 0,
        };
        bridge.next_state().await;
        bridge
    }

    pub(crate) async fn report(&mut self, report: Report) -> v1::ReportResponse {
        let reported = Reported {
            id: String::new(),
            source: ReportSource::Camera,
            age: Duration::from_millis(1),
            report,
        };
        self.send(report_to_proto(&reported, self.deck)).await
    }

    pub(crate) async fn send(&mut self, report: v1::TableReport) -> v1::ReportResponse {
        let response = self.try_send(report).await;
        response.expect("the report is taken")
    }

    async fn try_send(&mut self, report: v1::TableReport) -> Result<v1::ReportResponse, Error> {
        let response = self.client.report(&self.ticket, report).await?;
        self.state = response.state.clone().expect("a state");
        self.reports += 1;
        Ok(response)
    }

    async fn accepted(&mut self, report: Report) {
        let mut response = self.report(report.clone()).await;
        // Nobody says when the board is cleared: the cards that ended a pizza may still lie there.
        let question = self.state.questions.first().cloned();
        if let Some(question) = question.filter(|it| it.text.starts_with("Is that a new play")) {
            let answer = Report::Answer {
                id: question.question_id,
                option: Some(0),
            };
            response = self.report(answer).await;
        }
        let verdict = response.verdict();
        assert_eq!(
            verdict,
            v1::ReportVerdict::Accepted,
            "{report:?}: {}",
            response.detail
        );
    }

    /// Waits for a state that is newer than the last one.
    pub(crate) async fn next_state(&mut self) {
        loop {
            let state = patiently("a state", self.follower.next()).await;
            let state = state.expect("it follows").expect("the game is not over");
            if state.version > self.state.version {
                self.state = state;
                return;
            }
        }
    }

    fn stage(&self) -> Stage {
        let seat = || Seat::new(self.state.seat.expect("a seat") as usize);
        match self.state.stage() {
            v1::TableStage::Hand => Stage::Hand(seat()),
            v1::TableStage::Gift => Stage::Gift(seat()),
            v1::TableStage::Opening => Stage::Opening,
            v1::TableStage::Turn => Stage::Turn(seat()),
            v1::TableStage::Question => Stage::Question,
            v1::TableStage::Confirmation => Stage::Confirmation,
            v1::TableStage::Over => Stage::Over,
            stage => panic!("{stage:?} in a game without special actions"),
        }
    }

    fn awaits_the_table(&self) -> bool {
        match self.stage() {
            Stage::Hand(_) | Stage::Opening | Stage::Confirmation => true,
            Stage::Turn(seat) | Stage::Gift(seat) => self.at_table[seat],
            _ => false,
        }
    }

    /// Whether remote seats have taken turns that the truth has not followed.
    fn is_behind(&self) -> bool {
        let Some(open) = self.real.truth.decision() else {
            return false;
        };
        let shift = (self.state.observation.as_ref()).map_or(0, |observation| observation.shift);
        // A Shift whose hands are reported has no turns yet.
        let dealt = matches!(self.stage(), Stage::Hand(_)) && self.real.truth.shift() == shift;
        open.kind == DecisionKind::Turn && !self.at_table[open.seat] && !dealt
    }

    /// Lets the truth follow the turns of remote seats. Not all of them are laid: passes need not be
    /// shown once another seat has acted.
    async fn follow(&mut self) {
        // First, because it makes some of the turns void.
        while self.corrections > 0 {
            self.read_event().await;
        }
        while self.is_behind() {
            match self.turns.pop_front() {
                Some((_, action)) => self.real.decide(action),
                None => self.read_event().await,
            }
        }
    }

    async fn read_event(&mut self) {
        let event = patiently("an event", self.events.next()).await;
        let event = event.expect("spectators are admitted");
        let event = event.expect("the game is not over");
        let actions = self.real.truth.rules().actions();
        let (seat, action) = match event.kind {
            Some(Kind::Play(play)) => {
                let action = ActionId::new(u16::try_from(play.action).expect("an action"));
                (play.seat, Some(action))
            }
            Some(Kind::Pass(pass)) => (pass.seat, actions.encode(Action::Pass)),
            Some(Kind::Correction(correction)) => {
                self.corrections -= 1;
                if correction.first_void > 0 {
                    (self.turns).retain(|(number, _)| *number < correction.first_void);
                }
                return;
            }
            _ => return,
        };
        if !self.at_table[Seat::new(seat as usize)] {
            (self.turns).extend(action.map(|action| (event.sequence, action)));
        }
    }

    /// Lays the cards of remote seats. The truth follows their gifts.
    async fn lay(&mut self) -> bool {
        let Some(decided) = self.state.to_lay.first().cloned() else {
            return false;
        };
        let seat = Seat::new(decided.seat as usize);
        let cards = decided.cards.clone().unwrap_or_default().cards;
        let open = self.real.truth.decision().expect("the game is not over");
        let seen = Some(v1::SeenCards {
            cards: cards.clone(),
            golden: decided.cards.as_ref().and_then(|cards| cards.golden),
        });
        let kind = match decided.kind() {
            v1::DecisionKind::Exchange => {
                // A forced gift is no decision.
                if open.seat == seat {
                    for card in &cards {
                        let gift = match face(*card) {
                            Some(face) => Action::Give(face),
                            None => Action::GiveJoker,
                        };
                        self.decide(gift);
                    }
                }
                table_report::Kind::Gift(v1::GiftSeen {
                    seat: decided.seat,
                    cards: seen,
                })
            }
            _ if cards.is_empty() => table_report::Kind::Pass(v1::PassShown {
                seat: Some(decided.seat),
            }),
            _ => table_report::Kind::Laid(v1::CardsLaid {
                seat: Some(decided.seat),
                cards: seen,
            }),
        };
        let report = v1::TableReport {
            kind: Some(kind),
            ..v1::TableReport::default()
        };
        let version = self.state.version;
        match self.try_send(report).await {
            // Another remote seat has acted since this state: the pass need not be shown.
            Ok(response) if response.verdict() == v1::ReportVerdict::Known => {
                let is_newer = self.state.version > version;
                assert!(cards.is_empty() && is_newer, "{}", decided.text);
            }
            Ok(response) => assert_eq!(
                response.verdict(),
                v1::ReportVerdict::Accepted,
                "{}",
                decided.text
            ),
            // Another remote seat has ended the game.
            Err(error) if error.reason() == Some("GAME_OVER") => self.next_state().await,
            Err(error) => panic!("{}: {error}", decided.text),
        }
        true
    }

    fn decide(&mut self, action: Action) {
        let actions = self.real.truth.rules().actions();
        let action = actions.encode(action).expect("the deck has these cards");
        self.real.decide(action);
    }

    /// Plays until a condition holds before a report of the table, or the game is over.
    pub(crate) async fn until(&mut self, mut done: impl FnMut(&Self) -> bool) {
        loop {
            if self.state.stage() == v1::TableStage::Over {
                self.follow().await;
                return;
            }
            let is_played = self.state.stage() == v1::TableStage::Confirmation;
            if !is_played && self.lay().await {
                continue;
            }
            if !self.awaits_the_table() {
                self.next_state().await;
                continue;
            }
            if done(self) {
                return;
            }
            self.follow().await;
            let report = self.real.next_report(self.stage()).expect("the table acts");
            self.accepted(report).await;
        }
    }

    /// Reports a play with cards of the next lower face, and corrects it. Returns whether the next
    /// report of the table was such a play; it is made in any case.
    pub(crate) async fn misread(&mut self) -> bool {
        self.follow().await;
        let right = self.real.next_report(self.stage()).expect("the table acts");
        let wrong = match &right {
            Report::Laid { seat, cards } => {
                (2..11).find(|face| cards.counts[*face] == 1).map(|face| {
                    let mut cards = *cards;
                    (cards.counts[face], cards.counts[face - 1]) = (0, 1);
                    Report::Laid { seat: *seat, cards }
                })
            }
            _ => None,
        };
        let Some(wrong) = wrong else {
            self.accepted(right).await;
            return false;
        };
        let response = self.report(wrong).await;
        if response.verdict() != v1::ReportVerdict::Accepted {
            self.accepted(right).await;
            return false;
        }
        let correction = Report::Correction {
            number: response.report,
            instead: Some(Box::new(right)),
        };
        self.accepted(correction).await;
        self.corrections += 1;
        true
    }

    /// Checks that a record verifies and contains the game that was played at the table.
    pub(crate) fn assert_recorded(&self, record: &[v1::RecordLine]) {
        let replayed = replay::replay(record).expect("the record verifies");
        let standings = self.real.truth.standings().expect("the truth is over");
        assert_eq!(replayed.standings, final_table(&standings));
        let truth = self.real.decisions.iter();
        let truth = truth
            .map(|(seat, action)| (seat_number(*seat), action.index().into()))
            .collect();
        assert_eq!(self.sorted(decisions(record)), self.sorted(truth));
    }

    /// Decisions with the cards of each gift sorted: they have no order at a table.
    fn sorted(&self, mut decisions: Vec<(u32, u32)>) -> Vec<(u32, u32)> {
        let actions = self.real.truth.rules().actions();
        let is_gift = |action: u32| {
            let action = actions.decode(ActionId::new(u16::try_from(action).expect("an action")));
            matches!(action, Some(Action::Give(_) | Action::GiveJoker))
        };
        let gift = |a: &(u32, u32), b: &(u32, u32)| a.0 == b.0 && is_gift(a.1) && is_gift(b.1);
        (decisions.chunk_by_mut(gift)).for_each(<[(u32, u32)]>::sort_unstable);
        decisions
    }
}

/// Seat and action of all decisions of a record.
fn decisions(lines: &[v1::RecordLine]) -> Vec<(u32, u32)> {
    let lines = lines.iter();
    lines
        .filter_map(|line| match &line.line {
            Some(Line::Decision(decision)) => Some((decision.seat, decision.action)),
            _ => None,
        })
        .collect()
}

fn face(card: u32) -> Option<Face> {
    Face::new(u8::try_from(card).ok()?).filter(|face| face.get() <= 11)
}
