// A seat as a number on a disc of its colour: what all pages and pictures know a seat by. As high as the text around it.

import css from "./SeatNumber.module.css";

/** The disc. Who listens hears nothing of it: the seat's name or number is said beside it. */
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
