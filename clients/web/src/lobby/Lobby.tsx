// The first page: start a game at once, make a room, join with a code; then the rooms of the server and its tournaments.

import type { ComponentChildren } from "preact";
import { useState } from "preact/hooks";
import { wordsOf } from "../api/faults";
import { usePolled } from "../api/poll";
import type { Room } from "../gen/chefshat/v1/room_pb";
import { t } from "../i18n";
import { Button, ButtonLink } from "../parts/Button";
import { Notice } from "../parts/Notice";
import { JoinForm } from "./JoinForm";
import { QuickGame } from "./QuickGame";
import { RoomCard } from "./RoomCard";
import { listFinishedRooms, listOpenRooms, SHOWN_ROOMS } from "./rooms";
import { TournamentStrip } from "./TournamentStrip";
import "./lobby.css";

/** How often the lists are asked for, milliseconds. */
const EVERY_MS = 3000;
/** And the rooms that are over, milliseconds: there are many, and nobody waits for them. */
const OVER_EVERY_MS = 20_000;

/** The page. */
export function Lobby() {
  const words = t().lobby;
  const { value: rooms, fault } = usePolled(listOpenRooms, EVERY_MS, "rooms");
  const { value: over } = usePolled(listFinishedRooms, OVER_EVERY_MS, "over");
  return (
    <div class="lobby">
      <h1 class="only-heard">{words.title}</h1>
      <div class="lobby-start">
        <QuickGame />
        <section class="sheet lobby-tile">
          <h2>{words.join.title}</h2>
          <JoinForm />
        </section>
        <section class="sheet lobby-tile">
          <h2>{words.make.title}</h2>
          <p>{words.make.text}</p>
          <ButtonLink href="/new">{words.make.link}</ButtonLink>
        </section>
      </div>
      {fault && <Notice kind="fault">{wordsOf(fault)}</Notice>}
      <RoomSection title={words.rooms.waiting} rooms={rooms?.waiting}>
        {words.rooms.noneWaiting}
      </RoomSection>
      <RoomSection title={words.rooms.playing} rooms={rooms?.playing}>
        {words.rooms.nonePlaying}
      </RoomSection>
      <TournamentStrip />
      {over && over.length > 0 && <RoomSection title={words.rooms.over} rooms={over} />}
    </div>
  );
}

/** A list of rooms under its title; what is said if there are none; the rest on demand. */
function RoomSection(props: { title: string; rooms: Room[] | undefined; children?: ComponentChildren }) {
  const { title, rooms, children } = props;
  const [all, setAll] = useState(false);
  if (rooms === undefined) return null;
  const shown = all ? rooms : rooms.slice(0, SHOWN_ROOMS);
  return (
    <section class="lobby-section">
      <h2>
        {title} {rooms.length > 0 && <span class="soft number">{rooms.length}</span>}
      </h2>
      {rooms.length === 0 && <p class="soft">{children}</p>}
      <ul class="lobby-rooms">
        {shown.map((room) => (
          <RoomCard key={room.roomId} room={room} />
        ))}
      </ul>
      {shown.length < rooms.length && (
        <Button onClick={() => setAll(true)}>{t().lobby.rooms.showAll(rooms.length)}</Button>
      )}
    </section>
  );
}
