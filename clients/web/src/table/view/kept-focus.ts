// Keeps the keyboard focus in a part of the page whose elements disappear: when a focused card or
// button goes away, the browser would move the focus to the start of the page. It moves to a refuge
// instead that does nothing by itself: never to another card or button, which the next key would
// activate.

import type { RefObject } from "preact";
import { useLayoutEffect, useRef } from "preact/hooks";

/** Keeps the focus in the part with these two listeners; falls back to `refuge`. */
export function useKeptFocus(refuge: RefObject<HTMLElement | null>) {
  const inside = useRef(false);
  useLayoutEffect(() => {
    if (inside.current && document.activeElement === document.body) refuge.current?.focus({ preventScroll: true });
  });
  return {
    onFocusIn: () => {
      inside.current = true;
    },
    onFocusOut: (event: FocusEvent) => {
      if (event.relatedTarget) inside.current = false;
    },
  };
}
