// The page of a tournament, open from before the start to the end, updates without a reload; and
// the wall view.

import { expect, test } from "vitest";
import { TournamentFormat } from "../../src/gen/chefshat/v1/tournament_pb";
import { clientsOf, program } from "./rooms";
import { browser, person, server, useStage } from "./stage";

useStage();

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
  const rows = page.locator('[data-part~="standings"] tbody tr');
  // Before the start nobody has a place.
  await expect.poll(() => page.locator('[data-part~="entrants"] li').count()).toBe(3);
  expect(await rows.count()).toBe(0);
  expect(await page.getByText("Gustav").count()).toBe(0);

  const args = ["--server", server.url, "--agent", "greedy", "--name", "Gustav", "--code", joinCode];
  expect(await program("tournament", "join", ...args)).toBe(0);
  await page.getByRole("heading", { name: "Final standings" }).waitFor();
  await expect.poll(() => rows.count()).toBe(4);

  const { standings } = await clientsOf(server).tournaments.getTournamentResults({
    tournamentId: tournament.tournamentId,
  });
  const shown = () => rows.evaluateAll((lines) => lines.map((line) => line.querySelector("td b")?.textContent));
  await expect.poll(shown).toEqual(standings.map(({ score, games }) => (Number(score) / games).toFixed(2)));
  expect(await rows.filter({ hasText: "Gustav" }).locator(".number").allInnerTexts()).toContain("3");
  expect(loads).toBe(1);

  // A certificate is printed on a sheet of its own, and nothing else with it.
  await page.getByRole("link", { name: "Results and certificates" }).click();
  await page.evaluate(() => {
    globalThis.print = () => {};
  });
  await page.getByRole("button", { name: "Print the certificate of Gustav" }).click();
  await page.locator('[data-part~="certificate"]').waitFor({ state: "attached" });
  const pdf = (await page.pdf({ preferCSSPageSize: true })).toString("latin1");
  const sizes = [...pdf.matchAll(/\/MediaBox \[0 0 (\d+)\.?\d* (\d+)/g)].map(([, width, height]) => [width, height]);
  expect(sizes).toEqual([["841", "594"]]);
  await page.evaluate(() => dispatchEvent(new Event("afterprint")));
  await page.locator('[data-part~="certificate"]').waitFor({ state: "detached" });
  expect(faults).toEqual([]);
});

test.each([
  ["one table", TournamentFormat.SWISS, 4, 0.05, "no-preference"],
  ["two tables", TournamentFormat.SWISS, 8, 0.035, "no-preference"],
  ["two tables and reduced motion", TournamentFormat.SWISS, 8, 0.035, "reduce"],
  ["a bracket", TournamentFormat.KNOCKOUT, 8, 0.03, "no-preference"],
  ["many tables", TournamentFormat.SWISS, 40, 0.025, "no-preference"],
  ["64 names", TournamentFormat.SWISS, 64, 0.02, "reduce"],
] as const)(
  "the wall view with %s fills the screen, and nothing is cut off",
  async (_, format, count, least, reducedMotion) => {
    const { tournaments } = clientsOf(server);
    const make = async (startWhenJoined: number) => {
      const settings = {
        name: "On the wall",
        format,
        rounds: format === TournamentFormat.SWISS ? 1 : 0,
        rules: { preset: "paper", faces: 8, stop: { case: "targetShifts" as const, value: 1 } },
        builtInAgents: Array<string>(count).fill("greedy"),
        startWhenJoined,
      };
      return (await tournaments.createTournament({ settings })).tournament?.tournamentId ?? "";
    };
    const [open, over] = [await make(0), await make(count)];
    const { page, faults } = await person(browser, { reducedMotion });
    for (const [width, height] of [
      [1280, 720],
      [1920, 1080],
      [3840, 2160],
    ] as const) {
      await page.setViewportSize({ width, height });
      for (const [id, ready] of [
        [open, '[data-part~="entrants"]'],
        [over, '[data-part~="standings"]'],
      ]) {
        await page.goto(`${server.url}/tournaments/${id}?wall`);
        await page
          .locator('[data-part~="wall-fitted"]')
          .locator(ready ?? "")
          .first()
          .waitFor();
        if (id === over) await page.getByText("finished").first().waitFor();
        const measured = () =>
          page.locator('[data-part~="wall-fitted"]').evaluateAll((boxes) =>
            boxes.map((box) => ({
              size: Number.parseFloat(getComputedStyle(box).fontSize),
              fits: box.scrollHeight <= box.clientHeight && box.scrollWidth <= box.clientWidth,
              written: box.textContent !== "",
            })),
          );
        // The size is computed again when a style sheet or font loads later.
        await expect.poll(async () => (await measured())[0]?.size).toBeGreaterThan(least * height);
        const full = Array<object>(id === over ? 2 : 1).fill({ fits: true, written: true });
        await expect.poll(measured).toMatchObject(full);
        expect(await page.evaluate(() => document.documentElement.scrollHeight <= window.innerHeight)).toBe(true);
        // A large screen has all names at once.
        if (id === over && width >= 1920) {
          expect(await page.locator('[data-part~="standings"] tbody tr').count()).toBe(count);
        }
      }
    }
    expect(faults).toEqual([]);
  },
);
