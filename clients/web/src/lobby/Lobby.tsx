// The start page: start a game at once, create a room, join with a code; below, the rooms and
// tournaments of the server.

import type { ComponentChildren } from "preact";
import { wordsOf } from "../api/faults";
import { countWords, type Shown, useShown } from "../api/pages";
import { usePolled } from "../api/poll";
import { type Room, RoomState } from "../gen/chefshat/v1/room_pb";
import { t } from "../i18n";
import { ButtonLink } from "../parts/Button";
import { MoreButton } from "../parts/MoreButton";
import { Notice } from "../parts/Notice";
import { pathOf } from "../router";
import { JoinForm } from "./JoinForm";
import css from "./Lobby.module.css";
import { QuickGame } from "./QuickGame";
import { RoomCard } from "./RoomCard";
import { openRooms, roomsIn } from "./rooms";
import { roomsWithSeats } from "./seat";
import { TournamentStrip } from "./TournamentStrip";

/** Polling interval of the lists, milliseconds. */
const EVERY_MS = 3000;
/** Polling interval of finished rooms, milliseconds: nobody is waiting for them. */
const OVER_EVERY_MS = 20_000;
/** Rooms shown at first, and more at a time. */
const AT_A_TIME = 12;

/** The page. */
export function Lobby() {
  const words = t().lobby;
  const waiting = useShown(roomsIn(RoomState.WAITING), AT_A_TIME, EVERY_MS, "waiting");
  const playing = useShown(roomsIn(RoomState.PLAYING), AT_A_TIME, EVERY_MS, "playing");
  const over = useShown(roomsIn(RoomState.FINISHED), AT_A_TIME, OVER_EVERY_MS, "over");
  const fault = waiting.fault ?? playing.fault;
  const held = roomsWithSeats();
  const own = usePolled((signal) => openRooms(held, signal), EVERY_MS, held.join()).value ?? [];
  return (
    <div class={css.lobby}>
      <h1 class="visually-hidden">{t().common.nav.lobby}</h1>
      {own.length > 0 && (
        <section class={css.section} data-part="own-seats">
          <h2>{words.rooms.own}</h2>
          <Rooms rooms={own} />
        </section>
      )}
      <div class={css.start}>
        <QuickGame />
        <section class={`sheet ${css.tile}`}>
          <h2>{words.join.title}</h2>
          <JoinForm />
        </section>
        <section class={`sheet ${css.tile}`}>
          <h2>{words.make.title}</h2>
          <p>{words.make.text}</p>
          <ButtonLink href="/new">{words.make.link}</ButtonLink>
          <a class="own-line" href={pathOf({ page: "studies" })}>
            {words.make.studies}
          </a>
        </section>
      </div>
      {fault && <Notice kind="fault">{wordsOf(fault)}</Notice>}
      <RoomSection title={words.rooms.waiting} shown={waiting} own={own}>
        {words.rooms.noneWaiting}
      </RoomSection>
      <RoomSection title={words.rooms.playing} shown={playing} own={own} half>
        {words.rooms.nonePlaying}
      </RoomSection>
      <TournamentStrip />
      {over.list && over.list.items.length > 0 && <RoomSection title={words.rooms.over} shown={over} />}
    </div>
  );
}

/**
 * A list of rooms with its title; `children` if it is empty. Those with own seats are listed above. On a
 * large screen another section may stand beside it.
 */
function RoomSection(props: {
  title: string;
  shown: Shown<Room>;
  own?: readonly Room[];
  half?: boolean;
  children?: ComponentChildren;
}) {
  const { title, shown, own = [], half = false, children } = props;
  const { list } = shown;
  if (list === null) return null;
  return (
    <section class={`${css.section} ${half ? css.half : ""}`} data-part="lobby-section">
      <h2>
        {title} {list.items.length > 0 && <span class="soft number">{countWords(list.items.length, list.more)}</span>}
      </h2>
      {list.items.length === 0 && <p class="soft">{children}</p>}
      <Rooms rooms={list.items.filter(({ roomId }) => !own.some((room) => room.roomId === roomId))} />
      <MoreButton shown={shown} what={title} />
    </section>
  );
}

function Rooms({ rooms }: { rooms: readonly Room[] }) {
  return (
    <ul class={css.rooms} data-part="lobby-rooms">
      {rooms.map((room) => (
        <RoomCard key={room.roomId} room={room} />
      ))}
    </ul>
  );
}
