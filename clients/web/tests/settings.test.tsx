// The settings: the connection, and full screen where the browser can show it.

import { create } from "@bufbuild/protobuf";
import { Code, ConnectError } from "@connectrpc/connect";
import { act } from "preact/test-utils";
import { afterEach, beforeEach, expect, test, vi } from "vitest";
import { serverApi } from "../src/api/client";
import { GetServerInfoResponseSchema } from "../src/gen/chefshat/v1/server_service_pb";
import { Settings } from "../src/parts/Settings";
import { button, later, mount, root } from "./mounted";

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
  await mount(<Settings onClose={onClose} />);
  return onClose;
}

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

test("the time until the server answers is measured while the settings are open", async () => {
  vi.useFakeTimers();
  const ask = vi.spyOn(serverApi, "getServerInfo").mockImplementation(async () => {
    await new Promise((resolve) => setTimeout(resolve, 120));
    return create(GetServerInfoResponseSchema, {});
  });
  await show(false, null);
  const lag = () => root.querySelector('[data-part="lag"]')?.textContent;
  expect(lag()).toBe("The connection is being measured…");
  await later(120);
  expect(lag()).toBe("The server answers after 120\u00a0ms.");
  ask.mockRejectedValue(new ConnectError("", Code.Unavailable));
  await later(3_000);
  expect(lag()).toMatch(/server/i);
  mount(null);
  await vi.advanceTimersByTimeAsync(60_000);
  expect(ask).toHaveBeenCalledTimes(2);
});

test("a language that cannot be loaded is reported", async () => {
  vi.stubGlobal("fetch", async () => Promise.reject(new TypeError("no network")));
  vi.resetModules();
  vi.doMock("../src/i18n/it", () => {
    throw new Error("gone");
  });
  try {
    const { startLanguage, t } = await import("../src/i18n");
    const { Settings } = await import("../src/parts/Settings");
    await startLanguage();
    await mount(<Settings onClose={() => {}} />);
    const select = root.querySelector("select");
    if (!select) throw new Error("there is no choice of a language");
    select.value = "it";
    await act(() => void select.dispatchEvent(new Event("change", { bubbles: true })));
    await vi.waitFor(() =>
      expect(root.querySelector('[role="alert"]')?.textContent).toContain(t().common.pageNotLoaded),
    );
  } finally {
    vi.doUnmock("../src/i18n/it");
  }
});
