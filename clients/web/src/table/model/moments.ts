// The moments of a game that are worth a stop: which event is one. Shown by view/Moment.tsx.

import { SpecialAction } from "../../gen/chefshat/v1/rules_pb";
import type { LogEntry, LogLine, TableState } from "./state";

export type MomentKind = "foodFight" | "dinner" | "exchange" | "opening" | "lastCard";

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
    case "gave":
      return isFirst(table, sequence, "gave") ? { kind: "exchange", seat: entry.giver, sequence } : undefined;
    case "played": {
      const { seat, cards } = entry;
      if (isFirst(table, sequence, "played", "passed", "pizzaDone") && cards.some(({ kind }) => kind === "golden"))
        return { kind: "opening", seat, sequence };
      return table.seats[seat]?.cardsLeft === 1 ? { kind: "lastCard", seat, sequence } : undefined;
    }
    default:
      return undefined;
  }
}

/** Whether an event is the first of these kinds in its Shift. */
function isFirst({ log }: TableState, sequence: number, ...kinds: LogEntry["kind"][]): boolean {
  const before = log.findLast(({ entry, sequence: at }) => {
    return at < sequence && ["dealt", ...kinds].includes(entry.kind);
  });
  return before?.entry.kind === "dealt";
}
