// A choice among options that each need a line of explanation.

import { useId } from "preact/hooks";
import fieldCss from "../parts/Field.module.css";
import css from "./Choices.module.css";

interface ChoicesProps<Value extends string> {
  label: string;
  value: Value;
  options: readonly { value: Value; name: string; hint: string }[];
  fault?: string | undefined;
  onPick: (value: Value) => void;
}

/** The choice. */
export function Choices<Value extends string>({ label, value, options, fault, onPick }: ChoicesProps<Value>) {
  const id = useId();
  return (
    <fieldset class={css.choices} aria-describedby={fault && `${id}-fault`}>
      <legend>{label}</legend>
      <div class={css.options}>
        {options.map((option) => (
          <label key={option.value} class={css.choice}>
            <input
              type="radio"
              name={id}
              checked={option.value === value}
              // The chosen option is the invalid one, and receives the focus.
              aria-invalid={Boolean(fault) && option.value === value}
              aria-labelledby={`${id}-${option.value}-name`}
              aria-describedby={`${id}-${option.value}`}
              onChange={() => onPick(option.value)}
            />
            <b id={`${id}-${option.value}-name`}>{option.name}</b>
            <span id={`${id}-${option.value}`} class="soft small">
              {option.hint}
            </span>
          </label>
        ))}
      </div>
      {fault && (
        <p id={`${id}-fault`} class={fieldCss.fault} role="alert">
          {fault}
        </p>
      )}
    </fieldset>
  );
}
