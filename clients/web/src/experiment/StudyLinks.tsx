// The form that makes links for the participants of a study, for whoever made the room. Nothing is sent anywhere: it only writes addresses.

import { useId, useState } from "preact/hooks";
import { CALL_LIMIT_MS, roomApi } from "../api/client";
import { usePolled } from "../api/poll";
import { type Language, languages, t } from "../i18n";
import { CopyLine } from "../lobby/Invite";
import { invitation } from "../lobby/seat";
import { CheckField, Field, SelectField, TextField } from "../parts/Field";
import { Notice } from "../parts/Notice";
import { freeForPeople, placed } from "./places";
import { HIDEABLE, type Hideable, questionnaire, searchOf } from "./study";
import "./experiment.css";

/** How often the seats are asked for, milliseconds. */
const EVERY_MS = 5_000;

interface StudyLinksProps {
  roomId: string;
  code: string;
}

/** The form, folded away; the room's seats are asked for once it has been opened. */
export function StudyLinks(props: StudyLinksProps) {
  const [opened, setOpened] = useState(false);
  return (
    <details class="study-links" onToggle={() => setOpened(true)}>
      <summary>{t().experiment.links.title}</summary>
      {opened && <StudyForm {...props} />}
    </details>
  );
}

function StudyForm({ roomId, code }: StudyLinksProps) {
  const words = t().experiment.links;
  const [names, setNames] = useState("");
  const [seat, setSeat] = useState("any");
  const [lang, setLang] = useState<Language | "">("");
  const [hide, setHide] = useState<readonly Hideable[]>([]);
  const [times, setTimes] = useState(false);
  const [consent, setConsent] = useState("");
  const [before, setBefore] = useState("");
  const [after, setAfter] = useState("");
  const group = useId();
  const given = names.split("\n").flatMap((name) => name.trim() || []);
  const ask = async (signal: AbortSignal) =>
    (await roomApi.getRoom({ roomId }, { signal, timeoutMs: CALL_LIMIT_MS })).room?.seats ?? [];
  const seats = usePolled(ask, EVERY_MS, roomId).value ?? [];
  const free = freeForPeople(seats);
  const places = placed(seats, given.length === 0 ? [""] : given, seat === "any" ? 0 : Number(seat));
  const links = places.map(({ name, seat: own }) => ({
    name,
    address:
      invitation(code) +
      searchOf(
        {
          name,
          seat: seat === "any" ? undefined : own,
          times,
          hide,
          consent,
          before: questionnaire(before),
          after: questionnaire(after),
        },
        lang,
      ),
  }));
  const addressFault = (address: string) =>
    address !== "" && questionnaire(address) === "" ? words.notAnAddress : undefined;
  return (
    <div class="study">
      <p class="soft">{words.text}</p>
      <Field label={words.names} hint={words.namesHint}>
        {(joined) => (
          <textarea {...joined} rows={3} value={names} onInput={(event) => setNames(event.currentTarget.value)} />
        )}
      </Field>
      <div class="study-two">
        <SelectField
          label={words.seat}
          value={seat}
          options={[
            { value: "any", label: words.anySeat },
            ...free.map((number) => ({ value: String(number), label: String(number) })),
          ]}
          onPick={setSeat}
        />
        <SelectField
          label={words.language}
          value={lang}
          options={[
            { value: "" as const, label: words.browserLanguage },
            ...Object.entries(languages).map(([value, label]) => ({ value: value as Language, label })),
          ]}
          onPick={setLang}
        />
      </div>
      <fieldset class="study-hide" aria-labelledby={group}>
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
      <Field label={words.consent} hint={words.consentHint}>
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
        hint={words.afterHint}
        value={after}
        onText={setAfter}
        fault={addressFault(after)}
      />
      <h3>{words.result}</h3>
      {places.length < given.length && <Notice kind="hint">{words.tooMany(places.length)}</Notice>}
      {links.map(({ name, address }) => (
        <CopyLine key={name} label={name || words.everybody} text={address} />
      ))}
    </div>
  );
}
