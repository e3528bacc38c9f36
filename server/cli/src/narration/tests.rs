//! A scripted game with its exact text, and generated games of every size that keep within the page
//! width.

use chefshat_agents::{AgentKind, BuiltInAgent};
use chefshat_client::v1::{self, game_event::Kind};
use chefshat_engine::{Event, Game, RuleSet, RuleSetSpec, Seat, Seed, Viewer};
use chefshat_record::convert::{By, event_kind, observation_to_proto, rules_to_proto};

use super::Narrator;
use super::text::{WIDTH, columns};
use super::view::GameView;

/// The text of events without colours.
fn text_of(narrator: &mut Narrator, events: impl IntoIterator<Item = Kind>) -> String {
    let mut out = String::new();
    for (sequence, kind) in (1..).zip(events) {
        out.push_str(&narrator.narrate(&v1::GameEvent {
            sequence,
            kind: Some(kind),
            ..v1::GameEvent::default()
        }));
    }
    anstream::adapter::strip_str(&out).to_string()
}

fn check(events: impl IntoIterator<Item = Kind>, expected: &str) {
    let text = text_of(&mut Narrator::default(), events);
    let text: Vec<&str> = text.lines().map(str::trim_end).collect();
    let expected: Vec<&str> = expected.lines().map(str::trim_end).collect();
    assert_eq!(text, expected, "{}", text.join("\n"));
}

fn standard() -> RuleSet {
    RuleSetSpec::default().validate().expect("the standard")
}

fn game_started(rules: &RuleSet, names: &[&str]) -> Kind {
    Kind::GameStarted(Box::new(v1::GameStarted {
        rules: Some(rules_to_proto(rules)),
        hand_size: rules.hand_size().into(),
        seats: names
            .iter()
            .map(|name| v1::Participant {
                name: (*name).to_owned(),
                kind: v1::ParticipantKind::Agent.into(),
                ..v1::Participant::default()
            })
            .collect(),
        ..v1::GameStarted::default()
    }))
}

fn shift_started(shift: u32) -> Kind {
    Kind::ShiftStarted(v1::ShiftStarted {
        shift,
        hands: Vec::new(),
    })
}

fn roles(roles: [v1::Role; 4]) -> Kind {
    Kind::RolesAssigned(v1::RolesAssigned {
        roles: roles.map(i32::from).to_vec(),
    })
}

fn gives(giver: u32, count: u32, receiver: u32) -> Kind {
    Kind::CardsExchanged(Box::new(v1::CardsExchanged {
        giver,
        receiver,
        count,
        cards: Vec::new(),
        golden: false,
    }))
}

/// `seat` plays `quantity` cards of `face` with `jokers` and has `cards_left`.
fn play(seat: u32, (quantity, face, jokers): (u32, u32, u32), cards_left: u32) -> Kind {
    Kind::Play(v1::Play {
        seat,
        quantity,
        face,
        jokers,
        cards_left,
        source: v1::DecisionSource::Agent.into(),
        ..v1::Play::default()
    })
}

fn pass(seat: u32, source: v1::DecisionSource) -> Kind {
    Kind::Pass(v1::Pass {
        seat,
        source: source.into(),
        decision_time_us: 0,
    })
}

fn done(pizza: u32, last_to_play: Option<u32>, next_leader: u32) -> Kind {
    Kind::PizzaDone(v1::PizzaDone {
        pizza,
        last_to_play,
        next_leader,
    })
}

fn finished(seat: u32, place: u32) -> Kind {
    Kind::SeatFinished(v1::SeatFinished { seat, place })
}

fn shift_ended(order: [u32; 4], points: [u32; 4], scores: [u64; 4]) -> Kind {
    Kind::ShiftEnded(Box::new(v1::ShiftEnded {
        order: order.to_vec(),
        shift_points: points.to_vec(),
        points: scores.to_vec(),
        pizzas: 4,
        turns: 16,
        ..v1::ShiftEnded::default()
    }))
}

#[test]
fn a_first_shift() {
    use v1::DecisionSource::{Agent, Invalid, Timeout};
    let events = [
        game_started(&standard(), &["Greta", "Rolf", "Gustav", "Rita"]),
        shift_started(1),
        play(2, (3, 11, 0), 14),
        pass(3, Agent),
        play(0, (2, 8, 1), 14),
        play(1, (6, 5, 0), 11),
        pass(2, Agent),
        pass(0, Agent),
        done(1, Some(1), 1),
        pass(1, Agent),
        pass(2, Agent),
        pass(3, Timeout),
        pass(0, Agent),
        done(2, None, 2),
        play(2, (0, 12, 1), 13),
        play(3, (1, 9, 0), 16),
        play(0, (1, 7, 2), 11),
        play(1, (4, 5, 0), 7),
        pass(2, Agent),
        play(3, (5, 4, 0), 11),
        pass(0, Invalid),
        play(1, (7, 2, 0), 0),
        finished(1, 1),
        done(3, Some(1), 2),
        play(2, (13, 10, 0), 0),
        finished(2, 2),
        pass(3, Agent),
        play(0, (11, 9, 0), 0),
        finished(0, 3),
        shift_ended([1, 2, 0, 3], [1, 5, 3, 0], [1, 5, 3, 0]),
    ];
    check(
        events,
        "   at the table  Greta agent · Rolf agent · Gustav agent · Rita agent
   the rules     to 15 points · 11 faces and 2 jokers · 17 cards each · 5, 3, 1, 0 points by place

━━ Shift 1 ━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━
   no roles in the first Shift; the holder of the Golden 11 (★) opens with it

pizza                                                                Greta    Rolf  Gustav    Rita
    1  Gustav 3×11★ › (Rita) › Greta 2×8+J › Rolf 6×5                   14      11      14      17
    2  nobody plays › (Rita too late)                                   14      11      14      17
    3  Gustav J › Rita 1×9 › Greta 1×7+2J › Rolf 4×5 › (Gustav)
       › Rita 5×4 › (Greta invalid) › Rolf 7×2 1st                      11     1st      13      11
    4  Gustav 13×10 2nd › (Rita) › Greta 11×9 3rd                      3rd     1st     2nd      11

   4 pizzas, 16 turns
   1st  Rolf           +5     5  ▓▓▓▓▓▓▓▓▓▓▓▓▓▓▓░░░░░░░░░░░░░░░░░░░░░░░░░░░░░░
   2nd  Gustav         +3     3  ▓▓▓▓▓▓▓▓▓░░░░░░░░░░░░░░░░░░░░░░░░░░░░░░░░░░░░
   3rd  Greta          +1     1  ▓▓▓░░░░░░░░░░░░░░░░░░░░░░░░░░░░░░░░░░░░░░░░░░
   4th  Rita           +0     0  ░░░░░░░░░░░░░░░░░░░░░░░░░░░░░░░░░░░░░░░░░░░░░
",
    );
}

#[test]
fn roles_special_actions_and_incidents() {
    use v1::DecisionSource::Agent;
    use v1::Role::{Chef, Dishwasher, SousChef, Waiter};
    let events = [
        game_started(&standard(), &["Greta", "Rolf", "Gustav", "Rita"]),
        shift_ended([0, 1, 2, 3], [5, 3, 1, 0], [5, 3, 1, 0]),
        shift_started(2),
        roles([Chef, SousChef, Waiter, Dishwasher]),
        Kind::SpecialActionDeclared(Box::new(v1::SpecialActionDeclared {
            seat: 3,
            action: v1::SpecialAction::FoodFight.into(),
            ..v1::SpecialActionDeclared::default()
        })),
        roles([Dishwasher, Waiter, SousChef, Chef]),
        gives(0, 2, 3),
        gives(3, 2, 0),
        gives(1, 1, 2),
        gives(2, 1, 1),
        play(3, (2, 11, 0), 15),
        Kind::Disconnected(v1::Disconnected {
            seat: 0,
            ..v1::Disconnected::default()
        }),
        Kind::Substituted(v1::Substituted {
            seat: 0,
            built_in_agent: "random".into(),
            for_good: false,
        }),
        play(0, (2, 6, 0), 15),
        done(1, Some(0), 0),
        Kind::Returned(v1::Returned { seat: 0 }),
        pass(0, Agent),
        play(1, (1, 8, 0), 16),
        Kind::GameAborted(Box::new(v1::GameAborted {
            reason: v1::AbortReason::Closed.into(),
            reveal: None,
        })),
    ];
    check(
        events,
        "   at the table  Greta agent · Rolf agent · Gustav agent · Rita agent
   the rules     to 15 points · 11 faces and 2 jokers · 17 cards each · 5, 3, 1, 0 points by place

   4 pizzas, 16 turns
   1st  Greta          +5     5  ▓▓▓▓▓▓▓▓▓▓▓▓▓▓▓░░░░░░░░░░░░░░░░░░░░░░░░░░░░░░
   2nd  Rolf           +3     3  ▓▓▓▓▓▓▓▓▓░░░░░░░░░░░░░░░░░░░░░░░░░░░░░░░░░░░░
   3rd  Gustav         +1     1  ▓▓▓░░░░░░░░░░░░░░░░░░░░░░░░░░░░░░░░░░░░░░░░░░
   4th  Rita           +0     0  ░░░░░░░░░░░░░░░░░░░░░░░░░░░░░░░░░░░░░░░░░░░░░

━━ Shift 2 ━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━
   Chef Greta · Sous-Chef Rolf · Waiter Gustav · Dishwasher Rita
   Rita ✦ Food Fight! Two jokers: all roles are reversed
   now  Chef Rita · Sous-Chef Gustav · Waiter Rolf · Dishwasher Greta
   exchange  Greta 2 cards → Rita · Rita 2 cards → Greta · Rolf 1 card → Gustav
             Gustav 1 card → Rolf

pizza                                                                Greta    Rolf  Gustav    Rita
    1  Rita 2×11★
   Greta is disconnected
   Greta is replaced by random
       Greta 2×6                                                        15      17      17      15
   Greta is back
    2  (Greta) › Rolf 1×8                                               15      16      17      15

The game was aborted and has no result: its room was closed.
",
    );
}

#[test]
fn a_branch_and_a_restart() {
    use v1::DecisionSource::{Agent, Recorded};
    let by = |source: v1::DecisionSource, kind| match kind {
        Kind::Play(play) => Kind::Play(v1::Play {
            source: source.into(),
            ..play
        }),
        kind => kind,
    };
    let events = [
        game_started(&standard(), &["Greta", "Rolf", "Gustav", "Rita"]),
        shift_started(3),
        gives(0, 2, 3),
        by(Recorded, play(3, (2, 11, 0), 15)),
        pass(0, Recorded),
        by(Recorded, play(1, (2, 9, 0), 15)),
        by(Agent, play(2, (2, 8, 0), 15)),
        Kind::ServerRestarted(v1::ServerRestarted {}),
        pass(3, Agent),
        play(0, (2, 7, 0), 15),
        done(1, Some(0), 0),
    ];
    check(
        events,
        "   at the table  Greta agent · Rolf agent · Gustav agent · Rita agent
   the rules     to 15 points · 11 faces and 2 jokers · 17 cards each · 5, 3, 1, 0 points by place

━━ Shift 3 ━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━
   exchange  Greta 2 cards → Rita

pizza                                                                Greta    Rolf  Gustav    Rita
    1  Rita 2×11★ › (Greta) › Rolf 2×9
   end of the recorded decisions; the players decide from here
       Gustav 2×8
   the server was restarted; the game resumes
       (Rita) › Greta 2×7                                               15      15      15      15
",
    );
}

#[test]
fn standings_name_the_winner() {
    let standing = |seat, points, place| v1::Standing {
        seat,
        points,
        place,
    };
    let mut narrator = Narrator::default().with_labels(["greedy".into(), "random".into()]);
    let two = RuleSetSpec {
        players: 2,
        ..RuleSetSpec::default()
    };
    let rules = two.validate().expect("two may play");
    let text = text_of(
        &mut narrator,
        [
            game_started(&rules, &["Greta", "Rolf"]),
            Kind::GameEnded(Box::new(v1::GameEnded {
                standings: vec![standing(1, 15, 1), standing(0, 1, 2)],
                reveal: None,
            })),
        ],
    );
    let lines: Vec<&str> = text.lines().collect();
    let last = &lines[lines.len() - 2..];
    assert_eq!(
        last,
        [
            "   1st  Rolf          random           15 points   ★ wins the game",
            "   2nd  Greta         greedy             1 point"
        ]
    );
}

#[test]
fn a_tie_is_explained() {
    let standing = |seat, place| v1::Standing {
        seat,
        points: 16,
        place,
    };
    let ended = Kind::GameEnded(Box::new(v1::GameEnded {
        standings: vec![standing(2, 1), standing(0, 2)],
        reveal: None,
    }));
    let text = text_of(&mut Narrator::default(), [ended]);
    assert!(text.contains("seat 3"), "{text}");
    assert_eq!(
        text.matches("wins by its place in the last Shift").count(),
        1
    );
}

#[test]
fn names_are_safe_and_unique() {
    let text = text_of(
        &mut Narrator::default(),
        [game_started(
            &standard(),
            &["bot", "bot", "\u{1b}[2Jwipe", ""],
        )],
    );
    let table = text.lines().next().unwrap_or_default();
    assert_eq!(
        table,
        "   at the table  bot#1 agent · bot#2 agent · [2Jwipe agent · seat 4 agent"
    );
}

#[test]
fn a_table_with_more_seats_than_any_game_has_a_line() {
    let names = ["Ada"; 100];
    let most = u32::MAX;
    let table = [
        game_started(&standard(), &names),
        shift_started(most),
        play(99, (most, most, most), most),
        done(most, Some(most), most),
    ];
    let text = text_of(&mut Narrator::default(), table);
    assert!(text.contains("Ada#100 4294967295×4294967295"), "{text}");
}

#[test]
fn a_correction_at_a_physical_table_takes_back_what_is_void() {
    use v1::DecisionSource::Table;
    let mut narrator = Narrator::of_room(&v1::Room {
        origin: v1::GameOrigin::Physical.into(),
        ..v1::Room::default()
    });
    let events = [
        game_started(&standard(), &["Ada", "Bo", "Greta", "Cy"]),
        shift_started(1),
        Kind::HandReported(Box::new(v1::HandReported {
            hand: Some(v1::SeatCards {
                seat: 2,
                cards: vec![8, 8, 12],
                golden: false,
            }),
            dealt: true,
        })),
        play(0, (1, 11, 0), 16),
        pass(1, Table),
        play(2, (2, 8, 0), 1),
        Kind::Violation(Box::new(v1::Violation {
            seat: Some(2),
            text: "It is Cy's turn.".into(),
            ..v1::Violation::default()
        })),
        Kind::Correction(Box::new(v1::Correction {
            first_void: 5,
            text: "Corrected: Bo laid two 9s. (Before: Bo passed.)".into(),
            report: 3,
        })),
        play(1, (2, 9, 0), 15),
        Kind::TablePaused(v1::TablePaused { paused: true }),
    ];
    let text = text_of(&mut narrator, events);
    let last: Vec<&str> = text.lines().rev().take(8).map(str::trim_end).collect();
    assert_eq!(
        last.into_iter().rev().collect::<Vec<_>>(),
        [
            "   Greta has a known hand",
            "",
            "pizza                                                                     Ada     Bo  Greta     Cy",
            "    1  Ada 1×11★ › (Bo) › Greta 2×8",
            "   ⚠ Greta: It is Cy's turn.",
            "   Corrected: Bo laid two 9s. (Before: Bo passed.)",
            "    1  Bo 2×9",
            "   the game is paused",
        ],
        "{text}"
    );
    let [_, bo, greta, _] = narrator.view.seats.as_slice() else {
        panic!("four seats");
    };
    assert_eq!((bo.passed, bo.cards, greta.cards), (false, 15, 17));
    let hand = greta.hand.as_ref().map(|hand| hand.counts[7]);
    assert_eq!((hand, narrator.view.turns), (Some(2), 2));
}

#[test]
fn a_snapshot_has_what_the_events_have_shown() {
    let names = ["Greta", "Rolf", "Gustav", "Rita"];
    let rules = standard();
    let viewer = Viewer::Seat(Seat::new(0));
    let start = game_started(&rules, &names);
    let mut by_events = GameView::default();
    let event = |kind| v1::GameEvent {
        kind: Some(kind),
        ..v1::GameEvent::default()
    };
    by_events.apply(&event(start.clone()));
    let Kind::GameStarted(start) = start else {
        panic!("it is the start")
    };
    let mut compared = 0;
    let mut seen = 0;
    play_engine(rules, names.len(), 7, |game, events| {
        for next in &events[seen..] {
            let kind = event_kind(&next.seen_by(viewer), rules.actions(), BY);
            kind.into_iter()
                .for_each(|kind| by_events.apply(&event(kind)));
        }
        seen = events.len();
        let observation = game.observe(viewer);
        let snapshot = v1::Snapshot {
            game_started: Some(*start.clone()),
            observation: Some(observation_to_proto(&observation)),
            next_sequence: 1,
        };
        let mut restored = GameView::default();
        restored.restore(&snapshot, Some(0));
        // What a snapshot does not say.
        let mut known = by_events.clone();
        known.turns = known.turns.min(1);
        known.turn = None;
        known.last_order.clear();
        for view in [&mut known, &mut restored] {
            view.board.iter_mut().for_each(|board| board.golden = false);
            for place in &mut view.seats {
                // In the exchange, whether it is the Golden card that is given.
                if observation.pizza == 0
                    && let Some(hand) = &mut place.hand
                {
                    hand.golden = false;
                }
                // With the place in the Shift the events show no more of who has passed.
                place.passed &= place.finished.is_none();
            }
        }
        assert_eq!(format!("{restored:?}"), format!("{known:?}"));
        compared += 1;
    });
    assert!(compared > 100, "{compared}");
}

/// The source and time of every decision of [`play_engine`].
const BY: By = By {
    source: v1::DecisionSource::Disconnected,
    decision_time_us: 0,
};

/// Plays a game of the engine; the text a spectator reads.
fn played(rules: RuleSet, names: &[&str], seed: u8) -> String {
    let events = play_engine(rules, names.len(), seed, |_, _| ());
    let kinds = events
        .iter()
        .filter_map(|event| event_kind(&event.seen_by(Viewer::Spectator), rules.actions(), BY));
    let all = std::iter::once(game_started(&rules, names)).chain(kinds);
    text_of(&mut Narrator::default(), all)
}

/// Plays a game of the engine, shown before each decision; its events.
fn play_engine(
    rules: RuleSet,
    players: usize,
    seed: u8,
    mut show: impl FnMut(&Game, &[Event]),
) -> Vec<Event> {
    let mut agents: Vec<BuiltInAgent> = (0..players)
        .map(|seat| {
            let kind = AgentKind::ALL[seat % 3];
            let seat = u8::try_from(seat).expect("a seat is below six");
            BuiltInAgent::new(kind, [seed ^ seat; 32])
        })
        .collect();
    let mut events: Vec<Event> = Vec::new();
    let mut game = Game::new(rules, Seed([seed; 32]), |event| events.push(event));
    while let Some(decision) = game.decision() {
        show(&game, &events);
        let legal = game.legal_actions();
        let seen = game.observe(Viewer::Seat(decision.seat));
        let wish = agents[decision.seat.index()].decide(&seen, &legal);
        let action = if legal.contains(wish) {
            wish
        } else {
            game.default_action().expect("a decision has a default")
        };
        game.apply(action, |event| events.push(event))
            .expect("the action is legal");
    }
    events
}

#[test]
fn no_line_is_wider_than_the_page() {
    let names = [
        "Wilhelmina the Great",
        "料理長のとても長い名前",
        "Bartholomew",
        "Maximiliano",
        "Christopher",
        "Alexandrina",
    ];
    for players in 2..=6 {
        for seed in 1..4 {
            let spec = RuleSetSpec {
                players,
                faces: 15,
                ..RuleSetSpec::default()
            };
            let rules = spec.validate().expect("any number of seats may play");
            let text = played(rules, &names[..usize::from(players)], seed);
            assert!(text.lines().count() > 40, "a game takes more lines");
            for line in text.lines() {
                assert!(columns(line) <= WIDTH, "{players} seats: {line}");
            }
        }
    }
}

#[test]
fn break_off_ends_an_open_line() {
    let mut narrator = Narrator::default();
    assert_eq!(narrator.break_off(), "", "nothing is open");
    text_of(
        &mut narrator,
        [
            game_started(&standard(), &["Ada", "Ben", "Cleo", "Dan"]),
            shift_started(1),
            play(0, (3, 11, 0), 14),
        ],
    );
    assert_eq!(narrator.break_off(), "\n");
    assert_eq!(narrator.break_off(), "");
}
