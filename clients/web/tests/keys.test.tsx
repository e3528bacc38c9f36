// The keys of the table: which cards they pick, and what they play.

import { act } from "preact/test-utils";
import { afterEach, describe, expect, test } from "vitest";
import { tableOf } from "../src/attend/words";
import { DecisionKind } from "../src/gen/chefshat/v1/decision_pb";
import { setPreference } from "../src/preferences";
import { cardsOf, keyOf } from "../src/table/keys";
import { actionOf, type Move } from "../src/table/model/actions";
import { cardsFromNumbers } from "../src/table/model/cards";
import type { OpenDecision } from "../src/table/model/live";
import { heldPlays, type Picked, pickedMove, pressFace, pressJoker } from "../src/table/model/picking";
import { TableView } from "../src/table/view/TableView";
import { mount, root } from "./mounted";
import { DEALT, decisionOf, stateOf } from "./table-state";

const FACES = 11;
const JOKER = FACES + 1;
const HAND = cardsFromNumbers([3, 9, 9, 9, 11, JOKER, JOKER], false, FACES);
const play = (face: number, quantity: number, jokers = 0): Move => ({ kind: "play", face, quantity, jokers });
const NONE: Picked = new Set();

test.each([
  ["1", 1],
  ["9", 9],
  ["0", 10],
  ["a", 11],
  ["g", 15],
  ["J", undefined],
])("%s names face %s, and back", (key, face) => {
  expect(cardsOf(key)).toEqual({ face });
  expect(keyOf(face)).toBe(key);
});

test.each(["p", "j", "d", "Enter", "F1", "", "10"])("%j names no cards", (key) => {
  expect(cardsOf(key)).toBeUndefined();
});

describe("picking", () => {
  const moves = heldPlays(HAND);
  const keyed = (...keys: (number | "j" | undefined)[]) => {
    let picked: Picked | undefined = NONE;
    for (const key of keys) {
      picked = key === "j" ? pressJoker(HAND, picked ?? NONE, moves) : pressFace(HAND, picked ?? NONE, key, moves);
    }
    return picked && pickedMove(HAND, picked, moves);
  };

  test("a hand holds every play of its cards", () => {
    // 3, 9 to three times, and 11, each with up to two jokers; and a joker alone.
    expect(moves).toHaveLength((1 + 3 + 1) * 3 + 1);
  });

  test("a face is picked once, again for one more, and starts again after the last", () => {
    expect(keyed(9)).toEqual(play(9, 1));
    expect(keyed(9, 9, 9)).toEqual(play(9, 3));
    expect(keyed(9, 9, 9, 9)).toEqual(play(9, 1));
    expect(keyed(9, 3)).toEqual(play(3, 1));
  });

  test("jokers join the picked cards one by one, and leave together", () => {
    expect(keyed(9, "j")).toEqual(play(9, 1, 1));
    expect(keyed(9, "j", 9)).toEqual(play(9, 2, 1));
    expect(keyed(9, "j", "j")).toEqual(play(9, 1, 2));
    expect(keyed(9, "j", "j", "j")).toEqual(play(9, 1));
    expect(keyed("j")).toEqual({ kind: "loneJoker" });
    expect(keyed(undefined)).toEqual({ kind: "loneJoker" });
  });

  test("the smallest legal play is picked, with the fewest jokers", () => {
    const legal = moves.filter((move) => move.kind === "play" && move.quantity + move.jokers >= 3);
    const made = (face: number) => pickedMove(HAND, pressFace(HAND, NONE, face, legal) ?? NONE, legal);
    expect(made(9)).toEqual(play(9, 3));
    expect(made(3)).toEqual(play(3, 1, 2));
    expect(pressFace(HAND, NONE, 4, legal)).toBeUndefined();
  });
});

describe("at the table", () => {
  afterEach(() => setPreference("keys", true));

  const decision = (kind: DecisionKind, moves: readonly Move[]) => {
    const legal = moves.map((move) => actionOf(move, FACES));
    return decisionOf(HAND, legal, { kind });
  };
  const TURN = decision(DecisionKind.TURN, [play(9, 2), play(9, 3), play(9, 1, 1), play(3, 1, 1), { kind: "pass" }]);

  const show = async (open: OpenDecision) => {
    const answers: number[] = [];
    const table = { ...tableOf(stateOf({ observation: DEALT })), phase: "pizza" as const, faces: FACES };
    const props = { table, own: 2, decision: open, untimed: true, onAnswer: (action: number) => answers.push(action) };
    await mount(<TableView {...props} />);
    return answers;
  };
  const press = (key: string, on: EventTarget = document.activeElement ?? document.body) =>
    act(() => {
      on.dispatchEvent(new KeyboardEvent("keydown", { key, bubbles: true, cancelable: true }));
    });

  test("two keys play cards, one passes", async () => {
    const answers = await show(TURN);
    await press("9");
    await press("Enter");
    await press("p");
    expect(answers).toEqual([actionOf(play(9, 2), FACES), actionOf({ kind: "pass" }, FACES)]);
  });

  test("a key whose cards cannot be played says why, and Enter then plays nothing", async () => {
    const answers = await show(TURN);
    await press("4");
    expect(root.querySelector('[role="note"]')?.textContent).toBe("You have no 4.");
    await press("Enter");
    expect(answers).toEqual([]);
  });

  test("Backspace puts back one card, Escape all of them", async () => {
    await show(TURN);
    const picked = () => root.querySelectorAll('[data-part~="hand-card"][aria-pressed="true"]').length;
    await press("9");
    await press("9");
    expect(picked()).toBe(3);
    await press("Backspace");
    expect(picked()).toBe(2);
    await press("Escape");
    expect(picked()).toBe(0);
  });

  test("a special action has keys of its own", async () => {
    const answers = await show(decision(DecisionKind.SPECIAL_ACTION, [{ kind: "declare" }, { kind: "decline" }]));
    await press("9");
    await press("p");
    await press("n");
    expect(answers).toEqual([actionOf({ kind: "decline" }, FACES)]);
  });

  test("the question mark explains what can be done, and the keys", async () => {
    await show(TURN);
    await press("?");
    const dialog = root.querySelector('[data-part~="dialog"]');
    expect(dialog?.textContent).toContain("What can I do?");
    expect(dialog?.textContent).toContain("plays or gives the picked cards");
  });

  test("keys that are typed into a field, or switched off, do nothing", async () => {
    const answers = await show(TURN);
    const field = document.createElement("input");
    root.append(field);
    await press("p", field);
    field.remove();
    setPreference("keys", false);
    await show(TURN);
    await press("p", document.body);
    expect(answers).toEqual([]);
  });
});
