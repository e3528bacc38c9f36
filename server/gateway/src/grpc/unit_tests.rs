//! Calls about tournaments and studies, without a server around them. Repeated requests, whose answers
//! contain secrets: the caller gets the same answer again, and another token with the same `request_id`
//! does not get these secrets. Calls that wait.

use std::sync::Arc;

use chefshat_proto::v1::{
    self, study_service_server::StudyService as _,
    tournament_service_server::TournamentService as _,
};
use chefshat_room::ids::SecretHash;
use tokio_util::sync::CancellationToken;
use tokio_util::task::TaskTracker;
use tonic::Request;

use futures::FutureExt as _;

use super::limits::FullShare;
use super::{Lookup, Recorded, StudyCalls, TournamentCalls};
use chefshat_admission::access::{Caller, Role};
use chefshat_admission::limits::{CallLimits, Key};
use chefshat_hosting::config::ServerConfig;
use chefshat_hosting::rooms::Rooms;
use chefshat_hosting::studies::Studies;
use chefshat_hosting::tournaments::Tournaments;
use chefshat_store::MemoryStore;

const REQUEST_ID: [u8; 32] = [7; 32];

/// The calls of a server.
struct Calls {
    rooms: Arc<Rooms>,
    tournaments: TournamentCalls,
    studies: StudyCalls,
}

fn calls() -> Calls {
    let config = ServerConfig::default();
    let tracker = TaskTracker::new();
    let store = Arc::new(MemoryStore::default());
    let rooms = Rooms::new(&config, store, tracker.clone()).expect("threads");
    let tournaments = Tournaments::new(Arc::clone(&rooms), tracker.clone());
    let studies = Studies::new(Arc::clone(&rooms), tracker);
    let limits = Arc::new(CallLimits::new(config.shares));
    let lookup = Lookup::new(Arc::clone(&rooms), Arc::clone(&tournaments));
    let recorded = Recorded::new(lookup.clone(), Role::Spectator).expect("threads");
    let closing = CancellationToken::new();
    let calls = Arc::clone(&limits);
    Calls {
        rooms,
        tournaments: TournamentCalls::new(tournaments, recorded, calls, closing.clone()),
        studies: StudyCalls::new(studies, lookup, limits, closing),
    }
}

/// A request of a token of this role.
fn by<T>(token: &str, message: T) -> Request<T> {
    let mut request = Request::new(message);
    request.extensions_mut().insert(Caller {
        token_hash: Some(SecretHash::of(token.as_bytes())),
        role: Role::Host,
        ..Caller::default()
    });
    request
}

/// Creates a study for one participant.
fn create() -> v1::CreateStudyRequest {
    let seat = v1::SeatConfig {
        filled_by: Some(v1::seat_config::FilledBy::BuiltInAgent("random".into())),
        ..v1::SeatConfig::default()
    };
    v1::CreateStudyRequest {
        settings: Some(v1::StudySettings {
            name: "study".into(),
            title: "A game of cards".into(),
            participants: 1,
            conditions: vec![v1::StudyCondition {
                id: "only".into(),
                seats: vec![seat; 3],
                ..v1::StudyCondition::default()
            }],
            stages: vec![v1::StudyStage {
                stage: Some(v1::study_stage::Stage::Games(v1::StudyGames { count: 1 })),
                ..v1::StudyStage::default()
            }],
            ..v1::StudySettings::default()
        }),
        request_id: REQUEST_ID.to_vec(),
    }
}

#[tokio::test]
async fn another_token_does_not_get_the_secret_of_a_study() {
    let Calls { studies, .. } = calls();
    let created = async |token| {
        let created = studies.create_study(by(token, create())).await;
        created.expect("a study").into_inner().owner_token
    };
    let owner = created("first").await;
    assert_eq!(created("first").await, owner, "repeated");
    assert_ne!(created("second").await, owner);
}

#[tokio::test]
async fn who_waits_for_something_about_all_participants_of_a_study_holds_up_no_other_calls() {
    let Calls { rooms, studies, .. } = calls();
    let created = studies.create_study(by("first", create())).await;
    let created = created.expect("a study").into_inner();
    // Games of built-in agents have all threads.
    let slice = || rooms.background().slice(Key::Local).now_or_never();
    let _games: Vec<_> = std::iter::from_fn(slice).collect();
    let mut request = by(
        "first",
        v1::GetStudyRequest {
            study_id: created.study.expect("a study").study_id,
            owner_token: created.owner_token,
        },
    );
    let share = FullShare::with(&mut request);
    assert!(studies.get_study(request).now_or_never().is_none());
    assert!(share.has_place());
}

#[tokio::test]
async fn another_token_does_not_get_the_ticket_of_who_is_added_by_hand() {
    let Calls { tournaments, .. } = calls();
    let cup = v1::CreateTournamentRequest {
        settings: Some(v1::TournamentSettings {
            name: "Cup".into(),
            format: v1::TournamentFormat::RoundRobin.into(),
            max_participants: 8,
            ..v1::TournamentSettings::default()
        }),
        ..v1::CreateTournamentRequest::default()
    };
    let cup = tournaments.create_tournament(by("first", cup)).await;
    let cup = cup.expect("a tournament").into_inner();
    let join = v1::JoinTournamentRequest {
        join_code: cup.join_code,
        name: "Ada".into(),
        ..v1::JoinTournamentRequest::default()
    };
    let joined = tournaments.join_tournament(by("first", join)).await;
    let joined = joined.expect("joined").into_inner();
    let replace = v1::ReplaceParticipantRequest {
        tournament_id: cup.tournament.expect("a tournament").tournament_id,
        owner_token: cup.owner_token,
        participant: joined.participant,
        name: "Bo".into(),
        request_id: REQUEST_ID.to_vec(),
        ..v1::ReplaceParticipantRequest::default()
    };
    // Both tokens are used with the owner token of the tournament.
    let replaced = async |token| {
        let replaced = tournaments
            .replace_participant(by(token, replace.clone()))
            .await;
        replaced.map(|it| it.into_inner().ticket)
    };
    let ticket = replaced("first").await.expect("replaced");
    assert!(!ticket.is_empty());
    assert_eq!(replaced("first").await.expect("repeated"), ticket);
    assert_ne!(replaced("second").await.ok(), Some(ticket));
}
