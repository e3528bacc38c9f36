//! The language of a study: which ones there are, and which have the texts of templates.

use chefshat_proto::v1::{self, study_stage};
use chefshat_study::SettingsProblem;

use super::complete_settings;

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
