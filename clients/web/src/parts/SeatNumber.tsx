// A seat's number on a disc of its colour. As high as the surrounding text.

import css from "./SeatNumber.module.css";

/** The number of a seat for people, who count from 1; the protocol counts from 0. */
export function seatNumber(seat: number): number {
  return seat + 1;
}

/** The disc. Hidden from screen readers: text beside it names the seat. */
export function SeatNumber({ seat }: { seat: number }) {
  return (
    <span
      class={css.seatNumber}
      data-part="seat-number"
      style={{ background: `var(--seat-${seat})` }}
      aria-hidden="true"
    >
      {seatNumber(seat)}
    </span>
  );
}
