// Interface traces: what is left at the end of a game is sent, also past a call under way and a lost
// connection.

import { Code, ConnectError } from "@connectrpc/connect";
import { signal } from "@preact/signals";
import { beforeEach, expect, test, vi } from "vitest";
import { startTracing } from "../src/studies/tracing";
import type { LiveState } from "../src/table/model/live";

beforeEach(() => void vi.useFakeTimers());

/** Collects traces, whose calls last a second; what `fails` returns true for fails. */
function collecting(fails: (call: number) => boolean) {
  const sent: string[] = [];
  let calls = 0;
  const live = signal({ decision: undefined } as LiveState);
  const tracing = startTracing(document.createElement("div"), live, async (traces) => {
    const failed = fails(++calls);
    await new Promise((resolve) => setTimeout(resolve, 1_000));
    if (failed) throw new ConnectError("away", Code.Unavailable);
    sent.push(...traces.map(({ target }) => target ?? ""));
  });
  return { tracing, sent, calls: () => calls };
}

test("what is collected during a call is sent after it", async () => {
  const { tracing, sent } = collecting(() => false);
  tracing.pick("1", true);
  await vi.advanceTimersByTimeAsync(5_500);
  tracing.pick("2", true);
  tracing.stop();
  await vi.advanceTimersByTimeAsync(5_000);
  expect(sent).toEqual(["card:1", "card:2"]);
});

test("the rest is sent again while the server cannot be reached, and in several calls if it is much", async () => {
  const { tracing, sent } = collecting((call) => call <= 2);
  const many = Array.from({ length: 1_200 }, (_, number) => String(number));
  for (const card of many) tracing.pick(card, true);
  tracing.stop();
  await vi.advanceTimersByTimeAsync(60_000);
  expect(sent).toEqual(many.map((card) => `card:${card}`));
});

test("a server that is not back is not asked for ever", async () => {
  const { tracing, calls } = collecting(() => true);
  tracing.pick("1", true);
  tracing.stop();
  await vi.advanceTimersByTimeAsync(600_000);
  const asked = calls();
  await vi.advanceTimersByTimeAsync(600_000);
  expect([asked > 1, calls()]).toEqual([true, asked]);
});
