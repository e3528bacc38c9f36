//! The action table of a decision agrees with the mask and is only for the seat that decides.

use chefshat_engine::{Action, ActionId, DecisionKind, Game, Requirement, Seed, Viewer};
use chefshat_render::{Figure, Film, FilmError, Perspective, State, When, figure_at, frame_at};

use super::{chronicle, fixture, rules};

#[test]
fn the_action_table_agrees_with_the_mask() {
    let tables = [(4, 11), (3, 4), (6, 15)];
    let mut legal = 0;
    for (players, faces) in tables {
        let rules = rules(players, faces);
        let chronicle = chronicle(&rules, &[], Viewer::Everything);
        let mut game = Game::new(rules, Seed([9; 32]), |_| {});
        let mut turn = 0;
        while let Some(open) = game.decision() {
            let figure = Figure::of(&game, &chronicle).unwrap();
            assert_eq!(figure.seat, open.seat);
            check(&game, &figure);
            legal += figure.legal;
            turn += 1;
            let mask = game.legal_actions();
            game.apply(mask.nth(turn % mask.len()).unwrap(), |_| {})
                .unwrap();
        }
        assert!(Figure::of(&game, &chronicle).is_none());
    }
    assert!(legal > 1000);
}

/// Checks that exactly the actions of the mask are legal, and that the states of the others follow
/// from hand and board.
fn check(game: &Game, figure: &Figure) {
    let (space, mask) = (game.rules().actions(), game.legal_actions());
    let hand = game.hands()[figure.seat];
    let mut actions: Vec<(Action, State)> = vec![(Action::Pass, figure.pass)];
    actions.extend(figure.lone_joker.map(|state| (Action::LoneJoker, state)));
    for (face, quantities) in (1..).zip(&figure.plays) {
        let face = chefshat_engine::Face::new(face).unwrap();
        assert_eq!(quantities.len(), usize::from(face.get()));
        for (quantity, states) in (1..).zip(quantities) {
            for (jokers, &state) in (0..).zip(states) {
                let play = Action::Play {
                    face,
                    quantity,
                    jokers,
                };
                let held = hand.count(face) >= quantity && hand.jokers() >= jokers;
                let allowed = match figure.requirement {
                    Requirement::Play(required) => {
                        (required.lowest_face..=required.highest_face).contains(&face.get())
                            && quantity + jokers >= required.fewest_cards
                    }
                    Requirement::Gift(_) | Requirement::SpecialAction(_) => false,
                };
                let expected = match (held, allowed) {
                    (true, true) => State::Legal,
                    (true, false) => State::NotAllowed,
                    (false, true) => State::NotInHand,
                    (false, false) => State::Impossible,
                };
                assert_eq!(state, expected, "{play}");
                actions.push((play, state));
            }
        }
    }
    let faces = (1..=figure.faces).filter_map(chefshat_engine::Face::new);
    let gifts = faces.map(Action::Give).chain([Action::GiveJoker]);
    actions.extend(gifts.zip(figure.gives.iter().copied()));
    actions.extend(
        [Action::Declare, Action::Decline]
            .into_iter()
            .zip(figure.special.iter().copied()),
    );
    let mut legal: Vec<ActionId> = actions
        .iter()
        .filter(|(_, state)| *state == State::Legal)
        .map(|(meaning, _)| space.encode(*meaning).unwrap())
        .collect();
    legal.sort();
    assert_eq!(legal, mask.iter().collect::<Vec<_>>());
    assert_eq!(figure.legal, legal.len());
    let kind = game.decision().unwrap().kind;
    assert_eq!(
        matches!(figure.requirement, Requirement::Play(_)),
        kind == DecisionKind::Turn
    );
}

#[test]
fn a_frame_is_that_of_the_film() {
    for name in ["fixed.jsonl", "committed.jsonl"] {
        let lines = fixture(name);
        for perspective in [
            Perspective::All,
            Perspective::Seat(1),
            Perspective::Spectator,
        ] {
            let film = Film::new(&lines, perspective).unwrap();
            let last = film.decisions();
            let decisions = (1..=30)
                .chain([last / 2, last, last + 1])
                .map(When::Decision);
            let ends = (0..=4).map(When::ShiftEnd).chain([When::End]);
            for when in decisions.chain(ends) {
                let frame = frame_at(&lines, perspective, when);
                let expected = film.at(when).cloned();
                assert_eq!(format!("{frame:?}"), format!("{expected:?}"), "{when:?}");
            }
        }
    }
}

#[test]
fn the_action_table_is_only_for_the_seat_that_decides() {
    let lines = fixture("committed.jsonl");
    let seat = figure_at(&lines, Perspective::All, 7).unwrap().seat;
    let own = u32::try_from(seat.index()).unwrap();
    assert_eq!(
        figure_at(&lines, Perspective::Seat(own), 7).unwrap().seat,
        seat
    );
    for (perspective, decision, words) in [
        (
            Perspective::All,
            208,
            "there is no decision 208: the game has decisions 1 to 207",
        ),
        (
            Perspective::Seat(9),
            7,
            "there is no seat 9: the game has seats 0 to 3",
        ),
    ] {
        let error = figure_at(&lines, perspective, decision).unwrap_err();
        assert_eq!(error.to_string(), words);
    }
    for perspective in [Perspective::Spectator, Perspective::Seat((own + 1) % 4)] {
        let error = figure_at(&lines, perspective, 7).unwrap_err();
        assert_eq!(error, FilmError::HandNotSeen { decision: 7 });
        assert!(
            !error.to_string().contains("seat "),
            "the error does not name the seat"
        );
    }
}
