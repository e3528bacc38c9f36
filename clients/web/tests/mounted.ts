// Where component tests render: an element in the page, new for each test. A file that imports `root` has the hooks.

import { render } from "preact";
import { act } from "preact/test-utils";
import { afterEach, beforeEach, vi } from "vitest";
import { startLanguage } from "../src/i18n";

export let root: HTMLElement;

/** Lets the page process the responses that fakes have given. */
export const settle = () => act(() => new Promise<void>((resolve) => setTimeout(resolve)));

/** Waits until a check passes, as long as a busy machine may take to load a language. */
export const eventually = (check: () => void) => vi.waitFor(check, { timeout: 30_000 });

/** The first button whose text begins with these words. */
export const button = (words: string) =>
  [...root.querySelectorAll("button")].find((one) => one.textContent?.startsWith(words));

/** Presses a button, and lets what it sends be answered. */
export async function press(words: string) {
  const found = button(words);
  if (!found) throw new Error(`no button "${words}"`);
  await act(() => found.click());
  await settle();
}

/** Types a text into a field, in place of what it had. */
export function type(field: HTMLInputElement | HTMLTextAreaElement | null | undefined, text: string) {
  if (!field) throw new Error("there is no such field");
  return act(() => {
    field.value = text;
    field.dispatchEvent(new Event("input", { bubbles: true }));
  });
}

beforeEach(async () => {
  await startLanguage();
  root = document.createElement("div");
  document.body.append(root);
});

afterEach(async () => {
  await act(() => render(null, root));
  root.remove();
});
