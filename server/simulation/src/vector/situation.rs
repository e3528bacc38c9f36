//! Rows of decisions and of ended episodes, read back from their columns.

use chefshat_engine::{Board, BySeat, Cards, DecisionKind, Mask, Observation, Role, RuleSet, Seat};

use super::columns::{Batch, Endings, ObservationColumns, kind_number};

/// What a row says of its seat.
#[derive(Clone, PartialEq, Debug)]
pub struct Situation {
    /// What the seat may know. Cards that were exchanged do not say which is the Golden card.
    pub observation: Observation,
    /// The legal actions; none at the end of an episode.
    pub legal: Mask,
    /// Rewards since the seat last decided.
    pub reward: f32,
    /// Invalid attempts so far.
    pub attempts: u32,
}

impl Batch {
    /// The open decision of a row, of games with these rules; `None` if there is no such row.
    pub fn situation(&self, row: usize, rules: &RuleSet) -> Option<Situation> {
        let kinds = [
            DecisionKind::Turn,
            DecisionKind::Exchange,
            DecisionKind::SpecialAction,
        ];
        let [number] = at(&self.kinds, row)?;
        let kind = kinds.into_iter().find(|kind| kind_number(*kind) == number);
        let seat = Seat::new(usize::from(*self.seats.get(row)?));
        let width = usize::from(rules.actions().size()).div_ceil(8);
        Some(Situation {
            observation: self.observations.observation(row, seat, kind, rules)?,
            legal: Mask::from_bytes(wide(&self.masks, row, width)?)?,
            reward: f32::from_le_bytes(at(&self.rewards, row)?),
            attempts: u32::from_le_bytes(at(&self.attempts, row)?),
        })
    }
}

impl Endings {
    /// The end of a row's episode, of games with these rules; `None` if there is no such row.
    pub fn situation(&self, row: usize, rules: &RuleSet) -> Option<Situation> {
        let seat = Seat::new(usize::from(*self.seats.get(row)?));
        Some(Situation {
            observation: self.observations.observation(row, seat, None, rules)?,
            legal: Mask::EMPTY,
            reward: f32::from_le_bytes(at(&self.rewards, row)?),
            attempts: 0,
        })
    }
}

impl ObservationColumns {
    fn observation(
        &self,
        row: usize,
        seat: Seat,
        kind: Option<DecisionKind>,
        rules: &RuleSet,
    ) -> Option<Observation> {
        let (faces, players) = (rules.faces(), rules.players());
        let cards = |column, golden| {
            Cards::from_counts(faces, wide(column, row, usize::from(faces) + 1)?, golden)
        };
        let by_seat = |column| BySeat::from_slice(wide(column, row, players)?);
        let [golden] = at(&self.golden, row)?;
        let [face, size, jokers] = at(&self.boards, row)?;
        let [owner] = at(&self.board_owners, row)?;
        let (points, _) = wide(&self.points, row, 4 * players)?.as_chunks::<4>();
        let points = BySeat::from_slice(points)?;
        Some(Observation {
            seat: Some(seat),
            kind,
            faces,
            hand_size: rules.hand_size(),
            shift: u32::from_le_bytes(at(&self.shifts, row)?),
            pizza: u32::from_le_bytes(at(&self.pizzas, row)?),
            hand: cards(&self.hands, golden != 0)?,
            board: Board { face, size, jokers },
            board_owner: (usize::from(owner) < players).then(|| Seat::new(owner.into())),
            cards_left: by_seat(&self.cards_left)?,
            passed: by_seat(&self.passed)?.map(|passed| passed != 0),
            places: by_seat(&self.places)?,
            roles: by_seat(&self.roles)?.map(role),
            points: points.map(|points| u32::from_le_bytes(points).into()),
            played: cards(&self.played, false)?,
            gave: cards(&self.gave, false)?,
            received: cards(&self.received, false)?,
        })
    }
}

fn role(number: u8) -> Option<Role> {
    use Role::{Chef, Cook, Dishwasher, SousChef, Waiter};
    let roles = [Chef, SousChef, Cook, Waiter, Dishwasher];
    roles.into_iter().find(|role| *role as u8 == number)
}

/// The bytes of a row.
fn wide(column: &[u8], row: usize, width: usize) -> Option<&[u8]> {
    column.get(row * width..)?.get(..width)
}

/// The bytes of a row of a known width.
fn at<const N: usize>(column: &[u8], row: usize) -> Option<[u8; N]> {
    wide(column, row, N)?.try_into().ok()
}
