// People at a table: complete Shifts with the mouse and with the keyboard alone, through a reload
// and a server crash, and two people with two agents in one room.

import type { Page } from "playwright-core";
import { expect, test } from "vitest";
import { byClicks, byKeys, focus, HAND, hearing, nextDecision, playOn, sitDown, tabTo } from "./play";
import { agent, gameOf, newRoom, recordOf } from "./rooms";
import { browser, person, server, startBrowser, useStage } from "./stage";
import { Tap } from "./tap";

const OPPONENTS = ["greedy", "random", "greedy"];

useStage();

test("a person plays a complete Shift by clicking, and continues after a reload", async () => {
  const { roomId, code } = await newRoom(server, { seats: ["person", ...OPPONENTS], faces: 5 });
  const { page, faults } = await person(browser);
  await sitDown(page, server, code, "Rosa");
  let reloads = 0;
  const taken = await playOn(page, byClicks, async (already) => {
    if (already === 0) await expectTimeInForcedColours(page);
    if (already !== 3) return;
    const before = await seen(page);
    await page.reload();
    await page.locator("[data-decision]").waitFor();
    expect(await seen(page)).toEqual(before);
    reloads += 1;
  });
  expect(reloads).toBe(1);
  await expectEnd(page, roomId, taken);
  expect(faults).toEqual([]);
});

test("a play that is pressed while the network is gone arrives when it is back", async () => {
  const { code } = await newRoom(server, { seats: ["person", ...OPPONENTS], faces: 5 });
  const tap = await Tap.before(server);
  const { page } = await person(browser);
  await sitDown(page, tap, code, "Rosa");
  const decision = await nextDecision(page);
  tap.fallSilent();
  await page.getByText("Connection lost. Reconnecting…").waitFor();
  await byClicks(page);
  await page.getByText("Sending…").waitFor();
  tap.recover();
  await nextDecision(page, decision);
  await page.getByText("Connection lost. Reconnecting…").waitFor({ state: "detached" });
  await page.close();
  await tap.stop();
});

test("a server that has been updated says so, never over a decision, and a new page has the same one", async () => {
  const { code } = await newRoom(server, { seats: ["person", ...OPPONENTS], faces: 5 });
  const { page } = await person(browser);
  await sitDown(page, server, code, "Rosa");
  const decision = await nextDecision(page);
  const lobby = await page.context().newPage();
  await lobby.goto(server.url);
  await lobby.locator('[data-part~="quick"]').waitFor();
  const next = (await (await fetch(server.url)).text()).replace(/index-[^"]+\.js/, "index-next.js");
  await page.context().route(`${server.url}/`, (route) => route.fulfill({ body: next, contentType: "text/html" }));
  await server.restart();

  const settings = page.locator('[data-part~="header-settings"][data-outdated]');
  await settings.waitFor();
  expect(await page.locator('[data-part~="update"]').isVisible()).toBe(false);
  await settings.click();
  await Promise.all([page.waitForEvent("load"), page.getByRole("button", { name: "Load the new version" }).click()]);
  expect(await nextDecision(page)).toBe(decision);

  // Its calls may all have been before or after the restart.
  await lobby.evaluate(() => document.dispatchEvent(new Event("visibilitychange")));
  const notice = lobby.locator('[data-part~="update"]');
  await notice.getByText("The server has been updated").waitFor();
  await notice.getByRole("button", { name: "Close" }).click();
  await notice.waitFor({ state: "detached" });
});

test("a person plays a complete game with the keyboard alone, and hears all that happens in its order", async () => {
  const names = ["Rosa", "greedy", "random", "trained"];
  const { roomId, code } = await newRoom(server, { seats: ["person", ...names.slice(1)], faces: 5, shifts: 2 });
  const { page, faults } = await person(browser);
  const heard = await hearing(page);
  await page.goto(`${server.url}/join/${code}`);
  await page.getByLabel("Your name").waitFor();
  await tabTo(page, (on) => on.label.startsWith("Your name"));
  await page.keyboard.type("Rosa");
  await page.keyboard.press("Enter");
  const taken = await playOn(page, byKeys, async (already) => {
    // From the second decision on, the focus is in the hand or on the buttons, never at the top of
    // the page.
    if (already > 0) await expect.poll(async () => (await focus(page)).label).not.toBe("");
  });
  await expectEnd(page, roomId, taken);
  await expect.poll(() => heard.join(" ").match(/Your turn\./g)?.length).toBe(taken);
  await expect.poll(() => heard.join(" ")).toMatch(/The game is over\. .+ won\. 1st .+, \d+ points?\. 2nd /);
  const record = await recordOf(server, await gameOf(server, roomId));
  const happened = record.flatMap(({ line }) => {
    const { case: kind, value } = line.case === "event" ? line.value.kind : { case: undefined, value: undefined };
    if (kind === "play") return [`${names[value.seat]} plays`];
    if (kind === "pass") return [`${names[value.seat]} passes`];
    if (kind === "seatFinished") return [`${names[value.seat]} finishes`];
    if (kind === "cardsExchanged") return [`${names[value.giver]} gives`];
    if (kind === "pizzaDone") return [`Pizza ${value.pizza} is done`];
    if (kind === "shiftEnded") return [`Shift ${value.shift} is over`];
    return [];
  });
  const words = `(${names.join("|")}) (plays|passes|finishes|gives)|Pizza \\d+ is done|Shift \\d is over`;
  const said = heard.join(" ").match(new RegExp(words, "g")) ?? [];
  // What happened while the page loaded is seen, not heard.
  const fromOwnTurn = (all: string[]) => all.slice(all.findIndex((what) => what.startsWith("Rosa ")));
  expect(fromOwnTurn(said)).toEqual(fromOwnTurn(happened));
  expect(heard.join(" ")).toMatch(/Rosa: .+\. greedy: .+\. random: .+\. trained: /);
  // The focus is on the result, from where the next step is a few keys away.
  await expect.poll(async () => (await focus(page)).label).toMatch(/ won|You won/);
  await tabTo(page, (on) => on.label === "Watch the replay");
  await page.keyboard.press("Enter");
  await page.waitForURL(/\/replay\//);
  expect(faults).toEqual([]);
});

test("Food Fight and both gifts of the Chef are decided by keyboard, and no card is given that was not chosen", async () => {
  const { roomId, code } = await newRoom(server, {
    seats: ["person", ...OPPONENTS],
    faces: 7,
    shifts: 2,
    hands: [
      [8, 8, 4, 5, 6, 7, 7],
      [1, 2, 2, 5, 5, 6, 7],
      [3, 3, 4, 5, 6, 6, 7],
      [3, 4, 4, 5, 6, 7, 7],
    ],
  });
  const { page, faults } = await person(browser);
  await sitDown(page, server, code, "Rosa");
  const picked = page.locator('[data-part~="hand-card"][aria-pressed="true"]');
  const inNoCard = async () => {
    await expect.poll(() => focus(page)).toMatchObject({ label: HAND, card: "" });
    for (const key of ["Enter", "Space", "Enter"]) await page.keyboard.press(key);
    expect(await picked.count()).toBe(0);
  };

  await page.locator('[data-action="declare"]').waitFor();
  await tabTo(page, (on) => on.action === "declare");
  await page.keyboard.press("Enter");

  await page.getByRole("heading", { name: "You give card 1 of 2" }).waitFor();
  const first = await nextDecision(page);
  await inNoCard();
  await page.keyboard.press("ArrowRight");
  expect((await focus(page)).card).toBe("4");
  await page.keyboard.press("Space");
  await page.keyboard.press("Enter");

  await page.getByRole("heading", { name: "You give card 2 of 2" }).waitFor();
  const second = await nextDecision(page, first);
  await inNoCard();
  // The arrow key starts at the position of the card just given.
  await page.keyboard.press("ArrowRight");
  expect((await focus(page)).card).toBe("5");
  await page.keyboard.press("Enter");
  expect((await focus(page)).pressed).toBe(true);
  await page.keyboard.press("Enter");

  const turn = await nextDecision(page, second);
  expect(turn).toBeDefined();
  await expect.poll(async () => (await focus(page)).label).toBe(HAND);
  const taken = await playOn(page, byKeys, async () => {
    await expect.poll(async () => (await focus(page)).label).not.toBe("");
  });
  await expectEnd(page, roomId, 3 + taken);
  const record = await recordOf(server, await gameOf(server, roomId));
  const gave = record.flatMap(({ line }) =>
    line.case === "event" && line.value.kind.case === "cardsExchanged" && line.value.kind.value.giver === 0
      ? [[...line.value.kind.value.cards]]
      : [],
  );
  expect(gave).toEqual([[4, 5]]);
  expect(faults).toEqual([]);
});

test("a game resumes after a server crash", async () => {
  const { roomId, code } = await newRoom(server, { seats: ["person", ...OPPONENTS], faces: 5 });
  const { page } = await person(browser);
  await sitDown(page, server, code, "Rosa");
  let restarts = 0;
  const taken = await playOn(page, byClicks, async (already) => {
    if (already !== 2) return;
    const before = await seen(page);
    await server.restart();
    // It is a line of the log and, until the next one, of what is read out.
    await page.getByText("The server restarted; the game continues").first().waitFor();
    await page.locator("[data-decision]").waitFor();
    expect((await seen(page)).hand).toEqual(before.hand);
    restarts += 1;
  });
  expect(restarts).toBe(1);
  await expectEnd(page, roomId, taken);
});

test("two people in two browsers and two agents play in one room to its end", async () => {
  const { roomId, code } = await newRoom(server, { seats: ["person", "agent", "person", "agent"], faces: 5 });
  const other = await startBrowser();
  try {
    const rosa = await person(browser);
    const karl = await person(other, { viewport: { width: 390, height: 844 } });
    await sitDown(rosa.page, server, code, "Rosa");
    await sitDown(karl.page, server, code, "Karl");
    const agents = Promise.all([agent(server, "greedy", code, "Gustav"), agent(server, "random", code, "Rolf")]);
    const taken = await Promise.all([playOn(rosa.page, byClicks), playOn(karl.page, byClicks)]);
    expect(await agents).toEqual([0, 0]);
    const standings = (page: Page) => page.locator('[data-part~="result"] tbody tr').allInnerTexts();
    const [seen, seenByKarl] = [await standings(rosa.page), await standings(karl.page)];
    expect(seen).toHaveLength(4);
    // Each has a word at the reader's own line.
    const plain = (lines: string[], name: string) => lines.map((line) => line.replace(`${name} (you)`, name));
    expect(seen).not.toEqual(plain(seen, "Rosa"));
    expect(plain(seenByKarl, "Karl")).toEqual(plain(seen, "Rosa"));
    await expectEnd(rosa.page, roomId, taken[0]);
    expect([...rosa.faults, ...karl.faults]).toEqual([]);
  } finally {
    await other.close();
  }
});

/** The open decision as the page shows it, and what led to it. */
async function seen(page: Page): Promise<Record<"decision" | "hand" | "heading" | "points", unknown>> {
  return {
    decision: await page.locator("[data-decision]").getAttribute("data-decision"),
    hand: await page
      .locator('[data-part~="hand-card"]')
      .evaluateAll((cards) => cards.map((card) => card.getAttribute("aria-label"))),
    heading: await page.getByRole("heading", { level: 1 }).textContent(),
    points: await page.locator('[data-part~="seat-points"]').allInnerTexts(),
  };
}

/** The game is over, and its record has every decision as the person's own. */
async function expectEnd(page: Page, roomId: string, taken: number): Promise<void> {
  await page.getByRole("heading", { name: "The game is over", level: 1 }).waitFor();
  const record = await recordOf(server, await gameOf(server, roomId));
  const decisions = record.flatMap(({ line }) =>
    line.case === "decision" && line.value.seat === 0 ? [line.value] : [],
  );
  expect(decisions).toHaveLength(taken);
  expect(taken).toBeGreaterThan(2);
  expect(decisions.every(({ source, invalidAttempts }) => source === 1 && invalidAttempts.length === 0)).toBe(true);
}

/** Expects that the bar of the time differs from its ground, also where the system chooses the colours. */
async function expectTimeInForcedColours(page: Page): Promise<void> {
  await page.emulateMedia({ forcedColors: "active" });
  const colours = await page
    .locator('[data-part~="clock"] [aria-hidden]')
    .evaluate((bar) => [bar, bar.firstElementChild ?? bar].map((part) => getComputedStyle(part).backgroundColor));
  expect(new Set(colours).size).toBe(2);
  await page.emulateMedia({ forcedColors: "none" });
}
