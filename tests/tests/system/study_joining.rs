//! People take part in a study by its open link, as a panel sends them.

use chefshat_proto::v1::participation_service_client::ParticipationServiceClient;
use chefshat_proto::v1::study_service_client::StudyServiceClient;
use chefshat_proto::v1::{self, study_view::Content};
use chefshat_tests::patiently;
use tonic::transport::Channel;
use tonic::{Code, Status};
use tonic_types::StatusExt as _;

use crate::studies::{Lab, host, settings};

const FULL: &str = "https://panel.example/full";

/// A study for one participant, recruited from a panel.
fn recruited() -> v1::StudySettings {
    v1::StudySettings {
        participants: 1,
        recruiting: Some(v1::StudyRecruiting {
            open_link: true,
            id_parameter: "PROLIFIC_PID".to_owned(),
            completed_url: "https://panel.example/done?id={id}".to_owned(),
            left_url: "https://panel.example/left".to_owned(),
            full_url: FULL.to_owned(),
            ..v1::StudyRecruiting::default()
        }),
        ..settings()
    }
}

/// The service of participants of a server.
async fn participants(url: &str) -> ParticipationServiceClient<Channel> {
    let channel = Channel::from_shared(url.to_owned()).expect("a URL");
    ParticipationServiceClient::new(channel.connect().await.expect("the server listens"))
}

/// Joins with an id at the panel, and 32 times this byte as the request id.
async fn join(
    service: &mut ParticipationServiceClient<Channel>,
    open_link: &str,
    panel_id: &str,
    request: u8,
) -> Result<String, Status> {
    join_on(service, open_link, panel_id, request, None).await
}

/// Joins as [`join`], on this device.
async fn join_on(
    service: &mut ParticipationServiceClient<Channel>,
    open_link: &str,
    panel_id: &str,
    request: u8,
    device: Option<v1::StudyDevice>,
) -> Result<String, Status> {
    let request = v1::JoinStudyRequest {
        open_link: open_link.to_owned(),
        panel_id: panel_id.to_owned(),
        request_id: vec![request; 32],
        device,
    };
    let joined = patiently("joining", service.join_study(request)).await?;
    Ok(joined.into_inner().link)
}

async fn open(
    service: &mut ParticipationServiceClient<Channel>,
    link: &str,
) -> Result<v1::OpenStudyResponse, Status> {
    let request = v1::OpenStudyRequest {
        link: link.into(),
        ..Default::default()
    };
    Ok(service.open_study(request).await?.into_inner())
}

/// The reason of a refusal, and one of its metadata.
fn refusal<T: std::fmt::Debug>(result: Result<T, Status>, key: &str) -> (String, Option<String>) {
    let info = result.expect_err("refused").get_details_error_info();
    let info = info.expect("error info");
    (info.reason, info.metadata.get(key).cloned())
}

#[tokio::test(flavor = "multi_thread")]
async fn people_of_a_panel_join_once_each_until_the_study_is_full() {
    let folder = tempfile::tempdir().expect("a folder");
    let first = host(folder.path()).await;
    let channel = Channel::from_shared(first.url()).expect("a URL");
    let channel = channel.connect().await.expect("the server listens");
    let request = v1::CreateStudyRequest {
        settings: Some(recruited()),
        request_id: Vec::new(),
    };
    let created = StudyServiceClient::new(channel).create_study(request).await;
    let created = created.expect("valid").into_inner();
    let study = created.study.expect("a study");
    let owner = (study.study_id, created.owner_token);
    let open_link = study.open_link;

    let mut service = participants(&first.url()).await;
    let asked = refusal(open(&mut service, &open_link).await, "id_parameter");
    let expected = ("LINK_OPEN".to_owned(), Some("PROLIFIC_PID".to_owned()));
    assert_eq!(asked, expected);
    let without = join(&mut service, &open_link, "", 1).await;
    assert_eq!(refusal(without, "field").0, "PANEL_ID_REFUSED");
    let own = join(&mut service, &open_link, "ada", 1).await;
    let own = own.expect("she has joined");
    let other = join(&mut service, &open_link, "bo", 2).await;
    let other = other.expect("he has joined");
    assert_ne!(own, other);
    let taken = join(&mut service, &open_link, "ada", 3).await;
    assert_eq!(refusal(taken, "field").0, "PANEL_ID_TAKEN");
    // A link of somebody's own, another text, and the open link where one's own is needed.
    for wrong in [own.as_str(), "no link", &open_link[..29]] {
        let refused = join(&mut service, wrong, "cy", 4).await;
        assert_eq!(refused.expect_err("wrong").code(), Code::Unauthenticated);
    }
    let request = v1::WithdrawFromStudyRequest {
        link: open_link.clone(),
        delete_data: true,
    };
    let refused = service.withdraw_from_study(request).await;
    assert_eq!(refusal(refused, "field").0, "LINK_UNKNOWN");

    // A restarted server knows who has joined, by which request.
    let stopping = patiently("the server to stop", first.stop());
    stopping.await.expect("a clean end");
    let second = host(folder.path()).await;
    let mut service = participants(&second.url()).await;
    let again = join(&mut service, &open_link, "ada", 1).await;
    assert_eq!(again.expect("the same request"), own);
    let taken = join(&mut service, &open_link, "ada", 3).await;
    assert_eq!(refusal(taken, "field").0, "PANEL_ID_TAKEN");

    // Ada agrees and has the only place. Bo has read the text meanwhile.
    let ada = open(&mut service, &own).await.expect("her link").session;
    let bo = open(&mut service, &other).await.expect("his link").session;
    let consent = |session| v1::GiveConsentRequest { session, step: 0 };
    service.give_consent(consent(ada)).await.expect("a place");
    let full = ("STUDY_FULL".to_owned(), Some(FULL.to_owned()));
    let refused = service.give_consent(consent(bo)).await;
    assert_eq!(refusal(refused, "url"), full);
    let late = join(&mut service, &open_link, "cy", 4).await;
    assert_eq!(refusal(late, "url"), full);

    let request = v1::WithdrawFromStudyRequest {
        link: own,
        delete_data: false,
    };
    let left = service.withdraw_from_study(request).await;
    let view = left.expect("her link").into_inner().view;
    let Some(Content::End(end)) = view.expect("a view").content else {
        panic!("it is the end");
    };
    assert_eq!(end.url, "https://panel.example/left");

    let mut lab = Lab::connect(&second, owner).await;
    let ids = lab.participants().await.into_iter().map(|it| it.panel_id);
    assert_eq!(ids.collect::<Vec<_>>(), ["ada", "bo"]);
    let data = lab.export().await;
    let text = |file: &str| String::from_utf8_lossy(&data[file]).into_owned();
    assert!(text("participants.csv").contains("ada"));
    // Data are published: nothing in them lets anybody take part, or be paid.
    for file in data.keys() {
        let secret = [open_link.as_str(), "panel.example"];
        let found = secret.iter().find(|secret| text(file).contains(**secret));
        assert_eq!(found, None, "{file}");
    }
    let request = v1::CloseStudyRequest {
        study_id: lab.study_id.clone(),
        owner_token: lab.owner_token.clone(),
    };
    lab.service.close_study(request).await.expect("closed");
    let closed = ("STUDY_CLOSED".to_owned(), Some(FULL.to_owned()));
    let late = join(&mut service, &open_link, "cy", 4).await;
    assert_eq!(refusal(late, "url"), closed);
    let stopping = patiently("the server to stop", second.stop());
    stopping.await.expect("a clean end");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_study_that_needs_a_computer_begins_on_no_other_device() {
    let folder = tempfile::tempdir().expect("a folder");
    let server = host(folder.path()).await;
    let channel = Channel::from_shared(server.url()).expect("a URL");
    let channel = channel.connect().await.expect("the server listens");
    let request = v1::CreateStudyRequest {
        settings: Some(v1::StudySettings {
            device: Some(v1::StudyRequiredDevice {
                pointer: v1::StudyPointer::Fine.into(),
                min_width: 1024,
            }),
            ..recruited()
        }),
        request_id: Vec::new(),
    };
    let created = StudyServiceClient::new(channel).create_study(request).await;
    let created = created.expect("valid").into_inner();
    let study = created.study.expect("a study");
    let open_link = study.open_link;
    let mut lab = Lab::connect(&server, (study.study_id, created.owner_token)).await;

    let device = |pointer: v1::StudyPointer, width| v1::StudyDevice {
        width,
        height: 800,
        pixels: 100,
        pointer: pointer.into(),
        time_zone: "Europe/Rome".to_owned(),
    };
    let phone = device(v1::StudyPointer::Coarse, 390);
    let narrow = device(v1::StudyPointer::Fine, 1023);
    let invalid = v1::StudyDevice {
        time_zone: String::new(),
        ..device(v1::StudyPointer::Fine, 1024)
    };
    let others = [None, Some(phone.clone()), Some(narrow), Some(invalid)];
    let mut service = participants(&server.url()).await;
    for other in others.clone() {
        let refused = join_on(&mut service, &open_link, "ada", 1, other).await;
        let info = refused.expect_err("refused").get_details_error_info();
        let info = info.expect("error info");
        assert_eq!(info.reason, "WRONG_DEVICE");
        let language = "en".to_owned();
        let said = ["pointer", "min_width", "language"].map(|key| info.metadata[key].clone());
        assert_eq!(said, ["fine".to_owned(), "1024".to_owned(), language]);
    }
    assert_eq!(lab.participants().await, []);
    let computer = Some(device(v1::StudyPointer::Fine, 1024));
    let own = join_on(&mut service, &open_link, "ada", 1, computer.clone()).await;
    let own = own.expect("a computer");
    for other in others {
        let request = v1::OpenStudyRequest {
            link: own.clone(),
            device: other,
        };
        let refused = service.open_study(request).await;
        assert_eq!(refusal(refused, "pointer").0, "WRONG_DEVICE");
    }
    let invited = lab.participants().await;
    let counts = invited.iter().map(|it| (it.state(), it.sessions, it.slot));
    let expected = (v1::StudyParticipantState::Invited, 0, None);
    assert_eq!(counts.collect::<Vec<_>>(), [expected]);

    let request = v1::OpenStudyRequest {
        link: own.clone(),
        device: computer,
    };
    let opened = service.open_study(request).await.expect("a computer");
    let session = opened.into_inner().session;
    // The phone takes nothing over.
    let request = v1::OpenStudyRequest {
        link: own.clone(),
        device: Some(phone),
    };
    let refused = service.open_study(request).await;
    assert_eq!(refusal(refused, "min_width").0, "WRONG_DEVICE");
    let consent = v1::GiveConsentRequest { session, step: 0 };
    service.give_consent(consent).await.expect("a place");
    // It can withdraw.
    let request = v1::WithdrawFromStudyRequest {
        link: own,
        delete_data: true,
    };
    service.withdraw_from_study(request).await.expect("at once");
    let stopping = patiently("the server to stop", server.stop());
    stopping.await.expect("a clean end");
}
