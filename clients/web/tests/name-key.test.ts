// The key of this device's names: made once, or entered from another device.

import { create } from "@bufbuild/protobuf";
import { expect, test, vi } from "vitest";
import { roomApi } from "../src/api/client";
import { ParticipantKind } from "../src/gen/chefshat/v1/room_pb";
import { JoinRoomResponseSchema } from "../src/gen/chefshat/v1/room_service_pb";
import { heldSeat, lastName, takeSeat } from "../src/lobby/seat";
import { isNameKey, NO_KEY, nameKey, nameKeyText, setNameKey } from "../src/name-key";
import { forgetAll, remember } from "../src/store";

test("a key is made the first time, and kept", () => {
  expect(nameKeyText()).toBeNull();
  const key = nameKey();
  expect(key).toHaveLength(32);
  expect(nameKey()).toEqual(key);
  expect(isNameKey(nameKeyText() ?? "")).toBe(true);
  forgetAll();
  expect(nameKey()).not.toEqual(key);
});

test("the key of another device can be entered; a stored text that is not a key is replaced", () => {
  setNameKey("0A".repeat(32));
  expect(nameKey()).toEqual(new Uint8Array(32).fill(10));
  for (const text of ["", "0a".repeat(31), "0g".repeat(32), "0a".repeat(33)]) expect(isNameKey(text)).toBe(false);
  remember("nameKey", "of another version");
  expect(nameKeyText()).toBeNull();
  expect(nameKey()).toHaveLength(32);
});

test("a seat is taken with the device's key, in a study without one", async () => {
  const join = vi.spyOn(roomApi, "joinRoom").mockRejectedValue(new Error("no server"));
  await expect(takeSeat("BCDF2345", "Ada")).rejects.toThrow("no server");
  await expect(takeSeat("BCDF2345", "P07", 1, ParticipantKind.HUMAN, NO_KEY)).rejects.toThrow("no server");
  expect(join.mock.calls.map(([request]) => request.nameKey)).toEqual([nameKey(), NO_KEY]);
});

test("the name of a robot is not proposed as the person's own", async () => {
  vi.spyOn(roomApi, "joinRoom").mockResolvedValue(create(JoinRoomResponseSchema, { room: { roomId: "01" } }));
  await takeSeat("BCDF2345", "Ada");
  await takeSeat("BCDF2345", "Pepper", 1, ParticipantKind.ROBOT, NO_KEY);
  expect([lastName(), heldSeat("01")?.name]).toEqual(["Ada", "Pepper"]);
});
