// When the sounds of the table begin, with a clock of the test's own.

import { afterEach, beforeEach, expect, test, vi } from "vitest";
import { play, soundOf } from "../src/table/sounds";

/** When each tone began, seconds. */
let begun: number[] = [];
const NOW_S = 10;

class Node {
  readonly gain = { setValueAtTime() {}, linearRampToValueAtTime() {}, exponentialRampToValueAtTime() {} };
  connect(next: unknown) {
    return next;
  }
  start(at: number) {
    begun.push(at - NOW_S);
  }
  stop() {}
}

beforeEach(() => {
  begun = [];
  vi.stubGlobal(
    "AudioContext",
    class {
      readonly currentTime = NOW_S;
      readonly state = "running";
    },
  );
  vi.stubGlobal("OscillatorNode", Node);
  vi.stubGlobal("GainNode", Node);
  Object.defineProperty(navigator, "userActivation", { configurable: true, value: { hasBeenActive: true } });
});
afterEach(() => {
  vi.unstubAllGlobals();
  Reflect.deleteProperty(navigator, "userActivation");
});

test.each([
  [false, 0.33],
  [true, 0],
])("a card is heard when it meets the board; with reduced motion (%s) that is at once", (reduced, first) => {
  vi.stubGlobal("matchMedia", () => ({ matches: reduced }));
  play("play");
  expect(begun[0]).toBeCloseTo(first);
  expect(begun.length).toBe(2);
  begun = [];
  play("yourTurn");
  expect(begun[0]).toBeCloseTo(0);
});

test("a deal is heard as several cards, the start of a game not at all", () => {
  const sound = soundOf({ entry: { kind: "dealt", shift: 1 }, sequence: 1 });
  expect(sound).toBe("dealt");
  if (sound) play(sound);
  expect(begun.length).toBeGreaterThan(3);
  expect(begun).toEqual(begun.toSorted((one, other) => one - other));
  expect(soundOf({ entry: { kind: "gameStarted" }, sequence: 2 })).toBeUndefined();
});
