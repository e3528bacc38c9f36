// A server that has been updated: the page says so with a button, and only then.

import { Code, ConnectError } from "@connectrpc/connect";
import { act } from "preact/test-utils";
import { afterEach, beforeEach, expect, test, vi } from "vitest";
import { follow } from "../src/api/follow";
import { lookForUpdate, outdated, startUpdates } from "../src/api/update";
import { UpdateNotice, UpdateSetting } from "../src/parts/Update";
import { mount, root, settle } from "./mounted";

const documentOf = (script: string) =>
  new Response(`<html><head><script type="module" crossorigin src="${script}"></script></head></html>`);
const ask = vi.fn<typeof fetch>();

beforeEach(() => {
  outdated.value = false;
  // Of another type at first, so that the document does not load it.
  document.head.innerHTML = '<script type="text/plain" src="/assets/index-old.js"></script>';
  document.querySelector("script")?.setAttribute("type", "module");
  ask.mockReset();
  vi.stubGlobal("fetch", ask);
});
afterEach(() => {
  document.head.replaceChildren();
});

test.each([
  ["the same version", () => documentOf("/assets/index-old.js"), false],
  ["another version", () => documentOf("/assets/index-new.js"), true],
  ["the page of a hotspot", () => new Response('<script type="module" src="/login.js"></script>'), false],
  [
    "an error",
    () => new Response('<script type="module" src="/assets/index-new.js"></script>', { status: 502 }),
    false,
  ],
])("%s is or is not an update", async (_, answer, expected) => {
  ask.mockImplementation(async () => answer());
  await lookForUpdate();
  expect(ask).toHaveBeenCalledTimes(1);
  expect(outdated.value).toBe(expected);
});

test("after a failure it is looked for again, and once found no longer", async () => {
  ask.mockRejectedValueOnce(new TypeError("no network"));
  ask.mockImplementation(async () => documentOf("/assets/index-new.js"));
  await lookForUpdate();
  expect(outdated.value).toBe(false);
  await lookForUpdate();
  expect(outdated.value).toBe(true);
  await lookForUpdate();
  expect(ask).toHaveBeenCalledTimes(2);
});

test("a document that never comes does not keep it from being looked for again", async () => {
  const late = new AbortController();
  vi.spyOn(AbortSignal, "timeout").mockReturnValueOnce(late.signal);
  ask.mockImplementationOnce(
    (_, init) =>
      new Promise((_, reject) => {
        init?.signal?.addEventListener("abort", () => reject(new TypeError("too late")));
      }),
  );
  ask.mockImplementation(async () => documentOf("/assets/index-new.js"));
  const first = lookForUpdate();
  late.abort();
  await first;
  await lookForUpdate();
  expect(outdated.value).toBe(true);
});

test("a stream that is lost and back, a page that is seen again, and time look for it", async () => {
  ask.mockImplementation(async () => documentOf("/assets/index-old.js"));
  const streams = [["a"], ["b", "end"]];
  const following = follow(
    async function* () {
      yield* streams.shift() ?? [];
      throw new ConnectError("away", Code.Unavailable);
    },
    (message) => message !== "end",
  );
  expect(ask).not.toHaveBeenCalled();
  await expect.poll(() => following.link.value).toBe("ended");
  expect(ask).toHaveBeenCalledTimes(1);
  vi.useFakeTimers();
  startUpdates();
  document.dispatchEvent(new Event("visibilitychange"));
  expect(ask).toHaveBeenCalledTimes(2);
  await vi.advanceTimersByTimeAsync(300_000);
  expect(ask).toHaveBeenCalledTimes(3);
  vi.useRealTimers();
});

test("the offer reloads, is closed once, and stays in the settings", async () => {
  const reload = vi.spyOn(location, "reload").mockImplementation(() => {});
  await mount(
    <>
      <UpdateNotice unattended={false} />
      <UpdateSetting />
    </>,
  );
  expect(root.textContent).toBe("");
  await act(() => {
    outdated.value = true;
  });
  await settle();
  const buttons = () => [...root.querySelectorAll("button")];
  expect(buttons().map((button) => button.textContent)).toEqual(["Load the new version", "×", "Load the new version"]);
  buttons()[0]?.click();
  expect(reload).toHaveBeenCalledTimes(1);
  await act(() => buttons()[1]?.click());
  expect(buttons().map((button) => button.textContent)).toEqual(["Load the new version"]);
});

test("a wall loads itself, and says nothing", async () => {
  const reload = vi.spyOn(location, "reload").mockImplementation(() => {});
  await mount(<UpdateNotice unattended />);
  expect(reload).not.toHaveBeenCalled();
  await act(() => {
    outdated.value = true;
  });
  expect(reload).toHaveBeenCalledTimes(1);
  expect(root.textContent).toBe("");
});
