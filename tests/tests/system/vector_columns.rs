//! The columns of vector streams equal the engine's values for the same games.

use chefshat_agents::game_seed;
use chefshat_engine::{Event, Game, RuleSetSpec, Viewer};
use chefshat_proto::v1;
use chefshat_record::convert::{decision_kind, observation_to_proto};
use chefshat_tests::TestServer;

use crate::vectors::{play_on, setup};

#[tokio::test]
async fn every_column_equals_the_engines_value() {
    let server = TestServer::start().await;
    let client = server.client().await;
    let wanted = v1::VectorSetup {
        shift_statistics: true,
        reward_scheme: v1::RewardScheme::Points.into(),
        ..setup(3, 9)
    };
    let (mut games, batch) = client.vector(wanted).await.expect("games");
    let rules = RuleSetSpec::default().validate().expect("default rules");
    let mut alone: Vec<Game> = (0..3)
        .map(|index| Game::new(rules, game_seed(11, index), |_| {}))
        .collect();
    let mut rows = 0;
    let mut beside = Vec::new();
    let last = play_on(&mut games, batch, |batch, actions| {
        let begun = batch.beginnings.clone().unwrap_or_default();
        let (begun, indices) = (
            begun.games.as_chunks::<4>().0.to_vec(),
            begun.indices.to_vec(),
        );
        for (game, index) in begun.iter().zip(indices.as_chunks::<8>().0) {
            let seed = game_seed(11, u64::from_le_bytes(*index));
            alone[u32::from_le_bytes(*game) as usize] = Game::new(rules, seed, |_| {});
        }
        let seen = batch.observations.as_ref().expect("observations");
        for (row, bytes) in batch.games.as_chunks::<4>().0.iter().enumerate() {
            let game = &mut alone[u32::from_le_bytes(*bytes) as usize];
            let open = game.decision().expect("a decision is open");
            let view = game.observe(Viewer::Seat(open.seat));
            let expected = observation_to_proto(&view);
            let part = |column: &[u8], width: usize| column[row * width..][..width].to_vec();
            let numbers = |column: &[u8], width: usize| -> Vec<u64> {
                let bytes = part(column, 4 * width);
                let numbers = bytes.as_chunks::<4>().0.iter();
                numbers
                    .map(|number| u32::from_le_bytes(*number).into())
                    .collect()
            };
            let or_none = |cards: &[u8]| {
                if cards.is_empty() {
                    vec![0; 12]
                } else {
                    cards.to_vec()
                }
            };
            let board = [
                expected.board_face,
                expected.board_size,
                expected.board_jokers,
            ];
            assert_eq!(u32::from(batch.seats[row]), open.seat.index() as u32);
            assert_eq!(
                i32::from(batch.kinds[row]),
                i32::from(decision_kind(open.kind))
            );
            assert_eq!(numbers(&seen.shifts, 1), [u64::from(expected.shift)]);
            assert_eq!(numbers(&seen.pizzas, 1), [u64::from(expected.pizza)]);
            assert_eq!(part(&seen.hands, 12), expected.hand);
            assert_eq!(seen.golden[row], u8::from(expected.golden));
            assert!(
                part(&seen.boards, 3)
                    .iter()
                    .map(|part| u32::from(*part))
                    .eq(board)
            );
            let owner = expected.board_owner.unwrap_or(255);
            assert_eq!(u32::from(seen.board_owners[row]), owner);
            assert_eq!(part(&seen.cards_left, 4), expected.cards_left);
            assert_eq!(part(&seen.passed, 4), expected.passed);
            assert_eq!(part(&seen.places, 4), expected.places);
            assert_eq!(part(&seen.roles, 4), expected.roles);
            assert_eq!(numbers(&seen.points, 4), expected.points);
            assert_eq!(part(&seen.played, 12), expected.played);
            assert_eq!(part(&seen.gave, 12), or_none(&expected.gave));
            assert_eq!(part(&seen.received, 12), or_none(&expected.received));
            assert_eq!(
                part(&batch.action_masks, 27),
                game.legal_actions().to_bytes(214)
            );
            let action = u16::try_from(actions[row].0).expect("an action");
            game.apply(chefshat_engine::ActionId::new(action), |event| {
                if let Event::ShiftEnded(end) = event {
                    beside.push((
                        end.pizzas,
                        end.laps,
                        end.turns,
                        end.points.as_slice().to_vec(),
                    ));
                }
            })
            .expect("a legal action");
            rows += 1;
        }
    })
    .await;
    assert!(rows > 1000 && beside.len() > 20, "{rows} rows");
    assert_eq!(last.totals.expect("totals").shifts, beside.len() as u64);
}
