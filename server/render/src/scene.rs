//! A moment of a game as it is to be drawn: who sits where, what each seat shows, the board, what the next decision must be. A value
//! without geometry, colours or words. What a viewer may not see is not in it, by `Event::seen_by`. How it is drawn is in `table`; how
//! a record becomes a row of scenes, in `film`.

use chefshat_engine::{
    BySeat, Cards, DecisionKind, Event, Game, Opening, PlayRequirement, Requirement, Role, Seat,
    SpecialAction, Standings, Viewer,
};

use super::chronicle::{Chronicle, Happening, Participant};

/// One moment of a game, as one viewer sees it.
#[derive(Debug, Clone, PartialEq)]
pub struct Scene {
    /// Name of the room or of the record.
    pub caption: String,
    /// Whose eyes it is seen with.
    pub viewer: Viewer,
    /// Number of the open decision over the whole game, from 1. Only with all hands open: to others a gap in the numbers would tell that a
    /// special action was declined.
    pub decision: Option<u64>,
    /// Number of faces F of the deck.
    pub faces: u8,
    /// Number of the Shift, from 1.
    pub shift: u32,
    /// Number of the pizza in its Shift, from 1; 0 before the Shift's first turn is open.
    pub pizza: u32,
    /// Number of the turn in its Shift that is open, from 1.
    pub turn: u32,
    /// The seats, index = seat.
    pub seats: Vec<SeatScene>,
    /// The cards on the board.
    pub board: Vec<Card>,
    /// Who played them, where that is known.
    pub board_by: Option<Seat>,
    /// How many cards have been played in this Shift, and how many the deck has: of each face from face 1, then jokers where the deck
    /// has them.
    pub played: Vec<(u8, u8)>,
    /// What the game waits for.
    pub now: Now,
    /// What happened last, the newest at the end.
    pub log: Vec<Happening>,
}

/// What one seat shows.
#[derive(Debug, Clone, PartialEq)]
pub struct SeatScene {
    /// Who sits there.
    pub participant: Participant,
    /// Its role in this Shift.
    pub role: Option<Role>,
    /// Its points in the game so far.
    pub points: u64,
    /// Its cards.
    pub hand: Hand,
    /// Whether it is out of the pizza.
    pub passed: bool,
    /// Its place in this Shift, from 1, or in the game once that is over; 0 while it holds cards.
    pub place: u8,
    /// Whether the open decision is its own, as far as the viewer may know.
    pub deciding: bool,
}

/// The cards of a seat.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Hand {
    /// Seen, ascending.
    Open(Vec<Card>),
    /// So many cards that the viewer may not see.
    Hidden(u8),
    /// So many cards that nobody wrote down.
    Unknown(u8),
}

/// A card.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Card {
    /// An ingredient, by its face, 1..=15.
    Face(u8),
    /// The Golden card, of this face.
    Golden(u8),
    /// A joker.
    Joker,
}

impl Card {
    /// The face; `None` for a joker.
    pub fn face(self) -> Option<u8> {
        match self {
            Card::Face(face) | Card::Golden(face) => Some(face),
            Card::Joker => None,
        }
    }

    /// The card as one of its face, whether it is the Golden one or not.
    pub(super) fn plain(self) -> Card {
        self.face().map_or(Card::Joker, Card::Face)
    }
}

/// What the game waits for.
#[derive(Debug, Clone, PartialEq)]
pub enum Now {
    /// The cards have been dealt; the viewer may not know what is decided.
    Dealt,
    /// This seat may declare this special action.
    Special(Seat, SpecialAction),
    /// The first seat gives a card to the second.
    Exchange(Seat, Seat),
    /// This seat plays or passes.
    Turn {
        /// The seat.
        seat: Seat,
        /// What a play must be, and whether passing is legal.
        requirement: PlayRequirement,
    },
    /// The Shift has just ended.
    ShiftOver {
        /// Points of this Shift.
        points: BySeat<u32>,
        /// Whether it reached its limit of turns.
        adjudicated: bool,
    },
    /// The game has ended.
    GameOver(Standings),
    /// The game ended without a result.
    Aborted,
}

impl Scene {
    /// The scene of a game as it stands. `known` says whose hand is known at all.
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
                    Some(hand) => Hand::Open(cards(hand, faces)),
                    None => Hand::Hidden(cards_left),
                },
                passed: view.passed[seat],
                place: view.places[seat],
                deciding: deciding == Some(seat),
            })
            .collect();
        // The opening is the only play of the top face that no other can follow within the first pizza.
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
            board: played(view.board.face, quantity, view.board.jokers, golden),
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

    /// Does not show the Golden card in the hands of which nobody knows whether they hold it.
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

/// The cards of a play.
pub(super) fn played(face: u8, quantity: u8, jokers: u8, golden: bool) -> Vec<Card> {
    let mut cards = vec![Card::Face(face); usize::from(quantity)];
    if let (true, Some(first)) = (golden, cards.first_mut()) {
        *first = Card::Golden(face);
    }
    cards.extend(std::iter::repeat_n(Card::Joker, usize::from(jokers)));
    cards
}

/// Cards ascending, jokers at the end, the Golden card first of its face.
pub(super) fn cards(cards: Cards, faces: u8) -> Vec<Card> {
    let plain = |number| {
        if number > faces {
            Card::Joker
        } else {
            Card::Face(number)
        }
    };
    let mut seen: Vec<Card> = cards.ascending(faces).map(plain).collect();
    if cards.has_golden()
        && let Some(first) = seen.iter().position(|&card| card == Card::Face(faces))
    {
        seen[first] = Card::Golden(faces);
    }
    seen
}

/// The hands that a viewer may see, by the one rule there is for it.
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

/// Whether what only a seat itself may know is shown.
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
