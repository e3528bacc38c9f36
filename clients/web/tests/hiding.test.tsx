// Hidden parts stay hidden while pages change, whichever order they come and go in.

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

test("a page rendered again with another key keeps hiding", () => {
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
