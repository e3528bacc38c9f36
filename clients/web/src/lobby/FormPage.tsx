// The frame of a form that creates something on the server: title, name, folded part and submit
// button. The state of the form is in state.ts.

import type { ComponentChildren } from "preact";
import { type Offered, useOffered } from "../api/server";
import { Submit } from "../parts/ActionButton";
import { TextField } from "../parts/Field";
import { Notice } from "../parts/Notice";
import css from "./FormPage.module.css";
import type { FormState } from "./form-state";
import { MAX_NAME } from "./room-form";

/** The page; `children` renders the form once the server's offer is known. */
export function FormPage({ title, children }: { title: string; children: (offered: Offered) => ComponentChildren }) {
  const { offered, fault } = useOffered();
  return (
    <section class={css.page}>
      <h1>{title}</h1>
      {fault && <Notice kind="fault">{fault}</Notice>}
      {offered && children(offered)}
    </section>
  );
}

interface FormFrameProps {
  state: FormState<{ name: string }, "name">;
  words: { name: string; namePlaceholder: string; more: string; submit: string };
  /** Fields below the name. */
  first: ComponentChildren;
  /** Further parts. */
  children: ComponentChildren;
  /** The settings that few people change. */
  folded: ComponentChildren;
}

/** The form. */
export function FormFrame({ state, words, first, children, folded }: FormFrameProps) {
  return (
    <form class={css.form} data-part="new-room-form" onSubmit={state.submit} noValidate>
      <FormPart>
        <TextField
          label={words.name}
          value={state.form.name}
          onText={(name) => state.change({ name })}
          fault={state.faults.name}
          maxLength={MAX_NAME}
          placeholder={words.namePlaceholder}
        />
        {first}
      </FormPart>
      {children}
      <details
        class={`sheet ${css.part}`}
        open={state.unfolded}
        onToggle={(event) => state.unfold(event.currentTarget.open)}
      >
        <summary>
          <h2>{words.more}</h2>
        </summary>
        {folded}
      </details>
      <Submit busy={state.busy} fault={state.refusal}>
        {words.submit}
      </Submit>
    </form>
  );
}

/** A part of the form under a title. */
export function FormPart({ title, children }: { title?: string; children: ComponentChildren }) {
  return (
    <section class={`sheet ${css.part}`}>
      {title && <h2>{title}</h2>}
      {children}
    </section>
  );
}
