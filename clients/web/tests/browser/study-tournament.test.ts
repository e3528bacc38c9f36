// A study in a tournament: a participant consents, joins with the name in the link, and has the
// study's settings in every game; decision times are recorded, and the questionnaire follows after
// the tournament, each time the link is opened.

import { expect, test } from "vitest";
import { TournamentFormat } from "../../src/gen/chefshat/v1/tournament_pb";
import { byClicks, playOn } from "./play";
import { clientsOf, recordOf } from "./rooms";
import { browser, person, server, useStage } from "./stage";

/** As in docs/playing.md. */
const PERSON_TIME_KEY = "person_decision_time_ms";
const ROUNDS = 2;

useStage();

test("a participant's link applies to every game of the tournament", async () => {
  const { tournaments } = clientsOf(server);
  const { tournament, joinCode } = await tournaments.createTournament({
    settings: {
      name: "Study league",
      format: TournamentFormat.SWISS,
      rounds: ROUNDS,
      rules: { preset: "paper", stop: { case: "targetShifts", value: 1 } },
      policy: { decisionTimeMs: 3_600_000, paceMs: 0, spectators: true },
      builtInAgents: ["greedy", "random", "random"],
      startWhenJoined: 4,
    },
  });
  const tournamentId = tournament?.tournamentId ?? "";
  const link = new URL(`${server.url}/tournaments/${tournamentId}`);
  link.search = new URLSearchParams({
    code: joinCode,
    name: "P07",
    lang: "it",
    hide: "log,expressions,pages",
    times: "1",
    consent: "Puoi smettere quando vuoi.",
    before: "https://forms.example/before?id={name}",
    after: "https://forms.example/after?id={name}&t={tournament}",
  }).toString();
  const { page, faults } = await person(browser);
  await page.goto(link.href);
  await page.getByText("Puoi smettere quando vuoi.").waitFor();
  await page.getByRole("button", { name: "Ho letto e acconsento" }).click();
  const questionnaire = page.getByRole("link", { name: "Apri il questionario" });
  expect(await questionnaire.getAttribute("href")).toBe("https://forms.example/before?id=P07");
  await page.getByRole("button", { name: "L’ho compilato" }).click();
  await page.getByRole("button", { name: "Iscriviti al torneo" }).click();
  await page.waitForURL(new RegExp(`/tournaments/${tournamentId}\\?lang=it$`));

  let taken = 0;
  for (let round = 1; round <= ROUNDS; round += 1) {
    await page.getByText(`Study league · round ${round}, table 1`).waitFor();
    taken += await playOn(page, byClicks, async (already) => {
      if (already === 1) await page.reload().then(() => page.locator("[data-decision]").waitFor());
      for (const left of ['[data-part~="log"]', '[data-part~="expressions"]', '[data-part~="header-nav"]'])
        expect(await page.locator(left).first().isVisible()).toBe(false);
    });
    if (round < ROUNDS) expect(await questionnaire.count()).toBe(0);
  }
  const after = `https://forms.example/after?id=P07&t=${tournamentId}`;
  await questionnaire.first().waitFor();
  expect(await questionnaire.first().getAttribute("href")).toBe(after);
  await page.getByRole("button", { name: "Torna alla classifica" }).click();
  await page.getByRole("heading", { name: "Classifica finale" }).waitFor();
  // The study hides the links of the standings.
  await expect.poll(() => page.locator("main a").count()).toBe(1);

  await page.goto(`${server.url}/?lang=it`);
  await page.getByRole("heading", { name: "Siediti e gioca" }).waitFor();
  await page.goto(link.href);
  expect(await questionnaire.getAttribute("href")).toBe(after);

  const { games } = await tournaments.listTournamentGames({ tournamentId });
  expect(games.length).toBe(ROUNDS);
  const own = [];
  for (const { gameId } of games) {
    const lines = (await recordOf(server, gameId)).map(({ line }) => line);
    const header = lines.flatMap((line) => (line.case === "header" ? line.value : []))[0];
    const seat = header?.seats.findIndex(({ name }) => name === "P07");
    own.push(...lines.flatMap((line) => (line.case === "decision" && line.value.seat === seat ? line.value : [])));
  }
  expect(own.length).toBe(taken);
  for (const { annotations } of own) expect(annotations?.extra[PERSON_TIME_KEY]).toMatch(/^\d+$/);
  expect(faults).toEqual([]);
});

test("the organiser creates links, which participants use in turn on one device", async () => {
  const { page, faults } = await person(browser);
  await page.goto(`${server.url}/tournaments/new`);
  await page.getByLabel("Name of the tournament").fill("Links");
  await page.getByRole("button", { name: "Create the tournament" }).click();
  await page.getByText("Links for a study").click();
  await page.getByLabel("Participants, one per line").fill("P01\nP02\nP02");
  await page.getByLabel("what happened").check();
  const links = await page.getByText(/\?code=[0-9A-Z]{8}&name=P0\d&hide=log$/).allTextContents();
  expect(links.map((link) => new URL(link).searchParams.get("name"))).toEqual(["P01", "P02"]);

  for (const [index, name] of ["P01", "P02"].entries()) {
    await page.goto(links[index] ?? "");
    // The previous participant's place is not given up without a question.
    if (index > 0) {
      await page.getByText("If someone else joins here, P01 cannot play any more games.").waitFor();
      await page.getByRole("button", { name: `Take part as ${name}` }).click();
    }
    await page.getByText(`You are taking part as ${name}.`).waitFor();
    await page.getByRole("button", { name: "Join the tournament" }).click();
    await page.locator('[data-part~="entrants"] [aria-current]').filter({ hasText: name }).waitFor();
  }
  // A link without a name asks who is using the device.
  await page.goto((links[0] ?? "").replace("name=P01&", ""));
  await page.getByRole("button", { name: "Continue as P02" }).click();
  await page.locator('[data-part~="entrants"] [aria-current]').filter({ hasText: "P02" }).waitFor();
  const tournamentId = new URL(page.url()).pathname.split("/").at(-1) ?? "";
  const { tournament } = await clientsOf(server).tournaments.getTournament({ tournamentId });
  const fingerprints = tournament?.participants.map(({ name, nameFingerprint }) => [name, nameFingerprint]);
  expect(fingerprints).toEqual([
    ["P01", ""],
    ["P02", ""],
  ]);
  expect(faults).toEqual([]);
});
