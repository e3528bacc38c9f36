// The tickets and owner tokens of this device: shown with the calls that may need them, and with no
// others.

import type { StreamRequest, UnaryRequest } from "@connectrpc/connect";
import { expect, test } from "vitest";
import { keepSecret, secretsFor, showSecrets } from "../src/api/secrets";
import { keepTableTicket } from "../src/attend/ticket";
import { Visibility } from "../src/gen/chefshat/v1/room_pb";
import { remember, remembered } from "../src/store";

const ROOM = "0".repeat(32);
const OTHER = "1".repeat(32);
const PRIVATE = { visibility: Visibility.PRIVATE };
const secretOf = (id: string, digit: string) => id + digit.repeat(64);

test("a room is asked for with its own secrets first", () => {
  const [ticket, owner, elsewhere] = [secretOf(ROOM, "a"), secretOf(ROOM, "b"), secretOf(OTHER, "c")];
  for (const secret of [ticket, owner, elsewhere]) keepSecret(secret, PRIVATE);
  expect(secretsFor("GetRoom", { roomId: ROOM })).toEqual([owner, ticket, elsewhere]);
  expect(secretsFor("FollowTournament", { tournamentId: OTHER })).toEqual([elsewhere, owner, ticket]);
  expect(secretsFor("ListRooms", { state: 1 })).toEqual([elsewhere, owner, ticket]);
});

test("a record is asked for with the secrets of its room first", () => {
  keepSecret(secretOf(ROOM, "a"), PRIVATE, "game 1");
  keepSecret(secretOf(OTHER, "b"), PRIVATE, "game 2");
  expect(secretsFor("GetRecord", { gameId: "game 1" })[0]).toBe(secretOf(ROOM, "a"));
});

test("they are sent as headers, with streams too", async () => {
  const secret = secretOf(ROOM, "a");
  keepSecret(secret, PRIVATE);
  const message = { roomId: ROOM };
  async function* messages() {
    yield message;
  }
  const header = () => new Headers();
  const unary = { stream: false, method: { name: "GetRoom" }, message, header: header() };
  const stream = { stream: true, method: { name: "Watch" }, message: messages(), header: header() };
  for (const request of [unary, stream]) {
    const sent: (UnaryRequest | StreamRequest)[] = [];
    const next = async (passed: UnaryRequest | StreamRequest) => {
      sent.push(passed);
      return {} as never;
    };
    await showSecrets(next)(request as unknown as UnaryRequest);
    expect(sent[0]?.header.get("chefshat-secret")).toBe(secret);
    const received = [];
    if (sent[0]?.stream) for await (const one of sent[0].message) received.push(one);
    expect(received).toEqual(request.stream ? [message] : []);
  }
});

test("secrets of what is public are not stored", () => {
  keepSecret(secretOf(ROOM, "a"), { visibility: Visibility.UNSPECIFIED });
  keepSecret(secretOf(ROOM, "b"), undefined);
  expect(remembered().size).toBe(0);
  keepSecret(secretOf(ROOM, "c"), { visibility: Visibility.UNLISTED });
  expect(secretsFor("ListRooms", {})).toEqual([secretOf(ROOM, "c")]);
});

test("the ticket of a table shows its room", () => {
  keepTableTicket(ROOM, secretOf(ROOM, "d"));
  expect(secretsFor("GetRoom", { roomId: ROOM })).toEqual([secretOf(ROOM, "d")]);
  expect(secretsFor("ListRooms", {})).toEqual([]);
  keepTableTicket(ROOM, "mistyped");
  expect(secretsFor("GetRoom", { roomId: ROOM })).toEqual([]);
});

test("other calls show none", () => {
  keepSecret(secretOf(ROOM, "a"), PRIVATE);
  expect(secretsFor("GetServerInfo", {})).toEqual([]);
  expect(secretsFor("GetRoom", { roomId: "", joinCode: "BCDF2345" })).toEqual([]);
});

test("no more are shown than the server accepts, the newest ones", () => {
  const digits = Array.from({ length: 20 }, (_, number) => number.toString(16).padStart(64, "0"));
  for (const digit of digits) keepSecret(ROOM + digit, PRIVATE);
  keepSecret(ROOM + digits[5], PRIVATE);
  const shown = secretsFor("ListRecords", {});
  expect(shown).toHaveLength(16);
  expect(shown.slice(0, 2)).toEqual([ROOM + digits[5], ROOM + digits[19]]);
});

test.each(["", "null", "{}", '{"kept":3}', '{"kept":[null,{"secret":"BCDF2345"},{"secret":3}]}'])(
  "%j contains no secret",
  (stored) => {
    remember("secrets", stored);
    expect(secretsFor("ListRooms", {})).toEqual([]);
  },
);
