//! The settings of a study: the languages there are, with those that have the texts of templates, what
//! groups need of conditions, and the device that is needed.

use chefshat_proto::v1::{self, study_stage};
use chefshat_study::{Pointer, SettingsProblem};

use super::{complete_settings, study_plan};

/// The questionnaire of a study in this language, made from a template and these items.
fn completed(
    language: &str,
    items: Vec<v1::StudyItem>,
) -> Result<v1::StudyQuestionnaire, SettingsProblem> {
    let questionnaire = v1::StudyQuestionnaire {
        template: "godspeed".to_owned(),
        items,
        ..Default::default()
    };
    let stage = study_stage::Stage::Questionnaire(questionnaire);
    let settings = v1::StudySettings {
        name: "pilot".to_owned(),
        language: language.to_owned(),
        block_size: 1,
        stages: vec![v1::StudyStage {
            stage: Some(stage),
            ..v1::StudyStage::default()
        }],
        ..Default::default()
    };
    let complete = complete_settings(settings, || [1; 32], true)?;
    match &complete.stages[0].stage {
        Some(study_stage::Stage::Questionnaire(it)) => Ok(it.clone()),
        other => panic!("{other:?} is not a questionnaire"),
    }
}

#[test]
fn a_template_without_texts_in_the_language_needs_items() {
    assert_eq!(completed("it", Vec::new()).unwrap().items.len(), 24);
    let refused = completed("de", Vec::new()).unwrap_err();
    assert_eq!(refused.field, "stages");
    assert!(refused.problem.contains("list its items"), "{refused:?}");
    let own = vec![v1::StudyItem::default()];
    let given = completed("de", own.clone()).unwrap();
    assert_eq!((given.id.as_str(), given.items), ("godspeed", own));
}

#[test]
fn an_unknown_language_is_refused_with_those_there_are() {
    let refused = completed("fr", Vec::new()).unwrap_err();
    assert_eq!(refused.field, "language");
    assert!(
        refused.problem.ends_with("en, de, es, it"),
        "{}",
        refused.problem
    );
}

/// Pairs who play with two agents, under this policy.
fn in_pairs(policy: v1::RoomPolicy) -> v1::StudySettings {
    let condition = v1::StudyCondition {
        id: "only".to_owned(),
        policy: Some(policy),
        seats: vec![v1::SeatConfig::default(); 2],
        seeds: vec![vec![1; 32]],
        ..v1::StudyCondition::default()
    };
    v1::StudySettings {
        name: "pairs".to_owned(),
        block_size: 1,
        conditions: vec![condition],
        groups: Some(v1::StudyGroups {
            size: 2,
            ..v1::StudyGroups::default()
        }),
        ..v1::StudySettings::default()
    }
}

#[test]
fn the_games_of_groups_are_played_to_their_ends() {
    let complete = complete_settings(in_pairs(v1::RoomPolicy::default()), || [1; 32], true);
    let complete = complete.unwrap();
    let groups = complete.groups.as_ref().unwrap();
    assert_eq!(groups.wait_ms, 600_000);
    assert_eq!(groups.left_over(), v1::StudyLeftOver::Dismiss);
    assert_eq!(study_plan(&complete).unwrap().conditions[0].fills.len(), 2);
    for abort in [v1::AbortPolicy::AnyLost, v1::AbortPolicy::AllLost] {
        let policy = v1::RoomPolicy {
            abort: abort.into(),
            ..v1::RoomPolicy::default()
        };
        let refused = complete_settings(in_pairs(policy), || [1; 32], true).unwrap_err();
        assert_eq!(refused.field, "conditions[0].policy.abort");
    }
    let mut three = complete;
    three.groups.as_mut().unwrap().size = 3;
    let refused = study_plan(&three).unwrap_err();
    assert_eq!(refused.field, "conditions[0].seats");
}

#[test]
fn a_device_that_is_needed_has_a_pointer_and_a_width() {
    let complete = complete_settings(in_pairs(v1::RoomPolicy::default()), || [1; 32], true);
    let complete = complete.unwrap();
    assert_eq!(study_plan(&complete).unwrap().core.device, None);
    let needed = |pointer: i32, min_width| {
        let message = v1::StudySettings {
            device: Some(v1::StudyRequiredDevice { pointer, min_width }),
            ..complete.clone()
        };
        study_plan(&message).map(|plan| plan.core.device.expect("it is set"))
    };
    let device = needed(v1::StudyPointer::Fine.into(), 1024).unwrap();
    assert_eq!(device.pointer, Some(Pointer::Fine));
    assert_eq!(device.min_width, 1024);
    assert_eq!(needed(0, 1).unwrap().pointer, None);
    assert_eq!(needed(77, 0).unwrap_err().field, "device.pointer");
    // A width that does not fit is none that fits: the core refuses it.
    assert_eq!(needed(0, 65_536 + 1024).unwrap().min_width, u16::MAX);
}
