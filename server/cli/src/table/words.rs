//! A physical table in words: its state, and the referee's verdicts.

use chefshat_client::v1;

use crate::narration::view::GameView;
use crate::narration::{aborted, clean, heading, row, title};
use crate::numbers::{counted, ordinal};
use crate::tui::view::{beating, play_words};

/// Maximum columns of a text from the server.
const TEXT: usize = 200;
/// Maximum columns of a name at the start of a row.
const NAME: usize = 13;
/// Reports shown: older ones can rarely be corrected.
const REPORTS: usize = 6;

/// The state of a table, as lines.
pub(super) fn state_in_words(state: &v1::TableState) -> String {
    let room = state.room.clone().unwrap_or_default();
    let view = GameView::of_room(&room);
    let mut out = heading(&headline(state, &view));
    for question in &state.questions {
        out.push_str(&row("question", &clean(&question.text, TEXT)));
        out.push_str(&row("", &answers(question)));
    }
    if let Some(violation) = &state.violation {
        let name = violation.seat.map(|seat| view.name(seat) + ": ");
        let words = format!("⚠ {}{}", name.unwrap_or_default(), violation.text);
        out.push_str(&row("not allowed", &clean(&words, TEXT)));
    }
    for act in &state.to_lay {
        out.push_str(&row("to do", &clean(&act.text, TEXT)));
    }
    out.push_str(&row("now", &now(state, &room)));
    if let Some(required) = &state.play_requirement {
        out.push_str(&row("a play", &requirement(required)));
    }
    if let Some(seen) = &state.observation {
        out.push_str(&row("board", &board(seen, view.faces())));
    }
    for seat in (0u32..).take(room.seats.len()) {
        out.push_str(&row(
            &clean(&view.name(seat), NAME),
            &seat_in_words(state, &view, seat),
        ));
    }
    let older = state.reports.len().saturating_sub(REPORTS);
    for report in &state.reports[older..] {
        let words = clean(&report.text, TEXT);
        out.push_str(&row(&format!("report {}", report.report), &words));
    }
    out
}

/// The verdict on a report, as lines.
pub(super) fn verdict_in_words(response: &v1::ReportResponse) -> String {
    let detail = clean(&response.detail, TEXT);
    let label = format!("report {}", response.report);
    let mut out = match response.verdict() {
        v1::ReportVerdict::Violation => row("not allowed", &format!("⚠ {detail}")),
        v1::ReportVerdict::Held => row(&label, &format!("waits for an answer: {detail}")),
        v1::ReportVerdict::Known => row(&label, &detail),
        v1::ReportVerdict::Accepted | v1::ReportVerdict::Unspecified => row(&label, "accepted"),
    };
    if !response.void_reports.is_empty() {
        let numbers: Vec<String> = response.void_reports.iter().map(u64::to_string).collect();
        let words = format!(
            "no longer fits: {}; report again what happened",
            numbers.join(", ")
        );
        out.push_str(&row("void", &words));
    }
    out
}

fn headline(state: &v1::TableState, view: &GameView) -> String {
    match &state.observation {
        Some(seen) if seen.shift > 0 => {
            format!("Shift {} · pizza {}", seen.shift, seen.pizza.max(1))
        }
        _ if view.room_name.is_empty() => "Chef's Hat".to_owned(),
        _ => view.room_name.clone(),
    }
}

fn now(state: &v1::TableState, room: &v1::Room) -> String {
    if room.state() == v1::RoomState::Aborted {
        return aborted(room.abort_reason());
    }
    let words = clean(&state.waiting_for, TEXT);
    match state.paused {
        true => format!("Paused. {words}"),
        false => words,
    }
}

/// What can be typed to answer a question.
fn answers(question: &v1::TableQuestion) -> String {
    let answers = (1..).zip(&question.options);
    let answers = answers
        .map(|(number, option): (u32, _)| format!("answer {number}: {}", clean(option, TEXT)));
    answers.collect::<Vec<_>>().join(" · ")
}

/// What a play must be.
fn requirement(required: &v1::PlayRequirement) -> String {
    let highest = required.highest_face;
    let play = match (required.golden_card, required.lowest_face, highest) {
        (true, ..) => format!("{highest}s, the Golden {highest} among them"),
        (false, 2.., _) => format!("{highest}s"),
        (false, _, 0) => "nothing beats the board".to_owned(),
        (false, ..) if required.lone_joker => "any face, or a joker alone".to_owned(),
        (false, ..) => beating(highest, required.fewest_cards),
    };
    match required.may_pass {
        true => format!("{play}; or a pass"),
        false => format!("{play}; passing is not allowed"),
    }
}

fn board(seen: &v1::Observation, faces: u32) -> String {
    if seen.board_face == 0 {
        return "empty".to_owned();
    }
    let quantity = seen.board_size.saturating_sub(seen.board_jokers);
    play_words(seen.board_face, quantity, seen.board_jokers, faces)
}

fn seat_in_words(state: &v1::TableState, view: &GameView, seat: u32) -> String {
    let index = usize::try_from(seat).unwrap_or(usize::MAX);
    let at_table = state.seats.get(index).is_some_and(|it| it.at_table);
    let hand_known = state.seats.get(index).is_some_and(|it| it.hand_known);
    let participant = view.seat(seat).cloned().unwrap_or_default();
    let mut words = Vec::new();
    if let Some(seen) = &state.observation {
        let of = |bytes: &[u8]| bytes.get(index).copied().unwrap_or(0);
        let points = seen.points.get(index).copied().unwrap_or(0);
        words.push(match of(&seen.places) {
            0 => counted(of(&seen.cards_left).into(), "card"),
            place => ordinal(place.into()),
        });
        words.push(counted(points, "point"));
        match v1::Role::try_from(i32::from(of(&seen.roles))) {
            Err(_) | Ok(v1::Role::Unspecified) => {}
            Ok(role) => words.push(title(role).to_owned()),
        }
        if of(&seen.passed) > 0 && of(&seen.places) == 0 {
            words.push("passed".to_owned());
        }
        if hand_known && of(&seen.cards_left) > 0 {
            words.push("hand known".to_owned());
        }
    }
    words.push(match (participant.name.as_str(), at_table) {
        ("", _) => "free".to_owned(),
        (_, true) => "at the table".to_owned(),
        (_, false) if !participant.built_in.is_empty() => "played by the server".to_owned(),
        (_, false) if participant.connected => "remote".to_owned(),
        (_, false) => "remote, not connected".to_owned(),
    });
    words.join(" · ")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The second pizza of a mixed table, with everything that a state can have.
    fn state() -> v1::TableState {
        let seat = |(seat, name): (u32, &str)| v1::Participant {
            seat,
            name: name.into(),
            built_in_agent: if name == "Greta" { "greedy" } else { "" }.into(),
            ..v1::Participant::default()
        };
        let known = |at_table, hand_known| v1::TableSeat {
            at_table,
            hand_known,
        };
        v1::TableState {
            room: Some(v1::Room {
                seats: (0..)
                    .zip(["Ada", "Bo", "Greta", "Rita"])
                    .map(seat)
                    .collect(),
                ..v1::Room::default()
            }),
            stage: v1::TableStage::Turn.into(),
            seat: Some(0),
            waiting_for: "It is Ada's turn.".into(),
            paused: true,
            observation: Some(v1::Observation {
                shift: 2,
                pizza: 3,
                board_face: 8,
                board_size: 3,
                board_jokers: 1,
                cards_left: vec![5, 0, 14, 1],
                passed: vec![0, 0, 1, 0],
                places: vec![0, 1, 0, 0],
                roles: vec![1, 2, 4, 5],
                points: vec![5, 3, 1, 0],
                ..v1::Observation::default()
            }),
            seats: vec![
                known(true, false),
                known(true, false),
                known(false, true),
                known(false, true),
            ],
            to_lay: vec![v1::CardsToLay {
                text: "Show the pass card of Greta".into(),
                ..v1::CardsToLay::default()
            }],
            questions: vec![v1::TableQuestion {
                text: "7 or 9 at place 4?".into(),
                options: vec!["7".into(), "9".into()],
                ..v1::TableQuestion::default()
            }],
            reports: vec![v1::AcceptedReport {
                report: 12,
                text: "Ada laid two 8s and a joker".into(),
                ..v1::AcceptedReport::default()
            }],
            violation: Some(v1::Violation {
                seat: Some(1),
                text: "It is Ada's turn.\u{1b}[2J".into(),
                ..v1::Violation::default()
            }),
            play_requirement: Some(v1::PlayRequirement {
                lowest_face: 1,
                highest_face: 7,
                fewest_cards: 3,
                may_pass: true,
                ..v1::PlayRequirement::default()
            }),
            ..v1::TableState::default()
        }
    }

    fn plain(text: &str) -> Vec<String> {
        let text = anstream::adapter::strip_str(text).to_string();
        let lines = text.lines().filter(|line| !line.is_empty());
        lines.map(|line| line.trim_end().to_owned()).collect()
    }

    #[test]
    fn a_state_says_what_is_needed_at_the_table() {
        let lines = plain(&state_in_words(&state()));
        assert!(lines[0].starts_with("━━ Shift 2 · pizza 3 ━"), "{lines:?}");
        assert_eq!(
            lines[1..],
            [
                "   question      7 or 9 at place 4?",
                "                 answer 1: 7 · answer 2: 9",
                "   not allowed   ⚠ Bo: It is Ada's turn.[2J",
                "   to do         Show the pass card of Greta",
                "   now           Paused. It is Ada's turn.",
                "   a play        7 or lower, at least 3 cards; or a pass",
                "   board         2 × 8 + 1 joker",
                "   Ada           5 cards · 5 points · Chef · at the table",
                "   Bo            1st · 3 points · Sous-Chef · at the table",
                "   Greta         14 cards · 1 point · Waiter · passed · hand known · played by the server",
                "   Rita          1 card · 0 points · Dishwasher · hand known · remote, not connected",
                "   report 12     Ada laid two 8s and a joker",
            ]
        );
    }

    #[test]
    fn a_play_must_be() {
        let of = |lowest_face, highest_face, fewest_cards| v1::PlayRequirement {
            lowest_face,
            highest_face,
            fewest_cards,
            may_pass: true,
            ..v1::PlayRequirement::default()
        };
        let opening = v1::PlayRequirement {
            golden_card: true,
            may_pass: false,
            ..of(11, 11, 1)
        };
        let leading = v1::PlayRequirement {
            lone_joker: true,
            ..of(1, 11, 1)
        };
        let cases = [
            (
                opening,
                "11s, the Golden 11 among them; passing is not allowed",
            ),
            (of(11, 11, 1), "11s; or a pass"),
            (leading, "any face, or a joker alone; or a pass"),
            (of(1, 5, 1), "5 or lower, at least 1 card; or a pass"),
            (of(1, 1, 2), "1, at least 2 cards; or a pass"),
            (of(1, 0, 2), "nothing beats the board; or a pass"),
        ];
        for (required, expected) in cases {
            assert_eq!(requirement(&required), expected);
        }
    }

    #[test]
    fn verdicts() {
        let of = |verdict: v1::ReportVerdict, detail: &str| v1::ReportResponse {
            report: 12,
            verdict: verdict.into(),
            detail: detail.into(),
            ..v1::ReportResponse::default()
        };
        let corrected = v1::ReportResponse {
            void_reports: vec![13, 14],
            ..of(v1::ReportVerdict::Accepted, "")
        };
        let cases: [(_, &[&str]); 4] = [
            (
                corrected,
                &[
                    "   report 12     accepted",
                    "   void          no longer fits: 13, 14; report again what happened",
                ],
            ),
            (
                of(v1::ReportVerdict::Known, "This was known already."),
                &["   report 12     This was known already."],
            ),
            (
                of(v1::ReportVerdict::Violation, "It is Bo's turn."),
                &["   not allowed   ⚠ It is Bo's turn."],
            ),
            (
                of(v1::ReportVerdict::Held, "Did Bo pass?"),
                &["   report 12     waits for an answer: Did Bo pass?"],
            ),
        ];
        for (response, expected) in cases {
            assert_eq!(plain(&verdict_in_words(&response)), expected);
        }
    }

    #[test]
    fn an_aborted_game_says_why() {
        let mut state = state();
        let room = state.room.get_or_insert_default();
        room.state = v1::RoomState::Aborted.into();
        room.abort_reason = v1::AbortReason::Closed.into();
        let lines = plain(&state_in_words(&state));
        assert!(
            lines
                .iter()
                .any(|line| line.contains("its room was closed"))
        );
    }
}
