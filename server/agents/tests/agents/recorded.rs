//! Imitating a recorded player: its own game repeats from any point; elsewhere the most similar
//! decision of its own counts.

use std::sync::Arc;

use chefshat_agents::{AgentKind, BuiltInAgent, Listener, RecordedPlayer, play};
use chefshat_engine::RecordedDecision;
use chefshat_engine::{
    ActionId, ActionSpace, Decision, DecisionKind, Game, Mask, Observation, RuleSet, RuleSetSpec,
    Seat, Seed, Stop, Viewer,
};

fn rules(spec: RuleSetSpec) -> RuleSet {
    spec.validate().unwrap()
}

/// Plays with one agent for each seat and returns every decision with its seat.
fn played(
    rules: RuleSet,
    seed: Seed,
    agents: &mut [BuiltInAgent],
) -> Vec<(Seat, RecordedDecision)> {
    let mut game = Game::new(rules, seed, |_| {});
    let mut decisions = Vec::new();
    while let Some(Decision { seat, .. }) = game.decision() {
        let (observation, legal) = (game.observe(Viewer::Seat(seat)), game.legal_actions());
        let action = agents[seat.index()].decide(&observation, &legal);
        let own = legal.contains(action);
        let action = if own {
            action
        } else {
            game.default_action().unwrap()
        };
        game.apply(action, |_| {}).unwrap();
        decisions.push((
            seat,
            RecordedDecision {
                observation,
                legal,
                action,
                own,
            },
        ));
    }
    decisions
}

/// The player of each seat.
fn players(seats: usize, decisions: &[(Seat, RecordedDecision)]) -> Vec<Arc<RecordedPlayer>> {
    let of = |seat| {
        let own = decisions.iter().filter(move |(other, _)| *other == seat);
        own.map(|(_, decision)| decision.clone())
    };
    (0..seats)
        .map(|seat| Arc::new(RecordedPlayer::new(of(Seat::new(seat)))))
        .collect()
}

fn random(seats: usize, seed: u8) -> Vec<BuiltInAgent> {
    (0..seats)
        .map(|seat| BuiltInAgent::new(AgentKind::Random, [seed ^ seat as u8; 32]))
        .collect()
}

#[test]
fn players_repeat_their_game() {
    let table = [
        RuleSetSpec::default(),
        RuleSetSpec::preset("original2020").unwrap(),
        RuleSetSpec {
            players: 2,
            faces: 6,
            stop: Stop::Shifts(4),
            ..RuleSetSpec::default()
        },
        RuleSetSpec {
            players: 6,
            faces: 15,
            stop: Stop::Shifts(3),
            ..RuleSetSpec::default()
        },
    ];
    for (line, spec) in table.into_iter().enumerate() {
        let rules = rules(spec);
        let seed = Seed([line as u8; 32]);
        let first = played(rules, seed, &mut random(rules.players(), 40));
        assert!(first.len() > 80, "line {line}: {} decisions", first.len());
        let mut again: Vec<BuiltInAgent> = players(rules.players(), &first)
            .into_iter()
            .map(BuiltInAgent::replay)
            .collect();
        assert_eq!(again[0].name(), "replay");
        assert!(played(rules, seed, &mut again) == first, "line {line}");
    }
}

#[test]
fn no_two_decisions_look_the_same_to_a_seat() {
    for seed in 0..20 {
        let preset = RuleSetSpec::PRESETS[usize::from(seed) % 3];
        let rules = rules(RuleSetSpec::preset(preset).unwrap());
        let game = played(rules, Seed([seed; 32]), &mut random(4, seed));
        for (index, (seat, decision)) in game.iter().enumerate() {
            let twin = game[..index]
                .iter()
                .find(|(other, then)| other == seat && then.observation == decision.observation);
            assert!(twin.is_none(), "{preset}, seed {seed}: {decision:?}");
        }
    }
}

/// Counts decisions.
struct Steps(u32);

impl Listener for Steps {
    fn on_decision(&mut self, _: Decision, _: ActionId) {
        self.0 += 1;
    }
}

#[test]
fn players_finish_other_games_deterministically() {
    let standard = rules(RuleSetSpec::default());
    let first = played(standard, Seed([1; 32]), &mut random(4, 50));
    let own = players(4, &first);
    let other_deck = RuleSetSpec {
        players: 5,
        faces: 13,
        ..RuleSetSpec::default()
    };
    for spec in [RuleSetSpec::default(), other_deck] {
        let rules = rules(spec);
        let run = || {
            let mut agents: Vec<BuiltInAgent> = (0..rules.players())
                .map(|seat| BuiltInAgent::replay(own[seat % 4].clone()))
                .collect();
            let mut steps = Steps(0);
            let decide = |seat: Seat, observation: &Observation, legal: &Mask| {
                let action = agents[seat.index()].decide(observation, legal);
                assert!(legal.contains(action));
                action
            };
            let standings = play(rules, Seed([2; 32]), None, decide, &mut steps);
            (standings, steps.0)
        };
        let (standings, steps) = run();
        assert!(steps > 80);
        assert_eq!((standings, steps), run());
    }
}

fn space() -> ActionSpace {
    ActionSpace::new(11).unwrap()
}

fn action(text: &str) -> ActionId {
    space().parse(text).unwrap_or_else(|| panic!("{text}"))
}

fn actions(texts: &str) -> Mask {
    texts.split(", ").map(action).collect()
}

/// Seat 0's observation with this face and number of cards on the board.
fn observation(kind: DecisionKind, face: u8, size: u8) -> Observation {
    let game = Game::new(rules(RuleSetSpec::default()), Seed([1; 32]), |_| {});
    let mut observation = game.observe(Viewer::Seat(Seat::new(0)));
    observation.kind = Some(kind);
    observation.board.face = face;
    observation.board.size = size;
    observation
}

#[test]
fn the_most_similar_decision_with_a_legal_action_counts() {
    use DecisionKind::{Exchange, SpecialAction, Turn};
    // Kind, board, action, whether the player took it itself.
    let past = [
        (Turn, (0, 0), "C11;Q2;J0", true),
        (Turn, (9, 2), "C8;Q2;J0", true),
        (Turn, (5, 2), "C4;Q2;J0", true),
        (Turn, (5, 2), "pass", true),
        (Turn, (7, 3), "C2;Q1;J2", false),
        (Exchange, (0, 0), "give C11", true),
        (Exchange, (0, 0), "give C10", true),
    ];
    let all = |kind| match kind {
        Turn => actions("C11;Q2;J0, C8;Q2;J0, C4;Q2;J0, C2;Q1;J2, pass"),
        Exchange => actions("give C9, give C10, give C11"),
        SpecialAction => actions("decline, declare"),
    };
    let player =
        RecordedPlayer::new(
            past.map(|(kind, (face, size), text, own)| RecordedDecision {
                observation: observation(kind, face, size),
                legal: all(kind),
                action: action(text),
                own,
            }),
        );
    assert_eq!(player.decisions().len(), past.len());
    let table = [
        // An exact match, even if a substitute took it.
        (Turn, (7, 3), all(Turn), "C2;Q1;J2"),
        // The same board with more legal actions: the most similar decision that the player took
        // itself.
        (
            Turn,
            (7, 3),
            actions("C8;Q2;J0, C4;Q2;J0, C2;Q1;J2, C1;Q1;J2"),
            "C8;Q2;J0",
        ),
        (Turn, (5, 2), actions("C4;Q2;J0, pass"), "C4;Q2;J0"),
        (Turn, (6, 2), all(Turn), "C4;Q2;J0"),
        (Turn, (8, 2), all(Turn), "C8;Q2;J0"),
        // Illegal actions are skipped.
        (Turn, (8, 2), actions("C4;Q2;J0, pass"), "C4;Q2;J0"),
        (Turn, (8, 2), actions("C3;Q2;J0, pass"), "pass"),
        // No recorded action is legal: the default decision.
        (Turn, (0, 0), actions("C2;Q1;J0, C3;Q1;J0"), "C2;Q1;J0"),
        (SpecialAction, (0, 0), all(SpecialAction), "decline"),
        // The earliest of two that are equally similar.
        (Exchange, (3, 1), all(Exchange), "give C11"),
        (Exchange, (3, 1), actions("give C9, give C10"), "give C10"),
    ];
    for (line, (kind, (face, size), legal, expected)) in table.into_iter().enumerate() {
        let chosen = player.decide(&observation(kind, face, size), &legal);
        assert_eq!(
            space().text(chosen).as_deref(),
            Some(expected),
            "line {line}"
        );
    }
}

#[test]
fn actions_are_translated_by_meaning() {
    let decision = RecordedDecision {
        observation: observation(DecisionKind::Turn, 11, 1),
        legal: actions("C9;Q2;J1, pass"),
        action: action("C9;Q2;J1"),
        own: true,
    };
    let player = RecordedPlayer::new([decision]);
    for (faces, expected) in [(15, "C9;Q2;J1"), (9, "C9;Q2;J1"), (8, "pass")] {
        let space = ActionSpace::new(faces).unwrap();
        let mut now = observation(DecisionKind::Turn, faces, 1);
        now.faces = faces;
        let legal = Mask::from_actions(
            ["C1;Q1;J0", "C9;Q2;J1", "pass"]
                .iter()
                .filter_map(|text| space.parse(text)),
        );
        let chosen = player.decide(&now, &legal);
        assert_eq!(
            space.text(chosen).as_deref(),
            Some(expected),
            "{faces} faces"
        );
    }
}

#[test]
fn invalid_decisions_are_skipped() {
    let sound = RecordedDecision {
        observation: observation(DecisionKind::Turn, 0, 0),
        legal: actions("C9;Q2;J1, pass"),
        action: action("pass"),
        own: true,
    };
    let mut closed = sound.clone();
    closed.observation.kind = None;
    let mut nobodys = sound.clone();
    nobodys.observation.seat = None;
    let illegal = RecordedDecision {
        action: ActionId::new(9999),
        ..sound.clone()
    };
    let player = RecordedPlayer::new([closed, nobodys, sound.clone(), illegal]);
    assert_eq!(player.decisions(), [sound]);
    // A player without decisions takes default decisions.
    let nobody = RecordedPlayer::new([]);
    let now = observation(DecisionKind::Exchange, 0, 0);
    let legal = actions("give C2, give C3");
    assert!(legal.contains(nobody.decide(&now, &legal)));
}
