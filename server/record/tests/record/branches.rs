//! Branches and players of records: the decisions taken over repeat the game up to the branch
//! point, and impossible branch points are refused.

use chefshat_engine::TakenOver;
use chefshat_engine::{ActionId, Game, RuleSetSpec, Script, Seat, Seed, Stop, Viewer};
use chefshat_proto::v1::{self, record_line::Line};
use chefshat_record::branch::{BranchError, branch_of};
use chefshat_record::import::import;
use chefshat_record::players::{PlayerError, recorded_player};
use chefshat_record::replay::{replay, walk};

use crate::fixture;
use chefshat_record::testing::{
    Observed, TestGame, aborted, decisions, shifts, taken_over, transcript,
};

/// Lines before the game starts: the header and four seated participants.
const SEATED: usize = 5;
const AGENT: v1::DecisionSource = v1::DecisionSource::Agent;

fn record() -> Vec<v1::RecordLine> {
    TestGame::dealt(shifts(4), 7, 1).played()
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

/// The first decision of a Shift.
fn shift_of(course: &[(Game, ActionId)], shift: u32) -> usize {
    let mut games = course.iter().map(|(game, _)| game);
    games.position(|game| game.shift() == shift).unwrap()
}

#[test]
fn a_branch_repeats_the_game_up_to_every_point() {
    let lines = record();
    let course = decisions_of(&lines);
    assert!(course.len() > 100, "{} decisions", course.len());
    for (point, (game, _)) in course.iter().enumerate() {
        let branch = branch_of(&lines, point as u64).unwrap();
        assert_eq!(branch.rules, shifts(4));
        assert_eq!(branch.script, None);
        assert_eq!(branch.later_deals, Some(Seed([7; 32])));
        let actions = course[..point].iter().map(|(_, action)| *action).collect();
        let seed = Seed([7; 32]);
        assert_eq!(branch.taken_over, [TakenOver { seed, actions }]);
        assert_eq!(branch.played(seed).unwrap(), *game, "point {point}");
    }
}

#[test]
fn a_branch_continues_with_the_same_deals_or_others() {
    let lines = record();
    let course = decisions_of(&lines);
    // In the second Shift.
    let point = shift_of(&course, 2) + 3;
    let branch = branch_of(&lines, point as u64).unwrap();
    let same = branch.later_deals.unwrap();
    let third = |seed| {
        let mut game = branch.played(seed).unwrap();
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
    let point = shift_of(&decisions_of(&first), 2) + 5;
    let branch = branch_of(&first, point as u64).unwrap();
    let second = TestGame {
        branch: Some(&branch),
        ..TestGame::dealt(shifts(4), 9, 2)
    }
    .played();
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
            again.played(course[at].0.seed()).unwrap(),
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
    let rules = shifts(4);
    let dealt = *Game::new(rules, Seed([50; 32]), |_| {}).hands();
    let script = Script::first_shift(dealt);
    let game = TestGame {
        script: Some(script.clone()),
        ..TestGame::dealt(rules, 7, 3)
    };
    let lines = game.played();
    replay(&lines).unwrap();
    let course = decisions_of(&lines);
    for at in [0, 10, course.len() - 1] {
        let branch = branch_of(&lines, at as u64).unwrap();
        assert_eq!(branch.script.as_ref(), Some(&script));
        assert_eq!(branch.played(Seed([7; 32])).unwrap(), course[at].0);
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
    let is_decision = |line: &usize| matches!(lines[*line].line, Some(Line::Decision(_)));
    let fiftieth = (0..lines.len()).filter(is_decision).nth(50).unwrap();
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
    check_players(&TestGame::dealt(shifts(4), 7, 1).record(source));
    // A substitute plays for one of its seats.
    check_players(&fixture("committed.jsonl"));
}

fn check_players(lines: &[v1::RecordLine]) {
    let course = decisions_of(lines);
    let sources: Vec<_> = decisions(lines).map(|it| it.source()).collect();
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

/// An imported game of two Shifts, with all plays and the hands of these seats, one bit each.
fn imported(hands: u32) -> Vec<v1::RecordLine> {
    let spec = RuleSetSpec {
        players: 2,
        faces: 4,
        jokers: 1,
        stop: Stop::Shifts(2),
        special_actions: false,
        exchange: false,
        ..RuleSetSpec::default()
    };
    let game = TestGame::dealt(spec.validate().unwrap(), 3, 5);
    let observed = Observed {
        hands,
        ..Observed::TURNS
    };
    import(transcript(&game.rules, &game.played(), observed).as_bytes()).unwrap()
}

#[test]
fn an_imported_game_can_be_branched_in_its_first_shift() {
    let lines = imported(0b11);
    let course = decisions_of(&lines);
    let first_shift = course.iter().filter(|(game, _)| game.shift() == 1).count();
    assert!(first_shift > 3 && first_shift < course.len());
    for (point, (game, _)) in course[..first_shift].iter().enumerate() {
        let branch = branch_of(&lines, point as u64).unwrap();
        assert_eq!(branch.later_deals, None);
        let mut game = game.clone();
        game.reseed(Seed([9; 32]));
        assert_eq!(branch.played(Seed([9; 32])).unwrap(), game);
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
    let lines = imported(0b10);
    assert_eq!(branch_of(&lines, 0), Err(BranchError::HandsUnknown));
    let known = recorded_player(&lines, 1).unwrap();
    let all = decisions_of(&lines).len();
    let other = recorded_player(&lines, 0).map_or(0, |decisions| decisions.len());
    assert!(!known.is_empty() && known.len() + other < all);
}
