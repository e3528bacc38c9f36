//! Pairs of people who play a study together, over real sockets: one leaves in the middle of a game,
//! the server is restarted in the middle of another, and nobody learns who else is a person.

use std::collections::{BTreeMap, BTreeSet};

use chefshat_client::{ActionId, Agent};
use chefshat_proto::v1::study_service_client::StudyServiceClient;
use chefshat_proto::v1::{
    self, game_event::Kind, seat_command::Command, seat_update::Update, study_stage::Stage,
    study_view::Content,
};
use chefshat_server::host::Host;
use chefshat_tests::{StreamSeat, first_legal, patiently};
use tokio::sync::oneshot;
use tonic::transport::Channel;
use tonic_types::StatusExt as _;

use crate::studies::{
    Lab, Person, SECRETS, Tap, address, analysed, assert_as_described, checked_header, contains,
    playable, rows, settings, stage,
};
use crate::study_calls::{open_to_all, operated};

/// Steps: consent, arrival, games, text.
const STEPS: u32 = 4;

/// Two pairs, each in one of the conditions of [`settings`].
fn pairs() -> v1::StudySettings {
    let mut settings = settings();
    settings.participants = 4;
    settings.groups = Some(v1::StudyGroups {
        size: 2,
        ..v1::StudyGroups::default()
    });
    for condition in &mut settings.conditions {
        condition.seats.truncate(2);
    }
    let is_kept = |stage: &v1::StudyStage| {
        !matches!(
            stage.stage,
            Some(Stage::Questionnaire(_) | Stage::Practice(_))
        )
    };
    settings.stages.retain(is_kept);
    let arrival = v1::StudyArrival {
        text: "Another player comes soon.".to_owned(),
    };
    settings.stages.insert(1, stage(Stage::Arrival(arrival)));
    settings
}

/// Attaches to its seat, says when the game has begun, and never answers.
struct Idle(Option<oneshot::Sender<()>>);

impl Agent for Idle {
    fn decide(&mut self, request: &v1::DecisionRequest) -> ActionId {
        unreachable!("{request:?}: it does not answer")
    }

    fn try_decide(&mut self, _: &v1::DecisionRequest) -> Option<ActionId> {
        None
    }

    fn on_event(&mut self, _: &v1::GameEvent) {
        if let Some(begun) = self.0.take() {
            // The test may have gone on.
            let _ = begun.send(());
        }
    }
}

/// Two people, and what they see, arrive one after the other, and become a pair.
async fn arrive(
    one: &mut Person,
    first: v1::StudyView,
    other: &mut Person,
    second: v1::StudyView,
) -> [v1::StudyView; 2] {
    let (first, _) = one.go_on(first, 1).await;
    let Some(Content::Arrival(shown)) = &first.content else {
        panic!("it waits");
    };
    assert_eq!((shown.size, shown.here), (2, 1));
    let (second, _) = other.go_on(second, 1).await;
    let (first, second) = tokio::join!(one.go_on(first, 2), other.go_on(second, 2));
    [first.0, second.0]
}

/// The game of a view, once it has a room.
async fn game_of(person: &mut Person) -> v1::StudyShownGame {
    let view = person.until(|content| playable(content).is_some()).await;
    let game = view.content.as_ref().and_then(playable);
    game.expect("a game").clone()
}

/// Creates a study on a server.
async fn created(host: &Host, settings: v1::StudySettings) -> Lab {
    let channel = Channel::from_shared(host.url().to_owned()).expect("a URL");
    let channel = channel.connect().await.expect("the server listens");
    let request = v1::CreateStudyRequest {
        settings: Some(settings),
        request_id: Vec::new(),
    };
    let created = StudyServiceClient::new(channel).create_study(request).await;
    let created = created.expect("valid").into_inner();
    let id = created.study.expect("a study").study_id;
    Lab::connect(host, (id, created.owner_token)).await
}

/// A substitution shows that a seat is a person's: others do not learn of it.
#[tokio::test(flavor = "multi_thread")]
async fn only_the_one_of_a_pair_for_whom_a_substitute_plays_learns_of_it() {
    let folder = tempfile::tempdir().expect("a folder");
    let host = open_to_all(folder.path()).await;
    let tap = Tap::new(address(&host)).await;
    let mut settings = pairs();
    settings.participants = 2;
    settings.conditions.truncate(1);
    settings.factors[0].levels.truncate(1);
    for condition in &mut settings.conditions {
        let policy = condition.policy.as_mut().expect("it has one");
        (policy.decision_time_ms, policy.bank_ms) = (Some(1_000), Some(0));
        policy.max_timeouts = Some(1);
    }
    let mut lab = created(&host, settings).await;
    let links = lab.links(vec!["Ada".to_owned(), "Bo".to_owned()]).await;
    let (mut ada, a) = Person::new(&tap, &links[0]).await;
    let (mut bo, b) = Person::new(&tap, &links[1]).await;
    let [_, _] = arrive(&mut ada, a, &mut bo, b).await;
    let games = tokio::join!(game_of(&mut ada), game_of(&mut bo));
    let seat = async |person: &Person, game: &v1::StudyShownGame| {
        StreamSeat::attached(person.client.channel(), &game.ticket).await
    };
    let mut own = seat(&ada, &games.0).await;
    let mut other = seat(&bo, &games.1).await;
    // One never answers, and takes its seat back once.
    let idle = async {
        let mut received = Vec::new();
        loop {
            match own.next().await {
                Update::Substitution(it) => {
                    received.push(it.active);
                    if received == [true] {
                        own.send(Command::Resume(v1::ResumeSeat {})).await;
                    }
                }
                Update::Detached(_) => break received,
                _ => {}
            }
        }
    };
    // The other one answers. Only if that was too late does a substitute play for it as well.
    let answering = async {
        let (mut received, mut was_late) = (Vec::new(), false);
        loop {
            match other.next().await {
                Update::Decision(request) => {
                    let action = first_legal(&request);
                    other.answer(request.decision_id, action).await;
                }
                Update::Result(it) => was_late |= it.status() == v1::AnswerStatus::Closed,
                Update::Substitution(it) => received.push(it.active),
                Update::Detached(_) => break (received, was_late),
                update => panic!("unexpected {update:?}"),
            }
        }
    };
    let (received, (of_other, was_late)) = tokio::join!(idle, answering);
    assert_eq!(received, [true, false, true]);
    assert!(of_other.is_empty() || was_late, "{of_other:?}");
    for seat in [&own, &other] {
        let presence = |event: &&v1::GameEvent| {
            matches!(event.kind, Some(Kind::Substituted(_) | Kind::Returned(_)))
        };
        assert_eq!(seat.events.iter().find(presence), None);
    }
    let stopping = patiently("the server to stop", host.stop());
    stopping.await.expect("a clean end");
}

#[tokio::test(flavor = "multi_thread")]
async fn pairs_of_people_play_together_and_a_partner_who_leaves_is_replaced() {
    let folder = tempfile::tempdir().expect("a folder");
    let (first_host, mut operator) = operated(folder.path()).await;
    let tap = Tap::new(address(&first_host)).await;
    let mut lab = created(&first_host, pairs()).await;
    let owner = (lab.study_id.clone(), lab.owner_token.clone());
    let name = |number| format!("Pseudonym-{number}-of-all");
    let links = lab.links((1..=4).map(name).collect()).await;
    let mut people = Vec::new();
    for link in &links {
        people.push(Person::new(&tap, link).await);
    }
    let [(mut ada, a), (mut bo, b), (mut cy, c), (mut di, d)] =
        <[_; 4]>::try_from(people).ok().expect("four");

    // The first pair is in its game when the server is restarted, the second at its arrival.
    let [_, _] = arrive(&mut ada, a, &mut bo, b).await;
    let games = tokio::join!(game_of(&mut ada), game_of(&mut bo));
    assert_eq!(games.0.game_id, games.1.game_id);
    assert_ne!(games.0.ticket, games.1.ticket);
    // What others play as well is not deleted under them.
    let request = v1::DeleteParticipantRequest {
        name: name(2),
        ..v1::DeleteParticipantRequest::default()
    };
    let refused = operator.delete_participant(request).await;
    let refused = refused.expect_err("it plays").get_details_error_info();
    assert_eq!(refused.expect("error info").reason, "PARTICIPANT_PLAYING");
    let (cy_waits, _) = cy.go_on(c, 1).await;
    let (di_waits, _) = di.go_on(d, 1).await;
    assert_eq!((cy_waits.step, di_waits.step), (1, 1));
    let stopping = patiently("the server to stop", first_host.stop());
    stopping.await.expect("a clean end");
    let second_host = open_to_all(folder.path()).await;
    *tap.target.lock().expect("not poisoned") = address(&second_host);
    let mut lab = Lab::connect(&second_host, owner.clone()).await;

    let (a, b, c, d) = (
        ada.back().await,
        bo.back().await,
        cy.back().await,
        di.back().await,
    );
    assert_eq!(a.content.as_ref().and_then(playable), Some(&games.0));
    let first_pair = async {
        let (a, b) = tokio::join!(ada.go_on(a, STEPS), bo.go_on(b, STEPS));
        [a.0, b.0]
    };
    let second_pair = async {
        let [c, _] = arrive(&mut cy, c, &mut di, d).await;
        let ticket = game_of(&mut di).await.ticket;
        let (begun, has_begun) = oneshot::channel();
        let client = di.client.clone();
        let idle = tokio::spawn(async move { client.play(ticket, Idle(Some(begun))).await });
        let leaving = async {
            patiently("the game to begin", has_begun)
                .await
                .expect("it begins");
            let request = v1::WithdrawFromStudyRequest {
                link: di.link.clone(),
                delete_data: true,
            };
            // Others still play in its game, which is deleted when that is over.
            let withdrawn = di.service.withdraw_from_study(request).await;
            withdrawn.expect("always possible");
        };
        let (c, ()) = tokio::join!(cy.go_on(c, STEPS), leaving);
        idle.abort();
        c.0
    };
    let (first_pair, c) = tokio::join!(first_pair, second_pair);
    for view in first_pair.into_iter().chain([c]) {
        let Some(Content::End(end)) = view.content else {
            panic!("it is the end");
        };
        assert_eq!(end.reason(), v1::StudyEndReason::Completed);
    }

    let participants = lab.participants().await;
    let groups: Vec<u32> = participants.iter().map(|it| it.group).collect();
    assert_eq!(groups, [1, 1, 2, 2]);
    let conditions: Vec<&str> = participants
        .iter()
        .map(|it| it.conditions[0].as_str())
        .collect();
    assert_eq!(conditions[0], conditions[1]);
    assert_eq!(conditions[2], conditions[3]);
    assert_ne!(conditions[0], conditions[2]);
    let played: Vec<usize> = participants.iter().map(|it| it.games.len()).collect();
    assert_eq!(played, [2, 2, 2, 1]);

    // The data have each game once, and say who played in it. That of those who have left with their
    // data is deleted.
    let files = lab.export().await;
    assert_as_described(&files);
    assert_eq!(rows(&files["games.csv"]).len(), 6);
    let formed = rows(&files["groups.csv"]);
    assert!(formed[0].ends_with(",2,1 2,2"), "{formed:?}");
    assert!(formed[1].ends_with(",2,3 4,1"), "{formed:?}");
    let mut recorded = BTreeMap::new();
    for (_, bytes) in files
        .iter()
        .filter(|(file, _)| file.starts_with("records/"))
    {
        let header = checked_header(bytes);
        let study = header.study.clone().expect("it says where it belongs");
        let others = study.others.iter().map(|other| (other.number, other.seat));
        let members: Vec<(u32, u32)> = [(study.number, study.seat)]
            .into_iter()
            .chain(others)
            .collect();
        for (number, seat) in &members {
            let own = participants[*number as usize - 1].games.iter();
            let own = own.filter(|game| game.game_id == header.game_id);
            assert_eq!(own.map(|game| game.seat).collect::<Vec<_>>(), [*seat]);
            let seated = &header.seats[*seat as usize];
            assert_eq!(seated.name, name(*number));
        }
        let numbers: Vec<u32> = members.into_iter().map(|(number, _)| number).collect();
        *recorded.entry((study.group, numbers)).or_insert(0) += 1;
    }
    let expected = [((1, vec![1, 2]), 2), ((2, vec![3]), 1)];
    assert_eq!(recorded, expected.into());

    let printed = analysed(&files, &[]).await;
    // In each condition, what its group scored counts once.
    let points = printed.lines().filter(|line| line.contains(" points "));
    let counts: Vec<&str> = points
        .filter_map(|line| line.split_whitespace().nth(2))
        .collect();
    assert_eq!(counts, ["1", "1"], "{printed}");
    assert!(
        printed.contains("groups: 2, of which 1 are whole"),
        "{printed}"
    );
    let of_whole = analysed(&files, &["--whole-groups"]).await;
    let points = of_whole.lines().filter(|line| line.contains(" points "));
    assert_eq!(points.count(), 1, "{of_whole}");

    // A game is deleted with the data of one of its players.
    let request = v1::DeleteStudyParticipantRequest {
        study_id: owner.0.clone(),
        owner_token: owner.1.clone(),
        number: 1,
    };
    let deleted = lab.service.delete_study_participant(request).await;
    assert_eq!(deleted.expect("it exists").into_inner().games, 2);
    let files = lab.export().await;
    assert_as_described(&files);
    for (file, bytes) in &files {
        let found = [1, 4]
            .into_iter()
            .find(|number| contains(bytes, &name(*number)));
        assert_eq!(found, None, "{file}");
    }
    let records = files.keys().filter(|file| file.starts_with("records/"));
    assert_eq!(records.count(), 1);
    assert_eq!(rows(&files["games.csv"]).len(), 4);
    let stopping = patiently("the server to stop", second_host.stop());
    stopping.await.expect("a clean end");

    // Nobody has received the name of another, or what names a condition.
    for bytes in tap.received.lock().expect("not poisoned").iter() {
        let names: BTreeSet<u32> = (1..=4)
            .filter(|number| contains(bytes, &name(*number)))
            .collect();
        assert!(names.len() <= 1, "{names:?} on one connection");
        for secret in SECRETS {
            assert!(!contains(bytes, secret), "participants received {secret:?}");
        }
    }
}
