// The players of a room: one line per seat with number, colour, name and kind, or whom a free seat
// is reserved for.

import { ParticipantKind, type Room } from "../gen/chefshat/v1/room_pb";
import { t } from "../i18n";
import { KindBadge, kindWord } from "../parts/KindBadge";
import { SeatNumber } from "../parts/SeatNumber";
import { isFree, nameOf } from "./rooms";
import css from "./Seats.module.css";

/** The seats of a room. */
export function Seats({ room, mine }: { room: Room; mine?: number | undefined }) {
  const words = t().lobby.seats;
  return (
    <ul class={css.seatList}>
      {room.seats.map((participant) => (
        <li key={participant.seat} class={css.line}>
          <SeatNumber seat={participant.seat} />
          <span class="visually-hidden">{t().common.seat(participant.seat)}:</span>
          {isFree(participant) ? (
            <span class="soft">
              {participant.reservedFor === ParticipantKind.UNSPECIFIED
                ? words.free
                : words.reservedFor(kindWord(participant.reservedFor))}
            </span>
          ) : (
            <>
              <span class={css.name}>
                {nameOf(participant)}
                {participant.seat === mine && <span class="soft"> {words.you}</span>}
              </span>
              <KindBadge kind={participant.kind} builtIn={participant.builtInAgent} name={participant.name} />
              {participant.atTable ? (
                <span class="soft small">{t().table.physical.atTable}</span>
              ) : (
                !participant.connected && <span class={css.away}>{t().table.presence.away}</span>
              )}
            </>
          )}
        </li>
      ))}
    </ul>
  );
}
