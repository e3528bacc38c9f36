// The token of a link: taken from the address, sent with each call, and in no link of this page.

import type { UnaryRequest, UnaryResponse } from "@connectrpc/connect";
import { beforeEach, expect, test, vi } from "vitest";

const TOKEN = "chefshat_0badcafe_c2VjcmV0";

beforeEach(() => void vi.resetModules());

/** The page after it has been loaded at an address. */
async function opened(address: string) {
  history.replaceState(null, "", address);
  const page = await import("../src/api/token");
  page.startToken();
  return page;
}

/** The authorization that a call is sent with. */
async function sent({ authorize }: Awaited<ReturnType<typeof opened>>): Promise<string | null> {
  const request = { header: new Headers() } as UnaryRequest;
  await authorize(async () => ({}) as UnaryResponse)(request);
  return request.header.get("Authorization");
}

test("a token is removed from the address and sent with each call", async () => {
  const page = await opened(`/join/ABCD2345?lang=it#token=${TOKEN}`);
  expect(location.href).not.toContain(TOKEN);
  expect(location.pathname + location.search + location.hash).toBe("/join/ABCD2345?lang=it");
  expect(await sent(page)).toBe(`Bearer ${TOKEN}`);
});

test("a token lasts as long as the tab, and a newer one replaces it", async () => {
  await opened(`/#token=${TOKEN}`);
  vi.resetModules();
  expect(await sent(await opened("/"))).toBe(`Bearer ${TOKEN}`);
  vi.resetModules();
  expect(await sent(await opened("/#token=chefshat_1_2"))).toBe("Bearer chefshat_1_2");
});

test("without a token nothing is sent", async () => {
  expect(await sent(await opened("/#ticket=abc"))).toBeNull();
  expect(location.hash).toBe("#ticket=abc");
});

test("other parts of the hash remain", async () => {
  const { withoutToken } = await opened("/");
  const table: [string, string, string][] = [
    ["", "", ""],
    ["#", "", ""],
    ["#token=a", "a", ""],
    ["#ticket=b&token=a", "a", "#ticket=b"],
    ["#token=a&ticket=b%3D", "a", "#ticket=b%3D"],
    ["#mytoken=a", "", "#mytoken=a"],
  ];
  for (const [hash, token, rest] of table) expect(withoutToken(hash)).toEqual({ token, hash: rest });
});

test("no link that the page makes contains the token", async () => {
  await opened(`/rooms/0123#token=${TOKEN}`);
  const { invitation } = await import("../src/lobby/seat");
  const { attendantLink } = await import("../src/attend/ticket");
  const { invitationTo } = await import("../src/tournaments/hosting");
  for (const link of [invitation("ABCD2345"), attendantLink("0123", "secret"), invitationTo("0123", "ABCD2345")]) {
    expect(link).toContain(location.origin);
    expect(link).not.toContain(TOKEN);
  }
});
