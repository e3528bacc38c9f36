// The page of an attendant: attaches to the table with this device's ticket, and shows how another
// device gets it.

import { useEffect, useState } from "preact/hooks";
import { wordsOf } from "../api/faults";
import { keepSecret } from "../api/secrets";
import { TableStage } from "../gen/chefshat/v1/table_service_pb";
import { t } from "../i18n";
import { CopyLine, QrCode, ThisMachine } from "../lobby/Invite";
import { RoomInvite } from "../lobby/RoomInvite";
import { isForAgents, isOpen } from "../lobby/rooms";
import { ErrorPage } from "../parts/ErrorPage";
import { useStarted } from "../parts/started";
import type { PageProps } from "../router";
import css from "./Attend.module.css";
import { AttendView } from "./AttendView";
import { type Attending, startAttending } from "./attending";
import { isBeforePlay } from "./entries";
import { attendantLink, keepTableTicket, takeTicket } from "./ticket";

/** The page. */
export function AttendPage({ route }: PageProps<"attend">) {
  const { roomId } = route;
  const [ticket] = useState(() => takeTicket(roomId));
  const attending = useStarted(() => (ticket === null ? undefined : startAttending(ticket)), ticket);
  useEffect(() => {
    // A reload shows the end again; a reader who leaves it is done.
    return () => attending?.state.peek()?.stage === TableStage.OVER && keepTableTicket(roomId, null);
  }, [attending]);
  if (ticket === null) return <ErrorPage title={t().attend.title} words={t().attend.noTicket} />;
  return attending ? <Attended roomId={roomId} ticket={ticket} attending={attending} /> : null;
}

interface AttendedProps {
  roomId: string;
  ticket: string;
  attending: Attending;
}

function Attended({ roomId, ticket, attending }: AttendedProps) {
  const state = attending.state.value;
  const { link, fault } = attending.following;
  const failed = link.value === "failed" ? fault.value : undefined;
  const unknown = failed?.reason === "TICKET_UNKNOWN";
  useEffect(() => {
    if (unknown) keepTableTicket(roomId, null);
  }, [unknown]);
  const room = state?.room;
  useEffect(() => {
    // It shows the record when the page has been left.
    if (room) keepSecret(ticket, room.policy, room.gameId);
  }, [room?.gameId]);
  const trouble = failed ? (unknown ? t().attend.gone : wordsOf(failed)) : "";
  if (failed && !state) return <ErrorPage title={t().attend.title} words={trouble} />;
  if (!state || !room) return <p class="soft">{t().common.loading}</p>;
  const early = isBeforePlay(state) && (state.observation?.shift ?? 1) === 1;
  return (
    <>
      <p class={css.room}>
        {t().attend.heading(room.name)} <span class="soft">· {t().attend.room.realCards}</span>
      </p>
      <AttendView
        state={state}
        report={attending.report}
        trouble={link.value === "lost" ? t().table.link.lost : trouble}
      />
      {isOpen(room) && <RoomInvite roomId={roomId} forAgents={isForAgents(room.seats)} />}
      <details class={`${css.link} sheet`} open={early} data-part="attendant-link">
        <summary>
          <h2>{t().attend.link.title}</h2>
        </summary>
        <AttendantLink address={attendantLink(roomId, ticket)} />
      </details>
    </>
  );
}

/** The address of this view for another device, and its QR code. */
function AttendantLink({ address }: { address: string }) {
  const words = t().attend.link;
  return (
    <div class={css.linkBody}>
      <div class="stack">
        <p>{words.text}</p>
        <CopyLine label={t().lobby.invite.link} text={address} />
      </div>
      <QrCode text={address} label={words.qr} />
      <ThisMachine />
    </div>
  );
}
