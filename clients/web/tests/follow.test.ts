// Following a stream: it is opened again when it is lost or silent, and left when it says that it
// is over or fails for good.

import { Code, ConnectError } from "@connectrpc/connect";
import { afterEach, beforeEach, expect, test, vi } from "vitest";
import { follow } from "../src/api/follow";

beforeEach(() => {
  vi.useFakeTimers();
});
afterEach(() => {
  vi.useRealTimers();
});

/** A stream that gives these messages, then throws or ends. */
async function* stream(messages: readonly string[], thrown?: unknown): AsyncGenerator<string> {
  yield* messages;
  if (thrown) throw thrown;
}

test("a lost stream is opened again until it says that it is over", async () => {
  const away = new ConnectError("away", Code.Unavailable);
  const streams = [stream(["a"], away), stream([], away), stream(["b"]), stream(["c", "end", "never"])];
  let opened = 0;
  const heard: string[] = [];
  const following = follow(
    () => streams[opened++] ?? stream([]),
    (message) => {
      heard.push(message);
      return message !== "end";
    },
  );
  await vi.advanceTimersByTimeAsync(0);
  expect(following.link.value).toBe("lost");
  await vi.advanceTimersByTimeAsync(60_000);
  expect(heard).toEqual(["a", "b", "c", "end"]);
  expect(opened).toBe(4);
  expect(following.link.value).toBe("ended");
});

test("a fault that trying again does not mend ends it", async () => {
  let opened = 0;
  const following = follow(
    () => {
      opened += 1;
      return stream([], new ConnectError("who?", Code.NotFound));
    },
    () => true,
  );
  await vi.advanceTimersByTimeAsync(60_000);
  expect(following.link.value).toBe("failed");
  expect(following.fault.value?.code).toBe(Code.NotFound);
  expect(opened).toBe(1);
});

test("a stream on which nothing is heard any more is given up and opened again", async () => {
  let opened = 0;
  const following = follow(
    async function* (abort) {
      opened += 1;
      yield "heartbeat";
      await new Promise((_, reject) => {
        abort.addEventListener("abort", () => reject(new ConnectError("aborted", Code.Canceled)));
      });
    },
    () => true,
  );
  await vi.advanceTimersByTimeAsync(30_000);
  expect(opened).toBe(1);
  expect(following.link.value).toBe("open");
  await vi.advanceTimersByTimeAsync(20_000);
  expect(opened).toBe(2);
  following.stop();
  await vi.advanceTimersByTimeAsync(120_000);
  expect(opened).toBe(2);
  expect(following.link.value).toBe("ended");
});
