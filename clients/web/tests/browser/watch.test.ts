// A spectator's page and every byte it receives: no hidden card before the end of the game.

import { expect, test } from "vitest";
import type { GameEvent } from "../../src/gen/chefshat/v1/event_pb";
import { SpectatorServiceWatchResponseSchema } from "../../src/gen/chefshat/v1/spectator_service_pb";
import { agent, newRoom } from "./rooms";
import { browser, person, server, useStage } from "./stage";
import { Tap } from "./tap";

const GET_ROOM = "/chefshat.v1.RoomService/GetRoom";
const WATCH = "/chefshat.v1.SpectatorService/Watch";

let tap: Tap;

useStage();

/**
 * A game of two Shifts, watched from start to end: the messages the page received, and whether it
 * ever showed an open hand.
 */
async function watched(policy: { spectatorsSeeHands?: boolean; spectatorDelayDecisions?: number }) {
  tap = await Tap.before(server);
  try {
    const { roomId, code } = await newRoom(server, {
      seats: ["agent", "greedy", "random", "greedy"],
      shifts: 2,
      faces: 8,
      policy: { ...policy, paceMs: 20 },
    });
    const { page, faults } = await person(browser);
    await page.addInitScript(() => {
      const look = () => {
        if (document.querySelector('[data-part~="seat-open"]')) document.documentElement.dataset.openHand = "seen";
      };
      new MutationObserver(look).observe(document, { childList: true, subtree: true });
    });
    await page.goto(`${tap.url}/watch/${roomId}`);
    await page.getByRole("heading", { name: "Friday evening" }).waitFor();
    expect(await agent(server, "greedy", code, "Gustav")).toBe(0);
    await page.getByRole("heading", { name: "The game is over", level: 1 }).waitFor();
    const openHand = (await page.locator("html").getAttribute("data-open-hand")) !== null;
    await page.context().close();
    expect(faults).toEqual([]);
    return { openHand, called: tap.called, messages: tap.messages(WATCH, SpectatorServiceWatchResponseSchema) };
  } finally {
    await tap.stop();
  }
}

/** The events that reveal a hidden card. */
function tellingOfHidden(events: readonly GameEvent[]): GameEvent[] {
  return events.filter(({ kind, rewards }) => {
    if (rewards.length > 0) return true;
    if (kind.case === "shiftStarted") return kind.value.hands.length > 0;
    return kind.case === "cardsExchanged" && (kind.value.cards.length > 0 || kind.value.golden);
  });
}

test("a spectator's page receives no hidden card before the end of the game", async () => {
  const { openHand, called, messages } = await watched({});
  const events = messages.flatMap((message) => message.events);
  const cases = events.map(({ kind }) => kind.case);
  expect(cases.filter((kind) => kind === "shiftStarted")).toHaveLength(2);
  expect(cases.filter((kind) => kind === "cardsExchanged")).toHaveLength(4);
  expect(cases.filter((kind) => kind === "play").length).toBeGreaterThan(20);
  expect(cases.at(-1)).toBe("gameEnded");
  expect(tellingOfHidden(events)).toEqual([]);
  expect(messages.filter(({ snapshot }) => snapshot?.observation)).toEqual([]);
  // No unknown fields, and no other call except the room's description, which has no cards.
  expect(messages.filter((message) => message.$unknown || message.events.some((event) => event.$unknown))).toEqual([]);
  expect([...called].filter((path) => path !== WATCH && path !== GET_ROOM)).toEqual([]);
  expect(openHand).toBe(false);
});

test("if a room shows hands, the same check finds them", async () => {
  const { openHand, messages } = await watched({ spectatorsSeeHands: true, spectatorDelayDecisions: 1 });
  const hands = messages.flatMap(({ events }) => tellingOfHidden(events));
  expect(hands.map(({ kind }) => kind.case)).toContain("shiftStarted");
  expect(openHand).toBe(true);
});
