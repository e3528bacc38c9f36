// Requests to create and to join are repeated when their response is lost.

import { create } from "@bufbuild/protobuf";
import { Code, ConnectError, type UnaryRequest, type UnaryResponse } from "@connectrpc/connect";
import { afterEach, beforeEach, expect, test, vi } from "vitest";
import { REQUEST_ID_BYTES, repeat } from "../src/api/repeat";
import { ActRequestSchema } from "../src/gen/chefshat/v1/play_service_pb";
import { GetRoomRequestSchema, JoinRoomRequestSchema } from "../src/gen/chefshat/v1/room_service_pb";

beforeEach(() => void vi.useFakeTimers());
afterEach(() => void vi.useRealTimers());

/** Sends a message through the interceptor; each attempt fails with the next error. */
async function send(message: unknown, errors: ConnectError[]) {
  const ids: unknown[] = [];
  const answered = {} as UnaryResponse;
  const next = repeat(async (request) => {
    const { requestId, command } = request.message as {
      requestId?: unknown;
      command?: { value?: { requestId?: unknown } };
    };
    ids.push(requestId ?? command?.value?.requestId);
    const error = errors[ids.length - 1];
    if (error) throw error;
    return answered;
  });
  const request = { stream: false, message } as unknown as UnaryRequest;
  const sent = next(request).then(
    (response) => response === answered,
    () => false,
  );
  await vi.runAllTimersAsync();
  return { done: await sent, ids };
}

const lost = new ConnectError("connection lost", Code.Unavailable);
const refused = new ConnectError("the room is full", Code.FailedPrecondition);

test("a request for a hint is repeated with its id, other commands are not", async () => {
  const hint = create(ActRequestSchema, { command: { case: "hint", value: { decisionId: 7n } } });
  const { done, ids } = await send(hint, [lost]);
  expect(done).toBe(true);
  expect(ids).toHaveLength(2);
  expect(ids[0]).toHaveLength(REQUEST_ID_BYTES);
  expect(new Set(ids).size).toBe(1);
  const answer = create(ActRequestSchema, { command: { case: "answer", value: { decisionId: 7n } } });
  expect(await send(answer, [lost])).toEqual({ done: false, ids: [undefined] });
});

test("a request whose response was lost is repeated with its id", async () => {
  const { done, ids } = await send(create(JoinRoomRequestSchema), [lost, lost]);
  expect(done).toBe(true);
  expect(ids).toHaveLength(3);
  expect(ids[0]).toHaveLength(REQUEST_ID_BYTES);
  expect(new Set(ids).size).toBe(1);
});

test("a refusal is not repeated, and neither is a call without an id", async () => {
  expect(await send(create(JoinRoomRequestSchema), [refused])).toMatchObject({ done: false, ids: { length: 1 } });
  expect(await send(create(GetRoomRequestSchema), [lost])).toMatchObject({ done: false, ids: { length: 1 } });
});

test("the client gives up after four attempts", async () => {
  const { done, ids } = await send(create(JoinRoomRequestSchema), [lost, lost, lost, lost]);
  expect(done).toBe(false);
  expect(ids).toHaveLength(4);
});
