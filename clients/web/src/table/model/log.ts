// Selects the lines of the log that are shown and read out: a flapping connection takes one line,
// and a study may hide expressions. The wording is in words.ts, the delay of connection changes in
// ../presence.ts.

import type { LogEntry, LogLine } from "./state";

/** More events than this at once are a past that is caught up with. */
export const MOST_AT_ONCE = 14;

/** Events about a seat's connection. */
const PRESENCE = ["lost", "back", "substituted"] as const;

/** A line about a seat's connection. */
export interface PresenceLine extends LogLine {
  readonly entry: LogEntry & { readonly kind: (typeof PRESENCE)[number] };
}

/** Whether a line is about a seat's connection. */
export function isPresence(line: LogLine): line is PresenceLine {
  return (PRESENCE as readonly string[]).includes(line.entry.kind);
}

/** The lines to show or read out; without `expressions`, no shown expressions. */
export function visibleLines(log: readonly LogLine[], expressions: boolean): LogLine[] {
  // Seats whose connection a later line describes.
  const described = new Set<number>();
  const lines: LogLine[] = [];
  for (const line of log.toReversed()) {
    if (!expressions && line.entry.kind === "expressed") continue;
    if (isPresence(line)) {
      // Consecutive changes of a connection are one line, the last, as long as nothing was decided
      // for the seat in between.
      if (described.has(line.entry.seat)) continue;
      described.add(line.entry.seat);
    } else {
      const seat = decidedBy(line.entry);
      if (seat !== undefined) described.delete(seat);
    }
    lines.push(line);
  }
  return lines.reverse();
}

/** The seat whose decision an event reports, if it reports one. */
function decidedBy(entry: LogEntry): number | undefined {
  switch (entry.kind) {
    case "played":
    case "passed":
    case "declared":
      return entry.seat;
    case "gave":
      return entry.giver;
    default:
      return undefined;
  }
}
