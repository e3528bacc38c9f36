// Attending to a physical table: follows its state and sends reports. A report is sent until the server
// answers, as long as the page is open, and always with its id, so that the server counts it once.

import type { MessageInitShape } from "@bufbuild/protobuf";
import { type Signal, signal } from "@preact/signals";
import { askUntilAnswered } from "../api/asking";
import { tableApi } from "../api/client";
import { wordsOf } from "../api/faults";
import { type Following, follow } from "../api/follow";
import {
  type ReportResponse,
  ReportSource,
  ReportVerdict,
  type TableReportSchema,
  TableStage,
  type TableState,
} from "../gen/chefshat/v1/table_service_pb";
import { hex } from "../hex";

/** What happened, as it is reported. */
export type ReportKind = NonNullable<MessageInitShape<typeof TableReportSchema>["kind"]> & { case: string };

/** What came of the last report, as far as the state of the table does not show it. */
export type Outcome =
  | { readonly kind: "accepted" }
  | { readonly kind: "known" }
  | { readonly kind: "violation" }
  | { readonly kind: "held" }
  /** A correction after which this many later reports are void. */
  | { readonly kind: "void"; readonly count: number }
  | { readonly kind: "fault"; readonly words: string };

/** Reports something; resolves to what came of it. */
export type Report = (what: ReportKind) => Promise<Outcome>;

export interface Attending {
  /** Undefined before the first message. */
  readonly state: Signal<TableState | undefined>;
  readonly following: Following;
  readonly report: Report;
  stop(): void;
}

const REPORT_ID_BYTES = 16;

/** Starts attending with a table's ticket. */
export function startAttending(ticket: string): Attending {
  const state = signal<TableState | undefined>(undefined);
  let stopped = false;
  const apply = (next: TableState | undefined) => {
    const before = state.peek();
    if (next && (before === undefined || next.version > before.version)) state.value = next;
  };
  const following = follow(
    (abort) => tableApi.watch({ tableTicket: ticket }, { signal: abort }),
    (message) => {
      apply(message.state);
      return state.peek()?.stage !== TableStage.OVER;
    },
  );
  const report: Report = async (what) => {
    const request = {
      tableTicket: ticket,
      reportId: newId(),
      report: { source: ReportSource.ATTENDANT, kind: what },
    };
    let words = "";
    const response = await askUntilAnswered(
      () => tableApi.report(request),
      () => !stopped,
      (found) => {
        words = wordsOf(found);
      },
    );
    if (!response) return { kind: "fault", words };
    apply(response.state);
    return outcomeOf(response);
  };
  const stop = () => {
    stopped = true;
    following.stop();
  };
  return { state, following, report, stop };
}

function outcomeOf({ verdict, voidReports }: ReportResponse): Outcome {
  switch (verdict) {
    case ReportVerdict.VIOLATION:
      return { kind: "violation" };
    case ReportVerdict.KNOWN:
      return { kind: "known" };
    case ReportVerdict.HELD:
      return { kind: "held" };
    default:
      return voidReports.length > 0 ? { kind: "void", count: voidReports.length } : { kind: "accepted" };
  }
}

function newId(): string {
  return hex(crypto.getRandomValues(new Uint8Array(REPORT_ID_BYTES)));
}
