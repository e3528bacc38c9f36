//! The open link: who joins by it, and where participants go on at the end.

use chefshat_study::testing::settings;
use chefshat_study::{
    Change, Content, Device, End, Joined, Recruiting, Refusal, RequiredDevice, Settings, Study,
};

use super::support::{Lab, device};

const ID: &str = "PROLIFIC_PID";

/// A study for two, recruited from a panel.
fn recruited() -> Settings {
    Settings {
        participants: 2,
        recruiting: Recruiting {
            open_link: true,
            id_parameter: ID.to_owned(),
            completed_url: "https://panel.example/done?id={id}&cc=ABC".to_owned(),
            left_url: "https://panel.example/left".to_owned(),
            full_url: "https://panel.example/full?id={id}".to_owned(),
            screened_out_url: String::new(),
            left_over_url: String::new(),
        },
        ..settings()
    }
}

/// When participants join.
const NOW_MS: u64 = 1000;

fn joining(request: u8, panel_id: &str) -> Joined {
    Joined {
        request_sha256: vec![request; 32],
        panel_id: panel_id.to_owned(),
    }
}

fn join(study: &mut Study, request: u8, panel_id: &str) -> Result<u32, Refusal> {
    let (number, change) = study.join(joining(request, panel_id), Some(&device()), NOW_MS)?;
    if let Some(change) = change {
        study.fold(&change);
    }
    Ok(number)
}

fn folded(changes: &[Change]) -> Study {
    let mut study = Study::new(recruited()).unwrap();
    changes.iter().for_each(|change| study.fold(change));
    study
}

#[test]
fn each_id_joins_once_and_a_repeated_request_adds_nobody() {
    let mut lab = Lab::new(recruited(), 0);
    let study = &mut lab.study;
    assert_eq!(join(study, 1, "a/5"), Ok(1));
    assert_eq!(join(study, 1, "a/5"), Ok(1));
    assert_eq!(join(study, 2, "a/5"), Err(Refusal::PanelIdTaken));
    assert_eq!(join(study, 2, "other"), Ok(2));
    let pseudonyms = study.participants().values().map(|it| &it.pseudonym);
    assert_eq!(pseudonyms.collect::<Vec<_>>(), ["P01", "P02"]);
    for refused in ["", "a b", "a\nb", "é", &"x".repeat(129)] {
        let refusal = join(study, 3, refused).unwrap_err();
        assert!(matches!(refusal, Refusal::PanelId(_)), "{refused:?}");
        assert!(refusal.to_string().contains(ID), "{refusal}");
    }
}

#[test]
fn nobody_joins_a_study_that_is_full_closed_or_has_no_open_link() {
    let mut lab = Lab::new(recruited(), 0);
    for number in 1..=2 {
        let id = format!("id{number}");
        assert_eq!(join(&mut lab.study, number, &id), Ok(number.into()));
        lab.complete(number.into());
    }
    assert_eq!(join(&mut lab.study, 3, "late"), Err(Refusal::Full));
    let close = lab.study.close().expect("it is open");
    lab.study.fold(&close);
    assert_eq!(join(&mut lab.study, 3, "late"), Err(Refusal::Closed));
    // Who has joined finds the link again.
    assert_eq!(join(&mut lab.study, 1, "id1"), Ok(1));

    let mut personal = Study::new(settings()).unwrap();
    assert_eq!(join(&mut personal, 1, ""), Err(Refusal::Unknown));
}

#[test]
fn on_another_device_nobody_joins() {
    let required = RequiredDevice {
        pointer: device().pointer(),
        min_width: 390,
    };
    let mut study = Study::new(Settings {
        device: Some(required),
        closes_at_ms: Some(NOW_MS + 1),
        ..recruited()
    })
    .unwrap();
    let narrow = Device {
        width: device().width - 1,
        ..device()
    };
    for device in [None, Some(&narrow)] {
        let refused = study.join(joining(1, "a"), device, NOW_MS).unwrap_err();
        assert_eq!(refused, Refusal::WrongDevice(required));
    }
    assert_eq!(join(&mut study, 1, "a"), Ok(1));
    // Who has joined finds the link again, also there.
    assert_eq!(study.join(joining(1, "a"), None, NOW_MS), Ok((1, None)));
    // Without a place, another device would not help.
    let join = |study: &Study, now_ms| study.join(joining(2, "b"), None, now_ms).unwrap_err();
    let wrong = Refusal::WrongDevice(required);
    assert_eq!(
        (join(&study, NOW_MS), join(&study, NOW_MS + 1)),
        (wrong, Refusal::Closed)
    );
    let close = study.close().expect("it is open");
    study.fold(&close);
    assert_eq!(join(&study, NOW_MS), Refusal::Closed);
}

#[test]
fn without_a_panel_an_id_is_not_kept() {
    let mut study = Study::new(Settings {
        recruiting: Recruiting {
            open_link: true,
            ..Recruiting::default()
        },
        ..settings()
    })
    .unwrap();
    assert_eq!(join(&mut study, 1, ""), Ok(1));
    assert_eq!(join(&mut study, 2, ""), Ok(2));
    let refusal = join(&mut study, 3, "somebody").unwrap_err();
    assert!(matches!(refusal, Refusal::PanelId(_)), "{refusal:?}");
}

#[test]
fn participants_go_on_where_the_panel_says() {
    let end = |lab: &Lab, number| match lab.content(number) {
        Content::End { reason, url, .. } => (reason, url),
        content => panic!("it is not over: {content:?}"),
    };
    let mut lab = Lab::new(recruited(), 1);
    join(&mut lab.study, 1, "a/5&x=1").unwrap();
    lab.complete(2);
    let filled = "https://panel.example/done?id=a%2F5%26x%3D1&cc=ABC";
    assert_eq!(end(&lab, 2), (End::Completed, Some(filled.to_owned())));
    // Who got its link from a researcher has no id that could be filled in.
    lab.complete(1);
    assert_eq!(end(&lab, 1), (End::Completed, None));

    let full = |id| lab.study.settings().recruiting.full_url(id);
    let filled = "https://panel.example/full?id=late";
    assert_eq!(full("late").as_deref(), Some(filled));
    assert_eq!(full(""), None);
}

#[test]
fn the_id_at_the_panel_is_deleted_with_the_data() {
    let (_, added) = folded(&[])
        .join(joining(1, "secret"), None, NOW_MS)
        .unwrap();
    let mut changes = vec![added.unwrap()];
    changes.extend(folded(&changes).open(1, Some(device()), 1000).unwrap());
    changes.extend(folded(&changes).withdraw(1, true, 2000).unwrap());
    let before = folded(&changes);
    assert_eq!(before.participant(1).unwrap().panel_id(), "");
    let Content::End { reason, url, .. } = before.view(1).unwrap().content else {
        panic!("it is over");
    };
    assert_eq!(reason, End::DataDeleted);
    assert_eq!(url.as_deref(), Some("https://panel.example/left"));

    for change in &mut changes[..2] {
        assert!(change.forget(1));
        assert!(!change.forget(1), "once");
    }
    let left = format!("{changes:?}");
    assert!(!left.contains("secret") && !left.contains("Europe"));
    assert_eq!(folded(&changes).participants(), before.participants());
}

#[test]
fn a_device_is_within_its_ranges() {
    assert!(device().is_valid());
    let zones = ["", "Europe Rome", "x\n", "é"];
    let mut wrong: Vec<Device> = zones.map(in_zone).into();
    wrong.push(in_zone(&"x".repeat(65)));
    wrong.push(Device {
        width: 0,
        ..device()
    });
    wrong.push(Device {
        height: 0,
        ..device()
    });
    wrong.push(Device {
        pixels: 0,
        ..device()
    });
    wrong.push(Device {
        width: 65_536,
        ..device()
    });
    for device in wrong {
        assert!(!device.is_valid(), "{device:?}");
    }
}

fn in_zone(zone: &str) -> Device {
    Device {
        time_zone: zone.to_owned(),
        ..device()
    }
}
