// Drawings of the expressions that a person can show with one click. Other expressions, of robots
// and agents, are shown by their label.

import type { Label } from "../expressions";
import css from "./Tools.module.css";

/** Brows, eyes and mouth of each expression, in a box of 48 by 48. */
const FEATURES: Record<Label, string> = {
  joy: "M15 19v3M33 19v3M14 29c4 8 16 8 20 0",
  amusement: "M12 21c2-4 6-4 8 0M28 21c2-4 6-4 8 0M14 27h20c0 12-20 12-20 0Z",
  surprise: "M12 13c2-2 5-2 7-1M29 12c2-1 5-1 7 1M16 20v3M32 20v3M24 29c5 0 5 9 0 9s-5-9 0-9Z",
  concentration: "M12 16l8 1M28 17l8-1M16 22v2M32 22v2M18 33h12",
  annoyance: "M12 15l9 4M36 15l-9 4M17 23v2M31 23v2M15 35c3-4 6 1 9-1s6-3 9 0",
  sadness: "M12 18l8-4M36 18l-8-4M16 22v3M32 22v3M15 36c4-7 14-7 18 0",
};

/** The face of an expression; decorative. */
export function Face({ label }: { label: Label }) {
  return (
    <svg
      class={css.face}
      viewBox="0 0 48 48"
      aria-hidden="true"
      fill="none"
      stroke="#2b2320"
      stroke-width="2.6"
      stroke-linecap="round"
      stroke-linejoin="round"
    >
      <circle cx="24" cy="24" r="20" fill="#ffd95e" />
      <path d={FEATURES[label]} />
    </svg>
  );
}
