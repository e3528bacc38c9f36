// Requests to create and to join are repeated when their response is lost.

import { create, type DescMessage, type MessageInitShape } from "@bufbuild/protobuf";
import { Code, ConnectError, type UnaryRequest, type UnaryResponse } from "@connectrpc/connect";
import { beforeEach, expect, test, vi } from "vitest";
import { REQUEST_ID_BYTES, repeat } from "../src/api/repeat";
import { ActRequestSchema } from "../src/gen/chefshat/v1/play_service_pb";
import { GetRoomRequestSchema, JoinRoomRequestSchema } from "../src/gen/chefshat/v1/room_service_pb";

beforeEach(() => void vi.useFakeTimers());

/** Sends a message through the interceptor; each attempt fails with the next error. */
async function send<Asked extends DescMessage>(input: Asked, init: MessageInitShape<Asked>, errors: ConnectError[]) {
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
  const method = { name: input.typeName, input };
  const request = { stream: false, method, message: create(input, init) } as unknown as UnaryRequest;
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
  const hint = { command: { case: "hint" as const, value: { decisionId: 7n } } };
  const { done, ids } = await send(ActRequestSchema, hint, [lost]);
  expect(done).toBe(true);
  expect(ids).toHaveLength(2);
  expect(ids[0]).toHaveLength(REQUEST_ID_BYTES);
  expect(new Set(ids).size).toBe(1);
  const answer = { command: { case: "answer" as const, value: { decisionId: 7n } } };
  expect(await send(ActRequestSchema, answer, [lost])).toEqual({ done: false, ids: [undefined] });
});

test("a request whose response was lost is repeated with its id", async () => {
  const { done, ids } = await send(JoinRoomRequestSchema, {}, [lost, lost]);
  expect(done).toBe(true);
  expect(ids).toHaveLength(3);
  expect(ids[0]).toHaveLength(REQUEST_ID_BYTES);
  expect(new Set(ids).size).toBe(1);
});

test("a refusal is not repeated, and neither is a call without an id", async () => {
  expect(await send(JoinRoomRequestSchema, {}, [refused])).toMatchObject({ done: false, ids: { length: 1 } });
  expect(await send(GetRoomRequestSchema, {}, [lost])).toMatchObject({ done: false, ids: { length: 1 } });
});

const NEVER = [lost, lost, lost, lost];

test("the client gives up after four attempts", async () => {
  const { done, ids } = await send(JoinRoomRequestSchema, {}, NEVER);
  expect(done).toBe(false);
  expect(ids).toHaveLength(4);
});

test("what is asked again after no attempt was answered is the same request, until it is answered", async () => {
  const asked = { joinCode: "BCDF2345", name: "Ada" };
  const join = async (init: typeof asked, errors: ConnectError[]) =>
    (await send(JoinRoomRequestSchema, init, errors)).ids[0];
  const first = await join(asked, NEVER);
  expect(await join(asked, [new ConnectError("too late", Code.DeadlineExceeded)])).toEqual(first);
  expect(await join(asked, [])).toEqual(first);
  const second = await join(asked, [refused]);
  expect(second).not.toEqual(first);
  const third = await join(asked, NEVER);
  expect(third).not.toEqual(second);
  expect(await join({ ...asked, name: "Bo" }, [])).not.toEqual(third);
});

test("what is asked again much later is meant anew", async () => {
  const { ids } = await send(JoinRoomRequestSchema, { name: "Ada" }, NEVER);
  await vi.advanceTimersByTimeAsync(3_600_000);
  expect((await send(JoinRoomRequestSchema, { name: "Ada" }, [])).ids[0]).not.toEqual(ids[0]);
});
