// Filling in a form that makes something on the server: what was typed, which fields cannot be accepted and why, and sending it. Which
// fields there are is for the form itself.

import { useEffect, useRef, useState } from "preact/hooks";
import { type Fault, faultOf, wordsOf } from "../api/faults";
import { t } from "../i18n";

/** What is wrong with fields, in words, by name. */
export type FieldFaults<Name extends string> = Partial<Record<Name, string>>;

/** What is done with a form. */
export interface FormUse<Form, Name extends string> {
  /** What can be seen to be wrong before it is sent. */
  check(form: Form): FieldFaults<Name>;
  /** Fields of the form by the names that the protocol has for them. */
  fields: Readonly<Record<string, Name>>;
  /** Sends it and goes to what was made. */
  send(form: Form): Promise<void>;
}

/** A form that is being filled in. */
export interface Filling<Form, Name extends string> {
  form: Form;
  faults: FieldFaults<Name>;
  change: (changed: Partial<Form>) => void;
  /** Why it was not accepted; null if nothing says that it is not. */
  refusal: string | null;
  /** It is on its way. */
  busy: boolean;
  /** Whether what is folded away is to be seen: it is when something there may be at fault. */
  unfolded: boolean;
  unfold: (open: boolean) => void;
  submit: (event: Event) => void;
}

/** Begins with the form that `begin` gives. */
export function useFilling<Form extends object, Name extends string>(
  begin: () => Form,
  use: FormUse<Form, Name>,
): Filling<Form, Name> {
  const [form, setForm] = useState(begin);
  const [faults, setFaults] = useState<FieldFaults<Name>>({});
  const [refusal, setRefusal] = useState<string | null>(null);
  const [busy, setBusy] = useState(false);
  const [unfolded, unfold] = useState(false);
  const sent = useRef<HTMLElement | null>(null);
  const [refusals, setRefusals] = useState(0);
  useEffect(() => {
    // The first field at fault, once all of them are marked and unfolded.
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

/** The field of a form that the server refused, and its words for it; null if it is none of the form's own. */
export function refusedField<Name extends string>(
  { metadata, message }: Fault,
  fields: Readonly<Record<string, Name>>,
): { field: Name; words: string } | null {
  const outer = metadata.field ?? "";
  const words = message.startsWith(`${outer}: `) ? message.slice(outer.length + 2) : message;
  // Within the rules and the policy of a tournament the message alone names the field.
  const within = /^(\w+): ([\s\S]+)$/.exec(words);
  const inner = within?.[1] === undefined ? undefined : fields[within[1]];
  if (inner !== undefined) return { field: inner, words: within?.[2] ?? words };
  const field = fields[outer];
  return field === undefined ? null : { field, words };
}
