//! The lines that an attendant types: what happened at a physical table, in words. The referee in the
//! server judges what was typed; here only what cannot be understood is refused.

use chefshat_client::v1::{self, table_report::Kind};

use crate::narration::view::GameView;
use crate::numbers::seat_number;

/// What can be typed.
pub(super) const HELP: &str = "\
7 7 joker             the player whose turn it is laid these cards
Ada: 7 7 joker        Ada laid them; 2x7 is short for 7 7, j for joker
pass                  the player whose turn it is passed; also pass Ada
take back             the last pass was taken back; also take back Ada
clear                 the board was cleared: the pizza is done
done                  what was to be done for a remote player is done; also done Ada
hand Ada: 1 2 joker   these are all cards of Ada; golden is the Golden card, no golden rules it out
gift Ada: 1 2         Ada gave these cards; gift Ada if nobody saw them
special Ada           Ada declares a special action; no special if nobody does
role Ada: chef        Ada took this role card: chef, sous-chef, cook, waiter, dishwasher
answer 1              the first answer to the oldest question; answer none withdraws it
correct 12: 8 8       report 12 was wrong: it was 8 8; also correct 12: pass
remove 12             what report 12 says did not happen
pause, resume         the clocks of remote players stand still, or run again
end                   the play that ended the game was read correctly
state                 show the table again
wait                  wait until the table needs a report; for scripts
quit                  end this command; the game continues";

/// What a line asks for.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Command {
    /// Report this.
    Report(Kind),
    /// Nothing: an empty line, or a comment that begins with #.
    Nothing,
    /// Show what can be typed.
    Help,
    /// Show the state of the table.
    State,
    /// Wait until the table needs a report.
    Wait,
    /// End.
    Quit,
}

/// Parses a line.
///
/// # Errors
/// What to type instead.
pub(super) fn parse(line: &str, state: &v1::TableState) -> Result<Command, String> {
    let line = line.trim();
    if line.starts_with('#') {
        return Ok(Command::Nothing);
    }
    Ok(match line.to_lowercase().as_str() {
        "" => Command::Nothing,
        "help" | "?" => Command::Help,
        "state" => Command::State,
        "wait" => Command::Wait,
        "quit" | "exit" => Command::Quit,
        _ => Command::Report(Grammar::of(state).report(line)?),
    })
}

/// The words of one table: its seats and its deck.
struct Grammar<'a> {
    state: &'a v1::TableState,
    seats: &'a [v1::Participant],
    /// The seats with distinct names.
    view: GameView,
    faces: u32,
}

impl<'a> Grammar<'a> {
    fn of(state: &'a v1::TableState) -> Self {
        let room = state.room.as_ref();
        let view = room.map(GameView::of_room).unwrap_or_default();
        Self {
            state,
            seats: room.map_or(&[], |room| &room.seats),
            faces: view.faces(),
            view,
        }
    }

    fn report(&self, line: &str) -> Result<Kind, String> {
        let (verb, rest) = split_word(line);
        match verb.to_lowercase().trim_end_matches(':') {
            "pause" if rest.is_empty() => Ok(pause(true)),
            "resume" if rest.is_empty() => Ok(pause(false)),
            "end" if rest.is_empty() => Ok(Kind::EndConfirmed(v1::EndConfirmed {})),
            "clear" if rest.is_empty() => Ok(Kind::Cleared(v1::BoardCleared {})),
            "take" => self.taken_back(rest),
            "done" => self.done(rest),
            "hand" => self.hand(rest),
            "gift" => self.gift(rest),
            "special" => self.special(rest),
            "no" if rest.eq_ignore_ascii_case("special") => Ok(special(None)),
            "role" => self.role(rest),
            "answer" => self.answer(rest),
            "correct" => self.correct(rest),
            "remove" => Ok(correction(number(rest, "remove 12")?, None)),
            "pass" => match rest {
                "" => Ok(pass(None)),
                name => Ok(pass(Some(self.seat(name)?))),
            },
            _ => match line.rsplit_once(':') {
                Some((name, turn)) => self.turn(Some(self.seat(name)?), turn.trim()),
                None => self.turn(None, line),
            },
        }
    }

    /// A play or a pass.
    fn turn(&self, seat: Option<u32>, words: &str) -> Result<Kind, String> {
        if words.eq_ignore_ascii_case("pass") {
            return Ok(pass(seat));
        }
        Ok(Kind::Laid(v1::CardsLaid {
            seat,
            cards: Some(self.cards(words)?),
        }))
    }

    fn taken_back(&self, rest: &str) -> Result<Kind, String> {
        let (back, name) = split_word(rest);
        if !back.eq_ignore_ascii_case("back") {
            return Err("to withdraw a pass, type take back".into());
        }
        let passed = |report: &&v1::AcceptedReport| {
            matches!(
                report.content.as_ref().and_then(|it| it.kind.as_ref()),
                Some(Kind::Pass(_))
            )
        };
        let seat = match name {
            "" => (self.state.reports.iter().rev().find(passed))
                .and_then(|report| report.seat)
                .ok_or("no pass was reported; name the player: take back Ada")?,
            name => self.seat(name)?,
        };
        Ok(Kind::PassWithdrawn(v1::PassWithdrawn { seat }))
    }

    /// The report that a remote seat's decision was carried out.
    fn done(&self, name: &str) -> Result<Kind, String> {
        let seat = match name {
            "" => None,
            name => Some(self.seat(name)?),
        };
        let wanted = |it: &&v1::CardsToLay| seat.is_none_or(|seat| it.seat == seat);
        let act = (self.state.to_lay.iter().find(wanted))
            .ok_or("nothing is to be done for a remote player now")?;
        let seat = act.seat;
        let cards = act.cards.clone().filter(|seen| !seen.cards.is_empty());
        Ok(match (act.kind(), cards) {
            (v1::DecisionKind::Exchange, cards) => Kind::Gift(v1::GiftSeen { seat, cards }),
            (v1::DecisionKind::SpecialAction, _) => special(Some(seat)),
            (_, None) => pass(Some(seat)),
            (_, cards) => Kind::Laid(v1::CardsLaid {
                seat: Some(seat),
                cards,
            }),
        })
    }

    fn hand(&self, rest: &str) -> Result<Kind, String> {
        let (seat, words) = match rest.rsplit_once(':') {
            Some((name, words)) if !name.trim().is_empty() => (self.seat(name)?, words),
            _ => (
                self.awaited(v1::TableStage::Hand)
                    .ok_or("say whose hand it is: hand Ada: 1 2 joker")?,
                rest,
            ),
        };
        let cards = self.hidden_cards(words)?;
        Ok(Kind::Hand(v1::HandSeen {
            seat,
            cards: Some(cards),
        }))
    }

    fn gift(&self, rest: &str) -> Result<Kind, String> {
        let (seat, words) = match rest.rsplit_once(':') {
            Some((name, words)) if !name.trim().is_empty() => (Some(self.seat(name)?), words),
            Some((_, words)) => (None, words),
            None if rest.is_empty() || self.cards(rest).is_ok() => (None, rest),
            None => (Some(self.seat(rest)?), ""),
        };
        let seat = seat
            .or_else(|| self.awaited(v1::TableStage::Gift))
            .ok_or("say who gave: gift Ada: 1 2, or gift Ada if nobody saw the cards")?;
        let cards = match words.trim() {
            "" => None,
            words => Some(self.hidden_cards(words)?),
        };
        Ok(Kind::Gift(v1::GiftSeen { seat, cards }))
    }

    fn special(&self, name: &str) -> Result<Kind, String> {
        let seat = match name {
            "" => self
                .awaited(v1::TableStage::SpecialAction)
                .ok_or("say who declares: special Ada, or no special")?,
            name => self.seat(name)?,
        };
        Ok(special(Some(seat)))
    }

    fn role(&self, rest: &str) -> Result<Kind, String> {
        let (name, role) =
            (rest.rsplit_once(':')).ok_or("say who took which role: role Ada: chef")?;
        let role = match role.trim().to_lowercase().as_str() {
            "chef" => v1::Role::Chef,
            "sous-chef" | "sous chef" => v1::Role::SousChef,
            "cook" => v1::Role::Cook,
            "waiter" => v1::Role::Waiter,
            "dishwasher" => v1::Role::Dishwasher,
            role => {
                return Err(format!(
                    "{role:?} is not a role; use chef, sous-chef, cook, waiter or dishwasher"
                ));
            }
        };
        Ok(Kind::Role(v1::RoleTaken {
            seat: self.seat(name)?,
            role: role.into(),
        }))
    }

    fn answer(&self, rest: &str) -> Result<Kind, String> {
        let question = (self.state.questions.first()).ok_or("there is no question to answer")?;
        let count = u32::try_from(question.options.len()).unwrap_or(u32::MAX);
        let option = match rest.parse::<u32>() {
            Ok(answer) if (1..=count).contains(&answer) => Some(answer - 1),
            _ if rest.eq_ignore_ascii_case("none") => None,
            _ => return Err(format!("type answer 1 to answer {count}, or answer none")),
        };
        Ok(Kind::Answer(v1::QuestionAnswered {
            question_id: question.question_id.clone(),
            option,
        }))
    }

    /// A correction: of the same seat and sort as the report that was wrong.
    fn correct(&self, rest: &str) -> Result<Kind, String> {
        let example = "correct 12: 8 8";
        let (report, words) = (rest.split_once(':'))
            .ok_or_else(|| format!("say what happened instead: {example}"))?;
        let (report, words) = (number(report, example)?, words.trim());
        let wrong = (self.state.reports.iter().rev())
            .find(|it| it.report == report)
            .ok_or_else(|| {
                format!("report {report} cannot be corrected; state lists those that can")
            })?;
        let kind = wrong.content.as_ref().and_then(|it| it.kind.as_ref());
        let instead = match (kind, wrong.seat) {
            (Some(Kind::Laid(_) | Kind::Pass(_)), seat) => self.turn(seat, words)?,
            (Some(Kind::Hand(_)), Some(seat)) => Kind::Hand(v1::HandSeen {
                seat,
                cards: Some(self.hidden_cards(words)?),
            }),
            (Some(Kind::Gift(_)), Some(seat)) => Kind::Gift(v1::GiftSeen {
                seat,
                cards: Some(self.hidden_cards(words)?),
            }),
            (Some(Kind::Special(_)), _) => match words.to_lowercase().as_str() {
                "no special" => special(None),
                words => self.special(words.trim_start_matches("special").trim())?,
            },
            _ => {
                return Err(format!(
                    "report {report} can only be removed: remove {report}"
                ));
            }
        };
        Ok(correction(report, Some(instead)))
    }

    /// The seat that the table waits for, if it waits for this.
    fn awaited(&self, stage: v1::TableStage) -> Option<u32> {
        self.state.seat.filter(|_| self.state.stage() == stage)
    }

    /// A seat by its name, or as "seat 2", which counts from 1.
    fn seat(&self, name: &str) -> Result<u32, String> {
        let name = name.trim().to_lowercase();
        let number = name.strip_prefix("seat ").map(str::trim);
        let is = |text: &str| text.to_lowercase() == name;
        let named = |seat: &u32, participant: &v1::Participant| {
            is(&self.view.name(*seat)) || is(&participant.name)
        };
        let matching: Vec<u32> = (0u32..)
            .zip(self.seats)
            .filter(|(seat, it)| {
                named(seat, it) || number == Some(&*seat_number(*seat).to_string())
            })
            .map(|(seat, _)| seat)
            .collect();
        match matching.as_slice() {
            [seat] => Ok(*seat),
            [] => {
                let names = (0u32..)
                    .zip(self.seats)
                    .map(|(seat, _)| self.view.name(seat));
                let names = names.collect::<Vec<_>>().join(", ");
                Err(format!("{name:?} is not a player of this table: {names}"))
            }
            [first, ..] => Err(format!(
                "{name:?} is the name of several players; type for example seat {}",
                seat_number(*first)
            )),
        }
    }

    /// Cards of a hand or gift. Before the first play the Golden card is in some hand, so it must be
    /// said whether it is in this one.
    fn hidden_cards(&self, words: &str) -> Result<v1::SeenCards, String> {
        let seen = self.cards(words)?;
        let top = self.faces;
        let of_top = seen.cards.iter().filter(|card| **card == top).count();
        let unsaid = seen.golden.is_none() && of_top > 0 && of_top < top as usize;
        if unsaid && is_before_play(self.state) {
            return Err(format!(
                "say whether the Golden {top} is among them: type golden for that card, or add no golden"
            ));
        }
        Ok(seen)
    }

    /// Cards: faces, "joker", "golden", "2x7", and "no golden", between spaces or commas.
    fn cards(&self, words: &str) -> Result<v1::SeenCards, String> {
        let mut seen = v1::SeenCards::default();
        let mut words = words
            .split([' ', '\t', ',', ';'])
            .filter(|word| !word.is_empty())
            .peekable();
        while let Some(word) = words.next() {
            let lower = word.to_lowercase();
            let next_is_golden = |next: &&str| next.eq_ignore_ascii_case("golden");
            if lower == "no" && words.next_if(next_is_golden).is_some() {
                seen.golden = Some(false);
                continue;
            }
            let (times, what) = (lower.split_once(['x', '×', '*']))
                .and_then(|(times, what)| Some((times.parse::<u8>().ok()?, what)))
                .unwrap_or((1, &lower));
            let card = match what {
                "joker" | "jokers" | "j" => self.faces + 1,
                "golden" => {
                    seen.golden = Some(true);
                    self.faces
                }
                face => (face.parse().ok())
                    .filter(|face| (1..=self.faces).contains(face))
                    .ok_or_else(|| self.no_card(word))?,
            };
            seen.cards.extend(std::iter::repeat_n(card, times.into()));
        }
        if seen.cards.is_empty() {
            return Err("name the cards, for example 7 7 joker".into());
        }
        Ok(seen)
    }

    fn no_card(&self, word: &str) -> String {
        match self.seat(word) {
            Ok(_) => format!("type a colon after the name: {word}: 7 7"),
            Err(_) => format!(
                "{word:?} is not a card: type numbers 1 to {}, joker or golden; help shows what else can be typed",
                self.faces
            ),
        }
    }
}

/// Whether nobody has played or passed in this Shift.
fn is_before_play(state: &v1::TableState) -> bool {
    state.observation.as_ref().is_none_or(|it| {
        it.pizza <= 1 && it.played.iter().chain(&it.passed).all(|count| *count == 0)
    })
}

fn pass(seat: Option<u32>) -> Kind {
    Kind::Pass(v1::PassShown { seat })
}

fn pause(paused: bool) -> Kind {
    Kind::Pause(v1::TablePause { paused })
}

fn special(seat: Option<u32>) -> Kind {
    Kind::Special(v1::SpecialActionSeen { seat })
}

fn correction(report: u64, instead: Option<Kind>) -> Kind {
    let instead = instead.map(|kind| {
        Box::new(v1::TableReport {
            kind: Some(kind),
            ..v1::TableReport::default()
        })
    });
    Kind::Correction(Box::new(v1::ReportCorrection { report, instead }))
}

/// The first word, and what follows it.
fn split_word(line: &str) -> (&str, &str) {
    let (word, rest) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
    (word, rest.trim())
}

/// The number of a report.
fn number(word: &str, example: &str) -> Result<u64, String> {
    let word = word.trim();
    word.parse()
        .map_err(|_| format!("{word:?} is not the number of a report: type for example {example}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    const ADA: u32 = 0;
    const BO: u32 = 1;
    const GRETA: u32 = 2;

    fn accepted(report: u64, seat: u32, kind: Kind) -> v1::AcceptedReport {
        v1::AcceptedReport {
            report,
            seat: Some(seat),
            content: Some(v1::TableReport {
                kind: Some(kind),
                ..v1::TableReport::default()
            }),
            ..v1::AcceptedReport::default()
        }
    }

    /// A table in its first pizza, with Ada, Bo Ek, Greta and another Greta.
    fn table() -> v1::TableState {
        let seat = |(seat, name): (u32, &str)| v1::Participant {
            seat,
            name: name.into(),
            ..v1::Participant::default()
        };
        let names = ["Ada", "Bo Ek", "Greta", "Greta"];
        v1::TableState {
            room: Some(v1::Room {
                seats: (0..).zip(names).map(seat).collect(),
                ..v1::Room::default()
            }),
            observation: Some(v1::Observation {
                pizza: 1,
                played: vec![0, 0, 1],
                ..v1::Observation::default()
            }),
            reports: vec![
                accepted(3, ADA, hand(ADA, &[1], None)),
                accepted(4, ADA, laid(Some(ADA), &[9, 9], None)),
                accepted(5, BO, pass(Some(BO))),
                accepted(6, ADA, Kind::Cleared(v1::BoardCleared {})),
                accepted(7, ADA, gift(ADA, None)),
                accepted(8, BO, special(Some(BO))),
            ],
            questions: vec![v1::TableQuestion {
                question_id: "q".into(),
                options: vec!["7".into(), "9".into()],
                ..v1::TableQuestion::default()
            }],
            to_lay: vec![
                to_lay(GRETA, v1::DecisionKind::Turn, &[]),
                to_lay(BO, v1::DecisionKind::Turn, &[8, 8]),
            ],
            ..v1::TableState::default()
        }
    }

    fn waiting_for(stage: v1::TableStage, seat: u32) -> v1::TableState {
        v1::TableState {
            stage: stage.into(),
            seat: Some(seat),
            ..table()
        }
    }

    fn to_lay(seat: u32, kind: v1::DecisionKind, cards: &[u32]) -> v1::CardsToLay {
        v1::CardsToLay {
            seat,
            kind: kind.into(),
            cards: Some(seen(cards, Some(false))),
            ..v1::CardsToLay::default()
        }
    }

    fn seen(cards: &[u32], golden: Option<bool>) -> v1::SeenCards {
        v1::SeenCards {
            cards: cards.to_vec(),
            golden,
        }
    }

    fn laid(seat: Option<u32>, cards: &[u32], golden: Option<bool>) -> Kind {
        Kind::Laid(v1::CardsLaid {
            seat,
            cards: Some(seen(cards, golden)),
        })
    }

    fn hand(seat: u32, cards: &[u32], golden: Option<bool>) -> Kind {
        Kind::Hand(v1::HandSeen {
            seat,
            cards: Some(seen(cards, golden)),
        })
    }

    fn gift(seat: u32, cards: Option<&[u32]>) -> Kind {
        Kind::Gift(v1::GiftSeen {
            seat,
            cards: cards.map(|cards| seen(cards, None)),
        })
    }

    fn withdrawn(seat: u32) -> Kind {
        Kind::PassWithdrawn(v1::PassWithdrawn { seat })
    }

    fn answer(option: Option<u32>) -> Kind {
        Kind::Answer(v1::QuestionAnswered {
            question_id: "q".into(),
            option,
        })
    }

    fn check(state: &v1::TableState, line: &str, expected: Kind) {
        assert_eq!(parse(line, state), Ok(Command::Report(expected)), "{line}");
    }

    #[test]
    fn lines_are_reports() {
        let cases = [
            ("7 7 joker", laid(None, &[7, 7, 12], None)),
            ("2x7, J", laid(None, &[7, 7, 12], None)),
            ("joker", laid(None, &[12], None)),
            ("Ada: 7", laid(Some(ADA), &[7], None)),
            ("bo ek:  2×8 ", laid(Some(BO), &[8, 8], None)),
            ("seat 4: 8", laid(Some(3), &[8], None)),
            ("golden 11", laid(None, &[11, 11], Some(true))),
            ("11 no golden", laid(None, &[11], Some(false))),
            ("greta#4: 8", laid(Some(3), &[8], None)),
            ("pass", pass(None)),
            ("PASS Ada", pass(Some(ADA))),
            ("Ada: pass", pass(Some(ADA))),
            ("take back", withdrawn(BO)),
            ("take back ada", withdrawn(ADA)),
            ("clear", Kind::Cleared(v1::BoardCleared {})),
            ("hand Ada: 1 2 2 j", hand(ADA, &[1, 2, 2, 12], None)),
            ("hand Ada: 11 11", hand(ADA, &[11, 11], None)),
            ("gift Ada: 3 4", gift(ADA, Some(&[3, 4]))),
            ("gift Bo Ek", gift(BO, None)),
            ("special Bo Ek", special(Some(BO))),
            ("no special", special(None)),
            (
                "role Ada: Sous-Chef",
                Kind::Role(v1::RoleTaken {
                    seat: ADA,
                    role: v1::Role::SousChef.into(),
                }),
            ),
            ("answer 2", answer(Some(1))),
            ("answer none", answer(None)),
            ("pause", pause(true)),
            ("resume", pause(false)),
            ("done", pass(Some(GRETA))),
            ("done bo ek", laid(Some(BO), &[8, 8], Some(false))),
        ];
        for (line, expected) in cases {
            check(&table(), line, expected);
        }
    }

    #[test]
    fn a_correction_is_about_the_same_seat() {
        let cases = [
            ("correct 4: 8 8", 4, Some(laid(Some(ADA), &[8, 8], None))),
            ("correct 4: pass", 4, Some(pass(Some(ADA)))),
            ("correct 5: 8", 5, Some(laid(Some(BO), &[8], None))),
            ("correct 3: 1 2", 3, Some(hand(ADA, &[1, 2], None))),
            ("correct 7: 1", 7, Some(gift(ADA, Some(&[1])))),
            ("correct 8: no special", 8, Some(special(None))),
            ("correct 8: special Ada", 8, Some(special(Some(ADA)))),
            ("remove 6", 6, None),
        ];
        for (line, report, instead) in cases {
            check(&table(), line, correction(report, instead));
        }
    }

    #[test]
    fn the_awaited_seat_need_not_be_named() {
        let state = waiting_for(v1::TableStage::Hand, GRETA);
        check(&state, "hand 1 2", hand(GRETA, &[1, 2], None));
        check(&state, "hand: 1 2", hand(GRETA, &[1, 2], None));
        let state = waiting_for(v1::TableStage::Gift, BO);
        check(&state, "gift", gift(BO, None));
        check(&state, "gift 3 4", gift(BO, Some(&[3, 4])));
        let state = waiting_for(v1::TableStage::SpecialAction, BO);
        check(&state, "special", special(Some(BO)));
    }

    #[test]
    fn decisions_of_remote_seats_are_reported_as_done() {
        let of = |kind, cards: &[u32]| v1::TableState {
            to_lay: vec![to_lay(GRETA, kind, cards)],
            ..table()
        };
        let given = Kind::Gift(v1::GiftSeen {
            seat: GRETA,
            cards: Some(seen(&[3], Some(false))),
        });
        check(&of(v1::DecisionKind::Exchange, &[3]), "done", given);
        let state = of(v1::DecisionKind::SpecialAction, &[]);
        check(&state, "done", special(Some(GRETA)));
    }

    #[test]
    fn the_golden_card_is_accounted_for_before_the_first_play() {
        let mut state = table();
        state.observation = None;
        let problem = parse("hand Ada: 11 11", &state).expect_err("golden or not");
        assert!(problem.contains("no golden"), "{problem}");
        check(
            &state,
            "hand Ada: 11 golden",
            hand(ADA, &[11, 11], Some(true)),
        );
        check(
            &state,
            "hand Ada: 11 11 no golden",
            hand(ADA, &[11, 11], Some(false)),
        );
        check(&state, "hand Ada: 11x11", hand(ADA, &[11; 11], None));
        check(&state, "11 11", laid(None, &[11, 11], None));
    }

    #[test]
    fn other_lines() {
        let cases = [
            ("", Command::Nothing),
            ("# nothing", Command::Nothing),
            ("Help", Command::Help),
            ("?", Command::Help),
            ("state", Command::State),
            ("wait", Command::Wait),
            ("quit", Command::Quit),
        ];
        for (line, expected) in cases {
            assert_eq!(parse(line, &table()), Ok(expected), "{line}");
        }
    }

    #[test]
    fn what_cannot_be_understood_says_what_to_type() {
        let cases = [
            ("sevens", "help shows"),
            ("12", "1 to 11"),
            ("0", "1 to 11"),
            ("300x7", "is not a card"),
            ("Ada 7 7", "Ada: 7 7"),
            ("Ada:", "7 7 joker"),
            ("Cy: 7", "Ada, Bo Ek, Greta#3, Greta#4"),
            ("Greta: 7", "seat 3"),
            ("seat 0: 7", "is not a player"),
            ("pass Cy", "Bo Ek"),
            ("take", "take back"),
            ("hand 1 2", "hand Ada: 1 2 joker"),
            ("gift", "gift Ada"),
            ("special", "no special"),
            ("role Ada", "role Ada: chef"),
            ("role Ada: pilot", "sous-chef"),
            ("answer 3", "answer 1 to answer 2"),
            ("answer", "answer none"),
            ("correct 4", "correct 12: 8 8"),
            ("correct x: 8", "correct 12: 8 8"),
            ("correct 99: 8", "state"),
            ("correct 6: 8", "remove 6"),
            ("remove", "remove 12"),
            ("done Ada", "nothing is to be done"),
        ];
        for (line, hint) in cases {
            let problem = parse(line, &table()).expect_err(line);
            assert!(problem.contains(hint), "{line}: {problem}");
        }
        let problem = parse("take back", &v1::TableState::default()).expect_err("no pass");
        assert!(problem.contains("take back Ada"), "{problem}");
        let problem = parse("answer 1", &v1::TableState::default()).expect_err("no question");
        assert!(problem.contains("no question"), "{problem}");
    }
}
