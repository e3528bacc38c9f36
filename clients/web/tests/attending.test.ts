// Reports of an attendant: their outcome, and what happens when a response is lost.

import { create } from "@bufbuild/protobuf";
import { Code, ConnectError } from "@connectrpc/connect";
import { afterEach, beforeEach, expect, test, vi } from "vitest";
import { tableApi } from "../src/api/client";
import { type Attending, startAttending } from "../src/attend/attending";
import {
  ReportResponseSchema,
  ReportSource,
  ReportVerdict,
  TableServiceWatchResponseSchema,
} from "../src/gen/chefshat/v1/table_service_pb";
import { startLanguage } from "../src/i18n";
import { AWAY } from "./refusals";
import { stateOf } from "./table-state";

let attending: Attending;
const spy = () => vi.spyOn(tableApi, "report");
let report: ReturnType<typeof spy>;

beforeEach(async () => {
  await startLanguage();
  vi.useFakeTimers();
  report = spy();
  vi.spyOn(tableApi, "watch").mockImplementation(async function* (_, options) {
    yield create(TableServiceWatchResponseSchema, { state: stateOf({ version: 5n }) });
    yield create(TableServiceWatchResponseSchema, {});
    await new Promise((_, reject) => options?.signal?.addEventListener("abort", () => reject(new Error("closed"))));
  });
  attending = startAttending("t1");
});

afterEach(() => attending.stop());

const answers = (verdict: ReportVerdict, voidReports = 0, version = 6n) =>
  create(ReportResponseSchema, {
    report: 1n,
    verdict,
    voidReports: Array<bigint>(voidReports).fill(2n),
    state: stateOf({ version }),
  });
const pass = { case: "pass" as const, value: { seat: 1 } };

test.each([
  [ReportVerdict.ACCEPTED, 0, { kind: "accepted" }],
  [ReportVerdict.ACCEPTED, 2, { kind: "void", count: 2 }],
  [ReportVerdict.KNOWN, 0, { kind: "known" }],
  [ReportVerdict.VIOLATION, 0, { kind: "violation" }],
  [ReportVerdict.HELD, 0, { kind: "held" }],
])("verdict %i after which %i are void", async (verdict, voidReports, outcome) => {
  report.mockResolvedValue(answers(verdict, voidReports));
  expect(await attending.report(pass)).toEqual(outcome);
  expect(report.mock.calls[0]?.[0]).toMatchObject({
    tableTicket: "t1",
    report: { source: ReportSource.ATTENDANT, kind: pass },
  });
});

test("a report whose response was lost is sent again with its id", async () => {
  report.mockRejectedValueOnce(AWAY).mockRejectedValueOnce(AWAY).mockResolvedValue(answers(ReportVerdict.ACCEPTED));
  const outcome = attending.report(pass);
  await vi.runOnlyPendingTimersAsync();
  await vi.runOnlyPendingTimersAsync();
  expect(await outcome).toEqual({ kind: "accepted" });
  const ids = report.mock.calls.map(([request]) => request.reportId);
  expect(ids).toHaveLength(3);
  expect(new Set(ids).size).toBe(1);
  expect(ids[0]).toMatch(/^[0-9a-f]{32}$/);
});

test("a report waits for a server that is away, but not longer than the page", async () => {
  report.mockRejectedValue(AWAY);
  let came: unknown;
  void attending.report(pass).then((outcome) => {
    came = outcome;
  });
  await vi.advanceTimersByTimeAsync(120_000);
  expect(came).toBeUndefined();
  report.mockResolvedValue(answers(ReportVerdict.ACCEPTED));
  await vi.advanceTimersByTimeAsync(10_000);
  expect(came).toEqual({ kind: "accepted" });
  expect(new Set(report.mock.calls.map(([request]) => request.reportId)).size).toBe(1);

  report.mockRejectedValue(AWAY);
  void attending.report(pass);
  await vi.advanceTimersByTimeAsync(1_000);
  attending.stop();
  const before = report.mock.calls.length;
  await vi.advanceTimersByTimeAsync(60_000);
  expect(report).toHaveBeenCalledTimes(before);
});

test("a refused report is not sent again, and says why", async () => {
  report.mockRejectedValue(new ConnectError("cards: 13 is no card", Code.InvalidArgument));
  expect(await attending.report(pass)).toEqual({ kind: "fault", words: "cards: 13 is no card" });
  expect(report).toHaveBeenCalledTimes(1);
});

test("the newest state counts, whether it comes with a response or on the stream", async () => {
  await vi.waitUntil(() => attending.state.value?.version === 5n);
  report.mockResolvedValueOnce(answers(ReportVerdict.ACCEPTED, 0, 7n));
  await attending.report(pass);
  expect(attending.state.value?.version).toBe(7n);
  report.mockResolvedValueOnce(answers(ReportVerdict.ACCEPTED, 0, 6n));
  await attending.report(pass);
  expect(attending.state.value?.version).toBe(7n);
});
