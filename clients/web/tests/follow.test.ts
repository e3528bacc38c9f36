// Following a stream: it is reopened when lost or silent, and closed when it ends or fails for
// good.

import { Code, ConnectError, type UnaryRequest, type UnaryResponse } from "@connectrpc/connect";
import { beforeAll, beforeEach, expect, test, vi } from "vitest";
import { wordsOf } from "../src/api/faults";
import { askHeartbeats, follow } from "../src/api/follow";
import { setLanguage } from "../src/i18n";
import { AWAY, tooMany } from "./refusals";

beforeAll(() => setLanguage("en"));
beforeEach(() => void vi.useFakeTimers());

/** A stream of these messages that then throws or ends. */
async function* stream(messages: readonly string[], thrown?: unknown): AsyncGenerator<string> {
  yield* messages;
  if (thrown) throw thrown;
}

test("a lost stream is reopened until it ends", async () => {
  const streams = [stream(["a"], AWAY), stream([], AWAY), stream(["b"]), stream(["c", "end", "never"])];
  const open = vi.fn(() => streams.shift() ?? stream([]));
  const heard: string[] = [];
  const following = follow(open, (message) => {
    heard.push(message);
    return message !== "end";
  });
  await vi.advanceTimersByTimeAsync(0);
  expect(following.link.value).toBe("lost");
  await vi.advanceTimersByTimeAsync(60_000);
  expect(heard).toEqual(["a", "b", "c", "end"]);
  expect(open).toHaveBeenCalledTimes(4);
  expect(following.link.value).toBe("ended");
});

test("a stream that ends is not reopened if the server had nothing more to send", async () => {
  const open = vi.fn(() => stream(["a", "b"]));
  const heard: string[] = [];
  const isComplete = () => heard.length === 2;
  const following = follow(open, (message) => heard.push(message) > 0, { isComplete });
  await vi.advanceTimersByTimeAsync(60_000);
  expect(open).toHaveBeenCalledTimes(1);
  expect([heard, following.link.value]).toEqual([["a", "b"], "ended"]);
});

test("an error that a retry does not fix ends the stream", async () => {
  const open = vi.fn(() => stream([], new ConnectError("who?", Code.NotFound)));
  const following = follow(open, () => true);
  await vi.advanceTimersByTimeAsync(60_000);
  expect(following.link.value).toBe("failed");
  expect(following.fault.value?.code).toBe(Code.NotFound);
  expect(open).toHaveBeenCalledTimes(1);
});

test("a stream that a limit refuses is opened again when the server says so", async () => {
  const open = vi.fn(() => stream(["end"])).mockImplementationOnce(() => stream([], tooMany(20_000)));
  const following = follow(open, () => false);
  await vi.advanceTimersByTimeAsync(19_000);
  expect([following.link.value, open.mock.calls.length]).toEqual(["lost", 1]);
  await vi.advanceTimersByTimeAsync(1_000);
  expect([following.link.value, open.mock.calls.length]).toEqual(["ended", 2]);
});

test("an exception of the page is not a lost connection", async () => {
  const log = vi.spyOn(console, "error").mockImplementation(() => {});
  const open = vi.fn(() => stream(["a", "b"]));
  const following = follow(open, () => {
    throw new TypeError("no such card");
  });
  await vi.advanceTimersByTimeAsync(60_000);
  expect(open).toHaveBeenCalledTimes(1);
  expect(following.link.value).toBe("failed");
  expect(following.fault.value && wordsOf(following.fault.value)).toContain("Reload");
  expect(log).toHaveBeenCalledOnce();
});

test("streams ask for heartbeats, other calls do not", async () => {
  for (const [isStream, asked] of [
    [true, "3"],
    [false, null],
  ] as const) {
    const request = { stream: isStream, header: new Headers() } as UnaryRequest;
    await askHeartbeats(async () => ({}) as UnaryResponse)(request);
    expect(request.header.get("chefshat-heartbeat")).toBe(asked);
  }
});

test.each([true, false])(
  "a stream that rests while the page is hidden (%s) is closed then, and opened again",
  async (rests) => {
    const page = vi.spyOn(document, "visibilityState", "get");
    const show = (state: DocumentVisibilityState) => {
      page.mockReturnValue(state);
      document.dispatchEvent(new Event("visibilitychange"));
    };
    let [opened, open] = [0, 0];
    const following = follow(
      async function* (abort) {
        opened += 1;
        open += 1;
        abort.addEventListener("abort", () => {
          open -= 1;
        });
        const ended = untilAborted(abort);
        for (;;) {
          yield "heartbeat";
          await Promise.race([ended, new Promise((resolve) => setTimeout(resolve, 3_000))]);
        }
      },
      () => true,
      { restsWhileHidden: rests },
    );
    // A look at another tab changes nothing.
    show("hidden");
    await vi.advanceTimersByTimeAsync(5_000);
    show("visible");
    await vi.advanceTimersByTimeAsync(60_000);
    expect([opened, open]).toEqual([1, 1]);
    show("hidden");
    await vi.advanceTimersByTimeAsync(60_000);
    window.dispatchEvent(new Event("online"));
    await vi.advanceTimersByTimeAsync(60_000);
    expect([open, following.link.value]).toEqual([rests ? 0 : 1, "open"]);
    show("visible");
    await vi.advanceTimersByTimeAsync(0);
    expect([opened, open, following.link.value]).toEqual([2, 1, "open"]);
    following.stop();
  },
);

test("a stream in a tab that is opened in the background rests until somebody looks", async () => {
  const page = vi.spyOn(document, "visibilityState", "get").mockReturnValue("hidden");
  const open = vi.fn(beatOnce);
  const following = follow(open, () => true, { restsWhileHidden: true });
  await vi.advanceTimersByTimeAsync(600_000);
  const before = open.mock.calls.length;
  await vi.advanceTimersByTimeAsync(600_000);
  expect(open).toHaveBeenCalledTimes(before);
  page.mockReturnValue("visible");
  document.dispatchEvent(new Event("visibilitychange"));
  await vi.advanceTimersByTimeAsync(0);
  expect(open).toHaveBeenCalledTimes(before + 1);
  following.stop();
});

/** What a call that is aborted throws. */
function untilAborted(abort: AbortSignal): Promise<never> {
  return new Promise((_, reject) => {
    abort.addEventListener("abort", () => reject(new ConnectError("aborted", Code.Canceled)));
  });
}

/** A stream that is silent after its first message. */
async function* beatOnce(abort: AbortSignal): AsyncGenerator<string> {
  yield "heartbeat";
  await untilAborted(abort);
}

test("a silent stream is reopened", async () => {
  const open = vi.fn(beatOnce);
  const following = follow(open, () => true);
  await vi.advanceTimersByTimeAsync(8_000);
  expect(open).toHaveBeenCalledTimes(1);
  expect(following.link.value).toBe("open");
  await vi.advanceTimersByTimeAsync(3_000);
  expect(open).toHaveBeenCalledTimes(2);
  // Those of the former network are dead.
  window.dispatchEvent(new Event("online"));
  await vi.advanceTimersByTimeAsync(300);
  expect(open).toHaveBeenCalledTimes(3);
  // Somebody sets the clock of the device back.
  vi.setSystemTime(Date.now() - 3_600_000);
  await vi.advanceTimersByTimeAsync(11_000);
  expect(open).toHaveBeenCalledTimes(4);
  following.stop();
  await vi.advanceTimersByTimeAsync(120_000);
  expect(open).toHaveBeenCalledTimes(4);
  expect(following.link.value).toBe("ended");
});
