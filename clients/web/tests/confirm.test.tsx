// The confirm button: focus, a single action, and errors.

import { act } from "preact/test-utils";
import { beforeEach, expect, test } from "vitest";
import { ConfirmButton } from "../src/parts/ConfirmButton";
import { button, mount, press, root } from "./mounted";

let calls: { done: () => void; failed: (why: Error) => void }[];

beforeEach(async () => {
  calls = [];
  const perform = () => new Promise<void>((done, failed) => calls.push({ done, failed }));
  await mount(
    <ConfirmButton label="Close…" confirm="Do it" act={perform}>
      It ends for everybody.
    </ConfirmButton>,
  );
});

test("the question gets the focus, and then the button", async () => {
  await press("Close…");
  expect(document.activeElement?.textContent).toBe("It ends for everybody.");
  await press("Cancel");
  expect(document.activeElement).toBe(button("Close…"));
  expect(calls).toHaveLength(0);
});

test("pressed twice, it acts once", async () => {
  await press("Close…");
  await press("Do it");
  await press("Do it");
  expect(calls).toHaveLength(1);
  expect(button("Do it")?.disabled).toBe(true);
});

test("an error is shown until the next attempt or cancellation", async () => {
  await press("Close…");
  await press("Do it");
  await act(async () => calls[0]?.failed(new Error("no")));
  expect(root.querySelector("[role=alert]")).not.toBeNull();
  expect(button("Do it")?.disabled).toBe(false);
  await press("Cancel");
  expect(root.querySelector("[role=alert]")).toBeNull();
});
