// The form that makes links for the participants of a study, for whoever made the room. Nothing is sent anywhere: it only writes addresses.

import { useId, useState } from "preact/hooks";
import { type Language, languages, t } from "../i18n";
import { CopyLine } from "../lobby/Invite";
import { invitation } from "../lobby/seat";
import { CheckField, Field, SelectField, TextField } from "../parts/Field";
import { HIDEABLE, type Hideable, questionnaire, searchOf } from "./study";
import "./experiment.css";

const SEATS = ["any", "0", "1", "2", "3", "4", "5"] as const;

/** The form, folded away. */
export function StudyLinks({ code }: { code: string }) {
  const words = t().experiment.links;
  const [names, setNames] = useState("");
  const [seat, setSeat] = useState<(typeof SEATS)[number]>("any");
  const [lang, setLang] = useState<Language | "">("");
  const [hide, setHide] = useState<readonly Hideable[]>([]);
  const [times, setTimes] = useState(false);
  const [consent, setConsent] = useState("");
  const [before, setBefore] = useState("");
  const [after, setAfter] = useState("");
  const group = useId();
  const given = names.split("\n").flatMap((name) => name.trim() || []);
  const links = (given.length === 0 ? [""] : given).map((name, index) => ({
    name,
    address:
      invitation(code) +
      searchOf(
        {
          name,
          seat: seat === "any" ? undefined : Number(seat) + index,
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
    <details class="study-links">
      <summary>{words.title}</summary>
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
            options={SEATS.map((value) => ({ value, label: value === "any" ? words.anySeat : value }))}
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
        {links.map(({ name, address }) => (
          <CopyLine key={name} label={name || words.everybody} text={address} />
        ))}
      </div>
    </details>
  );
}
