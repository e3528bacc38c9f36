// Choosing a play before the turn: it is sent on the turn, unless it has become illegal; and passing
// by itself.

import { signal } from "@preact/signals";
import { act } from "preact/test-utils";
import { beforeEach, expect, test, vi } from "vitest";
import type { Acting } from "../src/table/acting";
import { passDelayMs, useAutoPass } from "../src/table/auto-pass";
import { actionOf, type Move } from "../src/table/model/actions";
import { cardsFromNumbers, playedCards } from "../src/table/model/cards";
import { type OpenDecision, startLive } from "../src/table/model/live";
import { emptyTable, seatFromParticipant, type TableState } from "../src/table/model/state";
import { TableView } from "../src/table/view/TableView";
import { mount, root } from "./mounted";
import { decisionOf, SEATS, stateOf } from "./table-state";

const FACES = 11;
const OWN = 0;
const HAND = cardsFromNumbers([3, 8, 8, 9, 9], false, FACES);
const EIGHTS: Move = { kind: "play", face: 8, quantity: 2, jokers: 0 };
const PASS: Move = { kind: "pass" };
const action = (move: Move) => actionOf(move, FACES);

beforeEach(() => vi.useFakeTimers({ toFake: ["setTimeout", "clearTimeout"] }));

/** Others decide while 9s lie on the board. */
function table(changed: Partial<TableState> = {}): TableState {
  const seats = (stateOf().room?.seats ?? []).map((seat) => ({
    ...seatFromParticipant(seat),
    cardsLeft: 5,
    hand: seat.seat === OWN ? HAND : undefined,
  }));
  expect(seats).toHaveLength(SEATS.length);
  const board = playedCards(9, 2, 0, false);
  return { ...emptyTable(seats), phase: "pizza", shift: 1, pizza: 1, turn: 5, board, boardBy: 1, next: 2, ...changed };
}

const turn = (...moves: Move[]) => decisionOf(HAND, moves.map(action));

let answers: [number, string | undefined][] = [];
const show = (table: TableState, decision?: OpenDecision, plans = true) => {
  const onAnswer = (action: number, automatic?: string) => answers.push([action, automatic]);
  return mount(<TableView {...{ table, decision, plans, onAnswer }} own={OWN} untimed />);
};
const button = (id: string) => root.querySelector<HTMLButtonElement>(`[data-action="${id}"]`);
const click = (id: string) => act(() => button(id)?.click());
const pick = (face: number) => act(() => root.querySelector<HTMLElement>(`[data-card="${face}"]`)?.click());
const press = (key: string) =>
  act(() => void document.dispatchEvent(new KeyboardEvent("keydown", { key, bubbles: true })));
const note = () => root.querySelector('[role="note"]')?.textContent;
const wait = () => act(() => void vi.advanceTimersByTime(60_000));

beforeEach(() => {
  answers = [];
});

test("a chosen play is sent on the turn", async () => {
  await show(table());
  await pick(8);
  expect(button("plan-play")?.textContent).toBe("Then: two 8s");
  await click("plan-play");
  await wait();
  expect(answers).toEqual([]);
  expect(note()).toBe("Chosen for your turn: two 8s");
  await show(table(), turn(EIGHTS, PASS));
  await wait();
  expect(answers).toEqual([[action(EIGHTS), "planned"]]);
});

test("it can be taken back until it is sent", async () => {
  await show(table());
  await pick(8);
  await click("plan-play");
  await show(table(), turn(EIGHTS, PASS));
  await click("unplan");
  await wait();
  expect(answers).toEqual([]);
  // The cards stay picked.
  await click("play");
  expect(answers).toEqual([[action(EIGHTS), undefined]]);
});

test.each([
  ["other cards are picked", () => pick(3)],
  ["its cards are put back", () => press("Backspace")],
])("when %s, the former play is not sent", async (_, change) => {
  const three: Move = { kind: "play", face: 3, quantity: 1, jokers: 0 };
  await show(table({ board: playedCards(9, 1, 0, false) }));
  await pick(8);
  await click("plan-play");
  expect(button("unplan")).not.toBeNull();
  await change();
  expect(button("unplan")).toBeNull();
  const eight: Move = { kind: "play", face: 8, quantity: 1, jokers: 0 };
  await show(table({ board: playedCards(9, 1, 0, false) }), turn(eight, three, PASS));
  await wait();
  expect(answers).toEqual([]);
});

test.each([
  ["pass", [PASS]],
  ["play", [EIGHTS, PASS]],
])("the main button is %s where what is legal is %j", async (main, legal) => {
  await show(table({ next: OWN }), turn(...legal));
  expect(button(main)?.dataset.look).toBe("main");
  expect(root.querySelectorAll('[data-look="main"]')).toHaveLength(1);
});

test.each([
  ["the board rises above it", { board: playedCards(7, 2, 0, false) }],
  ["the pizza is done", { pizza: 2, board: [] }],
])("it is dropped when %s", async (_, changed) => {
  await show(table());
  await pick(8);
  await click("plan-play");
  await show(table(changed));
  expect(note()).toBe("Not possible any more: two 8s. Choose again.");
  await show(table(changed), turn(EIGHTS, PASS));
  await wait();
  expect(answers).toEqual([]);
});

test.each([
  ["stay picked in the same pizza", {}, true],
  ["do not stay picked when the next pizza is opened", { pizza: 2, board: [] }, false],
  ["do not stay picked in the next Shift", { shift: 2, board: [] }, false],
])("cards that were picked before the turn %s", async (_, changed, played) => {
  await show(table());
  await pick(8);
  await show(table({ ...changed, next: OWN }), turn(EIGHTS, PASS));
  await press("Enter");
  expect(answers).toEqual(played ? [[action(EIGHTS), undefined]] : []);
});

test("cards that were picked before the turn do not stay picked while others open the next pizza", async () => {
  await show(table());
  await pick(8);
  await show(table({ pizza: 2, board: [] }));
  expect(root.querySelectorAll('[data-part~="hand-card"][aria-pressed="true"]')).toHaveLength(0);
});

test("a pass is planned too, and cards that do not beat the board are refused", async () => {
  await show(table());
  await pick(9);
  expect(note()).toBe("9 does not beat 9: play a lower number.");
  await click("plan-pass");
  await show(table(), turn(EIGHTS, PASS));
  await wait();
  expect(answers).toEqual([[action(PASS), "planned"]]);
});

test.each([
  ["without the preference, or in a study", {}, false],
  ["with real cards", { physical: true }, true],
  ["while the own play is on its way", { next: OWN }, true],
])("nothing is chosen before the turn %s", async (_, changed, plans) => {
  await show(table(changed), undefined, plans);
  expect(button("plan-pass")).toBeNull();
  await pick(8);
  expect(note()).toBe("It is not your turn.");
});

test.each([
  ["nothing but a pass is legal", [PASS], true, [[action(PASS), "auto_pass"]]],
  ["something can be played", [EIGHTS, PASS], true, []],
  ["it is switched off", [PASS], false, []],
])("when %s, the page passes by itself or does not", async (_, moves, on, expected) => {
  const live = signal({ ...startLive(table(), OWN), decision: turn(...moves) });
  const answer = (action: number, automatic?: string) => answers.push([action, automatic]);
  const acting = { live, answer } as unknown as Acting;
  const AutoPass = () => <>{String(useAutoPass(acting, on))}</>;
  await mount(<AutoPass />);
  expect(root.textContent).toBe(String(expected.length > 0));
  await act(() => void vi.advanceTimersByTime(1000));
  expect(answers).toEqual([]);
  await wait();
  expect(answers).toEqual(expected);
});

test("a pass by itself takes as long as one of the person's decisions, within bounds", () => {
  expect(passDelayMs([], 0, 0)).toBe(2000);
  expect(passDelayMs([], 0, 1)).toBe(5500);
  const own = [100, 3000, 60_000];
  expect([0, 0.5, 0.99].map((random) => passDelayMs(own, 0, random))).toEqual([1500, 3000, 9000]);
  // Never more than a third of the time that is left.
  expect(passDelayMs(own, 6000, 0.99)).toBe(2000);
});
