// The result at the table: how long it stays, whose row is the reader's, the curve of a game's points.

import { act } from "preact/test-utils";
import { expect, test } from "vitest";
import { tableOf } from "../src/attend/words";
import { DecisionKind } from "../src/gen/chefshat/v1/decision_pb";
import { actionOf } from "../src/table/model/actions";
import type { OpenDecision } from "../src/table/model/live";
import type { TableState } from "../src/table/model/state";
import { Result } from "../src/table/view/Result";
import { TableView } from "../src/table/view/TableView";
import { mount, root } from "./mounted";
import { DEALT, stateOf } from "./table-state";

const START: TableState = { ...tableOf(stateOf({ observation: DEALT })), phase: "pizza", shift: 2 };
const shift = (number: number) => ({
  shift: number,
  order: [2, 0, 1, 3],
  shiftPoints: [2, 1, 3, 0],
  points: [2 * number, number, 3 * number, 0],
  adjudicated: false,
});
const ENDED: TableState = { ...START, phase: "shiftOver", results: [shift(1)] };
const NEXT: TableState = { ...ENDED, phase: "pizza" };
const OVER: TableState = {
  ...ENDED,
  phase: "gameOver",
  results: [shift(1), shift(2)],
  standings: [2, 0, 1, 3].map((seat, index) => ({ seat, points: 3 - index, place: index + 1 })),
};

const show = (table: TableState, own: number | undefined, props: Partial<Parameters<typeof Result>[0]> = {}) =>
  mount(<Result table={table} own={own} {...props} />);
const PLAYING = { playing: true };
const shown = () => root.querySelector("h2")?.textContent;
const button = () => root.querySelector("button");

test("a player's result stays in the next Shift until it is closed", async () => {
  await show(ENDED, 0, PLAYING);
  await show(NEXT, 0, PLAYING);
  expect(shown()).toBe("Shift 1");
  await act(() => button()?.click());
  expect(shown()).toBeUndefined();
  await show({ ...NEXT, phase: "shiftOver", results: [shift(1), shift(2)] }, 0, PLAYING);
  expect(shown()).toBe("Shift 2");
});

test("a player's action closes it for good", async () => {
  await show(ENDED, 0, PLAYING);
  await show(NEXT, 0, { ...PLAYING, acted: true });
  expect(shown()).toBeUndefined();
  await show(NEXT, 0, PLAYING);
  expect(shown()).toBeUndefined();
  // A correction makes new values of the results: the same one stays closed, another one is shown.
  await show({ ...NEXT, results: [shift(1)] }, 0, PLAYING);
  expect(shown()).toBeUndefined();
  await show({ ...NEXT, results: [{ ...shift(1), order: [0, 2, 1, 3] }] }, 0, PLAYING);
  expect(shown()).toBe("Shift 1");
});

test("who leads the Shift closes it by the first card picked", async () => {
  const hand = [{ kind: "face" as const, face: 11 }];
  const seats = ENDED.seats.map((seat) => (seat.seat === 0 ? { ...seat, hand, cardsLeft: 1 } : seat));
  const legal = [actionOf({ kind: "play", face: 11, quantity: 1, jokers: 0 }, 11)];
  const decision = { id: 7n, kind: DecisionKind.TURN, hand, legal, requirement: undefined } as unknown as OpenDecision;
  const dealt: TableState = { ...ENDED, faces: 11, phase: "dealt", seats };
  await mount(<TableView table={dealt} own={0} decision={decision} onAnswer={() => {}} />);
  expect(root.querySelector('[data-part~="result"] h2')?.textContent).toBe("Shift 1");
  await act(() => root.querySelector<HTMLElement>('[data-part~="hand-card"]')?.click());
  expect(root.querySelector('[data-part~="result"] h2')).toBeNull();
});

test("what ended while the reader was away is not shown during the next Shift", async () => {
  const line = (sequence: number) => ({ sequence, entry: { kind: "restarted" as const } });
  await show({ ...START, log: [line(1)] }, 0, PLAYING);
  await show({ ...NEXT, log: [line(1), line(200)] }, 0, PLAYING);
  expect(shown()).toBeUndefined();
});

test.each([
  ["spectators", undefined, true],
  ["readers of a replay", 0, false],
])("%s see it until the next Shift's first turn", async (_, own, links) => {
  await show(NEXT, own, { links });
  expect(shown()).toBeUndefined();
  // A replay also goes back.
  await show(ENDED, own, { links });
  expect(shown()).toBe("Shift 1");
  expect(button()).toBeNull();
  await show(NEXT, own, { links });
  expect(shown()).toBeUndefined();
});

test("what ended before the page was opened is not shown", async () => {
  await show(NEXT, 0, PLAYING);
  expect(shown()).toBeUndefined();
});

test("a player's own row is marked, with a word", async () => {
  const marked = () => [...root.querySelectorAll("tr[data-own]")].map(({ textContent }) => textContent);
  for (const table of [ENDED, OVER]) {
    await show(table, 0);
    expect(marked()).toEqual([expect.stringContaining("Ada (you)")]);
    await show(table, 0, { links: false });
    expect(marked()).toEqual([]);
  }
});

test("the curve has the points after each Shift, if all of them were seen", async () => {
  const curve = () => root.querySelector('[data-part~="chart"]');
  await show(OVER, 0);
  expect(curve()?.querySelectorAll("path[style]")).toHaveLength(4);
  const lines = [...(curve()?.querySelectorAll("path[style]") ?? [])].map((path) => path.getAttribute("d"));
  // Six points are the most, at the top right; who has none stays at the bottom.
  expect(lines[2]).toBe("M0.0 200.0L500.0 100.0L1000.0 0.0h0");
  expect(lines[3]).toBe("M0.0 200.0L500.0 200.0L1000.0 200.0h0");
  await show({ ...OVER, results: [shift(2)] }, 0);
  expect(curve()).toBeNull();
  await show({ ...OVER, results: [shift(1)] }, 0);
  expect(curve()).toBeNull();
});
