// Where component tests render: an element in the page, new for each test. A file that imports this has the hooks.

import { type ComponentChild, render } from "preact";
import { act } from "preact/test-utils";
import { afterEach, beforeEach, vi } from "vitest";
import { startLanguage } from "../src/i18n";

export let root: HTMLElement;

/** Shows something, in place of what was there. */
export const mount = (shown: ComponentChild) => act(() => render(shown, root));

/** Lets the page process the responses that fakes have given. */
export const settle = () => act(() => new Promise<void>((resolve) => setTimeout(resolve)));

/** Lets time pass, by fake timers. */
export const later = (ms: number) =>
  act(async () => {
    await vi.advanceTimersByTimeAsync(ms);
  });

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

/** The field with a label. */
export function fieldOf(label: string) {
  const found = [...root.querySelectorAll("label")].find(({ textContent }) => textContent === label);
  return root.querySelector<HTMLInputElement>(`[id="${found?.htmlFor}"]`);
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
  await mount(null);
  root.remove();
});
