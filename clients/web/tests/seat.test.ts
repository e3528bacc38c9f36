// Stored seats and rooms survive a reload and invalid data; join codes are accepted as people type
// them.

import { expect, test } from "vitest";
import { addressIn, codeIn } from "../src/lobby/JoinForm";
import {
  decideSeat,
  giveUpSeat,
  type HeldSeat,
  heldSeat,
  hostedRoom,
  linkToSeat,
  roomOfCode,
  seatFromLink,
} from "../src/lobby/seat";
import { forgetAll, remember, remembered } from "../src/store";

const ROOM = "5f0c6a4de2b14b7f8a3d9c1e7b60425d";
const HELD = { ticket: `${ROOM}${"cd".repeat(32)}`, seat: 2, name: "Rosa" };

test("a seat is stored until it is given up", () => {
  remember(`seat.${ROOM}`, JSON.stringify(HELD));
  remember("code.BCDF2345", ROOM);
  expect(heldSeat(ROOM)).toEqual(HELD);
  expect(heldSeat("room2")).toBeNull();
  expect(roomOfCode("bcdf-2345")).toBe(ROOM);
  remember("code.OTHER234", "room2");
  giveUpSeat(ROOM);
  expect([...remembered().keys()]).toEqual(["code.OTHER234"]);
  expect(heldSeat(ROOM)).toBeNull();
  expect(roomOfCode("BCDF2345")).toBeNull();
});

const BO: HeldSeat = { ticket: `${ROOM}${"ab".repeat(32)}`, seat: 3, name: "Bo & Çem" };
const open = (held: HeldSeat) => {
  const { pathname, hash } = new URL(linkToSeat(ROOM, held));
  expect(pathname).toBe(`/rooms/${ROOM}`);
  history.replaceState(null, "", pathname + hash);
};

test("a link brings a seat to another device and leaves the address", () => {
  open(BO);
  expect(seatFromLink(ROOM)).toBeNull();
  expect(heldSeat(ROOM)).toEqual(BO);
  expect(location.hash).toBe("");
});

test.each([
  ["stays without an answer", undefined, HELD, true],
  ["stays if the person wants it to", null, HELD, false],
  ["is replaced if the person wants it to be", BO, BO, false],
] as const)("the seat that this device already has %s", (_, chosen, expected, stillInAddress) => {
  open(HELD);
  seatFromLink(ROOM);
  open(BO);
  expect(seatFromLink(ROOM)).toEqual(BO);
  if (chosen !== undefined) decideSeat(ROOM, chosen);
  expect(heldSeat(ROOM)).toEqual(expected);
  expect(location.hash !== "").toBe(stillInAddress);
});

const bringing = (...brought: unknown[]) => `#seat=${encodeURIComponent(JSON.stringify(brought))}`;

test.each([
  "",
  "#seat=",
  "#seat=%5B1%5D",
  "#seat=%",
  bringing(...Object.values(BO)).replace("seat", "place"),
  bringing("x", 0, "Ada"),
  bringing("ab".repeat(48), 0, "of another room"),
  bringing(BO.ticket, "0", "Ada"),
])("a link without a seat brings none: %s", (hash) => {
  history.replaceState(null, "", `/rooms/${ROOM}${hash}`);
  expect(seatFromLink(ROOM)).toBeNull();
  expect(heldSeat(ROOM)).toBeNull();
});

test.each(["", "null", "3", "[]", "{", '{"ticket":1}'])("%j is neither a seat nor a room", (kept) => {
  remember(`seat.${ROOM}`, kept);
  remember(`hosted.${ROOM}`, kept);
  expect(heldSeat(ROOM)).toBeNull();
  expect(hostedRoom(ROOM)).toBeNull();
});

test.each([
  ["bcdf2345", "BCDF2345"],
  [" bcdf 2345 ", "BCDF2345"],
  ["", ""],
  ["https://example.org/else/where", ""],
  ["#seat=x", ""],
])("%j is the code %j", (typed, code) => {
  expect(addressIn(typed)).toBeNull();
  expect(codeIn(typed)).toBe(code);
});

test.each([
  ["http://127.0.0.1:50051/join/bcdf2345", "/join/bcdf2345"],
  ["Come: 127.0.0.1/join/bcdf2345?as=robot&lang=it ", "/join/bcdf2345?as=robot&lang=it"],
  ["http://127.0.0.1/tournaments/89ab?code=BCDF2345&name=P07", "/tournaments/89ab?code=BCDF2345&name=P07"],
  [" /tournaments/89ab ", "/tournaments/89ab"],
  ["https://example.org/join/X#token=T", "/join/X#token=T"],
  ["https://example.org/#token=T", "/#token=T"],
  ["https://example.org/study/abc", "/study/abc"],
  ["https://example.org//rooms/./x", "/rooms/x"],
])("the pasted text %j leads to %s", (typed, address) => {
  expect(addressIn(typed)).toBe(address);
});

test("a pasted link that brings a seat is that link here, and no code", () => {
  const link = linkToSeat(ROOM, HELD);
  expect(location.origin + addressIn(link)).toBe(link);
  expect(codeIn(link)).toBe("");
});

test("everything stored can be deleted, and nothing else is", () => {
  localStorage.setItem("another", "page's");
  remember("name", "Rosa");
  expect([...remembered().keys()]).toEqual(["name"]);
  forgetAll();
  expect(remembered().size).toBe(0);
  expect(localStorage.getItem("another")).toBe("page's");
});
