// A short word to the reader in a page: something went wrong, something is good to know, nothing is here yet.

import type { ComponentChildren } from "preact";
import css from "./Notice.module.css";

interface NoticeProps {
  kind: "fault" | "hint" | "good";
  children: ComponentChildren;
}

const signs = { fault: "!", hint: "i", good: "✓" };

/** A notice; a fault is read out at once. */
export function Notice({ kind, children }: NoticeProps) {
  return (
    <div class={`${css.notice} ${css[kind]}`} role={kind === "fault" ? "alert" : undefined}>
      <span class={css.sign} aria-hidden="true">
        {signs[kind]}
      </span>
      <div>{children}</div>
    </div>
  );
}
