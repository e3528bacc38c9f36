// The console of a person who plays as a robot: lines by key and by button, expressions that report
// nothing about a person, the pace, and moves with the agent's suggestion.

import { create } from "@bufbuild/protobuf";
import { act } from "preact/test-utils";
import { expect, test } from "vitest";
import { tableOf } from "../src/attend/words";
import { ExpressionSource } from "../src/gen/chefshat/v1/decision_pb";
import { HintSchema } from "../src/gen/chefshat/v1/play_service_pb";
import { ParticipantKind } from "../src/gen/chefshat/v1/room_pb";
import { newForm, requestOf } from "../src/lobby/room-form";
import type { GivenHint } from "../src/table/acting";
import { type Gesture, lineGesture, MAX_LINE, phraseOf, shownLabel } from "../src/table/expressions";
import { actionOf } from "../src/table/model/actions";
import { cardsFromNumbers } from "../src/table/model/cards";
import type { OpenDecision } from "../src/table/model/live";
import type { SeatState } from "../src/table/model/state";
import { Console, isWizard } from "../src/wizard/Console";
import { MAX_LINES, storedLines, storeLines } from "../src/wizard/lines";
import { drawn, FIRST_PACE, paceOf, storedPace, storePace } from "../src/wizard/pace";
import { mount, root, type } from "./mounted";
import { DEALT, decisionOf, stateOf } from "./table-state";

const FACES = 11;
const PASS = actionOf({ kind: "pass" }, FACES);
const NINES = actionOf({ kind: "play", face: 9, quantity: 2, jokers: 0 }, FACES);

const decisionAt = (receivedAtMs: number) =>
  decisionOf(cardsFromNumbers([3, 9, 9], false, FACES), [NINES, PASS], { receivedAtMs });

interface Shown {
  said: Gesture[];
  answered: number[];
}

async function show(
  decision: OpenDecision | undefined,
  hint?: GivenHint,
  onHint: (() => void) | undefined = () => {},
): Promise<Shown> {
  const shown: Shown = { said: [], answered: [] };
  const table = { ...tableOf(stateOf({ observation: DEALT })), faces: FACES };
  await mount(
    <Console
      table={table}
      decision={decision}
      hint={hint}
      sending={false}
      onHint={onHint}
      onAnswer={(action) => shown.answered.push(action)}
      onExpress={(gesture) => shown.said.push(gesture)}
    />,
  );
  return shown;
}

const all = (selector: string) => [...root.querySelectorAll<HTMLElement>(selector)];
const press = (code: string, init: KeyboardEventInit = { altKey: true }) =>
  document.dispatchEvent(new KeyboardEvent("keydown", { code, key: "¡", cancelable: true, ...init }));

const words = ({ label, media = "" }: Gesture) => phraseOf(shownLabel({ label, media }))?.text;

test("robots' and agents' seats have a console, people's have none", () => {
  const seat = (kind: ParticipantKind) => ({ kind }) as SeatState;
  expect(isWizard(seat(ParticipantKind.ROBOT))).toBe(true);
  expect(isWizard(seat(ParticipantKind.AGENT))).toBe(true);
  expect(isWizard(seat(ParticipantKind.HUMAN))).toBe(false);
  expect(isWizard(undefined)).toBe(false);
});

test("a line is said by its button, or by Alt and its digit", async () => {
  storeLines("Ciao!\n  Two words  \n\n");
  const shown = await show(undefined);
  expect(all("[data-line]").map((button) => button.textContent)).toEqual(["Alt 1 Ciao!", "Alt 2 Two words"]);
  all("[data-line]")[0]?.click();
  press("Digit2");
  for (const other of ["Digit3", "KeyA"]) press(other);
  press("Digit1", {});
  press("Digit1", { altKey: true, ctrlKey: true });
  expect(shown.said.map(words)).toEqual(["Ciao!", "Two words"]);
});

test("what a robot shows and says is not recorded as reported by a person", async () => {
  const shown = await show(undefined);
  for (const face of all('[data-part="wizard-face"]')) face.click();
  all("[data-line]")[0]?.click();
  expect(shown.said).toHaveLength(7);
  expect(new Set(shown.said.map(({ source }) => source))).toEqual(new Set([ExpressionSource.MODEL]));
});

test("lines are kept on the device", async () => {
  expect(storedLines()).toBeUndefined();
  const kept = storeLines([..."🍕".repeat(12)].join("\n"));
  expect(kept).toHaveLength(MAX_LINES);
  const [long = ""] = storeLines("è".repeat(300));
  expect(Array.from(long)).toHaveLength(MAX_LINE);
  await show(undefined);
  await act(() => all('[data-action="edit-lines"]')[0]?.click());
  await type(root.querySelector("textarea"), "One\nTwo");
  await act(() => all('[data-action="keep-lines"]')[0]?.click());
  expect(all("[data-line]")).toHaveLength(2);
  expect(storedLines()).toEqual(["One", "Two"]);
});

test("a line travels as a robot's lines do", () => {
  expect(lineGesture("Ciao, è bello!")).toMatchObject({ label: "say", media: "data:,Ciao%2C%20%C3%A8%20bello!" });
  expect(words(lineGesture("Ciao, è bello!"))).toBe("Ciao, è bello!");
  const { label, media = "" } = lineGesture("🍕".repeat(80));
  expect(media.length).toBeLessThanOrEqual(256);
  expect(words({ label, media, source: 0 })).toMatch(/^(🍕)+…$/u);
  // Anything else keeps its label.
  for (const [label, media] of [
    ["say", ""],
    ["say", "data:,%E8"],
    ["joy", "data:,x"],
  ] as const) {
    expect(shownLabel({ label, media })).toBe(label);
  }
});

test("a time is drawn between the bounds", () => {
  expect(paceOf("2-6")).toEqual({ least: 2, most: 6 });
  expect(paceOf(" 0.5-0.5 ")).toEqual({ least: 0.5, most: 0.5 });
  for (const text of ["", "6-2", "2", "2-61", "-1-2", "a-b"]) expect(paceOf(text), text).toBeUndefined();
  expect([0, 0.5, 1].map((chance) => drawn({ least: 2, most: 8 }, chance))).toEqual([2000, 4000, 8000]);
  expect([0, 1].map((chance) => drawn({ least: 0, most: 8 }, chance))).toEqual([0, 8000]);
  expect(storedPace()).toEqual(FIRST_PACE);
  storePace({ least: 1, most: 3 });
  expect(storedPace()).toEqual({ least: 1, most: 3 });
});

test("the console says when to act", async () => {
  storePace({ least: 50, most: 50 });
  const timer = () => root.querySelector('[data-part="wizard-timer"]')?.textContent;
  await show(undefined);
  expect(timer()).toBe("No decision is open.");
  await show(decisionAt(performance.now() + 5_000));
  expect(timer()).toMatch(/^Act in 5\d\u00a0s$/);
  await show(undefined);
  await show(decisionAt(performance.now() - 50_000));
  expect(timer()).toBe("Act now");
});

test("moves are listed, the suggested one first in look, and played by a click", async () => {
  let asked = 0;
  const ask = () => {
    asked += 1;
  };
  await show(decisionAt(0), undefined, ask);
  all('[data-action="suggest"]')[0]?.click();
  expect(asked).toBe(1);
  const hint = create(HintSchema, { action: NINES });
  const shown = await show(decisionAt(0), { decision: 7n, hint }, ask);
  expect(all("[data-move]").map((button) => [button.textContent, button.dataset.look])).toEqual([
    ["two 9s · suggested", "main"],
    ["Pass", "plain"],
  ]);
  all("[data-move]")[0]?.click();
  expect(shown.answered).toEqual([NINES]);
});

test("a room without hints says so", async () => {
  const table = { ...tableOf(stateOf({ observation: DEALT })), faces: FACES };
  const nothing = () => {};
  const props = { table, decision: undefined, hint: undefined, sending: false, onHint: undefined };
  await mount(<Console {...props} onAnswer={nothing} onExpress={nothing} />);
  expect(root.textContent).toContain("This room gives no suggestions.");
});

test("the form asks for a person who plays as a robot", () => {
  const form = newForm(["greedy"]);
  const request = requestOf({ ...form, seats: ["wizard", "human", "human", "human"] });
  expect(request.seats?.[0]).toEqual({ filledBy: { case: "wizard", value: ParticipantKind.ROBOT } });
});
