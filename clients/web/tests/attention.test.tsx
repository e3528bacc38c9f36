// What calls a person back on their turn, and keeps the screen on: each way only if it is switched on
// and allowed, and never asked for by itself.

import { readFileSync } from "node:fs";
import { act } from "preact/test-utils";
import { afterEach, beforeEach, expect, test, vi } from "vitest";
import { Settings } from "../src/parts/Settings";
import { useTab } from "../src/parts/tab";
import { isOn, setPreference } from "../src/preferences";
import { useAttention } from "../src/table/attention";
import type { OpenDecision } from "../src/table/model/live";
import { eventually, fieldOf, mount, root } from "./mounted";

const TURN = { id: 7n } as unknown as OpenDecision;

/** The title of a page, as the layout sets it, around a table. */
function Page({ decision, playing }: { decision: OpenDecision | undefined; playing: boolean }) {
  useTab("Table");
  return <AtTable decision={decision} playing={playing} />;
}

function AtTable({
  decision,
  playing,
  room = "00ff",
}: {
  decision: OpenDecision | undefined;
  playing: boolean;
  room?: string;
}) {
  useAttention(room, decision, playing);
  return null;
}

const notified = vi.fn();
const asked = vi.fn(async () => "granted");
const vibrate = vi.fn();
const released = vi.fn();
const locked = vi.fn(async () => ({ release: released }));
let focused = false;

class FakeNotification {
  static permission = "granted";
  static requestPermission = asked;
  onclick = () => {};
  constructor(title: string) {
    notified(title);
  }
  close() {}
}

beforeEach(() => {
  vi.stubGlobal("Notification", FakeNotification);
  vi.stubGlobal("isSecureContext", true);
  vi.spyOn(document, "hasFocus").mockImplementation(() => focused);
  Object.defineProperties(navigator, {
    vibrate: { value: vibrate, configurable: true },
    userActivation: { value: { hasBeenActive: true }, configurable: true },
    wakeLock: { value: { request: locked }, configurable: true },
    serviceWorker: { value: { getRegistration: async () => undefined }, configurable: true },
  });
  for (const mock of [notified, asked, vibrate, released, locked]) mock.mockClear();
  focused = false;
});

afterEach(() => {
  for (const name of ["vibrate", "userActivation", "wakeLock", "serviceWorker"])
    Reflect.deleteProperty(navigator, name);
  for (const name of ["tab", "vibration", "awake"] as const) setPreference(name, true);
  setPreference("notification", false);
});

const show = (decision: OpenDecision | undefined, playing = true) =>
  mount(<Page decision={decision} playing={playing} />);

test("the title and the icon say whose turn it is, as long as it is", async () => {
  const icon = document.head.appendChild(document.createElement("link"));
  icon.rel = "icon";
  icon.href = "/hat.svg";
  const plain = icon.href;
  await show(undefined);
  expect([document.title, icon.href]).toEqual(["Table", plain]);
  await show(TURN);
  expect([document.title, icon.href]).toEqual(["Your turn · Table", expect.stringContaining("data:image/svg+xml")]);
  await show(undefined);
  expect([document.title, icon.href]).toEqual(["Table", plain]);
  icon.remove();
});

test("a turn vibrates and keeps the screen on until the game ends; nothing is asked for", async () => {
  await show(TURN);
  expect(vibrate).toHaveBeenCalledTimes(1);
  expect(locked).toHaveBeenCalledTimes(1);
  expect(released).not.toHaveBeenCalled();
  await show(undefined, false);
  await eventually(() => expect(released).toHaveBeenCalled());
  expect([asked.mock.calls, notified.mock.calls]).toEqual([[], []]);
});

test("all of it can be switched off", async () => {
  for (const name of ["tab", "vibration", "awake"] as const) setPreference(name, false);
  await show(TURN);
  expect(document.title).toBe("Table");
  expect([vibrate.mock.calls, locked.mock.calls]).toEqual([[], []]);
});

test("a notification comes only if it is switched on and the page is not seen", async () => {
  setPreference("notification", true);
  focused = true;
  await show(TURN);
  focused = false;
  await show({ ...TURN, id: 8n });
  await eventually(() => expect(notified.mock.calls).toEqual([["Your turn"]]));
});

/** A service worker, with the open notifications by tag; the first registration waits for `registered`. */
function fakeWorker(registered = Promise.resolve()) {
  const open = new Map<string, { title: string; path: unknown; close(): void }>();
  const worker = {
    showNotification: async (title: string, { tag, data }: { tag: string; data: { path: string } }) => {
      open.set(tag, { title, path: data.path, close: () => open.delete(tag) });
    },
    getNotifications: async ({ tag }: { tag: string }) => [open.get(tag)].filter((one) => one !== undefined),
  };
  const getRegistration = () => registered.then(() => worker);
  Object.defineProperties(navigator, { serviceWorker: { value: { getRegistration }, configurable: true } });
  return open;
}

test("each table has a notification of its own, which closes with its decision", async () => {
  setPreference("notification", true);
  const open = fakeWorker();
  const two = (first: OpenDecision | undefined) => (
    <>
      <AtTable room="01" decision={first} playing />
      <AtTable room="02" decision={TURN} playing />
    </>
  );
  await mount(two(TURN));
  await eventually(() => expect(open.size).toBe(2));
  const [first, second] = open.values();
  expect([first?.title, first?.path]).toEqual(["Your turn", location.pathname]);
  await mount(two(undefined));
  await eventually(() => expect([...open.values()]).toEqual([second]));
});

test("a decision that is over before its notification is shown has none", async () => {
  setPreference("notification", true);
  let register = () => {};
  const shown = fakeWorker(
    new Promise((resolve) => {
      register = resolve;
    }),
  );
  const set = vi.spyOn(shown, "set");
  await show(TURN);
  await show(undefined);
  register();
  await show({ ...TURN, id: 8n });
  await eventually(() => expect(shown.size).toBe(1));
  expect(set).toHaveBeenCalledTimes(1);
});

test("a browser that refuses notifications of a page is left in peace", async () => {
  setPreference("notification", true);
  notified.mockImplementationOnce(() => {
    throw new TypeError("Illegal constructor");
  });
  await show(TURN);
  await eventually(() => expect(notified).toHaveBeenCalledTimes(1));
  await show(undefined);
});

test.each([
  ["that page, if it is open", "/rooms/02", "focused /rooms/02"],
  ["its address, if it is not", "/rooms/03", "opened /rooms/03"],
])("a click on a notification shows %s", async (_, path, expected) => {
  const listeners: Partial<Record<string, (event: object) => void>> = {};
  const done: string[] = [];
  const page = (path: string) => ({ url: `http://127.0.0.1${path}`, focus: () => done.push(`focused ${path}`) });
  const worker = {
    addEventListener: (name: string, listener: (event: object) => void) => {
      listeners[name] = listener;
    },
    clients: {
      matchAll: async () => [page("/rooms/01"), page("/rooms/02")],
      openWindow: (path: string) => done.push(`opened ${path}`),
    },
  };
  new Function("self", readFileSync("public/sw.js", "utf8"))(worker);
  let returned: Promise<unknown> | undefined;
  listeners.notificationclick?.({
    notification: { data: { path }, close: () => done.push("closed") },
    waitUntil: (promise: Promise<unknown>) => {
      returned = promise;
    },
  });
  await returned;
  expect(done).toEqual(["closed", expected]);
});

test.each([
  ["granted", true],
  ["denied", false],
])("the settings ask the browser on a click; if it is %s, the switch is %s", async (answer, on) => {
  asked.mockImplementation(async () => answer);
  await mount(<Settings onClose={() => {}} />);
  expect(asked).not.toHaveBeenCalled();
  await act(() => fieldOf("Notify me on my turn")?.click());
  await eventually(() => expect(isOn("notification")).toBe(on));
  expect(asked).toHaveBeenCalledTimes(1);
  await act(() => undefined);
  expect(root.textContent?.includes("does not allow notifications")).toBe(!on);
});
