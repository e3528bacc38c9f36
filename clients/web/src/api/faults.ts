// Errors of calls, in words for a person. The server sends a reason in UPPER_SNAKE
// (google.rpc.ErrorInfo) and a sentence in English; reasons that a person at this page can meet
// have a sentence in each language (`faults` in i18n).

import { durationMs } from "@bufbuild/protobuf/wkt";
import { Code, ConnectError } from "@connectrpc/connect";
import { ErrorInfoSchema, RetryInfoSchema } from "../gen/google/rpc/error_details_pb";
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
  /** Milliseconds after which the server would accept the call; undefined if it did not say. */
  retryMs?: number;
}

/** Parses anything that a call threw. */
export function faultOf(thrown: unknown): Fault {
  const error = ConnectError.from(thrown);
  const info = error.findDetails(ErrorInfoSchema)[0];
  const delay = error.findDetails(RetryInfoSchema)[0]?.retryDelay;
  return {
    reason: info?.reason ?? "",
    code: error.code,
    message: error.rawMessage,
    metadata: { ...info?.metadata },
    ...(delay && { retryMs: durationMs(delay) }),
  };
}

/** Reason of an exception of this page itself. */
export const PAGE_BROKEN = "PAGE_BROKEN";

/** Reasons that end a stream or a call, which may be repeated. */
const PASSING_REASONS = [
  "SHUTTING_DOWN",
  "STORE_FAILED",
  "ROOM_GONE",
  "OWNER_UNREACHABLE",
  "NODE_NOT_REACHED",
  "SPECTATOR_TOO_SLOW",
  "FOLLOWER_TOO_SLOW",
];

/**
 * Whether a retry may succeed soon: the server is unreachable, restarting or shutting down, the
 * connection was slow, or a limit was reached that says when to try again.
 */
export function isPassing(fault: Fault): boolean {
  if (PASSING_REASONS.includes(fault.reason) || fault.retryMs !== undefined) return true;
  return (
    fault.reason === "" && [Code.Unavailable, Code.Unknown, Code.DeadlineExceeded, Code.Internal].includes(fault.code)
  );
}

/** Reasons of calls that need a token, or another one. */
const TOKEN_REASONS = ["TOKEN_MISSING", "TOKEN_UNKNOWN", "TOKEN_EXPIRED", "ROLE_TOO_LOW", "OUT_OF_SCOPE"];

/** Whether the call needs a token, or another one. */
export function needsToken(fault: Fault): boolean {
  return TOKEN_REASONS.includes(fault.reason);
}

/** A fault in words: the translated sentence for its reason if there is one, else the server's. */
export function wordsOf(fault: Fault): string {
  const words = t().faults;
  if (fault.reason === PAGE_BROKEN) return words.pageBroken;
  const known: Record<string, string> = words.byReason;
  const own = known[fault.reason];
  if (fault.retryMs !== undefined) {
    const waitMs = Math.max(1, Math.ceil(fault.retryMs / 1000)) * 1000;
    return `${own ?? words.tooMuch} ${words.again(waitMs)}`;
  }
  if (own !== undefined) return own;
  if (fault.reason === "" && isPassing(fault)) return words.notReached;
  return fault.message || words.unknown;
}

/** Anything that a call threw, in words. */
export function inWords(thrown: unknown): string {
  return wordsOf(faultOf(thrown));
}
