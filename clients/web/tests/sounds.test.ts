// When the sounds of the table begin, with a clock of the test's own.

import { afterEach, beforeEach, expect, test, vi } from "vitest";
import { play, soundOf } from "../src/table/sounds";

/** When each tone began, seconds. */
let begun: number[] = [];
/** The tones that have not ended. */
const tones: Node[] = [];
const NOW_S = 10;
const resume = vi.fn(() => Promise.resolve());
const suspend = vi.fn(() => Promise.resolve());

class Node {
  onended = () => {};
  readonly gain = { setValueAtTime() {}, linearRampToValueAtTime() {}, exponentialRampToValueAtTime() {} };
  connect(next: unknown) {
    return next;
  }
  start(at: number) {
    begun.push(at - NOW_S);
    tones.push(this);
  }
  stop() {}
}

beforeEach(() => {
  begun = [];
  vi.stubGlobal(
    "AudioContext",
    class {
      readonly currentTime = NOW_S;
      readonly resume = resume;
      readonly suspend = suspend;
    },
  );
  vi.stubGlobal("OscillatorNode", Node);
  vi.stubGlobal("GainNode", Node);
  Object.defineProperty(navigator, "userActivation", { configurable: true, value: { hasBeenActive: true } });
});
afterEach(() => {
  for (const tone of tones.splice(0)) tone.onended();
  vi.clearAllMocks();
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

test("between sounds nothing is computed", () => {
  play("play");
  expect(tones.length).toBe(2);
  expect(resume).toHaveBeenCalledOnce();
  tones.shift()?.onended();
  play("pass");
  tones.shift()?.onended();
  expect(suspend).not.toHaveBeenCalled();
  tones.shift()?.onended();
  expect(suspend).toHaveBeenCalledOnce();
  play("pass");
  expect(resume).toHaveBeenCalledTimes(3);
});
