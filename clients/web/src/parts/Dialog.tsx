// A dialog over the page. The browser's own <dialog> keeps the focus inside, closes with Escape and gives the focus back.

import type { ComponentChildren } from "preact";
import { useEffect, useId, useRef } from "preact/hooks";
import { t } from "../i18n";
import css from "./Dialog.module.css";

interface DialogProps {
  title: string;
  /** Called when the reader closes it; the owner then stops drawing it. */
  onClose: () => void;
  children: ComponentChildren;
}

/** A dialog, open for as long as it is drawn. */
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
