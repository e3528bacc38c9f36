// A button for an irreversible action: asks for confirmation and shows why the action failed. The
// focus moves to the question, so that it is read out, and back to the button.

import type { ComponentChildren } from "preact";
import { useEffect, useRef, useState } from "preact/hooks";
import { t } from "../i18n";
import { useAttempt } from "../parts/attempt";
import { Button } from "../parts/Button";
import { Notice } from "../parts/Notice";
import css from "./Sure.module.css";

interface SureProps {
  /** Label of the button. */
  label: string;
  /** Label of the confirmation; `label` by default. */
  confirm?: string;
  act: () => Promise<void>;
  /** The consequence, shown with the confirmation. */
  children: ComponentChildren;
}

/** The button. */
export function Sure({ label, confirm = label, act, children }: SureProps) {
  const [asked, setAsked] = useState(false);
  const { busy, fault, run, reset } = useAttempt();
  const whole = useRef<HTMLDivElement>(null);
  const before = useRef(asked);
  useEffect(() => {
    if (before.current === asked) return;
    before.current = asked;
    whole.current?.querySelector<HTMLElement>(asked ? '[data-part="question"]' : "button")?.focus();
  }, [asked]);
  const cancel = () => {
    setAsked(false);
    reset();
  };
  return (
    <div class={css.sure} ref={whole}>
      {asked ? (
        <>
          <span data-part="question" tabIndex={-1}>
            {children}
          </span>
          <Button busy={busy} onClick={() => run(act)}>
            {confirm}
          </Button>
          <Button look="quiet" disabled={busy} onClick={cancel}>
            {t().common.cancel}
          </Button>
        </>
      ) : (
        <Button look="quiet" onClick={() => setAsked(true)}>
          {label}
        </Button>
      )}
      {fault && <Notice kind="fault">{fault}</Notice>}
    </div>
  );
}
