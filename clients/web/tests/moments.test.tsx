// Special moments: which events are one, and that they are shown once, with what they mean.

import { create, type MessageInitShape } from "@bufbuild/protobuf";
import { act } from "preact/test-utils";
import { afterEach, expect, test, vi } from "vitest";
import { GameEventSchema } from "../src/gen/chefshat/v1/event_pb";
import { SpecialAction } from "../src/gen/chefshat/v1/rules_pb";
import { Announcer } from "../src/parts/Announcer";
import { setPreference } from "../src/preferences";
import { useAnnounced } from "../src/table/following";
import { momentSince } from "../src/table/model/moments";
import { applyEvents } from "../src/table/model/reduce";
import { emptyTable, seatFromParticipant, type TableState } from "../src/table/model/state";
import { Moment } from "../src/table/view/Moment";
import { Travel } from "../src/table/view/Travel";
import { eventually, mount, root } from "./mounted";
import { RECORDS, recorded } from "./record";
import { stateOf } from "./table-state";

type Kind = NonNullable<MessageInitShape<typeof GameEventSchema>["kind"]>;

const start = () => emptyTable((stateOf().room?.seats ?? []).map(seatFromParticipant));
const played = (table: TableState, ...kinds: Kind[]) =>
  applyEvents(
    table,
    kinds.map((kind, index) => create(GameEventSchema, { sequence: BigInt(table.nextSequence + index), kind })),
  );
const deal: Kind = { case: "shiftStarted", value: { shift: 1 } };
const play = (seat: number, face: number, quantity: number, cardsLeft: number): Kind => {
  return { case: "play", value: { seat, face, quantity, cardsLeft } };
};
const gift = (giver: number, receiver: number): Kind => {
  return { case: "cardsExchanged", value: { giver, receiver, count: 2 } };
};

afterEach(() => setPreference("moments", true));

test.each<[string, Kind[], string | undefined]>([
  ["the Golden card opens a Shift", [deal, play(1, 11, 2, 15)], "opening"],
  ["a later play", [deal, play(1, 11, 2, 15), play(2, 9, 2, 15)], "opening"],
  ["a last card", [deal, play(1, 11, 2, 15), play(2, 9, 2, 1)], "lastCard"],
  ["Dinner is Served", [deal, declared(SpecialAction.DINNER_IS_SERVED)], "dinner"],
  ["a Food Fight", [deal, declared(SpecialAction.FOOD_FIGHT)], "foodFight"],
  ["a deal", [deal], undefined],
  ["the first gift of an exchange", [deal, gift(3, 0)], "exchange"],
  ["the opening after an exchange", [deal, gift(3, 0), play(1, 11, 2, 15)], "opening"],
])("%s", (_, kinds, kind) => {
  expect(momentSince(played(start(), ...kinds), 0)?.kind).toBe(kind);
});

test("only the first gift of an exchange is a moment", () => {
  const begun = played(start(), deal, gift(3, 0));
  expect(momentSince(played(begun, gift(0, 3)), begun.nextSequence - 1)).toBeUndefined();
});

test("gifts travel until they have arrived, also when the next ones come meanwhile", async () => {
  vi.useFakeTimers({ toFake: ["setTimeout", "clearTimeout"] });
  const show = (table: TableState) => mount(<Travel table={table} own={0} dealt={false} />);
  const underWay = () => root.querySelectorAll('[data-part~="under-way"]').length;
  const later = (ms: number) => act(() => void vi.advanceTimersByTime(ms));
  let table = played(start(), deal);
  await show(table);
  table = played(table, gift(3, 0));
  await show(table);
  expect(underWay()).toBe(1);
  await later(1_000);
  await show(played(table, gift(0, 3)));
  expect(underWay()).toBe(2);
  await later(1_000);
  expect(underWay()).toBe(1);
  await later(1_000);
  expect(underWay()).toBe(0);
});

test("only events after a number count", () => {
  const table = played(start(), deal, play(1, 11, 2, 15));
  expect(momentSince(table, table.nextSequence - 1)).toBeUndefined();
});

test.each(RECORDS)("each Shift of %s has one opening at most", (name) => {
  let table = emptyTable();
  let shifts = 0;
  let openings = 0;
  for (const { line } of recorded(name)) {
    if (line.case !== "event") continue;
    const before = table.nextSequence - 1;
    table = applyEvents(table, [line.value]);
    if (line.value.kind.case === "shiftStarted") shifts += 1;
    if (momentSince(table, before)?.kind === "opening") openings += 1;
  }
  expect(openings).toBeLessThanOrEqual(shifts);
});

test("a moment is shown for a while; the past of a table is not", async () => {
  vi.useFakeTimers({ toFake: ["setTimeout", "clearTimeout"] });
  const dealt = played(start(), deal);
  const opened = played(dealt, play(1, 11, 2, 15));
  const show = (table: TableState) => mount(<Moment table={table} />);
  const shown = () => root.querySelector('[data-part~="moment"]')?.textContent;
  await show(opened);
  expect(shown()).toBeUndefined();
  await show(played(opened, play(2, 9, 2, 1)));
  expect(shown()).toContain("Cleo has one card left");
  await act(() => void vi.advanceTimersByTime(10_000));
  expect(shown()).toBeUndefined();
});

/** What is read out of a table. */
function Heard({ table }: { table: TableState }) {
  useAnnounced(table, undefined, undefined);
  return (
    <>
      <Moment table={table} />
      <Announcer />
    </>
  );
}

test.each([
  ["of a Shift when it ends", [shiftEnds()], /^Shift 1 is over, Ada finished first\. 1st Ada, 5 points\./],
  [
    "of the game once, if its last Shift ends it",
    [shiftEnds(), gameEnds()],
    /first\. The game is over\. Ada won\. 1st Ada/,
  ],
])("the points %s are read out", async (_, kinds, expected) => {
  const dealt = played(start(), deal);
  await mount(<Heard table={dealt} />);
  await mount(<Heard table={played(dealt, ...kinds)} />);
  const heard = () => root.querySelector('[role="status"]')?.textContent ?? "";
  await eventually(() => expect(heard()).toMatch(expected));
  expect(heard().match(/\d points?/g)).toEqual(["5 points", "3 points", "1 point", "0 points"]);
});

test("what a moment means is read out after who played", async () => {
  const dealt = played(start(), deal);
  await mount(<Heard table={dealt} />);
  await mount(<Heard table={played(dealt, play(1, 11, 2, 15))} />);
  const heard = () => root.querySelector('[role="status"]')?.textContent;
  await eventually(() => expect(heard()).toMatch(/^Bo plays .*\. It opens the Shift\.$/));
});

test("a last card is no longer announced once it has been played", async () => {
  const dealt = played(start(), deal, play(1, 11, 2, 15));
  const last = played(dealt, play(2, 9, 2, 1));
  const show = (table: TableState) => mount(<Moment table={table} />);
  for (const table of [dealt, last]) await show(table);
  expect(root.textContent).toContain("Cleo has one card left");
  await show(played(last, play(2, 8, 1, 0)));
  expect(root.textContent).toBe("");
});

test("moments can be switched off", async () => {
  setPreference("moments", false);
  const dealt = played(start(), deal);
  await mount(<Moment table={dealt} />);
  await mount(<Moment table={played(dealt, play(1, 11, 2, 15))} />);
  expect(root.querySelector('[data-part~="moment"]')).toBeNull();
});

function shiftEnds(): Kind {
  const points = [5n, 3n, 1n, 0n];
  return { case: "shiftEnded", value: { shift: 1, order: [0, 1, 2, 3], shiftPoints: points.map(Number), points } };
}

function gameEnds(): Kind {
  const standings = [5n, 3n, 1n, 0n].map((points, seat) => ({ seat, points, place: seat + 1 }));
  return { case: "gameEnded", value: { standings } };
}

function declared(action: SpecialAction): Kind {
  return { case: "specialActionDeclared", value: { seat: 1, action } };
}
