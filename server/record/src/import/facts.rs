//! The stated facts of a Shift at a real table: hands, gifts and turns, each with its line. They
//! come from the rows of a transcript or from the lines of an imported record.

use chefshat_engine::{Action, BySeat, Cards, Face, Role, RuleSet, Seat, SeatOrder};
use chefshat_proto::v1::{self, game_event::Kind, record_line::Line};

use super::game::StartState;
use super::transcript::{Entry, Transcript, TranscriptError};
use crate::convert::{cards_from_numbers, seat_from_number};

/// Cards by kind: index f-1 counts face f, [`JOKER`] the jokers.
pub(super) type Counts = [u8; JOKER + 1];
/// The index of the jokers.
pub(super) const JOKER: usize = chefshat_engine::MAX_FACES as usize;

#[derive(Debug, Clone, Copy)]
pub(crate) enum Fact {
    /// A hand as dealt.
    Hand(Seat, Cards),
    /// A seat was dealt two jokers, and declared its special action or declined.
    Special { seat: Seat, declared: bool },
    /// A seat chose this card to give.
    Gives(Seat, Action),
    /// The complete gift of a seat, if known. Implies that the exchange is over.
    Given(Seat, Option<Cards>),
    /// A seat played or passed.
    Turn(Seat, Action),
}

/// The facts of one Shift, in order.
#[derive(Debug, Clone, Default)]
pub(crate) struct ShiftFacts {
    /// Each with its line, from 1.
    pub(crate) facts: Vec<(usize, Fact)>,
}

/// Facts, added up.
#[derive(Debug, Clone)]
pub(super) struct Tally {
    pub(super) dealt: BySeat<Option<Cards>>,
    /// The seat dealt two jokers, and whether it declared.
    pub(super) special: Option<(Seat, bool)>,
    /// Cards the seat chose to give, as far as stated.
    pub(super) gives: BySeat<Counts>,
    /// The complete gift of a seat.
    pub(super) given: BySeat<Option<Cards>>,
    /// Whether the exchange, if any, is over.
    pub(super) exchanged: bool,
    pub(super) played: BySeat<Counts>,
    /// The seat that took the first turn.
    pub(super) opener: Option<Seat>,
}

impl Tally {
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
                Fact::Gives(seat, gift) => add_action(&mut tally.gives[seat], gift),
                Fact::Given(seat, cards) => {
                    tally.given[seat] = cards;
                    tally.exchanged = true;
                }
                Fact::Turn(seat, turn) => {
                    add_action(&mut tally.played[seat], turn);
                    tally.opener.get_or_insert(seat);
                    tally.exchanged = true;
                }
            }
        }
        tally
    }
}

/// The facts of an imported record, by Shift. Invalid lines are skipped here; the replay rejects
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
            push_facts(rules, line, |fact| shift.facts.push((number, fact)));
        }
    }
    shifts
}

fn push_facts(rules: &RuleSet, line: &Line, mut push: impl FnMut(Fact)) {
    let (players, faces) = (rules.players(), rules.faces());
    let seat = |number| seat_from_number(number, players);
    match line {
        Line::Decision(decision) => {
            let action = crate::replay::action_id(decision.action);
            if let (Some(seat), Some(meaning)) =
                (seat(decision.seat), rules.actions().decode(action))
            {
                match meaning {
                    Action::Declare | Action::Decline => push(Fact::Special {
                        seat,
                        declared: meaning == Action::Declare,
                    }),
                    Action::Give(_) | Action::GiveJoker => push(Fact::Gives(seat, meaning)),
                    turn => push(Fact::Turn(seat, turn)),
                }
            }
        }
        Line::Event(event) => match &event.kind {
            Some(Kind::ShiftStarted(started)) => {
                for hand in &started.hands {
                    let cards = cards_from_numbers(&hand.cards, hand.golden, faces);
                    if let (Some(seat), Some(cards)) = (seat(hand.seat), cards) {
                        push(Fact::Hand(seat, cards));
                    }
                }
            }
            Some(Kind::CardsExchanged(exchanged)) => {
                let cards = cards_from_numbers(&exchanged.cards, exchanged.golden, faces)
                    .filter(|cards| !cards.is_empty());
                if let Some(giver) = seat(exchanged.giver) {
                    push(Fact::Given(giver, cards));
                }
            }
            _ => {}
        },
        _ => {}
    }
}

/// The facts of a transcript, by Shift, and the state of the game before the first one.
pub(super) fn facts_of_transcript(
    transcript: &Transcript,
) -> Result<(StartState, Vec<ShiftFacts>), TranscriptError> {
    let mut shifts: Vec<ShiftFacts> = Vec::new();
    let mut current: Option<u32> = None;
    let mut playing = false;
    for row in &transcript.rows {
        let wrong_at = |problem: &str| Err(wrong(row.line, problem.to_owned()));
        if current != Some(row.shift) {
            if current.is_some_and(|shift| shift.checked_add(1) != Some(row.shift)) {
                return wrong_at("Shifts must follow one another");
            }
            if row.shift == 0 {
                return wrong_at("the number of the first Shift is 1");
            }
            current = Some(row.shift);
            playing = false;
            shifts.push(ShiftFacts::default());
        }
        let Some(shift) = shifts.last_mut() else {
            continue;
        };
        let mut push = |fact| shift.facts.push((row.line, fact));
        match &row.entry {
            Entry::Hand(_) | Entry::Gives(_) | Entry::Special(_) if playing => {
                return wrong_at(
                    "hands, special actions and gifts must come before the first turn of the Shift",
                );
            }
            Entry::Hand(cards) => push(Fact::Hand(row.seat, *cards)),
            Entry::Special(declared) => push(Fact::Special {
                seat: row.seat,
                declared: *declared,
            }),
            Entry::Gives(gift) => {
                push(Fact::Given(
                    row.seat,
                    gift.as_ref().map(|(cards, _)| *cards),
                ));
            }
            Entry::Turn(turn) => {
                playing = true;
                push(Fact::Turn(row.seat, *turn));
            }
            _ => {}
        }
    }
    Ok((start_state(transcript)?, shifts))
}

/// The state before the first stated Shift: unless it is the first of the game, from its rows
/// `role` and `points`.
fn start_state(transcript: &Transcript) -> Result<StartState, TranscriptError> {
    let players = transcript.rules.players();
    let mut start = StartState {
        shift: 1,
        last_order: None,
        scores: BySeat::filled(players, 0),
    };
    let Some(first) = transcript.rows.first().filter(|row| row.shift > 1) else {
        return Ok(start);
    };
    start.shift = first.shift;
    let mut roles: BySeat<Option<&str>> = BySeat::filled(players, None);
    for row in transcript.rows.iter().take_while(|row| {
        row.shift == first.shift && !matches!(row.entry, Entry::Turn(_) | Entry::Special(_))
    }) {
        match &row.entry {
            Entry::Role(name) => roles[row.seat] = Some(name),
            Entry::Points(points) => {
                start.scores[row.seat] = u32::try_from(*points)
                    .map_err(|_| wrong(row.line, "too many points".into()))?;
            }
            _ => {}
        }
    }
    let mut order: Vec<Seat> = Vec::new();
    for role in Role::in_order(players) {
        let next = roles
            .seats()
            .find(|seat| roles[*seat] == Some(role.name()) && !order.contains(seat));
        order.extend(next);
    }
    let order = SeatOrder::from_slice(&order).filter(|order| order.len() == players);
    start.last_order = Some(order.ok_or_else(|| {
        wrong(
            first.line,
            format!(
                "the transcript begins with Shift {}, which needs a row `role` for each seat ({})",
                first.shift,
                Role::in_order(players)
                    .map(Role::name)
                    .collect::<Vec<_>>()
                    .join(", ")
            ),
        )
    })?);
    Ok(start)
}

pub(super) fn wrong(line: usize, problem: String) -> TranscriptError {
    TranscriptError { line, problem }
}

/// Adds the cards of an action; saturates far above any deck.
fn add_action(counts: &mut Counts, cards: Action) {
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

/// The index of a face.
pub(super) fn index(face: Face) -> usize {
    usize::from(face.get()) - 1
}

pub(super) fn counts_of(cards: Cards, faces: u8) -> Counts {
    let mut counts = [0; JOKER + 1];
    for (slot, count) in counts.iter_mut().zip(cards.counts(faces)) {
        *slot = count;
    }
    counts[usize::from(faces)..JOKER].fill(0);
    counts[JOKER] = cards.jokers();
    counts
}

/// Whether `all` contains every card of `some`.
pub(super) fn contains(all: &Counts, some: &Counts) -> bool {
    all.iter().zip(some).all(|(all, some)| all >= some)
}

pub(super) fn add(sum: &mut Counts, more: &Counts) {
    for (sum, more) in sum.iter_mut().zip(more) {
        *sum = sum.saturating_add(*more);
    }
}

/// Removes cards; `None` if some are missing.
pub(super) fn take(from: &mut Counts, cards: &Counts) -> Option<()> {
    for (from, cards) in from.iter_mut().zip(cards) {
        *from = from.checked_sub(*cards)?;
    }
    Some(())
}

/// Raises each count to at least that of `least`.
pub(super) fn at_least(counts: &mut Counts, least: &Counts) {
    for (count, least) in counts.iter_mut().zip(least) {
        *count = (*count).max(*least);
    }
}
