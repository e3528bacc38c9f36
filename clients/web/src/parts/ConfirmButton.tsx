// A button for an irreversible action: asks for confirmation and shows why the action failed. The
// focus moves to the question, so that it is read out, and back to the button.

import type { ComponentChildren } from "preact";
import { useLayoutEffect, useRef, useState } from "preact/hooks";
import { t } from "../i18n";
import { useAttempt } from "./attempt";
import { Button, type ButtonLook } from "./Button";
import css from "./ConfirmButton.module.css";
import { Notice } from "./Notice";

interface ConfirmButtonProps {
  /** Label of the button. */
  label: string;
  /** Label of the confirmation; `label` by default. */
  confirm?: string;
  /** How prominent the button is at first; quiet by default. */
  look?: ButtonLook;
  /**
   * Whom or what the action is about, as the question names it. If it changes while the question is
   * shown, the action is refused.
   */
  subject?: string;
  /** One that resolves to false may be confirmed again. */
  act: () => Promise<unknown>;
  /** The consequence, shown with the confirmation. */
  children: ComponentChildren;
}

/** The button. */
export function ConfirmButton(props: ConfirmButtonProps) {
  const { label, confirm = label, look = "quiet", subject = "", act, children } = props;
  const [asked, setAsked] = useState(false);
  const askedAbout = useRef(subject);
  const changed = asked && askedAbout.current !== subject;
  const { busy, fault, run, reset } = useAttempt();
  const whole = useRef<HTMLDivElement>(null);
  const before = useRef(asked);
  // Before anybody can use the question: later, the focus would leave what was chosen meanwhile.
  useLayoutEffect(() => {
    if (before.current === asked) return;
    before.current = asked;
    whole.current?.querySelector<HTMLElement>(asked ? '[data-part="question"]' : "button")?.focus();
  }, [asked]);
  const ask = () => {
    askedAbout.current = subject;
    setAsked(true);
  };
  const cancel = () => {
    setAsked(false);
    reset();
  };
  return (
    <div class={css.confirm} ref={whole}>
      {asked ? (
        <>
          <span data-part="question" tabIndex={-1}>
            {changed ? t().common.changedMeanwhile(askedAbout.current, subject) : children}
          </span>
          {!changed && (
            <Button busy={busy} onClick={() => run(act)}>
              {confirm}
            </Button>
          )}
          <Button look="quiet" disabled={busy} onClick={cancel}>
            {t().common.cancel}
          </Button>
        </>
      ) : (
        <Button look={look} onClick={ask}>
          {label}
        </Button>
      )}
      {fault && <Notice kind="fault">{fault}</Notice>}
    </div>
  );
}
