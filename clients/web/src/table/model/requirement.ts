// What a play must be at a turn. The server sends it with each decision of the reader's own seat.
// For the turns of others, which spectators and replays show, it follows from the board as
// described at PlayRequirement in the protocol.

import type { PlayRequirement } from "../../gen/chefshat/v1/decision_pb";
import { Opening } from "../../gen/chefshat/v1/rules_pb";
import type { Move } from "./actions";
import { type Card, countOf, faceOf } from "./cards";
import type { TableState } from "./state";

/** The fields of the protocol that determine which plays are allowed. */
export type Requirement = Pick<
  PlayRequirement,
  "lowestFace" | "highestFace" | "fewestCards" | "goldenCard" | "loneJoker"
>;

/** The requirement at the open turn of another seat. */
export function publicRequirement({ turn, faces, board, rules }: TableState): Requirement {
  const opening = turn === 1;
  const [first] = board;
  return {
    lowestFace: opening ? faces : 1,
    highestFace: first ? (faceOf(first) ?? faces + 1) - 1 : faces,
    fewestCards: Math.max(1, board.length),
    goldenCard: opening && rules?.opening !== Opening.ANY_TOP_FACE,
    loneJoker: !first && !opening,
  };
}

/** Whether this is the first turn of a Shift. */
export function isOpening({ lowestFace }: Requirement): boolean {
  return lowestFace > 1;
}

/** Whether a play is allowed for a hand that holds its cards. */
export function allows(requirement: Requirement, move: Move): boolean {
  if (move.kind === "loneJoker") return requirement.loneJoker;
  if (move.kind !== "play") return false;
  const { lowestFace, highestFace, fewestCards } = requirement;
  return lowestFace <= move.face && move.face <= highestFace && move.quantity + move.jokers >= fewestCards;
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
