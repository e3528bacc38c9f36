// A room of their own for each participant of a study, like the one at hand: made one after the other, with their links.

import { useEffect, useRef, useState } from "preact/hooks";
import { inWords } from "../api/faults";
import type { Room } from "../gen/chefshat/v1/room_pb";
import { t } from "../i18n";
import { notToBeRepeated } from "../lobby/room-like";
import { invitation } from "../lobby/seat";
import { Button } from "../parts/Button";
import { SelectField } from "../parts/Field";
import { Notice } from "../parts/Notice";
import { LinkList } from "./LinkList";
import { LONGEST_WAIT_MS, makeOwnRooms, type OwnRoom, ownRooms } from "./own-rooms";

interface OwnRoomsProps {
  /** The room that those to be made are like. */
  room: Room;
  names: readonly string[];
  /** A participant's link, from the address that invites to their room. */
  linkTo: (name: string, address: string) => string;
}

/** The rooms and their links. */
export function OwnRooms({ room, names, linkTo }: OwnRoomsProps) {
  const words = t().experiment.links.own;
  const [made, setMade] = useState<readonly OwnRoom[]>(() => ownRooms(room.roomId));
  const [busy, setBusy] = useState(false);
  const [fault, setFault] = useState("");
  const own = room.policy?.waitingTimeMs ?? LONGEST_WAIT_MS;
  const [wait, setWait] = useState(LONGEST_WAIT_MS);
  // Who has gone to another page finds what was made when they come back.
  const here = useRef(true);
  useEffect(() => {
    here.current = true;
    return () => {
      here.current = false;
    };
  }, []);
  const missing = names.filter((name) => !made.some((one) => one.name === name));
  const barred = notToBeRepeated(room);
  const make = async () => {
    setBusy(true);
    setFault("");
    try {
      await makeOwnRooms(room, missing, wait, (rooms) => here.current && setMade(rooms));
    } catch (thrown) {
      if (here.current) setFault(inWords(thrown));
    }
    if (here.current) setBusy(false);
  };
  const waits = [...new Set([LONGEST_WAIT_MS, own])];
  return (
    <>
      <p class="soft">{words.text}</p>
      {barred && <Notice kind="hint">{words.barred[barred]}</Notice>}
      {barred !== "hands" && (
        <>
          <SelectField
            label={words.wait}
            hint={words.waitHint}
            value={String(wait)}
            options={waits.map((ms) => ({ value: String(ms), label: words.time(ms) }))}
            onPick={(picked) => setWait(Number(picked))}
          />
          {names.length === 0 && <p class="soft">{words.namesMissing}</p>}
          {busy && (
            <p role="status">
              {words.making(names.length - missing.length, names.length)}{" "}
              <progress value={names.length - missing.length} max={names.length} />
            </p>
          )}
          {fault && (
            <Notice kind="fault">
              {fault} {made.length > 0 && words.keptMade(made.length, missing.length)}
            </Notice>
          )}
          {missing.length > 0 && (
            <Button look="main" busy={busy} onClick={() => void make()}>
              {words.make(missing.length)}
            </Button>
          )}
        </>
      )}
      {made.length > 0 && (
        <>
          <h3>{t().experiment.links.result}</h3>
          <LinkList
            links={made.map(({ name, roomId, joinCode }) => ({
              name,
              roomId,
              address: linkTo(name, invitation(joinCode)),
            }))}
          />
        </>
      )}
    </>
  );
}
