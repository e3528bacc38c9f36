// The rules that matter at a moment.

import { expect, test } from "vitest";
import { DecisionKind } from "../src/gen/chefshat/v1/decision_pb";
import { playedCards } from "../src/table/model/cards";
import { rulesNow } from "../src/table/model/situation";
import { emptyTable, seatFromParticipant, type TableState } from "../src/table/model/state";
import { stateOf } from "./table-state";

const seats = (stateOf().room?.seats ?? []).map((seat) => ({ ...seatFromParticipant(seat), cardsLeft: 5 }));
const table = (changed: Partial<TableState>): TableState => ({ ...emptyTable(seats), turn: 5, ...changed });
const mine = (changed: object) => seats.map((seat) => (seat.seat === 0 ? { ...seat, ...changed } : seat));
const asked = (kind: DecisionKind) => ({ kind, requirement: undefined });
const NINES = playedCards(9, 2, 0, false);

test.each<[string, Partial<TableState>, DecisionKind | undefined, string]>([
  ["a turn with cards on the board", { phase: "pizza", board: NINES }, DecisionKind.TURN, "beating"],
  ["a turn on an empty board", { phase: "pizza" }, DecisionKind.TURN, "leading"],
  ["the first turn of a Shift", { phase: "dealt", turn: 1 }, DecisionKind.TURN, "opening"],
  ["a board that nothing beats", { phase: "pizza", board: playedCards(1, 1, 0, false) }, DecisionKind.TURN, "passing"],
  ["a gift", { phase: "dealt", shift: 2 }, DecisionKind.EXCHANGE, "exchange"],
  ["both jokers", { phase: "dealt", shift: 2 }, DecisionKind.SPECIAL_ACTION, "special"],
  ["a deal with roles", { phase: "dealt", shift: 2 }, undefined, "exchange"],
  ["out of the pizza", { phase: "pizza", board: NINES, seats: mine({ passed: true }) }, undefined, "passing"],
  ["finished", { phase: "pizza", board: NINES, seats: mine({ place: 1 }) }, undefined, "finishing"],
  ["after a Shift", { phase: "shiftOver" }, undefined, "points"],
  ["after the game", { phase: "gameOver" }, undefined, "end"],
])("%s", (_, changed, kind, rule) => {
  expect(rulesNow(table(changed), 0, kind === undefined ? undefined : asked(kind))[0]).toBe(rule);
});
