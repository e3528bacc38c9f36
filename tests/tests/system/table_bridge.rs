//! A physical table over a real socket: a simulated one plays the truth with the rule engine, and a
//! bridge reports it.

use std::time::Duration;

use chefshat_client::{Client, TableFollower};
use chefshat_engine::{Action, ActionId, BySeat, Face, RuleSet, Seat, Seed};
use chefshat_proto::v1::{self, record_line::Line, table_report};
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
    real: RealTable,
    deck: Deck,
    at_table: BySeat<bool>,
    pub(crate) state: v1::TableState,
    pub(crate) reports: u32,
}

impl Bridge {
    /// Attaches to the table with this ticket, at which these seats play a game dealt from `seed`,
    /// and waits for its state.
    pub(crate) async fn attach(
        client: &Client,
        ticket: String,
        rules: RuleSet,
        seed: Seed,
        at_table: BySeat<bool>,
    ) -> Self {
        let mut bridge = Self {
            follower: client.follow_table(&ticket),
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
        let response = self.client.report(&self.ticket, report).await;
        let response = response.expect("the report is taken");
        self.state = response.state.clone().expect("a state");
        self.reports += 1;
        response
    }

    async fn accepted(&mut self, report: Report) {
        let response = self.report(report.clone()).await;
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
            v1::TableStage::Over => Stage::Over,
            stage => panic!("{stage:?} in a game without special actions"),
        }
    }

    fn awaits_the_table(&self) -> bool {
        match self.stage() {
            Stage::Hand(_) | Stage::Opening => true,
            Stage::Turn(seat) | Stage::Gift(seat) => self.at_table[seat],
            _ => false,
        }
    }

    /// Lays the cards of remote seats, and lets the truth follow them.
    async fn lay(&mut self) -> bool {
        let Some(decided) = self.state.to_lay.first().cloned() else {
            return false;
        };
        let seat = Seat::new(decided.seat as usize);
        let cards = decided.cards.clone().unwrap_or_default().cards;
        let open = self.real.truth.decision().expect("the game goes on");
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
            _ if cards.is_empty() => {
                self.pass_until(seat);
                self.decide(Action::Pass);
                table_report::Kind::Pass(v1::PassShown {
                    seat: Some(decided.seat),
                })
            }
            _ => {
                self.pass_until(seat);
                self.decide(play(&cards));
                table_report::Kind::Laid(v1::CardsLaid {
                    seat: Some(decided.seat),
                    cards: seen,
                })
            }
        };
        let response = self
            .send(v1::TableReport {
                kind: Some(kind),
                ..v1::TableReport::default()
            })
            .await;
        assert_eq!(
            response.verdict(),
            v1::ReportVerdict::Accepted,
            "{}",
            decided.text
        );
        true
    }

    /// Passes of remote seats need not be shown once another seat has acted.
    fn pass_until(&mut self, seat: Seat) {
        while (self.real.truth.decision()).is_some_and(|open| open.seat != seat) {
            self.decide(Action::Pass);
        }
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
                return;
            }
            if self.lay().await {
                continue;
            }
            if !self.awaits_the_table() {
                self.next_state().await;
                continue;
            }
            if done(self) {
                return;
            }
            let report = self.real.next_report(self.stage()).expect("the table acts");
            self.accepted(report).await;
        }
    }

    /// Reports a play with cards of the next lower face, and corrects it. Returns whether the next
    /// report of the table was such a play; it is made in any case.
    pub(crate) async fn misread(&mut self) -> bool {
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

/// The play that cards on the board are.
fn play(cards: &[u32]) -> Action {
    let faces: Vec<Face> = cards.iter().filter_map(|card| face(*card)).collect();
    let jokers = u8::try_from(cards.len() - faces.len()).expect("few");
    match faces.first() {
        Some(face) => Action::Play {
            face: *face,
            quantity: u8::try_from(faces.len()).expect("few"),
            jokers,
        },
        None => Action::LoneJoker,
    }
}
