// The state of a form that creates something on the server: its values, its invalid fields and its
// submission. The form itself defines the fields.

import { useLayoutEffect, useRef, useState } from "preact/hooks";
import { type Fault, faultOf, wordsOf } from "../api/faults";
import { t } from "../i18n";

/** Error messages by field. */
export type FieldFaults<Name extends string> = Partial<Record<Name, string>>;

/** What a form does. */
export interface FormUse<Form, Name extends string> {
  /** Errors that can be found before submitting. */
  check(form: Form): FieldFaults<Name>;
  /** The form's fields by their names in the protocol. */
  fields: Readonly<Record<string, Name>>;
  /** Submits the form and navigates to what was created. */
  send(form: Form): Promise<void>;
}

/** The state of a form. */
export interface FormState<Form, Name extends string> {
  form: Form;
  faults: FieldFaults<Name>;
  change: (changed: Partial<Form>) => void;
  /** Why it was refused; null if it was not. */
  refusal: string | null;
  /** The form is being submitted. */
  busy: boolean;
  /** Whether the folded part is open: it opens when a field in it may be invalid. */
  unfolded: boolean;
  unfold: (open: boolean) => void;
  submit: (event: Event) => void;
}

/** A form that starts with the values of `begin`. */
export function useFormState<Form extends object, Name extends string>(
  begin: () => Form,
  use: FormUse<Form, Name>,
): FormState<Form, Name> {
  const [form, setForm] = useState(begin);
  const [faults, setFaults] = useState<FieldFaults<Name>>({});
  const [refusal, setRefusal] = useState<string | null>(null);
  const [busy, setBusy] = useState(false);
  const [unfolded, unfold] = useState(false);
  const sent = useRef<HTMLElement | null>(null);
  const [refusals, setRefusals] = useState(0);
  useLayoutEffect(() => {
    // The first invalid field, once all are marked and unfolded.
    if (refusals > 0) sent.current?.querySelector<HTMLElement>('[aria-invalid="true"]')?.focus();
  }, [refusals]);
  const change = (changed: Partial<Form>) => {
    setForm((before) => ({ ...before, ...changed }));
    setFaults((before) => {
      const left = { ...before };
      for (const field of Object.keys(changed)) delete left[field as Name];
      return left;
    });
  };
  const refuse = (refused: FieldFaults<Name>, words: string) => {
    setFaults(refused);
    setRefusal(words);
    unfold(true);
    setRefusals((before) => before + 1);
  };
  const send = async () => {
    const bad = use.check(form);
    if (Object.keys(bad).length > 0) return refuse(bad, t().lobby.make.lookAgain);
    setBusy(true);
    setRefusal(null);
    try {
      await use.send(form);
    } catch (thrown) {
      setBusy(false);
      const fault = faultOf(thrown);
      const refused = refusedField(fault, use.fields);
      if (refused) refuse({ [refused.field]: refused.words } as FieldFaults<Name>, t().lobby.make.lookAgain);
      else refuse({}, wordsOf(fault));
    }
  };
  const submit = (event: Event) => {
    event.preventDefault();
    sent.current = event.currentTarget instanceof HTMLElement ? event.currentTarget : null;
    void send();
  };
  return { form, faults, change, refusal, busy, unfolded, unfold, submit };
}

/** The field that the server refused and its message; null if it is not a field of this form. */
export function refusedField<Name extends string>(
  { metadata, message }: Fault,
  fields: Readonly<Record<string, Name>>,
): { field: Name; words: string } | null {
  const outer = metadata.field ?? "";
  const words = message.startsWith(`${outer}: `) ? message.slice(outer.length + 2) : message;
  // Within the rules and the policy of a tournament, only the message names the field.
  const within = /^(\w+): ([\s\S]+)$/.exec(words);
  const inner = within?.[1] === undefined ? undefined : fields[within[1]];
  if (inner !== undefined) return { field: inner, words: within?.[2] ?? words };
  const field = fields[outer];
  return field === undefined ? null : { field, words };
}
