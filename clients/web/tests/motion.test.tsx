// Cards that are dealt, laid and swept: what moves when, and that nothing of it stays.

import { create, type MessageInitShape } from "@bufbuild/protobuf";
import { act } from "preact/test-utils";
import { beforeEach, expect, test, vi } from "vitest";
import { GameEventSchema } from "../src/gen/chefshat/v1/event_pb";
import { applyEvents } from "../src/table/model/reduce";
import { emptyTable, seatFromParticipant, type TableState } from "../src/table/model/state";
import { useDealt } from "../src/table/view/arrivals";
import { Board } from "../src/table/view/Board";
import { Travel } from "../src/table/view/Travel";
import { mount, root } from "./mounted";
import { stateOf } from "./table-state";

type Kind = NonNullable<MessageInitShape<typeof GameEventSchema>["kind"]>;

function Table({ table }: { table: TableState }) {
  return (
    <>
      <Board table={table} />
      <Travel table={table} own={0} dealt={useDealt(table)} />
    </>
  );
}

let table: TableState;
const happens = (...kinds: Kind[]) => {
  const events = kinds.map((kind, index) =>
    create(GameEventSchema, { sequence: BigInt(table.nextSequence + index), kind }),
  );
  table = applyEvents(table, events);
  return mount(<Table table={table} />);
};
const later = (ms: number) => act(() => void vi.advanceTimersByTime(ms));
const count = (part: string) => root.querySelectorAll(`[data-part~="${part}"]`).length;
const deal: Kind = { case: "shiftStarted", value: { shift: 1 } };
const play = (seat: number, face: number): Kind => {
  return { case: "play", value: { seat, face, quantity: 2, cardsLeft: 9 } };
};
const pass = (seat: number): Kind => ({ case: "pass", value: { seat } });

beforeEach(async () => {
  vi.useFakeTimers({ toFake: ["setTimeout", "clearTimeout"] });
  table = emptyTable((stateOf().room?.seats ?? []).map(seatFromParticipant));
  await mount(<Table table={table} />);
});

test("a deal goes to every seat but the reader's, whose hand shows it, and arrives", async () => {
  await happens(deal);
  expect(count("under-way")).toBe(table.seats.length - 1);
  await later(2_000);
  expect(count("under-way")).toBe(0);
});

test("cards are laid once, not again when somebody passes", async () => {
  await happens(deal, play(1, 11));
  const first = root.querySelector('[data-part~="board"] [data-part~="card"]');
  expect(first).not.toBeNull();
  await happens(pass(2));
  expect(root.querySelector('[data-part~="board"] [data-part~="card"]')).toBe(first);
  await happens(play(3, 9));
  expect(root.contains(first)).toBe(false);
});

test("the last cards of a pizza are swept off the board", async () => {
  await happens(deal, play(1, 11));
  await happens(pass(2), { case: "pizzaDone", value: { pizza: 1, nextLeader: 1 } });
  expect(table.board).toEqual([]);
  expect(root.querySelectorAll('[data-part~="swept"] [data-part~="card"]').length).toBe(2);
  await later(2_000);
  expect(count("swept")).toBe(0);
  expect(root.querySelectorAll('[data-part~="board"] [data-part~="card"]').length).toBe(0);
});

test("a reader who catches up sees no past cards on their way", async () => {
  const catchingUp = Array.from({ length: 20 }, () => pass(2));
  await happens(deal, play(1, 11), ...catchingUp, { case: "pizzaDone", value: { pizza: 1, nextLeader: 1 } });
  expect(count("swept") + count("under-way")).toBe(0);
});
