// The table of a physical room as its remote players and spectators see it.

import { expect, test } from "vitest";
import { tableOf } from "../src/attend/words";
import { Role } from "../src/gen/chefshat/v1/rules_pb";
import { ViolatedRule } from "../src/gen/chefshat/v1/table_pb";
import type { TableState } from "../src/table/model/state";
import { TableView } from "../src/table/view/TableView";
import { mount, root } from "./mounted";
import { DEALT, stateOf } from "./table-state";

const REMOTE = 2;

const show = (table: TableState, own: number | undefined, replayed = false) =>
  mount(<TableView table={table} own={own} replayed={replayed} />);
const dealt = (): TableState => ({ ...tableOf(stateOf({ observation: DEALT })), phase: "dealt", next: undefined });
const heading = () => root.querySelector('[data-part~="now-heading"]')?.textContent;
const banner = () => root.querySelector('[data-part~="table-banner"]')?.textContent;

test("a remote player reads why there are no cards yet", async () => {
  await show(dealt(), REMOTE);
  expect(heading()).toBe("Your cards are on their way");
  expect(root.querySelector('[data-part~="own-cards"]')?.textContent).toContain("The attendant shows your cards");
});

test("others do not, nor the player once the hand is known", async () => {
  await show(dealt(), undefined);
  expect(heading()).toBe("The cards have been dealt");
  const known = dealt();
  const seats = known.seats.map((seat) =>
    seat.seat === REMOTE ? { ...seat, hand: [{ kind: "joker" as const }] } : seat,
  );
  await show({ ...known, seats }, REMOTE);
  expect(heading()).toBe("The cards have been dealt");
});

test("a replay says that a hand is not known", async () => {
  await show(dealt(), REMOTE, true);
  expect(root.querySelector('[data-part~="own-cards"]')?.textContent).toContain("This hand is not known.");
});

test("a pause and a violation are shown above the table", async () => {
  await show(dealt(), REMOTE);
  expect(banner()).toBe("");
  const breach = { seat: 1, rule: ViolatedRule.SIZE, text: "That pizza has 3 cards." };
  const demand = { highestFace: 8, fewestCards: 3, onBoard: true, opening: false, goldenCard: false, next: 0 };
  await show({ ...dealt(), paused: true, violation: { kind: "violated", breach, demand } }, REMOTE);
  expect(banner()).toContain("The game is paused at the table.");
  expect(banner()).toContain("Bo: That pizza has 3 cards.");
});

test("after the game a seat shows its place in the game, not the role of the last Shift", async () => {
  const known = dealt();
  const seats = known.seats.map((seat) => ({ ...seat, role: Role.CHEF, place: 4 - seat.seat }));
  const states = () => [...root.querySelectorAll('[data-part~="seat"]')].map(({ textContent }) => textContent ?? "");
  await show({ ...known, phase: "shiftOver", seats }, undefined);
  expect(states().every((text) => text.includes("Chef"))).toBe(true);
  const standings = known.seats.map(({ seat }) => ({ seat, points: 0, place: seat + 1 }));
  await show({ ...known, phase: "gameOver", seats, standings }, undefined);
  expect(states().some((text) => text.includes("Chef"))).toBe(false);
  expect(states().filter((text) => text.includes("1st"))).toEqual([expect.stringContaining("Ada")]);
});
