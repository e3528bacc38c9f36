// Looking at a moment of a record with somebody's eyes: with all hands open, as the holder of a seat saw it, or as spectators did.

import { DecisionKind } from "../gen/chefshat/v1/decision_pb";
import type { TableState } from "../table/model/state";
import type { Frame } from "./frames";

/** Whose eyes: everybody's cards, none, or those of a seat. */
export type Eyes = "all" | "none" | number;

/** The table as those eyes saw it. */
export function seenWith(table: TableState, eyes: Eyes): TableState {
  if (eyes === "all") return table;
  const seats = table.seats.map((seat) => (seat.seat === eyes ? seat : { ...seat, hand: undefined, received: [] }));
  const log = table.log.map((line) => {
    const { happening } = line;
    if (happening.kind !== "gave" || happening.giver === eyes || happening.receiver === eyes) return line;
    return { ...line, happening: { ...happening, cards: [] } };
  });
  return { ...table, seats, log };
}

/** Whose decision is open, as far as those eyes may know: that a special action is being thought about is for its seat alone. */
export function decidingFor({ open, table }: Frame, eyes: Eyes): number | undefined {
  if (!open) return undefined;
  if (open.kind === DecisionKind.SPECIAL_ACTION && eyes !== "all" && eyes !== open.seat) return undefined;
  // The last one to play when the pizza is done and the Shift too: nobody.
  return table.phase === "gameOver" || table.phase === "aborted" ? undefined : open.seat;
}
