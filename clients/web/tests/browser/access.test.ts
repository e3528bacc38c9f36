// A server that requires tokens: links with a token, invitations without one, refusals in words.

import { afterAll, beforeAll, expect, test } from "vitest";
import { byClicks, nextDecision } from "./play";
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

test("a token that is not enough is explained, in the language of the person", async () => {
  const { page } = await person(browser, { locale: "it-IT" });
  await page.goto(`${closed.url}/new#token=chefshat_00000000_${"A".repeat(43)}`);
  await page.getByRole("button", { name: "Crea la stanza" }).click();
  await page.getByText("Il server non riconosce il token del tuo link.").waitFor();
  await page.goto(`${closed.url}/new#token=${closed.tokenFor("player")}`);
  await page.getByRole("button", { name: "Crea la stanza" }).click();
  await page.getByText("Il tuo link non lo permette.").waitFor();
});
