// Acting for a seat on a bad connection: an answer is sent again while its decision is open, and
// what is late blocks nothing.

import { create } from "@bufbuild/protobuf";
import { beforeAll, beforeEach, expect, test, vi } from "vitest";
import { playApi } from "../src/api/client";
import { AnswerStatus } from "../src/gen/chefshat/v1/decision_pb";
import { ActResponseSchema, type SeatUpdate, SeatUpdateSchema } from "../src/gen/chefshat/v1/play_service_pb";
import { setLanguage } from "../src/i18n";
import { startActing } from "../src/table/acting";
import { gesture } from "../src/table/expressions";
import { emptyTable } from "../src/table/model/state";
import { AWAY } from "./refusals";

beforeAll(() => setLanguage("en"));
beforeEach(() => void vi.useFakeTimers());

/** The request of a decision. */
function requested(decisionId: bigint): SeatUpdate {
  return create(SeatUpdateSchema, { update: { case: "decision", value: { decisionId } } });
}

const accepted = (decisionId: bigint) =>
  create(ActResponseSchema, { result: { decisionId, status: AnswerStatus.ACCEPTED } });

/** A seat with an open decision, and the decisions that were answered, as the calls were made. */
function seated(answer: (decisionId: bigint) => Promise<ReturnType<typeof accepted>>) {
  const calls: bigint[] = [];
  vi.spyOn(playApi, "act").mockImplementation(async ({ command }) => {
    const decisionId = command?.case === "answer" ? (command.value.decisionId ?? 0n) : 0n;
    calls.push(decisionId);
    return answer(decisionId);
  });
  const acting = startActing("ticket", emptyTable(), 0, false);
  acting.apply([requested(1n)]);
  return { acting, calls };
}

test("an answer given while the connection is cut arrives when it is back", async () => {
  let isCut = true;
  const { acting, calls } = seated(async (decision) => {
    if (isCut) throw AWAY;
    return accepted(decision);
  });
  acting.answer(7);
  await vi.advanceTimersByTimeAsync(60_000);
  expect(acting.sending.value).toBe(true);
  expect(acting.trouble.value).not.toBe("");
  isCut = false;
  window.dispatchEvent(new Event("online"));
  await vi.advanceTimersByTimeAsync(0);
  expect(acting.sending.value).toBe(false);
  expect(acting.trouble.value).toBe("");
  expect(new Set(calls)).toEqual(new Set([1n]));
  const before = calls.length;
  await vi.advanceTimersByTimeAsync(60_000);
  expect(calls).toHaveLength(before);
});

test("an answer is not sent again once its decision is gone", async () => {
  const { acting, calls } = seated(async () => {
    throw AWAY;
  });
  acting.answer(7);
  await vi.advanceTimersByTimeAsync(1_000);
  const before = calls.length;
  acting.apply([requested(2n)]);
  await vi.advanceTimersByTimeAsync(60_000);
  expect(calls.length - before).toBeLessThanOrEqual(1);
  expect(acting.trouble.value).toBe("");
});

test("an answer given while the connection was cut arrives once a new stream has requested it again", async () => {
  let isCut = true;
  const { acting, calls } = seated(async (decision) => {
    if (isCut) throw AWAY;
    return accepted(decision);
  });
  acting.answer(7);
  await vi.advanceTimersByTimeAsync(100);
  acting.apply([create(SeatUpdateSchema, { update: { case: "attached", value: {} } })]);
  await vi.advanceTimersByTimeAsync(2_000);
  acting.apply([requested(1n)]);
  expect(acting.sending.value).toBe(true);
  isCut = false;
  await vi.advanceTimersByTimeAsync(10_000);
  expect(acting.sending.value).toBe(false);
  expect(calls.length).toBeGreaterThan(1);
  expect(acting.trouble.value).toBe("");
});

test("what closes a decision may have been the answer whose response was lost", async () => {
  let attempts = 0;
  const { acting } = seated(async (decisionId) => {
    attempts += 1;
    if (attempts === 1) throw AWAY;
    return create(ActResponseSchema, { result: { decisionId, status: AnswerStatus.CLOSED } });
  });
  acting.answer(7);
  await vi.advanceTimersByTimeAsync(10_000);
  expect(attempts).toBe(2);
  expect([acting.sending.value, acting.trouble.value]).toEqual([false, ""]);
});

test("a call for a decision that is gone does not keep the next one from being answered", async () => {
  let release = () => {};
  const { acting, calls } = seated((decision) =>
    decision === 1n
      ? new Promise((resolve) => {
          release = () => resolve(accepted(decision));
        })
      : Promise.resolve(accepted(decision)),
  );
  acting.answer(7);
  acting.answer(8);
  expect(acting.sending.value).toBe(true);
  acting.apply([requested(2n)]);
  expect(acting.sending.value).toBe(false);
  acting.answer(9);
  await vi.advanceTimersByTimeAsync(0);
  expect(calls).toEqual([1n, 2n]);
  release();
  await vi.advanceTimersByTimeAsync(0);
  expect(acting.sending.value).toBe(false);
  expect(acting.trouble.value).toBe("");
});

test("expressions arrive in the order in which they were shown", async () => {
  const arrived: string[] = [];
  vi.spyOn(playApi, "act").mockImplementation(async ({ command }) => {
    const label = command?.case === "express" ? (command.value.label ?? "") : "";
    // The first call is slow, and the second fails.
    await new Promise((resolve) => setTimeout(resolve, label === "joy" ? 3_000 : 0));
    arrived.push(label);
    if (label === "surprise") throw AWAY;
    return create(ActResponseSchema, {});
  });
  const acting = startActing("ticket", emptyTable(), 0, false);
  for (const label of ["joy", "surprise", "sadness"] as const) acting.express(gesture(label));
  await vi.advanceTimersByTimeAsync(5_000);
  expect(arrived).toEqual(["joy", "surprise", "sadness"]);
  expect(acting.trouble.value).not.toBe("");
});

test("expressions do not pile up behind a connection that is cut", async () => {
  let calls = 0;
  vi.spyOn(playApi, "act").mockImplementation(async () => {
    calls += 1;
    await new Promise((resolve) => setTimeout(resolve, 15_000));
    throw AWAY;
  });
  const acting = startActing("ticket", emptyTable(), 0, false);
  for (let taps = 0; taps < 100; taps += 1) acting.express(gesture("joy"));
  await vi.advanceTimersByTimeAsync(600_000);
  expect(calls).toBe(5);
  acting.express(gesture("joy"));
  await vi.advanceTimersByTimeAsync(0);
  expect(calls).toBe(6);
});
