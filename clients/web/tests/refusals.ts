// Errors of the server, for the tests.

import { durationFromMs } from "@bufbuild/protobuf/wkt";
import { Code, ConnectError } from "@connectrpc/connect";
import { ErrorInfoSchema, RetryInfoSchema } from "../src/gen/google/rpc/error_details_pb";

/** An error of the server with a reason. */
export function refused(
  reason: string,
  code = Code.FailedPrecondition,
  metadata: Record<string, string> = {},
): ConnectError {
  return new ConnectError(reason, code, undefined, [{ desc: ErrorInfoSchema, value: { reason, metadata } }]);
}

/** The error of a limit that says when to try again. */
export function tooMany(retryMs: number): ConnectError {
  const value = { retryDelay: durationFromMs(retryMs) };
  return new ConnectError("too many", Code.ResourceExhausted, undefined, [{ desc: RetryInfoSchema, value }]);
}

/** What a call throws while the server cannot be reached. */
export const AWAY = new ConnectError("away", Code.Unavailable);
