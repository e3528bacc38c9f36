// A room as one of its players sees it: the seats while it waits, then the table, as long as this
// device holds a seat.

import { useEffect, useRef, useState } from "preact/hooks";
import { wordsOf } from "../api/faults";
import { ParticipantKind } from "../gen/chefshat/v1/room_pb";
import { t } from "../i18n";
import { Again } from "../lobby/Again";
import { Doorway } from "../lobby/Doorway";
import { LeaveButton, LeaveDialog } from "../lobby/Leaving";
import { MoveButton, MoveDialog } from "../lobby/MoveToDevice";
import { RoomInvite } from "../lobby/RoomInvite";
import { decideSeat, giveUpSeat, type HeldSeat, heldSeat, linkToSeat, seatFromLink } from "../lobby/seat";
import { WhichOne } from "../lobby/WhichOne";
import { ErrorPage } from "../parts/ErrorPage";
import { Highlights } from "../replay/Highlights";
import type { PageProps } from "../router";
import { askRoom } from "./asking";
import { isOver, isTaken, type SeatState, type TableState, tableFromRoom } from "./model/state";
import { SeatBanner } from "./SeatBanner";
import { Seated } from "./Seated";
import { type Session, startSession } from "./session";

/** The page. */
export function RoomPage({ route }: PageProps<"room">) {
  const { roomId } = route;
  const [brought, setBrought] = useState(() => seatFromLink(roomId));
  const held = brought && heldSeat(roomId);
  if (!held) return <RoomView roomId={roomId} />;
  const decide = (chosen: HeldSeat | null) => {
    decideSeat(roomId, chosen);
    setBrought(null);
  };
  return <WhichOne {...{ held, brought, decide }} words={t().lobby.moving.which} />;
}

/** The room, once it is known which seat of it this device has. */
function RoomView({ roomId }: { roomId: string }) {
  const [table, setTable] = useState<TableState | undefined>(undefined);
  const [session, setSession] = useState<Session | undefined>(undefined);
  const [held, setHeld] = useState<HeldSeat | null>(null);
  const [fault, setFault] = useState("");
  const ended = useRef<TableState | undefined>(undefined);

  useEffect(() => {
    let left = false;
    let started: Session | undefined;
    let held: HeldSeat | null = null;
    const load = async () => {
      const room = await askRoom(
        roomId,
        () => !left,
        (fault) => {
          if (fault.reason === "ROOM_UNKNOWN") giveUpSeat(roomId);
          if (!left) setFault(wordsOf(fault));
        },
      );
      if (left || !room) return;
      const table = tableFromRoom(room);
      held = heldSeat(roomId);
      started = held ? startSession(held, table) : undefined;
      setFault("");
      setTable(table);
      setSession(started);
      setHeld(held);
    };
    setFault("");
    void load();
    return () => {
      left = true;
      started?.stop();
      // Unless a link has brought another seat since.
      if (ended.current?.roomId === roomId && heldSeat(roomId)?.ticket === held?.ticket) giveUpSeat(roomId);
    };
  }, [roomId]);

  // A finished game stays finished, even while the page replays it from the start.
  const live = session?.live.value.table;
  if (live && isOver(live)) ended.current = live;

  const attachment = session?.live.value.attachment;
  const vacated =
    attachment?.kind === "left" || (attachment?.kind === "refused" && attachment.reason === "TICKET_UNKNOWN");
  useEffect(() => {
    if (!vacated) return;
    // The seat was given up, here or in another tab, or went to others while this page was away:
    // show the room from outside. Delete the stored seat unless another tab has taken a new one
    // since.
    if (session && heldSeat(roomId)?.ticket === held?.ticket) giveUpSeat(roomId);
    session?.stop();
    setSession(undefined);
  }, [vacated]);

  if (fault) return <ErrorPage title={t().table.title} words={fault} />;
  if (!table) return <p class="soft">{t().common.loading}</p>;
  if (session && held) return <Held session={session} held={held} />;
  return <Doorway roomId={roomId} />;
}

/** The table from this device's seat. */
function Held({ session, held }: { session: Session; held: HeldSeat }) {
  const { table, own, attachment } = session.live.value;
  const { roomId } = table;
  const [moving, setMoving] = useState(false);
  const [leaving, setLeaving] = useState(false);
  // Once the other device has the seat, nobody needs to see the link.
  const superseded = attachment.kind === "superseded";
  useEffect(() => {
    if (superseded) setMoving(false);
  }, [superseded]);
  const waiting = table.phase === "waiting";
  const others = table.seats.some((seat) => isTaken(seat) && seat.seat !== own && seat.builtIn === "");
  const move = <MoveButton look={waiting ? "button" : "tool"} onClick={() => setMoving(true)} />;
  const leave = <LeaveButton roomId={roomId} look={waiting ? "button" : "tool"} onClick={() => setLeaving(true)} />;
  return (
    <>
      {/* Outside of waiting room and table, and before them: it stays open, and in its place, when one
          replaces the other. */}
      {leaving && !isOver(table) && (
        <LeaveDialog
          roomId={roomId}
          playing={!waiting}
          others={others}
          policy={table.policy}
          onClose={() => setLeaving(false)}
        />
      )}
      {moving && !isOver(table) && <MoveDialog address={linkToSeat(roomId, held)} onClose={() => setMoving(false)} />}
      <Seated
        acting={session}
        banner={<SeatBanner session={session} />}
        tools={
          !isOver(table) && (
            <>
              {move}
              {leave}
            </>
          )
        }
        nextStep={
          <>
            <Highlights table={table} own={own} />
            <Again roomId={roomId} others={others} />
          </>
        }
        below={
          <>
            <RoomInvite roomId={roomId} forAgents={table.seats.some(isForAgent)} />
            {move}
            {leave}
          </>
        }
      />
    </>
  );
}

/** Whether an agent can still take the seat. */
function isForAgent(seat: SeatState): boolean {
  return !isTaken(seat) && [ParticipantKind.UNSPECIFIED, ParticipantKind.AGENT].includes(seat.reservedFor);
}
