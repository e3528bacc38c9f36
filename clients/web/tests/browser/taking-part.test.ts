// A person in a tournament: joins on its page, plays each of its games there through a reload and a
// server crash, and returns to the standings. Also the wall view of the tournament.

import { expect, test } from "vitest";
import { TournamentFormat } from "../../src/gen/chefshat/v1/tournament_pb";
import { byClicks, playOn } from "./play";
import { clientsOf } from "./rooms";
import { browser, person, server, useStage } from "./stage";

useStage();

/**
 * Creates a tournament of one Shift per game that starts with a number of participants, by default
 * with one person. Returns its id and join code.
 */
async function newTournament(rounds: number, startWhenJoined = 4): Promise<{ id: string; code: string }> {
  const { tournament, joinCode } = await clientsOf(server).tournaments.createTournament({
    settings: {
      name: "Friday league",
      format: TournamentFormat.SWISS,
      rounds,
      rules: { preset: "paper", faces: 5, stop: { case: "targetShifts", value: 1 } },
      policy: { decisionTimeMs: 3_600_000, paceMs: 0, spectators: true },
      builtInAgents: ["greedy", "random", "random"],
      startWhenJoined,
      // A Shift of so few cards may otherwise be over before all interruptions.
      dealSeed: new Uint8Array(32).fill(7),
    },
  });
  if (!tournament) throw new Error("the server did not say which tournament it made");
  return { id: tournament.tournamentId, code: joinCode };
}

test("a person joins, plays every game of the tournament and sees the final standings", async () => {
  const { id, code } = await newTournament(2);
  const wall = await person(browser);
  await wall.page.goto(`${server.url}/tournaments/${id}?wall`);
  await wall.page.getByText("open to join").waitFor();
  expect(await wall.page.locator('[data-part~="header"]').isVisible()).toBe(false);

  const { page, faults } = await person(browser);
  await page.goto(`${server.url}/tournaments/${id}`);
  await page.getByRole("button", { name: "Join the tournament" }).click();
  await page.getByText("Enter the code that the organiser gave you.").waitFor();
  await page.getByLabel("Join code of the tournament").fill(code.toLowerCase());
  await page.getByLabel("Your name").fill("Rosa");
  await page.getByRole("button", { name: "Join the tournament" }).click();

  // The first game starts automatically, and returns to the same decision after a reload and a
  // server crash.
  let interrupted = 0;
  await playOn(page, byClicks, async (already) => {
    if (already !== 1 && already !== 2) return;
    const before = await page.locator("[data-decision]").getAttribute("data-decision");
    if (already === 1) await page.reload();
    else {
      await server.restart();
      await page.getByText("The server restarted; the game continues").first().waitFor();
    }
    await page.locator(`[data-decision="${before}"]`).waitFor();
    interrupted += 1;
  });
  expect(interrupted).toBe(2);

  // The second game replaces the first one's result, or is opened from the standings.
  const second = page.getByText("Friday league · round 2, table 1");
  await second.waitFor();
  // The page of the tournament is a press away, and calls back.
  await page.getByRole("button", { name: "Back to the tournament" }).click();
  await page.getByRole("button", { name: "Leave the tournament…" }).waitFor();
  await page.getByRole("alert").getByText("Your turn").waitFor();
  await page.getByRole("button", { name: "Go to my game" }).click();
  await playOn(page, byClicks);
  await page.getByRole("button", { name: "Back to the standings" }).click();
  await page.getByText("The tournament is over. Thank you for playing.").waitFor();
  const standings = page.getByRole("table", { name: "Final standings" });
  await standings.getByRole("row", { name: /Rosa person/ }).waitFor();
  expect(await standings.getByRole("row").count()).toBe(5);
  expect(faults.filter((fault) => !/net::|Failed to load/.test(fault))).toEqual([]);

  await wall.page.getByText("finished").waitFor();
  await wall.page.getByRole("table").getByText("Rosa").waitFor();
});

test("a wrong code and a taken name are explained", async () => {
  const { id, code } = await newTournament(1);
  const { page } = await person(browser, { locale: "it-IT" });
  await page.goto(`${server.url}/tournaments/${id}?code=22222222`);
  await page.getByLabel("Il tuo nome").fill("greedy");
  const join = page.getByRole("button", { name: "Iscriviti al torneo" });
  await join.click();
  await page.getByRole("alert").waitFor();
  await page.getByLabel("Codice d’ingresso del torneo").fill(code);
  await join.click();
  await page.getByText("Qualcun altro ha già questo nome.").waitFor();
});

test("entering a code again leads back to the place taken with it", async () => {
  const { id, code } = await newTournament(1, 8);
  const { page, faults } = await person(browser);
  const typed = async () => {
    await page.goto(`${server.url}/join`);
    await page.getByLabel("Join code").fill(code);
    await page.getByRole("button", { name: "Continue" }).click();
    await page.waitForURL(new RegExp(`/tournaments/${id}`));
  };
  await typed();
  await page.getByLabel("Your name").fill("Rosa");
  await page.getByRole("button", { name: "Join the tournament" }).click();
  await page.getByText("You are taking part as Rosa.").waitFor();
  await typed();
  await page.getByText("You are taking part as Rosa.").waitFor();
  expect(await page.getByRole("button", { name: "Join the tournament" }).count()).toBe(0);
  const { tournament } = await clientsOf(server).tournaments.getTournament({ tournamentId: id });
  expect(tournament?.participants.map(({ name }) => name).filter((name) => name === "Rosa")).toEqual(["Rosa"]);
  expect(tournament?.participants).toHaveLength(4);
  expect(faults).toEqual([]);
});
