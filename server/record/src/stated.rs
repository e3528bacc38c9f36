//! What the record of an imported game states: the facts of its lines, and where it starts. `import`
//! makes such records of transcripts, `replay` checks them.

use chefshat_engine::{Action, Deal, RuleSet};
use chefshat_proto::v1::{self, game_event::Kind, record_line::Line};
use chefshat_referee::{Fact, NO_SEED, ShiftFacts, StartState};

use crate::convert::{
    FieldProblem, action_id, cards_from_numbers, script_from_proto, seat_cards, seat_from_number,
    seat_number,
};

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

/// Reads the header of an imported record: a scripted Shift without hands, or none.
pub(crate) fn start_of_header(
    scripted: Option<&v1::ScriptedShift>,
    rules: &RuleSet,
) -> Result<StartState, FieldProblem> {
    let scripted = scripted.cloned().unwrap_or_default();
    if !scripted.hands.is_empty() || scripted.drawn_seat.is_some() {
        return Err(FieldProblem::new(
            "hands",
            "hands of an imported game are stated in its Shifts",
        ));
    }
    let deal = Deal::new(rules, NO_SEED, 1);
    let any_hands = v1::ScriptedShift {
        hands: deal
            .hands()
            .iter()
            .map(|(seat, &hand)| seat_cards(seat, hand, rules.faces()))
            .collect(),
        drawn_seat: deal.drawn().map(seat_number),
        ..scripted
    };
    let script = script_from_proto(&any_hands, rules)?;
    Ok(StartState {
        shift: script.shift,
        last_order: script.last_order,
        scores: script.scores,
    })
}
