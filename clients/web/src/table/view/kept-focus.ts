// The keyboard's focus in a part of the page that changes under it. A card that is played and a button whose decision is taken go away, and the
// browser would throw who had the focus there back to the beginning of the page. It goes to a place of refuge instead, which does nothing by
// itself: never to another card or button, which the next key would then use although nobody chose it.

import type { RefObject } from "preact";
import { useLayoutEffect, useRef } from "preact/hooks";

/** Keeps the focus in the part that the two listeners are put on; it falls back to `refuge`. */
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
