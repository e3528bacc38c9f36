//! A physical room over real sockets: two persons at the table, an agent in this process and a
//! built-in agent. A simulated table plays the truth with the rule engine and reports it, once
//! wrongly, once against the rules, with a question, and across a crash of the server.

use std::time::Duration;

use chefshat_client::{Client, Error, RandomAgent, TableFollower};
use chefshat_engine::{Action, ActionId, BySeat, Face, Seat, Seed};
use chefshat_proto::v1::{
    self, game_event::Kind, record_line::Line, seat_config::FilledBy, table_report,
};
use chefshat_record::convert::{rules_from_proto, seat_number};
use chefshat_record::{jsonl, replay};
use chefshat_referee::{Report, Stage};
use chefshat_room::journal::{ReportSource, Reported};
use chefshat_room::testing::real_table::RealTable;
use chefshat_server::convert::{Deck, report_to_proto};
use chefshat_tests::{Launch, Process, patiently, set_up};
use tokio::process::Command;

const ADA: Seat = Seat::new(0);
const AGENT: Seat = Seat::new(1);
const BO: Seat = Seat::new(3);

fn seats() -> Vec<v1::SeatConfig> {
    let seat = |filled_by, name: &str| v1::SeatConfig {
        filled_by: Some(filled_by),
        name: name.into(),
    };
    let at_table = || FilledBy::AtTable(v1::ParticipantKind::Human.into());
    vec![
        seat(at_table(), "Ada"),
        seat(FilledBy::ReservedFor(v1::ParticipantKind::Agent.into()), ""),
        seat(FilledBy::BuiltInAgent("greedy".into()), "Greta"),
        seat(at_table(), "Bo"),
    ]
}

fn request() -> v1::CreateRoomRequest {
    v1::CreateRoomRequest {
        name: "lab".into(),
        rules: Some(v1::RuleSet {
            stop: Some(v1::rule_set::Stop::TargetShifts(2)),
            // A decline is seen by nobody, so the truth could not follow it.
            special_actions: Some(false),
            ..v1::RuleSet::default()
        }),
        seats: seats(),
        policy: Some(v1::RoomPolicy {
            pace_ms: Some(0),
            decision_time_ms: Some(600_000),
            ..v1::RoomPolicy::default()
        }),
        physical: true,
        ..v1::CreateRoomRequest::default()
    }
}

/// A real table with a bridge that reports what happens there.
struct Bridge {
    client: Client,
    ticket: String,
    follower: TableFollower,
    real: RealTable,
    deck: Deck,
    state: v1::TableState,
    reports: u32,
}

impl Bridge {
    async fn report(&mut self, report: Report) -> v1::ReportResponse {
        let reported = Reported {
            id: String::new(),
            source: ReportSource::Camera,
            age: Duration::from_millis(1),
            report,
        };
        self.send(report_to_proto(&reported, self.deck)).await
    }

    async fn send(&mut self, report: v1::TableReport) -> v1::ReportResponse {
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
    async fn next_state(&mut self) {
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
            Stage::Turn(seat) | Stage::Gift(seat) => seat == ADA || seat == BO,
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
    async fn until(&mut self, mut done: impl FnMut(&Self) -> bool) {
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
    async fn misread(&mut self) -> bool {
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

async fn restarted(launch: &mut Launch, server: Process) -> Process {
    server.kill().await;
    launch.start().await.expect("the server restarts")
}

/// Seat and action of all decisions of a record. The cards of a gift have no order at a table.
fn decisions(lines: &[v1::RecordLine]) -> Vec<(u32, u32)> {
    let lines = lines.iter();
    lines
        .filter_map(|line| match &line.line {
            Some(Line::Decision(decision)) => Some((decision.seat, decision.action)),
            _ => None,
        })
        .collect()
}

fn sort_gifts(decisions: &mut [(u32, u32)], bridge: &Bridge) {
    let actions = bridge.real.truth.rules().actions();
    let is_gift = |action: u32| {
        let action = actions.decode(ActionId::new(u16::try_from(action).expect("an action")));
        matches!(action, Some(Action::Give(_) | Action::GiveJoker))
    };
    let gift = |a: &(u32, u32), b: &(u32, u32)| a.0 == b.0 && is_gift(a.1) && is_gift(b.1);
    (decisions.chunk_by_mut(gift)).for_each(<[(u32, u32)]>::sort_unstable);
}

fn count(lines: &[v1::RecordLine], wanted: impl Fn(&Kind) -> bool) -> usize {
    let events = lines.iter().filter_map(|line| match &line.line {
        Some(Line::Event(event)) => event.kind.as_ref(),
        _ => None,
    });
    events.filter(|kind| wanted(kind)).count()
}

async fn chefshat(arguments: &[&str]) -> String {
    let output = Command::new(set_up("CHEFSHAT_BIN"))
        .args(arguments)
        .output()
        .await
        .expect("the binary starts");
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    let problem = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{arguments:?}: {text}{problem}");
    text
}

#[tokio::test(flavor = "multi_thread")]
async fn persons_at_a_table_play_with_agents_and_the_record_is_their_game() {
    let data = tempfile::tempdir().expect("a temporary folder");
    let mut launch = Launch::new(data.path());
    let server = launch.start().await.expect("the server starts");
    let client = Client::connect(launch.url()).await.expect("it listens");
    let created = client.create_room(request()).await.expect("a new room");
    let room = created.room.expect("a room");
    assert_eq!(room.origin(), v1::GameOrigin::Physical);
    assert!(room.seed_commitment.is_empty() && !room.seed_fixed);
    let rules = rules_from_proto(room.rules.as_ref().expect("rules")).expect("valid rules");
    let at_table = BySeat::from_fn(4, |seat| seat == ADA || seat == BO);
    let mut bridge = Bridge {
        follower: client.follow_table(&created.table_ticket),
        ticket: created.table_ticket,
        client: client.clone(),
        real: RealTable::new(rules, Seed([5; 32]), at_table),
        deck: Deck::of(&rules),
        state: v1::TableState::default(),
        reports: 0,
    };
    bridge.next_state().await;
    assert_eq!(bridge.state.stage(), v1::TableStage::Waiting);
    let early = client
        .report(
            &bridge.ticket,
            v1::TableReport {
                kind: Some(table_report::Kind::Cleared(v1::BoardCleared {})),
                ..v1::TableReport::default()
            },
        )
        .await;
    assert_eq!(
        early.expect_err("too early").reason(),
        Some("GAME_NOT_STARTED")
    );

    let joined = client.join_with_code(&created.join_code, "agent").await;
    let joined = joined.expect("the open seat");
    assert_eq!(joined.seat, seat_number(AGENT));
    let player = client.clone();
    let playing =
        tokio::spawn(async move { player.play(joined.ticket, RandomAgent::new(3)).await });
    while bridge.state.stage() == v1::TableStage::Waiting {
        bridge.next_state().await;
    }

    // A play that breaks the rules changes nothing.
    bridge.until(|it| it.reports > 12).await;
    let before = bridge.state.observation.clone();
    let violation = bridge
        .send(v1::TableReport {
            kind: Some(table_report::Kind::Laid(v1::CardsLaid {
                seat: None,
                cards: Some(v1::SeenCards {
                    cards: vec![2, 3],
                    golden: None,
                }),
            })),
            ..v1::TableReport::default()
        })
        .await;
    assert_eq!(violation.verdict(), v1::ReportVerdict::Violation);
    let shown = bridge.state.violation.clone().expect("it is shown");
    assert_eq!(
        (shown.rule(), &shown.text),
        (v1::ViolatedRule::Form, &violation.detail)
    );
    assert_eq!(bridge.state.observation, before);

    // A question is asked and answered.
    let question = v1::TableQuestion {
        question_id: "place 4".into(),
        text: "7 or 9 at place 4?".into(),
        options: vec!["7".into(), "9".into()],
        seat: None,
        picture: vec![1; 1000],
    };
    bridge
        .send(v1::TableReport {
            kind: Some(table_report::Kind::Question(question.clone())),
            ..v1::TableReport::default()
        })
        .await;
    assert_eq!(bridge.state.questions, [question]);
    bridge
        .report(Report::Answer {
            id: "place 4".into(),
            option: Some(1),
        })
        .await;
    assert!(bridge.state.questions.is_empty());

    // A misread play is corrected, while the agents already answer it.
    while !bridge.misread().await {
        bridge.until(|_| true).await;
    }

    // The server crashes and resumes the game at the same place.
    bridge.until(|it| it.reports > 40).await;
    let (stage, observation) = (bridge.state.stage(), bridge.state.observation.clone());
    let server = restarted(&mut launch, server).await;
    bridge.next_state().await;
    while bridge
        .state
        .room
        .as_ref()
        .is_some_and(|room| !room.seats[1].connected)
    {
        bridge.next_state().await;
    }
    assert_eq!(
        (bridge.state.stage(), &bridge.state.observation),
        (stage, &observation)
    );

    bridge.until(|_| false).await;
    let outcome = patiently("the agent", playing).await.expect("no panic");
    outcome.expect("the game has a result");
    let late = bridge.follower.next().await;
    assert!(matches!(late, Ok(Some(_) | None)), "{late:?}");
    let over: Result<_, Error> = client
        .report(
            &bridge.ticket,
            v1::TableReport {
                kind: Some(table_report::Kind::Cleared(v1::BoardCleared {})),
                ..v1::TableReport::default()
            },
        )
        .await;
    assert_eq!(over.expect_err("over").reason(), Some("GAME_OVER"));

    let record = client.record(&room.game_id).await.expect("a record");
    let replayed = replay::replay(&record).expect("the record verifies");
    let standings = bridge.real.truth.standings().expect("the truth is over");
    let standings = chefshat_record::convert::final_table(&standings);
    assert_eq!(replayed.standings, standings);
    let mut recorded = decisions(&record);
    let truth = bridge.real.decisions.iter();
    let mut truth: Vec<(u32, u32)> = truth
        .map(|(seat, action)| (seat_number(*seat), action.index().into()))
        .collect();
    sort_gifts(&mut recorded, &bridge);
    sort_gifts(&mut truth, &bridge);
    assert_eq!(recorded, truth);
    assert_eq!(count(&record, |it| matches!(it, Kind::Violation(_))), 1);
    assert_eq!(count(&record, |it| matches!(it, Kind::Correction(_))), 1);
    assert_eq!(
        count(&record, |it| matches!(it, Kind::ServerRestarted(_))),
        1
    );

    // Its file verifies, and is exported and rendered like others.
    let ended = server.stop().await;
    assert!(ended.status.success(), "{ended:?}");
    let file = jsonl::path_of(data.path(), &room.game_id);
    assert!(jsonl::read(&file).expect("a record file") == record);
    let file = file.to_str().expect("text");
    let out = data.path().join("out");
    let out = out.to_str().expect("text");
    chefshat(&["verify", file]).await;
    chefshat(&["export", file, "--out", out]).await;
    let picture = data.path().join("picture.png");
    let picture = picture.to_str().expect("text");
    chefshat(&["render", file, "--at", "20", "--out", picture]).await;
}
