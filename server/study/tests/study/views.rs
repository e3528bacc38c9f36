//! What participants see.

use chefshat_study::testing::settings;
use chefshat_study::{
    Content, ExternalQuestionnaire, Hide, Language, NewParticipants, Stage, Task, Template, View,
};

use super::support::Lab;

/// All views of a participant to the end, without its pseudonym.
fn views(lab: &mut Lab, number: u32) -> Vec<View> {
    lab.open(number).unwrap();
    let mut views = Vec::new();
    loop {
        let mut view = lab.study.view(number).unwrap();
        view.pseudonym.clear();
        if let Content::Game(game) = &mut view.content {
            // The ids of rooms and games are random.
            game.place = game.place.map(|_| ([0; 16], [0; 16]));
        }
        let is_end = matches!(view.content, Content::End { .. });
        views.push(view);
        if is_end {
            return views;
        }
        lab.act(number);
    }
}

#[test]
fn participants_of_different_conditions_get_the_same() {
    let mut settings = settings();
    settings.stages.insert(
        2,
        Stage::per_condition(vec![
            Task::Practice { in_data: false },
            Task::Questionnaire(Template::NasaTlx.questionnaire(Language::English).unwrap()),
        ]),
    );
    let mut lab = Lab::new(settings, 8);
    let first = views(&mut lab, 1);
    assert_eq!(first.len(), 10);
    assert!(first.iter().all(|view| view.steps == 5));
    for number in 2..=8 {
        assert_eq!(views(&mut lab, number), first);
    }
    let conditions = [0, 1].map(|slot| lab.study.sequence(slot)[0]);
    assert_ne!(conditions[0], conditions[1]);
}

#[test]
fn a_game_hides_what_its_condition_hides() {
    let mut settings = settings();
    for condition in &mut settings.conditions {
        condition.hide.insert(Hide::Log);
    }
    let mut lab = Lab::new(settings, 1);
    let views = views(&mut lab, 1);
    let games: Vec<_> = views
        .iter()
        .filter_map(|view| match &view.content {
            Content::Game(game) => Some((game.place.is_some(), game.ended, game.hide.len())),
            _ => None,
        })
        .collect();
    assert_eq!(
        games,
        [(false, false, 0), (true, false, 1), (true, true, 1)]
    );
}

#[test]
fn a_pseudonym_cannot_add_to_the_address_of_an_external_questionnaire() {
    let mut settings = settings();
    settings.stages[0] = Stage::once(Task::External(ExternalQuestionnaire {
        text: "Please answer these questions.".to_owned(),
        url: "https://example.org/?p={participant}&x=1".to_owned(),
    }));
    let mut lab = Lab::new(settings, 0);
    for change in lab
        .study
        .add(&NewParticipants {
            pseudonyms: vec!["a&x=2 è{participant}".to_owned()],
            ..NewParticipants::default()
        })
        .unwrap()
    {
        lab.fold(change);
    }
    lab.open(1).unwrap();
    let Content::External(external) = lab.content(1) else {
        panic!("it is the first step");
    };
    let expected = "https://example.org/?p=a%26x%3D2%20%C3%A8%7Bparticipant%7D&x=1";
    assert_eq!(external.url, expected);
}
