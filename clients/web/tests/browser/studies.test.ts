// A study on the server: a participant goes through all stages, changes the device, reloads, and
// never meets a condition's name; another one withdraws; the researcher's page shows both.

import { readFileSync } from "node:fs";
import { createRequire } from "node:module";
import type { AxeResults } from "axe-core";
import type { Page } from "playwright-core";
import { expect, test } from "vitest";
import { StudyLabels } from "../../src/gen/chefshat/v1/study_pb";
import { byClicks } from "./play";
import { clientsOf } from "./rooms";
import { browser, person, server, until, useStage } from "./stage";

const AXE = readFileSync(createRequire(import.meta.url).resolve("axe-core/axe.min.js"), "utf8");
/** What no participant may meet: names of the study, its conditions and factors. */
const SECRET = ["Trust pilot", "cond-warm", "cond-cold", "warmth", "lvl-high", "lvl-low"];

useStage();

/** A study with two conditions; returns the links of its participants. */
async function newStudy(participants: number): Promise<{ studyId: string; ownerToken: string; links: string[] }> {
  const { studies } = clientsOf(server);
  const rules = { preset: "paper", faces: 8, stop: { case: "targetShifts" as const, value: 1 } };
  const condition = (id: string, level: string, agent: string) => ({
    id,
    levels: { warmth: level },
    rules,
    seats: Array.from({ length: 3 }, () => ({ filledBy: { case: "builtInAgent" as const, value: agent } })),
    labels: StudyLabels.PLAYERS,
  });
  const { study, ownerToken } = await studies.createStudy({
    settings: {
      name: "Trust pilot",
      title: "Cooking together",
      participants,
      factors: [{ name: "warmth", levels: ["lvl-high", "lvl-low"] }],
      conditions: [condition("cond-warm", "lvl-high", "greedy"), condition("cond-cold", "lvl-low", "random")],
      traces: true,
      stages: [
        { stage: { case: "consent", value: { text: "We record your games.", version: "1" } } },
        { stage: { case: "practice", value: {} } },
        { stage: { case: "games", value: { count: 1 } } },
        {
          stage: {
            case: "questionnaire",
            value: {
              id: "after",
              title: "About the game",
              items: [
                {
                  id: "liked",
                  text: "I liked it",
                  kind: { case: "likert", value: { points: 5, labels: ["no", "yes"] } },
                },
                { id: "effort", text: "Effort", kind: { case: "slider", value: { min: 0, max: 100, step: 5 } } },
                {
                  id: "said",
                  text: "Anything else",
                  optional: true,
                  kind: { case: "freeText", value: { maxCharacters: 200 } },
                },
              ],
            },
          },
        },
        { stage: { case: "text", value: { title: "About this study", text: "Thank you." } } },
      ],
    },
  });
  const studyId = study?.studyId ?? "";
  const { links } = await studies.addStudyParticipants({ studyId, ownerToken, count: participants });
  return { studyId, ownerToken, links: links.map(({ link }) => `${server.url}/study/${link}`) };
}

/** Everything that the page received, and what is in its address, storage and title. */
function listen(page: Page): () => Promise<string> {
  const received: Promise<string>[] = [];
  page.on("response", (response) => {
    if (response.url().includes("chefshat.v1.")) received.push(response.text().catch(() => ""));
  });
  return async () => {
    const here = await page.evaluate(
      () =>
        JSON.stringify([location.href, document.title, { ...localStorage }, { ...sessionStorage }]) +
        document.body.innerHTML,
    );
    // Streams are still open.
    const settled = Promise.race([Promise.all(received), new Promise<string[]>((done) => setTimeout(done, 0, []))]);
    return here + (await settled).join();
  };
}

async function expectNoSecret(all: string): Promise<void> {
  expect(SECRET.filter((secret) => all.includes(secret))).toEqual([]);
}

async function accessible(page: Page): Promise<string[]> {
  await page.evaluate(AXE);
  const found = await page.evaluate(async () => {
    const { axe } = globalThis as unknown as { axe: { run(): Promise<AxeResults> } };
    return axe.run();
  });
  return found.violations
    .filter(({ impact }) => impact === "serious" || impact === "critical")
    .flatMap(({ id, nodes }) => nodes.map(({ target }) => `${id}: ${target}`));
}

/** Plays until the study offers to continue. */
async function playGame(page: Page): Promise<number> {
  const onward = page.locator('[data-part~="study-game"]').getByRole("button", { name: "Continue" });
  let taken = 0;
  let before = "";
  for (;;) {
    const found = await page.waitForFunction((before) => {
      const buttons = [...document.querySelectorAll('[data-part~="study-game"] button')];
      if (buttons.some(({ textContent }) => textContent === "Continue")) return "over";
      const id = document.querySelector<HTMLElement>("[data-decision]")?.dataset.decision;
      return id !== undefined && id !== before && id;
    }, before);
    const id = String(await found.jsonValue());
    if (id === "over") break;
    await byClicks(page);
    before = id;
    taken += 1;
  }
  await onward.click();
  return taken;
}

test("a participant goes through all stages, on two devices, without meeting a condition", async () => {
  const { studyId, ownerToken, links } = await newStudy(2);
  const first = await person(browser);
  const all = listen(first.page);
  await first.page.goto(links[0] ?? "");
  await first.page.getByRole("heading", { name: "Before you begin" }).waitFor();
  expect(await accessible(first.page)).toEqual([]);
  // With the keyboard alone.
  await first.page.getByLabel("I have read this text").press("Space");
  await first.page.getByRole("button", { name: "Agree and continue" }).press("Enter");
  // Practice.
  await first.page.locator("[data-decision]").waitFor();
  expect(await first.page.locator('[data-part~="header-nav"]').isVisible()).toBe(false);
  expect(await accessible(first.page)).toEqual([]);
  await first.page.reload();
  await first.page.locator("[data-decision]").waitFor();
  expect(await playGame(first.page)).toBeGreaterThan(0);
  await first.page.locator("[data-decision]").waitFor();
  await expectNoSecret(await all());

  // Another device takes over in the middle of the game.
  const second = await person(browser);
  const allOfSecond = listen(second.page);
  await second.page.goto(links[0] ?? "");
  await first.page.getByRole("heading", { name: "You continue on another device or page" }).waitFor();
  expect(await playGame(second.page)).toBeGreaterThan(0);

  await second.page.getByRole("heading", { name: "About the game" }).waitFor();
  await second.page.getByRole("button", { name: "Send the answers" }).click();
  await second.page.getByText("2 questions have no answer yet.").first().waitFor();
  expect(await accessible(second.page)).toEqual([]);
  await second.page.getByLabel("4 of 5").check();
  // What was entered survives a reload.
  await second.page.reload();
  await until(() => second.page.getByLabel("4 of 5").isChecked());
  await second.page.getByRole("slider").press("ArrowRight");
  await second.page.getByRole("button", { name: "Send the answers" }).click();
  await second.page.getByRole("heading", { name: "About this study" }).waitFor();
  await second.page.getByRole("button", { name: "Continue" }).click();
  await second.page.getByRole("heading", { name: "Thank you for taking part" }).waitFor();
  expect(await accessible(second.page)).toEqual([]);
  await expectNoSecret(await allOfSecond());
  expect([...first.faults, ...second.faults]).toEqual([]);

  // The other participant withdraws.
  const other = await person(browser);
  await other.page.goto(links[1] ?? "");
  await other.page.getByRole("button", { name: "Withdraw from the study…" }).click();
  await other.page.getByRole("button", { name: "Withdraw now" }).click();
  await other.page.getByText("You have withdrawn.").waitFor();

  // The researcher's page shows both.
  const researcher = await person(browser);
  await researcher.page.goto(`${server.url}/studies/${studyId}`);
  await researcher.page.getByLabel("Owner token").fill(ownerToken);
  await researcher.page.getByRole("button", { name: "Use this key" }).click();
  const rows = researcher.page.locator('[data-part~="participants"] tbody tr');
  await expect.poll(() => rows.allInnerTexts().then((texts) => texts.join())).toMatch(/completed[\s\S]*withdrawn/);
  expect(await accessible(researcher.page)).toEqual([]);
  const [saved] = await Promise.all([
    researcher.page.waitForEvent("download"),
    researcher.page.getByRole("button", { name: "Download the data (ZIP)" }).click(),
  ]);
  const archive = readFileSync(await saved.path(), "latin1");
  for (const file of ["participants.csv", "games.csv", "answers.csv", "traces.csv", "records/"])
    expect(archive).toContain(file);
  expect(archive).toContain("cond-");
  expect(researcher.faults).toEqual([]);
});
