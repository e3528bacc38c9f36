// Which lines of the log are worth a reader's or a hearer's while: a connection that comes and goes takes one line, and what a study leaves out
// is left out. What the lines say is in words.ts.

import type { LogLine } from "./state";

/** The lines to be shown or read out; without `expressions` nothing of who showed what. */
export function worthSaying(log: readonly LogLine[], expressions: boolean): LogLine[] {
  return log.filter(({ happening }) => expressions || happening.kind !== "expressed").filter(isLastOfRun);
}

/** A seat that is lost and comes back, perhaps again and again, takes one line as long as nothing else happens: how it ended. */
function isLastOfRun(line: LogLine, index: number, lines: readonly LogLine[]): boolean {
  const seat = comingOrGoing(line);
  return seat === undefined || comingOrGoing(lines[index + 1]) !== seat;
}

/** The seat whose connection a line is about. */
function comingOrGoing(line: LogLine | undefined): number | undefined {
  const kind = line?.happening.kind;
  return kind === "lost" || kind === "back" ? line?.happening.seat : undefined;
}
