// A button for what cannot be undone: it asks once more before it does it, and says what went wrong if it could not. The focus goes to the
// question, so that it is read out, and back to the button.

import type { ComponentChildren } from "preact";
import { useEffect, useRef, useState } from "preact/hooks";
import { t } from "../i18n";
import { useAttempt } from "../parts/attempt";
import { Button } from "../parts/Button";
import { Notice } from "../parts/Notice";
import css from "./Sure.module.css";

interface SureProps {
  /** What the button says at first. */
  label: string;
  /** What it says when it has asked; the same if not given. */
  confirm?: string;
  act: () => Promise<void>;
  /** What will come of it, said when it asks. */
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
