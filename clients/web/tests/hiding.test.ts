// Hidden parts stay hidden while pages change, whichever order they come and go in.

import { afterEach, expect, test } from "vitest";
import { hidden, leaveOut } from "../src/hiding";

const said = () => document.documentElement.dataset.hide;

afterEach(() => expect([said(), hidden.value]).toEqual([undefined, []]));

test("the next part arrives before the previous one leaves", () => {
  const first = leaveOut(["log"]);
  const second = leaveOut(["log"]);
  first();
  expect([said(), hidden.value]).toEqual(["log", ["log"]]);
  second();
});

test("the next part arrives after the previous one left", () => {
  const first = leaveOut(["log"]);
  first();
  expect(said()).toBeUndefined();
  const second = leaveOut(["log", "pages"]);
  expect(said()).toBe("log pages");
  second();
});

test("two parts at once hide the union of their wishes", () => {
  const both = [leaveOut(["log"]), leaveOut(["pages", "log"])];
  expect(hidden.value).toEqual(["log", "pages"]);
  for (const done of both) done();
});
