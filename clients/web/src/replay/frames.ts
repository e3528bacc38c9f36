// A record as a row of moments to be stepped through: after every event, and after every decision that brought none. Each knows the table with
// all hands, and the decision that is open, which the record says already. Whose eyes it is looked at with is said in eyes.ts. A long game has
// tens of thousands of moments: only some tables are kept, the others are made from the one before and the events since.

import type { GameEvent } from "../gen/chefshat/v1/event_pb";
import type { DecisionRecord, RecordHeader, RecordLine } from "../gen/chefshat/v1/record_pb";
import { applyEvent } from "../table/model/reduce";
import { emptyTable, fromRules, seatFromParticipant, type TableState } from "../table/model/state";

/** From one table that is kept to the next, in moments: so many events are applied in less time than it takes to draw the table. */
const KEPT_EVERY = 200;

/** One moment of a recorded game. */
export interface Frame {
  readonly table: TableState;
  /** The decision that is open, with what was answered; undefined when nobody decides any more. */
  readonly open: DecisionRecord | undefined;
  /** How many decisions have been taken. */
  readonly decisions: number;
}

/** A record that can be stepped through. */
export interface Film {
  readonly header: RecordHeader | undefined;
  /** How many moments there are. */
  readonly length: number;
  /** How many decisions there are in all. */
  readonly decisions: number;
  /** Where each Shift begins: the first moment with its cards. */
  readonly shifts: readonly { readonly shift: number; readonly frame: number }[];
  /** A moment by its number, from 0 to `length` - 1. */
  at(moment: number): Frame;
  /** The first moment at which so many decisions have been taken; undefined if there are fewer. */
  after(decisions: number): number | undefined;
}

/** What a moment adds to the one before. */
interface Moment {
  /** What happened; undefined where a decision brought no event. */
  readonly event: GameEvent | undefined;
  readonly decisions: number;
  open: DecisionRecord | undefined;
}

/** The film of a record. */
export function filmOf(lines: readonly RecordLine[], keptEvery = KEPT_EVERY): Film {
  let header: RecordHeader | undefined;
  let decisions = 0;
  const moments: Moment[] = [];
  const shifts: { shift: number; frame: number }[] = [];
  lines.forEach(({ line }, index) => {
    switch (line.case) {
      case "header":
        header = line.value;
        break;
      case "decision": {
        // Open it is once everything before it has happened: not between the last pass of a pizza and the next leader's turn.
        const before = moments.at(-1);
        if (before) before.open = line.value;
        decisions += 1;
        if (lines[index + 1]?.line.case !== "event") moments.push({ event: undefined, open: undefined, decisions });
        break;
      }
      case "event":
        moments.push({ event: line.value, open: undefined, decisions });
        if (line.value.kind.case === "shiftStarted") {
          shifts.push({ shift: line.value.kind.value.shift, frame: moments.length - 1 });
        }
        break;
      default:
    }
  });
  const tableAt = folded(header ? tableFromHeader(header) : emptyTable(), moments, keptEvery);
  return {
    header,
    length: moments.length,
    decisions,
    shifts,
    at: (number) => {
      const moment = moments[number];
      return { table: tableAt(number), open: moment?.open, decisions: moment?.decisions ?? 0 };
    },
    after: (taken) => {
      const found = moments.findIndex((moment) => moment.decisions >= taken);
      return found < 0 ? undefined : found;
    },
  };
}

/** The table at each moment: folded once from the beginning, then from the last one that was kept or looked at. */
function folded(start: TableState, moments: readonly Moment[], keptEvery: number): (number: number) => TableState {
  const kept: TableState[] = [];
  let looked = { number: -1, table: start };
  const on = (table: TableState, { event }: Moment) => (event ? applyEvent(table, event) : table);
  moments.forEach((moment, number) => {
    looked = { number, table: on(looked.table, moment) };
    if (number % keptEvery === 0) kept.push(looked.table);
  });
  return (number) => {
    const last = Math.floor(number / keptEvery);
    const base = { number: last * keptEvery, table: kept[last] ?? start };
    const from = looked.number > base.number && looked.number <= number ? looked : base;
    looked = { number, table: moments.slice(from.number + 1, number + 1).reduce(on, from.table) };
    return looked.table;
  };
}

function tableFromHeader(header: RecordHeader): TableState {
  return {
    ...emptyTable(header.seats.map(seatFromParticipant)),
    ...fromRules(header.rules),
    roomId: header.roomId,
    roomName: header.roomName,
    gameId: header.gameId,
    policy: header.policy,
  };
}
