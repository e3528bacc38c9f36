// A record as a sequence of moments: one after every event, and after every decision without an
// event. Each moment has the table with all hands and the open decision with its recorded answer. A
// long game has tens of thousands of moments: only some tables are stored, the others are computed
// from the previous one.

import type { GameEvent } from "../gen/chefshat/v1/event_pb";
import type { DecisionRecord, RecordHeader, RecordLine } from "../gen/chefshat/v1/record_pb";
import { applyEvent } from "../table/model/reduce";
import { emptyTable, type TableState, tableFromRoom } from "../table/model/state";

/** Moments between stored tables: this many events are applied faster than the table is drawn. */
const STORED_EVERY = 200;

/** A moment of a recorded game. */
export interface Frame {
  readonly table: TableState;
  /** The open decision with its recorded answer; undefined if none is open. */
  readonly open: DecisionRecord | undefined;
  /** Decisions taken so far. */
  readonly decisions: number;
}

/** The first moment of a Shift with its cards. */
interface ShiftStart {
  readonly shift: number;
  readonly frame: number;
  /** Decisions of the game before it. */
  readonly decisions: number;
}

/** A record that can be stepped through. */
export interface Film {
  readonly header: RecordHeader | undefined;
  /** Number of moments. */
  readonly length: number;
  /** Number of decisions. */
  readonly decisions: number;
  /** Whether a hand is known at any moment; in some imported games none is. */
  readonly handsKnown: boolean;
  readonly shifts: readonly ShiftStart[];
  /** A moment by number, from 0 to `length` - 1. */
  at(moment: number): Frame;
  /** The first moment after a number of decisions; undefined if there are fewer. */
  after(decisions: number): number | undefined;
  /** The moment in which a decision is open, by its number from 1; undefined if there are fewer. */
  opening(decision: number): number | undefined;
}

/** The change from one moment to the next. */
interface Moment {
  /** Undefined for a decision without an event. */
  readonly event: GameEvent | undefined;
  readonly decisions: number;
  open: DecisionRecord | undefined;
}

/** Most Shifts that are marked on a slider or a graph; more would look like a bar. */
const MOST_MARKS = 60;

/** The Shifts to mark. */
export function marked({ shifts }: Film): readonly ShiftStart[] {
  return shifts.length > MOST_MARKS ? [] : shifts;
}

/** The film of a record. */
export function filmOf(lines: readonly RecordLine[], storedEvery = STORED_EVERY): Film {
  let header: RecordHeader | undefined;
  let decisions = 0;
  const moments: Moment[] = [];
  const shifts: ShiftStart[] = [];
  let handsKnown = false;
  lines.forEach(({ line }, index) => {
    switch (line.case) {
      case "header":
        header = line.value;
        break;
      case "decision": {
        // A decision opens after every event before it: not between the last pass of a pizza and
        // the next leader's turn.
        const before = moments.at(-1);
        if (before) before.open = line.value;
        decisions += 1;
        if (lines[index + 1]?.line.case !== "event") moments.push({ event: undefined, open: undefined, decisions });
        break;
      }
      case "event":
        moments.push({ event: line.value, open: undefined, decisions });
        handsKnown ||= showsHand(line.value);
        if (line.value.kind.case === "shiftStarted") {
          shifts.push({ shift: line.value.kind.value.shift, frame: moments.length - 1, decisions });
        }
        break;
      default:
    }
  });
  const tableAt = folded(header ? tableFromHeader(header) : emptyTable(), moments, storedEvery);
  return {
    header,
    length: moments.length,
    decisions,
    handsKnown,
    shifts,
    at: (number) => {
      const moment = moments[number];
      return { table: tableAt(number), open: moment?.open, decisions: moment?.decisions ?? 0 };
    },
    after: (taken) => {
      const found = moments.findIndex((moment) => moment.decisions >= taken);
      return found < 0 ? undefined : found;
    },
    opening: (decision) => {
      const found = moments.findIndex((moment) => moment.open && moment.decisions === decision - 1);
      return found < 0 ? undefined : found;
    },
  };
}

/** Whether an event says which cards somebody holds. */
function showsHand({ kind }: GameEvent): boolean {
  if (kind.case === "handReported") return (kind.value.hand?.cards.length ?? 0) > 0;
  return kind.case === "shiftStarted" && kind.value.hands.some(({ cards }) => cards.length > 0);
}

/** The table at each moment, computed from the nearest stored or last requested one before it. */
function folded(start: TableState, moments: readonly Moment[], storedEvery: number): (number: number) => TableState {
  const stored: TableState[] = [];
  let looked = { number: -1, table: start };
  const on = (table: TableState, { event }: Moment) => (event ? applyEvent(table, event) : table);
  moments.forEach((moment, number) => {
    looked = { number, table: on(looked.table, moment) };
    if (number % storedEvery === 0) stored.push(looked.table);
  });
  return (number) => {
    const last = Math.floor(number / storedEvery);
    const base = { number: last * storedEvery, table: stored[last] ?? start };
    const from = looked.number > base.number && looked.number <= number ? looked : base;
    looked = { number, table: moments.slice(from.number + 1, number + 1).reduce(on, from.table) };
    return looked.table;
  };
}

/** The table before the first event. A record has the game as corrected, so it needs no history. */
function tableFromHeader(header: RecordHeader): TableState {
  return { ...tableFromRoom({ ...header, name: header.roomName }), history: undefined };
}
