// The parts of the page that a study hides from its participants. hiding.css hides most of them by
// `data-hide` of the document; screen reader announcements and keyboard handling ask here.

import { signal } from "@preact/signals";
import "./hiding.css";

/** A part that a study can hide. */
export type Hideable = "log" | "lookup" | "expressions" | "played" | "pages";

/** The hidden parts; empty outside a study. */
export const hidden = signal<readonly Hideable[]>([]);

/**
 * What each rendered part wants hidden. During a change of pages the second one may arrive before
 * the first one leaves.
 */
const wanted = new Set<readonly Hideable[]>();

/** Hides parts until the returned function is called. */
export function leaveOut(parts: readonly Hideable[]): () => void {
  const own = [...parts];
  wanted.add(own);
  show();
  return () => {
    wanted.delete(own);
    show();
  };
}

function show(): void {
  const parts = [...new Set([...wanted].flat())];
  const { dataset } = document.documentElement;
  if (parts.length > 0) dataset.hide = parts.join(" ");
  else delete dataset.hide;
  hidden.value = parts;
}
