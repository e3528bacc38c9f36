// A short word to the reader in a page: something went wrong, something is good to know, nothing is here yet.

import type { ComponentChildren } from "preact";
import "./notice.css";

interface NoticeProps {
  kind: "fault" | "hint" | "good";
  children: ComponentChildren;
}

const signs = { fault: "!", hint: "i", good: "✓" };

/** A notice; a fault is read out at once. */
export function Notice({ kind, children }: NoticeProps) {
  return (
    <div class={`notice notice-${kind}`} role={kind === "fault" ? "alert" : undefined}>
      <span class="notice-sign" aria-hidden="true">
        {signs[kind]}
      </span>
      <div>{children}</div>
    </div>
  );
}
