// What is left out on the page just now, for a study. The style sheet leaves out most of it by `data-hide` of the document; what is read out or
// can be followed by keyboard asks here.

import { signal } from "@preact/signals";
import type { Hideable } from "./study";

/** What is left out; nothing outside a study. */
export const hidden = signal<readonly Hideable[]>([]);

/** Leaves parts out, or nothing any more. */
export function setHidden(parts: readonly Hideable[]): void {
  const { dataset } = document.documentElement;
  if (parts.length > 0) dataset.hide = parts.join(" ");
  else delete dataset.hide;
  hidden.value = parts;
}
