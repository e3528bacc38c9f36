// Screens from a small phone to a large desktop: everything needed for a decision is visible
// without scrolling.

import type { Page } from "playwright-core";
import { expect, test } from "vitest";
import { LANGUAGES } from "./checks";
import { byClicks, playOn, sitDown } from "./play";
import { gameOf, newRoom } from "./rooms";
import { browser, person, server, useStage } from "./stage";

/** Width and height. */
const SIZES = [
  [360, 740],
  [375, 667],
  [390, 664],
  [390, 844],
  [412, 915],
  [844, 390],
  [768, 1024],
  [1024, 768],
  [1280, 720],
  [1280, 800],
  [1366, 650],
  [1366, 768],
  [1920, 1080],
  [2560, 1440],
] as const;

/** Old phones, where kinds and reactions give way. */
const SMALLEST = [
  [320, 568],
  [360, 640],
] as const;

/** The longest name, without a place to break it. */
const LONG = "W".repeat(64);

const EVERYBODY = [
  '[data-part~="table-head"] h1',
  '[data-part~="seats"] [data-part~="seat"]',
  '[data-part~="seats"] [data-part~="seat-points"]',
  '[data-part~="own"] [data-part~="seat"]',
  '[data-part~="own"] [data-part~="seat-points"]',
];
const CHOICE = [
  '[data-part~="board"]',
  '[data-part~="now-heading"]',
  '[data-part~="hand-stack"]',
  "[data-action=play]",
  "[data-action=pass]",
];
/** What a play must be, which a turn shows that does not open the Shift. */
const REQUIREMENT = '[data-part~="requirement"]';

/** Id of the game that was played to its end. */
let gameId: string;

useStage();

test("a turn, and the end of the game, at every size", async () => {
  const { roomId, code } = await newRoom(server, { name: LONG, seats: ["person", "greedy", "random", "greedy"] });
  const { page, faults } = await person(browser);
  // As if the room had been created on this device, so that the game can be played again.
  await page.addInitScript(([name, secrets]) => localStorage.setItem(name, secrets), [
    `chefshat.hosted.${roomId}`,
    JSON.stringify({ joinCode: code, ownerToken: "-" }),
  ] as const);
  await sitDown(page, server, code, LONG);
  const address = page.url();
  let looked = 0;
  await playOn(page, byClicks, async (taken) => {
    if (taken === 1) {
      expect(await page.locator(REQUIREMENT).count()).toBe(1);
      await expectSeen(page, [...CHOICE, REQUIREMENT], [...SIZES, ...SMALLEST]);
    }
    if (taken > 0) return;
    for (const { value: language } of LANGUAGES) {
      await page.goto(`${address}?lang=${language}`);
      await page.locator("[data-decision]").waitFor();
      await expectSeen(page, [
        ...EVERYBODY,
        ...CHOICE,
        '[data-part~="clock"]',
        '[data-part~="expressions"]',
        '[data-part~="own"] [data-part~="chip"]',
      ]);
      looked += 1;
    }
  });
  expect(looked).toBe(LANGUAGES.length);
  await expectSeen(page, [
    ...EVERYBODY,
    '[data-part~="own"] [data-part~="chip"]',
    '[data-part~="result"]',
    '[data-part~="result-ways"] [data-part~="button"]',
  ]);
  await page.getByRole("button", { name: /^(Nochmal spielen|Gioca ancora)$/ }).waitFor();
  gameId = await gameOf(server, roomId);
  expect(faults).toEqual([]);
});

test("a replay: its controls cover no seat on a desktop, and nothing is wider than the screen", async () => {
  const { page } = await person(browser);
  await page.goto(`${server.url}/replay/${gameId}?lang=it`);
  const slider = page.locator('[data-part~="replay-slider"] input');
  const last = Number(await slider.getAttribute("max"));
  expect(last).toBeGreaterThan(20);
  for (const [width, height] of SIZES) {
    await page.setViewportSize({ width, height });
    for (let at = 0; at <= last; at += Math.ceil(last / 6)) {
      await slider.fill(String(at));
      const wider = () => page.evaluate(() => document.documentElement.scrollWidth - innerWidth);
      await expect.poll(wider, { message: `${width} × ${height} at ${at}` }).toBeLessThanOrEqual(0);
    }
    // A smaller screen may scroll.
    if (width < 1000) continue;
    await slider.fill("3");
    await expectSeenNow(page, [
      '[data-part~="seats"] [data-part~="seat"]',
      '[data-part~="seats"] [data-part~="seat-points"]',
      '[data-part~="seat-open"]',
      '[data-part~="board"]',
      '[data-part~="replay-bar"]',
    ]);
  }
});

test.each(LANGUAGES)("the tutorial in $label, with its text, at every size", async ({ value: language }) => {
  const { page } = await person(browser);
  await page.goto(`${server.url}/tutorial?lang=${language}`);
  await page.locator('[data-part~="lesson"] [data-part~="button"]').waitFor();
  await expectSeen(page, [
    '[data-part~="lesson"]',
    '[data-part~="lesson"] [data-part~="button"]',
    ...EVERYBODY,
    ...CHOICE,
  ]);
});

/** At every size, none of these parts is outside the window or covered. */
async function expectSeen(
  page: Page,
  parts: readonly string[],
  sizes: readonly (readonly [number, number])[] = SIZES,
): Promise<void> {
  for (const [width, height] of sizes) {
    await page.setViewportSize({ width, height });
    await expectSeenNow(page, parts);
  }
}

async function expectSeenNow(page: Page, parts: readonly string[]): Promise<void> {
  const message = JSON.stringify(page.viewportSize());
  await expect.poll(() => unseen(page, parts), { message }).toEqual([]);
}

/** Parts that are missing, outside the window of an unscrolled page, or covered at their centre. */
async function unseen(page: Page, parts: readonly string[]): Promise<string[]> {
  return page.evaluate((parts) => {
    scrollTo(0, 0);
    // One pixel for rounding.
    const [right, bottom] = [innerWidth + 1, innerHeight + 1];
    return parts.flatMap((part) => {
      const found = [...document.querySelectorAll(part)];
      if (found.length === 0) return [`${part} is not there`];
      return found.flatMap((element, index) => {
        const box = element.getBoundingClientRect();
        const inside = box.left >= -1 && box.top >= -1 && box.right <= right && box.bottom <= bottom;
        const at = document.elementFromPoint(box.left + box.width / 2, box.top + box.height / 2);
        const free = at !== null && (element.contains(at) || at.contains(element));
        // The result may cover the board, and the cards of a hand overlap.
        const seen = inside && (free || element.matches('[data-part~="board"], [data-part~="hand-stack"]'));
        return seen ? [] : [`${part} ${index}: ${Math.round(box.top)} to ${Math.round(box.bottom)}`];
      });
    });
  }, parts);
}
