//! The content of a picture: seats, hands, board and the open decision, redacted for one viewer
//! (by `Event::seen_by`). No geometry, colours or text: those are in `table`. Records become
//! scenes in `film`.

use chefshat_engine::{
    BySeat, Cards, DecisionKind, Event, Game, Opening, PlayRequirement, Requirement, Role, Seat,
    SpecialAction, Standings, Viewer,
};

use super::card::Card;
use super::chronicle::{Chronicle, LogEntry, Participant};

/// A moment of a game, redacted for one viewer.
#[derive(Debug, Clone, PartialEq)]
pub struct Scene {
    /// Name of the room or of the record.
    pub caption: String,
    /// The viewer.
    pub viewer: Viewer,
    /// Number of the open decision in the game, from 1. Only with all hands open: to other
    /// viewers, a gap in the numbers would reveal a declined special action.
    pub decision: Option<u64>,
    /// Number of faces F of the deck.
    pub faces: u8,
    /// Number of the Shift, from 1.
    pub shift: u32,
    /// Number of the pizza in its Shift, from 1; 0 before the Shift's first turn is open.
    pub pizza: u32,
    /// Number of the open turn in its Shift, from 1.
    pub turn: u32,
    /// The seats, index = seat.
    pub seats: Vec<SeatScene>,
    /// The cards on the board.
    pub board: Vec<Card>,
    /// The seat that played them, if known.
    pub board_by: Option<Seat>,
    /// Cards played in this Shift and cards in the deck, by face from 1, then jokers if the deck
    /// has any.
    pub played: Vec<(u8, u8)>,
    /// The open decision or the result.
    pub now: Now,
    /// The last events, newest last.
    pub log: Vec<LogEntry>,
}

/// A seat in a scene.
#[derive(Debug, Clone, PartialEq)]
pub struct SeatScene {
    /// The participant.
    pub participant: Participant,
    /// The role in this Shift.
    pub role: Option<Role>,
    /// The points in the game so far.
    pub points: u64,
    /// The cards.
    pub hand: Hand,
    /// Whether it has passed in this pizza.
    pub passed: bool,
    /// Its place in this Shift, or in the game once that is over, from 1; 0 while it holds cards.
    pub place: u8,
    /// Whether it has the open decision, as far as the viewer may know.
    pub deciding: bool,
}

/// The cards of a seat.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Hand {
    /// Visible, ascending.
    Open(Vec<Card>),
    /// A number of cards the viewer may not see.
    Hidden(u8),
    /// A number of cards missing from an imported record.
    Unknown(u8),
}

/// The open decision, or the result.
#[derive(Debug, Clone, PartialEq)]
pub enum Now {
    /// Cards are dealt; the viewer may not know the open decision.
    Dealt,
    /// A seat may declare a special action.
    Special(Seat, SpecialAction),
    /// A seat gives a card to another.
    Exchange(Seat, Seat),
    /// A seat plays or passes.
    Turn {
        /// The seat.
        seat: Seat,
        /// What the rules require of the play.
        requirement: PlayRequirement,
    },
    /// The Shift has just ended.
    ShiftOver {
        /// Points of this Shift.
        points: BySeat<u32>,
        /// Whether it reached the turn limit.
        adjudicated: bool,
    },
    /// The game has ended.
    GameOver(Standings),
    /// The game ended without a result.
    Aborted,
}

impl Now {
    /// Whether a Shift or the game is over, so that no decision is open.
    pub(super) fn is_end(&self) -> bool {
        matches!(
            self,
            Now::ShiftOver { .. } | Now::GameOver(_) | Now::Aborted
        )
    }
}

impl Scene {
    /// The current scene of a game. `known` tells which hands are known at all.
    pub fn of(game: &Game, chronicle: &Chronicle, viewer: Viewer, known: &BySeat<bool>) -> Scene {
        let view = game.observe(viewer);
        let faces = view.faces;
        let deciding = game
            .decision()
            .filter(|decision| {
                decision.kind != DecisionKind::SpecialAction || sees(viewer, decision.seat)
            })
            .map(|decision| decision.seat);
        let hands = hands_seen(game, viewer);
        let seats = view
            .cards_left
            .iter()
            .map(|(seat, &cards_left)| SeatScene {
                participant: chronicle.participant(seat),
                role: view.roles[seat],
                points: view.points[seat],
                hand: match hands[seat] {
                    Some(_) if !known[seat] => Hand::Unknown(cards_left),
                    Some(hand) => Hand::Open(Card::of_hand(hand, faces)),
                    None => Hand::Hidden(cards_left),
                },
                passed: view.passed[seat],
                place: view.places[seat],
                deciding: deciding == Some(seat),
            })
            .collect();
        // In the first pizza only the opening can leave the top face on the board.
        let golden = game.rules().opening() == Opening::Golden
            && !game.rules().opening_pass()
            && view.pizza == 1
            && view.board.face == faces;
        let quantity = view.board.size - view.board.jokers;
        Scene {
            caption: chronicle.caption().to_owned(),
            viewer,
            decision: None,
            faces,
            shift: view.shift,
            pizza: view.pizza,
            turn: game.shift_turns() + 1,
            seats,
            board: Card::of_play(view.board.face, quantity, view.board.jokers, golden),
            board_by: chronicle.last_to_play().filter(|_| view.board.size > 0),
            played: view
                .played
                .counts(faces)
                .zip((1..=faces).chain([game.rules().jokers()]))
                .filter(|&(_, all)| all > 0)
                .collect(),
            now: now(game, viewer),
            log: chronicle.log().cloned().collect(),
        }
    }

    /// Unmarks the Golden card in hands that are not known to contain it.
    pub(super) fn hide_golden(&mut self, known: &BySeat<bool>) {
        for (shown, _) in self
            .seats
            .iter_mut()
            .zip(known.values())
            .filter(|(_, known)| !**known)
        {
            if let Hand::Open(cards) = &mut shown.hand {
                cards.iter_mut().for_each(|card| *card = card.plain());
            }
        }
    }
}

/// The hands a viewer may see.
fn hands_seen(game: &Game, viewer: Viewer) -> BySeat<Option<Cards>> {
    let dealt = Event::ShiftStarted {
        shift: game.shift(),
        hands: Box::new(game.hands().map(Some)),
    };
    match dealt.seen_by(viewer) {
        Event::ShiftStarted { hands, .. } => *hands,
        _ => BySeat::filled(game.rules().players(), None),
    }
}

/// Whether the viewer sees what only this seat knows.
fn sees(viewer: Viewer, seat: Seat) -> bool {
    match viewer {
        Viewer::Seat(own) => own == seat,
        Viewer::Spectator => false,
        Viewer::Everything => true,
    }
}

fn now(game: &Game, viewer: Viewer) -> Now {
    if let Some(standings) = game.standings() {
        return Now::GameOver(standings);
    }
    let Some(decision) = game.decision() else {
        return Now::Dealt;
    };
    let seat = decision.seat;
    match game.requirement() {
        None => Now::Dealt,
        Some(Requirement::SpecialAction(_)) if !sees(viewer, seat) => Now::Dealt,
        Some(Requirement::SpecialAction(special)) => Now::Special(seat, special),
        Some(Requirement::Gift(gift)) => Now::Exchange(seat, gift.receiver),
        Some(Requirement::Play(requirement)) => Now::Turn { seat, requirement },
    }
}
