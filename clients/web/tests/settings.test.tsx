// The settings: full screen, where the browser can show it.

import { render } from "preact";
import { act } from "preact/test-utils";
import { afterEach, beforeEach, expect, test, vi } from "vitest";
import { Settings } from "../src/parts/Settings";
import { root } from "./mounted";

const request = vi.fn(async () => {});
const exit = vi.fn(async () => {});

beforeEach(() => {
  Object.assign(document.documentElement, { requestFullscreen: request });
  Object.assign(document, { exitFullscreen: exit });
});
afterEach(() => {
  for (const name of ["fullscreenEnabled", "fullscreenElement", "exitFullscreen"])
    Reflect.deleteProperty(document, name);
  Reflect.deleteProperty(document.documentElement, "requestFullscreen");
  vi.clearAllMocks();
});

async function show(fullscreenEnabled: boolean, fullscreenElement: Element | null) {
  Object.defineProperty(document, "fullscreenEnabled", { configurable: true, value: fullscreenEnabled });
  Object.defineProperty(document, "fullscreenElement", { configurable: true, value: fullscreenElement });
  const onClose = vi.fn();
  await act(() => render(<Settings onClose={onClose} />, root));
  return onClose;
}
const button = (words: string) => [...root.querySelectorAll("button")].find(({ textContent }) => textContent === words);

test("full screen is switched on, after the dialog has closed", async () => {
  const onClose = await show(true, null);
  expect(button("Leave full screen")).toBeUndefined();
  button("Full screen")?.click();
  expect(request).toHaveBeenCalledTimes(1);
  expect(exit).not.toHaveBeenCalled();
  expect(onClose.mock.invocationCallOrder[0]).toBeLessThan(request.mock.invocationCallOrder[0] ?? 0);
});

test("full screen is switched off", async () => {
  const onClose = await show(true, document.documentElement);
  expect(button("Full screen")).toBeUndefined();
  button("Leave full screen")?.click();
  expect(exit).toHaveBeenCalledTimes(1);
  expect(request).not.toHaveBeenCalled();
  expect(onClose).toHaveBeenCalledTimes(1);
});

test("a browser without full screen is not offered it", async () => {
  await show(false, null);
  expect(button("Full screen")).toBeUndefined();
  expect(button("Leave full screen")).toBeUndefined();
});
