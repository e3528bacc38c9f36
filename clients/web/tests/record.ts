// The recorded games of the repository's fixtures, and the events that a viewer would have
// received.

import { readFileSync } from "node:fs";
import { create, fromJson, type JsonValue } from "@bufbuild/protobuf";
import { type GameEvent, GameEventSchema } from "../src/gen/chefshat/v1/event_pb";
import { type RecordLine, RecordLineSchema } from "../src/gen/chefshat/v1/record_pb";

const FOLDER = `${import.meta.dirname}/../../../tests/fixtures/records`;

/** The recorded games. */
export const RECORDS = ["committed", "fixed"] as const;

/** The lines of a recorded game. */
export function recorded(name: (typeof RECORDS)[number]): RecordLine[] {
  const lines = readFileSync(`${FOLDER}/${name}.jsonl`, "utf8").trim().split("\n");
  return lines.map((line) => fromJson(RecordLineSchema, JSON.parse(line) as JsonValue));
}

/** An event as a seat receives it, or a spectator if no seat is given. */
export function seenBy(event: GameEvent, seat: number | undefined): GameEvent {
  const { kind } = event;
  switch (kind.case) {
    case "shiftStarted": {
      const hands = kind.value.hands.filter((hand) => hand.seat === seat);
      return create(GameEventSchema, { ...event, kind: { case: kind.case, value: { ...kind.value, hands } } });
    }
    case "cardsExchanged": {
      if (kind.value.giver === seat || kind.value.receiver === seat) return event;
      const value = { ...kind.value, cards: [], golden: false };
      return create(GameEventSchema, { ...event, kind: { case: kind.case, value } });
    }
    default:
      return event;
  }
}

/** A record in which no hand is known, as of games imported from a table with real cards. */
export function withoutHands(lines: readonly RecordLine[]): RecordLine[] {
  return lines.map((record) => {
    const { line } = record;
    if (line.case === "decision") {
      const value = { ...line.value, actionMask: new Uint8Array() };
      return create(RecordLineSchema, { line: { case: "decision", value } });
    }
    return line.case === "event"
      ? create(RecordLineSchema, { line: { case: "event", value: seenBy(line.value, undefined) } })
      : record;
  });
}
