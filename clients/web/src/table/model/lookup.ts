// The look-up table of a decision, as in the paper's figure of possible actions: every play by
// face, quantity and jokers, with its state for one hand at one turn. Drawn by
// view/LookupTable.tsx.

import { actionOf, type Move } from "./actions";
import type { Card } from "./cards";
import { allows, holds, type Requirement } from "./requirement";
import type { TableState } from "./state";

/**
 * Whether an action is allowed at this turn with any hand, and whether the hand holds its cards.
 */
export type CellState = "legal" | "notInHand" | "notAllowed" | "impossible";

/** An action in the table. */
export interface Cell {
  readonly move: Move;
  readonly action: number;
  readonly state: CellState;
}

export interface Lookup {
  /** Plays by face from 1, by quantity from 1, by jokers from 0. */
  readonly plays: readonly (readonly (readonly Cell[])[])[];
  /** A lone joker (if the deck has jokers) and passing. */
  readonly others: readonly Cell[];
}

/** The table of a turn. */
export function lookupOf(
  { faces, jokers }: Pick<TableState, "faces" | "jokers">,
  requirement: Requirement,
  hand: readonly Card[],
  legal: ReadonlySet<number>,
): Lookup {
  const cell = (move: Move): Cell => {
    const action = actionOf(move, faces);
    const held = holds(hand, move);
    if (legal.has(action)) return { move, action, state: "legal" };
    if (held) return { move, action, state: "notAllowed" };
    return { move, action, state: allows(requirement, move) ? "notInHand" : "impossible" };
  };
  const upTo = (count: number) => Array.from({ length: count }, (_, index) => index + 1);
  const plays = upTo(faces).map((face) =>
    upTo(face).map((quantity) =>
      Array.from({ length: jokers + 1 }, (_, withJokers) => cell({ kind: "play", face, quantity, jokers: withJokers })),
    ),
  );
  const alone: Cell[] = jokers > 0 ? [cell({ kind: "loneJoker" })] : [];
  return { plays, others: [...alone, cell({ kind: "pass" })] };
}
