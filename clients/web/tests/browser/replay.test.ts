// A replay in a browser shows what the record contains.

import type { Page } from "playwright-core";
import { beforeAll, expect, test } from "vitest";
import type { DecisionRecord, RecordLine } from "../../src/gen/chefshat/v1/record_pb";
import { legalActions } from "../../src/table/model/actions";
import { agent, gameOf, newRoom, recordOf } from "./rooms";
import { browser, person, server, useStage } from "./stage";

let gameId: string;
let lines: RecordLine[];

useStage();

beforeAll(async () => {
  const { roomId, code } = await newRoom(server, { seats: ["agent", "greedy", "random", "greedy"], shifts: 2 });
  expect(await agent(server, "greedy", code, "Gustav")).toBe(0);
  gameId = await gameOf(server, roomId);
  lines = await recordOf(server, gameId);
});

test("scrubbing shows the recorded hands and decision", async () => {
  const { page, faults } = await person(browser);
  await page.goto(`${server.url}/replay/${gameId}`);
  const slider = page.getByLabel("Position in the game");
  const all = lines.filter(({ line }) => line.case === "decision").length;
  await expect.poll(() => slider.getAttribute("aria-valuetext")).toBe(`0 of ${all} decisions taken`);
  const possible = page.locator('[data-part~="replay-decision"]');
  await possible.locator("summary").click();
  const last = Number(await slider.getAttribute("max"));
  for (const share of [0.1, 0.35, 0.6, 0.85]) {
    await slider.fill(String(Math.round(share * last)));
    // From the end of a pizza or Shift to the next decision.
    while ((await possible.count()) === 0) await page.getByRole("button", { name: "One step forward" }).click();
    const taken = Number((await slider.getAttribute("aria-valuetext"))?.split(" ")[0]);
    const { hands, decision } = before(taken + 1);
    expect(await shownHands(page)).toEqual(hands);
    const name = ["Gustav", "greedy", "random", "greedy"][decision.seat] ?? "";
    expect(await possible.locator("summary").textContent()).toContain(name);
    if (decision.text.startsWith("C")) {
      await possible.getByText(`${legalActions(decision.actionMask).length} legal action`).waitFor();
    }
  }
  await page.getByLabel("Cards shown").selectOption({ label: "as a spectator" });
  await expect.poll(() => shownHands(page)).toEqual([[], [], [], []]);
  await page.getByRole("button", { name: "To the end" }).click();
  await page.getByRole("heading", { name: "The game is over", level: 1 }).waitFor();
  expect(faults).toEqual([]);
});

test("an address with a decision starts the replay there", async () => {
  const { page } = await person(browser);
  await page.goto(`${server.url}/replay/${gameId}?decision=12`);
  const slider = page.getByLabel("Position in the game");
  await expect.poll(() => slider.getAttribute("aria-valuetext")).toMatch(/^11 of /);
  await page.getByLabel("Speed").selectOption({ label: "× 8" });
  await page.getByRole("button", { name: "Play", exact: true }).click();
  const taken = async () => Number.parseInt((await slider.getAttribute("aria-valuetext")) ?? "", 10);
  await expect.poll(taken).toBeGreaterThanOrEqual(14);
});

test("the analysis of a moment shows what its actions were worth, and follows to the next one", async () => {
  const { page, faults } = await person(browser);
  await page.goto(`${server.url}/replay/${gameId}?decision=12`);
  const analysis = page.locator('[data-part~="replay-analysis"]');
  const position = page.getByLabel("Position in the game");
  const taken = async () => Number((await position.getAttribute("aria-valuetext"))?.split(" ")[0]);
  await expect.poll(taken).toBe(11);
  // Beyond the end of a pizza.
  const stepTo = async (decisions: number) => {
    while ((await taken()) < decisions || (await analysis.count()) === 0) {
      await page.getByRole("button", { name: "One step forward" }).click();
    }
  };
  await analysis.locator("summary").click();
  for (const number of [12, 13, 14]) {
    const { hands, decision } = before(number);
    const legal = legalActions(decision.actionMask);
    // The estimates so far are those of all actions; the last ones say that no better ones follow.
    await analysis.locator('[data-state="done"]').waitFor();
    const rows = analysis.locator('[data-part~="estimate"]');
    expect(await rows.count()).toBeGreaterThanOrEqual(Math.min(8, legal.length));
    expect(await rows.count()).toBeLessThanOrEqual(Math.min(9, legal.length));
    expect(await analysis.locator('[data-best="true"]').count()).toBe(1);
    expect(await rows.first().getAttribute("data-best")).toBe("true");
    expect(await analysis.locator('[data-taken="true"]').count()).toBe(1);
    expect(await rows.first().textContent()).toMatch(/\d\.\d\d ± \d\.\d\d/);
    // The seat knows its own hand.
    const own = analysis.locator('[data-part~="likely-hands"] tbody tr').nth(decision.seat);
    const counts = Array.from(
      { length: JOKER },
      (_, kind) => hands[decision.seat]?.filter((card) => card === kind + 1).length,
    );
    expect(await own.locator("td").allTextContents()).toEqual(counts.map((count) => count?.toFixed(1)));
    // Stepping on leaves the analysis open, for the next decision.
    await stepTo(number);
  }
  await page.getByLabel("Cards shown").selectOption({ label: "as a spectator" });
  await expect.poll(() => analysis.count()).toBe(0);
  expect(faults).toEqual([]);
});

/** The sorted hands when a decision is open, and the decision, from the record. */
function before(number: number): { hands: number[][]; decision: DecisionRecord } {
  let hands: number[][] = [];
  let decisions = 0;
  const take = (seat: number, face: number) => hands[seat]?.splice(hands[seat].indexOf(face), 1);
  for (const { line } of lines) {
    if (line.case === "decision") {
      decisions += 1;
      if (decisions === number) {
        for (const hand of hands) hand.sort((a, b) => a - b);
        return { hands, decision: line.value };
      }
    }
    if (line.case !== "event") continue;
    const { kind } = line.value;
    if (kind.case === "shiftStarted") hands = kind.value.hands.map(({ cards }) => [...cards]);
    if (kind.case === "cardsExchanged") {
      const { giver, receiver, cards } = kind.value;
      for (const face of cards) {
        take(giver, face);
        hands[receiver]?.push(face);
      }
    }
    if (kind.case === "play") {
      const { seat, face, quantity, jokers } = kind.value;
      for (let card = 0; card < quantity; card += 1) take(seat, face);
      for (let card = 0; card < jokers; card += 1) take(seat, JOKER);
    }
  }
  throw new Error(`the record has no decision ${number}`);
}

/** A joker in a record: one more than the number of faces. */
const JOKER = 12;

/** The open hands on the page, by seat, as a screen reader hears them. */
async function shownHands(page: Page): Promise<number[][]> {
  const seats = page.locator("[data-seat]");
  const shown: number[][] = [];
  for (const seat of await seats.all()) {
    const spoken = seat.locator('[data-part~="seat-cards"] .visually-hidden');
    const words = (await spoken.count()) > 0 ? ((await spoken.textContent()) ?? "") : "";
    const faces = words.split("; ").filter((word) => word !== "");
    shown[Number(await seat.getAttribute("data-seat"))] = faces.map((word) =>
      word === "joker" ? JOKER : Number(/\d+/.exec(word)?.[0]),
    );
  }
  return shown;
}
