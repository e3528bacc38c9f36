// The perspectives on a moment of a record: all hands open, as the holder of a seat saw it, or as
// spectators did.

import { DecisionKind } from "../gen/chefshat/v1/decision_pb";
import { isOver, type TableState } from "../table/model/state";
import type { Frame } from "./frames";

/** All hands, no hands, or the hand of a seat. */
export type Perspective = "all" | "none" | number;

/** The table from a perspective. */
export function seenFrom(table: TableState, perspective: Perspective): TableState {
  if (perspective === "all") return table;
  const seats = table.seats.map((seat) =>
    seat.seat === perspective ? seat : { ...seat, hand: undefined, received: [] },
  );
  const log = table.log.map((line) => {
    const { entry } = line;
    if (entry.kind !== "gave" || entry.giver === perspective || entry.receiver === perspective) return line;
    return { ...line, entry: { ...entry, cards: [] } };
  });
  return { ...table, seats, log };
}

/**
 * The seat whose decision is open, if the perspective may know: only a seat itself knows that it
 * may declare a special action.
 */
export function decidingFor({ open, table }: Frame, perspective: Perspective): number | undefined {
  if (!open) return undefined;
  if (open.kind === DecisionKind.SPECIAL_ACTION && perspective !== "all" && perspective !== open.seat) return undefined;
  // After the last play of a game nobody decides.
  return isOver(table) ? undefined : open.seat;
}
