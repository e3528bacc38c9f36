//! The output of a step as columns of bytes: one value or a fixed number of values per row, packed,
//! little-endian. The layout is that of the protocol's vector messages, so a column is sent as it
//! is.

use chefshat_engine::{
    ActionSpace, BySeat, Cards, DecisionKind, MAX_FACES, Mask, Observation, PlayedDecision, Seat,
    SeatOrder, Seed, ShiftMetrics, SpecialAction, Standings,
};

use super::history::History;
use super::{Episode, VectorSetup};

/// The end of an episode with a place for every seat.
const FINISHED: u8 = 1;
/// Seat in a column or a state where there is none.
pub(super) const NO_SEAT: u8 = u8::MAX;

/// The tables of one step.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Batch {
    /// Number of the batch, from 1.
    pub step: u64,
    /// Number of open decisions.
    pub rows: u32,
    /// Whether all games are over and none follows.
    pub done: bool,
    /// u32: game.
    pub games: Vec<u8>,
    /// u8: seat.
    pub seats: Vec<u8>,
    /// u8: kind of decision: 1 turn, 2 exchange, 3 special action.
    pub kinds: Vec<u8>,
    /// u32: invalid attempts so far.
    pub attempts: Vec<u8>,
    /// f32: rewards since the seat last decided.
    pub rewards: Vec<u8>,
    /// The observations of the seats.
    pub observations: ObservationColumns,
    /// ceil(A/8) bytes wide: legal actions.
    pub masks: Vec<u8>,
    /// u8 by seat and card: the hands of all seats; empty unless the setup asks for them.
    pub all_hands: Vec<u8>,
    /// Episodes that ended.
    pub endings: Endings,
    /// Games that began.
    pub beginnings: Beginnings,
    /// Shifts that ended, if statistics are enabled.
    pub shifts: Shifts,
    /// Totals since the beginning.
    pub totals: Totals,
    /// Games that ended, if records are enabled.
    pub played: Vec<PlayedGame>,
    /// Bytes of a mask.
    mask_bytes: usize,
}

/// Observations, one per row. Cards are F+1 counts, seats N values.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct ObservationColumns {
    /// u32.
    pub shifts: Vec<u8>,
    /// u32.
    pub pizzas: Vec<u8>,
    /// u8 by card.
    pub hands: Vec<u8>,
    /// u8: 0 or 1.
    pub golden: Vec<u8>,
    /// u8, 3 wide: face, size, jokers.
    pub boards: Vec<u8>,
    /// u8: seat that played the board, or 255.
    pub board_owners: Vec<u8>,
    /// u8 by seat.
    pub cards_left: Vec<u8>,
    /// u8 by seat.
    pub passed: Vec<u8>,
    /// u8 by seat.
    pub places: Vec<u8>,
    /// u8 by seat: 0 none, 1 Chef, 2 Sous-Chef, 3 Cook, 4 Waiter, 5 Dishwasher.
    pub roles: Vec<u8>,
    /// u32 by seat.
    pub points: Vec<u8>,
    /// u8 by card.
    pub played: Vec<u8>,
    /// u8 by card.
    pub gave: Vec<u8>,
    /// u8 by card.
    pub received: Vec<u8>,
    /// u16, as wide as the setup's history: the latest actions of the Shift that the seat may know,
    /// the most recent last, after zeros. With A actions, 1 + seat * (A+1) + action; action A is a
    /// gift of an unknown card.
    pub history: Vec<u8>,
    /// u32: number of the actions of the Shift that the seat may know; empty without history.
    pub history_counts: Vec<u8>,
    /// Width of `history`.
    width: u16,
}

/// Episodes of the client's seats that ended.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Endings {
    /// Number of rows.
    pub rows: u32,
    /// u32.
    pub games: Vec<u8>,
    /// u64.
    pub indices: Vec<u8>,
    /// u8.
    pub seats: Vec<u8>,
    /// f32: rewards since the seat last decided.
    pub rewards: Vec<u8>,
    /// u8: always 1, finished. Every episode ends with a place for each seat, also if its last
    /// Shift was adjudicated.
    pub ends: Vec<u8>,
    /// u8: 0 or 1.
    pub game_over: Vec<u8>,
    /// u8: place in the episode, from 1.
    pub places_taken: Vec<u8>,
    /// The final observations.
    pub observations: ObservationColumns,
}

/// Games that began.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Beginnings {
    /// Number of rows.
    pub rows: u32,
    /// u32.
    pub games: Vec<u8>,
    /// u64.
    pub indices: Vec<u8>,
    /// 32 bytes wide.
    pub seeds: Vec<u8>,
}

/// Shifts that ended.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Shifts {
    /// Number of rows.
    pub rows: u32,
    /// u32.
    pub games: Vec<u8>,
    /// u64.
    pub indices: Vec<u8>,
    /// u32: number in the game.
    pub shifts: Vec<u8>,
    /// u8.
    pub starters: Vec<u8>,
    /// u32.
    pub pizzas: Vec<u8>,
    /// u32.
    pub laps: Vec<u8>,
    /// u32.
    pub turns: Vec<u8>,
    /// u8: 0 none, 1 Food Fight, 2 Dinner is Served.
    pub special_actions: Vec<u8>,
    /// u8: 0 or 1.
    pub adjudicated: Vec<u8>,
    /// u8: seat, or 255.
    pub game_winners: Vec<u8>,
    /// u8 by seat.
    pub places: Vec<u8>,
    /// u32 by seat.
    pub points: Vec<u8>,
    /// u32 by seat.
    pub valid: Vec<u8>,
    /// u32 by seat.
    pub wrong: Vec<u8>,
    /// u32 by seat.
    pub passes: Vec<u8>,
    /// f32 by seat.
    pub reward_sums: Vec<u8>,
    /// f32 by seat.
    pub performance: Vec<u8>,
}

/// A game that ended, with all its decisions.
#[derive(Clone, Eq, PartialEq, Debug)]
pub struct PlayedGame {
    /// The game, from 0.
    pub game: u32,
    /// Its index.
    pub index: u64,
    /// Its seed.
    pub seed: Seed,
    /// Its decisions.
    pub decisions: Vec<PlayedDecision>,
}

/// Totals since the beginning.
#[derive(Copy, Clone, Eq, PartialEq, Debug, Default)]
pub struct Totals {
    /// Decisions of the client.
    pub client_decisions: u64,
    /// All decisions.
    pub decisions: u64,
    /// Invalid attempts of the client.
    pub invalid_attempts: u64,
    /// Shifts that ended.
    pub shifts: u64,
    /// Games that ended.
    pub games: u64,
}

/// An open decision, as a row.
pub(super) struct Row<'a> {
    pub(super) game: u32,
    pub(super) seat: Seat,
    pub(super) attempts: u32,
    pub(super) reward: f32,
    pub(super) observation: &'a Observation,
    pub(super) history: Option<&'a History>,
    pub(super) legal: &'a Mask,
    pub(super) all_hands: Option<&'a BySeat<Cards>>,
}

/// An ended episode of a seat, as a row.
pub(super) struct Ending<'a> {
    pub(super) game: u32,
    pub(super) index: u64,
    pub(super) seat: Seat,
    pub(super) reward: f32,
    pub(super) game_over: bool,
    pub(super) place: u8,
    pub(super) observation: &'a Observation,
    pub(super) history: Option<&'a History>,
}

impl Batch {
    /// An empty batch with capacity for this number of rows.
    pub(super) fn new(setup: &VectorSetup, rows: usize) -> Batch {
        let rules = setup.rules();
        let mask_bytes = usize::from(rules.actions().size()).div_ceil(8);
        let of = |width: usize| Vec::with_capacity(rows * width);
        Batch {
            games: of(4),
            seats: of(1),
            kinds: of(1),
            attempts: of(4),
            rewards: of(4),
            observations: ObservationColumns::with_room(
                rows,
                usize::from(rules.faces()) + 1,
                rules.players(),
                setup.history(),
            ),
            endings: Endings {
                observations: ObservationColumns {
                    width: setup.history(),
                    ..ObservationColumns::default()
                },
                ..Endings::default()
            },
            masks: of(mask_bytes),
            all_hands: of(setup.all_hands_width()),
            mask_bytes,
            ..Batch::default()
        }
    }

    /// All columns of the open decisions but those of the observations.
    fn columns(&mut self) -> [&mut Vec<u8>; 7] {
        [
            &mut self.games,
            &mut self.seats,
            &mut self.kinds,
            &mut self.attempts,
            &mut self.rewards,
            &mut self.masks,
            &mut self.all_hands,
        ]
    }

    /// Takes over the tables of the games that follow.
    pub(super) fn append(&mut self, next: &mut Batch) {
        self.rows += std::mem::take(&mut next.rows);
        append_columns(self.columns(), next.columns());
        self.observations.append(&mut next.observations);
        self.endings.append(&mut next.endings);
        self.beginnings.append(&mut next.beginnings);
        self.shifts.append(&mut next.shifts);
        self.played.append(&mut next.played);
    }

    /// Sorts what happened by game, but not the rows of open decisions. What happened in a game keeps
    /// its order.
    pub(super) fn sort_by_game(&mut self) {
        self.endings.sort_by_game();
        self.beginnings.sort_by_game();
        self.shifts.sort_by_game();
        self.played.sort_by_key(|played| played.game);
    }

    pub(super) fn push(&mut self, row: &Row<'_>) {
        self.rows += 1;
        put_u32(&mut self.games, row.game);
        self.seats.push(row.seat.index() as u8);
        self.kinds.push(row.observation.kind.map_or(0, kind_number));
        put_u32(&mut self.attempts, row.attempts);
        put_f32(&mut self.rewards, row.reward);
        self.observations
            .push(row.observation, row.seat, row.history);
        let mut words = row.legal.words().iter();
        for word in words.by_ref().take(self.mask_bytes / 8) {
            self.masks.extend_from_slice(&word.to_le_bytes());
        }
        let last = words.next().map_or([0; 8], |word| word.to_le_bytes());
        self.masks
            .extend(last.into_iter().take(self.mask_bytes % 8));
        for hand in row.all_hands.into_iter().flat_map(BySeat::values) {
            self.all_hands.extend(hand.counts(row.observation.faces));
        }
    }
}

impl Totals {
    pub(super) fn add(&mut self, more: &Totals) {
        self.client_decisions += more.client_decisions;
        self.decisions += more.decisions;
        self.invalid_attempts += more.invalid_attempts;
        self.shifts += more.shifts;
        self.games += more.games;
    }
}

impl ObservationColumns {
    /// All columns.
    fn columns(&mut self) -> [&mut Vec<u8>; 16] {
        [
            &mut self.shifts,
            &mut self.pizzas,
            &mut self.hands,
            &mut self.golden,
            &mut self.boards,
            &mut self.board_owners,
            &mut self.cards_left,
            &mut self.passed,
            &mut self.places,
            &mut self.roles,
            &mut self.points,
            &mut self.played,
            &mut self.gave,
            &mut self.received,
            &mut self.history,
            &mut self.history_counts,
        ]
    }

    /// Takes over the rows of another table.
    fn append(&mut self, next: &mut ObservationColumns) {
        append_columns(self.columns(), next.columns());
    }

    fn with_room(rows: usize, cards: usize, seats: usize, history: u16) -> ObservationColumns {
        let of = |width: usize| Vec::with_capacity(rows * width);
        // With room for the fixed number of bytes that is copied for the last row.
        let of_cards = || Vec::with_capacity(rows * cards + usize::from(MAX_FACES) + 1);
        ObservationColumns {
            shifts: of(4),
            pizzas: of(4),
            hands: of_cards(),
            golden: of(1),
            boards: of(3),
            board_owners: of(1),
            cards_left: of(seats),
            passed: of(seats),
            places: of(seats),
            roles: of(seats),
            points: of(4 * seats),
            played: of_cards(),
            gave: of_cards(),
            received: of_cards(),
            history: of(2 * usize::from(history)),
            history_counts: of(4 * usize::from(history.min(1))),
            width: history,
        }
    }

    fn push(&mut self, seen: &Observation, seat: Seat, history: Option<&History>) {
        let kinds = usize::from(seen.faces) + 1;
        let put_cards = |column: &mut Vec<u8>, cards: Cards| {
            // A fixed number of bytes is copied faster.
            let length = column.len() + kinds;
            column.extend_from_slice(&cards.count_array(seen.faces));
            column.truncate(length);
        };
        put_u32(&mut self.shifts, seen.shift);
        put_u32(&mut self.pizzas, seen.pizza);
        put_cards(&mut self.hands, seen.hand);
        self.golden.push(seen.hand.has_golden().into());
        let board = seen.board;
        self.boards
            .extend_from_slice(&[board.face, board.size, board.jokers]);
        self.board_owners.push(seat_or_none(seen.board_owner));
        self.cards_left
            .extend_from_slice(seen.cards_left.as_slice());
        self.passed
            .extend(seen.passed.values().map(|passed| u8::from(*passed)));
        self.places.extend_from_slice(seen.places.as_slice());
        let roles = seen.roles.values();
        self.roles
            .extend(roles.map(|role| role.map_or(0, |role| role as u8)));
        for points in seen.points.values() {
            put_u32(&mut self.points, u32::try_from(*points).unwrap_or(u32::MAX));
        }
        put_cards(&mut self.played, seen.played);
        put_cards(&mut self.gave, seen.gave);
        put_cards(&mut self.received, seen.received);
        if let Some(history) = history {
            let space = ActionSpace::new(seen.faces).expect("an observation has 4 to 15 faces");
            let count = history.write(self.width, seat, space, &mut self.history);
            put_u32(&mut self.history_counts, count);
        }
    }
}

impl Endings {
    /// All columns but those of the observations.
    fn columns(&mut self) -> [&mut Vec<u8>; 7] {
        [
            &mut self.games,
            &mut self.indices,
            &mut self.seats,
            &mut self.rewards,
            &mut self.ends,
            &mut self.game_over,
            &mut self.places_taken,
        ]
    }

    /// Takes over the rows of another table.
    fn append(&mut self, next: &mut Endings) {
        self.rows += std::mem::take(&mut next.rows);
        append_columns(self.columns(), next.columns());
        self.observations.append(&mut next.observations);
    }

    /// Sorts the rows by game. Those of a game keep their order.
    fn sort_by_game(&mut self) {
        if let Some(order) = order_by_game(&self.games) {
            reorder(self.columns(), &order);
            reorder(self.observations.columns(), &order);
        }
    }

    pub(super) fn push(&mut self, row: &Ending<'_>) {
        self.rows += 1;
        put_u32(&mut self.games, row.game);
        self.indices.extend_from_slice(&row.index.to_le_bytes());
        self.seats.push(row.seat.index() as u8);
        put_f32(&mut self.rewards, row.reward);
        self.ends.push(FINISHED);
        self.game_over.push(row.game_over.into());
        self.places_taken.push(row.place);
        self.observations
            .push(row.observation, row.seat, row.history);
    }
}

impl Beginnings {
    /// All columns.
    fn columns(&mut self) -> [&mut Vec<u8>; 3] {
        [&mut self.games, &mut self.indices, &mut self.seeds]
    }

    /// Takes over the rows of another table.
    fn append(&mut self, next: &mut Beginnings) {
        self.rows += std::mem::take(&mut next.rows);
        append_columns(self.columns(), next.columns());
    }

    /// Sorts the rows by game. Those of a game keep their order.
    fn sort_by_game(&mut self) {
        if let Some(order) = order_by_game(&self.games) {
            reorder(self.columns(), &order);
        }
    }

    pub(super) fn push(&mut self, game: u32, index: u64, seed: &[u8; 32]) {
        self.rows += 1;
        put_u32(&mut self.games, game);
        self.indices.extend_from_slice(&index.to_le_bytes());
        self.seeds.extend_from_slice(seed);
    }
}

impl Shifts {
    /// All columns.
    fn columns(&mut self) -> [&mut Vec<u8>; 17] {
        [
            &mut self.games,
            &mut self.indices,
            &mut self.shifts,
            &mut self.starters,
            &mut self.pizzas,
            &mut self.laps,
            &mut self.turns,
            &mut self.special_actions,
            &mut self.adjudicated,
            &mut self.game_winners,
            &mut self.places,
            &mut self.points,
            &mut self.valid,
            &mut self.wrong,
            &mut self.passes,
            &mut self.reward_sums,
            &mut self.performance,
        ]
    }

    /// Takes over the rows of another table.
    fn append(&mut self, next: &mut Shifts) {
        self.rows += std::mem::take(&mut next.rows);
        append_columns(self.columns(), next.columns());
    }

    /// Sorts the rows by game. Those of a game keep their order.
    fn sort_by_game(&mut self) {
        if let Some(order) = order_by_game(&self.games) {
            reorder(self.columns(), &order);
        }
    }

    pub(super) fn push(
        &mut self,
        game: u32,
        index: u64,
        shift: &ShiftMetrics,
        winner: Option<Seat>,
    ) {
        self.rows += 1;
        put_u32(&mut self.games, game);
        self.indices.extend_from_slice(&index.to_le_bytes());
        put_u32(&mut self.shifts, shift.shift);
        self.starters.push(shift.starter.index() as u8);
        put_u32(&mut self.pizzas, shift.pizzas);
        put_u32(&mut self.laps, shift.laps);
        put_u32(&mut self.turns, shift.turns);
        self.special_actions.push(match shift.special {
            None => 0,
            Some(SpecialAction::FoodFight) => 1,
            Some(SpecialAction::DinnerIsServed) => 2,
        });
        self.adjudicated.push(shift.adjudicated.into());
        self.game_winners.push(seat_or_none(winner));
        for seat in shift.seats.values() {
            self.places.push(seat.place);
            put_u32(&mut self.points, seat.points);
            put_u32(&mut self.valid, seat.valid);
            put_u32(&mut self.wrong, seat.wrong);
            put_u32(&mut self.passes, seat.passes);
            put_f32(&mut self.reward_sums, seat.reward_sum as f32);
            put_f32(&mut self.performance, seat.performance as f32);
        }
    }
}

/// Places by seat at the end of an episode: those of the Shift, or of the game if that is the
/// episode.
pub(super) fn places_taken(
    episode: Episode,
    shift: &SeatOrder,
    standings: Option<&Standings>,
) -> BySeat<u8> {
    let order = match (episode, standings) {
        (Episode::Game, Some(standings)) => standings.as_slice(),
        _ => shift.as_slice(),
    };
    let mut places = BySeat::filled(order.len(), 0);
    for (&seat, place) in order.iter().zip(1..) {
        places[seat] = place;
    }
    places
}

/// The number of a kind of decision in columns.
pub const fn kind_number(kind: DecisionKind) -> u8 {
    match kind {
        DecisionKind::Turn => 1,
        DecisionKind::Exchange => 2,
        DecisionKind::SpecialAction => 3,
    }
}

fn seat_or_none(seat: Option<Seat>) -> u8 {
    seat.map_or(NO_SEAT, |seat| seat.index() as u8)
}

/// Moves the rows of each column to its counterpart.
fn append_columns<const N: usize>(columns: [&mut Vec<u8>; N], next: [&mut Vec<u8>; N]) {
    for (column, next) in columns.into_iter().zip(next) {
        column.append(next);
    }
}

/// The rows in the order of their games; `None` if they are in it.
fn order_by_game(games: &[u8]) -> Option<Vec<usize>> {
    let (games, _) = games.as_chunks::<4>();
    let game = |row: usize| u32::from_le_bytes(games[row]);
    let mut order: Vec<usize> = (0..games.len()).collect();
    if order.is_sorted_by_key(|row| game(*row)) {
        return None;
    }
    order.sort_by_key(|row| game(*row));
    Some(order)
}

/// Puts the rows of columns in another order.
fn reorder<const N: usize>(columns: [&mut Vec<u8>; N], order: &[usize]) {
    for column in columns {
        let width = column.len() / order.len();
        let rows = order.iter().flat_map(|row| &column[row * width..][..width]);
        *column = rows.copied().collect();
    }
}

fn put_u32(column: &mut Vec<u8>, value: u32) {
    column.extend_from_slice(&value.to_le_bytes());
}

fn put_f32(column: &mut Vec<u8>, value: f32) {
    column.extend_from_slice(&value.to_le_bytes());
}
