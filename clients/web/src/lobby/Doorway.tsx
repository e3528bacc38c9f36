// A room for someone without a seat: its players, how to join or watch; for its creator, how to
// invite others and how to close it.

import { roomApi } from "../api/client";
import { wordsOf } from "../api/faults";
import { usePolled } from "../api/poll";
import { tableTicket } from "../attend/ticket";
import { type Room, RoomState } from "../gen/chefshat/v1/room_pb";
import { t } from "../i18n";
import { ButtonLink } from "../parts/Button";
import { ConfirmButton } from "../parts/ConfirmButton";
import { Notice } from "../parts/Notice";
import { pathOf } from "../router";
import css from "./Doorway.module.css";
import { NameForm } from "./Join";
import { JoinForm } from "./JoinForm";
import { RoomStateChip, rulesInShort } from "./RoomCard";
import { RoomInvite } from "./RoomInvite";
import { freeForPeople, isForAgents, isOpen } from "./rooms";
import { Seats } from "./Seats";
import { closeRoom, hostedRoom } from "./seat";

/** Polling interval of the room, milliseconds. */
const EVERY_MS = 2000;

/** The page of a room without a seat. */
export function Doorway({ roomId }: { roomId: string }) {
  const words = t().lobby.door;
  const ask = async (signal: AbortSignal) => (await roomApi.getRoom({ roomId }, { signal })).room;
  const { value: room, fault } = usePolled(ask, EVERY_MS, roomId);
  if (!room) {
    if (!fault) return <p class="soft">{t().common.loading}</p>;
    return (
      <div class={css.doorway}>
        <section class="sheet">
          <Notice kind="fault">{wordsOf(fault)}</Notice>
          <p>
            <ButtonLink href="/">{t().common.toLobby}</ButtonLink>
          </p>
        </section>
      </div>
    );
  }
  const waiting = room.state === RoomState.WAITING && room.tournamentId === "";
  return (
    <div class={css.doorway}>
      <section class="sheet stack">
        <header class={css.head}>
          <h1>{room.name || t().lobby.rooms.unnamed}</h1>
          <RoomStateChip room={room} />
        </header>
        <p class="soft">{rulesInShort(room)}</p>
        <Seats room={room} />
        <DoorwayLinks room={room} />
        {fault && <Notice kind="fault">{wordsOf(fault)}</Notice>}
      </section>
      {waiting && <WayIn room={room} />}
      {[RoomState.WAITING, RoomState.PLAYING].includes(room.state) && hostedRoom(roomId) && (
        <ConfirmButton label={words.close} act={() => closeRoom(roomId)}>
          {room.state === RoomState.WAITING ? words.closeSure : words.closePlaying}
        </ConfirmButton>
      )}
    </div>
  );
}

/** How to join while the room waits. */
function WayIn({ room }: { room: Room }) {
  const hosted = hostedRoom(room.roomId);
  const seatForPeople = freeForPeople(room.seats).length > 0;
  return (
    <>
      {seatForPeople && (
        <section class="sheet stack">
          <h2>{t().lobby.join.sitDown}</h2>
          {hosted ? <NameForm code={hosted.joinCode} room={room} /> : <JoinForm />}
        </section>
      )}
      {isOpen(room) && <RoomInvite roomId={room.roomId} forAgents={isForAgents(room.seats)} />}
    </>
  );
}

function DoorwayLinks({ room }: { room: Room }) {
  const words = t().lobby.rooms;
  const over = room.state === RoomState.FINISHED || room.state === RoomState.ABORTED;
  if (room.state === RoomState.ABORTED) return <Notice kind="hint">{t().lobby.door.aborted}</Notice>;
  return (
    <div class="row">
      {!over && tableTicket(room.roomId) !== null && (
        <ButtonLink look="main" href={pathOf({ page: "attend", roomId: room.roomId })}>
          {t().attend.title}
        </ButtonLink>
      )}
      {over && <ButtonLink href={pathOf({ page: "replay", gameId: room.gameId })}>{words.replay}</ButtonLink>}
      {!over && room.policy?.spectators && (
        <ButtonLink href={pathOf({ page: "watch", roomId: room.roomId })}>{words.watch}</ButtonLink>
      )}
    </div>
  );
}
