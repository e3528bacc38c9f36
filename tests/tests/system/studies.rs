//! A study over real sockets: two conditions, eight scripted participants and one who is replaced.
//! One withdraws, one changes the device, the server is restarted in the middle of games. All that
//! participants receive is recorded, and searched for what would name a condition.

use std::collections::{BTreeMap, BTreeSet};
use std::net::{Ipv4Addr, SocketAddr};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

use chefshat_client::{Client, RandomAgent};
use chefshat_proto::v1::participation_service_client::ParticipationServiceClient;
use chefshat_proto::v1::record_service_client::RecordServiceClient;
use chefshat_proto::v1::room_service_client::RoomServiceClient;
use chefshat_proto::v1::study_service_client::StudyServiceClient;
use chefshat_proto::v1::{
    self, record_line::Line, seat_config::FilledBy, study_item_answer::Value,
    study_shown_item::Kind, study_stage::Stage, study_view::Content,
};
use chefshat_record::replay::replay;
use chefshat_room::ids::Id;
use chefshat_server::access::SECRET_HEADER;
use chefshat_server::config::ServerConfig;
use chefshat_server::host::Host;
use chefshat_server::store::studies::StoredStudy;
use chefshat_server::store::{SqliteStore, Store as _};
use chefshat_tests::{one_shift, patiently, set_up, skip};
use futures::future::join_all;
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tokio::net::{TcpListener, TcpStream};
use tokio::process::Command;
use tonic::transport::Channel;
use tonic::{Code, Request, Status};
use tonic_types::StatusExt as _;

/// What no participant may receive: all that names the study for researchers, a factor, a level, a
/// condition, an agent or a robot's behaviour.
pub(crate) const SECRETS: [&str; 12] = [
    "warmth-study-2031",
    "temperament",
    "level-warm",
    "level-cold",
    "condition-warm",
    "condition-cold",
    "Robot Carla",
    "Robot Dora",
    "greedy",
    "trained",
    "behaves-warmly",
    "behaves-coldly",
];
const PARTICIPANTS: u32 = 8;
/// Games of a participant, without practice.
const GAMES: usize = 2;
/// Steps: consent, questionnaire, practice, games, text.
const STEPS: u32 = 5;

/// A connection of participants to the server, whose address may change, that records what they
/// receive.
pub(crate) struct Tap {
    address: SocketAddr,
    pub(crate) target: Arc<Mutex<SocketAddr>>,
    /// The bytes of each connection.
    pub(crate) received: Received,
}

type Received = Arc<Mutex<Vec<Vec<u8>>>>;

impl Tap {
    pub(crate) async fn new(target: SocketAddr) -> Self {
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).await;
        let listener = listener.expect("a free port");
        let address = listener.local_addr().expect("bound");
        let (target, received) = (Arc::new(Mutex::new(target)), Arc::default());
        let (to, into) = (Arc::clone(&target), Arc::clone(&received));
        tokio::spawn(async move {
            while let Ok((client, _)) = listener.accept().await {
                let address = *to.lock().expect("not poisoned");
                tokio::spawn(forward(client, address, Arc::clone(&into)));
            }
        });
        Self {
            address,
            target,
            received,
        }
    }

    fn url(&self) -> String {
        format!("http://{}", self.address)
    }
}

/// Forwards a connection, and records what its client receives.
async fn forward(client: TcpStream, address: SocketAddr, received: Received) {
    let Ok(server) = TcpStream::connect(address).await else {
        return;
    };
    let (mut from_client, mut to_client) = client.into_split();
    let (mut from_server, mut to_server) = server.into_split();
    let up = async {
        let _ = tokio::io::copy(&mut from_client, &mut to_server).await;
        let _ = to_server.shutdown().await;
    };
    let down = async {
        let connection = {
            let mut all = received.lock().expect("not poisoned");
            all.push(Vec::new());
            all.len() - 1
        };
        let mut buffer = vec![0; 64 * 1024];
        while let Ok(count @ 1..) = from_server.read(&mut buffer).await {
            received.lock().expect("not poisoned")[connection].extend(&buffer[..count]);
            if to_client.write_all(&buffer[..count]).await.is_err() {
                break;
            }
        }
        let _ = to_client.shutdown().await;
    };
    tokio::join!(up, down);
}

pub(crate) async fn host(folder: &Path) -> Host {
    let store = SqliteStore::open(folder).await.expect("a store");
    let config = ServerConfig {
        data_dir: Some(PathBuf::from(folder)),
        grace: std::time::Duration::ZERO,
        ..ServerConfig::default()
    };
    let host = Host::start(config, Arc::new(store)).await;
    host.expect("a free port")
}

pub(crate) fn address(host: &Host) -> SocketAddr {
    let url = host.url();
    let address = url.trim_start_matches("http://").parse();
    address.expect("an address")
}

pub(crate) fn stage(stage: Stage) -> v1::StudyStage {
    v1::StudyStage {
        stage: Some(stage),
        ..v1::StudyStage::default()
    }
}

fn condition(temperament: &str, robot: &str, agent: &str, behaviour: &str) -> v1::StudyCondition {
    let level = format!("level-{temperament}");
    let seat = v1::SeatConfig {
        filled_by: Some(FilledBy::BuiltInAgent(agent.to_owned())),
        name: robot.to_owned(),
    };
    v1::StudyCondition {
        id: format!("condition-{temperament}"),
        levels: [("temperament".to_owned(), level)].into(),
        rules: Some(one_shift()),
        policy: Some(v1::RoomPolicy {
            pace_ms: Some(0),
            substitute: agent.to_owned(),
            ..v1::RoomPolicy::default()
        }),
        seats: vec![seat; 3],
        robot_behaviour: behaviour.to_owned(),
        labels: v1::StudyLabels::Players.into(),
        ..v1::StudyCondition::default()
    }
}

pub(crate) fn settings() -> v1::StudySettings {
    v1::StudySettings {
        name: "warmth-study-2031".to_owned(),
        title: "A game of cards".to_owned(),
        participants: PARTICIPANTS,
        factors: vec![v1::StudyFactor {
            name: "temperament".to_owned(),
            levels: vec!["level-warm".to_owned(), "level-cold".to_owned()],
        }],
        conditions: vec![
            condition("warm", "Robot Carla", "greedy", "behaves-warmly"),
            condition("cold", "Robot Dora", "trained", "behaves-coldly"),
        ],
        stages: vec![
            stage(Stage::Consent(v1::StudyConsent {
                text: "I take part.".to_owned(),
                version: "1".to_owned(),
            })),
            stage(Stage::Questionnaire(v1::StudyQuestionnaire {
                template: "nasa_tlx".to_owned(),
                ..v1::StudyQuestionnaire::default()
            })),
            stage(Stage::Practice(v1::StudyPractice { in_data: false })),
            stage(Stage::Games(v1::StudyGames {
                count: u32::try_from(GAMES).expect("few"),
            })),
            stage(Stage::Text(v1::StudyText {
                title: "Thank you".to_owned(),
                text: "That is all.".to_owned(),
            })),
        ],
        traces: true,
        ..v1::StudySettings::default()
    }
}

/// A participant with a device of its own.
pub(crate) struct Person {
    pub(crate) service: ParticipationServiceClient<Channel>,
    pub(crate) client: Client,
    pub(crate) link: String,
    session: String,
}

impl Person {
    pub(crate) async fn new(tap: &Tap, link: &str) -> (Self, v1::StudyView) {
        let url = tap.url();
        let endpoint = Channel::from_shared(url.clone()).expect("a URL");
        let mut person = Self {
            service: ParticipationServiceClient::new(
                endpoint.connect().await.expect("the server listens"),
            ),
            client: Client::connect(url).await.expect("the server listens"),
            link: link.to_owned(),
            session: String::new(),
        };
        let view = person.open().await.expect("the link is valid");
        (person, view)
    }

    pub(crate) async fn open(&mut self) -> Result<v1::StudyView, Status> {
        let request = v1::OpenStudyRequest {
            link: self.link.clone(),
            device: Some(device()),
        };
        let opened = self.service.open_study(request).await?;
        let opened = opened.into_inner();
        self.session = opened.session;
        Ok(opened.view.expect("a view"))
    }

    /// What is shown, once it is what is wanted.
    pub(crate) async fn until(&mut self, wanted: impl Fn(&Content) -> bool) -> v1::StudyView {
        let session = self.session.clone();
        let request = v1::FollowParticipationRequest { session };
        let following = async {
            let followed = self.service.follow_participation(request).await;
            let mut views = followed.expect("the session is open").into_inner();
            while let Some(message) = views.message().await.expect("the stream lasts") {
                if let Some(view) = message.view
                    && wanted(view.content.as_ref().expect("content"))
                {
                    return view;
                }
            }
            panic!("the stream ended");
        };
        patiently("the next view", following).await
    }

    /// Does what a view shows. Returns what follows, and the seat's ticket if it was a game.
    async fn act(&mut self, view: v1::StudyView) -> (v1::StudyView, Option<String>) {
        let (session, step) = (self.session.clone(), view.step);
        match view.content.expect("content") {
            Content::Consent(_) => {
                let request = v1::GiveConsentRequest { session, step };
                let given = self.service.give_consent(request).await.expect("its step");
                (given.into_inner().view.expect("a view"), None)
            }
            Content::Questionnaire(shown) => {
                let answers: Vec<_> = shown.items.iter().map(answer).collect();
                let session = self.save_and_come_back(session, step, &answers[..1]).await;
                let request = v1::AnswerQuestionnaireRequest {
                    session,
                    step,
                    answers,
                };
                let answered = self.service.answer_questionnaire(request).await;
                let answered = answered.expect("the answers are valid").into_inner();
                (answered.view.expect("a view"), None)
            }
            Content::Game(_) => {
                let view = self.until(|content| playable(content).is_some()).await;
                let game = view.content.as_ref().and_then(playable).expect("a game");
                let ticket = game.ticket.clone();
                if !game.ended {
                    self.trace(&game.game_id).await;
                    let playing = self.client.play(ticket.clone(), RandomAgent::new(7));
                    patiently("the game to end", playing)
                        .await
                        .expect("it ends");
                }
                let over = |content: &Content| playable(content).is_some_and(|it| it.ended);
                self.until(over).await;
                (self.proceed(view.step).await, Some(ticket))
            }
            Content::Text(_) => (self.proceed(step).await, None),
            Content::Arrival(_) => {
                let over = |content: &Content| !matches!(content, Content::Arrival(_));
                (self.until(over).await, None)
            }
            other => panic!("unexpected: {other:?}"),
        }
    }

    /// Saves answers, and opens the link again, where they are shown. Returns the new session.
    async fn save_and_come_back(
        &mut self,
        session: String,
        step: u32,
        answers: &[v1::StudyItemAnswer],
    ) -> String {
        let request = v1::SaveAnswersRequest {
            session,
            step,
            answers: answers.to_vec(),
        };
        let saved = self.service.save_answers(request.clone()).await;
        saved.expect("the answer is valid");
        let link = self.link.clone();
        let opened = (self.service)
            .open_study(v1::OpenStudyRequest {
                link,
                device: Some(device()),
            })
            .await;
        let opened = opened.expect("the link is valid").into_inner();
        assert_eq!(opened.saved_answers, answers);
        let again = self.service.save_answers(request).await;
        let superseded = again.expect_err("another session is open");
        assert_eq!(reason(&superseded), "SESSION_SUPERSEDED");
        self.session.clone_from(&opened.session);
        opened.session
    }

    async fn proceed(&mut self, step: u32) -> v1::StudyView {
        let session = self.session.clone();
        let request = v1::ContinueStudyRequest { session, step };
        let continued = self.service.continue_study(request).await;
        continued
            .expect("its step")
            .into_inner()
            .view
            .expect("a view")
    }

    /// Opens the link when the server that was restarted has the study.
    pub(crate) async fn back(&mut self) -> v1::StudyView {
        let opened = async {
            loop {
                match self.open().await {
                    Ok(view) => return view,
                    Err(status) if status.code() == Code::Unavailable => {
                        tokio::task::yield_now().await;
                    }
                    Err(status) => panic!("{status}"),
                }
            }
        };
        patiently("the study to be back", opened).await
    }

    async fn trace(&mut self, game_id: &str) {
        let request = v1::RecordTracesRequest {
            session: self.session.clone(),
            game_id: game_id.to_owned(),
            traces: vec![v1::StudyTrace {
                kind: v1::StudyTraceKind::CardPicked.into(),
                at_ms: 1200,
                decision_id: 1,
                target: "card:7".to_owned(),
                duration_ms: 0,
            }],
        };
        self.service.record_traces(request).await.expect("its game");
    }

    /// Does everything until a step is reached. Returns the view and the tickets of its games.
    pub(crate) async fn go_on(
        &mut self,
        mut view: v1::StudyView,
        until_step: u32,
    ) -> (v1::StudyView, Vec<String>) {
        let mut tickets = Vec::new();
        while view.step < until_step {
            let (next, ticket) = self.act(view).await;
            tickets.extend(ticket);
            view = next;
        }
        (view, tickets)
    }
}

/// What everybody's device is.
fn device() -> v1::StudyDevice {
    v1::StudyDevice {
        width: 390,
        height: 844,
        pixels: 300,
        pointer: v1::StudyPointer::Coarse.into(),
        time_zone: "Europe/Rome".to_owned(),
    }
}

/// The game of a view, if it has a room.
pub(crate) fn playable(content: &Content) -> Option<&v1::StudyShownGame> {
    match content {
        Content::Game(game) if !game.ticket.is_empty() => Some(game),
        _ => None,
    }
}

fn answer(item: &v1::StudyShownItem) -> v1::StudyItemAnswer {
    let Some(Kind::Slider(slider)) = &item.kind else {
        panic!("the items of NASA-TLX are sliders");
    };
    v1::StudyItemAnswer {
        item: item.item,
        value: Some(Value::Number(slider.max)),
        answered_after_ms: Some(900),
    }
}

fn reason(status: &Status) -> String {
    let info = status.get_details_error_info();
    info.map_or_else(String::new, |info| info.reason)
}

/// The researcher.
pub(crate) struct Lab {
    pub(crate) service: StudyServiceClient<Channel>,
    records: RecordServiceClient<Channel>,
    pub(crate) study_id: String,
    pub(crate) owner_token: String,
}

impl Lab {
    pub(crate) async fn connect(host: &Host, (study_id, owner_token): (String, String)) -> Self {
        let channel = Channel::from_shared(host.url().to_owned()).expect("a URL");
        let channel = channel.connect().await.expect("the server listens");
        Self {
            service: StudyServiceClient::new(channel.clone()),
            records: RecordServiceClient::new(channel),
            study_id,
            owner_token,
        }
    }

    pub(crate) async fn links(&mut self, pseudonyms: Vec<String>) -> Vec<String> {
        let request = v1::AddStudyParticipantsRequest {
            study_id: self.study_id.clone(),
            owner_token: self.owner_token.clone(),
            pseudonyms,
            ..v1::AddStudyParticipantsRequest::default()
        };
        let added = self.service.add_study_participants(request).await;
        let links = added.expect("the study is open").into_inner().links;
        links.into_iter().map(|link| link.link).collect()
    }

    pub(crate) async fn participants(&mut self) -> Vec<v1::StudyParticipant> {
        let request = v1::GetStudyRequest {
            study_id: self.study_id.clone(),
            owner_token: self.owner_token.clone(),
        };
        let shown = self.service.get_study(request).await;
        shown.expect("the study exists").into_inner().participants
    }

    pub(crate) async fn export(&mut self) -> BTreeMap<String, Vec<u8>> {
        let request = v1::ExportStudyRequest {
            study_id: self.study_id.clone(),
            owner_token: self.owner_token.clone(),
            test: false,
        };
        let exported = self.service.export_study(request).await;
        let mut parts = exported.expect("the study exists").into_inner();
        let mut files: BTreeMap<String, Vec<u8>> = BTreeMap::new();
        while let Some(part) = parts.message().await.expect("the export ends well") {
            files.entry(part.file).or_default().extend(part.data);
        }
        files
    }

    /// Why the record of a game is refused to a caller who shows this secret; `None` if it is not.
    async fn record_refused(&mut self, game: &str, secret: &str) -> Option<Code> {
        let mut request = Request::new(v1::GetRecordRequest {
            game_id: game.to_owned(),
        });
        let value = secret.parse().expect("ASCII");
        request.metadata_mut().insert(SECRET_HEADER, value);
        match self.records.get_record(request).await {
            Ok(lines) => {
                let first = lines.into_inner().message().await.expect("a record");
                assert!(first.is_some());
                None
            }
            Err(status) => Some(status.code()),
        }
    }
}

/// Rows of a table without its header.
pub(crate) fn rows(file: &[u8]) -> Vec<String> {
    let text = std::str::from_utf8(file).expect("UTF-8");
    text.lines().skip(1).map(str::to_owned).collect()
}

pub(crate) fn contains(bytes: &[u8], word: &str) -> bool {
    bytes
        .windows(word.len())
        .any(|window| window == word.as_bytes())
}

/// The header of an exported record, whose game is replayed.
pub(crate) fn checked_header(record: &[u8]) -> v1::RecordHeader {
    let lines = std::str::from_utf8(record).expect("UTF-8").lines();
    let lines: Vec<v1::RecordLine> = lines
        .map(|line| serde_json::from_str(line).expect("a line of a record"))
        .collect();
    replay(&lines).expect("the record is right");
    match lines.into_iter().next().and_then(|line| line.line) {
        Some(Line::Header(header)) => *header,
        _ => panic!("a header comes first"),
    }
}

/// Asserts that every cell of the exported tables is what their descriptor says.
pub(crate) fn assert_as_described(files: &BTreeMap<String, Vec<u8>>) {
    let descriptor: serde_json::Value =
        serde_json::from_slice(&files["datapackage.json"]).expect("JSON");
    let list = |value: &serde_json::Value| value.as_array().expect("a list").clone();
    let mut described = BTreeSet::new();
    for resource in list(&descriptor["resources"]) {
        let path = resource["path"].as_str().expect("a name").to_owned();
        let fields = list(&resource["schema"]["fields"]);
        let mut keys = BTreeSet::new();
        let rows = csv::Reader::from_reader(files[&path].as_slice()).into_deserialize();
        for row in rows {
            let row: BTreeMap<String, String> = row.expect("as many cells as columns");
            assert_eq!(row.len(), fields.len(), "{path}");
            for field in &fields {
                let cell = &row[field["name"].as_str().expect("a name")];
                let constraints = &field["constraints"];
                let fits = match (cell.as_str(), field["type"].as_str()) {
                    ("", _) => constraints["required"] == false,
                    (_, Some("integer")) => cell.parse::<i64>().is_ok(),
                    (_, Some("boolean")) => ["true", "false"].contains(&cell.as_str()),
                    (_, Some("string")) => match constraints["enum"].as_array() {
                        Some(codes) => codes.iter().any(|code| code == cell.as_str()),
                        None => true,
                    },
                    _ => false,
                };
                assert!(fits, "{path}: {cell:?} is not {field}");
            }
            if let Some(key) = resource["schema"]["primaryKey"].as_array() {
                let key = key
                    .iter()
                    .map(|name| row[name.as_str().expect("a name")].clone());
                assert!(
                    keys.insert(key.collect::<Vec<_>>()),
                    "{path}: {row:?} is there twice"
                );
            }
        }
        described.insert(path);
    }
    let tables = files.keys().filter(|name| name.ends_with(".csv"));
    assert_eq!(described, tables.cloned().collect());
}

/// What the samples print of the exported tables, with these options; that in R prints the same as
/// that in Python.
pub(crate) async fn analysed(files: &BTreeMap<String, Vec<u8>>, options: &[&str]) -> String {
    let folder = tempfile::tempdir().expect("a folder");
    for (name, bytes) in files.iter().filter(|(name, _)| !name.contains('/')) {
        std::fs::write(folder.path().join(name), bytes).expect("a file");
    }
    let python = Path::new(env!("CARGO_MANIFEST_DIR")).join("../clients/python");
    let samples = python.join("samples/study");
    let run = async |interpreter: &Path, sample: &str| {
        let analysing = Command::new(interpreter)
            .arg(samples.join(sample))
            .arg(folder.path())
            .args(options)
            .kill_on_drop(true)
            .output();
        let analysed = patiently("the analysis", analysing).await.expect(sample);
        let problem = String::from_utf8_lossy(&analysed.stderr);
        assert!(analysed.status.success(), "{sample}: {problem}");
        String::from_utf8(analysed.stdout).expect("UTF-8")
    };
    let printed = run(&set_up("CHEFSHAT_PYTHON"), "analysis.py").await;
    let version = Command::new("Rscript").arg("--version").output();
    match version.await {
        Ok(version) if version.status.success() => {
            let in_r = run(Path::new("Rscript"), "analysis.R").await;
            assert_same_figures(&printed, &in_r);
        }
        _ => skip(
            "the analysis in R",
            "R is not installed; run `apt-get install r-base-core`",
        ),
    }
    printed
}

/// Asserts that two analyses print the same lines. Means may differ in how they are rounded.
fn assert_same_figures(python: &str, r: &str) {
    let in_both = format!("Python:\n{python}R:\n{r}");
    assert_eq!(python.lines().count(), r.lines().count(), "{in_both}");
    for (in_python, in_r) in python.lines().zip(r.lines()) {
        let words = |line: &str| -> Vec<String> {
            // A deviation of one value.
            let named = line.split_whitespace().map(|word| match word {
                "NA" => "NaN",
                word => word,
            });
            named.map(str::to_owned).collect()
        };
        let (in_python, in_r) = (words(in_python), words(in_r));
        assert_eq!(in_python.len(), in_r.len(), "{in_both}");
        for (one, other) in in_python.iter().zip(&in_r) {
            let same = match (one.parse::<f64>(), other.parse::<f64>()) {
                _ if one == other => true,
                (Ok(one), Ok(other)) => (one - other).abs() < 0.0015,
                _ => false,
            };
            assert!(same, "{one} is not {other}\n{in_both}");
        }
    }
}

/// Asserts that the samples read the exported tables and summarise them by condition.
async fn assert_analysed(files: &BTreeMap<String, Vec<u8>>) {
    let printed = analysed(files, &[]).await;
    let first = printed.lines().next().unwrap_or_default();
    assert!(
        first.contains(&format!("{PARTICIPANTS} completed")),
        "{printed}"
    );
    // Half of the participants met each condition, and all answered by the ends of the sliders.
    let half = (PARTICIPANTS / 2).to_string();
    for (measure, expected) in [("timeouts_per_decision", "0.000"), ("effort", "100.000")] {
        for condition in ["condition-warm", "condition-cold"] {
            let line = printed.lines().find(|line| {
                let mut words = line.split_whitespace();
                words.any(|word| word == measure) && words.any(|word| word == condition)
            });
            let line = line.unwrap_or_else(|| panic!("no {measure}, {condition}: {printed}"));
            let words: Vec<&str> = line.split_whitespace().rev().collect();
            assert_eq!(words[1], expected, "{line}");
            if measure == "timeouts_per_decision" {
                assert_eq!(words[2], half, "{line}");
            }
        }
    }
}

/// Asserts that the samples leave out what the tables say is not counted: games in which a substitute
/// played, practice, and attention checks.
async fn assert_left_out(mut files: BTreeMap<String, Vec<u8>>) {
    let (finished, slider) = (("outcome", "finished"), ("kind", "slider"));
    let edit = |files: &mut BTreeMap<String, Vec<u8>>, table: &str, of_kind, column, value| {
        let edited = with_cell(&files[table], of_kind, column, value);
        files.insert(table.to_owned(), edited);
    };
    // One game counts visibly.
    edit(&mut files, "games.csv", finished, "points", "1000");
    let counted = analysed(&files, &[]).await;
    for (table, of_kind, column, value) in [
        ("games.csv", finished, "substituted", "true"),
        ("games.csv", finished, "practice", "true"),
        ("items.csv", slider, "attention_check", "5"),
    ] {
        let mut edited = files.clone();
        edit(&mut edited, table, of_kind, column, value);
        let left_out = analysed(&edited, &[]).await;
        assert_ne!(left_out, counted, "{column} of {table} changes nothing");
    }
}

/// A table with another value in this column of the first row that has a value in another one.
fn with_cell(file: &[u8], (of, kind): (&str, &str), column: &str, value: &str) -> Vec<u8> {
    let mut rows: Vec<Vec<String>> = csv::ReaderBuilder::new()
        .has_headers(false)
        .from_reader(file)
        .into_deserialize()
        .map(|row| row.expect("a row"))
        .collect();
    let index = |name| rows[0].iter().position(|it| it == name).expect("a column");
    let (of, column) = (index(of), index(column));
    let row = rows.iter_mut().find(|row| row[of] == kind).expect("a row");
    assert_ne!(row[column], value);
    row[column] = value.to_owned();
    let mut edited = csv::Writer::from_writer(Vec::new());
    for row in rows {
        edited.write_record(row).expect("a row");
    }
    edited.into_inner().expect("all rows")
}

#[tokio::test(flavor = "multi_thread")]
async fn a_study_from_its_links_to_its_data() {
    let folder = tempfile::tempdir().expect("a folder");
    let first_host = host(folder.path()).await;
    let tap = Tap::new(address(&first_host)).await;
    let channel = Channel::from_shared(first_host.url().to_owned()).expect("a URL");
    let channel = channel.connect().await.expect("the server listens");
    let request = v1::CreateStudyRequest {
        settings: Some(settings()),
        request_id: vec![7; 32],
    };
    let mut service = StudyServiceClient::new(channel);
    let created = service.create_study(request.clone()).await.expect("valid");
    let created = created.into_inner();
    let repeated = service.create_study(request).await.expect("the same");
    assert_eq!(repeated.into_inner(), created);
    let study = created.study.expect("a study");
    // What the server has made of the settings makes the same study again.
    let again = v1::CreateStudyRequest {
        settings: study.settings.clone(),
        request_id: Vec::new(),
    };
    let again = service.create_study(again).await.expect("valid");
    let again = again.into_inner().study.expect("a study");
    assert_eq!(again.settings, study.settings);
    assert_ne!(again.study_id, study.study_id);
    assert_eq!(
        (study.steps, study.games, study.practice_games),
        (STEPS, 2, 1)
    );
    let owner = (study.study_id, created.owner_token);
    let mut lab = Lab::connect(&first_host, owner.clone()).await;
    let name = |number| format!("Pseudonym-{number}-of-all");
    let links = lab.links((1..=PARTICIPANTS).map(name).collect()).await;

    // All get to the games, some with practice behind them. The third withdraws after its answers
    // and has its data deleted; the fifth is removed and replaced.
    let mut people = Vec::new();
    for link in &links {
        people.push(Person::new(&tap, link).await);
    }
    let going = people.into_iter().map(async |(mut person, view)| {
        let (view, tickets) = person.go_on(view, 3).await;
        (person, view, tickets)
    });
    let mut people = join_all(going).await;

    let third = &mut people[2].0;
    let request = v1::WithdrawFromStudyRequest {
        link: third.link.clone(),
        delete_data: true,
    };
    let withdrawn = third.service.withdraw_from_study(request).await;
    let view = withdrawn.expect("always possible").into_inner().view;
    let Some(Content::End(end)) = view.expect("a view").content else {
        panic!("it is the end");
    };
    assert_eq!(end.reason(), v1::StudyEndReason::DataDeleted);
    let request = v1::RemoveStudyParticipantRequest {
        study_id: owner.0.clone(),
        owner_token: owner.1.clone(),
        number: 5,
        replace: true,
    };
    let removed = lab.service.remove_study_participant(request).await;
    let replacement = removed.expect("it is active").into_inner().replacement;
    let replacement = replacement.expect("requested").link;
    let second_replacement = lab.links(vec![name(10)]).await.remove(0);

    // The fourth opens its link on another device: the first one can do nothing more.
    let (mut other_device, other_view) = Person::new(&tap, &links[3]).await;
    assert_eq!(other_view.step, 3);
    let old = &mut people[3].0;
    let session = old.session.clone();
    let refused = (old.service)
        .continue_study(v1::ContinueStudyRequest { session, step: 3 })
        .await
        .expect_err("superseded");
    assert_eq!(reason(&refused), "SESSION_SUPERSEDED");
    let forged = old.service.open_study(v1::OpenStudyRequest {
        link: "A".repeat(30),
        ..Default::default()
    });
    assert_eq!(reason(&forged.await.expect_err("forged")), "LINK_UNKNOWN");

    // The first has a room when the server is restarted.
    let game_before = {
        let first = &mut people[0].0;
        let view = first.until(|content| playable(content).is_some()).await;
        let game = view.content.as_ref().and_then(playable).expect("a game");
        let mut rooms = RoomServiceClient::new(
            Channel::from_shared(tap.url())
                .expect("a URL")
                .connect()
                .await
                .expect("it listens"),
        );
        let mut request = Request::new(v1::GetRoomRequest {
            room_id: game.room_id.clone(),
            join_code: String::new(),
        });
        let value = game.ticket.parse().expect("ASCII");
        request.metadata_mut().insert(SECRET_HEADER, value);
        let room = rooms.get_room(request).await.expect("its own room");
        let room = room.into_inner().room.expect("a room");
        let names: BTreeSet<String> = room.seats.into_iter().map(|seat| seat.name).collect();
        let others = ["Player 2", "Player 3", "Player 4"].map(str::to_owned);
        let expected: BTreeSet<String> = others.into_iter().chain([name(1)]).collect();
        assert_eq!(names, expected);
        game.clone()
    };
    let stopping = patiently("the server to stop", first_host.stop());
    stopping.await.expect("a clean end");
    let second_host = host(folder.path()).await;
    *tap.target.lock().expect("not poisoned") = address(&second_host);
    let mut lab = Lab::connect(&second_host, owner.clone()).await;

    let mut people: Vec<Person> = people.into_iter().map(|(person, ..)| person).collect();
    std::mem::swap(&mut people[3], &mut other_device);
    let gone = [people.remove(4), people.remove(2)];
    let mut everybody = Vec::new();
    for mut person in people {
        let view = person.back().await;
        everybody.push((person, view));
    }
    let shown = everybody[0].1.content.as_ref().and_then(playable);
    assert_eq!(shown, Some(&game_before));
    for link in [&replacement, &second_replacement] {
        everybody.push(Person::new(&tap, link).await);
    }
    let finishing = everybody.into_iter().map(async |(mut person, view)| {
        let (view, tickets) = person.go_on(view, STEPS).await;
        let Some(Content::End(end)) = view.content else {
            panic!("it is the end");
        };
        assert_eq!(end.reason(), v1::StudyEndReason::Completed);
        tickets
    });
    let tickets: Vec<String> = join_all(finishing).await.concat();

    // The assignment is balanced, and the record of a game is for the lab alone.
    let participants = lab.participants().await;
    let completed = |it: &&v1::StudyParticipant| it.state() == v1::StudyParticipantState::Completed;
    let done: Vec<_> = participants.iter().filter(completed).collect();
    assert_eq!(done.len(), PARTICIPANTS as usize);
    let mut by_condition: BTreeMap<&str, u32> = BTreeMap::new();
    for participant in &done {
        *by_condition.entry(&participant.conditions[0]).or_default() += 1;
        assert!(participant.consent.is_some());
    }
    assert_eq!(
        by_condition,
        [("condition-warm", 4), ("condition-cold", 4)].into()
    );
    let game = &done[0].games.last().expect("it has played").game_id;
    assert_eq!(lab.record_refused(game, &owner.1).await, None);
    for ticket in &tickets {
        assert_eq!(lab.record_refused(game, ticket).await, Some(Code::NotFound));
    }

    // The export has everything but practice and what was deleted.
    let files = lab.export().await;
    assert_as_described(&files);
    assert_analysed(&files).await;
    assert_left_out(files.clone()).await;
    let table = |name: &str| rows(&files[name]);
    assert_eq!(table("participants.csv").len(), PARTICIPANTS as usize + 2);
    let games = table("games.csv");
    let finished = games.iter().filter(|row| row.contains(",finished,"));
    assert_eq!(
        finished.count(),
        GAMES * PARTICIPANTS as usize,
        "{games:#?}"
    );
    // The one who was removed has answered, too.
    assert_eq!(table("answers.csv").len(), 6 * (PARTICIPANTS as usize + 1));
    assert!(!table("traces.csv").is_empty());
    let sessions = table("sessions.csv");
    for row in &sessions {
        assert!(row.ends_with(",390,844,300,coarse,Europe/Rome"), "{row}");
    }
    let session_of = |row: &String| row.split(',').nth(2).map(str::to_owned);
    assert!(
        sessions
            .iter()
            .any(|row| session_of(row).as_deref() == Some("2"))
    );
    let mut records = 0;
    for (file, bytes) in &files {
        assert!(!contains(bytes, &name(3)), "{file}");
        if !file.starts_with("records/") {
            continue;
        }
        records += 1;
        let header = checked_header(bytes);
        let of_study = header.study.as_ref().expect("it says where it belongs");
        let participant = &participants[of_study.number as usize - 1];
        assert_eq!(of_study.participant, participant.pseudonym);
        assert_eq!(of_study.condition, participant.conditions[0]);
        let agent = match of_study.condition.as_str() {
            "condition-warm" => "greedy",
            _ => "trained",
        };
        let others = header
            .seats
            .iter()
            .filter(|seat| seat.seat != of_study.seat);
        assert!(others.into_iter().all(|seat| seat.built_in_agent == agent));
    }
    assert_eq!(records, GAMES * PARTICIPANTS as usize);

    // Deletion while the server runs.
    let request = v1::DeleteStudyParticipantRequest {
        study_id: owner.0.clone(),
        owner_token: owner.1.clone(),
        number: 1,
    };
    let deleted = lab.service.delete_study_participant(request).await;
    assert_eq!(deleted.expect("it exists").into_inner().games, 3);
    for (file, bytes) in lab.export().await {
        assert!(!contains(&bytes, &name(1)), "{file}");
    }
    drop((lab, gone));
    let stopping = patiently("the server to stop", second_host.stop());
    stopping.await.expect("a clean end");
    let store = SqliteStore::open(folder.path()).await.expect("a store");
    let id = Id::parse(&owner.0).expect("an id");
    let stored = StoredStudy::read(&store, id)
        .await
        .expect("readable")
        .expect("it exists");
    let stored = format!("{:?}", stored.changes);
    let traces = store.traces(id).await.expect("readable");
    for number in [1, 3] {
        assert!(!stored.contains(&name(number)));
        assert!(traces.iter().all(|traces| traces.number != number));
        for game in &participants[number as usize - 1].games {
            let game = Id::parse(&game.game_id).expect("an id");
            assert!(store.finished(game).await.expect("readable").is_none());
        }
    }
    assert!(stored.contains(&name(2)));
    store.close().await;

    // Nothing that names a condition has reached a participant.
    let received = tap.received.lock().expect("not poisoned");
    let any = |word: &str| received.iter().any(|bytes| contains(bytes, word));
    assert!(any("A game of cards") && any("Player 2"));
    for secret in SECRETS {
        assert!(!any(secret), "participants received {secret:?}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn pictures_are_shown_with_the_texts_that_name_them() {
    let folder = tempfile::tempdir().expect("a folder");
    let server = host(folder.path()).await;
    let channel = Channel::from_shared(server.url()).expect("a URL");
    let channel = channel.connect().await.expect("the server listens");
    let mut service = StudyServiceClient::new(channel);
    let file = |byte| [b"GIF89a".to_vec(), vec![byte; 200_000]].concat();
    let picture = |name: &str, byte| v1::StudyPicture {
        name: name.to_owned(),
        data: file(byte).into(),
    };
    let text = |text: &str| {
        stage(Stage::Text(v1::StudyText {
            title: String::new(),
            text: text.to_owned(),
        }))
    };
    let pictures = vec![picture("first.gif", 1), picture("second.gif", 2)];
    let request = v1::CreateStudyRequest {
        settings: Some(v1::StudySettings {
            stages: vec![text("![a hand](first.gif)"), text("![another](second.gif)")],
            pictures: pictures.clone(),
            ..settings()
        }),
        request_id: Vec::new(),
    };
    let created = service.create_study(request).await.expect("valid");
    let created = created.into_inner();
    let study = created.study.expect("a study");
    let owner = (study.study_id, created.owner_token);

    // The settings come without the files, unless somebody asks for this study.
    let files = |study: &v1::Study| -> Vec<_> {
        let settings = study.settings.as_ref().expect("settings");
        settings.pictures.iter().map(|it| it.data.len()).collect()
    };
    let request = v1::ListStudiesRequest {
        owner_tokens: vec![owner.1.clone()],
    };
    let listed = service.list_studies(request).await.expect("a list");
    assert_eq!(files(&listed.into_inner().studies[0]), [0, 0]);
    let request = v1::GetStudyRequest {
        study_id: owner.0.clone(),
        owner_token: owner.1.clone(),
    };
    let whole = service.get_study(request).await.expect("it exists");
    let whole = whole.into_inner().study.expect("a study");
    assert_eq!(whole.settings.expect("settings").pictures, pictures);

    let mut lab = Lab::connect(&server, owner).await;
    let links = lab.links(vec!["P1".to_owned()]).await;
    let url = server.url();
    let channel = Channel::from_shared(url).expect("a URL");
    let mut service =
        ParticipationServiceClient::new(channel.connect().await.expect("the server listens"));
    let shown = async |service: &mut ParticipationServiceClient<Channel>, picture: &str| {
        let request = v1::GetStudyPictureRequest {
            link: links[0].clone(),
            picture: picture.to_owned(),
        };
        let got = service.get_study_picture(request).await;
        got.map(|got| got.into_inner().data)
            .map_err(|status| reason(&status))
    };
    let unknown = Err("PICTURE_UNKNOWN".to_owned());
    assert_eq!(
        shown(&mut service, "first.gif").await,
        unknown,
        "it has not begun"
    );
    let request = v1::OpenStudyRequest {
        link: links[0].clone(),
        device: None,
    };
    let opened = service.open_study(request).await.expect("a place");
    let session = opened.into_inner().session;
    assert_eq!(shown(&mut service, "first.gif").await, Ok(file(1).into()));
    assert_eq!(shown(&mut service, "second.gif").await, unknown);
    let request = v1::ContinueStudyRequest { session, step: 0 };
    service.continue_study(request).await.expect("it is a text");
    assert_eq!(shown(&mut service, "first.gif").await, unknown);
    assert_eq!(shown(&mut service, "second.gif").await, Ok(file(2).into()));

    let exported = lab.export().await;
    assert_eq!(exported["pictures/first.gif"], file(1));
    let stopping = patiently("the server to stop", server.stop());
    stopping.await.expect("a clean end");

    // They are stored.
    let server = host(folder.path()).await;
    let channel = Channel::from_shared(server.url()).expect("a URL");
    let mut service =
        ParticipationServiceClient::new(channel.connect().await.expect("the server listens"));
    assert_eq!(shown(&mut service, "second.gif").await, Ok(file(2).into()));
    let stopping = patiently("the server to stop", server.stop());
    stopping.await.expect("a clean end");
}
