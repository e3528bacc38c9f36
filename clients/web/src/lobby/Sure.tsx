// A button for what cannot be undone: it asks once more before it does it, and says what went wrong if it could not.

import type { ComponentChildren } from "preact";
import { useState } from "preact/hooks";
import { inWords } from "../api/faults";
import { t } from "../i18n";
import { Button } from "../parts/Button";
import { Notice } from "../parts/Notice";
import "./sure.css";

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
  const [fault, setFault] = useState<string | null>(null);
  const doIt = () => {
    act().catch((thrown: unknown) => setFault(inWords(thrown)));
  };
  return (
    <div class="sure">
      {asked ? (
        <>
          <span>{children}</span>
          <Button onClick={doIt}>{confirm}</Button>
          <Button look="quiet" onClick={() => setAsked(false)}>
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
