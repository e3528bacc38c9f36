//! What is told of a Shift at a real table: hands, gifts and turns, as far as anybody wrote them down, each with the line that tells it. A
//! record tells them in its own lines; a transcript in its rows. What follows from them is worked out in `complete`.

use chefshat_engine::{Action, BySeat, Cards, Face, RuleSet, Seat};
use chefshat_proto::v1::{self, game_event::Kind, record_line::Line};

use crate::convert::{cards_from_numbers, seat_from_number};

/// How many cards of each kind: index f-1 for face f, [`JOKER`] for jokers.
pub(super) type Counts = [u8; JOKER + 1];
/// Where the jokers are counted.
pub(super) const JOKER: usize = chefshat_engine::MAX_FACES as usize;

/// Something told of a Shift.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Fact {
    /// The hand a seat was dealt.
    Hand(Seat, Cards),
    /// A seat was dealt two jokers, and declared its special action or declined.
    Special { seat: Seat, declared: bool },
    /// A seat chose this card to give.
    Gives(Seat, Action),
    /// All that a seat gave, if that is known. The exchange is complete.
    Given(Seat, Option<Cards>),
    /// A seat played or passed.
    Turn(Seat, Action),
}

/// What is told of one Shift, in order.
#[derive(Debug, Clone, Default)]
pub(crate) struct ShiftFacts {
    /// Each with the number of the line that tells it.
    pub(crate) facts: Vec<(usize, Fact)>,
}

/// What facts add up to.
#[derive(Debug, Clone)]
pub(super) struct Tally {
    pub(super) dealt: BySeat<Option<Cards>>,
    /// Who was dealt two jokers and decided, and whether it declared.
    pub(super) special: Option<(Seat, bool)>,
    /// Cards a seat is known to have chosen to give.
    pub(super) gives: BySeat<Counts>,
    /// All that a seat gave.
    pub(super) given: BySeat<Option<Cards>>,
    /// Whether the exchange, if there was one, is over.
    pub(super) exchanged: bool,
    pub(super) played: BySeat<Counts>,
    /// Who took the first turn.
    pub(super) opener: Option<Seat>,
}

impl Tally {
    /// Adds up facts.
    pub(super) fn of(rules: &RuleSet, facts: &[(usize, Fact)]) -> Self {
        let players = rules.players();
        let mut tally = Self {
            dealt: BySeat::filled(players, None),
            special: None,
            gives: BySeat::filled(players, [0; JOKER + 1]),
            given: BySeat::filled(players, None),
            exchanged: false,
            played: BySeat::filled(players, [0; JOKER + 1]),
            opener: None,
        };
        for (_, fact) in facts {
            match *fact {
                Fact::Hand(seat, cards) => tally.dealt[seat] = Some(cards),
                Fact::Special { seat, declared } => tally.special = Some((seat, declared)),
                Fact::Gives(seat, gift) => add_move(&mut tally.gives[seat], gift),
                Fact::Given(seat, cards) => {
                    tally.given[seat] = cards;
                    tally.exchanged = true;
                }
                Fact::Turn(seat, turn) => {
                    add_move(&mut tally.played[seat], turn);
                    tally.opener.get_or_insert(seat);
                    tally.exchanged = true;
                }
            }
        }
        tally
    }
}

/// The Shifts of a record, as its lines tell of them. Lines that make no sense tell nothing: they are refused when the replay comes to
/// them.
pub(crate) fn facts_of_record(rules: &RuleSet, lines: &[v1::RecordLine]) -> Vec<ShiftFacts> {
    let mut shifts: Vec<ShiftFacts> = Vec::new();
    for (number, line) in (1..).zip(lines) {
        if let Some(Line::Event(event)) = &line.line
            && let Some(Kind::ShiftStarted(_)) = &event.kind
        {
            shifts.push(ShiftFacts::default());
        }
        if let (Some(shift), Some(line)) = (shifts.last_mut(), &line.line) {
            note_line(rules, line, |fact| shift.facts.push((number, fact)));
        }
    }
    shifts
}

fn note_line(rules: &RuleSet, line: &Line, mut note: impl FnMut(Fact)) {
    let (players, faces) = (rules.players(), rules.faces());
    let seat = |number| seat_from_number(number, players);
    match line {
        Line::Decision(decision) => {
            let action = crate::replay::number(decision.action);
            if let (Some(seat), Some(meaning)) =
                (seat(decision.seat), rules.actions().decode(action))
            {
                match meaning {
                    Action::Declare | Action::Decline => note(Fact::Special {
                        seat,
                        declared: meaning == Action::Declare,
                    }),
                    Action::Give(_) | Action::GiveJoker => note(Fact::Gives(seat, meaning)),
                    turn => note(Fact::Turn(seat, turn)),
                }
            }
        }
        Line::Event(event) => match &event.kind {
            Some(Kind::ShiftStarted(started)) => {
                for hand in &started.hands {
                    let cards = cards_from_numbers(&hand.cards, hand.golden, faces);
                    if let (Some(seat), Some(cards)) = (seat(hand.seat), cards) {
                        note(Fact::Hand(seat, cards));
                    }
                }
            }
            Some(Kind::CardsExchanged(exchanged)) => {
                let cards = cards_from_numbers(&exchanged.cards, exchanged.golden, faces)
                    .filter(|cards| !cards.is_empty());
                if let Some(giver) = seat(exchanged.giver) {
                    note(Fact::Given(giver, cards));
                }
            }
            _ => {}
        },
        _ => {}
    }
}

/// Counts the cards of a move. More than any deck has are as good as one too many.
fn add_move(counts: &mut Counts, cards: Action) {
    let (face, quantity, jokers) = match cards {
        Action::Play {
            face,
            quantity,
            jokers,
        } => (Some(face), quantity, jokers),
        Action::Give(face) => (Some(face), 1, 0),
        Action::LoneJoker | Action::GiveJoker => (None, 0, 1),
        Action::Pass | Action::Decline | Action::Declare => (None, 0, 0),
    };
    if let Some(face) = face {
        let count = &mut counts[index(face)];
        *count = count.saturating_add(quantity);
    }
    counts[JOKER] = counts[JOKER].saturating_add(jokers);
}

/// Where a face is counted.
pub(super) fn index(face: Face) -> usize {
    usize::from(face.get()) - 1
}

/// The counts of cards.
pub(super) fn counts_of(cards: Cards, faces: u8) -> Counts {
    let mut counts = [0; JOKER + 1];
    for (slot, count) in counts.iter_mut().zip(cards.counts(faces)) {
        *slot = count;
    }
    counts[usize::from(faces)..JOKER].fill(0);
    counts[JOKER] = cards.jokers();
    counts
}

/// Whether all cards of the one are among the other.
pub(super) fn contains(all: &Counts, some: &Counts) -> bool {
    all.iter().zip(some).all(|(all, some)| all >= some)
}

/// Adds cards.
pub(super) fn add(sum: &mut Counts, more: &Counts) {
    for (sum, more) in sum.iter_mut().zip(more) {
        *sum = sum.saturating_add(*more);
    }
}

/// Takes cards away; `None` if they are not there.
pub(super) fn take(from: &mut Counts, cards: &Counts) -> Option<()> {
    for (from, cards) in from.iter_mut().zip(cards) {
        *from = from.checked_sub(*cards)?;
    }
    Some(())
}

/// Of each kind the greater count.
pub(super) fn at_least(counts: &mut Counts, least: &Counts) {
    for (count, least) in counts.iter_mut().zip(least) {
        *count = (*count).max(*least);
    }
}
