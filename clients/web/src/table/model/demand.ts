// What is asked for at the open turn, or in the exchange, as the rules say it: for words and for marking what the rules would allow. What a seat
// may really do stands in the mask that the server sends.

import { Opening, Role } from "../../gen/chefshat/v1/rules_pb";
import type { Move } from "./actions";
import { type Card, countOf, faceOf } from "./cards";
import type { OpenDecision } from "./live";
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

/** Cards that the Chef gives and gets. */
const CHEFS_GIFTS = 2;

/** Which card of how many is to be given, where it is more than one. */
export function giftOf(
  table: TableState,
  own: number | undefined,
  { hand, given }: Pick<OpenDecision, "hand" | "given">,
): { number: number; of: number } | undefined {
  if (own === undefined || table.seats[own]?.role !== Role.CHEF) return undefined;
  // From a hand smaller than this the Dishwasher may have fewer cards to give than two, jokers apart, and the Chef gives as many.
  if (hand.length + given < CHEFS_GIFTS + table.jokers) return undefined;
  return { number: given + 1, of: CHEFS_GIFTS };
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
