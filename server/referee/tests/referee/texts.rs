//! What the referee says to the people at the table.

use chefshat_engine::{BySeat, Role, Seat};
use chefshat_referee::counts::{JOKER, NOTHING};
use chefshat_referee::{Question, Referee, Report, SeenCards, Stage, Verdict};

use crate::table::rules;

/// A referee of four people at a table, with the number of its last report.
struct Evening {
    referee: Referee,
    number: u64,
}

fn cards(faces: &[usize], golden: Option<bool>) -> SeenCards {
    let mut counts = NOTHING;
    for face in faces {
        counts[if *face == 12 { JOKER } else { face - 1 }] += 1;
    }
    SeenCards { counts, golden }
}

/// A hand without jokers.
const HAND: [usize; 17] = [4, 4, 5, 6, 6, 7, 7, 7, 8, 8, 8, 9, 9, 9, 9, 10, 10];

fn laid(seat: usize, faces: &[usize]) -> Report {
    Report::Laid {
        seat: Some(Seat::new(seat)),
        cards: cards(faces, None),
    }
}

fn hand(seat: usize, faces: &[usize], golden: Option<bool>) -> Report {
    Report::Hand {
        seat: Seat::new(seat),
        cards: cards(faces, golden),
    }
}

fn pass(seat: usize) -> Report {
    Report::Pass {
        seat: Some(Seat::new(seat)),
    }
}

impl Evening {
    fn new() -> Self {
        Self::with_remote(BySeat::filled(4, false))
    }

    fn with_remote(remote: BySeat<bool>) -> Self {
        let names = ["Ada", "Bo", "Cy", "Di"].map(str::to_owned).to_vec();
        let mut referee = Referee::new(rules(4, 11, 3), remote, names);
        referee.start();
        Self { referee, number: 0 }
    }

    /// Lets a remote seat decide.
    fn decide(&mut self, seat: usize, action: &str) {
        self.number += 1;
        let action = rules(4, 11, 3).actions().parse(action).unwrap();
        let ruling = (self.referee).decide(self.number, Seat::new(seat), action);
        assert!(!ruling.events.is_empty());
    }

    /// What the referee says to a report: "accepted", "known", the violation, or its question.
    fn say(&mut self, report: &Report) -> String {
        self.number += 1;
        match self.referee.report(self.number, report).verdict {
            Verdict::Accepted => "accepted".into(),
            Verdict::Known => "known".into(),
            Verdict::Violation(violation) => violation.text,
            Verdict::Held { question } => {
                let questions = self.referee.questions();
                questions
                    .iter()
                    .find(|it| it.id == question)
                    .unwrap()
                    .text
                    .clone()
            }
        }
    }

    /// The seats of the reports that count.
    fn seats(&self) -> Vec<Seat> {
        let seats = self.referee.accepted().map(|it| it.report.seat());
        seats.map(Option::unwrap).collect()
    }

    /// Answers the first question.
    fn answer(&mut self, option: usize) {
        let id = self.referee.questions()[0].id.clone();
        let option = Some(option);
        self.check(&[(Report::Answer { id, option }, "accepted")]);
    }

    fn check(&mut self, table: &[(Report, &str)]) {
        for (report, expected) in table {
            assert_eq!(self.say(report), *expected, "{report:?}");
        }
    }
}

#[test]
fn plays_that_break_a_rule() {
    let mut evening = Evening::new();
    assert_eq!(
        evening.referee.waiting_for(),
        "The player with the Golden 11 opens the Shift."
    );
    evening.check(&[
        (laid(0, &[9, 9]), "The Shift is opened with 11s, the Golden 11 among them."),
        (pass(0), "The first turn of a Shift must be a play."),
        (
            Report::Laid { seat: Some(Seat::new(0)), cards: cards(&[11, 11], Some(false)) },
            "The Golden 11 must be among the cards that open the Shift.",
        ),
        (laid(0, &[11, 11]), "accepted"),
        (laid(0, &[11, 11]), "known"),
        (laid(1, &[7, 9]), "These cards are 7s and 9s: a play has cards of one face, and jokers."),
        (laid(1, &[]), "No cards were laid."),
        (laid(1, &[12, 12]), "Jokers alone are no play: lay one alone, or jokers with cards of one face."),
        (laid(1, &[12]), "A joker alone can only start a pizza."),
        (laid(1, &[9]), "That pizza has 2 cards: a play needs at least as many, jokers included."),
        (laid(1, &[3, 3, 3, 3]), "These are 4 3s, but the deck has 3."),
        (laid(1, &[5, 12]), "accepted"),
        (laid(2, &[5, 5]), "That pizza already shows 5s: a play must be 4 or lower."),
        (laid(2, &[2, 12]), "accepted"),
        (laid(3, &[1, 12]), "Di cannot have a 1 and a joker: too many jokers were dealt to or played by the seats together: 3, but the deck has 2."),
    ]);
}

#[test]
fn a_missed_pass_is_asked_for() {
    let mut evening = Evening::new();
    evening.check(&[
        (laid(0, &[11]), "accepted"),
        (laid(2, &[9]), "Did Bo pass?"),
        (laid(3, &[8]), "Did Bo pass?"),
    ]);
    assert_eq!(evening.referee.stage(), Stage::Question);
    let id = evening.referee.questions()[0].id.clone();
    evening.check(&[
        (
            Report::Answer {
                id: id.clone(),
                option: Some(7),
            },
            "The question has no such answer.",
        ),
        (
            Report::Answer {
                id: id.clone(),
                option: Some(0),
            },
            "accepted",
        ),
        (
            Report::Answer {
                id,
                option: Some(0),
            },
            "known",
        ),
    ]);
    assert_eq!(evening.referee.stage(), Stage::Turn(Seat::new(0)));
    assert_eq!(evening.referee.waiting_for(), "It is Ada's turn.");
    // The pizza was cleared, but two passes are missing.
    evening.check(&[(Report::Cleared, "Did Ada and Cy pass?")]);
    evening.answer(1);
    evening.check(&[
        (pass(0), "accepted"),
        (Report::PassWithdrawn { seat: Seat::new(0) }, "accepted"),
        (Report::PassWithdrawn { seat: Seat::new(0) }, "known"),
    ]);
    assert_eq!(evening.referee.waiting_for(), "It is Ada's turn.");
}

/// Cards that somebody laid.
fn somebody(faces: &[usize]) -> Report {
    Report::Laid {
        seat: None,
        cards: cards(faces, None),
    }
}

#[test]
fn a_play_without_a_seat_may_be_of_the_one_after_who_passed_unseen() {
    let mut evening = Evening::new();
    // Bo passes, which nobody sees; Cy lays a 9, Di an 8, and then Ada passes.
    evening.check(&[
        (laid(0, &[11]), "accepted"),
        (somebody(&[9]), "accepted"),
        (somebody(&[8]), "accepted"),
    ]);
    let counted: Vec<_> = evening.referee.accepted().collect();
    assert_eq!(counted[1].report.seat(), Some(Seat::new(1)));
    assert_eq!(
        counted.iter().map(|it| it.is_assumed).collect::<Vec<_>>(),
        [false, true, true]
    );
    evening.check(&[(pass(0), "Did Di pass?")]);
    let question = evening.referee.questions()[0].clone();
    assert_eq!(
        question.options,
        [
            "Yes",
            "No",
            "No, Cy passed before 8",
            "No, Bo passed before 9"
        ]
    );
    let (id, option) = (question.id, Some(3));
    let ruling = (evening.referee).report(9, &Report::Answer { id, option });
    let corrected = ruling.corrected.unwrap();
    assert_eq!(corrected.text, "No, Bo passed before 9");
    assert!(corrected.void_reports.is_empty());
    assert_eq!(evening.seats(), [0, 1, 2, 3, 0].map(Seat::new));
    assert_eq!(evening.referee.waiting_for(), "It is Cy's turn.");
}

#[test]
fn a_play_without_a_seat_is_moved_by_a_correction_and_those_after_it_follow() {
    let mut evening = Evening::new();
    evening.check(&[
        (laid(0, &[11]), "accepted"),
        (somebody(&[9]), "accepted"),
        (somebody(&[8]), "accepted"),
        (
            Report::Correction {
                number: 2,
                instead: Some(Box::new(laid(2, &[9]))),
            },
            "Did Bo pass?",
        ),
    ]);
    evening.answer(0);
    assert_eq!(evening.seats(), [0, 1, 2, 3].map(Seat::new));
}

#[test]
fn a_play_that_the_awaited_seat_cannot_have_is_asked_about() {
    let mut evening = Evening::new();
    let faces = [5, 6, 6, 7, 7, 7, 8, 8, 8, 8, 9, 9, 9, 9, 10, 10, 10];
    evening.check(&[
        (hand(1, &faces, None), "accepted"),
        (laid(0, &[11, 11]), "accepted"),
        // Bo has none.
        (somebody(&[4, 4]), "Did Bo pass?"),
    ]);
    evening.answer(0);
    assert_eq!(evening.referee.waiting_for(), "It is Di's turn.");
}

#[test]
fn the_play_that_ended_a_pizza_counts_twice_only_if_it_was_laid_twice() {
    let names = ["Ada", "Bo", "Cy"].map(str::to_owned).to_vec();
    let options = [
        (Some(0), "It is Cy's turn."),
        (Some(1), "It is Ada's turn."),
    ];
    for (option, next) in options {
        let referee = Referee::new(rules(3, 4, 1), BySeat::filled(3, false), names.clone());
        let mut evening = Evening { referee, number: 0 };
        evening.referee.start();
        let golden = Report::Laid {
            seat: Some(Seat::new(0)),
            cards: cards(&[4], Some(true)),
        };
        evening.check(&[
            (golden, "accepted"),
            (laid(1, &[3]), "accepted"),
            (pass(2), "accepted"),
            (pass(0), "accepted"),
        ]);
        for face in [3, 3] {
            evening.check(&[
                (laid(1, &[face]), "accepted"),
                (pass(2), "accepted"),
                (pass(0), "accepted"),
            ]);
        }
        // Bo has finished and Cy has passed: nobody can follow Ada.
        evening.check(&[
            (laid(1, &[4]), "accepted"),
            (pass(2), "accepted"),
            (laid(0, &[2]), "accepted"),
        ]);
        assert_eq!(evening.referee.waiting_for(), "It is Ada's turn.");
        evening.check(&[(laid(0, &[2]), "Is that a new play by Ada?")]);
        let id = evening.referee.questions()[0].id.clone();
        evening.check(&[(Report::Answer { id, option }, "accepted")]);
        assert_eq!(evening.referee.waiting_for(), next);
    }
}

#[test]
fn a_play_of_an_earlier_pizza_can_be_corrected() {
    let mut evening = Evening::new();
    let mut reports = vec![
        (laid(0, &[11]), "accepted"),
        (laid(1, &[9]), "accepted"),
        (pass(2), "accepted"),
        (pass(3), "accepted"),
        (pass(0), "accepted"),
    ];
    for face in [8, 7, 6] {
        reports.push((laid(1, &[face]), "accepted"));
        reports.extend([2, 3, 0].map(|seat| (pass(seat), "accepted")));
    }
    evening.check(&reports);
    let instead = Some(Box::new(laid(1, &[10])));
    let ruling = (evening.referee).report(99, &Report::Correction { number: 2, instead });
    let corrected = ruling.corrected.unwrap();
    assert_eq!(
        corrected.text,
        "Corrected: Bo laid a 10. (Before: Bo laid a 9.)"
    );
    assert!(corrected.void_reports.is_empty());
}

#[test]
fn a_remote_seat_decides_before_the_board_is_cleared() {
    let mut evening = Evening::with_remote(BySeat::from_fn(4, |seat| seat == Seat::new(3)));
    let hand = hand(3, &HAND, None);
    evening.check(&[
        (hand.clone(), "accepted"),
        (laid(0, &[11]), "accepted"),
        (pass(1), "accepted"),
        (pass(2), "accepted"),
    ]);
    evening.decide(3, "C10;Q1;J0");
    // The 10 is still among its cards.
    evening.check(&[
        (hand.clone(), "known"),
        (laid(3, &[10]), "accepted"),
        (
            hand,
            "Di has 16 cards, but 17 are seen. Show all of them side by side.",
        ),
        (pass(0), "accepted"),
    ]);
    evening.decide(3, "C7;Q2;J0");
    evening.check(&[
        (Report::Cleared, "known"),
        (laid(3, &[7, 7]), "accepted"),
        (Report::Cleared, "Did Ada, Bo and Cy pass?"),
    ]);
}

#[test]
fn corrections_and_questions() {
    let mut evening = Evening::new();
    evening.check(&[
        (laid(0, &[11, 11]), "accepted"),
        (laid(1, &[9, 9]), "accepted"),
        (laid(2, &[7, 7]), "accepted"),
    ]);
    let instead = Some(Box::new(laid(1, &[6, 6])));
    let ruling = evening
        .referee
        .report(9, &Report::Correction { number: 2, instead });
    let corrected = ruling.corrected.unwrap();
    assert_eq!(
        corrected.text,
        "Corrected: Bo laid two 6s. (Before: Bo laid two 9s.)"
    );
    // Cy's 7s do not fall below the 6s.
    assert_eq!(corrected.void_reports, [3]);
    assert_eq!(corrected.void_events, 2);
    assert_eq!(evening.referee.waiting_for(), "It is Cy's turn.");

    let question = Question {
        id: "camera-1".into(),
        text: "7 or 9 at place 4?".into(),
        options: vec!["7".into(), "9".into()],
        seat: Some(Seat::new(2)),
    };
    evening.check(&[
        (Report::Question(question.clone()), "accepted"),
        (Report::Question(question), "known"),
        (Report::Answer { id: "camera-1".into(), option: Some(0) }, "accepted"),
        (Report::Correction { number: 99, instead: None }, "This report cannot be corrected: it is no report of this Shift that counts."),
        (
            Report::Correction { number: 2, instead: Some(Box::new(Report::Cleared)) },
            "A report can be replaced only by one of the same kind and seat.",
        ),
        (Report::Role { seat: Seat::new(0), role: Role::Chef }, "The first Shift has no roles."),
        (Report::Gift { seat: Seat::new(0), cards: None }, "Ada gives no cards in this Shift."),
        (
            Report::Special { seat: Some(Seat::new(0)) },
            "A special action is declared before the exchange, from the second Shift on, by a player with two jokers.",
        ),
        (Report::Pause(true), "accepted"),
        (Report::Pause(true), "known"),
        (
            hand(3, &[1, 2, 3], None),
            "Di has 17 cards, but 3 are seen. Show all of them side by side.",
        ),
    ]);
}

#[test]
fn what_came_after_a_corrected_end_of_the_game_is_void() {
    let names = ["Ada", "Bo"].map(str::to_owned).to_vec();
    let mut referee = Referee::new(rules(2, 4, 1), BySeat::filled(2, false), names);
    referee.start();
    let mut evening = Evening { referee, number: 0 };
    let golden = Report::Laid {
        seat: Some(Seat::new(0)),
        cards: cards(&[4, 4], Some(true)),
    };
    evening.check(&[
        (golden, "accepted"),
        (laid(1, &[3, 3]), "accepted"),
        (laid(0, &[2, 2]), "accepted"),
        (pass(1), "accepted"),
        (laid(0, &[4]), "accepted"),
        (laid(1, &[3]), "accepted"),
    ]);
    // Ada had laid both her cards, and the game was over.
    let instead = Some(Box::new(laid(0, &[4, 4])));
    let ruling = (evening.referee).report(7, &Report::Correction { number: 5, instead });
    assert_eq!(ruling.corrected.unwrap().void_reports, [6]);
    assert!(evening.referee.game().is_over());
}

#[test]
fn reports_without_a_seat_are_never_those_of_a_remote_seat() {
    let mut evening = Evening::with_remote(BySeat::from_fn(4, |seat| seat == Seat::new(1)));
    evening.check(&[
        (hand(1, &HAND, None), "accepted"),
        (laid(0, &[11]), "accepted"),
        (
            Report::Pass { seat: None },
            "It is Bo's turn, who has not decided yet.",
        ),
        (somebody(&[8]), "It is Bo's turn, who has not decided yet."),
    ]);
    evening.decide(1, "pass");
    // Cy passes; the pass card of Bo is shown later.
    evening.check(&[
        (Report::Pass { seat: None }, "accepted"),
        (pass(1), "accepted"),
    ]);
    assert_eq!(evening.referee.waiting_for(), "It is Di's turn.");
}

#[test]
fn reports_without_a_seat_wait_for_the_answer_to_a_question() {
    let mut evening = Evening::new();
    evening.check(&[
        (laid(0, &[11]), "accepted"),
        (laid(2, &[9]), "Did Bo pass?"),
        (somebody(&[8]), "Did Bo pass?"),
    ]);
    let held = evening.number;
    let instead = Some(Box::new(hand(1, &[1], None)));
    let id = evening.referee.questions()[0].id.clone();
    evening.check(&[
        (
            Report::Correction {
                number: held,
                instead,
            },
            "A report can be replaced only by one of the same kind and seat.",
        ),
        (
            Report::Answer {
                id,
                option: Some(0),
            },
            "accepted",
        ),
    ]);
    // Di laid the 8.
    assert_eq!(evening.referee.waiting_for(), "It is Ada's turn.");
}

#[test]
fn passes_of_one_answer_are_taken_back_one_by_one() {
    let mut evening = Evening::new();
    evening.check(&[
        (laid(0, &[11]), "accepted"),
        (laid(3, &[9]), "Did Bo and Cy pass?"),
    ]);
    evening.answer(0);
    evening.check(&[(Report::PassWithdrawn { seat: Seat::new(2) }, "accepted")]);
    // Bo has passed; Di's cards wait again.
    assert_eq!(evening.referee.waiting_for(), "Did Cy pass?");
}

#[test]
fn the_golden_card_in_a_known_hand_is_in_no_other() {
    let mut evening = Evening::new();
    let bo = [11, 3, 5, 5, 6, 6, 8, 8, 8, 9, 9, 9, 10, 10, 10, 10, 10];
    let ada = [11, 4, 4, 5, 6, 6, 7, 7, 7, 8, 8, 9, 9, 9, 9, 10, 10];
    evening.check(&[
        (
            hand(1, &bo, None),
            "Say whether the Golden 11 is among these cards.",
        ),
        (hand(0, &ada, Some(true)), "accepted"),
        (hand(1, &bo, None), "accepted"),
    ]);
}
