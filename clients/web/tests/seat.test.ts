// Stored seats and rooms survive a reload and invalid data; join codes are accepted as people type
// them.

import { beforeEach, expect, test } from "vitest";
import { codeIn } from "../src/lobby/JoinForm";
import { giveUpSeat, heldSeat, hostedRoom, roomOfCode } from "../src/lobby/seat";
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
