// A room in the lists of the lobby: name, state, players, actions.

import { tableTicket } from "../attend/ticket";
import { GameOrigin, ParticipantKind, type Room, RoomState } from "../gen/chefshat/v1/room_pb";
import { t } from "../i18n";
import { ButtonLink } from "../parts/Button";
import { StateChip } from "../parts/StateChip";
import { pathOf } from "../router";
import css from "./RoomCard.module.css";
import { clockOf, isOpen, visibilityWords } from "./rooms";
import { Seats } from "./Seats";
import { heldSeat, hostedRoom } from "./seat";

/** A room in a list. */
export function RoomCard({ room }: { room: Room }) {
  const words = t().lobby.rooms;
  const held = heldSeat(room.roomId);
  return (
    <li class={`${css.roomCard} sheet`} data-part="room-card">
      <header class={css.head}>
        <h3>{room.name || words.unnamed}</h3>
        <RoomStateChip room={room} />
      </header>
      <p class="soft small">
        {rulesInShort(room)}
        {room.spectators > 0 && ` · ${t().table.watch.spectators(room.spectators)}`}
      </p>
      <Seats room={room} mine={held?.seat} />
      <div class={css.actions}>
        <RoomActions room={room} />
      </div>
    </li>
  );
}

function RoomActions({ room }: { room: Room }) {
  const words = t().lobby.rooms;
  const { roomId, gameId } = room;
  const link = (href: string, label: string, main = false) => (
    <ButtonLink href={href} look={main ? "main" : "plain"}>
      {label}
      <span class="visually-hidden"> {room.name || words.unnamed}</span>
    </ButtonLink>
  );
  if (room.state === RoomState.FINISHED) return link(pathOf({ page: "replay", gameId }), words.replay);
  if (heldSeat(roomId)) return link(pathOf({ page: "room", roomId }), words.goBack, true);
  const attend = tableTicket(roomId) !== null && link(pathOf({ page: "attend", roomId }), t().attend.title, true);
  const watch = room.policy?.spectators && link(pathOf({ page: "watch", roomId }), words.watch);
  if (room.state === RoomState.PLAYING) {
    if (!attend && !watch) return <span class="soft small">{words.closed}</span>;
    return (
      <>
        {attend}
        {watch}
      </>
    );
  }
  return (
    <>
      {attend}
      {isOpen(room) && link(pathOf({ page: "room", roomId }), hostedRoom(roomId) ? words.open : words.join, !attend)}
      {watch}
    </>
  );
}

/** The state of a room. */
export function RoomStateChip({ room }: { room: Room }) {
  const words = t().lobby.rooms.states;
  switch (room.state) {
    case RoomState.WAITING:
      return <StateChip state="open" word={words.waiting} />;
    case RoomState.PLAYING:
      return <StateChip state="playing" word={words.playing} />;
    case RoomState.FINISHED:
      return <StateChip state="finished" word={words.finished} />;
    default:
      return <StateChip state="ended" word={words.aborted} />;
  }
}

/** The length of a game and the time per decision, in one line. */
export function rulesInShort(room: Room): string {
  const words = t().lobby.rooms;
  const parts: string[] = [];
  const stop = room.rules?.stop;
  if (stop?.case === "targetPoints") parts.push(words.toPoints(stop.value));
  if (stop?.case === "targetShifts") parts.push(words.shifts(stop.value));
  const kinds = room.seats.flatMap(({ kind, reservedFor, builtInAgent, atTable }) => {
    return builtInAgent === "" && !atTable ? [kind || reservedFor] : [];
  });
  // The most patient: people may also take a seat for everybody.
  const patient = [ParticipantKind.HUMAN, ParticipantKind.UNSPECIFIED, ParticipantKind.MODEL];
  const whose = patient.find((kind) => kinds.includes(kind)) ?? ParticipantKind.AGENT;
  // At a table with real cards only remote participants have a clock.
  const timed = room.seats.some(({ atTable, builtInAgent }) => !atTable && builtInAgent === "");
  if (room.policy && (timed || room.origin !== GameOrigin.PHYSICAL)) {
    parts.push(words.decisionTime(clockOf(room.policy, whose || ParticipantKind.HUMAN).decisionTimeMs));
  }
  if (room.origin === GameOrigin.PHYSICAL) parts.push(t().attend.room.realCards);
  if (room.tournamentId) parts.push(words.ofTournament);
  return [...parts, ...visibilityWords(room.policy)].join(" · ");
}
