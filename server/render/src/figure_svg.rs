//! The layout and text of the action table, rendered by `templates/figure.svg`.

use std::collections::BTreeSet;

use chefshat_engine::Requirement;
use serde::Serialize;

use super::chronicle::ParticipantKind;
use super::figure::{Figure, State};
use super::paint::Painter;
use super::scene::Hand;
use super::table::hand::{Label, Placed, Sprite, SpriteDefinition, lay_out};

/// Width of the picture, SVG units.
const WIDTH: f32 = 1280.0;
/// Margin.
const GAP: f32 = 24.0;
/// Width of the column of faces.
const HEAD: f32 = 92.0;
/// Top of the first row.
const TOP: f32 = 262.0;
/// Height of all rows together.
const ROWS: f32 = 500.0;
/// The largest height of a row.
const ROW: f32 = 46.0;
/// Height below the table.
const BELOW: f32 = 148.0;
/// Width of the board.
const BOARD: f32 = 400.0;

#[derive(Serialize)]
struct Page {
    width: f32,
    height: f32,
    title: String,
    subtitle: String,
    cards: Vec<SpriteDefinition>,
    hand: Vec<Placed>,
    counts: Vec<Label>,
    board: Vec<Placed>,
    board_counts: Vec<Label>,
    board_x: f32,
    head: f32,
    top: f32,
    bottom: f32,
    row: f32,
    column: f32,
    cell: f32,
    jokers: u8,
    faces: Vec<u8>,
    cells: Vec<Cell>,
    others: Vec<Other>,
}

#[derive(Serialize)]
struct Cell {
    x: f32,
    y: f32,
    state: &'static str,
}

#[derive(Serialize)]
struct Other {
    x: f32,
    width: f32,
    text: String,
    state: &'static str,
}

impl Painter {
    /// Draws an action table as SVG. Its text needs the embedded font; see [`Painter::outlined`].
    pub fn figure(&self, figure: &Figure) -> String {
        let faces = f32::from(figure.faces);
        let row = (ROWS / faces).min(ROW).floor();
        let column = ((WIDTH - GAP - GAP - HEAD) / faces).floor();
        let cell = (column - 6.0) / f32::from(figure.jokers + 1);
        let bottom = TOP + row * faces;
        let hand = Hand::Open(figure.hand.clone());
        let (hand, counts) = lay_out(&hand, WIDTH - BOARD - 4.0 * GAP);
        let (board, board_counts) = lay_out(&Hand::Open(figure.board.clone()), BOARD);
        let cards: BTreeSet<Sprite> = hand.iter().chain(&board).map(|card| card.sprite).collect();
        let page = Page {
            width: WIDTH,
            height: bottom + BELOW,
            title: self.title(figure),
            subtitle: subtitle(figure),
            cards: cards.into_iter().map(Sprite::definition).collect(),
            hand,
            counts,
            board,
            board_counts,
            board_x: WIDTH - BOARD - GAP,
            head: GAP + HEAD,
            top: TOP,
            bottom,
            row,
            column,
            cell,
            jokers: figure.jokers,
            faces: (1..=figure.faces).collect(),
            cells: cells(figure, row, column, cell),
            others: self.others(figure),
        };
        self.fill("figure.svg", &page)
    }

    fn title(&self, figure: &Figure) -> String {
        let name = match figure.participant.name.as_str() {
            "" => format!("seat {}", figure.seat),
            name => name.to_owned(),
        };
        let name = self.fit(&name, 26.0, true, 520.0);
        let what = match &figure.participant.kind {
            ParticipantKind::Unspecified => "player",
            ParticipantKind::Person => "person",
            ParticipantKind::Robot => "robot",
            ParticipantKind::Model => "language model",
            ParticipantKind::Agent => "agent",
            ParticipantKind::BuiltIn(_) => "built-in agent",
        };
        format!("Actions of {name} ({what}, seat {})", figure.seat)
    }

    /// The actions outside the table, side by side.
    fn others(&self, figure: &Figure) -> Vec<Other> {
        const SPACE: f32 = 10.0;
        let item = |text: &str, state| (text.to_owned(), Some(state));
        let mut items = vec![item("pass", figure.pass)];
        items.extend(figure.lone_joker.map(|state| item("joker alone", state)));
        if !figure.gives.is_empty() {
            items.push(("give".to_owned(), None));
        }
        for (index, &state) in figure.gives.iter().enumerate() {
            if index < usize::from(figure.faces) {
                items.push(item(&(index + 1).to_string(), state));
            } else {
                items.push(item("J", state));
            }
        }
        let special = ["declare", "decline"].into_iter().zip(&figure.special);
        items.extend(special.map(|(text, &state)| item(text, state)));
        let natural: Vec<f32> = items
            .iter()
            .map(|(text, state)| {
                self.width(text, 15.0, true) + if state.is_some() { 44.0 } else { 8.0 }
            })
            .collect();
        let spaces = SPACE * (items.len() - 1) as f32;
        let room = WIDTH - 2.0 * GAP - spaces;
        let shrink = (room / natural.iter().sum::<f32>()).min(1.0);
        let mut x = GAP;
        items
            .into_iter()
            .zip(natural)
            .map(|((text, state), natural)| {
                let width = natural * shrink;
                let left = x;
                x += width + SPACE;
                Other {
                    x: left,
                    width,
                    text,
                    state: state.map_or("", class),
                }
            })
            .collect()
    }
}

fn cells(figure: &Figure, row: f32, column: f32, cell: f32) -> Vec<Cell> {
    let mut cells = Vec::new();
    for (face, quantities) in figure.plays.iter().enumerate() {
        for (quantity, jokers) in quantities.iter().enumerate() {
            for (joker, &state) in jokers.iter().enumerate() {
                cells.push(Cell {
                    x: GAP + HEAD + quantity as f32 * column + joker as f32 * cell,
                    y: TOP + face as f32 * row,
                    state: class(state),
                });
            }
        }
    }
    cells
}

fn class(state: State) -> &'static str {
    match state {
        State::Impossible => "impossible",
        State::NotAllowed => "not-allowed",
        State::NotInHand => "not-in-hand",
        State::Legal => "legal",
    }
}

fn subtitle(figure: &Figure) -> String {
    let moment = if figure.pizza == 0 {
        format!("Shift {}, before the first pizza", figure.shift)
    } else {
        format!("Shift {}, pizza {}", figure.shift, figure.pizza)
    };
    let required = match figure.requirement {
        Requirement::Gift(_) => "one card must be given".to_owned(),
        Requirement::SpecialAction(_) => "a special action may be declared".to_owned(),
        Requirement::Play(play) => match play.highest_face {
            _ if play.lone_joker => "the board is empty, any play opens the pizza".to_owned(),
            face if play.golden_card => format!("face {face} with the Golden card opens the Shift"),
            face if play.is_opening() => format!("face {face} opens the Shift"),
            0 => "nothing beats the board".to_owned(),
            face => format!(
                "face {face} or rarer beats the board, {} or more cards",
                play.fewest_cards
            ),
        },
    };
    let legal = match figure.legal {
        1 => "1 action is legal".to_owned(),
        legal => format!("{legal} actions are legal"),
    };
    format!("{moment}: {required}; {legal}.")
}
