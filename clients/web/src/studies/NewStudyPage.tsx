// Creating a study: from a file with all settings, or with a form for the common case.

import { useLayoutEffect, useRef, useState } from "preact/hooks";
import { agentsFor, useOffered } from "../api/server";
import type { StudySettings } from "../gen/chefshat/v1/study_pb";
import { language, languages, t } from "../i18n";
import { Submit } from "../parts/ActionButton";
import { useAttempt } from "../parts/attempt";
import { Button } from "../parts/Button";
import { CheckField, Field, SelectField, TextField } from "../parts/Field";
import { Notice } from "../parts/Notice";
import { navigateFromHere } from "../router";
import { ConditionFields, QuestionFields } from "./FormFields";
import css from "./Own.module.css";
import { createStudy } from "./owning";
import { PictureFields } from "./PictureFields";
import { PICTURES } from "./picture-files";
import { hasSettings, settingsFrom } from "./settings-file";
import {
  DATES,
  emptyForm,
  factorsOf,
  faultsOf,
  hasOtherSeats,
  hasTexts,
  NEW_QUESTION,
  newCondition,
  PANEL_URLS,
  type StudyForm,
  settingsOf,
  type Template,
} from "./study-form";

/** The page. */
export function NewStudyPage() {
  return (
    <div class={css.page}>
      <h1>{t().studies.make.title}</h1>
      <FromFile />
      <FromForm />
    </div>
  );
}

function FromFile() {
  const words = t().studies.make;
  const [read, setRead] = useState<StudySettings | null>(null);
  const [problem, setProblem] = useState("");
  const { busy, fault, run, reset } = useAttempt();
  const take = async (chosen: readonly File[]) => {
    setRead(null);
    setProblem("");
    reset();
    const file = chosen.find(({ name }) => hasSettings(name)) ?? chosen[0];
    if (!file) return;
    try {
      const others = chosen.filter((other) => other !== file);
      const contents = others.map(async (other) => [other.name, new Uint8Array(await other.arrayBuffer())] as const);
      setRead(await settingsFrom(await file.text(), file.name, new Map(await Promise.all(contents))));
    } catch (thrown) {
      setProblem(words.unreadable(thrown instanceof Error ? thrown.message : String(thrown)));
    }
  };
  const make = (settings: StudySettings) => {
    const navigate = navigateFromHere();
    run(async () => navigate({ page: "ownStudy", studyId: await createStudy(settings) }));
  };
  return (
    <section class={`sheet ${css.part}`} data-part="study-file">
      <h2>{words.fromFile}</h2>
      <Field label={words.file} hint={words.fromFileText} fault={problem || undefined}>
        {(joined) => (
          <input
            {...joined}
            type="file"
            multiple
            accept={`.json,.toml,.md,.txt,application/json,${PICTURES}`}
            onChange={(event) => void take([...(event.currentTarget.files ?? [])])}
          />
        )}
      </Field>
      {read && <p>{words.read(read.name, read.conditions.length, read.stages.length)}</p>}
      {fault && <Notice kind="fault">{fault}</Notice>}
      {read && (
        <div>
          <Button look="main" busy={busy} onClick={() => make(read)}>
            {words.createFile}
          </Button>
        </div>
      )}
    </section>
  );
}

/** The fields that are typed. */
type TextName = { [Name in keyof StudyForm]: string extends StudyForm[Name] ? Name : never }[keyof StudyForm];
const DEVICES: readonly StudyForm["device"][] = ["any", "fine", "coarse"];

function FromForm() {
  const words = t().studies.make;
  const [form, setForm] = useState<StudyForm>(() => emptyForm(language.peek()));
  // How often the form has been submitted: each time, the first wrong field gets the focus.
  const [tries, setTries] = useState(0);
  const tried = tries > 0;
  const sent = useRef<HTMLFormElement>(null);
  useLayoutEffect(() => {
    sent.current?.querySelector<HTMLElement>('[aria-invalid="true"]')?.focus();
  }, [tries]);
  // Dates of which only a part is entered are empty in the form.
  const [unfinished, setUnfinished] = useState<readonly string[]>([]);
  const { offered } = useOffered();
  const { busy, fault, run } = useAttempt();
  const agents = offered ? agentsFor(offered, false, "") : ["greedy", "random"];
  const faults = tried ? faultsOf(form) : {};
  const change = (changed: Partial<StudyForm>) => setForm((now) => ({ ...now, ...changed }));
  const submit = (event: Event) => {
    event.preventDefault();
    setTries(tries + 1);
    const typed = event.currentTarget as HTMLFormElement;
    const isUnfinished = (name: string) => (typed.elements.namedItem(name) as HTMLInputElement).validity.badInput;
    const unfinished = DATES.filter(isUnfinished);
    setUnfinished(unfinished);
    if (unfinished.length > 0 || Object.keys(faultsOf(form)).length > 0) return;
    const navigate = navigateFromHere();
    run(async () => navigate({ page: "ownStudy", studyId: await createStudy(await settingsOf(form)) }));
  };
  const text = (name: TextName, label: string, hint?: string, shown: { rows?: number; inputMode?: "numeric" } = {}) => (
    <TextField
      label={label}
      hint={hint}
      value={form[name]}
      onText={(typed) => change({ [name]: typed })}
      fault={faults[name]}
      {...shown}
    />
  );
  const number = (name: TextName, label: string, hint?: string) => text(name, label, hint, { inputMode: "numeric" });
  const long = (name: TextName, label: string, hint?: string) => text(name, label, hint, { rows: 6 });
  const check = (name: "within" | "practice" | "traces" | "openLink" | "fill", label: string) => (
    <CheckField label={label} checked={form[name]} onCheck={(checked) => change({ [name]: checked })} />
  );
  const template = (name: Template, label: string) => {
    const inLanguage = hasTexts(name, form.language);
    const known = languages.filter(({ value }) => hasTexts(name, value)).map((one) => one.label);
    return (
      <CheckField
        label={label}
        hint={inLanguage ? undefined : words.templateLanguages(known.join(", "))}
        checked={form[name] && inLanguage}
        disabled={!inLanguage}
        onCheck={(checked) => change({ [name]: checked })}
      />
    );
  };
  return (
    <form ref={sent} class={`sheet ${css.part}`} onSubmit={submit} noValidate data-part="study-form">
      <h2>{words.form}</h2>
      <div class={css.fields}>
        {text("name", words.name, words.nameHint)}
        {text("title", words.studyTitle, words.titleHint)}
        <SelectField
          label={words.language}
          value={form.language}
          options={languages}
          onPick={(chosen) => change({ language: chosen })}
        />
        {number("participants", words.participants)}
        {number("people", words.people, words.peopleHint)}
        {number("games", words.games)}
        {number("shifts", words.shifts)}
      </div>
      <h3>{words.conditions}</h3>
      <p class="soft small">{words.conditionsHint}</p>
      {text("factors", words.factors, words.factorsHint)}
      {form.conditions.map((condition, index) => (
        // The key of a condition is its index, since its name is being typed.
        <ConditionFields
          key={index}
          condition={condition}
          index={index}
          factors={factorsOf(form)}
          agents={agents}
          hasOtherSeats={hasOtherSeats(form)}
          faults={faults}
          onChange={(changed) => change({ conditions: form.conditions.with(index, { ...condition, ...changed }) })}
          onRemove={
            form.conditions.length > 1 ? () => change({ conditions: form.conditions.toSpliced(index, 1) }) : undefined
          }
        />
      ))}
      <div>
        <Button onClick={() => change({ conditions: [...form.conditions, newCondition("", agents[0] ?? "greedy")] })}>
          {words.addCondition}
        </Button>
      </div>
      {Number(form.people) > 1 && check("fill", words.fill)}
      {check("within", words.within)}
      {check("practice", words.practice)}
      {long("seeds", words.seeds, words.seedsHint)}
      {long("consent", words.consent)}
      <div class={css.fields}>{text("version", words.version)}</div>
      <h3>{words.questions}</h3>
      {form.questions.map((question, index) => (
        <QuestionFields
          key={index}
          question={question}
          index={index}
          faults={faults}
          onChange={(changed) => change({ questions: form.questions.with(index, { ...question, ...changed }) })}
          onRemove={() => change({ questions: form.questions.toSpliced(index, 1) })}
        />
      ))}
      <div>
        <Button onClick={() => change({ questions: [...form.questions, NEW_QUESTION] })}>{words.addQuestion}</Button>
      </div>
      {template("godspeed", words.godspeed)}
      {template("nasaTlx", words.nasaTlx)}
      {template("ueqS", words.ueqS)}
      {text("external", words.external, words.externalHint)}
      {long("debriefing", words.debriefing)}
      <PictureFields
        pictures={form.pictures}
        fault={faults.pictures}
        onChange={(changed) => setForm((now) => ({ ...now, pictures: changed(now.pictures) }))}
      />
      {check("traces", words.traces)}
      <div class={css.fields}>
        <SelectField
          label={words.devices}
          value={form.device}
          options={DEVICES.map((value) => ({ value, label: words.device[value] }))}
          onPick={(device) => change({ device })}
        />
        {number("minWidth", words.minWidth, words.minWidthHint)}
      </div>
      <div class={css.fields}>
        {DATES.map((name) => (
          <TextField
            key={name}
            name={name}
            type="datetime-local"
            label={words[name]}
            hint={name === "deletesAt" ? words.deletesAtHint : undefined}
            value={form[name]}
            onText={(typed) => {
              change({ [name]: typed });
              setUnfinished(unfinished.filter((one) => one !== name));
            }}
            fault={unfinished.includes(name) ? words.problems.unfinished : faults[name]}
          />
        ))}
      </div>
      {check("openLink", words.openLink)}
      {form.openLink && (
        <div class={css.fields} data-part="panel">
          {text("idParameter", words.idParameter, words.idParameterHint)}
          {PANEL_URLS.map((name) => text(name, words[name], name === "leftUrl" ? "https://…" : words.panelUrlHint))}
        </div>
      )}
      {(unfinished.length > 0 || Object.keys(faults).length > 0) && (
        <Notice kind="fault">{t().lobby.make.lookAgain}</Notice>
      )}
      <Submit {...{ busy, fault }}>{words.submit}</Submit>
    </form>
  );
}
