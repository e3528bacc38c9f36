//! Scenes, pictures and films reveal nothing that their viewer may not know.

use std::time::Duration;

use chefshat_engine::{
    Action, BySeat, Cards, DecisionKind, Game, RuleSet, RuleSetSpec, Script, Seat, SeatOrder, Seed,
    SpecialAction, Stop, TakenOver, Viewer,
};
use chefshat_proto::v1::{self, record_line::Line};
use chefshat_record::branch::Branch;
use chefshat_record::import::import;
use chefshat_record::replay::walk;
use chefshat_record::testing::{HiddenGolden, Observed, TestGame, transcript};
use chefshat_render::{Card, Film, Frame, Hand, LogEntry, Now, Painter, Perspective, Scene, When};

use super::{chronicle, film, fixture, rules, scene};

/// One in this many scenes is drawn too.
const DRAWN: usize = 9;

/// The cards that an SVG picture draws.
fn drawn(svg: &str) -> Vec<String> {
    let mut cards: Vec<String> = svg
        .split('"')
        .filter(|part| part.starts_with("card-"))
        .map(str::to_owned)
        .collect();
    cards.sort();
    cards.dedup();
    cards
}

fn names_of(cards: &[Card]) -> Vec<String> {
    let mut names: Vec<String> = cards
        .iter()
        .map(|card| match card {
            Card::Face(face) => format!("card-{face}"),
            Card::Golden(_) => "card-golden".to_owned(),
            Card::Joker => "card-joker".to_owned(),
        })
        .collect();
    names.sort();
    names.dedup();
    names
}

#[test]
fn nothing_hidden_is_in_a_scene_or_its_picture() {
    let painter = Painter::new();
    let all = film("committed.jsonl", Perspective::All);
    for perspective in [
        Perspective::Seat(0),
        Perspective::Seat(2),
        Perspective::Spectator,
    ] {
        let own = match perspective {
            Perspective::Seat(seat) => usize::try_from(seat).ok(),
            _ => None,
        };
        let film = film("committed.jsonl", perspective);
        let mut gifts = 0;
        for (number, (frame, all)) in film.frames().iter().zip(all.frames()).enumerate() {
            let mut visible = frame.scene.board.clone();
            for (seat, (shown, open)) in frame.scene.seats.iter().zip(&all.scene.seats).enumerate()
            {
                let Hand::Open(cards) = &open.hand else {
                    panic!("all hands are open")
                };
                if Some(seat) == own {
                    assert_eq!(shown.hand, open.hand);
                    visible.extend(cards);
                } else {
                    assert_eq!(shown.hand, Hand::Hidden(u8::try_from(cards.len()).unwrap()));
                }
            }
            for entry in &frame.scene.log {
                if let LogEntry::Gave {
                    giver,
                    receiver,
                    cards,
                    ..
                } = entry
                {
                    let involved = [giver.index(), receiver.index()];
                    assert_eq!(
                        cards.is_some(),
                        own.is_some_and(|own| involved.contains(&own))
                    );
                    gifts += 1;
                }
            }
            if number % DRAWN != 0 {
                continue;
            }
            let svg = painter.table(&frame.scene);
            // The embedded font has all characters of our own words.
            let known = |letter: char| letter.is_ascii() || "×·…≤≥’".contains(letter);
            assert!(svg.chars().all(known), "{:?}", frame.when);
            let drawn = drawn(&svg);
            let fronts: Vec<_> = drawn
                .into_iter()
                .filter(|card| card != "card-back")
                .collect();
            assert_eq!(fronts, names_of(&visible), "{:?}", frame.when);
        }
        assert!(gifts > 0, "the game has exchanges");
    }
}

#[test]
fn games_that_differ_in_hidden_cards_give_the_same_picture() {
    let rules = rules(4, 11);
    let painter = Painter::new();
    let viewer = Viewer::Seat(Seat::new(1));
    let mut compared = 0;
    let mut game = Game::new(rules, Seed([5; 32]), |_| {});
    for _ in 0..30 {
        let legal = game.legal_actions();
        game.apply(legal.nth(legal.len() / 2).unwrap(), |_| {})
            .unwrap();
        let Some(other) = with_other_hidden_cards(&game) else {
            continue;
        };
        compared += 1;
        assert_eq!(scene(&game, viewer), scene(&other, viewer));
        assert_eq!(
            painter.table(&scene(&game, viewer)),
            painter.table(&scene(&other, viewer))
        );
        assert_ne!(
            painter.table(&scene(&game, Viewer::Everything)),
            painter.table(&scene(&other, Viewer::Everything))
        );
    }
    assert!(compared > 10, "{compared}");
}

/// The same game after seats 2 and 3 swap one card.
fn with_other_hidden_cards(game: &Game) -> Option<Game> {
    let (left, right) = (Seat::new(2), Seat::new(3));
    let mut hands = *game.hands();
    let faces = game.rules().faces();
    let counts = |seat: Seat| -> Vec<u8> { hands[seat].counts(faces).collect() };
    let (mut lefts, mut rights) = (counts(left), counts(right));
    // Cards of the top face stay, the Golden card among them.
    let plain = usize::from(faces) - 1;
    let (from, to) = (0..plain)
        .flat_map(|from| (0..plain).map(move |to| (from, to)))
        .find(|&(from, to)| from != to && lefts[from] > 0 && rights[to] > 0)?;
    for (hand, from, to) in [(&mut lefts, from, to), (&mut rights, to, from)] {
        hand[from] -= 1;
        hand[to] += 1;
    }
    for (seat, counts) in [(left, lefts), (right, rights)] {
        hands[seat] = Cards::from_counts(faces, &counts, hands[seat].has_golden())?;
    }
    Some(game.with_hands(hands).unwrap())
}

/// The decisions about special actions, known only to their seat and to viewers of everything.
fn specials(all: &Film) -> Vec<(u64, Seat, SpecialAction)> {
    let special = |frame: &Frame| match (frame.when, &frame.scene.now) {
        (When::Decision(number), Now::Special(seat, special)) => Some((number, *seat, *special)),
        _ => None,
    };
    all.frames().iter().filter_map(special).collect()
}

fn own(seat: Seat) -> Perspective {
    Perspective::Seat(u32::try_from(seat.index()).unwrap())
}

#[test]
fn only_the_seat_sees_that_it_may_declare_a_special_action() {
    let lines = fixture("fixed.jsonl");
    let all = Film::new(&lines, Perspective::All).unwrap();
    let [(number, seat, special)] = specials(&all)[..] else {
        panic!("one such decision: {:?}", specials(&all))
    };
    let moment = When::Decision(number);
    let film = Film::new(&lines, own(seat)).unwrap();
    let scene = &film.at(moment).unwrap().scene;
    assert_eq!(scene.now, Now::Special(seat, special));
    assert!(scene.seats[seat.index()].deciding);
    assert_eq!(film.frames().len(), all.frames().len());

    for perspective in [
        own(Seat::new((seat.index() + 1) % 3)),
        Perspective::Spectator,
    ] {
        let film = Film::new(&lines, perspective).unwrap();
        let whens = |range| -> Vec<When> {
            let frames = film.range(range).unwrap();
            frames.iter().map(|frame| frame.when).collect()
        };
        assert_eq!(film.frames().len(), all.frames().len() - 1);
        assert_eq!(whens(1..=film.decisions()).len(), film.frames().len());
        // The frame before replaces it: the end of the Shift, before the first gift.
        let before = When::ShiftEnd(1);
        assert_eq!(film.at(moment).unwrap().when, before);
        assert_eq!(whens(number..=number), [before]);
        let (earlier, later) = (number - 1, number + 1);
        assert_eq!(
            whens(earlier..=later),
            [When::Decision(earlier), before, When::Decision(later)]
        );
        assert_eq!(whens(earlier..=earlier), [When::Decision(earlier)]);
        assert_eq!(whens(later..=later), [When::Decision(later)]);
    }
}

#[test]
fn a_film_may_begin_with_a_hidden_decision() {
    let rules = rules(3, 11);
    let mut hands = None;
    walk(&fixture("fixed.jsonl"), |moment| {
        if let (Line::Decision(_), Some(game)) = (moment.entry, moment.game)
            && game.decision().unwrap().kind == DecisionKind::SpecialAction
        {
            hands = Some(*game.hands());
        }
    })
    .unwrap();
    let script = Script {
        shift: 2,
        hands: hands.unwrap(),
        last_order: SeatOrder::from_slice(&[Seat::new(0), Seat::new(1), Seat::new(2)]),
        scores: BySeat::filled(3, 0),
        drawn: None,
    };
    let game = TestGame {
        script: Some(script),
        ..TestGame::dealt(rules, 1, 2)
    };
    let lines = game.record(|_| v1::DecisionSource::Agent);
    let all = Film::new(&lines, Perspective::All).unwrap();
    assert_eq!(specials(&all)[0].0, 1);
    let film = Film::new(&lines, Perspective::Spectator).unwrap();
    let first = film.at(When::Decision(1)).unwrap();
    assert_eq!(first.when, film.frames()[0].when);
    assert_eq!(film.range(1..=1).unwrap().len(), 1);
}

#[test]
fn only_viewers_of_everything_see_numbers_of_decisions() {
    let painter = Painter::new();
    for (perspective, has_numbers) in [
        (Perspective::All, true),
        (Perspective::Seat(0), false),
        (Perspective::Seat(1), false),
        (Perspective::Spectator, false),
    ] {
        let film = film("fixed.jsonl", perspective);
        for frame in film.frames() {
            let number = match frame.when {
                When::Decision(number) if has_numbers => Some(number),
                _ => None,
            };
            assert_eq!(frame.scene.decision, number);
        }
        let svg = painter.table(&film.at(When::Decision(57)).unwrap().scene);
        assert_eq!(svg.contains("decision 57"), has_numbers);
    }
}

/// The same game with and without special actions; all are declined.
fn with_and_without_special_actions(players: u8, seed: u8) -> [Vec<v1::RecordLine>; 2] {
    [true, false].map(|special_actions| {
        let spec = RuleSetSpec {
            players,
            faces: 7,
            stop: Stop::Shifts(9),
            special_actions,
            ..RuleSetSpec::default()
        };
        let rules = spec.validate().unwrap();
        let seed = Seed([seed; 32]);
        let mut game = Game::new(rules, seed, |_| {});
        let (mut actions, mut others) = (Vec::new(), 0);
        while let Some(open) = game.decision() {
            let legal = game.legal_actions();
            let action = if open.kind == DecisionKind::SpecialAction {
                rules.actions().encode(Action::Decline).unwrap()
            } else {
                others += 1;
                legal.nth(others * 7 % legal.len()).unwrap()
            };
            actions.push(action);
            game.apply(action, |_| {}).unwrap();
        }
        let branch = Branch {
            rules,
            script: None,
            taken_over: vec![TakenOver { seed, actions }],
            later_deals: None,
        };
        let game = TestGame {
            branch: Some(&branch),
            seed,
            ..TestGame::dealt(rules, 0, 0)
        };
        game.record(|_| v1::DecisionSource::Recorded)
    })
}

/// The scenes of a film and their times, without the viewer's own special actions.
fn shown(film: &Film) -> Vec<(&Scene, Duration)> {
    let frames = film.frames().iter();
    frames
        .filter(|frame| !matches!(frame.scene.now, Now::Special(..)))
        .map(|frame| (&frame.scene, frame.decision_time))
        .collect()
}

#[test]
fn games_that_differ_in_a_silent_decline_give_the_same_film() {
    let painter = Painter::new();
    let mut compared = 0;
    for (players, seed) in [2, 3, 4, 4, 5, 6].into_iter().zip(1..) {
        let [offered, not_offered] = with_and_without_special_actions(players, seed);
        let declines = specials(&Film::new(&offered, Perspective::All).unwrap());
        let seats = (0..usize::from(players)).map(Seat::new);
        for perspective in seats.map(own).chain([Perspective::Spectator]) {
            let films =
                [&offered, &not_offered].map(|lines| Film::new(lines, perspective).unwrap());
            let [with, without] = films.each_ref().map(shown);
            assert_eq!(with, without);
            let of_others = declines
                .iter()
                .filter(|(_, seat, _)| own(*seat) != perspective);
            for &(number, _, _) in of_others {
                compared += 1;
                // The frame before replaces the decision, and its picture shows no number.
                let [film, _] = &films;
                let [before, moment] = [number - 1, number].map(|decision| {
                    let frame = film.at(When::Decision(decision)).unwrap();
                    (film.frames().iter())
                        .position(|other| std::ptr::eq(other, frame))
                        .unwrap()
                });
                assert_eq!(moment, before + 1, "the end of the Shift");
                let svg = painter.table(&film.frames()[moment].scene);
                assert!(!svg.contains("decision"));
            }
        }
    }
    assert!(compared > 20, "{compared}");
}

#[test]
fn unknown_hands_are_drawn_as_unknown() {
    let rules = rules(2, 4);
    let game = Game::new(rules, Seed([1; 32]), |_| {});
    let known = BySeat::from_fn(2, |seat| seat.index() == 0);
    let viewer = Viewer::Everything;
    let scene = Scene::of(&game, &chronicle(&rules, &[], viewer), viewer, &known);
    let Hand::Open(cards) = &scene.seats[0].hand else {
        panic!("{:?}", scene.seats[0])
    };
    let mut expected = names_of(cards);
    expected.push("card-unknown".to_owned());
    assert_eq!(scene.seats[1].hand, Hand::Unknown(rules.hand_size()));
    assert_eq!(drawn(&Painter::new().table(&scene)), expected);
}

/// The number of hands with the Golden card in the film of an imported game.
fn golden_drawn(rules: &RuleSet, played: &[v1::RecordLine], observed: Observed) -> usize {
    let record = import(transcript(rules, played, observed).as_bytes()).unwrap();
    let film = Film::new(&record, Perspective::All).unwrap();
    let seats = film.frames().iter().flat_map(|frame| &frame.scene.seats);
    seats
        .filter(|seat| {
            matches!(&seat.hand, Hand::Open(cards) if cards.iter().any(|card| matches!(card, Card::Golden(_))))
        })
        .count()
}

#[test]
fn the_golden_card_is_drawn_only_if_its_holder_is_known() {
    let HiddenGolden {
        rules,
        lines: played,
        holder,
    } = HiddenGolden::record();
    assert_eq!(golden_drawn(&rules, &played, Observed::TURNS), 0);
    for seat in 0..4 {
        let observed = Observed {
            hands: 1 << seat,
            ..Observed::TURNS
        };
        assert_eq!(golden_drawn(&rules, &played, observed) > 0, seat == holder);
    }
    // By the default rules, the opening reveals the holder.
    let rules = RuleSetSpec {
        stop: Stop::Shifts(1),
        ..RuleSetSpec::default()
    };
    let rules = rules.validate().unwrap();
    let played = TestGame::dealt(rules, 7, 1).record(|_| v1::DecisionSource::Agent);
    assert!(golden_drawn(&rules, &played, Observed::TURNS) > 0);
}
