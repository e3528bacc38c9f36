//! Whole games, reported correctly or with reports that are missing, doubled or misread.

use chefshat_engine::{Action, Seat, Viewer};
use chefshat_referee::{Question, Report, Stage, Verdict};
use proptest::prelude::*;

use crate::table::{NAMES, Table, report_of, rules, seen, varied};

/// How the question begins whether the cards of a play are another one.
const NEW_PLAY: &str = "Is that a new play";

/// Plays a game whose reports are all correct.
fn play_correctly(table: &mut Table, confirm: bool) {
    let mut steps = 0;
    while table.referee.stage() != Stage::Over {
        steps += 1;
        assert!(
            steps < 5000,
            "{:?} {:?}",
            table.referee.stage(),
            table.truth.decision()
        );
        if !table.prepare() {
            continue;
        }
        let (seat, _, mut report) = table.turn();
        if table.remote[seat] {
            if confirm {
                let (_, verdict) = table.report(&report);
                assert!(
                    matches!(verdict, Verdict::Accepted | Verdict::Known),
                    "{verdict:?}"
                );
            }
            continue;
        }
        if table.rng.random_bool(0.3) {
            report = without_seat(table, &report);
        }
        let (_, mut verdict) = table.report(&report);
        // The cards that ended a pizza may still lie there, or the same ones were laid again.
        if matches!(verdict, Verdict::Held { .. }) {
            let question = table.referee.questions()[0].clone();
            assert!(question.text.starts_with(NEW_PLAY), "{question:?}");
            verdict = table.report(&yes(question.id)).1;
        }
        assert_eq!(verdict, Verdict::Accepted, "{report:?}");
        let board = table.referee.game().observe(Viewer::Spectator).board;
        if table.rng.random_bool(0.2) && board.size == 0 {
            let (_, verdict) = table.report(&Report::Cleared);
            assert_eq!(verdict, Verdict::Known);
        }
    }
}

/// A report as a camera makes it that does not see who laid the cards, where the referee allows it.
fn without_seat(table: &Table, report: &Report) -> Report {
    let mut report = report.clone();
    if table.referee.stage() != Stage::Opening && table.referee.to_lay().is_empty() {
        match &mut report {
            Report::Laid { seat, .. } | Report::Pass { seat } => *seat = None,
            _ => {}
        }
    }
    report
}

fn yes(question: String) -> Report {
    Report::Answer {
        id: question,
        option: Some(0),
    }
}

/// The first turn that counts although it is not what happened.
fn first_wrong(counted: &[(u64, Seat, Action)], truth: &[(Seat, Action)]) -> Option<usize> {
    (counted.iter().zip(truth)).position(|((_, seat, action), right)| (*seat, *action) != *right)
}

/// The answer to whether seats passed, of an attendant who saw everything: yes, no, or that instead
/// somebody had passed before a play that counts for the wrong seat.
fn passed(table: &Table, question: &Question) -> usize {
    let counted = table.counted();
    let truth = table.true_turns();
    if let Some(index) = first_wrong(&counted, truth) {
        let (_, seat, action) = counted[index];
        let is_explained = truth[index] == (seat, Action::Pass)
            && truth
                .get(index + 1)
                .is_some_and(|(_, laid)| *laid == action);
        let option = format!("No, {} passed before", NAMES[seat.index()]);
        // The newest play comes first: of several, the oldest is the one.
        let found = question
            .options
            .iter()
            .rposition(|it| it.starts_with(&option));
        return found.filter(|_| is_explained).unwrap_or(1);
    }
    let separators = [" and ", ", "].map(|it| question.text.matches(it).count());
    let asked = separators.iter().sum::<usize>() + 1;
    let next = &truth[counted.len().min(truth.len())..];
    let missed = (next.iter().take(asked)).filter(|(_, action)| *action == Action::Pass);
    usize::from(missed.count() != asked)
}

/// Brings the referee to the truth, as an attendant does who saw everything.
fn attend(table: &mut Table) {
    for _ in 0..200 {
        if let Some(question) = table.referee.questions().first().cloned() {
            let option = if question.text.starts_with("Who") {
                let opener = NAMES[table.true_turns()[0].0.index()];
                question.options.iter().position(|name| name == opener)
            } else if question.text.starts_with(NEW_PLAY) {
                let counted = table.counted();
                let next = table.true_turns().get(counted.len());
                let last = counted.last();
                let is_new = next.map(|(_, action)| action) == last.map(|(.., action)| action);
                Some(usize::from(!is_new))
            } else {
                Some(passed(table, &question))
            };
            table.report(&Report::Answer {
                id: question.id,
                option,
            });
            continue;
        }
        let counted = table.counted();
        let truth = table.true_turns().to_vec();
        if let Some(index) = first_wrong(&counted, &truth) {
            let (number, seat, _) = counted[index];
            let (right, action) = truth[index];
            let inferred = counted.get(index + 1).is_some_and(|next| next.0 == number);
            let is_assumed =
                (table.referee.accepted()).any(|it| it.number == number && it.is_assumed);
            let instead = ((seat == right || is_assumed) && !inferred)
                .then(|| Box::new(report_of(right, action, index == 0)));
            let (_, verdict) = table.report(&Report::Correction { number, instead });
            assert!(
                matches!(verdict, Verdict::Accepted | Verdict::Held { .. }),
                "{:?}",
                table.rulings.last()
            );
            continue;
        }
        if let Some((number, ..)) = counted.get(truth.len()) {
            // A pass that was reported twice can be two passes by the rules.
            let instead = None;
            let number = *number;
            let (_, verdict) = table.report(&Report::Correction { number, instead });
            assert_eq!(
                verdict,
                Verdict::Accepted,
                "{:?}\n{:?}\n{:?}",
                table.rulings.last(),
                &counted[counted.len().saturating_sub(8)..],
                &truth[truth.len().saturating_sub(6)..]
            );
            continue;
        }
        let Some((seat, action)) = truth.get(counted.len()).copied() else {
            return;
        };
        assert!(
            !table.remote[seat],
            "a remote seat's decision counts at once"
        );
        let report = report_of(seat, action, counted.is_empty());
        let (_, verdict) = table.report(&report);
        let is_asked = (table.referee.questions().first())
            .is_some_and(|question| question.text.starts_with(NEW_PLAY));
        assert!(
            verdict == Verdict::Accepted || is_asked,
            "{report:?} {:?}",
            table.rulings.last()
        );
    }
    panic!("the attendant does not come to an end");
}

/// Misreads a report of cards: another face, or one card more or fewer.
fn misread(table: &mut Table, report: &Report) -> Report {
    let mut wrong = report.clone();
    if let Report::Laid { cards, .. } = &mut wrong {
        let faces = usize::from(table.truth.rules().faces());
        if let Some(kind) = (0..faces).find(|kind| cards.counts[*kind] > 0) {
            let other = table.rng.random_range(0..faces);
            let count = cards.counts[kind];
            cards.counts[kind] = 0;
            cards.counts[other] = if other == kind { count + 1 } else { count };
            cards.golden = None;
        }
    }
    wrong
}

fn play_noisily(table: &mut Table, noise: f64) {
    play(table, |table, report| {
        if !table.rng.random_bool(noise) {
            table.report(report);
            return;
        }
        match table.rng.random_range(0..3) {
            0 => {}
            1 => {
                table.report(report);
                table.report(report);
            }
            _ => {
                let wrong = misread(table, report);
                table.report(&wrong);
            }
        }
    });
}

/// Reports everything but some passes. Whatever counts then is what happened: the referee infers a
/// pass only if nothing else is possible.
fn play_with_missing_passes(table: &mut Table, missing: f64) {
    play(table, |table, report| {
        if matches!(report, Report::Pass { .. }) && table.rng.random_bool(missing) {
            return;
        }
        table.report(report);
        let counted = table.counted();
        let truth = table.true_turns();
        assert!(counted.len() <= truth.len());
        for ((_, seat, action), right) in counted.iter().zip(truth) {
            assert_eq!((*seat, *action), *right);
        }
    });
}

/// Reports everything but some passes, and of what is laid often not by whom.
fn play_with_missing_names(table: &mut Table, missing: f64) {
    play(table, |table, report| {
        if !table.rng.random_bool(missing) {
            table.report(report);
        } else if !matches!(report, Report::Pass { .. }) {
            let report = without_seat(table, report);
            table.report(&report);
        }
    });
}

/// Plays a game of which the turns at the table are reported by `report`. An attendant answers
/// questions and corrects what is wrong.
fn play(table: &mut Table, mut report_turn: impl FnMut(&mut Table, &Report)) {
    while table.referee.stage() != Stage::Over {
        if table.referee.stage() == Stage::Question {
            attend(table);
            continue;
        }
        if table.referee.stage() == Stage::Confirmation {
            attend(table);
        }
        if !table.prepare() {
            continue;
        }
        // Remote seats decide by what the referee counts: bring it to the truth first.
        let next = table.truth.decision().map(|open| open.seat);
        let remote_is_next = next.is_some_and(|seat| table.remote[seat]);
        let last_of_shift = table.counted().len() != table.true_turns().len();
        if remote_is_next || last_of_shift && table.turns.is_empty() {
            attend(table);
            if !matches!(table.referee.stage(), Stage::Opening | Stage::Turn(_)) {
                continue;
            }
        }
        let pizza = |table: &Table| table.truth.observe(Viewer::Spectator).pizza;
        let pizza_before = pizza(table);
        let (seat, _, report) = table.turn();
        if table.remote[seat] {
            continue;
        }
        report_turn(table, &report);
        // A correction is possible within the pizza: the attendant looks before it is cleared.
        let other_shift =
            table.referee.game().shift() != table.truth.shift() || table.referee.game().is_over();
        if pizza(table) != pizza_before
            || table.turns.is_empty()
            || other_shift
            || table.rng.random_bool(0.5)
        {
            attend(table);
        }
    }
}

/// Seeds, remote seats, numbers of faces and variations of the rules.
fn games() -> impl Strategy<Value = (u64, u8, u8, u8)> {
    (any::<u64>(), 0..15u8, 5..=11u8, 0..16u8)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 96, ..ProptestConfig::default() })]

    /// No legal physical game is called a violation, and its record is the truth.
    #[test]
    fn correct_reports_give_the_game_itself(
        (seed, remote, faces, variation) in games(),
        confirm in any::<bool>(),
    ) {
        let mut table = Table::new(varied(faces, 3, variation), seed, remote);
        play_correctly(&mut table, confirm);
        table.check_end();
        for ruling in &table.rulings {
            prop_assert!(ruling.violations.is_empty(), "{ruling:?}");
            prop_assert!(ruling.corrected.is_none(), "{ruling:?}");
        }
    }

    /// Reports that are missing, doubled or misread are noticed or corrected: the game that counts in
    /// the end is the truth.
    #[test]
    fn noisy_reports_give_the_game_after_questions_and_corrections(
        (seed, remote, faces, variation) in games(),
        noise in 0.0..0.5,
    ) {
        let mut table = Table::new(varied(faces, 2, variation), seed, remote);
        play_noisily(&mut table, noise);
        table.check_end();
    }

    /// Missing passes are never guessed wrong, whether an attendant looks or not.
    #[test]
    fn missing_passes_are_inferred_or_asked_for(
        (seed, remote, faces, variation) in games(),
        missing in 0.0..1.0,
    ) {
        let mut table = Table::new(varied(faces, 2, variation), seed, remote);
        play_with_missing_passes(&mut table, missing);
        table.check_end();
    }

    /// Plays that count for the wrong seat after a forgotten pass are noticed or corrected.
    #[test]
    fn plays_without_a_seat_are_brought_to_theirs(
        (seed, remote, faces, variation) in games(),
        missing in 0.0..0.7,
    ) {
        let mut table = Table::new(varied(faces, 2, variation), seed, remote);
        play_with_missing_names(&mut table, missing);
        table.check_end();
    }
}

#[test]
fn other_numbers_of_players() {
    for players in [2, 3, 5, 6] {
        for seed in 0..8 {
            let faces = if players > 4 { 11 } else { 9 };
            let mut table = Table::new(rules(players, faces, 3), seed, 1);
            play_correctly(&mut table, true);
            table.check_end();
        }
    }
}

#[test]
fn hands_that_all_were_played_are_known_in_the_end() {
    let mut table = Table::new(rules(4, 11, 1), 5, 0);
    play_correctly(&mut table, false);
    let story = table.referee.story();
    let known: Vec<Seat> = (story[0].hands.iter())
        .filter(|(_, hand)| hand.is_some())
        .map(|(seat, _)| seat)
        .collect();
    // Three seats played all their cards; the fourth has the rest of the deck.
    assert_eq!(known.len(), 4);
    assert_eq!(
        seen(table.dealt[0][Seat::new(0)], 11)
            .counts
            .iter()
            .sum::<u8>(),
        17
    );
}
