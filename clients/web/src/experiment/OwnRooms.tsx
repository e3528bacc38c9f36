// Creates a separate room for each participant of a study, like the current one, and lists their
// links.

import { useState } from "preact/hooks";
import { inWords } from "../api/faults";
import type { Room } from "../gen/chefshat/v1/room_pb";
import { t } from "../i18n";
import { notToBeRepeated } from "../lobby/room-like";
import { invitation } from "../lobby/seat";
import { Button } from "../parts/Button";
import { SelectField } from "../parts/Field";
import { Notice } from "../parts/Notice";
import { LinkList } from "./LinkList";
import { jobs, LONGEST_WAIT_MS, makeOwnRooms, type OwnRoom, ownRooms } from "./own-rooms";

interface OwnRoomsProps {
  /** The room to copy. */
  room: Room;
  names: readonly string[];
  /** The query of a participant's link, from "?" on. */
  searchFor: (name: string) => string;
}

/** The rooms and their links. */
export function OwnRooms({ room, names, searchFor }: OwnRoomsProps) {
  const words = t().experiment.links.own;
  const own = room.policy?.waitingTimeMs ?? LONGEST_WAIT_MS;
  const [wait, setWait] = useState(LONGEST_WAIT_MS);
  const job = jobs.value.get(room.roomId);
  const made = ownRooms(room.roomId);
  const hasRoom = (name: string) => made.some((one) => one.name === name);
  const missing = names.filter((name) => !hasRoom(name));
  const wanted = job?.participants ?? [];
  const done = wanted.filter(hasRoom).length;
  const barred = notToBeRepeated(room);
  const waits = [...new Set([LONGEST_WAIT_MS, own])];
  return (
    <>
      <p class="soft">{words.text}</p>
      {barred && <Notice kind="hint">{words.barred[barred]}</Notice>}
      {barred !== "hands" && barred !== "real" && (
        <>
          <SelectField
            label={words.wait}
            hint={words.waitHint}
            value={String(wait)}
            options={waits.map((ms) => ({ value: String(ms), label: words.time(ms) }))}
            onPick={(picked) => setWait(Number(picked))}
          />
          {names.length === 0 && <p class="soft">{words.namesMissing}</p>}
          {job?.busy && (
            <p role="status">
              {words.making(done, wanted.length)} <progress value={done} max={wanted.length} />
            </p>
          )}
          {job?.fault !== undefined && (
            <Notice kind="fault">
              {inWords(job.fault)} {made.length > 0 && words.keptMade(made.length, wanted.length - done)}
            </Notice>
          )}
          {(missing.length > 0 || job?.busy) && (
            <Button
              look="main"
              busy={job?.busy ?? false}
              onClick={() => void makeOwnRooms(room, missing, wait, searchFor)}
            >
              {words.make(job?.busy ? wanted.length - done : missing.length)}
            </Button>
          )}
        </>
      )}
      <OwnLinks made={made} />
    </>
  );
}

/** The links of the created rooms, each as it was at the time. */
export function OwnLinks({ made }: { made: readonly OwnRoom[] }) {
  if (made.length === 0) return null;
  return (
    <>
      <h3>{t().experiment.links.result}</h3>
      <LinkList
        links={made.map(({ name, roomId, joinCode, search }) => ({
          name,
          roomId,
          address: invitation(joinCode) + search,
        }))}
      />
    </>
  );
}
