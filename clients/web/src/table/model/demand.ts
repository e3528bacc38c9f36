// What a play must be at the open turn, as the rules say it: for words and for marking what the rules would allow. What a seat may really do
// stands in the mask that the server sends.

import { Opening } from "../../gen/chefshat/v1/rules_pb";
import type { Move } from "./actions";
import { type Card, countOf, faceOf } from "./cards";
import type { TableState } from "./state";

/** What a play must be. */
export type Demand =
  | { readonly kind: "anything" }
  /** Cards of the top face, the Golden one among them where `golden`. */
  | { readonly kind: "opening"; readonly face: number; readonly golden: boolean }
  /** So many cards at least, of this face or a lower one; 0 where none is lower. */
  | { readonly kind: "beat"; readonly face: number; readonly size: number };

/** The demand of the open turn. */
export function demandOf(table: TableState): Demand {
  if (table.turn === 1) {
    return { kind: "opening", face: table.faces, golden: table.rules?.opening !== Opening.ANY_TOP_FACE };
  }
  const { board } = table;
  const first = board[0];
  if (!first) return { kind: "anything" };
  return { kind: "beat", face: (faceOf(first) ?? table.faces + 1) - 1, size: board.length };
}

/** Whether the rules allow a move at such a turn to a hand that holds its cards; whether passing is allowed they do not say here. */
export function allows(demand: Demand, move: Move): boolean {
  if (move.kind === "loneJoker") return demand.kind === "anything";
  if (move.kind !== "play") return false;
  switch (demand.kind) {
    case "anything":
      return true;
    case "opening":
      return move.face === demand.face;
    case "beat":
      return move.face <= demand.face && move.quantity + move.jokers >= demand.size;
  }
}

/** Whether a hand holds the cards of a move. */
export function holds(hand: readonly Card[], move: Move): boolean {
  switch (move.kind) {
    case "play":
      return countOf(hand, move.face) >= move.quantity && countOf(hand, undefined) >= move.jokers;
    case "loneJoker":
    case "giveJoker":
      return countOf(hand, undefined) > 0;
    case "give":
      return countOf(hand, move.face) > 0;
    default:
      return true;
  }
}
