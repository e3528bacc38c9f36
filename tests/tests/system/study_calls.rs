//! What a researcher does with a running study besides reading its data: follows it, deletes a
//! participant by its name or the whole study. And what a participant cannot do to its room.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use chefshat_client::{Client, ConnectOptions, Connection, RandomAgent};
use chefshat_proto::v1::admin_service_client::AdminServiceClient;
use chefshat_proto::v1::instrument_service_client::InstrumentServiceClient;
use chefshat_proto::v1::study_service_client::StudyServiceClient;
use chefshat_proto::v1::{self, record_line::Line, seat_config::FilledBy, study_view::Content};
use chefshat_record::pseudonym::Named;
use chefshat_record::samples;
use chefshat_room::ids::Id;
use chefshat_server::access::{Mode, NewToken, Role, TokenFile};
use chefshat_server::config::ServerConfig;
use chefshat_server::host::Host;
use chefshat_server::participants::ParticipantData;
use chefshat_server::store::studies::StoredStudy;
use chefshat_server::store::units::UnitKind;
use chefshat_server::store::{SqliteStore, Store as _, units_of};
use chefshat_tests::patiently;
use tonic::Streaming;
use tonic::transport::Channel;

use crate::records::reason;
use crate::studies::{Lab, Person, Tap, address, host, playable, settings};

/// The first step with a game.
const GAMES: u32 = 2;

/// A study on a server, with participants of these names.
struct Running {
    lab: Lab,
    tap: Tap,
    links: Vec<String>,
}

async fn running(host: &Host, names: &[&str]) -> Running {
    created(host, settings(), names).await
}

async fn created(host: &Host, settings: v1::StudySettings, names: &[&str]) -> Running {
    let channel = Channel::from_shared(host.url().to_owned()).expect("a URL");
    let channel = channel.connect().await.expect("the server listens");
    let request = v1::CreateStudyRequest {
        settings: Some(settings),
        request_id: Vec::new(),
    };
    let mut service = StudyServiceClient::new(channel);
    let created = service.create_study(request).await.expect("valid");
    let created = created.into_inner();
    let study = created.study.expect("a study");
    let mut lab = Lab::connect(host, (study.study_id, created.owner_token)).await;
    let names = names.iter().map(|name| (*name).to_owned()).collect();
    Running {
        links: lab.links(names).await,
        lab,
        tap: Tap::new(address(host)).await,
    }
}

/// A participant who has come to a game that has a room.
async fn at_a_game(tap: &Tap, link: &str) -> (Person, v1::StudyShownGame) {
    let (mut person, view) = Person::new(tap, link).await;
    person.go_on(view, GAMES).await;
    let view = person.until(|content| playable(content).is_some()).await;
    let game = view.content.as_ref().and_then(playable).expect("a game");
    let game = game.clone();
    (person, game)
}

#[tokio::test(flavor = "multi_thread")]
async fn a_participant_keeps_its_seat_until_it_withdraws() {
    let folder = tempfile::tempdir().expect("a folder");
    let host = host(folder.path()).await;
    let study = running(&host, &["Ana"]).await;
    let (mut person, game) = at_a_game(&study.tap, &study.links[0]).await;
    let client = Client::connect(host.url()).await.expect("it listens");
    let left = client.leave_room(game.ticket.as_str()).await;
    let refused = left.expect_err("the study has assigned the seat");
    assert_eq!(refused.reason(), Some("SEAT_ASSIGNED"));
    // The same game is still there to be played.
    let view = person.open().await.expect("the link is valid");
    assert_eq!(view.content.as_ref().and_then(playable), Some(&game));
    let (view, tickets) = person.go_on(view, GAMES + 1).await;
    assert_eq!(tickets, [game.ticket]);
    assert_eq!(view.step, GAMES + 1);
    let stopping = patiently("the server to stop", host.stop());
    stopping.await.expect("a clean end");
}

/// What a follower knows of a study.
#[derive(Default)]
struct Followed {
    study: Option<v1::Study>,
    participants: BTreeMap<u32, v1::StudyParticipant>,
}

impl Followed {
    /// Reads updates until the participants are as wanted; `false` if the stream ends before.
    async fn until(
        &mut self,
        updates: &mut Streaming<v1::FollowStudyResponse>,
        wanted: impl Fn(&BTreeMap<u32, v1::StudyParticipant>) -> bool,
    ) -> bool {
        let reading = async {
            while !wanted(&self.participants) {
                let Some(update) = updates.message().await.expect("it ends well") else {
                    return false;
                };
                if self.study.is_none() {
                    assert!(update.study.is_some(), "the first message has the study");
                }
                self.study = update.study.or(self.study.take());
                let changed = update.participants.into_iter();
                self.participants.extend(changed.map(|it| (it.number, it)));
            }
            true
        };
        patiently("the next update", reading).await
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_study_is_followed_until_it_is_over_and_deleted() {
    let folder = tempfile::tempdir().expect("a folder");
    let host = host(folder.path()).await;
    let Running {
        mut lab,
        tap,
        links,
    } = running(&host, &["Ana", "Bo"]).await;
    let request = v1::FollowStudyRequest {
        study_id: lab.study_id.clone(),
        owner_token: "wrong".into(),
    };
    let refused = lab.service.follow_study(request.clone()).await;
    assert_eq!(reason(&refused.expect_err("wrong")), "STUDY_UNKNOWN");
    let request = v1::FollowStudyRequest {
        owner_token: lab.owner_token.clone(),
        ..request
    };
    let followed = lab.service.follow_study(request).await;
    let mut updates = followed.expect("its owner").into_inner();
    let mut known = Followed::default();
    assert!(known.until(&mut updates, |all| all.len() == 2).await);
    let invited = v1::StudyParticipantState::Invited;
    assert!(known.participants.values().all(|it| it.state() == invited));

    // Each change of a participant arrives: it begins, comes to a game, and the game has a room.
    let (_ana, game) = at_a_game(&tap, &links[0]).await;
    let plays = |it: &v1::StudyParticipant| it.games.iter().any(|it| it.game_id == game.game_id);
    assert!(known.until(&mut updates, |all| plays(&all[&1])).await);
    let ana = &known.participants[&1];
    assert_eq!(
        (ana.state(), ana.step),
        (v1::StudyParticipantState::Active, GAMES)
    );
    assert_eq!(known.participants[&2].state(), invited);

    let delete = |lab: &Lab, force| v1::DeleteStudyRequest {
        study_id: lab.study_id.clone(),
        owner_token: lab.owner_token.clone(),
        force,
    };
    let refused = lab.service.delete_study(delete(&lab, false)).await;
    assert_eq!(reason(&refused.expect_err("Ana plays")), "STUDY_RUNNING");
    let deleted = lab.service.delete_study(delete(&lab, true)).await;
    let deleted = deleted.expect("forced").into_inner();
    assert_eq!((deleted.participants, deleted.games), (2, 1));
    // The follower sees the end, or at least that there is nothing more.
    assert!(!known.until(&mut updates, |_| false).await);
    let removed = v1::StudyParticipantState::Removed;
    assert_eq!(known.participants[&1].state(), removed);
    let again = lab.service.delete_study(delete(&lab, true)).await;
    assert_eq!(reason(&again.expect_err("it is gone")), "STUDY_UNKNOWN");
    let stopping = patiently("the server to stop", host.stop());
    stopping.await.expect("a clean end");
    let store = SqliteStore::open(folder.path()).await.expect("a store");
    assert_eq!(
        store.units(UnitKind::Study, usize::MAX).await,
        Ok(Vec::new())
    );
    let game = Id::parse(&game.game_id).expect("an id");
    assert!(store.finished(game).await.expect("readable").is_none());
    store.close().await;
}

/// A server on a folder that asks for tokens only where its operator is needed.
pub(crate) async fn open_to_all(folder: &Path) -> Host {
    let store = SqliteStore::open(folder).await.expect("a store");
    let mut config = ServerConfig {
        data_dir: Some(PathBuf::from(folder)),
        grace: std::time::Duration::ZERO,
        ..ServerConfig::default()
    };
    config.access.mode = Some(Mode::Open);
    let host = Host::start(config, Arc::new(store)).await;
    host.expect("a free port")
}

/// A server open to all on a folder, and what its operator calls.
pub(crate) async fn operated(folder: &Path) -> (Host, AdminServiceClient<Connection>) {
    let new = NewToken {
        role: Role::Admin,
        label: String::new(),
        lifetime: None,
        scope: None,
    };
    let token = TokenFile::of(folder).create(new).expect("a token");
    let host = open_to_all(folder).await;
    let options = ConnectOptions {
        token: Some(token.to_text()),
        ca: None,
    };
    let client = Client::connect_with(host.url(), &options).await;
    let operator = AdminServiceClient::new(client.expect("it listens").channel());
    (host, operator)
}

/// A chunk of two samples.
fn chunk() -> Option<v1::SampleChunk> {
    Some(v1::SampleChunk {
        stream: "affect".into(),
        channels: vec!["valence".into()],
        elapsed_us: vec![1, 2],
        values: vec![0.5, 0.25],
    })
}

#[tokio::test(flavor = "multi_thread")]
async fn the_instruments_of_the_researcher_reach_the_game_of_a_participant() {
    let folder = tempfile::tempdir().expect("a folder");
    let host = host(folder.path()).await;
    let mut study = running(&host, &["Ana"]).await;
    let (mut person, view) = Person::new(&study.tap, &study.links[0]).await;
    let (view, _) = person.go_on(view, GAMES + 1).await;
    let game = person.until(|content| playable(content).is_some()).await;
    let game = game
        .content
        .as_ref()
        .and_then(playable)
        .expect("a game")
        .clone();
    let placed = study.lab.participants().await.remove(0).games.pop();
    let seat = placed.expect("its game").seat;

    let stranger = Client::connect(host.url()).await.expect("it listens");
    let owner = stranger
        .with_secrets([&study.lab.owner_token])
        .expect("a token");
    let unseen = stranger.spectate(&game.room_id, 0).next().await;
    let unseen = unseen
        .expect_err("it is private")
        .reason()
        .map(str::to_owned);
    assert_eq!(unseen.as_deref(), Some("ROOM_UNKNOWN"));
    let seated = stranger.with_secrets([&game.ticket]).expect("a ticket");
    let refused = seated.spectate(&game.room_id, 0).next().await;
    let refused = refused
        .expect_err("no spectators")
        .reason()
        .map(str::to_owned);
    assert_eq!(refused.as_deref(), Some("SPECTATORS_NOT_ADMITTED"));
    let mut watching = owner.spectate(&game.room_id, 0);
    let first = patiently("an event", watching.next()).await;
    first.expect("the owner watches").expect("an event");

    let mut instruments = InstrumentServiceClient::new(stranger.channel());
    let mark = |owner_token: &str| v1::AddMarkerRequest {
        room_id: game.room_id.clone(),
        owner_token: owner_token.into(),
        label: "EEG on".into(),
        elapsed_us: Some(1),
    };
    let marked = instruments.add_marker(mark(&study.lab.owner_token)).await;
    assert_eq!(
        marked
            .expect("its owner")
            .into_inner()
            .marker
            .map(|it| it.number),
        Some(1)
    );
    let refused = instruments.add_marker(mark(&game.ticket)).await;
    assert_eq!(
        reason(&refused.expect_err("a participant")),
        "OWNER_TOKEN_WRONG"
    );
    let add = |owner_token: &str, seat: u32| v1::AddSamplesRequest {
        owned_seat: Some(v1::OwnedSeat {
            room_id: game.room_id.clone(),
            owner_token: owner_token.into(),
            seat,
        }),
        chunk: chunk(),
        ..v1::AddSamplesRequest::default()
    };
    for (token, seat, expected) in [
        (game.ticket.as_str(), seat, "OWNER_TOKEN_WRONG"),
        ("", seat, "ROOM_UNKNOWN"),
        (&study.lab.owner_token, 4, "SAMPLES_REFUSED"),
    ] {
        let refused = instruments.add_samples(add(token, seat)).await;
        assert_eq!(
            reason(&refused.expect_err("not its owner, or no seat")),
            expected
        );
    }
    // The samples of a seat may come until the room is gone, but not before its game.
    let early = instruments
        .add_samples(add(&study.lab.owner_token, seat))
        .await;
    assert_eq!(reason(&early.expect_err("it waits")), "GAME_NOT_STARTED");
    person.go_on(view, GAMES + 2).await;
    let mut seen = String::new();
    while let Some(event) = patiently("an event", watching.next())
        .await
        .expect("still watched")
    {
        seen += &format!("{event:?}\n");
    }
    // Like the participant, the owner sees the game without what names the condition.
    assert!(
        seen.contains("GameStarted") && seen.contains("GameEnded"),
        "{seen}"
    );
    assert!(!seen.contains("Robot"), "{seen}");
    let added = instruments
        .add_samples(add(&study.lab.owner_token, seat))
        .await;
    assert_eq!(added.expect("its owner").into_inner().recorded, 2);

    let data = study.lab.export().await;
    let samples = &data[&format!("samples/{}.{seat}.samples", game.game_id)];
    let stored = std::fs::read(samples::path_of(
        folder.path(),
        &game.game_id,
        seat as usize,
    ));
    assert_eq!(samples, &stored.expect("its file"));
    let record = &data[&format!("records/{}.jsonl", game.game_id)];
    assert!(String::from_utf8_lossy(record).contains("EEG on"));
    drop((watching, person, study));
    let stopping = patiently("the server to stop", host.stop());
    stopping.await.expect("a clean end");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_robot_of_a_study_may_be_played_by_a_person() {
    let folder = tempfile::tempdir().expect("a folder");
    let host = host(folder.path()).await;
    let mut settings = settings();
    for condition in &mut settings.conditions {
        let robot = v1::ParticipantKind::Robot.into();
        condition.seats[1].name.clear();
        condition.seats[1].filled_by = Some(FilledBy::Wizard(robot));
    }
    let mut study = created(&host, settings, &["Ana"]).await;
    let (mut person, view) = Person::new(&study.tap, &study.links[0]).await;
    let step = GAMES + 1;
    // The practice and each game need the robot.
    let client = Client::connect(host.url()).await.expect("it listens");
    let robot = async {
        let mut played = BTreeSet::new();
        loop {
            let games = study.lab.participants().await.remove(0).games;
            let open = games.into_iter().find(|it| !it.join_code.is_empty());
            let Some(game) = open.filter(|it| played.insert(it.game_id.clone())) else {
                tokio::time::sleep(std::time::Duration::from_millis(20)).await;
                continue;
            };
            let request = v1::JoinRoomRequest {
                join_code: game.join_code,
                name: "Robbie".into(),
                kind: v1::ParticipantKind::Robot.into(),
                ..v1::JoinRoomRequest::default()
            };
            let joined = client.join(request).await.expect("a seat for a robot");
            let playing = client.play(joined.ticket, RandomAgent::new(3)).await;
            playing.expect("it ends");
        }
    };
    let playing = async {
        tokio::select! {
            () = robot => {}
            _ = person.go_on(view, step + 1) => {}
        }
    };
    patiently("the games to end", playing).await;

    let data = study.lab.export().await;
    let placed = study.lab.participants().await.remove(0).games;
    let game = placed.iter().find(|it| it.step == step).expect("a game");
    let record = &data[&format!("records/{}.jsonl", game.game_id)];
    let first = record.split(|byte| *byte == b'\n').next();
    let first: v1::RecordLine = serde_json::from_slice(first.expect("a line")).expect("a record");
    let Some(Line::Header(header)) = &first.line else {
        panic!("no header");
    };
    let robots: Vec<_> = (header.seats.iter())
        .filter(|it| it.name == "Robbie")
        .map(|it| (it.kind(), it.shown_kind()))
        .collect();
    let person_as_robot = (v1::ParticipantKind::Human, v1::ParticipantKind::Robot);
    assert_eq!(robots, [person_as_robot]);
    drop((person, study));
    let stopping = patiently("the server to stop", host.stop());
    stopping.await.expect("a clean end");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_participant_is_known_by_its_name_to_the_operator() {
    let folder = tempfile::tempdir().expect("a folder");
    let (host, mut operator) = operated(folder.path()).await;
    let mut study = running(&host, &["Pseudonym-of-Ana", "Pseudonym-of-Bo"]).await;
    let (mut person, _) = at_a_game(&study.tap, &study.links[0]).await;
    let name = || "Pseudonym-of-Ana".to_owned();
    let request = v1::ExportParticipantRequest {
        name: name(),
        ..v1::ExportParticipantRequest::default()
    };
    let exported = operator.export_participant(request).await;
    let mut lines = exported.expect("allowed").into_inner();
    let mut kinds: BTreeMap<&str, u32> = BTreeMap::new();
    while let Some(response) = lines.message().await.expect("it ends well") {
        assert_eq!(response.unread_files, [""; 0]);
        for kind in ["participant", "study", "answer", "decision"] {
            let starts = format!("{{\"{kind}\":");
            *kinds.entry(kind).or_default() += u32::from(response.line.starts_with(&starts));
        }
    }
    // The six items of NASA-TLX; its game is not over.
    let expected = [
        ("participant", 1),
        ("study", 1),
        ("answer", 6),
        ("decision", 0),
    ];
    assert_eq!(kinds, expected.into());

    // Its game is closed, and its data in the study are deleted.
    let request = v1::DeleteParticipantRequest {
        name: name(),
        ..v1::DeleteParticipantRequest::default()
    };
    let deleted = operator.delete_participant(request.clone()).await;
    let deleted = deleted.expect("all can be closed").into_inner();
    assert_eq!((deleted.studies, deleted.games), (1, 0));
    let view = person.open().await.expect("the link is valid");
    let Some(Content::End(end)) = view.content else {
        panic!("it is the end");
    };
    assert_eq!(end.reason(), v1::StudyEndReason::DataDeleted);
    let participants = study.lab.participants().await;
    assert!(participants[0].data_deleted && !participants[1].data_deleted);
    let again = operator
        .delete_participant(request)
        .await
        .expect("the same");
    assert_eq!(again.into_inner().studies, 0);
    let request = v1::ExportParticipantRequest {
        name: name(),
        ..v1::ExportParticipantRequest::default()
    };
    let exported = operator.export_participant(request).await;
    let unknown = exported.expect("allowed").into_inner().message().await;
    assert_eq!(
        reason(&unknown.expect_err("nothing is left")),
        "PARTICIPANT_UNKNOWN"
    );
    let empty = v1::DeleteParticipantRequest::default();
    let refused = operator.delete_participant(empty).await;
    assert_eq!(reason(&refused.expect_err("no name")), "NAME_REFUSED");
    drop((person, study));
    let stopping = patiently("the server to stop", host.stop());
    stopping.await.expect("a clean end");
    let store = SqliteStore::open(folder.path()).await.expect("a store");
    let studies = units_of(&store, usize::MAX).await.expect("readable");
    let stored = StoredStudy::read(&store, studies[0])
        .await
        .expect("readable");
    let stored = format!("{:?}", stored.expect("it exists").changes);
    assert!(!stored.contains(&name()) && stored.contains("Pseudonym-of-Bo"));
    store.close().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_participant_is_deleted_from_a_study_of_a_server_that_is_stopped() {
    let folder = tempfile::tempdir().expect("a folder");
    let host = host(folder.path()).await;
    let ana = Named {
        name: "Pseudonym-of-Ana".into(),
        fingerprint: None,
    };
    let study = running(&host, &[&ana.name]).await;
    let (mut person, view) = Person::new(&study.tap, &study.links[0]).await;
    person.go_on(view, GAMES).await;
    let game = person.until(|content| playable(content).is_some()).await;
    let game = game
        .content
        .as_ref()
        .and_then(playable)
        .expect("a game")
        .clone();
    let stop = async |host: Host| {
        let stopping = patiently("the server to stop", host.stop());
        stopping.await.expect("a clean end");
    };
    stop(host).await;
    let with_data = async || {
        let store = Arc::new(SqliteStore::open(folder.path()).await.expect("a store"));
        let data = ParticipantData::new(Arc::clone(&store) as _, Some(folder.path().into()));
        (store, data)
    };
    let (store, data) = with_data().await;
    let refused = data.delete(&ana).await.expect_err("its game is not over");
    assert!(
        refused.to_string().contains("a game that is not over"),
        "{refused}"
    );
    store.close().await;
    drop((store, data));

    let host = crate::studies::host(folder.path()).await;
    *study.tap.target.lock().expect("not poisoned") = address(&host);
    let view = person.back().await;
    // Before the last step, the next game has a room as soon as one is over.
    let last = view.steps - 1;
    let (view, tickets) = person.go_on(view, last).await;
    assert_eq!((view.step, &tickets[0]), (last, &game.ticket));
    stop(host).await;
    let samples = samples::path_of(folder.path(), &game.game_id, 0);
    std::fs::create_dir(samples::folder_of(folder.path())).expect("a new folder");
    std::fs::write(&samples, []).expect("written");

    let (store, data) = with_data().await;
    let deleted = data.delete(&ana).await.expect("its games are over");
    assert_eq!(deleted.studies, 1);
    let studies = units_of(store.as_ref(), usize::MAX).await;
    let id = studies.expect("readable")[0];
    let stored = StoredStudy::read(store.as_ref(), id)
        .await
        .expect("readable")
        .expect("stored");
    assert!(!format!("{:?}", stored.changes).contains(&ana.name));
    assert_eq!(store.traces(id).await, Ok(Vec::new()));
    let game = Id::parse(&game.game_id).expect("an id");
    assert!(store.finished(game).await.expect("readable").is_none());
    assert!(!samples.exists());
    let again = data.delete(&ana).await.expect("nothing to do");
    assert!(!again.found_any(), "{again:?}");
    store.close().await;
    drop((store, data));

    // The study resumes, and knows that the participant has withdrawn.
    let host = crate::studies::host(folder.path()).await;
    let owner = (study.lab.study_id, study.lab.owner_token);
    let mut lab = Lab::connect(&host, owner).await;
    let participants = lab.participants().await;
    let withdrawn = v1::StudyParticipantState::Withdrawn;
    assert_eq!(participants[0].state(), withdrawn);
    assert!(participants[0].data_deleted);
    stop(host).await;
}
