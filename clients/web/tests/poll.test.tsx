// Polling: at once, at the interval, less often after errors, not while hidden, and never after the
// page is gone.

import { Code } from "@connectrpc/connect";
import { beforeEach, expect, test, vi } from "vitest";
import { type Polled, usePolled } from "../src/api/poll";
import { later, mount } from "./mounted";
import { AWAY, tooMany } from "./refusals";

const EVERY_MS = 1000;
let seen: Polled<number> | undefined;

beforeEach(() => void vi.useFakeTimers());

async function shown(ask: (signal: AbortSignal) => Promise<number>, key = "one") {
  function Page() {
    seen = usePolled(ask, EVERY_MS, key);
    return null;
  }
  await mount(<Page />);
}

test("the latest response is shown, requested at once and at the interval", async () => {
  let answer = 0;
  await shown(async () => ++answer);
  await later(0);
  expect(seen?.value).toBe(1);
  await later(EVERY_MS - 1);
  expect(seen?.value).toBe(1);
  await later(1);
  expect(seen?.value).toBe(2);
});

test("after an error the last response stays, and requests slow down until one succeeds", async () => {
  let asked = 0;
  await shown(async () => {
    asked += 1;
    if (asked === 2) throw AWAY;
    return asked;
  });
  await later(EVERY_MS);
  expect(seen?.value).toBe(1);
  expect(seen?.fault?.code).toBe(Code.Unavailable);
  await later(EVERY_MS);
  expect(asked).toBe(2);
  await later(EVERY_MS);
  expect(seen).toEqual({ value: 3, fault: null });
});

test("a limit that says when to try again is obeyed", async () => {
  let asked = 0;
  await shown(async () => {
    asked += 1;
    if (asked === 1) throw tooMany(20 * EVERY_MS);
    return asked;
  });
  await later(19 * EVERY_MS);
  expect(asked).toBe(1);
  await later(EVERY_MS);
  expect(seen).toEqual({ value: 2, fault: null });
});

test("a hidden page makes no request, and makes one at once when it is shown again", async () => {
  const hidden = vi.spyOn(document, "hidden", "get").mockReturnValue(true);
  let asked = 0;
  await shown(async () => ++asked);
  await later(10 * EVERY_MS);
  expect(asked).toBe(0);
  hidden.mockReturnValue(false);
  document.dispatchEvent(new Event("visibilitychange"));
  await later(0);
  expect(seen?.value).toBe(1);
});

test("hiding and showing the page during a request does not repeat it", async () => {
  let asked = 0;
  await shown(() => new Promise(() => (asked += 1)));
  document.dispatchEvent(new Event("visibilitychange"));
  await later(10 * EVERY_MS);
  expect(asked).toBe(1);
});

test("a page that is gone stops polling and aborts its request", async () => {
  let signal: AbortSignal | undefined;
  let asked = 0;
  await shown(async (given) => {
    signal = given;
    return ++asked;
  });
  await later(0);
  await mount(null);
  await later(10 * EVERY_MS);
  expect(asked).toBe(1);
  expect(signal?.aborted).toBe(true);
});
