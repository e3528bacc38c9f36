//! Drawings are complete and deterministic for all names and cards.

use std::io::Cursor;
use std::path::Path;

use chefshat_engine::{BySeat, Game, Seat, Seed, Viewer};
use chefshat_proto::v1::{self, game_event::Kind};
use chefshat_record::words;
use chefshat_render::{Film, GifWriter, Painter, Palette, Perspective, Scene, When, figure_at};
use resvg::tiny_skia::Pixmap;

use super::{chronicle, film, rules};
use chefshat_record::testing::TestGame;

/// Width of the pictures, pixels; small, to be fast.
const WIDTH: u32 = 320;

#[test]
fn names_of_every_kind_fit_and_break_nothing() {
    let rules = rules(6, 15);
    let painter = Painter::new();
    let long = "Wilhelmina ".repeat(40);
    let names = [
        long.as_str(),
        "<b>&\"'</b>]]>",
        "a\u{0}\u{1b}[31m\u{202e}b\u{ffff}",
        "料理長\u{3000}Ὀρέστης 👩🏽‍🍳",
        "",
        "Žofie Łączyńska-Ångström, Nguyễn Thị Hoa\u{301}",
    ];
    let viewer = Viewer::Seat(Seat::new(0));
    let game = Game::new(rules, Seed([3; 32]), |_| {});
    let known = BySeat::filled(6, true);
    let scene = Scene::of(&game, &chronicle(&rules, &names, viewer), viewer, &known);
    let svg = painter.table(&scene);
    assert!(svg.contains("Wilhelmina Wi") && svg.contains("…<"));
    assert!(!svg.contains(&"Wilhelmina ".repeat(3)), "it is shortened");
    assert!(!svg.contains("<b>") && !svg.contains('\u{202e}') && !svg.contains('\u{0}'));
    assert!(svg.contains("Žofie Łączyńska") && svg.contains("seat 4"));
    assert!(svg.contains("??? ??????? ???"), "replaced characters");
    let picture = painter.pixels(&svg, WIDTH).unwrap();
    assert_eq!((picture.width(), picture.height()), (WIDTH, 200));
}

#[test]
fn a_letter_that_the_font_lacks_is_drawn_as_its_base_letter() {
    let rules = rules(2, 4);
    let painter = Painter::new();
    let viewer = Viewer::Spectator;
    let game = Game::new(rules, Seed([3; 32]), |_| {});
    let known = BySeat::filled(2, true);
    for (name, expected) in [
        ("Žofie Łączyńska-Ångström", "Žofie Łączyńska-Ångström"),
        // The font has a letter and its mark, composed or not.
        ("Jose\u{301}", "Jose\u{301}"),
        // The font lacks the composed letter and the mark of a dot below.
        ("Nguyễn Thị", "Nguye\u{302}\u{303}n Thi"),
        ("Ana\u{323}", "Ana"),
        ("料理\u{3000}長", "?? ?"),
        ("Ορέστης", "???????"),
        ("👩🏽\u{200d}🍳\u{fe0f} Ana", "??? Ana"),
    ] {
        let named = chronicle(&rules, &[name, "Pepper"], viewer);
        let svg = painter.table(&Scene::of(&game, &named, viewer, &known));
        assert!(svg.contains(&format!(">{expected}<")), "{name}: {svg}");
    }
}

#[test]
fn what_a_participant_says_and_what_the_server_decides_are_in_the_words_of_other_texts() {
    let rules = rules(2, 4);
    let viewer = Viewer::Spectator;
    let mut log = chronicle(&rules, &["Ana", "Pepper"], viewer);
    let shown = |expression| {
        Kind::ExpressionShown(Box::new(v1::ExpressionShown {
            seat: 1,
            expression: Some(expression),
        }))
    };
    log.note(&shown(words::said("a < b, or not?")));
    log.note(&shown(v1::Expression {
        label: "joy".into(),
        ..v1::Expression::default()
    }));
    for source in [
        v1::DecisionSource::Timeout,
        v1::DecisionSource::Substitute,
        v1::DecisionSource::Agent,
    ] {
        log.note(&Kind::Pass(v1::Pass {
            seat: 1,
            source: source.into(),
            ..v1::Pass::default()
        }));
    }
    let game = Game::new(rules, Seed([3; 32]), |_| {});
    let scene = Scene::of(&game, &log, viewer, &BySeat::filled(2, true));
    let svg = Painter::new().table(&scene);
    for text in [
        "says “a &lt; b, or not?”",
        "shows joy",
        "passes (too late)",
        "passes (substitute)",
        "passes<",
    ] {
        assert!(svg.contains(text), "{text}: {svg}");
    }
}

#[test]
fn pictures_are_deterministic() {
    let film = film("committed.jsonl", Perspective::Seat(1));
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
            format!("the width must be 160 to 8000 pixels, not {width}")
        );
    }
}

/// After an intended change, look at the new drawings and replace the files.
#[test]
fn drawings_equal_the_reviewed_ones() {
    let lines = TestGame::dealt(rules(2, 4), 6, 2).record(|_| v1::DecisionSource::Agent);
    let painter = Painter::new();
    let film = Film::new(&lines, Perspective::Seat(0)).unwrap();
    let table = painter.table(&film.at(When::Decision(2)).unwrap().scene);
    let figure = painter.figure(&figure_at(&lines, Perspective::All, 2).unwrap());
    for (name, drawn, expected) in [
        ("picture-table.svg", table, include_str!("table.svg")),
        ("picture-figure.svg", figure, include_str!("figure.svg")),
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
    let film = film("fixed.jsonl", Perspective::All);
    let painter = Painter::new();
    let frames = film.range(1..=4).unwrap();
    let mut pictures: Vec<Pixmap> = frames
        .iter()
        .map(|frame| painter.pixels(&painter.table(&frame.scene), WIDTH).unwrap())
        .collect();
    // A repeated picture extends the delay of the one before.
    pictures.insert(2, pictures[1].clone());
    let mut writer = GifWriter::new(Vec::new(), WIDTH, 200, Palette::of(&pictures)).unwrap();
    for picture in &pictures {
        writer.add(picture, 40).unwrap();
    }
    let other = Pixmap::new(10, 10).unwrap();
    assert!(writer.add(&other, 1).is_err(), "another size");
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
