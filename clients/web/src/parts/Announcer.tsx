// What is said to those who listen to the page. One region for all pages: a region that comes and goes with a page is not read
// reliably. Things said in quick succession are read together, in order.

import { signal } from "@preact/signals";

/** How long things said are gathered before they are read, so that one does not cut off the other. */
const GATHER_MS = 150;

const spoken = signal("");
let gathered: string[] = [];
let timer: ReturnType<typeof setTimeout> | undefined;

/** Says something, after what is being said. */
export function announce(text: string): void {
  gathered.push(text);
  if (timer !== undefined) return;
  timer = setTimeout(() => {
    // The same words twice would be no change, and not be read: a no-break space makes one.
    const words = gathered.join(" ");
    spoken.value = words === spoken.value ? `${words}\u00a0` : words;
    gathered = [];
    timer = undefined;
  }, GATHER_MS);
}

/** The region itself; drawn once, by the layout. */
export function Announcer() {
  return (
    <div class="visually-hidden" role="status" aria-live="polite" data-testid="announcer">
      {spoken.value}
    </div>
  );
}
