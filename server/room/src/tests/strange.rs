//! Random inputs in random order: no panic, no unchecked change, and a journal that replays to the
//! same room.

use chefshat_agents::AgentKind;
use proptest::prelude::*;

use super::*;
use crate::Expression;

#[derive(Debug, Clone)]
enum Input {
    Join(Option<u32>),
    Attach(usize),
    Lose(usize, u64),
    Answer {
        seat: usize,
        decision_offset: u64,
        action: u32,
    },
    AnswerOpen(usize),
    Express(usize, bool),
    Resume(usize),
    Wait(u64),
}

fn input() -> impl Strategy<Value = Input> {
    prop_oneof![
        1 => proptest::option::of(0..9u32).prop_map(Input::Join),
        2 => (0..4usize).prop_map(Input::Attach),
        1 => (0..4usize, 0..12u64).prop_map(|(seat, connection)| Input::Lose(seat, connection)),
        4 => (0..4usize, 0..5u64, 0..600u32).prop_map(|(seat, decision_offset, action)| {
            Input::Answer { seat, decision_offset, action }
        }),
        20 => (0..300usize).prop_map(Input::AnswerOpen),
        1 => (0..4usize, any::<bool>()).prop_map(|(seat, private)| Input::Express(seat, private)),
        1 => (0..4usize).prop_map(Input::Resume),
        2 => (0..3000u64).prop_map(Input::Wait),
    ]
}

fn step(table: &mut Table, input: &Input) {
    match *input {
        Input::Join(seat) => {
            let _ = table.core.join(
                table.now,
                seat,
                participant("somebody", ParticipantKind::Agent),
            );
        }
        Input::Attach(seat) => {
            table.attach(Seat::new(seat));
        }
        Input::Lose(seat, connection) => table.lost(Seat::new(seat), ConnectionId(connection)),
        Input::Answer {
            seat,
            decision_offset,
            action,
        } => {
            let id = table.core.open().map_or(0, |open| open.id) + decision_offset;
            table.answer(Seat::new(seat), id.saturating_sub(2), action);
        }
        Input::AnswerOpen(index) => {
            if let Some(open) = table.core.open() {
                let (seat, id) = (open.decision.seat, open.id);
                let action = table.legal(index);
                table.answer(seat, id, action);
            }
        }
        Input::Express(seat, record_only) => {
            let expression = Expression {
                record_only,
                ..Expression::default()
            };
            let _ = (table.core).express(table.now, Seat::new(seat), expression);
        }
        Input::Resume(seat) => table.core.resume(table.now, Seat::new(seat)),
        Input::Wait(time) => table.pass_time(ms(time)),
    }
    table.commit();
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(128))]

    #[test]
    fn random_inputs_leave_a_room_that_replays(
        inputs in proptest::collection::vec(input(), 1..400),
        built_in in proptest::option::of(0..4usize),
        begin in any::<bool>(),
        absence in proptest::option::of(0..1500u64),
    ) {
        let mut fills = vec![OPEN; 4];
        if let Some(seat) = built_in {
            fills[seat] = Fill::BuiltIn(AgentKind::RandomUnmasked.into());
        }
        let policy = Policy {
            decision_time: ms(1000),
            bank: ms(2000),
            max_timeouts: 2,
            max_invalid_attempts: Some(3),
            pace: Some(ms(50)),
            absence_time: absence.map(ms),
            ..Policy::default()
        };
        let mut table = Table::empty(policy, fills);
        if begin {
            table.fill();
        }
        for input in &inputs {
            let before = table.core.log().len();
            let decisions = table.core.decisions();
            step(&mut table, input);
            prop_assert!(table.core.log().len() >= before);
            prop_assert!(table.core.decisions() >= decisions);
        }
        table.assert_replays();
    }
}
