//! The facts of a Shift, from the rows of a transcript or from the lines of an imported record.

use chefshat_engine::{Action, RuleSet};
use chefshat_proto::v1::{self, game_event::Kind, record_line::Line};
use chefshat_referee::{Fact, ShiftFacts};

use super::transcript::{Entry, Transcript, TranscriptError, wrong};
use crate::convert::{action_id, cards_from_numbers, seat_from_number};

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
