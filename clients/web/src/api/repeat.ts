// Repeats a request to create or to join, or for a hint, whose response was lost. Its request id
// tells the server that it is the same request, so that it answers with the same place, the same
// secrets or the same hint.

import type { Interceptor } from "@connectrpc/connect";
import { Code } from "@connectrpc/connect";
import { faultOf } from "./faults";

/** Bytes of a request id. */
export const REQUEST_ID_BYTES = 32;
/** Pauses before each further attempt, milliseconds. */
const PAUSES_MS = [100, 200, 400];
/** Codes of a call that ended without an answer. */
const LOST: Code[] = [Code.Unavailable, Code.Unknown, Code.Internal];

interface Identified {
  requestId?: unknown;
}

/** Gives requests that can be repeated an id and repeats them when the connection is lost. */
export const repeat: Interceptor = (next) => async (request) => {
  const message = request.message as Identified & { command?: { case?: string; value?: Identified } };
  const identified = message.command?.case === "hint" ? message.command.value : message;
  if (request.stream || !(identified?.requestId instanceof Uint8Array)) return next(request);
  if (identified.requestId.length === 0) {
    identified.requestId = crypto.getRandomValues(new Uint8Array(REQUEST_ID_BYTES));
  }
  for (const pause of PAUSES_MS) {
    try {
      return await next(request);
    } catch (thrown) {
      if (!isLost(thrown)) throw thrown;
      await new Promise((resume) => setTimeout(resume, pause));
    }
  }
  return next(request);
};

/** Whether a call ended without an answer from the server, which gives a reason. */
function isLost(thrown: unknown): boolean {
  const fault = faultOf(thrown);
  return fault.reason === "" && LOST.includes(fault.code);
}
