// Every page: no accessibility error in the light and the dark theme, no horizontal scrolling on a
// phone, names for everything in each language; and the size of the first page.

import type { Page } from "playwright-core";
import { beforeAll, expect, test } from "vitest";
import { TournamentFormat } from "../../src/gen/chefshat/v1/tournament_pb";
import { inaccessible, LANGUAGES, PHONES, tooWide, unnamed } from "./checks";
import { newStudy } from "./participants";
import { byClicks, nextDecision, sitDown } from "./play";
import { agent, clientsOf, gameOf, newPhysicalRoom, newRoom } from "./rooms";
import { browser, person, server, useStage } from "./stage";

const COMPUTER = { width: 1280, height: 800 };
const MOST_FIRST_PAGE_BYTES = 200_000;

/** A page whose device holds a seat at a table with an open decision. */
let seated: Page;
let gameId: string;
let tournamentId: string;
/** A tournament created by the device that has not started. */
let ownId: string;
let rooms: { over: string; table: string; waiting: string; wizard: string };
/** A study whose key the device has. */
let studyId: string;
/** A room with real cards, which the device attends to. */
let physicalId: string;
/** Join code of a room in which the device has no seat. */
let code: string;

useStage();

beforeAll(async () => {
  const over = await newRoom(server, { seats: ["agent", "greedy", "random", "trained"], rated: true });
  expect(await agent(server, "greedy", over.code, "Gustav")).toBe(0);
  gameId = await gameOf(server, over.roomId);
  const { tournament } = await clientsOf(server).tournaments.createTournament({
    settings: {
      name: "Spring cup",
      format: TournamentFormat.KNOCKOUT,
      rules: { preset: "paper", faces: 8, stop: { case: "targetShifts", value: 1 } },
      builtInAgents: Array.from({ length: 8 }, (_, index) => (index % 2 === 0 ? "greedy" : "random")),
      startWhenJoined: 8,
    },
  });
  tournamentId = tournament?.tournamentId ?? "";
  const table = await newRoom(server, { seats: ["person", "greedy", "random", "greedy"] });
  const waiting = await newRoom(server, { seats: ["person", "agent", "random", "greedy"], name: "Sunday" });
  const wizard = await newRoom(server, { seats: ["wizard", "greedy", "random", "greedy"], policy: { hints: true } });
  rooms = { over: over.roomId, table: table.roomId, waiting: waiting.roomId, wizard: wizard.roomId };
  code = (await newRoom(server, { seats: ["person", "agent", "random", "greedy"], name: "Monday" })).code;
  seated = (await person(browser)).page;
  const physical = await newPhysicalRoom(server, ["Ada", "Bo", "Cleo"]);
  physicalId = physical.roomId;
  await seated.goto(`${server.url}/rooms/${physicalId}/table#ticket=${physical.tableTicket}`);
  await seated.locator('[data-part~="entry"]').waitFor();
  // Each is waited for: a seat whose holder has never been there is free again after two minutes.
  await sitDown(seated, server, waiting.code, "Rosa");
  await seated.locator('[data-part~="waiting-seat"]').filter({ hasText: "Rosa" }).filter({ hasText: "✓" }).waitFor();
  await sitDown(seated, server, table.code, "Rosa");
  await nextDecision(seated);
  await sitDown(seated, server, `${wizard.code}?as=robot`, "Robo");
  await nextDecision(seated);
  await seated.goto(`${server.url}/tournaments/new`);
  await seated.getByLabel("Name of the tournament").fill("My league");
  await seated.getByLabel("greedy", { exact: true }).fill("2");
  await seated.getByRole("button", { name: "Create the tournament" }).click();
  await seated.locator('[data-part~="organiser"]').waitFor();
  ownId = new URL(seated.url()).pathname.split("/").at(-1) ?? "";
  const study = await newStudy(server, { participants: 4 });
  studyId = study.studyId;
  await clientsOf(server).studies.addStudyParticipants({ ...study, count: 2 });
  await seated.goto(`${server.url}/studies/${studyId}`);
  await seated.getByLabel("Owner token").fill(study.ownerToken);
  await seated.getByRole("button", { name: "Use this key" }).click();
  await seated.locator('[data-part~="participants"]').waitFor();
  await seated.goto(`${server.url}/rooms/${rooms.table}`);
  // A few turns later, so that the board and the log have content.
  for (let turn = 0, id = await nextDecision(seated); turn < 2; turn += 1) {
    await byClicks(seated);
    id = await nextDecision(seated, id);
  }
});

/** Every page: its address, and an element that is there once it is rendered. */
const PAGES: Record<string, { path: () => string; ready: string; opened?: string }> = {
  lobby: { path: () => "/", ready: '[data-part~="lobby-rooms"] li' },
  "new room": {
    path: () => "/new",
    ready: '[data-part~="new-room-form"]',
    opened: '[data-part~="new-room-form"] summary',
  },
  join: { path: () => "/join", ready: "form" },
  "wrong code": { path: () => "/join/ABCD2345", ready: '[role="alert"]' },
  invitation: { path: () => `/join/${code}`, ready: '[data-part~="join-room"]' },
  "waiting room": { path: () => `/rooms/${rooms.waiting}`, ready: '[data-part~="waiting-seat"]' },
  table: { path: () => `/rooms/${rooms.table}`, ready: "[data-decision]" },
  "look-up table": {
    path: () => `/rooms/${rooms.table}`,
    ready: "[data-decision]",
    opened: '[data-part~="tool-lookup"]',
  },
  "what can I do": {
    path: () => `/rooms/${rooms.table}`,
    ready: "[data-decision]",
    opened: '[data-part~="help"]',
  },
  phrases: {
    path: () => `/rooms/${rooms.table}`,
    ready: "[data-decision]",
    opened: '[data-part~="expressions"] button:last-of-type',
  },
  settings: { path: () => "/tutorial", ready: '[data-part~="lesson"]', opened: '[data-part~="header-settings"]' },
  rules: { path: () => "/rules", ready: '[data-part~="rules"]' },
  console: { path: () => `/rooms/${rooms.wizard}`, ready: '[data-part~="wizard-moves"] button' },
  leaving: { path: () => `/rooms/${rooms.table}`, ready: "[data-decision]", opened: '[data-part~="tool-leave"]' },
  "table with real cards": { path: () => `/rooms/${physicalId}/table`, ready: '[data-part~="entry"]' },
  "entering a play": {
    path: () => `/rooms/${physicalId}/table`,
    ready: '[data-part~="entry"]',
    opened: '[data-part~="choice"] button',
  },
  watch: { path: () => `/watch/${rooms.table}`, ready: '[data-view="watched"]' },
  "end of a game": { path: () => `/watch/${rooms.over}`, ready: '[data-part~="result"]' },
  replay: {
    path: () => `/replay/${gameId}`,
    ready: '[data-part~="replay"]',
    opened: '[data-part~="replay-decision"] summary',
  },
  analysis: {
    path: () => `/replay/${gameId}`,
    ready: '[data-part~="replay"]',
    opened: '[data-part~="replay-analysis"] summary',
  },
  tournaments: { path: () => "/tournaments", ready: "main li a" },
  "new tournament": {
    path: () => "/tournaments/new",
    ready: '[data-part~="new-room-form"]',
    opened: '[data-part~="new-room-form"] summary',
  },
  "tournament of one's own": {
    path: () => `/tournaments/${ownId}`,
    ready: '[data-part~="organiser"]',
  },
  tournament: { path: () => `/tournaments/${tournamentId}`, ready: '[data-part~="standings"] tbody tr' },
  wall: { path: () => `/tournaments/${tournamentId}?wall`, ready: '[data-part~="standings"] tbody tr' },
  "wall before": { path: () => `/tournaments/${ownId}?wall`, ready: '[data-part~="entrants"] li' },
  results: { path: () => `/tournaments/${tournamentId}/results`, ready: '[data-part~="certificates"], footer' },
  studies: { path: () => "/studies", ready: "main li a" },
  "new study": { path: () => "/studies/new", ready: "main form" },
  "study of one's own": { path: () => `/studies/${studyId}`, ready: '[data-part~="participants"] tbody tr' },
  leaderboard: { path: () => "/leaderboard", ready: "tbody tr" },
  "a person": { path: () => "/people/Gustav", ready: "tbody tr" },
  tutorial: { path: () => "/tutorial", ready: '[data-part~="lesson"]' },
  "not found": { path: () => "/nowhere/at/all", ready: "h1" },
};

test.each(Object.keys(PAGES))("%s: accessible in both themes, and no wider than a phone", async (name) => {
  const { path = () => "", ready = "", opened } = PAGES[name] ?? {};
  const page = seated;
  await page.emulateMedia({ reducedMotion: "reduce" });
  await page.setViewportSize(COMPUTER);
  await page.goto(server.url + path());
  await page.locator(ready).first().waitFor();
  if (opened) await page.locator(opened).first().click();
  expect(await inaccessible(page)).toEqual([]);
  for (const phone of PHONES.toReversed()) {
    await page.setViewportSize(phone);
    // The page adapts to the new size over a few frames.
    await expect.poll(() => tooWide(page), { message: JSON.stringify(phone) }).toEqual([]);
  }
  // Texts in other languages are longer.
  for (const { value } of LANGUAGES.filter(({ value }) => value !== "en")) {
    await page.goto(`${server.url}${path()}${path().includes("?") ? "&" : "?"}lang=${value}`);
    await page.locator(ready).first().waitFor();
    if (opened) await page.locator(opened).first().click();
    expect(await page.locator("html").getAttribute("lang")).toBe(value);
    expect(await unnamed(page), value).toEqual([]);
    await expect.poll(() => tooWide(page), { message: value }).toEqual([]);
  }
});

test("the checks find what is wrong with a page", async () => {
  const { page } = await person(browser);
  await page.setContent(`
    <style>@media (prefers-color-scheme: dark) { p { color: #777; background: #666 } }</style>
    <main style="width: 3000px"><h1>A page</h1><h3>Skips a level</h3><p>Seen by day</p><button></button></main>`);
  const [everything, names] = [await inaccessible(page), await unnamed(page)];
  for (const rule of ["button-name", "document-title", "heading-order", "html-has-lang"])
    expect(everything.join("\n")).toContain(`light: ${rule}: `);
  expect(everything.filter((finding) => finding.includes("color-contrast")).join()).toMatch(/^dark: /);
  expect(names.map((finding) => finding.split(":")[0])).toEqual(["button-name", "document-title", "html-has-lang"]);
  expect(await tooWide(page)).not.toEqual([]);
});

const LOCALES = ["en-GB", "de-DE", "es-ES", "it-IT"];

test.each(LOCALES)("the first page in %s loads one language and less than 200 kB", async (locale) => {
  const { page } = await person(browser, { locale });
  const network = await page.context().newCDPSession(page);
  let bytes = 0;
  const kinds = new Set<string>();
  await network.send("Network.enable");
  const underWay = new Set<string>();
  network.on("Network.requestWillBeSent", ({ requestId }) => underWay.add(requestId));
  const texts = new Set<string>();
  network.on("Network.responseReceived", ({ type, response }) => {
    kinds.add(type);
    const [, language] = /\/assets\/([a-z]{2})-[^/]+\.js$/.exec(response.url) ?? [];
    if (language) texts.add(language);
  });
  network.on("Network.loadingFinished", ({ requestId, encodedDataLength }) => {
    bytes += encodedDataLength;
    underWay.delete(requestId);
  });
  await page.goto(`${server.url}/`);
  await page.locator('[data-part~="lobby-rooms"] li').first().waitFor();
  await page.evaluate(() => document.fonts.ready.then(() => undefined));
  const loaded = expect.arrayContaining(["Document", "Script", "Stylesheet", "Font", "Fetch"]);
  await expect.poll(() => ({ kinds: [...kinds], underWay: underWay.size })).toEqual({ kinds: loaded, underWay: 0 });
  expect([...texts]).toEqual([locale.slice(0, 2)]);
  expect(bytes).toBeGreaterThan(50_000);
  expect(bytes).toBeLessThan(MOST_FIRST_PAGE_BYTES);
});
