// A tournament on the page alone: its organiser creates it, invites and starts it, a person joins
// in another browser and plays; errors are marked at their fields.

import { expect, test } from "vitest";
import { byClicks, playOn } from "./play";
import { browser, person, server, useStage } from "./stage";

useStage();

test("a tournament is created, joined from another browser, filled up, started and played to its end", async () => {
  const host = await person(browser);
  await host.page.goto(`${server.url}/tournaments`);
  await host.page.getByRole("link", { name: "Create a tournament…" }).click();
  await host.page.getByLabel("Name of the tournament").fill("Spring cup");
  await host.page.getByRole("radio", { name: "Knockout" }).check();
  await host.page.getByLabel("greedy", { exact: true }).fill("2");
  await host.page.getByText("2 built-in agents").waitFor();
  await host.page.getByLabel("Delay of built-in agents, in seconds").fill("0");
  await host.page.getByLabel("Time to decide").selectOption("noHurry");
  await host.page.getByText("Deals, rules, errors and spectators").click();
  await host.page.getByLabel("The game ends").selectOption("shifts");
  await host.page.getByLabel("Shifts", { exact: true }).fill("1");
  await host.page.getByRole("button", { name: "Create the tournament" }).click();
  await host.page.waitForURL(/\/tournaments\/[0-9a-f]{32}$/);
  await host.page.getByText("2 have joined.").waitFor();
  await host.page.getByText("2 agents “random” are added to make 4.").waitFor();
  await host.page.getByRole("img", { name: "QR code of the address" }).waitFor();
  const invitation = await host.page.getByText(/\/tournaments\/[0-9a-f]{32}\?code=[0-9A-Z]{8}$/).textContent();
  if (!invitation) throw new Error("the invitation is empty");

  const guest = await person(browser);
  await guest.page.goto(invitation);
  // Only the organiser's device can start or close it.
  await guest.page.getByRole("button", { name: "Join the tournament" }).waitFor();
  expect(await guest.page.getByRole("button", { name: "Start the tournament" }).count()).toBe(0);
  await guest.page.getByLabel("Your name").fill("Rosa");
  await guest.page.getByRole("button", { name: "Join the tournament" }).click();
  await guest.page.getByText("You are taking part as Rosa.").waitFor();

  await host.page.getByText("1 agent “random” is added to make 4.").waitFor();
  const entrants = host.page.locator('[data-part~="entrants"] li');
  await expect.poll(() => entrants.count()).toBe(3);
  await entrants.filter({ hasText: "Rosa" }).getByText("person", { exact: true }).waitFor();
  // The secret survives a reload.
  await host.page.reload();
  await host.page.getByRole("button", { name: "Start the tournament" }).click();
  await host.page.getByText("in progress").first().waitFor();

  await playOn(guest.page, byClicks);
  await guest.page.getByRole("button", { name: "Back to the standings" }).click();
  for (const { page } of [host, guest]) {
    await page.getByRole("heading", { name: "Final standings" }).waitFor();
    await expect.poll(() => page.locator('[data-part~="standings"] tbody tr').count()).toBe(4);
    await page.getByRole("row", { name: /Rosa person/ }).waitFor();
  }
  await host.page.getByRole("button", { name: "Close the tournament…" }).waitFor({ state: "detached" });
  expect([...host.faults, ...guest.faults]).toEqual([]);
});

test("who is invited to a private tournament joins by the link and by the code, and nobody else sees it", async () => {
  const host = await person(browser);
  await host.page.goto(`${server.url}/tournaments/new`);
  await host.page.getByLabel("Name of the tournament").fill("Club evening");
  await host.page.getByRole("radio", { name: "Round robin" }).check();
  await host.page.getByText("Deals, rules, errors and spectators").click();
  await host.page.getByLabel("Visible to").selectOption("private");
  await host.page.getByRole("button", { name: "Create the tournament" }).click();
  const invitation = await host.page.getByText(/\/tournaments\/[0-9a-f]{32}\?code=[0-9A-Z]{8}$/).textContent();
  const [address = "", code = ""] = (invitation ?? "").split("?code=");

  const stranger = await person(browser);
  await stranger.page.goto(address);
  await stranger.page.getByText("This tournament does not exist, or it is private.").waitFor();

  const byLink = await person(browser);
  await byLink.page.goto(`${address}?code=${code}`);
  const byCode = await person(browser);
  await byCode.page.goto(server.url);
  await byCode.page.getByLabel("Join code").fill(code);
  await byCode.page.getByRole("button", { name: "Continue" }).click();
  for (const [{ page }, name] of [
    [byLink, "Rosa"],
    [byCode, "Ada"],
  ] as const) {
    await page.getByRole("heading", { name: "Club evening", level: 1 }).waitFor();
    await page.getByLabel("Your name").fill(name);
    await page.getByRole("button", { name: "Join the tournament" }).click();
    await page.getByText(`You are taking part as ${name}.`).waitFor();
  }
  expect([...host.faults, ...byLink.faults, ...byCode.faults]).toEqual([]);
});

test("the organiser adds a person at a physical table, and attends to the game there", async () => {
  const { page, faults } = await person(browser);
  await page.goto(`${server.url}/tournaments/new`);
  await page.getByLabel("Name of the tournament").fill("Mixed cup");
  await page.getByRole("radio", { name: "Swiss" }).check();
  await page.getByLabel("Rounds", { exact: true }).fill("1");
  await page.getByLabel("greedy", { exact: true }).fill("3");
  await page.getByLabel("Physical tables").fill("1");
  await page.getByRole("button", { name: "Create the tournament" }).click();
  const table = page.locator('[data-part~="add-at-table"]');
  const entrants = page.locator('[data-part~="entrants"] li');
  for (const name of ["", "Ada"]) {
    await table.getByLabel("Name").fill(name);
    await table.getByRole("button", { name: "Add" }).click();
    if (name === "") await table.getByText("Enter a name.").waitFor();
  }
  await entrants.filter({ hasText: "Ada" }).getByText("at the table").waitFor();
  // The form is ready for the next one, and says what is wrong with a name.
  await table.getByLabel("Name").fill("Ada");
  await table.getByRole("button", { name: "Add" }).click();
  await table.getByText("Someone else already has this name.").waitFor();
  await page.getByRole("button", { name: "Start the tournament" }).click();

  const game = page.locator('[data-part~="physical-games"]');
  await game.getByText("Round 1, Table 1, game 1").waitFor();
  await game.getByText("Ada").waitFor();
  await game.getByRole("button", { name: "Attend to the table" }).click();
  await page.waitForURL(/\/rooms\/\w+\/table$/);
  await page.getByText("Mixed cup · round 1, table 1, game 1").waitFor();
  await page.locator('[data-part~="awaited-heading"]').waitFor();
  expect(faults).toEqual([]);
});

test("invalid fields are marked, by the page and by the server", async () => {
  const { page } = await person(browser);
  await page.goto(`${server.url}/tournaments/new`);
  const submit = page.getByRole("button", { name: "Create the tournament" });
  await submit.click();
  await page.getByText("Enter a name.").waitFor();
  await page.getByLabel("Name of the tournament").fill("Friday league");
  await page.getByRole("radio", { name: "Swiss" }).check();
  await page.getByLabel("Rounds", { exact: true }).fill("2000");
  await submit.click();
  await page.getByText("Must be between 1 and 1000.").waitFor();
  expect(await page.getByLabel("Rounds", { exact: true }).getAttribute("aria-invalid")).toBe("true");
  await page.getByLabel("Rounds", { exact: true }).fill("3");
  // Only the server finds that six hands cannot be dealt from so few cards.
  await page.getByLabel("Players per table").selectOption("6");
  await page.getByLabel("Faces").fill("4");
  await page.getByLabel("Jokers").fill("0");
  await submit.click();
  await page
    .locator('[data-part~="field"]')
    .filter({ has: page.getByLabel("Faces") })
    .getByRole("alert")
    .waitFor();
  expect(await page.getByLabel("Rounds", { exact: true }).getAttribute("aria-invalid")).toBe("false");
});

test("a tournament starts automatically, is found by its code, and is closed by its organiser after a confirmation", async () => {
  const host = await person(browser);
  await host.page.goto(`${server.url}/tournaments/new`);
  await host.page.getByLabel("Name of the tournament").fill("Open league");
  await host.page.getByRole("radio", { name: "Round robin" }).check();
  await host.page.getByLabel("trained", { exact: true }).fill("3");
  await host.page.getByLabel("It starts").selectOption("joined");
  await host.page.getByLabel("Participants", { exact: true }).fill("4");
  await host.page.getByRole("button", { name: "Create the tournament" }).click();
  await host.page.getByText("It starts automatically when 4 have joined.").waitFor();
  const code = await host.page.locator('[data-part~="invite-code"]').textContent();

  const guest = await person(browser);
  await guest.page.goto(`${server.url}/`);
  await guest.page.getByLabel("Join code").fill(code ?? "");
  await guest.page.getByRole("button", { name: "Continue" }).click();
  // The code is not asked for again.
  await guest.page.getByRole("heading", { name: "Open league", level: 1 }).waitFor();
  await guest.page.getByLabel("Your name").fill("Ada");
  await guest.page.getByRole("button", { name: "Join the tournament" }).click();
  await guest.page.waitForURL(/\/tournaments\/[0-9a-f]{32}$/);

  await host.page.getByText("in progress").first().waitFor();
  await host.page.getByRole("button", { name: "Close the tournament…" }).click();
  await host.page.getByText("Running games are aborted").waitFor();
  await host.page.getByRole("button", { name: "Cancel" }).click();
  await host.page.getByRole("button", { name: "Close the tournament…" }).click();
  await host.page.getByRole("button", { name: "Close it now" }).click();
  await host.page.getByText("closed early").waitFor();
  await host.page.getByRole("button", { name: "Close the tournament…" }).waitFor({ state: "detached" });
  expect(host.faults).toEqual([]);
});
