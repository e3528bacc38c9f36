// A room as one of its players sees it: the seats while it waits, then the table, for as long as this device holds a seat there.

import { useEffect, useState } from "preact/hooks";
import { CALL_LIMIT_MS, roomApi } from "../api/client";
import { inWords, wordsOf } from "../api/faults";
import type { PageProps } from "../app";
import { t } from "../i18n";
import { Doorway } from "../lobby/Doorway";
import { HostInvite } from "../lobby/Invite";
import { heldSeat } from "../lobby/seat";
import { Button } from "../parts/Button";
import { Notice } from "../parts/Notice";
import { gesture } from "./expressions";
import { useAnnounced } from "./following";
import { type TableState, tableFromRoom } from "./model/state";
import { type Session, startSession } from "./session";
import { TableView } from "./view/TableView";
import { WaitingRoom } from "./view/WaitingRoom";

/** The page. */
export function RoomPage({ route }: PageProps<"room">) {
  const { roomId } = route;
  const [table, setTable] = useState<TableState | undefined>(undefined);
  const [session, setSession] = useState<Session | undefined>(undefined);
  const [fault, setFault] = useState("");

  useEffect(() => {
    let left = false;
    let started: Session | undefined;
    const load = async () => {
      try {
        const { room } = await roomApi.getRoom({ roomId }, { timeoutMs: CALL_LIMIT_MS });
        if (left || !room) return;
        const table = tableFromRoom(room);
        const held = heldSeat(roomId);
        started = held ? startSession(held, table) : undefined;
        setTable(table);
        setSession(started);
      } catch (thrown) {
        if (!left) setFault(inWords(thrown));
      }
    };
    setFault("");
    void load();
    return () => {
      left = true;
      started?.stop();
    };
  }, [roomId]);

  if (fault) return <Notice kind="fault">{fault}</Notice>;
  if (!table) return <p class="soft">{t().common.loading}</p>;
  return session ? <Seated session={session} /> : <Doorway roomId={roomId} />;
}

/** The table from a seat. */
function Seated({ session }: { session: Session }) {
  const { table, own, decision } = session.live.value;
  useAnnounced(table, own, decision);
  const banner = <Banner session={session} />;
  if (table.phase === "waiting") {
    return (
      <>
        <WaitingRoom table={table} own={own} banner={banner} />
        <HostInvite roomId={table.roomId} />
      </>
    );
  }
  return (
    <TableView
      table={table}
      own={own}
      decision={decision}
      sending={session.sending.value !== undefined}
      trouble={session.trouble.value}
      banner={banner}
      caption={table.roomName}
      onAnswer={session.answer}
      onExpress={(label) => session.express(gesture(label))}
    />
  );
}

/** What is to be said about the connection, if anything. */
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
