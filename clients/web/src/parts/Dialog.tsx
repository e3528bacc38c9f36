// A modal dialog. The browser's <dialog> traps the focus, closes on Escape and restores the focus.

import type { ComponentChildren } from "preact";
import { useEffect, useId, useRef } from "preact/hooks";
import { t } from "../i18n";
import css from "./Dialog.module.css";

interface DialogProps {
  title: string;
  /** Called when the reader closes the dialog; the parent then stops rendering it. */
  onClose: () => void;
  children: ComponentChildren;
}

/** A dialog that is open while it is rendered. */
export function Dialog({ title, onClose, children }: DialogProps) {
  const dialog = useRef<HTMLDialogElement>(null);
  const heading = useId();
  useEffect(() => {
    const opened = dialog.current;
    opened?.showModal();
    return () => opened?.close();
  }, []);
  return (
    <dialog ref={dialog} class={css.dialog} data-part="dialog" aria-labelledby={heading} onClose={onClose}>
      <header class={css.head}>
        <h2 id={heading}>{title}</h2>
        <button type="button" class={css.close} aria-label={t().common.close} onClick={onClose}>
          <span aria-hidden="true">×</span>
        </button>
      </header>
      <div class={css.body}>{children}</div>
    </dialog>
  );
}
