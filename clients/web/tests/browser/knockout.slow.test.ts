// A knockout of people, built-in agents and a robot. One person closes the page at their first
// decision, another in the final. The others see for whom and how long they wait, and substitutes
// play on.

import type { Page } from "playwright-core";
import { expect, test } from "vitest";
import { DecisionSource } from "../../src/gen/chefshat/v1/event_pb";
import type { RecordLine } from "../../src/gen/chefshat/v1/record_pb";
import { ParticipantKind } from "../../src/gen/chefshat/v1/room_pb";
import {
  TournamentFormat,
  type TournamentGame,
  TournamentGameState,
  TournamentState,
} from "../../src/gen/chefshat/v1/tournament_pb";
import { byClicks, hearing } from "./play";
import { clientsOf, program, recordOf } from "./rooms";
import { browser, person, server, until, useStage } from "./stage";

/** How long a game waits for a person who is away: the default in tournaments. */
const ABSENCE_MS = 12_000;
/** How long a game waits for a participant who does not come to it; Rosa does not come to the final. */
const NO_SHOW_MS = 20_000;
const BANK_MS = 60_000;

const AGENTS = ["greedy", "random"];
const ROBOT = "Pepe";
/** The first of them leaves at her first decision. */
const PEOPLE = ["Rosa", "Karl", "Ines", "Nino", "Vera"];
/** Draws a person and the robot for Rosa's table, and so many people for the other that one reaches the final. */
const DRAW_SEED = new Uint8Array(32).fill(18);
const TABLES = [
  ["Ines", "Pepe", "Rosa", "greedy"],
  ["Karl", "Nino", "Vera", "random"],
];
/** With these deals, Rosa's substitute reaches the final, which does not wait for her again. */
const DEAL_SEED = new Uint8Array(32).fill(1);

/** The line that says whom the game waits for, if that seat is away. */
const AWAY_LINE = '[data-part~="awaited"][data-away]';

useStage();

test("two people leave a knockout, the others see for whom they wait, and substitutes play on", async () => {
  const { tournaments } = clientsOf(server);
  const { tournament, joinCode, ownerToken } = await tournaments.createTournament({
    settings: {
      name: "Evening cup",
      format: TournamentFormat.KNOCKOUT,
      rules: { preset: "paper", faces: 5, stop: { case: "targetShifts", value: 1 } },
      policy: {
        decisionTimeMs: 3_600_000,
        bankMs: BANK_MS,
        paceMs: 0,
        substitute: "greedy",
        spectators: true,
      },
      builtInAgents: AGENTS,
      noShowTimeMs: NO_SHOW_MS,
      maxCalls: 1,
      drawSeed: DRAW_SEED,
      dealSeed: DEAL_SEED,
    },
  });
  const tournamentId = tournament?.tournamentId ?? "";
  const address = `${server.url}/tournaments/${tournamentId}`;
  const wall = await person(browser, { viewport: { width: 1920, height: 1080 } });
  await wall.page.goto(`${address}?wall&code=${joinCode}`);
  const invitation = wall.page.locator('[data-part~="wall-invitation"]');
  await invitation.getByText(`or open ${server.address} and enter ${joinCode}`).waitFor();
  await invitation.getByRole("img", { name: "QR code of the address" }).waitFor();

  // They join one after the other, because the draw depends on the order.
  const participants = async () => (await tournaments.getTournament({ tournamentId })).tournament?.participants ?? [];
  const here = (name: string) =>
    until(async () => (await participants()).some((one) => one.name === name && one.connected));
  const robot = program(
    ...["tournament", "join", "--agent", "greedy", "--kind-of", "robot", "--name", ROBOT, "--seed", "1"],
    ...["--server", server.url, "--code", joinCode],
  );
  await here(ROBOT);
  const players: Player[] = [];
  for (const name of PEOPLE) {
    players.push(await enter(`${address}?code=${joinCode}`, name));
    await here(name);
  }
  await wall.page.getByText("8 participants").waitFor();
  const everybody = await participants();
  const nameOf = ({ participant }: { participant: number }) => everybody[participant]?.name ?? "";
  const namesOf = (game: TournamentGame | undefined) => game?.seats.map(nameOf) ?? [];
  expect(everybody.find(({ name }) => name === ROBOT)?.kind).toBe(ParticipantKind.ROBOT);

  await tournaments.startTournament({ tournamentId, ownerToken });
  const over = ended(tournamentId);
  over.catch(() => {}); // Awaited below.
  await invitation.waitFor({ state: "detached" });
  await wall.page.getByText("round 1 of 2").waitFor();
  const games = async () => (await tournaments.listTournamentGames({ tournamentId })).games;
  expect((await games()).map((game) => namesOf(game).toSorted())).toEqual(TABLES);

  // Rosa leaves at once, and in the final the first person who decides, once a spectator is there.
  const spectator = await person(browser);
  const seenBySpectator = await hearing(spectator.page, AWAY_LINE);
  let second = "";
  const leaves = async (name: string, round: number) => {
    if (name === "Rosa") return true;
    if (round < 2 || second !== "") return false;
    second = name;
    const final = (await games()).find((game) => game.round === 2);
    await spectator.page.goto(`${server.url}/watch/${final?.roomId}`);
    await spectator.page.locator('[data-part~="table"]').waitFor();
    return true;
  };
  const gone = wall.page.getByRole("row", { name: "Rosa not connected" }).waitFor();
  await Promise.all([gone, ...players.map((player) => takePart(player, over, leaves))]);
  expect(await over).toBe(TournamentState.FINISHED);
  expect(await robot).toBe(0);

  // Every game counted once, and the others played on without those who left.
  const played = await games();
  expect(played.map(({ round, state, calls }) => [round, state, calls])).toEqual(
    [1, 1, 2].map((round) => [round, TournamentGameState.COUNTED, 1]),
  );
  const { standings } = await tournaments.getTournamentResults({ tournamentId });
  expect(standings.map((row) => row.games)).toEqual([2, 2, 2, 2, 1, 1, 1, 1]);
  const which = (what: "substituted" | "forfeited") =>
    played.flatMap(({ round, seats }) => seats.flatMap((seat) => (seat[what] ? [[round, nameOf(seat)]] : [])));
  expect(which("substituted")).toEqual([
    [1, "Rosa"],
    [2, second],
  ]);
  const records = await Promise.all(played.map(({ gameId }) => recordOf(server, gameId)));
  const waits = played.flatMap(({ seats }, index) => waitsIn(records[index] ?? [], seats.map(nameOf)));
  expect(waits.map(({ name, bankLeftMs, later }) => ({ name, bankLeftMs, later }))).toEqual(
    ["Rosa", second].map((name) => ({ name, bankLeftMs: BANK_MS, later: [DecisionSource.SUBSTITUTE] })),
  );

  // The final was called without Rosa if her substitute had reached it.
  const missed = which("forfeited");
  expect(missed).toEqual(namesOf(played[2]).includes("Rosa") ? [[2, "Rosa"]] : []);
  for (const { ms } of waits) expect(ms).toBeGreaterThanOrEqual(ABSENCE_MS - 1);

  // Everybody at their tables saw for whom the game waited, and how long.
  const stayed = players.filter(({ name }) => name !== "Rosa" && name !== second);
  for (const { name, seen } of players) if (name === "Ines") expectCountdown(seen, "Rosa");
  for (const { name, seen } of stayed) if (namesOf(played[2]).includes(name)) expectCountdown(seen, second);
  expectCountdown(seenBySpectator, second);

  // Everybody sees who won.
  const winner = standings[0] ? nameOf(standings[0]) : "";
  for (const { page } of stayed) {
    await page.getByRole("button", { name: "Back to the standings" }).click();
    await page.getByRole("table", { name: "Final standings" }).getByRole("row").nth(1).getByText(winner).waitFor();
  }
  await wall.page.getByRole("heading", { name: "Final standings" }).waitFor();
  await wall.page
    .getByRole("listitem")
    .filter({ hasText: `${winner}★` })
    .last()
    .waitFor();
  expect([wall, spectator, ...stayed].flatMap(({ faults }) => faults)).toEqual([]);
});

/** A person at a page of their own. */
interface Player {
  name: string;
  page: Page;
  faults: string[];
  /** The lines about seats that are away, as the page showed them. */
  seen: string[];
}

/** Opens an invitation to a tournament and joins. */
async function enter(invitation: string, name: string): Promise<Player> {
  const { page, faults } = await person(browser);
  const seen = await hearing(page, AWAY_LINE);
  await page.goto(invitation);
  await page.getByLabel("Your name").fill(name);
  await page.getByRole("button", { name: "Join the tournament" }).click();
  await page.getByText(`You are taking part as ${name}.`).waitFor();
  return { name, page, faults, seen };
}

/** Waits for the end of a tournament. */
async function ended(tournamentId: string): Promise<TournamentState | undefined> {
  let state: TournamentState | undefined;
  for await (const { tournament } of clientsOf(server).tournaments.followTournament({ tournamentId }))
    state = tournament?.state ?? state;
  return state;
}

/** Plays until the tournament is over, or closes the page at a decision at which the person leaves. */
async function takePart(
  { name, page }: Player,
  over: Promise<unknown>,
  leaves: (name: string, round: number) => Promise<boolean>,
): Promise<void> {
  const next = (before: string) =>
    page.waitForFunction(
      (before) => {
        const id = document.querySelector<HTMLElement>("[data-decision]")?.dataset.decision;
        const [, round] =
          /round (\d+)/.exec(document.querySelector('[data-part~="table-head"]')?.textContent ?? "") ?? [];
        const key = `${round} ${id}`;
        return id !== undefined && round !== undefined && key !== before && key;
      },
      before,
      { timeout: 0 },
    );
  for (let before = ""; ; ) {
    const found = next(before).then((handle) => handle.jsonValue());
    found.catch(() => {}); // Of no use once the tournament is over.
    const key = await Promise.race([found, over]);
    if (typeof key !== "string") return;
    if (await leaves(name, Number.parseInt(key, 10))) return page.close();
    await byClicks(page);
    before = key;
  }
}

/** A decision that ended because its seat was away. */
interface Wait {
  name: string;
  /** How long the game waited for the seat, by the server's clock. */
  ms: number;
  bankLeftMs: number;
  /** How the later decisions of the seat were taken, each way once. */
  later: DecisionSource[];
}

/** The waits of a game, in order. */
function waitsIn(record: readonly RecordLine[], names: readonly string[]): Wait[] {
  const goneAtMs = new Map<number, number>();
  const waits: Wait[] = [];
  for (const { line } of record) {
    if (line.case === "event" && line.value.kind.case === "disconnected")
      goneAtMs.set(line.value.kind.value.seat, Number(line.value.elapsedMs));
    if (line.case !== "decision") continue;
    const { seat, source, decisionTimeUs, bankLeftMs } = line.value;
    const name = names[seat] ?? "";
    for (const wait of waits) if (wait.name === name && !wait.later.includes(source)) wait.later.push(source);
    if (source !== DecisionSource.DISCONNECTED) continue;
    const endedAtMs = Number(line.value.elapsedMs);
    const openedAtMs = endedAtMs - Number(decisionTimeUs) / 1000;
    const ms = endedAtMs - Math.max(openedAtMs, goneAtMs.get(seat) ?? 0);
    waits.push({ name, ms, bankLeftMs, later: [] });
  }
  return waits;
}

/** Expects lines about a seat that is away, which count its seconds down. */
function expectCountdown(lines: readonly string[], name: string): void {
  const about = lines.filter((line) => line.includes(name));
  const seconds = about.map((line) => Number(/^Waiting for \w+ \(away\): (\d+) s$/.exec(line)?.[1]));
  expect(seconds).toEqual(seconds.toSorted((one, other) => other - one));
  expect(seconds.length).toBeGreaterThan(0);
  expect(seconds[0]).toBeLessThanOrEqual(ABSENCE_MS / 1000);
}
