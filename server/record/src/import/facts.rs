//! The stated facts of a Shift at a real table: hands, gifts and turns, each with its line. They
//! come from the rows of a transcript or from the lines of an imported record.

use chefshat_engine::{Action, BySeat, Cards, RuleSet, Seat};
use chefshat_proto::v1::{self, game_event::Kind, record_line::Line};

use super::counts::{Counts, NOTHING, add_action};
use super::transcript::{Entry, Transcript, TranscriptError, wrong};
use crate::convert::{action_id, cards_from_numbers, seat_from_number};

/// A stated fact.
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
            gives: BySeat::filled(players, NOTHING),
            given: BySeat::filled(players, None),
            exchanged: false,
            played: BySeat::filled(players, NOTHING),
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
            let action = action_id(decision.action);
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

/// The facts of a transcript, by Shift.
pub(super) fn facts_of_transcript(
    transcript: &Transcript,
) -> Result<Vec<ShiftFacts>, TranscriptError> {
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
    Ok(shifts)
}
