//! Branches and players of records: the decisions taken over repeat the game up to the branch
//! point, and impossible branch points are refused.

use chefshat_engine::TakenOver;
use chefshat_engine::{ActionId, Game, RuleSet, RuleSetSpec, Script, Seat, Seed, Stop, Viewer};
use chefshat_proto::v1::{self, game_event::Kind, record_line::Line};
use chefshat_record::branch::{Branch, BranchError, branch_of};
use chefshat_record::import::import;
use chefshat_record::players::{PlayerError, recorded_player};
use chefshat_record::replay::{replay, walk};

use crate::fixture;
use chefshat_record::testing::{TestGame, aborted, taken_over};

/// Lines before the game starts: the header and four seated participants.
const SEATED: usize = 5;
const AGENT: v1::DecisionSource = v1::DecisionSource::Agent;

fn standard() -> RuleSet {
    let spec = RuleSetSpec {
        stop: Stop::Shifts(4),
        ..RuleSetSpec::default()
    };
    spec.validate().unwrap()
}

fn record() -> Vec<v1::RecordLine> {
    TestGame::dealt(standard(), 7, 1).record(|_| AGENT)
}

/// The recorded game before each of its decisions.
fn decisions_of(lines: &[v1::RecordLine]) -> Vec<(Game, ActionId)> {
    let mut decisions = Vec::new();
    walk(lines, |moment| {
        if let (Line::Decision(decision), Some(game)) = (moment.entry, moment.game) {
            let action = ActionId::new(u16::try_from(decision.action).unwrap());
            decisions.push((game.clone(), action));
        }
    })
    .unwrap();
    decisions
}

/// The game of a branch at its branch point, with the seed of the later deals.
fn game_at_point(branch: &Branch, seed: Seed) -> Game {
    branch.played(seed).unwrap()
}

#[test]
fn a_branch_repeats_the_game_up_to_every_point() {
    let lines = record();
    let course = decisions_of(&lines);
    assert!(course.len() > 100, "{} decisions", course.len());
    for (point, (game, _)) in course.iter().enumerate() {
        let branch = branch_of(&lines, point as u64).unwrap();
        assert_eq!(branch.rules, standard());
        assert_eq!(branch.script, None);
        assert_eq!(branch.later_deals, Some(Seed([7; 32])));
        let actions = course[..point].iter().map(|(_, action)| *action).collect();
        let seed = Seed([7; 32]);
        assert_eq!(branch.taken_over, [TakenOver { seed, actions }]);
        assert_eq!(game_at_point(&branch, seed), *game, "point {point}");
    }
}

#[test]
fn a_branch_continues_with_the_same_deals_or_others() {
    let lines = record();
    let course = decisions_of(&lines);
    // In the second Shift.
    let point = course
        .iter()
        .position(|(game, _)| game.shift() == 2)
        .unwrap()
        + 3;
    let branch = branch_of(&lines, point as u64).unwrap();
    let same = branch.later_deals.unwrap();
    let third = |seed| {
        let mut game = game_at_point(&branch, seed);
        for (_, action) in &course[point..] {
            if game.shift() == 3 {
                break;
            }
            game.apply(*action, |_| {}).unwrap();
        }
        assert_eq!(game.shift(), 3);
        *game.hands()
    };
    let recorded = course.iter().find(|(game, _)| game.shift() == 3).unwrap();
    assert_eq!(third(same), *recorded.0.hands());
    assert_ne!(third(Seed([8; 32])), *recorded.0.hands());
}

#[test]
fn a_branch_of_a_branch_has_the_seed_of_each_shift() {
    let first = record();
    let shift_of = |course: &[(Game, ActionId)], shift| {
        course
            .iter()
            .position(|(game, _)| game.shift() == shift)
            .unwrap()
    };
    let point = shift_of(&decisions_of(&first), 2) + 5;
    let branch = branch_of(&first, point as u64).unwrap();
    let second = TestGame {
        branch: Some(&branch),
        ..TestGame::dealt(standard(), 9, 2)
    }
    .record(|_| AGENT);
    replay(&second).unwrap();
    let course = decisions_of(&second);
    let third_shift = shift_of(&course, 3);
    assert!(point < third_shift);
    for at in [
        0,
        1,
        point - 1,
        point,
        point + 1,
        third_shift,
        course.len() - 1,
    ] {
        let again = branch_of(&second, at as u64).unwrap();
        assert_eq!(taken_over(&again), at as u64);
        assert_eq!(
            game_at_point(&again, course[at].0.seed()),
            course[at].0,
            "point {at}"
        );
        let seeds: Vec<u8> = again.taken_over.iter().map(|part| part.seed.0[0]).collect();
        let expected: &[u8] = if at <= point { &[7] } else { &[7, 9] };
        assert_eq!(seeds, expected, "point {at}");
        // From the first Shift on, one seed deals the second Shift and another the third.
        let first_shift = course[at].0.shift() == 1;
        let deals = again.later_deals.map(|seed| seed.0[0]);
        assert_eq!(deals, (!first_shift).then_some(9), "point {at}");
    }
}

#[test]
fn given_hands_are_taken_over() {
    let rules = standard();
    let dealt = *Game::new(rules, Seed([50; 32]), |_| {}).hands();
    let script = Script::first_shift(dealt);
    let game = TestGame {
        script: Some(script.clone()),
        ..TestGame::dealt(rules, 7, 3)
    };
    let lines = game.record(|_| AGENT);
    replay(&lines).unwrap();
    let course = decisions_of(&lines);
    for at in [0, 10, course.len() - 1] {
        let branch = branch_of(&lines, at as u64).unwrap();
        assert_eq!(branch.script.as_ref(), Some(&script));
        assert_eq!(game_at_point(&branch, Seed([7; 32])), course[at].0);
    }
}

#[test]
fn impossible_branch_points_are_refused() {
    let lines = record();
    let decisions = decisions_of(&lines).len() as u64;
    assert_eq!(
        branch_of(&lines, decisions),
        Err(BranchError::Over(decisions))
    );
    let too_far = BranchError::TooFar {
        has: decisions,
        asked: decisions + 1,
    };
    assert_eq!(branch_of(&lines, decisions + 1), Err(too_far));
    let cut = branch_of(&lines[..lines.len() - 1], 0);
    assert!(matches!(cut, Err(BranchError::Record(_))), "{cut:?}");
}

#[test]
fn an_aborted_game_can_be_branched() {
    let lines = record();
    let fiftieth = lines
        .iter()
        .enumerate()
        .filter(|(_, line)| matches!(line.line, Some(Line::Decision(_))))
        .nth(50)
        .unwrap()
        .0;
    let aborted_later = aborted(lines.clone(), fiftieth);
    let branch = branch_of(&aborted_later, 50).unwrap();
    assert_eq!(taken_over(&branch), 50);
    assert_eq!(branch.later_deals, Some(Seed([7; 32])));
    // Aborted before the deal, so there is nothing to take over.
    assert_eq!(
        branch_of(&aborted(lines, SEATED), 0),
        Err(BranchError::NeverBegan)
    );
}

#[test]
fn a_recorded_player_has_the_observations_and_actions_of_its_seat() {
    use v1::DecisionSource::{Agent, Disconnected, Invalid, Timeout};
    let sources = [Agent, Timeout, Invalid, Disconnected];
    let source = |decision: u64| sources[decision as usize % sources.len()];
    check_players(&TestGame::dealt(standard(), 7, 1).record(source));
    // A substitute plays for one of its seats.
    check_players(&fixture("committed.jsonl"));
}

fn check_players(lines: &[v1::RecordLine]) {
    let course = decisions_of(lines);
    let sources: Vec<_> = lines
        .iter()
        .filter_map(|line| match &line.line {
            Some(Line::Decision(decision)) => Some(decision.source()),
            _ => None,
        })
        .collect();
    let mut all = 0;
    for seat in 0..4 {
        let decisions = recorded_player(lines, seat).unwrap();
        let seat = Seat::new(seat as usize);
        let of_seat = course
            .iter()
            .zip(&sources)
            .filter(|((game, _), _)| game.decision().unwrap().seat == seat);
        for (decision, ((game, action), source)) in decisions.iter().zip(of_seat) {
            assert_eq!(decision.observation, game.observe(Viewer::Seat(seat)));
            assert_eq!(decision.legal, game.legal_actions());
            assert_eq!(decision.action, *action);
            assert_eq!(decision.own, *source == AGENT);
        }
        all += decisions.len();
    }
    assert_eq!(all, course.len());
}

#[test]
fn seats_without_a_player_are_refused() {
    let lines = record();
    let missing = PlayerError::NoSuchSeat {
        seat: 4,
        players: 4,
    };
    assert_eq!(recorded_player(&lines, 4), Err(missing));
    assert_eq!(
        recorded_player(&aborted(lines.clone(), SEATED), 2),
        Err(PlayerError::NothingKnown(2))
    );
    let cut = recorded_player(&lines[..20], 0);
    assert!(matches!(cut, Err(PlayerError::Record(_))), "{cut:?}");
}

/// An imported game of two Shifts, with all plays and the hands of these seats.
fn imported(hands: &[u32]) -> Vec<v1::RecordLine> {
    let spec = RuleSetSpec {
        players: 2,
        faces: 4,
        jokers: 1,
        stop: Stop::Shifts(2),
        special_actions: false,
        exchange: false,
        ..RuleSetSpec::default()
    };
    let lines = TestGame::dealt(spec.validate().unwrap(), 3, 5).record(|_| AGENT);
    let mut text = String::from(
        "shift,seat,what,value\n\
         ,,rules,paper players=2 faces=4 jokers=1 target_shifts=2 exchange=off special_actions=off\n\
         ,0,human,Ada\n,1,human,Ben\n",
    );
    let words = |cards: &[u32], mut golden: bool| {
        let word = |card: &u32| match card {
            5 => "J".to_owned(),
            4 if std::mem::take(&mut golden) => "G".to_owned(),
            card => card.to_string(),
        };
        cards.iter().map(word).collect::<Vec<_>>().join(" ")
    };
    let mut shift = 0;
    for line in &lines {
        let Some(Line::Event(event)) = &line.line else {
            continue;
        };
        match event.kind.as_ref().unwrap() {
            Kind::ShiftStarted(started) => {
                shift = started.shift;
                let stated = started
                    .hands
                    .iter()
                    .filter(|hand| hands.contains(&hand.seat));
                for hand in stated {
                    let cards = words(&hand.cards, hand.golden);
                    text.push_str(&format!("{shift},{},hand,{cards}\n", hand.seat));
                }
            }
            Kind::Play(play) => {
                let mut cards = vec![play.face; play.quantity as usize];
                cards.extend(vec![5; play.jokers as usize]);
                let cards = words(&cards, false);
                text.push_str(&format!("{shift},{},plays,{cards}\n", play.seat));
            }
            Kind::Pass(pass) => text.push_str(&format!("{shift},{},passes,\n", pass.seat)),
            _ => {}
        }
    }
    import(text.as_bytes()).unwrap()
}

#[test]
fn an_imported_game_can_be_branched_in_its_first_shift() {
    let lines = imported(&[0, 1]);
    let course = decisions_of(&lines);
    let first_shift = course.iter().filter(|(game, _)| game.shift() == 1).count();
    assert!(first_shift > 3 && first_shift < course.len());
    for (point, (game, _)) in course[..first_shift].iter().enumerate() {
        let branch = branch_of(&lines, point as u64).unwrap();
        assert_eq!(branch.later_deals, None);
        let mut game = game.clone();
        game.reseed(Seed([9; 32]));
        assert_eq!(game_at_point(&branch, Seed([9; 32])), game);
    }
    let second = branch_of(&lines, first_shift as u64);
    assert_eq!(second, Err(BranchError::RealCards));
    // All players are known.
    let decisions = (0..2).map(|seat| recorded_player(&lines, seat).unwrap().len());
    assert_eq!(decisions.sum::<usize>(), course.len());
}

#[test]
fn unknown_hands_cannot_be_branched() {
    // The other hand is unknown: one of the eleven cards was set aside.
    let lines = imported(&[1]);
    assert_eq!(branch_of(&lines, 0), Err(BranchError::HandsUnknown));
    let known = recorded_player(&lines, 1).unwrap();
    let all = decisions_of(&lines).len();
    let other = recorded_player(&lines, 0).map_or(0, |decisions| decisions.len());
    assert!(!known.is_empty() && known.len() + other < all);
}
