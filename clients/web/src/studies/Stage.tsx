// What the stages of a study have in common: a title that gets the focus when the stage begins.

import type { ComponentChildren } from "preact";
import { useEffect, useRef } from "preact/hooks";

/** Whether a stage was shown before: the first one leaves the focus at the start of the page. */
let anyShown = false;

/** The title of a stage. It gets the focus, so that a screen reader reads on from there. */
export function StageTitle({ children }: { children: ComponentChildren }) {
  const title = useRef<HTMLHeadingElement>(null);
  useEffect(() => {
    if (anyShown) {
      title.current?.focus({ preventScroll: true });
      window.scrollTo(0, 0);
    }
    anyShown = true;
  }, []);
  return (
    <h1 ref={title} tabIndex={-1}>
      {children}
    </h1>
  );
}
