// A room as one of its players sees it: the seats while it waits, then the table, as long as this
// device holds a seat.

import { useEffect, useRef, useState } from "preact/hooks";
import { CALL_LIMIT_MS, roomApi } from "../api/client";
import { faultOf, wordsOf } from "../api/faults";
import { ParticipantKind } from "../gen/chefshat/v1/room_pb";
import { t } from "../i18n";
import { Again } from "../lobby/Again";
import { Doorway } from "../lobby/Doorway";
import { LeaveButton, LeaveDialog } from "../lobby/Leaving";
import { MoveButton, MoveDialog } from "../lobby/MoveToDevice";
import { RoomInvite } from "../lobby/RoomInvite";
import { decideSeat, giveUpSeat, type HeldSeat, heldSeat, linkToSeat, seatFromLink } from "../lobby/seat";
import { WhichOne } from "../lobby/WhichOne";
import { Button } from "../parts/Button";
import { ErrorPage } from "../parts/ErrorPage";
import { Notice } from "../parts/Notice";
import { Highlights } from "../replay/Highlights";
import type { PageProps } from "../router";
import { isTaken, type SeatState, type TableState, tableFromRoom } from "./model/state";
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
      try {
        const { room } = await roomApi.getRoom({ roomId }, { timeoutMs: CALL_LIMIT_MS });
        if (left || !room) return;
        const table = tableFromRoom(room);
        held = heldSeat(roomId);
        started = held ? startSession(held, table) : undefined;
        setTable(table);
        setSession(started);
        setHeld(held);
      } catch (thrown) {
        const fault = faultOf(thrown);
        if (fault.reason === "ROOM_UNKNOWN") giveUpSeat(roomId);
        if (!left) setFault(wordsOf(fault));
      }
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
  const banner = (
    <>
      <Banner session={session} />
    </>
  );
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
        banner={banner}
        tools={
          !isOver(table) && (
            <>
              {move}
              {leave}
            </>
          )
        }
        onward={
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

function isOver({ phase }: TableState): boolean {
  return phase === "gameOver" || phase === "aborted";
}

/** The state of the connection, if there is something to say. */
function Banner({ session }: { session: Session }) {
  const { attachment, substituted, table } = session.live.value;
  const { link, fault } = session.following.value;
  const words = t().table.link;
  if (attachment.kind === "superseded") {
    return (
      <Notice kind="hint">
        {words.superseded} <Button onClick={session.takeBack}>{words.takeBack}</Button>
      </Notice>
    );
  }
  if (attachment.kind === "refused") {
    const own = (t().faults.byReason as Record<string, string>)[attachment.reason];
    return <Notice kind="fault">{own ?? `${words.refused} ${attachment.message}`}</Notice>;
  }
  if (link.value === "failed") return <Notice kind="fault">{fault.value && wordsOf(fault.value)}</Notice>;
  if (link.value === "lost") return <Notice kind="fault">{words.lost}</Notice>;
  if (substituted && table.phase !== "gameOver") {
    return (
      <Notice kind="hint">
        {words.substituted}{" "}
        <Button look="main" onClick={session.resume}>
          {words.resume}
        </Button>
      </Notice>
    );
  }
  return null;
}
