// A room before its game: who has which seat, which are still free and for whom. The game begins by itself. Who is connected is no event of a
// room that waits, so it is asked for.

import type { ComponentChildren } from "preact";
import { CALL_LIMIT_MS, roomApi } from "../../api/client";
import { usePolled } from "../../api/poll";
import { t } from "../../i18n";
import { isTaken, type SeatState, type TableState } from "../model/state";
import { Board } from "./Board";
import { SeatPanel } from "./SeatPanel";
import "./table.css";
import "./seats.css";

/** How often it is asked who is connected, milliseconds. */
const EVERY_MS = 2000;

/** Toppings that a pizza gets for each seat that is taken. */
const TOPPINGS_OF_A_SEAT = 4;
/** Ingredients that look well on it, by face. */
const TOPPINGS = [10, 9, 6, 7, 8, 11];

interface WaitingRoomProps {
  table: TableState;
  own: number | undefined;
  banner?: ComponentChildren;
}

export function WaitingRoom({ table, own, banner }: WaitingRoomProps) {
  const words = t().table.room;
  const { roomId } = table;
  const ask = async (signal: AbortSignal) =>
    (await roomApi.getRoom({ roomId }, { signal, timeoutMs: CALL_LIMIT_MS })).room;
  const { value: room } = usePolled(ask, EVERY_MS, roomId);
  const seats = table.seats.map((seat): SeatState => {
    const connected = seat.seat === own || (room?.seats[seat.seat]?.connected ?? seat.connected);
    return { ...seat, connected };
  });
  const free = seats.filter((seat) => !isTaken(seat)).length;
  const toppings = Array.from({ length: TOPPINGS_OF_A_SEAT * (seats.length - free) }, (_, index) => {
    return TOPPINGS[index % TOPPINGS.length] ?? 1;
  });
  return (
    <section class="waiting-room">
      <h1>{table.roomName || t().table.title}</h1>
      {banner}
      <ol class="seats" style={{ "--seats": Math.min(4, seats.length) }} aria-label={words.seats}>
        {seats.map((seat) => (
          <li key={seat.seat}>
            <SeatPanel table={table} seat={seat} own={seat.seat === own} deciding={false} cards={false} />
          </li>
        ))}
      </ol>
      <Board table={{ ...table, toppings }}>
        <strong>{free > 0 ? words.waiting(free) : t().table.heading.waiting}</strong> {words.begins}
      </Board>
    </section>
  );
}
