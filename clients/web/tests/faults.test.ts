// Error messages: translated for known reasons, the server's for others, and a default when there
// was no response.

import { create } from "@bufbuild/protobuf";
import { durationFromMs } from "@bufbuild/protobuf/wkt";
import { Code, ConnectError } from "@connectrpc/connect";
import { beforeAll, expect, test } from "vitest";
import { faultOf, inWords, isPassing, needsToken } from "../src/api/faults";
import { ErrorInfoSchema, RetryInfoSchema } from "../src/gen/google/rpc/error_details_pb";
import { startLanguage } from "../src/i18n";
import * as en from "../src/i18n/en";

beforeAll(startLanguage);

function refusal(
  reason: string,
  message: string,
  metadata: Record<string, string> = {},
  code = Code.InvalidArgument,
): ConnectError {
  const error = new ConnectError(message, code);
  error.details.push({
    desc: ErrorInfoSchema,
    value: create(ErrorInfoSchema, { reason, domain: "chefshat", metadata }),
  });
  return error;
}

test("a known reason has a translated message", () => {
  expect(inWords(refusal("ROOM_FULL", "no seat is free"))).toBe(en.faults.byReason.ROOM_FULL);
});

test("an unknown reason has the server's message, with its field", () => {
  const error = refusal("RULE_SET_REFUSED", "faces: 99 is not in 4..=15", { field: "faces" });
  expect(inWords(error)).toBe("faces: 99 is not in 4..=15");
  expect(faultOf(error).metadata).toEqual({ field: "faces" });
});

test("an unreachable server is retried, a refusal is not", () => {
  const away = new TypeError("Failed to fetch");
  expect(inWords(away)).toBe(en.faults.notReached);
  expect(isPassing(faultOf(away))).toBe(true);
  expect(isPassing(faultOf(refusal("SHUTTING_DOWN", "")))).toBe(true);
  expect(isPassing(faultOf(refusal("ROOM_FULL", "")))).toBe(false);
});

test("a limit is explained with the time to wait, in whole seconds", () => {
  const error = refusal("TOO_MANY_CALLS", "calls: at most 20", {}, Code.ResourceExhausted);
  expect(inWords(error)).toBe(en.faults.byReason.TOO_MANY_CALLS);
  expect(isPassing(faultOf(error))).toBe(false);
  const delays: [number, string][] = [
    [0, "1 second"],
    [2100, "3 seconds"],
    [240_000, "4 minutes"],
  ];
  for (const [ms, words] of delays) {
    error.details[1] = {
      desc: RetryInfoSchema,
      value: create(RetryInfoSchema, { retryDelay: durationFromMs(ms) }),
    };
    expect(inWords(error)).toBe(`${en.faults.byReason.TOO_MANY_CALLS} Try again in ${words}.`);
  }
  expect(isPassing(faultOf(error))).toBe(true);
  const unknown = refusal("TOO_MANY_SOMETHING", "", {}, Code.ResourceExhausted);
  unknown.details.push(...error.details.slice(1));
  expect(inWords(unknown)).toBe("This was too much at once. Try again in 4 minutes.");
});

test("refused tokens are explained and not retried", () => {
  for (const reason of ["TOKEN_MISSING", "TOKEN_UNKNOWN", "TOKEN_EXPIRED", "ROLE_TOO_LOW", "OUT_OF_SCOPE"]) {
    const error = refusal(reason, "the server's words");
    expect(inWords(error)).not.toContain("the server's words");
    expect(needsToken(faultOf(error))).toBe(true);
    expect(isPassing(faultOf(error))).toBe(false);
  }
});
