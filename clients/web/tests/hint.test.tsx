// The hint at the table: asked for by a button, it picks the suggested cards and shows the points.
// The replay says which decisions had one.

import { create } from "@bufbuild/protobuf";
import { expect, test } from "vitest";
import { tableOf } from "../src/attend/words";
import { DecisionKind } from "../src/gen/chefshat/v1/decision_pb";
import { HintSchema } from "../src/gen/chefshat/v1/play_service_pb";
import { DecisionRecordSchema } from "../src/gen/chefshat/v1/record_pb";
import { Decision } from "../src/replay/ReplayPage";
import type { GivenHint } from "../src/table/acting";
import { actionOf } from "../src/table/model/actions";
import { cardsFromNumbers } from "../src/table/model/cards";
import { TableView } from "../src/table/view/TableView";
import { mount, root } from "./mounted";
import { DEALT, decisionOf, stateOf } from "./table-state";

const FACES = 11;
const PASS = actionOf({ kind: "pass" }, FACES);
const NINES = actionOf({ kind: "play", face: 9, quantity: 2, jokers: 0 }, FACES);
const decision = decisionOf(cardsFromNumbers([3, 9, 9], false, FACES), [NINES, PASS]);

const show = (hint: GivenHint | undefined, onHint?: () => void) => {
  const table = { ...tableOf(stateOf({ observation: DEALT })), phase: "pizza" as const, faces: FACES };
  const props = { table, own: 2, decision, hint, onHint, untimed: true, onAnswer: () => {} };
  return mount(<TableView {...props} />);
};
const button = (id: string) => root.querySelector<HTMLButtonElement>(`[data-action="${id}"]`);
const text = () => root.querySelector('[data-part~="hint"]')?.textContent;

test("there is a button only where the room gives hints", async () => {
  await show(undefined);
  expect(button("hint")).toBeNull();
  let asked = 0;
  await show(undefined, () => {
    asked += 1;
  });
  button("hint")?.click();
  expect(asked).toBe(1);
  // One at a time.
  await show({ decision: 7n, hint: undefined }, () => {
    asked += 1;
  });
  button("hint")?.click();
  expect([asked, text()]).toEqual([1, "The hint is being computed…"]);
});

test("a hint picks the suggested cards and shows points", async () => {
  const hint = create(HintSchema, {
    action: NINES,
    actions: [
      { action: PASS, points: 1.25, standardError: 0.1, rollouts: 40n },
      { action: NINES, points: 3, standardError: 0.2, rollouts: 40n },
    ],
  });
  await show({ decision: 7n, hint }, () => {});
  expect(text()).toBe("Suggested: two 9s: 3.0 ± 0.2 points · Pass: 1.3 ± 0.1 points");
  expect(button("play")?.textContent).toBe("Play two 9s");
  expect(button("play")?.getAttribute("aria-disabled")).toBe("false");
});

test("a hint without estimates, and one for an earlier decision", async () => {
  await show({ decision: 7n, hint: create(HintSchema, { action: PASS }) }, () => {});
  expect(text()).toBe("Suggested: Pass");
  await show({ decision: 6n, hint: create(HintSchema, { action: PASS }) }, () => {});
  expect(text()).toBeUndefined();
});

test.each([
  [0, "Ada: Pass"],
  [1, "Ada: Pass · after a hint"],
  [3, "Ada: Pass · after 3 hints"],
])("the replay of a decision with %d hints", async (hints, words) => {
  const table = { ...tableOf(stateOf({ observation: DEALT })), faces: FACES };
  const open = create(DecisionRecordSchema, { seat: 0, kind: DecisionKind.TURN, action: PASS, hints });
  await mount(<Decision table={table} open={open} />);
  expect(root.querySelector("summary .soft")?.textContent).toBe(words);
});
