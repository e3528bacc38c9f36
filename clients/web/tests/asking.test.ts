// Asking until the server answers: after growing pauses, when the browser is back online, and not before
// the server wants it.

import { beforeEach, expect, test, vi } from "vitest";
import { askUntilAnswered } from "../src/api/asking";
import { AWAY, refused, tooMany } from "./refusals";

beforeEach(() => void vi.useFakeTimers());

/** An answer after these errors, and when each was asked for. */
function asked(errors: Error[], isWanted = () => true) {
  const begun = Date.now();
  const atMs: number[] = [];
  const faults: string[] = [];
  const answer = askUntilAnswered(
    async () => {
      atMs.push(Date.now() - begun);
      const error = errors[atMs.length - 1];
      if (error) throw error;
      return "answer";
    },
    isWanted,
    ({ message }) => faults.push(message),
  );
  return { answer, atMs, faults };
}

test("what passes is asked again, with growing pauses", async () => {
  const { answer, atMs, faults } = asked([AWAY, AWAY, AWAY]);
  await vi.runAllTimersAsync();
  expect(await answer).toBe("answer");
  expect(atMs).toEqual([0, 250, 750, 1750]);
  expect(faults).toEqual(["away", "away", "away"]);
});

test("a refusal is final", async () => {
  const { answer, atMs, faults } = asked([refused("STUDY_CLOSED")]);
  await vi.runAllTimersAsync();
  expect(await answer).toBeUndefined();
  expect([atMs, faults]).toEqual([[0], ["STUDY_CLOSED"]]);
});

test("back online, it is asked again at once, but not before a limit allows it", async () => {
  const { answer, atMs } = asked([AWAY, tooMany(20_000)]);
  await vi.advanceTimersByTimeAsync(100);
  window.dispatchEvent(new Event("online"));
  await vi.advanceTimersByTimeAsync(1_000);
  window.dispatchEvent(new Event("online"));
  await vi.runAllTimersAsync();
  expect(await answer).toBe("answer");
  expect(atMs).toEqual([0, 100, 20_100]);
});

test("nothing is asked when nobody waits any more", async () => {
  let isWanted = true;
  const { answer, atMs } = asked(Array(100).fill(AWAY), () => isWanted);
  await vi.advanceTimersByTimeAsync(1_000);
  isWanted = false;
  await vi.runAllTimersAsync();
  expect(await answer).toBeUndefined();
  expect(atMs).toEqual([0, 250, 750]);
});
