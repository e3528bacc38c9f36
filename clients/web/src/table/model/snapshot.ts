// What a viewer knows of a table from a snapshot or an observation, in place of the events so far.
// Neither says whose turn it is or what happened before.

import type { Observation } from "../../gen/chefshat/v1/decision_pb";
import type { Snapshot } from "../../gen/chefshat/v1/play_service_pb";
import { cardsFromCounts, playedCards } from "./cards";
import { fromRules, seatFromParticipant, type TableState, withHistory } from "./state";

/** The table of a snapshot, for the holder of a seat or a spectator. */
export function applySnapshot(table: TableState, snapshot: Snapshot, own: number | undefined): TableState {
  const nextSequence = Number(snapshot.nextSequence);
  const { gameStarted: start, observation } = snapshot;
  if (!start || !observation) return { ...table, nextSequence };
  const { gameId, policy } = start;
  const seats = start.seats.map(seatFromParticipant);
  const unknown = { log: [], next: undefined, toppings: [], results: [] };
  const begun = { ...table, ...unknown, ...fromRules(start.rules), gameId, policy, seats, nextSequence };
  const seen = applyObservation(begun, beforeGifts(observation), own);
  return table.history ? withHistory(seen) : seen;
}

/** The observation without the gifts of an exchange in progress, whose events are still to come. */
function beforeGifts(seen: Observation): Observation {
  if (seen.pizza > 0) return seen;
  const handSize = Math.max(0, ...seen.cardsLeft);
  const hand = seen.hand.map((count, face) => count + (seen.gave[face] ?? 0));
  return { ...seen, hand, cardsLeft: seen.cardsLeft.map(() => handSize) };
}

/** The table with everything in an observation. */
export function applyObservation(table: TableState, seen: Observation, own: number | undefined): TableState {
  const { faces } = table;
  const alone = seen.boardFace > faces;
  const quantity = alone ? 0 : seen.boardSize - seen.boardJokers;
  const seats = table.seats.map((seat) => {
    const mine = seat.seat === own && seen.hand.length > 0;
    return {
      ...seat,
      hand: mine ? cardsFromCounts(seen.hand, seen.golden, faces) : seat.hand,
      received: mine ? cardsFromCounts(seen.received, false, faces) : seat.received,
      cardsLeft: seen.cardsLeft[seat.seat] ?? seat.cardsLeft,
      passed: seen.passed[seat.seat] === 1,
      place: seen.places[seat.seat] ?? 0,
      role: seen.roles[seat.seat] ?? 0,
      points: Number(seen.points[seat.seat] ?? 0n),
    };
  });
  const board = seen.boardSize > 0 ? playedCards(seen.boardFace, quantity, seen.boardJokers, false) : [];
  return {
    ...table,
    seats,
    board,
    boardBy: seen.boardOwner,
    turn: isFirstTurn(seen) ? 1 : Math.max(2, table.turn),
    phase: seen.pizza > 0 ? "pizza" : "dealt",
    shift: seen.shift,
    pizza: seen.pizza,
    played: Array.from(seen.played),
  };
}

/** Whether an observation is of the Shift's first turn, or from before it. */
function isFirstTurn({ pizza, played, passed }: Observation): boolean {
  return pizza <= 1 && played.every((count) => count === 0) && passed.every((out) => out === 0);
}
