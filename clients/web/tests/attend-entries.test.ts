// What an attendant types and opens: cards, links with a ticket.

import { create } from "@bufbuild/protobuf";
import { expect, test } from "vitest";
import { cardsOfDraft, draftOf, entriesAt, handText, NO_PLAY, parseHand, seenOf } from "../src/attend/entries";
import { attendantLink, keepTableTicket, tableTicket, takeTicket, ticketIn } from "../src/attend/ticket";
import { SeenCardsSchema } from "../src/gen/chefshat/v1/table_service_pb";
import { DEALT, stateOf } from "./table-state";

const DECK = { faces: 11, jokers: 2 };

test.each([
  ["", [], undefined],
  ["3 4 4 J", [3, 4, 4, 12], undefined],
  [" j,11; 2x4 ", [4, 4, 11, 12], undefined],
  ["2×J", [12, 12], undefined],
  ["3J", [], { kind: "word", word: "3J" }],
  ["12", [], { kind: "word", word: "12" }],
  ["0 5", [5], { kind: "word", word: "0" }],
  ["four 5", [5], { kind: "word", word: "four" }],
  ["99999x5", [], { kind: "word", word: "99999x5" }],
  ["1 1", [1, 1], { kind: "tooMany", face: 1, all: 1 }],
  ["3xJ", [12, 12, 12], { kind: "tooManyJokers", all: 2 }],
])("of %j the cards are %j", (text, cards, problem) => {
  const parsed = parseHand(text, DECK);
  expect(parsed.cards).toEqual(cards);
  expect(parsed.problem).toEqual(problem);
  if (!problem) expect(parseHand(handText(parsed.cards, DECK), DECK).cards).toEqual(cards);
});

test.each([
  [[9, 9, 12], false],
  [[11, 11], true],
  [[12], false],
])("a play of %j is drafted and reported the same", (cards, golden) => {
  const draft = draftOf(create(SeenCardsSchema, { cards, golden }), DECK);
  expect(seenOf(cardsOfDraft(draft, DECK), DECK)).toEqual({ cards, golden });
});

test("nothing picked is no cards", () => {
  expect(cardsOfDraft(NO_PLAY, DECK)).toEqual([]);
});

test("what can be entered depends on the moment", () => {
  expect(entriesAt(stateOf())).toEqual(["turn", "passWithdrawn", "cleared", "hand"]);
  expect(entriesAt(stateOf({ observation: DEALT }))).toEqual(["turn", "hand"]);
  expect(entriesAt(stateOf({ observation: { ...DEALT, shift: 2 } }))).toEqual([
    "turn",
    "special",
    "gift",
    "hand",
    "role",
  ]);
});

test("a link gives its ticket to another device, and the address loses it", () => {
  const [room, other] = ["ab".repeat(16), "cd".repeat(16)];
  const ticket = room + "01".repeat(32);
  const link = new URL(attendantLink(room, ticket));
  expect(link.pathname).toBe(`/rooms/${room}/table`);
  expect(link.search).toBe("");
  expect(ticketIn(link.hash)).toBe(ticket);
  history.replaceState(null, "", link.pathname + link.hash);
  expect(takeTicket(room)).toBe(ticket);
  expect(location.hash).toBe("");
  expect(tableTicket(room)).toBe(ticket);
  expect(takeTicket(other)).toBeNull();
  // A link that was cut, or is another room's, leaves this device its ticket.
  for (const wrong of [ticket.slice(0, -4), other + "01".repeat(32)]) {
    history.replaceState(null, "", `${link.pathname}#ticket=${wrong}`);
    expect(takeTicket(room)).toBe(ticket);
    expect(location.hash).toBe("");
  }
});

test.each(["", "#content", "#ticket=", "#ticket=%E0%A4%A"])("%j has no ticket", (hash) => {
  keepTableTicket("r1", null);
  expect(ticketIn(hash)).toBeNull();
});
