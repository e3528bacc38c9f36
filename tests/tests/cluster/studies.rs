//! A study on three nodes, of which the one that owns it is killed while its participants play.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use chefshat_client::{Backoff, Client, Connection, PlayOptions, RandomAgent};
use chefshat_proto::v1::participation_service_client::ParticipationServiceClient;
use chefshat_proto::v1::study_service_client::StudyServiceClient;
use chefshat_proto::v1::{self, seat_config::FilledBy, study_stage::Stage, study_view::Content};
use chefshat_tests::{PATIENCE, one_shift, patiently};
use futures::future::join_all;
use tonic::{Code, Status};

use crate::cluster::{Cluster, Leases};

const NODES: usize = 3;
const PARTICIPANTS: u32 = 4;
/// Time between two attempts.
const TRY_AGAIN: Duration = Duration::from_millis(50);

fn settings() -> v1::StudySettings {
    let stage = |stage| v1::StudyStage {
        stage: Some(stage),
        ..v1::StudyStage::default()
    };
    let seat = v1::SeatConfig {
        filled_by: Some(FilledBy::BuiltInAgent("random".into())),
        ..v1::SeatConfig::default()
    };
    v1::StudySettings {
        name: "moving".into(),
        title: "A game of cards".into(),
        participants: PARTICIPANTS,
        conditions: vec![v1::StudyCondition {
            id: "only".into(),
            rules: Some(one_shift()),
            policy: Some(v1::RoomPolicy {
                decision_time_ms: Some(3_600_000),
                pace_ms: Some(2),
                ..v1::RoomPolicy::default()
            }),
            seats: vec![seat; 3],
            ..v1::StudyCondition::default()
        }],
        stages: vec![
            stage(Stage::Consent(v1::StudyConsent {
                text: "I take part.".into(),
                version: "1".into(),
            })),
            stage(Stage::Games(v1::StudyGames { count: 2 })),
        ],
        recruiting: Some(v1::StudyRecruiting {
            open_link: true,
            ..v1::StudyRecruiting::default()
        }),
        ..v1::StudySettings::default()
    }
}

/// Tries again while the node that has the study is just changing.
async fn settled<T, F: Future<Output = Result<T, Status>>>(call: impl Fn() -> F) -> T {
    let trying = async {
        loop {
            match call().await {
                Ok(answer) => return answer,
                Err(status) if status.code() == Code::Unavailable => {
                    tokio::time::sleep(TRY_AGAIN).await;
                }
                Err(status) => panic!("{status}"),
            }
        }
    };
    patiently("an answer", trying).await
}

/// As [`settled`], for a step that is taken once: `None` if the answer was lost with the node that had
/// committed it.
async fn taken<T, F: Future<Output = Result<T, Status>>>(call: impl Fn() -> F) -> Option<T> {
    let is_lost = AtomicBool::new(false);
    let attempt = || async {
        match call().await {
            Err(status) if status.code() == Code::Unavailable => {
                is_lost.store(true, Ordering::Relaxed);
                Err(status)
            }
            Err(status)
                if status.code() == Code::FailedPrecondition && is_lost.load(Ordering::Relaxed) =>
            {
                Ok(None)
            }
            answer => answer.map(Some),
        }
    };
    settled(attempt).await
}

/// Opens a link. Returns the session and what is shown.
async fn open(
    service: &ParticipationServiceClient<Connection>,
    link: &str,
) -> (String, v1::StudyView) {
    let opened = settled(|| {
        let mut service = service.clone();
        let link = link.to_owned();
        async move {
            service
                .open_study(v1::OpenStudyRequest {
                    link,
                    ..Default::default()
                })
                .await
        }
    });
    let opened = opened.await.into_inner();
    (opened.session, opened.view.expect("a view"))
}

/// Waits until a view is as wanted, whatever happens to the stream.
async fn until(
    service: &ParticipationServiceClient<Connection>,
    session: &str,
    wanted: impl Fn(&Content) -> bool,
) -> v1::StudyView {
    let following = async {
        loop {
            let session = session.to_owned();
            let request = v1::FollowParticipationRequest { session };
            if let Ok(followed) = service.clone().follow_participation(request).await {
                let mut views = followed.into_inner();
                while let Ok(Some(message)) = views.message().await {
                    if let Some(view) = message.view
                        && wanted(view.content.as_ref().expect("content"))
                    {
                        return view;
                    }
                }
            }
            tokio::time::sleep(TRY_AGAIN).await;
        }
    };
    patiently("the next view", following).await
}

/// Takes part through the proxy, to the end.
async fn take_part(url: String, link: String) {
    let client = Client::connect(&url).await.expect("the proxy listens");
    let service = ParticipationServiceClient::new(client.channel());
    let options = PlayOptions {
        backoff: Backoff {
            give_up_after: PATIENCE,
            ..Backoff::default()
        },
        ..PlayOptions::default()
    };
    let (mut session, mut view) = open(&service, &link).await;
    loop {
        let step = view.step;
        let next = match view.content.expect("content") {
            Content::Consent(_) => {
                let given = taken(|| {
                    let mut service = service.clone();
                    let session = session.clone();
                    async move {
                        service
                            .give_consent(v1::GiveConsentRequest { session, step })
                            .await
                    }
                });
                (given.await).map(|given| given.into_inner().view)
            }
            Content::Game(_) => {
                let playable = |content: &Content| matches!(content, Content::Game(game) if !game.ticket.is_empty());
                let shown = until(&service, &session, playable).await;
                let Some(Content::Game(game)) = shown.content else {
                    panic!("it is a game");
                };
                let playing = client.play_with(game.ticket, RandomAgent::new(7), &options);
                let outcome = patiently("the game to end", playing).await;
                assert!(outcome.expect("it ends").standing().is_some(), "aborted");
                let ended = |content: &Content| matches!(content, Content::Game(it) if it.ended);
                until(&service, &session, ended).await;
                let continued = taken(|| {
                    let mut service = service.clone();
                    let session = session.clone();
                    let request = v1::ContinueStudyRequest { session, step };
                    async move { service.continue_study(request).await }
                });
                (continued.await).map(|continued| continued.into_inner().view)
            }
            Content::End(end) => {
                assert_eq!(end.reason(), v1::StudyEndReason::Completed);
                return;
            }
            other => panic!("unexpected: {other:?}"),
        };
        match next {
            Some(next) => view = next.expect("a view"),
            // A page shows what follows in the same way.
            None => (session, view) = open(&service, &link).await,
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_study_whose_owner_is_killed_goes_on_at_another_node() {
    let mut cluster = Cluster::start(NODES, Leases::Short).await;
    let client = Client::connect(cluster.url()).await.expect("it listens");
    let mut service = StudyServiceClient::new(client.channel());
    let request = v1::CreateStudyRequest {
        settings: Some(settings()),
        request_id: vec![7; 32],
    };
    let created = settled(|| {
        let (mut service, request) = (service.clone(), request.clone());
        async move { service.create_study(request).await }
    });
    let created = created.await.into_inner();
    let study = created.study.expect("a study");
    let study_id = study.study_id;
    let owner_token = created.owner_token;
    // Each node answers the same request with the same study, and lists it.
    for node in &cluster.nodes {
        let mut service = StudyServiceClient::new(node.client().await.channel());
        let repeated = settled(|| {
            let (mut service, request) = (service.clone(), request.clone());
            async move { service.create_study(request).await }
        });
        let repeated = repeated.await.into_inner();
        assert_eq!(repeated.owner_token, owner_token);
        let request = v1::ListStudiesRequest {
            owner_tokens: vec![owner_token.clone()],
        };
        let listed = service.list_studies(request).await.expect("a list");
        let listed = listed.into_inner().studies;
        assert_eq!(listed.len(), 1);
        assert_eq!(listed[0].study_id, study_id);
    }
    let request = v1::AddStudyParticipantsRequest {
        study_id: study_id.clone(),
        owner_token: owner_token.clone(),
        count: PARTICIPANTS - 1,
        ..v1::AddStudyParticipantsRequest::default()
    };
    let added = service.add_study_participants(request).await;
    let links = added.expect("its owner").into_inner().links;
    let mut links: Vec<String> = links.into_iter().map(|it| it.link).collect();
    // One joins by the open link, which every node knows.
    let mut joined = BTreeSet::new();
    for node in &cluster.nodes {
        let service = ParticipationServiceClient::new(node.client().await.channel());
        let request = v1::JoinStudyRequest {
            open_link: study.open_link.clone(),
            panel_id: String::new(),
            request_id: vec![8; 32],
            device: None,
        };
        let answer = settled(|| {
            let (mut service, request) = (service.clone(), request.clone());
            async move { service.join_study(request).await }
        });
        joined.insert(answer.await.into_inner().link);
    }
    assert_eq!(joined.len(), 1, "the same request");
    links.extend(joined);
    let url = cluster.url();
    let people = links.into_iter().map(|it| take_part(url.clone(), it));
    let taking_part = tokio::spawn(join_all(people));

    let get = || {
        let mut service = service.clone();
        let request = v1::GetStudyRequest {
            study_id: study_id.clone(),
            owner_token: owner_token.clone(),
        };
        async move { service.get_study(request).await }
    };
    let playing = async {
        loop {
            let shown = settled(get).await.into_inner();
            if shown.participants.iter().any(|it| !it.games.is_empty()) {
                return;
            }
            tokio::time::sleep(TRY_AGAIN).await;
        }
    };
    patiently("a game", playing).await;
    let owner = cluster.owner_of(&study_id);
    cluster.kill(owner).await;
    cluster.taken_over(owner).await;
    assert_ne!(cluster.owner_of(&study_id), owner);
    cluster.restart(owner).await;
    patiently("the end", taking_part).await.expect("no panic");

    let participants = settled(get).await.into_inner().participants;
    let mut games: BTreeMap<&str, u32> = BTreeMap::new();
    for participant in &participants {
        let completed = v1::StudyParticipantState::Completed;
        assert_eq!(participant.state(), completed);
        for game in &participant.games {
            *games.entry(&game.game_id).or_default() += 1;
        }
    }
    assert_eq!(games.len(), 2 * PARTICIPANTS as usize, "each game once");
    // Every node exports the same data, and deletes a participant's.
    for node in &cluster.nodes {
        let service = StudyServiceClient::new(node.client().await.channel());
        let request = v1::ExportStudyRequest {
            study_id: study_id.clone(),
            owner_token: owner_token.clone(),
            test: false,
        };
        let exported = settled(|| {
            let (mut service, request) = (service.clone(), request.clone());
            async move { service.export_study(request).await }
        });
        let mut parts = exported.await.into_inner();
        let mut records = BTreeSet::new();
        while let Some(part) = parts.message().await.expect("it ends well") {
            if part.file.starts_with("records/") {
                records.insert(part.file);
            }
        }
        assert_eq!(records.len(), games.len());
    }
    let other = (0..NODES).find(|node| *node != cluster.owner_of(&study_id));
    let other = &cluster.nodes[other.expect("there are three")];
    let service = StudyServiceClient::new(other.client().await.channel());
    let request = v1::DeleteStudyParticipantRequest {
        study_id: study_id.clone(),
        owner_token: owner_token.clone(),
        number: 1,
    };
    let deleted = settled(|| {
        let (mut service, request) = (service.clone(), request.clone());
        async move { service.delete_study_participant(request).await }
    });
    assert_eq!(deleted.await.into_inner().games, 2);
    let request = v1::DeleteStudyRequest {
        study_id: study_id.clone(),
        owner_token: owner_token.clone(),
        force: false,
    };
    // Nobody is in the middle of it.
    let deleted = settled(|| {
        let (mut service, request) = (service.clone(), request.clone());
        async move { service.delete_study(request).await }
    });
    assert_eq!(deleted.await.into_inner().participants, PARTICIPANTS);
    settled(|| async {
        match get().await {
            Err(status) if status.code() == Code::NotFound => Ok(()),
            Err(status) => Err(status),
            Ok(_) => Err(Status::internal("it is still there")),
        }
    })
    .await;
}
