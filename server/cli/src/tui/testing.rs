//! Shared by the tests of `play` and `watch`: screens as text, recorded games, and games played by
//! the engine.

use std::path::Path;

use chefshat_client::v1::{self, game_event::Kind, record_line};
use chefshat_engine::{ActionId, Event, Game, RuleSetSpec, Seed, Viewer};
use chefshat_record::convert::{By, event_kind, final_table, rules_to_proto};
use ratatui::backend::TestBackend;
use ratatui::{Frame, Terminal};

use chefshat_record::convert::{decision_kind, observation_to_proto, put_requirement};

/// A screen of this size as text, without trailing spaces.
pub(crate) fn text(columns: u16, rows: u16, picture: impl FnOnce(&mut Frame<'_>)) -> String {
    let mut terminal = Terminal::new(TestBackend::new(columns, rows)).unwrap();
    terminal.draw(picture).unwrap();
    let buffer = terminal.backend().buffer();
    let mut text = String::new();
    for row in 0..rows {
        let line: String = (0..columns)
            .map(|column| buffer[(column, row)].symbol())
            .collect();
        text.push_str(line.trim_end());
        text.push('\n');
    }
    text
}

/// Compares screens with the committed ones, by name; screens that differ are written to the
/// directory for temporary files.
pub(crate) fn assert_screens(screens: &[(&str, String, &str)]) {
    let differ = screens
        .iter()
        .filter(|(_, screen, committed)| screen != committed);
    let differ = differ.map(|(name, screen, _)| {
        let new = std::env::temp_dir().join(format!("chefshat-{name}"));
        std::fs::write(&new, screen).unwrap();
        format!("{}:\n{screen}", new.display())
    });
    let differ: Vec<String> = differ.collect();
    assert!(
        differ.is_empty(),
        "screens differ from the committed ones: {}",
        differ.join("\n")
    );
}

/// A record of the fixtures.
pub(crate) fn lines(name: &str) -> Vec<v1::RecordLine> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/fixtures/records");
    chefshat_record::jsonl::read(&folder.join(name)).unwrap()
}

/// The events of a record.
pub(crate) fn recorded(name: &str) -> Vec<v1::GameEvent> {
    let events = lines(name).into_iter().filter_map(|line| match line.line {
        Some(record_line::Line::Event(event)) => Some(event),
        _ => None,
    });
    events.collect()
}

/// A game of the engine, with events as the server sends them to one seat.
pub(crate) struct Dealt {
    pub(crate) game: Game,
    viewer: Viewer,
    sent: u64,
    /// Number of decision requests so far.
    asked: u64,
}

impl Dealt {
    /// Starts a game; returns its first events.
    pub(crate) fn new(rules: &RuleSetSpec, seed: u8, viewer: Viewer) -> (Self, Vec<v1::GameEvent>) {
        let rules = rules.validate().unwrap();
        let mut events = Vec::new();
        let game = Game::new(rules, Seed([seed; 32]), |event| events.push(event));
        let mut dealt = Self {
            game,
            viewer,
            sent: 0,
            asked: 0,
        };
        let seats = (0u32..).zip(["Ada", "Ben", "Cleo", "Dan", "Eve", "Fay"]);
        let seats = seats
            .take(rules.players())
            .map(|(seat, name)| v1::Participant {
                seat,
                name: name.to_owned(),
                kind: match seat {
                    0 => v1::ParticipantKind::Human,
                    1 => v1::ParticipantKind::Robot,
                    _ => v1::ParticipantKind::Agent,
                }
                .into(),
                connected: true,
                ..v1::Participant::default()
            });
        let start = Kind::GameStarted(Box::new(v1::GameStarted {
            game_id: "5f0c6a4de2b14b7f8a3d9c1e7b60425d".into(),
            rules: Some(rules_to_proto(&rules)),
            seats: seats.collect(),
            hand_size: rules.hand_size().into(),
            ..v1::GameStarted::default()
        }));
        let mut sent = vec![dealt.numbered(start)];
        sent.extend(dealt.for_seat(&events));
        (dealt, sent)
    }

    /// Applies an action; returns its events.
    pub(crate) fn apply(&mut self, action: ActionId) -> Vec<v1::GameEvent> {
        let mut events = Vec::new();
        self.game.apply(action, |event| events.push(event)).unwrap();
        self.for_seat(&events)
    }

    /// The request for the open decision.
    pub(crate) fn request(&mut self) -> v1::DecisionRequest {
        self.asked += 1;
        let decision = self.game.decision().unwrap();
        let observation = self.game.observe(Viewer::Seat(decision.seat));
        let rules = self.game.rules();
        let mut request = v1::DecisionRequest {
            decision_id: self.asked,
            kind: decision_kind(decision.kind).into(),
            observation: Some(observation_to_proto(&observation)),
            action_mask: self.game.legal_actions().to_bytes(rules.actions().size()),
            time_left_ms: 30_000,
            bank_left_ms: 60_000,
            default_action: self.game.default_action().unwrap().index().into(),
            ..v1::DecisionRequest::default()
        };
        put_requirement(&mut request, self.game.requirement().unwrap());
        request
    }

    fn for_seat(&mut self, events: &[Event]) -> Vec<v1::GameEvent> {
        let space = self.game.rules().actions();
        let by = By {
            source: v1::DecisionSource::Agent,
            decision_time_us: 0,
        };
        let kinds = events.iter().map(|event| match event {
            Event::GameEnded { standings } => Kind::GameEnded(Box::new(v1::GameEnded {
                standings: final_table(standings),
                reveal: None,
            })),
            event => event_kind(&event.seen_by(self.viewer), space, by).unwrap(),
        });
        let kinds: Vec<Kind> = kinds.collect();
        kinds.into_iter().map(|kind| self.numbered(kind)).collect()
    }

    fn numbered(&mut self, kind: Kind) -> v1::GameEvent {
        self.sent += 1;
        v1::GameEvent {
            sequence: self.sent,
            kind: Some(kind),
            ..v1::GameEvent::default()
        }
    }
}
