//! Import of games at real tables: a transcript of any part of a game becomes a record that
//! verifies. Refusals are in `refused`, what is known of the hands in `known`.

mod known;
mod refused;

use std::fmt::Write as _;

use chefshat_engine::{RuleSetSpec, Stop};
use chefshat_proto::v1::{self, game_event::Kind};
use chefshat_record::import::import;
use chefshat_record::replay::replay;
use chefshat_record::testing::{Observed, TestGame, decisions, events, header, transcript};

fn spec(players: u8, faces: u8, shifts: u32) -> RuleSetSpec {
    RuleSetSpec {
        players,
        faces,
        stop: Stop::Shifts(shifts),
        ..RuleSetSpec::default()
    }
}

/// The public events of a game, without sequence numbers and cards that may be unknown.
fn public_events(lines: &[v1::RecordLine]) -> Vec<String> {
    events(lines)
        .filter_map(|(_, kind)| match kind {
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
fn any_transcript_of_a_game_becomes_a_record_that_verifies() {
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
    let some = |hands, gifts| Observed {
        hands,
        gifts,
        ..Observed::TURNS
    };
    let observations = [
        Observed::TURNS,
        Observed::EVERYTHING,
        some(1, 3),
        some(0b101, 0),
        some(0, 0b1111),
        some(2, u32::MAX),
    ];
    let mut games = 0;
    for spec in specs {
        let rules = spec.validate().unwrap();
        for chance in 0..2 {
            let played = TestGame::dealt(rules, 7 + chance, chance.into()).played();
            for observed in observations {
                let text = transcript(&rules, &played, observed);
                let record = import(text.as_bytes())
                    .unwrap_or_else(|error| panic!("{error}\n{observed:?}\n{text}"));
                assert_eq!(
                    public_events(&record),
                    public_events(&played),
                    "{observed:?}"
                );
                assert_eq!(replay(&record).unwrap().state, v1::RoomState::Finished);
                games += 1;
            }
        }
    }
    assert_eq!(games, 8 * 2 * 6);
}

#[test]
fn a_transcript_that_breaks_off_becomes_an_aborted_game() {
    let rules = spec(4, 11, 3).validate().unwrap();
    let played = TestGame::dealt(rules, 5, 9).played();
    let turns = public_events(&played)
        .iter()
        .filter(|event| event.starts_with("Play(") || event.starts_with("Pass("))
        .count();
    assert!(turns > 100, "{turns} turns");
    for hands in [0, 0b1000] {
        for turns in (0..turns).step_by(7) {
            let observed = Observed {
                hands,
                turns,
                ..Observed::TURNS
            };
            let text = transcript(&rules, &played, observed);
            let record = import(text.as_bytes())
                .unwrap_or_else(|error| panic!("after {turns} turns: {error}\n{text}"));
            let replayed = replay(&record).unwrap();
            assert_eq!(replayed.state, v1::RoomState::Aborted);
            assert!(
                public_events(&played)
                    .starts_with(&public_events(&record)[..public_events(&record).len() - 1])
            );
        }
    }
}

/// The transcript in the documentation: a short game with one card set aside.
fn documented() -> String {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/records.md");
    let text = std::fs::read_to_string(path).unwrap();
    let (_, block) = text.split_once("```csv\n").expect("there is an example");
    block.split_once("```").unwrap().0.to_owned()
}

#[test]
fn the_documented_transcript_becomes_a_record() {
    let text = documented();
    let mut record = import(text.as_bytes()).unwrap();
    let again = import(text.as_bytes()).unwrap();
    assert_eq!(record, again, "the result is deterministic");
    let replayed = replay(&record).unwrap();
    assert_eq!((replayed.decisions, replayed.events), (7, 17));
    assert_eq!(replayed.standings[0].seat, 0);
    let header = header(&mut record);
    assert_eq!(header.origin(), v1::GameOrigin::Imported);
    assert_eq!(header.room_name, "Lab table 3");
    assert_eq!(header.created_at_ms, 1_773_500_400_000);
    // Ana's hand is stated. One card of Pepper's is not, and another was set aside.
    let known = known::knowledge(&record);
    assert!(
        known
            .iter()
            .all(|(seat, hand, mask)| (*hand, *mask) == (*seat == 0, *seat == 0))
    );
    let times = decisions(&record).map(|it| (it.elapsed_ms, it.decision_time_us));
    let times: Vec<(u64, u64)> = times.collect();
    assert_eq!(
        times[..3],
        [(4500, 3_100_000), (9000, 2_250_000), (12_000, 1_000_000)]
    );
    let shown = events(&record).find_map(|(event, kind)| match kind {
        Kind::ExpressionShown(shown) => Some((event.elapsed_ms, shown.seat)),
        _ => None,
    });
    assert_eq!(shown, Some((12_500, 0)));
}

/// A complete transcript of the second Shift of a game, without the first.
fn from_the_second_shift() -> (String, Vec<v1::RecordLine>) {
    let rules = spec(4, 11, 2).validate().unwrap();
    let played = TestGame::dealt(rules, 11, 2).played();
    let complete = transcript(&rules, &played, Observed::EVERYTHING);
    let (_, second) = complete.split_once("\n2,").unwrap();
    let ended = events(&played).find_map(|(_, kind)| match kind {
        Kind::ShiftEnded(ended) => Some(ended.clone()),
        _ => None,
    });
    let ended = ended.unwrap();
    let mut text: String = complete
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
fn a_transcript_may_begin_with_a_later_shift() {
    let (text, played) = from_the_second_shift();
    let record = import(text.as_bytes()).unwrap_or_else(|error| panic!("{error}\n{text}"));
    let (all, later) = (public_events(&played), public_events(&record));
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

/// The second Shift of a game of six with 122 cards and two stated hands of rare cards: few of the
/// many possible gifts fit.
const SPARSE: &str = "\
shift,seat,what,value
,,rules,paper players=6 faces=15 jokers=2 target_points=60
,0,human,a
,1,human,b
,2,human,c
,3,human,d
,4,human,e
,5,human,f
2,0,role,Chef
2,1,role,Sous-Chef
2,2,role,Cook
2,3,role,Cook
2,4,role,Waiter
2,5,role,Dishwasher
2,2,hand,1 2 2 3 3 3 4 4 4 4 5 5 5 5 5 6 6 6 6 6
2,3,hand,6 7 7 7 7 7 7 7 8 8 8 8 8 8 8 8 9 9 9 9
2,0,plays,G 15
2,1,passes,
2,2,passes,
";

#[test]
fn gifts_that_fit_are_found_among_many_that_do_not() {
    let record = import(SPARSE.as_bytes()).unwrap();
    assert_eq!(replay(&record).unwrap().decisions, 3);
    // All gifts are stated.
    let seen = SPARSE.replace(
        "2,0,plays",
        "2,5,gives,9 9\n2,4,gives,9\n2,0,gives,15 15\n2,1,gives,15\n2,0,plays",
    );
    let record = import(seen.as_bytes()).unwrap();
    assert_eq!(replay(&record).unwrap().decisions, 6);
}

/// Two Shifts of a game, with the notes on the second after its last turn.
const NOTED: &str = "\
shift,seat,what,value
,,rules,paper players=2 faces=4 jokers=1 target_points=100 exchange=off special_actions=off
,0,human,Ana
,1,robot,Pepper
1,0,plays,4 4 4 4
1,1,passes,
1,0,plays,1
1,1,points,0
2,1,role,Dishwasher
2,1,plays,4 4 4 4
2,0,passes,
2,1,plays,3
2,1,finishes,1
2,0,role,Chef
2,0,points,5
3,0,role,Dishwasher
";

#[test]
fn notes_on_a_shift_may_follow_its_last_turn() {
    let record = import(NOTED.as_bytes()).unwrap();
    assert_eq!(replay(&record).unwrap().decisions, 6);
}
