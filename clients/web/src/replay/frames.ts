// A record as a row of moments to be stepped through: after every event, and after every decision that brought none. Each knows the table with
// all hands, and the decision that is open, which the record says already. Whose eyes it is looked at with is said in eyes.ts.

import type { DecisionRecord, RecordHeader, RecordLine } from "../gen/chefshat/v1/record_pb";
import { applyEvent } from "../table/model/reduce";
import { emptyTable, fromRules, seatFromParticipant, type TableState } from "../table/model/state";

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
  readonly frames: readonly Frame[];
  /** How many decisions there are in all. */
  readonly decisions: number;
  /** Where each Shift begins: the first frame with its cards. */
  readonly shifts: readonly { readonly shift: number; readonly frame: number }[];
}

/** The film of a record. */
export function filmOf(lines: readonly RecordLine[]): Film {
  let table = emptyTable();
  let header: RecordHeader | undefined;
  let decisions = 0;
  const frames: { table: TableState; open: DecisionRecord | undefined; decisions: number }[] = [];
  const shifts: { shift: number; frame: number }[] = [];
  lines.forEach(({ line }, index) => {
    switch (line.case) {
      case "header":
        header = line.value;
        table = tableFromHeader(line.value);
        break;
      case "decision": {
        // Open it is once everything before it has happened: not between the last pass of a pizza and the next leader's turn.
        const before = frames.at(-1);
        if (before) before.open = line.value;
        decisions += 1;
        if (lines[index + 1]?.line.case !== "event") frames.push({ table, open: undefined, decisions });
        break;
      }
      case "event":
        table = applyEvent(table, line.value);
        frames.push({ table, open: undefined, decisions });
        if (line.value.kind.case === "shiftStarted") {
          shifts.push({ shift: line.value.kind.value.shift, frame: frames.length - 1 });
        }
        break;
      default:
    }
  });
  return { header, frames, decisions, shifts };
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
