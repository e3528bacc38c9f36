// A server that requires tokens: links with a token, invitations without one, refusals in words.

import { afterAll, beforeAll, expect, test } from "vitest";
import { DecisionSource } from "../../src/gen/chefshat/v1/event_pb";
import { TournamentFormat } from "../../src/gen/chefshat/v1/tournament_pb";
import { byClicks, nextDecision, playOn, sitDown } from "./play";
import { clientsOf, gameOf, newRoom, recordOf } from "./rooms";
import { browser, person, Server, useStage } from "./stage";

useStage();

let closed: Server;
beforeAll(async () => {
  closed = await Server.startWithTokens();
});
afterAll(() => closed?.stop());

test("a host and a guest play with tokens of their own, which no address or invitation shows", async () => {
  const token = closed.tokenFor("host");
  const guestToken = closed.tokenFor("player");
  const host = await person(browser);
  await host.page.goto(`${closed.url}/new#token=${token}`);
  expect(host.page.url()).toBe(`${closed.url}/new`);
  await host.page.getByRole("button", { name: "Create the room" }).click();
  await host.page.waitForURL(/\/rooms\/[0-9a-f]{32}$/);
  const invitation = await host.page.getByText(/\/join\/[0-9A-Z]{8}$/).textContent();
  if (!invitation) throw new Error("the invitation is empty");
  expect(await host.page.content()).not.toContain(token);

  const guest = await person(browser);
  await guest.page.goto(invitation);
  await guest.page.getByText("This server is open to invited people only.").waitFor();
  // Only the part after "#" differs, so the browser does not load the page again by itself.
  await guest.page.goto(`${invitation}#token=${guestToken}`);
  await guest.page.getByLabel("Your name").fill("Rosa");
  expect(guest.page.url()).toBe(invitation);
  await guest.page.getByRole("button", { name: "Sit down" }).click();
  await guest.page.waitForURL(/\/rooms\//);
  const first = await nextDecision(guest.page);
  // A reload keeps the token.
  await guest.page.reload();
  expect(await nextDecision(guest.page)).toBe(first);
  await byClicks(guest.page);
  expect(await nextDecision(guest.page, first)).not.toBe(first);
});

test("a person plays a complete Shift with a link for players, while one with a link for spectators watches", async () => {
  const { roomId, code } = await newRoom(closed, { seats: ["person", "greedy", "random", "greedy"], faces: 5 });
  const watcher = await person(browser);
  await watcher.page.goto(`${closed.url}/watch/${roomId}#token=${await closed.tokenFor("spectator")}`);
  const player = await person(browser);
  await sitDown(player.page, closed, code, "Rosa", await closed.tokenFor("player"));
  const taken = await playOn(player.page, byClicks, async (already) => {
    if (already === 3) await player.page.reload();
  });
  const over = { name: "The game is over", level: 1 } as const;
  await player.page.getByRole("heading", over).waitFor();
  await watcher.page.getByRole("heading", over).waitFor();
  const record = await recordOf(closed, await gameOf(closed, roomId));
  const own = record.flatMap(({ line }) => (line.case === "decision" && line.value.seat === 0 ? [line.value] : []));
  expect(own.map(({ source }) => source)).toEqual(Array<number>(taken).fill(DecisionSource.AGENT));
  expect(taken).toBeGreaterThan(3);
  expect([...player.faults, ...watcher.faults]).toEqual([]);
});

test("a link to a tournament lets a person take part", async () => {
  const { tournaments } = clientsOf(closed);
  const { tournament, joinCode } = await tournaments.createTournament({
    settings: { name: "friday", format: TournamentFormat.SWISS, builtInAgents: ["greedy"] },
  });
  const { page, faults } = await person(browser);
  await page.goto(`${closed.url}/join/${joinCode}#token=${await closed.tokenFor("player")}`);
  await page.getByLabel("Your name").fill("Ana");
  await page.getByRole("button", { name: "Join the tournament" }).click();
  await page.getByText("You are taking part as Ana.").waitFor();
  expect(page.url()).toContain(tournament?.tournamentId);
  expect(faults).toEqual([]);
});

test("a token that is not enough is explained, in the language of the person", async () => {
  const { page } = await person(browser, { locale: "it-IT" });
  await page.goto(`${closed.url}/new#token=chefshat_00000000_${"A".repeat(43)}`);
  await page.getByRole("button", { name: "Crea la stanza" }).click();
  await page.getByText("Il server non riconosce il token del tuo link.").waitFor();
  await page.goto(`${closed.url}/new#token=${closed.tokenFor("player")}`);
  await page.getByRole("button", { name: "Crea la stanza" }).click();
  await page.getByText("Il tuo link non lo permette.").waitFor();
});
