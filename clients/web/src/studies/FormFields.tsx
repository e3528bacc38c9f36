// Fields of the form for a study: those of a condition and those of a question.

import { t } from "../i18n";
import { Button } from "../parts/Button";
import { CheckField, SelectField, TextField } from "../parts/Field";
import css from "./Own.module.css";
import type { ConditionForm, QuestionForm, StudyFaults } from "./study-form";

/** Most characters of a text for a robot. */
const MAX_BEHAVIOUR = 2000;
/** Most characters of a question. */
const MAX_QUESTION = 500;
const LABELS: readonly ConditionForm["labels"][] = ["players", "kinds", "asTheyAre"];
const TIMES: readonly QuestionForm["when"][] = ["before", "after"];
const KINDS: readonly QuestionForm["kind"][] = ["agree", "choice", "number", "words"];

interface Props<Form> {
  /** Its place in the form, from 0. */
  index: number;
  faults: StudyFaults;
  onChange: (changed: Partial<Form>) => void;
  /** Removes it; unset if it cannot be removed. */
  onRemove?: (() => void) | undefined;
}

/** The fields of a condition. */
export function ConditionFields(
  props: Props<ConditionForm> & {
    condition: ConditionForm;
    factors: readonly string[];
    agents: readonly string[];
    hasOtherSeats: boolean;
  },
) {
  const words = t().studies.make;
  const { condition, index, faults, onChange, onRemove, factors, agents, hasOtherSeats } = props;
  return (
    <fieldset class={css.group} data-part="condition">
      <legend>{words.conditionNumber(index + 1)}</legend>
      <div class={css.fields}>
        <TextField
          label={words.conditionId}
          value={condition.id}
          onText={(id) => onChange({ id })}
          fault={faults[`condition.${index}`]}
        />
        <SelectField
          label={words.opponents}
          value={condition.agent}
          options={agents.map((value) => ({ value, label: value }))}
          onPick={(agent) => onChange({ agent })}
        />
        <SelectField
          label={words.labels}
          value={condition.labels}
          options={LABELS.map((value) => ({ value, label: words.label[value] }))}
          onPick={(labels) => onChange({ labels })}
        />
        {factors.map((factor) => (
          <TextField
            key={factor}
            label={words.level(factor)}
            value={condition.levels[factor] ?? ""}
            onText={(level) => onChange({ levels: { ...condition.levels, [factor]: level } })}
            fault={faults[`level.${index}.${factor}`]}
          />
        ))}
      </div>
      <CheckField label={words.hints} checked={condition.hints} onCheck={(hints) => onChange({ hints })} />
      {hasOtherSeats && (
        <CheckField label={words.robot} checked={condition.robot} onCheck={(robot) => onChange({ robot })} />
      )}
      {hasOtherSeats && condition.robot && (
        <TextField
          label={words.behaviour}
          hint={words.behaviourHint}
          value={condition.behaviour}
          onText={(behaviour) => onChange({ behaviour })}
          maxLength={MAX_BEHAVIOUR}
        />
      )}
      {onRemove && (
        <Remove
          words={words.removeCondition}
          of={condition.id || words.conditionNumber(index + 1)}
          onRemove={onRemove}
        />
      )}
    </fieldset>
  );
}

/** The fields of a question. */
export function QuestionFields(props: Props<QuestionForm> & { question: QuestionForm }) {
  const words = t().studies.make;
  const { question, index, faults, onChange, onRemove } = props;
  return (
    <fieldset class={css.group} data-part="question">
      <legend>{words.questionNumber(index + 1)}</legend>
      <TextField
        label={words.question}
        value={question.text}
        onText={(text) => onChange({ text })}
        fault={faults[`question.${index}`]}
        maxLength={MAX_QUESTION}
      />
      <div class={css.fields}>
        <SelectField
          label={words.kind}
          value={question.kind}
          options={KINDS.map((value) => ({ value, label: words.kinds[value] }))}
          onPick={(kind) => onChange({ kind })}
        />
        <SelectField
          label={words.when}
          value={question.when}
          options={TIMES.map((value) => ({ value, label: words.times[value] }))}
          onPick={(when) => onChange({ when })}
        />
      </div>
      {question.kind === "choice" && (
        <TextField
          label={words.options}
          rows={4}
          value={question.options}
          onText={(options) => onChange({ options })}
          fault={faults[`options.${index}`]}
        />
      )}
      <CheckField label={words.optional} checked={question.optional} onCheck={(optional) => onChange({ optional })} />
      {onRemove && (
        <Remove
          words={words.removeQuestion}
          of={question.text || words.questionNumber(index + 1)}
          onRemove={onRemove}
        />
      )}
    </fieldset>
  );
}

function Remove({ words, of, onRemove }: { words: string; of: string; onRemove: () => void }) {
  const remove = (button: HTMLElement) => {
    const after = button.closest("fieldset")?.nextElementSibling;
    onRemove();
    // After the last ones are removed, nothing has the focus; the button that adds more comes next.
    requestAnimationFrame(() => {
      if (!button.isConnected) after?.querySelector("button")?.focus();
    });
  };
  return (
    <div>
      <Button look="quiet" onClick={(event) => remove(event.currentTarget)}>
        {words}
        <span class="visually-hidden"> {of}</span>
      </Button>
    </div>
  );
}
