// What is left out on the page just now, for a study. The style sheet leaves out most of it by `data-hide` of the document; what is read out or
// can be followed by keyboard asks here.

import { signal } from "@preact/signals";
import { useLayoutEffect } from "preact/hooks";
import type { Hideable, Study } from "./study";
import "./hiding.css";

/** What is left out; nothing outside a study. */
export const hidden = signal<readonly Hideable[]>([]);

/** What each part of the page that is drawn just now wants left out: of two that follow each other the second may come before the first goes. */
const wanted = new Set<readonly Hideable[]>();

/** Leaves parts out until what it returns is called. */
export function leaveOut(parts: readonly Hideable[]): () => void {
  const own = [...parts];
  wanted.add(own);
  show();
  return () => {
    wanted.delete(own);
    show();
  };
}

/** Leaves out what a study leaves out, for as long as the page that uses this is drawn. */
export function useHiding(study: Study | null): void {
  const hide = study?.hide.join(" ") ?? "";
  useLayoutEffect(() => leaveOut(study?.hide ?? []), [hide]);
}

function show(): void {
  const parts = [...new Set([...wanted].flat())];
  const { dataset } = document.documentElement;
  if (parts.length > 0) dataset.hide = parts.join(" ");
  else delete dataset.hide;
  hidden.value = parts;
}
