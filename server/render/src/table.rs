//! The layout and text of the table picture, rendered by `templates/table.svg`.

pub(super) mod hand;
mod words;

use std::collections::BTreeSet;

use chefshat_engine::{Role, Seat};
use chefshat_record::words::ordinal;
use serde::Serialize;

use super::chronicle::{ParticipantKind, Presence};
use super::paint::Painter;
use super::scene::{Now, Scene, SeatScene};
use hand::{Label, Placed, Sprite, SpriteDefinition};
use words::{COLUMN, SPACE};

/// Width of the picture, SVG units.
const WIDTH: f32 = 1280.0;
/// Height of the picture, SVG units.
const HEIGHT: f32 = 800.0;
/// Space at the edges and between the panels of the seats.
const GAP: f32 = 14.0;
/// Top of the upper row of panels.
const UPPER: f32 = 62.0;
/// Height of a panel.
const PANEL: f32 = 186.0;
/// Top of the lower row of panels.
const LOWER: f32 = HEIGHT - GAP - PANEL;
/// Centre of the board.
const BOARD: (f32, f32) = (WIDTH / 2.0, (UPPER + PANEL + LOWER) / 2.0);
/// Width available to the cards on the board.
const BOARD_WIDTH: f32 = 470.0;
/// The most cards in a row on the board.
const BOARD_ROW: usize = 9;
/// Width beside a name: number, chip and points.
const BESIDE_NAME: f32 = 218.0;
/// Width beside the line below the name, without the role: symbol and points.
const BESIDE_LABEL: f32 = 76.0 + 66.0;
/// Left edge of the caption.
const CAPTION: f32 = 182.0;

#[derive(Serialize)]
struct Table {
    width: f32,
    height: f32,
    caption: String,
    title: String,
    perspective: String,
    cards: Vec<SpriteDefinition>,
    seats: Vec<Panel>,
    board: Board,
    log: Vec<Line>,
    now: words::Notice,
    played: Vec<Played>,
    column: f32,
}

#[derive(Serialize)]
struct Panel {
    x: f32,
    y: f32,
    width: f32,
    height: f32,
    number: usize,
    name: String,
    kind: &'static str,
    label: String,
    role: Option<RoleBadge>,
    points: u64,
    chip: Option<Chip>,
    deciding: bool,
    passed: bool,
    place: String,
    cards: Vec<Placed>,
    counts: Vec<Label>,
}

#[derive(Serialize)]
struct RoleBadge {
    symbol: &'static str,
    name: &'static str,
    width: f32,
}

#[derive(Serialize)]
struct Chip {
    class: &'static str,
    text: String,
    width: f32,
}

#[derive(Serialize)]
struct Board {
    x: f32,
    y: f32,
    cards: Vec<Placed>,
    scale: f32,
    text: String,
}

#[derive(Serialize)]
struct Played {
    face: String,
    count: u8,
    all: u8,
    x: f32,
    y: f32,
}

#[derive(Serialize)]
struct Line {
    seat: Option<usize>,
    name: String,
    text: String,
    y: f32,
    newest: bool,
}

impl Painter {
    /// Draws a scene as SVG. Its text needs the embedded font; see [`Painter::outlined`].
    pub fn table(&self, scene: &Scene) -> String {
        let places = places(scene);
        let seats: Vec<Panel> = scene
            .seats
            .iter()
            .enumerate()
            .map(|(seat, shown)| panel(self, scene, seat, shown, places[seat]))
            .collect();
        let board = board(self, scene);
        let cards: BTreeSet<Sprite> = seats
            .iter()
            .flat_map(|panel| &panel.cards)
            .chain(&board.cards)
            .map(|placed| placed.sprite)
            .collect();
        let title = words::title(scene);
        let beside_title = (WIDTH - self.width(&title, 24.0, true)) / 2.0 - CAPTION - 2.0 * GAP;
        let table = Table {
            width: WIDTH,
            height: HEIGHT,
            caption: self.fit(&scene.caption, 18.0, false, beside_title),
            title,
            perspective: words::perspective(self, scene),
            cards: cards.into_iter().map(Sprite::definition).collect(),
            seats,
            board,
            log: log(self, scene),
            now: words::notice(self, scene),
            played: played(scene),
            column: COLUMN,
        };
        self.fill("table.svg", &table)
    }
}

/// Left edge, top and width of each seat's panel. Play goes clockwise.
fn places(scene: &Scene) -> Vec<(f32, f32, f32)> {
    let players = scene.seats.len();
    let lower = (players / 2).max(1);
    let upper = players - lower;
    let row = |count: usize, y: f32| {
        let count = count.max(1);
        let width = (WIDTH - GAP * (count as f32 + 1.0)) / count as f32;
        (0..count).map(move |index| (GAP + index as f32 * (width + GAP), y, width))
    };
    // Clockwise from the left half of the lower row.
    let lower: Vec<_> = row(lower, LOWER).collect();
    let first = (lower.len() - 1) / 2;
    let mut round: Vec<_> = lower[..=first].iter().rev().copied().collect();
    round.extend(row(upper, UPPER));
    round.extend(lower[first + 1..].iter().rev().copied());
    let front = match scene.viewer {
        chefshat_engine::Viewer::Seat(seat) => seat.index(),
        _ => 0,
    };
    (0..players)
        .map(|seat| round[(seat + players - front % players) % players])
        .collect()
}

fn panel(
    painter: &Painter,
    scene: &Scene,
    number: usize,
    shown: &SeatScene,
    (x, y, width): (f32, f32, f32),
) -> Panel {
    let name = words::name(scene, Seat::new(number));
    let (cards, counts) = hand::lay_out(&shown.hand, width - 2.0 * hand::MARGIN);
    let role = shown.role.map(|role| role_badge(painter, role));
    let beside = role.as_ref().map_or(0.0, |role| role.width + 10.0);
    let (kind, label) = label(painter, shown, width - BESIDE_LABEL - beside);
    Panel {
        x,
        y,
        width,
        height: PANEL,
        number,
        name: painter.fit(&name, 22.0, true, width - BESIDE_NAME),
        kind,
        label,
        role,
        points: shown.points,
        chip: chip(painter, scene, shown),
        deciding: shown.deciding,
        passed: shown.passed && shown.place == 0,
        place: match shown.place {
            0 => String::new(),
            place if matches!(scene.now, Now::GameOver(_)) => {
                format!("{} in the game", ordinal(place.into()))
            }
            place => format!("{} to finish", ordinal(place.into())),
        },
        cards,
        counts,
    }
}

/// The symbol and label of a participant: kind and number of cards. Shortened if too wide.
fn label(painter: &Painter, shown: &SeatScene, width: f32) -> (&'static str, String) {
    let participant = &shown.participant;
    let (symbol, what, short) = match &participant.kind {
        ParticipantKind::Unspecified => ("kind-open", "player".to_owned(), "player"),
        ParticipantKind::Person => ("kind-person", "person".to_owned(), "person"),
        ParticipantKind::Robot => ("kind-robot", "robot".to_owned(), "robot"),
        ParticipantKind::Model => ("kind-model", "model".to_owned(), "model"),
        ParticipantKind::Agent => ("kind-agent", "agent".to_owned(), "agent"),
        ParticipantKind::BuiltIn(agent) => {
            ("kind-built-in", format!("built-in {agent}"), agent.as_str())
        }
    };
    let (symbol, long, short) = match &participant.presence {
        Presence::Connected => (symbol, what, short.to_owned()),
        Presence::Disconnected => (
            symbol,
            format!("{what}, disconnected"),
            format!("{short}, away"),
        ),
        Presence::Substituted(agent) => (
            "kind-built-in",
            format!("{agent} for disconnected {what}"),
            format!("{agent} for {short}"),
        ),
    };
    let held = format!(" · {}", words::held(&shown.hand));
    let room = width - painter.width(&held, 15.0, false) - SPACE;
    let long = painter.fit(&long, 15.0, false, f32::INFINITY);
    let what = if painter.width(&long, 15.0, false) <= room {
        long
    } else {
        painter.fit(&short, 15.0, false, room)
    };
    (symbol, what + &held)
}

fn role_badge(painter: &Painter, role: Role) -> RoleBadge {
    let symbol = match role {
        Role::Chef => "role-chef",
        Role::SousChef => "role-sous-chef",
        Role::Cook => "role-cook",
        Role::Waiter => "role-waiter",
        Role::Dishwasher => "role-dishwasher",
    };
    RoleBadge {
        symbol,
        name: role.name(),
        width: painter.width(role.name(), 15.0, false) + 28.0,
    }
}

fn chip(painter: &Painter, scene: &Scene, shown: &SeatScene) -> Option<Chip> {
    let (class, text) = if shown.place > 0 {
        ("placed", ordinal(shown.place.into()))
    } else if shown.deciding {
        ("deciding", words::to_decide(&scene.now).to_owned())
    } else if shown.passed {
        ("passed", "passed".to_owned())
    } else {
        return None;
    };
    Some(Chip {
        class,
        width: painter.width(&text, 15.0, true) + 22.0,
        text,
    })
}

fn board(painter: &Painter, scene: &Scene) -> Board {
    let (cards, scale) = hand::spread(&scene.board, BOARD_ROW, BOARD_WIDTH, BOARD);
    let text = match (scene.board.as_slice(), scene.board_by) {
        ([], _) => String::new(),
        (cards, None) => words::play(cards),
        (cards, Some(by)) => {
            let play = words::play(cards);
            let room = 300.0 - painter.width(&play, 18.0, true);
            let name = words::short_name(painter, scene, by, (18.0, true), room);
            format!("{play} · {name}")
        }
    };
    Board {
        x: BOARD.0,
        y: BOARD.1,
        cards,
        scale,
        text,
    }
}

fn log(painter: &Painter, scene: &Scene) -> Vec<Line> {
    const STEP: f32 = 29.0;
    let newest = scene.log.len().saturating_sub(1);
    scene
        .log
        .iter()
        .enumerate()
        .map(|(index, entry)| {
            let (seat, text) = words::log_entry(painter, scene, entry);
            let name = seat.map_or_else(String::new, |seat| {
                painter.fit(&words::name(scene, seat), 16.0, true, 104.0)
            });
            let used = if name.is_empty() {
                0.0
            } else {
                painter.width(&name, 16.0, true) + SPACE
            };
            Line {
                seat: seat.map(Seat::index),
                text: painter.fit(&text, 16.0, false, COLUMN - 56.0 - used),
                name,
                y: index as f32 * STEP,
                newest: index == newest,
            }
        })
        .collect()
}

/// The cards played by face, in two rows.
fn played(scene: &Scene) -> Vec<Played> {
    let per_row = scene.played.len().div_ceil(2).max(1);
    let step = (COLUMN - 24.0) / per_row as f32;
    let cell = |(index, &(count, all)): (usize, &(u8, u8))| Played {
        face: if index < usize::from(scene.faces) {
            (index + 1).to_string()
        } else {
            "J".to_owned()
        },
        count,
        all,
        x: 12.0 + ((index % per_row) as f32 + 0.5) * step,
        y: (index / per_row) as f32 * 38.0,
    };
    scene.played.iter().enumerate().map(cell).collect()
}

#[cfg(test)]
mod tests {
    use crate::chronicle::Participant;
    use crate::scene::Hand;
    use crate::table::*;

    #[test]
    fn labels_do_not_overlap_roles_or_points() {
        let painter = Painter::new();
        let kinds = [
            ParticipantKind::Unspecified,
            ParticipantKind::Robot,
            ParticipantKind::BuiltIn("random".to_owned()),
            ParticipantKind::BuiltIn("a built-in agent of a long name".to_owned()),
        ];
        let presences = [
            Presence::Connected,
            Presence::Disconnected,
            Presence::Substituted("greedy".to_owned()),
        ];
        let roles = [
            None,
            Some(Role::Chef),
            Some(Role::SousChef),
            Some(Role::Dishwasher),
        ];
        // Three, two and one in a row.
        for (panel, kind, presence, role, cards) in [408.0, 619.0, 1252.0]
            .into_iter()
            .flat_map(|panel| kinds.iter().map(move |kind| (panel, kind)))
            .flat_map(|(panel, kind)| presences.iter().map(move |there| (panel, kind, there)))
            .flat_map(|(panel, kind, there)| roles.map(|role| (panel, kind, there, role)))
            .flat_map(|(panel, kind, there, role)| {
                [0, 22].map(|cards| (panel, kind, there, role, cards))
            })
        {
            let badge = role.map(|role| role_badge(&painter, role));
            let beside = badge.as_ref().map_or(0.0, |badge| badge.width + 10.0);
            let shown = SeatScene {
                participant: Participant {
                    name: String::new(),
                    kind: kind.clone(),
                    presence: presence.clone(),
                },
                role,
                points: 0,
                hand: Hand::Hidden(cards),
                passed: false,
                place: 0,
                deciding: false,
            };
            let (_, text) = label(&painter, &shown, panel - BESIDE_LABEL - beside);
            let right = 76.0 + painter.width(&text, 15.0, false);
            let role_begins = panel - 66.0 - badge.map_or(0.0, |badge| badge.width);
            assert!(right <= role_begins, "{panel}: {text} {role:?}");
            let held = words::held(&shown.hand);
            assert!(text.ends_with(&held), "{text}");
            if *presence == Presence::Connected
                && *kind == ParticipantKind::BuiltIn("random".to_owned())
            {
                assert!(!text.contains('…'), "{panel}: {text}");
            }
        }
    }
}
