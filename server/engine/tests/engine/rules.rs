//! Rule sets: presets, defaults, and every refusal with its field and reason.

use chefshat_engine::{Opening, PassScope, RuleSetSpec, Stop};

#[test]
fn presets() {
    let paper = RuleSetSpec::preset("paper").unwrap();
    assert_eq!(paper, RuleSetSpec::default());
    let rules = paper.validate().unwrap();
    assert_eq!((rules.players(), rules.faces(), rules.jokers()), (4, 11, 2));
    assert_eq!((rules.hand_size(), rules.deck_size()), (17, 68));
    assert_eq!(
        (rules.stop(), rules.points_slice()),
        (Stop::Points(15), &[5, 3, 1, 0][..])
    );
    assert_eq!(
        (
            rules.exchange(),
            rules.special_actions(),
            rules.opening_pass()
        ),
        (true, true, false)
    );
    assert_eq!(
        (rules.opening(), rules.pass_scope()),
        (Opening::Golden, PassScope::Pizza)
    );
    assert_eq!((rules.max_idle_pizzas(), rules.max_turns()), (3, 10_000));

    let rulebook = RuleSetSpec::preset("rulebook").unwrap();
    assert_eq!(
        rulebook,
        RuleSetSpec {
            points: vec![3, 2, 1, 0],
            ..RuleSetSpec::default()
        }
    );

    let original = RuleSetSpec::preset("original2020")
        .unwrap()
        .validate()
        .unwrap();
    assert_eq!(
        (original.opening(), original.opening_pass()),
        (Opening::AnyTopFace, true)
    );
    assert_eq!(
        (original.pass_scope(), original.points_slice()),
        (PassScope::Turn, &[5, 3, 1, 0][..])
    );

    for name in RuleSetSpec::PRESETS {
        assert!(
            RuleSetSpec::preset(name).unwrap().validate().is_ok(),
            "{name}"
        );
    }
    assert_eq!(RuleSetSpec::preset("Paper"), None);
}

#[test]
fn default_points_by_number_of_players() {
    let table: [(u8, &[u32]); 5] = [
        (2, &[5, 0]),
        (3, &[5, 3, 0]),
        (4, &[5, 3, 1, 0]),
        (5, &[5, 3, 1, 1, 0]),
        (6, &[5, 3, 1, 1, 1, 0]),
    ];
    for (players, points) in table {
        let rules = RuleSetSpec {
            players,
            ..RuleSetSpec::default()
        }
        .validate()
        .unwrap();
        assert_eq!(rules.points_slice(), points);
        assert_eq!(rules.points(1), points[0]);
        assert_eq!(
            (
                rules.points(0),
                rules.points(players + 1),
                rules.points(200)
            ),
            (0, 0, 0)
        );
        assert_eq!(
            rules.spec().validate(),
            Ok(rules),
            "a rule set can be written down and read again"
        );
    }
}

#[test]
fn invalid_rule_sets_are_refused_with_field_and_reason() {
    let standard = RuleSetSpec::default;
    let table: [(RuleSetSpec, &str, &str); 17] = [
        (
            RuleSetSpec {
                players: 1,
                ..standard()
            },
            "players",
            "1 players: choose 2 to 6",
        ),
        (
            RuleSetSpec {
                players: 7,
                ..standard()
            },
            "players",
            "7 players: choose 2 to 6",
        ),
        (
            RuleSetSpec {
                faces: 3,
                ..standard()
            },
            "faces",
            "3 faces: choose 4 to 15",
        ),
        (
            RuleSetSpec {
                faces: 16,
                ..standard()
            },
            "faces",
            "16 faces: choose 4 to 15",
        ),
        (
            RuleSetSpec {
                faces: 255,
                ..standard()
            },
            "faces",
            "255 faces",
        ),
        (
            RuleSetSpec {
                jokers: 3,
                ..standard()
            },
            "jokers",
            "3 jokers: choose 0 to 2",
        ),
        (
            RuleSetSpec {
                players: 6,
                faces: 4,
                ..standard()
            },
            "faces",
            "12 cards among 6 players leave hands of 2",
        ),
        (
            RuleSetSpec {
                faces: 4,
                jokers: 1,
                ..standard()
            },
            "faces",
            "11 cards among 4 players leave hands of 2",
        ),
        (
            RuleSetSpec {
                stop: Stop::Points(0),
                ..standard()
            },
            "target_points",
            "choose at least 1",
        ),
        (
            RuleSetSpec {
                stop: Stop::Shifts(0),
                ..standard()
            },
            "target_shifts",
            "choose at least 1",
        ),
        (
            RuleSetSpec {
                points: vec![5, 3, 1],
                ..standard()
            },
            "points",
            "3 numbers of points for 4 players",
        ),
        (
            RuleSetSpec {
                points: vec![5, 3, 1, 0, 0],
                ..standard()
            },
            "points",
            "5 numbers of points for 4 players",
        ),
        (
            RuleSetSpec {
                points: vec![5, 3, 4, 0],
                ..standard()
            },
            "points",
            "place 3 gets more points",
        ),
        (
            RuleSetSpec {
                points: vec![0, 0, 0, 0],
                ..standard()
            },
            "points",
            "the first place gets no points",
        ),
        (
            RuleSetSpec {
                players: 3,
                points: vec![3, 2, 1, 0],
                ..standard()
            },
            "points",
            "4 numbers of points for 3 players",
        ),
        (
            RuleSetSpec {
                max_idle_pizzas: 0,
                ..standard()
            },
            "max_idle_pizzas",
            "choose at least 1",
        ),
        (
            RuleSetSpec {
                max_turns: 0,
                ..standard()
            },
            "max_turns",
            "choose at least 1",
        ),
    ];
    for (spec, field, reason) in table {
        let error = spec.validate().unwrap_err();
        assert_eq!(error.field(), field, "{error}");
        assert!(error.to_string().contains(reason), "{error}");
    }
}

#[test]
fn the_smallest_and_largest_games_are_valid() {
    let table = [
        (4, 4, 2, 3),
        (3, 4, 0, 3),
        (2, 4, 0, 5),
        (6, 15, 2, 20),
        (2, 15, 2, 61),
        (5, 5, 0, 3),
        (6, 6, 0, 3),
    ];
    for (players, faces, jokers, hand) in table {
        let rules = RuleSetSpec {
            players,
            faces,
            jokers,
            ..RuleSetSpec::default()
        }
        .validate()
        .unwrap();
        assert_eq!(rules.hand_size(), hand);
    }
    let extreme = RuleSetSpec {
        stop: Stop::Shifts(u32::MAX),
        points: vec![u32::MAX; 4],
        max_turns: u32::MAX,
        max_idle_pizzas: u32::MAX,
        ..RuleSetSpec::default()
    };
    assert!(extreme.validate().is_ok());
}
