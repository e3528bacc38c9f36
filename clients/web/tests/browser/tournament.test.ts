// The page of a tournament, left open from before its beginning to its end: it follows without being loaded again.

import type { Browser } from "playwright-core";
import { afterAll, beforeAll, expect, test } from "vitest";
import { TournamentFormat } from "../../src/gen/chefshat/v1/tournament_pb";
import { clientsOf, program } from "./rooms";
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

test("a tournament's page follows it from the first participant to the final standings", async () => {
  const { tournament, joinCode } = await clientsOf(server).tournaments.createTournament({
    settings: {
      name: "Spring cup",
      format: TournamentFormat.ROUND_ROBIN,
      rules: { preset: "paper", faces: 8, stop: { case: "targetShifts", value: 1 } },
      builtInAgents: ["greedy", "random", "greedy"],
      startWhenJoined: 4,
      rounds: 3,
      maxParallelGames: 1,
    },
  });
  if (!tournament) throw new Error("the server did not say which tournament it made");
  const { page, faults } = await person(browser);
  let loads = 0;
  page.on("load", () => {
    loads += 1;
  });
  await page.goto(`${server.url}/tournaments/${tournament.tournamentId}`);
  await page.getByRole("heading", { name: "Spring cup" }).waitFor();
  const rows = page.locator(".standings tbody tr");
  await expect.poll(() => rows.count()).toBe(3);
  expect(await page.getByText("Gustav").count()).toBe(0);

  const args = ["--server", server.url, "--agent", "greedy", "--name", "Gustav", "--code", joinCode];
  expect(await program("tournament", "join", ...args)).toBe(0);
  await page.getByRole("heading", { name: "Final standings" }).waitFor();
  await expect.poll(() => rows.count()).toBe(4);

  const { standings } = await clientsOf(server).tournaments.getTournamentResults({
    tournamentId: tournament.tournamentId,
  });
  const shown = await rows.evaluateAll((lines) => lines.map((line) => line.querySelector("td b")?.textContent));
  expect(shown).toEqual(standings.map(({ score }) => String(score)));
  expect(await rows.filter({ hasText: "Gustav" }).locator(".number").allInnerTexts()).toContain("3");
  expect(loads).toBe(1);
  expect(faults).toEqual([]);
});
