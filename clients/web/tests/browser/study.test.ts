// A study by its links: the host creates them; a participant consents, fills in a questionnaire,
// and plays with the name, seat and settings of the link; decision times are recorded. Also what a
// link cannot do.

import { readFileSync } from "node:fs";
import { expect, test } from "vitest";
import { ParticipantKind } from "../../src/gen/chefshat/v1/room_pb";
import { byClicks, playOn } from "./play";
import { agent, clientsOf, gameOf, newRoom, recordOf } from "./rooms";
import { browser, person, server, useStage } from "./stage";

/** As in docs/playing.md. */
const PERSON_TIME_KEY = "person_decision_time_ms";

/** The parts that a study can hide. */
const PARTS = [
  '[data-part~="header-nav"]',
  '[data-part~="log"]',
  '[data-part~="tool-lookup"]',
  '[data-part~="tool-leave"]',
  '[data-part~="expressions"]',
  '[data-part~="played"]',
  '[data-part~="result-links"]',
];

useStage();

test("a participant's link leads from the consent to the table, and then to the questionnaire", async () => {
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
  // The link's text is not interpreted as HTML.
  await page.getByText("<b>Puoi smettere</b> quando vuoi.").waitFor();
  await page.getByRole("button", { name: "Ho letto e acconsento" }).click();
  const before = page.getByRole("link", { name: "Apri il questionario" });
  expect(await before.getAttribute("href")).toBe("https://forms.example/before?id=P07");
  await page.getByRole("button", { name: "L’ho compilato" }).click();
  await page.getByRole("button", { name: "Siediti al tavolo" }).click();
  await page.waitForURL(/\/rooms\//);

  const taken = await playOn(page, byClicks, async (already) => {
    if (already === 1) await page.reload().then(() => page.locator("[data-decision]").waitFor());
    for (const left of ['[data-part~="log"]', '[data-part~="expressions"]', '[data-part~="header-nav"]'])
      expect(await page.locator(left).first().isVisible()).toBe(false);
  });
  const after = page.getByRole("link", { name: "Apri il questionario" });
  expect(await after.getAttribute("href")).toBe(`https://forms.example/after?id=P07&room=${roomId}`);
  expect(await page.locator("html").getAttribute("lang")).toBe("it");
  // The link leads back to the questionnaire, even after leaving the table, until everything stored
  // is deleted.
  await page.goto(link.href);
  await page.waitForURL(/\/rooms\//);
  await after.waitFor();
  await page.evaluate(() => {
    const away = document.body.appendChild(document.createElement("a"));
    away.href = "/leaderboard?lang=it";
    away.click();
  });
  await page.getByRole("heading", { name: "Classifica", level: 1 }).waitFor();
  await page.locator('[data-part~="table"]').waitFor({ state: "detached" });
  const seats = () => page.evaluate(() => Object.keys(localStorage).filter((key) => key.includes("seat.")));
  await expect.poll(seats).toEqual([]);
  await page.goto(link.href);
  await page.getByRole("heading", { name: "Hai partecipato a questo studio" }).waitFor();
  expect(await after.getAttribute("href")).toBe(`https://forms.example/after?id=P07&room=${roomId}`);
  await page.goto(`${server.url}/?lang=it`);
  await page.getByRole("button", { name: "Impostazioni" }).click();
  await page.getByRole("button", { name: "Dimentica tutto su questo dispositivo" }).click();
  await page.getByRole("button", { name: "Dimentica tutto", exact: true }).click();
  await page.waitForURL(`${server.url}/`);
  await page.goto(link.href);
  await page.getByText("P07 ha già un posto.").waitFor();

  const lines = (await recordOf(server, await gameOf(server, roomId))).map(({ line }) => line);
  const header = lines.flatMap((line) => (line.case === "header" ? line.value : []))[0];
  expect(header?.seats[2]?.name).toBe("P07");
  // The key of the device would tell which participants used it.
  expect(header?.seats[2]?.nameFingerprint).toBe("");
  const own = lines.flatMap((line) => (line.case === "decision" && line.value.seat === 2 ? line.value : []));
  expect(own.length).toBe(taken);
  for (const { annotations } of own) expect(annotations?.extra[PERSON_TIME_KEY]).toMatch(/^\d+$/);
  expect(faults).toEqual([]);
});

test("a participant who does not consent cannot join", async () => {
  const { code } = await newRoom(server, { seats: ["greedy", "random", "person", "random"] });
  const { page } = await person(browser);
  await page.goto(`${server.url}/join/${code}?name=P08&consent=Read+this.`);
  await page.getByRole("button", { name: "I do not agree" }).click();
  await page.getByText("You are not taking part. Nothing was stored; you can close this page.").waitFor();
  expect(await page.evaluate(() => localStorage.length)).toBe(0);
  // The participant can reconsider without reloading.
  await page.getByRole("button", { name: "Read it again" }).click();
  await page.getByRole("button", { name: "I have read this and agree" }).click();
  await page.getByRole("button", { name: "Sit down at the table" }).waitFor();
});

test("without hiding, every part that a study can hide is visible", async () => {
  const { code } = await newRoom(server, { seats: ["person", "random", "random", "random"] });
  const { page, faults } = await person(browser);
  const seen = new Set<string>();
  const look = async () => {
    for (const part of PARTS) if (await page.locator(part).first().isVisible()) seen.add(part);
  };
  await page.goto(`${server.url}/join/${code}?name=P09`);
  await page.getByRole("button", { name: "Sit down at the table" }).click();
  await playOn(page, byClicks, look);
  await page.locator('[data-part~="result"]').waitFor();
  await look();
  expect([...seen].toSorted()).toEqual(PARTS.toSorted());
  expect(faults).toEqual([]);
});

test("hidden parts stay hidden from the first page to the end of the game, also after a reload", async () => {
  const { code } = await newRoom(server, { seats: ["person", "agent", "random", "random"] });
  const { page, faults } = await person(browser);
  const hide = "log lookup expressions played pages";
  // Records whether a hidden part is shown again at any time after it was first hidden.
  await page.addInitScript(() => {
    let last: string | undefined;
    const look = () => {
      const now = document.documentElement.dataset.hide;
      if (last !== undefined && now !== last) Object.assign(window, { slipped: true });
      last ??= now;
    };
    const seen = { subtree: true, attributes: true, attributeFilter: ["data-hide"] };
    new MutationObserver(look).observe(document, seen);
  });
  const isLeftOut = async () => {
    expect(await page.locator("html").getAttribute("data-hide")).toBe(hide);
    for (const part of PARTS)
      for (const found of await page.locator(part).all()) expect(await found.isVisible()).toBe(false);
    expect(await page.evaluate(() => "slipped" in window)).toBe(false);
  };
  const asked = new URLSearchParams({ name: "P09", hide: hide.replaceAll(" ", ","), consent: "Read this." });
  await page.goto(`${server.url}/join/${code}?${asked}`);
  await page.getByText("Read this.").waitFor();
  await isLeftOut();
  await page.getByRole("button", { name: "I have read this and agree" }).click();
  await page.getByRole("button", { name: "Sit down at the table" }).click();
  await page.getByText("(you)").waitFor();
  await isLeftOut();
  await page.reload();
  await page.getByText("(you)").waitFor();
  await isLeftOut();
  const done = agent(server, "greedy", code, "Greta");
  const taken = await playOn(page, byClicks, async (already) => {
    await isLeftOut();
    if (already === 1) await page.reload().then(() => page.locator("[data-decision]").waitFor());
  });
  expect(taken).toBeGreaterThan(1);
  expect(await done).toBe(0);
  expect(await page.locator('[data-part~="result"]').isVisible()).toBe(true);
  await isLeftOut();
  await page.reload();
  await page.locator('[data-part~="result"]').waitFor();
  await isLeftOut();
  expect(faults).toEqual([]);
});

test("a link on a device with another participant's seat asks first, and no link takes two seats", async () => {
  const { roomId, code } = await newRoom(server, { seats: ["greedy", "person", "person", "person"] });
  const named = async () => {
    const { room } = await clientsOf(server).rooms.getRoom({ roomId });
    return room?.seats.flatMap(({ kind, name }) => (kind === ParticipantKind.HUMAN ? name : []));
  };
  const { page, faults } = await person(browser);
  const link = (name: string) => `${server.url}/join/${code}?name=${name}`;
  const table = new RegExp(`/rooms/${roomId}`);
  await page.goto(link("P01"));
  await page.getByText("You are taking part as P01.").waitFor();
  await page.getByRole("button", { name: "Sit down at the table" }).click();
  await page.waitForURL(table);
  await page.goto(link("P02"));
  await page.getByRole("button", { name: "Continue as P01" }).click();
  await page.waitForURL(table);
  expect(await named()).toEqual(["P01"]);
  // While their seat is open in another tab too.
  const second = await page.context().newPage();
  await second.goto(link("P02"));
  await second.getByRole("button", { name: "Give up P01’s seat and take part as P02" }).click();
  await second.getByText("You are taking part as P02.").waitFor();
  await second.getByRole("button", { name: "Sit down at the table" }).click();
  await second.waitForURL(table);
  await second.getByRole("listitem").filter({ hasText: "P02" }).getByText("(you)").waitFor();
  expect(await named()).toEqual(["P02"]);
  await page.getByRole("heading", { name: "Sit down" }).waitFor();
  await page.close();
  // Their own link leads back to their seat.
  await second.goto(link("P02"));
  await second.getByRole("listitem").filter({ hasText: "P02" }).getByText("(you)").waitFor();
  const other = await person(browser);
  await other.page.goto(link("P02"));
  await other.page.getByText("P02 already has a seat.").waitFor();
  expect(await other.page.getByRole("button", { name: "Sit down at the table" }).count()).toBe(0);
  expect(await named()).toEqual(["P02"]);
  expect([...faults, ...other.faults]).toEqual([]);
});

test("a room closed before its game has no last questionnaire, and a room that is gone keeps links hidden", async () => {
  const { roomId, code, ownerToken } = await newRoom(server, { seats: ["greedy", "person", "person", "random"] });
  const { page } = await person(browser);
  const asked = new URLSearchParams({ name: "P01", hide: "pages", after: "https://forms.example/" });
  await page.goto(`${server.url}/join/${code}?${asked}`);
  await page.getByRole("button", { name: "Sit down at the table" }).click();
  await page.getByText("(you)").waitFor();
  await clientsOf(server).rooms.closeRoom({ roomId, ownerToken });
  await page.getByText("The room was closed by its owner.").first().waitFor();
  expect(await page.getByRole("link", { name: "Open the questionnaire" }).count()).toBe(0);
  expect(await page.locator("html").getAttribute("data-hide")).toBe("pages");

  const gone = "0".repeat(32);
  await page.evaluate((id) => localStorage.setItem(`chefshat.study.${id}`, "?hide=pages"), gone);
  await page.goto(`${server.url}/rooms/${gone}`);
  await page.getByText("This room no longer exists, or it is private.").waitFor();
  expect(await page.locator("html").getAttribute("data-hide")).toBe("pages");
  expect(await page.locator('[data-part~="error-page"]').getByRole("link").count()).toBe(0);
});

test("the host of a room creates links for its participants", async () => {
  const { page, faults } = await person(browser);
  await page.goto(`${server.url}/new`);
  await page.getByLabel("Seat 2").selectOption({ label: "Free for a person" });
  await page.getByRole("button", { name: "Create the room" }).click();
  await page.getByText("Links for a study").click();
  await page.getByLabel("Participants, one per line").fill("P01\nP02");
  await page.getByLabel("Seat of the first").selectOption("0");
  await page.getByLabel("what happened").check();
  await page.getByLabel("Address of a questionnaire after").fill("forms.example");
  await page.getByText("Enter an address that begins with https:// or http://.").waitFor();
  await page.getByLabel("Address of a questionnaire after").fill("https://forms.example/{name}");
  const link = await page.getByText(/name=P02&seat=1&hide=log&after=/).textContent();
  expect(new URL(link ?? "").searchParams.get("after")).toBe("https://forms.example/{name}");
  expect(faults).toEqual([]);
});

test("each participant gets a separate room like the current one, with all links in one list", async () => {
  const { page, faults } = await person(browser);
  await page.goto(`${server.url}/new`);
  await page.getByLabel("Name of the room").fill("Lab");
  await page.getByText("Rules, errors and spectators").click();
  await page.getByLabel("Faces").fill("7");
  await page.getByRole("button", { name: "Create the room" }).click();
  await page.getByText("Links for a study").click();
  await page.getByLabel("They play").selectOption("own");
  await page.getByText("Enter the participants above.").waitFor();
  await page.getByLabel("Participants, one per line").fill("P01-P03");
  await page.getByLabel("what happened").check();
  await page.getByRole("button", { name: "Create 3 rooms" }).click();
  await page.getByText(/name=P03&hide=log/).waitFor();
  const [table] = await Promise.all([
    page.waitForEvent("download"),
    page.getByRole("button", { name: "Download as a table (CSV)" }).click(),
  ]);
  const lines = readFileSync(await table.path(), "utf8")
    .trim()
    .split("\r\n");
  expect(lines[0]).toBe("name,link,room_id");
  const rows = lines.slice(1).map((line) => line.split(","));
  expect(rows.map(([name]) => name)).toEqual(["P01", "P02", "P03"]);
  expect(new Set(rows.map(([, , roomId]) => roomId)).size).toBe(3);
  for (const [name, link, roomId] of rows) {
    const { room } = await clientsOf(server).rooms.getRoom({ roomId: roomId ?? "" });
    expect([room?.name, room?.rules?.faces]).toEqual([`Lab · ${name}`, 7]);
    expect(room?.seats.map(({ builtInAgent }) => builtInAgent)).toEqual(["", "trained", "greedy", "random"]);
    expect(link).toContain(`name=${name}&hide=log`);
  }
  // They stay listed, and none is created twice.
  await page.reload();
  await page.getByText("Links for a study").click();
  await page.getByLabel("They play").selectOption("own");
  await page.getByText("name=P02&hide=log").waitFor();
  await page.getByLabel("Participants, one per line").fill(`P01-P04\n${"x".repeat(65)}`);
  await page.getByText("A name can have at most 64 characters").waitFor();
  await page.getByRole("button", { name: "Create 1 room" }).waitFor();
  // Also once the room they copy is closed.
  await page.getByRole("button", { name: "Close the room" }).click();
  await page.getByRole("button", { name: "Close the room" }).click();
  await page.getByRole("heading", { name: "Sit down" }).waitFor({ state: "detached" });
  await page.reload();
  await page.getByText("Links for a study").click();
  await page.getByText("name=P02&hide=log").waitFor();

  const participant = await person(browser);
  await participant.page.goto(rows[1]?.[1] ?? "");
  await participant.page.getByRole("button", { name: "Sit down at the table" }).click();
  await participant.page.waitForURL(new RegExp(`/rooms/${rows[1]?.[2]}`));
  await participant.page.locator("[data-decision]").waitFor();
  expect([...faults, ...participant.faults]).toEqual([]);
});

test("a link without a name asks who holds this device's seat, and a vacated seat does not block the room", async () => {
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
  await page.getByRole("button", { name: "Continue as Ada" }).click();
  await page.getByText("(you)").waitFor();
  // To the page, a ticket that the server has forgotten is the same as one it never knew.
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
