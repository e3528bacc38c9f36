//! Games of real tables: whatever of a game was written down, it becomes a record that replays, with what nobody wrote down left out; what
//! cannot have happened is refused at its row.

use std::fmt::Write as _;

use chefshat_engine::{RuleSet, RuleSetSpec, Stop};
use chefshat_proto::v1::{self, game_event::Kind, record_line::Line};
use chefshat_records::replay::{replay, walk};
use chefshat_records::table::import;

use super::made::Making;

/// What of a game is written down.
#[derive(Debug, Clone, Copy)]
struct Told {
    /// Seats whose hands are, one bit for each.
    hands: u32,
    /// Seats whose gifts are, one bit for each.
    gifts: u32,
    /// Whether declined special actions are.
    declines: bool,
    /// How many turns are.
    turns: usize,
}

const NOTHING: Told = Told {
    hands: 0,
    gifts: 0,
    declines: false,
    turns: usize::MAX,
};
const EVERYTHING: Told = Told {
    hands: u32::MAX,
    gifts: u32::MAX,
    declines: true,
    turns: usize::MAX,
};

fn rules_text(rules: &RuleSet) -> String {
    let spec = rules.spec();
    let on = |on| if on { "on" } else { "off" };
    let mut text = format!(
        "paper players={} faces={} jokers={} exchange={} special_actions={}",
        spec.players,
        spec.faces,
        spec.jokers,
        on(spec.exchange),
        on(spec.special_actions)
    );
    match spec.stop {
        Stop::Points(points) => write!(text, " target_points={points}"),
        Stop::Shifts(shifts) => write!(text, " target_shifts={shifts}"),
    }
    .unwrap();
    let points: Vec<String> = spec.points.iter().map(u32::to_string).collect();
    write!(text, " points={}", points.join("/")).unwrap();
    if spec.opening == chefshat_engine::Opening::AnyTopFace {
        text.push_str(" opening=any_top_face");
    }
    if spec.opening_pass {
        text.push_str(" opening_pass=allowed");
    }
    if spec.pass_scope == chefshat_engine::PassScope::Turn {
        text.push_str(" pass_scope=turn");
    }
    text
}

fn cards_text(cards: &[u32], golden: bool, faces: u32) -> String {
    let mut golden = golden;
    let words: Vec<String> = cards
        .iter()
        .map(|card| match *card {
            card if card > faces => "J".to_owned(),
            card if card == faces && std::mem::take(&mut golden) => "G".to_owned(),
            card => card.to_string(),
        })
        .collect();
    words.join(" ")
}

/// The game of a record as somebody might have written it down who saw only a part of it.
fn transcript(rules: &RuleSet, lines: &[v1::RecordLine], told: Told) -> String {
    let faces = u32::from(rules.faces());
    let mut text = String::from("shift,seat,what,value\n");
    writeln!(text, ",,rules,{}", rules_text(rules)).unwrap();
    for seat in 0..rules.players() {
        writeln!(text, ",{seat},human,player {seat}").unwrap();
    }
    let (mut shift, mut turns, mut rows) = (0, 0, String::new());
    for line in lines {
        if turns >= told.turns {
            break;
        }
        match line.line.as_ref().unwrap() {
            Line::Decision(decision) if told.declines && decision.text == "decline" => {
                writeln!(rows, "{shift},{},declines,", decision.seat).unwrap();
            }
            Line::Event(event) => match event.kind.as_ref().unwrap() {
                Kind::ShiftStarted(started) => {
                    shift = started.shift;
                    for hand in &started.hands {
                        if told.hands >> hand.seat & 1 == 1 {
                            let cards = cards_text(&hand.cards, hand.golden, faces);
                            writeln!(rows, "{shift},{},hand,{cards}", hand.seat).unwrap();
                        }
                    }
                }
                Kind::SpecialActionDeclared(declared) => {
                    writeln!(rows, "{shift},{},declares,", declared.seat).unwrap();
                }
                Kind::CardsExchanged(exchanged) if told.gifts >> exchanged.giver & 1 == 1 => {
                    let cards = cards_text(&exchanged.cards, exchanged.golden, faces);
                    writeln!(rows, "{shift},{},gives,{cards}", exchanged.giver).unwrap();
                }
                Kind::Play(play) => {
                    turns += 1;
                    let mut cards = vec![play.face; play.quantity as usize];
                    cards.extend(vec![faces + 1; play.jokers as usize]);
                    let cards = cards_text(&cards, false, faces);
                    writeln!(rows, "{shift},{},plays,{cards}", play.seat).unwrap();
                }
                Kind::Pass(pass) => {
                    turns += 1;
                    writeln!(rows, "{shift},{},passes,", pass.seat).unwrap();
                }
                Kind::SeatFinished(finished) => {
                    let place = finished.place;
                    writeln!(rows, "{shift},{},finishes,{place}", finished.seat).unwrap();
                }
                _ => {}
            },
            _ => {}
        }
    }
    text + &rows
}

fn spec(players: u8, faces: u8, shifts: u32) -> RuleSetSpec {
    RuleSetSpec {
        players,
        faces,
        stop: Stop::Shifts(shifts),
        ..RuleSetSpec::default()
    }
}

/// The public events and decisions of a game, without numbers and what may be unknown.
fn course(lines: &[v1::RecordLine]) -> Vec<String> {
    let kinds = lines.iter().filter_map(|line| match &line.line {
        Some(Line::Event(event)) => event.kind.clone(),
        _ => None,
    });
    kinds
        .filter_map(|kind| match kind {
            Kind::Seated(_) | Kind::GameStarted(_) => None,
            Kind::ShiftStarted(started) => Some(format!("Shift {}", started.shift)),
            Kind::CardsExchanged(exchanged) => Some(format!(
                "{} gives {} to {}",
                exchanged.giver, exchanged.count, exchanged.receiver
            )),
            Kind::GameEnded(ended) => Some(format!("{:?}", ended.standings)),
            other => Some(format!("{other:?}")),
        })
        .collect()
}

#[test]
fn whatever_is_told_of_a_game_becomes_a_record_that_replays() {
    let original = RuleSetSpec {
        stop: Stop::Shifts(3),
        ..RuleSetSpec::preset("original2020").unwrap()
    };
    let specs = [
        spec(4, 11, 4),
        original,
        spec(2, 7, 3),
        spec(3, 9, 3),
        spec(5, 11, 3),
        spec(6, 12, 3),
        spec(4, 4, 6),
        spec(3, 4, 6),
    ];
    let some = |hands, gifts| Told {
        hands,
        gifts,
        ..NOTHING
    };
    let tellings = [
        NOTHING,
        EVERYTHING,
        some(1, 3),
        some(0b101, 0),
        some(0, 0b1111),
        some(2, u32::MAX),
    ];
    let mut games = 0;
    for spec in specs {
        let rules = spec.validate().unwrap();
        for chance in 0..2 {
            let played = Making::dealt(rules, 7 + chance, chance.into())
                .record(|_| v1::DecisionSource::Agent);
            for told in tellings {
                let text = transcript(&rules, &played, told);
                let record = import(text.as_bytes())
                    .unwrap_or_else(|error| panic!("{error}\n{told:?}\n{text}"));
                assert_eq!(course(&record), course(&played), "{told:?}");
                assert_eq!(replay(&record).unwrap().state, v1::RoomState::Finished);
                games += 1;
            }
        }
    }
    assert_eq!(games, 8 * 2 * 6);
}

#[test]
fn a_game_that_was_broken_off_is_told_as_far_as_it_went() {
    let rules = spec(4, 11, 3).validate().unwrap();
    let played = Making::dealt(rules, 5, 9).record(|_| v1::DecisionSource::Agent);
    let turns = course(&played)
        .iter()
        .filter(|event| event.starts_with("Play(") || event.starts_with("Pass("))
        .count();
    assert!(turns > 100, "{turns} turns");
    for hands in [0, 0b1000] {
        for turns in (0..turns).step_by(7) {
            let told = Told {
                hands,
                turns,
                ..NOTHING
            };
            let text = transcript(&rules, &played, told);
            let record = import(text.as_bytes())
                .unwrap_or_else(|error| panic!("after {turns} turns: {error}\n{text}"));
            let replayed = replay(&record).unwrap();
            assert_eq!(replayed.state, v1::RoomState::Aborted);
            assert!(course(&played).starts_with(&course(&record)[..course(&record).len() - 1]));
        }
    }
}

/// Which hands are known, and for which decisions there are masks, by seat.
fn knowledge(record: &[v1::RecordLine]) -> Vec<(u32, bool, bool)> {
    let mut known = Vec::new();
    walk(record, |moment| {
        if let Line::Decision(decision) = moment.entry {
            let seat = chefshat_engine::Seat::new(decision.seat as usize);
            let hand_known = moment.hands_known[seat];
            known.push((decision.seat, hand_known, !decision.action_mask.is_empty()));
        }
    })
    .unwrap();
    known
}

#[test]
fn a_hand_is_known_where_it_is_told_or_follows_from_what_is_told() {
    let rules = spec(4, 11, 2).validate().unwrap();
    let played = Making::dealt(rules, 5, 9).record(|_| v1::DecisionSource::Agent);
    // Watched to the end, all hands of the standard game follow from the cards that were played.
    let whole = import(transcript(&rules, &played, NOTHING).as_bytes()).unwrap();
    let known = knowledge(&whole);
    assert!(known.len() > 50, "{} decisions", known.len());
    assert!(known.iter().all(|(_, hand, mask)| *hand && *mask));
    // Broken off early, only the hand that was told is known.
    let told = Told {
        hands: 0b0100,
        turns: 20,
        ..NOTHING
    };
    let broken_off = import(transcript(&rules, &played, told).as_bytes()).unwrap();
    let known = knowledge(&broken_off);
    assert_eq!(known.len(), 20);
    for (seat, hand, mask) in known {
        assert_eq!((hand, mask), (seat == 2, seat == 2));
    }
    let hands: Vec<usize> = broken_off
        .iter()
        .filter_map(|line| match &line.line {
            Some(Line::Event(event)) => match &event.kind {
                Some(Kind::ShiftStarted(started)) => Some(started.hands.len()),
                _ => None,
            },
            _ => None,
        })
        .collect();
    assert_eq!(hands, [1]);
}

/// A short game with one card set aside, as the documentation tells it.
fn documented() -> String {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/records.md");
    let text = std::fs::read_to_string(path).unwrap();
    let (_, block) = text.split_once("```csv\n").expect("there is an example");
    block.split_once("```").unwrap().0.to_owned()
}

#[test]
fn the_documented_transcript_becomes_a_record() {
    let text = documented();
    let record = import(text.as_bytes()).unwrap();
    assert_eq!(record, import(text.as_bytes()).unwrap(), "twice the same");
    let replayed = replay(&record).unwrap();
    assert_eq!((replayed.decisions, replayed.events), (7, 17));
    assert_eq!(replayed.standings[0].seat, 0);
    let Some(Line::Header(header)) = &record[0].line else {
        panic!("{:?}", record[0])
    };
    assert_eq!(header.origin(), v1::GameOrigin::Imported);
    assert_eq!(header.room_name, "Lab table 3");
    assert_eq!(header.created_at_ms, 1_773_500_400_000);
    // Ana's hand was shown. Of Pepper's, one card was neither played nor seen, and another was set aside.
    let known = knowledge(&record);
    assert!(
        known
            .iter()
            .all(|(seat, hand, mask)| (*hand, *mask) == (*seat == 0, *seat == 0))
    );
    let times: Vec<(u64, u64)> = record
        .iter()
        .filter_map(|line| match &line.line {
            Some(Line::Decision(decision)) => {
                Some((decision.elapsed_ms, decision.decision_time_us))
            }
            _ => None,
        })
        .collect();
    assert_eq!(
        times[..3],
        [(4500, 3_100_000), (9000, 2_250_000), (12_000, 1_000_000)]
    );
    let shown = record.iter().find_map(|line| match &line.line {
        Some(Line::Event(event)) => match &event.kind {
            Some(Kind::ExpressionShown(shown)) => Some((event.elapsed_ms, shown.seat)),
            _ => None,
        },
        _ => None,
    });
    assert_eq!(shown, Some((12_500, 0)));
}

#[test]
fn rows_that_cannot_be_are_named() {
    // What is replaced in the documented transcript, by what, the line and words of the refusal.
    #[rustfmt::skip] // A table is read by its rows.
    let cases = [
        ("seconds,took", "seconds,takes", 1, "there is no column \"takes\""),
        ("shift,seat,what", "shift,seat,why", 1, "there is no column \"why\""),
        ("paper players=2", "chess players=2", 7, "rules: preset"),
        ("players=2", "players=3", 7, "each of the seats 0..=2 needs one row"),
        ("faces=4", "faces=four", 3, "\"four\" is not a value of faces"),
        ("2026-03-14T15:00:00Z", "yesterday", 4, "a time is written like"),
        (",0,human,Ana", ",1,human,Ana", 6, "seat 1 is taken already"),
        ("1,0,hand,1 3 3 4 G", "1,0,hand,1 3 3 4", 7, "seat 0 was dealt 4 cards, but 5 are dealt to each"),
        ("1,0,hand,1 3 3 4 G", "1,0,hand,1 1 3 4 G", 7, "no deck has so many cards of one kind"),
        ("1,0,hand,1 3 3 4 G", "1,0,hand,1 3 3 4 5", 7, "\"5\" is no card"),
        ("1,0,hand,1 3 3 4 G", "1,0,hand,1 3 3 4 4", 8, "the Golden card"),
        ("1,0,hand,1 3 3 4 G", "1,0,hand,1 2 3 4 G", 9, "of face 2 were dealt to or played by all seats together: 3, but the deck has 2"),
        ("1,0,hand,1 3 3 4 G", "1,0,holds,1 3 3 4 G", 7, "`what` is \"holds\""),
        ("1,0,hand,", "1,2,hand,", 7, "there is no seat 2"),
        ("1,0,plays,4 G,4.5", "1,0,plays,3 3,4.5", 8, "must play the Golden card"),
        ("1,0,plays,4 G,4.5", "1,0,plays,4 3,4.5", 8, "a play is cards of one face"),
        ("1,0,plays,4 G,4.5", "1,0,plays,J J,4.5", 8, "or one of them alone"),
        ("1,0,plays,4 G,4.5", "1,0,passes,,4.5", 8, "passing is not allowed on the Shift's first turn"),
        ("1,1,plays,2 2,9", "1,1,plays,2,9", 9, "at least 2 cards must be played"),
        ("1,1,plays,2 2,9", "1,1,plays,4 4,9", 9, "the face must be lower than the 4"),
        ("1,1,plays,2 2,9", "1,0,plays,3 3,9", 9, "it is seat 1's decision, not seat 0's"),
        ("1,1,plays,2 2,9", "1,1,plays,1 J,9", 9, "cards of face 1"),
        ("1,1,plays,2 2,9", "1,1,plays,2 2,3", 9, "`seconds` is earlier"),
        ("1,1,plays,2 2,9", "1,1,plays,2 2,soon", 9, "`seconds` is \"soon\""),
        ("surprise,0.4", "surprise,1.4", 11, "valence: 1.4 is not in -1..=1"),
        ("1,1,plays,4 J,15", "2,1,plays,4 J,15", 13, "Shifts are told of one after the other"),
        ("1,0,plays,1,21,,,,\n1,0,fin", "2,0,plays,1,21,,,,\n2,0,fin", 15, "by the rules Shift 1 is being played, not Shift 2"),
        ("1,1,plays,4 J,15", "1,1,plays,4 J J,15", 12, "too many jokers"),
        ("1,1,plays,4 J,15", "1,1,declares,,15", 12, "before the Shift's first turn"),
        ("1,0,finishes,1", "1,0,finishes,2", 16, "seat 0 has place 1 by the rules, not 2"),
        ("1,0,finishes,1", "1,1,passes,", 16, "by the rules the Shift, or the game, ended"),
        ("1,0,finishes,1", "1,0,points,3", 16, "seat 0 has 5 points by the rules, not 3"),
        ("1,0,finishes,1", "1,0,role,Chef", 16, "in the first Shift there are no roles"),
        ("1,0,finishes,1", "1,0,tries,1", 16, "its turn is not told of"),
        ("1,0,finishes,1,,,,,", "1,0,finishes,1", 16, "the row has 4 cells and must have 9"),
    ];
    let text = documented();
    let mut wrong = Vec::new();
    for (found, replaced, line, words) in cases {
        let changed = text.replacen(found, replaced, 1);
        assert_ne!(changed, text, "{found}");
        match import(changed.as_bytes()) {
            Err(error) if error.line == line && error.problem.contains(words) => {}
            Err(error) => wrong.push(format!("{replaced}: line {line}, {words:?}: {error}")),
            Ok(_) => wrong.push(format!("{replaced}: line {line}, {words:?}: it was taken")),
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// The second Shift of a game in which everything was written down, told as if nothing before it had been watched.
fn from_the_second_shift() -> (String, Vec<v1::RecordLine>) {
    let rules = spec(4, 11, 2).validate().unwrap();
    let played = Making::dealt(rules, 11, 2).record(|_| v1::DecisionSource::Agent);
    let whole = transcript(&rules, &played, EVERYTHING);
    let (_, second) = whole.split_once("\n2,").unwrap();
    let ended = played.iter().find_map(|line| match &line.line {
        Some(Line::Event(event)) => match &event.kind {
            Some(Kind::ShiftEnded(ended)) => Some(ended.clone()),
            _ => None,
        },
        _ => None,
    });
    let ended = ended.unwrap();
    let mut text: String = whole
        .lines()
        .take(6)
        .map(|line| format!("{line}\n"))
        .collect();
    for (seat, role) in ended
        .order
        .iter()
        .zip(["Chef", "Sous-Chef", "Waiter", "Dishwasher"])
    {
        let points = ended.points[*seat as usize];
        writeln!(text, "2,{seat},role,{role}\n2,{seat},points,{points}").unwrap();
    }
    (text + "2," + second, played)
}

#[test]
fn a_game_can_be_told_from_a_later_shift_on() {
    let (text, played) = from_the_second_shift();
    let record = import(text.as_bytes()).unwrap_or_else(|error| panic!("{error}\n{text}"));
    let (all, later) = (course(&played), course(&record));
    assert_eq!(later[..], all[all.len() - later.len()..]);
    assert!(later[0].starts_with("Shift 2"));

    let without_roles = text.replace(",role,Chef", ",note,Chef");
    assert!(import(without_roles.as_bytes()).is_err());
    let twice_chef = text.replacen(",role,Waiter", ",role,Chef", 1);
    let error = import(twice_chef.as_bytes()).unwrap_err();
    assert!(
        error.problem.contains("needs a row `role` for each seat"),
        "{error}"
    );
}

#[test]
fn gifts_are_checked_against_the_hands_that_were_seen() {
    let (text, _) = from_the_second_shift();
    let gives: Vec<(usize, &str)> = (1..)
        .zip(text.lines())
        .filter(|(_, line)| line.contains(",gives,"))
        .collect();
    assert_eq!(gives.len(), 4, "{text}");
    // The Dishwasher gives its two rarest cards, and nothing else.
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
    let seen_short = text.replacen(&right, &format!("2,{seat},gives,{}", cards[0]), 1);
    let error = import(seen_short.as_bytes()).unwrap_err();
    assert_eq!(error.line, line, "{error}");
}

#[test]
fn a_damaged_record_of_a_real_table_is_named() {
    let whole = import(documented().as_bytes()).unwrap();
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
            "nobody knows the hand",
        ),
        (
            |lines| {
                edit(lines, 8, |decision| {
                    decision.source = v1::DecisionSource::Timeout.into()
                })
            },
            8,
            "at a real table every player decides",
        ),
        (
            |lines| {
                if let Some(Line::Header(header)) = &mut lines[0].line {
                    header.seed_commitment = vec![0; 32];
                }
            },
            1,
            "seedCommitment has 32 bytes",
        ),
    ];
    for (change, line, words) in cases {
        let mut changed = whole.clone();
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
