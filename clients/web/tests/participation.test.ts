// Taking part in a tournament: failed requests of a room are repeated with growing delays, only
// while the place belongs to this page.

import { create, type MessageInitShape } from "@bufbuild/protobuf";
import { Code, ConnectError } from "@connectrpc/connect";
import { beforeAll, beforeEach, expect, test, vi } from "vitest";
import { playApi, roomApi } from "../src/api/client";
import {
  DetachReason,
  PlayServiceWatchResponseSchema,
  type SeatUpdateSchema,
} from "../src/gen/chefshat/v1/play_service_pb";
import { GetRoomResponseSchema } from "../src/gen/chefshat/v1/room_service_pb";
import { setLanguage } from "../src/i18n";
import * as en from "../src/i18n/en";
import { refusedWords } from "../src/table/words";
import { startParticipation } from "../src/tournaments/participation";
import { AWAY } from "./refusals";

const SEATED = 2 ** 31;
type Update = MessageInitShape<typeof SeatUpdateSchema>;
const entered: Update = { handle: 0, update: { case: "entered", value: {} } };
const superseded: Update = { handle: 0, update: { case: "detached", value: { reason: DetachReason.SUPERSEDED } } };
const seated: Update = {
  handle: SEATED,
  update: { case: "attached", value: { roomId: "room1", ticket: "t", seat: 0 } },
};

beforeAll(() => setLanguage("en"));
beforeEach(() => void vi.useFakeTimers());

/** A stream that sends messages at these times, in milliseconds from its start, and stays open. */
function streaming(said: readonly (readonly [atMs: number, update: Update])[]) {
  return vi.spyOn(playApi, "watch").mockImplementation(async function* () {
    let nowMs = 0;
    for (const [atMs, update] of said) {
      if (atMs > nowMs) await new Promise((resolve) => setTimeout(resolve, atMs - nowMs));
      nowMs = atMs;
      yield create(PlayServiceWatchResponseSchema, { updates: [update] });
    }
    await new Promise(() => {});
  });
}

test("the request of a room is repeated until it succeeds, on one stream", async () => {
  const watch = streaming([
    [0, entered],
    [0, seated],
  ]);
  const room = create(GetRoomResponseSchema, { room: { roomId: "room1" } });
  const ask = vi.spyOn(roomApi, "getRoom").mockRejectedValueOnce(AWAY).mockRejectedValueOnce(AWAY);
  ask.mockResolvedValue(room);
  const part = startParticipation("ticket");
  await vi.advanceTimersByTimeAsync(10_000);
  expect(ask).toHaveBeenCalledTimes(3);
  expect(watch).toHaveBeenCalledTimes(1);
  expect(part.game.value?.live.value.table.roomId).toBe("room1");
  part.stop();
});

test("a superseded page stops its requests and does not take the place back", async () => {
  const watch = streaming([
    [0, entered],
    [0, seated],
    [5_000, superseded],
  ]);
  const ask = vi.spyOn(roomApi, "getRoom").mockRejectedValue(AWAY);
  const part = startParticipation("ticket");
  await vi.advanceTimersByTimeAsync(5_000);
  expect(part.presence.value).toBe("superseded");
  const asked = ask.mock.calls.length;
  expect(asked).toBeGreaterThan(1);
  await vi.advanceTimersByTimeAsync(120_000);
  expect(ask).toHaveBeenCalledTimes(asked);
  expect(watch).toHaveBeenCalledTimes(1);
  part.stop();
});

test("after a lost connection the seat is attached again, also if its game has ended meanwhile", async () => {
  vi.spyOn(roomApi, "getRoom").mockResolvedValue(create(GetRoomResponseSchema, { room: { roomId: "room1" } }));
  const refusal: Update = { handle: 0, update: { case: "refused", value: { reason: "TICKET_UNKNOWN" } } };
  let streams = 0;
  const watch = vi.spyOn(playApi, "watch").mockImplementation(async function* () {
    streams += 1;
    const again: Update[] = [refusal, { ...entered, handle: 1 }];
    for (const update of streams === 1 ? [entered, seated] : again) {
      yield create(PlayServiceWatchResponseSchema, { updates: [update] });
      await new Promise((resolve) => setTimeout(resolve, 10));
    }
    if (streams === 1) throw AWAY;
    await new Promise(() => {});
  });
  const part = startParticipation("ticket");
  await vi.advanceTimersByTimeAsync(5_000);
  const asked = watch.mock.calls.map(([{ seats = [] }]) => seats.map((one) => one.ticket));
  expect(asked).toEqual([["ticket"], ["t", "ticket"]]);
  expect(part.presence.value).toBe("here");
  expect(part.game.value?.live.value.attachment.kind).toBe("refused");
  part.stop();
});

test("the request of a room that is gone is not repeated", async () => {
  streaming([
    [0, entered],
    [0, seated],
  ]);
  const ask = vi.spyOn(roomApi, "getRoom").mockRejectedValue(new ConnectError("gone", Code.NotFound));
  const part = startParticipation("ticket");
  await vi.advanceTimersByTimeAsync(10_000);
  expect(ask).toHaveBeenCalledTimes(1);
  expect(part.game.value).toBeUndefined();
  part.stop();
});

test("a refused place says why", async () => {
  streaming([[0, { handle: 0, update: { case: "refused", value: { reason: "OUT_OF_SCOPE" } } }]]);
  const part = startParticipation("ticket");
  await vi.advanceTimersByTimeAsync(0);
  expect([part.presence.value, part.refusal.value?.reason]).toEqual(["refused", "OUT_OF_SCOPE"]);
  expect(refusedWords({ reason: "OUT_OF_SCOPE", message: "" })).toBe(en.faults.byReason.OUT_OF_SCOPE);
  part.stop();
});
