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

beforeEach(async () => {
  await startLanguage();
  root = document.createElement("div");
  document.body.append(root);
});

afterEach(async () => {
  await act(() => render(null, root));
  root.remove();
});
