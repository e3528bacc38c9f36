// Which lines of the log are worth a reader's or a hearer's while: a connection that comes and goes takes one line, and what a study leaves out
// is left out. What the lines say is in words.ts, how long is waited before a coming or going is read out in ../presence.ts.

import type { Happening, LogLine } from "./state";

/** What happens to a seat's connection. */
const PRESENCE = ["lost", "back", "substituted"] as const;

/** A line about a seat's connection. */
export interface PresenceLine extends LogLine {
  readonly happening: Happening & { readonly kind: (typeof PRESENCE)[number] };
}

/** Whether a line is about a seat's connection. */
export function isPresence(line: LogLine): line is PresenceLine {
  return (PRESENCE as readonly string[]).includes(line.happening.kind);
}

/** The lines to be shown or read out; without `expressions` nothing of who showed what. */
export function worthSaying(log: readonly LogLine[], expressions: boolean): LogLine[] {
  // Seats about which a later line says how their connection is.
  const told = new Set<number>();
  const lines: LogLine[] = [];
  for (const line of log.toReversed()) {
    if (!expressions && line.happening.kind === "expressed") continue;
    if (isPresence(line)) {
      // Gone and back, perhaps again and again, is one line as long as nothing was decided for the seat meanwhile: how it ended.
      if (told.has(line.happening.seat)) continue;
      told.add(line.happening.seat);
    } else {
      const seat = decidedBy(line.happening);
      if (seat !== undefined) told.delete(seat);
    }
    lines.push(line);
  }
  return lines.reverse();
}

/** Whose decision a happening was, if it was one. */
function decidedBy(happening: Happening): number | undefined {
  switch (happening.kind) {
    case "played":
    case "passed":
    case "declared":
      return happening.seat;
    case "gave":
      return happening.giver;
    default:
      return undefined;
  }
}
