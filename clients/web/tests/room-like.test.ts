// Rooms like another, for playing again.

import { create } from "@bufbuild/protobuf";
import { expect, test, vi } from "vitest";
import { roomApi } from "../src/api/client";
import { GameOrigin, ParticipantKind, RoomSchema } from "../src/gen/chefshat/v1/room_pb";
import {
  CloseRoomResponseSchema,
  CreateRoomRequestSchema,
  CreateRoomResponseSchema,
  GetRoomResponseSchema,
  JoinRoomResponseSchema,
  SetNextRoomResponseSchema,
} from "../src/gen/chefshat/v1/room_service_pb";
import { playAgain, requestLike } from "../src/lobby/room-like";
import { createRoom } from "../src/lobby/seat";
import { forgetAll, remember } from "../src/store";
import { refused } from "./refusals";

const room = create(RoomSchema, {
  roomId: "like",
  name: "Lab",
  origin: GameOrigin.DEALT,
  rules: { preset: "paper", players: 4, faces: 7, stop: { case: "targetShifts", value: 2 } },
  policy: { decisionTimeMs: 20_000, waitingTimeMs: 3_600_000, clocks: [{ kind: ParticipantKind.HUMAN, bankMs: 5 }] },
  seats: [
    { seat: 0, name: "Mia", kind: ParticipantKind.HUMAN, reservedFor: ParticipantKind.HUMAN },
    { seat: 1, name: "Bea", kind: ParticipantKind.AGENT, builtInAgent: "greedy" },
    { seat: 2, builtInAgent: "replay", name: "P01", replay: { gameId: "g", seat: 3 } },
    { seat: 3, reservedFor: ParticipantKind.AGENT },
  ],
});

test("a repeated room has the same rules, times and agents, and free seats otherwise", () => {
  const asked = create(CreateRoomRequestSchema, requestLike(room));
  expect(asked.name).toBe("Lab");
  expect(asked.rules).toEqual(room.rules);
  expect(asked.policy).toEqual(room.policy);
  expect(asked.seats.map(({ filledBy, name }) => [filledBy.case, name])).toEqual([
    ["reservedFor", ""],
    ["builtInAgent", "Bea"],
    ["replay", "P01"],
    ["reservedFor", ""],
  ]);
  expect(asked.seats.map(({ filledBy }) => filledBy.value)).toEqual([
    ParticipantKind.HUMAN,
    "greedy",
    room.seats[2]?.replay,
    ParticipantKind.AGENT,
  ]);
});

/** A room whose first seat a person plays as a robot. The server describes it like any robot's. */
async function wizardRoom() {
  const { HUMAN, ROBOT } = ParticipantKind;
  const described = create(RoomSchema, {
    roomId: "wizard's",
    seats: [
      { seat: 0, name: "Robo", kind: ROBOT, reservedFor: ROBOT },
      { seat: 1, name: "Robbie", kind: ROBOT, reservedFor: ROBOT },
      { seat: 2, name: "Mia", kind: HUMAN, reservedFor: HUMAN },
    ],
  });
  const making = vi.spyOn(roomApi, "createRoom");
  making.mockImplementation(async () =>
    create(CreateRoomResponseSchema, { room: described, joinCode: "BCDF2345", ownerToken: "o" }),
  );
  vi.spyOn(roomApi, "getRoom").mockResolvedValue(create(GetRoomResponseSchema, { room: described }));
  const seats = [
    { filledBy: { case: "wizard" as const, value: ROBOT } },
    { filledBy: { case: "reservedFor" as const, value: ROBOT } },
    { filledBy: { case: "reservedFor" as const, value: HUMAN } },
  ];
  await createRoom({ seats });
  return { described, making, seats };
}

test("a seat of a person who plays as a robot stays one, on the device that created the room", async () => {
  const { described, seats } = await wizardRoom();
  expect(requestLike(described).seats).toEqual(seats);
  // Nobody else knows; and a room that was created before the seats were stored has none.
  remember("hosted.wizard's", JSON.stringify({ joinCode: "BCDF2345", ownerToken: "o" }));
  expect(requestLike(described).seats?.[0]?.filledBy).toEqual(seats[1]?.filledBy);
  forgetAll();
  expect(requestLike(described).seats?.[0]?.filledBy).toEqual(seats[1]?.filledBy);
});

test.each([
  ["as a robot, without the key of the person's names", 0, "Robo", ParticipantKind.ROBOT, 0],
  ["as a person, with it", 2, "Mia", ParticipantKind.HUMAN, 32],
])("playing again takes the same seat %s", async (_, seat, name, kind, keyBytes) => {
  const { making, seats } = await wizardRoom();
  const join = vi.spyOn(roomApi, "joinRoom");
  join.mockResolvedValue(create(JoinRoomResponseSchema, { room: { roomId: "next" }, ticket: "t", seat }));
  const offer = vi.spyOn(roomApi, "setNextRoom").mockResolvedValue(create(SetNextRoomResponseSchema));
  await playAgain("wizard's", { ticket: "mine", name, seat });
  expect(offer.mock.lastCall?.[0]).toEqual({ roomId: "wizard's", ticket: "mine", joinCode: "BCDF2345" });
  expect(making.mock.lastCall?.[0].seats).toEqual(seats);
  expect(join.mock.calls).toHaveLength(1);
  const asked = join.mock.calls[0]?.[0];
  expect(asked).toMatchObject({ joinCode: "BCDF2345", name, seat, kind });
  expect(asked?.nameKey).toHaveLength(keyBytes);
});

test("who is slower to offer a rematch closes the own room and joins the other's", async () => {
  const { described } = await wizardRoom();
  vi.spyOn(roomApi, "setNextRoom").mockRejectedValue(refused("NEXT_ROOM_SET"));
  const close = vi.spyOn(roomApi, "closeRoom").mockResolvedValue(create(CloseRoomResponseSchema));
  const offered = { ...described, nextJoinCode: "FIRST234" };
  vi.spyOn(roomApi, "getRoom").mockResolvedValue(create(GetRoomResponseSchema, { room: offered }));
  const join = vi.spyOn(roomApi, "joinRoom");
  join.mockResolvedValue(create(JoinRoomResponseSchema, { room: { roomId: "theirs" }, ticket: "t", seat: 2 }));
  await playAgain("wizard's", { ticket: "mine", name: "Mia", seat: 2 });
  expect(close).toHaveBeenCalledTimes(1);
  expect(join.mock.calls.map(([asked]) => asked.joinCode)).toEqual(["FIRST234"]);
  expect(location.pathname).toBe("/rooms/theirs");
});

test("a branch continues from the same point", () => {
  const branched = create(RoomSchema, { branchedFrom: { gameId: "g", decisions: 9n } });
  const asked = create(CreateRoomRequestSchema, requestLike(branched));
  expect([asked.rules, asked.start.case]).toEqual([undefined, "branch"]);
});
