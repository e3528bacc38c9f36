// Repeats a request to create or to join, or for a hint, whose response was lost. Its request id
// tells the server that it is the same request, so that it answers with the same place, the same
// secrets or the same hint. Where all attempts were lost, it is the same request also when the person
// tries again.

import { toBinary } from "@bufbuild/protobuf";
import { base64Encode } from "@bufbuild/protobuf/wire";
import type { Interceptor } from "@connectrpc/connect";
import { Code } from "@connectrpc/connect";
import { type Fault, faultOf, isPassing } from "./faults";

/** Bytes of a request id. */
export const REQUEST_ID_BYTES = 32;
/** Pauses before each further attempt, milliseconds. */
const PAUSES_MS = [100, 200, 400];
/** Codes of a call that ended without an answer. */
const LOST: Code[] = [Code.Unavailable, Code.Unknown, Code.Internal];
/** For how long what is asked again is the same request, milliseconds: later it is meant anew. */
const SAME_FOR_MS = 600_000;

interface Identified {
  requestId?: unknown;
}

/** The last request of each method that may have been carried out without an answer. */
const unanswered = new Map<string, { asked: string; requestId: Uint8Array; atMs: number }>();

/** A new id for a request. */
export function newRequestId(): Uint8Array<ArrayBuffer> {
  return crypto.getRandomValues(new Uint8Array(REQUEST_ID_BYTES));
}

/** Gives requests that can be repeated an id and repeats them when the connection is lost. */
export const repeat: Interceptor = (next) => async (request) => {
  if (request.stream) return next(request);
  const message = request.message as Identified & { command?: { case?: string; value?: Identified } };
  const identified = message.command?.case === "hint" ? message.command.value : message;
  const given = identified?.requestId;
  if (!identified || !(given instanceof Uint8Array)) return next(request);
  const { name, input } = request.method;
  const asked = base64Encode(toBinary(input, request.message));
  const before = unanswered.get(name);
  const isSame = before?.asked === asked && performance.now() - before.atMs < SAME_FOR_MS;
  const requestId = given.length > 0 ? given : isSame ? before.requestId : newRequestId();
  identified.requestId = requestId;
  unanswered.delete(name);
  try {
    return await attempted(() => next(request));
  } catch (thrown) {
    if (isPassing(faultOf(thrown))) unanswered.set(name, { asked, requestId, atMs: performance.now() });
    throw thrown;
  }
};

/** The answer to a call, which is made again while the connection is lost. */
async function attempted<Answer>(call: () => Promise<Answer>): Promise<Answer> {
  for (const pause of PAUSES_MS) {
    try {
      return await call();
    } catch (thrown) {
      if (!isLost(faultOf(thrown))) throw thrown;
      await new Promise((resume) => setTimeout(resume, pause));
    }
  }
  return call();
}

/** Whether a call ended without an answer from the server, which gives a reason. */
function isLost({ reason, code }: Fault): boolean {
  return reason === "" && LOST.includes(code);
}
