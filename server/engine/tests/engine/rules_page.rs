//! `docs/rules.md` agrees with the engine: the sections that source code cites exist, and the
//! engine plays the example Shift.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use chefshat_engine::{Cards, Event, Game};

use crate::start::{second_shift, spec};
use crate::support::{act, cards};

const FACES: u8 = 5;

fn repository() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn page() -> String {
    fs::read_to_string(repository().join("docs/rules.md")).unwrap()
}

/// The cells of the table whose first column has this heading.
fn table<'a>(page: &'a str, first_column: &str) -> Vec<Vec<&'a str>> {
    let heading = format!("| {first_column} |");
    page.lines()
        .skip_while(|line| !line.starts_with(&heading))
        .skip(2)
        .take_while(|line| line.starts_with('|'))
        .map(|line| {
            let cells = line.trim_matches('|').split('|');
            cells.map(str::trim).collect()
        })
        .collect()
}

/// Cards as the page writes them: `4 5★ joker`, and words after a comma.
fn hand(cell: &str) -> Cards {
    let (list, _) = cell.split_once(',').unwrap_or((cell, ""));
    let line = list.replace("5★", "G").replace("joker", "J");
    cards(FACES, &line)
}

fn play_text(cell: &str) -> String {
    if cell == "pass" {
        return cell.to_owned();
    }
    let play = hand(cell);
    match play.rarest() {
        None => "C0;Q0;J1".to_owned(),
        Some(face) => format!("C{face};Q{};J{}", play.count(face), play.jokers()),
    }
}

/// Adds the sections cited in the source files below a folder.
fn cited(folder: &Path, sections: &mut BTreeSet<String>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        if path.is_dir() {
            if !name.starts_with('.') && !["target", "node_modules", "dist"].contains(&&*name) {
                cited(&path, sections);
            }
            continue;
        }
        let is_source = ["rs", "proto", "py", "ts", "tsx"]
            .iter()
            .any(|extension| path.extension().is_some_and(|own| own == *extension));
        if !is_source {
            continue;
        }
        let text = fs::read_to_string(&path).unwrap();
        for part in text.split('§').skip(1) {
            let number: String = part
                .chars()
                .take_while(|c| c.is_ascii_digit() || *c == '.')
                .collect();
            if !number.is_empty() {
                sections.insert(number.trim_end_matches('.').to_owned());
            }
        }
    }
}

#[test]
fn cited_sections_exist() {
    let page = page();
    let headings: BTreeSet<&str> = page
        .lines()
        .filter(|line| line.starts_with("## ") || line.starts_with("### "))
        .filter_map(|line| line.split_whitespace().nth(1))
        .map(|number| number.trim_end_matches('.'))
        .collect();
    let mut sections = BTreeSet::new();
    for folder in ["server", "proto", "client-rs", "clients"] {
        cited(&repository().join(folder), &mut sections);
    }
    assert!(sections.len() > 10, "only {sections:?} are cited");
    let missing: Vec<_> = sections
        .iter()
        .filter(|section| !headings.contains(section.as_str()))
        .collect();
    assert!(missing.is_empty(), "docs/rules.md has no {missing:?}");
}

#[test]
fn the_engine_plays_the_example_shift() {
    let page = page();
    let seats = table(&page, "player");
    let dealt: Vec<String> = seats
        .iter()
        .map(|row| row[2].replace("5★", "G").replace("joker", "J"))
        .collect();
    let lines: Vec<&str> = dealt.iter().map(String::as_str).collect();
    let (mut game, _) = second_shift(&spec(4, FACES), &lines, &[0, 1, 2, 3]);

    let chosen = [hand(seats[0][3]), hand(seats[1][3])];
    let mut events = Vec::new();
    for gift in chosen.iter().flat_map(|gift| gift.ascending(FACES)) {
        events = act(&mut game, &format!("give C{gift}"));
    }
    assert_eq!(events.len(), 4, "the exchange is complete");
    for (row, (seat, held)) in seats.iter().zip(game.hands().iter()) {
        assert_eq!(game.gave()[seat], hand(row[3]));
        assert_eq!(game.received()[seat], hand(row[4]));
        assert_eq!(*held, hand(row[5]));
    }

    let turns = table(&page, "pizza");
    let mut places = Vec::new();
    for (number, row) in turns.iter().enumerate() {
        let (seat, view) = open_turn(&game);
        assert_eq!([row[0], row[1]], [&*view, seats[seat][0]], "turn {number}");
        events = act(&mut game, &play_text(row[2]));
        let finished = |event: &Event| matches!(event, Event::SeatFinished { .. });
        assert_eq!(events.iter().any(finished), row[3].contains(" place**"));
        places.extend(events.iter().filter_map(|event| match event {
            Event::ShiftEnded(end) => Some((end.order, end.points)),
            _ => None,
        }));
    }
    let [(order, points)] = places[..] else {
        panic!("the Shift ends once")
    };
    let names: Vec<&str> = order
        .as_slice()
        .iter()
        .map(|seat| seats[seat.index()][0])
        .collect();
    assert_eq!(names, ["Ada", "Ben", "Dan", "Cleo"]);
    assert_eq!(points.as_slice(), [5, 3, 0, 1]);
    assert!(page.contains("Ada scores 5 points, Ben 3, Dan 1 and Cleo 0."));
}

/// The seat whose turn it is, and the number of the pizza.
fn open_turn(game: &Game) -> (usize, String) {
    let seat = game.decision().unwrap().seat;
    let pizza = game.observe(chefshat_engine::Viewer::Spectator).pizza;
    (seat.index(), pizza.to_string())
}
