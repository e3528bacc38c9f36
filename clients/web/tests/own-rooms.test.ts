// Rooms like another: for playing again, and separate ones for the participants of a study with the
// names and the list of links.

import { create } from "@bufbuild/protobuf";
import { afterEach, expect, test, vi } from "vitest";
import { roomApi } from "../src/api/client";
import { tableOf } from "../src/experiment/LinkList";
import { jobs, makeOwnRooms, ownRooms } from "../src/experiment/own-rooms";
import { isTooLong, MAX_PARTICIPANTS, participantsIn } from "../src/experiment/participants";
import { GameOrigin, ParticipantKind, RoomSchema } from "../src/gen/chefshat/v1/room_pb";
import {
  CreateRoomRequestSchema,
  CreateRoomResponseSchema,
  GetRoomResponseSchema,
  JoinRoomResponseSchema,
} from "../src/gen/chefshat/v1/room_service_pb";
import { MAX_NAME } from "../src/lobby/room-form";
import { notToBeRepeated, playAgain, requestLike } from "../src/lobby/room-like";
import { createRoom, hostedRoom } from "../src/lobby/seat";
import { forgetAll, remember } from "../src/store";

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

afterEach(() => {
  vi.restoreAllMocks();
  forgetAll();
});

test.each([
  ["", []],
  ["P01\n P02 \n\nP01", ["P01", "P02"]],
  ["P08-P11", ["P08", "P09", "P10", "P11"]],
  ["P08 – 11", ["P08", "P09", "P10", "P11"]],
  ["9-11", ["9", "10", "11"]],
  ["Anne-Marie\nP3-Q9\nP9-P3", ["Anne-Marie", "P3-Q9", "P9-P3"]],
])("%j names %j", (typed, names) => {
  expect(participantsIn(typed)).toEqual(names);
});

test("an excess of participants is cut off after one more than the maximum", () => {
  expect(participantsIn("P1-P5000").length).toBe(MAX_PARTICIPANTS + 1);
  expect(participantsIn("A1-A90\nB1-B90").length).toBe(MAX_PARTICIPANTS + 1);
});

test("a repeated room has the same rules, times and agents, and free seats otherwise", () => {
  const asked = create(CreateRoomRequestSchema, requestLike(room, "Lab · P07", 86_400_000));
  expect(asked.name).toBe("Lab · P07");
  expect(asked.rules).toEqual(room.rules);
  expect(asked.policy).toEqual({ ...room.policy, waitingTimeMs: 86_400_000 });
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
  expect(requestLike(described, "").seats).toEqual(seats);
  // Nobody else knows; and a room that was created before the seats were stored has none.
  remember("hosted.wizard's", JSON.stringify({ joinCode: "BCDF2345", ownerToken: "o" }));
  expect(requestLike(described, "").seats?.[0]?.filledBy).toEqual(seats[1]?.filledBy);
  forgetAll();
  expect(requestLike(described, "").seats?.[0]?.filledBy).toEqual(seats[1]?.filledBy);
});

test.each([
  ["as a robot, without the key of the person's names", 0, "Robo", ParticipantKind.ROBOT, 0],
  ["as a person, with it", 2, "Mia", ParticipantKind.HUMAN, 32],
])("playing again takes the same seat %s", async (_, seat, name, kind, keyBytes) => {
  const { making, seats } = await wizardRoom();
  const join = vi.spyOn(roomApi, "joinRoom");
  join.mockResolvedValue(create(JoinRoomResponseSchema, { room: { roomId: "next" }, ticket: "t", seat }));
  await playAgain("wizard's", name, seat);
  expect(making.mock.lastCall?.[0].seats).toEqual(seats);
  expect(join.mock.calls).toHaveLength(1);
  const asked = join.mock.calls[0]?.[0];
  expect(asked).toMatchObject({ joinCode: "BCDF2345", name, seat, kind });
  expect(asked?.nameKey).toHaveLength(keyBytes);
});

test("a branch continues from the same point, and a game that cannot be dealt again says so", () => {
  const branched = create(RoomSchema, { branchedFrom: { gameId: "g", decisions: 9n } });
  const asked = create(CreateRoomRequestSchema, requestLike(branched, ""));
  expect([asked.rules, asked.start.case]).toEqual([undefined, "branch"]);
  expect(notToBeRepeated(room)).toBeNull();
  expect(notToBeRepeated(create(RoomSchema, { seedFixed: true }))).toBe("seed");
  expect(notToBeRepeated(create(RoomSchema, { origin: GameOrigin.SCRIPTED }))).toBe("hands");
});

test("rooms created before an error are kept, and the rest are created on the next attempt", async () => {
  let left = 2;
  vi.spyOn(roomApi, "createRoom").mockImplementation(async ({ name }) => {
    left -= 1;
    if (left < 0) throw new Error("no more");
    return create(CreateRoomResponseSchema, {
      room: { roomId: `of ${name}` },
      joinCode: `code of ${name}`,
      ownerToken: "o",
    });
  });
  const make = (asked: string) => makeOwnRooms(room, ["P1", "P2", "P3"], 1000, (name) => `?name=${name}${asked}`);
  await make("&hide=log");
  expect(jobs.value.get("like")).toMatchObject({ busy: false, fault: new Error("no more") });
  expect(ownRooms("like").map(({ name }) => name)).toEqual(["P1", "P2"]);
  left = 5;
  await make("");
  expect(jobs.value.get("like")).toMatchObject({ busy: false, fault: undefined });
  expect(left).toBe(4);
  // Each link keeps the settings from when it was created.
  expect(ownRooms("like").map(({ search }) => search)).toEqual(["?name=P1&hide=log", "?name=P2&hide=log", "?name=P3"]);
  expect(ownRooms("like")[2]).toMatchObject({ name: "P3", roomId: "of Lab · P3", joinCode: "code of Lab · P3" });
  expect(hostedRoom("of Lab · P3")?.ownerToken).toBe("o");
  expect(ownRooms("another")).toEqual([]);
});

test("closing and reopening the form while rooms are created creates none twice", async () => {
  const made: string[] = [];
  let goOn = () => {};
  const first = new Promise<void>((resolve) => {
    goOn = resolve;
  });
  vi.spyOn(roomApi, "createRoom").mockImplementation(async ({ name = "" }) => {
    made.push(name);
    await first;
    return create(CreateRoomResponseSchema, { room: { roomId: `of ${name}` }, joinCode: "c", ownerToken: "o" });
  });
  const make = () => makeOwnRooms(room, ["P1", "P2"], 1000, () => "");
  const both = [make(), make()];
  expect(jobs.value.get("like")?.busy).toBe(true);
  goOn();
  await Promise.all(both);
  expect(made).toEqual(["Lab · P1", "Lab · P2"]);
  expect(ownRooms("like").map(({ name }) => name)).toEqual(["P1", "P2"]);
});

test("a participant's room has a name of valid length with theirs in it", async () => {
  const names: string[] = [];
  vi.spyOn(roomApi, "createRoom").mockImplementation(async ({ name = "" }) => {
    names.push(name);
    return create(CreateRoomResponseSchema, { room: { roomId: name }, joinCode: "c", ownerToken: "o" });
  });
  const long = create(RoomSchema, { ...room, name: "🍕".repeat(MAX_NAME) });
  const participants = ["P07", "x".repeat(MAX_NAME)];
  await makeOwnRooms(long, participants, 1000, () => "");
  expect(names).toEqual([`${"🍕".repeat(MAX_NAME - 6)} · P07`, participants[1]]);
  expect(participants.map(isTooLong)).toEqual([false, false]);
  expect(isTooLong("x".repeat(MAX_NAME + 1))).toBe(true);
});

test("links are a valid CSV table", () => {
  const link = (name: string) => ({ name, address: "https://a.example/join/X?name=1", roomId: "r" });
  expect(tableOf([link("P07"), link('Ann, "A"')])).toBe(
    'name,link,room_id\r\nP07,https://a.example/join/X?name=1,r\r\n"Ann, ""A""",https://a.example/join/X?name=1,r\r\n',
  );
});
