// A short message in a page: an error, a hint, or good news.

import type { ComponentChildren } from "preact";
import css from "./Notice.module.css";

interface NoticeProps {
  kind: "fault" | "hint" | "good";
  children: ComponentChildren;
}

const signs = { fault: "!", hint: "i", good: "✓" };

/** A notice; an error is read out at once. */
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
