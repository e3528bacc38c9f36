//! Outcomes: what each seat did in a game, and which games count for ratings.

use crate::fixture;
use chefshat_proto::v1::{self, DecisionSource, record_line::Line};
use chefshat_record::outcome::{Identity, Outcome, OutcomeError, Unrated, outcome};
use chefshat_record::rated::rated;
use chefshat_record::replay::replay;
use chefshat_record::summary::summary;
use chefshat_record::testing::{TestGame, decisions, footer, header, shifts};

/// The record of a game that a server dealt, in which every participant decided itself.
fn dealt() -> Vec<v1::RecordLine> {
    let mut lines = TestGame::dealt(shifts(3), 7, 3).played();
    header(&mut lines).origin = v1::GameOrigin::Dealt.into();
    lines
}

fn last<T>(lines: &mut [v1::RecordLine], of: impl Fn(&mut Line) -> Option<&mut T>) -> &mut T {
    let mut lines = lines.iter_mut().rev();
    lines
        .find_map(|line| line.line.as_mut().and_then(&of))
        .unwrap()
}

fn last_decision(lines: &mut [v1::RecordLine]) -> &mut v1::DecisionRecord {
    last(lines, |line| match line {
        Line::Decision(decision) => Some(decision),
        _ => None,
    })
}

fn standings(lines: &mut [v1::RecordLine]) -> &mut Vec<v1::Standing> {
    last(lines, |line| match line {
        Line::Event(event) => match &mut event.kind {
            Some(v1::game_event::Kind::GameEnded(ended)) => Some(&mut ended.standings),
            _ => None,
        },
        _ => None,
    })
}

/// By seat: place, points, decisions, wrong actions, timeouts, timed decisions, their time,
/// performance score in hundredths.
fn figures(outcome: &Outcome) -> Vec<[u64; 8]> {
    let seats = outcome.seats.iter().map(|seat| seat.statistics);
    seats
        .map(|seat| {
            [
                seat.place as u64,
                seat.points,
                seat.decisions,
                seat.wrong_actions,
                seat.timeouts,
                seat.timed_decisions,
                seat.decision_time_us,
                (seat.performance_score * 100.0).round() as u64,
            ]
        })
        .collect()
}

#[test]
fn outcomes_agree_with_a_count_of_the_file() {
    // Counted from the lines of the file with a script.
    let played = outcome(&fixture("committed.jsonl")).unwrap();
    assert_eq!(
        figures(&played),
        [
            [4, 0, 56, 143, 0, 0, 0, 0],
            [2, 9, 46, 0, 0, 0, 0, 168],
            [3, 3, 8, 0, 6, 2, 60_788, 56],
            [1, 15, 39, 0, 0, 39, 50_065, 280],
        ]
    );
    assert_eq!(played.shifts, 3);
    assert_eq!(played.game_id, "22b73f3bba773c1120e1858de68cd801");
    assert_eq!(played.ended_at_ms, 1_795_160_537_402 + 207);
    let substituted: Vec<bool> = played
        .seats
        .iter()
        .map(|seat| seat.statistics.substituted)
        .collect();
    assert_eq!(substituted, [false, false, true, false]);
    assert_eq!(played.unrated, Some(Unrated::Substituted));
    let identities = played.places();
    let expected = [
        ("random_unmasked", true, 4),
        ("greedy", true, 2),
        ("Rolf", false, 3),
        ("Greta", false, 1),
    ];
    let expected = expected.map(|(name, built_in, place)| {
        let name = name.to_owned();
        let kind = v1::ParticipantKind::Agent;
        (
            Identity {
                name,
                kind,
                built_in,
                name_fingerprint: String::new(),
            },
            place,
        )
    });
    assert_eq!(identities, expected);

    let fixed = outcome(&fixture("fixed.jsonl")).unwrap();
    assert_eq!(fixed.unrated, Some(Unrated::NotDealt));
    assert_eq!(fixed.seats.len(), 3);
}

#[test]
fn the_performance_score_equals_the_engines() {
    use chefshat_engine::{ActionId, Game, MetricsRecorder, Seed};
    let lines = dealt();
    let mut recorder = MetricsRecorder::new(shifts(3), None);
    let mut scores = Vec::new();
    let mut note = |event: chefshat_engine::Event| {
        if let Some(shift) = recorder.on_event(&event) {
            scores = shift
                .seats
                .iter()
                .map(|(_, seat)| seat.performance)
                .collect();
        }
    };
    let mut game = Game::new(shifts(3), Seed([7; 32]), &mut note);
    for decision in decisions(&lines) {
        let action = ActionId::new(u16::try_from(decision.action).unwrap());
        game.apply(action, &mut note).unwrap();
    }
    let outcome = outcome(&lines).unwrap();
    assert_eq!(scores.len(), 4);
    for (seat, score) in outcome.seats.iter().zip(&scores) {
        assert!(
            (seat.statistics.performance_score - score).abs() < 1e-12,
            "{scores:?}"
        );
    }
}

#[test]
fn a_game_in_which_all_decided_themselves_is_rated() {
    let played = outcome(&dealt()).unwrap();
    assert!(played.is_rated());
    let counted = played.seats.iter().map(|seat| seat.statistics.decisions);
    let counted: u64 = counted.sum();
    let lines = dealt();
    assert_eq!(counted, decisions(&lines).count() as u64);
}

#[test]
fn default_decisions_count_and_those_of_substitutes_do_not() {
    let record = |source: fn(u64) -> DecisionSource| {
        let mut lines = TestGame::dealt(shifts(3), 7, 3).record(source);
        header(&mut lines).origin = v1::GameOrigin::Dealt.into();
        let all: Vec<DecisionSource> = decisions(&lines).map(|it| it.source()).collect();
        (outcome(&lines).unwrap(), all)
    };
    let sum = |outcome: &Outcome, of: usize| -> u64 {
        figures(outcome).iter().map(|figures| figures[of]).sum()
    };
    let (lost, all) = record(|number| match number % 3 {
        0 => DecisionSource::Timeout,
        1 => DecisionSource::Disconnected,
        _ => DecisionSource::Invalid,
    });
    let of = |source| all.iter().filter(|other| **other == source).count() as u64;
    assert!(of(DecisionSource::Invalid) > 0);
    assert!(lost.is_rated(), "a late participant plays badly, but plays");
    assert_eq!(sum(&lost, 2), all.len() as u64);
    assert_eq!(sum(&lost, 3), 10 * of(DecisionSource::Invalid));
    assert_eq!(
        sum(&lost, 4),
        of(DecisionSource::Timeout) + of(DecisionSource::Disconnected)
    );

    let (replaced, all) = record(|number| match number {
        0..20 => DecisionSource::Agent,
        _ => DecisionSource::Substitute,
    });
    assert_eq!(sum(&replaced, 2), 20);
    assert!(all.len() > 20);
    assert_eq!(replaced.unrated, Some(Unrated::Substituted));
}

#[test]
fn games_that_do_not_show_skill_are_not_rated() {
    let unrated = |change: fn(&mut v1::RecordHeader)| {
        let mut lines = dealt();
        change(header(&mut lines));
        outcome(&lines).unwrap().unrated
    };
    type Case = (fn(&mut v1::RecordHeader), Option<Unrated>);
    let cases: [Case; 6] = [
        (
            |header| header.origin = v1::GameOrigin::Branched.into(),
            Some(Unrated::NotDealt),
        ),
        (
            |header| header.seats[3].substituted = true,
            Some(Unrated::Substituted),
        ),
        (
            |header| header.seats[1].name = header.seats[2].name.clone(),
            Some(Unrated::SameParticipant),
        ),
        (
            |header| {
                for seat in &mut header.seats[..2] {
                    seat.built_in_agent = "greedy".into();
                }
            },
            Some(Unrated::SameParticipant),
        ),
        (
            |header| header.seats[1].built_in_agent = "replay".into(),
            Some(Unrated::RecordedPlayer),
        ),
        // A person may have the name of an agent.
        (
            |header| {
                header.seats[1].name = header.seats[2].name.clone();
                header.seats[1].kind = v1::ParticipantKind::Human.into();
                header.seats[0].built_in_agent = "greedy".into();
                header.seats[3].name = "greedy".into();
            },
            None,
        ),
    ];
    for (number, (change, expected)) in cases.into_iter().enumerate() {
        assert_eq!(unrated(change), expected, "case {number}");
    }
}

#[test]
fn a_leaderboard_rates_public_games_that_a_server_dealt() {
    let mut lines = fixture("committed.jsonl");
    let replayed = replay(&lines).unwrap();
    let mut reason = |origin: v1::GameOrigin, visibility: v1::Visibility| {
        let header = header(&mut lines);
        header.origin = origin.into();
        header.policy.as_mut().unwrap().visibility = visibility.into();
        let summary = summary(&lines, &replayed).unwrap();
        assert_eq!(summary.visibility(), visibility);
        rated(&summary).err()
    };
    use v1::GameOrigin::{Dealt, FixedSeed, Physical};
    use v1::Visibility::{Private, Public, Unlisted, Unspecified};
    for (origin, visibility, expected) in [
        (Dealt, Unspecified, None),
        (Dealt, Public, None),
        (Dealt, Unlisted, Some(Unrated::NotPublic)),
        (Dealt, Private, Some(Unrated::NotPublic)),
        (Physical, Unspecified, Some(Unrated::NotDealt)),
        (FixedSeed, Unspecified, Some(Unrated::NotDealt)),
    ] {
        assert_eq!(
            reason(origin, visibility),
            expected,
            "{origin:?}, {visibility:?}"
        );
    }
}

#[test]
fn a_game_in_which_a_hint_was_given_is_not_rated() {
    let mut lines = dealt();
    let decision = last_decision(&mut lines);
    decision.hints = 1;
    let seat = decision.seat as usize;
    let played = outcome(&lines).unwrap();
    assert_eq!(played.unrated, Some(Unrated::Hinted));
    let hinted = played.seats.iter().map(|it| it.statistics.hinted);
    assert!(
        hinted
            .enumerate()
            .all(|(own, hinted)| hinted == (own == seat))
    );
}

#[test]
fn unfinished_games_have_no_outcome() {
    let broken = |change: fn(&mut Vec<v1::RecordLine>)| {
        let mut lines = dealt();
        change(&mut lines);
        outcome(&lines).map(|outcome| outcome.seats.len())
    };
    type Case = (fn(&mut Vec<v1::RecordLine>), OutcomeError);
    let cases: [Case; 7] = [
        (Vec::clear, OutcomeError::NoHeader),
        (|lines| drop(lines.remove(0)), OutcomeError::NoHeader),
        (|lines| drop(lines.pop()), OutcomeError::NotFinished),
        (
            |lines| footer(lines).state = v1::RoomState::Aborted.into(),
            OutcomeError::NotFinished,
        ),
        (
            |lines| standings(lines).truncate(3),
            OutcomeError::Standings,
        ),
        (
            |lines| standings(lines)[0].seat = standings(lines)[1].seat,
            OutcomeError::Standings,
        ),
        (
            |lines| standings(lines)[3].place = 5,
            OutcomeError::Standings,
        ),
    ];
    for (number, (change, expected)) in cases.into_iter().enumerate() {
        assert_eq!(broken(change), Err(expected), "case {number}");
    }
    let strange = broken(|lines| last_decision(lines).seat = 4);
    assert!(matches!(strange, Err(OutcomeError::Seat(_))), "{strange:?}");
}
