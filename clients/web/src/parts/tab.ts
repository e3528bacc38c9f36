// The title and the icon of the browser's tab. A page may put a mark on both, such as that it is the
// reader's turn.

import { signal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { insideOf } from "./Drawing";

/** A few words before the title; empty for no mark. */
const mark = signal("");

/** Marks the tab with a few words while they are not empty. */
export function useTabMark(words: string): void {
  useEffect(() => {
    mark.value = words;
    return () => {
      mark.value = "";
    };
  }, [words]);
}

/** Sets the title of the tab, and marks it; for the layout. */
export function useTab(title: string): void {
  const words = mark.value;
  useEffect(() => {
    document.title = words === "" ? title : `${words} · ${title}`;
  }, [title, words]);
  const marked = words !== "";
  useEffect(() => {
    const icon = document.querySelector<HTMLLinkElement>('link[rel="icon"]');
    if (!marked || !icon) return;
    const plain = icon.href;
    icon.href = MARKED_ICON;
    return () => {
      icon.href = plain;
    };
  }, [marked]);
}

/** The project's hat with a disc in the corner. */
const MARKED_ICON = `data:image/svg+xml,${encodeURIComponent(
  `<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 48 48" fill="none" stroke="#2b2320" stroke-width="2">${insideOf(
    "joker",
  )}<circle cx="36" cy="36" r="11" fill="#0072b2" stroke="#ffffff" stroke-width="3"/></svg>`,
)}`;
