// The 2x2 study of docs/studies/pairs.toml with pairs of people, from its file to its analysis: all
// take part at the same time. One leaves in the middle of a game, one comes late, one has a phone, and
// one comes when the study is full.

import { execFile } from "node:child_process";
import { mkdtempSync, readdirSync, readFileSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join, resolve } from "node:path";
import { promisify } from "node:util";
import { fromJson, type JsonValue } from "@bufbuild/protobuf";
import type { Page } from "playwright-core";
import { expect, test } from "vitest";
import { PlayServiceWatchResponseSchema } from "../../src/gen/chefshat/v1/play_service_pb";
import { RecordLineSchema } from "../../src/gen/chefshat/v1/record_pb";
import { StudyParticipantState } from "../../src/gen/chefshat/v1/study_pb";
import { consent, expectNoSecretSent, playGame, rowsOf, type Secrets, visit } from "./participants";
import { PATIENCE_MS } from "./patience";
import { clientsOf } from "./rooms";
import { browser, person, server, until, useStage } from "./stage";
import { Tap } from "./tap";

const DOCS = resolve(import.meta.dirname, "../../../../docs");
const ANALYSIS = resolve(import.meta.dirname, "../../../python/samples/study/analysis.py");
const WATCH = "/chefshat.v1.PlayService/Watch";

/** What the file plans: two pairs in each condition. */
const CONDITIONS = ["weak-shown", "weak-hidden", "strong-shown", "strong-hidden"];
const COUNT = 16;
const MEASURES = ["afterwards together", "hints", "place", "points", "seconds_per_decision", "timeouts_per_decision"];

const SECRETS: Secrets = {
  title: "A game of cards for two and others",
  names: ["pairs-pilot", ...CONDITIONS],
  words: ["weak", "random", "trained"],
};
/** The step at which people wait for a partner. */
const ARRIVAL = 2;
/** Decisions before one leaves in the middle of a game. */
const FEW = 2;
const LEAVES = 0;
const HAS_PHONE = 1;
const LATE = COUNT - 1;
const TOO_LATE = COUNT;
/** Nothing takes longer than the whole study. */
const WHOLE_STUDY_MS = 16 * PATIENCE_MS;
const PHONE = { viewport: { width: 390, height: 844 }, hasTouch: true, isMobile: true };

useStage();

test(
  "eight pairs of people, of whom one leaves, go through a 2x2 study, and its data are analysed",
  async () => {
    const researcher = await person(browser);
    const links = await linksOf(researcher.page, COUNT + 1);
    const tap = await Tap.before(server);
    const faults: string[] = [];
    /** What each participant saw of the seats of its game with people, and how many decisions it took. */
    const seen = new Map<number, string[]>();
    const decisions = new Map<number, number>();
    const pages: Page[] = [];

    const open = (index: number, options = {}) =>
      visit(links[index]?.replace(server.url, tap.url) ?? "", faults, SECRETS, options);
    const begin = async (index: number, options = {}) => {
      const visitor = await open(index, options);
      pages[index] = visitor.page;
      await consent(visitor.page);
      await playGame(visitor.page);
      return visitor;
    };
    /** Begins, and waits for the first decision beside a partner. */
    const arrive = async (index: number, options = {}) => {
      const visitor = await begin(index, options);
      await visitor.page.locator("[data-decision]").waitFor({ timeout: WHOLE_STUDY_MS });
      seen.set(index, await visitor.page.locator('[data-part~="seat"] h2').allInnerTexts());
      return visitor;
    };
    const leaveInTheMiddle = async (index: number) => {
      const { page, leave } = await arrive(index);
      await playGame(page, FEW);
      await leave();
    };
    const complete = async (index: number, options = {}) => {
      const { page, leave } = await arrive(index, options);
      decisions.set(index + 1, await playGame(page));
      await page.getByRole("radio", { name: /^4 of 7/ }).check();
      await page.getByRole("button", { name: "Send the answers" }).click();
      await page.getByText("The other players were a person and two programs.").waitFor();
      await page.getByRole("button", { name: "Continue" }).click();
      await page.getByRole("heading", { name: "Thank you for taking part" }).waitFor();
      await leave();
    };
    const owned = await keyOf(researcher.page);
    const participants = async () => (await clientsOf(server).studies.getStudy(owned)).participants;
    const comeLate = async () => {
      const alone = async () => (await participants()).slice(0, LATE).filter(({ group }) => group === 0);
      await until(async () => (await alone()).map(({ step }) => step).join() === String(ARRIVAL), WHOLE_STUDY_MS);
      const waiting = pages[((await alone())[0]?.number ?? 0) - 1];
      await waiting?.getByText("1 of 2 people are here", { exact: true }).waitFor();
      await complete(LATE);
    };
    const others = Array.from({ length: COUNT }, (_, index) => index).filter(
      (index) => ![LEAVES, HAS_PHONE, LATE].includes(index),
    );
    await Promise.all([
      leaveInTheMiddle(LEAVES),
      complete(HAS_PHONE, PHONE),
      ...others.map((index) => complete(index)),
      comeLate(),
    ]);
    const tooLate = await open(TOO_LATE);
    await tooLate.page.getByText("All places in this study are taken.").waitFor();
    await tooLate.leave();
    await until(async () => (await participants())[LEAVES]?.state === StudyParticipantState.DROPPED_OUT);
    expect(faults).toEqual([]);
    expectNoSecretSent(tap, SECRETS);
    expectNobodyAway(tap);
    await tap.stop();

    const conditionOf = (await participants()).map(({ conditions }) => conditions.join());
    const isShown = (index: number) => conditionOf[index]?.endsWith("shown");
    expect(seen.size).toBe(COUNT);
    for (const [index, names] of seen) {
      const agents = names.filter((name) => name.startsWith("Agent ")).length;
      const players = names.filter((name) => name.startsWith("Player ")).length;
      expect([agents, players], conditionOf[index]).toEqual(isShown(index) ? [2, 2] : [0, 4]);
    }
    const left = conditionOf[LEAVES] ?? "";
    const board = researcher.page.locator('[data-part="conditions"] tbody tr');
    const rows = () => board.allInnerTexts().then((texts) => texts.map((text) => text.split(/\s+/).join(" ")));
    // Not begun, taking part, completed, withdrawn, dropped out, removed, screened out, left over.
    const of = (condition: string) => `${condition} 0 0 ${condition === left ? "3 0 1" : "4 0 0"} 0 0 0`;
    await expect.poll(rows).toEqual([...CONDITIONS.map(of), `All 1 0 ${COUNT - 1} 0 1 0 0 0`]);

    const folder = await exported(researcher.page);
    expect(researcher.faults).toEqual([]);
    expectDescribed(folder);
    expectComplete(folder, decisions);
    expect(await analysed(folder)).toEqual(CONDITIONS.map((condition) => [condition, 2]));
    const whole = CONDITIONS.map((condition) => [condition, condition === left ? 1 : 2]);
    expect(await analysed(folder, "--whole-groups")).toEqual(whole);
    rmSync(folder, { recursive: true });
  },
  WHOLE_STUDY_MS,
);

/** Expects that no response says that a seat lost its connection, came back, or has a substitute. */
function expectNobodyAway(tap: Tap): void {
  const updates = tap.messages(WATCH, PlayServiceWatchResponseSchema).flatMap((message) => message.updates);
  const events = updates.flatMap(({ update }) => (update.case === "events" ? update.value.events : []));
  const kinds = new Set(events.map(({ kind }) => kind.case));
  expect(kinds).toContain("play");
  for (const kind of ["disconnected", "returned", "substituted"] as const) expect(kinds).not.toContain(kind);
}

/** Expects that the codebook has every column of every table, in order, and no other. */
function expectDescribed(folder: string): void {
  const described = new Map<string, string[]>();
  for (const { file = "", column = "" } of tableOf(folder, "codebook.csv"))
    described.set(file, [...(described.get(file) ?? []), column]);
  const tables = readdirSync(folder).filter((name) => name.endsWith(".csv") && name !== "codebook.csv");
  const header = (name: string) => readFileSync(join(folder, name), "utf8").split("\n")[0]?.split(",") ?? [];
  expect(described).toEqual(new Map(tables.map((name) => [name, header(name)])));
}

/** Expects the data of all who took part. `decisions`: how many each of them took, by its number, but the one who left. */
function expectComplete(folder: string, decisions: ReadonlyMap<number, number>): void {
  const participants = tableOf(folder, "participants.csv");
  const states = participants.map(({ state }) => state);
  expect(states).toEqual(states.map((_, index) => stateOf(index)));
  const groups = tableOf(folder, "groups.csv");
  expect(groups.map(({ conditions }) => conditions).sort()).toEqual([...CONDITIONS, ...CONDITIONS].sort());
  const left = participants[LEAVES]?.group;
  expect(groups.map(({ participants, completed }) => [participants, completed])).toEqual(
    groups.map(({ group }) => ["2", group === left ? "1" : "2"]),
  );
  for (const group of groups) {
    const members = participants.filter((one) => one.group === group.group);
    expect(members.map(({ number, conditions }) => [number, conditions])).toEqual(
      group.numbers?.split(" ").map((number) => [number, group.conditions]),
    );
  }

  // Each game has two rows and one record.
  const games = tableOf(folder, "games.csv");
  expect(games).toHaveLength(COUNT);
  const ids = new Set(games.map(({ game_id: id }) => id));
  expect(ids.size).toBe(groups.length);
  expect(readdirSync(join(folder, "records")).sort()).toEqual([...ids].map((id) => `${id}.jsonl`).sort());
  const played = games.filter(({ number }) => Number(number) !== LEAVES + 1);
  expect(new Map(played.map((game) => [Number(game.number), Number(game.decisions)]))).toEqual(decisions);
  for (const game of games) {
    const { number, outcome, participants, shifts, substituted } = game;
    expect([outcome, participants, shifts]).toEqual(["finished", "2", "2"]);
    expect(substituted, number).toBe(String(!played.includes(game)));
    // The agent of the condition played on.
    const agent = game.factor_agents === "weak" ? "random" : "trained";
    const substitutes = substitutesIn(folder, game.game_id ?? "").filter(([seat]) => String(seat) === game.seat);
    expect(substitutes).toEqual(substituted === "true" ? [[Number(game.seat), agent]] : []);
  }

  // The study asks for no kind of device: the data say what each had.
  const devices = tableOf(folder, "sessions.csv").map(({ number, width, height, pointer }) => [
    number,
    width,
    height,
    pointer,
  ]);
  expect(devices).toEqual(
    Array.from({ length: COUNT }, (_, index) => [
      String(index + 1),
      ...(index === HAS_PHONE ? ["390", "844", "coarse"] : ["1280", "800", "fine"]),
    ]),
  );
  const answers = tableOf(folder, "answers.csv");
  expect(answers.map(({ number, answer, status }) => [Number(number), answer, status])).toEqual(
    [...decisions.keys()].sort((one, other) => one - other).map((number) => [number, "4", "answered"]),
  );
}

/** Seat and agent of each substitution for good in a record. */
function substitutesIn(folder: string, gameId: string): [number, string][] {
  const lines = readFileSync(join(folder, "records", `${gameId}.jsonl`), "utf8")
    .trim()
    .split("\n");
  return lines.flatMap((text): [number, string][] => {
    const { line } = fromJson(RecordLineSchema, JSON.parse(text) as JsonValue);
    const kind = line.case === "event" ? line.value.kind : undefined;
    return kind?.case === "substituted" && kind.value.forGood ? [[kind.value.seat, kind.value.builtInAgent]] : [];
  });
}

function stateOf(index: number): string {
  if (index === LEAVES) return "dropped_out";
  return index === TOO_LATE ? "invited" : "completed";
}

function tableOf(folder: string, name: string) {
  return rowsOf(readFileSync(join(folder, name), "utf8"));
}

/** Creates the study of the file on the researcher's page, adds participants, and takes their links. */
async function linksOf(page: Page, count: number): Promise<string[]> {
  await page.goto(`${server.url}/studies/new`);
  const text = readFileSync(join(DOCS, "studies/pairs.toml"), "utf8");
  const file = { name: "pairs.toml", mimeType: "application/toml", buffer: Buffer.from(withOtherTimes(text)) };
  await page.getByLabel("File with the settings").setInputFiles(file);
  await page.getByText("“pairs-pilot”: 4 conditions, 6 stages.").waitFor();
  await page.getByRole("button", { name: "Create the study from this file" }).click();
  await page.getByLabel("How many").fill(String(count));
  await page.getByRole("button", { name: "Add", exact: true }).click();
  await until(async () => (await page.locator('[data-part="participants"] tbody tr').count()) === count);
  await page.getByRole("button", { name: "Show the links" }).click();
  const [saved] = await Promise.all([
    page.waitForEvent("download"),
    page.getByRole("button", { name: "Download as a table (CSV)" }).click(),
  ]);
  return rowsOf(readFileSync(await saved.path(), "utf8").replaceAll("\r", "")).map(({ link = "" }) => link);
}

/** Other times alone: one who leaves drops out as soon as a study may set, and nobody else is too late. */
function withOtherTimes(settings: string): string {
  return settings
    .replace("drop_out_after_ms = 600_000", "drop_out_after_ms = 60_000")
    .replace("wait_ms = 300_000", "wait_ms = 3_600_000")
    .replaceAll("policy = {", "policy = { decision_time_ms = 3_600_000, pace_ms = 100,");
}

/** The id and key of the study that a researcher's page shows. */
async function keyOf(page: Page): Promise<{ studyId: string; ownerToken: string }> {
  const key = page.locator("details").filter({ hasText: "Key of the study" });
  await key.locator("summary").click();
  const ownerToken = /[0-9a-f]{96}/.exec((await key.textContent()) ?? "")?.[0] ?? "";
  return { studyId: new URL(page.url()).pathname.split("/").pop() ?? "", ownerToken };
}

/** A folder with the data that the researcher's page gives. */
async function exported(page: Page): Promise<string> {
  const [saved] = await Promise.all([
    page.waitForEvent("download"),
    page.getByRole("button", { name: "Download the data (ZIP)" }).click(),
  ]);
  const folder = mkdtempSync(join(tmpdir(), "chefshat-pairs-"));
  await python("-m", "zipfile", "-e", await saved.path(), folder);
  return folder;
}

/**
 * The groups that the sample analysis counts in each condition, if they are the same for all measures,
 * and it prints each measure once for each condition.
 */
async function analysed(folder: string, ...options: readonly string[]): Promise<[string, number][]> {
  const [people, groups, , ...lines] = (await python(ANALYSIS, folder, ...options)).trim().split("\n");
  expect(people).toBe("participants: 15 completed, 1 invited, 1 dropped_out");
  expect(groups).toBe("groups: 8, of which 7 are whole");
  const counts = lines.map((line) => /^ *(.+?) +(\S+) +(\d+) +\S+ +\S+$/.exec(line)?.slice(1) ?? [line]);
  const first = counts
    .slice(0, CONDITIONS.length)
    .map(([, condition = "", count]): [string, number] => [condition, Number(count)]);
  expect(counts).toEqual(
    MEASURES.flatMap((measure) => first.map(([condition, count]) => [measure, condition, String(count)])),
  );
  return first;
}

async function python(...args: readonly string[]): Promise<string> {
  const { stdout, stderr } = await promisify(execFile)(process.env.CHEFSHAT_PYTHON ?? "python3", [...args]);
  expect(stderr).toBe("");
  return stdout;
}
