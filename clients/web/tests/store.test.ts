// What this device stores: also where the browser stores nothing more, and with other tabs.

import { beforeEach, expect, test, vi } from "vitest";
import { forgetAll, recall, remember, remembered } from "../src/store";

beforeEach(forgetAll);

/** Lets the browser refuse to store anything. */
const refuse = () =>
  vi.spyOn(Storage.prototype, "setItem").mockImplementation(() => {
    throw new DOMException("full", "QuotaExceededError");
  });

test("a value that cannot be stored lasts as long as the page, in place of an older one", () => {
  remember("a", "1");
  const refusing = refuse();
  remember("a", "2");
  remember("b", "3");
  expect([recall("a"), recall("b")]).toEqual(["2", "3"]);
  expect(Object.fromEntries(remembered())).toEqual({ a: "2", b: "3" });
  remember("b", null);
  expect(recall("b")).toBeNull();
  refusing.mockRestore();
  remember("a", "4");
  expect([recall("a"), localStorage.getItem("chefshat.a")]).toEqual(["4", "4"]);
});

test("what another tab deletes or replaces is not remembered here", () => {
  remember("a", "1");
  remember("b", "1");
  localStorage.removeItem("chefshat.a");
  localStorage.setItem("chefshat.b", "2");
  expect([recall("a"), recall("b")]).toEqual([null, "2"]);
  expect(Object.fromEntries(remembered())).toEqual({ b: "2" });
});

test("everything is forgotten: what is stored, what could not be, and what the tab has", () => {
  remember("a", "1");
  sessionStorage.setItem("chefshat.token", "secret");
  localStorage.setItem("of another page", "1");
  refuse();
  remember("b", "2");
  forgetAll();
  expect(remembered().size).toBe(0);
  expect(sessionStorage.getItem("chefshat.token")).toBeNull();
  expect(localStorage.getItem("of another page")).toBe("1");
  localStorage.clear();
});
