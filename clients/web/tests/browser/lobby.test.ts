// The lobby in a real browser: creating a room, joining by invitation, form errors, leaving,
// settings.

import type { Page } from "playwright-core";
import { expect, test } from "vitest";
import { Visibility } from "../../src/gen/chefshat/v1/room_pb";
import { byClicks, nextDecision, sitDown } from "./play";
import { clientsOf, newRoom } from "./rooms";
import { browser, person, server, useStage } from "./stage";

/** More rooms than the lobby shows at first, fewer than twice as many. */
const MANY = 14;

useStage();

test("a room is created, and a guest with its invitation takes the seat reserved for a person", async () => {
  const host = await person(browser);
  await host.page.goto(`${server.url}/`);
  await host.page.getByRole("link", { name: "Create a room…" }).click();
  await host.page.getByLabel("Name of the room").fill("Friday evening");
  await host.page.getByLabel("Seat 2").selectOption({ label: "Free for a person" });
  await host.page.getByRole("button", { name: "Create the room" }).click();
  await host.page.waitForURL(/\/rooms\/[0-9a-f]{32}$/);
  await host.page.getByRole("heading", { name: "Friday evening" }).waitFor();
  await host.page.getByRole("img", { name: "QR code of the address" }).waitFor();
  const invitation = await host.page.getByText(/\/join\/[0-9A-Z]{8}$/).textContent();
  if (!invitation) throw new Error("the invitation is empty");

  const guest = await person(browser);
  await guest.page.goto(invitation);
  await guest.page.getByRole("button", { name: "Sit down" }).click();
  await guest.page.getByText("Enter a name.").waitFor();
  await guest.page.getByLabel("Your name").fill("Rosa");
  await guest.page.getByRole("button", { name: "Sit down" }).click();
  await guest.page.waitForURL(/\/rooms\//);

  // Who has a seat can invite others, too.
  await guest.page.getByRole("img", { name: "QR code of the address" }).waitFor();
  expect(await guest.page.locator('[data-part~="invite-link"]').textContent()).toBe(invitation);

  // The seat appears on the host's page without a reload, labelled as a person's.
  const seat = host.page.getByRole("listitem").filter({ hasText: "Rosa" });
  await seat.getByText("person", { exact: true }).waitFor();
  expect([...host.faults, ...guest.faults]).toEqual([]);
});

test("a seat moves to another device, and back", async () => {
  const { code } = await newRoom(server, { seats: ["person", "greedy", "random", "greedy"] });
  const laptop = await person(browser);
  const phone = await person(browser, { viewport: { width: 390, height: 844 } });
  await sitDown(laptop.page, server, code, "Rosa");
  const decision = await nextDecision(laptop.page);
  await laptop.page.getByRole("button", { name: "Play on another device…" }).click();
  await laptop.page.getByRole("img", { name: "QR code of the link" }).waitFor();
  const link = await laptop.page.locator('[data-part~="invite-link"]').textContent();
  await laptop.page.keyboard.press("Escape");

  await phone.page.goto(link ?? "");
  expect(await nextDecision(phone.page)).toBe(decision);
  expect(new URL(phone.page.url()).hash).toBe("");
  await laptop.page.getByText("This seat is in use in another window or on another device.").waitFor();
  await byClicks(phone.page);
  const later = await nextDecision(phone.page, decision);
  await laptop.page.getByRole("button", { name: "Play here" }).click();
  expect(await nextDecision(laptop.page, decision)).toBe(later);
  await phone.page.getByText("This seat is in use in another window or on another device.").waitFor();
  expect([...laptop.faults, ...phone.faults]).toEqual([]);
});

test("the link to the content leaves the page and what was typed as they are", async () => {
  const { page, faults } = await person(browser);
  await page.goto(`${server.url}/new`);
  await page.getByLabel("Name of the room").fill("Friday evening");
  await page.getByRole("link", { name: "Skip to content" }).press("Enter");
  await page.waitForURL(/#content$/);
  await page.waitForFunction(() => document.activeElement?.id === "content");
  expect(await page.getByLabel("Name of the room").inputValue()).toBe("Friday evening");
  await page.goBack();
  expect(await page.getByLabel("Name of the room").inputValue()).toBe("Friday evening");
  expect(faults).toEqual([]);
});

test("the newest rooms are shown first, and more on request", async () => {
  const { page } = await person(browser);
  for (let number = 1; number <= MANY; number += 1)
    await newRoom(server, { name: `Table ${number}`, seats: ["person", "person", "random", "random"] });
  await page.goto(`${server.url}/`);
  const section = page.locator('[data-part~="lobby-section"]').filter({ hasText: "Rooms with free seats" });
  const cards = section.locator('[data-part~="room-card"]');
  await section.getByText("12+").waitFor();
  expect(await cards.count()).toBe(12);
  expect(await cards.first().textContent()).toContain(`Table ${MANY}`);
  expect(await section.getByRole("heading", { name: "Table 1", exact: true }).count()).toBe(0);
  await section.getByRole("button", { name: "Show more" }).click();
  await section.getByRole("heading", { name: "Table 1", exact: true }).waitFor();
  expect(await cards.count()).toBeGreaterThanOrEqual(MANY);
});

test("a room with a seat of this device stands first, a private one too", async () => {
  const seats = ["person", "person", "random", "random"];
  const { code } = await newRoom(server, { name: "Where I sit", seats, policy: { visibility: Visibility.PRIVATE } });
  const { page, faults } = await person(browser);
  await sitDown(page, server, code, "Nadia");
  await page.goto(`${server.url}/`);
  const own = page.locator('[data-part~="own-seats"]');
  await own.getByRole("heading", { name: "Where I sit" }).waitFor();
  await page.locator('[data-part~="lobby-section"]').first().waitFor();
  expect(await page.getByRole("heading", { name: "Where I sit" }).count()).toBe(1);
  await own.getByRole("link", { name: "Back to my seat" }).click();
  await page.waitForURL(/\/rooms\//);
  expect(faults).toEqual([]);
});

test("all invalid fields are marked at once", async () => {
  const { page } = await person(browser);
  await page.goto(`${server.url}/new`);
  await page.getByText("Rules, errors and spectators").click();
  const invalid = () => page.locator('[aria-invalid="true"]').count();
  await page.getByLabel("Faces").fill("99");
  await page.getByLabel("Jokers").fill("many");
  await page.getByLabel("Points by place").fill("5, banana");
  await page.getByRole("button", { name: "Create the room" }).click();
  await page.getByText("Some fields need correcting").waitFor();
  await page.getByText("Must be between 4 and 15.").waitFor();
  await page.getByText("Enter a number.").waitFor();
  await page.getByText("Enter whole numbers of 0 or more, separated by commas").waitFor();
  expect(await invalid()).toBe(3);
  await page.waitForFunction(() => document.activeElement === document.querySelector('[aria-invalid="true"]'));
  // Errors that only the server can find are marked too: six hands cannot be dealt from so few
  // cards.
  await page.getByLabel("Players", { exact: true }).selectOption("6");
  await page.getByLabel("Faces").fill("4");
  await page.getByLabel("Jokers").fill("0");
  await page.getByLabel("Points by place").fill("");
  await page.getByRole("button", { name: "Create the room" }).click();
  await expect.poll(() => page.getByLabel("Faces").getAttribute("aria-invalid")).toBe("true");
});

test("a wrong code and an unknown address are explained", async () => {
  const { page } = await person(browser, { locale: "it-IT" });
  await page.goto(`${server.url}/join/22222222`);
  await page.getByText("Questo codice non corrisponde a nessuna stanza").waitFor();
  expect(await page.getByLabel("Il tuo nome").count()).toBe(0);
  await page.goto(`${server.url}/nowhere/at/all`);
  await page.getByRole("heading", { name: "Questa pagina non esiste" }).waitFor();
});

test("an invitation shows its room and the names taken there", async () => {
  const { code } = await newRoom(server, { name: "Sunday table", seats: ["person", "person", "greedy", "random"] });
  const [ada, other] = [await person(browser), await person(browser)];
  await sitDown(ada.page, server, code, "Ada");
  await other.page.goto(`${server.url}/join/${code}`);
  await other.page.getByRole("heading", { name: "Sunday table" }).waitFor();
  await other.page.getByRole("listitem").filter({ hasText: "Ada" }).getByText("person", { exact: true }).waitFor();
  await other.page.getByLabel("Your name").fill("ada ");
  await other.page.getByText("Someone at this table is already called ada.").waitFor();
  await other.page.getByRole("button", { name: "Sit down" }).click();
  expect(new URL(other.page.url()).pathname).toBe(`/join/${code}`);
  await other.page.getByLabel("Your name").fill("Ben");
  await other.page.getByRole("button", { name: "Sit down" }).click();
  await other.page.waitForURL(/\/rooms\//);
  // Who comes too late learns it before entering a name, and can watch.
  const late = await person(browser);
  await late.page.goto(`${server.url}/join/${code}`);
  await late.page.getByText("The game has already started.").waitFor();
  expect(await late.page.getByLabel("Your name").count()).toBe(0);
  await late.page.getByRole("link", { name: "Watch" }).click();
  await late.page.waitForURL(/\/watch\//);
  expect([...ada.faults, ...other.faults, ...late.faults]).toEqual([]);
});

test("leaving frees the seat before the game, explains what happens during it, and lets the room's creator end it", async () => {
  const host = await person(browser);
  await host.page.goto(`${server.url}/new`);
  await host.page.getByLabel("Name of the room").fill("To be left");
  await host.page.getByLabel("Seat 2").selectOption({ label: "Free for a person" });
  await host.page.getByRole("button", { name: "Create the room" }).click();
  // No seat is free for an agent, and the address works on this machine only.
  await host.page.getByText("This address works on this machine only.").waitFor();
  expect(await host.page.getByText("For an agent, in a terminal").count()).toBe(0);
  await host.page.getByLabel("Your name").fill("Mia");
  await host.page.getByRole("button", { name: "Sit down" }).click();
  await host.page.getByRole("button", { name: "Leave or close the room…" }).click();
  await host.page.getByText("Your seat becomes free for someone else.").waitFor();
  const room = host.page.url();
  await host.page.getByRole("button", { name: "Leave", exact: true }).click();
  await host.page.waitForURL(`${server.url}/`);
  const card = host.page.locator('[data-part~="room-card"]').filter({ hasText: "To be left" });
  await card.waitFor();
  expect(await card.getByText("Mia").count()).toBe(0);
  await host.page.goto(room);
  await host.page.getByRole("button", { name: "Sit down" }).click();
  await host.page.getByRole("button", { name: "Leave or close the room…" }).waitFor();
  const code = (await host.page.locator('[data-part~="invite-code"]').textContent()) ?? "";

  const guest = await person(browser);
  await sitDown(guest.page, server, code, "Rosa");
  await guest.page.getByRole("button", { name: "Leave…" }).click();
  await guest.page.getByText(/After \d+\u00a0s at your next decision, the agent “random” plays for you/).waitFor();
  expect(await guest.page.getByRole("button", { name: "End the game" }).count()).toBe(0);
  await guest.page.getByRole("button", { name: "Stay" }).click();

  await host.page.getByRole("button", { name: "Leave…" }).click();
  await host.page.getByRole("button", { name: "End the game" }).click();
  for (const { page } of [host, guest]) await page.getByText("The room was closed by its owner.").waitFor();
  expect(await host.page.getByRole("button", { name: "Leave…" }).count()).toBe(0);
  expect([...host.faults, ...guest.faults]).toEqual([]);
});

test("the leave dialog stays open when the game starts meanwhile", async () => {
  const { code } = await newRoom(server, { seats: ["person", "person", "random", "random"] });
  const [ada, ben] = [await person(browser), await person(browser)];
  await sitDown(ada.page, server, code, "Ada");
  await ada.page.getByRole("button", { name: "Leave…" }).click();
  const dialog = ada.page.getByRole("dialog");
  await dialog.getByText("Your seat becomes free for someone else.").waitFor();
  await sitDown(ben.page, server, code, "Ben");
  await ada.page.locator('[data-decision], [data-part~="table"]').first().waitFor();
  await dialog.getByText(/After \d+\u00a0s at your next decision, the agent “random” plays for you/).waitFor();
  await dialog.getByRole("button", { name: "Stay" }).click();
  await dialog.waitFor({ state: "detached" });
  expect([...ada.faults, ...ben.faults]).toEqual([]);
});

test("Back, Forward and a reload restore the scroll position", async () => {
  for (let number = 1; number <= MANY; number += 1)
    await newRoom(server, { seats: ["person", "person", "random", "random"] });
  const { page, faults } = await person(browser, { viewport: { width: 390, height: 844 } });
  await page.goto(`${server.url}/`);
  const last = page.getByRole("button", { name: "Show more" }).first();
  await last.scrollIntoViewIfNeeded();
  const left = await page.evaluate(() => scrollY);
  expect(left).toBeGreaterThan(844);
  await page.evaluate(() => document.querySelector<HTMLElement>('nav a[href="/leaderboard"]')?.click());
  const other = page.getByRole("heading", { level: 1, name: "Leaderboard" });
  await other.waitFor();
  expect(await page.evaluate(() => scrollY)).toBe(0);
  await page.goBack();
  await expect.poll(() => page.evaluate(() => scrollY)).toBe(left);
  await page.goForward();
  await other.waitFor();
  await expect.poll(() => page.evaluate(() => scrollY)).toBe(0);
  await page.goBack();
  await expect.poll(() => page.evaluate(() => scrollY)).toBe(left);
  await page.reload();
  await expect.poll(() => page.evaluate(() => scrollY)).toBe(left);
  expect(faults).toEqual([]);
});

test("a page whose seat was given up elsewhere offers to join again", async () => {
  const { code } = await newRoom(server, { name: "Given back", seats: ["person", "person", "random", "random"] });
  const { page, faults } = await person(browser);
  await sitDown(page, server, code, "Ada");
  await page.getByRole("button", { name: "Leave…" }).waitFor();
  const kept = `seat.${new URL(page.url()).pathname.split("/").at(-1)}`;
  const ticket = await page.evaluate((kept) => {
    const name = Object.keys(localStorage).find((name) => name.endsWith(kept));
    return String(JSON.parse((name && localStorage.getItem(name)) || "{}").ticket);
  }, kept);
  await clientsOf(server).rooms.leaveRoom({ ticket });
  await page.getByRole("heading", { name: "Sit down" }).waitFor();
  expect(await page.getByRole("button", { name: "Leave…" }).count()).toBe(0);
  expect(faults).toEqual([]);
});

test("language and theme are chosen and stored", async () => {
  const { page } = await person(browser);
  await page.goto(`${server.url}/`);
  await page.getByRole("button", { name: "Settings" }).click();
  await page.getByLabel("Theme").selectOption("dark");
  await page.getByLabel("Language").selectOption("it");
  await page.getByRole("heading", { name: "Impostazioni" }).waitFor();
  await page.keyboard.press("Escape");
  await page.reload();
  await page.getByRole("heading", { name: "Siediti e gioca" }).waitFor();
  expect(await page.locator("html").getAttribute("lang")).toBe("it");
  expect(await page.locator("html").getAttribute("data-theme")).toBe("dark");
});

test("a private game is found and replayed by the one who created it alone", async () => {
  const host = await person(browser);
  await host.page.goto(`${server.url}/new`);
  await host.page.getByLabel("Name of the room").fill("Behind closed doors");
  await host.page.getByLabel("Seat 1").selectOption("built-in random");
  await host.page.getByLabel("Visible to").selectOption({ label: "Only participants" });
  await host.page.getByText("Nobody else can find it").waitFor();
  await host.page.getByLabel("Delay of built-in agents").fill("0");
  await host.page.getByRole("button", { name: "Create the room" }).click();
  await host.page.waitForURL(/\/rooms\/[0-9a-f]{32}/);
  const room = host.page.url();

  await host.page.goto(server.url);
  const card = host.page.locator('[data-part~="room-card"]').filter({ hasText: "Behind closed doors" });
  await card.getByText("private").waitFor();
  await card.getByRole("link", { name: "Replay" }).click();
  await host.page.waitForURL(/\/replay\//);
  await host.page.locator('[data-part~="replay-bar"]').waitFor();

  const stranger = await person(browser);
  await stranger.page.goto(server.url);
  await stranger.page.getByRole("heading", { name: "Create a room" }).waitFor();
  const answers = [
    [room, "This room no longer exists"],
    [host.page.url(), "The server has no record of this game"],
  ];
  for (const [address = "", words = ""] of answers) {
    expect(await stranger.page.getByText("Behind closed doors").count()).toBe(0);
    await stranger.page.goto(address);
    await stranger.page.getByText(words).waitFor();
  }
});

test("the key of a person's names is taken to another device", async () => {
  const devices = [await person(browser), await person(browser), await person(browser)];
  const [first, second, third] = devices.map(({ page }) => page) as [Page, Page, Page];
  // In rooms of their own: the page asks for another name where one is taken.
  const sit = async (page: Page) => {
    const { roomId, code } = await newRoom(server, { seats: ["person", "person", "greedy", "greedy"] });
    await sitDown(page, server, code, "Rosa");
    const { room } = await clientsOf(server).rooms.getRoom({ roomId });
    return room?.seats[0]?.nameFingerprint;
  };
  const keyField = async (page: Page) => {
    await page.goto(server.url);
    await page.getByRole("button", { name: "Settings" }).click();
    return page.getByLabel("Your identity key");
  };
  const own = await sit(first);
  expect(own).toMatch(/^[0-9a-f]{16}$/);
  const key = await (await keyField(first)).inputValue();
  expect(key).toMatch(/^[0-9a-f]{64}$/);

  const field = await keyField(second);
  expect(await field.inputValue()).toBe("");
  await field.fill(key.slice(1));
  const fault = second.getByText("A key has 64 digits from 0 to 9 and a to f.");
  await fault.waitFor();
  await field.fill(` ${key.toUpperCase()} `);
  await fault.waitFor({ state: "detached" });
  expect(await sit(second)).toBe(own);

  const other = await sit(third);
  expect(other).toMatch(/^[0-9a-f]{16}$/);
  expect(other).not.toBe(own);
  // A key that would replace another is confirmed.
  await (await keyField(third)).fill(key);
  await third.getByText("Use this key").waitFor();
  expect(await sit(third)).toBe(other);
  await (await keyField(third)).fill(key);
  await third.getByRole("button", { name: "Use this key" }).click();
  await third.getByText("Copy the former key first").waitFor();
  await third.getByRole("button", { name: "Use this key" }).click();
  await third.getByRole("button", { name: "Use this key" }).waitFor({ state: "detached" });
  expect(await sit(third)).toBe(own);
  for (const { faults } of devices) expect(faults).toEqual([]);
});
