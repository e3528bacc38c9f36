// What went wrong in a call, in words for a person. The server says a reason in UPPER_SNAKE (google.rpc.ErrorInfo) and a sentence in
// English; for reasons that a person at this page can meet there is a sentence in each language (`faults` in i18n).

import { Code, ConnectError } from "@connectrpc/connect";
import { ErrorInfoSchema } from "../gen/google/rpc/error_details_pb";
import { t } from "../i18n";

/** A failed call, taken apart. */
export interface Fault {
  /** Reason in UPPER_SNAKE; empty if the server was not reached or said none. */
  reason: string;
  /** Canonical code. */
  code: Code;
  /** The server's own sentence, in English. */
  message: string;
  /** The offending field or limit. */
  metadata: Record<string, string>;
}

/** Takes apart whatever a call threw. */
export function faultOf(thrown: unknown): Fault {
  const error = ConnectError.from(thrown);
  const info = error.findDetails(ErrorInfoSchema)[0];
  return {
    reason: info?.reason ?? "",
    code: error.code,
    message: error.rawMessage,
    metadata: { ...info?.metadata },
  };
}

/** Whether it makes sense to try the same again in a moment: the server is away or shutting down. */
export function isPassing(fault: Fault): boolean {
  if (fault.reason === "SHUTTING_DOWN" || fault.reason === "STORE_FAILED") return true;
  return (
    fault.reason === "" && [Code.Unavailable, Code.Unknown, Code.DeadlineExceeded, Code.Internal].includes(fault.code)
  );
}

/** A fault in words: our own where there are some for its reason, else the server's. */
export function wordsOf(fault: Fault): string {
  const known: Record<string, string> = t().faults.byReason;
  const own = known[fault.reason];
  if (own !== undefined) return own;
  if (fault.reason === "" && isPassing(fault)) return t().faults.notReached;
  return fault.message || t().faults.unknown;
}

/** Shortly: whatever a call threw, in words. */
export function inWords(thrown: unknown): string {
  return wordsOf(faultOf(thrown));
}
