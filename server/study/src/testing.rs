//! Studies for tests: settings, conditions, answers.
#![allow(missing_docs, reason = "test support")]

use std::collections::{BTreeMap, BTreeSet};

use crate::{
    Arrival, Condition, Consent, Factor, Groups, Labels, Language, LeftOverPolicy, Order,
    Recruiting, Settings, Stage, Task, Template, Text,
};

/// A study between participants in two conditions: consent, a game, a text.
pub fn settings() -> Settings {
    Settings {
        title: "A game of cards".to_owned(),
        language: Language::English,
        participants: 8,
        factors: vec![Factor {
            name: "robot-factor".to_owned(),
            levels: vec![
                "condition-level-0".to_owned(),
                "condition-level-1".to_owned(),
            ],
        }],
        conditions: (0..2).map(condition).collect(),
        order: Order::Between,
        block_size: None,
        assignment_seed: [7; 32],
        seeds: (0..3).map(|seed| [seed; 32]).collect(),
        stages: vec![
            Stage::once(consent()),
            Stage::once(Task::Games { count: 1 }),
            Stage::once(text()),
        ],
        traces: false,
        drop_out_after_ms: 60_000,
        closes_at_ms: None,
        deletes_at_ms: None,
        recruiting: Recruiting::default(),
        groups: None,
        device: None,
        pictures: Vec::new(),
    }
}

/// A study between participants in two conditions who play in groups of this size: consent, arrival,
/// two games, a text.
pub fn in_groups(size: u32) -> Settings {
    Settings {
        participants: 6 * size,
        stages: vec![
            Stage::once(consent()),
            Stage::once(Task::Arrival(Arrival {
                text: "Please wait.".to_owned(),
            })),
            Stage::once(Task::Games { count: 2 }),
            Stage::once(text()),
        ],
        groups: Some(Groups {
            size,
            wait_ms: 60_000,
            left_over: LeftOverPolicy::Dismiss,
        }),
        ..settings()
    }
}

/// A study within participants in this number of conditions: consent, practice, then for each
/// condition two games and a shuffled questionnaire, then a text.
pub fn within(conditions: usize) -> Settings {
    let mut questionnaire = Template::Godspeed
        .questionnaire(Language::Italian)
        .expect("it has Italian texts");
    questionnaire.shuffled = true;
    Settings {
        factors: Vec::new(),
        conditions: (0..conditions)
            .map(|index| Condition {
                levels: BTreeMap::new(),
                ..condition(index)
            })
            .collect(),
        order: Order::Within,
        participants: 24,
        stages: vec![
            Stage::once(consent()),
            Stage::once(Task::Practice { in_data: false }),
            Stage::per_condition(vec![
                Task::Games { count: 2 },
                Task::Questionnaire(questionnaire),
            ]),
            Stage::once(text()),
        ],
        ..settings()
    }
}

/// A condition, which has no level beyond the second.
pub fn condition(index: usize) -> Condition {
    let level = format!("condition-level-{index}");
    Condition {
        id: format!("condition-{index}"),
        levels: BTreeMap::from([("robot-factor".to_owned(), level)]),
        players: 4,
        participant_seat: None,
        hide: BTreeSet::new(),
        labels: Labels::AsTheyAre,
        seeds: Vec::new(),
    }
}

pub fn consent() -> Task {
    Task::Consent(Consent {
        text: "I take part.".to_owned(),
        version: "1".to_owned(),
    })
}

pub fn text() -> Task {
    Task::Text(Text {
        title: "Thank you".to_owned(),
        text: "That is all.".to_owned(),
    })
}
