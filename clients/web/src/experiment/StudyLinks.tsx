// The form that writes links for the participants of a study, for the creator of a room or
// tournament. It only composes addresses; OwnRooms.tsx creates separate rooms.

import { useId, useState } from "preact/hooks";
import { CALL_LIMIT_MS, roomApi } from "../api/client";
import { usePolled } from "../api/poll";
import type { Room } from "../gen/chefshat/v1/room_pb";
import { type Language, languages, t } from "../i18n";
import { MAX_NAME } from "../lobby/room-form";
import { hostedRoom, invitation } from "../lobby/seat";
import { CheckField, Field, SelectField, TextField } from "../parts/Field";
import { Notice } from "../parts/Notice";
import { seatNumber } from "../parts/SeatNumber";
import { pathOf } from "../router";
import css from "./Experiment.module.css";
import { LinkList } from "./LinkList";
import { OwnLinks, OwnRooms } from "./OwnRooms";
import { ownRooms } from "./own-rooms";
import { isTooLong, MAX_PARTICIPANTS, participantsIn } from "./participants";
import { freeForPeople, type Place, placed } from "./places";
import { HIDEABLE, type Hideable, questionnaire, searchOf } from "./study";

/** Polling interval of the seats, milliseconds. */
const EVERY_MS = 5_000;

interface StudyLinksProps {
  /** The invitation address that each link extends. */
  address: string;
}

/**
 * The form, folded: for a room, whose seats are requested when it is opened, or for a tournament.
 */
export function StudyLinks({ address, roomId }: StudyLinksProps & { roomId?: string }) {
  const [opened, setOpened] = useState(false);
  return (
    <details class={css.links} data-part="study-links" onToggle={() => setOpened(true)}>
      <summary>{t().experiment.links.title}</summary>
      {opened && (roomId ? <RoomStudyForm roomId={roomId} address={address} /> : <StudyForm address={address} />)}
    </details>
  );
}

function RoomStudyForm({ roomId, address }: StudyLinksProps & { roomId: string }) {
  const ask = async (signal: AbortSignal) =>
    (await roomApi.getRoom({ roomId }, { signal, timeoutMs: CALL_LIMIT_MS })).room ?? null;
  const { value: room, fault } = usePolled(ask, EVERY_MS, roomId);
  if (room) return <StudyForm address={address} room={room} />;
  return fault ? <OwnLinks made={ownRooms(roomId)} /> : <p class="soft">{t().common.loading}</p>;
}

/**
 * The form for a room that is closed to new players, if rooms like it were created: their links
 * outlast it.
 */
export function KeptLinks({ roomId }: { roomId: string }) {
  const hosted = hostedRoom(roomId);
  if (!hosted || ownRooms(roomId).length === 0) return null;
  return (
    <section class={`sheet ${css.keptLinks}`}>
      <StudyLinks roomId={roomId} address={invitation(hosted.joinCode)} />
    </section>
  );
}

/** A tournament has no seats to choose from. */
function StudyForm({ address, room }: StudyLinksProps & { room?: Room }) {
  const words = t().experiment.links;
  const seats = room?.seats;
  const [where, setWhere] = useState<"here" | "own">(() => (room && ownRooms(room.roomId).length > 0 ? "own" : "here"));
  const [names, setNames] = useState("");
  const [seat, setSeat] = useState("any");
  const [lang, setLang] = useState<Language | "">("");
  const [hide, setHide] = useState<readonly Hideable[]>([]);
  const [times, setTimes] = useState(false);
  const [consent, setConsent] = useState("");
  const [before, setBefore] = useState("");
  const [after, setAfter] = useState("");
  const group = useId();
  const typed = participantsIn(names);
  const tooMany = typed.length > MAX_PARTICIPANTS;
  const tooLong = typed.some(isTooLong);
  const given = typed.slice(0, MAX_PARTICIPANTS).filter((name) => !isTooLong(name));
  const wanted = typed.length === 0 ? [""] : given;
  const free = seats && freeForPeople(seats);
  const places: Partial<Place>[] = seats
    ? placed(seats, wanted, seat === "any" ? 0 : Number(seat))
    : wanted.map((name) => ({ name }));
  const searchFor = (name: string, own: number | undefined) => {
    const study = {
      name,
      seat: seat === "any" ? undefined : own,
      times,
      hide,
      consent,
      before: questionnaire(before),
      after: questionnaire(after),
    };
    const search = searchOf(study, lang);
    return search === "?" ? "" : search;
  };
  const links = places.map(({ name = "", seat: own }) => {
    const search = searchFor(name, own);
    const asked = address.includes("?") ? search.replace("?", "&") : search;
    return { name, address: address + asked, roomId: room?.roomId ?? "" };
  });
  const addressFault = (address: string) =>
    address !== "" && questionnaire(address) === "" ? words.notAnAddress : undefined;
  return (
    <div class={css.study}>
      <p class="soft">{seats ? words.text : words.tournamentText}</p>
      <p class="soft">
        {words.hosted} <a href={pathOf({ page: "studies" })}>{t().studies.own.title}</a>
      </p>
      {room && (
        <SelectField
          label={words.where}
          value={where}
          options={[
            { value: "here", label: words.here },
            { value: "own", label: words.own.label },
          ]}
          onPick={setWhere}
        />
      )}
      <Field
        label={words.names}
        hint={where === "own" ? words.own.namesHint : words.namesHint}
        fault={tooLong ? words.tooLong(MAX_NAME) : tooMany ? words.tooManyNames(MAX_PARTICIPANTS) : undefined}
      >
        {(joined) => (
          <textarea {...joined} rows={3} value={names} onInput={(event) => setNames(event.currentTarget.value)} />
        )}
      </Field>
      <div class={css.two}>
        {free && (
          <SelectField
            label={where === "own" ? words.own.seat : words.seat}
            value={seat}
            options={[
              { value: "any", label: words.anySeat },
              ...free.map((number) => ({ value: String(number), label: String(seatNumber(number)) })),
            ]}
            onPick={setSeat}
          />
        )}
        <SelectField
          label={words.language}
          value={lang}
          options={[{ value: "" as const, label: words.browserLanguage }, ...languages]}
          onPick={setLang}
        />
      </div>
      <fieldset class={css.hide} aria-labelledby={group}>
        <legend id={group}>{words.hide}</legend>
        {HIDEABLE.map((part) => (
          <CheckField
            key={part}
            label={words.hidden[part]}
            checked={hide.includes(part)}
            onCheck={(on) => setHide(HIDEABLE.filter((other) => (other === part ? on : hide.includes(other))))}
          />
        ))}
      </fieldset>
      <CheckField label={words.times} hint={words.timesHint} checked={times} onCheck={setTimes} />
      <Field label={words.consent} hint={seats ? words.consentHint : words.consentTournamentHint}>
        {(joined) => (
          <textarea {...joined} rows={4} value={consent} onInput={(event) => setConsent(event.currentTarget.value)} />
        )}
      </Field>
      <TextField
        label={words.before}
        hint={words.beforeHint}
        value={before}
        onText={setBefore}
        fault={addressFault(before)}
      />
      <TextField
        label={words.after}
        hint={seats ? words.afterHint : words.afterTournamentHint}
        value={after}
        onText={setAfter}
        fault={addressFault(after)}
      />
      {room && where === "own" ? (
        <OwnRooms room={room} names={given} searchFor={(name) => searchFor(name, Number(seat))} />
      ) : (
        <>
          <h3>{words.result}</h3>
          {places.length < given.length && <Notice kind="hint">{words.tooMany(places.length)}</Notice>}
          <LinkList links={links} />
        </>
      )}
    </div>
  );
}
