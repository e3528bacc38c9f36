// Form fields: a label, the control, a hint, an error. Ids connect them for screen readers.

import type { ComponentChildren } from "preact";
import { useId } from "preact/hooks";
import css from "./Field.module.css";

interface FieldFrame {
  label: string;
  hint?: string | undefined;
  fault?: string | undefined;
  /** Id of the error message of a group that this field belongs to. */
  faultId?: string | undefined;
}

/** Attributes that connect a control to its hint and error. */
interface Joined {
  id: string;
  "aria-describedby": string | undefined;
  "aria-invalid": boolean;
}

function joinedTo(id: string, { hint, fault, faultId }: Omit<FieldFrame, "label">): Joined {
  const described = [hint && `${id}-hint`, fault && `${id}-fault`, faultId].filter(Boolean).join(" ");
  return { id, "aria-describedby": described || undefined, "aria-invalid": Boolean(fault || faultId) };
}

/** The frame of any control; `children` receives the attributes to put on it. */
export function Field(props: FieldFrame & { children: (joined: Joined) => ComponentChildren }) {
  const id = useId();
  const { label, hint, fault } = props;
  return (
    <div class={css.field} data-part="field">
      <label for={id}>{label}</label>
      {props.children(joinedTo(id, props))}
      <Remarks id={id} hint={hint} fault={fault} />
    </div>
  );
}

/** The hint and the error below a control. */
function Remarks({ id, hint, fault }: { id: string } & Pick<FieldFrame, "hint" | "fault">) {
  return (
    <>
      {hint && (
        <p id={`${id}-hint`} class={css.hint}>
          {hint}
        </p>
      )}
      {fault && (
        <p id={`${id}-fault`} class={css.fault} role="alert">
          {fault}
        </p>
      )}
    </>
  );
}

interface TextProps extends FieldFrame {
  value: string;
  onText: (text: string) => void;
  type?: "text" | "datetime-local";
  /** How many lines are shown; one by default, and then there is only one. */
  rows?: number;
  /** For numbers. A field of the type "number" would say that it is empty where it shows "12px". */
  inputMode?: "numeric";
  name?: string;
  maxLength?: number;
  /** What the browser offers to fill in; nothing by default. */
  autoComplete?: string;
  autoCapitalize?: "characters" | "none" | "words";
  placeholder?: string;
  required?: boolean;
}

/** Text, or a local time as text. */
export function TextField(props: TextProps) {
  const { label, hint, fault, faultId, onText, rows, type = "text", autoComplete = "off", ...rest } = props;
  const onInput = (event: { currentTarget: { value: string } }) => onText(event.currentTarget.value);
  const typed = { ...rest, autoComplete, onInput };
  return (
    <Field label={label} hint={hint} fault={fault} faultId={faultId}>
      {(joined) =>
        rows ? <textarea {...typed} {...joined} rows={rows} /> : <input {...typed} {...joined} type={type as "text"} />
      }
    </Field>
  );
}

interface SelectProps<Value extends string> extends FieldFrame {
  value: Value;
  options: readonly { value: Value; label: string }[];
  onPick: (value: Value) => void;
}

/** A choice of one option. */
export function SelectField<Value extends string>({ label, hint, fault, value, options, onPick }: SelectProps<Value>) {
  return (
    <Field label={label} hint={hint} fault={fault}>
      {(joined) => (
        <select
          {...joined}
          value={value}
          onChange={(event) => {
            const picked = options[event.currentTarget.selectedIndex];
            if (picked) onPick(picked.value);
          }}
        >
          {options.map((option) => (
            <option key={option.value} value={option.value}>
              {option.label}
            </option>
          ))}
        </select>
      )}
    </Field>
  );
}

interface CheckProps extends FieldFrame {
  checked: boolean;
  disabled?: boolean;
  onCheck: (checked: boolean) => void;
}

/** A checkbox. */
export function CheckField({ label, hint, fault, faultId, checked, disabled = false, onCheck }: CheckProps) {
  const id = useId();
  return (
    <div class={`${css.field} ${css.check}`} data-part="field">
      <input
        {...joinedTo(id, { hint, fault, faultId })}
        type="checkbox"
        checked={checked}
        disabled={disabled}
        onChange={(event) => onCheck(event.currentTarget.checked)}
      />
      <label for={id}>{label}</label>
      <Remarks id={id} hint={hint} fault={fault} />
    </div>
  );
}
