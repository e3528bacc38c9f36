// Calls have a deadline, streams have none.

import { expect, test, vi } from "vitest";
import { playApi, serverApi } from "../src/api/client";

test("a call has a deadline unless it sets its own, and a stream has none", async () => {
  const deadlines: (string | null)[] = [];
  vi.stubGlobal("fetch", async (_: string, { headers }: RequestInit) => {
    deadlines.push(new Headers(headers).get("grpc-timeout"));
    throw new TypeError("no network");
  });
  const failed = async (call: Promise<unknown>) => expect(call).rejects.toThrow("no network");
  await failed(serverApi.getServerInfo({}));
  await failed(serverApi.getServerInfo({}, { timeoutMs: 5_000 }));
  await failed(serverApi.getServerInfo({}, { timeoutMs: 0 }));
  await failed(playApi.watch({ seats: [] })[Symbol.asyncIterator]().next());
  expect(deadlines).toEqual(["15000m", "5000m", null, null]);
});
