// A table with real cards, against the real server: an attendant enters a short Shift by hand, with
// a question of the referee, a violation and a correction; a remote player plays in a second
// browser, and a tablet opens the attendant's link.

import type { Page } from "playwright-core";
import { expect, test } from "vitest";
import { focus, hearing, nextDecision, sitDown, tabTo } from "./play";
import { clientsOf, gameOf, newPhysicalRoom } from "./rooms";
import { browser, person, server, until, useStage } from "./stage";

useStage();

/*
 * Four faces and no jokers are ten cards, three for each. Ada has 2 3 4★, Bo has 3 4 4, Cleo, who is
 * remote, has 1 2 3.
 */
const CLEOS_HAND = "1 2 3";

/** A picture of one pixel. */
const PICTURE = "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mP8z8BQDwAEhQGAhKmMIQAAAABJRU5ErkJggg==";

/** Creates the room on the page and returns its id. */
async function createTable(page: Page): Promise<string> {
  await page.goto(`${server.url}/new`);
  await page.getByLabel("Name of the room").fill("Kitchen table");
  await page.getByLabel("Cards", { exact: true }).selectOption({ label: "Real cards on a table" });
  await page.getByLabel("Players", { exact: true }).selectOption("3");
  await page.getByLabel("Seat 2", { exact: true }).selectOption({ label: "A person at the table" });
  await page.getByLabel("Seat 3", { exact: true }).selectOption({ label: "Remote: free for a person" });
  await page.getByRole("button", { name: "Create the room" }).click();
  await page.getByRole("alert").filter({ hasText: "Enter the name" }).first().waitFor();
  await page.getByLabel("Name, seat 1").fill("Ada");
  await page.getByLabel("Name, seat 2").fill("Bo");
  // A refused form is unfolded, so that all its fields are there.
  await page.getByLabel("The game ends").selectOption({ label: "after a number of Shifts" });
  await page.getByLabel("Shifts", { exact: true }).fill("1");
  await page.getByLabel("Faces", { exact: true }).fill("4");
  await page.getByLabel("Jokers", { exact: true }).fill("0");
  await page.getByRole("button", { name: "Create the room" }).click();
  await page.waitForURL(/\/rooms\/\w+\/table$/);
  return new URL(page.url()).pathname.split("/")[2] ?? "";
}

/** Waits for what the table waits for. */
async function awaits(page: Page, words: string): Promise<void> {
  await page.locator('[data-part~="awaited-heading"]').filter({ hasText: words }).waitFor();
}

/** Presses a button of the form for entering by hand. */
async function enter(page: Page, ...names: readonly string[]): Promise<void> {
  for (const name of names)
    await page.locator('[data-part~="entry"]').getByRole("button", { name, exact: true }).click();
}

/** Plays one card of a face from the remote player's page, and lays it at the table. */
async function playRemotely(cleo: Page, attendant: Page, face: number, before?: string): Promise<string | undefined> {
  const id = await nextDecision(cleo, before);
  await cleo.locator(`[data-part~="hand-card"][data-card="${face}"]`).click();
  await cleo.getByRole("button", { name: `Play one ${face}` }).click();
  const item = attendant.locator('[data-part~="to-lay-item"]').filter({ hasText: "Lay for Cleo" });
  await item.getByText(`one ${face}`).waitFor({ state: "attached" });
  await item.getByRole("button").click();
  await item.waitFor({ state: "detached" });
  return id;
}

test("an attendant enters a Shift, with a question, a violation and a correction; Cleo plays remotely", async () => {
  const { page: attendant, faults } = await person(browser);
  const { page: cleo, faults: faultsOfCleo } = await person(browser);
  const { page: tablet, faults: faultsOfTablet } = await person(browser, { viewport: { width: 390, height: 844 } });
  const board = (words: string) => cleo.locator('[data-part~="board-words"]').filter({ hasText: words }).waitFor();

  const roomId = await createTable(attendant);
  await awaits(attendant, "Waiting for remote players");
  const code = (await attendant.locator('[data-part~="invite-code"]').textContent()) ?? "";
  const link = await attendant.locator('[data-part~="attendant-link"] [data-part~="invite-link"]').textContent();

  // The tablet beside the table has its ticket from the link, and does not show it.
  await tablet.goto(link ?? "");
  await awaits(tablet, "Waiting for remote players");
  expect(new URL(tablet.url()).hash).toBe("");

  await sitDown(cleo, server, code, "Cleo");
  await awaits(attendant, "Show the hand of Cleo");
  await cleo.getByRole("heading", { name: "Your cards are on their way" }).waitFor();
  await attendant.getByLabel("Cards", { exact: true }).fill(CLEOS_HAND);
  await enter(attendant, "This is the hand of Cleo");
  await until(async () => (await cleo.locator('[data-part~="hand-card"]').count()) === 3);

  // Nobody said who opens: the referee asks, and the tablet answers.
  await awaits(attendant, "The player with the Golden 4 opens the Shift");
  await enter(attendant, "4, artichoke", "Report the play");
  await awaits(tablet, "A question to you");
  const question = tablet.locator('[data-part~="question-card"]');
  await question.getByRole("heading", { name: "Who opened the Shift?" }).waitFor();
  await question.getByRole("button", { name: "Ada" }).click();
  await board("the Golden 4 · Ada");

  // A violation, which everybody sees and which does not count.
  await awaits(attendant, "Bo to play");
  await enter(attendant, "4, artichoke, not allowed now", "Bo lays one 4");
  const violation = attendant.locator('[data-part~="violation"]');
  await violation.filter({ hasText: "Bo: That pizza already shows 4s" }).waitFor();
  await cleo.locator('[data-part~="table-banner"]').filter({ hasText: "That pizza already shows 4s" }).waitFor();
  await board("the Golden 4 · Ada");

  // The second attempt is misread, and corrected while Cleo decides.
  await violation.getByRole("button", { name: "Enter what really lies there" }).click();
  await enter(attendant, "2, shrimp", "Bo lays one 2");
  await violation.waitFor({ state: "detached" });
  await board("one 2 · Bo");
  const misread = await nextDecision(cleo);
  expect(await cleo.locator('[data-part~="hand-card"][data-card="2"]').getAttribute("aria-disabled")).toBe("true");
  await attendant.getByRole("button", { name: "Change: Bo laid one 2" }).click();
  const change = attendant.locator('[data-part~="change"]');
  await change.getByRole("button", { name: "3, anchovy" }).click();
  await change.getByRole("button", { name: "Bo lays one 3" }).click();
  await change.waitFor({ state: "detached" });
  await board("one 3 · Bo");
  await cleo.locator('[data-part~="log"]').getByText("Corrected:").waitFor();

  // A pause, seen by the remote player.
  await attendant.getByRole("button", { name: "Pause" }).click();
  await cleo.getByText("The game is paused at the table.").waitFor();
  await attendant.getByRole("button", { name: "Continue" }).click();
  await cleo.getByText("The game is paused at the table.").waitFor({ state: "detached" });

  let decision = await playRemotely(cleo, attendant, 2, misread);
  await awaits(attendant, "Ada to play");
  await enter(attendant, "Ada passes");
  await awaits(attendant, "Bo to play");
  await enter(attendant, "Bo passes");
  await awaits(attendant, "Cleo is deciding");
  decision = await playRemotely(cleo, attendant, 3, decision);
  await awaits(attendant, "Ada to play");
  await enter(attendant, "2, shrimp", "Ada lays one 2");
  await awaits(attendant, "Bo to play");
  await enter(attendant, "Bo passes");
  await playRemotely(cleo, attendant, 1, decision);
  await awaits(attendant, "Ada to play");
  await enter(attendant, "Ada passes");
  await awaits(attendant, "Ada to play");
  await until(
    async () => (await attendant.locator('[data-part~="board-words"]').textContent()) === "The board is empty",
  );
  await enter(attendant, "3, anchovy", "Ada lays one 3");

  await awaits(attendant, "The game is over");
  await awaits(tablet, "The game is over");
  await cleo.getByRole("heading", { name: "You won!" }).waitFor();

  // The record replays with the hands that were never known.
  await attendant.goto(`${server.url}/replay/${await gameOf(server, roomId)}`);
  const slider = attendant.locator('[data-part~="replay-slider"] input');
  await slider.fill((await slider.getAttribute("max")) ?? "");
  await attendant.getByRole("heading", { name: "Cleo won" }).waitFor();
  expect([...faults, ...faultsOfCleo, ...faultsOfTablet]).toEqual([]);
});

test("with the keyboard alone: a hand is typed, a play and a pass are reported, and what comes next is heard", async () => {
  const { roomId, tableTicket } = await newPhysicalRoom(server, ["Ada", "Bo", "Cleo"]);
  const { page, faults } = await person(browser);
  const heard = await hearing(page);
  const hears = (words: string) => expect.poll(() => heard.join(" ")).toContain(words);
  const press = async (name: string) => {
    await tabTo(page, (on) => on.label === name);
    await page.keyboard.press("Enter");
  };
  await page.goto(`${server.url}/rooms/${roomId}/table#ticket=${tableTicket}`);
  await awaits(page, "Show the hand of greedy");
  await tabTo(page, (on) => on.label === "Cards");
  await page.keyboard.type("1 2 2 3x3 4x4 5x5 6 2xJ");
  await tabTo(page, (on) => on.label === "Remove 5, chilli");
  await page.keyboard.press("Enter");
  await page.locator('[data-part~="entry"]').getByText("17 of 17 cards").waitFor({ state: "attached" });
  await tabTo(page, (on) => on.label === "Cards", "Shift+Tab");
  await page.keyboard.press("Enter");
  await hears("The player with the Golden 11 opens the Shift.");
  await press("1 Ada");
  await press("11, mozzarella");
  await press("More: How many");
  await press("Ada lays two 11s (one Golden)");
  await hears("Bo to play.");
  await press("Bo passes");
  await hears("Cleo to play.");
  await press("Cleo passes");
  // The built-in agent decides at once; its cards are laid for it.
  const item = page.locator('[data-part~="to-lay-item"]');
  await item.waitFor();
  await tabTo(page, (on) => on.label.startsWith("Done: "));
  await page.keyboard.press("Enter");
  await item.waitFor({ state: "detached" });
  expect(await focus(page)).not.toMatchObject({ label: "" });
  expect(faults).toEqual([]);
});

test("a doubt of the camera is shown with its picture, also to an attendant who comes later, and answered once", async () => {
  const { roomId, tableTicket } = await newPhysicalRoom(server, ["Ada", "Bo", "Cleo"]);
  const { page, faults } = await person(browser);
  const { page: later } = await person(browser, { locale: "it-IT" });
  const link = `${server.url}/rooms/${roomId}/table#ticket=${tableTicket}`;
  await page.goto(link);
  await awaits(page, "Show the hand of greedy");
  const { tables } = clientsOf(server);
  const question = { questionId: "place-4", text: "7 or 9 at place 4?", options: ["7", "9"] };
  const picture = Uint8Array.from(Buffer.from(PICTURE, "base64"));
  await tables.report({
    tableTicket,
    reportId: "camera-1",
    report: { kind: { case: "question", value: { ...question, picture } } },
  });
  await later.goto(link);
  for (const one of [page, later]) {
    const image = one.locator('[data-part~="question-card"] img');
    await until(() => image.evaluate((shown: HTMLImageElement) => shown.complete && shown.naturalWidth > 0));
  }
  await page.getByRole("heading", { name: "7 or 9 at place 4?" }).waitFor();
  await page.locator('[data-part~="question-card"]').getByRole("button", { name: "9", exact: true }).click();
  for (const one of [page, later]) await one.locator('[data-part~="question-card"]').waitFor({ state: "detached" });
  expect(faults).toEqual([]);
});
