// The page of an invitation: say a name and take a seat. Who has a seat in the room already goes to it.

import { useEffect, useState } from "preact/hooks";
import { faultOf, inWords } from "../api/faults";
import { usePolled } from "../api/poll";
import type { PageProps } from "../app";
import { AfterStudy } from "../experiment/AfterStudy";
import { useHiding } from "../experiment/hiding";
import { StudyJoin } from "../experiment/StudyJoin";
import { finishedBy, holderOf, languageOf, type Study, studyOf } from "../experiment/study";
import type { Room } from "../gen/chefshat/v1/room_pb";
import { t } from "../i18n";
import { Button } from "../parts/Button";
import { TextField } from "../parts/Field";
import { Notice } from "../parts/Notice";
import { navigate, type Route } from "../router";
import { takePlace } from "../tournaments/place";
import { lookUp } from "./code";
import { JoinForm } from "./JoinForm";
import { rulesInShort } from "./RoomCard";
import { MAX_NAME } from "./room-form";
import { nameOf } from "./rooms";
import { Seats } from "./Seats";
import { canonical, heldSeat, lastName, roomOfCode, takeSeat } from "./seat";
import "./join.css";

/** How often it is asked what has the code, and who sits there, milliseconds. */
const EVERY_MS = 4_000;

/** The page. */
export function Join({ route }: PageProps<"join">) {
  const words = t().lobby.join;
  const code = canonical(route.code);
  const study = studyOf(location.search);
  useHiding(study);
  const held = code === "" ? null : roomOfCode(code);
  const [another, setAnother] = useState(false);
  const before = held === null ? "" : (heldSeat(held)?.name ?? "");
  const holder = another ? "another" : holderOf(study, before);
  const seated = holder === "reader" ? held : null;
  const goOn = (roomId: string) =>
    navigate({ page: "room", roomId }, { replace: true, search: languageOf(location.search) });
  useEffect(() => {
    if (seated) goOn(seated);
  }, [seated]);
  if (seated) return null;
  if (held && holder === "unclear") {
    return (
      <section class="sheet join-page">
        <h1>{t().experiment.join.title}</h1>
        <p>{t().experiment.join.taken(before)}</p>
        <Button look="main" onClick={() => goOn(held)}>
          {t().experiment.join.goOn(before)}
        </Button>
        <Button onClick={() => setAnother(true)}>{t().experiment.join.another}</Button>
      </section>
    );
  }
  const finished = study ? finishedBy(code, study.name) : [];
  if (finished.length > 0) {
    return (
      <section class="sheet join-page">
        <h1>{t().experiment.join.over}</h1>
        {finished.map(({ name, roomId, after }) => (
          <AfterStudy key={name} after={after} blanks={{ name, room: roomId }} named />
        ))}
      </section>
    );
  }
  if (study && code !== "") return <StudyWay study={study} code={code} arrive={goOn} />;
  return (
    <section class="sheet join-page">
      <h1>{words.title}</h1>
      {code === "" ? <JoinForm /> : <WayIn code={code} />}
    </section>
  );
}

/** The way into a study, unless there is nothing at its end: that is to be known before a questionnaire is filled in. */
function StudyWay(props: { study: Study; code: string; arrive: (roomId: string) => void }) {
  const { study, code, arrive } = props;
  const { value: found } = usePolled((signal) => lookUp(code, signal), EVERY_MS, code);
  if (found === null) return <p class="soft">{t().common.loading}</p>;
  if (found.kind === "nothing") {
    return (
      <section class="sheet join-page">
        <h1>{t().experiment.join.title}</h1>
        <Notice kind="fault">{t().experiment.join.gone}</Notice>
      </section>
    );
  }
  const seats = found.kind === "room" ? found.room.seats : [];
  const take = async (name: string) => (await takeSeat(code, name, study.seat)).roomId;
  const isTaken = (name: string) => seats.some((seat) => sameName(nameOf(seat), name));
  return <StudyJoin study={study} what="room" take={take} isTaken={isTaken} arrive={arrive} />;
}

/** What is known of who has the code, and the way in, or why there is none. */
function WayIn({ code }: { code: string }) {
  const words = t().lobby.join;
  const { value: found } = usePolled((signal) => lookUp(code, signal), EVERY_MS, code);
  if (found === null) return <p class="soft">{t().common.loading}</p>;
  if (found.kind === "nothing") {
    return (
      <>
        <p>
          {words.codeIs} <span class="join-code">{code}</span>
        </p>
        <Notice kind="fault">{t().faults.byReason.JOIN_CODE_WRONG}</Notice>
        <JoinForm />
      </>
    );
  }
  const room = found.kind === "room" ? found.room : undefined;
  return (
    <>
      {room && (
        <section class="join-room">
          <h2>{room.name || t().lobby.rooms.unnamed}</h2>
          <p class="soft small">{rulesInShort(room)}</p>
          <Seats room={room} />
        </section>
      )}
      <NameForm code={code} room={room} />
    </>
  );
}

interface NameFormProps {
  code: string;
  /** The room that the code leads to, as far as it is known: for the names that are taken there. */
  room?: Room | undefined;
}

/** Asks for a name and takes a seat with the code. */
export function NameForm({ code, room }: NameFormProps) {
  const words = t().lobby.join;
  const [name, setName] = useState(lastName());
  const [busy, setBusy] = useState(false);
  const [fault, setFault] = useState<string | null>(null);
  const [missing, setMissing] = useState(false);
  const taken = room?.seats.some((seat) => sameName(nameOf(seat), name)) ?? false;
  const join = async (event: Event) => {
    event.preventDefault();
    setMissing(name.trim() === "");
    if (name.trim() === "" || taken) return;
    setBusy(true);
    setFault(null);
    try {
      navigate(await comeIn(code, name));
    } catch (error) {
      setFault(inWords(error));
      setBusy(false);
    }
  };
  return (
    <form class="join-form" onSubmit={join}>
      <p>
        {words.codeIs} <span class="join-code">{code}</span>
      </p>
      <TextField
        label={words.name}
        hint={words.nameHint}
        value={name}
        onText={setName}
        fault={taken ? words.nameTaken(name.trim()) : missing ? words.nameMissing : undefined}
        maxLength={MAX_NAME}
        autoComplete="nickname"
      />
      {fault && <Notice kind="fault">{fault}</Notice>}
      <Button look="main" type="submit" busy={busy}>
        {words.sitDown}
      </Button>
    </form>
  );
}

/** Whether two names look the same to those at the table. */
function sameName(one: string, other: string): boolean {
  return one !== "" && one.trim().toLocaleLowerCase() === other.trim().toLocaleLowerCase();
}

/** Takes a seat in the room with this code, or a place in the tournament that has it; gives the way there. */
async function comeIn(code: string, name: string): Promise<Route> {
  try {
    const { roomId } = await takeSeat(code, name);
    return { page: "room", roomId };
  } catch (thrown) {
    if (faultOf(thrown).reason !== "JOIN_CODE_WRONG") throw thrown;
    return { page: "tournament", tournamentId: await takePlace("", code, name) };
  }
}
