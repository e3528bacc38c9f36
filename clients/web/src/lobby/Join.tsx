// The page of an invitation: say a name and take a seat. Who has a seat in the room already goes to it.

import { useEffect, useState } from "preact/hooks";
import { faultOf, wordsOf } from "../api/faults";
import type { PageProps } from "../app";
import { StudyJoin } from "../experiment/StudyJoin";
import { holderOf, languageOf, studyOf } from "../experiment/study";
import { t } from "../i18n";
import { Button } from "../parts/Button";
import { TextField } from "../parts/Field";
import { Notice } from "../parts/Notice";
import { navigate } from "../router";
import { JoinForm } from "./JoinForm";
import { MAX_NAME } from "./room-form";
import { canonical, heldSeat, lastName, roomOfCode, takeSeat } from "./seat";
import "./join.css";

/** The page. */
export function Join({ route }: PageProps<"join">) {
  const words = t().lobby.join;
  const code = canonical(route.code);
  const study = studyOf(location.search);
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
  if (study && code !== "") return <StudyJoin code={code} study={study} />;
  return (
    <section class="sheet join-page">
      <h1>{words.title}</h1>
      {code === "" ? <JoinForm /> : <NameForm code={code} />}
    </section>
  );
}

/** Asks for a name and takes a seat with the code. */
export function NameForm({ code, seat }: { code: string; seat?: number }) {
  const words = t().lobby.join;
  const [name, setName] = useState(lastName());
  const [busy, setBusy] = useState(false);
  const [fault, setFault] = useState<string | null>(null);
  const [missing, setMissing] = useState(false);
  const join = async (event: Event) => {
    event.preventDefault();
    setMissing(name.trim() === "");
    if (name.trim() === "") return;
    setBusy(true);
    setFault(null);
    try {
      const room = await takeSeat(code, name, seat);
      navigate({ page: "room", roomId: room.roomId });
    } catch (error) {
      setFault(wordsOf(faultOf(error)));
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
        fault={missing ? words.nameMissing : undefined}
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
