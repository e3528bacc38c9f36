//! Records damaged in one place: the error names the first wrong line and the problem.

use std::path::Path;

use crate::fixture_path;
use chefshat_record::jsonl;
use chefshat_record::jsonl::{MAX_LINE_BYTES, RecordFileError};
use chefshat_record::replay::replay;
use serde_json::{Value, json};

/// A change to a record. Lines are numbered from 1.
enum Damage {
    /// Sets a field of a line.
    Set(usize, &'static str, Value),
    /// Removes a field of a line.
    Unset(usize, &'static str, &'static str),
    /// Removes a line.
    Drop(usize),
    /// Duplicates a line.
    Double(usize),
    /// Swaps two lines.
    Swap(usize, usize),
    /// Truncates the file after a line.
    CutBehind(usize),
    /// Truncates the file within a line.
    CutWithin(usize),
    /// Replaces a line by these bytes.
    Bytes(usize, Vec<u8>),
    /// Appends a line.
    Append(&'static str),
}

use Damage::{Append, Bytes, CutBehind, CutWithin, Double, Drop, Set, Swap, Unset};

/// The first wrong line and the problem; `None` if the record verifies.
fn verdict(path: &Path) -> Option<(usize, String)> {
    match jsonl::read(path) {
        Err(RecordFileError::Line { line, problem, .. }) => Some((line, problem.to_string())),
        Err(other) => panic!("{other}"),
        Ok(lines) => replay(&lines)
            .err()
            .map(|error| (error.line, error.problem)),
    }
}

fn damaged(text: &str, damage: &Damage) -> Vec<u8> {
    let mut lines: Vec<Vec<u8>> = text.lines().map(|line| line.as_bytes().to_vec()).collect();
    let mut ends_with_newline = true;
    let mut edit = |line: usize, change: &dyn Fn(&mut Value)| {
        let mut value = serde_json::from_slice(&lines[line - 1]).unwrap();
        change(&mut value);
        lines[line - 1] = value.to_string().into_bytes();
    };
    match damage {
        Set(line, pointer, new) => edit(*line, &|value| {
            let (parent, name) = pointer.rsplit_once('/').unwrap();
            match value.pointer_mut(parent).unwrap() {
                Value::Object(object) => {
                    let before = object.insert(name.to_owned(), new.clone());
                    assert_ne!(
                        before.as_ref(),
                        Some(new),
                        "{pointer} had this value already"
                    );
                }
                Value::Array(array) => array[name.parse::<usize>().unwrap()] = new.clone(),
                other => panic!("{pointer} is within {other}"),
            }
        }),
        Unset(line, pointer, name) => edit(*line, &|value| {
            let object = value.pointer_mut(pointer).unwrap().as_object_mut().unwrap();
            object.remove(*name).expect("the field is there");
        }),
        Drop(line) => {
            lines.remove(line - 1);
        }
        Double(line) => lines.insert(*line, lines[line - 1].clone()),
        Swap(one, other) => lines.swap(one - 1, other - 1),
        CutBehind(line) => lines.truncate(*line),
        CutWithin(line) => {
            lines.truncate(*line);
            let last = lines.last_mut().unwrap();
            last.truncate(last.len() / 2);
            ends_with_newline = false;
        }
        Bytes(line, bytes) => lines[line - 1].clone_from(bytes),
        Append(line) => lines.push(line.as_bytes().to_vec()),
    }
    let mut bytes = lines.join(&b'\n');
    if ends_with_newline && !bytes.is_empty() {
        bytes.push(b'\n');
    }
    bytes
}

/// Names of the damages, the wrong line and a part of the message.
#[rustfmt::skip] // One row each.
fn damages() -> Vec<(&'static str, Damage, usize, &'static str)> {
    vec![
        // The header.
        ("form", Set(1, "/header/formatVersion", json!(2)), 1, "reads version 1"),
        ("rules version", Set(1, "/header/rulesVersion", json!(7)), 1, "version 7 of the rules"),
        ("game id", Set(1, "/header/gameId", json!("22B73F3BBA773C1120E1858DE68CD801")), 1, "32 hexadecimal digits"),
        ("another game id", Set(1, "/header/gameId", json!("22b73f3bba773c1120e1858de68cd802")), 4, "gameStarted.gameId"),
        ("a rule", Set(1, "/header/rules/points", json!([3, 2, 1, 0])), 4, "gameStarted.rules.points is [5,3,1,0] and must be [3,2,1,0]"),
        ("too many clocks", Set(1, "/header/policy/clocks", json!(vec![json!({}); 5])), 1, "has more than 4 entries in `clocks`"),
        ("an impossible rule", Set(1, "/header/rules/faces", json!(16)), 1, "rules.faces"),
        ("a missing rule", Unset(1, "/header/rules", "exchange"), 1, "rules.exchange"),
        ("the action space", Set(1, "/header/actionSpace/size", json!(215)), 1, "actionSpace.size is 215 and must be 214"),
        ("the policy", Set(1, "/header/policy/bankMs", json!(90_000_000)), 1, "policy.bankMs is 90000000"),
        ("a seat's number", Set(1, "/header/seats/1/seat", json!(2)), 1, "seats[1].seat is 2 and must be 1"),
        ("a name", Set(1, "/header/seats/2/name", json!("Ralf")), 4, "\"Ralf\" on seat 2, but the events have \"Rolf\""),
        ("a name's fingerprint", Set(1, "/header/seats/3/nameFingerprint", json!("0123456789ABCDEF")), 1, "seats[3].nameFingerprint is \"0123456789ABCDEF\" and must be \"empty or 16"),
        ("a built-in agent's fingerprint", Set(1, "/header/seats/1/nameFingerprint", json!("0123456789abcdef")), 1, "seats[1].nameFingerprint is \"0123456789abcdef\" and must be \"empty for a built-in"),
        ("the origin", Set(1, "/header/origin", json!("GAME_ORIGIN_FIXED_SEED")), 1, "seedCommitment has 32 bytes; for GAME_ORIGIN_FIXED_SEED it must be absent"),
        ("no commitment", Unset(1, "/header", "seedCommitment"), 1, "seedCommitment has 0 bytes"),
        ("the commitment", Set(1, "/header/seedCommitment", json!("AAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAA=")), 4, "gameStarted.seedCommitment"),
        ("a start", Set(1, "/header/start", json!({"branchedFrom": {"gameId": "22b73f3bba773c1120e1858de68cd801"}})), 1, "start.branchedFrom is present"),
        ("substituted at the end", Unset(1, "/header/seats/2", "substituted"), 493, "seat 2 as not substituted"),
        ("the creation time", Set(1, "/header/createdAtMs", json!("253402300800000")), 1, "createdAtMs is 253402300800000, after the year 9999"),
        ("too many seats", Set(1, "/header/seats", json!([{}, {}, {}, {}, {}, {}, {}])), 1, "has more than 6 entries in `seats`"),
        // Seats.
        ("a missing seat", Set(2, "/event/seated/seat", json!(4)), 2, "seated.seat is 4 and must be in 0..=3"),
        ("a built-in agent's seat", Set(2, "/event/seated/seat", json!(1)), 2, "which is a built-in agent's"),
        ("another substitute", Set(51, "/event/substituted/builtInAgent", json!("greedy")), 51, "is \"greedy\" and must be \"random\""),
        ("a missing substitution", Drop(51), 51, "`substituted` must come here: seat 2 was away, or has reached the limit of timeouts"),
        // The deal.
        ("a hand", Set(5, "/event/shiftStarted/hands/1/cards/0", json!(2)), 5, "shiftStarted.hands[1].cards"),
        ("the Golden card", Set(5, "/event/shiftStarted/hands/1/golden", json!(true)), 5, "shiftStarted.hands[1].golden is true and must be false"),
        ("a long hand", Set(5, "/event/shiftStarted/hands/1/cards", json!(vec![1; 123])), 5, "has more than 122 entries in `cards`"),
        ("too many hands", Set(5, "/event/shiftStarted/hands", json!(vec![json!({}); 1000])), 5, "has more than 6 entries in `hands`"),
        ("missing hands", Set(5, "/event/shiftStarted/hands", json!([])), 5, "shiftStarted.hands is [] and must be a list of 4"),
        ("a later hand", Set(171, "/event/shiftStarted/hands/3/cards/16", json!(11)), 171, "shiftStarted.hands[3].cards"),
        ("a role", Set(172, "/event/rolesAssigned/roles/1", json!("ROLE_COOK")), 172, "rolesAssigned.roles"),
        ("exchanged cards", Set(176, "/event/cardsExchanged/cards", json!([3, 5])), 176, "cardsExchanged.cards is [3,5] and must be [3,3]"),
        ("a gift", Set(173, "/decision/text", json!("give C9")), 173, "text is \"give C9\" and must be \"give C11\""),
        // Decisions.
        ("whose decision", Set(8, "/decision/seat", json!(0)), 8, "seat is 0 and must be 3"),
        ("its number", Set(8, "/decision/decisionId", json!("2")), 8, "decisionId is 2 and must be 1"),
        ("its kind", Set(8, "/decision/kind", json!("DECISION_KIND_EXCHANGE")), 8, "kind is \"DECISION_KIND_EXCHANGE\" and must be \"DECISION_KIND_TURN\""),
        ("the action", Set(8, "/decision/action", json!(199)), 8, "text is \"C10;Q3;J0\" and must be \"pass\""),
        ("an action of no kind", Set(8, "/decision/action", json!(4711)), 8, "must be below 214"),
        ("a mask bit", Set(8, "/decision/actionMask", json!("AAAAAAIAAQAEAIAEAAAAAAAgAAAAAAAAgAAA")), 8, "actionMask has C10;Q2;J0 as not legal, but it is"),
        ("no mask", Unset(8, "/decision", "actionMask"), 8, "actionMask has 0 bytes and must have 27"),
        ("an attempt that was legal", Set(10, "/decision/invalidAttempts/1", json!(199)), 10, "invalidAttempts[1] is 199, which was legal"),
        ("an attempt too few", Set(10, "/decision/invalidAttempts", json!([85, 92])), 10, "invalidReward is \"-3\" and must be \"-2\""),
        ("the attempts' reward", Set(10, "/decision/invalidReward", json!(3.0)), 10, "invalidReward is \"3\" and must be \"-3\""),
        ("the source", Set(8, "/decision/source", json!("DECISION_SOURCE_SUBSTITUTE")), 8, "the seat's own agent plays"),
        ("taken over from nowhere", Set(8, "/decision/source", json!("DECISION_SOURCE_RECORDED")), 8, "all decisions taken over from another record came before"),
        ("a default that is none", Set(6, "/decision/source", json!("DECISION_SOURCE_TIMEOUT")), 6, "the default decision, because source is DECISION_SOURCE_TIMEOUT"),
        ("too long a time", Set(8, "/decision/decisionTimeUs", json!("9000000")), 8, "only 2 ms passed"),
        ("a negative time", Set(8, "/decision/decisionTimeUs", json!("-5")), 8, "is not a line of a record"),
        ("a built-in agent's time", Set(12, "/decision/decisionTimeUs", json!("5")), 12, "decisionTimeUs is 5 and must be 0"),
        ("the bank", Set(14, "/decision/bankLeftMs", json!(30)), 14, "bankLeftMs is 30 and must be 18"),
        ("the clock", Set(14, "/decision/elapsedMs", json!("3")), 14, "elapsedMs is 3, but an earlier line has 40"),
        ("a clock of another age", Set(14, "/decision/elapsedMs", json!("253402300799999")), 14, "is after the year 9999"),
        ("endless attempts", Set(8, "/decision/invalidAttempts", json!(vec![4711; 10_001])), 8, "has more than 10000 entries in `invalidAttempts`"),
        ("endless scores", Set(8, "/decision/annotations", json!({"actionScores": vec![1; 1025]})), 8, "has more than 1024 entries in `actionScores`"),
        ("annotations", Set(8, "/decision/annotations", json!({"valueEstimate": "NaN"})), 8, "not finite"),
        // Events.
        ("a sequence number", Set(9, "/event/sequence", json!("7")), 9, "sequence is 7 and must be 6"),
        ("an event's clock", Set(9, "/event/elapsedMs", json!("12")), 9, "elapsedMs is 12, but an earlier line has 40"),
        ("an event later than its decision", Set(9, "/event/elapsedMs", json!("41")), 9, "elapsedMs is \"41\" and must be \"40\""),
        ("a play", Set(9, "/event/play/quantity", json!(2)), 9, "play.quantity is 2 and must be 3"),
        ("cards left", Set(9, "/event/play/cardsLeft", json!(13)), 9, "play.cardsLeft is 13 and must be 14"),
        ("an event's source", Set(22, "/event/pass/source", json!("DECISION_SOURCE_AGENT")), 22, "pass.source"),
        ("an event's time", Set(22, "/event/pass/decisionTimeUs", json!("1")), 22, "pass.decisionTimeUs"),
        ("a reward", Set(9, "/event/rewards/0/value", json!(0.5)), 9, "rewards[0].value is 0.5"),
        ("no reward", Unset(9, "/event", "rewards"), 9, "rewards is [] and must be a list of 1"),
        ("rewards for nobody", Set(9, "/event/rewards", json!(vec![json!({}); 7])), 9, "has more than 6 entries in `rewards`"),
        ("a reward for nothing", Set(51, "/event/rewards", json!([{"seat": 2, "value": 1.0}])), 51, "this event has none"),
        ("another event", Set(11, "/event", json!({"sequence": "7", "elapsedMs": "40", "seatFinished": {"place": 1}})), 11, "the event is `seatFinished` and must be `pass`"),
        ("an event of no kind", Unset(11, "/event", "pass"), 11, "the event is empty"),
        ("a score", Set(170, "/event/shiftEnded/points/3", json!("6")), 170, "shiftEnded.points"),
        ("a place", Set(170, "/event/shiftEnded/order", json!([3, 1, 0, 2])), 170, "shiftEnded.order is [3,1,0,2] and must be [3,1,2,0]"),
        ("adjudicated", Set(320, "/event/shiftEnded/adjudicated", json!(true)), 320, "shiftEnded.adjudicated is true and must be false"),
        // The end.
        ("the standings", Set(492, "/event/gameEnded/standings/0/seat", json!(1)), 492, "gameEnded.standings[0].seat is 1 and must be 3"),
        ("no reveal", Unset(492, "/event/gameEnded", "reveal"), 492, "reveal.gameSeed is missing"),
        ("a byte of the server's seed", Set(492, "/event/gameEnded/reveal/serverSeed", json!("9GRkNt0jUcBkfF9tXwi6WIxfnmqzjw+xmE/FKx5LlvA=")), 492, "do not match the commitment"),
        ("a byte of the nonce", Set(492, "/event/gameEnded/reveal/nonce", json!("mY7lOltXOG+maFJCgTsyswJqt40wyyKTiz6hkoW3VLA=")), 492, "do not match the commitment"),
        ("a short nonce", Set(492, "/event/gameEnded/reveal/nonce", json!("mY7l")), 492, "reveal.nonce has 3 bytes and must have 32"),
        ("a byte of the game seed", Set(492, "/event/gameEnded/reveal/gameSeed", json!("5cfvpVRBjZkKjKJuMEg/mDII9UnBd79z5rKVnYts940=")), 492, "reveal.gameSeed"),
        ("a seat's bytes", Set(492, "/event/gameEnded/reveal/seatEntropy/2", json!("AAAA")), 5, "revealed on line 492"),
        ("bytes of seats that are not there", Set(492, "/event/gameEnded/reveal/seatEntropy", json!(vec![""; 7])), 492, "has more than 6 entries in `seatEntropy`"),
        ("a seat's bytes left out", Set(492, "/event/gameEnded/reveal/seatEntropy", json!([])), 492, "seatEntropy has 0 entries"),
        ("aborted instead", Set(492, "/event", json!({"sequence": "284", "elapsedMs": "207", "gameAborted": {"reason": "ABORT_REASON_CLOSED"}})), 492, "reveal.gameSeed is missing"),
        ("the footer's count", Set(493, "/footer/decisions", json!("206")), 493, "footer.decisions is \"206\" and must be \"207\""),
        ("how it ended", Set(493, "/footer/state", json!("ROOM_STATE_ABORTED")), 493, "footer.state"),
        // Lines.
        ("no header", Drop(1), 1, "the first line must be the header"),
        ("two headers", Double(1), 2, "is a second header: a file holds one record"),
        ("two starts", Double(4), 5, "starts the game a second time"),
        ("a decision dropped", Drop(8), 8, "`play` follows from no decision"),
        ("an event dropped", Drop(9), 9, "`play` must come here"),
        ("the game's end dropped", Drop(492), 492, "the footer comes here, but the game is not over"),
        ("a decision doubled", Double(8), 9, "`play` must come here"),
        ("an event doubled", Double(9), 10, "sequence is 6 and must be 7"),
        ("lines swapped", Swap(8, 9), 8, "`play` follows from no decision"),
        ("the footer in the middle", Swap(20, 493), 20, "the game is not over"),
        ("more behind the footer", Append(r#"{"footer":{}}"#), 494, "continues after its footer"),
        ("an empty line", Bytes(30, b"{}".to_vec()), 30, "is empty"),
        // The file.
        ("cut behind a line", CutBehind(300), 301, "it ends before the game does"),
        ("no footer", CutBehind(492), 493, "it ends before its footer"),
        ("cut within a line", CutWithin(300), 300, "is truncated"),
        ("an empty file", CutBehind(0), 1, "the file is empty"),
        ("a blank line", Bytes(40, Vec::new()), 40, "is not JSON"),
        ("no JSON", Bytes(40, b"{\"event\": }".to_vec()), 40, "is not JSON: expected value (column 11)"),
        ("other JSON", Bytes(40, b"{\"match\":1}".to_vec()), 40, "is not a line of a record: unknown field `match`"),
        ("what moves a cursor", Bytes(40, br#"{"\u001b[1A\u001b[2Kfits\u009b":1}"#.to_vec()), 40, "unknown field `\u{fffd}[1A\u{fffd}[2Kfits\u{fffd}`"),
        ("a value that moves a cursor", Bytes(40, br#"{"event":{"pass":{"source":"\u001b[2J"}}}"#.to_vec()), 40, "unknown variant `\u{fffd}[2J`"),
        ("no text", Bytes(40, b"{\"event\":\"\xff\"}".to_vec()), 40, "is not UTF-8 text (at byte 11"),
        ("a line without end", Bytes(40, vec![b' '; MAX_LINE_BYTES]), 40, "is longer than 262144 bytes"),
    ]
}

#[test]
fn each_damage_is_reported_at_the_first_wrong_line() {
    let path = fixture_path("committed.jsonl");
    assert_eq!(verdict(&path), None);
    let text = std::fs::read_to_string(&path).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let copy = folder.path().join("damaged.jsonl");
    let damages = damages();
    assert!(damages.len() >= 20);
    let mut wrong = Vec::new();
    for (name, damage, line, words) in &damages {
        std::fs::write(&copy, damaged(&text, damage)).unwrap();
        match verdict(&copy) {
            Some((named, said)) if named == *line && said.contains(words) => {}
            other => wrong.push(format!("{name}: line {line}, {words:?}: {other:?}")),
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
