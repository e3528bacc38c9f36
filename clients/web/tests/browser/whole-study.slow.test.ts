// A whole study: of its participants some drop out, one withdraws and wants its data deleted, one
// changes the device, and others take the free places. In the end the conditions are balanced, no
// byte that reached a participant names one, the data are complete, and the deleted are nowhere.

import { mkdtempSync, readdirSync, readFileSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { fromJson, type JsonValue } from "@bufbuild/protobuf";
import type { Page } from "playwright-core";
import { expect, test } from "vitest";
import { RecordLineSchema } from "../../src/gen/chefshat/v1/record_pb";
import { type StudyParticipant, StudyParticipantState } from "../../src/gen/chefshat/v1/study_pb";
import {
  consent,
  emptyCells,
  expectNoSecretOn,
  expectNoSecretSent,
  newStudy,
  playGame,
  rowsOf,
  visit,
} from "./participants";
import { PATIENCE_MS } from "./patience";
import { clientsOf, program } from "./rooms";
import { server, until, useStage } from "./stage";
import { Tap } from "./tap";

/** Number of participants who complete the study, half of them in each condition. */
const COUNT = Number(process.env.CHEFSHAT_PARTICIPANTS ?? 4);
const DROPPING_OUT = Math.floor((COUNT + 4) / 8);
/** Number of participants who have their pages open at the same time. */
const AT_ONCE = 3;
/** The shortest that a study may set. */
const DROP_OUT_AFTER_MS = 60_000n;
/** Decisions before a participant leaves in the middle of a game. */
const FEW = 2;

const COLUMNS = {
  "participants.csv":
    "number,participant,panel_id,test,state,slot,conditions,factor_warmth,step,sessions,began_at_ms,ended_at_ms,consent_at_ms,consent_version,consent_text_sha256,consent_language,attention_checks,attention_checks_passed,data_deleted",
  "sessions.csv": "number,participant,session,opened_at_ms,width,height,pixels,pointer,time_zone",
  "games.csv":
    "study,number,participant,condition,factor_warmth,step,practice,attempt,seed_index,seed,seat,game_id,outcome,started_at_ms,ended_at_ms,place,points,substituted,shifts,decisions,invalid_answers,timeouts,hints,timed_decisions,decision_time_us",
  "answers.csv":
    "number,participant,step,condition,factor_warmth,questionnaire,item,scale,position,status,answer,label,passed,answered_after_ms,questionnaire_shown_at_ms,questionnaire_answered_at_ms",
  "traces.csv": "number,participant,condition,factor_warmth,game_id,session,decision_id,at_ms,kind,target,duration_ms",
};
const LEVELS: Partial<Record<string, string>> = { "cond-warm": "lvl-high", "cond-cold": "lvl-low" };

useStage();

test(
  `a study with ${COUNT} participants, of whom ${DROPPING_OUT + 1} leave and are replaced`,
  async () => {
    const { studies } = clientsOf(server);
    const owned = await newStudy(server, { participants: COUNT, dropOutAfterMs: DROP_OUT_AFTER_MS });
    const pseudonyms = Array.from({ length: COUNT + DROPPING_OUT + 1 }, (_, index) => `Subject${index + 101}`);
    const { links } = await studies.addStudyParticipants({ ...owned, pseudonyms });
    const tap = await Tap.before(server);
    const faults: string[] = [];
    /** The decisions of each participant in its game, without practice. */
    const decisions = new Map<string, number>();

    const open = (index: number) => visit(`${tap.url}/study/${links[index]?.link}`, faults);
    const begin = async (index: number) => {
      const visitor = await open(index);
      await consent(visitor.page);
      return visitor;
    };
    const finish = async (index: number, page: Page, before = 0) => {
      decisions.set(pseudonyms[index] ?? "", before + (await playGame(page)));
      await page.getByRole("heading", { name: "About the game" }).waitFor();
      await expectNoSecretOn(page);
      await page.getByRole("radio", { name: "4 of 5" }).check();
      await page.getByRole("radio", { name: "6 of 7" }).check();
      await page.getByRole("slider").press("ArrowRight");
      await page.getByRole("textbox").fill(`Said by ${index}`);
      await page.getByRole("button", { name: "Send the answers" }).click();
      await page.getByRole("heading", { name: "About this study" }).waitFor();
      await page.getByRole("button", { name: "Continue" }).click();
      await page.getByRole("heading", { name: "Thank you for taking part" }).waitFor();
    };
    const dropOut = async (index: number) => {
      const { page, leave } = await begin(index);
      await playGame(page, FEW);
      await leave();
    };
    const withdraw = async (index: number) => {
      const { page, leave } = await begin(index);
      await playGame(page);
      await playGame(page, FEW);
      await page.getByRole("button", { name: "Withdraw from the study…" }).click();
      await page.getByLabel("Also delete the data recorded so far").check();
      await page.getByRole("button", { name: "Withdraw now" }).click();
      await page.getByText("Your participation is over, and your data were deleted.").waitFor();
      await leave();
    };
    const changeDevice = async (index: number) => {
      const first = await begin(index);
      await playGame(first.page);
      const before = await playGame(first.page, FEW);
      const second = await open(index);
      await first.page.getByRole("heading", { name: "You continue on another device or page" }).waitFor();
      await first.leave();
      await finish(index, second.page, before);
      await second.leave();
    };
    const complete = async (index: number) => {
      const { page, leave } = await begin(index);
      await playGame(page);
      await finish(index, page);
      await leave();
    };
    const states = async () => (await studies.getStudy(owned)).participants.map(({ state }) => state);

    // Those who drop out come first: meanwhile the others play.
    const roles = pseudonyms.map((_, index) => {
      if (index < DROPPING_OUT) return dropOut;
      if (index === DROPPING_OUT) return withdraw;
      return index === DROPPING_OUT + 1 ? changeDevice : complete;
    });
    await some(roles.slice(0, COUNT), (role, index) => role(index));
    await until(async () => {
      const found = (await states()).slice(0, DROPPING_OUT);
      return found.every((state) => state === StudyParticipantState.DROPPED_OUT);
    });
    await some(roles.slice(COUNT), (role, index) => role(COUNT + index));
    expect(faults).toEqual([]);
    expectNoSecretSent(tap);
    await tap.stop();

    const { study, participants } = await studies.getStudy(owned);
    expect([study?.completed, study?.left, study?.active]).toEqual([COUNT, DROPPING_OUT + 1, 0]);
    expectBalanced(participants);
    const files = await exported(owned);
    expectComplete(files, participants, decisions);
    const deleted = pseudonyms[DROPPING_OUT] ?? "";
    expect([...files].filter(([, text]) => text.includes(deleted)).map(([name]) => name)).toEqual([]);
    await until(async () => !(await isStored(deleted)));
    expect(await isStored(pseudonyms.at(-1) ?? "")).toBe(true);
  },
  (COUNT + 4) * PATIENCE_MS,
);

/** Does something for all items, a few at a time. */
async function some<Item>(items: readonly Item[], act: (item: Item, index: number) => Promise<void>): Promise<void> {
  const waiting = items.entries();
  const work = async () => {
    for (const [index, item] of waiting) await act(item, index);
  };
  await Promise.all(Array.from({ length: AT_ONCE }, work));
}

/** Every slot has one participant who completed the study, and every condition as many slots. */
function expectBalanced(participants: readonly StudyParticipant[]): void {
  const completed = participants.filter(({ state }) => state === StudyParticipantState.COMPLETED);
  const slots = completed.map(({ slot }) => slot ?? -1).sort((one, other) => one - other);
  expect(slots).toEqual(Array.from({ length: COUNT }, (_, slot) => slot));
  const met = completed.map(({ conditions }) => conditions.join()).sort();
  expect(met).toEqual([...Array(COUNT / 2).fill("cond-cold"), ...Array(COUNT / 2).fill("cond-warm")]);
}

/** The data have all columns, and a value of each for all who completed the study. */
function expectComplete(
  files: ReadonlyMap<string, string>,
  participants: readonly StudyParticipant[],
  decisions: ReadonlyMap<string, number>,
): void {
  for (const [name, columns] of Object.entries(COLUMNS)) expect(files.get(name)?.split("\n")[0], name).toBe(columns);
  const rows = (name: keyof typeof COLUMNS) => rowsOf(files.get(name) ?? "");
  const people = rows("participants.csv");
  expect(people.map(({ number }) => Number(number))).toEqual(participants.map(({ number }) => number));
  const inState = (state: string) => people.filter((row) => row.state === state);
  expect(inState("completed")).toHaveLength(COUNT);
  expect(inState("dropped_out")).toHaveLength(DROPPING_OUT);
  expect(inState("withdrawn").map((row) => [row.participant, row.data_deleted])).toEqual([["", "true"]]);
  // None came from a panel. Nothing is known of the one whose data were deleted.
  const deleted = ["participant", "attention_checks", "attention_checks_passed"];
  expect(people.flatMap(emptyCells).filter((name) => name !== "panel_id")).toEqual(deleted);
  const sessions = rows("sessions.csv");
  for (const { number, sessions: opened, data_deleted: deleted } of people)
    expect(sessions.filter((row) => row.number === number)).toHaveLength(deleted === "true" ? 0 : Number(opened));
  expect(new Set(sessions.map(({ pointer, pixels }) => `${pointer} ${pixels}`))).toEqual(new Set(["fine 100"]));

  // Those who left had not finished a game that counts.
  const games = rows("games.csv");
  expect(games).toHaveLength(COUNT);
  expect(games.flatMap(emptyCells)).toEqual([]);
  expect(new Map(games.map((row) => [row.participant, Number(row.decisions)]))).toEqual(decisions);
  for (const game of games) {
    const { participant, condition = "" } = game;
    const person = people.find((row) => row.participant === participant);
    expect([person?.conditions, game.factor_warmth, game.outcome]).toEqual([condition, LEVELS[condition], "finished"]);
    const record = files.get(`records/${game.game_id}.jsonl`)?.trim().split("\n") ?? [];
    const [header] = record.map((line) => fromJson(RecordLineSchema, JSON.parse(line) as JsonValue));
    expect(header?.line.case).toBe("header");
    expect(record[0]).toContain(`"${condition}"`);
  }
  expect([...files.keys()].filter((name) => name.startsWith("records/"))).toHaveLength(COUNT);

  const answers = rows("answers.csv");
  for (const { participant } of games) {
    const own = answers.filter((row) => row.participant === participant);
    expect(own.every(({ status }) => status === "answered")).toBe(true);
    expect(own.map(({ item, answer }) => [item, answer])).toEqual([
      ["liked", "4"],
      ["real", "6"],
      ["effort", expect.stringMatching(/^\d+$/)],
      ["said", expect.stringMatching(/^Said by \d+$/)],
    ]);
    const kinds = rows("traces.csv").flatMap((row) => (row.participant === participant ? [row.kind] : []));
    for (const kind of ["decision_shown", "answer_sent"]) expect(kinds, participant).toContain(kind);
  }
  expect(answers).toHaveLength(4 * COUNT);
  expect([...new Set(answers.flatMap(emptyCells))]).toEqual(["scale", "label", "passed"]);
}

/** The files of an export, by name. */
async function exported(owned: { studyId: string; ownerToken: string }): Promise<Map<string, string>> {
  const files = new Map<string, string>();
  for await (const { file, data } of clientsOf(server).studies.exportStudy(owned))
    files.set(file, (files.get(file) ?? "") + new TextDecoder().decode(data));
  return files;
}

/** Whether the data directory has a text, or a copy of it, whose database has no unused pages. */
async function isStored(text: string): Promise<boolean> {
  const folder = mkdtempSync(join(tmpdir(), "chefshat-copy-"));
  const copy = join(folder, "copy");
  expect(await program("backup", copy, "--data-dir", server.dataDir)).toBe(0);
  // The files themselves too: what is deleted is overwritten.
  const found = [copy, server.dataDir].some((directory) =>
    readdirSync(directory, { recursive: true, withFileTypes: true }).some(
      (one) => one.isFile() && readFileSync(join(one.parentPath, one.name)).includes(text),
    ),
  );
  rmSync(folder, { recursive: true });
  return found;
}
