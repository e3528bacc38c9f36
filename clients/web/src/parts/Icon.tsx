// A line icon in a box of 24 by 24, in the colour of the surrounding text. Decorative: its button
// has a label.

import type { ComponentChildren } from "preact";

/** The frame of an icon; `children` are its paths. */
export function Icon({ filled = false, children }: { filled?: boolean; children: ComponentChildren }) {
  return (
    <svg
      viewBox="0 0 24 24"
      aria-hidden="true"
      fill={filled ? "currentColor" : "none"}
      stroke="currentColor"
      stroke-width={filled ? 2.5 : 2}
      stroke-linecap="round"
      stroke-linejoin="round"
    >
      {children}
    </svg>
  );
}
