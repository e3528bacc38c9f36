// A study by its links: the host makes them, a participant agrees, fills in a questionnaire, plays under the name and in the seat that the
// link says, sees what the link says, and the times measured at the page go with the decisions. And what a link cannot do.

import type { Browser } from "playwright-core";
import { afterAll, beforeAll, expect, test } from "vitest";
import { byClicks, playOn } from "./play";
import { gameOf, newRoom, recordOf } from "./rooms";
import { person, Server, startBrowser } from "./stage";

/** As docs/playing.md names it. */
const PERSON_TIME_KEY = "person_decision_time_ms";

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

test("a participant's link leads from the consent to the table, and to the questionnaire after it", async () => {
  const { roomId, code } = await newRoom(server, { seats: ["greedy", "random", "person", "random"] });
  const link = new URL(`${server.url}/join/${code}`);
  link.search = new URLSearchParams({
    name: "P07",
    seat: "2",
    lang: "it",
    hide: "log,expressions,pages",
    times: "1",
    consent: "<b>Puoi smettere</b> quando vuoi.",
    before: "https://forms.example/before?id={name}",
    after: "https://forms.example/after?id={name}&room={room}",
  }).toString();
  const { page, faults } = await person(browser);
  await page.goto(link.href);
  await page.getByText("Partecipi come P07.").waitFor();
  // What the link says is text, whatever it looks like.
  await page.getByText("<b>Puoi smettere</b> quando vuoi.").waitFor();
  await page.getByRole("button", { name: "Ho letto e acconsento" }).click();
  const before = page.getByRole("link", { name: "Apri il questionario" });
  expect(await before.getAttribute("href")).toBe("https://forms.example/before?id=P07");
  await page.getByRole("button", { name: "L’ho compilato" }).click();
  await page.getByRole("button", { name: "Siediti al tavolo" }).click();
  await page.waitForURL(/\/rooms\//);

  const taken = await playOn(page, byClicks, async (already) => {
    if (already === 1) await page.reload().then(() => page.locator("[data-decision]").waitFor());
    for (const left of [".log", ".expressions", ".header-nav"])
      expect(await page.locator(left).first().isVisible()).toBe(false);
  });
  const after = page.getByRole("link", { name: "Apri il questionario" });
  expect(await after.getAttribute("href")).toBe(`https://forms.example/after?id=P07&room=${roomId}`);
  expect(await page.locator("html").getAttribute("lang")).toBe("it");

  const lines = (await recordOf(server, await gameOf(server, roomId))).map(({ line }) => line);
  const header = lines.flatMap((line) => (line.case === "header" ? line.value : []))[0];
  expect(header?.seats[2]?.name).toBe("P07");
  const own = lines.flatMap((line) => (line.case === "decision" && line.value.seat === 2 ? line.value : []));
  expect(own.length).toBe(taken);
  for (const { annotations } of own) expect(annotations?.extra[PERSON_TIME_KEY]).toMatch(/^\d+$/);
  expect(faults).toEqual([]);
});

test("who does not agree does not sit down", async () => {
  const { code } = await newRoom(server, { seats: ["greedy", "random", "person", "random"] });
  const { page } = await person(browser);
  await page.goto(`${server.url}/join/${code}?name=P08&consent=Read+this.`);
  await page.getByRole("button", { name: "I do not agree" }).click();
  await page.getByText("You do not take part. Nothing was stored; you can close this page.").waitFor();
  expect(await page.evaluate(() => localStorage.length)).toBe(0);
});

test("at one device one participant after the other takes a seat of their own", async () => {
  const { roomId, code } = await newRoom(server, { seats: ["greedy", "person", "person", "person"] });
  const { page } = await person(browser);
  for (const name of ["P01", "P02"]) {
    await page.goto(`${server.url}/join/${code}?name=${name}`);
    await page.getByText(`You take part as ${name}.`).waitFor();
    await page.getByRole("button", { name: "Sit down at the table" }).click();
    await page.waitForURL(new RegExp(`/rooms/${roomId}`));
  }
  await page.getByRole("listitem").filter({ hasText: "P02" }).getByText("(you)").waitFor();
  // Their own link leads back to their seat.
  await page.goto(`${server.url}/join/${code}?name=P02`);
  await page.waitForURL(new RegExp(`/rooms/${roomId}`));
});

test("the host of a room makes links for its participants", async () => {
  const { page, faults } = await person(browser);
  await page.goto(`${server.url}/new`);
  await page.getByLabel("Seat 1").selectOption({ label: "Free for a person" });
  await page.getByRole("button", { name: "Make the room" }).click();
  await page.getByText("Links for a study").click();
  await page.getByLabel("Participants, one a line").fill("P01\nP02");
  await page.getByLabel("Seat of the first").selectOption("0");
  await page.getByLabel("what happened").check();
  await page.getByLabel("Address of a questionnaire after").fill("forms.example");
  await page.getByText("This is no address that begins with https:// or http://.").waitFor();
  await page.getByLabel("Address of a questionnaire after").fill("https://forms.example/{name}");
  const link = await page.getByText(/name=P02&seat=1&hide=log&after=/).textContent();
  expect(new URL(link ?? "").searchParams.get("after")).toBe("https://forms.example/{name}");
  expect(faults).toEqual([]);
});

test("a link without a name asks whose the seat is that this device has, and a seat that was vacated keeps nobody from the room", async () => {
  const { code } = await newRoom(server, { seats: ["greedy", "person", "person", "random"] });
  const { page, faults } = await person(browser);
  const link = `${server.url}/join/${code}?times=1`;
  await page.goto(link);
  await page.getByLabel("Your name").fill("Ada");
  await page.getByRole("button", { name: "Sit down at the table" }).click();
  await page.getByText("(you)").waitFor();
  await page.goto(link);
  await page.getByRole("button", { name: "Take another seat" }).click();
  await page.getByRole("button", { name: "Sit down at the table" }).waitFor();
  await page.goto(link);
  await page.getByRole("button", { name: "Go on as Ada" }).click();
  await page.getByText("(you)").waitFor();
  // To the page a ticket that the server does not know any more is the same as one that it has never known.
  await page.evaluate(() => {
    for (const [name, kept] of Object.entries(localStorage)) {
      if (!name.startsWith("chefshat.seat.")) continue;
      const held = JSON.parse(kept);
      localStorage.setItem(name, JSON.stringify({ ...held, ticket: "A".repeat(held.ticket.length) }));
    }
  });
  await page.reload();
  await page.getByRole("heading", { name: "Sit down" }).waitFor();
  expect(await page.evaluate(() => Object.keys(localStorage))).toEqual([]);
  expect(faults).toEqual([]);
});
