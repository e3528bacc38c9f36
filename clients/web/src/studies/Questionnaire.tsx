// A questionnaire of a study. Every item is a native group of radio buttons, a slider, check boxes
// or a text field, so that keyboard and screen reader work as everywhere. No item has a value
// before the participant gives it one. Statements with the same points are a table where there is
// space, and groups one above the other where there is none.

import type { ComponentChildren } from "preact";
import { useEffect, useMemo, useRef, useState } from "preact/hooks";
import { askUntilAnswered } from "../api/asking";
import type {
  StudyLikert,
  StudyNumber,
  StudyShownItem,
  StudyShownQuestionnaire,
  StudySlider,
} from "../gen/chefshat/v1/study_pb";
import { t } from "../i18n";
import { Submit } from "../parts/ActionButton";
import { announce } from "../parts/Announcer";
import { useAttempt } from "../parts/attempt";
import { Notice } from "../parts/Notice";
import { answersOf, type Draft, draftOf, missingItems, shownItems, type Value, withoutHiddenFaults } from "./answers";
import { Formatted, FormattedQuestion, plainText } from "./Formatted";
import type { ItemAnswer, Participating } from "./participating";
import css from "./Questionnaire.module.css";
import { StageTitle } from "./Stage";

interface QuestionnaireProps {
  questionnaire: StudyShownQuestionnaire;
  part: Pick<Participating, "progress" | "answer" | "save">;
}

/** Pause after the last change before it is saved, milliseconds: a text changes with every key. */
const SAVE_AFTER_MS = 500;

/** The form. */
export function Questionnaire({ questionnaire, part }: QuestionnaireProps) {
  const { title, instructions, items } = questionnaire;
  const words = t().studies.questionnaire;
  const [{ step, reachedAtMs, saved }] = useState(part.progress);
  const [draft, setDraft] = useState<Draft>(() => draftOf(saved));
  const [tried, setTried] = useState(false);
  const { busy, fault, run } = useAttempt();
  // Saved late, answers still belong to the step at which they were entered.
  const save = useSaving((answers) => part.save(answers, step));
  const form = useRef<HTMLFormElement>(null);
  const tables = useMemo(() => tablesOf(items), [items]);
  const shown = shownItems(items, draft);
  const missing = tried ? missingItems(shown, draft) : [];

  const enter = (item: number, value: Value) => {
    const entered = { ...draft, [item]: { value, afterMs: performance.now() - reachedAtMs } };
    const next = withoutHiddenFaults(items, entered);
    setDraft(next);
    save(answersOf(shownItems(items, next), next));
  };
  const submit = (event: Event) => {
    event.preventDefault();
    setTried(true);
    const left = missingItems(shown, draft);
    if (left.length > 0) {
      announce(words.missing(left.length));
      form.current?.querySelector<HTMLElement>(`[data-item="${left[0]}"] :is(input, textarea)`)?.focus();
      return;
    }
    run(async () => {
      await part.answer(answersOf(shown, draft));
      return false;
    });
  };
  return (
    <form class={css.form} ref={form} onSubmit={submit} noValidate data-part="questionnaire">
      <StageTitle>{title || words.title}</StageTitle>
      {instructions && <Formatted text={instructions} />}
      {tables.map((table) => (
        <Table key={table[0]?.item} items={table} shown={shown}>
          {(item) => (
            <Item
              key={item.item}
              item={item}
              value={draft[item.item]?.value}
              missing={missing.includes(item.item)}
              onEnter={(value) => enter(item.item, value)}
            />
          )}
        </Table>
      ))}
      {missing.length > 0 && <Notice kind="fault">{words.missing(missing.length)}</Notice>}
      <Submit {...{ busy, fault }}>{words.submit}</Submit>
    </form>
  );
}

/**
 * Saves the answers a moment after they last changed, and at once when the page is hidden; one call at
 * a time. While the server cannot be reached they are sent again, unless they change meanwhile.
 */
function useSaving(send: (answers: ItemAnswer[]) => Promise<void>): (answers: ItemAnswer[]) => void {
  const unsaved = useRef<ItemAnswer[] | undefined>(undefined);
  const timer = useRef<ReturnType<typeof setTimeout> | undefined>(undefined);
  const busy = useRef(false);
  const left = useRef(false);
  const flush = async () => {
    clearTimeout(timer.current);
    for (let next = unsaved.current; next && !busy.current; next = unsaved.current) {
      const answers = next;
      unsaved.current = undefined;
      busy.current = true;
      await askUntilAnswered(
        () => send(answers),
        () => !left.current && unsaved.current === undefined,
      );
      busy.current = false;
    }
  };
  useEffect(() => {
    const hide = () => document.visibilityState === "hidden" && void flush();
    document.addEventListener("visibilitychange", hide);
    return () => {
      left.current = true;
      clearTimeout(timer.current);
      unsaved.current = undefined;
      document.removeEventListener("visibilitychange", hide);
    };
  }, []);
  return (answers) => {
    unsaved.current = answers;
    clearTimeout(timer.current);
    timer.current = setTimeout(() => void flush(), SAVE_AFTER_MS);
  };
}

/** The fewest statements with the same points that are a table. */
const TABLE_ROWS = 3;

/** The items, those together that are a table. */
function tablesOf(items: readonly StudyShownItem[]): StudyShownItem[][] {
  const runs: StudyShownItem[][] = [];
  for (const item of items) {
    const last = runs.at(-1);
    if (last?.[0] && haveSamePoints(last[0], item)) last.push(item);
    else runs.push([item]);
  }
  return runs.flatMap((run) => (run.length < TABLE_ROWS ? run.map((item) => [item]) : [run]));
}

function haveSamePoints({ kind: one }: StudyShownItem, { kind: other }: StudyShownItem): boolean {
  if (one.case !== "likert" || other.case !== "likert") return false;
  return one.value.points === other.value.points && one.value.labels.join("\n") === other.value.labels.join("\n");
}

interface TableProps {
  items: readonly StudyShownItem[];
  /** Those of the questionnaire that are shown now. */
  shown: readonly StudyShownItem[];
  children: (item: StudyShownItem) => ComponentChildren;
}

/**
 * Statements with the same points below their labels; a single item stands for itself. What is a table
 * stays one when items appear or disappear, so that the field that did it keeps the focus.
 */
function Table({ items, shown, children }: TableProps) {
  const rows = items.filter((item) => shown.includes(item));
  const kind = items[0]?.kind;
  if (rows.length === 0) return null;
  if (items.length < TABLE_ROWS || kind?.case !== "likert") return <>{rows.map(children)}</>;
  return (
    <div class={css.table} data-part="item-table">
      <TableHead likert={kind.value} />
      {rows.map(children)}
    </div>
  );
}

/** Whether each point has a label, and not the first and last alone. */
function isAllLabelled(points: number, labels: readonly string[]): boolean {
  return labels.length === points && points > 2;
}

/** The labels once; every item has them for a screen reader. */
function TableHead({ likert: { points, labels } }: { likert: StudyLikert }) {
  const all = isAllLabelled(points, labels);
  return (
    <div class={css.head} aria-hidden="true">
      <div class={all ? css.points : css.labels} style={{ "--points": points }}>
        {labels.map((label, index) => (
          <span key={index}>{label}</span>
        ))}
      </div>
    </div>
  );
}

interface ItemProps {
  item: StudyShownItem;
  value: Value | undefined;
  missing: boolean;
  onEnter: (value: Value) => void;
}

function Item({ item, value, missing, onEnter }: ItemProps) {
  const words = t().studies.questionnaire;
  const { kind } = item;
  const id = `item-${item.item}`;
  const plain = useMemo(() => plainText(item.text), [item.text]);
  const question = item.text
    ? plain
    : kind.case === "semanticDifferential"
      ? `${kind.value.left} – ${kind.value.right}`
      : "";
  return (
    <fieldset
      class={css.item}
      data-part="item"
      data-item={item.item}
      data-missing={missing || undefined}
      aria-describedby={missing ? `${id}-fault` : undefined}
    >
      <legend class={item.text ? css.question : "visually-hidden"}>
        {item.text ? <FormattedQuestion text={item.text} /> : question}
        {item.optional && <span class="soft small"> {words.optional}</span>}
      </legend>
      {kind.case === "likert" && (
        <Points id={id} points={kind.value.points} labels={kind.value.labels} {...{ value, missing, onEnter }} />
      )}
      {kind.case === "semanticDifferential" && (
        <Points
          id={id}
          points={kind.value.points}
          labels={[kind.value.left, kind.value.right]}
          beside
          {...{ value, missing, onEnter }}
        />
      )}
      {kind.case === "slider" && (
        <Slider
          label={question}
          slider={kind.value}
          value={typeof value === "number" ? value : undefined}
          onEnter={onEnter}
        />
      )}
      {kind.case === "choice" && (
        <Choice id={id} options={kind.value.options} multiple={kind.value.multiple} {...{ value, onEnter }} />
      )}
      {kind.case === "freeText" && (
        <FreeText
          label={question}
          max={kind.value.maxCharacters}
          value={typeof value === "string" ? value : ""}
          onEnter={onEnter}
        />
      )}
      {kind.case === "number" && (
        <NumberField
          id={id}
          label={question}
          number={kind.value}
          value={typeof value === "number" ? value : undefined}
          {...{ missing, onEnter }}
        />
      )}
      {missing && (
        <p id={`${id}-fault`} class={css.fault}>
          {Number.isNaN(value) ? words.notThisNumber : words.answerThis}
        </p>
      )}
    </fieldset>
  );
}

interface PointsProps extends Pick<ItemProps, "value" | "missing" | "onEnter"> {
  id: string;
  points: number;
  /** Of the first and last point, or of all. */
  labels: readonly string[];
  /** The labels stand before and after the points. */
  beside?: boolean;
}

/** One of several points. */
function Points({ id, points, labels, beside = false, value, onEnter }: PointsProps) {
  const words = t().studies.questionnaire;
  const all = isAllLabelled(points, labels);
  const labelOf = (point: number) =>
    all ? labels[point - 1] : point === 1 ? labels[0] : point === points ? labels[labels.length - 1] : "";
  return (
    <div class={`${css.scale} ${all ? css.labelled : ""}`} data-beside={beside || undefined}>
      {!all && (
        <span class={css.end} aria-hidden="true">
          {labels[0]}
        </span>
      )}
      <div class={css.points} style={{ "--points": points }}>
        {Array.from({ length: points }, (_, index) => index + 1).map((point) => (
          <label key={point} class={css.point}>
            <input
              type="radio"
              name={id}
              value={point}
              checked={value === point}
              aria-label={words.point(point, points, labelOf(point) ?? "")}
              onChange={() => onEnter(point)}
            />
            <span aria-hidden="true">{all ? labelOf(point) : point}</span>
          </label>
        ))}
      </div>
      {!all && (
        <span class={`${css.end} ${css.last}`} aria-hidden="true">
          {labels[labels.length - 1]}
        </span>
      )}
    </div>
  );
}

interface SliderProps {
  label: string;
  slider: StudySlider;
  value: number | undefined;
  onEnter: (value: number) => void;
}

/** Keys that give a slider the value at which it stands. */
const TAKES = ["Enter", " "];

/** A slider without a handle until it is moved. */
function Slider({ label, slider: { min, max, step, left, right }, value, onEnter }: SliderProps) {
  const words = t().studies.questionnaire;
  // Where the first move with a key starts from.
  const middle = min + Math.round((max - min) / 2 / step) * step;
  const take = (event: { currentTarget: HTMLInputElement }) => onEnter(Number(event.currentTarget.value));
  return (
    <div class={css.slider}>
      <input
        type="range"
        aria-label={label}
        aria-valuetext={value === undefined ? words.unset : words.onScale(value, min, max)}
        min={min}
        max={max}
        step={step}
        value={value ?? middle}
        data-unset={value === undefined || undefined}
        onInput={take}
        onClick={take}
        onKeyDown={(event) => {
          if (!TAKES.includes(event.key)) return;
          event.preventDefault();
          take(event);
        }}
      />
      <div class={css.ends}>
        <span>{left}</span>
        <span class="soft" aria-hidden="true">
          {value === undefined ? words.unset : "✓"}
        </span>
        <span>{right}</span>
      </div>
    </div>
  );
}

interface ChoiceProps extends Pick<ItemProps, "value" | "onEnter"> {
  id: string;
  options: readonly string[];
  multiple: boolean;
}

function Choice({ id, options, multiple, value, onEnter }: ChoiceProps) {
  const chosen: readonly number[] = Array.isArray(value) ? value : [];
  const choose = (index: number) => {
    if (!multiple) return onEnter([index]);
    onEnter(chosen.includes(index) ? chosen.filter((other) => other !== index) : [...chosen, index]);
  };
  return (
    <div class={css.options}>
      {options.map((option, index) => (
        <label key={option} class={css.option}>
          <input
            type={multiple ? "checkbox" : "radio"}
            name={id}
            checked={chosen.includes(index)}
            onChange={() => choose(index)}
          />
          <span>{option}</span>
        </label>
      ))}
    </div>
  );
}

interface NumberFieldProps extends Pick<ItemProps, "missing" | "onEnter"> {
  id: string;
  label: string;
  number: StudyNumber;
  value: number | undefined;
}

/** A number that is typed. What is not one of the numbers stands until it is corrected. */
function NumberField({ id, label, number: { min, max, unit }, value, missing, onEnter }: NumberFieldProps) {
  const words = t().studies.questionnaire;
  const [typed, setTyped] = useState(value === undefined || Number.isNaN(value) ? "" : String(value));
  const type = (text: string) => {
    setTyped(text);
    const number = /^[-−]?\d+$/.test(text.trim()) ? Number(text.trim().replace("−", "-")) : Number.NaN;
    if (text.trim() === "") onEnter("");
    else onEnter(min <= number && number <= max ? number : Number.NaN);
  };
  return (
    <div class={css.number}>
      <input
        class={css.text}
        // A keyboard of digits has no minus on some phones.
        inputMode={min < 0 ? "text" : "numeric"}
        autoComplete="off"
        aria-label={label}
        aria-describedby={`${id}-unit ${id}-range${missing ? ` ${id}-fault` : ""}`}
        aria-invalid={missing || undefined}
        value={typed}
        onInput={(event) => type(event.currentTarget.value)}
      />
      {unit && <span id={`${id}-unit`}>{unit}</span>}
      <span id={`${id}-range`} class="soft small">
        {words.numberWithin(min, max)}
      </span>
    </div>
  );
}

interface FreeTextProps {
  label: string;
  max: number;
  value: string;
  onEnter: (value: string) => void;
}

/** Characters left from which the number is shown. */
const FEW_LEFT = 100;

function FreeText({ label, max, value, onEnter }: FreeTextProps) {
  const words = t().studies.questionnaire;
  const left = max - value.length;
  // The number is read out when typing pauses, not with every letter.
  const [said, setSaid] = useState("");
  useEffect(() => {
    if (left > FEW_LEFT) return;
    const timer = setTimeout(() => setSaid(words.left(left)), 1000);
    return () => clearTimeout(timer);
  }, [left]);
  return (
    <>
      <textarea
        class={css.text}
        aria-label={label}
        rows={4}
        maxLength={max}
        value={value}
        onInput={(event) => onEnter(event.currentTarget.value)}
      />
      {left <= FEW_LEFT && (
        <p class="soft small" aria-hidden="true">
          {words.left(left)}
        </p>
      )}
      <span class="visually-hidden" role="status">
        {said}
      </span>
    </>
  );
}
