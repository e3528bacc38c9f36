// A seat's number on a disc of its colour, as on all pages and pictures. As high as the surrounding
// text.

import css from "./SeatNumber.module.css";

/** The disc. Hidden from screen readers: text beside it names the seat. */
export function SeatNumber({ seat }: { seat: number }) {
  return (
    <span
      class={css.seatNumber}
      data-part="seat-number"
      style={{ background: `var(--seat-${seat})` }}
      aria-hidden="true"
    >
      {seat}
    </span>
  );
}
