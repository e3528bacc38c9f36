// The tutorial's script follows the rules: every lesson can be done with the cards at hand, and
// counts add up.

import { expect, test } from "vitest";
import { actionOf } from "../src/table/model/actions";
import { applyEvent } from "../src/table/model/reduce";
import { allows, holds, publicRequirement } from "../src/table/model/requirement";
import { firstTable, LESSONS, nextEvent } from "../src/tutorial/lessons";

test("every lesson asks for a legal action, and leads to the next", () => {
  let table = firstTable("You");
  let turns = 0;
  const actions: number[] = [];
  for (const { decision, follows, name } of LESSONS) {
    const [move] = decision?.moves ?? [];
    for (const asked of decision?.moves ?? []) {
      expect(holds(table.seats[0]?.hand ?? [], asked), name).toBe(true);
      if (asked.kind !== "play") continue;
      turns += 1;
      expect(allows(publicRequirement(table), asked), name).toBe(true);
      expect(table.next ?? 0, name).toBe(0);
    }
    if (move) actions.push(actionOf(move, table.faces));
    for (const kind of follows(actions)) {
      if (kind.case === "play") {
        const { seat = 0, face = 0, quantity = 0, jokers = 0, cardsLeft = 0 } = kind.value;
        expect(allows(publicRequirement(table), { kind: "play", face, quantity, jokers }), name).toBe(true);
        expect(table.seats[seat]?.cardsLeft, `${name}: seat ${seat}`).toBe(cardsLeft + quantity + jokers);
        expect(table.next ?? 0, name).toBe(seat);
      }
      if (kind.case === "pass") expect(table.next, name).toBe(kind.value.seat);
      table = applyEvent(table, nextEvent(table, kind));
    }
    for (const [index, count] of table.played.entries()) {
      expect(count, `${name}: face ${index + 1}`).toBeLessThanOrEqual(index < table.faces ? index + 1 : table.jokers);
    }
  }
  expect(turns).toBe(5);
  expect(table.results.at(-1)?.order).toEqual([0, 1, 2, 3]);
});
