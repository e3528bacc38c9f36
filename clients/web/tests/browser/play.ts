// A player at the table: takes a seat, waits for decisions, takes them with the mouse or the
// keyboard alone. Picks the rarest face last, so that the Shift is not over at once.

import type { Page } from "playwright-core";
import { type Server, until } from "./stage";

/** Most key presses from one element to another. */
const MOST_TABS = 60;

/** Opens an invitation, with the token of a guest if the server requires tokens, and takes a seat. */
export async function sitDown(
  page: Page,
  server: Pick<Server, "url">,
  code: string,
  name: string,
  token = "",
): Promise<void> {
  await page.goto(`${server.url}/join/${code}${token && `#token=${token}`}`);
  await page.getByLabel("Your name").fill(name);
  await page.getByRole("button", { name: "Sit down" }).click();
  await page.waitForURL(/\/rooms\//);
}

/** Waits for a decision other than `before`. Returns its id, or undefined once the game is over. */
export async function nextDecision(page: Page, before?: string): Promise<string | undefined> {
  const waiting = page.waitForFunction((before) => {
    if (document.querySelector('[data-part~="result"] a[href^="/replay/"]')) return "over";
    const id = document.querySelector<HTMLElement>("[data-decision]")?.dataset.decision;
    // They count anew in each game, and the next one may have replaced the result already.
    if (id && before && Number(id) < Number(before)) return "over";
    return id !== before && id;
  }, before);
  const found = await waiting.catch(async (cause) => {
    throw new Error(`no decision after ${before} on the page: ${await page.locator("main").textContent()}`, { cause });
  });
  const id = await found.jsonValue();
  return id === "over" || id === false ? undefined : id;
}

/** A way to take the open decision. */
export type Way = (page: Page) => Promise<void>;

/**
 * Plays to the end of the game. Returns the number of decisions taken. `each` runs while a decision
 * is open.
 */
export async function playOn(page: Page, way: Way, each?: (taken: number) => Promise<void>): Promise<number> {
  let taken = 0;
  for (let id = await nextDecision(page); id !== undefined; id = await nextDecision(page, id)) {
    await each?.(taken);
    await way(page);
    taken += 1;
  }
  return taken;
}

/** Takes the decision with the mouse. */
export const byClicks: Way = async (page) => {
  const decline = page.locator('[data-action="decline"]');
  if (await decline.isVisible()) return decline.click();
  const ready = page.locator(
    '[data-action="play"][aria-disabled="false"], [data-action="give"][aria-disabled="false"]',
  );
  const picked = page.locator('[data-part~="hand-card"][aria-pressed="true"]');
  const free = page.locator('[data-part~="hand-card"][aria-disabled="false"][aria-pressed="false"]');
  while ((await ready.count()) === 0) {
    const already = await picked.count();
    const faces = free.and(page.locator(':not([data-card="J"])'));
    const card = (await faces.count()) > 0 ? faces : free;
    if ((await card.count()) === 0) return page.locator('[data-action="pass"][aria-disabled="false"]').click();
    await card.last().click();
    await until(async () => (await picked.count()) !== already);
  }
  await ready.click();
};

/** The focused element. */
export interface Focus {
  label: string;
  action: string;
  card: string;
  disabled: boolean;
  pressed: boolean;
}

/** The element with the keyboard focus; empty label if the document has it. */
export async function focus(page: Page): Promise<Focus> {
  return page.evaluate(() => {
    const on = document.activeElement;
    const label = on instanceof HTMLInputElement ? on.labels?.[0]?.textContent : on?.textContent;
    return {
      label: on === document.body ? "" : (on?.getAttribute("aria-label") ?? label ?? "").trim(),
      action: on?.getAttribute("data-action") ?? "",
      card: on?.getAttribute("data-card") ?? "",
      disabled: on?.getAttribute("aria-disabled") === "true",
      pressed: on?.getAttribute("aria-pressed") === "true",
    };
  });
}

/** Presses a key until the focus is on a wanted element. */
export async function tabTo(page: Page, wanted: (on: Focus) => boolean, key = "Tab"): Promise<void> {
  for (let pressed = 0; pressed < MOST_TABS; pressed += 1) {
    if (wanted(await focus(page))) return;
    await page.keyboard.press(key);
  }
  throw new Error(`not to be reached with ${key}; the focus is on "${(await focus(page)).label}"`);
}

/**
 * The announcements, or the texts of another element, of the pages that are opened from now on, as
 * they change.
 */
export async function hearing(page: Page, region = '[data-testid="announcer"]'): Promise<string[]> {
  const heard: string[] = [];
  await page.exposeFunction("hear", (text: string) => heard.push(text));
  await page.addInitScript((selector) => {
    const { hear } = globalThis as unknown as { hear(text: string): void };
    new MutationObserver((changes) => {
      const region = document.querySelector(selector);
      if (region && changes.some(({ target }) => region.contains(target))) hear(region.textContent);
    }).observe(document, { subtree: true, childList: true, characterData: true });
  }, region);
  return heard;
}

/** Label of the hand, which has the focus itself after a decision. */
export const HAND = "Your hand";

/**
 * Takes the decision with the keys of cards: the key of a face and Enter, or p. Returns the number of
 * keys.
 */
export async function byCardKeys(page: Page): Promise<number> {
  let pressed = 0;
  const press = async (key: string) => {
    await page.keyboard.press(key);
    pressed += 1;
  };
  const decline = page.locator('[data-action="decline"]');
  const free = page.locator('[data-part~="hand-card"][aria-disabled="false"]');
  const pass = page.locator('[data-action="pass"][aria-disabled="false"]');
  await decline.or(free).or(pass).first().waitFor();
  if (await decline.isVisible()) {
    await press("n");
    return pressed;
  }
  if ((await free.count()) === 0) {
    await press("p");
    return pressed;
  }
  const faces = free.and(page.locator(':not([data-card="J"])'));
  const card = (await faces.count()) > 0 ? faces : free;
  await press((await card.last().getAttribute("aria-keyshortcuts")) ?? "");
  await page
    .locator('[data-action="play"][aria-disabled="false"], [data-action="give"][aria-disabled="false"]')
    .waitFor();
  await press("Enter");
  return pressed;
}

/**
 * Takes the decision with the keyboard: arrow keys along the hand, the space bar picks a card,
 * Enter plays.
 */
export const byKeys: Way = async (page) => {
  if (await page.locator('[data-action="decline"]').isVisible()) {
    await tabTo(page, (on) => on.action === "decline");
    return page.keyboard.press("Enter");
  }
  const ready = page.locator(
    '[data-action="play"][aria-disabled="false"], [data-action="give"][aria-disabled="false"]',
  );
  const picked = page.locator('[data-part~="hand-card"][aria-pressed="true"]');
  const onHand = (on: Focus) => on.card !== "" || on.label === HAND;
  if (!onHand(await focus(page))) await tabTo(page, onHand, (await focus(page)).action ? "Shift+Tab" : "Tab");
  await page.keyboard.press("End");
  const cards = await page.locator('[data-part~="hand-card"]').count();
  for (let at = cards; at > 0 && (await ready.count()) === 0; at -= 1) {
    const on = await focus(page);
    if (!on.disabled && !on.pressed) {
      const already = await picked.count();
      await page.keyboard.press("Space");
      // The Golden card is picked first of its face, where it must be played.
      await until(async () => (await picked.count()) !== already);
    }
    if ((await ready.count()) === 0) await page.keyboard.press("ArrowLeft");
  }
  if ((await ready.count()) === 0) await tabTo(page, (on) => on.action === "pass" && !on.disabled);
  await page.keyboard.press("Enter");
};
