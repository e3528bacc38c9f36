//! Impossible games of real tables are refused, at the row of the transcript or the line of the
//! record.

use chefshat_proto::v1::{self, record_line::Line};
use chefshat_record::import::import;
use chefshat_record::replay::replay;
use chefshat_record::testing::header;

use super::{NOTED, SPARSE, documented, from_the_second_shift};

#[test]
fn impossible_rows_are_reported() {
    // Replaced text of the documented transcript, replacement, wrong line, part of the message.
    #[rustfmt::skip] // One row each.
    let cases = [
        ("seconds,took", "seconds,takes", 1, "there is no column \"takes\""),
        ("shift,seat,what", "shift,seat,why", 1, "there is no column \"why\""),
        ("paper players=2", "chess players=2", 3, "rules: preset"),
        ("players=2", "players=7", 3, "rules: players"),
        ("players=2", "players=3", 7, "each of the seats 0..=2 needs one row"),
        ("faces=4", "faces=four", 3, "\"four\" is not a value of faces"),
        ("2026-03-14T15:00:00Z", "yesterday", 4, "a time must be written like"),
        ("2026-03-14T15:00:00Z", "1969-12-31T23:59:59Z", 4, "times before 1970"),
        (",0,human,Ana", ",1,human,Ana", 6, "seat 1 is taken already"),
        ("1,0,hand,1 3 3 4 G", "1,0,hand,1 3 3 4", 7, "seat 0 was dealt 4 cards, but every hand has 5"),
        ("1,0,hand,1 3 3 4 G", "1,0,hand,1 1 3 4 G", 7, "no deck has that many cards of one kind"),
        ("1,0,hand,1 3 3 4 G", "1,0,hand,1 3 3 4 5", 7, "\"5\" is not a card"),
        ("1,0,hand,1 3 3 4 G", "1,0,hand,1 3 3 4 4", 8, "the Golden card"),
        ("1,0,hand,1 3 3 4 G", "1,0,hand,1 2 3 4 G", 9, "of face 2 were dealt to or played by the seats together: 3, but the deck has 2"),
        ("1,0,hand,1 3 3 4 G", "1,0,holds,1 3 3 4 G", 7, "`what` is \"holds\""),
        ("1,0,hand,", "1,2,hand,", 7, "there is no seat 2"),
        ("1,0,plays,4 G,4.5", "1,0,plays,3 3,4.5", 8, "must play cards of face 4, the Golden card among them"),
        ("1,0,plays,4 G,4.5", "1,0,plays,4 3,4.5", 8, "a play must be cards of one face"),
        ("1,0,plays,4 G,4.5", "1,0,plays,J J,4.5", 8, "or a single one alone"),
        ("1,0,plays,4 G,4.5", "1,0,passes,,4.5", 8, "passing is not allowed on the Shift's first turn"),
        ("1,1,plays,2 2,9", "1,1,plays,2,9", 9, "at least 2 cards must be played"),
        ("1,1,plays,2 2,9", "1,1,plays,4 4,9", 9, "the face must be lower than the 4"),
        ("1,1,plays,2 2,9", "1,0,plays,3 3,9", 9, "it is seat 1's decision, not seat 0's"),
        ("1,1,plays,2 2,9", "1,1,plays,1 J,9", 9, "cards of face 1"),
        ("1,1,plays,2 2,9", "1,1,plays,2 2,3", 9, "`seconds` is earlier"),
        ("1,1,plays,2 2,9", "1,1,plays,2 2,soon", 9, "`seconds` is \"soon\""),
        ("surprise,0.4", "surprise,1.4", 11, "valence: 1.4 is not in -1..=1"),
        ("1,1,plays,4 J,15", "2,1,plays,4 J,15", 13, "Shifts must follow one another"),
        ("1,0,plays,1,21,,,,\n1,0,fin", "2,0,plays,1,21,,,,\n2,0,fin", 15, "by the rules, Shift 1 is in progress, not Shift 2"),
        ("1,1,plays,4 J,15", "1,1,plays,4 J J,15", 12, "too many jokers"),
        ("1,1,plays,4 J,15", "1,1,declares,,15", 12, "before the first turn of the Shift"),
        ("1,0,finishes,1", "1,0,finishes,2", 16, "by the rules, seat 0 has place 1, not 2"),
        ("1,0,finishes,1", "1,1,passes,", 16, "by the rules, the Shift or the game ended"),
        ("1,0,finishes,1", "1,0,points,3", 16, "by the rules, seat 0 has 5 points, not 3"),
        ("1,0,finishes,1", "1,0,points,5000000000", 16, "5 points, not 5000000000"),
        ("1,0,finishes,1", "1,0,points,99999999999999999999", 16, "which is too large"),
        ("1,0,finishes,1", "1,0,role,Chef", 16, "the first Shift has no roles"),
        ("1,0,finishes,1", "1,0,tries,1", 16, "its turn is missing"),
        ("1,0,finishes,1,,,,,", "1,0,finishes,1", 16, "the row has 4 cells and must have 9"),
    ];
    check_refused(&documented(), &cases);
}

/// Checks that every change is refused: replaced text, replacement, wrong line, part of the
/// message.
fn check_refused(text: &str, cases: &[(&str, &str, usize, &str)]) {
    let mut wrong = Vec::new();
    for (found, replaced, line, words) in cases {
        let changed = text.replacen(found, replaced, 1);
        assert_ne!(changed, text, "{found}");
        match import(changed.as_bytes()) {
            Err(error) if error.line == *line && error.problem.contains(words) => {}
            Err(error) => wrong.push(format!("{replaced}: line {line}, {words:?}: {error}")),
            Ok(_) => wrong.push(format!(
                "{replaced}: line {line}, {words:?}: it was accepted"
            )),
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn notes_are_compared_with_the_shift_of_their_row() {
    #[rustfmt::skip] // One row each.
    let cases = [
        ("1,1,points,0", "1,1,points,1", 8, "by the rules, seat 1 has 0 points, not 1"),
        ("1,1,points,0", "1,1,role,Dishwasher", 8, "the first Shift has no roles"),
        ("1,1,points,0", "2,1,role,Chef", 8, "by the rules, seat 1 is Dishwasher, not Chef"),
        ("2,1,finishes,1", "2,1,finishes,2", 13, "by the rules, seat 1 has place 1, not 2"),
        ("2,0,role,Chef", "2,0,role,Dishwasher", 14, "by the rules, seat 0 is Chef, not Dishwasher"),
        ("2,1,plays,3\n2,1,finishes,1\n2,0,role,Chef\n2,0,points,5\n", "", 12, "by the rules, Shift 3 has not begun"),
        ("3,0,role,Dishwasher", "3,0,role,Chef", 16, "by the rules, seat 0 is Dishwasher, not Chef"),
    ];
    check_refused(NOTED, &cases);
}

#[test]
fn facts_that_no_gifts_explain_are_refused() {
    #[rustfmt::skip] // One row each.
    let cases = [
        ("2,0,plays,G 15", "2,0,plays,1", 17, "too many cards of face 1 were dealt to or played by the seats together: 2, but the deck has 1"),
        ("2,0,plays,G 15", "2,0,plays,14", 17, "must play cards of face 15, the Golden card among them"),
        ("2,0,plays,G 15", "2,2,plays,G 15", 17, "seat 2 does not hold these cards"),
        ("8 8 9 9 9 9", "8 8 9 9 9 G", 17, "no seat can have been dealt the Golden card"),
        // The Dishwasher plays a card rarer than those it gave, and received none that rare.
        ("2,0,plays,G 15", "2,5,gives,14 14\n2,0,gives,10 10\n2,0,plays,15\n2,1,passes,\n2,2,passes,\n2,3,passes,\n2,4,passes,\n2,5,plays,13", 24, "no deal and exchange fit"),
        // The Golden card goes last of its face.
        ("2,0,plays,G 15", "2,0,hand,10 10 10 10 10 11 11 11 11 11 12 12 12 12 13 13 13 13 15 G\n2,0,gives,15 G\n2,0,plays,15", 19, "no seat can have been dealt the Golden card"),
        ("2,0,plays,G 15", "2,0,hand,10 10 10 10 10 11 11 11 11 11 12 12 12 12 13 13 13 13 15 G\n2,0,gives,15 15\n2,0,plays,15", 18, "cannot have given these cards from its hand"),
        ("2,0,plays,G 15", "2,0,gives,9 9 9\n2,0,plays,15", 17, "no deal and exchange fit"),
    ];
    check_refused(SPARSE, &cases);
}

#[test]
fn gifts_are_checked_against_stated_hands() {
    let (text, _) = from_the_second_shift();
    let gives: Vec<(usize, &str)> = (1..)
        .zip(text.lines())
        .filter(|(_, line)| line.contains(",gives,"))
        .collect();
    assert_eq!(gives.len(), 4, "{text}");
    // The Dishwasher must give its two rarest cards.
    let (line, row) = gives[0];
    let seat = row.split(',').nth(1).unwrap();
    let hand = text
        .lines()
        .find(|line| line.starts_with(&format!("2,{seat},hand,")))
        .unwrap();
    let cards: Vec<&str> = hand.rsplit(',').next().unwrap().split(' ').collect();
    let right = format!("2,{seat},gives,{} {}", cards[0], cards[1]);
    assert_eq!(row, right);
    let last = cards.iter().rfind(|card| **card != "J").unwrap();
    let wrong = text.replacen(&right, &format!("2,{seat},gives,{} {last}", cards[0]), 1);
    let error = import(wrong.as_bytes()).unwrap_err();
    assert_eq!(error.line, line, "{error}");
    let one_card = text.replacen(&right, &format!("2,{seat},gives,{}", cards[0]), 1);
    let error = import(one_card.as_bytes()).unwrap_err();
    assert_eq!(error.line, line, "{error}");
}

#[test]
fn damaged_imported_records_are_reported() {
    let record = import(documented().as_bytes()).unwrap();
    type Change = fn(&mut Vec<v1::RecordLine>);
    let cases: [(Change, usize, &str); 4] = [
        (
            |lines| edit(lines, 6, |decision| decision.action_mask.clear()),
            6,
            "actionMask has 0 bytes",
        ),
        (
            |lines| edit(lines, 8, |decision| decision.action_mask = vec![1]),
            8,
            "the hand is unknown",
        ),
        (
            |lines| {
                edit(lines, 8, |decision| {
                    decision.source = v1::DecisionSource::Timeout.into()
                })
            },
            8,
            "every player of a real table decides",
        ),
        (
            |lines| header(lines).seed_commitment = vec![0; 32],
            1,
            "seedCommitment has 32 bytes",
        ),
    ];
    for (change, line, words) in cases {
        let mut changed = record.clone();
        change(&mut changed);
        let error = replay(&changed).unwrap_err();
        assert!(
            error.line == line && error.problem.contains(words),
            "{words}: {error}"
        );
    }
}

fn edit(lines: &mut [v1::RecordLine], line: usize, change: fn(&mut v1::DecisionRecord)) {
    match &mut lines[line - 1].line {
        Some(Line::Decision(decision)) => change(decision),
        other => panic!("{other:?}"),
    }
}
