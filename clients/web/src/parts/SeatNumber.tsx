// A seat as a number on a disc of its colour: what all pages and pictures know a seat by. As high as the text around it.

import "./seat-number.css";

/** The disc. Who listens hears nothing of it: the seat's name or number is said beside it. */
export function SeatNumber({ seat }: { seat: number }) {
  return (
    <span class={`seat-number seat-color-${seat}`} aria-hidden="true">
      {seat}
    </span>
  );
}
