// A record as a film: every decision is open once, and no perspective reveals hidden cards.

import { expect, test } from "vitest";
import { DecisionKind } from "../src/gen/chefshat/v1/decision_pb";
import { type Film, type Frame, filmOf } from "../src/replay/frames";
import { decidingFor, seenFrom } from "../src/replay/perspective";
import { legalActions } from "../src/table/model/actions";
import { applyEvent } from "../src/table/model/reduce";
import { RECORDS, recorded, withoutHands } from "./record";

/** All moments of a film. */
function framesOf(film: Film): Frame[] {
  return Array.from({ length: film.length }, (_, number) => film.at(number));
}

test.each(RECORDS)("%s: every decision is open once, at a table where it is that seat's turn", (name) => {
  const lines = recorded(name);
  const film = filmOf(lines);
  const taken = lines.filter(({ line }) => line.case === "decision").length;
  const open = framesOf(film).filter((frame) => frame.open);
  expect(film.decisions).toBe(taken);
  expect(open.map((frame) => frame.open)).toEqual(
    lines.flatMap(({ line }) => (line.case === "decision" ? [line.value] : [])),
  );
  const opening = (number: number) => film.at(film.opening(number) ?? -1).open;
  expect(open.map((_, index) => opening(index + 1))).toEqual(open.map((frame) => frame.open));
  expect([0, 1.5, taken + 1].map(film.opening)).toEqual([undefined, undefined, undefined]);
  for (const frame of open) {
    const { seat, kind, action, actionMask } = frame.open ?? { seat: -1, actionMask: new Uint8Array() };
    expect(legalActions(actionMask)).toContain(action);
    if (kind === DecisionKind.TURN && frame.table.turn > 1) expect(frame.table.next).toBe(seat);
  }
  expect(film.shifts.length).toBeGreaterThan(1);
  expect(film.at(film.length - 1).table.phase).toBe("gameOver");
});

test.each(RECORDS)("%s: a seat's perspective has its own hand only, and no gift between others", (name) => {
  for (const frame of framesOf(filmOf(recorded(name)))) {
    for (const perspective of [0, 1, "none"] as const) {
      const { seats, log } = seenFrom(frame.table, perspective);
      for (const { seat, hand, received } of seats) {
        if (seat === perspective) continue;
        expect(hand).toBeUndefined();
        expect(received).toEqual([]);
      }
      for (const { entry } of log) {
        if (entry.kind !== "gave" || entry.giver === perspective || entry.receiver === perspective) continue;
        expect(entry.cards).toEqual([]);
      }
      if (frame.open?.kind === DecisionKind.SPECIAL_ACTION && frame.open.seat !== perspective) {
        expect(decidingFor(frame, perspective)).toBeUndefined();
      }
    }
  }
});

test.each(RECORDS)("%s: with unknown hands, as at a table with real cards, leads to the same result", (name) => {
  const lines = recorded(name);
  const [known, film] = [filmOf(lines), filmOf(withoutHands(lines))];
  expect([known.handsKnown, film.handsKnown]).toEqual([true, false]);
  expect(film.length).toBe(known.length);
  for (let at = 0; at < film.length; at += 1) {
    const [frame, full] = [film.at(at), known.at(at)];
    expect(frame.table.seats.every(({ hand }) => hand === undefined)).toBe(true);
    expect(frame.table.seats.map(({ cardsLeft }) => cardsLeft)).toEqual(
      full.table.seats.map(({ cardsLeft }) => cardsLeft),
    );
  }
  expect(film.at(film.length - 1).table.standings).toEqual(known.at(known.length - 1).table.standings);
});

test.each(RECORDS)("%s: in any order, the table of a moment is the result of all events before it", (name) => {
  const lines = recorded(name);
  // Storing every table makes each one the result of the previous one and its event.
  const film = filmOf(lines, 1);
  const events = lines.flatMap(({ line }) => (line.case === "event" ? [line.value] : []));
  let table = events.slice(0, 1).reduce(applyEvent, film.at(0).table);
  const tables = Array.from({ length: film.length }, (_, number) => {
    table = events
      .filter(({ sequence }) => Number(sequence) < film.at(number).table.nextSequence)
      .reduce(applyEvent, table);
    return table;
  });
  expect(tables.at(-1)?.nextSequence).toBe(Number(events.at(-1)?.sequence) + 1);
  for (const keptEvery of [2, 7, 200, 100_000]) {
    const sparse = filmOf(lines, keptEvery);
    expect(sparse.length).toBe(film.length);
    // Visits all moments out of order: 101 is prime and divides neither length.
    for (let step = 0; step < sparse.length; step += 1) {
      const number = (step * 101) % sparse.length;
      const frame = sparse.at(number);
      expect(frame.table).toEqual(tables[number]);
      expect(frame.open).toBe(film.at(number).open);
      expect(frame.decisions).toBe(film.at(number).decisions);
    }
  }
});
