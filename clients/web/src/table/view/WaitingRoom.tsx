// A room before its game: the seats, what is missing, and how others can join. The game starts
// automatically. The room's creator sees the invitation below. Connections are no events of a
// waiting room, so the room is polled.

import type { ComponentChildren } from "preact";
import { roomApi } from "../../api/client";
import { usePolled } from "../../api/poll";
import { hidden } from "../../hiding";
import { t } from "../../i18n";
import { rulesInShort } from "../../lobby/RoomCard";
import { hostedRoom } from "../../lobby/seat";
import { ButtonLink } from "../../parts/Button";
import { KindBadge } from "../../parts/KindBadge";
import { SeatNumber } from "../../parts/SeatNumber";
import { isTaken, type SeatState, type TableState } from "../model/state";
import { nameOf } from "../words";
import { Board } from "./Board";
import css from "./WaitingRoom.module.css";

/** Polling interval, milliseconds. */
const EVERY_MS = 2000;

/** Toppings on the pizza per taken seat. */
const TOPPINGS_OF_A_SEAT = 4;
/** Ingredients drawn on it, by face. */
const TOPPINGS = [10, 9, 6, 7, 8, 11];

interface WaitingRoomProps {
  table: TableState;
  own: number | undefined;
  banner?: ComponentChildren;
}

export function WaitingRoom({ table, own, banner }: WaitingRoomProps) {
  const words = t().table.room;
  const { roomId } = table;
  const ask = async (signal: AbortSignal) => (await roomApi.getRoom({ roomId }, { signal })).room;
  const { value: room } = usePolled(ask, EVERY_MS, roomId);
  const seats = table.seats.map((seat): SeatState => {
    const connected = seat.seat === own || (room?.seats[seat.seat]?.connected ?? seat.connected);
    return { ...seat, connected };
  });
  const free = seats.filter((seat) => !isTaken(seat)).length;
  const away = seats.filter((seat) => isTaken(seat) && !isThere(seat)).length;
  const toppings = Array.from({ length: TOPPINGS_OF_A_SEAT * (seats.length - free) }, (_, index) => {
    return TOPPINGS[index % TOPPINGS.length] ?? 1;
  });
  return (
    <section class={css.room} data-part="waiting-room">
      <header class={css.head}>
        <h1>{table.roomName || t().table.title}</h1>
        {room && <p class="soft">{rulesInShort(room)}</p>}
      </header>
      {banner}
      <div class={css.parts}>
        <div class={`${css.words} sheet`}>
          <h2>{t().table.heading.waiting}</h2>
          <ol class={css.seats} aria-label={words.seats}>
            {seats.map((seat) => (
              <WaitingSeat key={seat.seat} table={table} seat={seat} own={seat.seat === own} />
            ))}
          </ol>
          <p>{words.begins}</p>
          {room && free > 0 && (
            <Ways roomId={roomId} tournament={room.tournamentId !== ""} seated={own !== undefined} />
          )}
        </div>
        <Board table={{ ...table, toppings }}>
          {free > 0 ? words.waiting(free) : away > 0 ? words.away(away) : t().table.heading.waiting}
        </Board>
      </div>
    </section>
  );
}

/** Whether the seat is ready for the game. */
function isThere({ connected, atTable, builtIn }: SeatState): boolean {
  return connected || atTable || builtIn !== "";
}

/** A seat: its participant and whether it is ready, or what it waits for. */
function WaitingSeat({ table, seat, own }: { table: TableState; seat: SeatState; own: boolean }) {
  const words = t().table.room;
  const taken = isTaken(seat);
  const ready = taken && isThere(seat);
  return (
    <li class={`${css.seat} ${ready ? css.ready : ""}`} data-part="waiting-seat" data-seat={seat.seat}>
      <SeatNumber seat={seat.seat} />
      <div class={css.who}>
        {taken ? (
          <>
            <h3>
              {nameOf(table, seat.seat)}
              {own && <span class="soft"> ({t().table.you})</span>}
            </h3>
            <p class={`${css.state} small`}>
              <KindBadge kind={seat.kind} builtIn={seat.builtIn} name={seat.name} />
              <span class={ready ? css.there : ""}>
                <span aria-hidden="true">{ready ? "✓" : "…"}</span> {ready ? readyWords(seat) : words.notHere}
              </span>
            </p>
          </>
        ) : (
          <>
            <h3>{t().table.freeSeat}</h3>
            <p class="soft small">{words.waitsFor[seat.reservedFor]}</p>
          </>
        )}
      </div>
    </li>
  );
}

function readyWords({ atTable, builtIn }: SeatState): string {
  if (atTable) return t().table.physical.atTable;
  return builtIn ? t().table.room.ready : t().table.room.here;
}

interface WaysProps {
  roomId: string;
  /** Whether the room belongs to a tournament. */
  tournament: boolean;
  /** Whether the reader has a seat. */
  seated: boolean;
}

/** How others can join, as far as the reader may know. */
function Ways({ roomId, tournament, seated }: WaysProps) {
  const words = t().table.room;
  const way = tournament ? words.assigned : hostedRoom(roomId) ? words.invite : seated ? words.invited : words.byCode;
  return (
    <section class={css.ways}>
      <h3>{words.ways}</h3>
      <p>{way}</p>
      {!tournament && !seated && !hidden.value.includes("pages") && (
        <ButtonLink href="/join">{words.toJoin}</ButtonLink>
      )}
    </section>
  );
}
