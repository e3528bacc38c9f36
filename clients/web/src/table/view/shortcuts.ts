// Listens for the keys of the table wherever the focus is, unless somebody types a text, a dialog is
// open, or a part of the page has handled the key. They can be switched off in the settings.

import { useLayoutEffect, useRef } from "preact/hooks";
import { isOn } from "../../preferences";

/** Elements that type. */
const TYPING = "input, textarea, select, [contenteditable]";
/** Elements that Enter activates. */
const ACTIVE = "a, button, summary";

/** Calls `press` with each key; it returns whether the key meant something. */
export function useShortcuts(press: (key: string) => boolean): void {
  const latest = useRef(press);
  latest.current = press;
  const on = isOn("keys");
  // With the first picture: a key pressed at once counts.
  useLayoutEffect(() => {
    if (!on) return;
    const listen = (event: KeyboardEvent) => {
      const { key, target } = event;
      if (event.defaultPrevented || event.repeat || event.ctrlKey || event.metaKey || event.altKey) return;
      if (document.querySelector("dialog[open]")) return;
      if (target instanceof Element && target.closest(key === "Enter" ? `${TYPING}, ${ACTIVE}` : TYPING)) return;
      if (latest.current(key)) event.preventDefault();
    };
    document.addEventListener("keydown", listen);
    return () => document.removeEventListener("keydown", listen);
  }, [on]);
}
