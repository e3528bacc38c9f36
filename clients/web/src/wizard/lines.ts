// The lines that a person behind a robot can say with one key, and the pace that the console
// suggests. Both are stored on this device.

import { ExpressionSource } from "../gen/chefshat/v1/decision_pb";
import { recall, remember } from "../store";
import { type Gesture, gesture, type Label, MAX_LINE } from "../table/expressions";

/** Lines with a key: Alt and a digit from 1 to 9. */
export const MAX_LINES = 9;

const LINES = "wizard.lines";

/** The stored lines; undefined if none were stored. */
export function storedLines(): readonly string[] | undefined {
  const stored = recall(LINES);
  return stored === null ? undefined : usable(stored.split("\n"));
}

/** Stores lines, as typed: one in each row. Returns what is kept of them. */
export function storeLines(typed: string): readonly string[] {
  const lines = usable(typed.split("\n"));
  remember(LINES, lines.join("\n"));
  return lines;
}

function usable(lines: readonly string[]): readonly string[] {
  const cut = (line: string) => Array.from(line.trim()).slice(0, MAX_LINE).join("");
  return lines
    .map(cut)
    .filter((line) => line !== "")
    .slice(0, MAX_LINES);
}

/** An expression as a robot's program would send it: it reports nothing about a person. */
export function robotGesture(label: Label): Gesture {
  return { ...gesture(label), source: ExpressionSource.MODEL };
}
