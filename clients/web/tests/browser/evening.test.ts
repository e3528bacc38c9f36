// What makes an evening pleasant: a Shift with few keys, a play chosen before the turn, phrases in
// everybody's language, an installed page.

import type { Page } from "playwright-core";
import { expect, test } from "vitest";
import { byCardKeys, byClicks, hearing, nextDecision, playOn, sitDown } from "./play";
import { gameOf, newRoom, recordOf } from "./rooms";
import { browser, person, server, until, useStage } from "./stage";

/** Most keys of a decision. */
const MOST_KEYS = 3;

useStage();

test("a whole game by the keys of cards takes at most three keys per decision", async () => {
  const { code } = await newRoom(server, { seats: ["person", "greedy", "random", "greedy"], faces: 6, shifts: 2 });
  const { page, faults } = await person(browser);
  await sitDown(page, server, code, "Rosa");
  const keys: number[] = [];
  const taken = await playOn(page, async () => {
    keys.push(await byCardKeys(page));
  });
  expect(taken).toBeGreaterThan(5);
  expect(keys).toHaveLength(taken);
  expect(keys[0]).toBeLessThanOrEqual(MOST_KEYS);
  expect(Math.max(...keys)).toBeLessThanOrEqual(MOST_KEYS);
  expect(faults).toEqual([]);
});

test("d declares a Food Fight, and the gifts of the new Chef take two keys each", async () => {
  const { code } = await newRoom(server, {
    seats: ["person", "greedy", "random", "greedy"],
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
  const heard = await hearing(page);
  await sitDown(page, server, code, "Rosa");
  const special = await nextDecision(page);
  await page.keyboard.press("d");
  await expect.poll(() => heard.join(" ")).toContain("All roles are reversed for this Shift");
  const first = await nextDecision(page, special);
  expect(await page.locator('[data-action="give"]').count()).toBe(1);
  expect(await byCardKeys(page)).toBe(2);
  const second = await nextDecision(page, first);
  expect(await page.locator('[data-action="give"]').count()).toBe(1);
  expect(await byCardKeys(page)).toBe(2);
  for (let id = await nextDecision(page, second); id !== undefined; id = await nextDecision(page, id))
    expect(await byCardKeys(page)).toBeLessThanOrEqual(MOST_KEYS);
  expect(faults).toEqual([]);
});

test("a pass that is chosen before the turn is sent on it, and the record says so", async () => {
  const { roomId, code } = await newRoom(server, { seats: ["person", "person", "random", "random"], faces: 5 });
  const [rosa, karl] = [await person(browser), await person(browser)];
  await sitDown(rosa.page, server, code, "Rosa");
  await sitDown(karl.page, server, code, "Karl");
  const plan = karl.page.locator('[data-action="plan-pass"]');
  const open = (page: Page) =>
    page.evaluate(() => document.querySelector<HTMLElement>("[data-decision]")?.dataset.decision);
  let planned = false;
  while (!planned) {
    await until(async () => Boolean((await open(rosa.page)) ?? (await open(karl.page))));
    const { page } = (await open(rosa.page)) ? rosa : karl;
    const id = await open(page);
    // If Rosa plays, the pizza lasts until Karl's turn.
    const canPlay = (await page.locator('[data-part~="hand-card"][aria-disabled="false"]').count()) > 0;
    if (page === rosa.page && canPlay && (await plan.isVisible())) {
      await plan.click();
      await karl.page.locator('[data-part~="actions"]').getByText("Chosen for your turn: Pass").waitFor();
      planned = true;
    }
    await byClicks(page);
    await until(async () => (await open(page)) !== id);
  }
  // Karl does nothing until his turn is over.
  await karl.page.locator('[data-action="unplan"]').waitFor({ state: "detached" });
  await Promise.all([playOn(rosa.page, byClicks), playOn(karl.page, byClicks)]);
  const record = await recordOf(server, await gameOf(server, roomId));
  const automatic = record.flatMap(({ line }) =>
    line.case === "decision" && line.value.annotations?.extra.person_automatic ? [line.value] : [],
  );
  expect(automatic.map(({ seat, text, annotations }) => [seat, text, annotations?.extra])).toEqual([
    [1, "pass", { person_automatic: "planned" }],
  ]);
  expect([...rosa.faults, ...karl.faults]).toEqual([]);
});

test("a phrase is read in the reader's language, and covers no name on a phone", async () => {
  const { code } = await newRoom(server, { seats: ["person", "person", "random", "random"] });
  const rosa = await person(browser);
  const carlo = await person(browser, { locale: "it-IT", viewport: { width: 360, height: 740 } });
  await sitDown(rosa.page, server, code, "Rosa");
  await carlo.page.goto(`${server.url}/join/${code}`);
  await carlo.page.getByLabel("Il tuo nome").fill("Carlo");
  await carlo.page.getByRole("button", { name: "Siediti" }).click();
  for (const { page } of [rosa, carlo]) await page.locator('[data-part~="table"]').waitFor();
  await rosa.page.getByRole("button", { name: "Say something" }).click();
  await rosa.page.getByRole("button", { name: "Well played!" }).click();
  const bubble = carlo.page.locator('[data-part~="seat"]').filter({ hasText: "Rosa" }).locator('[data-part~="bubble"]');
  await bubble.waitFor({ state: "attached" });
  expect(await bubble.textContent()).toBe("Bella giocata!");
  const covers = await bubble.evaluate((element) => {
    const name = element.parentElement?.querySelector("h2");
    if (!name) return true;
    return element.getBoundingClientRect().top < name.getBoundingClientRect().bottom - 1;
  });
  expect(covers).toBe(false);
  await carlo.page.locator('[data-part~="log"]').getByText("dice «Bella giocata!»").waitFor();
  expect([...rosa.faults, ...carlo.faults]).toEqual([]);
});

test("players and spectators see how many watch", async () => {
  const { roomId, code } = await newRoom(server, { seats: ["person", "greedy", "random", "greedy"] });
  const { page, faults } = await person(browser);
  await sitDown(page, server, code, "Rosa");
  await nextDecision(page);
  const head = page.locator('[data-part="table-head"]');
  await head.getByText("Friday evening", { exact: true }).waitFor();
  const [first, second] = [await person(browser), await person(browser)];
  for (const { page } of [first, second]) {
    await page.goto(`${server.url}/watch/${roomId}`);
    await page.locator('[data-part="table-head"]').getByText("spectator view").waitFor();
  }
  await head.getByText("Friday evening · 2 spectators").waitFor();
  await second.page.context().close();
  await head.getByText("Friday evening · 1 spectator", { exact: true }).waitFor();
  await first.page.getByText("spectator view · 1 spectator").waitFor();
  await first.page.goto(server.url);
  await first.page.locator('[data-part="room-card"]').first().waitFor();
  await head.getByText("Friday evening", { exact: true }).waitFor();
  expect(faults).toEqual([]);
});

test("the page can be installed, and its service worker caches nothing", async () => {
  const { page, faults } = await person(browser);
  await page.goto(`${server.url}/`);
  const found = await page.evaluate(async () => {
    const { active } = await navigator.serviceWorker.ready;
    const link = document.querySelector<HTMLLinkElement>('link[rel="manifest"]');
    const manifest = await (await fetch(link?.href ?? "")).json();
    const icons = manifest.icons as { src: string; sizes: string; type: string }[];
    const types = await Promise.all(icons.map(async ({ src }) => (await fetch(src)).headers.get("content-type")));
    return { script: active?.scriptURL, name: manifest.name, icons, types, caches: await caches.keys() };
  });
  expect(found.script).toBe(`${server.url}/sw.js`);
  expect(found.name).toBe("Chef’s Hat");
  expect(found.types).toEqual(found.icons.map(({ type }) => type));
  expect(found.icons.map(({ sizes }) => sizes)).toEqual(["any", "192x192", "512x512", "512x512"]);
  expect(found.caches).toEqual([]);
  expect(faults).toEqual([]);
});

test("the keys are in the help of the table, and the rules open beside it", async () => {
  const { code } = await newRoom(server, { seats: ["person", "random", "random", "random"] });
  const { page } = await person(browser);
  await sitDown(page, server, code, "Rosa");
  await nextDecision(page);
  await page.keyboard.press("?");
  const dialog = page.getByRole("dialog", { name: "What can I do?" });
  await dialog.getByText("plays or gives the picked cards").waitFor();
  const [rules] = await Promise.all([
    page.context().waitForEvent("page"),
    dialog.getByRole("link", { name: "All rules in short" }).click(),
  ]);
  await rules.getByRole("heading", { name: "The rules in short" }).waitFor();
  expect(new URL(rules.url()).hash).not.toBe("");
});

test("after a game everybody is one click away from another with the same seats", async () => {
  const { roomId, code } = await newRoom(server, {
    seats: ["person", "person", "random", "random"],
    faces: 5,
    rated: true,
  });
  const [rosa, karl] = [await person(browser), await person(browser)];
  await sitDown(rosa.page, server, code, "Rosa");
  await sitDown(karl.page, server, code, "Karl");
  await Promise.all([playOn(rosa.page, byClicks), playOn(karl.page, byClicks)]);
  // Nobody here created the room: the first one to offer a rematch counts.
  await rosa.page.getByRole("button", { name: "Invite to a rematch" }).waitFor();
  await karl.page.getByRole("button", { name: "Invite to a rematch" }).click();
  await karl.page.waitForURL((url) => url.pathname.startsWith("/rooms/") && !url.pathname.endsWith(roomId));
  await rosa.page.getByRole("button", { name: "Join the rematch" }).click();
  for (const { page } of [rosa, karl]) await page.locator('[data-part~="table"]').waitFor();
  expect(await karl.page.locator('[data-part~="own"] [data-part~="seat"]').getAttribute("data-seat")).toBe("1");
  expect([...rosa.faults, ...karl.faults]).toEqual([]);
});
