//! Pictures: what a scene shows of a recorded game, that nothing hidden is in it, that the look-up table agrees with the mask, and that
//! drawings come out whole and the same every time. That they look well was seen to by eye.

use std::io::Cursor;
use std::path::Path;

use chefshat_engine::{
    Action, BySeat, Cards, DecisionKind, Game, Move, RuleSet, RuleSetSpec, Seat, Seed, Stop, Viewer,
};
use chefshat_proto::v1::{self, game_event::Kind, record_line::Line};
use chefshat_records::jsonl;
use chefshat_records::picture::{
    Card, Chronicle, Demand, Eyes, Figure, Film, FilmError, GifWriter, Hand, Happening, Now,
    Painter, Palette, Scene, Sort, State, When, figure_at,
};
use resvg::tiny_skia::Pixmap;

use super::made::Making;

/// Pixels that the pictures of these tests are wide: few, because nobody looks at them.
const WIDTH: u32 = 320;

/// Of so many scenes one is drawn where all are looked at.
const DRAWN: usize = 9;

fn fixture(file: &str) -> Vec<v1::RecordLine> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/fixtures/records");
    jsonl::read(&folder.join(file)).unwrap()
}

fn film(file: &str, eyes: Eyes) -> Film {
    Film::new(&fixture(file), eyes).unwrap()
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

/// Who sits at a table with these names, as one viewer sees what happens there.
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
fn a_film_has_a_frame_for_every_moment() {
    let film = film("fixed.jsonl", Eyes::All);
    let shape: Vec<When> = film.frames().iter().map(|frame| frame.when).collect();
    assert_eq!(film.decisions(), 96);
    assert_eq!(shape.len(), 96 + 2 + 1);
    assert_eq!(shape[0], When::Decision(1));
    assert_eq!(
        shape[shape.len() - 3..],
        [When::Decision(96), When::ShiftEnd(2), When::End]
    );

    let first = &film.at(When::Decision(1)).unwrap().scene;
    let Now::Turn {
        seat,
        demand,
        may_pass,
    } = first.now
    else {
        panic!("{:?}", first.now)
    };
    assert_eq!((demand, may_pass), (Demand::Golden(11), false));
    let Hand::Open(hand) = &first.seats[seat.index()].hand else {
        panic!("all hands are open")
    };
    assert_eq!((hand.len(), hand.contains(&Card::Golden(11))), (22, true));
    assert!(hand.is_sorted_by_key(|card| card.face().unwrap_or(12)));
    assert_eq!(first.log, [Happening::Dealt(1)]);
    assert_eq!(
        first.seats[0].participant.sort,
        Sort::BuiltIn("greedy".into())
    );

    // The opening is answered with the Golden card on the board.
    let second = &film.at(When::Decision(2)).unwrap().scene;
    assert_eq!(
        (second.board[0], second.board_by),
        (Card::Golden(11), Some(seat))
    );
    let Now::Turn { demand, .. } = second.now else {
        panic!("{:?}", second.now)
    };
    let size = u8::try_from(second.board.len()).unwrap();
    assert_eq!(demand, Demand::Beat { face: 10, size });

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
fn a_part_of_a_film_is_what_was_asked_for() {
    let film = film("fixed.jsonl", Eyes::All);
    let whens = |frames: Vec<&chefshat_records::picture::Frame>| -> Vec<When> {
        frames.iter().map(|frame| frame.when).collect()
    };
    let first = whens(film.shift(1).unwrap());
    assert_eq!(first[0], When::Decision(1));
    assert_eq!(first.last(), Some(&When::ShiftEnd(1)));
    let turns = u64::try_from(first.len() - 1).unwrap();

    // The end of a Shift stands between decisions, and is no part of a row that stops before it.
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
            "there is no decision 97: the game has the decisions 1 to 96",
        ),
        (
            film.range(0..=3).map(drop),
            "there is no decision 0: the game has the decisions 1 to 96",
        ),
        (
            film.shift(3).map(drop),
            "there is no Shift 3: the game has the Shifts 1 to 2",
        ),
        (
            film.at(When::ShiftEnd(0)).map(drop),
            "there is no Shift 0: the game has the Shifts 1 to 2",
        ),
    ] {
        assert_eq!(problem.unwrap_err().to_string(), words);
    }
    let error = Film::new(&fixture("fixed.jsonl"), Eyes::Seat(3)).unwrap_err();
    assert_eq!(
        error.to_string(),
        "there is no seat 3: the game has the seats 0 to 2"
    );
    let cut = &fixture("fixed.jsonl")[..20];
    assert!(matches!(
        Film::new(cut, Eyes::All).unwrap_err(),
        FilmError::Replay(_)
    ));
}

#[test]
fn a_game_that_was_given_up_is_drawn_as_far_as_it_went() {
    let mut lines = fixture("fixed.jsonl");
    let reveal = lines.iter().find_map(|line| match line.line.as_ref()? {
        Line::Event(event) => match event.kind.as_ref()? {
            Kind::GameEnded(ended) => ended.reveal.clone(),
            _ => None,
        },
        _ => None,
    });
    let is_decision = |line: &v1::RecordLine| matches!(line.line, Some(Line::Decision(_)));
    let tenth = (0..lines.len())
        .filter(|&index| is_decision(&lines[index]))
        .nth(9)
        .unwrap();
    lines.truncate(tenth);
    let events = lines
        .iter()
        .filter(|line| matches!(line.line, Some(Line::Event(_))))
        .count();
    let sequence = u64::try_from(events).unwrap() + 1;
    let aborted = v1::GameEvent {
        sequence,
        kind: Some(Kind::GameAborted(Box::new(v1::GameAborted {
            reason: v1::AbortReason::Closed.into(),
            reveal,
        }))),
        ..v1::GameEvent::default()
    };
    let footer = v1::RecordFooter {
        state: v1::RoomState::Aborted.into(),
        events: sequence,
        decisions: 9,
    };
    for line in [Line::Event(aborted), Line::Footer(footer)] {
        lines.push(v1::RecordLine { line: Some(line) });
    }

    let film = Film::new(&lines, Eyes::Seat(0)).unwrap();
    assert_eq!((film.decisions(), film.frames().len()), (9, 10));
    let scene = &film.at(When::End).unwrap().scene;
    assert_eq!(scene.now, Now::Aborted);
    assert!(scene.seats.iter().all(|seat| !seat.deciding));
    assert!(Painter::new().table(scene).contains("There is no result."));
    assert_eq!(
        film.at(When::ShiftEnd(1)).unwrap_err().to_string(),
        "Shift 1 was not played to its end"
    );
}

#[test]
fn nothing_hidden_is_in_a_scene_or_its_picture() {
    let painter = Painter::new();
    let all = film("committed.jsonl", Eyes::All);
    for eyes in [Eyes::Seat(0), Eyes::Seat(2), Eyes::Spectator] {
        let own = match eyes {
            Eyes::Seat(seat) => usize::try_from(seat).ok(),
            _ => None,
        };
        let film = film("committed.jsonl", eyes);
        let mut gifts = 0;
        for (number, (frame, open)) in film.frames().iter().zip(all.frames()).enumerate() {
            let mut visible = frame.scene.board.clone();
            for (seat, (shown, whole)) in
                frame.scene.seats.iter().zip(&open.scene.seats).enumerate()
            {
                let Hand::Open(cards) = &whole.hand else {
                    panic!("all hands are open")
                };
                if Some(seat) == own {
                    assert_eq!(shown.hand, whole.hand);
                    visible.extend(cards);
                } else {
                    assert_eq!(shown.hand, Hand::Hidden(u8::try_from(cards.len()).unwrap()));
                }
            }
            for happening in &frame.scene.log {
                if let Happening::Gave {
                    giver,
                    receiver,
                    cards,
                    ..
                } = happening
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
            // Beyond ASCII our own words hold no letters but these, which the embedded font has.
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

/// The same game with one card of seat 2 and one of seat 3 in each other's place.
fn with_other_hidden_cards(game: &Game) -> Option<Game> {
    let (left, right) = (Seat::new(2), Seat::new(3));
    let mut hands = *game.hands();
    let faces = game.rules().faces();
    let counts = |seat: Seat| -> Vec<u8> { hands[seat].counts(faces).collect() };
    let (mut lefts, mut rights) = (counts(left), counts(right));
    // The top face stays, and with it the Golden card.
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

#[test]
fn that_a_special_action_may_be_declared_is_for_the_seat_alone() {
    let lines = fixture("fixed.jsonl");
    let all = Film::new(&lines, Eyes::All).unwrap();
    let (index, seat) = all
        .frames()
        .iter()
        .enumerate()
        .find_map(|(index, frame)| match frame.scene.now {
            Now::Special(seat) => Some((index, seat)),
            _ => None,
        })
        .unwrap();
    let own = u32::try_from(seat.index()).unwrap();
    for (eyes, told) in [
        (Eyes::Seat(own), true),
        (Eyes::Seat((own + 1) % 3), false),
        (Eyes::Spectator, false),
    ] {
        let film = Film::new(&lines, eyes).unwrap();
        let scene = &film.frames()[index].scene;
        assert_eq!(scene.now == Now::Special(seat), told);
        assert_eq!(scene.now == Now::Dealt, !told);
        assert_eq!(scene.seats.iter().any(|seat| seat.deciding), told);
        // What cannot be known is left out of a film.
        let shown = film.range(1..=film.decisions()).unwrap().len();
        assert_eq!(shown, film.frames().len() - usize::from(!told));
    }
}

#[test]
fn hands_that_nobody_wrote_down_are_drawn_as_unknown() {
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

#[test]
fn the_look_up_table_agrees_with_the_mask() {
    let tables = [(4, 11), (3, 4), (6, 15)];
    let mut legal = 0;
    for (players, faces) in tables {
        let rules = rules(players, faces);
        let chronicle = chronicle(&rules, &[], Viewer::Everything);
        let mut game = Game::new(rules, Seed([9; 32]), |_| {});
        let mut turn = 0;
        while let Some(open) = game.decision() {
            let figure = Figure::of(&game, &chronicle).unwrap();
            assert_eq!(figure.seat, open.seat);
            check(&game, &figure);
            legal += figure.legal;
            turn += 1;
            let mask = game.legal_actions();
            game.apply(mask.nth(turn % mask.len()).unwrap(), |_| {})
                .unwrap();
        }
        assert!(Figure::of(&game, &chronicle).is_none());
    }
    assert!(legal > 1000);
}

/// Every action of the mask is told as legal and no other, and what is told of the others follows from hand and board.
fn check(game: &Game, figure: &Figure) {
    let (space, mask) = (game.rules().actions(), game.legal_actions());
    let hand = game.hands()[figure.seat];
    let mut told: Vec<(Move, State)> = vec![(Move::Pass, figure.pass)];
    told.extend(figure.lone_joker.map(|state| (Move::LoneJoker, state)));
    for (face, quantities) in (1..).zip(&figure.plays) {
        let face = chefshat_engine::Face::new(face).unwrap();
        assert_eq!(quantities.len(), usize::from(face.get()));
        for (quantity, states) in (1..).zip(quantities) {
            for (jokers, &state) in (0..).zip(states) {
                let play = Move::Play {
                    face,
                    quantity,
                    jokers,
                };
                let held = hand.count(face) >= quantity && hand.jokers() >= jokers;
                let allowed = match figure.demand {
                    None => false,
                    Some(Demand::Anything) => true,
                    Some(Demand::Golden(only) | Demand::Face(only)) => face.get() == only,
                    Some(Demand::Beat { face: most, size }) => {
                        face.get() <= most && quantity + jokers >= size
                    }
                };
                let expected = match (held, allowed) {
                    (true, true) => State::Legal,
                    (true, false) => State::NotAllowed,
                    (false, true) => State::NotInHand,
                    (false, false) => State::Impossible,
                };
                assert_eq!(state, expected, "{play}");
                told.push((play, state));
            }
        }
    }
    let faces = (1..=figure.faces).filter_map(chefshat_engine::Face::new);
    let gifts = faces.map(Move::Give).chain([Move::GiveJoker]);
    told.extend(gifts.zip(figure.gives.iter().copied()));
    told.extend(
        [Move::Declare, Move::Decline]
            .into_iter()
            .zip(figure.special.iter().copied()),
    );
    let mut legal: Vec<Action> = told
        .iter()
        .filter(|(_, state)| *state == State::Legal)
        .map(|(meaning, _)| space.encode(*meaning).unwrap())
        .collect();
    legal.sort();
    assert_eq!(legal, mask.iter().collect::<Vec<_>>());
    assert_eq!(figure.legal, legal.len());
    let kind = game.decision().unwrap().kind;
    assert_eq!(figure.demand.is_some(), kind == DecisionKind::Turn);
}

#[test]
fn the_look_up_table_is_for_the_seat_that_decides() {
    let lines = fixture("committed.jsonl");
    let seat = figure_at(&lines, Eyes::All, 7).unwrap().seat;
    let own = u32::try_from(seat.index()).unwrap();
    assert_eq!(figure_at(&lines, Eyes::Seat(own), 7).unwrap().seat, seat);
    for (eyes, decision, words) in [
        (
            Eyes::All,
            208,
            "there is no decision 208: the game has the decisions 1 to 207",
        ),
        (
            Eyes::Seat(9),
            7,
            "there is no seat 9: the game has the seats 0 to 3",
        ),
    ] {
        let error = figure_at(&lines, eyes, decision).unwrap_err();
        assert_eq!(error.to_string(), words);
    }
    for eyes in [Eyes::Spectator, Eyes::Seat((own + 1) % 4)] {
        let error = figure_at(&lines, eyes, 7).unwrap_err();
        assert_eq!(error, FilmError::HandNotSeen { decision: 7, seat });
    }
}

#[test]
fn names_of_every_kind_fit_and_break_nothing() {
    let rules = rules(6, 15);
    let painter = Painter::new();
    let long = "Wilhelmina ".repeat(40);
    let names = [
        long.as_str(),
        "<b>&\"'</b>]]>",
        "a\u{0}\u{1b}[31m\u{202e}b\u{ffff}",
        "料理長のとても長い名前",
        "",
        "Žofie Łączyńska-Ångström",
    ];
    let viewer = Viewer::Seat(Seat::new(0));
    let game = Game::new(rules, Seed([3; 32]), |_| {});
    let known = BySeat::filled(6, true);
    let scene = Scene::of(&game, &chronicle(&rules, &names, viewer), viewer, &known);
    let svg = painter.table(&scene);
    assert!(svg.contains("Wilhelmina Wi") && svg.contains("…<"));
    assert!(!svg.contains(&"Wilhelmina ".repeat(3)), "it is cut");
    assert!(!svg.contains("<b>") && !svg.contains('\u{202e}') && !svg.contains('\u{0}'));
    assert!(svg.contains("Žofie Łączyńska") && svg.contains("seat 4"));
    let picture = painter.pixels(&svg, WIDTH).unwrap();
    assert_eq!((picture.width(), picture.height()), (WIDTH, 200));
}

#[test]
fn a_picture_is_the_same_every_time() {
    let film = film("committed.jsonl", Eyes::Seat(1));
    let scene = &film.at(When::Decision(120)).unwrap().scene;
    let picture = || {
        let painter = Painter::new();
        let svg = painter.table(scene);
        let pixels = painter.pixels(&svg, WIDTH).unwrap();
        let png = painter.png(&pixels).unwrap();
        (painter.outlined(&svg, WIDTH).unwrap(), svg, png)
    };
    let (outlined, svg, png) = picture();
    assert_eq!((outlined.clone(), svg, png.clone()), picture());
    assert!(!outlined.contains("<text"), "all text is outlines");
    assert!(outlined.starts_with(
        r#"<svg viewBox="0 0 1280 800" width="320" height="200" xmlns="http://www.w3.org/2000/svg""#
    ));
    let decoded = Pixmap::decode_png(&png).unwrap();
    assert_eq!((decoded.width(), decoded.height()), (320, 200));
    assert!(decoded.pixels().iter().all(|pixel| pixel.is_opaque()));

    let painter = Painter::new();
    for width in [0, 159, 8001, u32::MAX] {
        assert_eq!(
            painter.pixels(&outlined, width).unwrap_err().to_string(),
            format!("a picture is 160 to 8000 pixels wide, not {width}")
        );
    }
}

/// Whoever changes a drawing on purpose looks at it, then puts the new text in the place of the old.
#[test]
fn the_drawings_are_those_that_were_looked_at() {
    let lines = Making::dealt(rules(2, 4), 6, 2).record(|_| v1::DecisionSource::Agent);
    let painter = Painter::new();
    let film = Film::new(&lines, Eyes::Seat(0)).unwrap();
    let table = painter.table(&film.at(When::Decision(2)).unwrap().scene);
    let figure = painter.figure(&figure_at(&lines, Eyes::All, 2).unwrap());
    for (name, drawn, expected) in [
        (
            "picture-table.svg",
            table,
            include_str!("picture-table.svg"),
        ),
        (
            "picture-figure.svg",
            figure,
            include_str!("picture-figure.svg"),
        ),
    ] {
        if drawn != expected {
            let new = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
            std::fs::write(&new, drawn).unwrap();
            panic!("{name} has changed: the new one is {}", new.display());
        }
    }
}

#[test]
fn a_gif_has_a_frame_for_every_change_and_keeps_the_colours() {
    let film = film("fixed.jsonl", Eyes::All);
    let painter = Painter::new();
    let frames = film.range(1..=4).unwrap();
    let mut pictures: Vec<Pixmap> = frames
        .iter()
        .map(|frame| painter.pixels(&painter.table(&frame.scene), WIDTH).unwrap())
        .collect();
    // A picture that stands still makes the one before last longer.
    pictures.insert(2, pictures[1].clone());
    let mut writer = GifWriter::new(Vec::new(), WIDTH, 200, Palette::of(&pictures)).unwrap();
    for picture in &pictures {
        writer.add(picture, 40).unwrap();
    }
    let other = Pixmap::new(10, 10).unwrap();
    assert!(writer.add(&other, 1).is_err(), "of another size");
    let bytes = writer.finish().unwrap();

    let mut options = gif::DecodeOptions::new();
    options.set_color_output(gif::ColorOutput::RGBA);
    let mut decoder = options.read_info(Cursor::new(bytes)).unwrap();
    assert_eq!((decoder.width(), decoder.height()), (320, 200));
    let mut canvas = vec![0; 320 * 200 * 4];
    let mut delays = Vec::new();
    let shown = [0, 2, 3, 4];
    while let Some(frame) = decoder.read_next_frame().unwrap() {
        let (left, top) = (usize::from(frame.left), usize::from(frame.top));
        let width = usize::from(frame.width);
        for (index, pixel) in frame.buffer.chunks(4).enumerate() {
            let at = 4 * ((top + index / width) * 320 + left + index % width);
            if pixel[3] > 0 {
                canvas[at..at + 4].copy_from_slice(pixel);
            }
        }
        let picture = pictures[shown[delays.len()]].data();
        let apart: u64 = picture
            .iter()
            .zip(&canvas)
            .map(|(a, b)| u64::from(a.abs_diff(*b)))
            .sum();
        let mean = apart as f64 / canvas.len() as f64;
        assert!(mean < 3.0, "frame {}: {mean}", delays.len());
        delays.push(frame.delay);
    }
    assert_eq!(delays, [40, 80, 40, 40]);
}
