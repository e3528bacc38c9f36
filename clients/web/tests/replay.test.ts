// A record as a film: every decision can be seen before it is taken, and nobody's eyes see more than they may.

import { expect, test } from "vitest";
import { DecisionKind } from "../src/gen/chefshat/v1/decision_pb";
import { decidingFor, seenWith } from "../src/replay/eyes";
import { filmOf } from "../src/replay/frames";
import { legalActions } from "../src/table/model/actions";
import { RECORDS, recorded } from "./record";

test.each(RECORDS)("%s: every decision is open once, at a table where it is that seat's turn", (name) => {
  const lines = recorded(name);
  const film = filmOf(lines);
  const taken = lines.filter(({ line }) => line.case === "decision").length;
  const open = film.frames.filter((frame) => frame.open);
  expect(film.decisions).toBe(taken);
  expect(open.map((frame) => frame.open)).toEqual(
    lines.flatMap(({ line }) => (line.case === "decision" ? [line.value] : [])),
  );
  for (const frame of open) {
    const { seat, kind, action, actionMask } = frame.open ?? { seat: -1, actionMask: new Uint8Array() };
    expect(legalActions(actionMask)).toContain(action);
    if (kind === DecisionKind.TURN && frame.table.turn > 1) expect(frame.table.next).toBe(seat);
  }
  expect(film.shifts.length).toBeGreaterThan(1);
  expect(film.frames.at(-1)?.table.phase).toBe("gameOver");
});

test.each(RECORDS)("%s: eyes see their own hand and no other, and no gift between others", (name) => {
  for (const frame of filmOf(recorded(name)).frames) {
    for (const eyes of [0, 1, "none"] as const) {
      const { seats, log } = seenWith(frame.table, eyes);
      for (const { seat, hand, received } of seats) {
        if (seat === eyes) continue;
        expect(hand).toBeUndefined();
        expect(received).toEqual([]);
      }
      for (const { happening } of log) {
        if (happening.kind !== "gave" || happening.giver === eyes || happening.receiver === eyes) continue;
        expect(happening.cards).toEqual([]);
      }
      if (frame.open?.kind === DecisionKind.SPECIAL_ACTION && frame.open.seat !== eyes) {
        expect(decidingFor(frame, eyes)).toBeUndefined();
      }
    }
  }
});
