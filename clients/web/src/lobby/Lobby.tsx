// The start page: start a game at once, create a room, join with a code; below, the rooms and
// tournaments of the server.

import type { ComponentChildren } from "preact";
import { wordsOf } from "../api/faults";
import { countWords, type Shown, useShown } from "../api/pages";
import { type Room, RoomState } from "../gen/chefshat/v1/room_pb";
import { t } from "../i18n";
import { ButtonLink } from "../parts/Button";
import { MoreButton } from "../parts/MoreButton";
import { Notice } from "../parts/Notice";
import { JoinForm } from "./JoinForm";
import css from "./Lobby.module.css";
import { QuickGame } from "./QuickGame";
import { RoomCard } from "./RoomCard";
import { roomsIn } from "./rooms";
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
  return (
    <div class={css.lobby}>
      <h1 class="visually-hidden">{words.title}</h1>
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
        </section>
      </div>
      {fault && <Notice kind="fault">{wordsOf(fault)}</Notice>}
      <RoomSection title={words.rooms.waiting} shown={waiting}>
        {words.rooms.noneWaiting}
      </RoomSection>
      <RoomSection title={words.rooms.playing} shown={playing}>
        {words.rooms.nonePlaying}
      </RoomSection>
      <TournamentStrip />
      {over.list && over.list.items.length > 0 && <RoomSection title={words.rooms.over} shown={over} />}
    </div>
  );
}

/** A list of rooms with its title; `children` if it is empty. */
function RoomSection(props: { title: string; shown: Shown<Room>; children?: ComponentChildren }) {
  const { title, shown, children } = props;
  const { list } = shown;
  if (list === null) return null;
  return (
    <section class={css.section} data-part="lobby-section">
      <h2>
        {title} {list.items.length > 0 && <span class="soft number">{countWords(list.items.length, list.more)}</span>}
      </h2>
      {list.items.length === 0 && <p class="soft">{children}</p>}
      <ul class={css.rooms} data-part="lobby-rooms">
        {list.items.map((room) => (
          <RoomCard key={room.roomId} room={room} />
        ))}
      </ul>
      <MoreButton shown={shown} what={title} />
    </section>
  );
}
