// Estimates are ranked by points, with the best and the action taken marked, and bars to one scale.

import { create } from "@bufbuild/protobuf";
import { expect, test } from "vitest";
import { EvaluateResponseSchema } from "../src/gen/chefshat/v1/analysis_service_pb";
import { ranked } from "../src/replay/estimates";

const found = create(EvaluateResponseSchema, {
  actions: [
    { action: 3, points: 1, standardError: 0.5 },
    { action: 7, points: 3, standardError: 1 },
    { action: 9, points: 0, standardError: 0 },
    { action: 12, points: 2, standardError: 0.25 },
  ],
});

test("the best actions come first, with the one that was taken", () => {
  const { estimates, others } = ranked(found, 9, 2);
  expect(estimates.map(({ action }) => action)).toEqual([7, 12, 9]);
  expect(estimates.map(({ best }) => best)).toEqual([true, false, false]);
  expect(estimates.map(({ taken }) => taken)).toEqual([false, false, true]);
  expect(others).toBe(1);
});

test("the scale ends at the most points that an estimate reaches", () => {
  const [best, second, , last] = ranked(found, 7, 8).estimates;
  expect(best).toMatchObject({ part: 0.75, from: 0.5, to: 1, best: true, taken: true });
  expect(second).toMatchObject({ part: 0.5, from: 0.4375, to: 0.5625 });
  expect(last).toMatchObject({ part: 0, from: 0, to: 0 });
});

test("actions that are all worth nothing have empty bars", () => {
  const nothing = create(EvaluateResponseSchema, { actions: [{ action: 199, points: 0 }] });
  expect(ranked(nothing, 199, 8).estimates).toMatchObject([{ part: 0, from: 0, to: 0, best: true, taken: true }]);
});
