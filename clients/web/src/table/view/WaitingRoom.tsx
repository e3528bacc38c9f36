// A room before its game: who has which seat, and which are still free. The game begins by itself.

import type { ComponentChildren } from "preact";
import { t } from "../../i18n";
import { isTaken, type TableState } from "../model/state";
import { SeatPanel } from "./SeatPanel";
import "./table.css";
import "./seats.css";

interface WaitingRoomProps {
  table: TableState;
  own: number | undefined;
  banner?: ComponentChildren;
}

export function WaitingRoom({ table, own, banner }: WaitingRoomProps) {
  const words = t().table.room;
  const free = table.seats.filter((seat) => !isTaken(seat)).length;
  return (
    <section class="waiting-room">
      <h1>{table.roomName || t().table.title}</h1>
      {banner}
      <p>
        <strong>{free > 0 ? words.waiting(free) : t().table.heading.waiting}</strong> {words.begins}
      </p>
      <ol class="seats" style={{ "--seats": Math.min(4, table.seats.length) }} aria-label={words.seats}>
        {table.seats.map((seat) => (
          <li key={seat.seat}>
            <SeatPanel table={table} seat={seat} own={seat.seat === own} deciding={false} cards={false} />
          </li>
        ))}
      </ol>
    </section>
  );
}
