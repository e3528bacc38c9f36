// The lobby in a real browser: from one page to the other, a room made and joined by its invitation, what is refused said in words.

import type { Browser } from "playwright-core";
import { afterAll, beforeAll, expect, test } from "vitest";
import { person, Server, startBrowser } from "./stage";

let server: Server;
let browser: Browser;

beforeAll(async () => {
  server = await Server.start();
  browser = await startBrowser();
});

afterAll(async () => {
  await browser?.close();
  await server?.stop();
});

test("a room is made, and who opens its invitation takes the seat kept for a person", async () => {
  const host = await person(browser);
  await host.page.goto(`${server.url}/`);
  await host.page.getByRole("link", { name: "Make a room…" }).click();
  await host.page.getByLabel("Name of the room").fill("Friday evening");
  await host.page.getByLabel("Seat 1").selectOption({ label: "Free for a person" });
  await host.page.getByRole("button", { name: "Make the room" }).click();
  await host.page.waitForURL(/\/rooms\/[0-9a-f]{32}$/);
  await host.page.getByRole("heading", { name: "Friday evening" }).waitFor();
  await host.page.getByRole("img", { name: "QR code of the address" }).waitFor();
  const invitation = await host.page.getByText(/\/join\/[0-9A-Z]{8}$/).textContent();
  if (!invitation) throw new Error("the invitation is empty");

  const guest = await person(browser);
  await guest.page.goto(invitation);
  await guest.page.getByRole("button", { name: "Sit down" }).click();
  await guest.page.getByText("Say how the others shall call you.").waitFor();
  await guest.page.getByLabel("Your name").fill("Rosa");
  await guest.page.getByRole("button", { name: "Sit down" }).click();
  await guest.page.waitForURL(/\/rooms\//);

  // The seat shows up at the host's door without a reload, labelled as a person's.
  const seat = host.page.getByRole("listitem").filter({ hasText: "Rosa" });
  await seat.getByText("person", { exact: true }).waitFor();
  expect([...host.faults, ...guest.faults]).toEqual([]);
});

test("a rule that the server refuses is marked at its field", async () => {
  const { page } = await person(browser);
  await page.goto(`${server.url}/new`);
  await page.getByText("Rules, faults and watching").click();
  await page.getByLabel("Faces").fill("99");
  await page.getByRole("button", { name: "Make the room" }).click();
  await page.getByText("Something cannot be accepted").waitFor();
  expect(await page.getByLabel("Faces").getAttribute("aria-invalid")).toBe("true");
  await page.getByLabel("Faces").fill("many");
  await page.getByRole("button", { name: "Make the room" }).click();
  await page.getByText("This is no number.").waitFor();
});

test("a wrong code and an address that names nothing are answered in words", async () => {
  const { page } = await person(browser, { locale: "it-IT" });
  await page.goto(`${server.url}/join/22222222`);
  await page.getByLabel("Il tuo nome").fill("Rosa");
  await page.getByRole("button", { name: "Siediti" }).click();
  await page.getByText("Nessuna stanza ha questo codice. Ricontrollalo.").waitFor();
  await page.goto(`${server.url}/nowhere/at/all`);
  await page.getByRole("heading", { name: "Questa pagina non esiste" }).waitFor();
});

test("language and look are chosen and kept", async () => {
  const { page } = await person(browser);
  await page.goto(`${server.url}/`);
  await page.getByRole("button", { name: "Settings" }).click();
  await page.getByLabel("Look").selectOption("dark");
  await page.getByLabel("Language").selectOption("it");
  await page.getByRole("heading", { name: "Impostazioni" }).waitFor();
  await page.keyboard.press("Escape");
  await page.reload();
  await page.getByRole("heading", { name: "Siediti e gioca" }).waitFor();
  expect(await page.locator("html").getAttribute("lang")).toBe("it");
  expect(await page.locator("html").getAttribute("data-look")).toBe("dark");
});
