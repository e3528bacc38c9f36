// Writing that is as large as its place allows, for a wall: the size is sought at which everything in it can just be seen.

import type { RefObject } from "preact";
import { useLayoutEffect, useRef } from "preact/hooks";

/** Smallest size that is tried, pixels: what cannot be read from afar is still not cut off. */
const SMALLEST = 8;
/** Largest, as a share of the height of the window: a name is a line of a table, not a headline. */
const LARGEST = 0.075;
/** Halvings of the range between the two: then it is found to less than a pixel. */
const STEPS = 8;

/** A box whose type is as large as its own size allows. What is in it gives its sizes in `em`. */
export function useFit<Box extends HTMLElement>(): RefObject<Box | null> {
  const box = useRef<Box>(null);
  // After each drawing, since anything in it may have changed.
  useLayoutEffect(() => {
    const fitted = box.current;
    if (!fitted) return;
    fitTo(fitted);
    const watch = new ResizeObserver(() => fitTo(fitted));
    watch.observe(fitted);
    // The page's own type may come later than what is written in it.
    void document.fonts.ready.then(() => fitTo(fitted));
    return () => watch.disconnect();
  });
  return box;
}

/** Sets the largest size of type at which nothing of a box is out of sight. */
export function fitTo(box: HTMLElement): void {
  let [small, large] = [SMALLEST, Math.max(SMALLEST, LARGEST * window.innerHeight)];
  for (let step = 0; step < STEPS; step += 1) {
    const tried = (small + large) / 2;
    box.style.fontSize = `${tried}px`;
    if (box.scrollHeight <= box.clientHeight && box.scrollWidth <= box.clientWidth) small = tried;
    else large = tried;
  }
  box.style.fontSize = `${small}px`;
}
