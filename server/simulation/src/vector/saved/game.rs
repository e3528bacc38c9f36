//! The bytes of the engine's state, a part of a saved game.

use chefshat_engine::{
    Board, Cards, GameState, RuleSet, Seat, SeatOrder, Seed, SpecialAction, Stage,
};

use super::reader::Reader;
use crate::vector::columns::NO_SEAT;
use crate::vector::error::StateError;

pub(super) fn put_game(out: &mut Vec<u8>, state: &GameState) {
    let faces = state.rules.faces();
    let number = |seat: Option<Seat>| seat.map_or(NO_SEAT, |seat| seat.index() as u8);
    out.extend(state.seed.0);
    out.extend(state.shift.to_le_bytes());
    out.extend(match state.stage {
        Stage::Over => [0, NO_SEAT, 0, 0],
        Stage::Turn(seat) => [1, number(Some(seat)), 0, 0],
        Stage::Exchange {
            giver,
            chef_left,
            sous_chef_left,
        } => [2, number(Some(giver)), chef_left, sous_chef_left],
        Stage::Special(seat) => [3, number(Some(seat)), 0, 0],
    });
    out.extend([state.board.face, state.board.size, state.board.jokers]);
    for count in [state.turns, state.laps, state.pizza, state.idle] {
        out.extend(count.to_le_bytes());
    }
    let last = number(state.last_to_play);
    out.extend([
        number(Some(state.starter)),
        number(Some(state.leader)),
        last,
    ]);
    out.extend(state.passed.values().map(|passed| u8::from(*passed)));
    out.extend(state.places.as_slice());
    put_cards(out, state.played, faces);
    for cards in [&state.hands, &state.gave, &state.received] {
        cards
            .values()
            .for_each(|cards| put_cards(out, *cards, faces));
    }
    for score in state.scores.values() {
        out.extend(score.to_le_bytes());
    }
    out.push(state.special.map_or(0, |special| special as u8));
    out.push(number(state.drawn));
    for order in [state.ranking, state.last_order] {
        out.push(order.is_some().into());
        if let Some(order) = order {
            out.extend(order.as_slice().iter().map(|seat| seat.index() as u8));
        }
    }
}

fn put_cards(out: &mut Vec<u8>, cards: Cards, faces: u8) {
    out.extend(cards.counts(faces));
    out.push(cards.has_golden().into());
}

pub(super) fn game(reader: &mut Reader<'_>, rules: RuleSet) -> Result<GameState, StateError> {
    let (players, faces) = (rules.players(), rules.faces());
    let cards = |reader: &mut Reader<'_>| cards(reader, faces);
    Ok(GameState {
        rules,
        seed: Seed(reader.array()?),
        shift: reader.u32()?,
        stage: stage(reader, players)?,
        board: {
            let [face, size, jokers] = reader.array()?;
            Board { face, size, jokers }
        },
        turns: reader.u32()?,
        laps: reader.u32()?,
        pizza: reader.u32()?,
        idle: reader.u32()?,
        starter: reader.seat(players)?,
        leader: reader.seat(players)?,
        last_to_play: reader.seat_or_none(players)?,
        passed: reader.by_seat(players, Reader::flag)?,
        places: reader.by_seat(players, Reader::u8)?,
        played: cards(reader)?,
        hands: reader.by_seat(players, cards)?,
        gave: reader.by_seat(players, cards)?,
        received: reader.by_seat(players, cards)?,
        scores: reader.by_seat(players, Reader::u64)?,
        special: match reader.u8()? {
            0 => None,
            1 => Some(SpecialAction::FoodFight),
            2 => Some(SpecialAction::DinnerIsServed),
            _ => return Err(StateError::Malformed("there is no such special action")),
        },
        drawn: reader.seat_or_none(players)?,
        ranking: reader.optional(|reader| order(reader, players))?,
        last_order: reader.optional(|reader| order(reader, players))?,
    })
}

fn stage(reader: &mut Reader<'_>, players: usize) -> Result<Stage, StateError> {
    let unknown = StateError::Malformed("no game stands like this");
    let kind = reader.u8()?;
    let seat = reader.seat_or_none(players)?;
    let [chef_left, sous_chef_left] = reader.array()?;
    match (kind, seat, chef_left, sous_chef_left) {
        (0, None, 0, 0) => Ok(Stage::Over),
        (1, Some(seat), 0, 0) => Ok(Stage::Turn(seat)),
        (2, Some(giver), ..) => Ok(Stage::Exchange {
            giver,
            chef_left,
            sous_chef_left,
        }),
        (3, Some(seat), 0, 0) => Ok(Stage::Special(seat)),
        _ => Err(unknown),
    }
}

fn order(reader: &mut Reader<'_>, players: usize) -> Result<SeatOrder, StateError> {
    let seats = reader.by_seat(players, |reader| reader.seat(players))?;
    let repeated = StateError::Malformed("an order repeats a seat");
    SeatOrder::from_slice(seats.as_slice()).ok_or(repeated)
}

fn cards(reader: &mut Reader<'_>, faces: u8) -> Result<Cards, StateError> {
    let counts = reader.take(usize::from(faces) + 1)?;
    let golden = reader.flag()?;
    let impossible = StateError::Malformed("the deck has no such cards");
    Cards::from_counts(faces, counts, golden).ok_or(impossible)
}
