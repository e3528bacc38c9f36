//! Scenes of recorded games. What they hide, the action table and the drawings have their own
//! modules.

#![allow(
    clippy::unwrap_used,
    reason = "a test fails by it, in its helpers as well"
)]

mod drawing;
mod hidden;
mod look_up;

use std::path::Path;

use chefshat_engine::{BySeat, Game, PlayRequirement, RuleSet, RuleSetSpec, Stop, Viewer};
use chefshat_proto::v1::{self, record_line::Line};
use chefshat_record::import::import;
use chefshat_record::jsonl;
use chefshat_record::testing::aborted;
use chefshat_render::{
    Card, Chronicle, Film, FilmError, Hand, LogEntry, Now, Painter, ParticipantKind, Perspective,
    Scene, When,
};

fn fixture(file: &str) -> Vec<v1::RecordLine> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/fixtures/records");
    jsonl::read(&folder.join(file)).unwrap()
}

fn film(file: &str, perspective: Perspective) -> Film {
    Film::new(&fixture(file), perspective).unwrap()
}

fn rules(players: u8, faces: u8) -> RuleSet {
    let spec = RuleSetSpec {
        players,
        faces,
        stop: Stop::Shifts(2),
        ..RuleSetSpec::default()
    };
    spec.validate().unwrap()
}

/// The chronicle of a game between robots with these names, for one viewer.
fn chronicle(rules: &RuleSet, names: &[&str], viewer: Viewer) -> Chronicle {
    let seats: Vec<v1::Participant> = (0..)
        .zip(names)
        .map(|(seat, name)| v1::Participant {
            seat,
            name: (*name).to_owned(),
            kind: v1::ParticipantKind::Robot.into(),
            ..v1::Participant::default()
        })
        .collect();
    Chronicle::new("kitchen", &seats, rules, viewer)
}

fn scene(game: &Game, viewer: Viewer) -> Scene {
    let rules = game.rules();
    let known = BySeat::filled(rules.players(), true);
    Scene::of(game, &chronicle(rules, &[], viewer), viewer, &known)
}

#[test]
fn a_film_has_a_frame_for_every_moment() {
    let film = film("fixed.jsonl", Perspective::All);
    let shape: Vec<When> = film.frames().iter().map(|frame| frame.when).collect();
    assert_eq!(film.decisions(), 96);
    assert_eq!(shape.len(), 96 + 2 + 1);
    assert_eq!(shape[0], When::Decision(1));
    assert_eq!(
        shape[shape.len() - 3..],
        [When::Decision(96), When::ShiftEnd(2), When::End]
    );

    let first = &film.at(When::Decision(1)).unwrap().scene;
    let Now::Turn { seat, requirement } = first.now else {
        panic!("{:?}", first.now)
    };
    assert_eq!(
        requirement,
        PlayRequirement {
            lowest_face: 11,
            highest_face: 11,
            fewest_cards: 1,
            golden_card: true,
            lone_joker: false,
            may_pass: false,
        }
    );
    let Hand::Open(hand) = &first.seats[seat.index()].hand else {
        panic!("all hands are open")
    };
    assert_eq!((hand.len(), hand.contains(&Card::Golden(11))), (22, true));
    assert!(hand.is_sorted_by_key(|card| card.face().unwrap_or(12)));
    assert_eq!(first.log, [LogEntry::Dealt(1)]);
    assert_eq!(
        first.seats[0].participant.kind,
        ParticipantKind::BuiltIn("greedy".into())
    );

    // After the opening, the Golden card is on the board.
    let second = &film.at(When::Decision(2)).unwrap().scene;
    assert_eq!(
        (second.board[0], second.board_by),
        (Card::Golden(11), Some(seat))
    );
    let Now::Turn { requirement, .. } = second.now else {
        panic!("{:?}", second.now)
    };
    let size = u8::try_from(second.board.len()).unwrap();
    assert_eq!(
        requirement,
        PlayRequirement {
            lowest_face: 1,
            highest_face: 10,
            fewest_cards: size,
            golden_card: false,
            lone_joker: false,
            may_pass: true,
        }
    );

    for shift in [1, 2] {
        let over = &film.at(When::ShiftEnd(shift)).unwrap().scene;
        let places: Vec<u8> = over.seats.iter().map(|seat| seat.place).collect();
        assert_eq!(places.iter().sum::<u8>(), 1 + 2 + 3);
        for seat in &over.seats {
            let held = match &seat.hand {
                Hand::Open(cards) => cards.len(),
                hand => panic!("{hand:?}"),
            };
            assert_eq!(held == 0, seat.place < 3, "only the last holds cards");
        }
        let played: u8 = over.played.iter().map(|(played, _)| played).sum();
        let held: usize = over
            .seats
            .iter()
            .map(|seat| match &seat.hand {
                Hand::Open(cards) => cards.len(),
                _ => 0,
            })
            .sum();
        assert_eq!(
            usize::from(played) + held,
            66,
            "of 68 cards 2 are set aside"
        );
        assert!(matches!(over.now, Now::ShiftOver { .. }));
    }
    assert!(matches!(
        film.at(When::End).unwrap().scene.now,
        Now::GameOver(_)
    ));
}

#[test]
fn parts_of_a_film() {
    let film = film("fixed.jsonl", Perspective::All);
    let whens = |frames: Vec<&chefshat_render::Frame>| -> Vec<When> {
        frames.iter().map(|frame| frame.when).collect()
    };
    let first = whens(film.shift(1).unwrap());
    assert_eq!(first[0], When::Decision(1));
    assert_eq!(first.last(), Some(&When::ShiftEnd(1)));
    let turns = u64::try_from(first.len() - 1).unwrap();

    // The end of a Shift is between decisions, not in a range that stops before it.
    assert_eq!(
        whens(film.range(turns..=turns + 1).unwrap()),
        [
            When::Decision(turns),
            When::ShiftEnd(1),
            When::Decision(turns + 1)
        ]
    );
    assert_eq!(
        whens(film.range(turns..=turns).unwrap()),
        [When::Decision(turns)]
    );
    assert_eq!(
        whens(film.range(96..=96).unwrap()),
        [When::Decision(96), When::ShiftEnd(2), When::End]
    );
    assert_eq!(film.range(1..=96).unwrap().len(), film.frames().len());

    for (problem, words) in [
        (
            film.at(When::Decision(97)).map(drop),
            "there is no decision 97: the game has decisions 1 to 96",
        ),
        (
            film.range(0..=3).map(drop),
            "there is no decision 0: the game has decisions 1 to 96",
        ),
        (
            film.shift(3).map(drop),
            "there is no Shift 3: the game has Shifts 1 to 2",
        ),
        (
            film.at(When::ShiftEnd(0)).map(drop),
            "there is no Shift 0: the game has Shifts 1 to 2",
        ),
    ] {
        assert_eq!(problem.unwrap_err().to_string(), words);
    }
    let error = Film::new(&fixture("fixed.jsonl"), Perspective::Seat(3)).unwrap_err();
    assert_eq!(
        error.to_string(),
        "there is no seat 3: the game has seats 0 to 2"
    );
    let cut = &fixture("fixed.jsonl")[..20];
    assert!(matches!(
        Film::new(cut, Perspective::All).unwrap_err(),
        FilmError::Replay(_)
    ));
}

#[test]
fn an_aborted_game_is_drawn_up_to_its_end() {
    let lines = fixture("fixed.jsonl");
    let is_decision = |line: &v1::RecordLine| matches!(line.line, Some(Line::Decision(_)));
    let tenth = (0..lines.len())
        .filter(|&index| is_decision(&lines[index]))
        .nth(9)
        .unwrap();
    let lines = aborted(lines, tenth);
    let film = Film::new(&lines, Perspective::Seat(0)).unwrap();
    assert_eq!((film.decisions(), film.frames().len()), (9, 10));
    let scene = &film.at(When::End).unwrap().scene;
    assert_eq!(scene.now, Now::Aborted);
    assert!(scene.seats.iter().all(|seat| !seat.deciding));
    assert!(Painter::new().table(scene).contains("There is no result."));
    assert_eq!(
        film.at(When::ShiftEnd(1)).unwrap_err().to_string(),
        "Shift 1 did not end"
    );
}

#[test]
fn an_imported_game_that_stops_between_shifts_ends_with_the_scene_of_the_last_one() {
    let transcript = "shift,seat,what,value
,,rules,paper players=2 faces=4 jokers=1 target_points=100
,0,human,Ana
,1,robot,Pepper
1,0,plays,4 4 4 4
1,1,passes,
1,0,plays,1
";
    let film_of = |transcript: &str| {
        let lines = import(transcript.as_bytes()).unwrap();
        Film::new(&lines, Perspective::All).unwrap()
    };
    let film = film_of(transcript);
    let [.., before, last] = film.frames() else {
        panic!("{} frames", film.frames().len())
    };
    assert_eq!((before.when, last.when), (When::ShiftEnd(1), When::End));
    let aborted = Scene {
        now: Now::Aborted,
        ..before.scene.clone()
    };
    assert_eq!(last.scene, aborted, "there was no second deal");

    // A dealt Shift is shown even without a decision.
    let film = film_of(&format!("{transcript}2,0,hand,1 2 2 3 3\n"));
    let last = film.frames().last().unwrap();
    assert_eq!(
        (last.scene.now.clone(), last.scene.shift),
        (Now::Aborted, 2)
    );
    let whens: Vec<When> = (film.shift(2).unwrap().iter())
        .map(|frame| frame.when)
        .collect();
    assert_eq!(whens, [When::End]);
}
