// The moments of a game that are worth a stop: which event is one. Shown by view/Moment.tsx.

import { SpecialAction } from "../../gen/chefshat/v1/rules_pb";
import type { LogLine, TableState } from "./state";

export type MomentKind = "foodFight" | "dinner" | "opening" | "lastCard";

export interface Moment {
  readonly kind: MomentKind;
  readonly seat: number;
  /** Number of its event. */
  readonly sequence: number;
}

/** The last moment among events after `since`; undefined if there is none. */
export function momentSince(table: TableState, since: number): Moment | undefined {
  return table.log
    .filter(({ sequence }) => sequence > since)
    .flatMap((line) => momentOf(table, line) ?? [])
    .at(-1);
}

function momentOf(table: TableState, { entry, sequence }: LogLine): Moment | undefined {
  switch (entry.kind) {
    case "declared":
      return { kind: entry.action === SpecialAction.FOOD_FIGHT ? "foodFight" : "dinner", seat: entry.seat, sequence };
    case "played": {
      const { seat, cards } = entry;
      if (isFirst(table, sequence) && cards.some(({ kind }) => kind === "golden"))
        return { kind: "opening", seat, sequence };
      return table.seats[seat]?.cardsLeft === 1 ? { kind: "lastCard", seat, sequence } : undefined;
    }
    default:
      return undefined;
  }
}

/** Whether a play is the first of its Shift. */
function isFirst({ log }: TableState, sequence: number): boolean {
  const before = log.findLast(({ entry, sequence: at }) => {
    return at < sequence && ["dealt", "played", "passed", "pizzaDone"].includes(entry.kind);
  });
  return before?.entry.kind === "dealt";
}
