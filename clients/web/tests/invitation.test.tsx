// The page that an invitation opens: what a code belongs to, and how often it is asked for.

import { create } from "@bufbuild/protobuf";
import { Code, ConnectError } from "@connectrpc/connect";
import { render } from "preact";
import { act } from "preact/test-utils";
import { afterEach, beforeEach, expect, test, vi } from "vitest";
import { roomApi, tournamentApi } from "../src/api/client";
import { RoomState } from "../src/gen/chefshat/v1/room_pb";
import { GetRoomResponseSchema } from "../src/gen/chefshat/v1/room_service_pb";
import { ErrorInfoSchema } from "../src/gen/google/rpc/error_details_pb";
import { t } from "../src/i18n";
import { Join } from "../src/lobby/Join";
import { forgetAll } from "../src/store";
import { root } from "./mounted";

const ID = "5f0c6a4de2b14b7f8a3d9c1e7b60425d";
const CODE = "BCDF2345";

const refused = (reason: string) =>
  new ConnectError("no", Code.PermissionDenied, undefined, [{ desc: ErrorInfoSchema, value: { reason } }]);
const notReached = () => new ConnectError("away", Code.Unavailable);
const room = () =>
  create(GetRoomResponseSchema, { room: { roomId: ID, name: "Table one", state: RoomState.WAITING, seats: [{}] } });
beforeEach(() => {
  vi.useFakeTimers({ toFake: ["setTimeout", "clearTimeout", "setInterval", "clearInterval"] });
});
afterEach(() => {
  vi.useRealTimers();
  vi.restoreAllMocks();
  forgetAll();
  history.replaceState(null, "", "/");
});

async function pass(ms: number) {
  await act(async () => {
    await vi.advanceTimersByTimeAsync(ms);
  });
}

async function opened() {
  await act(() => render(<Join route={{ page: "join", code: CODE }} />, root));
  await pass(0);
}

test("a wrong code is sent once, and its page says that it is wrong", async () => {
  const rooms = vi.spyOn(roomApi, "getRoom").mockRejectedValue(refused("JOIN_CODE_WRONG"));
  const tournaments = vi.spyOn(tournamentApi, "getTournament").mockRejectedValue(refused("JOIN_CODE_WRONG"));
  await opened();
  await pass(600_000);
  expect(rooms).toHaveBeenCalledTimes(1);
  expect(tournaments).toHaveBeenCalledTimes(1);
  expect(root.textContent).toContain(t().faults.byReason.JOIN_CODE_WRONG);
});

test("who may try no more codes learns why", async () => {
  vi.spyOn(roomApi, "getRoom").mockRejectedValue(refused("TOO_MANY_WRONG_CODES"));
  await opened();
  expect(root.textContent).toContain(t().faults.byReason.TOO_MANY_WRONG_CODES);
  expect(root.querySelector("form")).toBeNull();
});

test("while the server is away, the room that was found stays, and one that was not can be joined", async () => {
  const rooms = vi.spyOn(roomApi, "getRoom").mockRejectedValueOnce(notReached()).mockResolvedValueOnce(room());
  rooms.mockRejectedValue(notReached());
  await opened();
  expect(root.querySelector("form")).not.toBeNull();
  expect(root.querySelector('[data-part~="join-room"]')).toBeNull();
  await pass(60_000);
  expect(root.querySelector('[data-part~="join-room"]')?.textContent).toContain("Table one");
});
