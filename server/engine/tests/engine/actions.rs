//! Indices and texts of actions.

use chefshat_engine::{Action, ActionId, ActionSpace, Face};

#[test]
fn standard_table() {
    let space = ActionSpace::new(11).unwrap();
    assert_eq!(
        (space.size(), space.turn_actions(), space.id().as_str()),
        (214, 200, "chefshat-11")
    );
    let table = [
        (0, "C1;Q1;J0"),
        (2, "C1;Q1;J2"),
        (3, "C2;Q1;J0"),
        (8, "C2;Q2;J2"),
        (9, "C3;Q1;J0"),
        (165, "C11;Q1;J0"),
        (168, "C11;Q2;J0"),
        (197, "C11;Q11;J2"),
        (198, "C0;Q0;J1"),
        (199, "pass"),
        (200, "give C1"),
        (210, "give C11"),
        (211, "give J"),
        (212, "decline"),
        (213, "declare"),
    ];
    for (index, text) in table {
        assert_eq!(space.text(ActionId::new(index)).as_deref(), Some(text));
        assert_eq!(space.parse(text), Some(ActionId::new(index)));
    }
    let named = [
        space.lone_joker(),
        space.pass(),
        space.give_joker(),
        space.decline(),
        space.declare(),
    ];
    assert_eq!(named.map(ActionId::index), [198, 199, 211, 212, 213]);
}

#[test]
fn texts_and_indices_convert_both_ways_for_every_number_of_faces() {
    let mut checked = 0u32;
    for faces in 4..=15 {
        let space = ActionSpace::new(faces).unwrap();
        let f = u16::from(faces);
        assert_eq!(space.turn_actions(), 3 * f * (f + 1) / 2 + 2);
        assert_eq!(space.size(), space.turn_actions() + f + 3);
        let mut texts = std::collections::BTreeSet::new();
        for action in space.iter() {
            let text = space.text(action).unwrap();
            assert_eq!(space.parse(&text), Some(action), "{text}");
            assert_eq!(
                space.encode(space.decode(action).unwrap()),
                Some(action),
                "{text}"
            );
            assert!(texts.insert(text), "every text is unique");
            checked += 1;
        }
        assert_eq!(space.text(ActionId::new(space.size())), None);
        assert_eq!(space.text(ActionId::new(u16::MAX)), None);
    }
    assert_eq!(
        checked,
        (4..=15)
            .map(|f| 3 * f * (f + 1) / 2 + 2 + f + 3)
            .sum::<u32>()
    );
}

#[test]
fn play_numbers_follow_the_formula() {
    let space = ActionSpace::new(15).unwrap();
    for face in 1..=15u8 {
        for quantity in 1..=face {
            for jokers in 0..=2u8 {
                let (f, q, j) = (u16::from(face), u16::from(quantity), u16::from(jokers));
                let action = ActionId::new(3 * (f * (f - 1) / 2 + q - 1) + j);
                let play = Action::Play {
                    face: Face::new(face).unwrap(),
                    quantity,
                    jokers,
                };
                assert_eq!(space.encode(play), Some(action));
                assert_eq!(space.decode(action), Some(play));
            }
        }
    }
}

#[test]
fn other_texts_are_refused() {
    let space = ActionSpace::new(11).unwrap();
    let texts = [
        "",
        "Pass",
        "pass ",
        "C01;Q1;J0",
        "C1;Q2;J0",
        "C12;Q1;J0",
        "C0;Q0;J0",
        "C0;Q0;J2",
        "C3;Q0;J1",
        "C3;Q1;J3",
        "C3;Q1",
        "C3;Q1;J0;J0",
        "C+3;Q1;J0",
        "give C12",
        "give C0",
        "give C03",
        "give",
        "give  J",
        "C300;Q1;J0",
    ];
    for text in texts {
        assert_eq!(space.parse(text), None, "{text:?}");
    }
    assert_eq!(space.give(Face::new(12).unwrap()), None);
    assert_eq!(
        space.encode(Action::Play {
            face: Face::new(3).unwrap(),
            quantity: 4,
            jokers: 0
        }),
        None
    );
    assert_eq!((ActionSpace::new(3), ActionSpace::new(16)), (None, None));
}
