// The live region for screen readers. All pages share one, because a region that comes and goes
// with a page is not read reliably. Announcements in quick succession are read together, in order.

import { signal } from "@preact/signals";

/**
 * How long announcements are collected before they are read, milliseconds, so that none cuts off
 * another.
 */
const GATHER_MS = 150;

const spoken = signal("");
let gathered: string[] = [];
let timer: ReturnType<typeof setTimeout> | undefined;

/** Announces a text, after those being read. */
export function announce(text: string): void {
  gathered.push(text);
  if (timer !== undefined) return;
  timer = setTimeout(() => {
    // Repeating the same text would be no change and not be read: a no-break space makes it one.
    const words = gathered.join(" ");
    spoken.value = words === spoken.value ? `${words}\u00a0` : words;
    gathered = [];
    timer = undefined;
  }, GATHER_MS);
}

/** The region; rendered once, by the layout. */
export function Announcer() {
  return (
    <div class="visually-hidden" role="status" aria-live="polite" data-testid="announcer">
      {spoken.value}
    </div>
  );
}
