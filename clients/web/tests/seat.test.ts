// Stored seats and rooms survive a reload and invalid data; join codes are accepted as people type
// them.

import { beforeEach, expect, test } from "vitest";
import { codeIn } from "../src/lobby/JoinForm";
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

beforeEach(forgetAll);

const HELD = { ticket: "secret", seat: 2, name: "Rosa" };

test("a seat is stored until it is given up", () => {
  remember("seat.room1", JSON.stringify(HELD));
  remember("code.BCDF2345", "room1");
  expect(heldSeat("room1")).toEqual(HELD);
  expect(heldSeat("room2")).toBeNull();
  expect(roomOfCode("bcdf-2345")).toBe("room1");
  remember("code.OTHER234", "room2");
  giveUpSeat("room1");
  expect([...remembered().keys()]).toEqual(["code.OTHER234"]);
  expect(heldSeat("room1")).toBeNull();
  expect(roomOfCode("BCDF2345")).toBeNull();
});

const BO: HeldSeat = { ticket: "ab".repeat(48), seat: 3, name: "Bo & Çem" };
const open = (held: HeldSeat) => {
  const { pathname, hash } = new URL(linkToSeat("room1", held));
  expect(pathname).toBe("/rooms/room1");
  history.replaceState(null, "", pathname + hash);
};

test("a link brings a seat to another device and leaves the address", () => {
  open(BO);
  expect(seatFromLink("room1")).toBeNull();
  expect(heldSeat("room1")).toEqual(BO);
  expect(location.hash).toBe("");
});

test.each([
  ["stays without an answer", undefined, HELD, true],
  ["stays if the person wants it to", null, HELD, false],
  ["is replaced if the person wants it to be", BO, BO, false],
] as const)("the seat that this device already has %s", (_, chosen, expected, stillInAddress) => {
  open(HELD);
  seatFromLink("room1");
  open(BO);
  expect(seatFromLink("room1")).toEqual(BO);
  if (chosen !== undefined) decideSeat("room1", chosen);
  expect(heldSeat("room1")).toEqual(expected);
  expect(location.hash !== "").toBe(stillInAddress);
});

test.each(["", "#seat=", "#seat=%5B1%5D", "#seat=%", "#place=%5B%22a%22%2C1%2C%22b%22%5D"])(
  "a link without a seat brings none: %s",
  (hash) => {
    history.replaceState(null, "", `/rooms/room1${hash}`);
    expect(seatFromLink("room1")).toBeNull();
    expect(heldSeat("room1")).toBeNull();
  },
);

test.each(["", "null", "3", "[]", "{", '{"ticket":1}'])("%j is neither a seat nor a room", (kept) => {
  remember("seat.room1", kept);
  remember("hosted.room1", kept);
  expect(heldSeat("room1")).toBeNull();
  expect(hostedRoom("room1")).toBeNull();
});

test.each([
  ["bcdf2345", "BCDF2345", ""],
  [" bcdf 2345 ", "BCDF2345", ""],
  ["http://127.0.0.1:50051/join/bcdf2345", "BCDF2345", ""],
  ["http://127.0.0.1:50051/join/bcdf2345?as=robot&lang=it ", "BCDF2345", "?as=robot&lang=it"],
  ["", "", ""],
])("%j is the code %s, and besides %j", (typed, code, search) => {
  expect(codeIn(typed)).toEqual({ code, search });
});

test("everything stored can be deleted, and nothing else is", () => {
  localStorage.setItem("another", "page's");
  remember("name", "Rosa");
  expect([...remembered().keys()]).toEqual(["name"]);
  forgetAll();
  expect(remembered().size).toBe(0);
  expect(localStorage.getItem("another")).toBe("page's");
});
