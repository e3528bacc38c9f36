// Participants of a study: what they do in each stage, and everything that reaches them, in which
// nothing may name a condition.

import type { MessageInitShape } from "@bufbuild/protobuf";
import type { BrowserContextOptions, Page } from "playwright-core";
import { expect } from "vitest";
import { StudyLabels, type StudySettingsSchema } from "../../src/gen/chefshat/v1/study_pb";
import { byClicks } from "./play";
import { clientsOf } from "./rooms";
import { browser, person, type Server } from "./stage";
import type { Tap } from "./tap";

/** What no participant of a study may meet. */
export interface Secrets {
  /** Title of the study, which participants do meet. */
  title: string;
  /** Names of the study, its conditions, factors, seats and programs. */
  names: readonly string[];
  /** Words that differ between the conditions, such as the names of built-in agents. Scripts may have them. */
  words: readonly string[];
}

const SECRETS: Secrets = {
  title: "Cooking together",
  names: ["Trust pilot", "cond-warm", "cond-cold", "warmth", "lvl-high", "lvl-low", "Ofelia", "Gaspare", "nods"],
  words: ["greedy", "random"],
};

/** A study with two conditions and all kinds of stages; `changed` replaces settings. */
export async function newStudy(server: Server, changed: MessageInitShape<typeof StudySettingsSchema> = {}) {
  const { studies } = clientsOf(server);
  const others = 4 - (changed.groups?.size ?? 1);
  const condition = (id: string, level: string, agent: string, name: string) => ({
    id,
    levels: { warmth: level },
    rules: { preset: "paper", faces: 5, stop: { case: "targetShifts" as const, value: 1 } },
    policy: { decisionTimeMs: 3_600_000, paceMs: 0 },
    seats: Array.from({ length: others }, () => ({ filledBy: { case: "builtInAgent" as const, value: agent }, name })),
    robotBehaviour: `${level} nods`,
    labels: StudyLabels.PLAYERS,
  });
  const { study, ownerToken } = await studies.createStudy({
    settings: {
      name: "Trust pilot",
      title: "Cooking together",
      factors: [{ name: "warmth", levels: ["lvl-high", "lvl-low"] }],
      conditions: [
        condition("cond-warm", "lvl-high", "greedy", "Ofelia"),
        condition("cond-cold", "lvl-low", "random", "Gaspare"),
      ],
      traces: true,
      stages: [
        { stage: { case: "consent", value: { text: "We record your games.", version: "1" } } },
        { stage: { case: "practice", value: {} } },
        { stage: { case: "games", value: { count: 1 } } },
        { stage: { case: "questionnaire", value: QUESTIONNAIRE } },
        { stage: { case: "text", value: { title: "About this study", text: "Thank you." } } },
      ],
      ...changed,
    },
  });
  return { studyId: study?.studyId ?? "", ownerToken };
}

const QUESTIONNAIRE = {
  id: "after",
  title: "About the game",
  items: [
    { id: "liked", text: "I liked it", kind: { case: "likert" as const, value: { points: 5, labels: ["no", "yes"] } } },
    { id: "real", kind: { case: "semanticDifferential" as const, value: { points: 7, left: "Fake", right: "Real" } } },
    { id: "effort", text: "Effort", kind: { case: "slider" as const, value: { min: 0, max: 100, step: 5 } } },
    {
      id: "said",
      text: "Anything else",
      optional: true,
      kind: { case: "freeText" as const, value: { maxCharacters: 200 } },
    },
  ],
};

/** Expects that no response names a condition. Scripts, which are the same for everybody, name agents. */
export function expectNoSecretSent(tap: Tap, { title, names, words } = SECRETS): void {
  expect(tap.having(title).length).toBeGreaterThan(0);
  const calls = (text: string) => tap.having(text).filter((path) => path.startsWith("/chefshat."));
  const found = [...names.flatMap((secret) => tap.having(secret)), ...words.flatMap(calls)];
  expect(found).toEqual([]);
}

/** Expects that nothing names a condition in what a page shows and stores, its address and title. */
export async function expectNoSecretOn(page: Page, { names, words } = SECRETS): Promise<void> {
  const all = await page.evaluate(() =>
    JSON.stringify([
      location.href,
      document.documentElement.outerHTML,
      document.cookie,
      { ...localStorage },
      { ...sessionStorage },
    ]),
  );
  expect([...names, ...words].filter((secret) => all.includes(secret))).toEqual([]);
}

/**
 * Opens a participant's link, in a browser context of its own. `leave` closes it for good, and adds the
 * errors of the page to `faults`.
 */
export async function visit(address: string, faults: string[], secrets = SECRETS, options: BrowserContextOptions = {}) {
  const visitor = await person(browser, options);
  await visitor.page.goto(address);
  const leave = async () => {
    await expectNoSecretOn(visitor.page, secrets);
    faults.push(...visitor.faults);
    await visitor.page.context().close();
  };
  return { page: visitor.page, leave };
}

/** Agrees, with the keyboard alone. */
export async function agree(page: Page): Promise<void> {
  await page.getByLabel("I have read this text").press("Space");
  await page.getByRole("button", { name: "Agree and continue" }).press("Enter");
}

/** Agrees, and waits for the practice game. */
export async function consent(page: Page): Promise<void> {
  await agree(page);
  await page.locator("[data-decision]").waitFor();
}

/** How often a page is asked for a decision: in every frame, pages of many participants would have the processor to themselves. */
const POLLING_MS = 100;

/** Takes decisions up to a number, and continues once the game is over. Returns how many it took. */
export async function playGame(page: Page, most = Number.POSITIVE_INFINITY): Promise<number> {
  const onward = page.locator('[data-part~="study-game"]').getByRole("button", { name: "Continue" });
  let before = "";
  for (let taken = 0; taken < most; taken += 1) {
    const found = await page.waitForFunction(
      (before) => {
        const buttons = [...document.querySelectorAll('[data-part~="study-game"] button')];
        if (buttons.some(({ textContent }) => textContent === "Continue")) return "over";
        const id = document.querySelector<HTMLElement>("[data-decision]")?.dataset.decision;
        return id !== undefined && id !== before && id;
      },
      before,
      { polling: POLLING_MS },
    );
    before = String(await found.jsonValue());
    if (before === "over") {
      await onward.click();
      await onward.waitFor({ state: "detached" });
      return taken;
    }
    await byClicks(page);
  }
  // The last answer has reached the server.
  await page.waitForFunction((before) => {
    return document.querySelector<HTMLElement>("[data-decision]")?.dataset.decision !== before;
  }, before);
  return most;
}

/** The rows of a table of a study's data. */
export function rowsOf(csv: string): Partial<Record<string, string>>[] {
  const [names = [], ...rows] = csv.trim().split("\n").map(cellsOf);
  return rows.map((cells) => Object.fromEntries(names.map((name, index) => [name, cells[index]])));
}

/** The cells of a line of a table; none has a line break. */
function cellsOf(line: string): string[] {
  const cells = `,${line}`.matchAll(/,(?:"((?:[^"]|"")*)"|([^",]*))/g);
  return [...cells].map(([, quoted, plain = ""]) => quoted?.replaceAll('""', '"') ?? plain);
}

export function emptyCells(row: Partial<Record<string, string>>): string[] {
  return Object.keys(row).filter((name) => row[name] === "");
}
