// Errors of calls, in words for a person. The server sends a reason in UPPER_SNAKE
// (google.rpc.ErrorInfo) and a sentence in English; reasons that a person at this page can meet
// have a sentence in each language (`faults` in i18n).

import { Code, ConnectError } from "@connectrpc/connect";
import { ErrorInfoSchema } from "../gen/google/rpc/error_details_pb";
import { t } from "../i18n";

/** The parts of a failed call's error. */
export interface Fault {
  /** Reason in UPPER_SNAKE; empty if the server was not reached or sent none. */
  reason: string;
  /** Canonical code. */
  code: Code;
  /** The server's own sentence, in English. */
  message: string;
  /** The offending field or limit. */
  metadata: Record<string, string>;
}

/** Parses anything that a call threw. */
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

/** Whether a retry may succeed soon: the server is unreachable, restarting or shutting down. */
export function isPassing(fault: Fault): boolean {
  if (["SHUTTING_DOWN", "STORE_FAILED", "ROOM_GONE"].includes(fault.reason)) return true;
  return (
    fault.reason === "" && [Code.Unavailable, Code.Unknown, Code.DeadlineExceeded, Code.Internal].includes(fault.code)
  );
}

/** A fault in words: the translated sentence for its reason if there is one, else the server's. */
export function wordsOf(fault: Fault): string {
  const known: Record<string, string> = t().faults.byReason;
  const own = known[fault.reason];
  if (own !== undefined) return own;
  if (fault.reason === "" && isPassing(fault)) return t().faults.notReached;
  return fault.message || t().faults.unknown;
}

/** Anything that a call threw, in words. */
export function inWords(thrown: unknown): string {
  return wordsOf(faultOf(thrown));
}
