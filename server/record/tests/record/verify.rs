//! Verification of records with every kind of start, and refusal of altered starts.

use crate::fixture;
use chefshat_engine::{BySeat, Game, Script, Seat, SeatOrder, Seed};
use chefshat_proto::v1::{self, record_line::Line};
use chefshat_record::branch::branch_of;
use chefshat_record::replay::{replay, walk};

use chefshat_record::testing::{TestGame, header, shifts};

/// A game that begins in its third Shift, with the hands of another deal.
fn scripted() -> Vec<v1::RecordLine> {
    let rules = shifts(5);
    let dealt = Game::new(rules, Seed([9; 32]), |_| {});
    let order = [2, 0, 3, 1].map(Seat::new);
    let game = TestGame {
        script: Some(Script {
            shift: 3,
            hands: *dealt.hands(),
            last_order: SeatOrder::from_slice(&order),
            scores: BySeat::from_slice(&[6, 2, 8, 2]).unwrap(),
            drawn: None,
        }),
        ..TestGame::dealt(rules, 7, 3)
    };
    game.played()
}

/// A game that branches in the middle of another.
fn branched() -> Vec<v1::RecordLine> {
    let before = TestGame::dealt(shifts(3), 7, 3).played();
    let branch = branch_of(&before, 100).unwrap();
    let game = TestGame {
        branch: Some(&branch),
        ..TestGame::dealt(shifts(3), 8, 4)
    };
    game.played()
}

fn start(lines: &mut [v1::RecordLine]) -> &mut v1::GameStart {
    header(lines).start.as_mut().unwrap()
}

fn decision(lines: &mut [v1::RecordLine], number: usize) -> &mut v1::DecisionRecord {
    let decisions = lines.iter_mut().filter_map(|line| match &mut line.line {
        Some(Line::Decision(decision)) => Some(decision),
        _ => None,
    });
    decisions.into_iter().nth(number).unwrap()
}

#[test]
fn recorded_games_verify() {
    for (file, decisions, events, winner) in [
        ("committed.jsonl", 207, 284, 3),
        ("fixed.jsonl", 96, 130, 2),
    ] {
        let lines = fixture(file);
        let replayed = replay(&lines).unwrap_or_else(|error| panic!("{file}: {error}"));
        assert_eq!(replayed.state, v1::RoomState::Finished, "{file}");
        assert_eq!(
            (
                replayed.decisions,
                replayed.events,
                replayed.standings[0].seat
            ),
            (decisions, events, winner),
            "{file}"
        );
    }
}

#[test]
fn a_walk_shows_every_line_with_the_game_before_its_decision() {
    let lines = scripted();
    let (mut shown, mut decisions) = (0, 0);
    walk(&lines, |moment| {
        shown += 1;
        assert_eq!(moment.line, shown);
        assert!(moment.hands_known.values().all(|known| *known));
        if let Line::Decision(decision) = moment.entry {
            decisions += 1;
            let game = moment.game.unwrap();
            let open = game.decision().unwrap();
            assert_eq!(open.seat.index(), decision.seat as usize);
        }
    })
    .unwrap();
    assert_eq!(shown, lines.len());
    assert!(decisions > 50, "{decisions} decisions");
}

#[test]
fn a_scripted_game_verifies_from_its_hands() {
    let lines = scripted();
    let replayed = replay(&lines).unwrap();
    assert_eq!(replayed.standings.len(), 4);

    type Change = fn(&mut Vec<v1::RecordLine>);
    let changes: [(&str, Change, usize, &str); 6] = [
        (
            "the script left out",
            |lines| header(lines).start = None,
            1,
            "start.scripted is missing",
        ),
        (
            "cards that are not in the deck",
            |lines| start(lines).scripted.as_mut().unwrap().hands[0].cards[0] = 1,
            1,
            "start.scripted.hands: ",
        ),
        (
            "a Shift without an order",
            |lines| start(lines).scripted.as_mut().unwrap().last_order.clear(),
            1,
            "start.scripted.last_order: ",
        ),
        (
            "the game would have ended",
            |lines| start(lines).scripted.as_mut().unwrap().shift = 6,
            1,
            "start.scripted.points: the game would have ended",
        ),
        (
            "two hands changed places",
            |lines| {
                let hands = &mut start(lines).scripted.as_mut().unwrap().hands;
                let cards = hands[0].cards.clone();
                hands[0].cards = std::mem::replace(&mut hands[1].cards, cards);
                let golden = hands[0].golden;
                hands[0].golden = std::mem::replace(&mut hands[1].golden, golden);
            },
            7,
            "shiftStarted.hands[0].cards",
        ),
        (
            "other points",
            |lines| start(lines).scripted.as_mut().unwrap().points[1] = 3,
            0,
            "shiftEnded.points",
        ),
    ];
    for (name, change, line, words) in changes {
        let mut changed = lines.clone();
        change(&mut changed);
        let error = replay(&changed).expect_err(name);
        assert!(error.problem.contains(words), "{name}: {error}");
        assert!(line == 0 || error.line == line, "{name}: {error}");
    }
}

#[test]
fn a_branched_game_verifies_from_the_seeds_it_took_over() {
    let lines = branched();
    let replayed = replay(&lines).unwrap();
    assert!(replayed.decisions > 100);

    type Change = fn(&mut Vec<v1::RecordLine>);
    let changes: [(&str, Change, &str); 6] = [
        (
            "a seed that was not the one",
            |lines| start(lines).taken_over[0].game_seed[0] ^= 1,
            "shiftStarted.hands[0].cards",
        ),
        (
            "half a seed",
            |lines| start(lines).taken_over[0].game_seed.truncate(16),
            "a gameSeed does not have 32 bytes",
        ),
        (
            "fewer decisions",
            |lines| start(lines).taken_over[0].decisions -= 1,
            "start.branchedFrom.decisions is 100 and must be 99",
        ),
        (
            "fewer decisions on both sides",
            |lines| {
                start(lines).taken_over[0].decisions -= 1;
                start(lines).branched_from.as_mut().unwrap().decisions -= 1;
            },
            "all decisions taken over from another record came before",
        ),
        (
            "an agent took the last one that was taken over",
            |lines| decision(lines, 99).source = v1::DecisionSource::Agent.into(),
            "must be \"DECISION_SOURCE_RECORDED\"",
        ),
        (
            "a game that is none",
            |lines| {
                start(lines)
                    .branched_from
                    .as_mut()
                    .unwrap()
                    .game_id
                    .push('0')
            },
            "start.branchedFrom.gameId",
        ),
    ];
    for (name, change, words) in changes {
        let mut changed = lines.clone();
        change(&mut changed);
        let error = replay(&changed).expect_err(name);
        assert!(error.problem.contains(words), "{name}: {error}");
    }
}
