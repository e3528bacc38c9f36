// What a study leaves out stays left out while one part of the page goes and another comes,
// whichever is first.

import { render } from "preact";
import { act } from "preact/test-utils";
import { afterEach, expect, test } from "vitest";
import { hidden, leaveOut, useHiding } from "../src/experiment/hiding";
import type { Study } from "../src/experiment/study";

const study: Study = {
  name: "P07",
  seat: undefined,
  times: false,
  hide: ["log", "pages"],
  consent: "",
  before: "",
  after: "",
};
const said = () => document.documentElement.dataset.hide;

afterEach(() => expect([said(), hidden.value]).toEqual([undefined, []]));

test("the next part comes before the one before it goes", () => {
  const first = leaveOut(["log"]);
  const second = leaveOut(["log"]);
  first();
  expect([said(), hidden.value]).toEqual(["log", ["log"]]);
  second();
});

test("the next part comes after the one before it has gone", () => {
  const first = leaveOut(["log"]);
  first();
  expect(said()).toBeUndefined();
  const second = leaveOut(["log", "pages"]);
  expect(said()).toBe("log pages");
  second();
});

test("two parts at once leave out what either wants, each thing once", () => {
  const both = [leaveOut(["log"]), leaveOut(["pages", "log"])];
  expect(hidden.value).toEqual(["log", "pages"]);
  for (const done of both) done();
});

test("a page that is drawn anew under another key goes on leaving out", () => {
  function Page() {
    useHiding(study);
    return null;
  }
  const root = document.createElement("div");
  for (const key of ["waiting", "table", "result"]) {
    act(() => render(<Page key={key} />, root));
    expect(said()).toBe("log pages");
  }
  act(() => render(null, root));
});
