// Flapping connections: one line in the log, and one announcement for each change that lasts.

import { beforeEach, expect, test, vi } from "vitest";
import { isPresence, visibleLines } from "../src/table/model/log";
import type { LogEntry, LogLine } from "../src/table/model/state";
import { createPresenceAnnouncer, SETTLED_MS } from "../src/table/presence";

beforeEach(() => void vi.useFakeTimers());

const lost = (seat: number): LogEntry => ({ kind: "lost", seat });
const back = (seat: number): LogEntry => ({ kind: "back", seat });
const replaced = (seat: number): LogEntry => ({ kind: "substituted", seat, agent: "greedy" });
const passed = (seat: number): LogEntry => ({ kind: "passed", seat, cause: "agent" });
const joy = (seat: number): LogEntry => ({ kind: "expressed", seat, label: "joy" });

test.each<[string, LogEntry[], number[]]>([
  ["gone and back", [lost(1), back(1)], [1]],
  ["gone, replaced and back", [lost(1), replaced(1), back(1)], [2]],
  ["again and again while others play", [lost(1), passed(2), back(1), passed(3), lost(1), back(1)], [1, 3, 5]],
  ["two at once", [lost(1), lost(0), back(1), back(0)], [2, 3]],
  ["away while it was decided for the seat", [lost(1), passed(1), back(1)], [0, 1, 2]],
  ["gone for good", [passed(1), lost(1), passed(2)], [0, 1, 2]],
  ["an expression between", [lost(1), joy(1), back(1)], [1, 2]],
])("in the log, %s", (_, entries, visible) => {
  const log = entries.map((entry, sequence): LogLine => ({ sequence, entry }));
  expect(visibleLines(log, true).map(({ sequence }) => sequence)).toEqual(visible);
  const quiet = visible.filter((sequence) => entries[sequence]?.kind !== "expressed");
  expect(visibleLines(log, false).map(({ sequence }) => sequence)).toEqual(quiet);
});

/**
 * Applies changes, each after a delay in milliseconds; returns the announcements once everything
 * has settled.
 */
function announcements(steps: readonly (readonly [afterMs: number, entry: LogEntry])[]): LogEntry[] {
  const announced: LogEntry[] = [];
  const announcer = createPresenceAnnouncer(({ entry }) => announced.push(entry));
  steps.forEach(([afterMs, entry], sequence) => {
    vi.advanceTimersByTime(afterMs);
    const line: LogLine = { sequence, entry };
    if (!isPresence(line)) throw new Error("not about a connection");
    announcer.apply(line);
  });
  vi.advanceTimersByTime(SETTLED_MS);
  return announced;
}

const SOON = SETTLED_MS / 4;
const LATE = SETTLED_MS * 2;

test.each<[string, [number, LogEntry][], LogEntry[]]>([
  ["a change that lasts is announced", [[0, lost(1)]], [lost(1)]],
  [
    "one that does not is not",
    [
      [0, lost(1)],
      [SOON, back(1)],
    ],
    [],
  ],
  [
    "a connection that flaps says how it ended",
    Array.from({ length: 21 }, (_, step) => [SOON, step % 2 === 0 ? lost(1) : back(1)]),
    [lost(1)],
  ],
  [
    "each lasting change is announced",
    [
      [0, lost(1)],
      [LATE, back(1)],
      [LATE, lost(1)],
    ],
    [lost(1), back(1), lost(1)],
  ],
  [
    "back for a moment only is not announced",
    [
      [0, lost(1)],
      [LATE, back(1)],
      [SOON, lost(1)],
    ],
    [lost(1)],
  ],
  ["who was lost before this page came is back", [[0, back(1)]], [back(1)]],
  [
    "a substitute is announced once",
    [
      [0, lost(1)],
      [SOON, replaced(1)],
      [LATE, back(1)],
    ],
    [replaced(1), back(1)],
  ],
  [
    "seats have nothing to do with each other",
    [
      [0, lost(1)],
      [SOON, lost(2)],
      [SOON, back(2)],
    ],
    [lost(1)],
  ],
])("%s", (_, steps, announced) => {
  expect(announcements(steps)).toEqual(announced);
});

test("after leaving the table nothing is announced", () => {
  const announced = vi.fn();
  const announcer = createPresenceAnnouncer(announced);
  const line: LogLine = { sequence: 1, entry: lost(1) };
  if (isPresence(line)) announcer.apply(line);
  announcer.stop();
  vi.advanceTimersByTime(LATE);
  expect(isPresence(line)).toBe(true);
  expect(announced).not.toHaveBeenCalled();
});
